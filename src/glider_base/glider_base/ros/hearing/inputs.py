# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""Inputs of a node: one subscription with what it brought last, and what of it is accepted."""

import math
import time

from glider_base.ros.hearing.owner import Owner
from glider_base.ros.wire.codec import MessageError
from glider_base.ros.wire.topics import Topic
from glider_base.signals import TICK_NS

#: The norm of a quaternion that is further from 1 is that of no attitude (-).
NOT_UNIT = 0.1
#: A battery that says that it has more of its capacity (-) counts in percent.
MOST_CHARGED = 1.5

#: A topic whose messages are refused is reported at most so often (s of wall time).
_REFUSED_EVERY_S = 1.0


def _check_attitude(values: tuple[float, ...]) -> None:
    if abs(math.hypot(*values[:4]) - 1.0) > NOT_UNIT:
        raise MessageError(f'orientation is {values[:4]} (allowed: unit quaternions)')


def _check_battery(values: tuple[float, ...]) -> None:
    if values[4] > MOST_CHARGED:
        raise MessageError(f'percentage is {values[4]:g} (allowed: 0 to 1)')


_CHECKS = {'imu': _check_attitude, 'battery': _check_battery}


class Input:
    """A subscription, and what it brought last."""

    def __init__(self, topic: Topic, lockstep: bool, stand_in: str = '') -> None:
        self.topic = topic
        #: in errors: free-running, any node may be in the place of its publisher
        self.named = f'{topic.name} of {topic.publisher}' if lockstep else topic.name
        self.subscription = None
        self.stamp_ns = -1
        self.values: tuple[float, ...] = ()
        self.arrived_s = -float('inf')  #: on the clock of the cycles
        self.stood_s = -float('inf')  #: the same, of the last that had the stamp of the one before
        self.owner = Owner(topic, lockstep, stand_in)
        self.refused = 0  #: messages of other publishers, and such as cannot be used
        self.refusal_shown_s = -float('inf')  #: wall time at which a refusal was reported last
        self.lost = 0  #: messages that lack between those that came
        self.late = 0  #: cycles that had to do with the input of the one before
        self.used_ns = -1
        self.excused_ns = -1  #: stamp at which time jumped last
        #: raises a `MessageError` if numbers cannot be what was measured
        self.check = _CHECKS.get(topic.name, lambda values: None)

    def _read(self, raw: bytes) -> tuple[int, tuple[float, ...]]:
        try:
            stamp_ns, values = self.topic.codec.decode(raw, check_frames=True)
            self.check(values)
        except MessageError as error:
            raise type(error)(f'{self.named}: {error}') from None
        return stamp_ns, values

    def accept(self, raw: bytes) -> None:
        """Keep a message; a `MessageError` names the topic if it cannot be used."""
        self.stamp_ns, self.values = self._read(raw)

    def accept_newest(self, raw: bytes, now_s: float, max_age_s: float) -> None:
        """Keep a message in free-running mode, unless it was overtaken on its way.

        A stamp that stands still does not refresh the input. One that is older than any input may
        be means that the clock of the vehicle has been set back. Errors are those of `accept`.
        """
        before, (stamp_ns, values) = self.stamp_ns, self._read(raw)
        since_ns = stamp_ns - before
        if before >= 0 and -max_age_s * 1e9 <= since_ns < 0:
            return
        self.stamp_ns, self.values = stamp_ns, values
        if since_ns:
            self.arrived_s = now_s
        else:
            self.stood_s = now_s
        if before >= 0 and since_ns <= max_age_s * 1e9:
            self.lost += max(0, round(since_ns / TICK_NS) - 1)

    def refuse(self) -> bool:
        """Count a message that is refused; whether it is time to tell of it."""
        self.refused += 1
        now_s = time.monotonic()
        if now_s - self.refusal_shown_s < _REFUSED_EVERY_S:
            return False
        self.refusal_shown_s = now_s
        return True
