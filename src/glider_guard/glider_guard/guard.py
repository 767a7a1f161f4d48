# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""The guard: what comes in, what it shows, and the command that goes out.

It trusts nobody before it: what it is told is checked again, and an actuator, a sensor or another
block that fails is met with a reaction (`glider_guard.rows`) that needs none of them.
"""

from typing import NamedTuple

from glider_guard.actuators import ActuatorLimits, Followers, follow
from glider_guard.ascent import INITIAL_ASCENT, Ascent, AscentLimits, come_up
from glider_guard.depth import DepthLimits, Depths, Sounding, begin_at, depth_rows, sound
from glider_guard.health import HealthLimits, HealthState, check_health
from glider_guard.rows import (
    DISAGREES,
    DROPS,
    FROZEN,
    HOLDS,
    LATCHED,
    LOST,
    NO_DEMAND,
    ORDERED,
    SURFACES,
)
from glider_guard.weight import Weight, WeightLimits, stopping_m, weigh
from glider_model.base.frames import euler_from_quaternion, rotate_to_ned
from glider_model.base.kernel import kernel
from glider_model.base.signals import SURFACE_TARGET, Battery, Health, Joints, Odometry
from glider_model.onboard.gate import GateParams, GateState, are_believed, gate_step, is_lost


class GuardParams(NamedTuple):
    """Limits of a vehicle, and of what is believed."""

    gate: GateParams
    actuators: ActuatorLimits
    depth: DepthLimits
    health: HealthLimits
    weight: WeightLimits
    has_pressure: bool  #: there is a depth apart from that of odom
    ascent: AscentLimits


class Heard(NamedTuple):
    """What a tick brings, as it is told."""

    demand: Joints  #: of control
    odometry: Odometry
    joints: Joints
    target: float  #: depth that guidance asks for (m); SURFACE_TARGET: the surface, for good
    depth: float  #: by the pressure (m)
    altitude: float  #: height over the bottom (m); 0.0: no echo
    health: Health
    battery: Battery


class Taken(NamedTuple):
    """The last of it that could be believed, and the time since (s)."""

    gate: GateState  #: odometry
    demand: Joints
    demand_s: float
    joints: Joints
    joints_s: float
    target: float
    target_s: float
    depth: float


class GuardState(NamedTuple):
    """The guard between two ticks."""

    tick: int
    taken: Taken
    followers: Followers
    depths: Depths
    health: HealthState
    weight: Weight
    ascent: Ascent
    command: Joints  #: the last one
    told: int  #: rows


class GuardOutput(NamedTuple):
    """What the guard publishes."""

    command: Joints
    drops: bool  #: the weight is let go
    told: int  #: rows


@kernel
def take_in(state, heard, params, dt):
    """What is believed at this tick: `Taken`."""
    limits = params.actuators.range
    demand, demand_s = heard.demand, 0.0
    if not are_believed(demand, limits):
        demand, demand_s = state.demand, state.demand_s + dt
    joints, joints_s = heard.joints, 0.0
    if not are_believed(joints, limits):
        joints, joints_s = state.joints, state.joints_s + dt
    target, target_s = heard.target, 0.0
    if not abs(target) < 1e6:
        target, target_s = state.target, state.target_s + dt
    gate = gate_step(state.gate, heard.odometry, params.gate, dt)
    depth = gate.odometry.p_d
    if params.has_pressure:
        depth = heard.depth if abs(heard.depth) < 1e6 else state.depth
    return Taken(gate, demand, demand_s, joints, joints_s, target, target_s, depth)


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
def _sounding(taken, before, altitude, theta, params):
    """What two ticks tell of the depth, at a pitch (rad)."""
    x = taken.gate.odometry
    _, _, rate = rotate_to_ned(x.q_w, x.q_x, x.q_y, x.q_z, x.u, x.v, x.w)
    target = max(0.0, taken.target)
    stop = stopping_m(theta, rate, params.weight)
    same = _is_same(x, before)
    return Sounding(x.p_d, before.p_d, rate, taken.depth, same, target, stop, altitude)


@kernel
def _intake_rows(taken, params):
    """Rows of what is asked for, and of what is not heard any more."""
    told, hold_s = 0, params.gate.hold_s
    if taken.target <= SURFACE_TARGET:
        told |= ORDERED
    if is_lost(taken.gate, params.gate) or taken.joints_s > hold_s or taken.target_s > hold_s:
        told |= LOST
    if taken.demand_s > hold_s:
        told |= NO_DEMAND
    return told


@kernel
def guard_step(state, heard, params, dt):
    """One tick of the guard.

    Parameters
    ----------
    state : GuardState
    heard : Heard
        Anything may be in it.
    params : GuardParams
    dt : float
        Length of the tick (s).

    Returns
    -------
    GuardState, GuardOutput
    """
    first = state.tick == 0
    taken = take_in(state.taken, heard, params, dt)
    last = taken.joints if first else state.command
    before = taken.gate.odometry if first else state.taken.gate.odometry
    sent = last
    if state.told & HOLDS and not state.told & (SURFACES | DROPS):
        # held level: whether they follow is seen by what is demanded
        sent = Joints(last.m_b, last.x_p, taken.demand.mu, taken.demand.delta)
    followers, told = follow(state.followers, taken.joints, sent, params.actuators, dt)
    x = taken.gate.odometry
    _, theta, _ = euler_from_quaternion(x.q_w, x.q_x, x.q_y, x.q_z)
    at = _sounding(taken, before, heard.altitude, theta, params)
    depths = state.depths
    if first:
        depths = begin_at(at.depth)
    ascends = last.m_b < 0.0
    surfaces = (state.told & (SURFACES | DROPS)) != 0
    depths = sound(depths, at, ascends, params.depth, dt)
    sees = not state.told & (FROZEN | LOST | DISAGREES)
    told |= depth_rows(depths, surfaces, sees, params.depth)
    well = params.health
    health, unwell = check_health(state.health, heard.health, heard.battery, well, dt)
    weight, heavy = weigh(
        state.weight, theta, at.rate, taken.joints.m_b, last.m_b, params.weight, dt
    )
    told |= unwell | heavy | _intake_rows(taken, params) | (state.told & LATCHED)
    command, ascent = taken.demand, INITIAL_ASCENT
    if told & (SURFACES | DROPS):
        sees = not told & (FROZEN | LOST | DISAGREES)
        ascent, command = come_up(state.ascent, at.rate, sees, taken.joints.m_b, params.ascent, dt)
    elif told & HOLDS:
        command = Joints(command.m_b, command.x_p, 0.0, 0.0)
    tick = state.tick + 1 if taken.gate.seen else 0
    output = GuardOutput(command, (told & DROPS) != 0, told)
    state = GuardState(tick, taken, followers, depths, health, weight, ascent, command, told)
    return state, output
