# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""What the vertical rate tells of the weight: heavier than its pump says, by a leak or by drag.

In a steady glide the polar tells the net heaviness of pitch and vertical rate. By how much that is
more than pump and ballast make is what nobody knows of: water in the hull, growth, a lost wing.
"""

import math
from typing import NamedTuple

from glider_base.kernel import kernel
from glider_guard.rows import TOO_HEAVY
from glider_model.onboard.glide_polar import Polar, glide_net_heaviness, glide_vertical_rate

#: Shallower (rad) or slower (m/s) than this it is no steady glide, nor so near (share) to the
#: shallowest one that there is, where a little pitch makes all the difference.
LEAST_PITCH, LEAST_RATE, LEAST_SHARE = math.radians(12.0), 0.03, 1.2
#: The pump is this near (share of its range) to where it goes.
PUMP_ARRIVED = 0.05
#: What a vehicle weighs now is averaged over this time (s), and so is its vertical rate: of the
#: square of one that is measured badly there would be left what its errors make.
SOON_S = 30.0
#: A vehicle that is held level sinks on by no more than this (m), as it does broadside until its
#: pump has made it light, and this (s) times the rate it had, until it lies level.
LEVEL_M, LEVEL_S = 12.0, 45.0
#: A vehicle whose weight is let go sinks on for no longer than this (s).
DROPPED_S = 20.0


class WeightLimits(NamedTuple):
    """When a vehicle is too heavy."""

    polar: Polar
    ballast: float  #: net heaviness with the pump in the middle (kg)
    most: float  #: that nobody knows of (kg)
    average_s: float
    arrived: float  #: the pump is this near to where it goes (kg)
    rate: float  #: of the pump (kg/s)
    range: float  #: of the pump, either way from its middle (kg)


class Weight(NamedTuple):
    """What is known of the weight, between two ticks."""

    off: float  #: more than pump and ballast make, averaged (kg)
    soon: float  #: the same, averaged over `SOON_S`
    rate: float  #: vertical rate (m/s, + down), averaged so too
    sinking: float  #: that of the depth, averaged so too
    glides_s: float  #: for which it has been a steady glide
    least: float  #: as `off`, by the rate that is less, less what drag may feign (kg)


INITIAL_WEIGHT = Weight(0.0, 0.0, 0.0, 0.0, 0.0, 0.0)


@kernel
def sinking_weight(state, m_b, limits):
    """What a vehicle weighs with its pump at ``m_b`` (kg), 0.0 if it is light.

    Not by how it sinks now: in a turn, or level, that is no glide.
    """
    return max(0.0, m_b + limits.ballast + state.soon)


@kernel
def stopping_m(rate, weight, limits):
    """Way (m) that a vehicle sinks on while its pump takes off the weight (kg) that it sinks by.

    The rate goes with the root of the weight, which falls with time: two thirds of rate by time.
    """
    return 2.0 / 3.0 * max(0.0, rate) * weight / limits.rate


@kernel
def turning_m(rate, weight, limits):
    """The same where its mass holds it level meanwhile."""
    return min(stopping_m(rate, weight, limits), LEVEL_M + LEVEL_S * max(0.0, rate))


@kernel
def sinks_on_m(rate, weight, m_b, is_pumped, limits):
    """Way (m) that a vehicle sinks on before its pump has stopped it, or else its drop weight.

    The pump at ``m_b`` (kg) does, if it goes on and can take off what the vehicle weighs.
    """
    if is_pumped or weight > m_b + limits.range:
        return max(0.0, rate) * DROPPED_S
    return stopping_m(rate, weight, limits)


@kernel
def led_rate(state, theta, m_b, limits):
    """Vertical rate (m/s, + down) of the steady glide that pitch (rad) and pump (kg) make.

    Returns
    -------
    float
        Down for a vehicle that is heavy, up for one that is light, wherever its nose points.
    bool
        Whether it points there: a glide.
    """
    weight = m_b + limits.ballast + state.off
    rate = abs(glide_vertical_rate(theta, weight, limits.polar))
    is_glide = abs(theta) > LEAST_PITCH and theta * weight < 0.0
    return (rate if weight > 0.0 else -rate), is_glide


@kernel
def weigh(state, theta, rate, sinking, m_b, sent, under, limits, dt):
    """Take in what a tick shows.

    At the surface nothing glides. Twice the drag, as growth makes it, takes half of the speed's
    square from a climb: what the vehicle still rises by is taken off again.

    Parameters
    ----------
    state : Weight
    theta : float
        Pitch (rad).
    rate, sinking : float
        Vertical rate of odom, which shows way over ground where an attitude is off, and that of
        the depth, which may be noise (m/s, + down).
    m_b, sent : float
        Where the pump is, and where it is sent (kg).
    under : bool
        Under water.
    limits : WeightLimits
    dt : float

    Returns
    -------
    Weight
    int
        Rows that hold.
    """
    off, soon, least = state.off, state.soon, state.least
    steep = max(LEAST_PITCH, LEAST_SHARE * limits.polar.shallowest)
    glides_s = 0.0
    if under and abs(theta) > steep and abs(m_b - sent) <= limits.arrived:
        glides_s = state.glides_s + dt
    mean = state.rate + dt / SOON_S * (rate - state.rate)
    sinks = state.sinking + dt / SOON_S * (sinking - state.sinking)
    if glides_s > SOON_S and abs(mean) > LEAST_RATE:
        known = m_b + limits.ballast
        more = glide_net_heaviness(theta, mean, limits.polar) - known
        shown = glide_net_heaviness(theta, min(mean, sinks), limits.polar)
        off += (dt / limits.average_s) * (more - off)
        least += (dt / limits.average_s) * (shown + min(0.0, shown) - known - least)
        soon += (dt / SOON_S) * (more - soon)
    return Weight(off, soon, mean, sinks, glides_s, least), TOO_HEAVY if least > limits.most else 0
