# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""How well the vehicle knew where it was: at each surfacing, before the first fix showed it."""

import math
from typing import NamedTuple

import numpy as np

from glider_base.frames import Origin, from_geodetic
from glider_base.kernel import kernel
from glider_bringup.scoring.scores import largest, mean, rms, seconds
from glider_mission.blocks import COLUMNS
from glider_model.onboard.fix_watch import DIVES_M, SURFACES_M

_ODOM, _FIX = (COLUMNS[name].start for name in ('odom', 'fix'))
_CURRENT, _BELIEVED = (COLUMNS[name].start for name in ('current_velocity', 'believed_current'))
_E2 = COLUMNS['tracking_error'].start + 1
#: North and east in an odometry, and their covariance: of north, of both, of east.
_PLACE, _COVARIANCE = [_ODOM + 1, _ODOM], [_ODOM + 16, _ODOM + 14, _ODOM + 13]
#: The current has been met by this surfacing: figures of what comes later begin with it.
FOURTH = 3
#: A 95 % ellipse: its radius squared over the variance, of two numbers (chi squared).
ELLIPSE_95 = 5.991


class _Way(NamedTuple):
    """Of a dive segment: sums of the current and of squared cross-track errors, and ticks."""

    east: float = 0.0
    north: float = 0.0
    squares: float = 0.0
    ticks: int = 0


@kernel
def _until_turn(log, true, start, is_deep, way):
    """Row from ``start`` on that dives or surfaces, or the number of rows; the way until then."""
    for row in range(start, len(log)):
        depth = -true[row, _ODOM + 2]
        if depth < SURFACES_M if is_deep else depth > DIVES_M:
            return row, way
        if is_deep:
            error, current = true[row, _E2], log[row, _CURRENT:]
            way = _Way(
                way.east + current[0],
                way.north + current[1],
                way.squares + error * error,
                way.ticks + 1,
            )
    return len(log), way


