# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""What a node hears: one subscription with what it brought last, and what of it is believed."""

import math
import time

from glider_model.base.signals import TICK_NS
from glider_model.ros.wire.codec import MessageError
from glider_model.ros.wire.topics import Topic

#: Messages that may be lost on their way without their publisher being taken for another.
MOST_LOST = 50

#: The norm of a quaternion that is further from 1 is that of no attitude (-).
NOT_UNIT = 0.1

#: A topic whose messages are refused is told of at most so often (s of wall time).
_REFUSED_EVERY_S = 1.0


class Input:
    """A subscription, and what it brought last."""

    def __init__(self, topic: Topic) -> None:
        self.topic = topic
        self.subscription = None
        self.stamp_ns = -1
        self.values: tuple[float, ...] = ()
        self.arrived_s = -float('inf')  #: on the clock of the cycles
        self.number = 0  #: that the publisher gave the last message; 0: none yet
        self.owner = ''  #: full name of the publisher; '' as long as it is not sure
        self.refused = 0  #: messages of other publishers, and such as cannot be used
        self.told_refused_s = -float('inf')  #: wall time at which a refusal was told of last
        self.lost = 0  #: messages that lack between those that came
        self.late = 0  #: cycles that had to do with the input of the one before
        self.used_ns = -1

    def accept(self, raw: bytes) -> None:
        """Keep a message.

        Raises
        ------
        MessageError
            Naming topic and publisher, if it cannot be used.
        """
        try:
            stamp_ns, values = self.topic.codec.decode(raw, check_frames=True)
            if self.topic.name == 'imu' and abs(math.hypot(*values[:4]) - 1.0) > NOT_UNIT:
                raise MessageError(f'orientation is {values[:4]} (allowed: unit quaternions)')
        except MessageError as error:
            said = f'{self.topic.name} of {self.topic.publisher}: {error}'
            raise type(error)(said) from None
        self.stamp_ns, self.values = stamp_ns, values

    def accept_newest(self, raw: bytes, now_s: float, max_age_s: float) -> bool:
        """Keep a message in free-running mode; False if it was overtaken on its way.

        A stamp that stands still does not refresh the input. One that is older than any input may
        be means that the clock of the vehicle has been set back.

        Raises
        ------
        MessageError
            As `accept`, or if the message has no stamp.
        """
        before = self.stamp_ns
        since_ns = self.topic.codec.decode_stamp(raw) - before
        if before >= 0 and -max_age_s * 1e9 <= since_ns < 0:
            return False
        self.accept(raw)
        if since_ns:
            self.arrived_s = now_s
        if before >= 0 and since_ns <= max_age_s * 1e9:
            self.lost += max(0, round(since_ns / TICK_NS) - 1)
        return True

    def refuse(self) -> bool:
        """Count a message that is refused; whether it is time to tell of it."""
        self.refused += 1
        now_s = time.monotonic()
        if now_s - self.told_refused_s < _REFUSED_EVERY_S:
            return False
        self.told_refused_s = now_s
        return True

    def is_from_another(self, info: dict) -> bool:
        """Whether a message comes from another publisher than those before.

        Publishers number their messages, so that in a line of numbers with two publishers that of
        the first goes on and that of the second does not. Not every middleware tells the numbers:
        then nobody is taken for another.

        Parameters
        ----------
        info : dict
            What rclpy tells of the message.
        """
        number = info.get('publication_sequence_number') or 0
        step = number - self.number
        goes_on = step == 1 or not (number and self.number)
        if goes_on or self.subscription.get_publisher_count() <= 1 or 1 < step <= MOST_LOST:
            self.number = number
            return False
        return True
