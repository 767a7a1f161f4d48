# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""The yo: a state machine over the paper's four stages and the inflections between them."""

import math
from typing import Literal, NamedTuple

from pydantic import Field

from glider_guidance.yo.end_of_path import WayLeft, lower_turn, next_dive
from glider_model.base.kernel import kernel
from glider_model.base.settings import Settings
from glider_model.base.signals import TICK_S
from glider_model.onboard.glide_polar import Polar, glide_vertical_rate

SURFACE_PREPARATION = 0
GLIDING_DOWN = 1
INFLECTING_UP = 2
GLIDING_UP = 3
INFLECTING_DOWN = 4
WAITING_ON_SURFACE = 5
SURFACING = 6
AT_END_OF_PATH = 7

STAGE_NAMES = (
    'surface preparation',
    'gliding down',
    'inflecting up',
    'gliding up',
    'inflecting down',
    'waiting on the surface',
    'surfacing on abort',
    'at the end of the path',
)

#: Shallower than this the vehicle has reached the surface (m).
AT_SURFACE_M = 1.0
#: Share of the glide's vertical rate at which the pitch goes over in a turn.
PITCH_OVER = 0.5
#: Largest lead that is believed, in leads by the vehicle's file.
LEAD_RANGE = 6.0
#: The path is looked at for so many full dives before its end.
DIVES_AHEAD = 4.0
#: The desired track is led between these times before a turn, and comes back in this time (s).
LEAD_FROM_S, LEAD_TO_S, RETURN_S = 400.0, 150.0, 240.0


class ProfileSettings(Settings):
    """Sawtooth, or flight along a three-dimensional path."""

    mode: Literal['profile', 'path'] = Field(
        'profile',
        description='profile: sawtooth at fixed pitch over the path; path: full 3-D line of sight',
    )
    depth_m: float = Field(1000.0, ge=10.0, le=12000.0, description='depth of the lower turn (m)')
    top_depth_m: float = Field(
        10.0, ge=2.0, le=1000.0, description='depth of the upper turn between dives (m)'
    )
    pitch_deg: float = Field(
        30.0, ge=13.0, le=60.0, description='glide pitch, nose down diving and up climbing (deg)'
    )
    net_heaviness_kg: float = Field(
        0.4,
        gt=0.0,
        le=20.0,
        description='net heaviness that sets the speed, - when climbing (kg)',
    )
    prepare_s: float = Field(
        60.0, ge=0.0, le=86400.0, description='surface preparation before a dive (s)'
    )
    surface_every_dives: int = Field(
        0, ge=0, le=100000, description='dives between waits on the surface; 0: after the last'
    )
    wait_s: float = Field(
        600.0, ge=0.0, le=864000.0, description='waiting on the surface between dives (s)'
    )

    def params(self, dives: int, pump_rate_kgps: float, polar: Polar) -> 'ProfileParams':
        """Kernel parameters for so many dives (0: no end) with this pump: turns are led."""
        pitch = math.radians(self.pitch_deg)
        return ProfileParams(
            self.mode == 'path',
            self.depth_m,
            min(self.top_depth_m, 0.5 * self.depth_m),
            pitch,
            self.net_heaviness_kg,
            glide_vertical_rate(-pitch, self.net_heaviness_kg, polar),
            dives,
            self.surface_every_dives,
            round(self.prepare_s / TICK_S),
            round(self.wait_s / TICK_S),
            2.0 / 3.0 * self.net_heaviness_kg / pump_rate_kgps,
        )


class ProfileParams(NamedTuple):
    """Profile as the kernels see it."""

    follows_path: bool
    depth: float  #: lower turn (m)
    top_depth: float  #: upper turn (m)
    pitch: float  #: magnitude (rad)
    net_heaviness: float  #: magnitude (kg)
    glide_rate: float  #: vertical rate of the steady glide, by the polar, magnitude (m/s)
    dives: int  #: 0: no end
    surface_every: int  #: dives between waits on the surface; 0: after the last
    prepare_ticks: int
    wait_ticks: int
    lead_s: float  #: way left once the pump starts, over the speed, by the file's pump (s)


