# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""Which message of a topic belongs to which tick, or step."""

import numpy as np

from glider_base.signals import TICK_NS
from glider_mission.recording.ros.recorded_run import Series

#: Ticks at the end that may lack in a topic: whoever recorded it left in the middle of one.
TICKS_OF_THE_END = 10


def place_ticks(stamps_ns: np.ndarray) -> np.ndarray:
    """Tick of every message of a topic, -1 where its stamp is no tick.

    A message that stands alone between the ticks k - 1 and k + 1 is that of tick k, whatever its
    stamp says: it is the stamp that is wrong.
    """
    ticks = np.where(stamps_ns % TICK_NS == 0, stamps_ns // TICK_NS, -1)
    before = np.concatenate(([-1], ticks[:-1]))
    last = len(ticks) - 1
    for i in np.flatnonzero(ticks != before + 1):
        expected = (ticks[i - 1] if i else -1) + 1
        if i == last or (i < last and ticks[i + 1] == expected + 1):
            ticks[i] = expected
    return ticks


class Track:
    """Which message of a topic belongs to each step of a block; -1 where there is none."""

    def __init__(self, series: Series, index: np.ndarray) -> None:
        self.series, self.index = series, index
        present = np.flatnonzero(index >= 0)
        self.end = int(present[-1]) + 1 if len(present) else 0  #: after the last step it has
        unusable = np.isin(index, list(series.unusable))
        gaps = np.flatnonzero((index < 0) | unusable)
        #: first step without a message that a node could use
        self.gap = int(gaps[0]) if len(gaps) else len(index)


def by_tick(series: Series, ticks: int) -> tuple[Track, list[int]]:
    """Track of a topic in lockstep, and messages that have no place in it."""
    placed = place_ticks(series.stamps_ns)
    index = np.full(ticks, -1)
    inside = (placed >= 0) & (placed < ticks)
    backwards = np.flatnonzero(inside)[::-1]
    index[placed[backwards]] = backwards  # the first of several stays
    taken = np.zeros(len(series), bool)
    taken[index[index >= 0]] = True
    return Track(series, index), [int(i) for i in np.flatnonzero(~taken)]
