# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""What verification says: a difference, and a verdict for each block."""

from collections.abc import Mapping, Sequence
from typing import NamedTuple

from glider_base.signals import TICK_NS

IDENTICAL, DIFFERENT, SKIPPED = 'identical', 'different', 'skipped'

#: What stands where there is no field, and no message.
NOT_RECORDED, WHOLE = 'not recorded', '(message)'


class Difference(NamedTuple):
    """Where a recording and today's code differ."""

    stamp_ns: int
    topic: str
    field: str
    computed: str
    recorded: str

    @property
    def tick(self) -> int:
        """Number of the tick; of a vehicle's own clock, that many tenths of a second."""
        return self.stamp_ns // TICK_NS


class Verdict(NamedTuple):
    """What came out for one block."""

    block: str
    result: str  #: IDENTICAL, DIFFERENT or SKIPPED
    reason: str = ''  #: why it was skipped
    ticks: int = 0  #: that were computed
    compared: Mapping[str, int] = {}  #: messages by topic
    differing: Mapping[str, int] = {}  #: those of them that differ, by topic
    first: Difference | None = None
    notes: Sequence[str] = ()


def time_text(stamp_ns: int) -> str:
    """Time of a stamp as part of a sentence."""
    return f't = {stamp_ns / 1e9:.1f} s'
