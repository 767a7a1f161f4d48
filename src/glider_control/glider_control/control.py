# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""Control: watch, measurement, attitude law, vertical-rate law and allocation put together.

The channels cannot be swapped: buoyancy sets speed and vertical rate, the mass forward or aft sets
pitch, the mass turned to a side sets roll and so heading.
"""

import math
from typing import Literal, NamedTuple

from pydantic import Field

from glider_control.adaptive import (
    AdaptiveParams,
    AdaptiveSettings,
    AdaptiveState,
    adaptation,
    adaptive_step,
    initial_adaptive,
    make_adaptive,
)
from glider_control.allocation import (
    AllocationParams,
    allocate_pitch,
    allocate_roll,
    make_allocation,
    moments,
)
from glider_control.pid import (
    HeadingSettings,
    PidParams,
    PidSettings,
    PidState,
    pid_step,
)
from glider_control.watch import (
    INITIAL_WATCH,
    ORDERED,
    SURFACES,
    WatchParams,
    WatchState,
    make_watch,
    take_in,
    watch,
)
from glider_model.command_filter import Filtered, FilterParams
from glider_model.gate import GateSettings
from glider_model.kernel import kernel
from glider_model.measurement import Measured, measure
from glider_model.polar import Polar, glide_net_heaviness, glide_speed, make_polar
from glider_model.rigid_body import GRAVITY
from glider_model.settings import Settings
from glider_model.signals import Adaptation, Joints, Wrench
from glider_model.vehicle import load_vehicle

_TUNABLE = {'tunable': True}

#: Bits of ``ControlOutput.saturation``; those of `glider_control.watch` come after them.
SATURATED_BUOYANCY, SATURATED_PITCH, SATURATED_ROLL = 1, 2, 4
#: The integrals of the vertical-rate law wait until the pump is this near to where it goes (kg).
PUMP_ARRIVED_KG = 0.05


class BuoyancySettings(Settings):
    """Vertical rate on the buoyancy engine."""

    ki_kg_per_m: float = Field(
        0.004,
        ge=0.0,
        le=10.0,
        description='integral of the vertical-rate error (kg/m)',
        json_schema_extra=_TUNABLE,
    )
    drag_ki_kg_per_m: float = Field(
        0.002,
        ge=0.0,
        le=10.0,
        description='integral that changes sides with dive and climb (kg/m)',
        json_schema_extra=_TUNABLE,
    )
    trim_limit_kg: float = Field(
        0.3, ge=0.0, le=20.0, description='largest correction by each integral (kg)'
    )


class FilterSettings(Settings):
    """What keeps noise from moving the motors."""

    attitude_s: float = Field(
        3.0, gt=0.0, le=60.0, description='time constant of the attitude filter (s)'
    )
    buoyancy_dead_band_kg: float = Field(
        0.005, ge=0.0, le=1.0, description='change of command that the pump ignores (kg)'
    )
    pitch_dead_band_m: float = Field(
        1e-4, ge=0.0, le=0.1, description='change of command that the pitch mass ignores (m)'
    )
    roll_dead_band_deg: float = Field(
        0.2, ge=0.0, le=10.0, description='change of command that the roll mass ignores (deg)'
    )


class ControlLawSettings(Settings):
    """How to control, whatever the vehicle: the control section of a scenario."""

    law: Literal['adaptive', 'pid'] = Field('adaptive', description='attitude law')
    adaptive: AdaptiveSettings = Field(AdaptiveSettings(), description='gains of the adaptive law')
    pid: PidSettings = Field(PidSettings(), description='gains of the PID law')
    heading: HeadingSettings = Field(HeadingSettings(), description='bank to turn')
    buoyancy: BuoyancySettings = Field(BuoyancySettings(), description='vertical-rate law')
    filters: FilterSettings = Field(FilterSettings(), description='filters and dead bands')
    gate: GateSettings = Field(GateSettings(), description='odometry that is refused')


class ControlSettings(ControlLawSettings):
    """Everything the control node is told."""

    vehicle: str = Field('zhang2021', description='vehicle: masses, ranges, polar, steering')
    lost_after_s: float = Field(
        10.0,
        ge=0.1,
        le=3600.0,
        description='free-running: an input that has been stale for so long is lost, and the '
        'vehicle surfaces for good (s)',
    )

    def params(self) -> 'ControlParams':
        """Kernel parameters."""
        vehicle = load_vehicle(self.vehicle)
        kernel_vehicle = vehicle.params()
        heading, filters = self.heading, self.filters
        roll_limit = math.radians(heading.roll_limit_deg)
        roll_filter = FilterParams(heading.roll_frequency_radps, heading.roll_rate_radps)
        return ControlParams(
            make_allocation(kernel_vehicle),
            make_polar(kernel_vehicle),
            self.law == 'adaptive',
            make_adaptive(self.adaptive, kernel_vehicle, roll_limit, roll_filter),
            PidParams(
                *(getattr(self.pid, name) for name in PidSettings.model_fields),
                vehicle.steering.dive.value,
                vehicle.steering.climb.value,
                roll_limit,
                roll_filter,
            ),
            self.buoyancy.ki_kg_per_m,
            self.buoyancy.drag_ki_kg_per_m,
            self.buoyancy.trim_limit_kg,
            filters.attitude_s,
            Joints(
                filters.buoyancy_dead_band_kg,
                filters.pitch_dead_band_m,
                math.radians(filters.roll_dead_band_deg),
            ),
            Joints(-kernel_vehicle.m_b_max, -kernel_vehicle.x_p_max, 0.0),
            make_watch(kernel_vehicle, vehicle.rated_depth_m, self.gate.params()),
        )

    def initial_state(self) -> 'ControlState':
        """State before the first tick."""
        return ControlState(
            0,
            Measured(0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0),
            initial_adaptive(self.adaptive),
            PidState(0.0, 0.0, 0.0, Filtered(0.0, 0.0)),
            Trim(0.0, 0.0),
            Joints(0.0, 0.0, 0.0),
            INITIAL_WATCH,
        )


class ControlParams(NamedTuple):
    """Control as the kernels see it."""

    allocation: AllocationParams
    polar: Polar
    adapts: bool  #: adaptive law, else PID
    adaptive: AdaptiveParams
    pid: PidParams
    buoyancy_ki: float  #: (kg/m)
    drag_ki: float  #: (kg/m)
    buoyancy_trim_max: float  #: (kg)
    attitude_s: float
    dead_band: Joints
    safe_command: Joints  #: as buoyant as possible, mass at the climb stop, no roll
    watch: WatchParams


class Trim(NamedTuple):
    """Integrals of the vertical-rate law."""

    ballast: float  #: the same in dive and climb: ballast, density (kg)
    drag: float  #: + in a dive, - in a climb (kg)


class ControlState(NamedTuple):
    """Control between two ticks."""

    tick: int
    measured: Measured
    adaptive: AdaptiveState
    pid: PidState
    trim: Trim
    command: Joints  #: last command
    watch: WatchState


class ControlOutput(NamedTuple):
    """What control publishes."""

    command: Joints
    wrench: Wrench
    adaptation: Adaptation
    saturation: int  #: sum of SATURATED_* bits and of those of `glider_control.watch`


@kernel
def _hold(command, last, band, limit):
    """``last``, unless the command leaves the dead band or reaches the end of the range."""
    if abs(command - last) <= band and abs(command) < limit:
        return last
    return command


@kernel
def vertical_rate_law(trim, measured, reference, joints, params, dt):
    """Net heaviness (kg) for the reference's vertical rate, and the new integrals.

    The glide polar gives the weight of the steady glide. One integral corrects what ballast and
    density differ by, another, with the sign of the rate, what the drag does: a draggy vehicle
    has to be heavier in the dive and lighter in the climb, and has to know it as soon as it turns
    over. Both wait until the pump is where it is meant to be, and no longer: a vehicle that then
    sinks, or climbs too slowly, needs them most.
    """
    sign = 1.0 if reference.v_d > 0.0 else -1.0
    ballast, drag = trim.ballast, trim.drag
    wanted = glide_net_heaviness(reference.theta, reference.v_d, params.polar) + sign * drag
    error = reference.v_d - measured.vertical_rate
    limit = params.allocation.m_b_max
    if abs(joints.m_b - wanted - ballast) < PUMP_ARRIVED_KG:
        most = params.buoyancy_trim_max
        ballast = min(most, max(-most, ballast + dt * params.buoyancy_ki * error))
        drag = min(most, max(-most, drag + dt * params.drag_ki * error * sign))
    return min(limit, max(-limit, wanted + ballast)), Trim(ballast, drag)


@kernel
def attitude_law(state, measured, seen, last, params, dt):
    """Roll and pitch moment (N m) of the law in use, with its state and what it has learnt."""
    limits, joints, reference = params.allocation, seen.joints, seen.reference
    speed, alpha = glide_speed(measured.theta, measured.vertical_rate, params.polar)
    held = (abs(last.mu) >= limits.mu_max, abs(last.x_p) >= limits.x_p_max)
    adaptive, pid = state.adaptive, state.pid
    if params.adapts:
        adaptive, tau_p, tau_q = adaptive_step(
            adaptive,
            measured,
            reference,
            speed,
            alpha,
            joints.m_b,
            moments(joints.x_p, joints.mu, measured.phi, measured.theta, limits),
            held,
            params.adaptive,
            dt,
        )
    else:
        pid, tau_p, tau_q = pid_step(
            pid, measured, reference, speed, held[1], held[0], params.pid, dt
        )
    return adaptive, pid, tau_p, tau_q


@kernel
def control_surface(state):
    """Bring the vehicle to the surface, now and for good."""
    seen = state.watch
    return ControlState(
        state.tick,
        state.measured,
        state.adaptive,
        state.pid,
        state.trim,
        state.command,
        WatchState(
            seen.gate,
            seen.joints,
            seen.joints_s,
            seen.reference,
            seen.reference_s,
            seen.lag_m,
            seen.lag_s,
            seen.still_s,
            seen.deep_s,
            seen.refused_s,
            seen.buoyancy,
            seen.pitch,
            seen.roll,
            seen.told | ORDERED,
        ),
    )


@kernel
def control_step(state, odometry, joints, reference, params, dt):
    """One tick of control.

    Parameters
    ----------
    state : ControlState
    odometry : Odometry
        Measured pose and velocity over ground; what the gate refuses is not acted on.
    joints : Joints
        Where the actuators are.
    reference : Reference
    params : ControlParams
    dt : float
        Length of the tick (s).

    Returns
    -------
    ControlState, ControlOutput
    """
    first = state.tick == 0
    seen = take_in(state.watch, odometry, joints, reference, params.watch, dt)
    odometry, joints = seen.gate.odometry, seen.joints
    last = joints if first else state.command
    limits = params.allocation
    measured = measure(state.measured, odometry, first, params.attitude_s, dt)
    before = odometry if first else state.watch.gate.odometry
    watched = watch(seen, before, measured.vertical_rate, last, params.watch, dt)

    adaptive, pid, trim = state.adaptive, state.pid, state.trim
    command, tau_p, tau_q = last, 0.0, 0.0
    m_b = last.m_b
    if watched.told & SURFACES:
        command, m_b = params.safe_command, params.safe_command.m_b
    elif seen.gate.seen:
        adaptive, pid, tau_p, tau_q = attitude_law(state, measured, seen, last, params, dt)
        m_b, trim = vertical_rate_law(state.trim, measured, seen.reference, joints, params, dt)
        mu = allocate_roll(tau_p, measured.phi, measured.theta, limits)
        x_p = allocate_pitch(tau_q, joints.mu, measured.phi, measured.theta, limits)
        command = Joints(
            _hold(m_b, last.m_b, params.dead_band.m_b, limits.m_b_max),
            _hold(x_p, last.x_p, params.dead_band.x_p, limits.x_p_max),
            _hold(mu, last.mu, params.dead_band.mu, limits.mu_max),
        )
    learnt = Adaptation(0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    if params.adapts:
        learnt = adaptation(adaptive, params.adaptive)

    saturation = watched.told
    if abs(command.m_b) >= limits.m_b_max:
        saturation |= SATURATED_BUOYANCY
    if abs(command.x_p) >= limits.x_p_max:
        saturation |= SATURATED_PITCH
    if abs(command.mu) >= limits.mu_max:
        saturation |= SATURATED_ROLL
    output = ControlOutput(command, Wrench(m_b * GRAVITY, tau_p, tau_q), learnt, saturation)
    tick = state.tick + 1 if seen.gate.seen else 0
    return ControlState(tick, measured, adaptive, pid, trim, command, watched), output
