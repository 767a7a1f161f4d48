# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""What the vehicle measures: its noise, and the way back to the truth.

White noise, drawn anew at every tick. It is a function of (seed, tick), so that nodes and direct
engine publish the same bits, and whoever knows the seed can take it off a recording again.

    p      = p + n_p
    q_NB   = q(0, 0, n_psi) (x) q_NB (x) q(n_phi, n_theta, 0)
    omega  = omega + n_omega

Heading noise turns about the vertical, roll and pitch noise about the body axes: no attitude is
singular. The velocity over ground keeps its numbers in body axes. The current field is asked at
the measured place, since its node knows no other.
"""

import math
from typing import NamedTuple

import numpy as np
from pydantic import Field

from glider_model.base.frames import odometry_to_wire, quaternion_from_euler
from glider_model.base.kernel import kernel
from glider_model.base.noise import normal_pair, random_stream
from glider_model.base.settings import Settings
from glider_model.base.signals import Odometry

#: Sets the streams of the sensors apart from those of the current, whose offsets are smaller.
_STREAM_OFFSET = 2**32
#: Pairs of random numbers in a tick: nine numbers, and one to spare.
_PAIRS = 5


class SensorSettings(Settings):
    """Noise of the odometry, as standard deviations; white, without bias."""

    attitude_std_deg: float = Field(
        0.0, ge=0.0, le=10.0, description='noise of roll and of pitch (deg)'
    )
    heading_std_deg: float = Field(0.0, ge=0.0, le=45.0, description='noise of the heading (deg)')
    rate_std_dps: float = Field(
        0.0, ge=0.0, le=10.0, description='noise of each angular rate (deg/s)'
    )
    position_std_m: float = Field(
        0.0, ge=0.0, le=1000.0, description='noise of north, of east and of depth (m)'
    )

    def params(self, seed: int) -> 'SensorParams':
        """Kernel parameters for the noise under one seed."""
        return SensorParams(
            np.uint64(random_stream(seed, _STREAM_OFFSET, 0)),
            math.radians(self.attitude_std_deg),
            math.radians(self.heading_std_deg),
            math.radians(self.rate_std_dps),
            self.position_std_m,
        )


class SensorParams(NamedTuple):
    """Noise as the kernels see it."""

    stream: np.uint64  #: start of the random stream
    attitude: float  #: standard deviations (rad, rad, rad/s, m)
    heading: float
    rate: float
    position: float


class Noise(NamedTuple):
    """Noise of one tick (m, rad, rad/s)."""

    p_n: float
    p_e: float
    p_d: float
    phi: float
    theta: float
    psi: float
    p: float
    q: float
    r: float


@kernel
def is_noisy(params):
    """Whether there is any noise."""
    return (
        params.attitude > 0.0 or params.heading > 0.0 or params.rate > 0.0 or params.position > 0.0
    )


@kernel
def noise_of_tick(tick, params):
    """Noise that belongs to a tick."""
    first = np.uint64(_PAIRS) * np.uint64(tick)
    n_1, n_2 = normal_pair(params.stream, first)
    n_3, n_4 = normal_pair(params.stream, first + np.uint64(1))
    n_5, n_6 = normal_pair(params.stream, first + np.uint64(2))
    n_7, n_8 = normal_pair(params.stream, first + np.uint64(3))
    n_9, _ = normal_pair(params.stream, first + np.uint64(4))
    return Noise(
        params.position * n_1,
        params.position * n_2,
        params.position * n_3,
        params.attitude * n_4,
        params.attitude * n_5,
        params.heading * n_6,
        params.rate * n_7,
        params.rate * n_8,
        params.rate * n_9,
    )


@kernel
def _product(a, b):
    """Product of two quaternions."""
    return (
        a[0] * b[0] - a[1] * b[1] - a[2] * b[2] - a[3] * b[3],
        a[0] * b[1] + a[1] * b[0] + a[2] * b[3] - a[3] * b[2],
        a[0] * b[2] - a[1] * b[3] + a[2] * b[0] + a[3] * b[1],
        a[0] * b[3] + a[1] * b[2] - a[2] * b[1] + a[3] * b[0],
    )


@kernel
def add_noise(odometry, tick, params):
    """Odometry with the noise of a tick; without noise the very same numbers.

    Parameters
    ----------
    odometry : Odometry
        Where the vehicle is.
    tick : int
    params : SensorParams

    Returns
    -------
    Odometry
    """
    if not is_noisy(params):
        return odometry
    x, n = odometry, noise_of_tick(tick, params)
    heading = quaternion_from_euler(0.0, 0.0, n.psi)
    tilt = quaternion_from_euler(n.phi, n.theta, 0.0)
    q = _product(_product(heading, (x.q_w, x.q_x, x.q_y, x.q_z)), tilt)
    return Odometry(
        x.p_n + n.p_n,
        x.p_e + n.p_e,
        x.p_d + n.p_d,
        q[0],
        q[1],
        q[2],
        q[3],
        x.u,
        x.v,
        x.w,
        x.p + n.p,
        x.q + n.q,
        x.r + n.r,
    )


@kernel
def sense(odometry, joints, tick, params):
    """What the vehicle measures at a tick, for the topics of the plant: odom, joint_states.

    Parameters
    ----------
    odometry : Odometry
        Where the vehicle is.
    joints : Joints
        Where the actuators are.
    tick : int
    params : SensorParams

    Returns
    -------
    tuple of tuple of float
        Numbers on the wire, in the order of the plant's outputs in `glider_model.base.wiring`.
    """
    odom = odometry_to_wire(add_noise(odometry, tick, params))
    return odom, (joints.m_b, joints.x_p, joints.mu)


@kernel
def remove_noise(measured, tick, params):
    """True odometry behind what was measured at a tick: `add_noise` undone, to rounding."""
    if not is_noisy(params):
        return measured
    x, n = measured, noise_of_tick(tick, params)
    heading = quaternion_from_euler(0.0, 0.0, -n.psi)
    w, i, j, k = quaternion_from_euler(n.phi, n.theta, 0.0)
    q = _product(_product(heading, (x.q_w, x.q_x, x.q_y, x.q_z)), (w, -i, -j, -k))
    return Odometry(
        x.p_n - n.p_n,
        x.p_e - n.p_e,
        x.p_d - n.p_d,
        q[0],
        q[1],
        q[2],
        q[3],
        x.u,
        x.v,
        x.w,
        x.p - n.p,
        x.q - n.q,
        x.r - n.r,
    )
