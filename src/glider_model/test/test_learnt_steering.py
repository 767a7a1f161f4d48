# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""How a vehicle steers, learnt: the estimator, and the gains for it."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.linalg import solve_continuous_are

from glider_base.kernel import kernel
from glider_model.onboard.attitude_filter import Measured
from glider_model.onboard.learnt_steering import (
    BANDWIDTH_MAX,
    MOST_BANK,
    SteeringLearningSettings,
    choose_way,
    heading_gains,
    learn,
    learn_steering,
    lookaheads,
    slope_at,
    steer_to,
)

DT = 0.1
SETTINGS = SteeringLearningSettings()
PARAMS = SETTINGS.params()

effectiveness = st.floats(0.005, 0.06).flatmap(lambda b: st.sampled_from([b, -b]))
kicks = st.floats(-0.5, 0.5)
bends = st.floats(-0.01, 0.01)
offsets = st.floats(-0.001, 0.001)


def turns(seconds: float, seed: int):
    """Bank (sine of a wandering roll) and roll rate of a vehicle that turns now and then."""
    rng = np.random.default_rng(seed)
    t = np.arange(0.0, seconds, DT)
    roll = sum(
        rng.uniform(0.02, 0.1) * np.sin(rng.uniform(0.01, 0.1) * t + rng.uniform(0, 6))
        for _ in range(5)
    )
    return np.sin(roll), np.gradient(roll, DT)


@kernel
def _learn_all(state, bank, roll_rate, yaw_rate, params):
    for i in range(len(bank)):
        state = learn_steering(state, bank[i], bank[i] ** 3, roll_rate[i], yaw_rate[i], params, DT)
    return state


def learn_all(state, bank, roll_rate, yaw_rate):
    return _learn_all(state, bank, roll_rate, yaw_rate, PARAMS)


def prior(sign: float):
    """Estimate of a phase whose steering is guessed to have this sign."""
    steering = SETTINGS.initial_state()
    return steering.dive if sign > 0.0 else steering.climb


def covariance(state):
    """Covariance of (b, c, k, d) as a matrix."""
    matrix = np.zeros((4, 4))
    matrix[np.triu_indices(4)] = state.p
    return matrix + np.triu(matrix, 1).T


@settings(max_examples=30)
@given(effectiveness, bends, kicks, offsets, st.integers(0, 1000), st.sampled_from([-1.0, 1.0]))
def test_estimate_comes_to_the_truth_from_either_sign(b, c, k, d, seed, first_guess):
    """b within 10 % after 20 min of turning, from any start; c and k within their deviations."""
    bank, roll_rate = turns(1200.0, seed)
    yaw_rate = b * bank + c * bank**3 + k * roll_rate + d
    state = learn_all(prior(first_guess), bank, roll_rate, yaw_rate)
    assert state.b == pytest.approx(b, rel=0.1, abs=3e-4)
    deviation = np.sqrt(np.diag(covariance(state)))
    assert deviation[2] < 0.5 * SETTINGS.kick_std
    assert state.c == pytest.approx(c, abs=2.0 * deviation[1])
    assert state.k == pytest.approx(k, abs=2.0 * deviation[2])


def test_rolls_of_several_sizes_tell_the_bend():
    """From turns at 10, 20 and 30 deg of roll to either side, c is known to better than a half."""
    sizes = np.sin(np.radians([10.0, -20.0, 30.0, -10.0, 20.0, -30.0]))
    bank = np.tile(np.repeat(sizes, 3000), 4)
    state = learn_all(prior(1.0), bank, np.zeros(len(bank)), 0.003 * bank - 0.006 * bank**3)
    deviation = np.sqrt(covariance(state)[1, 1])
    assert deviation < 0.003
    assert state.b == pytest.approx(0.003, rel=0.1)
    assert state.c == pytest.approx(-0.006, abs=2.0 * deviation)


def test_one_turn_tells_the_sign():
    """A roll of 20 deg, wrongly expected to turn to starboard, is understood within 40 s."""
    state = prior(1.0)
    bank = np.full(400, np.sin(np.radians(20.0)))
    state = learn_all(state, bank, np.zeros(400), -0.02 * bank)
    assert state.b == pytest.approx(-0.02, rel=0.3)


def test_straight_flight_teaches_nothing_about_b():
    """Level and without yaw, b stays and its variance grows only by the expected drift."""
    before = prior(1.0)
    still = np.zeros(10000)
    after = learn_all(before, still, still, still)
    assert after.b == before.b
    assert after.p[0] == pytest.approx(before.p[0] + PARAMS.drift * 1000.0, rel=1e-9)


@settings(max_examples=50)
@given(st.integers(0, 1000), effectiveness)
def test_covariance_stays_positive_definite(seed, b):
    bank, roll_rate = turns(300.0, seed)
    state = learn_all(prior(1.0), bank, roll_rate, b * bank)
    assert np.linalg.eigvalsh(covariance(state))[0] > 0.0


# ---------------------------------------------------------------------------- way of steering

LIMIT = MOST_BANK


def known(b, c, k, std=1e-5, **changes):
    """State of an estimator that is as sure of b, c and k as ``std`` says."""
    p = (std**2, 0.0, 0.0, 0.0, std**2, 0.0, 0.0, std**2, 0.0, 1e-10)
    return prior(1.0)._replace(b=b, c=c, k=k, p=p, **changes)


adverse = st.tuples(st.floats(0.003, 0.05), st.floats(0.02, 0.5))


