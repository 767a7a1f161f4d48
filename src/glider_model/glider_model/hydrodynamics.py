# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""Viscous forces and moments of the water on the hull, in body axes FRD.

The form of Graver (2005) and Zhang et al. (2013): drag, side force and lift in wind axes, turned
into body axes by R_BC(alpha, beta). Their polynomials in alpha hold for attached flow at a few
degrees. Beyond that an attitude must stay physical: alpha is replaced by sin(alpha) in the drag
(cross-flow) and by sin(alpha) cos(alpha) in lift and pitch moment, beta by v / V. At a glide's
1.5 deg the difference is below 0.05 %, and no trigonometric function is needed. Rate damping acts
along the wind axes on the rates about them, with which the spiral of Zhang et al. comes out; body
rates along wind axes would drive a vehicle that moves tail first. Its axes turn by sin(alpha)
cos(alpha)^4, 17 deg at most: it takes energy in any attitude and is slow enough to integrate.
"""

import math

from glider_model.kernel import kernel


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
        drag = (vehicle.K_D0 + vehicle.K_D * s_a * s_a) * speed2
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
    return (
        f_x - (vehicle.D_u + vehicle.D_uu * abs(u)) * u,
        f_y - (vehicle.D_v + vehicle.D_vv * abs(v)) * v,
        f_z - (vehicle.D_w + vehicle.D_ww * abs(w)) * w,
        t_x - (vehicle.D_p + vehicle.D_pp * abs(p)) * p,
        t_y - (vehicle.D_q + vehicle.D_qq * abs(q)) * q,
        t_z - (vehicle.D_r + vehicle.D_rr * abs(r)) * r,
    )
