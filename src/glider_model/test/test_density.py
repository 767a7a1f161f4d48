# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""The surface, stratification and compression."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pydantic import ValidationError

from glider_model.ocean.density import (
    DensitySettings,
    buoyancy_gain,
    depth_at,
    emerged_fraction,
    pressure_at,
)
from glider_model.vehicle.rigid_body import GRAVITY

quick = settings(max_examples=60)
M, RADIUS = 69.0, 0.11  # kg and m, zhang2021
depths = st.floats(0.0, 1000.0)


# ------------------------------------------------------------------------------------- density


@quick
@given(st.floats(-10.0, 6000.0))
def test_water_is_uniform_unless_asked(depth):
    assert buoyancy_gain(depth, M, DensitySettings().params()) == 0.0


@quick
@given(depths)
def test_density_of_a_pycnocline(depth):
    density = DensitySettings(pycnocline_rise=0.004, pycnocline_depth_m=80.0).params()
    expected = M * 0.004 * (1.0 - math.exp(-depth / 80.0))
    assert buoyancy_gain(depth, M, density) == pytest.approx(expected, rel=1e-12, abs=1e-15)


@quick
@given(depths)
def test_compressed_water_carries_more(depth):
    density = DensitySettings(compression_per_m=4.5e-6).params()
    assert buoyancy_gain(depth, M, density) == pytest.approx(M * 4.5e-6 * depth, abs=1e-14)


@quick
@given(depths)
def test_compressed_hull_carries_less(depth):
    density = DensitySettings(hull_compression_per_m=5e-6).params()
    assert buoyancy_gain(depth, M, density) == pytest.approx(-M * 5e-6 * depth, abs=1e-14)


def test_a_hull_as_soft_as_the_water_notices_nothing():
    density = DensitySettings(compression_per_m=4.5e-6, hull_compression_per_m=4.5e-6).params()
    assert buoyancy_gain(800.0, M, density) == 0.0


def test_there_is_no_density_above_the_surface():
    density = DensitySettings(pycnocline_rise=0.01, compression_per_m=1e-5).params()
    assert buoyancy_gain(-3.0, M, density) == 0.0


@pytest.mark.parametrize(
    'values',
    [
        {'pycnocline_rise': -0.001},
        {'pycnocline_depth_m': 0.0},
        {'hull_compression_per_m': 1.0},
        {'compression_per_m': math.nan},
    ],
)
def test_water_out_of_range_is_refused(values):
    with pytest.raises(ValidationError):
        DensitySettings(**values)


@pytest.mark.parametrize(
    ('water', 'sign'),
    [
        ({'pycnocline_rise': 0.004}, -1.0),
        ({'compression_per_m': 4.5e-6}, -1.0),
        ({'hull_compression_per_m': 5e-6}, 1.0),
    ],
)
def test_density_moves_a_neutral_vehicle(water, sign, fly, plant_params, start):
    """Dense water lifts, a soft hull sinks: dm(z) g / (m + a_33) at rest (m, within 1 %)."""
    params = plant_params('zhang2021', **water)
    flight = fly(params, start((0.0, 0.0, 200.0), velocity=(0.0,) * 6), 1.0)
    gain = buoyancy_gain(200.0, M, params.density)
    moved = flight.p_d[-1] - 200.0
    assert moved == pytest.approx(-0.5 * gain * GRAVITY / (M + 60.53), rel=0.01)
    assert moved * sign > 0.0


def test_a_ballasted_vehicle_sinks_to_where_it_is_neutral(fly, plant_params, start):
    """0.1 kg heavy in a pycnocline that gives 0.1 kg at 55.5 m."""
    params = plant_params('zhang2021', pycnocline_rise=0.004, pycnocline_depth_m=123.0)
    neutral = -123.0 * math.log(1.0 - 0.1 / (M * 0.004))
    state = start((0.0, 0.0, 20.0), velocity=(0.0,) * 6, joints=(0.1, 0.0, 0.0))
    flight = fly(params, state, 3600.0)
    assert flight.p_d[-1] == pytest.approx(neutral, abs=1.0)  # m


# ------------------------------------------------------------------------------------- surface


def test_a_hull_under_water_is_under_water():
    assert emerged_fraction(RADIUS, RADIUS) == 0.0
    assert emerged_fraction(5.0, RADIUS) == 0.0


def test_a_hull_in_the_air_is_in_the_air():
    assert emerged_fraction(-RADIUS, RADIUS) == 1.0
    assert emerged_fraction(-5.0, RADIUS) == 1.0


