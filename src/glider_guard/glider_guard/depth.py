# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""What depth and time under water tell: too deep, no way up, standing still, frozen."""

from typing import NamedTuple

from glider_base.kernel import kernel, replace
from glider_guard import rows
from glider_guard.rows import row
from glider_guard.witness import SURFACE_M

#: Longer than this (s) a vehicle may not be too deep.
TOO_DEEP_S = 1.0
#: A vehicle that rises faster than this (m/s) leaves the bottom.
RISES_MPS = 0.02
#: A vehicle with its pump out that sinks by so much (m) is too heavy for it. Where it leaks, has
#: been found too heavy before or sinks from the surface it only grows heavier: its weight goes.
SUNK_M = 3.0
#: The depth by which it sinks, or stays where it is, is averaged over this time (s).
MEAN_S = 10.0
#: A depth that changes by no more than this (m), or than this share of the way down by pump and
#: pitch, rests.
AT_REST_M, AT_REST_SHARE = 1.0, 0.25
#: One that is asked down goes farther than this many times the same depth down, or up, or hangs:
#: it may swing, and one that has no weight to go on is led out of a stall again and again.
DEEPER, HIGHER = 4.0, 24.0
#: For longer than this (s) the depth lags behind the vertical rate before it is reported.
LAG_S = 10.0
#: The past of the lag fades with this time (s).
LAG_FADES_S = 150.0
#: An attitude that is off by so much (rad) shows way over ground as way up or down.
TILT = 0.1


class DepthLimits(NamedTuple):
    """What is too deep, too long and too still."""

    rated: float  #: (m); infinite if nobody says
    margin: float  #: sinking on to deeper than rated by this is too deep whatever is commanded (m)
    crush: float  #: (m); infinite if nobody says
    drop_margin: float  #: sinking on to nearer than this to it is deep enough for the weight (m)
    overdepth_share: float  #: of the deepest target
    overdepth_m: float
    overdepth_s: float
    altitude_min_m: float  #: least height over the bottom
    altitude_s: float
    climb_progress_m: float  #: upward, in a climb
    no_climb_s: float
    drop_after_s: float
    drop_blind_s: float  #: the same where no depth is to be trusted
    climb_mps: float  #: slowest way up
    led_m: float  #: by pump and pitch, where the depth stays the same
    stalled_m: float
    stalled_s: float
    stall_mean_s: float  #: the depth is averaged over this, so that noise is no motion
    under_water_s: float  #: infinite: never too long
    lag_m: float
    lag_share: float  #: of the way that the vertical rate says
    still_s: float
    jump_m: float  #: a depth that has gone farther in a tick was set anew
    disagree_m: float
    disagree_s: float


class Depths(NamedTuple):
    """What is watched of the depth, between two ticks."""

    depth: float  #: that is trusted (m)
    target: float  #: deepest that was asked for so far (m)
    deep_s: float  #: time for which the vehicle has been too deep
    crush_s: float  #: deeper than its hull may bear, or about to be
    over_s: float  #: deeper than it was sent
    bottom_s: float  #: for which the bottom has been too close
    mark: float  #: depth from which progress upward is counted (m)
    climbs_s: float  #: time without progress while rising is commanded
    mean: float  #: depth, averaged (m)
    near: float  #: the same, averaged over `DepthLimits.stall_mean_s` (m)
    top: float  #: the least that this has been while it stayed the same (m)
    bottom: float  #: and the most
    stalled_s: float
    hangs: float  #: depth near which it may hang while it is asked down (m)
    hangs_s: float
    rest: float  #: depth at which it may be at rest (m)
    led_m: float  #: way by pump and pitch meanwhile (m, + down)
    up_s: float  #: time under water since it surfaces for good
    up_from: float  #: depth at which that began (m)
    least: float  #: the least mean since the pump has done what it can (m)
    under_s: float  #: time under water
    lag_m: float  #: of the measured depth behind the vertical rate
    gone_m: float  #: by the vertical rate, up or down, of late, and by what an attitude may be off
    astray_m: float  #: of the measured depth beside the way by pump and pitch
    lag_s: float  #: for which it has lagged too much
    still_s: float  #: for which nothing measured has changed
    apart_s: float  #: for which two measured depths have differed


INITIAL_DEPTHS = Depths(*(27 * (0.0,)))


