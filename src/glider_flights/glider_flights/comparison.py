# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""Our navigation over a recorded flight, beside what was made of it on board or ashore."""

import math
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from glider_flights.forecast import FORECASTS, Forecaster
from glider_flights.reckoning import Reckoned, mean_current, reckon
from glider_flights.record import Flight, Segment


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
    if flight.on_board_over == 'between fixes':
        return mean_current(segment, reckoned)
    return reckoned.dac_mps


def navigate(flight: Flight, progress: Callable[[int, int], None]) -> list[Row]:
    """Navigate all segments, in the order of time, each by what was known before it."""
    rows: list[Row] = []
    forecaster = Forecaster()
    for number, segment in enumerate(flight.segments):
        progress(number, len(flight.segments))
        reckoned = reckon(segment)
        comparable = comparable_current(flight, segment, reckoned)
        missed = dict.fromkeys(FORECASTS, math.nan)
        at_s = 0.5 * (reckoned.dived_s + reckoned.surfaced_s)
        for name, forecast in forecaster.forecast(at_s).items():
            wrong = reckoned.dac_mps - forecast
            missed[name] = float(np.hypot(*wrong)) * reckoned.seconds
        forecaster.tell(at_s, reckoned.dac_mps, reckoned.seconds)
        believed = segment.on_board.surfaced_m
        missed['on_board'] = float(np.hypot(*(reckoned.surfaced_m - believed)))
        rows.append(Row(segment, reckoned, comparable, missed))
    return rows


def summary(flight: Flight, rows: list[Row]) -> dict[str, Any]:
    """Figures of a flight, as `--json` prints them."""
    dac = [np.hypot(*(row.comparable_mps - row.segment.on_board.dac_mps)) for row in rows]
    way = [np.hypot(*(row.reckoned.way_m - row.segment.on_board.way_m)) for row in rows]
    through_water = [np.hypot(*row.reckoned.way_m) for row in rows]
    names = list(FORECASTS)
    if any(math.isfinite(row.missed_m['on_board']) for row in rows):
        names.append('on_board')
    return {
        'vehicle': flight.kind,
        'files': len(flight.files),
        'first_file': flight.files[0],
        'last_file': flight.files[-1],
        'segments': len(rows),
        'duration_s': round(rows[-1].reckoned.surfaced_s - rows[0].reckoned.dived_s, 1),
        'under_water_s': round(sum(row.reckoned.seconds for row in rows), 1),
        'through_water_m': round(float(sum(through_water)), 1),
        'on_board_current_is_mean': flight.on_board_over,
        'dac_difference_mps': _spread(dac, 4),
        'way_difference_m': _spread(way, 1),
        'prediction_m': {name: _spread([row.missed_m[name] for row in rows], 1) for name in names},
        'notes': flight.notes,
    }


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
