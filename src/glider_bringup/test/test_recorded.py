# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""A bag is scored and drawn without anything that ``./glider run`` adds to it."""

import shutil
import subprocess
import sys
from pathlib import Path

import pytest
from typer.testing import CliRunner

from glider_base.ros.lockstep import health
from glider_base.ros.wire.codec import to_cdr
from glider_base.ros.wire.topics import PLANT, TOPICS
from glider_base.settings import ConfigurationError
from glider_base.signals import TICK_NS
from glider_bringup.cli import app
from glider_bringup.engines.recorded import fly_recorded
from glider_bringup.scoring.again import score_again
from glider_bringup.scoring.card import scorecard, write_score
from glider_bringup.scoring.score import Scorer, scores_of
from glider_bringup.showing.figure import draw_run
from glider_bringup.showing.flown_run import read_run
from glider_mission.recording.ros.rosbag2 import BagWriter
from glider_mission.run_folder import make_run_folder
from glider_mission.scenario import load_scenario

#: What a score file knows and a bag does not.
ONLY_IN_THE_FILE = {'engine', 'wall_time_s', 'real_time_factor'}
#: `./glider score`, and what report, compare and figure begin with.
USES = (score_again, read_run)
ATTACHED = ('scenario.yaml', 'vehicle.yaml')


@pytest.fixture(scope='module')
def run(tmp_path_factory) -> Path:
    """Run folder with bag and score file."""
    scenario = load_scenario('noisy_sensors', {'dives': 0, 'duration_s': 300.0, 'settle_s': 0.0})
    folder = make_run_folder(scenario, tmp_path_factory.mktemp('run') / 'flight')
    scorer = Scorer(scenario)
    flight = fly_recorded(scenario, folder, [scorer])
    write_score(folder, scorecard(scenario, 'direct', flight, scores_of(scenario, scorer)))
    return folder


@pytest.fixture
def bag_only(run, tmp_path) -> Path:
    """Folder with nothing but the MCAP file of the run."""
    (file,) = run.glob('*.mcap')
    shutil.copy(file, tmp_path)
    return tmp_path


def said(phase: str, stamp_ns: int, message: str = '') -> bytes:
    """Report of the plant."""
    report = health.Report(PLANT, phase, message, stamp_ns, level=health.ERROR)
    return to_cdr(health.report_array(report))


def write_bag(folder: Path, *reports: bytes, but: str = '') -> Path:
    """Run folder, as a launch makes it, with three ticks in its bag, ``but`` in the last only."""
    scenario = load_scenario('helix', {'duration_s': 0.3})
    make_run_folder(scenario, folder)
    bag = BagWriter(folder, 'helix', attachments=[folder / name for name in ATTACHED])
    for tick in range(3):
        for topic in TOPICS.values():
            if topic.per_tick and (tick == 2 or topic.name != but):
                row = [0.0] * len(topic.codec.fields)
                bag.write(topic.name, tick * TICK_NS, topic.codec.encode(tick * TICK_NS, row))
    for report in reports:
        bag.write('/diagnostics', 2 * TICK_NS, report)
    bag.close()
    return folder


def test_scored_from_the_bag_as_it_was_in_flight(run, bag_only):
    card = score_again(run)
    assert (card['status'], card['engine']) == ('completed', 'direct')
    (file,) = bag_only.glob('*.mcap')
    for source in (bag_only, file):
        again = score_again(source)
        assert again.keys() == card.keys()
        assert {name for name in card if again[name] != card[name]} == ONLY_IN_THE_FILE
        assert [again[name] for name in sorted(ONLY_IN_THE_FILE)] == [None, None, None]


def test_launched_run_has_parameters_and_no_score_file(run, tmp_path):
    folder = tmp_path / 'launched'
    shutil.copytree(run, folder)
    (folder / 'score.json').unlink()
    (folder / 'parameters.yaml').touch()
    again = score_again(folder)
    assert (again['engine'], again['status'], again['reason']) == ('nodes', 'completed', '')


def test_drawn_from_the_bag_alone(bag_only):
    draw_run(read_run(bag_only), bag_only / 'run.png')
    assert (bag_only / 'run.png').read_bytes().startswith(b'\x89PNG')


@pytest.mark.parametrize(
    ('reports', 'status', 'words'),
    [
        ([said(health.FINISHED, 2 * TICK_NS)], 'completed', ''),
        ([said(health.FAILED, 2 * TICK_NS, 'control_node is late')], 'aborted', 'control_node is'),
        ([said(health.READY, TICK_NS)], 'aborted', 'stopped before'),
        ([], 'aborted', 'nobody knows how it ended'),
    ],
)
def test_status_is_what_the_plant_said_last(tmp_path, reports, status, words):
    card = score_again(write_bag(tmp_path / 'flight', *reports))
    assert card['status'] == status
    assert words in card['reason']
    assert bool(card['reason']) is bool(words)
    assert (card['ticks'], card['messages_lost']) == (3, 0)


