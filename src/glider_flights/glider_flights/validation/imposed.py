# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""The plant with part of its motion imposed: what a recording says of it is what it does.

Depth, and the water that was measured there, are the recorded ones throughout: errors of the
vertical rate would add up. Forcing is a table, a row for each sample, even in between.
"""

import math
from typing import NamedTuple

from glider_base.frames import (
    euler_from_quaternion,
    quaternion_from_euler,
    rotate_to_ned,
    wrap_angle,
)
from glider_base.kernel import kernel, replace
from glider_base.kernels.packing import put
from glider_base.signals import Joints, Water
from glider_model.ocean.density import displacing, immersed
from glider_model.plant.motion import Motion, acceleration, integrate
from glider_model.plant.plant import LARGEST_ERROR_J, MOST_STEPS
from glider_model.vehicle.file import VehicleParams
from glider_model.vehicle.rigid_body import make_inertia, solve_mass

#: Longest step while the attitude is imposed (s), at speeds up to this (m/s): above it damping in
#: yaw, which is the fastest that is left and goes with the square of speed, asks for shorter ones,
#: but none is shorter than the last.
STEP_S, STEP_MPS, SHORTEST_S = 0.2, 0.5, 0.01
#: Speed ahead at which a stretch begins (m/s); what follows from it is over before it is compared.
START_MPS = 0.2
_STILL = Water(0.0, 0.0, 0.0)


class Forcing(NamedTuple):
    """Columns of the forcing."""

    time: float  #: (s)
    depth: float  #: (m)
    phi: float  #: roll, pitch (rad)
    theta: float
    m_b: float  #: actuators, see `glider_base.signals.Joints`
    x_p: float
    mu: float
    delta: float
    ratio: float  #: density of the water over `SEA_WATER_DENSITY` (-)
    temperature: float  #: of the water (deg C)


class MeasuredWater(NamedTuple):
    """Water as it was measured beside the vehicle."""

    ratio: float
    temperature: float


class Body(NamedTuple):
    """Vehicle and water, in the place of `PlantParams`."""

    vehicle: VehicleParams
    density: MeasuredWater


@immersed.body(MeasuredWater)
@kernel
def _in_measured_water(depth, m_b, vehicle, params):
    """See `glider_model.ocean.density.immersed`."""
    warmer = params.temperature - vehicle.reference_temperature
    return displacing(
        m_b, vehicle.volume, vehicle.compressibility, warmer, params.ratio, depth, vehicle
    )


@kernel
def _between(one, other, share):
    """Forcing a share of the way from one row to the next."""
    return Forcing(
        time=one[0] + share * (other[0] - one[0]),
        depth=one[1] + share * (other[1] - one[1]),
        phi=one[2] + share * (other[2] - one[2]),
        theta=one[3] + share * (other[3] - one[3]),
        m_b=one[4] + share * (other[4] - one[4]),
        x_p=one[5] + share * (other[5] - one[5]),
        mu=one[6] + share * (other[6] - one[6]),
        delta=one[7] + share * (other[7] - one[7]),
        ratio=one[8] + share * (other[8] - one[8]),
        temperature=one[9] + share * (other[9] - one[9]),
    )


@kernel
def _joints(forcing):
    return Joints(forcing.m_b, forcing.x_p, forcing.mu, forcing.delta)


@kernel
def _turned(n, x, y, z):
    """D v of a vector, where D is the inverse of the symmetric N of an `Inertia`."""
    c_xx = n.n_yy * n.n_zz - n.n_yz * n.n_yz
    c_xy = n.n_xz * n.n_yz - n.n_xy * n.n_zz
    c_xz = n.n_xy * n.n_yz - n.n_xz * n.n_yy
    c_yy = n.n_xx * n.n_zz - n.n_xz * n.n_xz
    c_yz = n.n_xz * n.n_xy - n.n_xx * n.n_yz
    c_zz = n.n_xx * n.n_yy - n.n_xy * n.n_xy
    scale = 1.0 / (n.n_xx * c_xx + n.n_xy * c_xy + n.n_xz * c_xz)
    return (
        scale * (c_xx * x + c_xy * y + c_xz * z),
        scale * (c_xy * x + c_yy * y + c_yz * z),
        scale * (c_xz * x + c_yz * y + c_zz * z),
    )


@kernel
def _held(x, forcing, phi_dot, theta_dot, vehicle):
    """Rate of u, v, w and psi' of a plant whose roll and pitch are imposed.

    What holds them is a moment about horizontal axes, as gravity makes it on masses that are
    moved: about the vertical the plant turns as it will. With ω' = k psi'' + e, k the vertical in
    body axes and T the moment: M nu' = tau + [0; T], T . k = 0.
    """
    u, v, w, turn = x
    s_f, c_f = math.sin(forcing.phi), math.cos(forcing.phi)
    s_t, c_t = math.sin(forcing.theta), math.cos(forcing.theta)
    p = phi_dot - turn * s_t
    q = theta_dot * c_f + turn * s_f * c_t
    r = -theta_dot * s_f + turn * c_f * c_t
    q_w, q_x, q_y, q_z = quaternion_from_euler(forcing.phi, forcing.theta, 0.0)
    motion = Motion(0.0, 0.0, forcing.depth, q_w, q_x, q_y, q_z, u, v, w, p, q, r)
    inertia = make_inertia(forcing.x_p, forcing.mu, vehicle)
    water = MeasuredWater(forcing.ratio, forcing.temperature)
    a = acceleration(motion, _joints(forcing), inertia, _STILL, vehicle, water)
    e_x = -turn * c_t * theta_dot
    e_y = -theta_dot * s_f * phi_dot + turn * (c_f * c_t * phi_dot - s_f * s_t * theta_dot)
    e_z = -theta_dot * c_f * phi_dot - turn * (s_f * c_t * phi_dot + c_f * s_t * theta_dot)
    k_x, k_y, k_z = -s_t, s_f * c_t, c_f * c_t
    f_x, f_y, f_z = _turned(inertia, a[3] - e_x, a[4] - e_y, a[5] - e_z)
    d_x, d_y, d_z = _turned(inertia, k_x, k_y, k_z)
    turn_dot = (k_x * f_x + k_y * f_y + k_z * f_z) / (k_x * d_x + k_y * d_y + k_z * d_z)
    m_x, m_y, m_z = turn_dot * d_x - f_x, turn_dot * d_y - f_y, turn_dot * d_z - f_z
    b = solve_mass(0.0, 0.0, 0.0, m_x, m_y, m_z, inertia, vehicle)
    return a[0] + b[0], a[1] + b[1], a[2] + b[2], turn_dot


@kernel
def _after(x, rate, h):
    return x[0] + h * rate[0], x[1] + h * rate[1], x[2] + h * rate[2], x[3] + h * rate[3]


@kernel
def _held_after(x, start, middle, end, phi_dot, theta_dot, vehicle, h):
    """u, v, w and psi' after a step of Runge and Kutta; see `_held`."""
    a = _held(x, start, phi_dot, theta_dot, vehicle)
    b = _held(_after(x, a, 0.5 * h), middle, phi_dot, theta_dot, vehicle)
    c = _held(_after(x, b, 0.5 * h), middle, phi_dot, theta_dot, vehicle)
    d = _held(_after(x, c, h), end, phi_dot, theta_dot, vehicle)
    e = _after(_after(a, b, 2.0), c, 2.0)
    return _after(x, _after(e, d, 1.0), h / 6.0)


