# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""A driver that is killed in flight and is back within seconds: flown on, told, recorded.

A simulated plant of somebody else ends its run meanwhile. Driver, autopilot and recorder are
processes of their own. What the middleware knows of the dead driver stays listed for longer than
the guard would wait. What it publishes is reliable at first, and once it is back with best effort.
"""

import json
import signal
import subprocess
import sys
import time
from pathlib import Path
from types import SimpleNamespace

import pytest
import rclpy
from diagnostic_msgs.msg import DiagnosticArray
from mcap.reader import make_reader
from nav_msgs.msg import Path as PathMessage
from rclpy.context import Context
from rclpy.executors import SingleThreadedExecutor
from rclpy.parameter import Parameter
from rclpy.serialization import serialize_message
from sensor_msgs.msg import JointState, NavSatFix

from glider_base.ros.lockstep import health
from glider_base.ros.places import domain_id
from glider_base.ros.wire import qos
from glider_base.ros.wire.topics import PLANT, topic_of
from glider_base.wiring import JOINTS
from glider_bringup.engines.node_parameters import node_parameters, write_parameters
from glider_bringup.engines.processes import AUTOPILOT, RECORDER, node_commands, node_environment
from glider_mission.scenario import load_scenario

EXAMPLES = Path(__file__).resolve().parents[1] / 'examples'
#: A vehicle that glides down whatever happens, by the clock of the machine, and whose actuators
#: are where they were told to be; they stay there while nobody drives.
DRIVER = """
import json, math, sys, time
from pathlib import Path
sys.path.insert(0, sys.argv[1])
import rclpy
from driver import Driver, JOINTS
from rclpy.qos import qos_profile_sensor_data

START_S, PLACES, QOS = float(sys.argv[2]), Path(sys.argv[3]), sys.argv[4]


class OurDriver(Driver):
    def create_publisher(self, kind, topic, qos, **more):
        if QOS == 'best_effort' and topic in ('odom', 'joint_states'):
            qos = qos_profile_sensor_data
        return super().create_publisher(kind, topic, qos, **more)


class Glider:
    def time_ns(self):
        return time.time_ns()

    def navigation(self):
        t_s, half = time.time() - START_S, math.radians(10.0)
        pose = (0.0, 0.3 * t_s, -50.0 - 0.1 * t_s)
        facing = (math.cos(half) * math.sqrt(0.5), -math.sin(half) * math.sqrt(0.5),
                  math.sin(half) * math.sqrt(0.5), math.cos(half) * math.sqrt(0.5))
        return pose, facing, (0.316, 0.0, 0.0), (0.0, 0.0, 0.0)

    def actuators(self):
        return json.loads(PLACES.read_text())

    def move(self, targets):
        draft = PLACES.with_suffix('.part')
        draft.write_text(json.dumps([targets[joint] for joint in JOINTS]))
        draft.replace(PLACES)


rclpy.init(args=sys.argv)
driver = OurDriver(Glider())
driver.start()
rclpy.spin(driver)
"""
#: A recorder to which the middleware tells the names of nodes after their first messages.
LATE_NAMES = """
import sys
from glider_base.ros.lockstep import peers
from glider_bringup.nodes import recorder_node

told, named = peers.publishers, set()


def publishers(node, topic):
    names = told(node, topic)
    if names and topic.name not in named:
        named.add(topic.name)
        return dict.fromkeys(names, '')
    return names


