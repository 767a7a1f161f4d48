# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""Guidance: path, line of sight, profile and current observer put together."""

import math
from typing import Literal, NamedTuple

import pydantic
from pydantic import Field

from glider_guidance.current_observer import ObserverParams, ObserverState, observer_step
from glider_guidance.end_of_path import WayLeft, way_left
from glider_guidance.los import (
    approach_angles,
    approach_heading,
    crab_heading,
    desired_direction,
    target_rate,
)
from glider_guidance.path import (
    PathParams,
    PathSettings,
    StraightPath,
    path_angles,
    path_closest,
    path_errors,
    path_length,
    path_point,
    path_tangent,
    path_turn,
)
from glider_guidance.profile import (
    AT_END_OF_PATH,
    GLIDING_DOWN,
    INFLECTING_UP,
    INITIAL_PROFILE,
    SURFACE_PREPARATION,
    SURFACING,
    WAITING_ON_SURFACE,
    ProfileParams,
    ProfileSettings,
    ProfileState,
    coming_turn,
    is_gliding,
    look_ahead_s,
    profile_step,
    profile_targets,
    time_to_turn,
    turn_lead_s,
    turn_offset,
)
from glider_model.command_filter import Filtered, FilterParams, filter_angle
from glider_model.frames import euler_from_quaternion, rotate_to_ned, wrap_angle
from glider_model.gate import INITIAL_GATE, GateParams, GateSettings, GateState, gate_step
from glider_model.kernel import kernel
from glider_model.measurement import Measured, measure
from glider_model.polar import (
    Polar,
    glide_alpha,
    glide_horizontal_speed,
    glide_speed,
    glide_vertical_rate,
    make_polar,
    steepen,
)
from glider_model.settings import ConfigurationError, Settings
from glider_model.signals import SURFACE_TARGET, TICK_S, Reference, TrackingError, Water
from glider_model.steering import (
    Steering,
    SteeringLearningSettings,
    SteeringParams,
    followed_frequency,
    learn,
)
from glider_model.vehicle import load_vehicle, vehicle_path

#: The flight model is believed this long after a glide began (s).
SETTLED_S = 120.0
#: An infeasible course is reported once it has lasted this long (s).
INFEASIBLE_S = 60.0
#: The flight model is believed above this vertical rate (m/s) and pitch (rad).
MODEL_VERTICAL_RATE = 0.05
MODEL_PITCH = math.radians(12.0)
#: Time constant of the estimated speed through the water (s).
SPEED_FILTER_S = 30.0
#: Time constant of the attitude from which steering is learnt (s).
ATTITUDE_S = 3.0
#: Lookahead in time, times the frequency up to which the vehicle can be steered, is no less (-).
LOOKAHEAD_OVER_ZERO = 3.0
#: It grows to this many times itself.
LOOKAHEAD_STRETCH_MAX = 10.0
#: Of the lag behind a desired track that moves aside, this share is made up for beforehand.
OFFSET_AHEAD = 0.5
#: What a turn really cost across the path is measured so long after it (s), on the cross-track
#: error smoothed over this time (s), in a cross current of no less than this (m/s).
MEASURED_S, BESIDE_S, MEASURED_CURRENT = 120.0, 20.0, 0.02
#: Largest correction of the lead of a turn (s).
LEAD_CORRECTION_S = 60.0
#: A phase that can hardly be steered is entered on its heading: the vehicle turns to it so long
#: before the turn-over (s) for each time that the lookahead grows by itself, and so long at most.
READY_S, READY_S_MAX = 60.0, 100.0
#: The virtual target moves no faster than this (m/s).
TARGET_SPEED_MAX = 3.0


