# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""The motion of the vehicle: six degrees of freedom, and how they are integrated.

    p'     = R_NB nu_r + v_c
    q'     = 1/2 q (x) [0, omega]
    M nu'  = tau_h + tau_g - C_RB(omega) nu - C_A(nu) nu - M_RB [R_NB^T v_c'; 0]

nu is the velocity through the water. v_c' is what the vehicle sees of a changing current, its own
way through a shear included; it is the change over the last tick.

Rates decay fast by their damping, x' = -pole x + n(x, t). Exponential Runge-Kutta of fourth order
solves the decay exactly: Cox and Matthews (2002), J. Comput. Phys. 176, 430-455, eq. (26)-(29).
Where the pole is zero this is the classical RK4 (docs/theory.md, 1).
"""

import math
from typing import NamedTuple

from glider_base.frames import rotate_to_body, rotate_to_ned
from glider_base.kernel import kernel, replace
from glider_base.signals import Joints
from glider_model.ocean.density import emerged_fraction, immersed
from glider_model.vehicle.hydrodynamics import hydrodynamics, rate_damping
from glider_model.vehicle.rigid_body import GRAVITY, coriolis, make_inertia, solve_mass
from glider_model.vehicle.surface import surface_loads

#: Damping ratio of heave at the surface, where the hull radiates waves (-).
SURFACE_DAMPING = 0.2
#: Below this |z| phi_3 is summed up as a series: the closed form loses digits to cancellation.
SERIES_BELOW = 0.5
#: Terms of that series; what comes after them is below 1e-16 of the sum.
SERIES_TERMS = 13


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


class Decay(NamedTuple):
    """Weights of a step for one pole."""

    half: float  #: decay within half a step
    half_input: float  #: weight of the input of half a step (s)
    whole: float  #: decay within the step
    first: float  #: weights of the inputs n_1, n_2 + n_3, n_4 (s)
    middle: float
    last: float


@kernel
def phi_functions(z):
    """e^z, phi_1(z), phi_2(z), phi_3(z) for z <= 0."""
    if z > -SERIES_BELOW:
        phi_3 = 0.0
        for k in range(SERIES_TERMS + 3, 3, -1):
            phi_3 = (1.0 + phi_3) * z / k
        phi_3 = (1.0 + phi_3) / 6.0
        phi_2 = 0.5 + z * phi_3
        phi_1 = 1.0 + z * phi_2
        return 1.0 + z * phi_1, phi_1, phi_2, phi_3
    decay = math.exp(z)
    phi_1 = (decay - 1.0) / z
    phi_2 = (phi_1 - 1.0) / z
    return decay, phi_1, phi_2, (phi_2 - 0.5) / z


@kernel
def decay_weights(pole, h):
    """Weights of a step of ``h`` s for a pole (1/s, >= 0: decay)."""
    half, half_1, half_2, half_3 = phi_functions(-0.5 * h * pole)
    # from z to 2 z by sums of positive numbers, which lose nothing
    phi_1 = 0.5 * (half + 1.0) * half_1
    phi_2 = 0.25 * ((half + 1.0) * half_2 + half_1)
    phi_3 = 0.125 * ((half + 1.0) * half_3 + half_2 + 0.5 * half_1)
    return Decay(
        half=half,
        half_input=0.5 * h * half_1,
        whole=half * half,
        first=h * (phi_1 - 3.0 * phi_2 + 4.0 * phi_3),
        middle=h * (2.0 * phi_2 - 4.0 * phi_3),
        last=h * (4.0 * phi_3 - phi_2),
    )


@kernel
def acceleration(motion, joints, inertia, water_rate, vehicle, density):
    """Acceleration nu' (6) of a motion with actuators at ``joints``, of which is the inertia.

    ``water_rate`` is v_c' (NED, m/s^2).
    """
    q_w, q_x, q_y, q_z = motion.q_w, motion.q_x, motion.q_y, motion.q_z
    u, v, w, p, q, r = motion.u, motion.v, motion.w, motion.p, motion.q, motion.r
    hull = hydrodynamics(u, v, w, p, q, r, vehicle)
    h_x, h_y, h_z, l_x, l_y, l_z = surface_loads(
        hull, u, v, w, p, q, r, joints.delta, vehicle.surface
    )
    c_x, c_y, c_z, n_x, n_y, n_z = coriolis(u, v, w, p, q, r, inertia, vehicle)
    # direction of gravity in body axes: third row of R_NB
    k_x = 2.0 * (q_x * q_z - q_w * q_y)
    k_y = 2.0 * (q_y * q_z + q_w * q_x)
    k_z = 1.0 - 2.0 * (q_x * q_x + q_y * q_y)
    s_x, s_y, s_z = inertia.s_x, inertia.s_y, inertia.s_z
    water = immersed(motion.p_d, joints.m_b, vehicle, density)
    weight, ratio = water.net * GRAVITY, water.ratio
    # the oil pulls where the pump is: as if so much more of the first moment were there
    w_x = s_x + water.oil * vehicle.pump_x
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
        ratio * h_x - c_x + weight * k_x - m * a_x,
        ratio * h_y - c_y + weight * k_y - m * a_y,
        ratio * h_z - c_z + weight * k_z - m * a_z,
        ratio * l_x - n_x + GRAVITY * (s_y * k_z - s_z * k_y) - (s_y * a_z - s_z * a_y),
        ratio * l_y - n_y + GRAVITY * (s_z * k_x - w_x * k_z) - (s_z * a_x - s_x * a_z),
        ratio * l_z - n_z + GRAVITY * (w_x * k_y - s_y * k_x) - (s_x * a_y - s_y * a_x),
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
def derivative(motion, joints, inertia, current, water_rate, vehicle, density):
    """Time derivative of a motion."""
    q_w, q_x, q_y, q_z = motion.q_w, motion.q_x, motion.q_y, motion.q_z
    p, q, r = motion.p, motion.q, motion.r
    d_n, d_e, d_d = rotate_to_ned(q_w, q_x, q_y, q_z, motion.u, motion.v, motion.w)
    a = acceleration(motion, joints, inertia, water_rate, vehicle, density)
    return Motion(
        p_n=d_n + current.v_n,
        p_e=d_e + current.v_e,
        p_d=d_d + current.v_d,
        q_w=0.5 * (-q_x * p - q_y * q - q_z * r),
        q_x=0.5 * (q_w * p + q_y * r - q_z * q),
        q_y=0.5 * (q_w * q + q_z * p - q_x * r),
        q_z=0.5 * (q_w * r + q_x * q - q_y * p),
        u=a[0],
        v=a[1],
        w=a[2],
        p=a[3],
        q=a[4],
        r=a[5],
    )


@kernel
def _along(x, h, k, rates):
    """Point ``x + h k`` along a derivative, with rates of its own."""
    return Motion(
        p_n=x.p_n + h * k.p_n,
        p_e=x.p_e + h * k.p_e,
        p_d=x.p_d + h * k.p_d,
        q_w=x.q_w + h * k.q_w,
        q_x=x.q_x + h * k.q_x,
        q_y=x.q_y + h * k.q_y,
        q_z=x.q_z + h * k.q_z,
        u=x.u + h * k.u,
        v=x.v + h * k.v,
        w=x.w + h * k.w,
        p=rates.p,
        q=rates.q,
        r=rates.r,
    )


@kernel
def _between(start, end, share):
    """Actuator positions a share of the way from one to the other."""
    return Joints(
        start.m_b + share * (end.m_b - start.m_b),
        start.x_p + share * (end.x_p - start.x_p),
        start.mu + share * (end.mu - start.mu),
        start.delta + share * (end.delta - start.delta),
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
def _normalised(x):
    """The motion with a quaternion of length 1."""
    norm = math.sqrt(x.q_w * x.q_w + x.q_x * x.q_x + x.q_y * x.q_y + x.q_z * x.q_z)
    return replace(x, q_w=x.q_w / norm, q_x=x.q_x / norm, q_y=x.q_y / norm, q_z=x.q_z / norm)


@kernel
def integrate(motion, start, end, current, water_rate, params, dt, steps):
    """Integrate a motion over ``dt`` s, in steps of equal length.

    The actuators go evenly from start to end. Exponential RK4 for p, q and r with the poles
    of their damping at the start; the classical RK4 for all else. Comes with the error of the
    worst step (J): the energy of what the four stages disagree about, h / 6 (k_1 - k_2 - k_3
    + k_4), which shrinks with the third power of the step.
    """
    vehicle, density = params.vehicle, params.density
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
        k_1 = derivative(x, now, inertia_now, current, water_rate, vehicle, density)
        n_1 = _inputs(k_1, x, poles)
        x_2 = _along(x, 0.5 * h, k_1, _halfway(x, n_1, p, q, r))
        k_2 = derivative(x_2, middle, inertia_middle, current, water_rate, vehicle, density)
        n_2 = _inputs(k_2, x_2, poles)
        x_3 = _along(x, 0.5 * h, k_2, _halfway(x, n_2, p, q, r))
        k_3 = derivative(x_3, middle, inertia_middle, current, water_rate, vehicle, density)
        n_3 = _inputs(k_3, x_3, poles)
        n_31 = Rates(2.0 * n_3.p - n_1.p, 2.0 * n_3.q - n_1.q, 2.0 * n_3.r - n_1.r)
        x_4 = _along(x, h, k_3, _halfway(x_2, n_31, p, q, r))
        k_4 = derivative(x_4, after, inertia_after, current, water_rate, vehicle, density)
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
    return _normalised(x), largest
