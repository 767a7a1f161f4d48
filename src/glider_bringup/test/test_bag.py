# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""A recording opens everywhere, holds exactly what was written, and survives a kill."""

import struct

import numpy as np
import pytest
import yaml
from hypothesis import given
from hypothesis import strategies as st
from mcap.exceptions import EndOfFile
from mcap.reader import NonSeekingReader, make_reader
from mcap.records import Message
from mcap.stream_reader import StreamReader
from mcap_ros2.reader import read_ros2_messages
from nav_msgs.msg import Path as PathMessage
from rclpy.parameter import Parameter
from rosbags.highlevel import AnyReader
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from glider_base.block import Said
from glider_base.ros.lockstep import health
from glider_base.ros.lockstep.process import Stop
from glider_base.ros.wire.codec import to_cdr
from glider_base.ros.wire.topics import TOPICS
from glider_base.settings import ConfigurationError
from glider_base.signals import TICK_NS
from glider_bringup.nodes.recorder_node import RecorderNode
from glider_bringup.scoring.traces import TRACED
from glider_mission.blocks import BLOCK_TICKS, COLUMNS
from glider_mission.disk import DiskError
from glider_mission.recording.mcap_reader import Bag
from glider_mission.recording.mcap_writer import McapWriter
from glider_mission.recording.ros import recorded_log
from glider_mission.recording.ros.recorded_log import SCORED, RecordedLog
from glider_mission.recording.ros.rosbag2 import (
    CHUNK_TICKS,
    BagWriter,
    message_definition,
    type_hash,
)
from glider_mission.recording.tick_sorter import TickSorter

PER_TICK = {topic.name: topic for topic in TOPICS.values() if topic.per_tick}
TICKS = 2 * CHUNK_TICKS + 40


def numbers(topic, ticks: int) -> np.ndarray:
    """A row of recognisable numbers for each tick."""
    fields = topic.codec.fields
    rows = np.arange(ticks)[:, None] + np.arange(len(fields))[None, :] / 16.0
    integers = [field == 'status.status' for field in fields]
    rows[:, integers] = np.floor(rows[:, integers] % 100.0)
    return rows


def write_one_by_one(folder, ticks=TICKS, close=True, attachments=()):
    bag = BagWriter(folder, 'run', attachments=attachments)
    for tick in range(ticks):
        for name, topic in PER_TICK.items():
            row = numbers(topic, ticks)[tick]
            bag.write(name, tick * TICK_NS, topic.codec.encode(tick * TICK_NS, row))
        bag.end_tick(tick * TICK_NS)
    if close:
        bag.close()
    return bag


def write_at_once(folder, ticks=TICKS):
    bag = BagWriter(folder, 'run')
    stamps = np.arange(ticks) * TICK_NS
    bag.write_ticks(
        stamps,
        {
            name: topic.codec.encode_many(stamps, numbers(topic, ticks))
            for name, topic in PER_TICK.items()
        },
    )
    bag.close()


@pytest.fixture(scope='module')
def folder(tmp_path_factory):
    folder = tmp_path_factory.mktemp('bag')
    scenario = folder / 'scenario.yaml'
    scenario.write_text('seed: 7\n')
    write_one_by_one(folder, attachments=[scenario])
    return folder


@pytest.mark.parametrize('store', [None, Stores.ROS2_JAZZY])
def test_rosbags_reads_every_message(folder, store):
    typestore = get_typestore(store) if store else None
    seen = {name: [] for name in PER_TICK}
    with AnyReader([folder], default_typestore=typestore) as reader:
        stamps = []
        for connection, stamp_ns, raw in reader.messages():
            reader.deserialize(raw, connection.msgtype)
            seen[connection.topic.removeprefix('/glider/')].append(stamp_ns)
            stamps.append(stamp_ns)
    assert stamps == sorted(stamps)
    assert all(seen[name] == [tick * TICK_NS for tick in range(TICKS)] for name in PER_TICK)


def test_mcap_ros2_reads_the_numbers_that_were_written(folder):
    expected = numbers(PER_TICK['odom'], TICKS)
    tick = 0
    for message in read_ros2_messages(str(folder / 'run_0.mcap'), topics=['/glider/odom']):
        pose = message.ros_msg.pose.pose
        assert message.log_time_ns == message.publish_time_ns == tick * TICK_NS
        assert pose.position.z == expected[tick, 2]
        assert pose.orientation.w == expected[tick, 3]
        assert message.ros_msg.twist.twist.angular.z == expected[tick, 12]
        tick += 1
    assert tick == TICKS


