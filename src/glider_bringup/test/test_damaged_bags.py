# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""A bag that was harmed is refused or told, never scored as if it were whole."""

import json
import math
import os
import random
import shutil
import struct
import time
from pathlib import Path

import pytest
from mcap.opcode import Opcode
from mcap.reader import make_reader
from typer.testing import CliRunner

from fuzzing import bags, watch
from fuzzing.counts import Counter
from glider_base.ros.lockstep import health
from glider_base.ros.wire.codec import to_cdr
from glider_base.ros.wire.topics import PLANT, TOPICS
from glider_base.settings import ConfigurationError
from glider_base.signals import TICK_NS, TICK_S
from glider_bringup.cli import app
from glider_bringup.scoring.again import score_again
from glider_bringup.scoring.traces import load_traces
from glider_bringup.showing.figure import draw_run
from glider_bringup.showing.flown_run import read_run
from glider_bringup.showing.report import report_page
from glider_mission.disk import write_whole
from glider_mission.recording.mcap_reader import Bag
from glider_mission.recording.ros.recorded_run import Recording
from glider_mission.recording.ros.rosbag2 import CHUNK_TICKS, BagWriter
from glider_mission.run_folder import make_run_folder
from glider_mission.scenario import load_scenario

TICKS = 600
#: The end of a data section, up to its checksum: what ros2 bag writes has none.
DATA_END = struct.pack('<BQ', Opcode.DATA_END, 4)


