# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""Allocation: against the cross product of lever and weight, and against itself."""

import math

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from glider_control.allocation import (
    allocate_pitch,
    allocate_roll,
    gravity_direction,
    make_allocation,
    moments,
)
from glider_model.vehicle.file import load_vehicle, vehicle_names
from glider_model.vehicle.rigid_body import GRAVITY

quick = settings(max_examples=60)
every_vehicle = pytest.mark.parametrize('vehicle', vehicle_names())

rolls = st.floats(-0.7, 0.7)
pitches = st.floats(-1.1, 1.1)
shares = st.floats(-1.0, 1.0)
any_moment = st.floats(-1e4, 1e4)


def parts(vehicle):
    """Parameters of a vehicle and of its allocation."""
    params = load_vehicle(vehicle).params()
    return params, make_allocation(params)


def R_NB(phi, theta):
    """Attitude at heading 0 from elementary rotations."""
    cf, sf, ct, st_ = math.cos(phi), math.sin(phi), math.cos(theta), math.sin(theta)
    R_y = np.array([[ct, 0.0, st_], [0.0, 1.0, 0.0], [-st_, 0.0, ct]])
    R_x = np.array([[1.0, 0.0, 0.0], [0.0, cf, -sf], [0.0, sf, cf]])
    return R_y @ R_x


@quick
@given(rolls, pitches)
def test_gravity_direction_is_down_in_body_axes(phi, theta):
    expected = R_NB(phi, theta).T @ np.array([0.0, 0.0, 1.0])
    assert gravity_direction(phi, theta) == pytest.approx(expected, abs=1e-14)


@every_vehicle
@quick
@given(shares, shares, rolls, pitches)
def test_moments_are_levers_times_weights(vehicle, x_share, mu_share, phi, theta):
    """Hull, moving mass and oil as point masses; the hull's weight acts off the origin."""
    params, limits = parts(vehicle)
    x_p, mu = x_share * limits.x_p_max, mu_share * limits.mu_max
    hull = np.array([params.s_x, 0.0, params.s_z])
    moving = params.m_p * np.array(
        [params.x_p0 + x_p, params.R_p * math.sin(mu), params.R_p * math.cos(mu)]
    )
    gravity = R_NB(phi, theta).T @ np.array([0.0, 0.0, GRAVITY])
    oil = 0.1 * np.array([params.pump_x, 0.0, 0.0])
    expected = np.cross(hull + moving + oil, gravity)[:2]
    assert moments(0.1, x_p, mu, phi, theta, limits) == pytest.approx(expected, abs=1e-9)


@every_vehicle
@quick
@given(shares, shares, rolls, pitches)
def test_allocation_makes_the_moments_asked_for(vehicle, x_share, mu_share, phi, theta):
    """Any moments that positions within the range make are met, to 1 nN m."""
    _, limits = parts(vehicle)
    x_p, mu = x_share * limits.x_p_max, mu_share * limits.mu_max
    # beyond a right angle from the vertical, another rotation makes the same moment
    assume(abs(mu - math.atan2(*gravity_direction(phi, theta)[1:])) < 1.5)
    tau_p, tau_q = moments(0.1, x_p, mu, phi, theta, limits)
    found_mu = allocate_roll(tau_p, phi, theta, limits)
    found_x = allocate_pitch(tau_q, 0.1, found_mu, phi, theta, limits)
    assert moments(0.1, found_x, found_mu, phi, theta, limits) == pytest.approx(
        (tau_p, tau_q), abs=1e-9
    )
    assert (found_x, found_mu) == pytest.approx((x_p, mu), abs=1e-6)


@every_vehicle
@pytest.mark.parametrize('side', [1.0, -1.0])
def test_pitch_moments_are_made_until_hardly_any_gravity_is_left_for_them(vehicle, side):
    """A fifth of it, which is 78 deg nose up or down."""
    _, limits = parts(vehicle)
    x_p, theta = 0.3 * limits.x_p_max, side * math.acos(0.21)
    _, tau_q = moments(0.1, x_p, 0.0, 0.0, theta, limits)
    assert allocate_pitch(tau_q, 0.1, 0.0, 0.0, theta, limits) == pytest.approx(x_p, abs=1e-9)


@every_vehicle
@quick
@given(any_moment, any_moment, st.floats(-math.pi, math.pi), st.floats(-1.57, 1.57))
def test_allocation_stays_within_the_ranges(vehicle, tau_p, tau_q, phi, theta):
    _, limits = parts(vehicle)
    mu = allocate_roll(tau_p, phi, theta, limits)
    x_p = allocate_pitch(tau_q, 0.1, mu, phi, theta, limits)
    assert abs(mu) <= limits.mu_max
    assert abs(x_p) <= limits.x_p_max


@every_vehicle
@pytest.mark.parametrize('side', [-1.0, 1.0])
def test_out_of_reach_the_end_of_the_range_on_the_demanded_side(vehicle, side):
    _, limits = parts(vehicle)
    assert allocate_roll(side * 1e3, 0.1, -0.5, limits) == side * limits.mu_max
    assert allocate_pitch(side * 1e3, 0.1, 0.0, 0.1, -0.5, limits) == -side * limits.x_p_max


@every_vehicle
@quick
@given(rolls, pitches, st.floats(-20.0, 20.0), st.floats(0.1, 5.0))
def test_more_roll_moment_turns_the_mass_further_to_starboard(vehicle, phi, theta, tau, more):
    _, limits = parts(vehicle)
    assert allocate_roll(tau + more, phi, theta, limits) >= allocate_roll(tau, phi, theta, limits)


@every_vehicle
@quick
@given(rolls, pitches, st.floats(-50.0, 50.0), st.floats(0.1, 5.0))
def test_more_nose_up_moment_moves_the_mass_further_aft(vehicle, phi, theta, tau, more):
    _, limits = parts(vehicle)
    assert allocate_pitch(tau + more, 0.1, 0.0, phi, theta, limits) <= allocate_pitch(
        tau, 0.1, 0.0, phi, theta, limits
    )


@every_vehicle
def test_mass_forward_is_nose_down_and_mass_to_starboard_rolls_to_starboard(vehicle):
    _, limits = parts(vehicle)
    tau_p, tau_q = moments(0.0, 0.0, 0.0, 0.0, 0.0, limits)
    assert moments(0.0, 0.01, 0.0, 0.0, 0.0, limits)[1] < tau_q
    assert moments(0.0, 0.0, 0.1, 0.0, 0.0, limits)[0] > tau_p
