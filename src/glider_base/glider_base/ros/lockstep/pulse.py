# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""How a node is, once in a second on /diagnostics: for tools that take silence for a failure.

What changes is told as an event, which is recorded. This only repeats what holds, at 1 Hz of the
time that the node goes by, and is not recorded.
"""

import struct
from typing import Any, NamedTuple

from rclpy.event_handler import PublisherEventCallbacks
from rclpy.node import Node

from glider_base.ros.lockstep import health
from glider_base.ros.wire import qos
from glider_base.ros.wire.codec import to_cdr
from glider_base.ros.wire.topics import TOPICS

_SECOND_NS = 1_000_000_000
#: The stamp of a message with a header, after the 4 bytes that say how it is encoded.
_STAMP, _STAMP_AT = struct.Struct('<iI'), 4


class Condition(NamedTuple):
    """How a node is."""

    level: bytes
    message: str
    values: dict[str, Any] = {}


class Pulse:
    """Repeats how a node is.

    Parameters
    ----------
    node : Node
        Anything with the method ``condition`` of `glider_base.ros.lockstep.node.TickNode`.
    """

    def __init__(self, node: Node) -> None:
        self._node = node
        self._publisher = node.create_publisher(
            TOPICS['/diagnostics'].message_type,
            '/diagnostics',
            qos.REPEATED,
            event_callbacks=PublisherEventCallbacks(use_default_callbacks=False),
        )
        self._second = -1
        self._said: Condition | None = None
        self._raw = bytearray()

    def beat(self, now_ns: int, stamp_ns: int) -> None:
        """Say it if a second has begun since the last time.

        Parameters
        ----------
        now_ns : int
            By the clock that the node goes by (ns).
        stamp_ns : int
            For the message (ns).
        """
        if now_ns // _SECOND_NS == self._second:
            return
        self._second = now_ns // _SECOND_NS
        condition = self._node.condition()
        if condition != self._said:
            name = self._node.get_fully_qualified_name()
            self._said, self._raw = (
                condition,
                bytearray(to_cdr(health.status_array(0, name, *condition))),
            )
        _STAMP.pack_into(self._raw, _STAMP_AT, *divmod(stamp_ns, _SECOND_NS))
        self._publisher.publish(bytes(self._raw))
