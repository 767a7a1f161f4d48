# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""The estimator of how a vehicle steers."""

import numba
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from glider_control.steering import (
    SteeringLearningSettings,
    caution,
    learn_steering,
    roll_to_kick,
    roll_to_turn,
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


@numba.njit
def learn_all(state, bank, roll_rate, yaw_rate, params):
    for i in range(len(bank)):
        state = learn_steering(state, bank[i], bank[i] ** 3, roll_rate[i], yaw_rate[i], params, DT)
    return state


def learn(state, bank, roll_rate, yaw_rate):
    return learn_all(state, bank, roll_rate, yaw_rate, PARAMS)


def covariance(state):
    """Covariance of (b, c, k, d) as a matrix."""
    matrix = np.zeros((4, 4))
    matrix[np.triu_indices(4)] = state.p
    return matrix + np.triu(matrix, 1).T


@settings(max_examples=30, deadline=None)
@given(effectiveness, bends, kicks, offsets, st.integers(0, 1000), st.sampled_from([-1.0, 1.0]))
def test_estimate_comes_to_the_truth_from_either_sign(b, c, k, d, seed, first_guess):
    """b within 10 % after 20 min of turning, from any start; c and k within their deviations."""
    bank, roll_rate = turns(1200.0, seed)
    yaw_rate = b * bank + c * bank**3 + k * roll_rate + d
    state = learn(SETTINGS.initial_state(first_guess), bank, roll_rate, yaw_rate)
    assert state.b == pytest.approx(b, rel=0.1, abs=3e-4)
    deviation = np.sqrt(np.diag(covariance(state)))
    assert deviation[2] < 0.5 * SETTINGS.kick_std
    assert state.c == pytest.approx(c, abs=2.0 * deviation[1])
    assert state.k == pytest.approx(k, abs=2.0 * deviation[2])


def test_rolls_of_several_sizes_tell_the_bend():
    """From turns at 10, 20 and 30 deg of roll to either side, c is known to better than a half."""
    sizes = np.sin(np.radians([10.0, -20.0, 30.0, -10.0, 20.0, -30.0]))
    bank = np.tile(np.repeat(sizes, 3000), 4)
    state = learn(
        SETTINGS.initial_state(1.0), bank, np.zeros(len(bank)), 0.003 * bank - 0.006 * bank**3
    )
    deviation = np.sqrt(covariance(state)[1, 1])
    assert deviation < 0.003
    assert state.b == pytest.approx(0.003, rel=0.1)
    assert state.c == pytest.approx(-0.006, abs=2.0 * deviation)


def test_one_turn_tells_the_sign():
    """A roll of 20 deg, wrongly expected to turn to starboard, is understood within 40 s."""
    state = SETTINGS.initial_state(1.0)
    bank = np.full(400, np.sin(np.radians(20.0)))
    state = learn(state, bank, np.zeros(400), -0.02 * bank)
    assert state.b == pytest.approx(-0.02, rel=0.3)


def test_straight_flight_teaches_nothing_about_b():
    """Level and without yaw, b stays and its variance grows only by the expected drift."""
    before = SETTINGS.initial_state(1.0)
    still = np.zeros(10000)
    after = learn(before, still, still, still)
    assert after.b == before.b
    assert after.p[0] == pytest.approx(before.p[0] + PARAMS.drift * 1000.0, rel=1e-9)


@settings(max_examples=50, deadline=None)
@given(st.integers(0, 1000), effectiveness)
def test_covariance_stays_positive_definite(seed, b):
    bank, roll_rate = turns(300.0, seed)
    state = learn(SETTINGS.initial_state(1.0), bank, roll_rate, b * bank)
    assert np.linalg.eigvalsh(covariance(state))[0] > 0.0


# ---------------------------------------------------------------------------------- steering

LIMIT = np.sin(np.radians(30.0))


def known(b, c=0.0, std=0.0):
    """State of an estimator that is as sure of b as ``std`` says."""
    state = SETTINGS.initial_state(1.0)
    return state._replace(b=b, c=c, p=(std * std, *state.p[1:]))


@settings(max_examples=200, deadline=None)
@given(effectiveness, bends, st.floats(-0.05, 0.05), st.floats(0.3, 2.0))
def test_the_roll_turns_as_asked_or_as_much_as_it_can(b, c, turn, ratio):
    sine, most = roll_to_turn(known(b, c), turn, ratio, LIMIT)
    made = (b * sine + c * sine**3) * ratio
    assert abs(sine) <= most <= LIMIT
    if abs(sine) < most:
        assert made == pytest.approx(turn, rel=0.02, abs=1e-9)
    else:
        assert made * turn > 0.0
        assert abs(made) <= abs(turn) * (1.0 + 1e-9)


@given(st.floats(0.001, 0.01), st.floats(0.005, 0.02), st.sampled_from([1.0, -1.0]))
def test_no_vehicle_is_rolled_past_the_peak_of_its_turn_rate(b, c, side):
    """Where steering fades with roll, more roll turns less: most of the peak, with less roll."""
    sine, _ = roll_to_turn(known(b, -c), side * 1.0, 1.0, 0.99)
    rolls = np.linspace(0.0, 0.99, 1000)
    rates = b * rolls - c * rolls**3
    assert 0.0 < side * sine <= rolls[np.argmax(rates)] + 1e-3
    assert b * side * sine - c * (side * sine) ** 3 >= 0.85 * np.max(rates)


@given(effectiveness, st.floats(0.0, 0.1), st.floats(0.0, 0.1), st.floats(0.0001, 0.05))
def test_doubt_makes_the_roll_smaller(b, one_std, other_std, turn):
    """Never larger for a larger standard deviation of b, and always to the same side."""
    less, more = sorted((one_std, other_std))
    sure, _ = roll_to_turn(known(b, std=less), turn, 1.0, LIMIT)
    unsure, _ = roll_to_turn(known(b, std=more), turn, 1.0, LIMIT)
    assert abs(unsure) <= abs(sure)
    assert unsure * b >= 0.0


@given(st.floats(-1e-3, 1e-3), st.floats(-0.05, 0.05))
def test_an_estimate_that_passes_zero_does_not_slam_the_roll(b, turn):
    """With a deviation of 0.001 rad/s the roll goes through zero with b, and stays finite."""
    sine, _ = roll_to_turn(known(b, std=1e-3), turn, 1.0, LIMIT)
    assert abs(sine) <= min(LIMIT, abs(turn * b) / 1e-6 + 1e-12)
    assert roll_to_turn(known(0.0, std=0.0), turn, 1.0, LIMIT)[0] == 0.0


@given(effectiveness, st.floats(0.0, 0.2))
def test_caution_is_a_share_and_one_without_doubt(b, std):
    share = caution(known(b, std=std))
    assert 0.0 < share <= 1.0
    if std <= 0.3 * abs(b):
        assert share == 1.0


@given(effectiveness, kicks, st.floats(0.0, 0.1), st.floats(0.01, 0.5), st.floats(-1.0, 1.0))
def test_the_kick_is_used_where_the_turn_goes_to_its_side(b, k, std, kick_std, error):
    """Toward the reference, by no more than the whole error, and not against the turn."""
    state = known(b, std=std)._replace(k=k)
    state = state._replace(p=(*state.p[:7], kick_std**2, *state.p[8:]))
    sine = roll_to_kick(state, error)
    if b * k <= 0.0:
        assert sine == 0.0
    else:
        assert sine * k * error >= 0.0
        assert abs(sine * k) <= abs(error) * (1.0 + 1e-9)
