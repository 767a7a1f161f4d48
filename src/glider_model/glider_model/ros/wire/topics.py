# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""Every topic of the stack: name, message type, layout, who publishes it and who needs it.

The numbers of a message are in the conventions of the topics (ENU / FLU, SI, radians);
`glider_model.base.frames` turns them into signals and back.
"""

from importlib import import_module
from typing import NamedTuple

from diagnostic_msgs.msg import DiagnosticArray
from nav_msgs.msg import Path
from rclpy.qos import QoSProfile
from std_msgs.msg import Header

from glider_model.base import wiring
from glider_model.base.wiring import PORTS, WIRING, Port
from glider_model.ros.wire import qos
from glider_model.ros.wire.codec import Codec


def _codec(port: Port) -> Codec:
    """Codec of a per-tick message, from what the wiring says of it."""
    package, _, name = port.message.partition('/msg/')
    message = getattr(import_module(f'{package}.msg'), name)()
    if port.frame:
        message.header.frame_id = port.frame
    if port.child_frame:
        message.child_frame_id = port.child_frame
    if port.names:
        message.name, message.position = list(port.names), [0.0] * len(port.names)
    return Codec(message, port.fields, stamp='header.stamp' if port.fields else 'clock')


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
    codec, needed_by = _codec(PORTS[name]), (wired.node for wired in wiring.readers(name))
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
