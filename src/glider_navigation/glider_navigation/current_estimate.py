# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""The estimate of the current, from the mean over each dive segment (docs/theory.md, 4).

A mean and, if that is asked for, a tide, by a Kalman filter. How much the mean wanders is learnt
(innovation-based adaptive estimation, Mehra 1970). With the tide left out this is persistence: the
last mean holds for the next way. Where there is a forecast, all of this is about the difference
between the sea and the forecast.
"""

import math
from typing import NamedTuple

from glider_base.kernel import kernel, replace
from glider_base.signals import Vector, plus
from glider_model.ocean.current_settings import MAX_SPEED_MPS
from glider_navigation.forecast import Trust, weigh

#: Principal lunar tide M2 (rad/s).
TIDE = 2.0 * math.pi / (12.4206012 * 3600.0)
#: Before the first way: standard deviation of the mean and of the amplitude of a tide (m/s).
MEAN_STD, TIDE_STD = 0.3, 0.05
#: How far a mean over 1.5 hours is off that of the 1.5 hours before, at first (m/s); how many ways
#: that counts for; and from how many at most q is learnt.
FIRST_CHANGE, FIRST_WEIGHT, MOST_WEIGHT = 0.05, 1.0, 4.0
#: The mean over a way is no better known than this, however steady the sea: inflections, where the
#: flight model does not hold, are not all alike (m/s).
LEAST_STD = 0.0007
#: No current is faster, in whatever scenario (m/s).
FASTEST = MAX_SPEED_MPS
#: From so long a surface interval on (s) the change of the drift counts: in shorter ones of two
#: recorded flights, modena and sg033, the current was forecast better without it.
LONG_STAY_S = 7200.0
#: What share of that change is the current's, at first, and how far it may be off (-).
FOLLOWS, FOLLOWS_STD = 1.0, 1.0
FIRST_Q = 3.0 * FIRST_CHANGE * FIRST_CHANGE / (2.0 * 5400.0)


class Regressors(NamedTuple):
    """Mean of 1, cos(w t) and sin(w t) over a way."""

    one: float
    cos: float
    sin: float


class Uncertainty(NamedTuple):
    """Covariance of mean, cosine and sine, the same for both axes (m^2/s^2)."""

    mm: float
    ma: float
    mb: float
    aa: float
    ab: float
    bb: float


_STILL = Vector(0.0, 0.0)


class CurrentEstimate(NamedTuple):
    """The estimate of the current."""

    p: Uncertainty
    mean: Vector = _STILL  #: (m/s)
    cos: Vector = _STILL
    sin: Vector = _STILL
    q: float = FIRST_Q  #: growth of the variance of the mean (m^2/s^3)
    weight: float = FIRST_WEIGHT  #: ways that q was learnt from
    glide: Vector = _STILL  #: mean velocity through the water in the last way taken in (m/s)
    way_s: float = 0.0  #: its time; 0.0: none yet
    over: Regressors = Regressors(1.0, 0.0, 0.0)  #: of it
    follows: Trust = Trust(FOLLOWS, FOLLOWS_STD * FOLLOWS_STD)  #: the drift, in a long stay
    drifted: Vector = _STILL  #: that change since, as far as fixes tell it (m/s)
    gap_s: float = 0.0  #: time since then for which nothing tells how the current has changed


def initial_estimate(tide: bool, mean_std: float = MEAN_STD) -> CurrentEstimate:
    """Nothing is known yet, but how far the mean may be off (m/s)."""
    tide2 = TIDE_STD * TIDE_STD if tide else 0.0
    return CurrentEstimate(Uncertainty(mean_std * mean_std, 0.0, 0.0, tide2, 0.0, tide2))


@kernel
def _carried(estimate, share):
    """Mean (m/s) after the stays since, of whose drift a share was the current's."""
    return plus(estimate.mean, estimate.drifted, share)


@kernel
def current_at(estimate, t_s):
    """Current (m/s) that is estimated for a time since the start (s)."""
    mean = _carried(estimate, estimate.follows.share)
    if estimate.p.aa <= 0.0:
        return mean
    return plus(plus(mean, estimate.cos, math.cos(TIDE * t_s)), estimate.sin, math.sin(TIDE * t_s))


@kernel
def last_mean(estimate):
    """Mean (m/s) over the last way taken in, whatever the drift at the surface showed since."""
    h = estimate.over
    return plus(plus(estimate.mean, estimate.cos, h.cos), estimate.sin, h.sin)


