# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""The glide polar against the six-degree-of-freedom trim, and its inverse functions."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from glider_model.onboard.glide_polar import (
    LARGEST_ALPHA,
    glide_alpha,
    glide_attacks,
    glide_force,
    glide_horizontal_speed,
    glide_net_heaviness,
    glide_speed,
    glide_vertical_rate,
    make_polar,
    steepen,
)
from glider_model.plant.trim import solve_trim
from glider_model.vehicle.file import load_vehicle

quick = settings(max_examples=60)
VEHICLES = {name: load_vehicle(name).params() for name in ('zhang2021', 'seawing')}
POLARS = {name: make_polar(vehicle) for name, vehicle in VEHICLES.items()}
SHALLOWEST = POLARS['zhang2021'].shallowest
polars = st.sampled_from(list(POLARS.values()))
pitches = st.floats(SHALLOWEST, math.radians(70.0))
weights = st.floats(0.05, 1.0)
phases = st.sampled_from([1.0, -1.0])


@pytest.mark.parametrize('name', VEHICLES)
@pytest.mark.parametrize('pitch_deg', [18.0, 25.0, 35.0, 50.0])
@pytest.mark.parametrize('phase', [1.0, -1.0], ids=['dive', 'climb'])
def test_polar_agrees_with_trim(name, pitch_deg, phase):
    """Angle of attack within 0.02 deg, speeds within 0.5 %."""
    polar, theta = make_polar(VEHICLES[name]), -phase * math.radians(pitch_deg)
    # a mass that reaches steep pitches
    vehicle = VEHICLES[name]._replace(x_p_max=0.5)
    trim = solve_trim(vehicle, 0.35 * phase, pitch_deg=-phase * pitch_deg)
    assert trim.converged
    rate = glide_vertical_rate(theta, 0.35 * phase, polar)
    assert math.degrees(glide_alpha(theta, polar)) == pytest.approx(trim.alpha_deg, abs=0.02)
    assert rate == pytest.approx(trim.vertical_mps, rel=0.005)
    assert glide_horizontal_speed(theta, rate, polar) == pytest.approx(
        trim.horizontal_mps, rel=0.005
    )
    speed, alpha = glide_speed(theta, rate, polar)
    assert speed == pytest.approx(trim.speed_mps, rel=0.005)
    assert alpha == glide_alpha(theta, polar)


@quick
@given(polars, st.floats(math.radians(15.0), math.radians(70.0)), phases)
def test_lift_and_drag_balance_a_vertical_weight(polar, pitch, phase):
    theta = -phase * pitch
    alpha = glide_alpha(theta, polar)
    drag = polar.K_D0 + polar.K_D * alpha**2
    lift = polar.K_L0 + polar.K_L * alpha
    across = drag * math.cos(theta - alpha) + lift * math.sin(theta - alpha)
    assert abs(across) < 0.01 * glide_force(alpha, polar)


@quick
@given(polars, pitches, weights, phases)
def test_weight_comes_back_from_its_vertical_rate(polar, pitch, weight, phase):
    theta, weight = -phase * pitch, phase * weight
    rate = glide_vertical_rate(theta, weight, polar)
    assert glide_net_heaviness(theta, rate, polar) == pytest.approx(weight, rel=1e-12)


@quick
@given(polars, pitches, st.floats(0.01, 1.0), phases)
def test_speeds_are_one_triangle(polar, pitch, rate, phase):
    theta, rate = -phase * pitch, phase * rate
    assert glide_speed(theta, rate, polar)[0] == pytest.approx(
        math.hypot(rate, glide_horizontal_speed(theta, rate, polar)), rel=1e-12
    )


@quick
@given(polars, pitches, weights, phases)
def test_path_is_steeper_than_the_hull(polar, pitch, weight, phase):
    rate = glide_vertical_rate(-phase * pitch, phase * weight, polar)
    path = math.atan2(rate, glide_horizontal_speed(-phase * pitch, rate, polar))
    assert phase * path > pitch


@quick
@given(polars, pitches, phases)
def test_a_dive_goes_down_and_a_climb_up(polar, pitch, phase):
    assert phase * glide_vertical_rate(-phase * pitch, 0.4 * phase, polar) > 0.0


@quick
@given(polars, st.floats(-1.5, 1.5))
def test_angle_of_attack_stays_within_belief(polar, theta):
    assert abs(glide_alpha(theta, polar)) <= LARGEST_ALPHA


