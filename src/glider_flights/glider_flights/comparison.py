# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""Our navigation over a recorded flight, beside what was made of it on board or ashore."""

import itertools
import math
from typing import Any, NamedTuple

import numpy as np

from glider_flights.folders import Progress
from glider_flights.reckoning import FIX_STD_M, Reckoned, check, reckon
from glider_flights.record import Flight, Segment, runs

#: Method of navigation, if nothing else is said.
METHOD = 'dead_reckoned'
#: A current that is further off than this has its reason told (m/s).
FAR_OFF_MPS = 0.02
#: Names of the forecasts.
FORECASTS = ('none', 'persistence', 'ours')


class Row(NamedTuple):
    """What came out for a segment."""

    segment: Segment
    reckoned: Reckoned
    #: Our current over what the vehicle's own is a mean, shape (2,): north, east (m/s).
    comparable_mps: np.ndarray
    #: Distance from where it surfaced to where it was forecast (m), by name; NaN for the first.
    missed_m: dict[str, float]


def comparable_current(flight: Flight, segment: Segment, reckoned: Reckoned) -> np.ndarray:
    """Our current (m/s) over what the vehicle's own is a mean, shape (2,): north, east."""
    if flight.on_board_over != 'between fixes':
        return reckoned.dac_mps
    moved_m = segment.after.place_m[0] - segment.before.place_m[-1]
    return (moved_m - reckoned.way_m) / (segment.after.time_s[0] - segment.before.time_s[-1])


def navigate(flight: Flight, progress: Progress, method: str = METHOD) -> list[Row]:
    """Navigate all segments, in the order of time, each by what was known before it.

    Raises
    ------
    ConfigurationError
        If there is no such method, or it reads what was not recorded.
    """
    check(method)
    rows: list[Row] = []
    done = itertools.count(1)
    # Between others there is a dive that is not known.
    for run in runs(
        flight.segments, lambda last, one: one.before.time_s[-1] == last.after.time_s[-1]
    ):
        found = reckon(flight, run, method, lambda: progress(next(done), 2 * len(flight.segments)))
        last = None
        for segment, reckoned in zip(run, found, strict=True):
            comparable = comparable_current(flight, segment, reckoned)
            missed = _missed(segment, reckoned, last)
            rows.append(Row(segment, reckoned, comparable, missed))
            last = reckoned
    return rows


def _missed(segment: Segment, reckoned: Reckoned, last: Reckoned | None) -> dict[str, float]:
    """How far off it surfaced (m), by forecasts that know of the dive before, if there is one."""
    missed = dict.fromkeys(FORECASTS, math.nan)
    if last is not None:
        for name, current in (('none', np.zeros(2)), ('persistence', last.told_mps)):
            missed[name] = float(np.hypot(*(reckoned.dac_mps - current))) * reckoned.seconds
        missed['ours'] = float(np.hypot(*(reckoned.surfaced_m - reckoned.believed_m)))
    believed = segment.on_board.surfaced_m
    missed['on_board'] = float(np.hypot(*(reckoned.surfaced_m - believed)))
    return missed


def summary(flight: Flight, rows: list[Row], method: str = METHOD) -> dict[str, Any]:
    """Figures of a flight, as `--json` prints them."""
    dac = [np.hypot(*(row.comparable_mps - row.segment.on_board.dac_mps)) for row in rows]
    told = [np.hypot(*(row.reckoned.told_mps - row.reckoned.dac_mps)) for row in rows]
    way = [np.hypot(*(row.reckoned.way_m - row.segment.on_board.way_m)) for row in rows]
    through_water = [np.hypot(*row.reckoned.way_m) for row in rows]
    ratio = [
        own / np.hypot(*row.segment.on_board.way_m)
        for own, row in zip(through_water, rows, strict=True)
    ]
    names = list(FORECASTS)
    if any(math.isfinite(row.missed_m['on_board']) for row in rows):
        names.append('on_board')
    return {
        'vehicle': flight.kind,
        'method': method,
        'files': len(flight.files),
        'first_file': flight.files[0],
        'last_file': flight.files[-1],
        'segments': len(rows),
        'duration_s': round(rows[-1].reckoned.surfaced_s - rows[0].reckoned.dived_s, 1),
        'under_water_s': round(sum(row.reckoned.seconds for row in rows), 1),
        'through_water_m': round(float(np.nansum(through_water)), 1),
        'on_board_current_is_mean': flight.on_board_over,
        'dac_difference_mps': _spread(dac, 4),
        'told_difference_mps': _spread(told, 4),
        'way_difference_m': _spread(way, 1),
        'way_ratio': _spread(ratio, 4),
        'prediction_m': {name: _spread([row.missed_m[name] for row in rows], 1) for name in names},
        'notes': flight.notes + _why_far_off(rows, dac),
    }


def _why_far_off(rows: list[Row], dac: list[float]) -> list[str]:
    """Why the current is far off, if it is: what fixes and samples of such dives can tell."""
    off = _spread(dac, 4)['median']
    if off is None or off <= FAR_OFF_MPS:
        return []
    seconds = float(np.median([row.reckoned.seconds for row in rows]))
    apart_s = float(np.median([np.median(np.diff(row.segment.samples.time_s)) for row in rows]))
    return [
        f'current {100.0 * off:.1f} cm/s off that on board: in dives of {seconds / 60.0:.0f} min '
        f'{FIX_STD_M:g} m of each of two fixes are {140.0 * FIX_STD_M / seconds:.1f} cm/s, and '
        f'samples {apart_s:.0f} s apart leave open when it left the surface and when it came back'
    ]


def _spread(values: list[float], digits: int) -> dict[str, Any]:
    """Median and 90th percentile of what is known, and how many that are."""
    known = [value for value in values if math.isfinite(value)]
    if not known:
        return {'median': None, 'p90': None, 'segments': 0}
    return {
        'median': round(float(np.median(known)), digits),
        'p90': round(float(np.percentile(known, 90)), digits),
        'segments': len(known),
    }
