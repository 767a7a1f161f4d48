# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""How a mission goes, as a pilot asks for it: what is left, how fast, until when."""

import math
from typing import NamedTuple

from glider_base.signals import TICK_S, Battery
from glider_guidance.guidance import GuidanceParams, GuidanceState, locate
from glider_guidance.orders import is_surfaced
from glider_guidance.path.curve import path_piece
from glider_guidance.yo.end_of_path import way_left
from glider_guidance.yo.machine import ProfileParams, ProfileState
from glider_guidance.yo.stage import STAGE_NAMES, is_descending


class Status(NamedTuple):
    """How a mission goes. What nobody knows, or never comes, is infinite."""

    t_s: float  #: time since the start (s)
    stage: str
    leg: int  #: of the path, from 1 on
    legs: int
    to_go_m: float  #: way along the path that is left (m)
    eta_s: float  #: time to its end, turns and stays included, in the estimated current (s)
    speed_mps: float  #: horizontal, over ground (m/s)
    current_north_mps: float  #: that guidance estimates (m/s)
    current_east_mps: float
    next_surfacing_s: float  #: time to it (s); 0.0 at the surface
    dives: int  #: completed
    energy_left_wh: float  #: what the battery says is left (Wh)


def status_of(state: GuidanceState, params: GuidanceParams, battery: Battery) -> Status:
    """How a mission goes, by guidance after a tick, and what the battery said in it."""
    path, profile = params.path, params.profile
    place = locate(state.s, state.gate.odometry, params)
    piece, s = path_piece(state.s, path)
    share = (s - path.knots[piece]) / (path.knots[piece + 1] - path.knots[piece])
    way_m = path.ways[piece] + share * (path.ways[piece + 1] - path.ways[piece])
    current = state.water.observer
    stay_s = TICK_S * (profile.wait_ticks + profile.prepare_ticks)
    dive_s, turns_s = _dive_s(profile), 2.0 * profile.lead_s
    share = (dive_s - turns_s) / (dive_s + stay_s / (profile.surface_every or math.inf))
    stays = profile.holds or state.profile.aborted
    # in turns and stays the current acts on
    left = way_left(
        *(s, place.error.e1, share * params.profile_speed),
        *(current.current_n, current.current_e, math.inf, path),
    )
    is_measured = battery.voltage >= 0.0 and battery.charge >= 0.0
    return Status(
        t_s=state.tick * TICK_S,
        stage=STAGE_NAMES[state.profile.stage],
        leg=piece + 1,
        legs=len(path.knots) - 1,
        to_go_m=float(path.ways[-1] - way_m) - place.error.e1,
        eta_s=math.inf if stays else float(left.glide_s),
        speed_mps=math.hypot(place.ground_n, place.ground_e),
        current_north_mps=current.current_n,
        current_east_mps=current.current_e,
        next_surfacing_s=_to_surface_s(state.profile, place.depth, profile),
        dives=state.profile.dives,
        energy_left_wh=battery.voltage * battery.charge if is_measured else math.inf,
    )


def _dive_s(params: ProfileParams) -> float:
    """Time of a dive, down and up again (s)."""
    return 2.0 * ((params.depth - params.top_depth) / params.glide_rate + params.lead_s)


def _to_surface_s(state: ProfileState, depth: float, params: ProfileParams) -> float:
    """Time until the vehicle is at the surface by plan (s); infinite if it is not to come up."""
    # before the surface, so that what is called there once compiles it for a dive
    goes_down = is_descending(state.stage) and not (params.holds or state.aborted)
    if is_surfaced(state.stage):
        return 0.0
    way_m = depth
    if goes_down:
        way_m = 2.0 * max(depth, state.turn_depth) - depth
    this_s = way_m / params.glide_rate + (params.lead_s if way_m > depth else 0.0)
    if params.holds or state.aborted:
        return this_s
    more = math.inf
    if params.surface_every > 0:
        more = params.surface_every - 1 - state.dives % params.surface_every
    if params.dives > 0:
        more = min(more, params.dives - 1 - state.dives)
    return this_s + (more * _dive_s(params) if more > 0 else 0.0)