class LosSettings(Settings):
    """Line of sight."""

    method: Literal['observer', 'paper'] = Field(
        'observer',
        description='observer: crab into the estimated current; paper: as printed, no estimate',
    )
    lookahead_m: float = Field(
        40.0,
        ge=1.0,
        le=10000.0,
        description='least lookahead of the observer method (m)',
        json_schema_extra={'tunable': True},
    )
    lookahead_s: float = Field(
        150.0,
        ge=0.0,
        le=3600.0,
        description='lookahead of the observer method in time at the speed over ground (s)',
        json_schema_extra={'tunable': True},
    )
    lead_turns: bool = Field(
        True, description='share the drift of a turn between before and after (observer method)'
    )
    delta1_m: float = Field(
        3.2,
        ge=0.1,
        le=10000.0,
        description="Delta1, lookahead of the paper's method (m)",
        json_schema_extra={'tunable': True},
    )
    delta1_per_s: float = Field(
        0.1,
        gt=0.0,
        le=5.0,
        description='delta1, pull of the virtual target toward the vehicle (1/s)',
        json_schema_extra={'tunable': True},
    )
    delta2: float = Field(
        1.0,
        ge=0.05,
        le=20.0,
        description='delta2, ratio of the vertical lookahead to the distance (-)',
        json_schema_extra={'tunable': True},
    )


class ObserverSettings(Settings):
    """Current observer."""

    k3_per_s: float = Field(
        0.02,
        gt=0.0,
        le=1.0,
        description='K3, gain on position (1/s)',
        json_schema_extra={'tunable': True},
    )
    k4_per_s2: float = Field(
        1e-4,
        gt=0.0,
        le=0.1,
        description='K4, gain on the current (1/s^2)',
        json_schema_extra={'tunable': True},
    )

    @pydantic.model_validator(mode='after')
    def _is_stable(self):
        if self.k4_per_s2 > 5.0 * self.k3_per_s:
            raise ValueError(
                f'k4_per_s2 = {self.k4_per_s2} is unstable in steps of 0.1 s (allowed: at most '
                f'5 k3_per_s = {5.0 * self.k3_per_s:g})'
            )
        return self


class CommandFilterSettings(Settings):
    """Command filters of heading and pitch."""

    heading_frequency_radps: float = Field(
        0.07, gt=0.0, le=2.0, description='natural frequency of the heading filter (rad/s)'
    )
    heading_rate_radps: float = Field(
        0.012, gt=0.0, le=1.0, description='largest rate of the desired heading (rad/s)'
    )
    pitch_frequency_radps: float = Field(
        0.12, gt=0.0, le=2.0, description='natural frequency of the pitch filter (rad/s)'
    )
    pitch_rate_radps: float = Field(
        0.03, gt=0.0, le=1.0, description='largest rate of the desired pitch (rad/s)'
    )


class GuidanceLawSettings(Settings):
    """How to guide, whatever the vehicle and the path: the guidance section of a scenario."""

    los: LosSettings = Field(LosSettings(), description='line of sight')
    observer: ObserverSettings = Field(ObserverSettings(), description='current observer')
    filters: CommandFilterSettings = Field(CommandFilterSettings(), description='command filters')
    steering: SteeringLearningSettings = Field(
        SteeringLearningSettings(), description='what the vehicle can follow, learnt'
    )
    gate: GateSettings = Field(GateSettings(), description='odometry that is refused')


