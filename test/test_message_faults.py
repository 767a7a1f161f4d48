# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""Messages that are lost, cut, late, twice or out of order between nodes, on purpose.

In lockstep a flight is the same to the last bit, or ends and names what never came. Free-running
it goes on with the newest that it has.
"""

import hashlib
import json
import os
import signal
import time
from collections import Counter, defaultdict
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from pathlib import Path

import numpy as np
import pytest
from mcap.reader import make_reader

from glider_base.ros.wire.topics import TOPICS
from glider_base.wiring import publisher
from glider_bringup.engines.direct import fly_blocks
from glider_bringup.engines.flight import mission_of
from glider_bringup.engines.node_parameters import node_parameters, write_parameters
from glider_bringup.engines.processes import AUTOPILOT, node_commands, run_nodes
from glider_mission.blocks import COLUMNS
from glider_mission.scenario import load_scenario

#: One topic of each node.
STRUCK = ('measured_odom', 'current_velocity', 'odom', 'reference', 'demand', 'command')
DURATION_S = 60
#: A topic that is not struck, and the block that says it at every step.
WHOLE = {'tracking_error': 'guidance', 'wrench': 'control'}
#: Free-running: so many times real time, simulated time of the flight, and how it begins.
SPEED, FREE_S = 2.0, 60.0
#: The recorder is interrupted after so much time, and for so long (s, of a wall clock).
INTERRUPT_AFTER_S, INTERRUPTED_S = 10.0, 1.5
GLIDING = {
    **{'dives': 0, 'duration_s': FREE_S, 'initial.depth_m': 50.0, 'profile.prepare_s': 0.0},
    **{'initial.pitch_deg': -30.0, 'initial.speed_mps': 0.5, 'initial.net_heaviness_kg': 0.4},
}


def faults(how: str, share: float, topics=STRUCK, **more) -> str:
    """Faults of messages, as a person sets them."""
    kind = {'kind': 'message', 'how': how, 'share': share, **more}
    return json.dumps([{**kind, 'topic': topic} for topic in topics])


def digests(folder: Path) -> dict[str, tuple[int, str]]:
    """Number of messages of each per-tick topic, and a digest of their stamps and payloads."""
    counts, hashes = Counter(), defaultdict(hashlib.sha256)
    names = {topic.full_name('/glider') for topic in TOPICS.values() if topic.per_tick}
    (file,) = folder.glob('*.mcap')
    with file.open('rb') as stream:
        for _, channel, message in make_reader(stream).iter_messages(topics=names):
            counts[channel.topic] += 1
            hashes[channel.topic].update(message.log_time.to_bytes(8, 'big') + message.data)
    return {name: (counts[name], hashes[name].hexdigest()) for name in counts}


def fly(glider, folder: Path, *options):
    line = ('run', 'current_12deg', '--duration', DURATION_S, '--out', folder, '--json')
    return glider(*line, '--no-report', *options)


@pytest.fixture(scope='module')
def clean(glider, tmp_path_factory) -> dict[str, tuple[int, str]]:
    """The flight that nothing happens to."""
    folder = tmp_path_factory.mktemp('clean') / 'run'
    assert fly(glider, folder, '--engine', 'direct', '--bag').returncode == 0
    return digests(folder)


def test_twice_late_or_out_of_order_the_flight_is_the_same(glider, clean, tmp_path):
    struck = [
        *json.loads(faults('duplicate', 0.2)),
        *json.loads(faults('delay', 0.05, delay_s=0.002)),
        *json.loads(faults('reorder', 0.01)),
    ]
    done = fly(glider, tmp_path / 'run', '--set', f'faults={json.dumps(struck)}')
    assert done.returncode == 0, done.stderr
    assert digests(tmp_path / 'run') == clean
    assert json.loads(done.stdout)['messages_lost'] == 0


def test_a_message_that_never_comes_ends_the_flight_and_is_named(glider, tmp_path):
    topic = 'demand'
    struck = faults('corrupt', 0.05, [topic], at_s=20.0)
    done = fly(glider, tmp_path / 'run', '--set', f'faults={struck}')
    assert done.returncode == 1
    assert 'Traceback' not in done.stderr
    card = json.loads(done.stdout)
    assert card['status'] == 'aborted'
    assert publisher(topic).node in card['reason'] and topic in card['reason']
    assert 200 <= card['ticks'] < 10 * DURATION_S


def test_the_direct_engine_says_that_it_has_no_messages(glider, tmp_path):
    done = fly(
        *(glider, tmp_path / 'run', '--engine', 'direct'),
        *('--set', f'faults={faults("drop", 0.05)}'),
    )
    assert done.returncode == 2
    assert "faults.0.kind = 'message': the direct engine has no messages" in done.stderr


def test_where_the_vehicle_is_does_not_matter_to_a_message(glider, tmp_path):
    struck = faults('drop', 0.05, ['odom'], phase='dive')
    done = fly(glider, tmp_path / 'run', '--set', f'faults={struck}')
    assert done.returncode == 2
    assert 'a message goes wrong by time alone' in done.stderr


def off_track(places: np.ndarray) -> float:
    """Farthest (m) from a path that leads north through the origin; places east, north, up."""
    return float(np.max(np.abs(places[:, 0])))


def interrupt(folder: Path) -> bool:
    """Who writes into a folder has no time for a while, as on a busy computer; whether anybody."""
    time.sleep(INTERRUPT_AFTER_S)
    for file in Path('/proc').glob('[0-9]*/fd/*'):
        with suppress(OSError):
            if file.readlink().parent == folder:
                number = int(file.parts[2])
                os.kill(number, signal.SIGSTOP)
                time.sleep(INTERRUPTED_S)
                os.kill(number, signal.SIGCONT)
                return True
    return False


def test_free_running_it_flies_on(glider, tmp_path):
    """One message in twenty of each of six topics lacks: no more than twice as far off.

    By its recording nothing else is different: each step is computed again by what it had, and
    in a cycle without anything new a node says its answer again. The recorder, which is
    interrupted, misses nothing.
    """
    changes = {**GLIDING, 'faults': json.loads(faults('drop', 0.05))}
    clean, struck = (load_scenario('current_12deg', one) for one in (GLIDING, changes))
    rows = np.concatenate([rows.copy() for rows in fly_blocks(*mission_of(clean))])
    file, folder = tmp_path / 'nodes.yaml', tmp_path / 'run'
    folder.mkdir()
    told = node_parameters(struck, speed=SPEED, lockstep=False, record_to=folder)
    write_parameters({name: {**one, 'input_max_age_s': 2.0} for name, one in told.items()}, file)
    commands = {
        name: [*command, '-p', 'use_sim_time:=true']
        for name, command in node_commands(file, layout='autopilot').items()
    }
    # a starved machine is no bad line: at twice real time, 30 s are a minute
    commands[AUTOPILOT] += ['-p', 'guard_node:lost_after_s:=60.0']
    with ThreadPoolExecutor(1) as pool:
        interrupted = pool.submit(interrupt, folder)
        result = run_nodes(commands, tmp_path / 'nodes.log', lambda line: None)
    assert interrupted.result()
    assert result.status == 'completed', result.reason
    (bag,) = folder.glob('*.mcap')
    with bag.open('rb') as stream:
        reader = make_reader(stream)
        counts = {
            channel.topic: reader.get_summary().statistics.channel_message_counts.get(id_, 0)
            for id_, channel in reader.get_summary().channels.items()
        }
        truth = reader.iter_messages(topics=['/glider/ground_truth/odom'])
        flown = np.array([TOPICS['odom'].codec.decode(one.data)[1][:3] for _, _, one in truth])
        stamps = defaultdict(set)  # of each step: a busy machine misses some cycles
        for _, channel, one in reader.iter_messages(topics=[f'/glider/{one}' for one in WHOLE]):
            topic = channel.topic.removeprefix('/glider/')
            stamps[WHOLE[topic]].add(TOPICS[topic].codec.decode(one.data)[0])
    assert len(flown) > 0.8 * len(rows)
    assert counts['/glider/measured_odom'] == pytest.approx(0.95 * len(flown), rel=0.03)
    assert np.max(-flown[:, 2]) > 60.0  # it dives on, and was not brought up
    start = COLUMNS['ground_truth/odom'].start
    assert off_track(flown) < 2.0 * off_track(rows[:, start : start + 3])
    said = json.loads(glider('verify', folder, '--settings', file, '--json').stdout)
    for block, topic in {'guidance': 'reference', 'control': 'demand'}.items():
        (one,) = (one for one in said['blocks'] if one['block'] == block)
        assert (list(one['differing']), one['first']['recorded']) == ([topic], 'not recorded'), one
        assert one['ticks'] == len(stamps[block]) > 0