def riccati(b, k):
    """Gains of e and psi* that minimise the integral of `heading_gains`, by scipy."""
    rho, tau = PARAMS.rho, PARAMS.tau
    a, g = np.array([[0.0, 1.0], [0.0, 0.0]]), np.array([[k], [b]])
    q, r = np.diag([1.0, tau**2]), np.array([[1.0 / rho**2 + tau**2 * k**2]])
    cross = np.array([[0.0], [tau**2 * k]])
    p = solve_continuous_are(a, g, q, r, s=cross)
    return (np.linalg.solve(r, g.T @ p + cross.T))[0]


@settings(max_examples=100)
@given(st.floats(0.003, 0.05), kicks.filter(lambda k: abs(k) > 1e-3))
def test_closed_form_is_the_solution_of_the_riccati_equation(b, k):
    """beta e + (alpha - beta k / b) psi*, before it is put into a, T and w."""
    more = 1.0 + (PARAMS.rho * k * PARAMS.tau) ** 2
    beta = PARAMS.rho * b / np.sqrt(more)
    alpha = np.sqrt(2.0 * beta + PARAMS.rho**2 * (k**2 + (b * PARAMS.tau) ** 2) / more)
    assert riccati(b, k) * b == pytest.approx([beta, alpha - beta * k / b], rel=1e-6)


@settings(max_examples=100)
@given(adverse, st.sampled_from([1.0, -1.0]))
def test_what_is_fed_forward_changes_nothing_of_the_best_loop(steering, side):
    """With psi_s = -e / T, b u = w psi_s' + a (psi_s - psi*) is the best u."""
    b, k = steering[0] * side, -steering[1] * side
    a, lookahead_s, fed = heading_gains(b, k, PARAMS)
    assert 0.0 <= fed <= 1.0
    if a < BANDWIDTH_MAX:
        # u of e = 1 and of psi* = 1, with psi_s' = -(psi* + k u) / T
        share = b + fed * k / lookahead_s
        of_e, of_psi = a / lookahead_s / share, (fed / lookahead_s + a) / share
        assert [of_e, of_psi] == pytest.approx(riccati(b, k), rel=1e-6)


@settings(max_examples=100)
@given(adverse, st.floats(0.67, 1.33), st.floats(0.67, 1.33))
def test_loop_stays_stable_where_b_and_k_are_a_third_wrong(steering, of_b, of_k):
    """The linear loop of position and heading, with what is fed forward."""
    b, k = steering[0], -steering[1]
    a, lookahead_s, fed = heading_gains(b, k, PARAMS)
    real_b, real_k = of_b * b, of_k * k
    share = b + fed * real_k / lookahead_s - a * (k - real_k)
    u = -np.array([a / lookahead_s, fed / lookahead_s + a]) / share
    loop = np.array([[0.0, 1.0], [0.0, 0.0]]) + np.outer([real_k, real_b], u)
    assert np.max(np.linalg.eigvals(loop).real) < 0.0


@given(st.floats(3e-4, 0.005), st.floats(0.1, 0.5))
def test_a_weaker_vehicle_is_looked_further_ahead_for(b, k):
    assert heading_gains(0.3 * b, -k, PARAMS)[1] >= heading_gains(b, -k, PARAMS)[1]


def test_lookaheads_are_those_of_the_phases():
    steering = SETTINGS.initial_state()._replace(climb=known(-1e-3, 0.0, 0.3))
    dive_s, climb_s = lookaheads(steering, PARAMS)
    assert climb_s > 2.0 * dive_s


@settings(max_examples=200)
@given(effectiveness, bends, offsets, st.floats(-0.02, 0.02), st.floats(0.3, 2.0))
def test_the_roll_turns_as_asked_or_as_much_as_it_can(b, c, d, turn, ratio):
    """With the share that is fed, for a heading that is right already."""
    state = known(b, c, 0.0)._replace(d=d)
    way = choose_way(state, turn, ratio, LIMIT, PARAMS)
    fed = heading_gains(slope_at(state, 0.0) * ratio, 0.0, PARAMS)[2]
    made = (b * way.trim + c * way.trim**3) * ratio + d
    assert abs(way.trim) <= way.most <= LIMIT
    if abs(way.trim) < way.most:
        assert made == pytest.approx(fed * turn, rel=0.02, abs=1e-8)
    else:
        assert (made - d) * (fed * turn - d) > 0.0


@given(st.floats(0.001, 0.01), st.floats(0.005, 0.02), st.sampled_from([1.0, -1.0]))
def test_no_vehicle_is_rolled_past_the_peak_of_its_turn_rate(b, c, side):
    """Where steering fades with roll, more roll turns less: most of the peak, with less roll."""
    way = choose_way(known(b, -c, -0.3), 0.0, 1.0, 0.99, PARAMS)
    sine = steer_to(way, side * 3.0, 0.0, -0.3)
    rolls = np.linspace(0.0, 0.99, 1000)
    rates = b * rolls - c * rolls**3
    assert 0.0 < side * sine <= rolls[np.argmax(rates)] + 1e-3
    assert b * side * sine - c * (side * sine) ** 3 >= 0.85 * np.max(rates)


@given(effectiveness, st.floats(0.0, 0.1), st.floats(0.001, 0.5))
def test_doubt_never_turns_the_roll_off(b, std, error):
    """A vehicle that is not rolled shows nothing; it goes to the side that is thought right."""
    sure, unsure = (
        steer_to(choose_way(known(b, 0.0, 0.0, one), 0.0, 1.0, LIMIT, PARAMS), error, 0.0, 0.0)
        for one in (1e-6, std)
    )
    assert 0.0 < abs(unsure) <= LIMIT and 0.0 < abs(sure) <= LIMIT
    assert unsure * b > 0.0
