# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""The yo: a state machine over its stages, and what each stage asks for."""

import math
from typing import Literal, NamedTuple

from pydantic import Field

from glider_base.kernel import kernel, replace
from glider_base.settings import Settings, derived, number, positive
from glider_base.signals import TICK_S
from glider_base.wiring import NO_ECHO
from glider_guidance.yo.end_of_path import WayLeft, lower_turn, next_dive
from glider_guidance.yo.stage import (
    AT_END_OF_PATH,
    AT_SURFACE_M,
    GLIDING_DOWN,
    GLIDING_UP,
    INFLECTING_DOWN,
    INFLECTING_UP,
    SURFACE_PREPARATION,
    SURFACING,
    WAITING_ON_SURFACE,
    is_descending,
)
from glider_guidance.yo.turns import SLOW, turn_lead_m, turn_lead_s
from glider_model.onboard.glide_polar import Polar, glide_vertical_rate

#: Share of the glide's vertical rate at which the pitch goes over in a turn.
PITCH_OVER = 0.5
#: A vehicle that goes so fast (m/s) the new way, or at half of its glide's rate, has turned.
TURNED_MPS = 0.05
#: Largest lead that is used, in leads by the vehicle's file.
LEAD_RANGE = 6.0
#: The flight model holds this long after a glide began (s), or after this share of it.
SETTLED_S, SETTLED_SHARE = 120.0, 0.3
#: A bottom that echoes for longer than this is there, and no fish or bubble.
NEAR_TICKS = round(3.0 / TICK_S)
#: The path is looked at for so many full dives before its end.
DIVES_AHEAD = 4.0


class ProfileSettings(Settings):
    """Sawtooth, or flight along a three-dimensional path."""

    mode: Literal['profile', 'path'] = Field(
        'profile',
        description='profile: sawtooth at fixed pitch over the path; path: full 3-D line of sight',
    )
    depth_m: float = number(1000.0, (10.0, 12000.0), 'depth of the lower turn (m)', tunable=True)
    top_depth_m: float = number(
        10.0, (2.0, 1000.0), 'depth of the upper turn between dives, half of depth_m at most (m)'
    )
    pitch_deg: float = number(
        30.0, (8.0, 60.0), 'glide pitch, nose down diving and up climbing (deg)', tunable=True
    )
    net_heaviness_kg: float = positive(
        0.4, 20.0, 'net buoyancy that sets the speed, - when climbing (kg)'
    )
    climb_pitch_deg: float | None = number(
        None, (8.0, 60.0), 'glide pitch of the climb, if another one (deg)'
    )
    climb_net_heaviness_kg: float | None = positive(
        None, 20.0, 'magnitude for the climb, if another one (kg)'
    )
    clearance_m: float = number(
        0.0,
        (0.0, 80.0),
        'height over the bottom at which a dive is turned, by the altimeter that the vehicle then '
        'has (m); 0.0: none',
    )
    prepare_s: float = number(60.0, (0.0, 86400.0), 'surface preparation before a dive (s)')
    surface_every_dives: int = number(
        0, (0, 100000), 'dives between waits on the surface; 0: after the last'
    )
    wait_s: float = number(
        600.0, (0.0, 864000.0), 'waiting on the surface between dives (s)', tunable=True
    )

    def params(
        self, dives: int, pump_rate_kgps: float, polar: Polar, holds: bool = False
    ) -> 'ProfileParams':
        """Kernel parameters for so many dives (0: no end) with this pump: turns are led."""
        pitch, heavy = math.radians(self.pitch_deg), self.net_heaviness_kg
        climb_pitch = pitch if self.climb_pitch_deg is None else math.radians(self.climb_pitch_deg)
        light = heavy if self.climb_net_heaviness_kg is None else self.climb_net_heaviness_kg
        dive_rate = glide_vertical_rate(-pitch, heavy, polar)
        climb_rate = -glide_vertical_rate(climb_pitch, -light, polar)
        if (climb_pitch, light) == (pitch, heavy):
            climb_rate = dive_rate
        rate = dive_rate
        if climb_rate != dive_rate:  # one that takes as long down and up as the two do
            rate = 2.0 * dive_rate * climb_rate / (dive_rate + climb_rate)
        top_depth = min(self.top_depth_m, 0.5 * self.depth_m)
        return derived(
            ProfileParams,
            self,
            follows_path=self.mode == 'path',
            top_depth=top_depth,
            climb_pitch=climb_pitch,
            climb_net_heaviness=light,
            dive_rate=dive_rate,
            climb_rate=climb_rate,
            glide_rate=rate,
            dives=dives,
            surface_every=self.surface_every_dives,
            prepare_ticks=round(self.prepare_s / TICK_S),
            wait_ticks=round(self.wait_s / TICK_S),
            holds=holds,
            settled_s=min(SETTLED_S, SETTLED_SHARE * (self.depth_m - top_depth) / rate),
            lead_s=2.0
            / 3.0
            * (heavy if light == heavy else 0.5 * (heavy + light))
            / pump_rate_kgps,
        )