def test_checksums_summary_and_attachments(folder):
    with (folder / 'run_0.mcap').open('rb') as file:
        reader = make_reader(file, validate_crcs=True)
        assert reader.get_header().profile == 'ros2'
        statistics = reader.get_summary().statistics
        assert statistics.message_count == len(list(reader.iter_messages()))
        assert statistics.message_count == TICKS * len(PER_TICK)
        attachments = list(reader.iter_attachments())
        assert [a.name for a in attachments] == ['scenario.yaml']
        assert attachments[0].data == b'seed: 7\n'
        assert [m.name for m in reader.iter_metadata()] == ['rosbag2']
    with (folder / 'run_0.mcap').open('rb') as file:
        reader = NonSeekingReader(file, validate_crcs=True)
        assert len(list(reader.iter_messages())) == statistics.message_count


def test_recording_is_never_written_over_another(tmp_path):
    """Started once more with the parameters of a run, a recorder must not destroy it."""
    write_one_by_one(tmp_path, ticks=3)
    before = {file.name: file.read_bytes() for file in tmp_path.iterdir()}
    assert set(before) == {'run_0.mcap', 'metadata.yaml'}
    for name, exists in (('run', 'run_0.mcap'), ('other', 'metadata.yaml')):
        with pytest.raises(FileExistsError, match='never written over') as error:
            BagWriter(tmp_path, name)
        assert error.value.filename == str(tmp_path / exists)
    assert {file.name: file.read_bytes() for file in tmp_path.iterdir()} == before


def test_attachment_that_is_not_there_leaves_no_file_in_the_way(tmp_path):
    with pytest.raises(FileNotFoundError):
        BagWriter(tmp_path, 'run', attachments=[tmp_path / 'nix.yaml'])
    BagWriter(tmp_path, 'run').close()


def test_recorder_with_a_misspelt_parameter_leaves_no_file_in_the_way(context, tmp_path):
    given = {'folder': str(tmp_path), 'nmae': 'mine'}
    overrides = [Parameter(name, value=value) for name, value in given.items()]
    with pytest.raises(ConfigurationError, match='nmae: unknown'):
        RecorderNode(context=context, parameter_overrides=overrides)
    assert list(tmp_path.iterdir()) == []


def test_recorder_that_begins_on_a_full_disk_leaves_no_file_in_the_way(
    context, tmp_path, monkeypatch
):
    def fail(_):
        raise DiskError('the disk is full')

    monkeypatch.setattr(McapWriter, 'flush', fail)
    overrides = [Parameter('folder', value=str(tmp_path))]
    with pytest.raises(Stop, match='the disk is full') as stop:
        RecorderNode(context=context, parameter_overrides=overrides)
    assert stop.value.code == 1
    assert list(tmp_path.iterdir()) == []


def test_metadata_has_the_shape_of_jazzy(folder):
    information = yaml.safe_load((folder / 'metadata.yaml').read_text())
    assert list(information) == ['rosbag2_bagfile_information']
    information = information['rosbag2_bagfile_information']
    assert list(information) == [
        'version',
        'storage_identifier',
        'duration',
        'starting_time',
        'message_count',
        'topics_with_message_count',
        'compression_format',
        'compression_mode',
        'relative_file_paths',
        'files',
        'custom_data',
        'ros_distro',
    ]
    assert information['version'] == 9
    assert information['duration'] == {'nanoseconds': (TICKS - 1) * TICK_NS}
    assert information['message_count'] == TICKS * len(PER_TICK)
    assert information['relative_file_paths'] == ['run_0.mcap']
    (odom,) = (
        topic
        for topic in information['topics_with_message_count']
        if topic['topic_metadata']['name'] == '/glider/odom'
    )
    assert odom['message_count'] == TICKS
    assert odom['topic_metadata']['type_description_hash'].startswith('RIHS01_')
    qos = odom['topic_metadata']['offered_qos_profiles'][0]
    assert (qos['history'], qos['reliability']) == ('keep_last', 'reliable')
    assert (qos['durability'], qos['depth']) == ('volatile', 1024)
    assert qos['deadline'] == {'sec': 9223372036, 'nsec': 854775807}


def test_channels_say_what_rosbag2_says(folder):
    with (folder / 'run_0.mcap').open('rb') as file:
        summary = make_reader(file).get_summary()
    for channel in summary.channels.values():
        assert channel.message_encoding == 'cdr'
        assert summary.schemas[channel.schema_id].encoding == 'ros2msg'
        assert yaml.safe_load(channel.metadata['offered_qos_profiles'])[0]['depth'] > 0
        assert channel.metadata['topic_type_hash'].startswith('RIHS01_')


