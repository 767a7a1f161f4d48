# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""Which depth can be trusted: a witness that is no depth, and 0 at the surface.

Pump, pitch and glide polar say how fast the vehicle must sink. A depth that shows the same number
to the last bit for long, under water or while they lead the vehicle away, is no measurement; nor
is one that jumps and stays there. With the antenna out of the water the depth is 0: what is shown
there is its offset, which is taken off, or too large to be one. Where the depth is not trusted,
it is reckoned by pump, pitch and polar from the last one that was.
"""

from typing import NamedTuple

from glider_base.kernel import kernel, replace
from glider_guard.rows import DEPTH_OFFSET, DEPTH_WRONG, FROZEN

#: Above this the vehicle is at the surface, and nothing of its depth is watched (m).
SURFACE_M = 5.0
#: Above this it is afloat, and its antenna may be out (m): one that surfaces for good hangs where
#: it is deeper, and no contact is made.
AFLOAT_M = 2.0
#: There was a contact within this time (s): the antenna is out of the water.
HEARD_S = 1.0
#: With the antenna out for so long (s) the vehicle is at the surface; a depth shown there is
#: averaged over the second time (s).
OUT_S, ZERO_S = 5.0, 30.0
#: A smaller offset is left (m): waves, and an antenna that is out before the hull is.
LEAST_OFFSET_M = 3.0
#: Time constant of the vertical rate that forecasts go by (s).
RATE_S = 10.0
#: No glider sinks or rises faster (m/s).
FASTEST_MPS = 1.5
#: Deeper or higher than this nothing is shown (m).
FARTHEST_M = 1e6


class WitnessLimits(NamedTuple):
    """What of a depth is trusted."""

    same_s: float  #: the same sample for so long is none
    is_rough: bool  #: measured in steps: the same sample is natural where the vehicle hardly moves
    led_m: float  #: and is none where pump and pitch have led so far meanwhile
    jump_m: float  #: farther from sample to sample, and for longer than hold_s, is no motion
    hold_s: float
    settled_s: float  #: at the surface for so long odom shows what is sampled there
    offset_m: float  #: more than this is no offset
    has_rate: bool  #: the vertical rate of odom is measured apart from the depth


class Shown(NamedTuple):
    """What a tick shows."""

    raw: float  #: depth as the sensor shows it (m); anything
    odom: float  #: depth of odom (m)
    odom_before: float  #: the same a tick before
    contact_age_s: float  #: less than 0: not measured
    rate: float  #: vertical rate of odom (m/s, + down)
    led: float  #: vertical rate that pump, pitch and polar make (m/s, + down)
    is_glide: bool  #: they agree about the direction
    is_same: bool  #: odom is what it was a tick before


class Witness(NamedTuple):
    """What is known of the depth beside what is shown, between two ticks."""

    raw: float  #: last sample (m)
    same_s: float  #: since it changed
    led_m: float  #: way that pump and pitch have led since (m, + down)
    own: float  #: last sample that was not too far from the one before (m)
    own_s: float  #: its age
    far_s: float  #: for which samples have been too far from it
    out_s: float  #: antenna out of the water, without a break
    own_zero: float  #: what the sensor shows at the surface (m)
    odom_zero: float  #: what odom shows there
    depth: float  #: that is trusted (m)
    rate: float  #: vertical rate that is trusted, averaged (m/s, + down)
    apart_m: float  #: between the two that are measured (m)


INITIAL_WITNESS = Witness(*(12 * (0.0,)))


@kernel
def begin_watch(raw, odom):
    """Nothing is known yet but a sample of the sensor and of odom (m)."""
    shown = raw if abs(raw) < FARTHEST_M else odom
    return replace(INITIAL_WITNESS, raw=shown, own=shown, depth=odom)


@kernel
def _offset(zero):
    """What is taken off a depth (m) that shows ``zero`` at the surface."""
    return zero if abs(zero) > LEAST_OFFSET_M else 0.0


@kernel
def _averaged(zero, shown, before, jump_m, dt):
    """What is shown at the surface (m), averaged; anew where two samples (m) agree about it."""
    is_far = abs(shown - zero) > jump_m and abs(before - zero) > jump_m
    if is_far and 0.0 < abs(shown - before) < jump_m:
        return shown
    return zero + dt / ZERO_S * (shown - zero)


@kernel
def is_out(state):
    """Whether the vehicle is at the surface for certain: its antenna has contact."""
    return state.out_s > OUT_S


@kernel
def watch(
    state: Witness, shown: Shown, sees: bool, limits: WitnessLimits, dt: float
) -> tuple[Witness, int]:
    """Take in what a tick shows; also the rows that hold.

    ``sees`` says whether the depth has been trusted so far.
    """
    reported, raw = 0, shown.raw
    is_one = abs(raw) < FARTHEST_M
    led = shown.led if shown.is_glide or not sees else 0.0
    same_s, led_m = state.same_s + dt, state.led_m + dt * led
    if limits.is_rough and state.depth <= AFLOAT_M:  # nothing leads it up from there
        led_m = max(0.0, led_m)
    if is_one and raw != state.raw:
        same_s, led_m = 0.0, 0.0
    if not is_one:
        raw = state.raw
    own, own_s, far_s = state.own, state.own_s + dt, 0.0
    if abs(raw - own) > limits.jump_m + FASTEST_MPS * own_s:
        far_s = state.far_s + dt
    if far_s > limits.hold_s:
        # at the surface it is checked against 0
        far_s, reported = 0.0, 0 if state.out_s > OUT_S else DEPTH_WRONG
    if far_s == 0.0 and raw != own:
        own, own_s = raw, 0.0
    is_out = 0.0 <= shown.contact_age_s < HEARD_S
    out_s = state.out_s + dt if is_out else 0.0
    own_zero, odom_zero = state.own_zero, state.odom_zero
    if out_s > OUT_S + limits.settled_s:
        own_zero = _averaged(own_zero, own, state.own, limits.jump_m, dt)
        odom_zero = _averaged(odom_zero, shown.odom, shown.odom_before, limits.jump_m, dt)
    # two samples that agree show it higher above the water than any offset does: nobody flies
    is_above = far_s == 0.0 and raw != state.raw and max(own, state.own) < -limits.offset_m
    if is_above or max(abs(own_zero), abs(odom_zero)) > limits.offset_m:
        reported |= DEPTH_WRONG
    elif _offset(own_zero) != 0.0 or _offset(odom_zero) != 0.0:
        reported |= DEPTH_OFFSET
    by_own, by_odom = own - _offset(own_zero), shown.odom - _offset(odom_zero)
    depth, rate = by_own, shown.rate
    if far_s == 0.0:
        depth = max(by_own, by_odom)
    if same_s > limits.same_s:
        if abs(led_m) > limits.led_m or (depth > SURFACE_M and not limits.is_rough):
            reported |= FROZEN
    if not sees:
        rate = shown.rate if limits.has_rate and not shown.is_same else shown.led
        depth = 0.0 if out_s > OUT_S else max(0.0, state.depth + dt * rate)
    elif reported & (FROZEN | DEPTH_WRONG):
        # the last that was trusted, and what has been gone since
        depth = 0.0 if out_s > OUT_S else max(0.0, state.depth + (led_m if same_s > 0.0 else 0.0))
    rate = state.rate + dt / RATE_S * (rate - state.rate)
    return Witness(
        raw=raw,
        same_s=same_s,
        led_m=led_m,
        own=own,
        own_s=own_s,
        far_s=far_s,
        out_s=out_s,
        own_zero=own_zero,
        odom_zero=odom_zero,
        depth=depth,
        rate=rate,
        apart_m=abs(by_own - by_odom),
    ), reported