def test_half_a_hull_is_out_when_its_axis_is_at_the_surface():
    assert emerged_fraction(0.0, RADIUS) == pytest.approx(0.5, abs=1e-15)


@quick
@given(st.floats(-0.2, 0.2), st.floats(0.0, 0.1))
def test_a_higher_hull_has_more_outside(depth, higher):
    assert emerged_fraction(depth - higher, RADIUS) >= emerged_fraction(depth, RADIUS)


@pytest.mark.parametrize('name', ['zhang2021', 'seawing'])
@pytest.mark.parametrize('m_b', [-1.0, -0.4])
@pytest.mark.parametrize('depth', [-0.5, 0.0, 3.0])
def test_a_light_vehicle_floats_with_its_lightness_out(name, m_b, depth, fly, plant_params, start):
    """Archimedes: a fraction -m_b / m of the hull is above water, within 5 % of it."""
    params = plant_params(name)
    flight = fly(params, start((0, 0, depth), velocity=(0.0,) * 6, joints=(m_b, 0, 0)), 300.0)
    vehicle = params.vehicle
    out = emerged_fraction(flight.p_d[-1], vehicle.hull_radius)
    assert out == pytest.approx(-m_b / vehicle.m, rel=0.05)
    assert np.isfinite(flight.rows).all()


def test_bobbing_decays(fly, plant_params, start):
    """Dropped from 0.3 m above: within a minute under a millimetre of it is left."""
    state = start((0.0, 0.0, -0.3), velocity=(0.0,) * 6, joints=(-0.5, 0.0, 0.0))
    depth = fly(plant_params(), state, 120.0).p_d
    swing = [np.ptp(depth[a:b]) for a, b in ((0, 100), (100, 300), (600, 1200))]
    assert swing[0] > 0.3
    assert swing[1] < 0.3 * swing[0]
    assert swing[2] < 1e-3  # m


def test_a_climbing_glider_arrives_and_stays(fly, plant_params, start):
    """From a full climb: does not jump out, and at the end floats level with the surface."""
    state = start((0, 0, 20), (0, 0.5, 0), (0.5, 0, 0, 0, 0, 0), (-0.4, -0.016, 0))
    flight = fly(plant_params(), state, 600.0)
    assert flight.p_d.min() > -0.3  # m
    assert np.abs(flight.p_d[-600:]).max() < 0.11  # m
    assert np.abs(flight.velocity[-1, 2]) < 0.05  # m/s


def test_a_neutral_vehicle_at_depth_stays(fly, plant_params, start):
    flight = fly(plant_params('zhang2021'), start((1, 2, 50), velocity=(0.0,) * 6), 600.0)
    np.testing.assert_array_equal(flight.position[-1], [1.0, 2.0, 50.0])


def test_a_heavy_vehicle_leaves_the_surface(fly, plant_params, start):
    state = start((0, 0, 0), velocity=(0.0,) * 6, joints=(0.4, 0.016, 0.0))
    assert fly(plant_params(), state, 120.0).p_d[-1] > 10.0  # m


# ------------------------------------------------------------------------------------- pressure


@quick
@given(st.floats(-10.0, 12000.0))
def test_depth_comes_back_from_pressure(depth):
    assert depth_at(pressure_at(depth)) == pytest.approx(depth, abs=1e-8)


def depth_in_the_sea(decibar, latitude_deg):
    """Depth (m) of a pressure: Fofonoff and Millard (1983), Unesco 44, algorithm 4."""
    p, x = decibar, math.sin(math.radians(latitude_deg)) ** 2
    gravity = 9.780318 * (1.0 + (5.2788e-3 + 2.36e-5 * x) * x) + 1.092e-6 * p
    depth = (((-1.82e-15 * p + 2.279e-10) * p - 2.2512e-5) * p + 9.72659) * p
    return depth / gravity


def test_pressure_is_that_of_the_air_and_of_the_water_above():
    """The standard atmosphere; and the sea, which is compressed, down to 1000 m within 1 %."""
    assert depth_in_the_sea(10000.0, 30.0) == pytest.approx(9712.653, abs=1e-3)  # their check
    assert pressure_at(0.0) == 101325.0
    for decibar in (1.0, 100.0, 500.0, 1000.0):
        depth = depth_in_the_sea(decibar, 36.0)
        assert pressure_at(depth) - 101325.0 == pytest.approx(1e4 * decibar, rel=0.01)
