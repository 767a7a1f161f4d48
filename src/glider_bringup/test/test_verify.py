# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""What is recorded is what the code does; every bit that is not is named."""

import json
import re
import shutil
import struct
import subprocess
import sys

import numpy as np
import pytest
import yaml
from diagnostic_msgs.msg import DiagnosticArray
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from mcap.reader import make_reader
from mcap.writer import CompressionType
from rclpy.serialization import deserialize_message
from rosbags.typesys import Stores, get_typestore
from typer.testing import CliRunner

import glider_bringup as glider
from glider_base import wiring
from glider_base.ros.wire.codec import to_cdr
from glider_base.ros.wire.topics import TOPICS, recorded_topics
from glider_base.settings import ConfigurationError
from glider_base.signals import TICK_NS
from glider_bringup.cli import app
from glider_bringup.engines.direct import fly
from glider_bringup.engines.flight import mission_of
from glider_bringup.engines.node_parameters import write_parameters
from glider_bringup.engines.recorded import fly_recorded
from glider_bringup.scoring.again import score_again
from glider_mission.blocks import BLOCKS, COLUMNS, ROW
from glider_mission.recording.mcap_reader import Bag
from glider_mission.recording.recorded_inputs import RecordedBlock
from glider_mission.recording.ros.node_settings import read_settings
from glider_mission.recording.ros.recorded_log import RecordedLog
from glider_mission.recording.ros.recorded_run import Recording, Series
from glider_mission.recording.ros.verify import every_block
from glider_mission.recording.ros.verify.check import IDENTICAL
from glider_mission.recording.ros.verify.every_block import place_ticks, report, verify
from glider_mission.recording.ros.verify.free_running import _by_stamp, free_running
from glider_mission.run_folder import make_run_folder
from glider_mission.scenario import load_scenario
from glider_navigation.block import NAVIGATION

PER_TICK = {t.full_name('/glider'): t for t in recorded_topics(['measured_odom']) if t.per_tick}
BLOCK_OF = {
    name: topic.publisher.removesuffix('_node')
    for name, topic in {**PER_TICK, '/glider/path': TOPICS['path']}.items()
}
STORE = get_typestore(Stores.ROS2_JAZZY)


def verified(path, scratch, namespace=None, **options) -> dict:
    """Report on a bag."""
    bag = Bag(path)
    told = read_settings(bag, path, options.get('settings'), scratch)
    recording = Recording(bag, namespace, lambda share: None)
    only = options.get('only', [])
    return report(bag, recording, told, list(verify(recording, told, only, lambda *_: None)))


def results(path, scratch, **options) -> dict[str, dict]:
    """What is said about each block."""
    return {one['block']: one for one in verified(path, scratch, **options)['blocks']}


def different(blocks: dict[str, dict]) -> set[str]:
    return {name for name, one in blocks.items() if one['result'] == 'different'}


@pytest.fixture(scope='module')
def recorded(short_run, read_bag):
    """Messages of the short run, by topic and in order."""
    (file,) = short_run.glob('*.mcap')
    return read_bag(file)


@pytest.fixture(scope='module')
def beginning(recorded):
    """The first forty seconds of them."""
    return [message for message in recorded if message.log_ns < 400 * TICK_NS]


@pytest.fixture
def altered(short_run, write_bag, tmp_path):
    """Function that writes a run folder with other messages in it."""

    def write(messages, **options):
        folder = tmp_path / 'altered'
        shutil.rmtree(folder, ignore_errors=True)
        folder.mkdir()
        for name in ('scenario.yaml', 'vehicle.yaml'):
            shutil.copy(short_run / name, folder)
        (like,) = short_run.glob('*.mcap')
        write_bag(folder / 'bag_0.mcap', like, messages, **options)
        return folder

    return write


