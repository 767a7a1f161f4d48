# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""Control: intake, measurement, attitude law, steering, vertical-rate law and allocation.

The channels cannot be swapped: buoyancy sets speed and vertical rate, the mass forward or aft sets
pitch, the mass turned to a side sets roll and so heading, unless a steering surface does.
"""

import math
from typing import NamedTuple

from glider_base.kernel import kernel, replace
from glider_base.signals import Adaptation, Joints, Wrench
from glider_control.allocation import (
    AllocationParams,
    allocate_pitch,
    allocate_roll,
    limit_surface,
    moments,
)
from glider_control.intake import (
    REFUSED,
    IntakeParams,
    IntakeState,
    is_blind,
    is_refusing,
    take_in,
)
from glider_control.law import Seen, law_learnt, law_step
from glider_control.stall import leave_stall, watch_stall
from glider_control.surface import steer, surface_learnt
from glider_control.vertical_rate import Trim, rate_error, vertical_rate_law
from glider_model.onboard.attitude_filter import Measured, measure
from glider_model.onboard.glide_polar import NO_ATTACK, Polar, glide_attacks, glide_speed
from glider_model.vehicle.rigid_body import GRAVITY

#: Bits of ``ControlOutput.saturation``; REFUSED, and those of `glider_guard.rows`, are others.
SATURATED_BUOYANCY, SATURATED_PITCH, SATURATED_ROLL, SATURATED_SURFACE = 1, 2, 4, 4096
#: Shallower than this a vehicle is afloat, until it is deeper than that (m).
AFLOAT_M, SUBMERGED_M = 1.0, 2.0
#: Pitch of a vehicle afloat (rad).
AFLOAT_PITCH = math.radians(-40.0)


class ControlParams(NamedTuple):
    """Control as the kernels see it."""

    allocation: AllocationParams
    polar: Polar
    law: NamedTuple  #: of the law that was chosen
    steering: NamedTuple  #: by the vehicle's steering surface
    buoyancy_ki: float  #: (kg/m)
    drag_ki: float  #: (kg/m)
    buoyancy_trim_max: float  #: (kg)
    attitude_s: float
    dead_band: Joints
    safe_command: Joints  #: as buoyant as possible, mass at the climb stop, no roll, no turn
    intake: IntakeParams


class ControlState(NamedTuple):
    """Control between two ticks."""

    tick: int
    measured: Measured
    law: NamedTuple  #: of the law that was chosen
    steering: NamedTuple  #: by the vehicle's steering surface
    trim: Trim = Trim(0.0, 0.0)
    command: Joints = Joints(0.0, 0.0, 0.0, 0.0)  #: last command
    intake: IntakeState = IntakeState()
    depth: float = 0.0  #: filtered as the attitude is (m)
    rate_error: float = 0.0  #: of the vertical rate, by the depth (m/s)
    is_afloat: bool = True
    stall_s: float = 0.0  #: for which it has stalled; less than 0: it is led out of it so long


class ControlOutput(NamedTuple):
    """What control publishes."""

    command: Joints
    wrench: Wrench
    adaptation: Adaptation
    saturation: int  #: sum of SATURATED_* bits and of REFUSED


@kernel
def _hold(command, last, band, limit):
    """``last``, unless the command leaves the dead band or reaches the end of the range."""
    if abs(command - last) <= band and abs(command) < limit:
        return last
    return command


@kernel
def _saturation(command, limits):
    """Which actuators are sent to their limits: a sum of SATURATED_* bits."""
    saturation = 0
    if abs(command.m_b) >= limits.m_b_max:
        saturation |= SATURATED_BUOYANCY
    if abs(command.x_p) >= limits.x_p_max:
        saturation |= SATURATED_PITCH
    if 0.0 < limits.mu_max <= abs(command.mu):
        saturation |= SATURATED_ROLL
    if 0.0 < limits.delta_max <= abs(command.delta):
        saturation |= SATURATED_SURFACE
    return saturation


@kernel
def see(measured, reference, joints, last, params, attack=NO_ATTACK):
    """What a law sees, at a reference, of what was taken in."""
    limits = params.allocation
    speed, alpha = glide_speed(measured.theta, measured.vertical_rate, params.polar, attack)
    tau_p, tau_q = moments(joints.m_b, joints.x_p, joints.mu, measured.phi, measured.theta, limits)
    return Seen(
        measured=measured,
        reference=reference,
        speed=speed,
        alpha=alpha,
        m_b=joints.m_b,
        tau_p=tau_p,
        tau_q=tau_q,
        roll_held=abs(last.mu) >= limits.mu_max,
        pitch_held=abs(last.x_p) >= limits.x_p_max,
        delta=joints.delta,
    )


@kernel
def rest_afloat(m_b, params):
    """Actuators of a vehicle afloat: no roll, no turn, and balanced nose down, antenna up.

    Without way through the water there is nothing to steer by: a law would swing the vehicle. One
    that begins to sink level stays in a stall; nose down it glides from the first metre on.
    """
    x_p = allocate_pitch(0.0, m_b, 0.0, 0.0, AFLOAT_PITCH, params)
    return Joints(m_b, x_p, 0.0, 0.0)


@kernel
def control_step(state, odometry, joints, reference, params, dt):
    """One tick of control, of ``dt`` s.

    What the gate refuses of the odometry, pose and velocity over ground, is not acted on;
    ``joints`` is where the actuators are. Returns `ControlState` and `ControlOutput`.
    """
    first = state.tick == 0
    taken = take_in(state.intake, odometry, joints, reference, params.intake, dt)
    odometry, joints = taken.gate.odometry, taken.joints
    last = joints if first else state.command
    limits = params.allocation
    attitude = measure(state.measured, odometry, first, params.attitude_s, dt)
    before = odometry.p_d if first else state.depth
    depth = before + dt / (params.attitude_s + dt) * (odometry.p_d - before)
    error, off = rate_error(state.rate_error, attitude.vertical_rate, depth - before, dt)
    measured = replace(attitude, vertical_rate=attitude.vertical_rate - off)
    is_afloat = depth < (SUBMERGED_M if state.is_afloat else AFLOAT_M)

    law, steering, trim, stall_s = state.law, state.steering, state.trim, state.stall_s
    command, m_b, tau_p, tau_q = last, last.m_b, 0.0, 0.0
    if is_blind(taken, params.intake):
        command, m_b = params.safe_command, params.safe_command.m_b
    elif taken.gate.seen:
        reference = taken.reference
        attack, asked = glide_attacks(measured.theta, reference.theta, params.polar)
        m_b, trim = vertical_rate_law(
            state.trim, measured, reference, joints, is_afloat, params, dt, asked
        )
        stall_s = watch_stall(stall_s, measured, reference, joints.m_b, params, dt)
        if stall_s < 0.0:
            m_b, trim, reference = leave_stall(stall_s, m_b, trim, reference)
        phi, theta = measured.phi, measured.theta
        if is_afloat:
            wanted = rest_afloat(m_b, limits)
            tau_p, tau_q = moments(m_b, wanted.x_p, wanted.mu, phi, theta, limits)
        else:
            seen = see(measured, reference, joints, last, params, attack)
            law, tau_p, tau_q = law_step(law, seen, params.law, dt)
            steering, delta = steer(steering, seen, params.steering, dt)
            mu = allocate_roll(tau_p, phi, theta, limits)
            x_p = allocate_pitch(tau_q, joints.m_b, joints.mu, phi, theta, limits)
            wanted = Joints(m_b, x_p, mu, limit_surface(delta, limits))
        band = params.dead_band
        command = Joints(
            _hold(wanted.m_b, last.m_b, band.m_b, limits.m_b_max),
            _hold(wanted.x_p, last.x_p, band.x_p, limits.x_p_max),
            _hold(wanted.mu, last.mu, band.mu, limits.mu_max),
            _hold(wanted.delta, last.delta, band.delta, limits.delta_max),
        )
    saturation = _saturation(command, limits) | (REFUSED if is_refusing(taken) else 0)
    learnt = surface_learnt(law_learnt(law, params.law), steering, params.steering)
    output = ControlOutput(command, Wrench(m_b * GRAVITY, tau_p, tau_q), learnt, saturation)
    tick = state.tick + 1 if taken.gate.seen else 0
    state = ControlState(
        tick=tick,
        measured=attitude,
        law=law,
        steering=steering,
        trim=trim,
        command=command,
        intake=taken,
        depth=depth,
        rate_error=error,
        is_afloat=is_afloat,
        stall_s=stall_s,
    )
    return state, output
