# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""What depth and time under water tell: too deep, no way up, standing still, frozen."""

from typing import NamedTuple

from glider_guard.rows import (
    CRUSHING,
    DISAGREES,
    FROZEN,
    NEAR_BOTTOM,
    NOT_CLIMBING,
    NOT_RISING,
    OVERDEPTH,
    STALLED,
    TOO_DEEP,
    UNDER_LONG,
)
from glider_model.base.kernel import kernel

#: Longer than this (s) a vehicle may not be too deep.
TOO_DEEP_S = 1.0
#: A vehicle that rises faster than this (m/s) leaves the bottom.
RISES_MPS = 0.02
#: Above this the vehicle is at the surface, and nothing of this is watched (m).
SURFACE_M = 5.0
#: For longer than this (s) the depth lags behind the vertical rate before it is told.
LAG_S = 10.0
#: The past of the lag fades with this time (s).
LAG_FADES_S = 150.0


class DepthLimits(NamedTuple):
    """What is too deep, too long and too still."""

    rated: float  #: (m); infinite if nobody says
    margin: float  #: sinking on to deeper than rated by this is too deep whatever is commanded (m)
    crush: float  #: (m); infinite if nobody says
    over_share: float  #: of the deepest target
    over_m: float
    over_s: float
    altitude_m: float  #: least height over the bottom
    altitude_s: float
    progress_m: float  #: upward, in a climb
    no_climb_s: float
    drop_after_s: float
    drop_blind_s: float  #: the same where no depth is to be believed
    stalled_m: float
    stalled_s: float
    under_s: float  #: infinite: never too long
    lag_m: float
    lag_share: float  #: of the way that the vertical rate says
    still_s: float
    jump_m: float  #: a depth that has gone farther in a tick was set anew
    disagree_m: float
    disagree_s: float


class Depths(NamedTuple):
    """What is watched of the depth, between two ticks."""

    depth: float  #: the greater of those that are measured (m)
    target: float  #: deepest that was asked for so far (m)
    deep_s: float  #: time for which the vehicle has been too deep
    crush_s: float  #: deeper than its hull may bear
    over_s: float  #: deeper than it was sent
    bottom_s: float  #: for which the bottom has been too close
    mark: float  #: depth from which progress upward is counted (m)
    climbs_s: float  #: time without progress while rising is commanded
    anchor: float  #: depth about which it may be stalled (m)
    stalled_s: float
    under_s: float  #: time under water
    lag_m: float  #: of the measured depth behind the vertical rate
    gone_m: float  #: by the vertical rate, up or down, of late
    lag_s: float  #: for which that has been too much
    still_s: float  #: for which nothing measured has changed
    apart_s: float  #: for which two measured depths have differed


INITIAL_DEPTHS = Depths(*(16 * (0.0,)))


class Sounding(NamedTuple):
    """What a tick tells of the depth."""

    depth: float  #: by odom (m)
    before: float  #: the same a tick before
    rate: float  #: measured vertical rate (m/s, + down)
    own: float  #: by the pressure alone (m)
    is_same: bool  #: odom is what it was a tick before
    target: float  #: that guidance asks for (m)
    stop: float  #: way that it sinks on if it is stopped now (m)
    altitude: float  #: height over the bottom (m); 0.0: no echo


@kernel
def _count(holds, time_s, dt):
    """Time (s) for which something has held."""
    return time_s + dt if holds else 0.0


@kernel
def _lag(lag_m, at, jump_m, dt):
    """Lag (m) of the depth behind the vertical rate; a depth that was set anew has none."""
    fallen = at.depth - at.before
    if abs(fallen) > jump_m:
        return 0.0
    return lag_m + dt * (at.rate - lag_m / LAG_FADES_S) - fallen


@kernel
def begin_at(depth):
    """Nothing has lasted yet, at a depth (m)."""
    return Depths(
        depth, depth, 0.0, 0.0, 0.0, 0.0, depth, 0.0, depth, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    )


@kernel
def sound(state, at, ascends, limits, dt):
    """Take in the depth of a tick.

    Parameters
    ----------
    state : Depths
    at : Sounding
    ascends : bool
        Whether the last command makes the vehicle buoyant.
    limits : DepthLimits
    dt : float

    Returns
    -------
    Depths
    """
    depth = max(at.depth, at.own)
    target = max(state.target, at.target)
    under = depth > SURFACE_M
    sinks_to = depth + at.stop - limits.margin
    deepest = sinks_to if ascends else max(depth, sinks_to)
    over = max(limits.over_m, limits.over_share * target)
    lag_m = _lag(state.lag_m, at, limits.jump_m, dt)
    gone_m = state.gone_m + dt * (abs(at.rate) - state.gone_m / LAG_FADES_S)
    lags = abs(lag_m) > max(limits.lag_m, limits.lag_share * gone_m)
    mark = max(state.mark, depth) if ascends and under else depth
    progress = mark - depth >= limits.progress_m
    if progress:
        mark = depth
    anchor, is_stalled = state.anchor, under and abs(depth - state.anchor) < limits.stalled_m
    if not is_stalled:
        anchor = depth
    return Depths(
        depth,
        target,
        _count(deepest > limits.rated, state.deep_s, dt),
        _count(depth > limits.crush, state.crush_s, dt),
        _count(depth > target + over, state.over_s, dt),
        _count(0.0 < at.altitude < limits.altitude_m and at.rate > -RISES_MPS, state.bottom_s, dt),
        mark,
        _count(ascends and under and not progress, state.climbs_s, dt),
        anchor,
        _count(is_stalled, state.stalled_s, dt),
        _count(under, state.under_s, dt),
        lag_m,
        gone_m,
        _count(lags, state.lag_s, dt),
        _count(under and at.is_same, state.still_s, dt),
        _count(abs(at.own - at.depth) > limits.disagree_m, state.apart_s, dt),
    )


@kernel
def depth_rows(state, surfaces, sees, limits):
    """Rows that hold for a vehicle that is to surface for good, or not, and sees its depth."""
    told = 0
    if state.deep_s > TOO_DEEP_S:
        told |= TOO_DEEP
    if state.crush_s > TOO_DEEP_S:
        told |= CRUSHING
    if state.over_s > limits.over_s:
        told |= OVERDEPTH
    if state.bottom_s > limits.altitude_s:
        told |= NEAR_BOTTOM
    if state.climbs_s > limits.no_climb_s:
        told |= NOT_CLIMBING
    drop_s = limits.drop_after_s if sees else limits.drop_blind_s
    if surfaces and state.climbs_s > drop_s:
        told |= NOT_RISING
    if state.stalled_s > limits.stalled_s:
        told |= STALLED
    if state.under_s > limits.under_s:
        told |= UNDER_LONG
    if state.lag_s > LAG_S or state.still_s > limits.still_s:
        told |= FROZEN
    if state.apart_s > limits.disagree_s:
        told |= DISAGREES
    return told
