# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""Where the vehicle is, for tools that know transforms: odom as ``map -> base_link`` on /tf.

This node stands beside the run. It takes no part in the lockstep, nobody waits for it, and what it
publishes is not recorded: it follows from odom, in flight as well as from a bag that is played.
"""

import sys

from geometry_msgs.msg import TransformStamped
from nav_msgs.msg import Odometry
from pydantic import Field
from rclpy.clock import Clock, ClockType
from rclpy.node import Node
from rclpy.qos import QoSProfile
from rclpy.serialization import deserialize_message

from glider_base.ros.lockstep.executor import Gate, take
from glider_base.ros.lockstep.process import entry
from glider_base.ros.parameters import declare_settings
from glider_base.ros.wire import qos
from glider_base.settings import ConfigurationError, Settings, matching, number

#: What tf2's own broadcasters offer.
TF_QOS = QoSProfile(depth=100)


class TfSettings(Settings):
    """How transforms are published."""

    frame_prefix: str = Field(
        '',
        pattern=matching(r'^[A-Za-z0-9_/]*$', 'letters, digits, _ and /'),
        description='put before base_link, such as one/; the frame map is common to all vehicles',
    )
    rate_hz: float = number(50.0, (0.1, 1000.0), 'most transforms in a second of wall time (1/s)')


def transform_of(odometry: Odometry, frame_prefix: str) -> TransformStamped:
    """Transform of the vehicle in the world, stamped as the odometry is."""
    transform = TransformStamped(header=odometry.header)
    transform.child_frame_id = frame_prefix + odometry.child_frame_id.removeprefix(frame_prefix)
    position, translation = odometry.pose.pose.position, transform.transform.translation
    translation.x, translation.y, translation.z = position.x, position.y, position.z
    transform.transform.rotation = odometry.pose.pose.orientation
    return transform


class TfNode(Node):
    """Publishes the newest odom as a transform, `rate_hz` times in a second at most.

    A run can be hundreds of times faster than real time. Odometry is therefore not dispatched
    message by message; a timer takes what is there.
    """

    def __init__(self, **kwargs) -> None:
        super().__init__('tf_node', **kwargs)
        self.settings = declare_settings(self, TfSettings)
        try:
            from tf2_msgs.msg import TFMessage
        except ImportError:
            raise ConfigurationError(
                'tf_node: the package tf2_msgs is not installed (Debian: ros-jazzy-tf2-msgs)'
            ) from None
        self.message_type = TFMessage
        self.publisher = self.create_publisher(TFMessage, '/tf', TF_QOS)
        self.newest = b''
        self.subscription = self.create_subscription(
            Odometry, 'odom', self.keep, qos.NEWEST, callback_group=Gate(), raw=True
        )
        steady_clock = Clock(clock_type=ClockType.STEADY_TIME)
        self.create_timer(1.0 / self.settings.rate_hz, self.on_timer, clock=steady_clock)

    def keep(self, raw: bytes) -> None:
        """Keep the newest odometry."""
        self.newest = raw

    def on_timer(self) -> None:
        """Publish the newest odometry, once."""
        while (raw := take(self.subscription)) is not None:
            self.keep(raw)
        if self.newest:
            odometry, self.newest = deserialize_message(self.newest, Odometry), b''
            q = odometry.pose.pose.orientation
            if q.w or q.x or q.y or q.z:  # else it has no attitude, and tf2 complains of each
                transform = transform_of(odometry, self.settings.frame_prefix)
                self.publisher.publish(self.message_type(transforms=[transform]))

    def close(self) -> None:
        """Nothing to complete."""


main = entry(TfNode)

if __name__ == '__main__':
    sys.exit(main())
