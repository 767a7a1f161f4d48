# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""A surface interval: where the vehicle came up, where it is, and how it drifts, by its fixes.

A Kalman filter and a fixed-point smoother, the same for both axes (docs/theory.md, 4). A fix where
the vehicle can hardly be is set aside; another one beside it, later, says that the vehicle was
there after all: the estimate of the place is forgotten, and both count.
"""

import math
from typing import NamedTuple

from glider_base.kernel import kernel, replace
from glider_base.signals import Vector, minus, over, plus

#: Time from a fix that counts to the next (s).
FIX_EVERY_S = 60.0
#: Least variance of a fix, also of one that says nothing of its own (m^2).
LEAST_VARIANCE = 0.25
#: Before the first fixes: standard deviation of the drift about what is estimated (m/s).
DRIFT_STD = 0.15
#: The same where the place was estimated wrongly, and so is the drift (m/s).
LOST_DRIFT_STD = 1.5
#: Growth of the variance of the drift (m^2/s^3): by 0.03 m/s in an hour.
DRIFT_WANDERS = 3e-7
#: Where less than this share of what is known of its change is by fixes, they tell nothing.
LEAST_BY_FIXES = 1e-6
#: Farther from where the vehicle is estimated to be than so many standard deviations, and than so
#: far (m) and what it may have drifted otherwise since the last fix (m/s), a fix is set aside.
FARTHEST_STD, FARTHEST_M, FASTEST_MPS = 6.0, 100.0, 1.5
#: Another one this much later (s), and no farther from it than that, confirms it.
CONFIRMED_S = 10.0


#: There is no fix that was set aside.
NO_FIX_ASIDE = -1.0


class Known(NamedTuple):
    """Covariance of where it came up (c), drift there (d), place (p) and drift (v) now (m, s)."""

    cc: float
    cp: float
    cv: float
    dd: float
    dp: float
    dv: float
    pp: float
    pv: float
    vv: float


class Stay(NamedTuple):
    """What is known of a stay."""

    t_s: float  #: since the vehicle came up, or since the start
    came_up: Vector  #: where that was (m)
    place: Vector  #: where it is now (m)
    first_drift: Vector  #: as it came up (m/s)
    drift: Vector  #: now (m/s)
    known: Known
    fixes: int
    fixed_s: float  #: time of the last fix that counted
    aside: Vector  #: a fix that was set aside (m)
    aside_s: float = NO_FIX_ASIDE  #: when that was; `NO_FIX_ASIDE`: there is none


_STILL = Vector(0.0, 0.0)
_NOWHERE = Stay(0.0, _STILL, _STILL, _STILL, _STILL, Known(*(9 * (0.0,))), 0, 0.0, _STILL)


@kernel
def begin(place, variance, drift):
    """Come up at a place (m) that is known with a variance (m^2)."""
    vv = DRIFT_STD * DRIFT_STD
    known = replace(_NOWHERE.known, cc=variance, cp=variance, pp=variance, dd=vv, dv=vv, vv=vv)
    return replace(
        _NOWHERE, came_up=place, place=place, first_drift=drift, drift=drift, known=known
    )


def launched(place: Vector, variance: float) -> Stay:
    """Put into the water at a place (m) that is known with a variance (m^2), as by a fix."""
    return begin(place, variance, Vector(0.0, 0.0))._replace(fixes=1)


@kernel
def drifted_variance(stay):
    """Variance (m^2) of the way from where the vehicle came up to where it is."""
    return stay.known.cc - 2.0 * stay.known.cp + stay.known.pp


@kernel
def change_of_drift(stay):
    """Drift now less that as it came up (m/s), by the fixes alone, and its variance (m^2/s^2).

    The filter assumes that the drift changes little, and that is taken out of what it says.
    """
    before = DRIFT_WANDERS * stay.t_s
    variance = stay.known.vv - 2.0 * stay.known.dv + stay.known.dd
    by_fixes = 1.0 - variance / before if before > 0.0 else 0.0
    if by_fixes < LEAST_BY_FIXES:
        return Vector(0.0, 0.0), math.inf
    return over(minus(stay.drift, stay.first_drift), by_fixes), variance / by_fixes


@kernel
def counts(stay, fix):
    """Whether a fix counts."""
    return fix.is_fix and (stay.fixes == 0 or stay.t_s - stay.fixed_s >= FIX_EVERY_S)


@kernel
def wait(stay, dt):
    """Drift for a tick."""
    k = stay.known
    known = replace(
        k,
        cp=k.cp + dt * k.cv,
        dp=k.dp + dt * k.dv,
        pp=k.pp + dt * (2.0 * k.pv + dt * (k.vv + DRIFT_WANDERS * dt / 3.0)),
        pv=k.pv + dt * (k.vv + 0.5 * DRIFT_WANDERS * dt),
        vv=k.vv + DRIFT_WANDERS * dt,
    )
    place = plus(stay.place, stay.drift, dt)
    return replace(stay, t_s=stay.t_s + dt, place=place, known=known)


@kernel
def take_fix(stay, fix):
    """Take in a fix."""
    k = stay.known
    s = k.pp + max(LEAST_VARIANCE, fix.variance)
    k_c, k_d, k_p, k_v = k.cp / s, k.dp / s, k.pp / s, k.pv / s
    off = Vector(fix.p_n - stay.place.n, fix.p_e - stay.place.e)
    return replace(
        stay,
        came_up=plus(stay.came_up, off, k_c),
        place=plus(stay.place, off, k_p),
        first_drift=plus(stay.first_drift, off, k_d),
        drift=plus(stay.drift, off, k_v),
        known=Known(
            cc=k.cc - k_c * k.cp,
            cp=k.cp - k_c * k.pp,
            cv=k.cv - k_c * k.pv,
            dd=k.dd - k_d * k.dp,
            dp=k.dp - k_d * k.pp,
            dv=k.dv - k_d * k.pv,
            pp=k.pp - k_p * k.pp,
            pv=k.pv - k_p * k.pv,
            vv=k.vv - k_v * k.pv,
        ),
        fixes=stay.fixes + 1,
        fixed_s=stay.t_s,
        aside_s=NO_FIX_ASIDE,
    )


@kernel
def _distance2(fix, n, e):
    """Squared distance (m^2) of a fix from a place."""
    return (fix.p_n - n) * (fix.p_n - n) + (fix.p_e - e) * (fix.p_e - e)


@kernel
def _set_aside(stay, fix):
    """The same stay with a fix that is set aside."""
    return replace(stay, aside=Vector(fix.p_n, fix.p_e), aside_s=stay.t_s)


@kernel
def _begin_aside(stay, variance):
    """The same stay, of whose place nothing is known but the fix that was set aside."""
    t, fix, drift, vv = stay.aside_s, stay.aside, stay.drift, LOST_DRIFT_STD * LOST_DRIFT_STD
    variance = max(LEAST_VARIANCE, variance)
    back = variance + t * t * (vv + DRIFT_WANDERS * t / 3.0)
    then = replace(
        stay,
        t_s=t,
        came_up=plus(fix, drift, -t),
        place=fix,
        first_drift=drift,
        known=Known(
            cc=back,
            cp=variance,
            cv=-t * vv,
            dd=vv + DRIFT_WANDERS * t,
            dp=0.0,
            dv=vv,
            pp=variance,
            pv=0.0,
            vv=vv,
        ),
        fixes=stay.fixes + 1,
        fixed_s=t,
        aside_s=NO_FIX_ASIDE,
    )
    return wait(then, stay.t_s - t)


@kernel
def hear_fix(stay, fix):
    """Take in a fix that counts, if the vehicle can be there, or if another one has said so."""
    here = stay.place
    variance = stay.known.pp + max(LEAST_VARIANCE, fix.variance)
    drifted = FASTEST_MPS * (stay.t_s - stay.fixed_s) if stay.fixes > 0 else 0.0
    farthest = max(FARTHEST_M + drifted, FARTHEST_STD * math.sqrt(variance))
    if _distance2(fix, here.n, here.e) <= farthest * farthest:
        return take_fix(stay, fix)
    near = FARTHEST_M + FASTEST_MPS * (stay.t_s - stay.aside_s)
    beside = _distance2(fix, stay.aside.n, stay.aside.e) <= near * near
    if stay.aside_s == NO_FIX_ASIDE or not beside:
        return _set_aside(stay, fix)
    if stay.t_s - stay.aside_s < CONFIRMED_S:
        return stay
    anew = _begin_aside(stay, fix.variance)
    return take_fix(anew, fix) if counts(anew, fix) else anew
