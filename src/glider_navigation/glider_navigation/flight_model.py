# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""How fast the vehicle goes through the water, by pitch, and by pressure or net weight.

U_h = w / tan(theta - alpha(theta)) by the glide polar holds in a steady glide, and so does the
speed at which its drag carries a net weight. In an inflection, where pitch and vertical rate (or
weight) do not belong together, the last speed is held, and fades.

What depth is shown at the surface, with a fix, is the offset of its sensor: a receiver has one
with its antenna out of the water alone. A larger offset than any sensor has is left to the guard,
which brings the vehicle up.
"""

import math
from typing import NamedTuple

from glider_base.kernel import kernel
from glider_model.onboard.glide_polar import glide_horizontal_speed, steady_horizontal_speed

#: Shallower pitch (rad), or a slower vertical rate (m/s), is no glide.
LEAST_PITCH, LEAST_RATE = math.radians(11.3), 0.02
#: Time constant with which a speed fades that nothing tells any more (s).
FADES_S = 7.5
#: No glider is faster (m/s).
FASTEST = 1.5
#: Time constant of the vertical rate (s).
RATE_S = 4.0
#: A sample leads no further than this (s): then nobody knows how the depth goes on.
AHEAD_S = 60.0

#: What is shown with a fix counts after this time (s), and so many samples.
FIXED_S, LEAST_SAMPLES = 10.0, 5
#: It is averaged over so many samples at most.
AVERAGED = 100
#: A smaller one is left: waves, and an antenna that is out before the hull is. It is less than the
#: depth below which guidance takes a vehicle for surfaced. A larger one is no offset (m).
LEAST_M, LARGEST_M = 0.9, 20.0
#: Farther from the average (m) the vehicle is under way, or the crest of a wave.
STEADY_M = 0.3


class Flight(NamedTuple):
    """What pressure and pitch tell."""

    depth: float  #: (m)
    rate: float  #: vertical rate (m/s, + down)
    speed: float  #: horizontal, through the water (m/s)
    age_s: float  #: since the last sample
    seen: bool


INITIAL_FLIGHT = Flight(0.0, 0.0, 0.0, 0.0, False)


@kernel
def follow_depth(flight, depth, is_new, dt):
    """Follow the depth (m) by a filter of second order; between samples it goes on at its rate."""
    if not flight.seen:
        return Flight(depth, 0.0, 0.0, 0.0, True)
    age_s = flight.age_s + dt
    if age_s > AHEAD_S and not is_new:
        return Flight(flight.depth, 0.0, flight.speed, age_s, True)
    ahead = flight.depth + dt * flight.rate
    if not is_new:
        return Flight(ahead, flight.rate, flight.speed, age_s, True)
    fade = math.exp(-age_s / RATE_S)
    off = depth - ahead
    return Flight(
        ahead + (1.0 - fade * fade) * off,
        flight.rate + (1.0 - fade) * (1.0 - fade) * off / age_s,
        flight.speed,
        0.0,
        True,
    )


@kernel
def set_anew(flight, by):
    """The same flight where the depth is shown so much deeper (m) from now on."""
    return Flight(flight.depth + by, flight.rate, flight.speed, flight.age_s, flight.seen)


@kernel
def at_the_surface(flight, is_fix):
    """The same flight; a fix says that it is at the surface, if no sample says otherwise."""
    if is_fix and flight.age_s > AHEAD_S:
        return Flight(0.0, 0.0, flight.speed, flight.age_s, flight.seen)
    return flight


@kernel
def reckon_speed(flight, theta, polar, dt):
    """Speed through the water at a pitch (rad), by the vertical rate."""
    speed = flight.speed * (1.0 - dt / FADES_S)
    if abs(theta) > LEAST_PITCH and abs(flight.rate) > LEAST_RATE and theta * flight.rate < 0.0:
        speed = min(FASTEST, glide_horizontal_speed(theta, flight.rate, polar))
    return Flight(flight.depth, flight.rate, speed, flight.age_s, flight.seen)


@kernel
def weigh_speed(flight, theta, net_heaviness, polar, dt):
    """Speed through the water at a pitch (rad), by the net heaviness (kg, + sinks)."""
    speed = flight.speed * (1.0 - dt / FADES_S)
    if abs(theta) > polar.shallowest and theta * net_heaviness < 0.0:
        speed = min(FASTEST, steady_horizontal_speed(theta, net_heaviness, polar))
    return Flight(flight.depth, flight.rate, speed, flight.age_s, flight.seen)


class Zero(NamedTuple):
    """What the depth is at the surface, between two ticks."""

    fixed_s: float  #: with a fix, without a break
    samples: int  #: since then
    shown: float  #: depth then, averaged (m)
    offset: float  #: that is taken off (m)


INITIAL_ZERO = Zero(0.0, 0, 0.0, 0.0)


@kernel
def find_zero(zero, depth, is_new, is_fix, dt):
    """Take in the depth (m) that a tick shows, a new sample or not, with a fix or without."""
    if not is_fix:
        return Zero(0.0, 0, zero.shown, zero.offset)
    fixed_s, samples, shown = zero.fixed_s + dt, zero.samples, zero.shown
    if is_new:
        samples += 1
        shown = depth if samples == 1 else shown + (depth - shown) / min(samples, AVERAGED)
    offset = zero.offset
    counts = fixed_s >= FIXED_S and samples >= LEAST_SAMPLES and abs(depth - shown) < STEADY_M
    if counts and LEAST_M < abs(shown - offset) and abs(shown) <= LARGEST_M:
        offset = shown
    return Zero(fixed_s, samples, shown, offset)
