# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""A recorded flight of a real glider, whoever made it: dives between surfacings with fixes.

Positions are north and east (m) of the first fix, angles in the world NED and the body FRD.
"""

import math
from collections.abc import Iterable, Sequence
from typing import NamedTuple, TypeVar

import numpy as np

#: Metres of a degree of latitude, on a sphere of the Earth's mean radius.
METRES_PER_DEGREE = 6_371_000.0 * math.pi / 180.0
#: Shallower than this a glider is at the surface (m): it floats with its tail out of the water.
SURFACE_DEPTH_M = 2.0


class Fixes(NamedTuple):
    """Fixes of one stay at the surface, in the order of time; may be none."""

    time_s: np.ndarray  #: shape (n,), s since 1970
    place_m: np.ndarray  #: shape (n, 2): north, east (m) of the flight's first fix


class Samples(NamedTuple):
    """What was measured under water, all of shape (n,), in the order of time."""

    time_s: np.ndarray  #: time (s since 1970)
    depth_m: np.ndarray  #: depth (m, + down)
    pitch_rad: np.ndarray  #: pitch (rad, + nose up)
    heading_rad: np.ndarray  #: heading (rad from true north, + to east)
    buoyancy_kg: np.ndarray  #: buoyancy (kg, + rises), NaN where it is not known


NOT_KNOWN = np.full(2, math.nan)


class OnBoard(NamedTuple):
    """What the vehicle, or its base station, made of the same segment; NaN if it did not.

    Each of shape (2,): north, east.
    """

    dac_mps: np.ndarray = NOT_KNOWN  #: depth-averaged current (m/s)
    way_m: np.ndarray = NOT_KNOWN  #: way through the water (m)
    #: Where it believed to be when it came up (m of the flight's first fix).
    surfaced_m: np.ndarray = NOT_KNOWN


class Polar(NamedTuple):
    """Lift and drag of a glider as functions of angle of attack alpha and dynamic pressure q (Pa).

    Lift q A a alpha, drag q A (b q^s + c alpha^2), where A is an area.
    """

    lift: float  #: a (1/rad)
    drag: float  #: b (Pa^-s)
    induced: float  #: c (1/rad^2)
    exponent: float  #: s
    area_m2: float  #: A (m^2)
    shallowest_rad: float  #: at shallower pitch the polar is not believed (rad)


class Segment(NamedTuple):
    """From one stay at the surface to the next."""

    #: Of the file that it begins in.
    name: str
    before: Fixes
    after: Fixes
    samples: Samples
    on_board: OnBoard
    polar: Polar


class Instruments(NamedTuple):
    """What was recorded over a whole flight, all of shape (n,), in the order of time.

    NaN where it is not known.
    """

    time_s: np.ndarray  #: time (s since 1970)
    depth_m: np.ndarray  #: depth (m, + down), of the finest pressure that was recorded
    pitch_rad: np.ndarray  #: pitch (rad, + nose up)
    roll_rad: np.ndarray  #: roll (rad, + to starboard)
    heading_rad: np.ndarray  #: heading (rad from true north, + to east)
    pumped_m3: np.ndarray  #: volume of the buoyancy engine (m^3, + rises)
    mass_x_m: np.ndarray  #: position of the pitch mass (m, + forward: nose down)
    mass_roll_rad: np.ndarray  #: angle of the roll mass (rad, + to starboard)
    surface_rad: np.ndarray  #: angle of the steering surface (rad, + nose to starboard)
    temperature_degc: np.ndarray  #: temperature in situ (deg C, ITS-90)
    salinity: np.ndarray  #: practical salinity (-)
    #: Vertical rate (m/s, + down) of the flight model of the vehicle's makers.
    own_rate_mps: np.ndarray


class Flight(NamedTuple):
    """A recorded flight."""

    kind: str  #: kind of files: 'slocum', 'seaglider' or 'og1'
    #: Names of the files that were read.
    files: list[str]
    segments: list[Segment]
    notes: list[str]  #: what a person should know of the files: a sentence each
    origin_deg: np.ndarray  #: latitude and longitude of its first fix (degrees), shape (2,)
    instruments: Instruments | None = None  #: what else was recorded; None if it was not asked for
    #: Constants of the body that the files name: mass_kg, and volume_m3 with the engine at zero.
    #: Those of a base station for compressibility belong to its own way of computing.
    body: dict[str, float] | None = None
    #: Over what the vehicle's own current is a mean; a base station counts the drift, too.
    on_board_over: str = 'under water'


SamplesOrInstruments = TypeVar('SamplesOrInstruments', Samples, Instruments)


def instruments(time_s: np.ndarray, **known: np.ndarray) -> Instruments:
    """Instruments of which some are known, all at the same times; other names are no matter."""
    nothing = np.full(len(time_s), math.nan)
    return Instruments(
        time_s, **{name: known.get(name, nothing) for name in Instruments._fields[1:]}
    )


def joined(parts: Iterable[Instruments]) -> Instruments:
    """Instruments of several files, in the order of time."""
    table = np.concatenate([np.stack(part) for part in parts], axis=1)
    return Instruments(*table[:, np.argsort(table[0], kind='stable')])


def in_order(values: SamplesOrInstruments, needed: int) -> SamplesOrInstruments:
    """Values in the order of time, each time once, where the first ``needed`` are known."""
    table = np.stack(values)
    table = table[:, np.isfinite(table[:needed]).all(axis=0)]
    return type(values)(*table[:, np.unique(table[0], return_index=True)[1]])


def usual(values: Sequence[float]) -> float:
    """The median of what is known; NaN if nothing is."""
    values = np.asarray(values, float)
    values = values[np.isfinite(values)]
    return float(np.median(values)) if len(values) else math.nan


def local_metres(origin_deg: np.ndarray, latitude_deg, longitude_deg) -> np.ndarray:
    """North and east (m, last axis) of an origin (latitude, longitude in degrees)."""
    latitude_deg, longitude_deg = np.asarray(latitude_deg), np.asarray(longitude_deg)
    turned = (longitude_deg - origin_deg[1] + 180.0) % 360.0 - 180.0
    scale = np.cos(np.radians(0.5 * (latitude_deg + origin_deg[0])))
    north = (latitude_deg - origin_deg[0]) * METRES_PER_DEGREE
    return np.stack([north, turned * scale * METRES_PER_DEGREE], axis=-1)


def at_times(time_s: np.ndarray, own_s: np.ndarray, values: np.ndarray) -> np.ndarray:
    """Values with times of their own at other times, NaN beyond them and where there are none."""
    good = np.isfinite(own_s) & np.isfinite(values)
    if not good.any():
        return np.full(len(time_s), math.nan)
    order = np.argsort(own_s[good], kind='stable')
    own_s, values = own_s[good][order], values[good][order]
    return np.interp(time_s, own_s, values, left=math.nan, right=math.nan)


def angles_at_times(time_s: np.ndarray, own_s: np.ndarray, angles: np.ndarray) -> np.ndarray:
    """The same for angles (rad), across north."""
    east, north = (at_times(time_s, own_s, part(angles)) for part in (np.sin, np.cos))
    return np.arctan2(east, north)


def vertical_rate(time_s: np.ndarray, depth_m: np.ndarray, over_s: float = 15.0) -> np.ndarray:
    """Vertical rate (m/s, + down), shape (n,): the slope of depth over about ``over_s``."""
    begin = np.maximum(time_s - 0.5 * over_s, time_s[0])
    end = np.minimum(time_s + 0.5 * over_s, time_s[-1])
    index = np.arange(len(time_s))
    # With samples that are further apart, the neighbours.
    begin = np.minimum(begin, time_s[np.maximum(index - 1, 0)])
    end = np.maximum(end, time_s[np.minimum(index + 1, len(time_s) - 1)])
    first, last = np.interp(begin, time_s, depth_m), np.interp(end, time_s, depth_m)
    return (last - first) / (end - begin)
