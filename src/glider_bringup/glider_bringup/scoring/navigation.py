# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""How well the vehicle knew where it was: at each surfacing, before the first fix told it."""

import itertools
import math
from typing import NamedTuple

import numpy as np

from glider_base.frames import Origin, from_geodetic
from glider_bringup.scoring.scores import largest, rms, seconds
from glider_mission.blocks import COLUMNS
from glider_navigation.phase import DIVES_M, SURFACES_M

_ODOM, _FIX = (COLUMNS[name].start for name in ('odom', 'fix'))
_CURRENT, _BELIEVED = (COLUMNS[name].start for name in ('current_velocity', 'believed_current'))
_E2 = COLUMNS['tracking_error'].start + 1
#: Covariance of east and north in an odometry: xx, xy, yy.
_COVARIANCE = (_ODOM + 13, _ODOM + 14, _ODOM + 16)
#: The current has been met by this surfacing: figures of what comes later begin with it.
FOURTH = 3
#: A 95 % ellipse: its radius squared over the variance, of two numbers (chi squared).
ELLIPSE_95 = 5.991


class Surfacing(NamedTuple):
    """What was known when the vehicle came up. Pairs are east, north."""

    tick: int
    true: tuple[float, float]  #: place (m)
    believed: tuple[float, float]
    covariance: tuple[float, float, float]  #: of east, east and north, north (m^2)
    cross_track_m: float  #: true one
    believed_cross_track_m: float
    true_current: tuple[float, float]  #: mean of the way under water (m/s)
    way_rms_m: float  #: of the true cross-track error in it
    dive_tick: int  #: at which it had dived
    fix: tuple[float, float] | None = None  #: first one (m)
    learnt_current: tuple[float, float] | None = None  #: believed of the way after the fixes (m/s)

    @property
    def error_m(self) -> float:
        """Distance between the true and the estimated position (m)."""
        return math.dist(self.true, self.believed)

    def off_squared(self, place: tuple[float, float], variance: float = 0.0) -> float | None:
        """Squared distance of a place from the believed one, over its variance; None of none."""
        xx, xy, yy = self.covariance
        xx, yy = xx + variance, yy + variance
        determinant = xx * yy - xy * xy
        if not determinant > 0.0:
            return None
        d_e, d_n = place[0] - self.believed[0], place[1] - self.believed[1]
        return (yy * d_e * d_e - 2.0 * xy * d_e * d_n + xx * d_n * d_n) / determinant

    @property
    def is_inside(self) -> bool | None:
        """Whether the true place is inside the 95 % ellipse; None if there is none."""
        off = self.off_squared(self.true)
        return None if off is None else off <= ELLIPSE_95

    def report(self) -> dict:
        """What ``score.json`` tells of it; pairs are north, east, as everywhere there."""
        xx, xy, yy = self.covariance
        return {
            't_s': seconds(self.tick),
            'dive_t_s': seconds(self.dive_tick),
            'true_ned_m': _north_east(self.true),
            'believed_ned_m': _north_east(self.believed),
            'covariance_m2': [yy, xy, xx],
            'fix_ned_m': _north_east(self.fix),
            'cross_track_m': self.cross_track_m,
            'believed_cross_track_m': self.believed_cross_track_m,
            'error_m': self.error_m,
            'inside_95': self.is_inside,
            'dac_true_mps': _north_east(self.true_current),
            'dac_believed_mps': _north_east(self.learnt_current),
        }


