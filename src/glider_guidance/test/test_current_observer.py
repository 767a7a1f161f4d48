# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""Current observer: its linear theory, solved with the matrix exponential."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.linalg import expm, solve_continuous_lyapunov

from glider_guidance.current_observer import ObserverParams, ObserverState, observer_step
from glider_guidance.settings import ObserverSettings

quick = settings(max_examples=50)

DEFAULT = ObserverParams(ObserverSettings().k3_per_s, ObserverSettings().k4_per_s2)
AT_REST = ObserverState(0.0, 0.0, 0.0, 0.0)

gains = st.tuples(st.floats(1e-3, 1.0), st.floats(1e-6, 0.1))
velocities = st.floats(-1.5, 1.5)


def error_matrix(k3, k4):
    """A of [eta - eta_hat, v_c_hat]' = A [...] + [ground - model, 0]."""
    return np.array([[-k3, -1.0], [k4, 0.0]])


def run(state, ground, model, seconds, params=DEFAULT, dt=0.1, valid=True):
    for _ in range(round(seconds / dt)):
        state = observer_step(state, *ground, *model, valid, params, dt)
    return state


@quick
@given(gains)
def test_error_matrix_is_hurwitz_for_all_gains(k):
    assert np.max(np.linalg.eigvals(error_matrix(*k)).real) < 0.0


@quick
@given(gains, st.tuples(*4 * [velocities]), st.tuples(velocities, velocities))
def test_step_is_the_linear_equation(k, start, drift):
    """One Euler step of both axes, whatever the gains."""
    dt = 0.1
    after = observer_step(ObserverState(*start), *drift, 0.0, 0.0, True, ObserverParams(*k), dt)
    for axis in range(2):
        z = np.array([start[axis], start[axis + 2]])
        expected = z + dt * (error_matrix(*k) @ z + np.array([drift[axis], 0.0]))
        assert (after[axis], after[axis + 2]) == pytest.approx(expected, abs=1e-12)


@quick
@given(st.tuples(st.floats(0.005, 1.0), st.floats(1e-5, 0.1)), velocities, velocities)
def test_lyapunov_function_of_the_observer_falls(k, error, current_error):
    """V = x^T P x with A^T P + P A = -1 falls from any error, as V' = -x^T x says."""
    A = error_matrix(*k)
    P = solve_continuous_lyapunov(A.T, -np.eye(2))
    k3, k4 = k
    p_3 = (1.0 + k4 + k3 * k3) / (2.0 * k3 * k4)
    assert P == pytest.approx(np.array([[(1.0 + k4) / (2.0 * k3), 0.5], [0.5, p_3]]), rel=1e-6)
    assert np.linalg.eigvalsh(P)[0] > 0.0
    dt = 0.1
    x = np.array([100.0 * error, current_error])
    state = ObserverState(x[0], 0.0, x[1], 0.0)
    after = observer_step(state, 0.0, 0.0, 0.0, 0.0, True, ObserverParams(*k), dt)
    y = np.array([after.error_n, after.current_n])
    change = (y @ P @ y - x @ P @ x) / dt
    assert change == pytest.approx(
        -(x @ x) + dt * (A @ x) @ P @ (A @ x), rel=1e-6, abs=1e-9 * (1.0 + x @ P @ x)
    )


def test_response_converges_to_the_exponential_with_slope_one():
    """Half the step, half the difference from the exact solution (0.5 m/s of current, 200 s)."""
    A = error_matrix(*DEFAULT)
    settled = np.array([0.0, 0.5])
    exact = settled + expm(200.0 * A) @ -settled
    differences = []
    for dt in (0.4, 0.2, 0.1):
        state = run(AT_REST, (0.5, 0.0), (0.0, 0.0), 200.0, dt=dt)
        differences.append(abs(state.current_n - exact[1]))
    slopes = np.log2(np.array(differences[:-1]) / differences[1:])
    assert slopes == pytest.approx(1.0, abs=0.05)
    assert differences[-1] < 1e-3, 'm/s, at the tick length'


@quick
@given(velocities, velocities, velocities, velocities)
def test_estimate_converges_to_a_constant_current(v_n, v_e, u_n, u_e):
    """Ground velocity is model plus current: after 2000 s the estimate is the current."""
    state = run(AT_REST, (u_n + v_n, u_e + v_e), (u_n, u_e), 2000.0, dt=1.0)
    assert (state.current_n, state.current_e) == pytest.approx((v_n, v_e), abs=1e-5)
    assert (state.error_n, state.error_e) == pytest.approx((0.0, 0.0), abs=1e-3)


@quick
@given(st.tuples(*4 * [velocities]), velocities, velocities)
def test_estimate_is_held_to_the_last_bit_while_the_model_is_not_valid(start, ground_n, model_n):
    state = run(ObserverState(*start), (ground_n, 0.3), (model_n, 0.1), 50.0, valid=False)
    assert (state.current_n, state.current_e) == start[2:]


def test_innovation_decays_while_the_model_is_not_valid():
    state = run(ObserverState(4.0, -2.0, 0.1, 0.2), (1.0, 1.0), (0.0, 0.0), 100.0, valid=False)
    fallen = math.exp(-DEFAULT.k3 * 100.0)
    assert (state.error_n, state.error_e) == pytest.approx((4.0 * fallen, -2.0 * fallen), rel=5e-3)


def test_turn_over_does_not_disturb_a_settled_estimate():
    """A wrong model velocity counts for nothing while it is known to be wrong."""
    settled = run(AT_REST, (0.9, 0.1), (0.4, 0.0), 3000.0)
    turned = run(settled, (0.5, 0.1), (3.0, -2.0), 300.0, valid=False)
    after = run(turned, (0.9, 0.1), (0.4, 0.0), 300.0)
    assert (after.current_n, after.current_e) == pytest.approx((0.5, 0.1), abs=1e-6)
