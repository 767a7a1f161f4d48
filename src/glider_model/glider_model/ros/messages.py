# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""Every topic of the stack: name, message type, layout, who publishes it and who needs it.

The numbers of a message are in the conventions of the topics (ENU / FLU, SI, radians);
`glider_model.frames` turns them into signals and back.
"""

from typing import NamedTuple

from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import TwistStamped, Vector3Stamped, WrenchStamped
from nav_msgs.msg import Odometry, Path
from rclpy.qos import QoSProfile
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import JointState
from std_msgs.msg import Header

from glider_model.ros import qos
from glider_model.ros.codec import Codec
from glider_model.signals import Adaptation

#: Frame names: the world (ENU), the body (FLU), the path frame of the tracking error.
MAP, BASE_LINK, PATH_FRAME = 'map', 'base_link', 'path'

#: Joint names of joint_states and command, in the order of `glider_model.signals.Joints`.
JOINTS = ('buoyancy_engine', 'pitch_mass', 'roll_mass')

_XYZ = ('x', 'y', 'z')
_POSE_AND_TWIST = (
    *(f'pose.pose.position.{axis}' for axis in _XYZ),
    *(f'pose.pose.orientation.{axis}' for axis in ('w', *_XYZ)),
    *(f'twist.twist.linear.{axis}' for axis in _XYZ),
    *(f'twist.twist.angular.{axis}' for axis in _XYZ),
)


def _stamped(message, frame: str):
    message.header.frame_id = frame
    return message


def _odometry(child_frame: str) -> Codec:
    template = _stamped(Odometry(child_frame_id=child_frame), MAP)
    return Codec(template, _POSE_AND_TWIST)


def _named(names: tuple[str, ...]) -> Codec:
    template = JointState(name=list(names), position=[0.0] * len(names))
    return Codec(template, [f'position[{name}]' for name in names])


def _velocity() -> Codec:
    return Codec(_stamped(TwistStamped(), MAP), [f'twist.linear.{axis}' for axis in _XYZ])


CLOCK = Codec(Clock(), (), stamp='clock')
ODOM = _odometry(BASE_LINK)
JOINT_STATES = _named(JOINTS)
CURRENT_VELOCITY = _velocity()
#: Its twist is expressed in `map`: desired velocity over ground and Euler angle rates.
REFERENCE = _odometry(MAP)
TRACKING_ERROR = Codec(_stamped(Vector3Stamped(), PATH_FRAME), [f'vector.{axis}' for axis in _XYZ])
CURRENT_ESTIMATE = _velocity()
COMMAND = _named(JOINTS)
WRENCH = Codec(
    _stamped(WrenchStamped(), BASE_LINK), ('wrench.force.z', 'wrench.torque.x', 'wrench.torque.y')
)


#: Numbers with names and a stamp: a JointState, which every plotting tool shows by name.
ADAPTATION = _named(Adaptation._fields)


class Topic(NamedTuple):
    """One topic.

    A name without a leading slash lies in the namespace of the nodes. ``publisher`` is the node
    that publishes it, ``readers`` are the nodes that cannot work without it. Per-tick topics have
    a codec, and carry exactly one message per tick.
    """

    name: str
    message_type: type
    publisher: str
    readers: tuple[str, ...] = ()
    codec: Codec | None = None
    qos: QoSProfile = qos.PER_TICK
    recorded: bool = True

    @property
    def per_tick(self) -> bool:
        """Whether every tick brings exactly one message."""
        return self.codec is not None

    @property
    def type_name(self) -> str:
        """ROS name of the message type, such as nav_msgs/msg/Odometry."""
        package, kind, *_ = self.message_type.__module__.split('.')
        return f'{package}/{kind}/{self.message_type.__name__}'

    def full_name(self, namespace: str) -> str:
        """Absolute name for nodes in ``namespace``."""
        if self.name.startswith('/'):
            return self.name
        return f'/{namespace.strip("/")}/{self.name}'.replace('//', '/')


def _per_tick(name: str, codec: Codec, publisher: str, *readers: str) -> Topic:
    return Topic(name, codec.message_type, publisher, readers, codec)


PLANT, CURRENT, GUIDANCE, CONTROL, RECORDER = (
    'plant_node',
    'current_node',
    'guidance_node',
    'control_node',
    'recorder_node',
)
#: Stands for all of them to a recorder.
REPLAY = 'replay_node'

#: Every topic, per-tick ones first in the order in which a tick is recorded.
TOPICS = {
    topic.name: topic
    for topic in (
        _per_tick('/clock', CLOCK, PLANT),
        _per_tick('odom', ODOM, PLANT, CURRENT, GUIDANCE, CONTROL),
        _per_tick('joint_states', JOINT_STATES, PLANT, CONTROL),
        _per_tick('current_velocity', CURRENT_VELOCITY, CURRENT, PLANT),
        _per_tick('reference', REFERENCE, GUIDANCE, CONTROL),
        _per_tick('tracking_error', TRACKING_ERROR, GUIDANCE),
        _per_tick('current_estimate', CURRENT_ESTIMATE, GUIDANCE),
        _per_tick('command', COMMAND, CONTROL, PLANT),
        _per_tick('wrench', WRENCH, CONTROL),
        _per_tick('adaptation', ADAPTATION, CONTROL),
        Topic('path', Path, GUIDANCE, qos=qos.LATCHED),
        Topic('/diagnostics', DiagnosticArray, 'all', qos=qos.EVENTS),
        Topic('lockstep', DiagnosticArray, 'all', qos=qos.EVENTS, recorded=False),
        Topic('recorded', Header, RECORDER, (PLANT,), recorded=False),
    )
}
