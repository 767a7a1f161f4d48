# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""Control, free-running, whose inputs stop for good: it surfaces, says so, and stays so."""

import signal
import time

import pytest
import rclpy
from diagnostic_msgs.msg import DiagnosticArray
from rclpy.context import Context
from rclpy.executors import SingleThreadedExecutor
from rclpy.parameter import Parameter
from sensor_msgs.msg import JointState

from glider_bringup.runner import domain_id
from glider_control.control import ControlSettings
from glider_control.nodes.control_node import ControlNode
from glider_control.watch import ORDERED
from glider_model.ros import qos
from glider_model.ros.messages import TOPICS
from glider_model.signals import TICK_NS

LEVEL = (0.0, 0.0, -50.0, 1.0, 0.0, 0.0, 0.0, 0.5, 0.0, 0.0, 0.0, 0.0, 0.0)
INPUTS = {'odom': LEVEL, 'joint_states': (0.4, 0.0, 0.0), 'reference': LEVEL}
DEADLINE_S = 60.0


@pytest.fixture
def context(monkeypatch):
    monkeypatch.delenv('ROS_DOMAIN_ID', raising=False)
    monkeypatch.setenv('ROS_AUTOMATIC_DISCOVERY_RANGE', 'LOCALHOST')
    before = {number: signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM)}
    context = Context()
    with domain_id() as domain:
        rclpy.init(context=context, domain_id=domain)
        yield context
        rclpy.try_shutdown(context=context)
    for number, handler in before.items():
        signal.signal(number, handler)


class Vehicle:
    """Publishes the inputs of control, and hears what it says."""

    def __init__(self, context) -> None:
        self.node = rclpy.create_node('vehicle', namespace='/glider', context=context)
        self.publishers = {
            name: self.node.create_publisher(TOPICS[name].message_type, name, TOPICS[name].qos)
            for name in INPUTS
        }
        self.commands, self.told, self.stamp_ns, self.talks = [], [], 0, True
        self.node.create_subscription(JointState, 'command', self.on_command, 10)
        self.node.create_subscription(
            DiagnosticArray, '/diagnostics', self.on_diagnostics, qos.EVENTS
        )
        self.node.create_timer(0.1, self.publish)

    def on_command(self, command) -> None:
        self.commands.append(tuple(command.position))

    def on_diagnostics(self, array) -> None:
        self.told += [status.message for status in array.status]

    def publish(self) -> None:
        self.stamp_ns += TICK_NS
        for name, values in INPUTS.items() if self.talks else ():
            self.publishers[name].publish(TOPICS[name].codec.encode(self.stamp_ns, values))


def test_lost_input_surfaces_the_vehicle_for_good(context):
    vehicle = Vehicle(context)
    parameters = {'lockstep': False, 'input_max_age_s': 0.5, 'lost_after_s': 1.0}
    overrides = [Parameter(name, value=value) for name, value in parameters.items()]
    control = ControlNode(context=context, namespace='/glider', parameter_overrides=overrides)
    executor = SingleThreadedExecutor(context=context)
    executor.add_node(vehicle.node)
    executor.add_node(control)
    safe = tuple(ControlSettings().params().safe_command)

    def until(condition) -> None:
        end = time.monotonic() + DEADLINE_S
        while not condition():
            assert time.monotonic() < end
            executor.spin_once(timeout_sec=0.1)

    def said(text: str) -> bool:
        return any(text in told for told in vehicle.told)

    try:
        until(lambda: len(vehicle.commands) > 5 and vehicle.commands[-1] != safe)
        vehicle.talks = False
        until(lambda: said('input lost for 1 s: surfacing for good'))
        assert vehicle.commands[-1] == safe
        vehicle.talks = True
        until(lambda: said('inputs are fresh again'))
        before = len(vehicle.commands)
        until(lambda: len(vehicle.commands) > before + 10)
        assert set(vehicle.commands[before:]) == {safe}
        until(lambda: said('surfacing for good: ordered'))
        assert control.state.watch.told & ORDERED
    finally:
        executor.shutdown()
        control.close()
        control.destroy_node()
        vehicle.node.destroy_node()
