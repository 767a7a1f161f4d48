# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""A run over ROS 2 topics and a direct run of one scenario are identical to the last bit."""

import hashlib
import json
import sys
from collections import Counter, defaultdict
from pathlib import Path

import numpy as np
import pytest
import yaml
from mcap.reader import make_reader

from glider_base.ros.wire.topics import TOPICS, recorded_topics
from glider_base.signals import TICK_S
from glider_base.wiring import ESTIMATES
from glider_bringup.engines.processes import RECORDER, Layout, node_commands, run_nodes
from glider_mission.blocks import COLUMNS
from glider_mission.recording.mcap_reader import Bag
from glider_mission.recording.ros.recorded_log import RecordedLog
from glider_mission.run_folder import PARAMETERS_FILE

#: Topics of a flight with position known.
PER_TICK = [
    topic.full_name('/glider') for topic in recorded_topics(['measured_odom']) if topic.per_tick
]
#: A flight by dead reckoning, a dive between two stays at the surface, and what is set for it.
RECKONED = {
    'navigation.method': 'dead_reckoned',
    'sensors.compass_bias_deg': 1.0,
    'sensors.declination_deg': -8.0,
    'sensors.chart_declination_deg': -7.0,
    'sensors.gps_first_fix_s': 20.0,
    'sensors.also_fitted': '[altitude]',
    'sensors.altimeter_std_m': 0.2,
    'water.bottom_m': 120.0,
    'water.wind_mps': 8.0,
    'water.wind_from_deg': 45.0,
    'profile.depth_m': 25.0,
    'profile.surface_every_dives': 1,
    'profile.prepare_s': 10.0,
    'profile.wait_s': 70.0,
}
RECKONED_S = 380

#: What tells how a result came about, not what it is.
HOW = {'engine', 'wall_time_s', 'real_time_factor', 'messages_recorded'}

#: Runs the module that is named with the executor of rclpy: everything comes by callback.
BY_RCLPY = """
import runpy, sys
from rclpy.executors import SingleThreadedExecutor
from glider_base.ros.lockstep import executor
executor.TickExecutor = SingleThreadedExecutor
executor.Gate.can_execute = lambda gate, entity: True
executor.take_with_info = lambda subscription: None
runpy.run_module(sys.argv.pop(1), run_name='__main__', alter_sys=True)
"""

#: A recorder that does not get the processor for a second after it has said that it is ready.
SLOW_RECORDER = """
import sys, time
from glider_bringup.nodes import recorder_node
from glider_base.ros.lockstep.health import READY

class SlowRecorder(recorder_node.RecorderNode):
    def report(self, phase, *args, **fields):
        super().report(phase, *args, **fields)
        if phase == READY:
            time.sleep(1.0)

recorder_node.RecorderNode = SlowRecorder
sys.exit(recorder_node.main())
"""


def digests(folder: Path) -> dict[str, tuple[int, str]]:
    """Number of messages of each per-tick topic, and a digest of their stamps and payloads."""
    counts, hashes = Counter(), defaultdict(hashlib.sha256)
    names = [topic.full_name('/glider') for topic in TOPICS.values() if topic.per_tick]
    (file,) = folder.glob('*.mcap')
    with file.open('rb') as stream:
        for _, channel, message in make_reader(stream).iter_messages(topics=names):
            counts[channel.topic] += 1
            hashes[channel.topic].update(message.log_time.to_bytes(8, 'big') + message.data)
    return {name: (counts[name], hashes[name].hexdigest()) for name in names if name in counts}


def test_flight_is_what_it_was_meant_to_be(over_nodes):
    card = over_nodes.card
    assert (card['engine'], card['status'], card['reason']) == ('nodes', 'completed', '')
    assert card['ticks'] * TICK_S == pytest.approx(card['sim_time_s']) == pytest.approx(400.0)
    assert card['messages_lost'] == 0
    assert card['messages_recorded'] > card['ticks'] * len(PER_TICK)
    assert card['depth_m']['max'] > 60.0
    assert card['distance_along_path_m'] > 200.0


def test_final_state_and_scores_are_identical(over_nodes, direct):
    assert direct.card['engine'] == 'direct'
    assert over_nodes.card.keys() == direct.card.keys()
    nodes, engine = (
        {name: value for name, value in flight.card.items() if name not in HOW}
        for flight in (over_nodes, direct)
    )
    assert nodes == engine


def test_recorded_payloads_are_identical(over_nodes, direct):
    nodes = digests(over_nodes.folder)
    assert set(nodes) == set(PER_TICK)
    assert all(count == over_nodes.card['ticks'] for count, _ in nodes.values())
    assert nodes == digests(direct.folder)


@pytest.mark.parametrize('flight', ['over_nodes', 'direct'])
def test_score_from_the_bag_is_the_score_of_the_run(glider, request, flight):
    recorded = request.getfixturevalue(flight)
    done = glider('score', recorded.folder, '--json')
    assert done.returncode == 0, done.stderr
    assert json.loads(done.stdout) == recorded.card


