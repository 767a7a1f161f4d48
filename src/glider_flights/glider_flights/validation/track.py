# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""Stretches of a recorded flight under water, made ready to be flown and to be compared with."""

import math
from typing import NamedTuple

import numpy as np

from glider_base.errors import ConfigurationError
from glider_flights.folders import gsw
from glider_flights.record import SURFACE_DEPTH_M, Flight, Instruments, in_order, vertical_rate

#: The recorded vertical rate is the slope of depth over about this time (s).
RATE_S = 11.0
#: A stretch ends where nothing was recorded for so long (s), or for so many usual intervals.
LONGEST_GAP_S, LONGEST_GAP = 60.0, 8.0
#: A stretch is no shorter (s) and no shallower (m) than this.
SHORTEST_S, SHALLOWEST_M = 120.0, 10.0
#: Depth turns where it goes back by so much (m), or by this share of the depth of the stretch.
TURN_M, TURN = 5.0, 0.2
#: Not compared: so far from the surface and from a turn (m), and no more of a half dive than this.
SURFACE_M, SURFACE, AROUND_TURN_M, AROUND_TURN = 10.0, 0.25, 5.0, 0.125


class Track(NamedTuple):
    """A stretch under water without a gap; arrays of shape (n,)."""

    instruments: Instruments
    pressure_dbar: np.ndarray  #: pressure (dbar, above that of the air)
    density_kgpm3: np.ndarray  #: density in situ (kg/m^3), NaN where it is not known
    rate_mps: np.ndarray  #: recorded vertical rate (m/s, + down)
    phase: np.ndarray  #: whether it is a dive (1) or a climb (-1)
    counts: np.ndarray  #: whether it is compared


def tracks(flight: Flight) -> list[Track]:
    """Stretches under water of a flight.

    Raises
    ------
    ConfigurationError
        If there is none.
    """
    whole = in_order(flight.instruments, 3)  # time, depth and pitch
    under = whole.depth_m > SURFACE_DEPTH_M
    usual_s = float(np.median(np.diff(whole.time_s[under]))) if under.sum() > 1 else 0.0
    gap_s = max(LONGEST_GAP_S, LONGEST_GAP * usual_s)
    numbers = np.flatnonzero(under)
    breaks = np.flatnonzero((np.diff(numbers) > 1) | (np.diff(whole.time_s[numbers]) > gap_s))
    found = []
    for part in np.split(numbers, breaks + 1):
        if len(part) < 3:
            continue
        own = Instruments(*(values[part] for values in whole))
        if np.ptp(own.time_s) >= SHORTEST_S and own.depth_m.max() >= SHALLOWEST_M:
            found.append(_track(own, flight.origin_deg))
    if not any(track.counts.any() for track in found):
        raise ConfigurationError(
            f'{flight.files[0]} to {flight.files[-1]}: no stretch under water of {SHORTEST_S:g} s '
            f'and {SHALLOWEST_M:g} m with depth and pitch (needed: one)'
        )
    return found


def _track(own: Instruments, origin_deg: np.ndarray) -> Track:
    water = {
        name: _by_depth(own.depth_m, getattr(own, name))
        for name in ('salinity', 'temperature_degc')
    }
    own = own._replace(**water)
    latitude, longitude = origin_deg
    pressure = gsw().p_from_z(-own.depth_m, latitude)
    absolute = gsw().SA_from_SP(own.salinity, pressure, longitude, latitude)
    density = gsw().rho_t_exact(absolute, own.temperature_degc, pressure)
    turns = _turns(own.depth_m)
    counts = np.zeros(len(own.time_s), bool)
    phase = np.zeros(len(own.time_s))
    for begin, end in zip(turns[:-1], turns[1:], strict=True):
        depth = own.depth_m[begin : end + 1]
        phase[begin : end + 1] = math.copysign(1.0, depth[-1] - depth[0])
        counts[begin : end + 1] = _compared(depth)
    return Track(
        instruments=own,
        pressure_dbar=pressure,
        density_kgpm3=density,
        rate_mps=vertical_rate(own.time_s, own.depth_m, RATE_S),
        phase=phase,
        counts=counts,
    )


def _by_depth(depth_m: np.ndarray, values: np.ndarray) -> np.ndarray:
    """Values with gaps filled from those of the same depths, where there are some."""
    good = np.isfinite(values)
    if good.all() or not good.any():
        return values
    order = np.argsort(depth_m[good], kind='stable')
    filled = np.interp(depth_m, depth_m[good][order], values[good][order])
    return np.where(good, values, filled)


def _turns(depth_m: np.ndarray) -> list[int]:
    """Numbers of the samples at which depth turns, the first and the last included."""
    back_m = min(TURN_M, TURN * float(depth_m.max()))
    turns, extreme, down = [0], 0, True
    for number, depth in enumerate(depth_m):
        beyond = depth - depth_m[extreme] if down else depth_m[extreme] - depth
        if beyond > 0.0:
            extreme = number
        elif beyond < -back_m:
            if extreme > turns[-1]:
                turns.append(extreme)
            extreme, down = number, not down
    last = len(depth_m) - 1
    if extreme > turns[-1] and extreme < last:
        turns.append(extreme)
    return [*turns, last]


def _compared(depth_m: np.ndarray) -> np.ndarray:
    """Which samples of a half dive are far enough from the surface and from its turns."""
    span_m = abs(float(depth_m[-1] - depth_m[0]))
    around_m = min(AROUND_TURN_M, AROUND_TURN * span_m)
    top, bottom = min(depth_m[0], depth_m[-1]), max(depth_m[0], depth_m[-1])
    top = max(top + around_m, min(SURFACE_M, SURFACE * bottom))
    return (depth_m >= top) & (depth_m <= bottom - around_m)