@kernel
def _apart_s(estimate, way_s):
    """Time (s) in which the mean over a way comes to differ from that of the way before."""
    return (estimate.way_s + way_s) / 3.0 + estimate.gap_s


@kernel
def _grown(estimate, time_s):
    """Variance (m^2/s^2) by which the mean comes to differ in a time (s)."""
    return estimate.q * time_s * (1.0 + 1.0 / estimate.weight)


@kernel
def wandered(estimate, way_s):
    """Variance (m^2/s^2) by which the mean over a way differs from that of the way before."""
    if estimate.way_s <= 0.0:
        return 0.0
    return _grown(estimate, _apart_s(estimate, way_s)) + LEAST_STD * LEAST_STD


@kernel
def _loaded(p, h):
    """P h for the regressors of a way."""
    return (
        p.mm * h.one + p.ma * h.cos + p.mb * h.sin,
        p.ma * h.one + p.aa * h.cos + p.ab * h.sin,
        p.mb * h.one + p.ab * h.cos + p.bb * h.sin,
    )


@kernel
def mean_variance(estimate, h):
    """Variance (m^2/s^2) of the mean current over a way, by what is known."""
    m, a, b = _loaded(estimate.p, h)
    return h.one * m + h.cos * a + h.sin * b


@kernel
def _bounded(current):
    """A current (m/s) that is no faster than `FASTEST`."""
    speed = math.sqrt(current.n * current.n + current.e * current.e)
    if speed <= FASTEST:
        return current
    return Vector(FASTEST / speed * current.n, FASTEST / speed * current.e)


@kernel
def take_in(estimate, off, h, way_s, glide, variance, bias):
    """The estimate after a dive segment of ``way_s`` s; ``estimate`` is that before it.

    ``off`` is the mean current over the way less what was estimated (m/s), ``h`` its
    `Regressors`, ``glide`` the mean velocity through the water (m/s). ``variance`` (m^2/s^2)
    is that of the measured mean, by that of the fixes; ``bias`` that of what speed and
    compass errors seem to be of current, and was not in the way before.
    """
    wander = wandered(estimate, way_s)
    p = estimate.p
    grown = replace(p, mm=p.mm + wander + bias)
    m, a, b = _loaded(grown, h)
    s = h.one * m + h.cos * a + h.sin * b + variance
    drifted = estimate.drifted
    follows = weigh(estimate.follows, off, drifted, s - _grown(estimate, estimate.gap_s))
    more = follows.share - estimate.follows.share
    off = plus(off, drifted, -more)
    k_m, k_a, k_b = m / s, a / s, b / s
    q, weight = estimate.q, estimate.weight
    if estimate.way_s > 0.0:
        known = s - wander
        seen = (0.5 * (off.n * off.n + off.e * off.e) - known) / _apart_s(estimate, way_s)
        q = max(0.0, (weight * q + max(0.0, seen)) / (weight + 1.0))
        weight = min(MOST_WEIGHT, weight + 1.0)
    mean = _carried(estimate, follows.share)
    return CurrentEstimate(
        mean=_bounded(plus(mean, off, k_m)),
        cos=plus(estimate.cos, off, k_a),
        sin=plus(estimate.sin, off, k_b),
        p=Uncertainty(
            mm=grown.mm - k_m * m,
            ma=grown.ma - k_m * a,
            mb=grown.mb - k_m * b,
            aa=grown.aa - k_a * a,
            ab=grown.ab - k_a * b,
            bb=grown.bb - k_b * b,
        ),
        q=q,
        weight=weight,
        glide=glide,
        way_s=way_s,
        over=h,
        follows=follows,
        drifted=Vector(0.0, 0.0),
        gap_s=0.0,
    )


@kernel
def carry(estimate, change, stay_s, variance):
    """The estimate after a surface interval of ``stay_s`` s.

    ``estimate`` is that before it. ``change`` (m/s) is that of the drift in the interval,
    beyond what was expected to change, ``variance`` that of it by the fixes (m^2/s^2).
    """
    share = 0.0
    if stay_s >= LONG_STAY_S:
        wander = estimate.q * stay_s
        share = wander / (wander + variance)
    drifted = plus(estimate.drifted, change, share)
    known = min(1.0, share * estimate.follows.share)
    return replace(estimate, drifted=drifted, gap_s=estimate.gap_s + (1.0 - known) * stay_s)
