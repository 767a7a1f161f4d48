# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""Whether fixes contradict dead reckoning, by odometry and its covariance alone.

What of the jump at the first fix after a dive is a sea that changes, and what is none, as with a
compass that is stuck, is in docs/theory.md, 4. A position that is known has a covariance of 0, and
nothing of this is watched.
"""

import math
from typing import NamedTuple

from glider_base.frames import rotate_to_ned
from glider_base.kernel import kernel, replace
from glider_base.signals import Covariance, Odometry, Vector
from glider_model.onboard.gate import norm2

#: A vehicle that has been below the first depth dives, above the second it has come up (m).
DIVES_M, SURFACES_M = 3.0, 1.5
#: After less time under water than this (s) a jump tells nothing.
SHORTEST_S = 300.0
#: A fix makes the variance of the place fall to less than this share of itself in a tick.
FALLS = 0.5
#: A contradiction is faster than this (m/s), and farther than so many variances of the place.
FAST_MPS, FAR = 0.4, 4.0
#: So many surfacings are remembered, as bits.
REMEMBERED = 0b111111
#: Nothing counts that is larger (m, m/s, m^2).
MOST_M, MOST_MPS, MOST_M2 = 1e8, 10.0, 1e16


_STILL, _NONE = Vector(0.0, 0.0), Covariance(0.0, 0.0, 0.0)


class FixWatch(NamedTuple):
    """What is watched, between two ticks."""

    is_under: bool = False
    under_s: float = 0.0  #: time under water since the last fix
    is_fixed: bool = False  #: there was a fix in this surface interval
    place: Vector = _STILL  #: that was estimated a tick before (m)
    known: Covariance = _NONE  #: of it (m^2)
    jump: Vector = _STILL  #: at the fix of this stay, over the time under water (m/s)
    off: float = 0.0  #: the same as a distance, squared, over its variance
    drift: Vector = _STILL  #: at the surface, last heard of (m/s)
    drift_1: Vector = _STILL  #: as the last dive but none began
    drift_2: Vector = _STILL  #: and the one before it
    judged: int = 0  #: surfacings
    against: int = 0  #: those of the last six that contradict, as bits


@kernel
def contradictions(watch):
    """Number of the last six surfacings whose fixes contradict."""
    count, bits = 0, watch.against
    while bits > 0:
        count += bits & 1
        bits >>= 1
    return count


@kernel
def _unexplained(jump, change):
    """Speed (m/s) that is left of a jump without what the change of the drift explains."""
    squared = change.n * change.n + change.e * change.e
    share = 0.0
    if squared > 0.0:
        share = max(0.0, min(1.0, (jump.n * change.n + jump.e * change.e) / squared))
    n, e = jump.n - share * change.n, jump.e - share * change.e
    return math.sqrt(n * n + e * e)


@kernel
def _off_squared(d_n, d_e, known):
    """Squared distance (m) over its variance; 0.0 if there is none."""
    determinant = known.nn * known.ee - known.ne * known.ne
    if not determinant > 0.0:
        return 0.0
    squared = known.ee * d_n * d_n - 2.0 * known.ne * d_n * d_e + known.nn * d_e * d_e
    return squared / determinant


@kernel
def _is_plausible(x, known):
    """Whether all of it are numbers that a glider can have; false for NaN."""
    return (
        abs(x.p_n) < MOST_M
        and abs(x.p_e) < MOST_M
        and abs(x.p_d) < MOST_M
        and abs(x.u) < MOST_MPS
        and abs(x.v) < MOST_MPS
        and abs(x.w) < MOST_MPS
        and abs(norm2(x) - 1.0) < 0.1
        and 0.0 <= known.nn < MOST_M2
        and 0.0 <= known.ee < MOST_M2
        and abs(known.ne) < MOST_M2
    )


@kernel
def _dive(watch):
    """The watch as a dive begins: the stay before it is judged."""
    under_s, judged, against = watch.under_s, watch.judged, watch.against
    if watch.is_fixed:
        change = Vector(watch.drift.n - watch.drift_2.n, watch.drift.e - watch.drift_2.e)
        fast = _unexplained(watch.jump, change) > FAST_MPS
        # before the first nothing was known of the current
        is_against = judged > 0 and fast and watch.off > FAR
        against = ((against << 1) | (1 if is_against else 0)) & REMEMBERED
        under_s, judged = 0.0, judged + 1
    return replace(
        watch,
        is_under=True,
        under_s=under_s,
        is_fixed=False,
        jump=_STILL,
        off=0.0,
        drift_1=watch.drift,
        drift_2=watch.drift_1,
        judged=judged,
        against=against,
    )


@kernel
def watch_fixes(watch: FixWatch, odometry: Odometry, known: Covariance, dt: float) -> FixWatch:
    """Take in odometry and the covariance of its place (m^2) at a tick of ``dt`` s.

    Anything may be in them; what is not plausible changes nothing.
    """
    x = odometry
    if not _is_plausible(x, known):
        return watch
    is_under = x.p_d > (SURFACES_M if watch.is_under else DIVES_M)
    if is_under and not watch.is_under:
        watch = _dive(watch)
    jump, off, is_fixed, drift = watch.jump, watch.off, watch.is_fixed, watch.drift
    under_s = watch.under_s + dt if is_under else watch.under_s
    if not is_under:
        v_n, v_e, _ = rotate_to_ned(x.q_w, x.q_x, x.q_y, x.q_z, x.u, x.v, x.w)
        drift = Vector(v_n, v_e)
        fell = known.nn + known.ee < FALLS * (watch.known.nn + watch.known.ee)
        if fell and not is_fixed and watch.under_s <= SHORTEST_S:
            under_s = 0.0
        elif fell and not is_fixed:
            d_n, d_e = x.p_n - watch.place.n, x.p_e - watch.place.e
            jump, is_fixed = Vector(d_n / watch.under_s, d_e / watch.under_s), True
            off = _off_squared(d_n, d_e, watch.known)
    return replace(
        watch,
        is_under=is_under,
        under_s=under_s,
        is_fixed=is_fixed,
        place=Vector(x.p_n, x.p_e),
        known=known,
        jump=jump,
        off=off,
        drift=drift,
    )
