# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""What control watches over: measurements that fail, actuators that do not follow, and the depth.

Some of it is told and no more; some of it brings the vehicle to the surface for good (`SURFACES`).
"""

import math
from typing import NamedTuple

from glider_model.base.kernel import kernel
from glider_model.base.signals import SURFACE_TARGET, Joints, Reference
from glider_model.onboard.gate import INITIAL_GATE, GateParams, GateState, gate_step, is_lost

#: Told: an actuator does not follow its command; a measurement was refused.
STUCK_BUOYANCY, STUCK_PITCH, STUCK_ROLL, REFUSED = 8, 16, 32, 64
#: Told, and a reason to surface for good: it was ordered; deeper than the vehicle is rated for;
#: the depth does not follow the vertical rate, or nothing that is measured moves; no measurement.
ORDERED, TOO_DEEP, FROZEN, LOST = 128, 256, 512, 1024
#: Told as of the three other actuators.
STUCK_SURFACE = 2048
SURFACES = ORDERED | TOO_DEEP | FROZEN | LOST
STUCK = STUCK_BUOYANCY | STUCK_PITCH | STUCK_ROLL | STUCK_SURFACE
#: What the bits are called, and what they say.
ROWS = {
    STUCK_BUOYANCY: ('buoyancy_engine_stuck', 'buoyancy engine'),
    STUCK_PITCH: ('pitch_mass_stuck', 'pitch mass'),
    STUCK_ROLL: ('roll_mass_stuck', 'roll mass'),
    REFUSED: ('measurement_refused', 'a measurement'),
    ORDERED: ('surface_ordered', 'ordered'),
    TOO_DEEP: ('too_deep', 'deeper than the vehicle is rated for'),
    FROZEN: ('measurement_frozen', 'the measured depth, or all that is measured, stands still'),
    LOST: ('measurement_lost', 'nothing usable is measured'),
    STUCK_SURFACE: ('steering_surface_stuck', 'steering surface'),
}
#: A change of what is told is told at most once in this time (ns).
TELL_EVERY_NS = 1_000_000_000

#: Below the rated depth a vehicle may be by this share of it, and no less than so much (m): the
#: lower turn overshoots, with a pump at a third of its rate by 48 m. Longer than this (s) it may
#: not.
DEPTH_MARGIN_SHARE, DEPTH_MARGIN_M, TOO_DEEP_S = 0.05, 10.0, 1.0
#: Way that the vertical rate makes less that of the depth (m), of which the past fades (s): more
#: than this for so long (s) is a depth that is frozen.
LAG_M, LAG_FADES_S, LAG_S = 20.0, 600.0, 10.0
#: Below the surface (m), a measurement that has not changed by a bit for so long (s) is frozen.
STILL_BELOW_M, STILL_S = 5.0, 30.0
#: An actuator that is off its command by this share of its range, and in this time (s) does not go
#: as much, or a tenth of what its rate allows, does not follow.
FOLLOW_SHARE, STALL_S, STALL_RATE_SHARE = 0.02, 60.0, 0.1
#: Actuators that say they are farther out than this many ranges are not believed.
JOINT_RANGES = 1.5
#: A refusal is told for so long (s): an event is told once a second at most.
REFUSAL_TOLD_S = 2.0


class WatchParams(NamedTuple):
    """Limits of a vehicle, and of what is believed."""

    gate: GateParams
    depth_max: float  #: deepest that is no reason to surface (m); infinite if nobody says
    range: Joints  #: of the actuators
    progress: Joints  #: least way in STALL_S of an actuator that follows


class Follower(NamedTuple):
    """Where an actuator was when it last followed its command, and the time since (s)."""

    position: float
    waits_s: float


class WatchState(NamedTuple):
    """What is watched, between two ticks."""

    gate: GateState  #: the odometry that serves
    joints: Joints  #: the last that were believed, and the time since (s)
    joints_s: float
    reference: Reference  #: the last that was finite, and the time since (s)
    reference_s: float
    lag_m: float  #: of the measured depth behind the vertical rate
    lag_s: float  #: for which it has been too much
    still_s: float  #: for which no measured number has changed
    deep_s: float  #: for which the vehicle has been too deep
    refused_s: float  #: time since something was refused
    buoyancy: Follower
    pitch: Follower
    roll: Follower
    surface: Follower  #: the steering surface
    told: int  #: sum of the bits above; those of SURFACES stay


_STILL = Follower(0.0, 0.0)
INITIAL_WATCH = WatchState(
    INITIAL_GATE,
    Joints(0.0, 0.0, 0.0, 0.0),
    0.0,
    Reference(*(12 * (0.0,))),
    0.0,
    0.0,
    0.0,
    0.0,
    0.0,
    REFUSAL_TOLD_S,
    _STILL,
    _STILL,
    _STILL,
    _STILL,
    0,
)


def make_watch(vehicle, rated_depth_m: float, gate: GateParams) -> WatchParams:
    """Limits of a vehicle (VehicleParams) that is rated for a depth, infinite if nobody says."""
    margin_m = max(DEPTH_MARGIN_M, DEPTH_MARGIN_SHARE * rated_depth_m)
    ranges = Joints(vehicle.m_b_max, vehicle.x_p_max, vehicle.mu_max, vehicle.delta_max)
    rates = Joints(vehicle.m_b_rate, vehicle.x_p_rate, vehicle.mu_rate, vehicle.delta_rate)
    progress = (
        min(FOLLOW_SHARE * most, STALL_RATE_SHARE * rate * STALL_S)
        for most, rate in zip(ranges, rates, strict=True)
    )
    return WatchParams(gate, rated_depth_m + margin_m, ranges, Joints(*progress))


def say(told: int) -> str:
    """What some of the bits above say, in words; empty if they say nothing."""
    parts = {
        'surfacing for good': SURFACES,
        'does not follow its command': STUCK,
        'refused, the last good one serves': REFUSED,
    }
    named = {
        what: ', '.join(name for bit, (_, name) in ROWS.items() if told & bits & bit)
        for what, bits in parts.items()
    }
    return '; '.join(f'{what}: {names}' for what, names in named.items() if names)


@kernel
def _are_believed(joints, ranges):
    """Whether actuators can be where they say; false for NaN."""
    return (
        abs(joints.m_b) <= JOINT_RANGES * ranges.m_b
        and abs(joints.x_p) <= JOINT_RANGES * ranges.x_p
        and abs(joints.mu) <= JOINT_RANGES * ranges.mu
        and abs(joints.delta) <= JOINT_RANGES * ranges.delta
    )


@kernel
def _is_finite(reference):
    """Whether every number that control uses of a reference is finite."""
    a = reference
    return math.isfinite(
        a.p_d + a.phi + a.theta + a.psi + a.v_d + a.phi_dot + a.theta_dot + a.psi_dot
    )


@kernel
def _is_same(a, b):
    """Whether two samples of odometry are equal in every number."""
    return (
        a.p_n == b.p_n
        and a.p_e == b.p_e
        and a.p_d == b.p_d
        and a.q_w == b.q_w
        and a.q_x == b.q_x
        and a.q_y == b.q_y
        and a.q_z == b.q_z
        and a.u == b.u
        and a.v == b.v
        and a.w == b.w
        and a.p == b.p
        and a.q == b.q
        and a.r == b.r
    )


@kernel
def _follow(state, position, command, tolerance, progress, dt):
    """Whether an actuator follows: `Follower` of the next tick."""
    if abs(command - position) <= tolerance or abs(position - state.position) > progress:
        return Follower(position, 0.0)
    return Follower(state.position, state.waits_s + dt)


@kernel
def _depth_lag(lag_m, depth, depth_before, vertical_rate, jump_m, dt):
    """Lag (m) of the depth behind the vertical rate; a depth that was set anew has none."""
    fallen = depth - depth_before
    if abs(fallen) > jump_m:
        return 0.0
    return lag_m + dt * (vertical_rate - lag_m / LAG_FADES_S) - fallen


@kernel
def take_in(state, odometry, joints, reference, params, dt):
    """Take in what a tick brings; what cannot be is refused, and the last good ones serve.

    Returns
    -------
    WatchState
        With odometry (``gate.odometry``), ``joints`` and ``reference`` that can be worked with.
    """
    gate = gate_step(state.gate, odometry, params.gate, dt)
    joints_s, reference_s, refused_s = 0.0, 0.0, state.refused_s + dt
    if not _are_believed(joints, params.range):
        joints, joints_s = state.joints, state.joints_s + dt
    if not _is_finite(reference):
        reference, reference_s = state.reference, state.reference_s + dt
    if gate.age_s > 0.0 or joints_s > 0.0 or reference_s > 0.0:
        refused_s = 0.0
    return WatchState(
        gate,
        joints,
        joints_s,
        reference,
        reference_s,
        state.lag_m,
        state.lag_s,
        state.still_s,
        state.deep_s,
        refused_s,
        state.buoyancy,
        state.pitch,
        state.roll,
        state.surface,
        state.told,
    )


@kernel
def watch(state, before, vertical_rate, command, params, dt):
    """Look after what has been taken in.

    Parameters
    ----------
    state : WatchState
        From `take_in`.
    before : Odometry
        The odometry that served in the tick before.
    vertical_rate : float
        Measured (m/s, + down).
    command : Joints
        Last command.
    params : WatchParams
    dt : float

    Returns
    -------
    WatchState
    """
    odometry, joints, most = state.gate.odometry, state.joints, params.range
    depth = odometry.p_d
    lag_m = _depth_lag(state.lag_m, depth, before.p_d, vertical_rate, params.gate.depth_jump, dt)
    lag_s = state.lag_s + dt if abs(lag_m) > LAG_M else 0.0
    is_still = depth > STILL_BELOW_M and _is_same(odometry, before)
    still_s = state.still_s + dt if is_still else 0.0
    deep_s = state.deep_s + dt if depth > params.depth_max else 0.0
    progress = params.progress
    buoyancy = _follow(
        state.buoyancy, joints.m_b, command.m_b, FOLLOW_SHARE * most.m_b, progress.m_b, dt
    )
    pitch = _follow(
        state.pitch, joints.x_p, command.x_p, FOLLOW_SHARE * most.x_p, progress.x_p, dt
    )
    roll = _follow(state.roll, joints.mu, command.mu, FOLLOW_SHARE * most.mu, progress.mu, dt)
    surface = _follow(
        state.surface, joints.delta, command.delta, FOLLOW_SHARE * most.delta, progress.delta, dt
    )

    told = state.told & SURFACES
    if buoyancy.waits_s > STALL_S:
        told |= STUCK_BUOYANCY
    if pitch.waits_s > STALL_S:
        told |= STUCK_PITCH
    if roll.waits_s > STALL_S:
        told |= STUCK_ROLL
    if surface.waits_s > STALL_S:
        told |= STUCK_SURFACE
    if state.refused_s < REFUSAL_TOLD_S:
        told |= REFUSED
    if state.reference.p_d <= SURFACE_TARGET:
        told |= ORDERED
    if deep_s > TOO_DEEP_S:
        told |= TOO_DEEP
    if lag_s > LAG_S or still_s > STILL_S:
        told |= FROZEN
    hold_s = params.gate.hold_s
    if is_lost(state.gate, params.gate) or state.joints_s > hold_s or state.reference_s > hold_s:
        told |= LOST
    return WatchState(
        state.gate,
        joints,
        state.joints_s,
        state.reference,
        state.reference_s,
        lag_m,
        lag_s,
        still_s,
        deep_s,
        state.refused_s,
        buoyancy,
        pitch,
        roll,
        surface,
        told,
    )
