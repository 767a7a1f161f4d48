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
from glider_model.onboard.glide_polar import (
    Attack,
    Polar,
    glide_net_heaviness,
    glide_vertical_rate,
)

#: Shallower (rad) or slower (m/s) than this it is no steady glide, nor so near (share) to the
#: shallowest one that there is, where a little pitch makes all the difference.
LEAST_PITCH, LEAST_RATE, LEAST_SHARE = math.radians(12.0), 0.03, 1.2
#: The pump, or the mass, is this near (share of its range) to where it goes.
ARRIVED = 0.05
#: What a vehicle weighs now is averaged over this time (s), and so is its vertical rate: of the
#: square of one that is measured badly there would be left what its errors make.
SOON_S = 30.0
#: Water that comes in, and a hull that shrinks with depth, make a vehicle heavier all the way
#: down. What a dive shows of it is a line over time, from when the glide is steady (s); after so
#: long (s) it is used, as far ahead as it is long, and bent by what is newer than this (s).
STEADY_S, LINE_S, NEWER_S = 300.0, 600.0, 1800.0
#: What is more than this share of the range of the pump it cannot take off, though the polar errs,
#: as it does most in a steep dive with the whole pump and a pitch that errs.
SURELY = 1.1
#: What the polar errs by shows after the turn, when the pump has made it nearly neutral: there a
#: polar has little to err by. So long (s) after it glides up, it is weighed again, at the depth
#: where the dive ended; from then on it cannot take off more than its range.
WEIGHED_AGAIN_S = 4.0 * SOON_S
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


class Ended(NamedTuple):
    """The line of a dive where it ended, until the climb after it has shown what it errs by."""

    weight: float  #: (kg)
    depth: float  #: (m); 0.0: there is none
    per_m: float  #: by what it grew (kg/m)


class Weight(NamedTuple):
    """What is known of the weight, between two ticks."""

    off: float  #: more than pump and ballast make, averaged (kg)
    soon: float  #: the same, averaged over `SOON_S`
    rate: float  #: vertical rate (m/s, + down), averaged so too
    sinking: float  #: that of the depth, averaged so too
    glides_s: float  #: for which it has been a steady glide
    least: float  #: as `off`, by the rate that is less, less what drag may feign (kg)
    line: float  #: by the line through what this dive has shown so far (kg)
    growth: float  #: slope of that line (kg/s)
    line_s: float  #: length of that line (s)
    begun: float  #: depth at which it begins (m)
    ended: Ended
    can: float  #: by the line of a dive, the pump can take off so much (kg), or as good as


class Glide(NamedTuple):
    """What a tick shows of it."""

    theta: float  #: pitch (rad)
    attack: Attack
    #: vertical rate of odom (m/s, + down), which shows way over ground where an attitude is off
    rate: float
    sinking: float  #: that of the depth, which may be noise (m/s, + down)
    m_b: float  #: where the pump is (kg)
    sent: float  #: where it was sent (kg)
    depth: float  #: that is trusted (m)
    target: float  #: that guidance asks for (m)
    under: bool  #: under water


NO_END = Ended(0.0, 0.0, 0.0)
INITIAL_WEIGHT = Weight(*(10 * (0.0,)), NO_END, math.inf)


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
def led_rate(state, theta, attack, m_b, limits):
    """Vertical rate (m/s, + down) of the steady glide that pitch (rad) and pump (kg) make.

    Down for a vehicle that is heavy, up for one that is light, wherever its nose points; and
    whether it points there: a glide.
    """
    weight = m_b + limits.ballast + state.off
    rate = abs(glide_vertical_rate(theta, weight, limits.polar, attack))
    is_glide = abs(theta) > LEAST_PITCH and theta * weight < 0.0
    return (rate if weight > 0.0 else -rate), is_glide


@kernel
def sure_share(state, m_b, limits):
    """Share of the rate down by `led_rate` that is left if what climbs showed as weight is drag.

    Growth on the hull slows a climb as weight does. It does not hasten the dive that follows.
    """
    known = m_b + limits.ballast
    if state.off <= 0.0 or known + state.off <= 0.0:
        return 1.0
    return math.sqrt(max(0.0, known) / (known + state.off))


@kernel
def _least_squares(line, growth, more, since_s, dt):
    """Value (kg) and slope (kg/s) of the line through all since some time (s), to ``more``."""
    n = min(since_s, NEWER_S) / dt
    error = more - (line + growth * dt)
    line += growth * dt + 2.0 * (2.0 * n - 1.0) / (n * (n + 1.0)) * error
    return line, growth + 6.0 / (n * (n + 1.0)) * error / dt


@kernel
def weigh(state: Weight, at: Glide, limits: WeightLimits, dt: float) -> tuple[Weight, int]:
    """Take in what a tick shows; also the rows that hold.

    At the surface nothing glides. Twice the drag, as growth makes it, takes half of the speed's
    square from a climb: what the vehicle still rises by is taken off again. In a dive it is
    reported, too, where at the end of it the pump could not take off what it weighs.
    """
    off, soon, least, line, growth = state.off, state.soon, state.least, state.line, state.growth
    begun, line_s, glides, shown = state.begun, 0.0, 0.0, 0.0
    steep = max(LEAST_PITCH, LEAST_SHARE * limits.polar.shallowest)
    glides_s = 0.0
    if at.under and abs(at.theta) > steep and abs(at.m_b - at.sent) <= limits.arrived:
        glides_s = state.glides_s + dt
    mean = state.rate + dt / SOON_S * (at.rate - state.rate)
    sinks = state.sinking + dt / SOON_S * (at.sinking - state.sinking)
    if glides_s > SOON_S and abs(mean) > LEAST_RATE:
        known = at.m_b + limits.ballast
        glides = glide_net_heaviness(at.theta, mean, limits.polar, at.attack)
        more, shown = glides - known, glides
        if sinks < mean:
            shown = glide_net_heaviness(at.theta, sinks, limits.polar, at.attack)
        least += (dt / limits.average_s) * (shown + min(0.0, shown) - known - least)
        off += (dt / limits.average_s) * (more - off)
        soon += (dt / SOON_S) * (more - soon)
        if glides_s > STEADY_S:
            line_s = state.line_s + dt
            line, growth = _least_squares(line, growth, shown - known, line_s, dt)
    ended, can = state.ended, min(state.can, SURELY * limits.range)
    if line_s == 0.0:
        begun = at.depth
        if state.line_s > LINE_S and at.depth > state.begun:
            per_m = state.growth * state.line_s / (at.depth - state.begun)
            ended = Ended(state.line, at.depth, per_m)
    elif mean > LEAST_RATE:  # another dive: the climb after this one tells of it
        ended = NO_END
    if ended.depth > 0.0 and mean < -LEAST_RATE and glides_s > WEIGHED_AGAIN_S:
        # by the rate that is less, as the line is, which makes ``shown`` of ``glides``
        errs = ended.weight + ended.per_m * (at.depth - ended.depth) - (soon + shown - glides)
        ended, can = NO_END, limits.range + errs
    is_heavy = least > limits.most
    if line_s > LINE_S and mean > LEAST_RATE and at.target > at.depth > begun:
        ahead = min(1.0, (at.target - at.depth) / (at.depth - begun))
        is_heavy = is_heavy or line + growth * line_s * ahead > can
    state = Weight(
        off=off,
        soon=soon,
        rate=mean,
        sinking=sinks,
        glides_s=glides_s,
        least=least,
        line=line,
        growth=growth,
        line_s=line_s,
        begun=begun,
        ended=ended,
        can=can,
    )
    return state, TOO_HEAVY if is_heavy else 0