class GuidanceSettings(GuidanceLawSettings):
    """Everything the guidance node is told."""

    vehicle: str = Field('zhang2021', description='vehicle whose glide polar and pump are used')
    path: PathSettings = Field(
        StraightPath(kind='straight', length_m=25000.0), description='path to follow'
    )
    profile: ProfileSettings = Field(ProfileSettings(), description='sawtooth')
    dives: int = Field(
        0, ge=0, le=100000, description='dives before waiting on the surface; 0: no end'
    )
    duration_s: float = Field(
        0.0,
        ge=0.0,
        le=1e8,
        description='time at which the mission ends (s), no later turn is led; 0.0: never',
    )

    def check_depth(self) -> None:
        """Refuse to go deeper than the vehicle is rated for.

        Raises
        ------
        ConfigurationError
            If the lower turn or the path is too deep, or the vehicle's file has no rating.
        """
        vehicle = load_vehicle(self.vehicle)
        if vehicle.rated_depth is None:
            raise ConfigurationError(
                f'{vehicle_path(self.vehicle)}: rated_depth: missing (allowed: depth in m that '
                f'the vehicle is rated for, with unit and source)'
            )
        field, deepest = 'profile.depth_m', self.profile.depth_m
        if self.profile.mode == 'path':
            field, deepest = 'deepest point of path', float(self.path.points(500)[:, 2].max())
        if deepest > vehicle.rated_depth_m:
            raise ConfigurationError(
                f'{field} = {deepest:g}: deeper than the vehicle is rated for (allowed: <= '
                f'{vehicle.rated_depth_m:g} m, its rated_depth)'
            )

    def params(self) -> 'GuidanceParams':
        """Kernel parameters."""
        vehicle = load_vehicle(self.vehicle).params()
        polar = make_polar(vehicle)
        filters = self.filters
        profile = self.profile.params(self.dives, vehicle.m_b_rate, polar)
        return GuidanceParams(
            self.path.params(),
            profile,
            polar,
            glide_horizontal_speed(profile.pitch, profile.glide_rate, polar),
            self.los.method == 'observer',
            self.los.method == 'observer' and self.los.lead_turns,
            self.duration_s if self.duration_s > 0.0 else math.inf,
            self.path.at_end == 'stop',
            self.los.lookahead_m if self.los.method == 'observer' else self.los.delta1_m,
            self.los.lookahead_s if self.los.method == 'observer' else 0.0,
            self.los.delta1_per_s,
            self.los.delta2,
            ObserverParams(self.observer.k3_per_s, self.observer.k4_per_s2),
            FilterParams(filters.heading_frequency_radps, filters.heading_rate_radps),
            FilterParams(filters.pitch_frequency_radps, filters.pitch_rate_radps),
            self.steering.params(),
            self.gate.params(),
        )

    def initial_state(self) -> 'GuidanceState':
        """State before the first tick."""
        return GuidanceState(
            0,
            INITIAL_PROFILE,
            0.0,
            ObserverState(0.0, 0.0, 0.0, 0.0),
            Filtered(0.0, 0.0),
            Filtered(0.0, 0.0),
            0.0,
            0.0,
            0.0,
            0,
            0.0,
            0.0,
            0.0,
            Measured(0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0),
            self.steering.initial_state(),
            INITIAL_GATE,
        )


class GuidanceParams(NamedTuple):
    """Guidance as the kernels see it."""

    path: PathParams
    profile: ProfileParams
    polar: Polar
    profile_speed: float  #: horizontal speed through the water of the steady glide (m/s)
    compensates: bool  #: crab into the estimated current
    leads: bool  #: share the drift of a turn between before and after
    end_s: float  #: when the mission ends (s)
    ends_with_path: bool  #: comes up at the end of the path, and stays there
    lookahead: float  #: (m), at least
    lookahead_s: float  #: times the speed over ground, if that is more
    target_gain: float  #: delta1 (1/s)
    vertical_ratio: float  #: delta2
    observer: ObserverParams
    heading_filter: FilterParams
    pitch_filter: FilterParams
    steering: SteeringParams
    gate: GateParams


class GuidanceState(NamedTuple):
    """Guidance between two ticks."""

    tick: int
    profile: ProfileState
    s: float  #: path parameter of the virtual target (m)
    observer: ObserverState
    heading: Filtered
    pitch: Filtered
    speed: float  #: filtered horizontal speed through the water (m/s)
    heading_command: float  #: held while the vehicle turns (rad)
    drift: float  #: what the last turn was expected to cost across the path (m)
    infeasible_ticks: int
    beside: float  #: smoothed cross-track error (m)
    more_up_s: float  #: by how much the turn at depth has to be led more, as learnt (s)
    more_down_s: float  #: the same for the upper turn
    measured: Measured  #: filtered attitude and rates
    steering: Steering  #: what the vehicle can follow
    gate: GateState  #: the odometry that serves


