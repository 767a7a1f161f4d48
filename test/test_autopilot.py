# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""Navigation, guidance and control in one process: the same flight, the same ways to end."""

import hashlib
import json
import os
import signal
import time
from contextlib import ExitStack
from pathlib import Path
from typing import NamedTuple

import pytest
import yaml

import command_line
from glider_base.ros.places import domain_id
from glider_bringup.engines.node_parameters import node_parameters, write_parameters
from glider_bringup.engines.processes import (
    AUTOPILOT,
    AUTOPILOT_MODULE,
    node_commands,
    node_environment,
)
from glider_bringup.engines.recorded import fly_nodes, fly_recorded
from glider_bringup.scoring.score import Scorer, scores_of
from glider_mission.run_folder import make_run_folder
from glider_mission.scenario import load_scenario

CHANGES = {'dives': 0, 'duration_s': 60.0, 'navigation.method': 'dead_reckoned'}
DEADLINE_S = 120.0
SIGNALS = [signal.SIGINT, signal.SIGTERM]


def digest(folder: Path) -> str:
    """Of the recording of a run, to the last byte."""
    (file,) = folder.glob('*.mcap')
    return hashlib.sha256(file.read_bytes()).hexdigest()


@pytest.fixture(scope='module')
def flights(tmp_path_factory) -> dict:
    """Folder and scores of one flight: some nodes in a process, all, each in its own, none."""
    scenario, parent = load_scenario('rough_water', CHANGES), tmp_path_factory.mktemp('autopilot')
    flown = {}
    for name, options in (
        ('autopilot', {'layout': 'autopilot'}),
        ('together', {}),
        ('alone', {'layout': 'processes'}),
        ('direct', None),
    ):
        folder, scorer = make_run_folder(scenario, parent / name), Scorer(scenario)
        if options is None:
            flight = fly_recorded(scenario, folder, [scorer])
        else:
            flight = fly_nodes(scenario, folder, [scorer], **options)
        assert (flight.status, flight.reason) == ('completed', '')
        assert not flight.messages_lost
        flown[name] = (folder, scores_of(scenario, scorer))
    return flown


@pytest.mark.parametrize('other', ['autopilot', 'alone', 'direct'])
def test_scores_are_the_same(flights, other):
    assert flights['together'][1] == flights[other][1]


@pytest.mark.parametrize('other', ['autopilot', 'alone'])
def test_recording_is_the_same_to_the_last_byte(flights, other):
    assert digest(flights['together'][0]) == digest(flights[other][0])


def test_who_records_by_hand_is_told_of_the_sensors(glider):
    """The recorder of a vehicle that reckons its place has to hear what it reckons by."""
    said = glider('autopilot', 'reckoned_12deg', '--print-parameters')
    told = yaml.safe_load(said.stdout)['/glider/recorder_node']['ros__parameters']
    assert {'imu', 'pressure', 'fix'} <= set(json.loads(told['topics']))


@pytest.mark.parametrize(
    ('words', 'waits'),
    [
        ([], True),
        (['--no-navigation'], False),
        (['--no-navigation', '--set', 'sensors.also_fitted=[pressure]'], True),
    ],
)
def test_guard_waits_for_no_pressure_where_the_vehicle_publishes_odom(glider, words, waits):
    said = glider('autopilot', 'reckoned_12deg', *words, '--print-parameters')
    told = yaml.safe_load(said.stdout)['/glider/guard_node']['ros__parameters']
    assert told['pressure'] == waits


def test_a_route_that_is_planned_in_flight_is_refused(glider):
    said = glider('autopilot', 'survey', '--set', 'guidance.route=planned', '--print-parameters')
    assert (said.returncode, said.stdout) == (2, '')
    assert "guidance.route = 'planned': not over nodes" in said.stderr


def test_recording_verifies(glider, flights):
    done = glider('verify', flights['together'][0])
    assert done.returncode == 0, done.stdout + done.stderr


class Started(NamedTuple):
    """A process and what it says."""

    process: command_line.Started
    log: Path

    def has_said(self, *words: str) -> bool:
        """Wait until it has said all of these."""
        end = time.monotonic() + DEADLINE_S
        while not all(word in self.log.read_text() for word in words):
            if time.monotonic() > end:
                return False
            time.sleep(0.1)
        return True


