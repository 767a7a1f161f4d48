# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""What a person asks of a node in flight, on record with the first tick that it acts on.

A step is a function of state, inputs and parameters. Whoever computes a recorded run again knows
them all, if the recording also tells when a service or a parameter changed one of them.
"""

from rclpy.node import Node

from glider_base.ros.lockstep import health

#: Messages of the events on /diagnostics.
ABORT, PARAMETERS_SET, SURFACE, CLEAR = 'abort', 'parameters set', 'surface', 'clear'


class Orders:
    """Orders that a node has followed since its last tick.

    The node has a method ``publish_event``, as `glider_base.ros.lockstep.node.TickNode`.
    """

    def __init__(self, node: Node) -> None:
        self._node = node
        self._waiting: dict[str, dict[str, str]] = {}

    def add(self, message: str, values: dict[str, str] | None = None) -> None:
        """Keep an order until the next tick; a later one of its kind adds to it."""
        self._waiting.setdefault(message, {}).update(values or {})

    def tell(self, stamp_ns: int) -> None:
        """Put them on /diagnostics: they hold from this tick on."""
        for message, values in self._waiting.items():
            self._node.publish_event(
                health.status_array(
                    stamp_ns, self._node.get_fully_qualified_name(), health.OK, message, values
                )
            )
        self._waiting.clear()
