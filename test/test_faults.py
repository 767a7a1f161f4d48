# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""What goes wrong is named, ends the run by itself, and leaves nothing behind."""

import contextlib
import json
import os
import signal
import struct
import time
from collections import Counter
from pathlib import Path

import pytest
import yaml
from mcap.exceptions import McapError
from mcap.reader import make_reader
from mcap.records import Channel, Message
from mcap.stream_reader import StreamReader

from glider_base.ros.wire.topics import recorded_topics
from glider_base.signals import TICK_NS
from glider_bringup.engines.fork_server import FORK_SERVER, nodes_of
from glider_bringup.engines.janitor import is_alive
from glider_bringup.engines.processes import MODULES, PLANT, STACK, process_modules
from glider_mission.scenario import SCENARIO_FOLDER
from glider_model.vehicle.file import vehicle_path

PER_TICK = [
    topic.full_name('/glider') for topic in recorded_topics(['measured_odom']) if topic.per_tick
]
START_S = 200.0  #: for the processes to come up, at worst with every kernel to compile
STOP_S = 10.0  #: within which a run ends by itself
TICK_TIMEOUT_S = 5.0  #: after which the plant gives up a node that is silent
FLOWN_BYTES = 300_000  #: of recording: several chunks are on disk


# ---------------------------------------------------------------------- processes


def wait_until(condition, deadline_s: float, process, what: str):
    """Wait for a condition while the process runs; gives what the condition gave."""
    end = time.monotonic() + deadline_s
    while not (value := condition()):
        assert process.poll() is None, f'ended before {what}'
        assert time.monotonic() < end, f'not within {deadline_s:g} s: {what}'
        time.sleep(0.05)
    return value


class Flying:
    """A long run over nodes, each a process or but for the recorder in one."""

    def __init__(self, start_glider, tmp_path: Path, layout='processes') -> None:
        self.out, self._texts = tmp_path / 'run', tmp_path
        self.nodes: dict[str, int] = {}
        self._expected = {*process_modules(layout), FORK_SERVER}
        options = ['--no-report', *(['--processes'] if layout == 'processes' else [])]
        self.process = start_glider(
            'run', 'rough_water', '--duration', 100000, '--out', self.out, '--json', *options
        )
        wait_until(self._has_nodes, START_S, self.process, 'all processes')

    def _has_nodes(self) -> bool:
        self.nodes = nodes_of(self.process.pid)
        return set(self.nodes) == self._expected

    def take_off(self) -> 'Flying':
        """Wait until it flies, and some of that is on disk."""
        wait_until(self._has_flown, START_S, self.process, 'recording')
        return self

    def _has_flown(self) -> bool:
        return any(f.stat().st_size > FLOWN_BYTES for f in self.out.glob('*.mcap'))

    def end(self, within_s: float = STOP_S) -> tuple[int, dict]:
        """Exit code and scorecard of the run, which is about to end by itself."""
        code = self.process.wait(within_s)
        left = [name for name, pid in self.nodes.items() if is_alive(pid)]
        assert not left, f'left behind: {left}'
        assert 'Traceback' not in self.messages
        return code, json.loads((self._texts / 'stdout').read_text())

    @property
    def messages(self) -> str:
        """What the run printed on standard error."""
        return (self._texts / 'stderr').read_text()

    @property
    def recording(self) -> Path:
        """The MCAP file."""
        (file,) = self.out.glob('*.mcap')
        return file


@pytest.fixture
def starting(start_glider, tmp_path) -> Flying:
    """A run whose processes have just been started."""
    return Flying(start_glider, tmp_path)


@pytest.fixture
def flying(starting) -> Flying:
    """A run in flight."""
    return starting.take_off()


@pytest.fixture
def flying_together(start_glider, tmp_path) -> Flying:
    """The same with all nodes but the recorder in one process."""
    return Flying(start_glider, tmp_path, 'together').take_off()


# ---------------------------------------------------------------------- recordings


