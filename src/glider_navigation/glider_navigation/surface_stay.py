# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""A stay at the surface: where the vehicle came up, and how it drifts, from its fixes.

Least squares for the straight line p + v t with what was believed before as the first knowledge,
the same for both axes. Fixes count once in `FIX_EVERY_S`: the error of one is that of the next.
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


@kernel
def begin(place, variance, drift):
    """Come up at a place (m) that is known with a variance (m^2)."""
    return Stay(0.0, place, drift, variance, 0.0, DRIFT_STD * DRIFT_STD, 0, 0.0)


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
    )
