# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""A recorded flight of a real glider, whoever made it: dives between surfacings with fixes.

Positions are north and east (m) of the first fix, angles in the world NED and the body FRD.
"""

import math
from typing import NamedTuple

import numpy as np

#: Metres of a degree of latitude, on a sphere of the Earth's mean radius.
METRES_PER_DEGREE = 6_371_000.0 * math.pi / 180.0
#: Shallower than this a glider is at the surface (m): it floats with its tail out of the water.
SURFACE_DEPTH_M = 2.0


class Fixes(NamedTuple):
    """Fixes of one stay at the surface, in the order of time; may be none."""

    #: Shape (n,), s since 1970.
    time_s: np.ndarray
    #: Shape (n, 2): north, east (m) of the flight's first fix.
    place_m: np.ndarray


class Samples(NamedTuple):
    """What was measured under water, all of shape (n,), in the order of time."""

    #: Time (s since 1970).
    time_s: np.ndarray
    #: Depth (m, + down).
    depth_m: np.ndarray
    #: Pitch (rad, + nose up).
    pitch_rad: np.ndarray
    #: Heading (rad from true north, + to east).
    heading_rad: np.ndarray
    #: Buoyancy (kg, + rises), NaN where it is not known.
    buoyancy_kg: np.ndarray


class OnBoard(NamedTuple):
    """What the vehicle, or its base station, made of the same segment; NaN if it did not.

    Each of shape (2,): north, east.
    """

    #: Depth-averaged current (m/s).
    dac_mps: np.ndarray
    #: Way through the water (m).
    way_m: np.ndarray
    #: Where it believed to be when it came up (m of the flight's first fix).
    surfaced_m: np.ndarray


class Polar(NamedTuple):
    """Lift and drag of a glider as functions of angle of attack alpha and dynamic pressure q (Pa).

    Lift q A a alpha, drag q A (b q^s + c alpha^2), where A is an area.
    """

    #: a (1/rad).
    lift: float
    #: b (Pa^-s).
    drag: float
    #: c (1/rad^2).
    induced: float
    #: s.
    exponent: float
    #: A (m^2).
    area_m2: float
    #: At shallower pitch the polar is not believed (rad).
    shallowest_rad: float


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

    #: Time (s since 1970).
    time_s: np.ndarray
    #: Depth (m, + down), of the finest pressure that was recorded.
    depth_m: np.ndarray
    #: Pitch (rad, + nose up).
    pitch_rad: np.ndarray
    #: Roll (rad, + to starboard).
    roll_rad: np.ndarray
    #: Heading (rad from true north, + to east).
    heading_rad: np.ndarray
    #: Volume of the buoyancy engine (m^3, + rises).
    pumped_m3: np.ndarray
    #: Position of the pitch mass (m, + forward: nose down).
    mass_x_m: np.ndarray
    #: Angle of the roll mass (rad, + to starboard).
    mass_roll_rad: np.ndarray
    #: Angle of the steering surface (rad, + nose to starboard).
    surface_rad: np.ndarray
    #: Temperature in situ (deg C, ITS-90).
    temperature_degc: np.ndarray
    #: Practical salinity (-).
    salinity: np.ndarray
    #: Vertical rate (m/s, + down) of the flight model of the vehicle's makers.
    own_rate_mps: np.ndarray


class Flight(NamedTuple):
    """A recorded flight."""

    #: Kind of vehicle: 'slocum' or 'seaglider'.
    kind: str
    #: Names of the files that were read.
    files: list[str]
    segments: list[Segment]
    #: What a person should know of the files: a sentence each.
    notes: list[str]
    #: Latitude and longitude of its first fix (degrees), shape (2,).
    origin_deg: np.ndarray
    #: What else was recorded; None if it was not asked for.
    instruments: Instruments | None = None
    #: Constants of the body that the files name, by the names of `BODY`.
    body: dict[str, float] | None = None


#: Constants of a body that files may name: mass (kg), volume with the engine at zero (m^3). Those
#: of a base station for compressibility belong to its own way of computing, and are not taken.
BODY = ('mass_kg', 'volume_m3')
NOT_KNOWN = np.full(2, math.nan)


def instruments(time_s: np.ndarray, **known: np.ndarray) -> Instruments:
    """Instruments of which some are known, all at the same times."""
    nothing = np.full(len(time_s), math.nan)
    return Instruments(
        time_s, **{name: known.get(name, nothing) for name in Instruments._fields[1:]}
    )


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
