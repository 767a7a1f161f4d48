# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""A stay at the surface: where the vehicle came up, and how it drifts, from its fixes.

Least squares for the straight line p + v t with what was believed before as the first knowledge,
the same for both axes. Fixes count once in `FIX_EVERY_S`: the error of one is that of the next.
A fix where the vehicle can hardly be is set aside; another one beside it, later, says that the
vehicle is there after all, and what was believed of the place is forgotten.
"""

from typing import NamedTuple

from glider_model.base.kernel import kernel
from glider_model.base.signals import Vector

#: Time from a fix that counts to the next (s).
FIX_EVERY_S = 60.0
#: Least variance of a fix, also of one that says nothing of its own (m^2).
LEAST_VARIANCE = 0.25
#: Before the first fixes: standard deviation of the drift about what is believed (m/s).
DRIFT_STD = 0.15
#: Farther from where the vehicle is believed to be than so many standard deviations, and than so
#: far (m), a fix is set aside.
FARTHEST_STD, FARTHEST_M = 6.0, 100.0
#: Another one this much later (s), and no farther from it than this (m), confirms it.
CONFIRMED_S, CONFIRMED_M = 10.0, 100.0


class Stay(NamedTuple):
    """What is known of a stay."""

    t_s: float  #: since the vehicle came up, or since the start
    place: Vector  #: where that was (m)
    drift: Vector  #: (m/s)
    pp: float  #: covariance of both (m^2, m^2/s, m^2/s^2)
    pv: float
    vv: float
    fixes: int
    fixed_s: float  #: time of the last fix that counted
    aside: Vector  #: a fix that was set aside (m)
    aside_s: float  #: when that was; `NO_FIX_ASIDE`: there is none


#: There is no fix that was set aside.
NO_FIX_ASIDE = -1.0


@kernel
def begin(place, variance, drift):
    """Come up at a place (m) that is known with a variance (m^2)."""
    vv = DRIFT_STD * DRIFT_STD
    return Stay(0.0, place, drift, variance, 0.0, vv, 0, 0.0, Vector(0.0, 0.0), NO_FIX_ASIDE)


def launched(place: Vector, variance: float) -> Stay:
    """Put into the water at a place (m) that is known with a variance (m^2), as by a fix."""
    return begin(place, variance, Vector(0.0, 0.0))._replace(fixes=1)


@kernel
def now(stay):
    """Where the vehicle is now (m)."""
    return Vector(
        stay.place.n + stay.drift.n * stay.t_s,
        stay.place.e + stay.drift.e * stay.t_s,
    )


@kernel
def variance_now(stay):
    """Variance (m^2) of where the vehicle is now."""
    t = stay.t_s
    return stay.pp + 2.0 * t * stay.pv + t * t * stay.vv


@kernel
def counts(stay, fix):
    """Whether a fix counts."""
    return fix.is_fix and (stay.fixes == 0 or stay.t_s - stay.fixed_s >= FIX_EVERY_S)


@kernel
def wait(stay, dt):
    """Drift for a tick."""
    return Stay(
        stay.t_s + dt,
        stay.place,
        stay.drift,
        stay.pp,
        stay.pv,
        stay.vv,
        stay.fixes,
        stay.fixed_s,
        stay.aside,
        stay.aside_s,
    )


@kernel
def take_fix(stay, fix):
    """Take in a fix."""
    t, here = stay.t_s, now(stay)
    g_p, g_v = stay.pp + t * stay.pv, stay.pv + t * stay.vv
    s = g_p + t * g_v + max(LEAST_VARIANCE, fix.variance)
    k_p, k_v = g_p / s, g_v / s
    off_n, off_e = fix.p_n - here.n, fix.p_e - here.e
    return Stay(
        t,
        Vector(stay.place.n + k_p * off_n, stay.place.e + k_p * off_e),
        Vector(stay.drift.n + k_v * off_n, stay.drift.e + k_v * off_e),
        stay.pp - k_p * g_p,
        stay.pv - k_p * g_v,
        stay.vv - k_v * g_v,
        stay.fixes + 1,
        t,
        stay.aside,
        NO_FIX_ASIDE,
    )


@kernel
def _distance2(fix, n, e):
    """Squared distance (m^2) of a fix from a place."""
    return (fix.p_n - n) * (fix.p_n - n) + (fix.p_e - e) * (fix.p_e - e)


@kernel
def _set_aside(stay, aside, aside_s):
    """The same stay with a fix that is set aside."""
    return Stay(
        stay.t_s,
        stay.place,
        stay.drift,
        stay.pp,
        stay.pv,
        stay.vv,
        stay.fixes,
        stay.fixed_s,
        aside,
        aside_s,
    )


@kernel
def _begin_at(stay, fix):
    """The same stay, of whose place nothing is known but this fix."""
    t, vv = stay.t_s, DRIFT_STD * DRIFT_STD
    place = Vector(fix.p_n - t * stay.drift.n, fix.p_e - t * stay.drift.e)
    variance = max(LEAST_VARIANCE, fix.variance) + t * t * vv
    return Stay(
        t, place, stay.drift, variance, -t * vv, vv, stay.fixes + 1, t, stay.aside, NO_FIX_ASIDE
    )


@kernel
def hear_fix(stay, fix):
    """Take in a fix that counts, if the vehicle can be there, or if another one has said so."""
    here = now(stay)
    variance = variance_now(stay) + max(LEAST_VARIANCE, fix.variance)
    farthest2 = max(FARTHEST_M * FARTHEST_M, FARTHEST_STD * FARTHEST_STD * variance)
    if _distance2(fix, here.n, here.e) <= farthest2:
        return take_fix(stay, fix)
    beside = _distance2(fix, stay.aside.n, stay.aside.e) <= CONFIRMED_M * CONFIRMED_M
    if stay.aside_s == NO_FIX_ASIDE or not beside:
        return _set_aside(stay, Vector(fix.p_n, fix.p_e), stay.t_s)
    if stay.t_s - stay.aside_s >= CONFIRMED_S:
        return _begin_at(stay, fix)
    return stay
