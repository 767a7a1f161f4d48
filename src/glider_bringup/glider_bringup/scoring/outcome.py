# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""What became of the vehicle: completed, surfaced by its guard, or lost.

By the true depth, whatever the vehicle measured, and by what the guard reported.
"""

import math
from typing import Any, NamedTuple

import numpy as np

from glider_base.block import changes_to_tell
from glider_base.frames import to_geodetic
from glider_base.signals import TICK_NS, TICK_S
from glider_bringup.scoring.scores import seconds
from glider_guard.block import TELL_EVERY_NS
from glider_guard.rows import DROPS, ROWS, SURFACES
from glider_guard.settings import GuardLimitSettings
from glider_guard.witness import AFLOAT_M
from glider_guidance.path.curve import (
    PathParams,
    path_closest,
    path_entry,
    path_length,
    path_point,
    path_tangent,
)
from glider_mission.rules import Rules
from glider_model.ocean.bottom import least_height

COMPLETED, SURFACED, LOST, INFEASIBLE = 'completed', 'surfaced', 'lost', 'infeasible'
UNFINISHED = 'unfinished'
#: How far a turn may overshoot the rated depth: as the guard has it, unless it is set otherwise.
LIMITS = GuardLimitSettings()
#: The pace is known once so much of the path has been made good (-).
LEAST_SHARE = 0.02
#: Points of a path that are no farther apart (m) are one.
SAME_M = 0.01
#: All has been done for so long (s), and the vehicle has not come up by this (m): nothing is left.
TRIES_S, CLIMBS_M = 600.0, 5.0


def as_reported(bits: np.ndarray) -> np.ndarray:
    """Bits of guard or control as they are reported, which is once a second at most, int64[ticks].

    The same from a bag, which has what was reported, and from a log, which has what was noticed.
    """
    bits, stamps_ns = bits.astype(np.int64), np.arange(len(bits)) * TICK_NS
    before = np.zeros(1, np.int64)
    ticks = changes_to_tell(bits[:, None], stamps_ns, TELL_EVERY_NS, before, -TELL_EVERY_NS)
    return np.repeat([0, *bits[ticks]], np.diff([0, *ticks, len(bits)]))


def ends_mission(reported: np.ndarray) -> np.ndarray:
    """Where the guard brings the vehicle to the surface for good, bool[n]."""
    return (reported & (SURFACES | DROPS)) != 0


def outcome_of(
    depth: np.ndarray,
    reported: np.ndarray,
    hull: tuple[float, float],
    infeasible: bool,
    missing: str,
) -> tuple[str, str]:
    """What became of a vehicle: its status, and the reason, empty where there is nothing to say.

    By its true depth (m), float64[ticks], what the guard ``reported`` (see `as_reported`),
    the depths that its hull is rated for and at which it gives way (m, infinite if nobody knows),
    whether the course could not be held, and what of its mission it has not flown in its time.
    """
    if not len(depth):
        return COMPLETED, ''
    rated_m, crush_m = hull
    deepest_m, end_m = float(np.max(depth)), float(depth[-1])
    if deepest_m > crush_m:
        return LOST, _beyond(depth, crush_m, 'its hull bears')
    is_ended = ends_mission(reported[-1:])[0]
    reasons = [_ended(reported) if is_ended else missing]
    if (is_ended or missing) and end_m > AFLOAT_M:
        reasons.append(f'{end_m:,.0f} m deep at the end')
        if is_ended and _nothing_is_left(depth, reported):
            return LOST, f'{"; ".join(reasons)}, and nothing left to try'
    if deepest_m > rated_m + LIMITS.margin_m(rated_m):
        reasons.append(_beyond(depth, rated_m, 'it is rated for'))
    status = INFEASIBLE if infeasible else UNFINISHED if missing else COMPLETED
    return SURFACED if is_ended else status, '; '.join(filter(None, reasons))


def _beyond(depth: np.ndarray, limit_m: float, what: str) -> str:
    """That a vehicle was deeper than a limit (m), and when first."""
    at_s = TICK_S * int(np.argmax(depth > limit_m))
    deepest_m = float(np.max(depth))
    return f'deeper than {what}, {limit_m:,.0f} m, at {at_s:,.1f} s; deepest {deepest_m:,.1f} m'


def arrival_of(
    place: tuple[float, float],
    targets: np.ndarray,
    tick: int,
    since: int,
    is_at_end: bool,
    rules: Rules,
) -> dict[str, Any] | None:
    """Whether and when a vehicle came to the end of its path; None where it is to go on past it.

    Parameters
    ----------
    place : tuple of 2 float
        True one at the arrival, else at the end of the run, north and east (m).
    targets : float64[ticks, 2]
        The points of the path that guidance had come to, north and east (m), since it follows it.
    tick : int
        Of the arrival, else ticks of the run.
    since : int
        Tick from which the path is followed.
    is_at_end : bool
        Whether it came up there, or abeam of it, as it estimates.

    Returns
    -------
    dict
        arrived (see `Rules.has_arrived`), t_s (at the end), missed_m (distance from the
        last point), left_m (horizontal way along the path), eta_s (when it is at the end, or
        would be at its pace so far), overrun_s (by what that is beyond the time of the mission),
        place_latlon_deg (if there is a chart). What nobody knows is None.
    """
    if rules.path is None or not rules.ends:
        return None
    t_s, length = seconds(tick), float(path_length(rules.path))
    end = path_point(length, rules.path)
    missed_m, left_m, eta_s = math.dist(place, end[:2]), 0.0, t_s
    if not is_at_end:
        began_m, come_m = _come_from_to(targets, rules.path)
        # along the path as it goes on: it may have been carried back, or be past a corner
        d_n, d_e, _ = path_tangent(come_m + SAME_M, rules.path)
        back_n, back_e = targets[-1] - place
        behind_m = float(d_n * back_n + d_e * back_e) / math.hypot(d_n, d_e)
        ways, made_m = rules.path.ways, come_m - behind_m - began_m
        # who is abeam of its end, or beyond, and not near enough has to come back
        least_m = 0.0 if rules.has_arrived(missed_m) else missed_m
        way_m = ways[-1] - float(np.interp(come_m, rules.path.knots, ways)) + behind_m
        left_m = max(least_m, way_m)
        pace_s = (t_s - seconds(since)) / made_m if made_m >= LEAST_SHARE * length else None
        eta_s = None if pace_s is None else t_s + max(least_m, length - come_m + behind_m) * pace_s
    return {
        'arrived': is_at_end and rules.has_arrived(missed_m),
        't_s': t_s if is_at_end else None,
        'missed_m': missed_m,
        'left_m': left_m,
        'eta_s': eta_s,
        'overrun_s': None if eta_s is None else max(0.0, eta_s - rules.duration_s),
        'place_latlon_deg': list(to_geodetic(*place, rules.origin)) if rules.origin else None,
    }


def way_to_end(place: tuple[float, float], path: PathParams) -> float:
    """Horizontal way (m) from a place to where a path is entered, and along it to its end."""
    s = path_entry(*place, 0.0, True, path)
    entry = path_point(s, path)
    return math.dist(place, entry[:2]) + path.ways[-1] - float(np.interp(s, path.knots, path.ways))


def _come_from_to(targets: np.ndarray, path: PathParams) -> tuple[float, float]:
    """Parameters of the path (m) at the first and the last of the points on it.

    Where the path comes by a point again, it is the time that fits the way between the two.
    """
    began_m = float(path_entry(*targets[0], 0.0, True, path))
    way_m = float(np.sum(np.hypot(*np.diff(targets, axis=0).T)))
    way_m += np.interp(began_m, path.knots, path.ways)
    likely_m = float(np.interp(way_m, path.ways, path.knots))
    found = [_closest_on(i, targets[-1], path) for i in range(len(path.knots) - 1)]
    near_m = min(off_m for _, off_m in found) + SAME_M
    come = min((s for s, off_m in found if off_m <= near_m), key=lambda s: abs(s - likely_m))
    return began_m, come


def _closest_on(i: int, point: np.ndarray, path: PathParams) -> tuple[float, float]:
    """Parameter of the point on a piece of a path that is closest, and how far it is off (m)."""
    start, end = path.knots[i : i + 2]
    flat, steep = math.cos(path.slope), math.sin(path.slope)
    piece = path._replace(
        knots=np.array([0.0, end - start]),
        coefficients=path.coefficients[i : i + 1],
        bearing=path.bearing + (path.turn * start * flat / path.radius if path.radius else 0.0),
        start_d=path.start_d + start * steep,
    )
    s = path_closest(*point, 0.0, True, piece)
    return float(start + s), math.dist(point, path_point(s, piece)[:2])


class BottomWatch:
    """How near to the bottom of the sea a vehicle came, tick by tick."""

    def __init__(self, bottom: NamedTuple) -> None:
        self._bottom, self._ticks = bottom, 0
        self._least_m, self.touched_tick = math.inf, None  #: None: it has not touched

    def add(self, n: np.ndarray, e: np.ndarray, depth: np.ndarray) -> None:
        """Take in the true places of a block of ticks, float64[n] each (m)."""
        least_m, where = least_height(n, e, depth, self._bottom)
        self._least_m = min(self._least_m, least_m)
        if self.touched_tick is None and least_m <= 0.0:
            self.touched_tick = self._ticks + where
        self._ticks += len(depth)

    def result(self) -> dict[str, Any] | None:
        """Whether and when it touched the bottom first (s), and its least height over it (m)."""
        if not math.isfinite(self._least_m):
            return None
        tick = self.touched_tick
        at_s = None if tick is None else seconds(tick)
        return {'touched': tick is not None, 't_s': at_s, 'least_height_m': self._least_m}


def _ended(reported: np.ndarray) -> str:
    """When the guard ended the mission for good, and why."""
    free = np.flatnonzero(~ends_mission(reported))
    tick = int(free[-1]) + 1 if len(free) else 0
    rows = [row for row in ROWS if reported[tick] & row.bit & (SURFACES | DROPS)]
    why = '; '.join(row.says for row in rows)
    return f'the guard ended the mission at {tick * TICK_S:,.1f} s: {why}'


def _nothing_is_left(depth: np.ndarray, reported: np.ndarray) -> bool:
    """Whether all has been done for long, and the vehicle has not come up."""
    ticks = math.ceil(TRIES_S / TICK_S)
    return (
        len(depth) > ticks
        and bool(np.all(reported[-ticks:] & DROPS))
        and depth[-ticks] - depth[-1] < CLIMBS_M
    )
