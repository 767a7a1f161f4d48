# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""The plant: six degrees of freedom, three actuators, the water around them.

    p'     = R_NB nu_r + v_c
    q'     = 1/2 q (x) [0, omega]
    M nu'  = tau_h + tau_g - C_RB(omega) nu - C_A(nu) nu - M_RB [R_NB^T v_c'; 0]

nu is the velocity through the water. v_c' is what the vehicle sees of a changing current, its own
way through a shear included; it is the change over the last tick.
"""

import math
from typing import NamedTuple

from pydantic import Field

from glider_model.base.frames import quaternion_from_euler, rotate_to_body, rotate_to_ned
from glider_model.base.kernel import kernel
from glider_model.base.settings import Settings
from glider_model.base.signals import TICK_S, Joints, Odometry, Water, not_finite
from glider_model.ocean.density import (
    DensityParams,
    DensitySettings,
    buoyancy_gain,
    emerged_fraction,
)
from glider_model.plant.exponential import decay_weights
from glider_model.plant.sensors import SensorParams, SensorSettings, add_noise
from glider_model.vehicle.actuators import actuators_step
from glider_model.vehicle.file import VehicleParams, load_vehicle
from glider_model.vehicle.hydrodynamics import hydrodynamics, rate_damping
from glider_model.vehicle.perturb import PerturbSettings, perturbed
from glider_model.vehicle.rigid_body import GRAVITY, coriolis, make_inertia, solve_mass

#: A tick is one step; a step with a larger error is taken again as two, and so on (J). In all
#: shipped scenarios it stays below 1e-7.
LARGEST_ERROR_J = 1e-6
#: Steps in a tick at most.
MOST_STEPS = 256
#: A dive counts once the vehicle, having been below the first depth, is above the second (m)
DIVE_BELOW_M, DIVE_ABOVE_M = 30.0, 20.0
#: but in shallow profiles below and above these shares of their depth.
DIVE_BELOW_SHARE, DIVE_ABOVE_SHARE = 0.7, 0.6
#: Time at the surface after the last dive (s).
SURFACE_S = 60.0
#: Shallower than this the vehicle is at the surface (m).
SURFACE_M = 1.5
#: A vehicle that has been below this has dived, not only bobbed (m).
DIVED_M = 3.0
#: Damping ratio of heave at the surface, where the hull radiates waves (-).
SURFACE_DAMPING = 0.2


class Motion(NamedTuple):
    """What is integrated: position (m), attitude q_NB, velocity through the water, rates."""

    p_n: float
    p_e: float
    p_d: float
    q_w: float
    q_x: float
    q_y: float
    q_z: float
    u: float
    v: float
    w: float
    p: float
    q: float
    r: float


class Rates(NamedTuple):
    """Something about each of the three angular rates."""

    p: float
    q: float
    r: float


class PlantState(NamedTuple):
    """State of the plant at a tick."""

    motion: Motion
    joints: Joints
    water: Water  #: water velocity during the tick that led here
    tick: int
    deep: bool  #: has been below where a dive counts since it was last above
    dives: int  #: completed dives
    surface_ticks: int  #: ticks at the surface without a break
    afloat_ticks: int  #: those in which the pump was not filled; -1: has not dived yet


class PlantParams(NamedTuple):
    """Vehicle, water, where the run ends, and the noise of what is measured."""

    vehicle: VehicleParams
    water: DensityParams
    max_ticks: int
    stop_after_dives: int  #: 0: only max_ticks ends the run
    stop_surface_ticks: int
    stop_afloat_ticks: int  #: 0: never
    dive_below: float  #: a dive counts once the vehicle, having been below this (m)
    dive_above: float  #: is above this (m)
    sensors: SensorParams


def dive_depths(depth_m: float) -> tuple[float, float]:
    """Depths (m) below and then above which a dive of a profile to ``depth_m`` counts."""
    return (
        min(DIVE_BELOW_M, DIVE_BELOW_SHARE * depth_m),
        min(DIVE_ABOVE_M, DIVE_ABOVE_SHARE * depth_m),
    )


class InitialSettings(Settings):
    """State at the start of a run."""

    north_m: float = Field(0.0, ge=-1e7, le=1e7, description='start position, north (m)')
    east_m: float = Field(0.0, ge=-1e7, le=1e7, description='start position, east (m)')
    depth_m: float = Field(0.0, ge=0.0, le=12000.0, description='start depth (m)')
    heading_deg: float = Field(0.0, ge=-360.0, le=360.0, description='start heading (deg)')
    pitch_deg: float = Field(0.0, ge=-80.0, le=80.0, description='start pitch (deg, + nose up)')
    speed_mps: float = Field(0.0, ge=0.0, le=3.0, description='start speed through water (m/s)')
    net_heaviness_kg: float = Field(
        0.0, ge=-50.0, le=50.0, description='start net heaviness (kg, + sinks)'
    )


class PlantSettings(Settings):
    """Everything the plant node is told."""

    vehicle: str = Field('zhang2021', description='vehicle by name, or path of its YAML file')
    water: DensitySettings = Field(DensitySettings(), description='density of the water')
    initial: InitialSettings = Field(InitialSettings(), description='state at the start')
    duration_s: float = Field(
        108000.0, ge=0.1, le=1e8, description='the run ends after this simulated time (s)'
    )
    dives: int = Field(
        0, ge=0, le=100000, description='the run ends at the surface after this many; 0: never'
    )
    surface_s: float = Field(
        SURFACE_S, ge=0.0, le=86400.0, description='time at the surface after the last dive (s)'
    )
    dive_depth_m: float = Field(
        1000.0, ge=1.0, le=12000.0, description='depth of the dives, by which they are counted (m)'
    )
    afloat_s: float = Field(
        0.0,
        ge=0.0,
        le=1e6,
        description='the run ends once the vehicle, having dived, has been at the surface so long '
        'without filling its pump (s); 0.0: never',
    )
    seed: int = Field(0, ge=0, le=2**63 - 1, description='seed of the noise')
    sensors: SensorSettings = Field(SensorSettings(), description='noise of the odometry')
    perturb: PerturbSettings = Field(
        PerturbSettings(), description='what this vehicle differs in from its file'
    )

    def params(self) -> PlantParams:
        """Kernel parameters."""
        return PlantParams(
            perturbed(load_vehicle(self.vehicle).params(), self.perturb),
            self.water.params(),
            max(1, round(self.duration_s / TICK_S)),
            self.dives,
            round(self.surface_s / TICK_S),
            round(self.afloat_s / TICK_S),
            *dive_depths(self.dive_depth_m),
            self.sensors.params(self.seed),
        )

    def initial_state(self) -> PlantState:
        """State at tick 0."""
        start = self.initial
        limit = load_vehicle(self.vehicle).buoyancy_engine.range.value
        q = quaternion_from_euler(
            0.0, math.radians(start.pitch_deg), math.radians(start.heading_deg)
        )
        motion = Motion(
            start.north_m, start.east_m, start.depth_m, *q, start.speed_mps, *(5 * (0.0,))
        )
        m_b = min(limit, max(-limit, start.net_heaviness_kg))
        return PlantState(motion, Joints(m_b, 0.0, 0.0), Water(0.0, 0.0, 0.0), 0, False, 0, 0, -1)


@kernel
def acceleration(motion, m_b, inertia, water_rate, vehicle, water):
    """Acceleration nu' (6) of a motion with net heaviness ``m_b`` (kg).

    ``water_rate`` is v_c' (NED, m/s^2).
    """
    q_w, q_x, q_y, q_z = motion.q_w, motion.q_x, motion.q_y, motion.q_z
    u, v, w, p, q, r = motion.u, motion.v, motion.w, motion.p, motion.q, motion.r
    h_x, h_y, h_z, l_x, l_y, l_z = hydrodynamics(u, v, w, p, q, r, vehicle)
    c_x, c_y, c_z, n_x, n_y, n_z = coriolis(u, v, w, p, q, r, inertia, vehicle)
    # direction of gravity in body axes: third row of R_NB
    k_x = 2.0 * (q_x * q_z - q_w * q_y)
    k_y = 2.0 * (q_y * q_z + q_w * q_x)
    k_z = 1.0 - 2.0 * (q_x * q_x + q_y * q_y)
    s_x, s_y, s_z = inertia.s_x, inertia.s_y, inertia.s_z
    weight = (m_b + vehicle.ballast - buoyancy_gain(motion.p_d, vehicle.m, water)) * GRAVITY
    if motion.p_d < vehicle.hull_radius:
        weight += (
            vehicle.m * GRAVITY * emerged_fraction(motion.p_d, vehicle.hull_radius)
        ) - _surface_damping(motion, vehicle)
    a_x, a_y, a_z = 0.0, 0.0, 0.0
    if water_rate.v_n != 0.0 or water_rate.v_e != 0.0 or water_rate.v_d != 0.0:
        a_x, a_y, a_z = rotate_to_body(
            q_w, q_x, q_y, q_z, water_rate.v_n, water_rate.v_e, water_rate.v_d
        )
    m = vehicle.m
    return solve_mass(
        h_x - c_x + weight * k_x - m * a_x,
        h_y - c_y + weight * k_y - m * a_y,
        h_z - c_z + weight * k_z - m * a_z,
        l_x - n_x + GRAVITY * (s_y * k_z - s_z * k_y) - (s_y * a_z - s_z * a_y),
        l_y - n_y + GRAVITY * (s_z * k_x - s_x * k_z) - (s_z * a_x - s_x * a_z),
        l_z - n_z + GRAVITY * (s_x * k_y - s_y * k_x) - (s_x * a_y - s_y * a_x),
        inertia,
        vehicle,
    )


@kernel
def _surface_damping(motion, vehicle):
    """Heave force (N, against downward motion) of the waves that a hull at the surface makes."""
    down = rotate_to_ned(
        motion.q_w, motion.q_x, motion.q_y, motion.q_z, motion.u, motion.v, motion.w
    )[2]
    mass = vehicle.m + vehicle.a_33
    stiffness = vehicle.m * GRAVITY / (2.0 * vehicle.hull_radius)
    depth_share = min(1.0, (vehicle.hull_radius - motion.p_d) / vehicle.hull_radius)
    return 2.0 * SURFACE_DAMPING * math.sqrt(stiffness * mass) * down * depth_share


@kernel
def derivative(motion, m_b, inertia, current, water_rate, vehicle, water):
    """Time derivative of a motion."""
    q_w, q_x, q_y, q_z = motion.q_w, motion.q_x, motion.q_y, motion.q_z
    p, q, r = motion.p, motion.q, motion.r
    d_n, d_e, d_d = rotate_to_ned(q_w, q_x, q_y, q_z, motion.u, motion.v, motion.w)
    a = acceleration(motion, m_b, inertia, water_rate, vehicle, water)
    return Motion(
        d_n + current.v_n,
        d_e + current.v_e,
        d_d + current.v_d,
        0.5 * (-q_x * p - q_y * q - q_z * r),
        0.5 * (q_w * p + q_y * r - q_z * q),
        0.5 * (q_w * q + q_z * p - q_x * r),
        0.5 * (q_w * r + q_x * q - q_y * p),
        a[0],
        a[1],
        a[2],
        a[3],
        a[4],
        a[5],
    )


@kernel
def _along(x, h, k, rates):
    """Point ``x + h k`` along a derivative, with rates of its own."""
    return Motion(
        x.p_n + h * k.p_n,
        x.p_e + h * k.p_e,
        x.p_d + h * k.p_d,
        x.q_w + h * k.q_w,
        x.q_x + h * k.q_x,
        x.q_y + h * k.q_y,
        x.q_z + h * k.q_z,
        x.u + h * k.u,
        x.v + h * k.v,
        x.w + h * k.w,
        rates.p,
        rates.q,
        rates.r,
    )


@kernel
def _between(start, end, share):
    """Actuator positions a share of the way from one to the other."""
    return Joints(
        start.m_b + share * (end.m_b - start.m_b),
        start.x_p + share * (end.x_p - start.x_p),
        start.mu + share * (end.mu - start.mu),
    )


@kernel
def _poles(x, inertia, vehicle):
    """Poles (1/s) of the decay of p, q and r by damping about each axis; 0 where it drives."""
    d_p, d_q, d_r = rate_damping(x.u, x.v, x.w, x.p, x.q, x.r, vehicle)
    return Rates(
        max(0.0, inertia.n_xx * d_p),
        max(0.0, inertia.n_yy * d_q),
        max(0.0, inertia.n_zz * d_r),
    )


@kernel
def _inputs(k, x, poles):
    """What the exponential method sees of the accelerations at ``x``: all but the decay."""
    return Rates(k.p + poles.p * x.p, k.q + poles.q * x.q, k.r + poles.r * x.r)


@kernel
def _halfway(x, n, p, q, r):
    """Rates half a step after those of ``x`` under inputs ``n``; p, q, r are the decays."""
    return Rates(
        p.half * x.p + p.half_input * n.p,
        q.half * x.q + q.half_input * n.q,
        r.half * x.r + r.half_input * n.r,
    )


@kernel
def _whole(x, n_1, n_4, n_23, p, q, r):
    """Rates a step after those of ``x``; ``n_23`` is the sum of the inputs of two stages."""
    return Rates(
        p.whole * x.p + p.first * n_1.p + p.middle * n_23.p + p.last * n_4.p,
        q.whole * x.q + q.first * n_1.q + q.middle * n_23.q + q.last * n_4.q,
        r.whole * x.r + r.first * n_1.r + r.middle * n_23.r + r.last * n_4.r,
    )


@kernel
def _energy(u, v, w, p, q, r, inertia, vehicle):
    """Kinetic energy of a velocity (J) without the couplings of M: a measure of an error."""
    return 0.5 * (
        (vehicle.m + vehicle.a_11) * u * u
        + (vehicle.m + vehicle.a_22) * v * v
        + (vehicle.m + vehicle.a_33) * w * w
        + p * p / inertia.n_xx
        + q * q / inertia.n_yy
        + r * r / inertia.n_zz
    )


@kernel
def integrate(motion, start, end, current, water_rate, params, dt, steps):
    """Integrate a motion over ``dt`` s while the actuators go evenly from start to end.

    Exponential RK4 for p, q and r with the poles of their damping at the start; the classical RK4
    for all else.

    Parameters
    ----------
    steps : int
        Steps of equal length.

    Returns
    -------
    Motion
    float
        Error of the worst step (J): the energy of what the four stages disagree about,
        h / 6 (k_1 - k_2 - k_3 + k_4), which shrinks with the third power of the step.
    """
    vehicle, water = params.vehicle, params.water
    h = dt / steps
    fixed = start.x_p == end.x_p and start.mu == end.mu
    now = start
    inertia_now = make_inertia(now.x_p, now.mu, vehicle)
    poles = _poles(motion, inertia_now, vehicle)
    p, q, r = decay_weights(poles.p, h), decay_weights(poles.q, h), decay_weights(poles.r, h)
    x = motion
    largest = 0.0
    for i in range(steps):
        middle = _between(start, end, (i + 0.5) / steps)
        after = _between(start, end, (i + 1.0) / steps)
        inertia_middle, inertia_after = inertia_now, inertia_now
        if not fixed:
            inertia_middle = make_inertia(middle.x_p, middle.mu, vehicle)
            inertia_after = make_inertia(after.x_p, after.mu, vehicle)
        k_1 = derivative(x, now.m_b, inertia_now, current, water_rate, vehicle, water)
        n_1 = _inputs(k_1, x, poles)
        x_2 = _along(x, 0.5 * h, k_1, _halfway(x, n_1, p, q, r))
        k_2 = derivative(x_2, middle.m_b, inertia_middle, current, water_rate, vehicle, water)
        n_2 = _inputs(k_2, x_2, poles)
        x_3 = _along(x, 0.5 * h, k_2, _halfway(x, n_2, p, q, r))
        k_3 = derivative(x_3, middle.m_b, inertia_middle, current, water_rate, vehicle, water)
        n_3 = _inputs(k_3, x_3, poles)
        n_31 = Rates(2.0 * n_3.p - n_1.p, 2.0 * n_3.q - n_1.q, 2.0 * n_3.r - n_1.r)
        x_4 = _along(x, h, k_3, _halfway(x_2, n_31, p, q, r))
        k_4 = derivative(x_4, after.m_b, inertia_after, current, water_rate, vehicle, water)
        n_4 = _inputs(k_4, x_4, poles)
        n_23 = Rates(n_2.p + n_3.p, n_2.q + n_3.q, n_2.r + n_3.r)
        error = _energy(
            h / 6.0 * (k_1.u - k_2.u - k_3.u + k_4.u),
            h / 6.0 * (k_1.v - k_2.v - k_3.v + k_4.v),
            h / 6.0 * (k_1.w - k_2.w - k_3.w + k_4.w),
            p.last * (n_1.p - n_23.p + n_4.p),
            q.last * (n_1.q - n_23.q + n_4.q),
            r.last * (n_1.r - n_23.r + n_4.r),
            inertia_now,
            vehicle,
        )
        largest = max(largest, error)
        rates = _whole(x, n_1, n_4, n_23, p, q, r)
        x = _along(_along(x, h / 6.0, k_1, rates), h / 3.0, k_2, rates)
        x = _along(_along(x, h / 3.0, k_3, rates), h / 6.0, k_4, rates)
        now, inertia_now = after, inertia_after
    norm = math.sqrt(x.q_w * x.q_w + x.q_x * x.q_x + x.q_y * x.q_y + x.q_z * x.q_z)
    return (
        Motion(
            x.p_n,
            x.p_e,
            x.p_d,
            x.q_w / norm,
            x.q_x / norm,
            x.q_y / norm,
            x.q_z / norm,
            x.u,
            x.v,
            x.w,
            x.p,
            x.q,
            x.r,
        ),
        largest,
    )


@kernel
def plant_step(state, command, water, params, dt):
    """Advance the plant by one tick.

    Parameters
    ----------
    state : PlantState
    command : Joints
        Targets of the actuators.
    water : Water
        Water velocity at the vehicle, NED (m/s), held during the tick.
    params : PlantParams
    dt : float
        Length of the tick (s).

    Returns
    -------
    PlantState
    """
    joints = actuators_step(state.joints, command, params.vehicle, dt)
    water_rate = Water(0.0, 0.0, 0.0)
    if state.tick > 0:
        water_rate = Water(
            (water.v_n - state.water.v_n) / dt,
            (water.v_e - state.water.v_e) / dt,
            (water.v_d - state.water.v_d) / dt,
        )
    steps, motion, error = 1, state.motion, math.inf
    while error > LARGEST_ERROR_J and steps <= MOST_STEPS:
        motion, error = integrate(
            state.motion, state.joints, joints, water, water_rate, params, dt, steps
        )
        steps *= 2
    deep = motion.p_d > params.dive_below or (state.deep and motion.p_d >= params.dive_above)
    dives = state.dives + 1 if state.deep and not deep else state.dives
    surface_ticks = state.surface_ticks + 1 if motion.p_d < SURFACE_M else 0
    afloat_ticks = _afloat(state.afloat_ticks, motion.p_d, command.m_b > joints.m_b)
    return PlantState(
        motion, joints, water, state.tick + 1, deep, dives, surface_ticks, afloat_ticks
    )


@kernel
def _afloat(ticks, depth, fills):
    """Ticks afloat after one more; a vehicle that fills its pump is about to dive."""
    if depth >= SURFACE_M:
        return 0 if ticks >= 0 or depth > DIVED_M else -1
    return ticks if ticks < 0 or fills else ticks + 1


@kernel
def plant_finished(state, params):
    """Whether the tick of this state is the last one of the run."""
    surfaced = (
        params.stop_after_dives > 0
        and state.dives >= params.stop_after_dives
        and state.surface_ticks >= params.stop_surface_ticks
    )
    afloat = 0 < params.stop_afloat_ticks <= state.afloat_ticks
    return state.tick + 1 >= params.max_ticks or surfaced or afloat


@kernel
def plant_odometry(state):
    """Where the vehicle is and how it moves: what it would measure without error."""
    x, water = state.motion, state.water
    u, v, w = rotate_to_body(x.q_w, x.q_x, x.q_y, x.q_z, water.v_n, water.v_e, water.v_d)
    return Odometry(
        x.p_n,
        x.p_e,
        x.p_d,
        x.q_w,
        x.q_x,
        x.q_y,
        x.q_z,
        x.u + u,
        x.v + v,
        x.w + w,
        x.p,
        x.q,
        x.r,
    )


@kernel
def plant_measurement(state, params):
    """What the vehicle measures: the odometry with the noise of this tick."""
    return add_noise(plant_odometry(state), state.tick, params.sensors)


@kernel
def plant_joints(state):
    """Where the actuators are."""
    return state.joints


def state_fault(odometry: Odometry, joints: Joints, tick: int) -> str:
    """What of the vehicle's state at a tick is not finite, in words; empty if all is."""
    numbers = {**odometry._asdict(), **joints._asdict()}
    wrong = [name for name, number in numbers.items() if not math.isfinite(number)]
    return f'{not_finite("plant: the state", tick)}: {", ".join(wrong)}' if wrong else ''
