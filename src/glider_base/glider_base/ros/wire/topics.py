# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""Every topic of the stack: name, message type, layout, who publishes it and who needs it.

The numbers of a message are in the conventions of the topics (ENU / FLU, SI, radians);
`glider_base.frames` turns them into signals and back.
"""

from collections.abc import Iterable
from functools import cache
from importlib import import_module
from typing import NamedTuple

from diagnostic_msgs.msg import DiagnosticArray
from nav_msgs.msg import Path
from rclpy.qos import QoSProfile
from std_msgs.msg import Header

from glider_base import wiring
from glider_base.ros.wire import qos
from glider_base.ros.wire.codec import Codec, set_field
from glider_base.wiring import CONDITION, PORTS, SURFACE, WHEN_SILENT, WIRING, Port, present


def message_class(type_name: str) -> type:
    """Message type of a ROS name, such as nav_msgs/msg/Odometry."""
    package, *_, name = type_name.split('/')
    return getattr(import_module(f'{package}.msg'), name)


def _codec(port: Port, steers_by: str = '', unmeasured: tuple[float, ...] = ()) -> Codec:
    """Codec of a per-tick message, from what the wiring and the vehicle say of it."""
    message = message_class(port.message)()
    if port.frame:
        message.header.frame_id = port.frame
    if port.child_frame:
        message.child_frame_id = port.child_frame
    fields = port.fields
    if port.names:
        names = [*port.names, *([steers_by] if steers_by else [])]
        message.name, message.position = names, [0.0] * len(names)
        fields = tuple(f'position[{name}]' for name in names)
    for path, value in port.constants:
        set_field(message, path, value)
    stamp = 'header.stamp' if port.fields else 'clock'
    return Codec(message, fields, stamp, len(port.fields), unmeasured)


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
    unmeasured = WHEN_SILENT[name] if name in CONDITION else ()
    codec = _codec(PORTS[name], unmeasured=unmeasured)
    needed_by = (wired.node for wired in wiring.readers(name))
    return Topic(name, codec.message_type, wiring.publisher(name).node, tuple(needed_by), codec)


def recorded_topics(optional: Iterable[str]) -> tuple['Topic', ...]:
    """What is recorded of a run with these of the topics that not every run has."""
    return tuple(TOPICS[name] for name in present(TOPICS, optional) if TOPICS[name].recorded)


#: Names of the nodes.
PLANT, CURRENT, NAVIGATION, GUIDANCE, CONTROL, GUARD = (wired.node for wired in WIRING)
RECORDER = 'recorder_node'
#: Stands for all of them to a recorder.
REPLAY = 'replay_node'

#: Every topic, per-tick ones first in the order in which a tick is recorded.
TOPICS = {
    topic.name: topic
    for topic in (
        *(_per_tick(name) for wired in WIRING for name in wired.outputs),
        Topic('path', Path, GUIDANCE, qos=qos.LATCHED),
        Topic('mission/status', DiagnosticArray, GUIDANCE, qos=qos.LATCHED, recorded=False),
        Topic('/diagnostics', DiagnosticArray, 'all', qos=qos.EVENTS),
        Topic('lockstep', DiagnosticArray, 'all', qos=qos.EVENTS, recorded=False),
        Topic('told', DiagnosticArray, 'all', qos=qos.EVENTS, recorded=False),
        Topic('recorded', Header, RECORDER, (PLANT,), recorded=False),
        Topic('heard', Header, RECORDER, (PLANT,), recorded=False),
    )
}


@cache
def topic_of(name: str, steers_by: str = '') -> Topic:
    """Topic of a vehicle with a steering surface of this name, which is the name of its joint."""
    if not steers_by or name not in PORTS or SURFACE not in PORTS[name].fields:
        return TOPICS[name]
    return TOPICS[name]._replace(codec=_codec(PORTS[name], steers_by))
