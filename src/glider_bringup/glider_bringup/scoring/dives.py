# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""The dives of a run, one line each, from what was kept of it."""

from itertools import pairwise
from typing import NamedTuple

import numpy as np

from glider_bringup.scoring.traces import Traces


class Dive(NamedTuple):
    """From the beginning of a descent to that of the next, or to the end of the run."""

    from_s: float
    to_s: float
    deepest_m: float
    way_m: float  #: horizontal, from where it began to where it ended, in a straight line
    off_path_m: float  #: largest distance from the path to either side
    battery_percent: float  #: what is left at its end; NaN if it is not known


def dives_of(traces: Traces) -> list[Dive]:
    """Dives of a run; times to half a bucket of its traces.

    A descent begins where the desired vertical rate turns downward. What comes before the first
    one belongs to no dive.
    """
    descending = traces.curves['descending']
    known = np.flatnonzero(np.isfinite(descending))
    downward = np.diff(descending[known], prepend=0.0) > 0.0
    begins = known[downward].tolist()
    return [_dive(traces, start, end) for start, end in pairwise([*begins, len(descending)])]


def _dive(traces: Traces, start: int, end: int) -> Dive:
    """Dive of the values of curves from ``start`` to before ``end``."""
    places = (traces.samples['track_north_m'], traces.samples['track_east_m'])
    last = len(places[0]) - 1
    first, to = min(start // 2, last), min(-(-end // 2), last)
    north, east = (float(place[to] - place[first]) for place in places)
    battery = traces.curves['battery_percent'][start:end]
    battery = battery[np.isfinite(battery)]
    return Dive(
        from_s=start * traces.spacing_s,
        to_s=end * traces.spacing_s,
        deepest_m=_largest(traces.curves['depth_m'][start:end]),
        way_m=float(np.hypot(north, east)),
        off_path_m=_largest(traces.curves['cross_track_m'][start:end]),
        battery_percent=float(battery[-1]) if len(battery) else np.nan,
    )


def _largest(values: np.ndarray) -> float:
    """Largest magnitude; NaN of nothing."""
    known = np.abs(values[np.isfinite(values)])
    return float(known.max()) if len(known) else np.nan