class GuidanceOutput(NamedTuple):
    """What guidance publishes."""

    reference: Reference
    error: TrackingError
    current: Water
    stage: int
    infeasible: bool


@kernel
def guidance_abort(state):
    """Ask for the surface, now and for good."""
    profile = state.profile
    return GuidanceState(
        state.tick,
        ProfileState(
            profile.stage,
            profile.ticks,
            profile.dives,
            True,
            profile.lead_up_s,
            profile.lead_down_s,
            profile.turn_depth,
        ),
        state.s,
        state.observer,
        state.heading,
        state.pitch,
        state.speed,
        state.heading_command,
        state.drift,
        state.infeasible_ticks,
        state.beside,
        state.more_up_s,
        state.more_down_s,
        state.measured,
        state.steering,
        state.gate,
    )


@kernel
def _start(state, odometry, psi, theta, params):
    """State at the first tick: closest point of the path, filters at the measured attitude."""
    flat = not params.profile.follows_path
    s = path_closest(odometry.p_n, odometry.p_e, odometry.p_d, flat, params.path)
    stage = GLIDING_DOWN if params.profile.follows_path else SURFACE_PREPARATION
    return GuidanceState(
        state.tick,
        ProfileState(
            stage, 0, state.profile.dives, state.profile.aborted, 0.0, 0.0, params.profile.depth
        ),
        s,
        state.observer,
        Filtered(psi, 0.0),
        Filtered(theta, 0.0),
        params.profile_speed,
        psi,
        0.0,
        0,
        0.0,
        0.0,
        0.0,
        state.measured,
        state.steering,
        state.gate,
    )


@kernel
def lookahead_stretch(steering, lookahead_s):
    """Factor on the lookahead, 1 or more, for a vehicle that steers weakly in a phase.

    Position is steered by heading. Where each roll first turns the nose the wrong way, position
    must be asked for more slowly, or the two loops swing against each other.

    Parameters
    ----------
    steering : SteeringState
        What is known of the phase.
    lookahead_s : float
        Lookahead for a vehicle that steers well (s).
    """
    if lookahead_s <= 0.0:
        return 1.0
    needed_s = LOOKAHEAD_OVER_ZERO / followed_frequency(steering)
    return min(LOOKAHEAD_STRETCH_MAX, max(1.0, needed_s / lookahead_s))


@kernel
def _way_left(state, e1, params):
    """What is left of the path; infinite for a mission that does not end with it."""
    if not params.ends_with_path:
        return WayLeft(math.inf, 0.0)
    if state.s >= path_length(params.path):
        return WayLeft(0.0, 0.0)
    observer = state.observer
    return way_left(
        state.s,
        e1,
        params.profile_speed,
        observer.current_n,
        observer.current_e,
        look_ahead_s(params.profile),
        params.path,
    )


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
def within(value, most):
    """``value``, held within -most and most."""
    return min(most, max(-most, value))