def flip(data: bytes, bit: int) -> bytes:
    harmed = bytearray(data)
    harmed[bit // 8] ^= 1 << bit % 8
    return bytes(harmed)


def bag_of(folder: Path) -> Path:
    (file,) = folder.glob('*.mcap')
    return file


@pytest.fixture(scope='module')
def flown(tmp_path_factory) -> Path:
    """Run folder with all that a run has."""
    changes = {'dives': 0, 'duration_s': TICKS * TICK_S, 'settle_s': 0.0}
    scenario = load_scenario('current_8deg', changes)
    return bags.fly_whole(scenario, tmp_path_factory.mktemp('harm') / 'flight')


@pytest.fixture
def run(flown, tmp_path) -> Path:
    """A copy of it, to be harmed."""
    return Path(shutil.copytree(flown, tmp_path / 'flight'))


@pytest.fixture
def run_unchecked(run) -> Path:
    """The same without a checksum of the data section, as ros2 bag writes it."""
    data = bag_of(run).read_bytes()
    at = data.rindex(DATA_END) + len(DATA_END)
    bag_of(run).write_bytes(data[:at] + bytes(4) + data[at + 4 :])
    return run


def chunk_places(file: Path) -> list[tuple[int, int]]:
    """Place and length of every chunk, as the mcap package tells."""
    with file.open('rb') as stream:
        indexes = make_reader(stream).get_summary().chunk_indexes
    return sorted((one.chunk_start_offset, one.chunk_length) for one in indexes)


# ---------------------------------------------------------------------- the door


def test_door_of_bags_is_clean():
    told = []
    counter = Counter(told.append)
    bags.fuzz(5, 25, counter)
    assert counter.result() == (25, 0, 0, 0, ())
    assert told == list(range(1, 26))


@pytest.mark.parametrize(
    ('read', 'outcome'),
    [
        (lambda folder: ('another', False), 'wrong'),
        (lambda folder: ('another', True), ''),
        (lambda folder: ('good', False), ''),
        (lambda folder: ({}[folder], False), 'tracebacks'),
        (lambda folder: (time.sleep(5.0), False), 'hangs'),
        (lambda folder: Bag(folder / 'nowhere'), ''),
    ],
)
def test_door_of_bags_sees_what_goes_wrong(monkeypatch, tmp_path, read, outcome):
    monkeypatch.setattr(watch, 'HANG_S', 0.05)
    monkeypatch.setattr(bags, 'COMMANDS', {'it': read})
    assert bags._outcome(tmp_path, {'it': ('good', False)})[0] == outcome


# ---------------------------------------------------------------------- flipped bits


@pytest.mark.parametrize('share', [0.0, 0.5, 0.99])
def test_bit_in_a_chunk_is_told_with_time_and_ticks(run, share):
    file = bag_of(run)
    place, length = chunk_places(file)[2]
    file.write_bytes(flip(file.read_bytes(), 8 * (place + 60 + int(share * (length - 62)))))
    first = 2 * CHUNK_TICKS * TICK_S
    last = (3 * CHUNK_TICKS - 1) * TICK_S
    words = rf'chunk 3 is damaged: .*t = {first:.1f} s to {last:.1f} s, {CHUNK_TICKS} ticks'
    for use in (
        score_again,
        read_run,
        lambda run: draw_run(read_run(run), run / 'x.png'),
    ):
        with pytest.raises(ConfigurationError, match=words):
            use(run)


@pytest.mark.parametrize('bit', range(8 * 9))
def test_head_of_a_chunk_is_checked_in_bags_without_a_checksum(run_unchecked, bit):
    """Opcode or length: a chunk that is not seen as one is missed."""
    file = bag_of(run_unchecked)
    place, _ = chunk_places(file)[2]
    file.write_bytes(flip(file.read_bytes(), 8 * place + bit))
    with pytest.raises(ConfigurationError, match='damaged'):
        Bag(run_unchecked)


@pytest.mark.parametrize('field', [0, 8])
def test_times_of_a_chunk_are_checked_in_bags_without_a_checksum(run_unchecked, field):
    file = bag_of(run_unchecked)
    place, _ = chunk_places(file)[2]
    file.write_bytes(flip(file.read_bytes(), 8 * (place + 9 + field) + 30))
    with pytest.raises(ConfigurationError, match='chunk 3 .*is not where it should be'):
        Bag(run_unchecked)


@pytest.mark.parametrize('text', [b'/glider/odom', b'nav_msgs/msg/Odometry', b'transient_local'])
def test_topics_are_checked_in_bags_without_a_checksum(run_unchecked, text):
    file = bag_of(run_unchecked)
    data = file.read_bytes()
    file.write_bytes(flip(data, 8 * (data.index(text) + 4)))
    with pytest.raises(ConfigurationError, match='a topic or type is not that of its summary'):
        Bag(run_unchecked)


def test_attachment_is_checked(run):
    file = bag_of(run)
    data = file.read_bytes()
    file.write_bytes(flip(data, 8 * data.index(b'vehicle: vehicle.yaml') + 1))
    with pytest.raises(ConfigurationError, match=r"attachment 'scenario\.yaml' is wrong"):
        Bag(run)


def test_summary_is_not_needed(run):
    """Nothing depends on it where the data has a checksum; the result is the same."""
    card = score_again(run)
    file = bag_of(run)
    data = file.read_bytes()
    file.write_bytes(flip(data, 8 * (len(data) - 200)))
    assert score_again(run) == card
    file.write_bytes(data[:-200])
    assert score_again(run) == card


# ---------------------------------------------------------------------- cuts, and what is absent


@pytest.mark.parametrize('share', [0.6, 0.8])
def test_cut_run_is_not_completed_wherever_it_is_shown(run, share):
    file = bag_of(run)
    file.write_bytes(file.read_bytes()[: int(share * file.stat().st_size)])
    card = score_again(run)
    assert 0 < card['ticks'] < TICKS
    assert card['ticks'] % CHUNK_TICKS == 0
    assert card['status'] == 'aborted'
    assert f'{file} ends early, after ' in card['reason']
    assert f'it goes to t = {(card["ticks"] - 1) * TICK_S:.1f} s' in card['reason']
    assert f'{card["ticks"]} of {TICKS} ticks are there' in card['reason']
    for traced in (False, True):
        assert read_run(run, traced=traced).card == card
    for words in (['figure'], *(['export', '--to', kind] for kind in ('netcdf', 'csv', 'kml'))):
        done = CliRunner().invoke(app, [*words, str(run)], catch_exceptions=False)
        assert f'status: aborted ({card["reason"]})' in done.stderr, words


def test_cut_run_goes_as_far_as_its_ticks_whatever_was_told_later(tmp_path):
    """The direct engine hands on many ticks at once: each event follows its tick all the same."""
    orders = [{'at_s': (TICKS - 2) * TICK_S, 'depth_m': 500.0}]
    changes = {'dives': 0, 'duration_s': TICKS * TICK_S, 'orders': orders}
    run = bags.fly_whole(load_scenario('current_8deg', changes), tmp_path / 'flight')
    with bag_of(run).open('rb') as stream:
        times = [
            one.log_time for *_, one in make_reader(stream).iter_messages(log_time_order=False)
        ]
    assert times == sorted(times)
    os.truncate(bag_of(run), int(0.6 * bag_of(run).stat().st_size))
    card = score_again(run)
    assert f'it goes to t = {(card["ticks"] - 1) * TICK_S:.1f} s' in card['reason']


@pytest.mark.parametrize('size', [0, 1, 100, 6000])
def test_bag_without_a_whole_tick_is_not_scored(run, size):
    file = bag_of(run)
    file.write_bytes(file.read_bytes()[:size])
    for use in (score_again, read_run):
        with pytest.raises(ConfigurationError, match='cannot be scored: .* ends early'):
            use(run)


@pytest.mark.parametrize('size', [0, 1, 100])
def test_bag_without_a_topic_is_not_verified(run, size):
    file = bag_of(run)
    file.write_bytes(file.read_bytes()[:size])
    with pytest.raises(ConfigurationError, match='no topic .* ends early, after'):
        Recording(Bag(run), None, lambda share: None)


def test_score_file_does_not_stand_on_ticks_that_are_absent(run):
    file = run / 'score.json'
    card = json.loads(file.read_text())
    file.write_text(json.dumps({**card, 'ticks': 77000}))
    for again in (score_again(run), read_run(run).card):
        assert (again['status'], again['ticks']) == ('aborted', TICKS)
        assert again['reason'].startswith('600 of 77,000 ticks are there')


@pytest.mark.parametrize(
    ('topic', 'why'),
    [('odom', 'is not finite'), ('ground_truth/odom', 'is not finite'), ('wrench', '')],
)
def test_number_that_is_none_ends_the_rows_where_it_is_scored(tmp_path, topic, why):
    """What a node refuses, the reader must not trip over, nor score."""
    scenario = load_scenario('helix', {'duration_s': 3 * TICK_S})
    folder = make_run_folder(scenario, tmp_path / 'flight')
    bag = BagWriter(folder, 'helix')
    for tick in range(3):
        for one in TOPICS.values():
            if one.per_tick:
                bad = (tick, one.name) == (2, topic)
                row = [math.nan if bad else 0.0] * len(one.codec.fields)
                bag.write(one.name, tick * TICK_NS, one.codec.encode(tick * TICK_NS, row))
    end = health.Report(PLANT, health.FINISHED, '', 2 * TICK_NS)
    bag.write('/diagnostics', 2 * TICK_NS, to_cdr(health.report_array(end)))
    bag.close()
    card = score_again(folder)
    json.dumps(card, allow_nan=False)
    if why:
        assert (card['status'], card['ticks']) == ('aborted', 2)
        assert f'2 of 3 ticks are there; tick 2 (t = 0.2 s) lacks {topic}: ' in card['reason']
        assert card['reason'].endswith(why)
    else:
        assert (card['status'], card['ticks']) == ('completed', 3)


# ---------------------------------------------------------------------- files beside the bag


def test_traces_that_are_damaged_are_named(run):
    """A flipped bit is refused, or is one that the numbers do not need: of headers, of deflate."""
    file = run / 'traces.npz'
    data, draw, refused = file.read_bytes(), random.Random(3), 0
    good = load_traces(file)
    for _ in range(60):
        file.write_bytes(flip(data, draw.randrange(8 * len(data))))
        try:
            again = load_traces(file)
        except ConfigurationError as error:
            assert str(error).startswith(f'{file}: ')
            refused += 1
        else:
            for name, values in good.curves.items():
                assert again.curves[name].tobytes() == values.tobytes()
    assert refused > 30


def test_score_file_that_is_damaged_is_named_or_can_be_shown(run):
    file = run / 'score.json'
    data, draw = file.read_bytes(), random.Random(4)
    for _ in range(60):
        file.write_bytes(flip(data, draw.randrange(8 * len(data))))
        try:
            write_whole(run / 'report.html', report_page(read_run(run)))
        except ConfigurationError as error:
            assert str(error).startswith(str(run))


@pytest.mark.parametrize(
    ('before', 'after'),
    [
        (f'"ticks": {TICKS}', '"ticks": "many"'),
        ('"status": "completed"', '"status": "complete"'),
        ('"rms_steady"', '"rms_stead"'),
        ('"reason": ""', '"reason": null'),
        ('{', '[{'),
    ],
)
def test_score_file_of_another_shape_is_refused(run, before, after):
    file = run / 'score.json'
    text = file.read_text()
    assert before in text
    file.write_text(text.replace(before, after, 1))
    for use in (score_again, read_run):
        with pytest.raises(ConfigurationError, match=r'score\.json: '):
            use(run)


def test_metadata_that_is_damaged_is_named_or_does_not_matter(run):
    file = run / 'metadata.yaml'
    data, draw = file.read_bytes(), random.Random(5)
    topics = Bag(run).topics
    for _ in range(100):
        file.write_bytes(flip(data, draw.randrange(8 * len(data))))
        try:
            assert Bag(run).topics == topics
        except ConfigurationError as error:
            assert str(run) in str(error)