def messages_on_disk(file: Path) -> dict[str, list[int]]:
    """Stamps by topic in a recording, read chunk by chunk as far as it goes."""
    topics, stamps = {}, {}
    with file.open('rb') as stream, contextlib.suppress(McapError, EOFError, struct.error):
        for record in StreamReader(stream, validate_crcs=True).records:
            if isinstance(record, Channel):
                topics[record.id] = record.topic
            elif isinstance(record, Message):
                stamps.setdefault(topics[record.channel_id], []).append(record.log_time)
    return stamps


def check_ticks(stamps: dict[str, list[int]], allowed: dict[str, int]) -> None:
    """Every per-tick topic has each tick once, from 0; so many of the last ones may lack."""
    lengths = {name: len(stamps[name]) for name in PER_TICK}
    for name in PER_TICK:
        assert max(lengths.values()) - lengths[name] <= allowed[name], name
        assert lengths[name] >= 500
        assert stamps[name] == [tick * TICK_NS for tick in range(lengths[name])]


def lacking_when_cut(culprit: str = '') -> dict[str, int]:
    """How many of the last ticks a topic may lack in a run that was cut.

    Some nodes have answered the last tick, and others have not: one. Of a node that ended in the
    middle of a tick, what the others wait for may have reached them, but not the recorder, and the
    rest was never published. Then they begin the next tick, which this node does not answer: its
    topics lack two. Of the fork server that ends, every node does so, each at its own moment. The
    plant does not answer ticks, it begins them: one.
    """
    cut = {*MODULES} if culprit == FORK_SERVER else {culprit}
    return {
        topic.full_name('/glider'): 2 if topic.publisher in cut - {PLANT} else 1
        for topic in recorded_topics(['measured_odom'])
        if topic.per_tick
    }


def check_complete(flying: Flying, card: dict, culprit: str = '') -> None:
    """The bag has been completed: its end and metadata.yaml agree with the scorecard."""
    stamps = messages_on_disk(flying.recording)
    check_ticks(stamps, lacking_when_cut(culprit))
    with flying.recording.open('rb') as stream:
        statistics = make_reader(stream).get_summary().statistics
    information = yaml.safe_load((flying.out / 'metadata.yaml').read_text())
    counted = Counter({name: len(times) for name, times in stamps.items()})
    assert (
        counted.total()
        == statistics.message_count
        == information['rosbag2_bagfile_information']['message_count']
        == card['messages_recorded']
    )
    assert card['messages_lost'] == 0
    lengths = [counted[name] for name in PER_TICK]
    assert min(lengths) <= card['ticks'] <= max(lengths)


# ---------------------------------------------------------------------- nodes that die


@pytest.mark.parametrize('name', ['current_node', 'guard_node', PLANT, FORK_SERVER])
def test_killed_node_ends_the_run_and_is_named(flying, name):
    """The first and the last that answer the plant, the plant, and who starts them."""
    os.kill(flying.nodes[name], signal.SIGKILL)
    code, card = flying.end()
    assert code == 1
    assert card['status'] == 'aborted'
    assert card['reason'] == f'{name} was killed by SIGKILL'
    assert card['reason'] in flying.messages
    check_complete(flying, card, name)


def test_killed_process_of_all_nodes_ends_the_run_and_is_named(flying_together):
    flying = flying_together
    os.kill(flying.nodes[STACK], signal.SIGKILL)
    code, card = flying.end()
    assert (code, card['status']) == (1, 'aborted')
    assert card['reason'] == f'{STACK} was killed by SIGKILL'
    check_complete(flying, card)


def test_what_a_node_said_before_it_was_killed_is_recorded_by_a_recorder_that_lags(flying):
    os.kill(flying.nodes['recorder_node'], signal.SIGSTOP)
    time.sleep(0.3)  # in which the others fly as far as they may: hundreds of messages
    os.kill(flying.nodes['guidance_node'], signal.SIGKILL)
    os.kill(flying.nodes['recorder_node'], signal.SIGCONT)
    _, card = flying.end()
    check_complete(flying, card, 'guidance_node')


