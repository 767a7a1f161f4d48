# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""Dead reckoning of a dive, and the current that its next fix tells.

Speed through the water comes from pitch with the vertical rate, or with the buoyancy where that is
recorded, by lift and drag of a steady glide (Merckelbach et al. 2010, Eriksen et al. 2001).
"""

import math
from typing import NamedTuple

import numpy as np

from glider_flights.record import (
    NOT_KNOWN,
    SURFACE_DEPTH_M,
    Fixes,
    Polar,
    Samples,
    Segment,
)

GRAVITY = 9.81
DENSITY = 1027.5
#: Where the polar is not believed, in a turn-over, the last speed fades with this time (s).
FADE_S = 7.5
#: Angle of attack and dynamic pressure settle to this (rad), in no more steps than these.
SETTLED_RAD, STEPS = 1e-6, 60
#: No glider is faster through the water (m/s).
FASTEST_MPS = 1.5
#: The vertical rate is the slope of depth over about this time (s).
RATE_S = 15.0
#: Fixes over a shorter time say nothing of the drift at the surface (s).
SHORTEST_DRIFT_S = 60.0


class Reckoned(NamedTuple):
    """What navigation makes of a segment."""

    #: When it left the surface and when it came back (s since 1970).
    dived_s: float
    surfaced_s: float
    #: Where, of shape (2,): north, east (m).
    dived_m: np.ndarray
    surfaced_m: np.ndarray
    way_m: np.ndarray  #: way through the water between the two, of shape (2,): north, east (m)

    @property
    def seconds(self) -> float:
        """Time under water (s)."""
        return self.surfaced_s - self.dived_s

    @property
    def dac_mps(self) -> np.ndarray:
        """Depth-averaged current, of shape (2,): north, east (m/s)."""
        return (self.surfaced_m - self.dived_m - self.way_m) / self.seconds


def mean_current(segment: Segment, reckoned: Reckoned) -> np.ndarray:
    """Mean current (m/s) from fix to fix, also while at the surface, shape (2,): north, east."""
    begin_s, end_s = segment.before.time_s[-1], segment.after.time_s[0]
    moved_m = segment.after.place_m[0] - segment.before.place_m[-1]
    return (moved_m - reckoned.way_m) / (end_s - begin_s)


def vertical_rate(time_s: np.ndarray, depth_m: np.ndarray, over_s: float = RATE_S) -> np.ndarray:
    """Vertical rate (m/s, + down), shape (n,): the slope of depth over about ``over_s``."""
    begin = np.maximum(time_s - 0.5 * over_s, time_s[0])
    end = np.minimum(time_s + 0.5 * over_s, time_s[-1])
    index = np.arange(len(time_s))
    # With samples that are further apart, the neighbours.
    begin = np.minimum(begin, time_s[np.maximum(index - 1, 0)])
    end = np.maximum(end, time_s[np.minimum(index + 1, len(time_s) - 1)])
    first, last = np.interp(begin, time_s, depth_m), np.interp(end, time_s, depth_m)
    return (last - first) / (end - begin)


def glide(
    pitch_rad: np.ndarray, polar: Polar, rate_mps: np.ndarray, buoyancy_kg: np.ndarray
) -> np.ndarray:
    """Horizontal speed through the water (m/s) of steady glides, NaN where there is none.

    Lift and drag balance the buoyancy: b q^s + c alpha^2 + a alpha tan(gamma) = 0, with the glide
    angle gamma = theta - alpha and q from the vertical rate w = -V sin(gamma), or from drag equal
    to B sin(gamma) where the buoyancy B is known.
    """
    rises = np.where(np.isnan(buoyancy_kg), -rate_mps, buoyancy_kg)
    usable = (np.abs(pitch_rad) >= polar.shallowest_rad) & (rises * pitch_rad > 0.0)
    theta = np.where(usable, pitch_rad, math.nan)
    weighed = np.isfinite(buoyancy_kg)
    force = np.abs(buoyancy_kg) * GRAVITY / polar.area_m2
    gamma = np.copysign(0.25 * math.pi, theta)
    pressure = np.where(
        weighed, force / polar.drag, 0.5 * DENSITY * (rate_mps / np.sin(gamma)) ** 2
    )
    with np.errstate(invalid='ignore', divide='ignore'):
        for _ in range(STEPS):
            drag = polar.drag * pressure**polar.exponent
            half = 0.5 * polar.lift * np.tan(gamma) / polar.induced
            root = half * half - drag / polar.induced
            alpha = -half + np.copysign(np.sqrt(np.maximum(root, 0.0)), half)
            last, gamma = gamma, 0.5 * (gamma + theta - alpha)
            sine = np.abs(np.sin(gamma))
            told = force * sine / (drag + polar.induced * alpha * alpha)
            pressure = np.where(weighed, told, 0.5 * DENSITY * (rate_mps / sine) ** 2)
            if not (np.abs(gamma - last) > SETTLED_RAD).any():
                break
        level = np.sqrt(2.0 * pressure / DENSITY) * np.cos(gamma)
        return np.where((root >= 0.0) & (level <= FASTEST_MPS), level, math.nan)


def horizontal_speed(samples: Samples, polar: Polar) -> np.ndarray:
    """Horizontal speed through the water (m/s), shape (n,), also where no glide is steady."""
    rate_mps = vertical_rate(samples.time_s, samples.depth_m)
    steady = glide(samples.pitch_rad, polar, rate_mps, samples.buoyancy_kg)
    known = np.isfinite(steady)
    if not known.any():
        return np.zeros(len(steady))
    last = np.maximum.accumulate(np.where(known, np.arange(len(steady)), 0))
    faded = np.exp(-(samples.time_s - samples.time_s[last]) / FADE_S)
    return np.nan_to_num(steady)[last] * faded


def way_through_water(samples: Samples, polar: Polar) -> np.ndarray:
    """Way through the water (m) since the first sample, shape (n, 2): north, east."""
    speed = horizontal_speed(samples, polar)
    heading = samples.heading_rad
    velocity = np.stack([speed * np.cos(heading), speed * np.sin(heading)], axis=-1)
    steps = 0.5 * (velocity[1:] + velocity[:-1]) * np.diff(samples.time_s)[:, None]
    return np.concatenate([np.zeros((1, 2)), np.cumsum(steps, axis=0)])


def surface_drift(fixes: Fixes) -> np.ndarray:
    """Drift at the surface (m/s), shape (2,): the slope through the fixes; NaN if not known."""
    if len(fixes.time_s) < 2 or np.ptp(fixes.time_s) < SHORTEST_DRIFT_S:
        return NOT_KNOWN
    return np.polyfit(fixes.time_s - fixes.time_s[0], fixes.place_m, 1)[0]


def moments_under_water(segment: Segment) -> tuple[float, float]:
    """When a vehicle left the surface and when it came back (s since 1970).

    Where samples are far apart the crossing of the surface is put as early or as late as the
    vertical rate of the first or last of them has it, but not into the time of the fixes.
    """
    time_s, depth_m = segment.samples.time_s, segment.samples.depth_m
    deep = np.flatnonzero(depth_m > SURFACE_DEPTH_M)
    first, last = deep[0], deep[-1]
    rate = np.abs(vertical_rate(time_s, depth_m))
    typical = max(0.02, float(np.median(rate)))
    dived = time_s[first] - (depth_m[first] - SURFACE_DEPTH_M) / typical
    surfaced = time_s[last] + (depth_m[last] - SURFACE_DEPTH_M) / typical
    if first > 0:
        dived = max(dived, time_s[first - 1])
    if last < len(time_s) - 1:
        surfaced = min(surfaced, time_s[last + 1])
    return max(dived, segment.before.time_s[-1]), min(surfaced, segment.after.time_s[0])


def reckon(segment: Segment) -> Reckoned:
    """Dead reckoning of a segment: from the last fix before it to the first after it.

    Between fix and dive, and between surfacing and fix, it drifts as its fixes there say; where
    they say nothing, that time counts as under water.
    """
    dived_s, surfaced_s = moments_under_water(segment)
    dived_m, surfaced_m = segment.before.place_m[-1], segment.after.place_m[0]
    way_m = way_through_water(segment.samples, segment.polar)[-1]
    drift = surface_drift(segment.before)
    if np.isnan(drift).any():
        dived_s = segment.before.time_s[-1]
    else:
        dived_m = dived_m + drift * (dived_s - segment.before.time_s[-1])
    drift = surface_drift(segment.after)
    if np.isnan(drift).any():
        surfaced_s = segment.after.time_s[0]
    else:
        surfaced_m = surfaced_m - drift * (segment.after.time_s[0] - surfaced_s)
    return Reckoned(dived_s, surfaced_s, dived_m, surfaced_m, way_m)