class ProfileState(NamedTuple):
    """Stage of the yo."""

    stage: int
    ticks: int  #: ticks in this stage
    dives: int  #: dives completed
    aborted: bool
    lead_up_s: float  #: lead of the turn at depth, as learnt from the last one; 0: none yet (s)
    lead_down_s: float  #: lead of the upper turn
    turn_depth: float  #: planned lower turn of this dive, or of the next; 0: none is to come (m)


INITIAL_PROFILE = ProfileState(SURFACE_PREPARATION, 0, 0, False, 0.0, 0.0, math.inf)
#: Of a mission that does not end with its path.
NO_END = WayLeft(math.inf, 0.0)


@kernel
def _planned_turn(state, depth, left, params):
    """Lower turn (m) of this dive as it was planned, or of the next as it would be now."""
    stage = state.stage
    if stage == GLIDING_UP:
        return next_dive(
            left, depth, depth < AT_SURFACE_M, turn_lead_s(state, params), state.dives + 1, params
        )
    if stage == SURFACE_PREPARATION or stage == WAITING_ON_SURFACE:
        return next_dive(left, depth, True, turn_lead_s(state, params), state.dives, params)
    return state.turn_depth


@kernel
def coming_turn(state, depth, left, params):
    """Depth of the lower turn to come (m); 0.0 if no dive is to come."""
    if state.stage == GLIDING_DOWN:
        return lower_turn(state.turn_depth, left, depth, turn_lead_s(state, params), params)
    return state.turn_depth


@kernel
def look_ahead_s(params):
    """Time of straight glide (s) for which the rest of the path is looked at."""
    return DIVES_AHEAD * 2.0 * (params.depth / params.glide_rate + LEAD_RANGE * params.lead_s)


@kernel
def _next_stage(state, depth, vertical_rate, turn_depth, params):
    """Stage that follows from where the vehicle is; ``turn_depth`` is that of `coming_turn`."""
    stage = state.stage
    lead = abs(vertical_rate) * turn_lead_s(state, params)
    if state.aborted:
        return WAITING_ON_SURFACE if depth < AT_SURFACE_M else SURFACING
    is_over = turn_depth <= 0.0
    if stage == SURFACE_PREPARATION and is_over:
        return AT_END_OF_PATH
    if stage == SURFACE_PREPARATION and state.ticks >= params.prepare_ticks:
        return GLIDING_DOWN
    if stage == GLIDING_DOWN and depth + lead >= turn_depth:
        return INFLECTING_UP
    if stage == INFLECTING_UP and vertical_rate < -0.05:
        return GLIDING_UP
    if stage == GLIDING_UP:
        done = state.dives + 1
        last = params.dives > 0 and done >= params.dives
        if is_over:
            return AT_END_OF_PATH if depth < AT_SURFACE_M else GLIDING_UP
        if last or (params.surface_every > 0 and done % params.surface_every == 0):
            return WAITING_ON_SURFACE if depth < AT_SURFACE_M else GLIDING_UP
        return INFLECTING_DOWN if depth - lead <= params.top_depth else GLIDING_UP
    # a vehicle that came up to the surface bobs there before it sinks
    if stage == INFLECTING_DOWN and vertical_rate > 0.05 and depth > 2.0 * AT_SURFACE_M:
        return GLIDING_DOWN
    finished = params.dives > 0 and state.dives >= params.dives
    if stage == WAITING_ON_SURFACE and state.ticks >= params.wait_ticks and not finished:
        return SURFACE_PREPARATION
    return stage


@kernel
def profile_step(state, depth, vertical_rate, left, params):
    """Advance the stage by one tick.

    Parameters
    ----------
    state : ProfileState
    depth, vertical_rate : float
        Measured (m, m/s, + down).
    left : WayLeft
        What is left of the path; ``NO_END`` if the mission does not end with it.
    params : ProfileParams
    """
    planned = _planned_turn(state, depth, left, params)
    turn_depth = coming_turn(state, depth, left, params)
    stage = _next_stage(state, depth, vertical_rate, turn_depth, params)
    up_s, down_s = state.lead_up_s, state.lead_down_s
    if stage == state.stage:
        # the rate falls as the root of the weight: to PITCH_OVER after 1 - PITCH_OVER^2 of the
        # pump's time to neutral, two thirds of which are lost
        took_s = 2.0 / 3.0 * state.ticks * TICK_S / (1.0 - PITCH_OVER * PITCH_OVER)
        took_s = min(LEAD_RANGE * params.lead_s, took_s)
        if stage == INFLECTING_UP and vertical_rate > PITCH_OVER * params.glide_rate:
            up_s = took_s
        elif stage == INFLECTING_DOWN and vertical_rate < -PITCH_OVER * params.glide_rate:
            down_s = took_s
        return ProfileState(
            stage, state.ticks + 1, state.dives, state.aborted, up_s, down_s, planned
        )
    climbed = state.stage == GLIDING_UP and not state.aborted
    dives = state.dives + (1 if climbed else 0)
    return ProfileState(stage, 0, dives, state.aborted, up_s, down_s, planned)


