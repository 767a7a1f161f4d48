# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""Guidance: path, line of sight, profile and current observer put together.

A tick is six steps: where the vehicle is, what it is doing, what it can follow, what the water
does, in which direction the method would fly, and what control is asked for.
"""

import math
from typing import NamedTuple

from glider_base.frames import heading_of, pitch_of, rotate_to_ned
from glider_base.kernel import kernel, replace
from glider_base.signals import (
    SURFACE_TARGET,
    TICK_S,
    Odometry,
    Reference,
    TrackingError,
    Water,
    dive_m,
)
from glider_guidance.current_observer import ObserverParams, ObserverState, observer_step
from glider_guidance.los import target_rate
from glider_guidance.method import Leg, Situation, method_step
from glider_guidance.path.curve import (
    PathParams,
    path_angles,
    path_entry,
    path_errors,
    path_length,
    path_point,
    path_tangent,
    path_turn,
)
from glider_guidance.yo.end_of_path import WayLeft, way_left
from glider_guidance.yo.machine import (
    ProfileParams,
    ProfileState,
    coming_turn,
    heaviness_of,
    look_ahead_s,
    profile_step,
    profile_targets,
    surfacing_every_dive,
)
from glider_guidance.yo.progress import (
    Progress,
    on_another_path,
    watch_progress,
    waypoint_not_neared,
)
from glider_guidance.yo.stage import (
    AT_END_OF_PATH,
    GLIDING_DOWN,
    SURFACE_PREPARATION,
    SURFACING,
    WAITING_ON_SURFACE,
    is_descending,
    is_gliding,
)
from glider_guidance.yo.turns import time_to_turn, turn_lead_s
from glider_model.onboard.attitude_filter import Measured, measure
from glider_model.onboard.command_filter import Filtered, FilterParams, filter_angle
from glider_model.onboard.fix_watch import FixWatch, contradictions, watch_fixes
from glider_model.onboard.gate import INITIAL_GATE, GateParams, GateState, gate_step
from glider_model.onboard.glide_polar import (
    MODEL_VERTICAL_RATE,
    Polar,
    glide_alpha,
    glide_attacks,
    glide_horizontal_speed,
    glide_speed,
    glide_vertical_rate,
    steepen,
)
from glider_model.onboard.learnt_steering import Steering, SteeringParams, learn

#: An infeasible course is reported once it has lasted this long (s).
INFEASIBLE_S = 60.0
#: Time constant of the estimated speed through the water (s).
SPEED_FILTER_S = 30.0
#: Time constant of the attitude from which steering is learnt (s).
ATTITUDE_S = 3.0
#: The virtual target moves no faster than this (m/s).
TARGET_SPEED_MAX = 3.0


class GuidanceParams(NamedTuple):
    """Guidance as the kernels see it."""

    path: PathParams
    path_id: int  #: by which it is known from another one
    profile: ProfileParams
    polar: Polar
    profile_speed: float  #: horizontal speed through the water of the steady glide (m/s)
    method: NamedTuple  #: of the method that was chosen
    end_s: float  #: when the mission ends (s)
    ends_with_path: bool  #: comes up at the end of the path, and stays there
    arrival_radius: float  #: of the last point (m)
    no_progress_surfacings: int  #: so many without progress are reported; 0: none are
    target_gain: float  #: delta1 (1/s)
    observer: ObserverParams
    heading_filter: FilterParams
    pitch_filter: FilterParams
    steering: SteeringParams
    gate: GateParams


class Followed(NamedTuple):
    """What the vehicle does when it is asked to."""

    measured: Measured  #: filtered attitude and rates
    steering: Steering  #: what it can follow


class WaterState(NamedTuple):
    """What is known of the water and the way through it."""

    observer: ObserverState
    speed: float  #: filtered horizontal speed through the water (m/s)


class Commanded(NamedTuple):
    """What was asked for, filtered."""

    heading: Filtered
    pitch: Filtered
    heading_command: float  #: before the filter (rad)


class GuidanceState(NamedTuple):
    """Guidance between two ticks."""

    method: NamedTuple  #: of the method that was chosen
    followed: Followed
    tick: int = 0
    gate: GateState = INITIAL_GATE  #: the odometry that serves
    profile: ProfileState = ProfileState()
    s: float = 0.0  #: path parameter of the virtual target (m)
    path_id: int = 0  #: of the path that is followed
    water: WaterState = WaterState(ObserverState(0.0, 0.0, 0.0, 0.0), 0.0)
    commanded: Commanded = Commanded(Filtered(0.0, 0.0), Filtered(0.0, 0.0), 0.0)
    infeasible_ticks: int = 0
    progress: Progress = Progress()
    fixes: FixWatch = FixWatch()


class GuidanceOutput(NamedTuple):
    """What guidance publishes."""

    reference: Reference
    error: TrackingError
    current: Water
    stage: int
    infeasible: bool
    no_progress: int  #: number of the waypoint that it comes no nearer to, from 1 on; 0: none


class Place(NamedTuple):
    """Where the vehicle is relative to the path, and how it moves."""

    follows_path: bool  #: in three dimensions
    d_n: float  #: tangent of the path at the virtual target
    d_e: float
    d_d: float
    slope: float  #: its length
    course: float  #: gamma_d (rad)
    elevation: float  #: rho_d (rad)
    error: TrackingError
    ground_n: float  #: velocity over ground (m/s)
    ground_e: float
    ground_d: float
    depth: float  #: (m)
    theta: float  #: (rad)
    psi: float


class Doing(NamedTuple):
    """What the vehicle is to do, by the stage of its yo."""

    leg: Leg
    turn_depth: float  #: the lower turn to come (m)
    pitch: float  #: of the stage (rad)
    rate: float  #: vertical rate of the stage (m/s, + down)


@kernel
def guidance_abort(state):
    """Ask for the surface, now and for good."""
    return replace(state, profile=replace(state.profile, aborted=True))


@kernel
def hear_fixes(state, odometry, known, dt):
    """The state after odometry, its place known by a `Covariance`, is searched for fixes."""
    return replace(state, fixes=watch_fixes(state.fixes, odometry, known, dt))


@kernel
def _start(state, odometry, s, params):
    """State at the first tick, at ``s`` (m) of the path: filters at the measured attitude.

    One that begins under water glides at once: only at the surface is there a dive to prepare.
    """
    q_w, q_x, q_y, q_z = odometry.q_w, odometry.q_x, odometry.q_y, odometry.q_z
    theta, psi = pitch_of(q_w, q_x, q_y, q_z), heading_of(q_w, q_x, q_y, q_z)
    is_under = odometry.p_d > dive_m(params.profile.depth)
    stage = GLIDING_DOWN if is_under or params.profile.follows_path else SURFACE_PREPARATION
    profile = replace(
        state.profile,
        stage=stage,
        ticks=0,
        lead_up_s=0.0,
        lead_down_s=0.0,
        turn_depth=params.profile.depth,
        depth=params.profile.depth,
    )
    return replace(
        state,
        profile=profile,
        s=s,
        path_id=params.path_id,
        water=WaterState(state.water.observer, params.profile_speed),
        commanded=Commanded(Filtered(psi, 0.0), Filtered(theta, 0.0), psi),
        infeasible_ticks=0,
        progress=Progress(s, 0, 0),
    )


@kernel
def _change_path(state, s, params):
    """State at the first tick of another path, at its ``s`` (m).

    Who was at the end dives on, if dives are left, however near the other end is.
    """
    profile = state.profile
    if profile.stage == AT_END_OF_PATH:
        done = 0 < params.profile.dives <= profile.dives
        stage = WAITING_ON_SURFACE if done else SURFACE_PREPARATION
        depth, begun = params.profile.depth, profile.dives
        profile = replace(profile, stage=stage, ticks=0, turn_depth=depth, begun=begun)
    elif is_descending(profile.stage):
        profile = replace(profile, turn_depth=params.profile.depth)
    progress = on_another_path(state.progress, state.tick, s, params.no_progress_surfacings)
    return replace(state, profile=profile, s=s, path_id=params.path_id, progress=progress)


def path_time_s(params: GuidanceParams, current_n: float, current_e: float) -> float:
    """Estimated time (s) from the start of a path to the surface at its end, in a current (m/s).

    Infinite if the current does not let the vehicle get there.
    """
    speed, path, profile = params.profile_speed, params.path, params.profile
    glide_s = way_left(0.0, 0.0, speed, current_n, current_e, math.inf, path).glide_s
    if profile.follows_path:
        return glide_s + path_point(path_length(path), path)[2] / profile.glide_rate
    dives = glide_s / (2.0 * (profile.depth - profile.top_depth) / profile.glide_rate)
    return profile.prepare_ticks * TICK_S + glide_s + 2.0 * dives * profile.lead_s


@kernel
def locate(s, odometry, params):
    """Where the vehicle is relative to the path with the virtual target at ``s`` (m)."""
    q_w, q_x, q_y, q_z = odometry.q_w, odometry.q_x, odometry.q_y, odometry.q_z
    theta, psi = pitch_of(q_w, q_x, q_y, q_z), heading_of(q_w, q_x, q_y, q_z)
    ground_n, ground_e, ground_d = rotate_to_ned(
        q_w, q_x, q_y, q_z, odometry.u, odometry.v, odometry.w
    )
    follows_path = params.profile.follows_path
    if params.ends_with_path and s >= path_length(params.path):
        follows_path = False  # it comes up as from a dive
    d_n, d_e, d_d = path_tangent(s, params.path)
    if not follows_path:
        d_d = 0.0
    slope = math.sqrt(d_n * d_n + d_e * d_e + d_d * d_d)
    gamma_d, rho_d = path_angles(d_n, d_e, d_d)
    e1, e2, e3 = path_errors(
        odometry.p_n, odometry.p_e, odometry.p_d, s, gamma_d, rho_d, params.path
    )
    if not follows_path:
        e3 = 0.0
    return Place(
        follows_path=follows_path,
        d_n=d_n,
        d_e=d_e,
        d_d=d_d,
        slope=slope,
        course=gamma_d,
        elevation=rho_d,
        error=TrackingError(e1, e2, e3),
        ground_n=ground_n,
        ground_e=ground_e,
        ground_d=ground_d,
        depth=odometry.p_d,
        theta=theta,
        psi=psi,
    )


@kernel
def _way_left(state, e1, params):
    """What is left of the path; infinite for a mission that does not end with it.

    Nothing for who has come up near enough to its end, and no nearer to it than before.
    """
    if not params.ends_with_path:
        return WayLeft(math.inf, 0.0)
    length = path_length(params.path)
    if state.s >= length:
        return WayLeft(0.0, 0.0)
    stage, near = state.profile.stage, params.arrival_radius
    is_up = stage == WAITING_ON_SURFACE or stage == SURFACE_PREPARATION
    if is_up and state.progress.surfacings > 0 and length - state.s <= near:
        place, (north, east, _) = state.gate.odometry, path_point(length, params.path)
        if math.hypot(place.p_n - north, place.p_e - east) <= near:
            return WayLeft(0.0, 0.0)
    observer = state.water.observer
    return way_left(
        state.s,
        e1,
        params.profile_speed,
        observer.current_n,
        observer.current_e,
        look_ahead_s(params.profile),
        params.path,
    )


@kernel
def advance(
    state: GuidanceState, place: Place, altitude: float, params: GuidanceParams, dt: float
) -> tuple[ProfileState, Doing]:
    """Stage of the yo at this tick, and what the vehicle is to do in it.

    ``altitude`` is the measured height over the bottom (m); 0.0 where there is no echo.
    """
    before, depth, rate = state.profile, place.depth, place.ground_d
    left = _way_left(state, place.error.e1, params)
    if place.follows_path and not before.aborted:
        profile = replace(
            before,
            stage=GLIDING_DOWN,
            ticks=before.ticks + 1,
            turn_depth=0.0,
            depth=params.profile.depth,
        )
    else:
        asked = params.profile
        if contradictions(state.fixes) > 0:
            asked = surfacing_every_dive(asked)
        profile = profile_step(before, depth, rate, altitude, left, asked)
    stage = profile.stage
    turn_depth = coming_turn(profile, depth, left, params.profile)
    pitch_target, rate_target = profile_targets(stage, rate, params.profile)
    is_surfaced = (
        stage == WAITING_ON_SURFACE
        or stage == SURFACE_PREPARATION
        or stage == SURFACING
        or stage == AT_END_OF_PATH
    )
    turns_over = not is_gliding(stage) and not is_surfaced
    to_turn_s = time_to_turn(profile, depth, rate, turn_depth, params.profile)
    if state.tick * dt + to_turn_s > params.end_s:
        to_turn_s = math.inf
    leg = Leg(
        stage=stage,
        descends=is_descending(stage),
        is_gliding=is_gliding(stage),
        is_surfaced=is_surfaced,
        turns_over=turns_over,
        begins_to_turn_over=turns_over and is_gliding(before.stage),
        glided_s=profile.ticks * dt,
        glided_before_s=before.ticks * dt,
        lead_s=turn_lead_s(profile, params.profile),
        lead_before_s=turn_lead_s(before, params.profile),
        to_turn_s=to_turn_s,
    )
    return profile, Doing(leg, turn_depth, pitch_target, rate_target)


@kernel
def follow(steering, measured, attack, params, dt):
    """Learn what the vehicle can follow: its `Followed` at this tick."""
    speed, _ = glide_speed(measured.theta, measured.vertical_rate, params.polar, attack)
    return Followed(measured, learn(steering, measured, speed, params.steering, dt))


@kernel
def observe(state, place, attack, leg, params, dt):
    """Speed through the water and current by the flight model, as far as it holds now."""
    theta, rate = place.theta, place.ground_d
    valid = (
        leg.is_gliding
        and leg.glided_s > params.profile.settled_s
        and abs(theta) > params.polar.shallowest
        and abs(rate) > MODEL_VERTICAL_RATE
        and theta * rate < 0.0
    )
    model_speed = glide_horizontal_speed(theta, rate, params.polar, attack) if valid else 0.0
    observer = observer_step(
        state.observer,
        place.ground_n,
        place.ground_e,
        model_speed * math.cos(place.psi),
        model_speed * math.sin(place.psi),
        valid,
        params.observer,
        dt,
    )
    speed = state.speed
    if valid:
        speed += dt / SPEED_FILTER_S * (model_speed - speed)
    return WaterState(observer, speed)


@kernel
def refer(state, place, doing, asked, aborted, params, dt):
    """What control is asked for, and the path parameter (m) of the virtual target a tick later.

    `Commanded`, the parameter and `Reference`.
    """
    pitch_target, rate_target = doing.pitch, doing.rate
    if place.follows_path and not aborted:
        elevation = steepen(asked.elevation, params.polar)
        pitch_target = elevation
        for _ in range(3):
            pitch_target = elevation + glide_alpha(pitch_target, params.polar)
        rate_target = glide_vertical_rate(
            pitch_target, heaviness_of(pitch_target, params.profile), params.polar
        )
    made_good = (
        place.ground_n * place.d_n + place.ground_e * place.d_e + place.ground_d * place.d_d
    ) / place.slope
    s_rate = target_rate(
        made_good,
        place.error.e1,
        place.slope,
        params.target_gain,
        TARGET_SPEED_MAX / place.slope,
    )
    turn_rate = path_turn(state.s, params.path) * s_rate if doing.leg.is_gliding else 0.0
    before = state.commanded
    heading = filter_angle(before.heading, asked.heading, turn_rate, params.heading_filter, dt)
    pitch = filter_angle(before.pitch, pitch_target, 0.0, params.pitch_filter, dt)
    t_n, t_e, t_d = path_point(state.s, params.path)
    if not place.follows_path:
        t_d = doing.turn_depth if rate_target > 0.0 else 0.0
    if aborted:
        t_d = SURFACE_TARGET
    reference = Reference(
        p_n=t_n,
        p_e=t_e,
        p_d=t_d,
        phi=0.0,
        theta=pitch.value,
        psi=heading.value,
        v_n=math.cos(asked.heading) * asked.speed + asked.current_n,
        v_e=math.sin(asked.heading) * asked.speed + asked.current_e,
        v_d=rate_target,
        phi_dot=0.0,
        theta_dot=pitch.rate,
        psi_dot=heading.rate,
    )
    return Commanded(heading, pitch, float(asked.heading)), state.s + dt * s_rate, reference


@kernel
def guidance_step(
    state: GuidanceState, odometry: Odometry, altitude: float, params: GuidanceParams, dt: float
) -> tuple[GuidanceState, GuidanceOutput]:
    """One tick of guidance, of ``dt`` s.

    Of the odometry, pose and velocity over ground, what the gate refuses is not acted on.
    ``altitude`` is the measured height over the bottom (m); 0.0 where there is no echo.
    """
    gate = gate_step(state.gate, odometry, params.gate, dt)
    odometry = gate.odometry
    if state.tick == 0 or state.path_id != params.path_id:
        x, horizontal = odometry, not params.profile.follows_path
        s = path_entry(x.p_n, x.p_e, x.p_d, horizontal, params.path)
        if state.tick == 0:
            state = _start(state, odometry, s, params)
        else:
            state = _change_path(state, s, params)
    place = locate(state.s, odometry, params)
    profile, doing = advance(state, place, altitude, params, dt)
    progress = watch_progress(state.progress, state.tick, state.s, state.profile.stage, profile)
    before = state.followed
    measured = measure(before.measured, odometry, state.tick == 0, ATTITUDE_S, dt)
    filtered, raw = glide_attacks(measured.theta, place.theta, params.polar)
    followed = follow(before.steering, measured, filtered, params, dt)
    water = observe(state.water, place, raw, doing.leg, params, dt)
    current = Water(water.observer.current_n, water.observer.current_e, 0.0)
    seen = Situation(
        course=place.course,
        elevation=place.elevation,
        error=place.error,
        follows_path=place.follows_path,
        ground_n=place.ground_n,
        ground_e=place.ground_e,
        speed=water.speed,
        glide_speed=params.profile_speed,
        current=current,
        steering=followed.steering,
        turning=params.steering,
        leg=doing.leg,
        heading=state.commanded.heading_command,
    )
    method, asked = method_step(state.method, seen, params.method, dt)
    commanded, s, reference = refer(state, place, doing, asked, profile.aborted, params, dt)

    infeasible_ticks = 0 if asked.feasible else state.infeasible_ticks + 1
    is_infeasible = infeasible_ticks * dt > INFEASIBLE_S
    stays_at = waypoint_not_neared(progress, state.s, params.no_progress_surfacings, params.path)
    output = GuidanceOutput(
        reference, place.error, current, doing.leg.stage, is_infeasible, stays_at
    )
    return replace(
        state,
        tick=state.tick + 1 if gate.seen else 0,
        gate=gate,
        profile=profile,
        s=s,
        followed=followed,
        water=WaterState(water.observer, float(asked.speed)),
        method=method if gate.seen else state.method,
        commanded=commanded,
        infeasible_ticks=infeasible_ticks,
        progress=progress,
    ), output