def test_killed_recorder_ends_the_run_and_leaves_what_was_on_disk(flying_together):
    flying = flying_together
    on_disk = flying.recording.stat().st_size
    os.kill(flying.nodes['recorder_node'], signal.SIGKILL)
    code, card = flying.end()
    assert code == 1
    assert (card['status'], card['reason']) == (
        'aborted',
        'recorder_node was killed by SIGKILL',
    )
    assert card['reason'] in flying.messages
    assert flying.recording.stat().st_size >= on_disk
    check_ticks(messages_on_disk(flying.recording), dict.fromkeys(PER_TICK, 0))


def test_node_that_hangs_is_named_by_the_plant(flying):
    os.kill(flying.nodes['guidance_node'], signal.SIGSTOP)
    code, card = flying.end(TICK_TIMEOUT_S + STOP_S)
    assert code == 1
    assert card['status'] == 'aborted'
    assert card['reason'].startswith('guidance_node did not publish reference for t = ')
    check_complete(flying, card, 'guidance_node')


@pytest.mark.parametrize(
    ('number', 'layout'), [(signal.SIGINT, 'flying'), (signal.SIGTERM, 'flying_together')]
)
def test_interrupted_run_is_aborted_with_a_complete_bag(request, number, layout):
    flying = request.getfixturevalue(layout)
    flying.process.send_signal(number)
    code, card = flying.end()
    assert code == 130
    assert (card['status'], card['reason']) == ('aborted', f'stopped by {number.name}')
    check_complete(flying, card)


def test_node_that_dies_before_the_first_tick_is_named(starting):
    os.kill(starting.nodes['control_node'], signal.SIGKILL)
    code, card = starting.end()
    assert code == 1
    assert (card['status'], card['reason']) == ('aborted', 'control_node was killed by SIGKILL')
    assert card['ticks'] == 0


def test_run_interrupted_before_the_first_tick_is_aborted(starting):
    starting.process.send_signal(signal.SIGINT)
    code, card = starting.end()
    assert code == 130
    assert (card['status'], card['reason']) == ('aborted', 'stopped by SIGINT')
    assert card['ticks'] == 0


# ---------------------------------------------------------------------- files that are wrong

VEHICLE = 'broken_vehicle.yaml'

#: What is changed in a good scenario: field, value as YAML, and what the message has to say.
SCENARIO_FAULTS = {
    'unknown field': ('profile.deepness_m', '100.0', ['profile.deepness_m', '100.0', 'depth_m']),
    'NaN': ('initial.depth_m', '.nan', ['initial.depth_m', 'nan']),
    'out of range': ('profile.depth_m', '-5.0', ['profile.depth_m', '-5.0', '10.0', '12000.0']),
    'wrong word': ('control.law', 'bang', ['control.law', 'bang', 'adaptive', 'pid']),
    'wrong type': ('seed', 'many', ['seed', 'many']),
    'missing vehicle': ('vehicle', 'nautilus', ['vehicle', 'nautilus', 'zhang2021']),
    'missing vehicle file': ('vehicle', './no.yaml', ['vehicle', 'no.yaml']),
    'missing table': (
        'current',
        '{components: [{kind: table, file: no.csv}]}',
        ['no.csv'],
    ),
}

#: The same in a good vehicle.
VEHICLE_FAULTS = {
    'unknown field': ('rigid_body.weight', '{value: 1.0, unit: kg}', ['rigid_body.weight']),
    'NaN': ('rigid_body.hull_mass.value', '.nan', ['rigid_body.hull_mass', 'nan']),
    'negative mass': ('rigid_body.hull_mass.value', '-50.0', ['rigid_body.hull_mass', '-50.0']),
    'out of range': ('moving_mass.mass.value', '1e9', ['moving_mass.mass', '1000000000.0']),
    'missing field': ('hydrodynamics.K_D0', None, ['hydrodynamics.K_D0', 'missing']),
}


def changed(values: dict, field: str, text: str | None) -> str:
    """YAML of ``values`` with one field set, or taken out."""
    *parents, last = field.split('.')
    branch = values
    for parent in parents:
        branch = branch.setdefault(parent, {})
    branch.pop(last, None)
    if text is not None:
        branch[last] = yaml.safe_load(text)
    return yaml.safe_dump(values)


