# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""Every topic of the stack: name, message type, layout, who publishes it and who needs it.

The numbers of a message are in the conventions of the topics (ENU / FLU, SI, radians);
`glider_model.base.frames` turns them into signals and back.
"""

from typing import NamedTuple

from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import TwistStamped, Vector3Stamped, WrenchStamped
from nav_msgs.msg import Odometry, Path
from rclpy.qos import QoSProfile
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import JointState
from std_msgs.msg import Header

from glider_model.base import wiring
from glider_model.base.signals import Adaptation
from glider_model.base.wiring import FIELDS, JOINTS, WIRING
from glider_model.ros.wire import qos
from glider_model.ros.wire.codec import Codec

#: Frame names: the world (ENU), the body (FLU), the path frame of the tracking error.
MAP, BASE_LINK, PATH_FRAME = 'map', 'base_link', 'path'


def _stamped(message, frame: str):
    message.header.frame_id = frame
    return message


def _odometry(child_frame: str):
    return _stamped(Odometry(child_frame_id=child_frame), MAP)


def _named(names: tuple[str, ...]) -> JointState:
    """Numbers with names and a stamp, which every plotting tool shows by name."""
    return JointState(name=list(names), position=[0.0] * len(names))


#: Per-tick messages as they are before numbers and stamps are put in. The twist of the reference
#: is expressed in `map`: desired velocity over ground and Euler angle rates.
_TEMPLATES = {
    '/clock': Clock(),
    'odom': _odometry(BASE_LINK),
    'joint_states': _named(JOINTS),
    'current_velocity': _stamped(TwistStamped(), MAP),
    'reference': _odometry(MAP),
    'tracking_error': _stamped(Vector3Stamped(), PATH_FRAME),
    'current_estimate': _stamped(TwistStamped(), MAP),
    'command': _named(JOINTS),
    'wrench': _stamped(WrenchStamped(), BASE_LINK),
    'adaptation': _named(Adaptation._fields),
}
_CODECS = {
    name: Codec(template, FIELDS[name], stamp='clock' if name == '/clock' else 'header.stamp')
    for name, template in _TEMPLATES.items()
}


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


def _per_tick(name: str) -> Topic:
    codec, needed_by = _CODECS[name], (wired.node for wired in wiring.readers(name))
    return Topic(name, codec.message_type, wiring.publisher(name).node, tuple(needed_by), codec)


#: Names of the nodes.
PLANT, CURRENT, GUIDANCE, CONTROL = (wired.node for wired in WIRING)
RECORDER = 'recorder_node'
#: Stands for all of them to a recorder.
REPLAY = 'replay_node'

#: Every topic, per-tick ones first in the order in which a tick is recorded.
TOPICS = {
    topic.name: topic
    for topic in (
        *(_per_tick(name) for wired in WIRING for name in wired.outputs),
        Topic('path', Path, GUIDANCE, qos=qos.LATCHED),
        Topic('/diagnostics', DiagnosticArray, 'all', qos=qos.EVENTS),
        Topic('lockstep', DiagnosticArray, 'all', qos=qos.EVENTS, recorded=False),
        Topic('recorded', Header, RECORDER, (PLANT,), recorded=False),
    )
}
