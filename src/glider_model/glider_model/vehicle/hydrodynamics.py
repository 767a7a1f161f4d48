# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""Viscous forces and moments of the water on the hull, in body axes FRD (docs/theory.md, 1).

The form of Graver (2005) and Zhang et al. (2013): drag, side force and lift in wind axes, turned
into body axes by R_BC(alpha, beta). Their polynomials in alpha hold for attached flow at a few
degrees; docs/adr/0003 says what stands for alpha and beta, so that any attitude stays physical.
"""

import math

from glider_base.kernel import kernel

#: Faster than this no coefficient is known, and the water brakes any hull (m/s, rad/s): a force of
#: m v per metre per second and a moment of m omega per rad/s beyond it.
FASTEST_MPS, FASTEST_RADPS = 10.0, 10.0


@kernel
def _body_damping(linear, quadratic, rate, inertia):
    """Damping moment over its rate (N m s/rad), the brake of a spin included."""
    damping = max(0.0, linear + quadratic * abs(rate))
    return damping + inertia * max(0.0, abs(rate) - FASTEST_RADPS)


@kernel
def power_of_speed(speed, exponent):
    """A speed (m/s) to a power; to that of a laminar boundary layer by a root, which is faster."""
    return 1.0 / math.sqrt(speed) if exponent == -0.5 else speed**exponent


@kernel
def parasitic_drag(speed, vehicle):
    """K_D0 (kg/m) at a speed (m/s); that of the file is at 1 m/s.

    Of a hull with a laminar boundary layer it falls with speed (Eriksen et al. 2001).
    """
    if vehicle.speed_exponent == 0.0:
        return vehicle.K_D0
    return vehicle.K_D0 * power_of_speed(speed, vehicle.speed_exponent)


@kernel
def hydrodynamics(u, v, w, p, q, r, vehicle):
    """Viscous force (N) and moment (N m) for velocity through the water; 6 numbers."""
    xz2 = u * u + w * w
    speed2 = xz2 + v * v
    speed = math.sqrt(speed2)
    xz = math.sqrt(xz2)
    f_x, f_y, f_z = 0.0, 0.0, 0.0
    t_x, t_y, t_z = 0.0, 0.0, 0.0
    if xz > 1e-9:
        c_a, s_a = u / xz, w / xz
        c_b, s_b = xz / speed, v / speed
        lift_angle = s_a * c_a
        drag = (parasitic_drag(speed, vehicle) + vehicle.K_D * s_a * s_a) * speed2
        side = vehicle.K_beta * s_b * speed2
        lift = (vehicle.K_L0 + vehicle.K_L * lift_angle) * speed2
        # damping along axes that turn with alpha where it is small, by 17 deg at most
        s_d = s_a * c_a * c_a * c_a * c_a
        c_d = math.sqrt(1.0 - s_d * s_d)
        damp_1 = vehicle.K_p * (c_d * p + s_d * r) * speed2
        damp_2 = vehicle.K_q * q * speed2
        damp_3 = vehicle.K_r * (c_d * r - s_d * p) * speed2
        m_1 = vehicle.K_MR * s_b * speed2
        m_2 = (vehicle.K_M0 + vehicle.K_M * lift_angle) * speed2
        m_3 = vehicle.K_MY * s_b * speed2
        # R_BC maps wind axes to body: first column along the velocity, third to its lift side
        f_x = -drag * c_a * c_b - side * c_a * s_b + lift * s_a
        f_y = -drag * s_b + side * c_b
        f_z = -drag * s_a * c_b - side * s_a * s_b - lift * c_a
        t_x = m_1 * c_a * c_b - m_2 * c_a * s_b - m_3 * s_a + c_d * damp_1 - s_d * damp_3
        t_y = m_1 * s_b + m_2 * c_b + damp_2
        t_z = m_1 * s_a * c_b - m_2 * s_a * s_b + m_3 * c_a + s_d * damp_1 + c_d * damp_3
    brake = vehicle.m * max(0.0, speed - FASTEST_MPS)
    return (
        f_x - (max(0.0, vehicle.D_u + vehicle.D_uu * abs(u)) + brake) * u,
        f_y - (max(0.0, vehicle.D_v + vehicle.D_vv * abs(v)) + brake) * v,
        f_z - (max(0.0, vehicle.D_w + vehicle.D_ww * abs(w)) + brake) * w,
        t_x - _body_damping(vehicle.D_p, vehicle.D_pp, p, vehicle.i_xx + vehicle.a_44) * p,
        t_y - _body_damping(vehicle.D_q, vehicle.D_qq, q, vehicle.i_yy + vehicle.a_55) * q,
        t_z - _body_damping(vehicle.D_r, vehicle.D_rr, r, vehicle.i_zz + vehicle.a_66) * r,
    )


@kernel
def rate_damping(u, v, w, p, q, r, vehicle):
    """What the damping moments lose with the rate about their own axis (N m s/rad, 3 numbers).

    - d(moment)/d(rate) of `hydrodynamics`, without what static moments and other rates do.
    """
    xz2 = u * u + w * w
    speed2 = xz2 + v * v
    s_d2 = 0.0
    if xz2 > 1e-18:
        c_a2 = u * u / xz2
        s_d2 = (1.0 - c_a2) * c_a2 * c_a2 * c_a2 * c_a2
    d_x = (vehicle.K_p * (1.0 - s_d2) + vehicle.K_r * s_d2) * speed2
    d_z = (vehicle.K_p * s_d2 + vehicle.K_r * (1.0 - s_d2)) * speed2
    return (
        _steepness(vehicle.D_p, vehicle.D_pp, p, vehicle.i_xx + vehicle.a_44) - d_x,
        _steepness(vehicle.D_q, vehicle.D_qq, q, vehicle.i_yy + vehicle.a_55)
        - vehicle.K_q * speed2,
        _steepness(vehicle.D_r, vehicle.D_rr, r, vehicle.i_zz + vehicle.a_66) - d_z,
    )


@kernel
def _steepness(linear, quadratic, rate, inertia):
    """Derivative of the damping moment in body axes (N m s/rad)."""
    steepness = max(0.0, linear + 2.0 * quadratic * abs(rate))
    if abs(rate) > FASTEST_RADPS:
        steepness += inertia * (2.0 * abs(rate) - FASTEST_RADPS)
    return steepness
