# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""Perturbed vehicles: factors reach their numbers, offsets have the effect they are said to."""

import math

import numpy as np
import pydantic
import pytest

from glider_base.settings import ConfigurationError
from glider_model.plant.plant import PlantSettings
from glider_model.plant.trim import solve_trim
from glider_model.vehicle.file import load_vehicle, vehicle_names
from glider_model.vehicle.perturb import (
    ADDED_MASS,
    DAMPING,
    STATIC,
    VISCOUS,
    PerturbSettings,
    perturbed,
)
from glider_model.vehicle.rigid_body import GRAVITY

FACTORS = (*VISCOUS, *STATIC, *DAMPING, *ADDED_MASS)


@pytest.fixture
def vehicle():
    return load_vehicle('zhang2021').params()


def changed(vehicle, **values):
    return perturbed(vehicle, PerturbSettings(**values))


def differences(one, two):
    return {name for name in one._fields if getattr(one, name) != getattr(two, name)}


@pytest.mark.parametrize('name', vehicle_names())
def test_by_default_nothing_changes(name):
    vehicle = load_vehicle(name).params()
    assert perturbed(vehicle, PerturbSettings()) == vehicle


def test_every_number_of_the_water_on_the_hull_has_a_factor(vehicle):
    hydrodynamic = {name for name in vehicle._fields if name[:2] in ('K_', 'D_', 'a_')}
    assert set(FACTORS) == hydrodynamic
    assert len(FACTORS) == len(hydrodynamic)


@pytest.mark.parametrize('name', FACTORS)
def test_factor_scales_its_number_and_nothing_else(vehicle, name):
    seawing = load_vehicle('seawing').params()
    for one in (vehicle, seawing):
        factor = changed(one, **{name: 1.1})
        assert getattr(factor, name) == 1.1 * getattr(one, name)
        assert differences(factor, one) <= {name}


@pytest.mark.parametrize(
    ('field', 'number', 'value'), [('pump_rate', 'm_b_rate', 0.3), ('roll_range', 'mu_max', 0.3)]
)
def test_actuators_are_scaled(vehicle, field, number, value):
    factor = changed(vehicle, **{field: value})
    assert getattr(factor, number) == value * getattr(vehicle, number)
    assert differences(factor, vehicle) == {number}


def settled(fly, start, plant_params, vehicle, seconds=600.0, **given):
    """Flight in still water at rest; floating in the middle of it."""
    return fly(plant_params(vehicle), start(velocity=(1e-9,) + 5 * (0.0,), **given), seconds)


@pytest.mark.parametrize('bias_deg', [10.0, -10.0, 25.0])
def test_vehicle_with_roll_bias_hangs_at_that_roll(vehicle, fly, start, plant_params, bias_deg):
    flight = settled(fly, start, plant_params, changed(vehicle, roll_bias_deg=bias_deg))
    roll, pitch, _ = np.degrees(flight.euler[-1])
    assert roll == pytest.approx(bias_deg, abs=0.01)
    assert pitch == pytest.approx(0.0, abs=0.01)


def test_pitch_mass_forward_of_neutral_pitches_down(vehicle, fly, start, plant_params):
    """tan(pitch) = -m_p dx / s_z at rest, and the trim needs the mass that much further aft."""
    trimmed = changed(vehicle, pitch_trim_m=0.010)
    flight = settled(fly, start, plant_params, trimmed, seconds=1500.0)
    hanging = vehicle.s_z + vehicle.m_p * vehicle.R_p
    expected = -math.degrees(math.atan2(vehicle.m_p * 0.010, hanging))
    assert math.degrees(flight.euler[-1, 1]) == pytest.approx(expected, abs=0.05)
    nominal, off = (solve_trim(one, 0.4, pitch_deg=-30.0) for one in (vehicle, trimmed))
    assert off.pitch_mass_m == pytest.approx(nominal.pitch_mass_m - 0.010, abs=1e-9)


@pytest.mark.parametrize('kg', [0.05, -0.05])
def test_ballast_is_weight_that_the_pump_does_not_know_of(vehicle, kg):
    heavy = changed(vehicle, net_heaviness_kg=kg)
    off, same = solve_trim(heavy, 0.4, pitch_deg=-30.0), solve_trim(vehicle, 0.4 + kg, -30.0)
    assert off.vertical_mps == pytest.approx(same.vertical_mps, rel=1e-9)
    assert (off.vertical_mps > solve_trim(vehicle, 0.4, -30.0).vertical_mps) == (kg > 0.0)


def test_ballast_sinks_a_vehicle_at_rest(vehicle, fly, start, plant_params):
    flight = settled(
        fly, start, plant_params, changed(vehicle, net_heaviness_kg=0.05), seconds=0.5
    )
    acceleration = 0.05 * GRAVITY / (vehicle.m + vehicle.a_33)
    assert flight.p_d[-1] - 100.0 == pytest.approx(0.5 * acceleration * 0.25, rel=0.02)


def test_more_drag_is_a_slower_glide(vehicle):
    slow, nominal = (
        solve_trim(one, 0.4, pitch_deg=-30.0) for one in (changed(vehicle, K_D0=1.3), vehicle)
    )
    assert slow.speed_mps < 0.95 * nominal.speed_mps


def test_less_weathercock_stability_is_weaker_steering(vehicle):
    """Roll makes sideslip, which turns the vehicle by what K_MY is above the Munk moment."""
    weak, nominal = (
        solve_trim(one, 0.4, pitch_deg=-30.0, roll_mass_deg=10.0)
        for one in (changed(vehicle, K_MY=0.75), vehicle)
    )
    assert 0.0 < weak.turn_rate_radps < 0.7 * nominal.turn_rate_radps


def test_mass_matrix_has_to_stay_positive_definite(vehicle):
    coupled = vehicle._replace(a_35=30.0)
    with pytest.raises(ConfigurationError, match='perturb: the mass matrix is not positive'):
        perturbed(coupled, PerturbSettings(a_35=10.0))


@pytest.mark.parametrize(
    ('field', 'value'),
    [
        ('K_D0', -0.1),
        ('K_M', 10.1),
        ('D_p', math.nan),
        ('a_33', -1.0),
        ('pump_rate', 0.0),
        ('roll_range', -0.1),
        ('pitch_trim_m', 0.2),
        ('roll_bias_deg', 46.0),
        ('net_heaviness_kg', 5.1),
        ('K_XX', 1.0),
    ],
)
def test_out_of_range_is_refused_by_name(field, value):
    with pytest.raises(pydantic.ValidationError, match=field):
        PerturbSettings(**{field: value})


def test_static_moments_may_change_their_sign(vehicle):
    assert changed(vehicle, K_MR=-2.0).K_MR == -2.0 * vehicle.K_MR


def test_plant_flies_the_perturbed_vehicle(vehicle):
    given = PlantSettings(perturb={'K_M': 0.8, 'net_heaviness_kg': 0.02})
    expected = changed(vehicle, K_M=0.8, net_heaviness_kg=0.02)
    assert given.params().vehicle == expected