@pytest.mark.parametrize('ticks', [1, CHUNK_TICKS, CHUNK_TICKS + 1, TICKS])
def test_writing_at_once_gives_the_same_file(tmp_path, ticks):
    write_one_by_one(tmp_path / 'a', ticks)
    write_at_once(tmp_path / 'b', ticks)
    for name in ('run_0.mcap', 'metadata.yaml'):
        assert (tmp_path / 'a' / name).read_bytes() == (tmp_path / 'b' / name).read_bytes()


@pytest.mark.parametrize(('share', 'chunks'), [(0.02, 1), (0.2, 1), (0.98, 2)])
def test_torn_file_reads_up_to_the_last_whole_chunk(tmp_path, share, chunks):
    write_one_by_one(tmp_path / 'one', CHUNK_TICKS, close=False)
    file = tmp_path / 'run_0.mcap'
    whole = (tmp_path / 'one' / 'run_0.mcap').stat().st_size
    write_one_by_one(tmp_path, TICKS, close=False)
    assert not (tmp_path / 'metadata.yaml').exists()
    data = file.read_bytes()
    file.write_bytes(data[: whole + int(share * (len(data) - whole))])
    stamps = []
    with file.open('rb') as stream, pytest.raises((EndOfFile, struct.error)):
        for record in StreamReader(stream).records:
            if isinstance(record, Message):
                stamps.append(record.log_time)
    ticks = range(chunks * CHUNK_TICKS)
    assert stamps == [tick * TICK_NS for tick in ticks for _ in PER_TICK]


def test_empty_recording_is_valid(tmp_path):
    BagWriter(tmp_path, 'run').close()
    with AnyReader([tmp_path]) as reader:
        assert list(reader.messages()) == []


def test_late_event_keeps_its_stamp(tmp_path):
    bag = BagWriter(tmp_path, 'run')
    clock = PER_TICK['/clock'].codec
    bag.write('/clock', 5 * TICK_NS, clock.encode(5 * TICK_NS, ()))
    bag.write('path', 0, to_cdr(PathMessage()))
    bag.close()
    with AnyReader([tmp_path]) as reader:
        assert [(c.topic, stamp) for c, stamp, _ in reader.messages()] == [
            ('/glider/path', 0),
            ('/clock', 5 * TICK_NS),
        ]


@pytest.mark.parametrize('type_name', sorted({topic.type_name for topic in TOPICS.values()}))
def test_definition_and_hash_are_those_of_the_distribution(type_name):
    store = get_typestore(Stores.ROS2_JAZZY)
    assert type_hash(type_name) == store.hash_rihs01(type_name)
    types = get_types_from_msg(message_definition(type_name), type_name)
    for name, definition in types.items():
        assert store.fielddefs[name][1] == definition[1]


@given(st.permutations(6 * ['a', 'b']))
def test_order_of_arrival_does_not_show_in_the_recording(arrivals):
    written = []
    order = TickSorter(['a', 'b'], 1, lambda *message: written.append(message[:2]))
    order.add_event('event', 3, b'')
    for place, topic in enumerate(arrivals):
        order.add(topic, arrivals[:place].count(topic), b'')
        order.write_complete(lambda stamp_ns: False)
    expected = [(topic, tick) for tick in range(6) for topic in ('a', 'b')]
    expected.insert(8, ('event', 3))
    assert written == expected
    assert order.lost == 0


def test_tick_of_which_an_event_may_be_under_way_waits_for_it():
    written = []
    order = TickSorter(['a'], 1, lambda *message: written.append(message[:2]))
    for tick in range(4):
        order.add('a', tick, b'')
    order.write_complete(lambda stamp_ns: False, until_ns=1)
    order.add_event('event', 2, b'')
    order.write_complete(lambda stamp_ns: False, until_ns=3)
    assert written == [('a', 0), ('a', 1), ('a', 2), ('event', 2), ('a', 3)]


def test_event_from_before_the_beginning_of_time_is_of_the_first_tick(tmp_path):
    """As somebody may stamp it whose clock is not set; MCAP has no number for it."""
    bag = BagWriter(tmp_path, 'run')
    order = TickSorter(['odom'], 1, bag.write)
    order.add_event('/diagnostics', -1, b'\0\1\0\0')
    order.write_rest()
    bag.close()
    (file,) = tmp_path.glob('*.mcap')
    with file.open('rb') as stream:
        (message,) = (one for _, _, one in make_reader(stream).iter_messages())
    assert (message.log_time, message.data) == (0, b'\0\1\0\0')