def check_refused(glider, tmp_path: Path, engine: str, scenario: Path, words) -> None:
    """One message with all the words, exit code 2, no run folder."""
    out = tmp_path / 'run'
    done = glider('run', scenario, '--engine', engine, '--duration', 10, '--out', out, '--json')
    assert done.returncode == 2, done.stderr
    assert done.stdout == ''
    assert 'Traceback' not in done.stderr
    (line,) = done.stderr.strip().splitlines()
    assert not [word for word in words if word not in line], line
    assert not out.exists()


@pytest.mark.parametrize('fault', SCENARIO_FAULTS)
def test_wrong_scenario_is_refused(glider, tmp_path, fault):
    field, text, words = SCENARIO_FAULTS[fault]
    values = yaml.safe_load((SCENARIO_FOLDER / 'current_8deg.yaml').read_text())
    file = tmp_path / 'mine.yaml'
    file.write_text(changed(values, field, text))
    check_refused(glider, tmp_path, 'nodes', file, [str(file), *words])


@pytest.mark.parametrize(
    ('engine', 'fault'),
    [*(('nodes', fault) for fault in VEHICLE_FAULTS), ('direct', 'negative mass')],
)
def test_wrong_vehicle_is_refused(glider, tmp_path, engine, fault):
    field, text, words = VEHICLE_FAULTS[fault]
    values = yaml.safe_load(vehicle_path('zhang2021').read_text())
    (tmp_path / VEHICLE).write_text(changed(values, field, text))
    scenario = yaml.safe_load((SCENARIO_FOLDER / 'current_8deg.yaml').read_text())
    file = tmp_path / 'mine.yaml'
    file.write_text(changed(scenario, 'vehicle', VEHICLE))
    check_refused(glider, tmp_path, engine, file, [str(tmp_path / VEHICLE), *words])


@pytest.mark.parametrize(
    ('name', 'words'),
    [
        ('no/such.yaml', ['no/such.yaml']),
        ('nonsense', ['nonsense', 'current_8deg']),
    ],
)
def test_missing_scenario_is_refused(glider, tmp_path, name, words):
    check_refused(glider, tmp_path, 'nodes', Path(name), words)


def test_text_that_is_not_yaml_is_refused(glider, tmp_path):
    file = tmp_path / 'mine.yaml'
    file.write_text('{name: [')
    done = glider('run', file, '--out', tmp_path / 'run')
    assert done.returncode == 2
    assert 'Traceback' not in done.stderr
    assert f'{file}: not valid YAML' in done.stderr
    assert not (tmp_path / 'run').exists()


@pytest.mark.parametrize(
    ('options', 'words'),
    [
        (['--duration', '-1'], ['--duration', '-1', '0.1']),
        (['--speed', 'fast'], ['--speed', 'fast', 'max']),
        (['--set', 'profile.depth_m=nan'], ['profile.depth_m', 'nan']),
        (['--set', 'profile.depth_m'], ['profile.depth_m', 'value']),
        (['--seed', '-3'], ['seed', '-3', '0']),
        (['--speed', '2', '--engine', 'direct'], ['--speed', 'max']),
    ],
)
def test_wrong_option_is_refused(glider, tmp_path, options, words):
    done = glider('run', 'current_8deg', '--out', tmp_path / 'run', *options)
    assert done.returncode == 2
    assert 'Traceback' not in done.stderr
    assert not [word for word in words if word not in done.stderr], done.stderr
    assert not (tmp_path / 'run').exists()


def test_folder_of_another_run_is_refused_and_untouched(glider, tmp_path):
    (tmp_path / 'mine.txt').write_text('precious')
    done = glider('run', '--engine', 'direct', '--duration', 10, '--out', tmp_path)
    assert done.returncode == 2
    assert str(tmp_path) in done.stderr
    assert [(f.name, f.read_text()) for f in tmp_path.iterdir()] == [('mine.txt', 'precious')]
