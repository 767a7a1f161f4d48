# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""The guard: what comes in, what it shows, and the command that goes out.

It trusts nobody before it: what comes in is checked again, and an actuator, a sensor or another
block that fails is met with a reaction (`glider_guard.rows`) that needs none of them.
"""

import math
from typing import NamedTuple

from glider_base.frames import pitch_of, rotate_to_ned
from glider_base.kernel import kernel, replace
from glider_base.signals import SURFACE_TARGET, Battery, Covariance, Health, Joints, Odometry
from glider_guard import rows
from glider_guard.actuators import INITIAL_FOLLOWERS, ActuatorLimits, Followers, follow
from glider_guard.ascent import INITIAL_ASCENT, Ascent, AscentLimits, Rise, come_up
from glider_guard.depth import (
    INITIAL_DEPTHS,
    DepthLimits,
    Depths,
    Sounding,
    begin_at,
    depth_rows,
    sinking_rate,
    sound,
)
from glider_guard.rows import row
from glider_guard.weight import (
    INITIAL_WEIGHT,
    Glide,
    Weight,
    WeightLimits,
    led_rate,
    sinking_weight,
    sinks_on_m,
    sure_share,
    turning_m,
    weigh,
)
from glider_guard.witness import (
    AFLOAT_M,
    INITIAL_WITNESS,
    SURFACE_M,
    Shown,
    Witness,
    WitnessLimits,
    begin_watch,
    is_out,
    watch,
)
from glider_model.onboard.fix_watch import FixWatch, contradictions, watch_fixes
from glider_model.onboard.gate import (
    INITIAL_GATE,
    GateParams,
    GateState,
    are_plausible,
    gate_step,
    is_lost,
)
from glider_model.onboard.glide_polar import glide_attacks

#: So many of the last six surfacings end the mission, whose fixes contradict navigation.
TOO_MANY = 2


class HealthLimits(NamedTuple):
    """What health sensors may say."""

    vacuum_min: float  #: (Pa)
    vacuum_max: float
    battery_min: float  #: (V)
    reserve: float  #: share of the battery that is kept for coming home (-)
    contact_s: float  #: infinite: any
    health_s: float  #: for so long it may be otherwise


class HealthState(NamedTuple):
    """For how long each has not been well (s)."""

    leak_s: float = 0.0
    vacuum_s: float = 0.0
    battery_s: float = 0.0


@kernel
def check_health(state, health, battery, limits, dt):
    """Health a tick later (`HealthState`), and the rows that hold; less than 0 is not measured."""
    vacuum = health.vacuum_pa
    is_off = vacuum >= 0.0 and not limits.vacuum_min <= vacuum <= limits.vacuum_max
    is_low = 0.0 <= battery.voltage < limits.battery_min
    is_low = is_low or 0.0 <= battery.percentage < limits.reserve
    state = HealthState(
        state.leak_s + dt if health.leak > 0.5 else 0.0,
        state.vacuum_s + dt if is_off else 0.0,
        state.battery_s + dt if is_low else 0.0,
    )
    reported = row(rows.LEAK, state.leak_s > limits.health_s)
    reported |= row(rows.VACUUM, state.vacuum_s > limits.health_s)
    reported |= row(rows.BATTERY, state.battery_s > limits.health_s)
    return state, reported | row(rows.NO_CONTACT, health.contact_age_s > limits.contact_s)


class GuardParams(NamedTuple):
    """Limits of a vehicle, and of what is plausible."""

    gate: GateParams
    actuators: ActuatorLimits
    depth: DepthLimits
    health: HealthLimits
    weight: WeightLimits
    has_pressure: bool  #: there is a depth apart from that of odom
    ascent: AscentLimits
    witness: WitnessLimits


class Received(NamedTuple):
    """What a tick brings, as it comes."""

    demand: Joints  #: of control
    odometry: Odometry
    joints: Joints
    target: float  #: depth that guidance asks for (m); SURFACE_TARGET: the surface, for good
    depth: float  #: by the pressure (m)
    altitude: float  #: height over the bottom (m); 0.0: no echo
    health: Health
    battery: Battery
    known: Covariance = Covariance(0.0, 0.0, 0.0)  #: of the place of the odometry (m^2)


_REST = Joints(0.0, 0.0, 0.0, 0.0)


class Taken(NamedTuple):
    """The last of it that was plausible, and the time since (s)."""

    gate: GateState = INITIAL_GATE  #: odometry
    demand: Joints = _REST
    demand_s: float = 0.0
    joints: Joints = _REST
    joints_s: float = 0.0
    target: float = 0.0
    target_s: float = 0.0


class GuardState(NamedTuple):
    """The guard between two ticks."""

    tick: int = 0
    taken: Taken = Taken()
    followers: Followers = INITIAL_FOLLOWERS
    witness: Witness = INITIAL_WITNESS
    depths: Depths = INITIAL_DEPTHS
    health: HealthState = HealthState()
    weight: Weight = INITIAL_WEIGHT
    ascent: Ascent = INITIAL_ASCENT
    fixes: FixWatch = FixWatch()
    command: Joints = _REST  #: the last one
    reported: int = 0  #: rows
    t_s: float = 0.0  #: of this tick (s)


INITIAL_GUARD = GuardState()


class GuardOutput(NamedTuple):
    """What the guard publishes."""

    command: Joints
    drops: bool  #: the weight is let go
    reported: int  #: rows


@kernel
def _serves(received, is_good, last, last_s, dt):
    """What is received, or what was before and the time since (s)."""
    return (received, 0.0) if is_good else (last, last_s + dt)


@kernel
def take_in(state, received, params, dt):
    """What counts at this tick: `Taken`."""
    limits = params.actuators.range
    is_good = are_plausible(received.demand, limits)
    demand, demand_s = _serves(received.demand, is_good, state.demand, state.demand_s, dt)
    is_good = are_plausible(received.joints, limits)
    joints, joints_s = _serves(received.joints, is_good, state.joints, state.joints_s, dt)
    is_good = abs(received.target) < 1e6
    target, target_s = _serves(received.target, is_good, state.target, state.target_s, dt)
    gate = gate_step(state.gate, received.odometry, params.gate, dt)
    return Taken(
        gate=gate,
        demand=demand,
        demand_s=demand_s,
        joints=joints,
        joints_s=joints_s,
        target=target,
        target_s=target_s,
    )


@kernel
def _intake_rows(taken, params):
    """Rows of what is asked for, and of what does not come any more."""
    hold_s = params.gate.hold_s
    lost = is_lost(taken.gate, params.gate) or taken.joints_s > hold_s or taken.target_s > hold_s
    reported = row(rows.ORDERED, taken.target <= SURFACE_TARGET) | row(rows.LOST, lost)
    return reported | row(rows.NO_DEMAND, taken.demand_s > hold_s)


@kernel
def fix_rows(watch):
    """Rows that hold by a `FixWatch`."""
    count = contradictions(watch)
    if count >= TOO_MANY:
        return rows.CONTRADICTED | rows.ASTRAY
    return rows.CONTRADICTED if count > 0 else 0


@kernel
def _sent(last, demand, reported):
    """Where actuators are sent: held level, whether they follow is seen by what is demanded."""
    if reported & rows.HOLDS and not reported & (rows.SURFACES | rows.DROPS):
        return Joints(last.m_b, last.x_p, demand.mu, demand.delta)
    return last


@kernel
def _react(state, taken, reported, glide, is_same, witness, params, dt):
    """Ascent a tick later, and the command of this one: what is demanded, held level, or up."""
    demand = taken.demand
    if reported & (rows.SURFACES | rows.DROPS):
        seen, x_p = not state.reported & rows.BLIND, taken.joints.x_p
        is_stuck = ((reported | state.reported) & rows.STUCK_PITCH) != 0
        rise = Rise(
            rate=glide.sinking if seen else (witness.raw - state.witness.raw) / dt,
            sees=not reported & rows.BLIND,
            moves=witness.same_s < params.witness.same_s,
            under=glide.under,
            theta=glide.theta,
            is_new=not is_same,
            m_b=glide.m_b,
            x_p=x_p,
            is_there=is_stuck or abs(x_p - state.command.x_p) <= params.ascent.there,
        )
        return come_up(state.ascent, rise, params.ascent, dt)
    if reported & rows.HOLDS:
        return INITIAL_ASCENT, Joints(demand.m_b, demand.x_p, 0.0, 0.0)
    return INITIAL_ASCENT, demand


@kernel
def _sounding(state, taken, before, received, shown, witness, last, reported, params):
    """What a tick tells of the depth: `Sounding`.

    ``before`` is the odometry that counted a tick before, ``last`` where the actuators were
    sent last, ``reported`` the rows that hold by now.
    """
    x, m_b, rate = taken.gate.odometry, taken.joints.m_b, witness.rate
    north, east, down = rotate_to_ned(x.q_w, x.q_x, x.q_y, x.q_z, x.u, x.v, x.w)
    sinks = sinking_weight(state.weight, m_b, params.weight)
    neutral = -params.weight.ballast - state.weight.off
    is_stuck = ((reported | state.reported) & rows.STUCK_BUOYANCY) != 0
    is_pumped = is_stuck or m_b <= params.ascent.pumped
    led = shown.led if shown.is_glide else 0.0
    # in a slow dive of a light vehicle the pump is on its light side
    is_asked_up = taken.target < witness.depth
    ascends = last.m_b <= params.ascent.pumped
    ascends = ascends or (is_asked_up and last.m_b < min(0.0, neutral))
    is_afloat = witness.depth <= SURFACE_M
    if received.health.contact_age_s >= 0.0:
        is_afloat = is_out(witness) or (
            witness.depth <= AFLOAT_M and not state.reported & rows.BLIND
        )
    return Sounding(
        odom=x.p_d,
        before=before.p_d,
        odom_rate=down,
        odom_speed=math.hypot(north, east),
        depth=witness.depth,
        rate=rate,
        apart_m=witness.apart_m,
        is_same=shown.is_same,
        target=max(0.0, taken.target),
        stop=turning_m(rate, sinks, params.weight),
        drop_way=sinks_on_m(rate, sinks, m_b, is_pumped, params.weight),
        led=led,
        sure=sure_share(state.weight, m_b, params.weight),
        altitude=received.altitude,
        is_sent_up=last.m_b < max(0.0, neutral),
        ascends=ascends,
        surfaces=(state.reported & (rows.SURFACES | rows.DROPS)) != 0,
        is_pumped=is_pumped,
        is_out=is_out(witness),
        is_afloat=is_afloat,
    )


@kernel
def guard_step(
    state: GuardState, received: Received, params: GuardParams, dt: float
) -> tuple[GuardState, GuardOutput]:
    """One tick of the guard, of ``dt`` s; anything may be in what is received."""
    first = state.tick == 0
    taken = take_in(state.taken, received, params, dt)
    last = taken.joints if first else state.command
    before = taken.gate.odometry if first else state.taken.gate.odometry
    sent = _sent(last, taken.demand, state.reported)
    followers, reported = follow(state.followers, taken.joints, sent, params.actuators, dt)
    x, m_b = taken.gate.odometry, taken.joints.m_b
    theta = pitch_of(x.q_w, x.q_x, x.q_y, x.q_z)
    _, _, rate = rotate_to_ned(x.q_w, x.q_x, x.q_y, x.q_z, x.u, x.v, x.w)
    sees = not state.reported & rows.BLIND
    attack, _ = glide_attacks(theta, theta, params.weight.polar)
    led, is_glide = led_rate(state.weight, theta, attack, m_b, params.weight)
    shown = Shown(
        raw=received.depth if params.has_pressure else received.odometry.p_d,
        odom=x.p_d,
        odom_before=before.p_d,
        contact_age_s=received.health.contact_age_s,
        rate=rate,
        led=led,
        is_glide=is_glide,
        is_same=x == before,
    )
    witness, depths = state.witness, state.depths
    if first:
        witness, depths = begin_watch(shown.raw, x.p_d), begin_at(x.p_d)
    witness, wrong = watch(witness, shown, sees, params.witness, dt)
    at = _sounding(state, taken, before, received, shown, witness, last, reported, params)
    depths = sound(depths, at, params.depth, dt)
    if sees and not at.surfaces and at.depth <= SURFACE_M and depths.led_m > params.depth.led_m:
        witness = replace(witness, depth=depths.led_m)  # it was led there, whatever is shown
    # without a depth, a leak alone is certain
    floods = (state.reported & (rows.LEAK | rows.TOO_HEAVY if sees else rows.LEAK)) != 0
    reported |= wrong | depth_rows(depths, at.surfaces, sees, floods, params.depth)
    health, bad = check_health(state.health, received.health, received.battery, params.health, dt)
    sinking = sinking_rate(depths) if sees else rate
    under = witness.depth > SURFACE_M
    glide = Glide(
        theta=theta,
        attack=attack,
        rate=rate,
        sinking=sinking,
        m_b=m_b,
        sent=last.m_b,
        depth=witness.depth,
        target=taken.target,
        under=under,
    )
    weight, heavy = weigh(state.weight, glide, params.weight, dt)
    fixes = watch_fixes(state.fixes, received.odometry, received.known, dt)
    reported |= bad | heavy | fix_rows(fixes) | _intake_rows(taken, params)
    reported |= state.reported & rows.LATCHED
    ascent, command = _react(state, taken, reported, glide, shown.is_same, witness, params, dt)
    tick = state.tick + 1 if taken.gate.seen else 0
    output = GuardOutput(command, (reported & rows.DROPS) != 0, reported)
    state = GuardState(
        tick=tick,
        taken=taken,
        followers=followers,
        witness=witness,
        depths=depths,
        health=health,
        weight=weight,
        ascent=ascent,
        fixes=fixes,
        command=command,
        reported=reported,
        t_s=state.t_s,
    )
    return state, output
