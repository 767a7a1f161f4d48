# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""Steady glides and spirals against published numbers, and as fixed points of the plant."""

import json
import math
from dataclasses import asdict

import numpy as np
import pytest

from glider_base.frames import quaternion_from_euler
from glider_base.settings import ConfigurationError
from glider_model.plant.trim import solve_trim
from glider_model.vehicle.file import load_vehicle

ZHANG = load_vehicle('zhang2021').params()
SEAWING = load_vehicle('seawing').params()


# --------------------------------------------------------- Zhang et al. (2013), Ocean Eng. 60


@pytest.fixture(scope='module')
def spiral():
    """Published: gamma 45 deg, r_p1 0.4216 m (neutral 0.4016 m), 0.3 kg."""
    return solve_trim(SEAWING, 0.3, pitch_mass_m=0.4216 - 0.4016, roll_mass_deg=-45.0)


@pytest.mark.parametrize(
    ('field', 'published'),
    [('speed_mps', 0.490), ('turn_rate_radps', 0.0039), ('turn_radius_m', 100.5)],
)
def test_published_spiral_within_one_percent(spiral, field, published):
    assert getattr(spiral, field) == pytest.approx(published, rel=0.01)


@pytest.mark.parametrize(
    ('field', 'published_deg'),
    [('alpha_deg', 1.267), ('beta_deg', -1.283), ('pitch_deg', -35.641), ('roll_deg', -13.703)],
)
def test_published_spiral_angles_within_a_tenth_of_a_degree(spiral, field, published_deg):
    tolerance = 0.15 if field == 'pitch_deg' else 0.05
    assert getattr(spiral, field) == pytest.approx(published_deg, abs=tolerance)


def test_gentler_published_spiral():
    """Gamma 20 deg: an independent solution has 226 m, -6.23 deg, 0.4764 m/s."""
    trim = solve_trim(SEAWING, 0.3, pitch_mass_m=0.02, roll_mass_deg=-20.0)
    assert trim.turn_radius_m == pytest.approx(226.0, rel=0.03)
    assert trim.roll_deg == pytest.approx(-6.23, abs=0.05)
    assert trim.speed_mps == pytest.approx(0.4764, rel=0.002)


def test_straight_glide_of_seawing():
    """Gamma 0: 0.4729 m/s, alpha 1.457 deg, pitch -32.973 deg; no turn."""
    trim = solve_trim(SEAWING, 0.3, pitch_mass_m=0.02)
    assert trim.speed_mps == pytest.approx(0.4729, abs=2e-4)
    assert trim.alpha_deg == pytest.approx(1.457, abs=5e-3)
    assert trim.pitch_deg == pytest.approx(-32.973, abs=2e-2)
    assert trim.turn_rate_radps == trim.beta_deg == trim.roll_deg == 0.0
    assert trim.turn_radius_m is None


def test_numbers_of_an_array_are_numbers():
    numbers = np.array([0.25, -28.0], dtype=np.float32)
    assert solve_trim(SEAWING, numbers[0], pitch_deg=numbers[1]) == solve_trim(
        SEAWING, 0.25, pitch_deg=-28.0
    )


def test_seawing_turns_against_its_roll(spiral):
    assert spiral.turn_rate_radps * spiral.roll_deg < 0.0


# --------------------------------------------------------------------------------- zhang2021


@pytest.mark.parametrize(
    ('m_b', 'speed', 'horizontal', 'vertical'),
    [(0.3, 0.444, 0.379, 0.233), (0.4, 0.513, 0.437, 0.269), (0.5, 0.574, 0.489, 0.301)],
)
@pytest.mark.parametrize('phase', [1.0, -1.0], ids=['dive', 'climb'])
def test_steady_glides_at_30_deg(m_b, speed, horizontal, vertical, phase):
    trim = solve_trim(ZHANG, phase * m_b, pitch_deg=-30.0 * phase)
    assert trim.converged
    assert trim.speed_mps == pytest.approx(speed, rel=0.01)
    assert trim.horizontal_mps == pytest.approx(horizontal, rel=0.01)
    assert trim.vertical_mps == pytest.approx(phase * vertical, rel=0.01)
    assert trim.alpha_deg == pytest.approx(phase * 1.59, abs=0.01)
    assert trim.glide_deg == pytest.approx(-phase * 31.6, abs=0.05)


