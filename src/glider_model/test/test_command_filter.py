# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""The command filter: where it goes, how fast, and that its rate is its slope."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from glider_base.frames import wrap_angle
from glider_model.onboard.command_filter import (
    Filtered,
    FilterParams,
    filter_angle,
    filter_command,
)

quick = settings(max_examples=40)
DT = 0.1
params = st.builds(FilterParams, st.floats(0.05, 2.0), st.floats(0.01, 1.0))
commands = st.floats(-3.0, 3.0)


def run(step, start, command, params, seconds):
    states = [Filtered(start, 0.0)]
    for _ in range(round(seconds / DT)):
        states.append(step(states[-1], command, params, DT))
    return np.array(states)


def still_angle(state, command, params, dt):
    return filter_angle(state, command, 0.0, params, dt)


@quick
@given(params, commands, commands)
def test_value_converges_to_the_command(params, start, command):
    seconds = abs(command - start) / params.rate_limit + 30.0 / params.frequency
    states = run(filter_command, start, command, params, seconds)
    assert states[-1, 0] == pytest.approx(command, abs=1e-6)
    assert abs(states[-1, 1]) < 1e-6


@quick
@given(params, commands, commands)
def test_rate_keeps_to_its_limit(params, start, command):
    states = run(filter_command, start, command, params, 20.0)
    assert np.abs(states[:, 1]).max() <= params.rate_limit * (1.0 + 1e-12)


@quick
@given(params, commands, commands)
def test_rate_is_the_slope(params, start, command):
    states = run(filter_command, start, command, params, 20.0)
    np.testing.assert_allclose(np.diff(states[:, 0]) / DT, states[1:, 1], rtol=0, atol=1e-13)


def test_a_far_command_is_approached_at_the_rate_limit():
    states = run(filter_command, 0.0, 100.0, FilterParams(1.0, 0.5), 30.0)
    assert states[-1, 1] == pytest.approx(0.5, abs=1e-9)


def test_step_response_is_the_critically_damped_one():
    """1 - (1 + w t) exp(-w t), to first order in the step (2 % at w dt = 0.02)."""
    frequency = 0.2
    states = run(filter_command, 0.0, 1.0, FilterParams(frequency, 10.0), 40.0)
    phase = frequency * DT * np.arange(len(states))
    exact = 1.0 - (1.0 + phase) * np.exp(-phase)
    np.testing.assert_allclose(states[:, 0], exact, rtol=0, atol=0.02)


def test_a_step_is_not_overshot():
    states = run(filter_command, 0.0, 1.0, FilterParams(0.5, 10.0), 60.0)
    assert states[:, 0].max() <= 1.0 + 1e-9


@pytest.mark.parametrize(
    ('start', 'command', 'sign'), [(3.0, -3.0, 1.0), (-3.0, 3.0, -1.0), (0.5, -0.5, -1.0)]
)
def test_angle_goes_the_short_way(start, command, sign):
    states = run(still_angle, start, command, FilterParams(0.5, 0.2), 20.0)
    assert np.all(sign * states[1:, 1] >= -1e-12)


@quick
@given(params, st.floats(-math.pi, 3.14), st.floats(-10.0, 10.0))
def test_angle_converges_to_the_direction(params, start, command):
    seconds = math.pi / params.rate_limit + 30.0 / params.frequency
    states = run(still_angle, start, command, params, seconds)
    assert math.remainder(states[-1, 0] - command, 2.0 * math.pi) == pytest.approx(0.0, abs=1e-6)


@quick
@given(params, st.floats(-math.pi, 3.14), st.floats(-10.0, 10.0))
def test_angle_stays_in_range(params, start, command):
    states = run(still_angle, start, command, params, 20.0)
    assert states[:, 0].min() >= -math.pi
    assert states[:, 0].max() < math.pi


def test_angle_is_the_filtered_command_where_nothing_wraps():
    params = FilterParams(0.5, 0.2)
    np.testing.assert_allclose(
        run(still_angle, -1.0, 1.0, params, 20.0),
        run(filter_command, -1.0, 1.0, params, 20.0),
        rtol=0,
        atol=1e-13,
    )


@quick
@given(st.floats(0.1, 1.0), st.floats(-0.05, 0.05))
def test_a_turning_command_whose_rate_is_told_is_followed_without_lag(frequency, rate):
    """Within the step's rounding (rate dt) after the start has died out, across +-180 deg too."""
    params, state = FilterParams(frequency, 0.2), Filtered(0.0, 0.0)
    steps = round(40.0 / frequency / DT)
    for step in range(1, steps + 1):
        state = filter_angle(state, wrap_angle(step * DT * rate), rate, params, DT)
    assert abs(wrap_angle(state.value - steps * DT * rate)) <= abs(rate) * DT + 1e-9
    assert state.rate == pytest.approx(rate, abs=1e-6)