class ProfileParams(NamedTuple):
    """Profile as the kernels see it."""

    follows_path: bool
    depth: float  #: lower turn (m)
    top_depth: float  #: upper turn (m)
    pitch: float  #: of the dive, magnitude (rad)
    climb_pitch: float
    net_heaviness: float  #: of the dive, magnitude (kg)
    climb_net_heaviness: float
    dive_rate: float  #: vertical rates of the steady glides, by the polar, magnitudes (m/s)
    climb_rate: float
    glide_rate: float  #: down and up again over the time that both take (m/s)
    clearance: float  #: over the bottom (m); 0: none
    dives: int  #: 0: no end
    surface_every: int  #: dives between waits on the surface; 0: after the last
    prepare_ticks: int
    wait_ticks: int
    settled_s: float  #: the flight model holds this long after a glide began (s)
    lead_s: float  #: way left once the pump starts, over the speed, by the file's pump (s)
    holds: bool  #: comes up, and waits at the surface


@kernel
def surfacing_every_dive(params):
    """The same profile with a wait on the surface after every dive."""
    return replace(params, surface_every=1)


class ProfileState(NamedTuple):
    """Stage of the yo."""

    stage: int = SURFACE_PREPARATION
    ticks: int = 0  #: ticks in this stage
    near_ticks: int = 0  #: for which the bottom has echoed too near for this dive
    dives: int = 0  #: dives completed
    aborted: bool = False
    lead_up_s: float = 0.0  #: lead of the turn at depth, as learnt from the last; 0: none yet (s)
    lead_down_s: float = 0.0  #: lead of the upper turn
    #: Planned lower turn of this dive, or of the next; 0: none is to come (m).
    turn_depth: float = math.inf
    depth: float = math.inf  #: of a dive, when that was planned (m)
    begun: int = 0  #: dives before those of the path that began at the end of the one before
    is_cut: bool = False  #: a hold has ended this dive on its way down: it counts as none


#: Of a mission that does not end with its path.
NO_END = WayLeft(math.inf, 0.0)


@kernel
def _planned_turn(state, depth, left, params):
    """Lower turn (m) of this dive as it was planned, or of the next as it would be now."""
    stage = state.stage
    lead_s, dives = turn_lead_s(state, params), state.dives
    if stage == GLIDING_UP:
        return next_dive(left, depth, depth < AT_SURFACE_M, lead_s, dives + 1, False, params)
    if stage == SURFACE_PREPARATION or stage == WAITING_ON_SURFACE:
        return next_dive(left, depth, True, lead_s, dives, dives == state.begun, params)
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
    full = params.dive_rate if is_descending(stage) else params.climb_rate
    is_first = state.lead_up_s == 0.0 and state.lead_down_s == 0.0
    # one that goes the other way as yet, or lies at the surface, is not led into a turn
    rate = max(0.0, vertical_rate if is_descending(stage) else -vertical_rate)
    rate = 0.0 if depth < AT_SURFACE_M else rate
    lead = turn_lead_m(rate, full, turn_lead_s(state, params), is_first)
    if state.aborted:
        return WAITING_ON_SURFACE if depth < AT_SURFACE_M else SURFACING
    if params.holds and depth < AT_SURFACE_M:
        return WAITING_ON_SURFACE
    if params.holds and is_descending(stage):
        return INFLECTING_UP
    is_over = turn_depth <= 0.0
    if stage == SURFACE_PREPARATION and is_over:
        return AT_END_OF_PATH
    if stage == SURFACE_PREPARATION and state.ticks >= params.prepare_ticks:
        return GLIDING_DOWN
    if stage == GLIDING_DOWN and depth + lead >= turn_depth:
        return INFLECTING_UP
    rises = vertical_rate < -min(TURNED_MPS, SLOW * params.climb_rate)
    if stage == INFLECTING_UP and (rises or depth < AT_SURFACE_M):
        return GLIDING_UP
    if stage == GLIDING_UP and not params.holds:
        done = state.dives + 1
        last = params.dives > 0 and done >= params.dives
        if is_over:
            return AT_END_OF_PATH if depth < AT_SURFACE_M else GLIDING_UP
        if last or (params.surface_every > 0 and done % params.surface_every == 0):
            return WAITING_ON_SURFACE if depth < AT_SURFACE_M else GLIDING_UP
        return INFLECTING_DOWN if depth - lead <= params.top_depth else GLIDING_UP
    # one that never reaches its rate turns where it was sent all the same
    if stage == INFLECTING_DOWN and vertical_rate > 0.0 and depth + lead >= turn_depth:
        return INFLECTING_UP
    # a vehicle that came up to the surface bobs there before it sinks
    sinks = vertical_rate > min(TURNED_MPS, SLOW * params.dive_rate)
    if stage == INFLECTING_DOWN and sinks and depth > 2.0 * AT_SURFACE_M:
        return GLIDING_DOWN
    finished = params.dives > 0 and state.dives >= params.dives
    if stage == WAITING_ON_SURFACE and state.ticks >= params.wait_ticks and not finished:
        return SURFACE_PREPARATION
    return stage


