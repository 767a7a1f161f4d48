# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""Measurement filter: Euler rates, noise, lag, seams."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from glider_base.signals import TICK_S, Odometry
from glider_model.onboard.attitude_filter import Measured, measure

quick = settings(max_examples=60)

TIME_CONSTANT = 2.0
NOTHING = Measured(*(7 * (0.0,)))
rates = st.floats(-0.3, 0.3)


def odometry(phi=0.0, theta=0.0, psi=0.0, velocity=(0.0, 0.0, 0.0), omega=(0.0, 0.0, 0.0)):
    x, y, z, w = Rotation.from_euler('ZYX', [psi, theta, phi]).as_quat()
    return Odometry(0.0, 0.0, 0.0, *(float(q) for q in (w, x, y, z)), *velocity, *omega)


def follow(odometries, time_constant=TIME_CONSTANT):
    """States of the filter, as rows."""
    state, rows = NOTHING, []
    for i, one in enumerate(odometries):
        state = measure(state, one, i == 0, time_constant, TICK_S)
        rows.append(state)
    return np.array(rows)


def wrapped(angle):
    return (angle + math.pi) % (2.0 * math.pi) - math.pi


@quick
@given(st.floats(-1.0, 1.0), st.floats(-1.2, 1.2), st.floats(-3.1, 3.1), st.tuples(*3 * [rates]))
def test_euler_rates_are_the_derivative_of_the_attitude(phi, theta, psi, omega):
    """Against the attitude a moment later, by scipy; 1e-5 rad/s."""
    state = measure(NOTHING, odometry(phi, theta, psi, omega=omega), True, 2.0, TICK_S)
    attitude = Rotation.from_euler('ZYX', [psi, theta, phi])
    step = 1e-5
    later, before = (
        (attitude * Rotation.from_rotvec(sign * step * np.array(omega))).as_euler('ZYX')
        for sign in (1.0, -1.0)
    )
    psi_dot, theta_dot, phi_dot = wrapped(later - before) / (2.0 * step)
    assert state[3:6] == pytest.approx((phi_dot, theta_dot, psi_dot), abs=1e-5)


@quick
@given(st.floats(-1.0, 1.0), st.floats(-1.2, 1.2), st.floats(-3.1, 3.1), st.floats(-1.0, 1.0))
def test_first_measurement_is_taken_as_it_is(phi, theta, psi, u):
    state = measure(NOTHING, odometry(phi, theta, psi, (u, 0.0, 0.0)), True, 2.0, TICK_S)
    assert state[:3] == pytest.approx((phi, theta, psi), abs=1e-12)
    assert state.vertical_rate == pytest.approx(-u * math.sin(theta), abs=1e-12)


@pytest.mark.parametrize('time_constant', [0.5, 2.0, 10.0])
def test_noise_is_reduced_as_by_a_first_order_filter(time_constant):
    """White noise of 1 deg on the angles: variance times a / (2 - a), a = dt / (T + dt)."""
    noise = np.radians(1.0) * np.random.default_rng(7).standard_normal((12000, 3))
    rows = follow([odometry(*angles) for angles in noise], time_constant)[2000:]
    a = TICK_S / (time_constant + TICK_S)
    # 10,000 correlated samples: the standard deviation is known to a few per cent
    assert np.std(rows[:, :3], axis=0) / np.radians(1.0) == pytest.approx(
        math.sqrt(a / (2.0 - a)), rel=0.15
    )


def test_turn_at_constant_rate_is_followed_without_lag():
    """Across the seam of +-180 deg: 1e-9 rad, where a low pass would lag by 0.02 rad."""
    t = TICK_S * np.arange(2000)
    psi = wrapped(3.0 + 0.01 * t)
    rows = follow([odometry(psi=x, omega=(0.0, 0.0, 0.01)) for x in psi])
    assert np.min(psi) < 0.0 < np.max(psi)
    assert wrapped(rows[:, 2] - psi) == pytest.approx(0.0, abs=1e-9)


def test_pitch_manoeuvre_is_followed_without_lag():
    t = TICK_S * np.arange(600)
    theta = -0.5 + 0.02 * t
    rows = follow([odometry(theta=x, omega=(0.0, 0.02, 0.0)) for x in theta])
    assert rows[:, 1] == pytest.approx(theta, abs=1e-9)


@quick
@given(st.floats(0.5, 10.0), st.floats(-0.01, 0.01))
def test_bias_of_a_rate_sensor_leaves_a_bounded_error(time_constant, bias):
    """Steady offset T b: the angle does not drift away."""
    still = [odometry()] + [odometry(omega=(0.0, 0.0, bias))] * round(
        12.0 * time_constant / TICK_S
    )
    assert follow(still, time_constant)[-1, 2] == pytest.approx(
        time_constant * bias, rel=1e-3, abs=1e-9
    )


def test_vertical_rate_follows_a_step_with_a_quarter_of_the_time_constant():
    """1 - 1/e after 0.5 s, within the half tick that sampling costs."""
    sink = [odometry()] + [odometry(velocity=(0.0, 0.0, 0.3))] * 50
    rows = follow(sink)[:, 6] / 0.3
    times = TICK_S * np.arange(len(rows))
    reached = np.interp(1.0 - math.exp(-1.0), rows, times)
    assert reached == pytest.approx(0.5, abs=TICK_S)


@quick
@given(st.lists(st.tuples(*3 * [st.floats(-10.0, 10.0)]), min_size=2, max_size=20))
def test_filtered_angles_stay_wrapped_and_finite(angles):
    rows = follow([odometry(*one) for one in angles])
    assert np.all(np.isfinite(rows))
    assert np.all(np.abs(rows[:, :3]) <= math.nextafter(math.pi, 4.0))