class NavigationScorer:
    """Takes in log rows, and tells of every surfacing.

    Fixes are relative to ``origin``; ``reckons``: the vehicle has to reckon its place between
    them; ``tells``: it tells the current that it estimates.
    """

    def __init__(self, origin: Origin, reckons: bool, tells: bool) -> None:
        self._origin, self._reckons, self._tells = origin, reckons, tells
        self._ticks, self._is_deep = 0, False
        self._way = _Way()
        self._dive_tick, self._waits_for_fix, self._was_fixed = 0, False, False
        self._mean_current = np.zeros(2)  #: of the last whole way, east and north (m/s)
        self._ways: list[float] = []  #: rms of the true cross-track error of each (m)
        self._surfacings: list[dict] = []  #: what ``score.json`` tells of each
        self._innovations: list[float] = []  #: squared, over their variance
        self._dac_errors: list[float] = []  #: (m/s)

    def add(self, log: np.ndarray, true: np.ndarray) -> None:
        """Take in rows as they are and with true motion, float64[n, ROW] each."""
        start = 0
        while start < len(log):
            end, self._way = _until_turn(log, true, start, self._is_deep, self._way)
            if self._reckons and self._waits_for_fix:
                self._look_for_fix(log[start:end])
            if end < len(log):
                self._turn(log[end], true[end], self._ticks + end)
            start = end
        self._ticks += len(log)

    def _turn(self, row: np.ndarray, true: np.ndarray, tick: int) -> None:
        """Come up, or dive."""
        self._is_deep = not self._is_deep
        if self._is_deep:
            self._dive_tick = tick
            self._was_fixed = bool(self._surfacings) and not self._waits_for_fix
            self._way, self._waits_for_fix = _Way(), False
            return
        estimated = row[_BELIEVED : _BELIEVED + 2]
        # by the dive segment before
        if self._was_fixed and self._tells and np.all(np.isfinite(estimated)):
            self._surfacings[-1]['dac_believed_mps'] = _north_east(estimated)
            self._dac_errors.append(math.dist(estimated, self._mean_current))
        ticks = max(1, self._way.ticks)
        self._mean_current = np.array(self._way[:2]) / ticks
        self._ways.append(math.sqrt(self._way.squares / ticks))
        place, (estimated_place, covariance) = true[_PLACE].tolist(), _estimated(row)
        off = _off_squared(place, estimated_place, covariance)
        self._surfacings.append(
            {
                't_s': seconds(tick),
                'dive_t_s': seconds(self._dive_tick),
                'true_ned_m': place,
                'believed_ned_m': estimated_place,
                'covariance_m2': covariance,
                'fix_ned_m': None,
                'cross_track_m': float(true[_E2]),
                'believed_cross_track_m': float(row[_E2]),
                'error_m': math.dist(place, estimated_place),
                'inside_95': None if off is None else off <= ELLIPSE_95,
                'dac_true_mps': _north_east(self._mean_current),
                'dac_believed_mps': None,
            }
        )
        self._waits_for_fix = True

    def _look_for_fix(self, rows: np.ndarray) -> None:
        """Note how far the first fix is off the estimated place."""
        found = np.flatnonzero(rows[:, _FIX] >= 0.0)
        if not len(found):
            return
        self._waits_for_fix = False
        at = max(0, int(found[0]) - 1)  # what was estimated before it
        _, latitude, longitude, variance, _ = rows[found[0], _FIX : _FIX + 5].tolist()
        fix = [*from_geodetic(latitude, longitude, self._origin)]
        self._surfacings[-1]['fix_ned_m'] = fix if all(map(math.isfinite, fix)) else None
        off = _off_squared(fix, *_estimated(rows[at]), variance)
        if off is not None:
            self._innovations.append(off)

    def result(self, method: str, estimated_cross_track: dict) -> dict:
        """The part ``navigation`` of ``score.json``; a figure without data is None."""
        surfacings = self._surfacings
        errors, beside = (
            np.array([one[name] for one in surfacings]) for name in ('error_m', 'cross_track_m')
        )
        within = [one['inside_95'] for one in surfacings if one['inside_95'] is not None]
        ways, dac = np.array(self._ways), np.array(self._dac_errors)
        return {
            'method': method,
            'surfacings': len(surfacings),
            'error_m': {
                'p50': _percentile(errors, 50),
                'p95': _percentile(errors, 95),
                'worst': largest(errors),
            },
            'surfacing_cross_track_m': beside.tolist(),
            'surfacing_error_m': errors.tolist(),
            'surfacing_t_s': [one['t_s'] for one in surfacings],
            'under_water_rms_m': ways.tolist(),
            'from_fourth': {
                'surfacing_cross_track_m': largest(beside[FOURTH:]),
                'under_water_rms_m': rms(ways[FOURTH + 1 :]),
            },
            'dac_error_mps': {'rms': rms(dac), 'worst': largest(dac)},
            'believed_cross_track_m': estimated_cross_track,
            'ellipse_95_share': mean(within),
            'fixed': len(self._innovations),
            'innovation_squared': mean(self._innovations),
            'reports': surfacings if self._reckons else [],
        }


def _percentile(values: np.ndarray, share: float) -> float | None:
    return float(np.percentile(values, share)) if len(values) else None


def _north_east(pair: np.ndarray) -> list[float] | None:
    """An east and a north the other way round; None of what is not known."""
    return pair[::-1].tolist() if np.all(np.isfinite(pair)) else None


def _estimated(row: np.ndarray) -> tuple[list[float], list[float]]:
    """Estimated place (m), and its covariance (m^2): north, north and east, east."""
    return row[_PLACE].tolist(), row[_COVARIANCE].tolist()


def _off_squared(
    place: list[float], estimated: list[float], covariance: list[float], variance: float = 0.0
) -> float | None:
    """Squared distance of a place from the estimated one, over its variance; None of none."""
    nn, ne, ee = covariance
    nn, ee = nn + variance, ee + variance
    determinant = ee * nn - ne * ne
    if not determinant > 0.0:
        return None
    d_n, d_e = place[0] - estimated[0], place[1] - estimated[1]
    return (nn * d_e * d_e - 2.0 * ne * d_e * d_n + ee * d_n * d_n) / determinant