@kernel
def _rate(u, v, w, phi, theta):
    """Way through the water in a second: down, ahead, to starboard (m/s)."""
    q_w, q_x, q_y, q_z = quaternion_from_euler(phi, theta, 0.0)
    ahead, abeam, down = rotate_to_ned(q_w, q_x, q_y, q_z, u, v, w)
    return down, ahead, abeam


@kernel
def fly_held(table, vehicle, step, flown):
    """Fly with roll and pitch imposed; heading is the plant's own.

    Parameters
    ----------
    table : float64[n, 10]
        `Forcing` of each sample.
    vehicle : VehicleParams
    step : float
        Longest step (s).
    flown : float64[n, 7]
        Takes of each sample the way through the water since the first: down, along the heading
        and to starboard of it (m), how far it has turned since (rad), speed through the water
        (m/s), roll and pitch (rad).
    """
    x = START_MPS, 0.0, 0.0, 0.0
    down, ahead, abeam, heading = 0.0, 0.0, 0.0, 0.0
    for k in range(len(table)):
        here = table[k]
        phi, theta = here[2], here[3]
        speed = math.sqrt(x[0] * x[0] + x[1] * x[1] + x[2] * x[2])
        put(flown, k, 0, ((down, ahead, abeam, heading, speed, phi, theta),))
        if k == len(table) - 1:
            break
        after = table[k + 1]
        span = after[0] - here[0]
        phi_dot, theta_dot = (after[2] - phi) / span, (after[3] - theta) / span
        done = 0.0
        while done < span:
            speed2 = x[0] * x[0] + x[1] * x[1] + x[2] * x[2]
            longest = step * min(1.0, STEP_MPS * STEP_MPS / max(speed2, 1e-9))
            longest = max(longest, SHORTEST_S)
            h = (span - done) / math.ceil((span - done) / longest)
            start = _between(here, after, done / span)
            middle = _between(here, after, (done + 0.5 * h) / span)
            end = _between(here, after, (done + h) / span)
            done = done + h if h < span - done else span
            before, old = _rate(x[0], x[1], x[2], start.phi, start.theta), x[3]
            x = _held_after(x, start, middle, end, phi_dot, theta_dot, vehicle, h)
            now = _rate(x[0], x[1], x[2], end.phi, end.theta)
            down += 0.5 * h * (before[0] + now[0])
            ahead += 0.5 * h * (before[1] + now[1])
            abeam += 0.5 * h * (before[2] + now[2])
            heading += 0.5 * h * (old + x[3])


