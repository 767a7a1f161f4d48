# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""What is taken for measured: a wild sample of odometry is refused, the last good one serves.

A sample is refused if a number is not finite, the quaternion is none, place, rate or speed are
beyond any glider's, or if it lies so far from where the last good one leads that no glider went
there. After ``hold_s`` of refusals a sample that is good in itself counts again, for then the
world has jumped (a fix, a new source); without one the measurement is lost.
"""

import math
from typing import NamedTuple

from glider_base.frames import rotate_to_ned
from glider_base.kernel import kernel, replace
from glider_base.settings import Settings, derived, number, positive
from glider_base.signals import Odometry

#: Actuators that say they are farther out than this many ranges are not plausible (-).
JOINT_RANGES = 1.5
#: No place is farther than half round the Earth, and no sea is deeper (m).
FARTHEST_M, DEEPEST_M = 2e7, 12_000.0
#: Deviation of a quaternion's squared norm from 1: from here it is scaled, from there refused (-).
NORM_SCALED, NORM_REFUSED = 1e-9, 0.02


class GateSettings(Settings):
    """Which samples of odometry are refused, and for how long the last good one serves."""

    rate_max_radps: float = positive(6.0, 100.0, 'largest angular rate about any axis (rad/s)')
    speed_max_mps: float = positive(10.0, 1000.0, 'largest speed over ground (m/s)')
    rate_jump_radps: float = positive(
        1.0, 200.0, 'largest change of a rate between samples (rad/s)'
    )
    speed_jump_mps: float = positive(
        1.0, 2000.0, 'largest change of velocity between samples (m/s)'
    )
    attitude_jump_deg: float = positive(60.0, 360.0, 'largest turn between samples (deg)')
    position_jump_m: float = positive(
        100.0, 1e8, 'farthest from where the last sample leads, horizontally (m)'
    )
    depth_jump_m: float = positive(20.0, 1e5, 'the same for the depth (m)')
    hold_s: float = number(1.0, (0.0, 60.0), 'time for which the last good sample serves (s)')

    def params(self) -> 'GateParams':
        """Kernel parameters."""
        return derived(
            GateParams,
            self,
            speed_max2=self.speed_max_mps**2,
            speed_jump2=self.speed_jump_mps**2,
            attitude_cosine=math.cos(0.5 * math.radians(self.attitude_jump_deg)),
            position_jump2=self.position_jump_m**2,
        )


class GateParams(NamedTuple):
    """Limits as the kernels see them."""

    rate_max: float  #: (rad/s)
    speed_max2: float  #: (m^2/s^2)
    rate_jump: float  #: (rad/s)
    speed_jump2: float  #: (m^2/s^2)
    attitude_cosine: float  #: cosine of half the largest turn (-)
    position_jump2: float  #: (m^2)
    depth_jump: float  #: (m)
    hold_s: float  #: (s)


class GateState(NamedTuple):
    """The last good sample, and what has come since."""

    odometry: Odometry  #: what serves
    seen: bool  #: whether there has been a good sample
    age_s: float  #: time since the last good sample (s)
    refused: int  #: samples refused so far


INITIAL_GATE = GateState(Odometry(*(3 * (0.0,)), 1.0, *(9 * (0.0,))), False, 0.0, 0)


@kernel
def norm2(x):
    """Squared norm of the quaternion of a sample."""
    return x.q_w * x.q_w + x.q_x * x.q_x + x.q_y * x.q_y + x.q_z * x.q_z


@kernel
def is_slow(x, params):
    """Whether the angular rates of a sample are those of a glider; false for NaN."""
    most = params.rate_max
    return abs(x.p) <= most and abs(x.q) <= most and abs(x.r) <= most


@kernel
def is_plausible(odometry, params):
    """Whether a sample is good in itself: on Earth, an attitude, no faster than any glider."""
    x = odometry
    # a comparison with NaN is false: each is put such that NaN is refused
    return (
        abs(x.p_n) <= FARTHEST_M
        and abs(x.p_e) <= FARTHEST_M
        and abs(x.p_d) <= DEEPEST_M
        and abs(norm2(x) - 1.0) < NORM_REFUSED
        and x.u * x.u + x.v * x.v + x.w * x.w <= params.speed_max2
        and is_slow(x, params)
    )


@kernel
def are_plausible(joints, ranges):
    """Whether actuators can be where somebody says; false for NaN."""
    return (
        abs(joints.m_b) <= JOINT_RANGES * ranges.m_b
        and abs(joints.x_p) <= JOINT_RANGES * ranges.x_p
        and abs(joints.mu) <= JOINT_RANGES * ranges.mu
        and abs(joints.delta) <= JOINT_RANGES * ranges.delta
    )


@kernel
def has_turned(x, y, params):
    """Whether a sample is farther from another one than a glider turns."""
    turn = x.q_w * y.q_w + x.q_x * y.q_x + x.q_y * y.q_y + x.q_z * y.q_z
    return (
        abs(turn) < params.attitude_cosine
        or abs(x.p - y.p) > params.rate_jump
        or abs(x.q - y.q) > params.rate_jump
        or abs(x.r - y.r) > params.rate_jump
    )


@kernel
def has_jumped(odometry, last, velocity, age_s, params):
    """Whether a sample lies farther from the last good one than a glider comes in ``age_s``.

    ``velocity`` is that of the last good sample over ground, NED (m/s).
    """
    x, y = odometry, last
    d_n = x.p_n - y.p_n - velocity[0] * age_s
    d_e = x.p_e - y.p_e - velocity[1] * age_s
    d_d = x.p_d - y.p_d - velocity[2] * age_s
    d_u, d_v, d_w = x.u - y.u, x.v - y.v, x.w - y.w
    return (
        d_n * d_n + d_e * d_e > params.position_jump2
        or abs(d_d) > params.depth_jump
        or d_u * d_u + d_v * d_v + d_w * d_w > params.speed_jump2
        or has_turned(x, y, params)
    )


@kernel
def scaled(x):
    """The same sample with a unit quaternion; the very same if it has one."""
    if abs(norm2(x) - 1.0) <= NORM_SCALED:
        return x
    s = 1.0 / math.sqrt(norm2(x))
    return replace(x, q_w=s * x.q_w, q_x=s * x.q_x, q_y=s * x.q_y, q_z=s * x.q_z)


@kernel
def gate_step(state: GateState, odometry: Odometry, params: GateParams, dt: float) -> GateState:
    """Take in a sample ``dt`` s after the one before, in which anything may be.

    Its odometry is the sample, if that is good, else the last good one.
    """
    age_s = state.age_s + dt
    good = is_plausible(odometry, params)
    if good and state.seen and age_s <= params.hold_s:
        last = state.odometry
        velocity = rotate_to_ned(last.q_w, last.q_x, last.q_y, last.q_z, last.u, last.v, last.w)
        good = not has_jumped(odometry, last, velocity, age_s, params)
    if good:
        return GateState(scaled(odometry), True, 0.0, state.refused)
    return GateState(state.odometry, state.seen, age_s, state.refused + 1)


@kernel
def is_lost(state, params):
    """Whether there has been no good sample for so long that the last one serves no more."""
    return state.age_s > params.hold_s
