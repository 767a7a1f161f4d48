# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""How the vehicle steers, learnt in flight: turn rate = b sin(phi) V / V_0 + d.

Both the effectiveness b and its sign belong to vehicle and phase (Seaglider: -0.040 in the dive,
+0.018 in the climb), so a Kalman filter estimates (b, d) for each phase from the measured yaw
rate. It starts knowing nothing: the first turn that the path asks for tells the sign.
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
        0.004, gt=0.0, le=1.0, description='smallest b that is steered with (rad/s)'
    )
    drift_radps: float = Field(
        0.001, ge=0.0, le=0.1, description='change of b to be expected in 1000 s (rad/s)'
    )
    disturbance_std_radps: float = Field(
        0.002, gt=0.0, le=0.1, description='standard deviation of d before it is known (rad/s)'
    )
    disturbance_drift_radps: float = Field(
        0.0003, ge=0.0, le=0.1, description='change of d to be expected in 1000 s (rad/s)'
    )
    noise_radps: float = Field(
        0.002, gt=0.0, le=0.1, description='yaw rate that the model does not explain (rad/s)'
    )
    after_s: float = Field(
        30.0, ge=0.0, le=600.0, description='learning begins this long after a turn (s)'
    )
    lag_s: float = Field(4.0, gt=0.0, le=60.0, description='lag of yaw rate behind roll (s)')

    def params(self) -> 'SteeringParams':
        """Kernel parameters."""
        return SteeringParams(
            self.smallest_radps,
            self.drift_radps**2 / 1000.0,
            self.disturbance_drift_radps**2 / 1000.0,
            self.noise_radps**2 * self.lag_s,
            self.after_s,
            self.lag_s,
        )

    def initial_state(self, sign: float) -> 'SteeringState':
        """Estimate before the first turn."""
        return SteeringState(
            sign * self.prior_radps,
            0.0,
            self.prior_std_radps**2,
            0.0,
            self.disturbance_std_radps**2,
        )


class SteeringParams(NamedTuple):
    """Estimator as the kernels see it."""

    smallest: float  #: (rad/s)
    drift: float  #: variance growth of b (rad^2/s^3)
    disturbance_drift: float  #: variance growth of d (rad^2/s^3)
    noise: float  #: spectral density of the yaw-rate noise (rad^2/s)
    after_s: float  #: time after a turn in which nothing is learnt (s)
    lag_s: float


class SteeringState(NamedTuple):
    """Estimate and covariance for one phase."""

    b: float  #: effectiveness (rad/s)
    d: float  #: turn-rate disturbance (rad/s)
    p_bb: float
    p_bd: float
    p_dd: float


@kernel
def learn_steering(state, regressor, yaw_rate, params, dt):
    """One Kalman step of ``dt`` s on yaw_rate = b regressor + d.

    Parameters
    ----------
    regressor : float
        sin(phi) V / V_0, lagged as the yaw rate is (-).
    yaw_rate : float
        Measured (rad/s).
    """
    p_bb = state.p_bb + params.drift * dt
    p_bd = state.p_bd
    p_dd = state.p_dd + params.disturbance_drift * dt
    g_b = p_bb * regressor + p_bd
    g_d = p_bd * regressor + p_dd
    spread = g_b * regressor + g_d + params.noise / dt
    innovation = yaw_rate - state.b * regressor - state.d
    k_b, k_d = g_b / spread, g_d / spread
    return SteeringState(
        state.b + k_b * innovation,
        state.d + k_d * innovation,
        p_bb - k_b * g_b,
        p_bd - k_b * g_d,
        p_dd - k_d * g_d,
    )


@kernel
def effective_steering(state, params):
    """Effectiveness to steer with (rad/s): never so small that a command would be unbounded."""
    return math.copysign(max(abs(state.b), params.smallest), state.b)