def flip(data: bytes, bit: int) -> bytes:
    changed = bytearray(data)
    changed[bit // 8] ^= 1 << bit % 8
    return bytes(changed)


# ---------------------------------------------------------------------- identical


def test_every_message_of_a_run_is_compared_and_identical(short_run, recorded, tmp_path):
    report = verified(short_run, tmp_path)
    assert report['identical']
    assert report['lockstep']
    compared = {}
    for one in report['blocks']:
        assert (one['result'], one['first'], one['notes']) == (IDENTICAL, None, [])
        assert one['ticks'] == 1200
        for name, count in one['compared'].items():
            compared[name] = compared.get(name, 0) + count
    expected = {}
    for message in recorded:
        name = message.topic.removeprefix('/glider/')
        expected[name] = expected.get(name, 0) + 1
    assert compared == expected
    assert expected['/diagnostics'] > 5


@pytest.mark.parametrize('compression', list(CompressionType))
@pytest.mark.parametrize('chunked', [True, False])
def test_bag_by_another_writer_is_identical(altered, beginning, tmp_path, compression, chunked):
    folder = altered(beginning, compression=compression, chunked=chunked)
    assert verified(folder, tmp_path)['identical']


def test_settings_attached_to_the_bag_are_enough(short_run, tmp_path):
    (file,) = short_run.glob('*.mcap')
    alone = tmp_path / 'alone.mcap'
    shutil.copy(file, alone)
    report = verified(alone, tmp_path)
    assert report['identical']
    assert 'attached' in report['settings']


def test_messages_in_any_order_of_the_file_are_identical(altered, beginning, tmp_path):
    """Readers go by log time; at one log time the order of topics says nothing."""
    shuffled = list(beginning)
    np.random.default_rng(7).shuffle(shuffled)
    assert verified(altered([type(beginning[0])(*m) for m in shuffled]), tmp_path)['identical']


def test_split_bag_is_read_as_one(altered, recorded, short_run, write_bag, tmp_path):
    folder = altered(recorded[:4000])
    (like,) = short_run.glob('*.mcap')
    write_bag(folder / 'bag_1.mcap', like, recorded[4000:])
    names = ['bag_0.mcap', 'bag_1.mcap']
    information = {'storage_identifier': 'mcap', 'relative_file_paths': names}
    text = yaml.safe_dump({'rosbag2_bagfile_information': information})
    (folder / 'metadata.yaml').write_text(text)
    assert verified(folder, tmp_path)['identical']
    (folder / 'bag_1.mcap').unlink()
    with pytest.raises(ConfigurationError, match='bag_1.mcap: missing'):
        verified(folder, tmp_path)


@pytest.mark.parametrize('share', [0.3, 0.6, 0.85])
def test_bag_whose_writer_was_killed_is_compared_as_far_as_it_goes(short_run, tmp_path, share):
    (file,) = short_run.glob('*.mcap')
    data = file.read_bytes()
    (tmp_path / 'torn.mcap').write_bytes(data[: int(share * len(data))])
    report = verified(tmp_path / 'torn.mcap', tmp_path)
    assert report['identical']
    assert 'ends early' in report['notes'][0]
    assert 0 < report['blocks'][0]['ticks'] < 1200


@pytest.mark.parametrize('said', [1, 2, 9])
def test_a_run_that_was_broken_off_within_a_tick_is_identical(altered, recorded, tmp_path, said):
    begins = next(i for i, m in enumerate(recorded) if m.log_ns == 300 * TICK_NS)
    report = verified(altered(recorded[: begins + said]), tmp_path)
    assert report['identical'], [one['first'] for one in report['blocks']]
    assert report['blocks'][0]['ticks'] == 301


# ---------------------------------------------------------------------- one bit


def leaves(value, path='') -> dict[str, object]:
    """Every field of a message of the rosbags package, by its path."""
    if hasattr(value, '__dataclass_fields__'):
        found = {}
        for name in value.__dataclass_fields__:
            if name != '__msgtype__':
                found.update(leaves(getattr(value, name), f'{path}.{name}' if path else name))
        return found
    if isinstance(value, list | np.ndarray):
        found = {f'len({path})': len(value)}
        for index, one in enumerate(value):
            found.update(leaves(one, f'{path}[{index}]'))
        return found
    if isinstance(value, float):
        value = struct.pack('<d', value)
    return {path: value}


def fields_that_differ(topic, one: bytes, other: bytes) -> list[str] | None:
    """By an independent decoder, in the order of the message; None if it cannot read them."""
    try:
        both = [leaves(STORE.deserialize_cdr(data, topic.type_name)) for data in (one, other)]
    except Exception:
        return None
    return [path for path in both[0] if both[0][path] != both[1].get(path)]


@given(data=st.data())
@settings(max_examples=30, suppress_health_check=[HealthCheck.function_scoped_fixture])
def test_any_flipped_bit_is_named(altered, beginning, tmp_path, data):
    """Whatever bit of whatever per-tick message: block, topic and tick; the field as well."""
    name = data.draw(st.sampled_from(sorted(PER_TICK)))
    of_topic = [i for i, message in enumerate(beginning) if message.topic == name]
    tick = data.draw(st.sampled_from([0, 1, 398, 399]) | st.integers(0, 399))
    place = of_topic[tick]
    good = beginning[place].data
    bit = data.draw(st.integers(0, 8 * len(good) - 1))
    messages = list(beginning)
    messages[place] = messages[place]._replace(data=flip(good, bit))
    blocks = results(altered(messages), tmp_path)
    first = blocks[BLOCK_OF[name]]['first']
    assert (first['topic'], first['tick']) == (name.removeprefix('/glider/'), tick)
    assert first['computed'] != first['recorded']
    assert blocks[BLOCK_OF[name]]['differing'] == {first['topic']: 1}
    changed = fields_that_differ(PER_TICK[name], good, messages[place].data)
    if bit < 32:  # by the byte order that is in there, every field would be another
        assert first['field'] == 'CDR header'
    elif changed and not changed[0].startswith('len('):
        assert first['field'] == changed[0]


@pytest.mark.parametrize('topic', ['/glider/path', '/diagnostics'])
@pytest.mark.parametrize('share', [0.0, 0.03, 0.2, 0.5, 0.8, 0.999])
def test_flipped_bit_of_an_event_is_named(altered, beginning, tmp_path, topic, share):
    place = [i for i, message in enumerate(beginning) if message.topic == topic][-1]
    messages, good = list(beginning), beginning[place]
    changed = flip(good.data, int(share * 8 * len(good.data)))
    messages[place] = good._replace(data=changed)
    report = verified(altered(messages), tmp_path)
    firsts = [one['first'] for one in report['blocks'] if one['first']]
    assert [(one['topic'], one['tick']) for one in firsts] == [
        (topic.removeprefix('/glider/'), good.log_ns // TICK_NS)
    ]
    assert firsts[0]['field'] != '(message)'


def test_numbers_that_print_alike_are_told_apart(altered, beginning, tmp_path):
    place = next(i for i, m in enumerate(beginning) if m.topic == '/glider/wrench')
    messages = list(beginning)
    nan = struct.pack('<d', float('nan'))
    good = beginning[place].data
    at = PER_TICK['/glider/wrench'].codec.size - 8
    messages[place] = messages[place]._replace(data=good[:at] + nan)
    first = results(altered(messages), tmp_path)['control']['first']
    assert (first['field'], first['recorded']) == ('wrench.torque.z', 'nan')


def test_damage_to_an_input_leads_to_its_source(altered, recorded, tmp_path):
    """Guidance fed with a damaged odom differs too; the report says where that comes from."""
    place = [i for i, m in enumerate(recorded) if m.topic == '/glider/odom'][500]
    messages = list(recorded)
    at = recorded[place].data.index(b'base_link') + 16  # position, high bits of x
    messages[place] = messages[place]._replace(data=flip(recorded[place].data, 8 * at + 50))
    blocks = results(altered(messages), tmp_path)
    assert blocks['navigation']['differing'] == {'odom': 1}
    assert blocks['guidance']['first']['tick'] == 500
    assert any('odom differs at t = 50.0 s' in note for note in blocks['guidance']['notes'])


@pytest.mark.parametrize(
    ('name', 'source', 'readers'),
    [
        ('ground_truth/odom', 'plant', {'current'}),
        ('measured_odom', 'plant', {'navigation'}),
        ('odom', 'navigation', {'guidance', 'control', 'guard'}),
    ],
)
def test_input_that_is_not_finite_ends_what_can_be_computed(
    altered, beginning, tmp_path, name, source, readers
):
    topic = PER_TICK[f'/glider/{name}']
    place = [i for i, m in enumerate(beginning) if m.topic == f'/glider/{name}'][300]
    messages = list(beginning)
    numbers = list(topic.codec.decode(beginning[place].data)[1])
    numbers[2] = float('inf')
    raw = topic.codec.encode(300 * TICK_NS, numbers)
    messages[place] = messages[place]._replace(data=raw)
    blocks = results(altered(messages), tmp_path)
    assert blocks[source]['first']['field'] == 'pose.pose.position.z'
    assert different(blocks) == {source, *readers}
    for reader in readers:
        assert (blocks[reader]['first']['topic'], blocks[reader]['first']['tick']) == (name, 300)
        assert 'not finite' in blocks[reader]['first']['recorded']
        (note,) = blocks[reader]['notes']
        assert f'{name} differs at t = 30.0 s from what {source} computes' in note


def moved(message, offset_ns: int, log_ns: int):
    """The same message with another time in its header, where it begins with one."""
    stamp_ns = message.log_ns + offset_ns
    data = bytearray(message.data)
    struct.pack_into('<iI', data, 4, *divmod(stamp_ns, 10**9))
    return message._replace(data=bytes(data), log_ns=log_ns)


def test_a_recording_in_which_all_stands_twice_is_told_so(altered, beginning, tmp_path):
    report = verified(altered([one for one in beginning for _ in range(2)]), tmp_path)
    assert report['lockstep']
    for block in report['blocks']:
        assert block['first']['computed'].endswith('out of place or there twice')


def test_stamps_that_rot_in_a_topic_are_no_ticks_of_the_others(altered, beginning, tmp_path):
    messages = [
        moved(one, 50 * 10**9, one.log_ns)
        if one.topic == '/glider/battery' and one.log_ns // TICK_NS in (100, 101)
        else one
        for one in beginning
    ]
    assert different(results(altered(messages), tmp_path)) == {'plant', 'guard'}


def test_a_stamp_that_rots_costs_no_other_topic_a_tick(altered, beginning):
    (place, *_) = (i for i, m in enumerate(beginning) if m.topic == '/glider/battery')
    messages = list(beginning)
    messages[place] = moved(messages[place], 10**15, messages[place].log_ns)
    data = glider.open_run(altered(messages)).to_xarray()
    assert data.sizes['time'] == 400
    assert np.flatnonzero(np.isnan(data.battery_voltage)).tolist() == [0]


@pytest.mark.filterwarnings('error')
def test_number_that_rots_to_nan_is_a_difference_and_no_warning(altered, beginning, tmp_path):
    place = [i for i, m in enumerate(beginning) if m.topic == '/glider/battery'][100]
    data = beginning[place].data
    voltage = struct.pack('<f', PER_TICK['/glider/battery'].codec.decode(data)[1][0])
    messages = list(beginning)
    raw = data.replace(voltage, struct.pack('<I', 0x7F800001), 1)  # one that signals
    messages[place] = messages[place]._replace(data=raw)
    first = results(altered(messages), tmp_path)['plant']['first']
    assert (first['tick'], first['field'], first['recorded']) == (100, 'voltage', 'nan')


def test_a_vehicle_whose_clock_is_set_back_is_verified(altered, beginning, tmp_path):
    """As recorded by the time of arrival."""
    start_ns, at_ns, hour_ns = 10**13 + 12_345_678, 200 * TICK_NS, 3600 * 10**9
    messages = [
        moved(one, start_ns - hour_ns * (one.log_ns >= at_ns), start_ns + one.log_ns)
        for one in beginning
    ]
    report = verified(altered(messages), tmp_path)
    assert not report['lockstep']
    for block in report['blocks'][2:5]:
        assert block['ticks'] == 400
        assert set(block['differing']) <= {'path', '/diagnostics'}, block


class Sums(RecordedBlock):
    """Sums what joint_states say, as an integral does, and shows the sum at every fifth step."""

    state = 0.0

    def run(self, stamps_ns, inputs, passed):
        sums = self.state + np.cumsum(inputs['joint_states'][:, 0])
        self.state = float(sums[-1])
        demand = np.outer(np.where(stamps_ns // TICK_NS % 5 == 0, sums, 0.0), np.ones(4))
        return {'demand': demand}, np.zeros((len(demand), len(self.block.flags)), np.int64)


@pytest.mark.parametrize('seed', range(4))
def test_an_input_that_shows_only_some_steps_later_is_found_by_trying(short_run, tmp_path, seed):
    """It is late by up to two ticks, as free-running. The likely one is the wrong one here."""
    draw, bag = np.random.default_rng(seed), Bag(short_run)
    recording = Recording(bag, None, lambda share: None)
    (control,) = (one for one in BLOCKS if one.wired == wiring.CONTROL)
    settings = read_settings(bag, short_run, None, tmp_path).blocks['control']
    newest, series = np.arange(3, 103), recording.series
    series['joint_states'].values[:, 0] = draw.integers(0, 2, len(series['joint_states']))
    heard = np.maximum.accumulate(newest - draw.integers(0, 3, len(newest)))
    block, again = Sums(control, settings), Sums(control, settings)
    joints = {'joint_states': series['joint_states'].values[heard]}
    said, _ = block.run(newest * TICK_NS, joints, None)
    one = series['demand'] = Series(series['demand'].codec)
    one.stamps_ns, one.values = newest * TICK_NS, said['demand']
    one.own, one._count = np.ones(len(newest), bool), len(newest)
    del series['wrench'], series['adaptation']
    recording.events = []
    found = free_running(again, recording, 1.0, lambda share: None)
    assert (found.ticks, found.compared['demand'], found.differing) == (100, 100, {})


def test_a_free_running_bag_may_end_in_the_middle_of_a_step():
    """With a demand whose adaptation came too late; a topic may not go on alone."""
    series = Series(TOPICS['demand'].codec)
    series.stamps_ns = TICK_NS * np.arange(200)
    series._count = 200
    for steps, left in ((199, 0), (150, 50)):
        track, over = _by_stamp(series, series.stamps_ns[:steps])
        assert (track.gap, len(over)) == (steps, left)


def test_what_a_vehicle_need_not_say_is_not_missed_where_it_flies_freely(short_run, tmp_path):
    """To record it would not help: when it was taken for silent is on no record."""
    bag = Bag(short_run)
    recording = Recording(bag, None, lambda share: None)
    del recording.series['health'], recording.series['battery']
    given = read_settings(bag, short_run, None, tmp_path)
    for lockstep, why in ((True, 'health and battery'), (False, 'free-running: which inputs')):
        said = given._replace(lockstep=lockstep)
        (guard,) = verify(recording, said, ['guard'], lambda name, share: None)
        assert (guard.result, why in guard.reason) == ('skipped', True)


def test_after_a_silence_a_step_is_as_long_as_its_own_node_takes_it(
    altered, beginning, tmp_path, monkeypatch
):
    """Up to the `input_max_age_s` that it was given, and not that of another."""
    folder, taken = altered(beginning), {}
    control = {'lockstep': False, 'input_max_age_s': 3.0}
    write_parameters({'control_node': control}, folder / 'parameters.yaml')

    def look(block, recording, max_age_s, progress):
        taken[block.block.wired.name] = max_age_s
        return free_running(block, recording, max_age_s, progress)

    monkeypatch.setattr(every_block, 'free_running', look)
    verified(folder, tmp_path)
    assert taken == {'navigation': 1.0, 'guidance': 1.0, 'control': 3.0}


def test_a_free_running_block_that_had_acted_before_its_record_is_skipped(
    altered, recorded, tmp_path
):
    """As by a recorder that was started again: what the block had told before is latched."""
    later = [m for m in recorded if m.topic == '/diagnostics' or m.log_ns >= 300 * TICK_NS]
    folder = altered(later)
    write_parameters({'control_node': {'lockstep': False}}, folder / 'parameters.yaml')
    for name in ('guidance', 'control'):
        block = results(folder, tmp_path, only=[name])[name]
        assert block['result'] == 'skipped', block['first']
        assert 'is recorded from t = 30.0 s on, not from its first step' in block['reason']


@pytest.mark.parametrize('keep', [False, True])
def test_a_bag_without_events_of_its_nodes_does_not_say_how_it_ended(altered, recorded, keep):
    messages = [one for one in recorded if keep or one.topic != '/diagnostics']
    folder = altered(messages, rename=lambda topic: topic.replace('/glider/', '/alpha/'))
    card = score_again(folder)
    assert (card['ticks'], card['status']) == (1200, 'aborted')
    assert card['reason'] == 'nothing on /diagnostics is of /alpha: nobody knows how it ended'


def test_block_that_raises_is_told_and_the_others_are_compared(short_run, tmp_path, monkeypatch):
    run = RecordedBlock.run

    def raises(block, *inputs):
        if block.block.wired.name == 'control':
            raise ValueError('none of yours')
        return run(block, *inputs)

    monkeypatch.setattr(RecordedBlock, 'run', raises)
    blocks = results(short_run, tmp_path)
    assert different(blocks) == {'control'}
    (note,) = blocks['control']['notes']
    assert re.fullmatch(r'not computed: raises \(.*, line \d+\): ValueError: none of yours', note)


@pytest.mark.parametrize('compression', list(CompressionType))
@pytest.mark.parametrize('share', [0.2, 0.5, 0.9])
def test_bit_that_rots_in_a_chunk_is_named_with_file_and_chunk(
    altered, beginning, tmp_path, compression, share
):
    file = altered(beginning, compression=compression) / 'bag_0.mcap'
    with file.open('rb') as stream:
        chunk = make_reader(stream).get_summary().chunk_indexes[3]
    data = bytearray(file.read_bytes())
    data[chunk.chunk_start_offset + 50 + int(share * (chunk.chunk_length - 50))] ^= 16
    file.write_bytes(data)
    with pytest.raises(ConfigurationError, match=r'bag_0\.mcap: chunk 4 is damaged: '):
        verified(file.parent, tmp_path)


# ---------------------------------------------------------------------- other code

CHANGES = {
    'gain': ('control', {'control.adaptive.pitch.kp': 8.100001}),
    'law': ('control', {'control.law': 'pid'}),
    'filter': ('guidance', {'guidance.filters.pitch_frequency_radps': 0.120001}),
    'current': ('current', {'current.speed_kn': 0.71, 'current.angle_deg': 60.0}),
    'coefficient': ('plant', {'perturb.K_L': 1e-9}),
    'noise': ('plant', {'seed': 12}),
}


@pytest.mark.parametrize('change', CHANGES)
def test_change_is_found_where_the_run_itself_would_have_changed(
    short_run, read_bag, tmp_path, change
):
    """Until the first tick that differs, a run with the change has the same inputs."""
    block, fields = CHANGES[change]
    told = load_scenario(str(short_run / 'scenario.yaml'), fields)
    flown = make_run_folder(told, tmp_path / 'flown')
    fly_recorded(told, flown)
    (one,), (other,) = short_run.glob('*.mcap'), flown.glob('*.mcap')
    outputs = [name for name in PER_TICK if BLOCK_OF[name] == block]
    pairs = [
        (a.log_ns // TICK_NS, a.topic.removeprefix('/glider/'))
        for a, b in zip(
            *([m for m in read_bag(file) if m.topic in outputs] for file in (one, other)),
            strict=True,
        )
        if a.data != b.data
    ]
    blocks = results(short_run, tmp_path, settings=flown / 'scenario.yaml')
    assert block in different(blocks)
    if change != 'noise':
        assert different(blocks) == {block}
    first = blocks[block]['first']
    assert first['tick'] == pairs[0][0]
    assert first['topic'] in [topic for tick, topic in pairs if tick == pairs[0][0]]


def test_edited_scenario_is_refused_in_the_folder_and_tried_as_settings(
    altered, beginning, tmp_path
):
    folder = altered(beginning)
    text = (folder / 'scenario.yaml').read_text()
    assert 'kp: 8.1' in text
    edited = folder / 'scenario.yaml'
    edited.write_text(text.replace('kp: 8.1', 'kp: 8.2'))
    with pytest.raises(ConfigurationError, match='not the one that was flown'):
        verified(folder, tmp_path)
    assert different(results(folder, tmp_path, settings=edited)) == {'control'}


# ---------------------------------------------------------------------- what is not there


def without(recorded, *topics):
    return [message for message in recorded if message.topic not in topics]


def test_blocks_without_their_inputs_are_skipped_and_say_why(altered, recorded, tmp_path):
    names = ('/clock', '/glider/current_velocity', '/glider/wrench', '/diagnostics')
    folder = altered(without(recorded, *names))
    report = verified(folder, tmp_path)
    blocks = {one['block']: one for one in report['blocks']}
    assert report['identical']
    assert {name: one['result'] for name, one in blocks.items()} == {
        'plant': 'skipped',
        'current': 'skipped',
        'navigation': IDENTICAL,
        'guidance': IDENTICAL,
        'control': IDENTICAL,
        'guard': IDENTICAL,
    }
    assert 'current_velocity' in blocks['plant']['reason']
    assert 'wrench is not recorded' in blocks['control']['notes']


@pytest.mark.parametrize('tick', [0, 400, 1150])
def test_lost_input_is_a_difference(altered, recorded, tmp_path, tick):
    place = [i for i, m in enumerate(recorded) if m.topic == '/glider/reference'][tick]
    blocks = results(altered(recorded[:place] + recorded[place + 1 :]), tmp_path)
    first = blocks['guidance']['first']
    assert (first['topic'], first['tick'], first['recorded']) == (
        'reference',
        tick,
        'not recorded',
    )
    assert blocks['control']['result'] == ('different' if tick else 'skipped')
    assert blocks['control']['ticks'] == tick
    assert blocks['plant']['result'] == blocks['current']['result'] == IDENTICAL


def test_message_that_is_there_twice_is_a_difference(altered, recorded, tmp_path):
    place = [i for i, m in enumerate(recorded) if m.topic == '/glider/command'][600]
    blocks = results(altered([*recorded[: place + 1], *recorded[place:]]), tmp_path)
    assert blocks['guard']['first']['topic'] == 'command'
    assert 'twice' in blocks['guard']['first']['computed']


def test_recording_that_begins_late_cannot_be_compared(altered, recorded, tmp_path):
    folder = altered([m for m in recorded if m.log_ns >= 10_000_000_000])
    report = verified(folder, tmp_path)
    assert not report['identical']
    assert {one['result'] for one in report['blocks']} == {'skipped'}
    assert 'nothing could be compared' in report['notes']
    assert all('from t = 10.0 s on' in one['reason'] for one in report['blocks'])


def test_topics_that_were_remapped_are_named_where_nothing_is_compared(
    altered, recorded, tmp_path
):
    folder = altered(recorded, rename=lambda name: name.replace('/glider/odom', '/hw/odom'))
    notes = verified(folder, tmp_path, only=['guidance'])['notes']
    assert any('/hw/odom (nav_msgs/msg/Odometry)' in note for note in notes)
    with pytest.raises(ConfigurationError, match='lacks odom: .* or where topics were remapped'):
        score_again(folder)


def test_half_a_topic_is_a_difference(altered, recorded, tmp_path):
    cut = [m for m in recorded if m.topic != '/glider/wrench' or m.log_ns < 60_000_000_000]
    first = results(altered(cut), tmp_path)['control']['first']
    assert (first['topic'], first['tick']) == ('wrench', 600)
    for name, concerned in (
        ('ground_truth/odom', {'plant', 'current'}),
        ('measured_odom', {'plant', 'navigation'}),
        ('odom', {'navigation', 'guidance', 'control', 'guard'}),
    ):
        cut = [m for m in recorded if m.topic != f'/glider/{name}' or m.log_ns < 60_000_000_000]
        assert different(results(altered(cut), tmp_path)) == concerned


def test_event_that_is_not_recorded_or_made_up_is_a_difference(altered, recorded, tmp_path):
    events = [i for i, m in enumerate(recorded) if m.topic == '/diagnostics']
    place = events[2]
    lost = recorded[:place] + recorded[place + 1 :]
    report = verified(altered(lost), tmp_path)
    firsts = [one['first'] for one in report['blocks'] if one['first']]
    assert [(one['topic'], one['recorded']) for one in firsts] == [
        ('/diagnostics', 'not recorded')
    ]
    report = verified(altered([*recorded, recorded[place]]), tmp_path)
    firsts = [one['first'] for one in report['blocks'] if one['first']]
    assert [(one['topic'], one['recorded']) for one in firsts] == [
        ('/diagnostics', 'not computed')
    ]


def test_what_nodes_repeat_of_themselves_is_no_event(altered, recorded, short_run, tmp_path):
    """`ros2 bag record` keeps it, later than an event that was published after it."""
    repeats = []
    for message in (one for one in recorded if one.topic == '/diagnostics'):
        array = deserialize_message(message.data, DiagnosticArray)
        (status,) = array.status
        told = len(status.values)
        status.values = [pair for pair in status.values if pair.key != 't_s']
        late = message._replace(log_ns=recorded[-1].log_ns, data=to_cdr(array))
        repeats += [late] * (len(status.values) < told)
    assert len(repeats) > 5
    folder = altered([*recorded, *reversed(repeats)])
    assert verified(folder, tmp_path)['identical']
    rows, expected = (
        np.concatenate([block.copy() for block in RecordedLog(Bag(path)).blocks()])
        for path in (folder, short_run)
    )
    np.testing.assert_array_equal(rows, expected)


def test_a_node_that_ended_in_a_tick_need_not_have_told_of_it(altered, recorded, tmp_path):
    """Of a law that returns NaN nothing is published, nor what it would have told of that tick."""
    events = [m for m in recorded if m.topic == '/diagnostics' and b'control_node' in m.data]
    last = max(m.log_ns for m in events)
    silent = {
        '/diagnostics',
        *(name for name in BLOCK_OF if BLOCK_OF[name] in ('control', 'guard')),
    }
    kept = [m for m in recorded if m.log_ns < last or m.log_ns == last and m.topic not in silent]
    assert verified(altered(kept), tmp_path)['identical']
    whole = [m for m in recorded if m.log_ns <= last and m not in events]
    assert not verified(altered(whole), tmp_path)['identical']


def test_stamps_alone_name_the_tick():
    stamps = np.arange(8) * TICK_NS
    for place in range(8):
        wrong = stamps.copy()
        wrong[place] ^= 1 << 33
        assert list(place_ticks(wrong)) == list(range(8))
    assert list(place_ticks(np.delete(stamps, 3))) == [0, 1, 2, 4, 5, 6, 7]


@pytest.mark.parametrize('method', ['known', 'dead_reckoned'])
def test_a_sensor_that_is_not_fitted_shows_the_same_to_every_engine(method):
    """A method that looks at what it does not read, too, flies the same bits by all of them."""
    scenario = load_scenario('current_8deg', {'navigation.method': method})
    state, params = mission_of(scenario)
    log = np.zeros((20, ROW))
    state, _, _ = fly(state, params, log)
    navigation = RecordedBlock(NAVIGATION, scenario.navigation_settings())
    inputs = {name: log[:, COLUMNS[name]] for name in navigation.inputs}
    navigation.run(np.arange(20) * TICK_NS, inputs)
    assert navigation.state.intake == state.navigation.intake


# ---------------------------------------------------------------------- the command


def run(*arguments):
    return CliRunner().invoke(app, ['verify', *map(str, arguments)])


def test_command_says_identical(short_run):
    done = run(short_run, '--json')
    assert done.exit_code == 0, done.output
    assert json.loads(done.stdout)['identical']
    done = run(short_run, '--only', 'control')
    assert done.exit_code == 0
    assert 'control' in done.stdout
    assert 'guidance' not in done.stdout


def test_command_names_a_difference(altered, recorded):
    place = [i for i, m in enumerate(recorded) if m.topic == '/glider/wrench'][77]
    messages = list(recorded)
    messages[place] = messages[place]._replace(data=flip(recorded[place].data, 8 * 40 + 4))
    done = run(altered(messages))
    assert done.exit_code == 1
    assert 'first difference at tick 77 (t = 7.7 s), wrench' in done.stdout


INTERRUPTED = """
import signal, sys
from glider_bringup.cli import app
from glider_mission.recording.recorded_inputs import RecordedBlock


def shoot(compute):
    def run(*arguments):
        signal.setitimer(signal.ITIMER_REAL, 1e-4)
        return compute(*arguments)

    return run


RecordedBlock.run = shoot(RecordedBlock.run)
signal.signal(signal.SIGALRM, lambda *_: signal.raise_signal(signal.SIGINT))
app(['verify', *sys.argv[1:]])
"""


def test_ctrl_c_within_compiled_code_is_answered(short_run):
    done = subprocess.run(
        [sys.executable, '-c', INTERRUPTED, short_run, '--only', 'control'],
        capture_output=True,
        text=True,
        timeout=300,
    )
    assert (done.returncode, done.stdout) == (130, '')
    assert done.stderr.strip().endswith('stopped by SIGINT')


@pytest.mark.parametrize(
    ('name', 'content', 'words'),
    [
        ('nothing', None, 'no such run'),
        ('empty', {}, 'a direct one with --bag'),
        ('text', {'a.mcap': b'not a bag at all'}, 'a.mcap: not an MCAP file'),
        (
            'sqlite',
            {
                'metadata.yaml': b'rosbag2_bagfile_information: '
                b'{storage_identifier: sqlite3, relative_file_paths: [a.db3]}'
            },
            'storage sqlite3',
        ),
        ('garbled', {'metadata.yaml': b'[1, 2'}, 'metadata.yaml: not valid YAML'),
        ('other', {'metadata.yaml': b'a: 1'}, 'metadata.yaml: not metadata of rosbag2'),
    ],
)
def test_what_is_no_bag_is_refused_in_one_message(tmp_path, name, content, words):
    folder = tmp_path / name
    if content is not None:
        folder.mkdir()
        for file, data in content.items():
            (folder / file).write_bytes(data)
    with pytest.raises(ConfigurationError) as error:
        Bag(folder)
    assert words in str(error.value)


def test_bag_of_others_needs_settings_and_a_topic_of_ours(
    short_run, recorded, write_bag, tmp_path
):
    (like,) = short_run.glob('*.mcap')
    file = tmp_path / 'theirs.mcap'
    write_bag(file, like, recorded, attachments=False)
    with pytest.raises(ConfigurationError, match='put one there, or give --settings'):
        verified(file, tmp_path)
    assert verified(file, tmp_path, settings=short_run / 'scenario.yaml')['identical']
    with pytest.raises(ConfigurationError, match=r'allowed: /glider'):
        verified(file, tmp_path, 'other', settings=short_run / 'scenario.yaml')