@kernel
def guidance_step(state, odometry, params, dt):
    """One tick of guidance.

    Parameters
    ----------
    state : GuidanceState
    odometry : Odometry
        Measured pose and velocity over ground; what the gate refuses is not acted on.
    params : GuidanceParams
    dt : float
        Length of the tick (s).

    Returns
    -------
    GuidanceState, GuidanceOutput
    """
    gate = gate_step(state.gate, odometry, params.gate, dt)
    odometry = gate.odometry
    q_w, q_x, q_y, q_z = odometry.q_w, odometry.q_x, odometry.q_y, odometry.q_z
    _, theta, psi = euler_from_quaternion(q_w, q_x, q_y, q_z)
    ground_n, ground_e, ground_d = rotate_to_ned(
        q_w, q_x, q_y, q_z, odometry.u, odometry.v, odometry.w
    )
    if state.tick == 0:
        state = _start(state, odometry, psi, theta, params)
    follows_path = params.profile.follows_path
    if params.ends_with_path and state.s >= path_length(params.path):
        follows_path = False  # it comes up as from a dive

    # where the vehicle is relative to the path
    d_n, d_e, d_d = path_tangent(state.s, params.path)
    if not follows_path:
        d_d = 0.0
    slope = math.sqrt(d_n * d_n + d_e * d_e + d_d * d_d)
    gamma_d, rho_d = path_angles(d_n, d_e, d_d)
    e1, e2, e3 = path_errors(
        odometry.p_n, odometry.p_e, odometry.p_d, state.s, gamma_d, rho_d, params.path
    )

    # what the vehicle is doing
    left = _way_left(state, e1, params)
    if follows_path and not state.profile.aborted:
        profile = ProfileState(
            GLIDING_DOWN, state.profile.ticks + 1, state.profile.dives, False, 0.0, 0.0, 0.0
        )
    else:
        profile = profile_step(state.profile, odometry.p_d, ground_d, left, params.profile)
    turn_depth = coming_turn(profile, odometry.p_d, left, params.profile)
    stage = profile.stage
    pitch_target, rate_target = profile_targets(stage, ground_d, params.profile)
    if not follows_path:
        e3 = 0.0

    # what it can follow
    measured = measure(state.measured, odometry, state.tick == 0, ATTITUDE_S, dt)
    measured_speed, _ = glide_speed(measured.theta, measured.vertical_rate, params.polar)
    steering = learn(state.steering, measured, measured_speed, params.steering, dt)
    stretch = lookahead_stretch(steering.dive, params.lookahead_s)
    next_stretch = lookahead_stretch(steering.climb, params.lookahead_s)
    if rate_target < 0.0:
        stretch, next_stretch = next_stretch, stretch

    # speed through the water and current
    settled = is_gliding(stage) and profile.ticks * dt > SETTLED_S
    valid = (
        settled
        and abs(theta) > MODEL_PITCH
        and abs(ground_d) > MODEL_VERTICAL_RATE
        and theta * ground_d < 0.0
    )
    model_speed = glide_horizontal_speed(theta, ground_d, params.polar)
    observer = observer_step(
        state.observer,
        ground_n,
        ground_e,
        model_speed * math.cos(psi),
        model_speed * math.sin(psi),
        valid,
        params.observer,
        dt,
    )
    speed = state.speed
    if valid:
        speed += dt / SPEED_FILTER_S * (model_speed - speed)

    surfaced = stage == WAITING_ON_SURFACE or stage == SURFACE_PREPARATION or stage == SURFACING
    surfaced = surfaced or stage == AT_END_OF_PATH
    turns_over = not is_gliding(stage) and not surfaced
    # a turn-over is flown on the heading of the glide to come, as it should be
    begins_to_turn_over = turns_over and is_gliding(state.profile.stage)
    if params.compensates and begins_to_turn_over:
        speed = params.profile_speed

    # direction to fly
    lookahead_s = stretch * params.lookahead_s
    lookahead = max(
        params.lookahead,
        lookahead_s * math.sqrt(ground_n * ground_n + ground_e * ground_e),
    )
    drift_past = state.drift
    beside = state.beside + dt / BESIDE_S * (e2 - state.beside)
    more_up_s, more_down_s = state.more_up_s, state.more_down_s
    offset = 0.0
    is_nearly_over = False
    if params.leads and not follows_path:
        across = observer.current_e * math.cos(gamma_d) - observer.current_n * math.sin(gamma_d)
        more_s = more_up_s if rate_target > 0.0 else more_down_s
        coming = across * (turn_lead_s(profile, params.profile) + more_s)
        if surfaced:
            drift_past = 0.0
        elif begins_to_turn_over:
            more_s = more_up_s if stage == INFLECTING_UP else more_down_s
            drift_past = across * (turn_lead_s(state.profile, params.profile) + more_s)
        if is_gliding(stage):
            to_turn_s = time_to_turn(profile, odometry.p_d, ground_d, turn_depth, params.profile)
            if state.tick * dt + to_turn_s > params.end_s:
                to_turn_s = math.inf
            # the phase that steers less well bears the smaller part of the drift
            part = next_stretch / (stretch + next_stretch)
            glided_s = profile.ticks * dt
            coming, past = part * coming, part * drift_past
            offset = turn_offset(to_turn_s, glided_s, coming, past)
            if (
                state.profile.ticks * dt < MEASURED_S <= glided_s
                and drift_past != 0.0
                and abs(across) > MEASURED_CURRENT
            ):
                # those that steer well make it good by themselves
                more_s = (1.0 - 1.0 / stretch) * (beside - offset) / across
                if rate_target < 0.0:
                    more_up_s = within(more_up_s + more_s, LEAD_CORRECTION_S)
                else:
                    more_down_s = within(more_down_s + more_s, LEAD_CORRECTION_S)
            moved = turn_offset(to_turn_s - 1.0, glided_s + 1.0, coming, past) - offset
            offset += OFFSET_AHEAD * lookahead_s * moved
            is_nearly_over = to_turn_s < min(READY_S_MAX, READY_S * (next_stretch - 1.0))
    gamma_r, rho_r = approach_angles(e2 - offset, e3, lookahead, params.vertical_ratio)
    if not follows_path:
        rho_r = 0.0
    chi_d, upsilon_d = desired_direction(gamma_d, rho_d, gamma_r, rho_r)
    _, progress, feasible = crab_heading(gamma_d, speed, observer.current_n, observer.current_e)
    heading_command = chi_d
    current_n, current_e = 0.0, 0.0
    if params.compensates:
        current_n, current_e = observer.current_n, observer.current_e
        heading_command = approach_heading(
            gamma_d,
            wrap_angle(chi_d - gamma_d),
            progress,
            speed,
            observer.current_n,
            observer.current_e,
        )
    infeasible_ticks = 0 if feasible else state.infeasible_ticks + 1
    if params.compensates and (is_nearly_over or begins_to_turn_over):
        heading_command, _, _ = crab_heading(
            gamma_d, params.profile_speed, observer.current_n, observer.current_e
        )
    elif turns_over:
        heading_command = state.heading_command

    # pitch and vertical rate
    if follows_path and not profile.aborted:
        elevation = steepen(upsilon_d)
        pitch_target = elevation
        for _ in range(3):
            pitch_target = elevation + glide_alpha(pitch_target, params.polar)
        rate_target = glide_vertical_rate(pitch_target, params.profile.net_heaviness, params.polar)
    # virtual target
    made_good = (ground_n * d_n + ground_e * d_e + ground_d * d_d) / slope
    s_rate = target_rate(made_good, e1, slope, params.target_gain, TARGET_SPEED_MAX / slope)
    s = state.s + dt * s_rate

    turn_rate = path_turn(state.s, params.path) * s_rate if is_gliding(stage) else 0.0
    heading = filter_angle(state.heading, heading_command, turn_rate, params.heading_filter, dt)
    pitch = filter_angle(state.pitch, pitch_target, 0.0, params.pitch_filter, dt)
    t_n, t_e, t_d = path_point(state.s, params.path)
    if not follows_path:
        t_d = turn_depth if rate_target > 0.0 else 0.0
    if profile.aborted:
        t_d = SURFACE_TARGET

    reference = Reference(
        t_n,
        t_e,
        t_d,
        0.0,
        pitch.value,
        heading.value,
        math.cos(heading_command) * speed + current_n,
        math.sin(heading_command) * speed + current_e,
        rate_target,
        0.0,
        pitch.rate,
        heading.rate,
    )
    output = GuidanceOutput(
        reference,
        TrackingError(e1, e2, e3),
        Water(observer.current_n, observer.current_e, 0.0),
        stage,
        infeasible_ticks * dt > INFEASIBLE_S,
    )
    new_state = GuidanceState(
        state.tick + 1 if gate.seen else 0,
        profile,
        s,
        observer,
        heading,
        pitch,
        speed,
        heading_command,
        drift_past,
        infeasible_ticks,
        beside,
        more_up_s,
        more_down_s,
        measured,
        steering,
        gate,
    )
    return new_state, output
