# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""Measured attitude and vertical rate, filtered: noise must not move motors."""

from typing import NamedTuple

from glider_base.frames import euler_from_quaternion, euler_rates, rotate_to_ned, wrap_angle
from glider_base.kernel import kernel


class Measured(NamedTuple):
    """Filtered attitude (rad), Euler rates (rad/s), vertical rate (m/s, + down)."""

    phi: float
    theta: float
    psi: float
    phi_dot: float
    theta_dot: float
    psi_dot: float
    vertical_rate: float


#: Of a vehicle of which nothing has been measured yet.
STILL = Measured(*(7 * (0.0,)))


@kernel
def _follow(state, measured, rate, share, dt):
    """Complementary filter of an angle: the rate carries it, the measurement corrects it."""
    predicted = state + dt * rate
    return wrap_angle(predicted + share * wrap_angle(measured - predicted))


@kernel
def measure(state, odometry, first, time_constant, dt):
    """One step of the filter.

    The attitude follows the measured rates at once and the measured angles within
    ``time_constant`` (s), so that a manoeuvre is not delayed; rates and vertical rate are
    low-passed with a quarter of it.
    """
    q_w, q_x, q_y, q_z = odometry.q_w, odometry.q_x, odometry.q_y, odometry.q_z
    phi, theta, psi = euler_from_quaternion(q_w, q_x, q_y, q_z)
    _, _, down = rotate_to_ned(q_w, q_x, q_y, q_z, odometry.u, odometry.v, odometry.w)
    phi_dot, theta_dot, psi_dot = euler_rates(phi, theta, odometry.p, odometry.q, odometry.r)
    if first:
        return Measured(
            phi=phi,
            theta=theta,
            psi=psi,
            phi_dot=phi_dot,
            theta_dot=theta_dot,
            psi_dot=psi_dot,
            vertical_rate=down,
        )
    share = dt / (time_constant + dt)
    fast = dt / (0.25 * time_constant + dt)
    return Measured(
        phi=_follow(state.phi, phi, phi_dot, share, dt),
        theta=_follow(state.theta, theta, theta_dot, share, dt),
        psi=_follow(state.psi, psi, psi_dot, share, dt),
        phi_dot=state.phi_dot + fast * (phi_dot - state.phi_dot),
        theta_dot=state.theta_dot + fast * (theta_dot - state.theta_dot),
        psi_dot=state.psi_dot + fast * (psi_dot - state.psi_dot),
        vertical_rate=state.vertical_rate + fast * (down - state.vertical_rate),
    )