@kernel
def turn_lead_s(state, params):
    """Time (s) by which the coming turn is led: a turn costs the way of so much straight glide.

    The first turn goes by the pump of the vehicle's file, later ones by how long the last one, if
    there was one of the same kind, took, so that a slow pump or a wrong ballast is led too.
    """
    same_s, other_s = state.lead_down_s, state.lead_up_s
    if is_descending(state.stage):
        same_s, other_s = other_s, same_s
    if same_s > 0.0:
        return same_s
    return other_s if other_s > 0.0 else params.lead_s


@kernel
def is_descending(stage):
    """Whether a stage asks the vehicle to go down."""
    return stage == GLIDING_DOWN or stage == INFLECTING_DOWN


@kernel
def is_gliding(stage):
    """Whether a stage is a steady glide, not a turn or the surface."""
    return stage == GLIDING_DOWN or stage == GLIDING_UP


@kernel
def profile_targets(stage, vertical_rate, params):
    """Pitch (rad) and vertical rate (m/s, + down) that a stage asks for.

    In a turn the pump needs minutes, the pitch half a minute. Pitched over at once, a vehicle
    that is still heavy glides backwards; so the pitch goes over when the vertical rate has fallen
    to ``PITCH_OVER`` of the glide's. In preparation the nose is already turned down while the
    buoyancy keeps the vehicle up.
    """
    rate = params.glide_rate
    down = is_descending(stage)
    nose_down = down or stage == SURFACE_PREPARATION
    if stage == INFLECTING_UP:
        nose_down = vertical_rate > PITCH_OVER * rate
    elif stage == INFLECTING_DOWN:
        nose_down = vertical_rate > -PITCH_OVER * rate
    return -params.pitch if nose_down else params.pitch, rate if down else -rate


def mission_time_s(params: ProfileParams, dives: int) -> float:
    """Estimated time (s) of so many dives, from surface preparation to surfacing."""
    legs = 2.0 * dives * params.depth / params.glide_rate
    return params.prepare_ticks * TICK_S + legs + 2.0 * dives * params.lead_s


@kernel
def time_to_turn(state, depth, vertical_rate, turn_depth, params):
    """Time (s) until the pump starts for the next turn; infinite where none is to come.

    ``turn_depth`` is that of `coming_turn`.
    """
    rate = max(abs(vertical_rate), 0.01)
    if state.stage == GLIDING_DOWN:
        return (turn_depth - depth) / rate - turn_lead_s(state, params)
    done = state.dives + 1
    surfacing = (params.dives > 0 and done >= params.dives) or (
        params.surface_every > 0 and done % params.surface_every == 0
    )
    if state.stage == GLIDING_UP and not surfacing and turn_depth > 0.0:
        return (depth - params.top_depth) / rate - turn_lead_s(state, params)
    return math.inf


@kernel
def _smooth(share):
    """Smooth step from 0 to 1."""
    x = min(1.0, max(0.0, share))
    return x * x * (3.0 - 2.0 * x)


@kernel
def turn_offset(to_turn_s, since_turn_s, coming, past):
    """Offset (m) of the desired track that shares a turn's drift between before and after.

    In a turn the vehicle is slow and the current takes it along by a drift that is known
    beforehand. The desired track therefore moves up-current by the ``coming`` drift (m) before the
    turn, and from the ``past`` drift back to zero after it: of either, the part that this phase
    bears.
    """
    before = _smooth((LEAD_FROM_S - to_turn_s) / (LEAD_FROM_S - LEAD_TO_S))
    after = 1.0 - _smooth(since_turn_s / RETURN_S)
    return past * after - coming * before
