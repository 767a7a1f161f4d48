# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""A driver for a vehicle of your own: publishes where it is, obeys what control commands.

This is all that guidance_node and control_node need. See docs/your_vehicle.md.
"""

from typing import Protocol

from nav_msgs.msg import Odometry
from rclpy.node import Node
from rclpy.time import Time
from sensor_msgs.msg import JointState

JOINTS = ['buoyancy_engine', 'pitch_mass', 'roll_mass']
PERIOD_S = 0.1


class Vehicle(Protocol):
    """What the driver asks of a vehicle; units, frames and signs are those of the topics."""

    def time_ns(self) -> int:
        """Time at which `navigation` and `actuators` are valid, on the clock of the vehicle."""

    def navigation(self) -> tuple[tuple, tuple, tuple, tuple]:
        """Position, orientation (w, x, y, z), velocity over ground and rates, ENU and FLU."""

    def actuators(self) -> list[float]:
        """Positions of the actuators in the order of JOINTS."""

    def move(self, targets: dict[str, float]) -> None:
        """Move actuators towards their targets."""


class Driver(Node):
    """Publishes odom and joint_states at 10 Hz, and obeys command."""

    def __init__(self, vehicle: Vehicle, name: str = 'driver', **kwargs) -> None:
        super().__init__(name, **kwargs)
        self.vehicle = vehicle
        self.odom = self.create_publisher(Odometry, 'odom', 10)
        self.joint_states = self.create_publisher(JointState, 'joint_states', 10)
        self.create_subscription(JointState, 'command', self.on_command, 10)

    def start(self) -> None:
        """Publish from now on."""
        self.create_timer(PERIOD_S, lambda: self.publish(*self.read()))

    def read(self) -> tuple[Odometry, JointState]:
        """State of the vehicle as messages."""
        odom, joints = Odometry(child_frame_id='base_link'), JointState(name=JOINTS)
        odom.header.frame_id = 'map'
        odom.header.stamp = Time(nanoseconds=self.vehicle.time_ns()).to_msg()
        joints.header.stamp = odom.header.stamp
        position, orientation, velocity, rates = self.vehicle.navigation()
        pose, twist = odom.pose.pose, odom.twist.twist
        pose.position.x, pose.position.y, pose.position.z = position
        q = pose.orientation
        q.w, q.x, q.y, q.z = orientation
        twist.linear.x, twist.linear.y, twist.linear.z = velocity
        twist.angular.x, twist.angular.y, twist.angular.z = rates
        joints.position = self.vehicle.actuators()
        return odom, joints

    def publish(self, odom: Odometry, joints: JointState) -> None:
        """Publish a state."""
        self.joint_states.publish(joints)
        self.odom.publish(odom)

    def on_command(self, command: JointState) -> None:
        """Obey."""
        self.vehicle.move(dict(zip(command.name, command.position, strict=True)))