@pytest.fixture(scope='module')
def waiting(tmp_path_factory):
    """What waits, by name: an autopilot for each signal, and one beside a plant that gives up.

    Each in a ROS domain of its own, all at the same time: it takes 10 s until they say so. The
    plant is started then: its 10 s are for what is up, however busy the machine is.
    """
    folder = tmp_path_factory.mktemp('waiting')
    file = folder / 'parameters.yaml'
    write_parameters(node_parameters(load_scenario('current_8deg'), speed=1.0), file)
    commands, started = node_commands(file, layout='autopilot'), {}

    def start(name: str, node: str, domain: int, *words: str) -> None:
        log = folder / name / 'stderr'
        log.parent.mkdir()
        log.touch()
        _, _, module, *ros = commands[node]
        process = command_line.Started(
            [*ros, *words], node_environment(domain), log.parent, module
        )
        started[name] = Started(process, log)

    with ExitStack() as stack:
        stack.enter_context(pytest.MonkeyPatch.context()).delenv('ROS_DOMAIN_ID', raising=False)
        domain = stack.enter_context(domain_id())
        start('beside_plant', AUTOPILOT, domain)
        for number in SIGNALS:
            start(number.name, AUTOPILOT, stack.enter_context(domain_id()))
        assert started['beside_plant'].has_said('navigation_node', 'control_node')
        start('plant', 'plant_node', domain, '-p', 'startup_timeout_s:=10.0')
        yield started
        for one in started.values():
            one.process.kill()


@pytest.mark.parametrize('number', SIGNALS)
def test_signal_ends_it_cleanly(waiting, number):
    autopilot = waiting[number.name]
    assert autopilot.has_said('navigation_node', 'control_node')  # that they wait for the plant
    autopilot.process.send_signal(number)
    assert autopilot.process.wait(DEADLINE_S) == 0
    assert 'Traceback' not in autopilot.log.read_text()


def test_it_leaves_when_the_plant_gives_up(waiting):
    autopilot, plant = waiting['beside_plant'], waiting['plant']
    assert plant.process.wait(DEADLINE_S) == 3
    assert 'current_node has not appeared' in plant.log.read_text()
    assert 'navigation_node has not' not in plant.log.read_text()
    assert autopilot.process.wait(DEADLINE_S) == 0


def refused(tmp_path, words, **more) -> str:
    """What it says on standard error as it refuses to start."""
    env = {'ROS_AUTOMATIC_DISCOVERY_RANGE': 'LOCALHOST', **os.environ, **more}
    process = command_line.Started(words, env, tmp_path, AUTOPILOT_MODULE)
    _, error = process.communicate(DEADLINE_S)
    assert process.returncode == 2
    assert 'Traceback' not in error
    return error


@pytest.mark.parametrize(
    ('words', 'said'),
    [
        (  # in a namespace, where rcl knows no parameter of one node
            ['--ros-args', '-r', '__ns:=/glider', '-p', 'control_node:law:=bang'],
            "control_node: parameter law = 'bang'",
        ),
        (['--ros-args', '-p', 'law:=pid'], 'navigation_node: parameter law: unknown'),
        (['--ros-args', '--params-file', 'nix.yaml'], 'bad command line'),
        (['--ros-args', '-p', 'nonsense'], 'bad command line'),
        (['--ros-args', '-p', 'use_sim_time:=1'], "Trying to set parameter 'use_sim_time' to '1'"),
        (
            ['plant'],
            'autopilot: plant: no such part (allowed: navigation, guidance, control, guard)',
        ),
    ],
)
def test_what_it_cannot_use_is_named(tmp_path, words, said):
    assert f'fatal: {said}' in refused(tmp_path, words)


def test_a_folder_for_logs_that_cannot_be_made_is_named(tmp_path):
    error = refused(tmp_path, [], ROS_HOME='/proc/none', ROS_LOG_DIR='')
    assert 'fatal: no folder for logs: failed to initialize logging' in error
