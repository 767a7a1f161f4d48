# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""How the vehicle steers, learnt in flight: yaw rate = (b s + c s^3) V / V_0 + k phi' + d.

s is sin(phi). Both the effectiveness b and its sign belong to vehicle and phase (Seaglider: -0.040
in the dive, +0.018 in the climb), so a Kalman filter estimates (b, c, k, d) for each phase from
the measured yaw rate. It starts knowing nothing: the first turn that the path asks for tells the
sign.

The bend c: steering fades, or grows, with roll. A vehicle that steers weakly turns fastest at some
20 deg of roll and beyond 35 deg the other way; rolling it further is the way to lose it.

The kick k: while the vehicle rolls, the roll mass makes more moment than gravity takes back, and
on a pitched vehicle the excess turns the nose, by about (damping in roll / damping in yaw)
tan(pitch) of the roll angle, often to the wrong side. psi - k phi is the heading that is left when
the roll is gone; steering by it takes the non-minimum-phase part out of the heading loop.
"""

import math
from typing import NamedTuple

from pydantic import Field

from glider_model.kernel import kernel
from glider_model.settings import Settings

#: Speed through the water at which steering effectiveness is given (m/s).
STEERING_SPEED = 0.5
#: A vehicle that steers less is not steered at all (rad/s).
SMALLEST_STEERING = 1e-6
#: A standard deviation of this share of b is no doubt.
SURE_SHARE = 0.3
#: The kick is used for heading errors up to this size (rad).
KICK_ERROR = 0.09
#: The vehicle rolls to this share of the roll at which it turns fastest.
SHARE_OF_PEAK = 0.7


class SteeringLearningSettings(Settings):
    """Estimator of steering effectiveness and turn-rate disturbance."""

    prior_radps: float = Field(
        0.02, gt=0.0, le=1.0, description='b before anything is known, - in the climb (rad/s)'
    )
    prior_std_radps: float = Field(
        0.02, gt=0.0, le=1.0, description='its standard deviation (rad/s)'
    )
    drift_radps: float = Field(
        0.0005, ge=0.0, le=0.1, description='change of b to be expected in 1000 s (rad/s)'
    )
    bend_std_radps: float = Field(
        0.01, gt=0.0, le=1.0, description='standard deviation of c before it is known (rad/s)'
    )
    bend_drift_radps: float = Field(
        0.001, ge=0.0, le=0.1, description='change of c to be expected in 1000 s (rad/s)'
    )
    kick_std: float = Field(
        0.3, ge=0.0, le=5.0, description='standard deviation of k before it is known (-)'
    )
    kick_drift: float = Field(
        0.05, ge=0.0, le=5.0, description='change of k to be expected in 1000 s (-)'
    )
    disturbance_std_radps: float = Field(
        0.001, gt=0.0, le=0.1, description='standard deviation of d before it is known (rad/s)'
    )
    disturbance_drift_radps: float = Field(
        0.0003, ge=0.0, le=0.1, description='change of d to be expected in 1000 s (rad/s)'
    )
    noise_radps: float = Field(
        0.0004, gt=0.0, le=0.1, description='yaw rate that the model does not explain (rad/s)'
    )
    correlation_s: float = Field(
        60.0, gt=0.0, le=600.0, description='time over which that is one and the same error (s)'
    )
    smoothing_s: float = Field(
        20.0,
        gt=0.0,
        le=200.0,
        description='low pass on roll and yaw rate, slower than the turn takes to build up (s)',
    )
    after_s: float = Field(
        30.0, ge=0.0, le=600.0, description='learning begins this long after a turn-over (s)'
    )

    def params(self) -> 'SteeringParams':
        """Kernel parameters."""
        return SteeringParams(
            self.drift_radps**2 / 1000.0,
            self.bend_drift_radps**2 / 1000.0,
            self.kick_drift**2 / 1000.0,
            self.disturbance_drift_radps**2 / 1000.0,
            self.noise_radps**2 * self.correlation_s,
            self.after_s,
            self.smoothing_s,
        )

    def initial_state(self, sign: float) -> 'SteeringState':
        """Estimate before the first turn."""
        return SteeringState(
            sign * self.prior_radps,
            0.0,
            0.0,
            0.0,
            (
                *(self.prior_std_radps**2, 0.0, 0.0, 0.0),
                *(self.bend_std_radps**2, 0.0, 0.0),
                *(self.kick_std**2, 0.0),
                self.disturbance_std_radps**2,
            ),
        )


class SteeringParams(NamedTuple):
    """Estimator as the kernels see it."""

    drift: float  #: variance growth of b (rad^2/s^3)
    bend_drift: float  #: variance growth of c (rad^2/s^3)
    kick_drift: float  #: variance growth of k (1/s)
    disturbance_drift: float  #: variance growth of d (rad^2/s^3)
    noise: float  #: spectral density of the yaw-rate noise (rad^2/s)
    after_s: float  #: time after a turn-over in which nothing is learnt (s)
    smoothing_s: float


class SteeringState(NamedTuple):
    """Estimate and covariance for one phase."""

    b: float  #: effectiveness (rad/s)
    c: float  #: how it bends with the cube of sin(roll) (rad/s)
    k: float  #: heading per roll angle while the vehicle rolls (-)
    d: float  #: turn-rate disturbance (rad/s)
    p: tuple[float, float, float, float, float, float, float, float, float, float]
    #: upper triangle of the covariance of (b, c, k, d), row by row


@kernel
def learn_steering(state, bank, bend, roll_rate, yaw_rate, params, dt):
    """One Kalman step of ``dt`` s on yaw_rate = b bank + c bend + k roll_rate + d.

    Parameters
    ----------
    bank, bend : float
        sin(phi) V / V_0 and sin(phi)^3 V / V_0, smoothed as the rates are (-).
    roll_rate, yaw_rate : float
        Measured and smoothed (rad/s).
    """
    bb, bc, bk, bd, cc, ck, cd, kk, kd, dd = state.p
    bb += params.drift * dt
    cc += params.bend_drift * dt
    kk += params.kick_drift * dt
    dd += params.disturbance_drift * dt
    g_b = bb * bank + bc * bend + bk * roll_rate + bd
    g_c = bc * bank + cc * bend + ck * roll_rate + cd
    g_k = bk * bank + ck * bend + kk * roll_rate + kd
    g_d = bd * bank + cd * bend + kd * roll_rate + dd
    spread = g_b * bank + g_c * bend + g_k * roll_rate + g_d + params.noise / dt
    gain = (yaw_rate - state.b * bank - state.c * bend - state.k * roll_rate - state.d) / spread
    return SteeringState(
        state.b + g_b * gain,
        state.c + g_c * gain,
        state.k + g_k * gain,
        state.d + g_d * gain,
        (
            bb - g_b * g_b / spread,
            bc - g_b * g_c / spread,
            bk - g_b * g_k / spread,
            bd - g_b * g_d / spread,
            cc - g_c * g_c / spread,
            ck - g_c * g_k / spread,
            cd - g_c * g_d / spread,
            kk - g_k * g_k / spread,
            kd - g_k * g_d / spread,
            dd - g_d * g_d / spread,
        ),
    )


@kernel
def caution(state):
    """Share of a turn for which the vehicle is rolled: the less is known of b, the less.

    b^2 / (b^2 + var b) minimises the expected squared error of the turn rate (cautious control:
    Astrom and Wittenmark, Adaptive Control, 1995, chapter 7). A vehicle whose sign is in doubt is
    hardly rolled; a deviation that leaves no doubt about it is no reason.
    """
    square = state.b * state.b
    return square / (square + max(0.0, state.p[0] - SURE_SHARE * SURE_SHARE * square))


@kernel
def roll_to_kick(state, error):
    """Sine of the roll whose kick alone turns the nose by a heading error (rad), if it is of use.

    It is where turn and kick go to the same side: there the heading that is left when the roll is
    gone comes nearer by itself. Of a kick that is not known well, a share is used, as of b.
    """
    if state.b * state.k <= 0.0:
        return 0.0
    small = min(KICK_ERROR, max(-KICK_ERROR, error))
    return (1.0 - caution(state)) * small * state.k / (state.k * state.k + state.p[7])


@kernel
def roll_to_turn(state, turn, ratio, limit):
    """Sine of the roll that turns at ``turn``, and the largest sine that is of use.

    Where steering fades with roll, b s + c s^3 has a peak; beyond it a vehicle turns the less,
    and at last the other way, the more it rolls.

    Parameters
    ----------
    state : SteeringState
    turn : float
        Turn rate that roll shall make (rad/s).
    ratio : float
        V / V_0 (-).
    limit : float
        Largest sine of roll (-).
    """
    b, c = state.b, state.c
    if b * c < 0.0:
        limit = min(limit, SHARE_OF_PEAK * math.sqrt(-b / (3.0 * c)))
    sine = 0.0
    if abs(b) > SMALLEST_STEERING:
        part = turn / ratio * caution(state)
        for _ in range(4):
            sine += (part - (b + c * sine * sine) * sine) / (b + 3.0 * c * sine * sine)
            sine = min(limit, max(-limit, sine))
    return sine, limit