@pytest.mark.parametrize(
    ('phase', 'roll_mass_deg', 'roll_deg', 'radius_m', 'tolerance'),
    [
        (1, 20.0, 11, 77.0, 0.04),
        (1, 30.0, 17, 53.0, 0.04),
        (1, 45.0, 25, 37.0, 0.04),
        (1, 60.0, 34, 31.0, 0.04),
        (-1, 20.0, 13, 53.0, 0.02),
        (-1, 30.0, 19, 36.0, 0.02),
        (-1, 45.0, 29, 25.0, 0.02),
        (-1, 60.0, 40, 20.0, 0.02),
    ],
)
def test_turn_radii(phase, roll_mass_deg, roll_deg, radius_m, tolerance):
    """At 0.4 kg and 30 deg of pitch: into the roll in the dive, against it in the climb."""
    trim = solve_trim(ZHANG, 0.4 * phase, pitch_deg=-30.0 * phase, roll_mass_deg=roll_mass_deg)
    assert trim.roll_deg == pytest.approx(roll_deg, abs=0.5)
    assert trim.turn_radius_m == pytest.approx(radius_m, rel=tolerance)
    assert trim.turn_rate_radps * phase > 0.0


def test_port_is_the_mirror_of_starboard():
    one, other = (
        solve_trim(ZHANG, 0.4, pitch_deg=-30.0, roll_mass_deg=sign * 20.0) for sign in (1, -1)
    )
    assert other.turn_rate_radps == pytest.approx(-one.turn_rate_radps, rel=1e-9)
    assert other.roll_deg == pytest.approx(-one.roll_deg, rel=1e-9)
    assert other.speed_mps == pytest.approx(one.speed_mps, rel=1e-9)


@pytest.mark.parametrize('pitch_mass_m', [0.012, 0.016, 0.020])
def test_the_printed_table_does_not_glide(pitch_mass_m):
    """Table 1 of Zhang et al. (2021) at 0.5 kg: it falls, at an angle of attack of 40 deg."""
    vehicle = load_vehicle('zhang2021_table1').params()
    trim = solve_trim(vehicle, 0.5, pitch_mass_m=pitch_mass_m)
    assert trim.alpha_deg > 38.0
    assert trim.horizontal_mps < 0.025


def test_the_printed_table_at_the_pitch_of_a_glide():
    """Force balance of linear drags 50 and 100 kg/s: tan(alpha) = u / (2 w) tan(30 deg)."""
    trim = solve_trim(load_vehicle('zhang2021_table1').params(), 0.5, pitch_deg=-30.0)
    u, w = 0.5 * 9.81 * 0.5 / 50.0, 0.5 * 9.81 * math.sqrt(0.75) / 100.0
    assert trim.alpha_deg == pytest.approx(math.degrees(math.atan2(w, u)), abs=1e-6)
    assert trim.horizontal_mps == pytest.approx(u * math.sqrt(0.75) - w * 0.5, abs=1e-9)
    assert trim.horizontal_mps < 0.03


# ------------------------------------------------------------------------------- consistency


