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
    effective_steering,
    learn_steering,
)

DT = 0.1
SETTINGS = SteeringLearningSettings()
PARAMS = SETTINGS.params()

effectiveness = st.floats(0.005, 0.06).flatmap(lambda b: st.sampled_from([b, -b]))
kicks = st.floats(-0.5, 0.5)
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
        state = learn_steering(state, bank[i], roll_rate[i], yaw_rate[i], params, DT)
    return state


def learn(state, bank, roll_rate, yaw_rate):
    return learn_all(state, bank, roll_rate, yaw_rate, PARAMS)


@settings(max_examples=30, deadline=None)
@given(effectiveness, kicks, offsets, st.integers(0, 1000), st.sampled_from([-1.0, 1.0]))
def test_estimate_comes_to_the_truth_from_either_sign(b, k, d, seed, first_guess):
    """b within 10 % after 20 min of turning, from any start; k within its own deviation."""
    bank, roll_rate = turns(1200.0, seed)
    state = learn(
        SETTINGS.initial_state(first_guess), bank, roll_rate, b * bank + k * roll_rate + d
    )
    assert state.b == pytest.approx(b, rel=0.1, abs=3e-4)
    deviation = np.sqrt(state.p_kk)
    assert deviation < 0.5 * SETTINGS.kick_std
    assert state.k == pytest.approx(k, abs=2.0 * deviation)
    assert state.sign == np.sign(b)


def test_one_turn_tells_the_sign():
    """A roll of 20 deg, wrongly expected to turn to starboard, is understood within 40 s."""
    state = SETTINGS.initial_state(1.0)
    bank = np.full(400, np.sin(np.radians(20.0)))
    state = learn(state, bank, np.zeros(400), -0.02 * bank)
    assert state.sign == -1.0
    assert state.b == pytest.approx(-0.02, rel=0.3)


def test_straight_flight_teaches_nothing_about_b():
    """Level and without yaw, b stays and its variance grows only by the expected drift."""
    before = SETTINGS.initial_state(1.0)
    still = np.zeros(10000)
    after = learn(before, still, still, still)
    assert after.b == before.b
    assert after.p_bb == pytest.approx(before.p_bb + PARAMS.drift * 1000.0, rel=1e-9)


@settings(max_examples=50, deadline=None)
@given(st.integers(0, 1000), effectiveness)
def test_covariance_stays_positive_definite(seed, b):
    bank, roll_rate = turns(300.0, seed)
    s = learn(SETTINGS.initial_state(1.0), bank, roll_rate, b * bank)
    matrix = [[s.p_bb, s.p_bk, s.p_bd], [s.p_bk, s.p_kk, s.p_kd], [s.p_bd, s.p_kd, s.p_dd]]
    assert np.linalg.eigvalsh(matrix)[0] > 0.0


@settings(max_examples=50, deadline=None)
@given(st.floats(-0.1, 0.1), st.sampled_from([-1.0, 1.0]))
def test_steering_is_never_with_nothing(b, sign):
    """However small the estimate, the command stays bounded, and the sign does not flicker."""
    state = SETTINGS.initial_state(sign)._replace(b=b, sign=sign)
    used = effective_steering(state, PARAMS)
    assert abs(used) >= PARAMS.smallest
    assert np.sign(used) == sign


def test_sign_changes_only_when_the_other_one_is_clear():
    state = SETTINGS.initial_state(1.0)._replace(b=-0.4 * PARAMS.smallest, sign=1.0)
    kept = learn_steering(state, 0.0, 0.0, 0.0, PARAMS, DT)
    assert kept.sign == 1.0
    turned = learn_steering(state._replace(b=-0.6 * PARAMS.smallest), 0.0, 0.0, 0.0, PARAMS, DT)
    assert turned.sign == -1.0