@pytest.fixture(scope='module')
def reckoned(glider, tmp_path_factory) -> dict[str, Path]:
    """Run folders of the flight by dead reckoning, by engine."""
    folders = {name: tmp_path_factory.mktemp('reckoned') / name for name in ('nodes', 'direct')}
    changes = [word for name, value in RECKONED.items() for word in ('--set', f'{name}={value}')]
    for name, folder in folders.items():
        done = glider(
            *('run', 'current_12deg', '--duration', RECKONED_S, *changes),
            *('--engine', name, '--out', folder, *['--bag'] * (name == 'direct'), '--no-report'),
        )
        assert done.returncode == 0, done.stderr
    return folders


def test_dead_reckoning_is_the_same_over_nodes(reckoned):
    """Sensors, estimates and all that follows from them, to the last bit; and the score."""
    nodes, engine = (digests(folder) for folder in reckoned.values())
    assert nodes == engine
    expected = set(PER_TICK) - {'/glider/measured_odom'}
    expected |= {f'/glider/{name}' for name in ('imu', 'pressure', 'fix', 'altitude', *ESTIMATES)}
    assert set(nodes) == expected
    assert {count for count, _ in nodes.values()} == {round(RECKONED_S / TICK_S)}
    cards = [json.loads((folder / 'score.json').read_text()) for folder in reckoned.values()]
    one, other = ({k: v for k, v in card.items() if k not in HOW} for card in cards)
    assert one == other


def test_dead_reckoning_had_fixes_and_lost_its_way_between_them(reckoned):
    """What is flown is what is believed, and not what is true."""
    blocks = RecordedLog(Bag(reckoned['direct']), ['fix']).blocks()
    log = np.concatenate([block.copy() for block in blocks])
    fixed = log[:, COLUMNS['fix'].start] == 0.0
    true, believed = (log[:, COLUMNS[name]][:, :2] for name in ('ground_truth/odom', 'odom'))
    apart_m = np.hypot(*(believed - true).T)
    surfacings = np.count_nonzero(np.diff(fixed.astype(int)) == 1)
    assert surfacings >= 2
    assert np.max(apart_m[~fixed]) > 50.0
    assert np.max(apart_m[fixed][-300:]) < 20.0


def test_altimeter_of_the_flight_heard_the_bottom_within_its_reach(reckoned):
    blocks = RecordedLog(Bag(reckoned['nodes']), ['altitude', 'ground_truth/odom']).blocks()
    log = np.concatenate([block.copy() for block in blocks])
    height = log[:, COLUMNS['altitude'].start]
    depth = -log[:, COLUMNS['ground_truth/odom'].start + 2]
    assert np.count_nonzero(height) > 300
    heard = height > 0.0
    assert np.max(np.abs(height + depth - 120.0)[heard]) < 1.5
    assert depth[heard].min() > 18.0
    assert depth[~heard].max() < 22.0


@pytest.mark.parametrize('engine', ['nodes', 'direct'])
def test_dead_reckoning_verifies(glider, reckoned, engine):
    done = glider('verify', reckoned[engine], '--json')
    assert done.returncode == 0, done.stderr
    blocks = {one['block']: one['result'] for one in json.loads(done.stdout)['blocks']}
    names = ('plant', 'current', 'navigation', 'guidance', 'control', 'guard')
    assert blocks == dict.fromkeys(names, 'identical')


def test_payloads_are_the_same_with_the_executor_of_rclpy(glider, over_nodes, tmp_path):
    done = glider(
        *('run', over_nodes.folder / 'scenario.yaml', '--engine', 'direct', '--bag'),
        *('--duration', 30, '--out', tmp_path / 'direct', '--no-report'),
    )
    assert done.returncode == 0, done.stderr
    flown = flown_by(
        over_nodes.folder,
        tmp_path / 'public',
        30.0,
        'autopilot',
        lambda name, module: ['-c', BY_RCLPY, module],
    )
    assert flown == digests(tmp_path / 'direct')
    assert all(count == 300 for count, _ in flown.values())


def test_first_ticks_are_recorded_though_the_recorder_is_slow(over_nodes, tmp_path):
    flown = flown_by(
        over_nodes.folder,
        tmp_path / 'slow',
        20.0,
        'together',
        lambda name, module: ['-c', SLOW_RECORDER] if name == RECORDER else ['-m', module],
    )
    assert all(count == 200 for count, _ in flown.values())
    assert len(flown) == len(PER_TICK)


def flown_by(
    of: Path, folder: Path, duration_s: float, layout: Layout, program
) -> dict[str, tuple[int, str]]:
    """Digests of a flight by nodes that are other programs, with the parameters of a run."""
    folder.mkdir()
    parameters = yaml.safe_load((of / PARAMETERS_FILE).read_text())
    parameters['/glider/plant_node']['ros__parameters']['duration_s'] = duration_s
    parameters['/glider/guidance_node']['ros__parameters']['duration_s'] = duration_s
    parameters['/glider/recorder_node']['ros__parameters']['folder'] = str(folder)
    (folder / PARAMETERS_FILE).write_text(yaml.safe_dump(parameters))
    commands = node_commands(folder / PARAMETERS_FILE, layout=layout)
    commands = {
        name: [sys.executable, *program(name, module), *ros]
        for name, (_, _, module, *ros) in commands.items()
    }
    result = run_nodes(commands, folder / 'log.txt', print)
    assert (result.status, result.reason) == ('completed', '')
    return digests(folder)