class Sounding(NamedTuple):
    """What a tick tells of the depth."""

    odom: float  #: by odom (m)
    before: float  #: the same a tick before
    odom_rate: float  #: vertical rate of odom (m/s, + down)
    odom_speed: float  #: over ground, level (m/s)
    depth: float  #: that is trusted (m)
    rate: float  #: vertical rate that is trusted (m/s, + down)
    apart_m: float  #: between pressure and odom (m)
    is_same: bool  #: odom is what it was a tick before
    target: float  #: that guidance asks for (m)
    stop: float  #: way that it sinks on if it is stopped now (m)
    drop_way: float  #: the same if its weight is let go where the pump does not do (m)
    led: float  #: vertical rate by pump and pitch, where they make a glide (m/s, + down)
    sure: float  #: share of that which is left if what climbs showed as weight is drag
    altitude: float  #: height over the bottom (m); 0.0: no echo
    is_sent_up: bool  #: the last command makes it lighter than its file says it is, or than it is
    ascends: bool  #: and than both where it is asked up, or as light as can be
    surfaces: bool  #: for good
    is_pumped: bool  #: the pump has done what it can
    is_out: bool  #: the antenna, of the water
    is_afloat: bool  #: for certain


@kernel
def _count(holds, time_s, dt):
    """Time (s) for which something has held."""
    return time_s + dt if holds else 0.0


@kernel
def _lag(lag_m, rate, at, jump_m, dt):
    """Lag (m) of the depth behind a vertical rate (m/s); one that is set anew has none."""
    fallen = at.odom - at.before
    if abs(fallen) > jump_m or at.is_out:
        return 0.0
    return lag_m + dt * (rate - lag_m / LAG_FADES_S) - fallen


@kernel
def sinking_rate(state):
    """Vertical rate (m/s, + down) of the mean depth.

    That of odom may be noise, and where an attitude is off it shows way over ground as way down.
    """
    return (state.depth - state.mean) / MEAN_S


@kernel
def begin_at(depth):
    """Nothing has lasted yet, at a depth (m)."""
    return replace(
        INITIAL_DEPTHS,
        depth=depth,
        target=depth,
        mark=depth,
        mean=depth,
        near=depth,
        top=depth,
        bottom=depth,
        hangs=depth,
        rest=depth,
        up_from=depth,
        least=depth,
    )


