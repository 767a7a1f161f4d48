# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""Lift and drag as others write them, drag that falls with speed, and the lever of the pump."""

import copy
import math

import numpy as np
import pytest
import yaml

from glider_base.errors import ConfigurationError
from glider_base.files import read_yaml
from glider_model.plant.trim import solve_trim
from glider_model.vehicle.file import VEHICLE_FOLDER, load_vehicle
from glider_model.vehicle.hydrodynamics import hydrodynamics

ZHANG = load_vehicle('zhang2021').params()
MERCKELBACH = {'Cd0': ('-', 0.15), 'Cd1': ('1/rad^2', 10.5), 'S': ('m^2', 0.1)}
MERCKELBACH |= {'aw': ('1/rad', 3.7), 'ah': ('1/rad', 3.8)}
ERIKSEN = {'a': ('1/deg', 0.003836), 'b': ('Pa^(1/4)', 0.010078), 'c': ('1/deg^2', 2.1e-6)}
ERIKSEN |= {'l': ('m', 1.8)}
TEN = (0.0,) * 3


def section(numbers):
    return {
        name: {'value': value, 'unit': unit, 'source': 'test'}
        for name, (unit, value) in numbers.items()
    }


@pytest.fixture
def file(tmp_path):
    """``file(change)``: path of a copy of zhang2021 that a function has changed."""

    def make(change):
        values = copy.deepcopy(read_yaml(VEHICLE_FOLDER / 'zhang2021.yaml'))
        change(values)
        path = tmp_path / 'vehicle.yaml'
        path.write_text(yaml.safe_dump(values), encoding='utf-8')
        return str(path)

    return make


def with_set(name, numbers):
    """Change of a file: a set instead of lift and drag."""

    def change(values):
        for field in ('K_D0', 'K_D', 'K_L0', 'K_L'):
            del values['hydrodynamics'][field]
        values['hydrodynamics'][name] = section(numbers)

    return change


def force(vehicle, speed, alpha):
    """Drag and lift (N) of the kernel at an angle of attack."""
    u, w = speed * math.cos(alpha), speed * math.sin(alpha)
    f_x, _, f_z, *_ = hydrodynamics(u, 0.0, w, *TEN, vehicle)
    c, s = math.cos(alpha), math.sin(alpha)
    return -f_x * c - f_z * s, f_x * s - f_z * c


@pytest.mark.parametrize('speed', [0.15, 0.35, 0.7])
@pytest.mark.parametrize('alpha_deg', [-3.0, 0.5, 2.5])
def test_a_set_of_merckelbach_makes_his_forces(file, speed, alpha_deg):
    """D = rho/2 U^2 S (Cd0 + Cd1 a^2), L = rho/2 U^2 S (aw + ah) a; within 0.3 % in angles."""
    vehicle = load_vehicle(file(with_set('merckelbach', MERCKELBACH))).params()
    pressure, alpha = 0.5 * 1025.0 * speed**2, math.radians(alpha_deg)
    drag, lift = force(vehicle, speed, alpha)
    assert drag == pytest.approx(pressure * 0.1 * (0.15 + 10.5 * alpha**2), rel=0.003)
    assert lift == pytest.approx(pressure * 0.1 * 7.5 * alpha, rel=0.003)


@pytest.mark.parametrize('speed', [0.1, 0.25, 0.5])
@pytest.mark.parametrize('alpha_deg', [-4.0, 1.0, 3.0])
def test_a_set_of_eriksen_makes_his_forces(file, speed, alpha_deg):
    """D = q l^2 (b q^(-1/4) + c a^2), L = q l^2 a alpha, alpha in degrees."""
    vehicle = load_vehicle(file(with_set('eriksen', ERIKSEN))).params()
    q = 0.5 * 1025.0 * speed**2
    drag, lift = force(vehicle, speed, math.radians(alpha_deg))
    expected = q * 1.8**2 * (0.010078 * q**-0.25 + 2.1e-6 * alpha_deg**2)
    assert drag == pytest.approx(expected, rel=1e-3)
    assert lift == pytest.approx(q * 1.8**2 * 0.003836 * alpha_deg, rel=0.004)


def test_a_file_says_what_lift_and_drag_are_once(file):
    def both(values):
        values['hydrodynamics']['merckelbach'] = section(MERCKELBACH)

    def two(values):
        with_set('merckelbach', MERCKELBACH)(values)
        values['hydrodynamics']['eriksen'] = section(ERIKSEN)

    with pytest.raises(ConfigurationError, match='K_D0: follows from merckelbach .allowed: one'):
        load_vehicle(file(both))
    with pytest.raises(ConfigurationError, match='merckelbach and eriksen: both say'):
        load_vehicle(file(two))


