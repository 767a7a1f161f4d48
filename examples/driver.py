# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""A driver for a vehicle of your own: publishes what it measures, obeys what control commands.

This is all that the nodes on board need. See docs/your_vehicle.md.
"""

from typing import Protocol

from nav_msgs.msg import Odometry
from rclpy.node import Node
from rclpy.time import Time
from sensor_msgs.msg import FluidPressure, Imu, JointState, NavSatFix, NavSatStatus
from std_msgs.msg import Header

JOINTS = ['buoyancy_engine', 'pitch_mass', 'roll_mass']
PERIOD_S = 0.1
#: Messages that are kept for a recorder that has no time for a while.
KEPT = 256


class Vehicle(Protocol):
    """What the driver asks of a vehicle; units, frames and signs are those of the topics.

    One that navigates itself has `navigation`. Any other has `attitude`, `pressure` and `fix`:
    None where there is nothing new.
    """

    def time_ns(self) -> int:
        """Time of what the other methods give, on the clock of the vehicle."""

    def navigation(self) -> tuple[tuple, tuple, tuple, tuple]:
        """Position, orientation (w, x, y, z), velocity over ground and rates, ENU and FLU."""

    def attitude(self) -> tuple[tuple, tuple | None] | None:
        """Orientation (w, x, y, z), ENU and FLU, and rates; None for those without a gyro."""

    def pressure(self) -> float | None:
        """Absolute pressure (Pa)."""

    def fix(self) -> tuple[float, float, float] | None:
        """Latitude, longitude (deg), and standard deviation north and east (m)."""

    def actuators(self) -> list[float]:
        """Positions of the actuators in the order of the parameter ``joints``."""

    def move(self, targets: dict[str, float]) -> None:
        """Move actuators towards their targets."""


class Driver(Node):
    """Publishes joint_states and odom at 10 Hz, and obeys command.

    With its parameter ``navigates`` false, imu, pressure and fix take the place of odom. A vehicle
    with a steering surface has it as the last of its ``joints``, such as fin.
    """

    def __init__(self, vehicle: Vehicle, name: str = 'driver', **kwargs) -> None:
        super().__init__(name, **kwargs)
        self.vehicle = vehicle
        self.navigates = self.declare_parameter('navigates', True).value
        self.joints = self.declare_parameter('joints', JOINTS).value
        kinds = {'joint_states': JointState, 'odom': Odometry}
        if not self.navigates:
            kinds = {'joint_states': JointState}
            kinds |= {'imu': Imu, 'pressure': FluidPressure, 'fix': NavSatFix}
        self.out = {name: self.create_publisher(kind, name, KEPT) for name, kind in kinds.items()}
        self.create_subscription(JointState, 'command', self.on_command, 10)

    def start(self) -> None:
        """Publish from now on."""
        self.create_timer(PERIOD_S, lambda: self.publish(self.read()))

    def read(self) -> dict:
        """What there is to say of the vehicle, as messages by topic."""
        stamp = Time(nanoseconds=self.vehicle.time_ns()).to_msg()
        joints = JointState(header=Header(stamp=stamp), name=self.joints)
        joints.position = self.vehicle.actuators()
        header = Header(stamp=stamp, frame_id='base_link')
        measured = self.odometry(stamp) if self.navigates else self.samples(header)
        return {'joint_states': joints, **measured}

    def odometry(self, stamp) -> dict:
        """Where the vehicle is."""
        odom = Odometry(child_frame_id='base_link')
        odom.header.frame_id, odom.header.stamp = 'map', stamp
        position, orientation, velocity, rates = self.vehicle.navigation()
        pose, twist = odom.pose.pose, odom.twist.twist
        pose.position.x, pose.position.y, pose.position.z = position
        q = pose.orientation
        q.w, q.x, q.y, q.z = orientation
        twist.linear.x, twist.linear.y, twist.linear.z = velocity
        twist.angular.x, twist.angular.y, twist.angular.z = rates
        return {'odom': odom}

    def samples(self, header: Header) -> dict:
        """What its sensors have taken since the last time."""
        taken = {}
        if (attitude := self.vehicle.attitude()) is not None:
            imu = taken['imu'] = Imu(header=header)
            orientation, rates = attitude
            q, w = imu.orientation, imu.angular_velocity
            q.w, q.x, q.y, q.z = orientation
            if rates is None:
                imu.angular_velocity_covariance[0] = -1.0
            else:
                w.x, w.y, w.z = rates
        if (pressure := self.vehicle.pressure()) is not None:
            taken['pressure'] = FluidPressure(header=header, fluid_pressure=pressure)
        if (place := self.vehicle.fix()) is not None:
            fix = taken['fix'] = NavSatFix(header=header)
            fix.status.status = NavSatStatus.STATUS_FIX
            fix.latitude, fix.longitude, std_m = place
            fix.position_covariance[0] = fix.position_covariance[4] = std_m**2
            fix.position_covariance_type = NavSatFix.COVARIANCE_TYPE_DIAGONAL_KNOWN
        return taken

    def publish(self, messages: dict) -> None:
        """Publish what there is to say."""
        for name, message in messages.items():
            self.out[name].publish(message)

    def on_command(self, command: JointState) -> None:
        """Obey."""
        self.vehicle.move(dict(zip(command.name, command.position, strict=True)))
