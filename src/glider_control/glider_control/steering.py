# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""How the vehicle steers, learnt in flight: yaw rate = b sin(phi) V / V_0 + k phi' + d.

Both the effectiveness b and its sign belong to vehicle and phase (Seaglider: -0.040 in the dive,
+0.018 in the climb), so a Kalman filter estimates (b, k, d) for each phase from the measured yaw
rate. It starts knowing nothing: the first turn that the path asks for tells the sign.

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


class SteeringLearningSettings(Settings):
    """Estimator of steering effectiveness and turn-rate disturbance."""

    prior_radps: float = Field(
        0.02, gt=0.0, le=1.0, description='b before anything is known, - in the climb (rad/s)'
    )
    prior_std_radps: float = Field(
        0.05, gt=0.0, le=1.0, description='its standard deviation (rad/s)'
    )
    smallest_radps: float = Field(
        0.003, gt=0.0, le=1.0, description='smallest b that is steered with (rad/s)'
    )
    drift_radps: float = Field(
        0.005, ge=0.0, le=0.1, description='change of b to be expected in 1000 s (rad/s)'
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
        0.002, gt=0.0, le=0.1, description='yaw rate that the model does not explain (rad/s)'
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
            self.smallest_radps,
            self.drift_radps**2 / 1000.0,
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
            sign,
            0.0,
            0.0,
            self.prior_std_radps**2,
            0.0,
            0.0,
            self.kick_std**2,
            0.0,
            self.disturbance_std_radps**2,
        )


class SteeringParams(NamedTuple):
    """Estimator as the kernels see it."""

    smallest: float  #: (rad/s)
    drift: float  #: variance growth of b (rad^2/s^3)
    kick_drift: float  #: variance growth of k (1/s)
    disturbance_drift: float  #: variance growth of d (rad^2/s^3)
    noise: float  #: spectral density of the yaw-rate noise (rad^2/s)
    after_s: float  #: time after a turn-over in which nothing is learnt (s)
    smoothing_s: float


class SteeringState(NamedTuple):
    """Estimate and covariance for one phase."""

    b: float  #: effectiveness (rad/s)
    sign: float  #: sign that is steered with; it changes when the other one is clear
    k: float  #: heading per roll angle while the vehicle rolls (-)
    d: float  #: turn-rate disturbance (rad/s)
    p_bb: float  #: covariance
    p_bk: float
    p_bd: float
    p_kk: float
    p_kd: float
    p_dd: float


@kernel
def learn_steering(state, bank, roll_rate, yaw_rate, params, dt):
    """One Kalman step of ``dt`` s on yaw_rate = b bank + k roll_rate + d.

    Parameters
    ----------
    bank : float
        sin(phi) V / V_0, smoothed as the rates are (-).
    roll_rate, yaw_rate : float
        Measured and smoothed (rad/s).
    """
    p_bb = state.p_bb + params.drift * dt
    p_kk = state.p_kk + params.kick_drift * dt
    p_dd = state.p_dd + params.disturbance_drift * dt
    g_b = p_bb * bank + state.p_bk * roll_rate + state.p_bd
    g_k = state.p_bk * bank + p_kk * roll_rate + state.p_kd
    g_d = state.p_bd * bank + state.p_kd * roll_rate + p_dd
    spread = g_b * bank + g_k * roll_rate + g_d + params.noise / dt
    innovation = yaw_rate - state.b * bank - state.k * roll_rate - state.d
    b = state.b + g_b / spread * innovation
    sign = math.copysign(1.0, b) if abs(b) > 0.5 * params.smallest else state.sign
    return SteeringState(
        b,
        sign,
        state.k + g_k / spread * innovation,
        state.d + g_d / spread * innovation,
        p_bb - g_b * g_b / spread,
        state.p_bk - g_b * g_k / spread,
        state.p_bd - g_b * g_d / spread,
        p_kk - g_k * g_k / spread,
        state.p_kd - g_k * g_d / spread,
        p_dd - g_d * g_d / spread,
    )


@kernel
def effective_steering(state, params):
    """Effectiveness to steer with (rad/s): never so small that a command would be unbounded."""
    return state.sign * max(state.sign * state.b, params.smallest)
