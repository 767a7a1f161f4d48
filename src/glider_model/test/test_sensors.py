# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""Noise of the odometry: its size, its independence, and that it can be taken off again."""

import math

import numba
import numpy as np
import pydantic
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from glider_model.base.frames import (
    euler_from_quaternion,
    odometry_from_wire,
    odometry_to_wire,
    quaternion_from_euler,
)
from glider_model.base.signals import Odometry
from glider_model.plant.block import plant_outputs
from glider_model.plant.plant import PlantSettings, plant_odometry
from glider_model.plant.sensors import (
    SensorSettings,
    add_noise,
    is_noisy,
    noise_of_tick,
    remove_noise,
)

quick = settings(max_examples=100, deadline=None)

NOISE = {
    'attitude_std_deg': 0.2,
    'heading_std_deg': 0.5,
    'rate_std_dps': 0.1,
    'position_std_m': 1.0,
}
COUNT = 100_000
angles = st.floats(-math.pi, math.pi)
seeds = st.integers(0, 2**63 - 1)
ticks = st.integers(0, 10**9)


def odometry(phi=0.0, theta=-0.5, psi=1.0, position=(4000.0, -300.0, 500.0)):
    attitude = quaternion_from_euler(phi, theta, psi)
    return Odometry(*position, *attitude, 0.8, -0.1, 0.05, 0.01, -0.02, 0.03)


@numba.njit
def series(params, count):
    """Noise of ticks 0 to ``count``: float64[count, 9]."""
    rows = np.empty((count, 9))
    for tick in range(count):
        for column, number in enumerate(noise_of_tick(tick, params)):
            rows[tick, column] = number
    return rows


@pytest.fixture(scope='module')
def noise():
    return series(SensorSettings(**NOISE).params(seed=7), COUNT)


def test_each_number_has_its_standard_deviation_and_no_mean(noise):
    expected = np.repeat(
        [1.0, math.radians(0.2), math.radians(0.5), math.radians(0.1)], [3, 2, 1, 3]
    )
    np.testing.assert_allclose(noise.std(axis=0), expected, rtol=4.0 / math.sqrt(COUNT))
    assert np.all(np.abs(noise.mean(axis=0)) < 4.0 * expected / math.sqrt(COUNT))


def test_numbers_are_independent_of_each_other_and_from_tick_to_tick(noise):
    correlations = np.corrcoef(np.vstack([noise[:-1].T, noise[1:].T]))
    assert np.max(np.abs(correlations - np.eye(18))) < 5.0 / math.sqrt(COUNT)


@quick
@given(seeds, ticks)
def test_no_noise_is_the_very_same_numbers(seed, tick):
    params = SensorSettings().params(seed)
    assert not is_noisy(params)
    assert add_noise(odometry(), tick, params) == odometry()
    assert remove_noise(odometry(), tick, params) == odometry()


@pytest.mark.parametrize('name', NOISE)
def test_each_kind_of_noise_alone_is_noise(name):
    params = SensorSettings(**{name: NOISE[name]}).params(0)
    assert is_noisy(params)
    assert add_noise(odometry(), 3, params) != odometry()


@quick
@given(seeds, ticks)
def test_a_measurement_is_a_function_of_seed_and_tick(seed, tick):
    one, two = (SensorSettings(**NOISE).params(seed) for _ in range(2))
    assert add_noise(odometry(), tick, one) == add_noise(odometry(), tick, two)
    other = SensorSettings(**NOISE).params((seed + 1) % 2**63)
    assert add_noise(odometry(), tick, other) != add_noise(odometry(), tick, one)
    assert add_noise(odometry(), tick + 1, one) != add_noise(odometry(), tick, one)


@quick
@given(seeds, ticks, angles, st.floats(-1.5, 1.5), angles)
def test_the_truth_comes_back_from_what_went_over_a_topic(seed, tick, phi, theta, psi):
    params = SensorSettings(**NOISE).params(seed)
    true = odometry(phi, theta, psi)
    wire = odometry_to_wire(add_noise(true, tick, params))
    back = remove_noise(odometry_from_wire(wire), tick, params)
    np.testing.assert_allclose(back[:3], true[:3], rtol=0.0, atol=1e-11)
    one, two = (
        Rotation.from_quat(np.roll(back[3:7], -1)),
        Rotation.from_quat(np.roll(true[3:7], -1)),
    )
    assert (one * two.inv()).magnitude() < 1e-14
    np.testing.assert_allclose(back[7:], true[7:], rtol=0.0, atol=1e-16)


@quick
@given(seeds, st.floats(-0.6, 0.6), st.floats(-1.2, 1.2), angles)
def test_noise_of_heading_turns_about_the_vertical(seed, phi, theta, psi):
    params = SensorSettings(heading_std_deg=0.5).params(seed)
    measured = euler_from_quaternion(*add_noise(odometry(phi, theta, psi), 9, params)[3:7])
    expected = psi + noise_of_tick(9, params).psi
    assert measured[:2] == pytest.approx((phi, theta), abs=1e-12)
    assert math.cos(measured[2] - expected) == pytest.approx(1.0, abs=1e-14)


def test_noise_of_roll_and_pitch_adds_to_roll_and_pitch():
    """In wings-level flight, to first order."""
    params = SensorSettings(attitude_std_deg=0.2).params(1)
    for tick in range(20):
        noise = noise_of_tick(tick, params)
        phi, theta, psi = euler_from_quaternion(*add_noise(odometry(), tick, params)[3:7])
        assert theta == pytest.approx(-0.5 + noise.theta, abs=1e-4)
        assert phi == pytest.approx(noise.phi, abs=1e-4)
        assert psi == pytest.approx(1.0, abs=1e-4)


def test_velocity_over_ground_keeps_its_numbers_in_body_axes():
    measured = add_noise(odometry(), 5, SensorSettings(**NOISE).params(0))
    assert measured[7:10] == odometry()[7:10]


def test_attitude_stays_a_unit_quaternion():
    params = SensorSettings(attitude_std_deg=10.0, heading_std_deg=45.0).params(0)
    for tick in range(100):
        assert np.linalg.norm(add_noise(odometry(), tick, params)[3:7]) == pytest.approx(
            1.0, abs=1e-15
        )


def test_plant_measures_with_the_noise_of_its_tick_and_seed():
    given = PlantSettings(sensors=NOISE, seed=4)
    state = given.initial_state()._replace(tick=17)
    expected = add_noise(plant_odometry(state), 17, SensorSettings(**NOISE).params(4))
    (odom, joints), _ = plant_outputs(state, given.params())
    assert odom == odometry_to_wire(expected)
    assert joints == state.joints


def test_plant_without_noise_measures_its_odometry():
    given = PlantSettings(initial={'depth_m': 20.0, 'pitch_deg': -20.0, 'speed_mps': 0.4})
    state = given.initial_state()
    (odom, _), _ = plant_outputs(state, given.params())
    assert odom == odometry_to_wire(plant_odometry(state))


@pytest.mark.parametrize('name', NOISE)
@pytest.mark.parametrize('value', [-0.1, 1e9, math.nan])
def test_impossible_noise_is_refused(name, value):
    with pytest.raises(pydantic.ValidationError, match=name):
        SensorSettings(**{name: value})