class NavigationScorer:
    """Takes in log rows, and tells of every surfacing.

    Parameters
    ----------
    origin : Origin
        To which fixes are relative.
    reckons : bool
        Whether the vehicle has to reckon its place between fixes.
    """

    def __init__(self, origin: Origin, reckons: bool = False) -> None:
        self._origin, self._reckons = origin, reckons
        self._ticks, self._is_deep = 0, False
        #: of the way under water: sum of the current, of squared cross-track errors, and ticks
        self._current, self._squares, self._deep_ticks = np.zeros(2), 0.0, 0
        self._dive_tick, self._waits_for_fix, self._was_fixed = 0, False, False
        self.surfacings: list[Surfacing] = []
        self.innovations: list[float] = []  #: squared, over their variance
        self.dac_errors: list[tuple[float, float]] = []  #: of east and north (m/s)

    def add(self, log: np.ndarray, true: np.ndarray) -> None:
        """Take in rows as they are and with true motion, float64[n, ROW] each."""
        depth = -true[:, _ODOM + 2]
        zone = np.where(depth > DIVES_M, 1, np.where(depth < SURFACES_M, -1, 0))
        last = np.maximum.accumulate(np.where(zone != 0, np.arange(len(zone)), -1))
        deep = np.where(last < 0, self._is_deep, zone[last] > 0)
        turns = np.flatnonzero(np.diff(deep, prepend=self._is_deep))
        edges = np.unique([0, *turns, len(log)])
        for start, end in itertools.pairwise(edges.tolist()):
            if start in turns:
                self._turn(log[start], true[start], self._ticks + int(start))
            if self._is_deep:
                self._current += np.sum(log[start:end, _CURRENT : _CURRENT + 2], axis=0)
                self._squares += float(np.sum(true[start:end, _E2] ** 2))
                self._deep_ticks += end - start
            elif self._waits_for_fix:
                self._look_for_fix(log[start:end])
        self._ticks += len(log)

    def _turn(self, row: np.ndarray, true: np.ndarray, tick: int) -> None:
        """Come up, or dive."""
        self._is_deep = not self._is_deep
        if self._is_deep:
            self._dive_tick = tick
            self._was_fixed = bool(self.surfacings) and not self._waits_for_fix
            self._current, self._squares, self._deep_ticks = np.zeros(2), 0.0, 0
            self._waits_for_fix = False
            return
        believed = row[_BELIEVED : _BELIEVED + 2]
        if self._was_fixed and np.all(np.isfinite(believed)):  # what the way before told
            e, n = map(float, believed)
            before = self.surfacings[-1] = self.surfacings[-1]._replace(learnt_current=(e, n))
            true_e, true_n = before.true_current
            self.dac_errors.append((e - true_e, n - true_n))
        ticks = max(1, self._deep_ticks)
        mean = self._current / ticks
        self.surfacings.append(
            Surfacing(
                tick=tick,
                true=(float(true[_ODOM]), float(true[_ODOM + 1])),
                believed=(float(row[_ODOM]), float(row[_ODOM + 1])),
                covariance=tuple(float(row[i]) for i in _COVARIANCE),
                cross_track_m=float(true[_E2]),
                believed_cross_track_m=float(row[_E2]),
                true_current=(float(mean[0]), float(mean[1])),
                way_rms_m=math.sqrt(self._squares / ticks),
                dive_tick=self._dive_tick,
            )
        )
        self._waits_for_fix = True

    def _look_for_fix(self, rows: np.ndarray) -> None:
        """Note how far the first fix is off what was believed."""
        found = np.flatnonzero(rows[:, _FIX] >= 0.0)
        if not len(found):
            return
        self._waits_for_fix = False
        at = max(0, int(found[0]) - 1)  # what was believed before it
        _, latitude, longitude, variance, _ = rows[found[0], _FIX : _FIX + 5]
        north, east = from_geodetic(latitude, longitude, self._origin)
        row = rows[at]
        last = self.surfacings[-1] = self.surfacings[-1]._replace(fix=(east, north))
        before = last._replace(
            believed=(float(row[_ODOM]), float(row[_ODOM + 1])),
            covariance=tuple(float(row[i]) for i in _COVARIANCE),
        )
        off = before.off_squared((east, north), float(variance))
        if off is not None:
            self.innovations.append(off)

    def result(self, method: str, believed_cross_track: dict) -> dict:
        """The part ``navigation`` of ``score.json``; a figure without data is None."""
        errors, beside, ways = (
            np.array([getattr(one, name) for one in self.surfacings])
            for name in ('error_m', 'cross_track_m', 'way_rms_m')
        )
        within = [one.is_inside for one in self.surfacings if one.is_inside is not None]
        dac = np.array([math.hypot(*error) for error in self.dac_errors])
        return {
            'method': method,
            'surfacings': len(self.surfacings),
            'error_m': {
                'p50': _percentile(errors, 50),
                'p95': _percentile(errors, 95),
                'worst': largest(errors),
            },
            'surfacing_cross_track_m': beside.tolist(),
            'surfacing_error_m': errors.tolist(),
            'surfacing_t_s': [seconds(one.tick) for one in self.surfacings],
            'under_water_rms_m': ways.tolist(),
            'from_fourth': {
                'surfacing_cross_track_m': largest(beside[FOURTH:]),
                'under_water_rms_m': rms(ways[FOURTH + 1 :]),
            },
            'dac_error_mps': {'rms': rms(dac), 'worst': largest(dac)},
            'believed_cross_track_m': believed_cross_track,
            'ellipse_95_share': float(np.mean(within)) if within else None,
            'fixed': len(self.innovations),
            'innovation_squared': float(np.mean(self.innovations)) if self.innovations else None,
            'reports': [one.report() for one in self.surfacings] if self._reckons else [],
        }


def _percentile(values: np.ndarray, share: float) -> float | None:
    return float(np.percentile(values, share)) if len(values) else None


def _north_east(pair: tuple[float, float] | None) -> list[float] | None:
    """An east and a north the other way round; None of what is not known."""
    return None if pair is None or not all(map(math.isfinite, pair)) else [pair[1], pair[0]]
