# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""The roll for a turn rate or a heading error."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from glider_control.turning import caution, roll_to_kick, roll_to_turn, sure_disturbance
from glider_model.onboard.learnt_steering import SteeringLearningSettings

PRIOR = SteeringLearningSettings().initial_state().dive

effectiveness = st.floats(0.005, 0.06).flatmap(lambda b: st.sampled_from([b, -b]))
kicks = st.floats(-0.5, 0.5)
bends = st.floats(-0.01, 0.01)

LIMIT = np.sin(np.radians(30.0))


def known(b, c=0.0, std=0.0):
    """State of an estimator that is as sure of b as ``std`` says."""
    return PRIOR._replace(b=b, c=c, p=(std * std, *PRIOR.p[1:]))


@settings(max_examples=200)
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


@given(st.floats(-1e-3, 1e-3), st.floats(1e-6, 1e-3))
def test_disturbance_in_doubt_counts_for_little(d, std):
    state = PRIOR._replace(d=d, p=(*PRIOR.p[:9], std * std))
    sure = sure_disturbance(state)
    assert 0.0 <= sure * d <= d * d
    if abs(d) > 10.0 * std:
        assert sure == pytest.approx(d, rel=0.01)
    if abs(d) < 0.1 * std:
        assert abs(sure) <= 0.01 * abs(d)


@given(kicks.filter(lambda k: abs(k) > 0.05), st.floats(0.0, 0.5), st.floats(-1.0, 1.0))
def test_vehicle_that_hardly_turns_is_kicked_for_the_whole_error(k, kick_std, error):
    """Whichever way it turns; of a kick in doubt a part is used."""
    state = known(1e-4)._replace(k=k, is_kicked=True)
    state = state._replace(p=(*state.p[:7], kick_std**2 + 1e-9, *state.p[8:]))
    sine = roll_to_kick(state, error)
    assert 0.0 <= sine * k * error <= error * error * (1.0 + 1e-9)
    if kick_std < 0.01 * abs(k):
        assert sine * k == pytest.approx(error, rel=1e-3)


@settings(max_examples=50)
@given(st.floats(2e-4, 2e-3), st.floats(8.0, 26.0), st.floats(0.2, 0.45), st.floats(-3.0, 3.0))
def test_kicked_vehicle_holds_its_heading_at_the_bank_at_which_it_does_not_turn(
    b, null_deg, k, error_deg
):
    """Turn and kick go to different sides; the roll grows until the vehicle turns no more.

    psi_left' = b s + c s^3 with b + c s^2 = 0 at the bank ``null_deg``, psi = psi_left - k phi.
    """
    c = -b / math.sin(math.radians(null_deg)) ** 2
    state = known(b, c)._replace(k=-k, is_kicked=True)
    state = state._replace(p=(*state.p[:7], 1e-9, *state.p[8:]))
    left, dt = math.radians(error_deg), 4.0
    for _ in range(20000):
        sine = min(LIMIT, max(-LIMIT, roll_to_kick(state, -left)))
        left += dt * (b * sine + c * sine**3)
        assert abs(left - k * sine) < math.radians(0.2)
    if abs(error_deg) > 0.1:
        assert abs(math.degrees(math.asin(sine))) == pytest.approx(null_deg, rel=0.01)
