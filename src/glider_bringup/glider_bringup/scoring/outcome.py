# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""What became of the vehicle: completed, surfaced by its guard, or lost.

By the true depth, whatever the vehicle measured, and by what the guard told.
"""

import math
from typing import NamedTuple

import numpy as np

from glider_base.block import changes_to_tell
from glider_base.signals import TICK_NS, TICK_S
from glider_guard.block import TELL_EVERY_NS
from glider_guard.depth import SURFACE_M
from glider_guard.rows import ALL, DROPS, ROWS, SURFACES

COMPLETED, SURFACED, LOST, INFEASIBLE = 'completed', 'surfaced', 'lost', 'infeasible'
#: All has been done for so long (s), and the vehicle has not come up by this (m): nothing is left.
TRIES_S, CLIMBS_M = 600.0, 5.0


class Outcome(NamedTuple):
    """What became of a vehicle."""

    status: str
    reason: str  #: in words; empty where there is nothing to say


def told_by_guard(bits: np.ndarray) -> np.ndarray:
    """Rows of the guard as it told them, which it does once a second at most, int64[ticks].

    The same from a bag, which has what was told, and from a log, which has what was noticed.
    """
    bits = bits.astype(np.int64) & ALL
    stamps_ns = np.arange(len(bits)) * TICK_NS
    before = np.zeros(1, np.int64)
    ticks = changes_to_tell(bits[:, None], stamps_ns, TELL_EVERY_NS, before, -TELL_EVERY_NS)
    if not len(ticks):
        return np.zeros(len(bits), np.int64)
    last = np.searchsorted(ticks, np.arange(len(bits)), side='right') - 1
    return np.where(last >= 0, bits[np.asarray(ticks)[last]], 0)


def ends_mission(told: np.ndarray) -> np.ndarray:
    """Where the guard brings the vehicle to the surface for good, bool[n]."""
    return (told & (SURFACES | DROPS)) != 0


def outcome_of(
    depth: np.ndarray, told: np.ndarray, crush_depth_m: float, infeasible: bool
) -> Outcome:
    """What became of a vehicle.

    Parameters
    ----------
    depth : float64[ticks]
        True one (m).
    told : int64[ticks]
        See `told_by_guard`.
    crush_depth_m : float
        Infinite if nobody knows.
    infeasible : bool
        The course could not be held.
    """
    if not len(depth):
        return Outcome(COMPLETED, '')
    deepest_m = float(np.max(depth))
    if deepest_m > crush_depth_m:
        at_s = TICK_S * int(np.argmax(depth > crush_depth_m))
        return Outcome(
            LOST,
            f'deeper than its hull bears, {crush_depth_m:,.0f} m, at {at_s:,.1f} s; '
            f'deepest {deepest_m:,.1f} m',
        )
    if not ends_mission(told[-1:])[0]:
        return Outcome(INFEASIBLE if infeasible else COMPLETED, '')
    reason, end_m = _ended(told), float(depth[-1])
    if end_m > SURFACE_M:
        reason += f'; {end_m:,.0f} m deep at the end'
        if _nothing_is_left(depth, told):
            return Outcome(LOST, f'{reason}, and nothing left to try')
    return Outcome(SURFACED, reason)


def _ended(told: np.ndarray) -> str:
    """When the guard ended the mission for good, and why."""
    free = np.flatnonzero(~ends_mission(told))
    tick = int(free[-1]) + 1 if len(free) else 0
    rows = [row for row in ROWS if told[tick] & row.bit & (SURFACES | DROPS)]
    why = '; '.join(row.says for row in rows)
    return f'the guard ended the mission at {tick * TICK_S:,.1f} s: {why}'


def _nothing_is_left(depth: np.ndarray, told: np.ndarray) -> bool:
    """Whether all has been done for long, and the vehicle has not come up."""
    ticks = math.ceil(TRIES_S / TICK_S)
    return (
        len(depth) > ticks
        and bool(np.all(told[-ticks:] & DROPS))
        and depth[-ticks] - depth[-1] < CLIMBS_M
    )
