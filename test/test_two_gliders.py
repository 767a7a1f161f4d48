# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""Several gliders in one ROS domain: each flies as if it were alone, or says why it cannot."""

import json
import signal
import time
from pathlib import Path

import pytest
from diagnostic_msgs.msg import DiagnosticArray
from mcap.reader import make_reader
from rclpy.serialization import deserialize_message

from command_line import Started
from glider_base.ros.places import domain_id
from glider_base.ros.wire.topics import recorded_topics
from glider_bringup.engines.processes import node_environment

DEADLINE_S = 300.0
DURATION_S = 40
FLOWN_BYTES = 300_000  #: of recording: several chunks are on disk
#: Scenario by namespace.
GLIDERS = {'alpha': 'rough_water', 'beta': 'current_8deg'}
PER_TICK = [
    topic.name.strip('/') for topic in recorded_topics(['measured_odom']) if topic.per_tick
]


def start(domain: int, scenario: str, out: Path, *options) -> Started:
    """A run in a domain that is not its own."""
    words = ('run', scenario, '--out', out, '--json', '--no-report', *options)
    said = out.parent / f'{out.name}_said'
    said.mkdir()
    return Started(words, node_environment(domain), said)


@pytest.fixture(scope='module')
def together(tmp_path_factory):
    """Folders and scorecards of the gliders, flown at the same time."""
    folders = {name: tmp_path_factory.mktemp('two') / name for name in GLIDERS}
    with domain_id() as domain:
        runs = {
            name: start(
                *(domain, scenario, folders[name]),
                *('--namespace', name, '--duration', DURATION_S),
            )
            for name, scenario in GLIDERS.items()
        }
        said = {name: run.communicate(timeout=DEADLINE_S) for name, run in runs.items()}
    assert {name: run.returncode for name, run in runs.items()} == dict.fromkeys(GLIDERS, 0), said
    return {name: (folders[name], json.loads(said[name][0])) for name in GLIDERS}


def wait_for_recording(folder: Path, run: Started) -> None:
    """Return once some of a flight is on disk."""
    end = time.monotonic() + DEADLINE_S
    while not any(file.stat().st_size > FLOWN_BYTES for file in folder.glob('*.mcap')):
        assert run.poll() is None, run.communicate()
        assert time.monotonic() < end
        time.sleep(0.05)


def recorded(folder: Path, prefix: str) -> dict[str, list[tuple[int, bytes]]]:
    """Stamps and payloads by topic, named without the namespace."""
    found = {}
    (file,) = folder.glob('*.mcap')
    with file.open('rb') as stream:
        for _, channel, message in make_reader(stream).iter_messages():
            name = channel.topic.removeprefix(prefix).strip('/')
            found.setdefault(name, []).append((message.log_time, message.data))
    return found


@pytest.mark.parametrize('name', GLIDERS)
def test_a_glider_flies_as_if_it_were_alone(glider, together, tmp_path, name):
    folder, card = together[name]
    assert (card['status'], card['messages_lost']) == ('completed', 0)
    done = glider(
        *('run', GLIDERS[name], '--duration', DURATION_S, '--out', tmp_path / 'alone'),
        *('--engine', 'direct', '--bag', '--no-report'),
    )
    assert done.returncode == 0, done.stderr
    flown, alone = recorded(folder, f'/{name}/'), recorded(tmp_path / 'alone', '/glider/')
    assert len(flown['odom']) == 10 * DURATION_S
    assert {topic: flown[topic] for topic in PER_TICK} == {
        topic: alone[topic] for topic in PER_TICK
    }
    assert flown['path'] == alone['path']


@pytest.mark.parametrize('name', GLIDERS)
def test_a_bag_has_the_diagnostics_of_its_own_glider_only(together, name):
    folder, _ = together[name]
    said = {
        status.name
        for _, payload in recorded(folder, f'/{name}/')['diagnostics']
        for status in deserialize_message(payload, DiagnosticArray).status
    }
    assert f'/{name}/guidance_node' in said
    assert {full.rpartition('/')[0] for full in said} == {f'/{name}'}


@pytest.fixture(scope='module')
def rivals(tmp_path_factory):
    """A second glider in the namespace of the first: its exit code and words; the first's folder
    and scorecard."""
    folder = tmp_path_factory.mktemp('rivals')
    with domain_id() as domain:
        slow = ('--duration', 'full', '--speed', 10)  # what is flown meanwhile is flown again
        first = start(domain, 'current_8deg', folder / 'first', *slow)
        try:
            wait_for_recording(folder / 'first', first)
            second = start(domain, 'rough_water', folder / 'second')
            _, message = second.communicate(timeout=DEADLINE_S)
        finally:
            first.send_signal(signal.SIGTERM)
            out, _ = first.communicate(timeout=DEADLINE_S)
    return second.returncode, message, folder / 'first', json.loads(out)


def test_a_second_glider_in_the_namespace_of_the_first_is_refused(rivals):
    code, message, _, card = rivals
    assert code == 1
    # the node that notices first says it, wherever the line is broken
    assert 'is published by /glider/' in ' '.join(message.split())
    assert 'a clock of its own' in ' '.join(message.split())
    assert card['reason'] == 'stopped by SIGTERM'


def test_a_second_glider_in_the_namespace_of_the_first_does_not_disturb_it(
    glider, rivals, tmp_path
):
    _, _, folder, card = rivals
    assert (card['reason'], card['messages_lost']) == ('stopped by SIGTERM', 0)
    whole_s = card['ticks'] // 10 - 1  # the last ticks may have been cut short
    done = glider(
        *('run', 'current_8deg', '--duration', whole_s, '--out', tmp_path / 'alone'),
        *('--engine', 'direct', '--bag', '--no-report'),
    )
    assert done.returncode == 0, done.stderr
    flown, alone = recorded(folder, '/glider/'), recorded(tmp_path / 'alone', '/glider/')
    for topic in PER_TICK:
        assert flown[topic][: 10 * whole_s] == alone[topic], topic
    assert flown['path'] == alone['path']