@pytest.mark.parametrize(
    ('name', 'm_b', 'pitch_deg', 'roll_mass_deg'),
    [
        ('zhang2021', 0.4, -30.0, 0.0),
        ('zhang2021', -0.4, 30.0, 20.0),
        ('zhang2021', 0.5, -25.0, 30.0),
        ('seawing', 0.3, -35.0, -45.0),
        ('seawing', -0.3, 35.0, 0.0),
    ],
)
def test_trim_is_a_fixed_point_of_the_plant(
    name, m_b, pitch_deg, roll_mass_deg, fly, plant_params, start
):
    """Held for 600 s: velocity, rates, roll and pitch stay."""
    params = plant_params(name)
    trim = solve_trim(params.vehicle, m_b, pitch_deg=pitch_deg, roll_mass_deg=roll_mass_deg)
    phi, theta = math.radians(trim.roll_deg), math.radians(trim.pitch_deg)
    alpha, beta = math.radians(trim.alpha_deg), math.radians(trim.beta_deg)
    rate = trim.turn_rate_radps
    velocity = (
        trim.speed_mps * math.cos(alpha) * math.cos(beta),
        trim.speed_mps * math.sin(beta),
        trim.speed_mps * math.sin(alpha) * math.cos(beta),
        -rate * math.sin(theta),
        rate * math.cos(theta) * math.sin(phi),
        rate * math.cos(theta) * math.cos(phi),
    )
    joints = (m_b, trim.pitch_mass_m, math.radians(roll_mass_deg))
    flight = fly(params, start((0, 0, 1000), (phi, theta, 0.5), velocity, joints), 600.0)
    np.testing.assert_allclose(flight.velocity - velocity, 0.0, atol=1e-8)
    np.testing.assert_allclose(flight.euler[:, :2] - [phi, theta], 0.0, atol=1e-8)
    sunk = flight.p_d[-1] - 1000.0
    assert sunk == pytest.approx(600.0 * trim.vertical_mps, abs=1e-5)  # m
    q = quaternion_from_euler(phi, theta, 0.5 + 600.0 * rate)
    assert abs(np.dot(q, flight.quaternion[-1])) == pytest.approx(1.0, abs=1e-10)


@pytest.mark.parametrize('vehicle', [ZHANG, SEAWING], ids=['zhang2021', 'seawing'])
@pytest.mark.parametrize('phase', [1.0, -1.0], ids=['dive', 'climb'])
def test_pitch_and_pitch_mass_ask_for_the_same_glide(vehicle, phase):
    one = solve_trim(vehicle, 0.4 * phase, pitch_deg=-28.0 * phase, roll_mass_deg=15.0)
    other = solve_trim(vehicle, 0.4 * phase, pitch_mass_m=one.pitch_mass_m, roll_mass_deg=15.0)
    assert other.pitch_deg == pytest.approx(one.pitch_deg, abs=1e-6)
    assert other.turn_rate_radps == pytest.approx(one.turn_rate_radps, rel=1e-6)


@pytest.mark.parametrize('name', ['zhang2021', 'seawing'])
@pytest.mark.parametrize('phase', ['dive', 'climb'])
def test_steering_of_a_vehicle_file_is_that_of_its_gentle_spiral(name, phase):
    """Turn rate over sine of roll at 10 deg of roll mass, within 1.5 %."""
    file, sign = load_vehicle(name), 1.0 if phase == 'dive' else -1.0
    m_b, pitch_deg = {'zhang2021': (0.4, -30.0), 'seawing': (0.3, -35.0)}[name]
    trim = solve_trim(file.params(), sign * m_b, pitch_deg=sign * pitch_deg, roll_mass_deg=10.0)
    steering = trim.turn_rate_radps / math.sin(math.radians(trim.roll_deg))
    assert getattr(file.steering, phase).value == pytest.approx(steering, rel=0.015)


def test_a_glide_tail_first_does_not_count():
    assert not solve_trim(ZHANG, 0.4, pitch_deg=30.0).converged


def test_a_glide_on_its_back_does_not_count():
    """Mass aft of what any dive needs: the equations hold only with the nose past the vertical."""
    assert not solve_trim(ZHANG, 0.4, pitch_mass_m=-0.06).converged


@pytest.mark.parametrize('m_b', [-0.3, 0.3])
def test_a_glide_that_is_not_found_is_told_in_json(m_b):
    glide = solve_trim(SEAWING, m_b, pitch_deg=-math.copysign(66.0, m_b), roll_mass_deg=40.0)
    tail_first = solve_trim(SEAWING, m_b, pitch_deg=math.copysign(20.0, m_b))
    told = [json.loads(json.dumps(asdict(one)))['converged'] for one in (glide, tail_first)]
    assert told == [False, False]


def test_a_pitch_out_of_the_mass_reach_does_not_count():
    assert not solve_trim(ZHANG, 0.4, pitch_deg=-80.0).converged


