# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""Guidance, control and guard on a computer that is too slow for them: half of their cycles lack.

Time of the nodes goes on by two periods at once, as it does where a node has no time to look in
between, while the vehicle goes on as it always does.
"""

import time
from typing import NamedTuple

import pytest
import rclpy
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from rclpy.context import Context
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import JointState

from glider_base.ros.lockstep.executor import TickExecutor
from glider_base.ros.places import domain_id
from glider_base.ros.wire import qos
from glider_base.ros.wire.codec import to_cdr
from glider_base.ros.wire.topics import TOPICS
from glider_base.signals import TICK_NS, TICK_S
from glider_base.wiring import PLANT
from glider_bringup.engines.flight import mission_of
from glider_bringup.engines.node_parameters import node_parameters, write_parameters
from glider_control.nodes.control_node import ControlNode
from glider_guard.nodes.guard_node import GuardNode
from glider_guidance.nodes.guidance_node import GuidanceNode
from glider_mission.scenario import load_scenario
from glider_model.plant.block import plant_move, plant_outputs

FLIGHT = {'profile.prepare_s': 0.0, 'profile.depth_m': 40.0}
DURATION_S = 400.0
#: A cycle of the nodes for so many of the vehicle.
EVERY = 2
#: Simulated time at which the vehicle begins (ns).
START_NS = 1000 * 10**9
DEADLINE_S = 300.0
#: For so long the vehicle waits for a command (s), then it goes on by the last one.
COMMAND_S = 2.0
NOTHING = (0.0, 0.0, 0.0)


class Told(NamedTuple):
    """A status on /diagnostics."""

    node: str
    level: bytes
    message: str
    values: dict[str, str]


class Flight:
    """The plant without its node, on its own clock, and the nodes on board."""

    def __init__(self, context: Context, file) -> None:
        state, params = mission_of(load_scenario('current_8deg', FLIGHT))
        self.state, self.params = state.plant, params.plant
        self.command = tuple(self.state.joints)
        self.told, self.depths, self.commands = [], [], 0
        shared = {
            'context': context,
            'namespace': '/glider',
            'use_global_arguments': False,
            'cli_args': ['--ros-args', '--params-file', str(file), '-p', 'use_sim_time:=true'],
        }
        self.nodes = [kind(**shared) for kind in (GuidanceNode, ControlNode, GuardNode)]
        self.driver = rclpy.create_node('driver', namespace='/glider', context=context)
        self.clock = self.driver.create_publisher(Clock, '/clock', 10)
        self.out = {
            name: self.driver.create_publisher(TOPICS[name].message_type, name, 10)
            for name in ('odom', 'joint_states')
        }
        self.driver.create_subscription(JointState, 'command', self.on_command, 10)
        self.driver.create_subscription(DiagnosticArray, '/diagnostics', self.on_told, qos.EVENTS)
        self.executor = TickExecutor(context=context)
        for node in (*self.nodes, self.driver):
            self.executor.add_node(node)

    def on_command(self, command: JointState) -> None:
        self.commands += 1
        _, self.command = TOPICS['command'].codec.decode(to_cdr(command))

    def on_told(self, array: DiagnosticArray) -> None:
        for status in array.status:
            values = {pair.key: pair.value for pair in status.values}
            self.told.append(Told(status.name, status.level, status.message, values))

    def until(self, condition, patience_s: float = DEADLINE_S) -> bool:
        """Spin until something holds; whether it does in time."""
        end = time.monotonic() + patience_s
        while not condition() and time.monotonic() < end:
            self.executor.spin_once(timeout_sec=0.05)
        return condition()

    def tick(self, number: int) -> None:
        """A period of the vehicle."""
        stamp_ns = START_NS + number * TICK_NS
        measured, _ = plant_outputs(self.state, self.params)
        said = dict(zip(PLANT.outputs[1:], measured, strict=True))
        odom = (*said['measured_odom'], *(4 * (0.0,)))
        for name, values in (('odom', odom), ('joint_states', said['joint_states'])):
            self.out[name].publish(TOPICS[name].codec.encode(stamp_ns, values))
        self.depths.append(-odom[2])
        if number % EVERY == 0:
            for _ in range(6):  # what the vehicle has said is there when the cycle begins
                self.executor.spin_once(timeout_sec=0.0)
            self.clock.publish(TOPICS['/clock'].codec.encode(stamp_ns, ()))
            before = self.commands
            self.until(lambda: self.commands > before, COMMAND_S)
        self.state = plant_move(self.state, (self.command, NOTHING, (0.0,)), self.params, TICK_S)

    def close(self) -> None:
        self.executor.shutdown()
        for node in (*self.nodes, self.driver):
            node.destroy_node()


@pytest.fixture(scope='module')
def flight(tmp_path_factory):
    """A dive and most of the way up."""
    file = tmp_path_factory.mktemp('slow') / 'parameters.yaml'
    scenario = load_scenario('current_8deg', FLIGHT)
    write_parameters(node_parameters(scenario, lockstep=False), file)
    context = Context()
    with domain_id() as domain:
        rclpy.init(context=context, domain_id=domain)
        flown = Flight(context, file)
        try:
            heard = flown.out.values()
            assert flown.until(lambda: all(one.get_subscription_count() for one in heard))
            assert flown.until(lambda: flown.clock.get_subscription_count() == len(flown.nodes))
            for number in range(round(DURATION_S / TICK_S)):
                flown.tick(number)
        finally:
            flown.close()
            rclpy.try_shutdown(context=context)
    return flown


def test_it_dives_and_comes_up_again(flight):
    deepest = max(range(len(flight.depths)), key=flight.depths.__getitem__)
    assert flight.depths[deepest] == pytest.approx(40.0, abs=5.0)
    assert min(flight.depths[deepest:]) < 20.0


def test_nothing_is_taken_for_a_fault(flight):
    said = [told for told in flight.told if told.node == '/glider/guard_node']
    wrong = [told for told in said if told.level == DiagnosticStatus.ERROR]
    assert [told.message for told in wrong if 'missing or stale' not in told.message] == []
    assert all('frozen' not in f'{told.message} {told.values}' for told in said)


def test_missed_cycles_are_told(flight):
    for node in ('guidance_node', 'control_node', 'guard_node'):
        told = [one for one in flight.told if one.node == f'/glider/{node}']
        counted = [one for one in told if int(one.values.get('cycles_missed', 0))]
        assert counted[-1].level == DiagnosticStatus.WARN
        # half of them, but for those since it was told last
        missed = int(counted[-1].values['cycles_missed'])
        assert missed == pytest.approx(0.5 * DURATION_S / TICK_S, rel=0.1)