@pytest.mark.parametrize(
    ('change', 'told'),
    [
        (
            ('hydrodynamics.Cd0', 0.15),
            'Cd0.*unknown field .*Cd0, Cd1, S, aw and ah go under merck',
        ),
        (('hydrodynamics.K_D0.unit', '-'), "'-': should be 'kg/m' .*1/2 rho S C, rho = 1025"),
        (('buoyancy_engine.range.unit', 'g'), "or 'cc', 1 g = 0.001 kg, 1 cc of sea water"),
        (('rigid_body.hull_mass.unit', 'cc'), '1 cc of sea water = 0.001025 kg'),
    ],
)
def test_what_is_often_given_instead_is_hinted_at(file, change, told):
    def put(values):
        *groups, last = change[0].split('.')
        for name in groups:
            values = values[name]
        values[last] = change[1]

    with pytest.raises(ConfigurationError, match=told):
        load_vehicle(file(put))


def test_what_is_wrong_in_a_set_is_named_and_nothing_else(file):
    numbers = {**MERCKELBACH, 'S': ('m^2', -0.1)}
    with pytest.raises(ConfigurationError) as caught:
        load_vehicle(file(with_set('merckelbach', numbers)))
    assert 'hydrodynamics.merckelbach.S.value = -0.1: should be greater than 0' in str(
        caught.value
    )
    assert '\n' not in str(caught.value)


def test_oil_in_cubic_centimetres_is_kept_in_kilograms(file):
    def put(values):
        values['buoyancy_engine']['range'] |= {'value': 250, 'unit': 'cc'}
        values['buoyancy_engine']['rate'] |= {'value': 4.0, 'unit': 'cc/s'}
        values['volume'] = {'value': 67.0, 'unit': 'l', 'source': 'tank'}

    vehicle = load_vehicle(file(put))
    assert vehicle.params().m_b_max == pytest.approx(0.25625, rel=1e-12)
    assert vehicle.params().m_b_rate == pytest.approx(0.0041, rel=1e-12)
    assert vehicle.params().volume == pytest.approx(0.067, rel=1e-12)
    assert '(250 cc)' in vehicle.buoyancy_engine.range.source


def test_drag_goes_with_a_power_of_the_speed():
    falling = ZHANG._replace(speed_exponent=-0.5)
    for speed in (0.1, 0.4, 2.0):
        drag, _ = force(falling, speed, 0.0)
        assert drag == pytest.approx(7.5 * speed**1.5, rel=1e-12)
    assert force(falling, 0.0, 0.0) == (0.0, 0.0)


# -------------------------------------------------------------------------------- pump


@pytest.mark.parametrize('m_b', [0.3, -0.3])
def test_oil_pitches_a_vehicle_at_rest(m_b, fly, plant_params, start):
    """In a balance of moments alone: tan(theta) = -m_b x_b / S_z, and a mass aft undoes it."""
    vehicle = ZHANG._replace(pump_x=0.5)
    hanging = vehicle.s_z + vehicle.m_p * vehicle.R_p
    theta = math.atan(-m_b * 0.5 / hanging)
    # as heavy as light: it neither sinks nor rises
    params = plant_params(vehicle._replace(ballast=-m_b))
    state = start((0, 0, 500), (0, theta, 0), (0.0,) * 6, (m_b, 0.0, 0.0))
    flight = fly(params, state, 60.0)
    np.testing.assert_allclose(flight.euler[:, 1], theta, atol=1e-9)
    balanced = start((0, 0, 500), velocity=(0.0,) * 6, joints=(m_b, -m_b * 0.5 / 18.0, 0.0))
    np.testing.assert_allclose(fly(params, balanced, 60.0).euler, 0.0, atol=1e-9)


def test_the_mass_gives_way_to_the_oil_in_a_trim():
    """The same glide with the mass further aft by m_b x_b / m_p."""
    plain = solve_trim(ZHANG, 0.4, pitch_deg=-30.0)
    levered = solve_trim(ZHANG._replace(pump_x=0.5), 0.4, pitch_deg=-30.0)
    assert levered.speed_mps == pytest.approx(plain.speed_mps, rel=1e-9)
    moved = plain.pitch_mass_m - levered.pitch_mass_m
    assert moved == pytest.approx(0.4 * 0.5 / ZHANG.m_p, rel=1e-6)


# ---------------------------------------------------------------------------- steering


@pytest.mark.parametrize('name', ['zhang2021', 'seawing', 'seaglider'])
@pytest.mark.parametrize('phase', ['dive', 'climb'])
def test_steering_is_that_of_the_spiral_that_trim_solves(name, phase, file):
    """At half the range of the pump and 25 deg, rolled by 1 deg of roll mass: within 1 %."""
    loaded = load_vehicle(name)
    without = loaded.model_copy(update={'steering': None})
    vehicle, sign = loaded.params(), 1.0 if phase == 'dive' else -1.0
    heavy = sign * 0.5 * vehicle.m_b_max
    trim = solve_trim(vehicle, heavy, pitch_deg=-sign * 25.0, roll_mass_deg=1.0)
    steering = trim.turn_rate_radps / math.sin(math.radians(trim.roll_deg)) * 0.5 / trim.speed_mps
    assert getattr(without.steering_rates, phase) == pytest.approx(steering, rel=0.01)


def test_steering_of_a_file_is_taken_as_it_is():
    file = load_vehicle('zhang2021')
    assert file.steering_rates == (file.steering.dive.value, file.steering.climb.value)