def test_what_was_commanded_before_the_vehicle_was_heard_is_of_its_first_tick():
    """Without an input the guard stamps by the wall clock, a simulated vehicle from 0 on.

    All is written as it comes, as a free-running recorder does.
    """
    written, second_ns = [], 10**9
    order = TickSorter(['a', 'b'], second_ns, lambda *message: written.append(message), {'b'})

    def add(topic, stamp_s):
        order.add(topic, stamp_s * second_ns, b'')
        if order.begun:
            order.write_rest()

    order.add_event('path', 0, b'')
    for topic, stamp_s in [('b', 1_700_000_000), ('b', 1_700_000_001), ('a', 0)]:
        add(topic, stamp_s)
    order.add_event('told', 1_700_000_001 * second_ns, b'')
    for topic, stamp_s in [('b', 1_700_000_002), ('a', 1), ('b', 1)]:  # it hears of it late
        add(topic, stamp_s)
    assert [message[:2] for message in written] == [
        *[('a', 0), ('b', 0), ('b', 0), ('path', 0), ('b', 0), ('told', second_ns)],
        *[('a', second_ns), ('b', second_ns)],
    ]
    assert order.lost == 0


def test_what_is_commanded_where_no_vehicle_is_heard_is_recorded_at_the_end():
    written = []
    order = TickSorter(['a', 'b'], 1, lambda *message: written.append(message), {'b'})
    order.add('b', 7, b'')
    assert not order.begun
    order.write_rest()
    assert written == [('b', 7, b'')]


def test_bag_is_as_long_as_its_run_whatever_stamps_events_have():
    """A path is stamped 0, and a stranger tells with a clock of its own."""
    written = []
    order = TickSorter(['a'], 10, lambda *message: written.append(message[1]))
    begin, end = 1_700_000_000, 1_700_000_050
    order.add_event('path', 0, b'')
    order.add_event('/diagnostics', 5_000_000_000, b'')
    for stamp in range(begin, end, 10):
        order.add('a', stamp, b'')
        order.write_complete(lambda stamp_ns: False)
    order.write_rest()
    assert len(written) == 7
    assert (min(written), max(written)) == (begin, end)


def test_incomplete_ticks_are_written_at_the_end_and_gaps_are_counted():
    written = []
    order = TickSorter(['a', 'b'], 10, lambda *message: written.append(message))
    for stamp_ns in (0, 10, 40):
        order.add('a', stamp_ns, b'a')
    order.add('b', 0, b'b')
    assert order.write_complete(lambda stamp_ns: stamp_ns == 0)
    assert written == [('a', 0, b'a'), ('b', 0, b'b')]
    order.write_rest()
    assert written[2:] == [('a', 10, b'a'), ('a', 40, b'a')]
    assert order.lost == 2
    assert order.written_ns == 40


def test_an_answer_that_comes_late_does_not_set_back_how_far_is_written():
    """Else a recorder at ten times a second waits for a last tick that it has."""
    order = TickSorter(['a', 'b'], 10, lambda *message: None)
    order.add('a', 10, b'')
    order.write_rest()
    order.add('b', 0, b'')
    order.write_rest()
    assert order.written_ns == 10


def test_a_topic_that_begins_later_than_others_has_lost_messages():
    order = TickSorter(['a', 'b'], 10, lambda *message: None)
    order.add('a', 50, b'')
    assert (order.lost, order.heard_ns) == (0, 40)
    order.add('b', 70, b'')
    assert (order.lost, order.heard_ns) == (2, 50)


def write_with_gaps(folder, ticks, lost):
    """Bag of per-tick messages without the lost (topic, tick); all numbers are the tick."""
    bag = BagWriter(folder, 'gaps')
    for tick in ticks:
        for name in (*SCORED, *TRACED):
            if (name, tick) not in lost:
                codec = TOPICS[name].codec
                row = np.full(len(codec.fields), float(tick))
                bag.write(name, tick * TICK_NS, codec.encode(tick * TICK_NS, row))
    bag.close()