@kernel
def sound(state: Depths, at: Sounding, limits: DepthLimits, dt: float) -> Depths:
    """Take in the depth of a tick."""
    depth = at.depth
    target = max(state.target, at.target)
    under = depth > SURFACE_M
    sinks_to = depth + at.stop - limits.margin
    deepest = sinks_to if at.is_sent_up else max(depth, sinks_to)
    crushed = depth > limits.crush
    if at.surfaces and at.rate > RISES_MPS:
        crushed = crushed or depth + at.drop_way > limits.crush - limits.drop_margin
    over = max(limits.overdepth_m, limits.overdepth_share * target)
    lag_m = _lag(state.lag_m, at.odom_rate, at, limits.jump_m, dt)
    astray_m = _lag(state.astray_m, at.led, at, limits.jump_m, dt)
    going = abs(at.odom_rate) + TILT * at.odom_speed
    gone_m = state.gone_m + dt * (going - state.gone_m / LAG_FADES_S)
    # where pump and pitch led it to this depth, it is the vertical rate that is wrong
    is_led = at.led != 0.0 and abs(astray_m) < 0.5 * abs(astray_m - lag_m)
    lags = not is_led and abs(lag_m) > max(limits.lag_m, limits.lag_share * gone_m)
    climbs = at.ascends or at.surfaces
    mark = max(state.mark, depth) if climbs and under else depth
    progress = mark - depth >= limits.climb_progress_m
    if progress:
        mark = depth
    mean, before = state.mean + dt / MEAN_S * (depth - state.mean), state.least
    dives = under and at.target > depth and not at.surfaces
    gone = (depth - state.hangs) / limits.stalled_m
    is_held = dives and -HIGHER < gone < DEEPER
    hangs = state.hangs if is_held else depth
    near = state.near + dt / limits.stall_mean_s * (depth - state.near)
    if abs(depth - state.depth) > limits.jump_m:  # it was set anew
        mean, near, before = depth, depth, depth
    top, bottom = min(state.top, near), max(state.bottom, near)
    # by the average: noise shows the surface to one that hangs a few metres below it
    is_stalled = near > SURFACE_M and bottom - top < limits.stalled_m
    if not is_stalled:
        top, bottom = near, near
    is_counted = at.surfaces and at.is_pumped and not at.is_out
    least = min(before, mean) if is_counted else mean
    at_rest_m = max(AT_REST_M, AT_REST_SHARE * at.sure * state.led_m)
    is_gone = at.is_out or under != (state.rest > SURFACE_M) or abs(depth - state.rest) > at_rest_m
    rest, led_m = (depth, 0.0) if is_gone else (state.rest, state.led_m + dt * at.led)
    if not under:  # nothing leads it up from there
        led_m = max(0.0, led_m)
    waits_up = at.surfaces and not at.is_afloat
    up_from = state.up_from if waits_up and state.up_s > 0.0 else depth
    is_near = 0.0 < at.altitude < limits.altitude_min_m and at.rate > -RISES_MPS
    no_way_up, is_still = climbs and under and not progress, under and at.is_same
    return Depths(
        depth=depth,
        target=target,
        deep_s=_count(deepest > limits.rated, state.deep_s, dt),
        crush_s=_count(crushed, state.crush_s, dt),
        over_s=_count(depth > target + over, state.over_s, dt),
        bottom_s=_count(is_near, state.bottom_s, dt),
        mark=mark,
        climbs_s=_count(no_way_up, state.climbs_s, dt),
        mean=mean,
        near=near,
        top=top,
        bottom=bottom,
        stalled_s=_count(is_stalled, state.stalled_s, dt),
        hangs=hangs,
        hangs_s=_count(is_held, state.hangs_s, dt),
        rest=rest,
        led_m=led_m,
        up_s=_count(waits_up, state.up_s, dt),
        up_from=up_from,
        least=least,
        under_s=_count(under, state.under_s, dt),
        lag_m=lag_m,
        gone_m=gone_m,
        astray_m=astray_m,
        lag_s=_count(lags, state.lag_s, dt),
        still_s=_count(is_still, state.still_s, dt),
        apart_s=_count(at.apart_m > limits.disagree_m, state.apart_s, dt),
    )


@kernel
def late_s(drop_s, depth, limits):
    """When who comes up from a depth (m) is late (s), ``drop_s`` beside the time of the way."""
    return drop_s + depth / limits.climb_mps


@kernel
def _weight_goes(state, sees, floods, limits):
    """Whether a vehicle that surfaces for good does not, and never will, without its weight."""
    drop_s = limits.drop_after_s if sees else limits.drop_blind_s
    is_late = state.up_s > late_s(drop_s, state.up_from, limits)
    sinks = sees and state.mean - state.least > SUNK_M
    is_flooded = sinks and (floods or state.least < SURFACE_M)
    is_flooded = is_flooded or (floods and not sees and state.up_s > 0.0)
    return state.climbs_s > limits.drop_after_s or is_late or is_flooded


@kernel
def depth_rows(state, surfaces, sees, floods, limits):
    """Rows that hold for a vehicle that is to surface for good, sees its depth, floods, or not."""
    reported = row(rows.TOO_DEEP, state.deep_s > TOO_DEEP_S)
    reported |= row(rows.CRUSHING, state.crush_s > TOO_DEEP_S)
    reported |= row(rows.OVERDEPTH, state.over_s > limits.overdepth_s)
    reported |= row(rows.NEAR_BOTTOM, state.bottom_s > limits.altitude_s)
    reported |= row(rows.NOT_CLIMBING, state.climbs_s > limits.no_climb_s)
    reported |= row(rows.NOT_RISING, surfaces and _weight_goes(state, sees, floods, limits))
    reported |= row(rows.STALLED, max(state.stalled_s, state.hangs_s) > limits.stalled_s)
    reported |= row(rows.UNDER_LONG, state.under_s > limits.under_water_s)
    reported |= row(rows.FROZEN, state.lag_s > LAG_S or state.still_s > limits.still_s)
    reported |= row(rows.FROZEN, not surfaces and abs(state.led_m) > limits.led_m)
    return reported | row(rows.DISAGREES, state.apart_s > limits.disagree_s)
