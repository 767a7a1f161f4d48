# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""What is believed of the current, from the mean over each way under water (docs/theory.md, 4).

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
#: The mean over a way is no better known than this, however steady the sea: turn-overs, where the
#: flight model does not hold, are not all alike (m/s).
LEAST_STD = 0.0007
#: No current is faster, in whatever scenario (m/s).
FASTEST = MAX_SPEED_MPS
#: From so long a stay at the surface on (s) the change of the drift counts: in shorter ones of two
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


class CurrentBelief(NamedTuple):
    """What is believed of the current."""

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


def initial_belief(tide: bool, mean_std: float = MEAN_STD) -> CurrentBelief:
    """Nothing is known yet, but how far the mean may be off (m/s)."""
    tide2 = TIDE_STD * TIDE_STD if tide else 0.0
    return CurrentBelief(Uncertainty(mean_std * mean_std, 0.0, 0.0, tide2, 0.0, tide2))


@kernel
def _carried(belief, share):
    """Mean (m/s) after the stays since, of whose drift a share was the current's."""
    return plus(belief.mean, belief.drifted, share)


@kernel
def current_at(belief, t_s):
    """Current (m/s) that is believed for a time since the start (s)."""
    mean = _carried(belief, belief.follows.share)
    if belief.p.aa <= 0.0:
        return mean
    return plus(plus(mean, belief.cos, math.cos(TIDE * t_s)), belief.sin, math.sin(TIDE * t_s))


@kernel
def last_mean(belief):
    """Mean (m/s) over the last way taken in, whatever the drift at the surface told since."""
    h = belief.over
    return plus(plus(belief.mean, belief.cos, h.cos), belief.sin, h.sin)


@kernel
def _apart_s(belief, way_s):
    """Time (s) in which the mean over a way comes to differ from that of the way before."""
    return (belief.way_s + way_s) / 3.0 + belief.gap_s


@kernel
def _grown(belief, time_s):
    """Variance (m^2/s^2) by which the mean comes to differ in a time (s)."""
    return belief.q * time_s * (1.0 + 1.0 / belief.weight)


@kernel
def wandered(belief, way_s):
    """Variance (m^2/s^2) by which the mean over a way differs from that of the way before."""
    if belief.way_s <= 0.0:
        return 0.0
    return _grown(belief, _apart_s(belief, way_s)) + LEAST_STD * LEAST_STD


@kernel
def _loaded(p, h):
    """P h for the regressors of a way."""
    return (
        p.mm * h.one + p.ma * h.cos + p.mb * h.sin,
        p.ma * h.one + p.aa * h.cos + p.ab * h.sin,
        p.mb * h.one + p.ab * h.cos + p.bb * h.sin,
    )


@kernel
def mean_variance(belief, h):
    """Variance (m^2/s^2) of the mean current over a way, by what is known."""
    m, a, b = _loaded(belief.p, h)
    return h.one * m + h.cos * a + h.sin * b


@kernel
def _bounded(current):
    """A current (m/s) that is no faster than `FASTEST`."""
    speed = math.sqrt(current.n * current.n + current.e * current.e)
    if speed <= FASTEST:
        return current
    return Vector(FASTEST / speed * current.n, FASTEST / speed * current.e)


@kernel
def take_in(belief, off, h, way_s, glide, variance, bias):
    """What is believed after a way of ``way_s`` s under water; ``belief`` is that before it.

    ``off`` is the mean current over the way less what was believed (m/s), ``h`` its
    `Regressors`, ``glide`` the mean velocity through the water (m/s). ``variance`` (m^2/s^2)
    is that of the measured mean, by that of the fixes; ``bias`` that of what speed and
    compass errors seem to be of current, and was not in the way before.
    """
    wander = wandered(belief, way_s)
    p = belief.p
    grown = replace(p, mm=p.mm + wander + bias)
    m, a, b = _loaded(grown, h)
    s = h.one * m + h.cos * a + h.sin * b + variance
    drifted = belief.drifted
    follows = weigh(belief.follows, off, drifted, s - _grown(belief, belief.gap_s))
    more = follows.share - belief.follows.share
    off = plus(off, drifted, -more)
    k_m, k_a, k_b = m / s, a / s, b / s
    q, weight = belief.q, belief.weight
    if belief.way_s > 0.0:
        known = s - wander
        seen = (0.5 * (off.n * off.n + off.e * off.e) - known) / _apart_s(belief, way_s)
        q = max(0.0, (weight * q + max(0.0, seen)) / (weight + 1.0))
        weight = min(MOST_WEIGHT, weight + 1.0)
    mean = _carried(belief, follows.share)
    return CurrentBelief(
        mean=_bounded(plus(mean, off, k_m)),
        cos=plus(belief.cos, off, k_a),
        sin=plus(belief.sin, off, k_b),
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
def carry(belief, change, stay_s, variance):
    """What is believed after a stay at the surface of ``stay_s`` s.

    ``belief`` is that after the way before it. ``change`` (m/s) is that of the drift in the stay,
    beyond what was believed to change, ``variance`` that of it by the fixes (m^2/s^2).
    """
    share = 0.0
    if stay_s >= LONG_STAY_S:
        wander = belief.q * stay_s
        share = wander / (wander + variance)
    drifted = plus(belief.drifted, change, share)
    known = min(1.0, share * belief.follows.share)
    return replace(belief, drifted=drifted, gap_s=belief.gap_s + (1.0 - known) * stay_s)