@kernel
def fly_free(table, vehicle, step, flown):
    """Fly with the actuators imposed; attitude is the plant's own. See `fly_held`."""
    start = table[0]
    q_w, q_x, q_y, q_z = quaternion_from_euler(start[2], start[3], 0.0)
    x = Motion(0.0, 0.0, start[1], q_w, q_x, q_y, q_z, START_MPS, 0.0, 0.0, 0.0, 0.0, 0.0)
    down, ahead, abeam, heading, last = 0.0, 0.0, 0.0, 0.0, 0.0
    for k in range(len(table)):
        here = table[k]
        phi, theta, _ = euler_from_quaternion(x.q_w, x.q_x, x.q_y, x.q_z)
        before = _rate(x.u, x.v, x.w, phi, theta)
        speed = math.sqrt(x.u * x.u + x.v * x.v + x.w * x.w)
        put(flown, k, 0, ((down, ahead, abeam, heading, speed, phi, theta),))
        if k == len(table) - 1:
            break
        after = table[k + 1]
        span = after[0] - here[0]
        steps = int(math.ceil(span / step))
        h = span / steps
        for i in range(steps):
            begin = _between(here, after, i / steps)
            end = _between(here, after, (i + 1.0) / steps)
            x = _stepped(x, begin, end, vehicle, h)
            phi, theta, psi = euler_from_quaternion(x.q_w, x.q_x, x.q_y, x.q_z)
            now = _rate(x.u, x.v, x.w, phi, theta)
            down += 0.5 * h * (before[0] + now[0])
            ahead += 0.5 * h * (before[1] + now[1])
            abeam += 0.5 * h * (before[2] + now[2])
            heading += wrap_angle(psi - last)
            before, last = now, psi


@kernel
def _stepped(x, begin, end, vehicle, h):
    """Motion a step later, under actuators and in water that are imposed."""
    placed = replace(x, p_n=0.0, p_e=0.0, p_d=begin.depth)
    middle = MeasuredWater(
        0.5 * (begin.ratio + end.ratio), 0.5 * (begin.temperature + end.temperature)
    )
    body = Body(vehicle, middle)
    steps, motion, error = 1, placed, math.inf
    while error > LARGEST_ERROR_J and steps <= MOST_STEPS:
        motion, error = integrate(
            placed, _joints(begin), _joints(end), _STILL, _STILL, body, h, steps
        )
        steps *= 2
    return motion
