# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""What travels between the blocks: plain numbers in NED / FRD, SI units and radians."""

from traceback import extract_tb
from typing import NamedTuple

from glider_base.kernel import kernel

#: A virtual target as high above the water as this (m, + down) asks control for the surface with
#: all there is: the whole pump, the mass at its climb stop, no roll. No path leads there.
SURFACE_TARGET = -1000.0

#: Length of one tick (s) and of one tick in the integer nanoseconds of a message stamp.
TICK_S = 0.1
TICK_NS = 100_000_000

#: A dive leads so far down and up again (m), wherever it turns; in shallow profiles this share of
#: their depth. One that begins deeper than this begins in a dive.
DIVE_M, DIVE_SHARE = 20.0, 0.3

#: Density of the sea water that coefficients and kilograms of net heaviness are for (kg/m^3).
SEA_WATER_DENSITY = 1025.0


class Odometry(NamedTuple):
    """Where the vehicle is and how it moves over ground."""

    p_n: float  #: north (m)
    p_e: float  #: east (m)
    p_d: float  #: depth (m, + down)
    q_w: float  #: attitude quaternion q_NB, body FRD to NED
    q_x: float
    q_y: float
    q_z: float
    u: float  #: velocity over ground in body axes FRD (m/s)
    v: float
    w: float
    p: float  #: angular rate in body axes FRD (rad/s)
    q: float
    r: float


class Joints(NamedTuple):
    """Positions of the actuators, or the targets commanded to them."""

    m_b: float  #: net heaviness from the buoyancy engine (kg, + sinks)
    x_p: float  #: pitch mass from its neutral position (m, + forward: nose down)
    mu: float  #: roll mass rotation about the x axis (rad, 0 hangs straight down)
    delta: float  #: steering surface (rad, + nose to starboard); 0 of a vehicle without one


class Water(NamedTuple):
    """Velocity of the water over ground, NED (m/s)."""

    v_n: float
    v_e: float
    v_d: float


class Imu(NamedTuple):
    """Attitude q_NB, and rates in body axes FRD (rad/s)."""

    q_w: float
    q_x: float
    q_y: float
    q_z: float
    p: float
    q: float
    r: float
    has_rates: bool


class Vector(NamedTuple):
    """A horizontal vector."""

    n: float
    e: float


@kernel
def plus(a, b, times=1.0):
    """A vector and another one, so many times."""
    return Vector(a.n + times * b.n, a.e + times * b.e)


@kernel
def minus(a, b):
    """A vector less another one."""
    return Vector(a.n - b.n, a.e - b.e)


@kernel
def over(a, number):
    """A vector over a number."""
    return Vector(a.n / number, a.e / number)


class Covariance(NamedTuple):
    """Of a horizontal vector."""

    nn: float
    ne: float
    ee: float


class Reference(NamedTuple):
    """What guidance asks of control."""

    p_n: float  #: virtual target on the path (m); its depth may be SURFACE_TARGET
    p_e: float
    p_d: float
    phi: float  #: desired roll, pitch, heading (rad)
    theta: float
    psi: float
    v_n: float  #: desired velocity over ground (m/s); v_d is the vertical rate, + down
    v_e: float
    v_d: float
    phi_dot: float  #: desired Euler angle rates (rad/s)
    theta_dot: float
    psi_dot: float


class TrackingError(NamedTuple):
    """Position relative to the virtual target, in the path frame (m)."""

    e1: float  #: along the path
    e2: float  #: across, + to starboard of the path
    e3: float  #: normal to both, + below the path


class Wrench(NamedTuple):
    """Force and moments that control demands."""

    tau_w: float  #: heave force, + down (N)
    tau_p: float  #: roll moment (N m)
    tau_q: float  #: pitch moment (N m)


class Adaptation(NamedTuple):
    """What control has learnt; under the PID law zero but for the steering of a fin."""

    roll_bias_nm: float  #: parameters of the roll moment (N m)
    roll_side_force_nm: float
    roll_damping_nm: float
    pitch_bias_nm: float  #: parameters of the pitch moment (N m)
    pitch_alpha_nm: float
    pitch_speed_nm: float
    pitch_damping_nm: float
    steering_dive_radps: float  #: turn rate over sin(roll), or of the fin, at 0.5 m/s, and offset
    disturbance_dive_radps: float
    steering_climb_radps: float
    disturbance_climb_radps: float
    lyapunov_1: float  #: V1 and V2 without the part of the unknown parameter errors
    lyapunov_2: float


#: Of a law that learns nothing.
NOTHING_LEARNT = Adaptation(*(0.0 for _ in Adaptation._fields))


class Health(NamedTuple):
    """What the sensors of the vehicle's own health say."""

    leak: float  #: 1.0: there is water in the hull
    vacuum_pa: float  #: pressure in the hull below that of the air at the surface (Pa)
    contact_age_s: float  #: time since the antenna was last out of the water (s)


class Battery(NamedTuple):
    """What the battery says of itself; less than nothing is not measured, but for the current."""

    voltage: float  #: (V)
    current: float  #: (A), - discharges
    charge: float  #: what is left (Ah)
    capacity: float  #: of the full battery (Ah)
    percentage: float  #: what is left, as a share (-)


#: Stands in the reason of every run that fails: a number ceases to be finite, or a law raises.
AT_TICK = 'at tick'


@kernel
def dive_m(depth_m):
    """How far (m) a dive leads down and up again, in dives to a depth."""
    return min(DIVE_M, DIVE_SHARE * depth_m)


def not_finite(what: str, tick: int) -> str:
    """Say that something is not finite at a tick."""
    return at_tick(f'{what} is not finite', tick)


def raised(error: Exception) -> str:
    """Say what was raised, by which function in which line."""
    place = extract_tb(error.__traceback__)[-1]
    where = f'{place.name} ({place.filename}, line {place.lineno})'
    return f'{where}: {type(error).__name__}: {error}'


def at_tick(what: str, tick: int) -> str:
    """Say that something happened at a tick."""
    return f'{what} {AT_TICK} {tick} (t = {tick * TICK_S:.1f} s)'
