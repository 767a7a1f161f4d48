# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""What verification says: a difference, and a verdict for each block."""

from typing import NamedTuple

from glider_model.base.signals import TICK_NS

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
    status: str  #: IDENTICAL, DIFFERENT or SKIPPED
    reason: str  #: why it was skipped
    ticks: int  #: that were computed
    compared: dict[str, int]  #: messages by topic
    differing: dict[str, int]  #: those of them that differ, by topic
    first: Difference | None
    notes: list[str]


def skipped(block: str, reason: str) -> Verdict:
    """Verdict on a block that cannot be compared."""
    return Verdict(
        block=block,
        status=SKIPPED,
        reason=reason,
        ticks=0,
        compared={},
        differing={},
        first=None,
        notes=[],
    )


def time_text(stamp_ns: int) -> str:
    """Time of a stamp as part of a sentence."""
    return f't = {stamp_ns / 1e9:.1f} s'
