# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""Current observer: the predictor of the paper, equations (19)-(25), made whole.

    eta_hat'  = nu_model + v_c_hat + K3 (eta - eta_hat)
    v_c_hat'  = K4 (eta - eta_hat)

The error obeys A = [-K3 I, I; -K4 I, 0], stable for K3, K4 > 0. The vehicle does not measure its
speed through the water: ``nu_model`` comes from pitch and vertical rate through the glide polar.
That holds in a steady glide only. While it does not (inflections, surface), the prediction uses
the velocity over ground instead, so that the innovation decays and the estimate stays what it was.
"""

from typing import NamedTuple

from glider_base.kernel import kernel


class ObserverState(NamedTuple):
    """Estimate of the current, and the position error of the prediction."""

    error_n: float  #: eta - eta_hat (m)
    error_e: float
    current_n: float  #: v_c_hat (m/s)
    current_e: float


class ObserverParams(NamedTuple):
    """Gains of the observer."""

    k3: float  #: (1/s)
    k4: float  #: (1/s^2)


@kernel
def observer_step(state, ground_n, ground_e, model_n, model_e, valid, params, dt):
    """One step of ``dt`` s.

    Parameters
    ----------
    ground_n, ground_e : float
        Velocity over ground (m/s), the rate of the measured position.
    model_n, model_e : float
        Velocity through the water by the flight model (m/s).
    valid : bool
        Whether the flight model holds now.
    """
    if valid:
        drift_n = ground_n - model_n - state.current_n
        drift_e = ground_e - model_e - state.current_e
        current_n = state.current_n + dt * params.k4 * state.error_n
        current_e = state.current_e + dt * params.k4 * state.error_e
    else:
        drift_n, drift_e = 0.0, 0.0
        current_n, current_e = state.current_n, state.current_e
    return ObserverState(
        state.error_n + dt * (drift_n - params.k3 * state.error_n),
        state.error_e + dt * (drift_e - params.k3 * state.error_e),
        current_n,
        current_e,
    )