@pytest.mark.parametrize('block_ticks', [20, BLOCK_TICKS])
def test_rows_end_at_the_first_gap_of_what_is_scored(tmp_path, monkeypatch, block_ticks):
    """Ticks after the gap are whole, but not consecutive; what is only drawn may have gaps."""
    monkeypatch.setattr(recorded_log, 'BLOCK_TICKS', block_ticks)
    write_with_gaps(tmp_path, range(100), {('odom', 50), ('adaptation', 20)})
    rows = np.concatenate([block.copy() for block in RecordedLog(Bag(tmp_path), TRACED).blocks()])
    assert rows[:, COLUMNS['odom'].start].tolist() == list(range(50))
    learnt = rows[:, COLUMNS['adaptation'].start]
    assert np.flatnonzero(np.isnan(learnt)).tolist() == [20]


@pytest.mark.parametrize('is_registered', [True, False])
def test_rows_are_whole_where_nobody_tells_the_truth(tmp_path, is_registered):
    """As at sea, and as before there was navigation; that topic alone may lack, in all ticks."""
    names = [name for name in SCORED if is_registered or name != 'ground_truth/odom']
    bag = BagWriter(tmp_path, 'sea', topics=[TOPICS[name] for name in names])
    for tick in range(30):
        for name in SCORED[1:]:
            codec = TOPICS[name].codec
            row = np.full(len(codec.fields), float(tick))
            bag.write(name, tick * TICK_NS, codec.encode(tick * TICK_NS, row))
    bag.close()
    rows = np.concatenate([block.copy() for block in RecordedLog(Bag(tmp_path)).blocks()])
    assert rows[:, COLUMNS['odom'].start].tolist() == list(range(30))
    assert np.all(np.isnan(rows[:, COLUMNS['ground_truth/odom']]))


def test_rows_end_where_the_truth_is_not_told_any_more(tmp_path):
    write_with_gaps(tmp_path, range(100), {('ground_truth/odom', 50)})
    log = RecordedLog(Bag(tmp_path))
    rows = np.concatenate([block.copy() for block in log.blocks()])
    assert len(rows) == 50
    assert 'tick 50 (t = 5.0 s) lacks ground_truth/odom: not recorded' in log.missing(100)


def test_rows_are_whole_where_a_recorder_from_outside_mixed_up_ticks(tmp_path, monkeypatch):
    """It takes topic after topic as they come, so that some are ticks behind the others."""
    monkeypatch.setattr(recorded_log, 'BLOCK_TICKS', 20)
    late = np.random.default_rng(0).uniform(0.0, 5.0, (100, len(SCORED)))
    order = np.argsort(np.arange(100)[:, np.newaxis] + late, axis=None)
    bag = BagWriter(tmp_path, 'outside')
    for tick, topic in zip(*np.unravel_index(order, late.shape), strict=True):
        codec = TOPICS[SCORED[topic]].codec
        row = np.full(len(codec.fields), float(tick))
        bag.write(SCORED[topic], int(tick) * TICK_NS, codec.encode(int(tick) * TICK_NS, row))
    bag.close()
    rows = np.concatenate([block.copy() for block in RecordedLog(Bag(tmp_path)).blocks()])
    for name in SCORED:
        assert rows[:, COLUMNS[name].start].tolist() == list(range(100))


def test_rows_tell_nothing_of_another_glider(tmp_path):
    """All tell on /diagnostics, and a recorder from outside keeps what all of them say."""
    bag = BagWriter(tmp_path, 'outside')
    for tick in range(10):
        for name in SCORED:
            codec = TOPICS[name].codec
            bag.write(name, tick * TICK_NS, codec.encode(tick * TICK_NS, np.ones(codec.width)))
    for tick, place, mask in [(3, '/glider', 4), (5, '/other', 1)]:
        said = Said('warn', 'at its limit', {'saturation': mask})
        told = health.said_array(tick * TICK_NS, f'{place}/control_node', said)
        bag.write('/diagnostics', tick * TICK_NS, to_cdr(told))
    bag.close()
    (rows,) = (block.copy() for block in RecordedLog(Bag(tmp_path)).blocks())
    assert rows[:, COLUMNS['saturation']].tolist() == 3 * [0.0] + 7 * [4.0]


@pytest.mark.parametrize('last', [100, BLOCK_TICKS, 5 * BLOCK_TICKS])
def test_gap_of_any_length_ends_the_rows(tmp_path, last):
    write_with_gaps(tmp_path, [*range(10), last], ())
    rows = np.concatenate([block.copy() for block in RecordedLog(Bag(tmp_path)).blocks()])
    assert rows[:, COLUMNS['odom'].start].tolist() == list(range(10))