@pytest.mark.parametrize(
    ('arguments', 'message'),
    [
        ({}, r'give either pitch_deg or pitch_mass_m'),
        ({'pitch_deg': -30.0, 'pitch_mass_m': 0.01}, r'give either pitch_deg or pitch_mass_m'),
        ({'pitch_deg': -81.0}, r'pitch = -81.0 deg: out of range \(allowed: -80 to 80 deg\)'),
        ({'pitch_mass_m': 0.07}, r'pitch mass = 0.07 m: .*allowed: -0.06 to 0.06 m\)'),
        ({'pitch_deg': math.nan}, r'pitch = nan deg: out of range'),
        ({'pitch_deg': 'x'}, r'pitch = x deg: out of range'),
        ({'pitch_deg': -30.0, 'net_heaviness_kg': 'x'}, r'net buoyancy = x kg: .*-1 to 1 kg'),
        ({'pitch_deg': -30.0, 'roll_mass_deg': None}, r'roll mass = None deg: .*-60 to 60 deg'),
        ({'pitch_deg': -30.0, 'roll_mass_deg': 61.0}, r'roll mass = 61.0 deg: .*-60 to 60 deg'),
        ({'pitch_deg': -30.0, 'net_heaviness_kg': 1.1}, r'net buoyancy = 1.1 kg: .*-1 to 1 kg'),
        ({'pitch_deg': -30.0, 'net_heaviness_kg': 0.0}, r'net buoyancy = 0 kg: .*neutral'),
    ],
)
def test_what_cannot_be_trimmed_is_refused(arguments, message):
    with pytest.raises(ConfigurationError, match=message):
        solve_trim(ZHANG, **{'net_heaviness_kg': 0.4, **arguments})


# ------------------------------------------------------------------------- with a fin


@pytest.mark.parametrize(
    ('pitch_deg', 'speed', 'vertical', 'alpha_deg'),
    [(-25.0, 0.3267, 0.1507, 2.48), (-35.0, 0.3844, 0.2293, 1.62)],
)
def test_slocum_glides_as_merckelbach_says(pitch_deg, speed, vertical, alpha_deg):
    """At 0.205 kg, by his steady-state model: within 0.5 %."""
    trim = solve_trim(load_vehicle('slocum_g2').params(), 0.205, pitch_deg=pitch_deg)
    assert trim.converged
    assert trim.speed_mps == pytest.approx(speed, rel=0.005)
    assert trim.vertical_mps == pytest.approx(vertical, rel=0.005)
    assert trim.alpha_deg == pytest.approx(alpha_deg, rel=0.005)


@pytest.mark.parametrize('fin_deg', [5.0, 10.0, 20.0, -10.0])
@pytest.mark.parametrize(('m_b', 'pitch_deg'), [(0.205, -25.0), (0.205, -35.0), (-0.205, 25.0)])
def test_slocum_turns_by_its_fin_as_in_2016(fin_deg, m_b, pitch_deg):
    """r = c0 sin(delta) U^2 with c0 = 0.5 within 10 %; to starboard in dive and climb."""
    vehicle = load_vehicle('slocum_g2')
    trim = solve_trim(vehicle.params(), m_b, pitch_deg=pitch_deg, fin_deg=fin_deg)
    assert trim.converged
    c_0 = trim.turn_rate_radps / (math.sin(math.radians(fin_deg)) * trim.speed_mps**2)
    assert c_0 == pytest.approx(0.5, rel=0.1)
    assert vehicle.fin.turn_rate.value == 0.5


def test_the_pump_of_slocum_pitches_it_alone():
    """230 cc with the battery in the middle: recorded flights have 24 to 26 deg."""
    for oil_kg in (0.23575, -0.23575):
        trim = solve_trim(load_vehicle('slocum_g2').params(), oil_kg, pitch_mass_m=0.0)
        assert 24.0 < -math.copysign(1.0, oil_kg) * trim.pitch_deg < 26.0


def test_seaglider_turns_against_its_roll_in_the_dive_and_with_it_in_the_climb():
    """Measured, turn rate over sine of roll at 0.5 m/s: -.054, -.025 and +.031, +.030 rad/s."""
    dive, climb = load_vehicle('seaglider').steering_rates
    assert -0.054 < dive < -0.025
    assert 0.025 < climb < 0.035