@kernel
def _near_ticks(state, vertical_rate, altitude, params):
    """Ticks for which a dive has been so near to the bottom that it is to turn."""
    if params.clearance == 0.0 or altitude <= NO_ECHO or not is_descending(state.stage):
        return 0
    # what was learnt may be of a turn with little weight
    lead_s = max(params.lead_s, turn_lead_s(state, params)) + NEAR_TICKS * TICK_S
    is_near = altitude < params.clearance + max(0.0, vertical_rate) * lead_s
    return state.near_ticks + 1 if is_near else 0


@kernel
def profile_step(
    state: ProfileState,
    depth: float,
    vertical_rate: float,
    altitude: float,
    left: WayLeft,
    params: ProfileParams,
) -> ProfileState:
    """Advance the stage by one tick.

    Measured are depth (m), vertical rate (m/s, + down) and height over the bottom (m, 0.0 where
    there is no echo). ``left`` of the path is `NO_END` if the mission does not end with it.
    """
    if state.depth != params.depth and is_descending(state.stage):  # another one since it began
        state = replace(state, turn_depth=params.depth)
    near_ticks = _near_ticks(state, vertical_rate, altitude, params)
    planned = _planned_turn(state, depth, left, params)
    turn_depth = coming_turn(state, depth, left, params)
    if near_ticks > NEAR_TICKS:
        turn_depth = min(turn_depth, depth)
    stage = _next_stage(state, depth, vertical_rate, turn_depth, params)
    up_s, down_s = state.lead_up_s, state.lead_down_s
    if stage == state.stage:
        # the rate falls as the root of the weight: to PITCH_OVER after 1 - PITCH_OVER^2 of the
        # pump's time to neutral, two thirds of which are lost
        took_s = 2.0 / 3.0 * state.ticks * TICK_S / (1.0 - PITCH_OVER * PITCH_OVER)
        took_s = min(LEAD_RANGE * params.lead_s, took_s)
        if stage == INFLECTING_UP and vertical_rate > PITCH_OVER * params.dive_rate:
            up_s = took_s
        elif stage == INFLECTING_DOWN and vertical_rate < -PITCH_OVER * params.climb_rate:
            down_s = took_s
        return replace(
            state,
            ticks=state.ticks + 1,
            near_ticks=near_ticks,
            lead_up_s=up_s,
            lead_down_s=down_s,
            turn_depth=planned,
            depth=params.depth,
        )
    is_cut = params.holds if is_descending(state.stage) else state.is_cut
    is_at_once = state.stage == INFLECTING_UP and stage == WAITING_ON_SURFACE
    climbed = state.stage == GLIDING_UP or is_at_once
    return replace(
        state,
        stage=stage,
        ticks=0,
        near_ticks=0,
        dives=state.dives + (climbed and not is_cut and not state.aborted),
        is_cut=is_cut,
        turn_depth=planned,
        depth=params.depth,
    )


@kernel
def heaviness_of(pitch, params):
    """Magnitude of the net heaviness (kg) of a dive, at a pitch (rad) below 0, or of a climb."""
    return params.net_heaviness if pitch < 0.0 else params.climb_net_heaviness


@kernel
def profile_targets(stage, vertical_rate, params):
    """Pitch (rad) and vertical rate (m/s, + down) that a stage asks for.

    In a turn the pump needs minutes, the pitch half a minute. Pitched over at once, a vehicle
    that is still heavy glides backwards; so the pitch goes over when the vertical rate has fallen
    to ``PITCH_OVER`` of the glide's. In preparation the nose is already turned down while the
    buoyancy keeps the vehicle up.
    """
    down = is_descending(stage)
    nose_down = down or stage == SURFACE_PREPARATION
    if stage == INFLECTING_UP:
        nose_down = vertical_rate > PITCH_OVER * params.dive_rate
    elif stage == INFLECTING_DOWN:
        nose_down = vertical_rate > -PITCH_OVER * params.climb_rate
    pitch = -params.pitch if nose_down else params.climb_pitch
    return pitch, params.dive_rate if down else -params.climb_rate


def mission_time_s(params: ProfileParams, dives: int) -> float:
    """Estimated time (s) of so many dives, from surface preparation to surfacing."""
    legs = 2.0 * dives * params.depth / params.glide_rate
    return params.prepare_ticks * TICK_S + legs + 2.0 * dives * params.lead_s
