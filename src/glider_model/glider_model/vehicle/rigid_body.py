# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""Rigid body with a moving mass, and added mass: M, C nu, gravity.

Fossen (2021), ch. 3, 6 and 10; body axes FRD with the origin at the centre of buoyancy.
M = M_RB + M_A = [[A, B], [B^T, D]] with A diagonal, which makes its inverse a 3 x 3 one.
"""

import math
from typing import NamedTuple

import numpy as np

from glider_base.kernel import kernel

GRAVITY = 9.81  #: (m/s^2)


class Inertia(NamedTuple):
    """First moment, inertia and inverted Schur complement for one position of the moving mass."""

    s_x: float  #: first moment of the whole vehicle (kg m)
    s_y: float
    s_z: float
    i_xx: float  #: rigid-body inertia about the origin (kg m^2); i_xy is the matrix element
    i_yy: float
    i_zz: float
    i_xy: float
    i_xz: float
    i_yz: float
    n_xx: float  #: (D - B^T A^-1 B)^-1, symmetric
    n_yy: float
    n_zz: float
    n_xy: float
    n_xz: float
    n_yz: float


@kernel
def rigid_body(x_p, mu, vehicle):
    """First moment (3) and inertia matrix elements xx, yy, zz, xy, xz, yz for a mass position.

    The pitch mass is x_p (m) from neutral, the roll mass turned by mu (rad).
    """
    x = vehicle.x_p0 + x_p
    sine, cosine = math.sin(mu), math.cos(mu)
    y, z = vehicle.R_p * sine, vehicle.R_p * cosine
    m_p = vehicle.m_p
    return (
        vehicle.s_x + m_p * x,
        vehicle.s_y + m_p * y,
        vehicle.s_z + m_p * z,
        vehicle.i_xx + vehicle.i_px + m_p * (y * y + z * z),
        vehicle.i_yy
        + cosine * cosine * vehicle.i_py
        + sine * sine * vehicle.i_pz
        + m_p * (x * x + z * z),
        vehicle.i_zz
        + sine * sine * vehicle.i_py
        + cosine * cosine * vehicle.i_pz
        + m_p * (x * x + y * y),
        -m_p * x * y,
        -m_p * x * z,
        (vehicle.i_pz - vehicle.i_py) * sine * cosine - m_p * y * z,
    )


@kernel
def make_inertia(x_p, mu, vehicle):
    """Everything of M that depends on where the moving mass is."""
    s_x, s_y, s_z, i_xx, i_yy, i_zz, i_xy, i_xz, i_yz = rigid_body(x_p, mu, vehicle)
    a_1 = 1.0 / (vehicle.m + vehicle.a_11)
    a_2 = 1.0 / (vehicle.m + vehicle.a_22)
    a_3 = 1.0 / (vehicle.m + vehicle.a_33)
    # B = [[0, s_z, -s_y], [-s_z, 0, b_23], [s_y, b_32, 0]]
    b_23 = s_x + vehicle.a_26
    b_32 = -s_x + vehicle.a_35
    d_xx = i_xx + vehicle.a_44 - a_2 * s_z * s_z - a_3 * s_y * s_y
    d_yy = i_yy + vehicle.a_55 - a_1 * s_z * s_z - a_3 * b_32 * b_32
    d_zz = i_zz + vehicle.a_66 - a_1 * s_y * s_y - a_2 * b_23 * b_23
    d_xy = i_xy - a_3 * s_y * b_32
    d_xz = i_xz + a_2 * s_z * b_23
    d_yz = i_yz + a_1 * s_z * s_y
    c_xx = d_yy * d_zz - d_yz * d_yz
    c_xy = d_xz * d_yz - d_xy * d_zz
    c_xz = d_xy * d_yz - d_xz * d_yy
    scale = 1.0 / (d_xx * c_xx + d_xy * c_xy + d_xz * c_xz)
    return Inertia(
        s_x=s_x,
        s_y=s_y,
        s_z=s_z,
        i_xx=i_xx,
        i_yy=i_yy,
        i_zz=i_zz,
        i_xy=i_xy,
        i_xz=i_xz,
        i_yz=i_yz,
        n_xx=c_xx * scale,
        n_yy=(d_xx * d_zz - d_xz * d_xz) * scale,
        n_zz=(d_xx * d_yy - d_xy * d_xy) * scale,
        n_xy=c_xy * scale,
        n_xz=c_xz * scale,
        n_yz=(d_xz * d_xy - d_xx * d_yz) * scale,
    )


@kernel
def solve_mass(f_x, f_y, f_z, t_x, t_y, t_z, inertia, vehicle):
    """Acceleration M^-1 [f; t]: linear (m/s^2) and angular (rad/s^2), 6 numbers."""
    s_x, s_y, s_z = inertia.s_x, inertia.s_y, inertia.s_z
    b_23 = s_x + vehicle.a_26
    b_32 = -s_x + vehicle.a_35
    a_1 = 1.0 / (vehicle.m + vehicle.a_11)
    a_2 = 1.0 / (vehicle.m + vehicle.a_22)
    a_3 = 1.0 / (vehicle.m + vehicle.a_33)
    g_x, g_y, g_z = a_1 * f_x, a_2 * f_y, a_3 * f_z
    h_x = t_x + s_z * g_y - s_y * g_z
    h_y = t_y - s_z * g_x - b_32 * g_z
    h_z = t_z + s_y * g_x - b_23 * g_y
    w_x = inertia.n_xx * h_x + inertia.n_xy * h_y + inertia.n_xz * h_z
    w_y = inertia.n_xy * h_x + inertia.n_yy * h_y + inertia.n_yz * h_z
    w_z = inertia.n_xz * h_x + inertia.n_yz * h_y + inertia.n_zz * h_z
    return (
        g_x - a_1 * (s_z * w_y - s_y * w_z),
        g_y - a_2 * (-s_z * w_x + b_23 * w_z),
        g_z - a_3 * (s_y * w_x + b_32 * w_y),
        w_x,
        w_y,
        w_z,
    )


@kernel
def coriolis(u, v, w, p, q, r, inertia, vehicle):
    """C_RB(omega) nu_r + C_A(nu_r) nu_r: force (N) and moment (N m), 6 numbers.

    C_RB is the parametrisation that does not depend on linear velocity, so that the equation in
    nu_r is exact for a constant irrotational current (Hegrenaes; Fossen 2021, sec. 10.3). C_A
    carries the Munk moment.
    """
    m = vehicle.m
    s_x, s_y, s_z = inertia.s_x, inertia.s_y, inertia.s_z
    # rigid body: m w x v + w x (w x S);  S x (w x v) + w x (I w)
    c_x, c_y, c_z = q * w - r * v, r * u - p * w, p * v - q * u
    e_x, e_y, e_z = q * s_z - r * s_y, r * s_x - p * s_z, p * s_y - q * s_x
    h_x = inertia.i_xx * p + inertia.i_xy * q + inertia.i_xz * r
    h_y = inertia.i_xy * p + inertia.i_yy * q + inertia.i_yz * r
    h_z = inertia.i_xz * p + inertia.i_yz * q + inertia.i_zz * r
    # added mass: w x a;  v x a + w x b
    a_x = vehicle.a_11 * u
    a_y = vehicle.a_22 * v + vehicle.a_26 * r
    a_z = vehicle.a_33 * w + vehicle.a_35 * q
    h_x += vehicle.a_44 * p
    h_y += vehicle.a_55 * q + vehicle.a_35 * w
    h_z += vehicle.a_66 * r + vehicle.a_26 * v
    return (
        m * c_x + q * e_z - r * e_y + q * a_z - r * a_y,
        m * c_y + r * e_x - p * e_z + r * a_x - p * a_z,
        m * c_z + p * e_y - q * e_x + p * a_y - q * a_x,
        s_y * c_z - s_z * c_y + q * h_z - r * h_y + v * a_z - w * a_y,
        s_z * c_x - s_x * c_z + r * h_x - p * h_z + w * a_x - u * a_z,
        s_x * c_y - s_y * c_x + p * h_y - q * h_x + u * a_y - v * a_x,
    )


def mass_matrix(x_p: float, mu: float, vehicle) -> np.ndarray:
    """M = M_RB + M_A, float64[6, 6], for positions of the pitch (m) and roll mass (rad)."""
    s_x, s_y, s_z, i_xx, i_yy, i_zz, i_xy, i_xz, i_yz = rigid_body(x_p, mu, vehicle)
    m, v = vehicle.m, vehicle
    added = [v.a_11, v.a_22, v.a_33, v.a_44, v.a_55, v.a_66]
    matrix = np.diag(np.add([m, m, m, i_xx, i_yy, i_zz], added))
    coupling = np.array(
        [
            [0.0, s_z, -s_y],
            [-s_z, 0.0, s_x + vehicle.a_26],
            [s_y, -s_x + vehicle.a_35, 0.0],
        ]
    )
    matrix[:3, 3:] = coupling
    matrix[3:, :3] = coupling.T
    matrix[3, 4] = matrix[4, 3] = i_xy
    matrix[3, 5] = matrix[5, 3] = i_xz
    matrix[4, 5] = matrix[5, 4] = i_yz
    return matrix
