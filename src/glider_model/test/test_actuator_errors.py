# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""Actuators that err: dead bands, noise of what they say, a pump that is slower at depth."""

import math

import numpy as np
import pytest

from glider_base.settings import ConfigurationError
from glider_base.signals import TICK_S, Joints, Water
from glider_model.plant.plant import PlantSettings, plant_step, tell
from glider_model.plant.sensors import make_readings, noise_of_readings, read
from glider_model.vehicle.actuators import actuators_step, toward
from glider_model.vehicle.file import changed_vehicle, load_vehicle

#: Dead band and noise of each actuator of a Slocum, in the units of its file, and in SI.
FIELDS = {
    'buoyancy_engine.dead_band': 0.01,
    'moving_mass.dead_band': 0.001,
    'moving_mass.rotation_dead_band': 1.0,
    'fin.dead_band': 2.0,
    'buoyancy_engine.noise': 0.002,
    'moving_mass.noise': 1e-4,
    'moving_mass.rotation_noise': 0.2,
    'fin.noise': 0.5,
}
BANDS = Joints(0.01, 0.001, math.radians(1.0), math.radians(2.0))
NOISE = Joints(0.002, 1e-4, math.radians(0.2), math.radians(0.5))
ERRS = changed_vehicle('slocum_g2', FIELDS)
IDEAL = Joints(0.0, 0.0, 0.0, 0.0)
GOAL = Joints(0.2, 0.02, 0.0, 0.3)


def params(**fields):
    named = {name.replace('__', '.'): value for name, value in fields.items()}
    return load_vehicle(changed_vehicle('slocum_g2', named)).params()


def run(start, command, vehicle, seconds, depth=0.0):
    joints = start
    for _ in range(round(seconds / TICK_S)):
        joints = actuators_step(joints, command, depth, vehicle, TICK_S)
    return joints


def test_a_file_that_says_nothing_of_errors_has_none():
    for name in ('zhang2021', 'seawing', 'slocum_g2', 'seaglider'):
        assert load_vehicle(name).params().errors == (IDEAL, IDEAL, 0.0)


def test_fields_reach_the_kernels_in_si_and_oil_may_be_given_in_cc():
    errors = load_vehicle(ERRS).params().errors
    np.testing.assert_allclose(errors.dead_band, BANDS, rtol=1e-15)
    np.testing.assert_allclose(errors.noise, NOISE, rtol=1e-15)
    quantity = {'value': 10.0, 'unit': 'cc', 'source': 'a test'}
    assert params(buoyancy_engine__dead_band=quantity).errors.dead_band.m_b == pytest.approx(
        0.01025, rel=1e-12
    )


@pytest.mark.parametrize(
    ('field', 'value', 'said'),
    [
        ('buoyancy_engine.dead_band', -0.1, 'greater than or equal to 0'),
        ('moving_mass.noise', 0.5, 'less than or equal to 0.1'),
        ('fin.noise', 21.0, 'less than or equal to 20'),
        ('buoyancy_engine.rate_per_m', 0.0049, 'allowed: <= 0.00475 1/m, which leaves 5 %'),
    ],
)
def test_what_cannot_be_is_refused_by_its_field(field, value, said):
    with pytest.raises(ConfigurationError) as told:
        load_vehicle(changed_vehicle('slocum_g2', {field: value}))
    assert field in str(told.value) and said in str(told.value)


def test_an_actuator_stops_within_its_dead_band_and_stirs_for_more():
    vehicle = load_vehicle(ERRS).params()
    there = run(IDEAL, GOAL, vehicle, 60.0)
    for at, goal, band, ideal in zip(
        there, GOAL, BANDS, run(IDEAL, GOAL, params(), 60.0), strict=True
    ):
        assert ideal == goal
        assert goal == 0.0 or 0.0 < goal - at <= band
    nudge = Joints(*(at + 0.9 * band for at, band in zip(there, BANDS, strict=True)))
    assert run(there, nudge, vehicle, 60.0) == there
    push = Joints(*(at - 1.5 * band for at, band in zip(there, BANDS, strict=True)))
    moved = run(there, push, vehicle, 60.0)
    assert moved.m_b < there.m_b and moved.x_p < there.x_p and moved.delta < there.delta


def test_without_a_dead_band_not_even_the_sign_of_a_zero_changes():
    assert math.copysign(1.0, toward(-0.0, -0.0, 1.0, 0.1, 0.0)) == math.copysign(1.0, -0.0 + 0.0)


def test_a_pump_is_slower_at_depth_where_it_pumps_out_alone():
    vehicle = params(buoyancy_engine__rate_per_m=0.002)
    rate = vehicle.m_b_rate
    for depth, share in ((0.0, 1.0), (100.0, 0.8), (200.0, 0.6), (-1.0, 1.0), (600.0, 0.0)):
        out = actuators_step(IDEAL, Joints(-0.2, 0.0, 0.0, 0.0), depth, vehicle, 1.0)
        assert out.m_b == pytest.approx(-share * rate, abs=1e-12)
        into = actuators_step(IDEAL, Joints(0.2, 0.0, 0.0, 0.0), depth, vehicle, 1.0)
        assert into.m_b == rate
    file = load_vehicle(changed_vehicle('slocum_g2', {'buoyancy_engine.rate_per_m': 0.002}))
    assert file.slowest_pump_rate(100.0) == pytest.approx(0.8 * rate, rel=1e-12)
    assert file.slowest_pump_rate(5000.0) == file.slowest_pump_rate(200.0)
    assert load_vehicle('slocum_g2').slowest_pump_rate(200.0) == rate


def test_noise_belongs_to_seed_and_tick_and_is_as_large_as_the_file_says():
    vehicle = load_vehicle(ERRS).params()
    readings = make_readings(vehicle, 7)
    drawn = np.array([noise_of_readings(tick, readings) for tick in range(4000)])
    np.testing.assert_allclose(drawn.std(axis=0), NOISE, rtol=0.05)
    assert np.all(np.abs(drawn.mean(axis=0)) < 4.0 * np.array(NOISE) / math.sqrt(4000))
    assert np.abs(np.corrcoef(drawn.T) - np.eye(4)).max() < 0.08
    assert noise_of_readings(11, make_readings(vehicle, 7)) == tuple(drawn[11])
    assert noise_of_readings(11, make_readings(vehicle, 8)) != tuple(drawn[11])
    assert read(GOAL, 11, readings) == tuple(np.array(GOAL) + drawn[11])
    assert read(GOAL, 11, make_readings(params(), 7)) == GOAL


def test_the_plant_tells_its_joints_with_noise_and_moves_by_where_they_are():
    """Two plants that differ in noise alone move alike."""
    noise = {name: value for name, value in FIELDS.items() if name.endswith('noise')}
    told, states = [], []
    for fields in ({}, noise):
        settings = PlantSettings(vehicle=changed_vehicle('slocum_g2', fields), seed=3)
        state, kernel = settings.initial_state(), settings.params()
        for _ in range(50):
            state = plant_step(state, GOAL, Water(0.0, 0.0, 0.0), kernel, TICK_S)
        told.append(tell(state, kernel))
        states.append(state)
    assert states[0].motion == states[1].motion and states[0].joints == states[1].joints
    differ = [i for i, (one, other) in enumerate(zip(*told, strict=True)) if one != other]
    (at,) = differ
    off = np.abs(np.array(told[0][at]) - np.array(told[1][at]))
    assert np.all((off > 0.0) & (off < 5.0 * np.array(NOISE)))