peers.publishers = publishers
sys.exit(recorder_node.main())
"""
#: The driver is away for so long (s), and what follows.
AWAY_S, AFTER_S, DEADLINE_S = 3.5, 6.0, 120.0
#: So long (s) the recorder is stopped before.
STOPPED_S = 2.5


class Heard:
    """What passed between driver and autopilot, with the wall time."""

    def __init__(self, context: Context) -> None:
        self.node = rclpy.create_node('watch', namespace='/glider', context=context)
        self.executor = SingleThreadedExecutor(context=context)
        self.executor.add_node(self.node)
        self.commands, self.told, self.ready = [], [], set()
        self.node.create_subscription(JointState, 'command', self.on_command, 100)
        self.node.create_subscription(DiagnosticArray, '/diagnostics', self.on_told, qos.EVENTS)
        self.node.create_subscription(DiagnosticArray, 'lockstep', self.on_report, qos.EVENTS)
        self.path = self.node.create_publisher(PathMessage, 'path', qos.LATCHED)
        self.end = self.node.create_publisher(DiagnosticArray, 'lockstep', qos.EVENTS)

    def on_command(self, command) -> None:
        pump = dict(zip(command.name, command.position, strict=True))['buoyancy_engine']
        self.commands.append((time.monotonic(), pump))

    def on_told(self, array) -> None:
        for status in array.status:
            self.told.append((time.monotonic(), status.name, status.message))

    def on_report(self, array) -> None:
        self.ready |= {r.node for r in health.reports_in(array) if r.phase == health.READY}

    def disturb(self) -> None:
        """Say what a simulated run of somebody else says, and bytes that are no path."""
        self.path.publish(b'\0\1\0\0')
        report = health.Report(PLANT, health.FINISHED, health.COMPLETE, process='another')
        self.end.publish(health.report_array(report))

    def takers(self) -> set[str]:
        """Nodes that said that a new driver takes the place of the old one."""
        words = 'takes the place of /glider/driver'
        return {node for _, node, said in self.told if words in said}

    def until(self, condition) -> None:
        end = time.monotonic() + DEADLINE_S
        while not condition():
            assert time.monotonic() < end
            self.executor.spin_once(timeout_sec=0.05)

    def listen(self, for_s: float) -> None:
        end = time.monotonic() + for_s
        self.until(lambda: time.monotonic() > end)


@pytest.fixture(scope='module')
def flight(tmp_path_factory):
    """What was heard; when the driver was killed and started again, and the end; the recording."""
    folder = tmp_path_factory.mktemp('restart')
    script, places = folder / 'driver.py', folder / 'places.json'
    printed = folder / 'recorder.txt'
    script.write_text(DRIVER)
    places.write_text('[0.4, 0.0, 0.0]')
    scenario = load_scenario('current_8deg', {'profile.prepare_s': 0.0})
    write_parameters(
        node_parameters(scenario, lockstep=False, record_to=folder), folder / 'nodes.yaml'
    )
    commands = node_commands(folder / 'nodes.yaml', layout='autopilot')
    python, option, module, *ros = commands[AUTOPILOT]
    aboard = [python, option, module, 'guidance', 'control', 'guard', *ros]
    driver = [sys.executable, script, EXAMPLES, str(time.time()), places]
    space = ['--ros-args', '-r', '__ns:=/glider']
    context, processes = Context(), []
    with domain_id() as domain:
        environment = node_environment(domain)

        def start(command, **options) -> subprocess.Popen:
            command = list(map(str, command))
            processes.append(subprocess.Popen(command, env=environment, **options))
            return processes[-1]

        def recorded_s() -> float:
            """Stamp (s) of the newest odom that the recorder has, by what it prints."""
            lines = printed.read_text().rpartition('\n')[0].splitlines()
            return json.loads(lines[-1])['t_s'] if lines else 0.0

        rclpy.init(context=context, domain_id=domain)
        heard = Heard(context)
        try:
            autopilot = start([*aboard, '-p', 'record:=false'])
            with printed.open('w') as stream:
                recorder = start(
                    [python, '-c', LATE_NAMES, *commands[RECORDER][3:]], stdout=stream
                )
            nodes = {'guidance_node', 'control_node', 'guard_node', RECORDER}
            heard.until(lambda: heard.ready >= nodes)
            first = start([*driver, 'reliable', *space])
            heard.until(lambda: heard.commands and heard.commands[-1][1] > 0.2 and recorded_s())
            heard.disturb()
            recorder.send_signal(signal.SIGSTOP)  # it has no time, and asks for all of it again
            heard.listen(STOPPED_S)
            recorder.send_signal(signal.SIGCONT)
            going_on_s = time.time()
            heard.until(lambda: recorded_s() > going_on_s)
            first.kill()
            killed_s = time.monotonic()
            heard.listen(AWAY_S)
            start([*driver, 'best_effort', *space])
            back_s, back_at_s = time.monotonic(), time.time()
            heard.until(lambda: len(heard.takers()) == 3)
            heard.until(lambda: recorded_s() > back_at_s)
            heard.listen(AFTER_S)
            ended_s = time.monotonic()
            for process in (autopilot, recorder):
                process.terminate()
                assert process.wait(DEADLINE_S) == 0
        finally:
            for process in processes:
                process.kill()
                process.wait()
            heard.executor.shutdown()
            heard.node.destroy_node()
            rclpy.try_shutdown(context=context)
    (bag,) = folder.glob('*.mcap')
    return heard, (killed_s, back_s, ended_s), bag


def test_it_is_flown_on(flight):
    heard, (killed_s, back_s, ended_s), _ = flight
    away = [pump for when_s, pump in heard.commands if killed_s + 1.5 < when_s < back_s]
    assert away and max(away) < 0.0  # the safe state, all the buoyancy there is
    after = [pump for when_s, pump in heard.commands if ended_s - 1.5 < when_s]
    assert len(after) > 5 and min(after) > 0.2
    assert not [told for *_, told in heard.told if 'for good' in told]


def test_successor_is_told_with_its_gid_and_is_no_stranger(flight):
    heard, (_, back_s, _), _ = flight
    told = [(node, said) for when_s, node, said in heard.told if when_s > back_s]
    taken = [(node, said) for node, said in told if 'takes the place of /glider/driver' in said]
    named = {f'/glider/{name}_node' for name in ('guidance', 'control', 'guard')}
    assert heard.takers() == {node for node, _ in taken} == named
    assert all(said.startswith('/glider/') and '(01.0f.' in said for _, said in taken)
    assert not [said for _, said in told if 'is published by' in said]


def test_recording_goes_on(flight):
    _, (killed_s, _, ended_s), bag = flight
    with bag.open('rb') as stream:
        reader = make_reader(stream)
        begin_s = reader.get_summary().statistics.message_start_time / 1e9
        stamps_s = [m.log_time / 1e9 for _, _, m in reader.iter_messages(topics=['/glider/odom'])]
    assert stamps_s[0] - begin_s < DEADLINE_S  # the path has no stamp, and comes first
    gaps_s = [after - before for before, after in zip(stamps_s[:-1], stamps_s[1:], strict=True)]
    assert AWAY_S < max(gaps_s) < ended_s - killed_s
    assert sorted(gaps_s)[-2] < STOPPED_S - 1.5
    assert stamps_s[-1] - stamps_s[gaps_s.index(max(gaps_s)) + 1] > 1.0


def test_what_the_example_says_is_taken_from_a_vehicle_with_a_fin(context, monkeypatch):
    monkeypatch.syspath_prepend(str(EXAMPLES))
    from driver import Driver

    vehicle = SimpleNamespace(
        time_ns=lambda: 7,
        attitude=lambda: None,
        pressure=lambda: 2e5,
        fix=lambda: (36.0, 9.0, 4.0),
        actuators=lambda: [0.1, 0.2, 0.3, 0.4],
    )
    told = {'navigates': False, 'joints': [*JOINTS, 'fin']}
    overrides = [Parameter(name, value=value) for name, value in told.items()]
    node = Driver(vehicle, context=context, parameter_overrides=overrides)
    said = node.read()
    node.destroy_node()
    codec = topic_of('joint_states', 'fin').codec
    assert codec.decode(serialize_message(said['joint_states'])) == (7, (0.1, 0.2, 0.3, 0.4))
    codec = topic_of('fix').codec
    assert codec.decode(serialize_message(said['fix'])) == (7, (0.0, 36.0, 9.0, 16.0, 16.0))
    assert said['fix'].position_covariance_type == NavSatFix.COVARIANCE_TYPE_DIAGONAL_KNOWN
