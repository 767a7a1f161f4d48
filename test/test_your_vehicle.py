# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""A vehicle from outside on a bad line, flown by free-running nodes, or by the autopilot.

It publishes odom itself, or what its sensors take, for navigation. The stand-in of examples/ is a
process of its own, with its own clock, twice as fast as real time. Its line delays, loses
and, for three seconds, is silent.
"""

import signal
import subprocess
import sys
import threading
import time
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pytest
import rclpy
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from geometry_msgs.msg import Vector3Stamped
from nav_msgs.msg import Odometry
from rcl_interfaces.srv import SetParameters
from rclpy.context import Context
from rclpy.executors import SingleThreadedExecutor
from rclpy.parameter import Parameter
from rclpy.signals import SignalHandlerOptions
from sensor_msgs.msg import JointState
from std_srvs.srv import Trigger

from command_line import Started
from glider_base.ros.lockstep import health
from glider_base.ros.places import domain_id
from glider_base.ros.wire import qos
from glider_base.ros.wire.codec import to_cdr
from glider_base.ros.wire.topics import TOPICS
from glider_base.signals import TICK_S
from glider_base.wiring import NAVIGATION
from glider_bringup.engines.direct import fly_blocks
from glider_bringup.engines.flight import mission_of
from glider_bringup.engines.node_parameters import node_parameters, write_parameters
from glider_bringup.engines.processes import AUTOPILOT, ON_BOARD, node_commands, node_environment
from glider_mission.scenario import load_scenario

STAND_IN = Path(__file__).resolve().parents[1] / 'examples' / 'stand_in.py'
SPEED, LOSS = 2.0, 0.05
#: Seconds of the vehicle's time after its start.
START_S, SILENCE_S, CHANGE_S, ABORT_S, END_S = 1000.0, 40.0, 65.0, 80.0, 95.0
SILENT_S, MAX_AGE_S = 3.0, 2.0
FLIGHT = {'profile.prepare_s': 0.0}
#: What a vehicle that does not know its place has in its scenario beside that.
RECKONED = {
    **{'navigation.method': 'dead_reckoned'},
    **{'sensors.imu_period_s': 4.0, 'sensors.gyro': False},
}
#: How far odom may be from the truth (m), horizontally and in depth: navigation knows neither the
#: current, 4 m until the abort, nor the 0.5 m/s of the start, when it has too few samples. A busy
#: machine makes that longer, and depth drifts at 0.2 m/s until pressures come: told from FED_S on.
OFF_M, FED_S = (15.0, 1.0), 20.0
#: How the stand-in begins.
GLIDING = {'heading_deg': 30.0, 'pitch_deg': -30.0, 'speed_mps': 0.5, 'net_heaviness_kg': 0.4}
#: All the buoyancy there is; the mass holds it level for the pump.
SAFE = {'buoyancy_engine': -1.0, 'pitch_mass': 0.0, 'roll_mass': 0.0}
DEADLINE_S = 200.0
#: Flights by their names: whether the vehicle navigates itself, and whether by the autopilot;
#: both ways of both.
FLIGHTS = {'odom_autopilot': (True, True), 'sensors': (False, False)}
#: Flights start their nodes one after the other.
STARTING = threading.Lock()


def stamp_s(message) -> float:
    """Time of a message after the start of the vehicle (s)."""
    return message.header.stamp.sec + message.header.stamp.nanosec / 1e9 - START_S


class Told(NamedTuple):
    """A status on /diagnostics."""

    t_s: float
    node: str
    level: bytes
    message: str
    values: dict


class Watch:
    """What passed between the nodes and the vehicle."""

    def __init__(self, context: Context) -> None:
        self.node = rclpy.create_node('watch', namespace='/glider', context=context)
        self.executor = SingleThreadedExecutor(context=context)
        self.executor.add_node(self.node)
        self.odom, self.errors, self.commands, self.told, self.ready = [], [], [], [], set()
        self.joints, self.truth = [], []
        for kind, name, keep in (
            (Odometry, 'odom', self.odom.append),
            (Vector3Stamped, 'tracking_error', self.errors.append),
            (Odometry, 'ground_truth/odom', self.truth.append),
            (JointState, 'command', self.commands.append),
            (JointState, 'joint_states', self.joints.append),
        ):
            self.node.create_subscription(kind, name, keep, 1000)
        self.node.create_subscription(
            DiagnosticArray, '/diagnostics', self.on_diagnostics, qos.EVENTS
        )
        self.node.create_subscription(DiagnosticArray, 'lockstep', self.on_report, qos.EVENTS)

    def on_report(self, array) -> None:
        self.ready |= {r.node for r in health.reports_in(array) if r.phase == health.READY}

    def on_diagnostics(self, array) -> None:
        for status in array.status:
            values = {pair.key: pair.value for pair in status.values}
            told = Told(stamp_s(array), status.name, status.level, status.message, values)
            self.told.append(told)

    def until(self, condition) -> None:
        """Listen until something is the case."""
        end = time.monotonic() + DEADLINE_S
        while not condition():
            assert time.monotonic() < end
            self.executor.spin_once(timeout_sec=0.05)

    def until_s(self, t_s: float) -> None:
        """Listen until a time of the vehicle."""
        self.until(lambda: self.odom and stamp_s(self.odom[-1]) >= t_s)

    def call(self, kind, name: str, request):
        """Answer of a service."""
        client = self.node.create_client(kind, name)
        self.until(client.service_is_ready)
        future = client.call_async(request)
        self.until(future.done)
        return future.result()

    def told_by(self, node: str, text: str) -> list[Told]:
        """Statuses of a node that say something."""
        return [told for told in self.told if told.node == node and text in told.message]

    def commands_between(self, start_s: float, end_s: float) -> list[dict[str, float]]:
        return [
            dict(zip(command.name, command.position, strict=True))
            for command in self.commands
            if start_s <= stamp_s(command) < end_s
        ]


def options(**parameters) -> list[str]:
    """Parameters on a command line."""
    return [word for name, value in parameters.items() for word in ('-p', f'{name}:={value}')]


class Flown(NamedTuple):
    """A flight, and whether the vehicle published odom itself."""

    watch: Watch
    navigates: bool


def commands_on_board(file: Path, navigates: bool, autopilot: bool) -> dict[str, list[str]]:
    """What is started on board, by name."""
    commands = node_commands(file, layout='autopilot' if autopilot else 'processes')
    parts = [wired for wired in ON_BOARD if not (navigates and wired == NAVIGATION)]
    if not autopilot:
        return {wired.node: commands[wired.node] for wired in parts}
    python, _, module, *ros = commands[AUTOPILOT]
    return {AUTOPILOT: [python, '-m', module, *(wired.name for wired in parts), *ros]}


@pytest.fixture(scope='module')
def flights(tmp_path_factory):
    """All flights by their names, at the same time: each waits more than it computes."""
    with ThreadPoolExecutor(len(FLIGHTS)) as pool:
        yield {
            name: pool.submit(fly, *how, tmp_path_factory.mktemp(name))
            for name, how in FLIGHTS.items()
        }


@pytest.fixture(scope='module', params=FLIGHTS)
def flown(request, flights) -> Flown:
    """One of them."""
    return flights[request.param].result()


def fly(navigates: bool, autopilot: bool, folder: Path) -> Flown:
    """A flight: a silence, a gain changed on the way, an abort."""
    file = folder / 'nodes.yaml'
    scenario = load_scenario('current_8deg', {**FLIGHT, **({} if navigates else RECKONED)})
    write_parameters(node_parameters(scenario, lockstep=False), file)
    nodes = {wired.node for wired in ON_BOARD if not (navigates and wired == NAVIGATION)}
    context, processes = Context(), []
    faults = {'speed': SPEED, 'loss': LOSS, 'silence_at_s': SILENCE_S, 'silence_s': SILENT_S}
    with domain_id() as domain:
        environment = node_environment(domain)
        rclpy.init(
            context=context, domain_id=domain, signal_handler_options=SignalHandlerOptions.NO
        )
        watch = Watch(context)
        try:
            for name, command in commands_on_board(file, navigates, autopilot).items():
                _, _, module, *words = command
                words += options(use_sim_time='true', input_max_age_s=MAX_AGE_S)
                (folder / name).mkdir()
                with STARTING:
                    processes.append(Started(words, environment, folder / name, module))
            watch.until(lambda: watch.ready == nodes)
            stand_in = [sys.executable, STAND_IN, '--ros-args', '-r', '__ns:=/glider']
            stand_in += options(**faults, duration_s=END_S, listeners=7 if navigates else 8)
            stand_in += options(navigates=str(navigates).lower())
            processes.append(subprocess.Popen(stand_in, env=environment))
            watch.until_s(CHANGE_S)
            gain = Parameter('adaptive.roll.kp', value=5.0)
            request = SetParameters.Request(parameters=[gain.to_parameter_msg()])
            answer = watch.call(SetParameters, 'control_node/set_parameters', request)
            assert [result.successful for result in answer.results] == [True]
            watch.until_s(ABORT_S)
            assert watch.call(Trigger, 'abort', Trigger.Request()).success
            watch.until(lambda: processes[-1].poll() is not None)
            for process in processes[:-1]:
                process.send_signal(signal.SIGTERM)
            assert {process.wait(DEADLINE_S) for process in processes} == {0}
        finally:
            for process in processes:
                process.kill()
            watch.executor.shutdown()
            watch.node.destroy_node()
            rclpy.try_shutdown(context=context)
    return Flown(watch, navigates)


@pytest.fixture
def flight(flown) -> Watch:
    """What passed between nodes and vehicle."""
    return flown.watch


def undisturbed() -> np.ndarray:
    """Log rows of the same flight in lockstep, by the direct engine."""
    scenario = load_scenario(
        'current_8deg',
        {
            **FLIGHT,
            **{'dives': 0, 'duration_s': END_S, 'initial.depth_m': 50.0},
            **{f'initial.{name}': value for name, value in GLIDING.items()},
            'current': {
                'components': [{'kind': 'constant', 'speed_mps': 0.05, 'direction_deg': 90.0}]
            },
        },
    )
    return np.concatenate([block.copy() for block in fly_blocks(*mission_of(scenario))])


def odometry_of(messages) -> dict[int, tuple[float, ...]]:
    """Numbers of odometry until the abort, by tick."""
    decode = TOPICS['odom'].codec.decode
    return {
        round(stamp_s(message) / TICK_S): decode(to_cdr(message))[1]
        for message in messages
        if 1.0 < stamp_s(message) < ABORT_S
    }


def test_track_and_depth_are_nearly_those_of_a_perfect_line(flown):
    """It begins 30 deg off its course, and has to turn through it to come back to its path."""
    if not flown.navigates:
        pytest.skip('without odom from the start it surfaces until there is an attitude')
    ideal, known = undisturbed(), odometry_of(flown.watch.odom)
    assert len(known) > 0.8 * ABORT_S / TICK_S
    apart_m = [np.abs(np.array(known[k][:3]) - ideal[k, :3]) for k in known]
    assert np.max(apart_m) < 1.0


def test_odom_is_where_it_is(flown):
    known, truth = odometry_of(flown.watch.odom), odometry_of(flown.watch.truth)
    both = sorted(known.keys() & truth.keys())
    assert len(both) > 0.5 * ABORT_S / TICK_S
    off_m = np.abs([np.subtract(known[k][:3], truth[k][:3]) for k in both])
    assert np.max(np.hypot(off_m[:, 0], off_m[:, 1])) < OFF_M[0]
    fed = np.array(both) * TICK_S >= FED_S
    assert np.max(off_m[fed, 2]) < OFF_M[1]


def test_line_was_as_bad_as_it_is_said_to_be(flight):
    gaps_s = [
        stamp_s(after) - stamp_s(before)
        for before, after in zip(flight.joints[:-1], flight.joints[1:], strict=True)
    ]
    assert max(gaps_s) == pytest.approx(SILENT_S, abs=0.35)
    lost = sum(round(gap_s / 0.1) - 1 for gap_s in gaps_s if 0.15 < gap_s < 1.0)
    assert lost / (10 * END_S) == pytest.approx(LOSS, abs=0.03)


def test_lost_and_late_inputs_are_counted_and_told(flight):
    told = flight.told_by('/glider/guidance_node', 'inputs: ')[-1]
    stamps = [stamp_s(message) for message in flight.odom if stamp_s(message) <= told.t_s]
    lacking = sum(
        round((after - before) / 0.1) - 1
        for before, after in zip(stamps[:-1], stamps[1:], strict=True)
        if 0.15 < after - before < 1.0
    )
    assert told.t_s > ABORT_S - 15.0
    assert int(told.values['odom_lost']) >= 0.8 * lacking > 0
    assert int(told.values['odom_late']) > 0
    levels = {told.level for told in flight.told_by('/glider/guidance_node', 'inputs: ')}
    assert DiagnosticStatus.WARN in levels


def test_safe_state_is_commanded_in_the_silence_and_named(flight):
    silence = flight.commands_between(SILENCE_S - 0.5, SILENCE_S + SILENT_S)
    assert SAFE in silence
    told = flight.told_by('/glider/guard_node', 'commanding the safe state')
    in_silence = [t for t in told if abs(t.t_s - SILENCE_S) < 1.0]
    assert in_silence
    assert {t.level for t in in_silence} == {DiagnosticStatus.ERROR}


def test_flight_goes_on_when_inputs_are_back(flight):
    fresh = [
        told
        for told in flight.told_by('/glider/guard_node', 'inputs are fresh again')
        if told.t_s > SILENCE_S
    ]
    assert fresh
    assert fresh[0].t_s < SILENCE_S + SILENT_S + 3.0
    assert fresh[0].level == DiagnosticStatus.OK
    after = flight.commands_between(SILENCE_S + SILENT_S + 5.0, ABORT_S)
    assert len(after) > 0.5 * 10 * (ABORT_S - SILENCE_S - SILENT_S - 5.0)
    assert SAFE not in after
    assert all(command['buoyancy_engine'] > 0.2 for command in after)


def test_abort_brings_it_up(flight):
    assert flight.told_by('/glider/guidance_node', 'surfacing on abort')
    assert flight.commands_between(END_S - 5.0, END_S)[-1]['buoyancy_engine'] < -0.2