@quick
@given(polars, st.floats(-1.5, 1.5), st.floats(-1.0, 1.0))
def test_everything_is_finite_at_any_pitch(polar, theta, rate):
    numbers = [
        glide_vertical_rate(theta, rate, polar),
        glide_net_heaviness(theta, rate, polar),
        glide_horizontal_speed(theta, rate, polar),
        *glide_speed(theta, rate, polar),
    ]
    assert np.isfinite(numbers).all()


@pytest.mark.parametrize(
    ('theta', 'steep'), [(-0.1, -SHALLOWEST), (0.1, SHALLOWEST), (-0.5, -0.5)]
)
def test_a_shallow_pitch_is_steepened_to_its_side(theta, steep):
    assert steepen(theta, POLARS['zhang2021']) == steep


@quick
@given(polars, weights, phases)
def test_four_times_the_weight_is_twice_the_speed(polar, weight, phase):
    one, four = (glide_vertical_rate(-0.5 * phase, n * weight * phase, polar) for n in (1, 4))
    assert four == pytest.approx(2.0 * one, rel=1e-12)


def test_polar_of_a_vehicle_without_lift_is_usable():
    polar = make_polar(load_vehicle('zhang2021_table1').params())
    assert min(polar.K_D0, polar.K_D, polar.K_L) > 0.0
    assert math.isfinite(glide_alpha(-0.5, polar))


@quick
@given(st.floats(math.radians(8.0), math.radians(60.0)), st.floats(0.06, 0.5), phases)
def test_speed_and_angle_are_found_together_where_drag_changes_with_speed(pitch, rate, phase):
    """Lift and drag at both balance a vertical weight, which makes that rate."""
    polar, theta, rate = (
        make_polar(load_vehicle('seaglider').params()),
        -phase * pitch,
        phase * rate,
    )
    speed, alpha = glide_speed(theta, rate, polar)
    assert speed * math.sin(alpha - theta) == pytest.approx(rate, rel=1e-12)
    drag = polar.K_D0 * speed**polar.n + polar.K_D * alpha**2
    lift = polar.K_L0 + polar.K_L * alpha
    across = drag * math.cos(theta - alpha) + lift * math.sin(theta - alpha)
    assert abs(across) < 1e-3 * math.hypot(drag, lift)
    weight = glide_net_heaviness(theta, rate, polar)
    assert glide_vertical_rate(theta, weight, polar) == pytest.approx(rate, rel=3e-4)


@quick
@given(
    st.sampled_from(['seaglider', 'slocum_g2', 'zhang2021']),
    st.floats(math.radians(7.0), math.radians(60.0)),
    phases,
)
def test_shallow_glides_are_sought_until_forces_balance(name, pitch, phase):
    """Where there is a glide at this pitch at all: its discriminant is not negative."""
    polar = make_polar(load_vehicle(name).params(), to_the_end=True)._replace(n=0.0)
    theta = -phase * pitch
    alpha = glide_alpha(theta, polar)
    drag, lift = polar.K_D0 + polar.K_D * alpha**2, polar.K_L0 + polar.K_L * alpha
    slope = math.tan(theta - alpha)
    if (polar.K_L * slope) ** 2 > 4.1 * polar.K_D * (polar.K_D0 + polar.K_L0 * slope):
        assert drag + lift * slope == pytest.approx(0.0, abs=0.03 * drag)


@quick
@given(
    st.sampled_from([*VEHICLES, 'seaglider', 'slocum_g2']),
    st.booleans(),
    st.tuples(*(2 * [st.floats(-1.5, 1.5)])),
    st.floats(-1.0, 1.0),
)
def test_what_is_found_beforehand_is_what_would_be_found(name, to_the_end, pitches, number):
    """To the last bit, at the pitch that it is of and at any other."""
    polar = make_polar(load_vehicle(name).params(), to_the_end)
    ways = (glide_vertical_rate, glide_net_heaviness, glide_horizontal_speed, glide_speed)
    for found in glide_attacks(*pitches, polar):
        assert math.isinf(found.theta) is (to_the_end or polar.n != 0.0)
        for theta in pitches:
            for way in ways:
                assert way(theta, number, polar, found) == way(theta, number, polar)


def test_linear_drag_is_taken_at_half_a_metre_per_second():
    vehicle = VEHICLES['zhang2021']._replace(D_u=2.0)
    assert make_polar(vehicle).K_D0 == pytest.approx(7.5 + 2.0 / 0.5, rel=1e-15)
