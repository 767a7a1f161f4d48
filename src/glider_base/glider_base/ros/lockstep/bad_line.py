# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""Messages that go wrong on purpose as they leave a node: the faults `message` of a scenario."""

from collections.abc import Callable, Sequence
from functools import partial

import numpy as np
from rclpy.node import Node

from glider_base.noise import random_stream, uniform
from glider_base.ros.message_fault import MessageFault
from glider_base.ros.wire.topics import TOPICS, Topic
from glider_base.signals import TICK_NS, TICK_S

#: Sets the streams apart from those of currents, sensors and other faults.
_STREAM_OFFSET = 2**34
#: A message that is to come after the next one comes after this time (s) if there is no next one:
#: in lockstep the next one waits for it.
_NO_NEXT_S = 0.05


class BadLine:
    """What goes wrong with the messages of one topic of a node; a seed says which are struck."""

    def __init__(
        self,
        node: Node,
        topic: Topic,
        faults: Sequence[MessageFault],
        seed: int,
        publish: Callable[[bytes], None],
    ) -> None:
        first = 64 * list(TOPICS).index(topic.name)
        self._node, self._publish = node, publish
        self._faults = [
            (fault, np.uint64(random_stream(seed, _STREAM_OFFSET, first + i)))
            for i, fault in enumerate(faults)
        ]
        self._held: list[bytes] = []

    def send(self, stamp_ns: int, raw: bytes) -> None:
        """Publish a message, as far as nothing goes wrong with it."""
        tick = stamp_ns // TICK_NS
        for fault, stream in self._faults:
            if fault.strikes_at(tick * TICK_S) and uniform(stream, np.uint64(tick)) < fault.share:
                self._wrong(fault, raw)
                return
        self._publish(raw)
        self._release()

    def _wrong(self, fault: MessageFault, raw: bytes) -> None:
        if fault.how == 'duplicate':
            self._publish(raw)
            self._publish(raw)
        elif fault.how == 'corrupt':
            self._publish(raw[: len(raw) // 2])
        elif fault.how == 'delay':
            self._after(fault.delay_s, partial(self._publish, raw))
        elif fault.how == 'reorder':
            self._held.append(raw)
            self._after(_NO_NEXT_S, self._release)

    def _release(self) -> None:
        """Publish what was held back for this moment."""
        held, self._held = self._held, []
        for raw in held:
            self._publish(raw)

    def _after(self, delay_s: float, call: Callable[[], None]) -> None:
        """Call something once, later."""

        def late() -> None:
            self._node.destroy_timer(timer)
            call()

        timer = self._node.wall_timer(delay_s, late)