def test_score_file_knows_more_than_the_bag(run, tmp_path):
    """A run stopped by hand leaves no word of it in the bag."""
    folder = tmp_path / 'stopped'
    shutil.copytree(run, folder)
    text = (folder / 'score.json').read_text()
    (folder / 'score.json').write_text(
        text.replace('"completed"', '"aborted"').replace(
            '"reason": ""', '"reason": "stopped by SIGINT"'
        )
    )
    card = score_again(folder)
    assert (card['status'], card['reason']) == ('aborted', 'stopped by SIGINT')


@pytest.mark.parametrize('keep', [0, 5000])
def test_file_cut_before_its_attachments_tells_what_is_missing(bag_only, keep):
    (file,) = bag_only.glob('*.mcap')
    file.write_bytes(file.read_bytes()[:keep])
    for use in USES:
        with pytest.raises(ConfigurationError, match=r'no scenario\.yaml beside'):
            use(bag_only)


def test_file_cut_short_is_scored_as_far_as_it_goes(bag_only):
    (file,) = bag_only.glob('*.mcap')
    file.write_bytes(file.read_bytes()[: file.stat().st_size // 2])
    card = score_again(bag_only)
    assert card['status'] == 'aborted'
    assert 500 < card['ticks'] < 2500


def test_aborted_run_tells_of_a_gap_before_its_end(tmp_path):
    report = said(health.FAILED, 9 * TICK_NS, 'control_node is late')
    card = score_again(write_bag(tmp_path / 'flight', report))
    assert (card['status'], card['ticks']) == ('aborted', 3)
    assert 'control_node is late; 3 of 10 ticks are there; tick 3 ' in card['reason']


def test_free_running_recording_is_no_scorecard_of_nothing(tmp_path):
    folder = write_bag(tmp_path / 'flight', said(health.FINISHED, 2 * TICK_NS), but='reference')
    for use in USES:
        with pytest.raises(ConfigurationError, match='flight: cannot be scored.*free-running'):
            use(folder)
    for told in ('', '/**: {ros__parameters: {lockstep: false}}'):  # or only to be seen
        if told:
            (folder / 'parameters.yaml').write_text(told, encoding='utf-8')
        done = CliRunner().invoke(app, ['recover', str(folder)])
        assert 'ticks are not counted: ' in done.stderr and 'free-running' in done.stderr
        assert done.stdout.splitlines()[0] == 'whole: left as it is'
        assert 'missing' not in done.stdout  # neither messages nor ticks: nobody had planned them


@pytest.mark.parametrize('kind', ['netcdf', 'csv', 'mat', 'og1'])
def test_recording_without_a_tick_is_no_file_that_nobody_can_read(tmp_path, kind):
    pytest.importorskip('h5netcdf')
    folder = make_run_folder(load_scenario('helix'), tmp_path / 'flight')
    BagWriter(folder, 'helix').close()
    words = ['export', str(folder), '--to', kind, *(['--start', '2026-03-01'] * (kind == 'og1'))]
    with pytest.raises(ConfigurationError, match='flight: no tick was recorded'):
        CliRunner().invoke(app, words, catch_exceptions=False)
    assert not [*folder.glob('run.*')]


def test_attached_scenario_that_cannot_be_used_is_named(tmp_path):
    (tmp_path / 'scenario.yaml').write_text('profile: {depth_m: 1.0}\n')
    bag = BagWriter(tmp_path / 'flight', 'x', attachments=[tmp_path / 'scenario.yaml'])
    bag.close()
    for use in USES:
        with pytest.raises(ConfigurationError, match=r'flight: attached scenario\.yaml.*depth_m'):
            use(tmp_path / 'flight')


@pytest.mark.parametrize(
    ('name', 'words'), [('nothing', 'no such run folder'), ('', 'not a run folder')]
)
def test_what_holds_no_run_is_refused(tmp_path, name, words):
    for use in USES:
        with pytest.raises(ConfigurationError, match=words):
            use(tmp_path / name)
    assert list(tmp_path.iterdir()) == []


PEAK = """
import sys
from pathlib import Path
from glider_mission.recording.mcap_reader import Bag
from glider_mission.recording.ros.recorded_log import RecordedLog

def peak_mb():
    lines = Path('/proc/self/status').read_text().splitlines()
    return next(int(line.split()[1]) for line in lines if line.startswith('VmHWM:')) / 1000.0

blocks, before = RecordedLog(Bag(Path(sys.argv[1]))).blocks(), peak_mb()
print(next(blocks).shape[0], peak_mb() - before)
"""


def test_a_long_bag_is_read_piece_by_piece(tmp_path):
    """The first hour of three takes less memory than all messages do."""
    scenario = load_scenario('current_8deg', {'dives': 0, 'duration_s': 10800.0})
    folder = make_run_folder(scenario, tmp_path / 'run')
    fly_recorded(scenario, folder)
    command = [sys.executable, '-c', PEAK, folder]
    done = subprocess.run(command, capture_output=True, text=True, check=True, timeout=300)
    ticks, grown_mb = done.stdout.split()
    assert int(ticks) == 36000
    payloads_mb = 3 * 36000 * 3792 / 1e6  # docs/scale.md, t
    assert float(grown_mb) < 0.5 * payloads_mb
