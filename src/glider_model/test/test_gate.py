# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""The gate: good samples pass as they are, wild ones never; the last good one serves."""

import math

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from glider_base.frames import quaternion_from_euler
from glider_base.signals import TICK_S, Odometry
from glider_model.onboard.gate import INITIAL_GATE, GateSettings, gate_step, is_lost

quick = settings(max_examples=100)
PARAMS = GateSettings().params()
WILD = st.sampled_from([math.nan, math.inf, -math.inf, 1e300, -1e300, 1e30])


def sample(
    position=(0.0, 0.0, 50.0), angles=(0.0, -0.5, 0.3), velocity=(0.5, 0.0, 0.0), omega=0.0
):
    return Odometry(*position, *quaternion_from_euler(*angles), *velocity, omega, 0.0, 0.0)


GOOD = sample()


def passed(*samples, params=PARAMS):
    state = INITIAL_GATE
    for one in samples:
        state = gate_step(state, one, params, TICK_S)
    return state


@quick
@given(
    position=st.tuples(*2 * [st.floats(-1e6, 1e6)], st.floats(-12e3, 12e3)),
    angles=st.tuples(*3 * [st.floats(-3.0, 3.0)]),
    velocity=st.tuples(*3 * [st.floats(-3.0, 3.0)]),
    omega=st.floats(-5.0, 5.0),
)
def test_first_plausible_sample_passes_to_the_last_bit(position, angles, velocity, omega):
    one = sample(position, angles, velocity, omega)
    state = passed(one)
    assert state.odometry == one
    assert (state.seen, state.age_s, state.refused) == (True, 0.0, 0)


@quick
@given(st.integers(0, 12), WILD)
def test_a_wild_number_anywhere_is_refused_and_the_last_good_sample_serves(place, wild):
    numbers = list(GOOD)
    numbers[place] = wild
    state = passed(GOOD, Odometry(*numbers))
    assert state.odometry == GOOD
    assert state.refused == 1
    assert passed(GOOD, Odometry(*numbers), GOOD).age_s == 0.0


@pytest.mark.parametrize(('place', 'wild'), [(0, -2.1e7), (1, 1e12), (2, 12_500.0)])
def test_a_place_that_is_not_on_earth_never_counts(place, wild):
    numbers = list(GOOD)
    numbers[place] = wild
    state = passed(GOOD, *(200 * [Odometry(*numbers)]))
    assert state.odometry == GOOD
    assert state.refused == 200


@pytest.mark.parametrize('factor', [0.0, 0.5, 0.98, 1.02, 2.0])
def test_a_quaternion_that_is_none_is_refused(factor):
    bad = GOOD._replace(
        **{name: factor * getattr(GOOD, name) for name in ('q_w', 'q_x', 'q_y', 'q_z')}
    )
    assert passed(bad).seen is False


@quick
@given(st.floats(0.995, 1.005))
def test_a_quaternion_of_a_coarse_driver_is_scaled(factor):
    coarse = GOOD._replace(
        **{name: factor * getattr(GOOD, name) for name in ('q_w', 'q_x', 'q_y', 'q_z')}
    )
    q = passed(coarse).odometry[3:7]
    assert math.fsum(x * x for x in q) == pytest.approx(1.0, abs=1e-8)


@pytest.mark.parametrize(
    ('changes', 'refused'),
    [
        ({'p_n': 99.0}, False),
        ({'p_n': 101.0}, True),
        ({'p_d': 50.0 + 19.0}, False),
        ({'p_d': 50.0 - 21.0}, True),
        ({'u': 1.4}, False),
        ({'w': 1.1}, True),
        ({'q': 0.9}, False),
        ({'r': -1.1}, True),
        (
            dict(
                zip(
                    ('q_w', 'q_x', 'q_y', 'q_z'),
                    quaternion_from_euler(0.0, -0.5, 1.3),
                    strict=True,
                )
            ),
            False,
        ),
        (
            dict(
                zip(
                    ('q_w', 'q_x', 'q_y', 'q_z'),
                    quaternion_from_euler(0.0, -0.5, 1.5),
                    strict=True,
                )
            ),
            True,
        ),
    ],
)
def test_jumps_are_refused_beyond_what_the_settings_say(changes, refused):
    assert passed(GOOD, GOOD._replace(**changes)).refused == refused


def test_the_same_attitude_by_the_opposite_quaternion_is_no_jump():
    opposite = GOOD._replace(
        **{name: -getattr(GOOD, name) for name in ('q_w', 'q_x', 'q_y', 'q_z')}
    )
    assert passed(GOOD, opposite).refused == 0


def test_a_world_that_has_jumped_is_believed_after_the_hold():
    """A fix 500 m aside: refused for 1 s, then taken."""
    moved = GOOD._replace(p_e=500.0)
    state = passed(GOOD, *(10 * [moved]))
    assert (state.odometry.p_e, state.refused) == (0.0, 10)
    state = gate_step(state, moved, PARAMS, TICK_S)
    assert (state.odometry.p_e, state.age_s) == (500.0, 0.0)


def test_without_a_good_sample_the_measurement_is_lost_after_the_hold():
    bad = GOOD._replace(p_d=math.nan)
    assert not is_lost(passed(GOOD, *(10 * [bad])), PARAMS)
    assert is_lost(passed(GOOD, *(11 * [bad])), PARAMS)
    assert not is_lost(passed(GOOD, *(11 * [bad]), GOOD), PARAMS)
