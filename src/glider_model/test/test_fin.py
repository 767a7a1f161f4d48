# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""The tail fin: which way it turns the vehicle, what it costs, and who is left as he was."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from glider_base.settings import ConfigurationError
from glider_base.signals import SEA_WATER_DENSITY, TICK_S, Joints
from glider_model.plant.trim import solve_trim
from glider_model.vehicle.actuators import actuators_step
from glider_model.vehicle.file import changed_vehicle, load_vehicle
from glider_model.vehicle.surface import surface_loads
from glider_model.vehicle.surfaces.fin import FinParams

FIN = {'range': 26.0, 'rate': 1.2, 'area': 0.05, 'lift_slope': 3.0, 'x': -1.2, 'turn_rate': 0.5}
#: A hull with less weathercock stability than zhang2021's: +20 kg/rad in total instead of +80.
SLENDER = {'hydrodynamics.K_MY': 98.4}
NOTHING = 6 * (0.0,)
numbers = st.floats(-2.0, 2.0)
quick = settings(max_examples=200)


def with_fin(changes=None, **fin):
    """Vehicle zhang2021 with a fin."""
    fields = {f'fin.{name}': value for name, value in {**FIN, **fin}.items()}
    return load_vehicle(changed_vehicle('zhang2021', {**fields, **(changes or {})}))


def loads(u=0.5, v=0.0, w=0.0, p=0.0, q=0.0, r=0.0, delta=0.0, params=None):
    """Loads on the fin alone: X, Y, Z (N), K, M, N (N m)."""
    return surface_loads(NOTHING, u, v, w, p, q, r, delta, params or with_fin().params().surface)


def test_a_positive_angle_turns_the_nose_to_starboard():
    x, y, _, _, _, n = loads(delta=0.2)
    assert x < 0.0 and y < 0.0 and n > 0.0
    assert loads(delta=-0.2)[5] == -n


def test_force_is_normal_to_the_chord_and_grows_with_the_square_of_speed():
    """rho/2 S a U^2 sin(delta) on a vehicle that goes straight ahead."""
    x, y, *_ = loads(u=0.5, delta=0.3)
    normal = 0.5 * SEA_WATER_DENSITY * 0.05 * 3.0 * 0.25 * math.sin(0.3)
    assert (x, y) == pytest.approx((-normal * math.sin(0.3), -normal * math.cos(0.3)), rel=1e-12)
    assert loads(u=1.0, delta=0.3)[1] == pytest.approx(4.0 * y, rel=1e-12)


def test_at_rest_it_keeps_the_nose_in_the_flow_and_damps_the_turn():
    """As a weathercock does: it pushes the tail away from the side that the flow comes from."""
    assert loads(v=0.1)[1] < 0.0 < loads(v=0.1)[5]
    assert loads(r=0.1)[5] < 0.0
    assert loads() == NOTHING


def test_above_the_axis_it_rolls_as_it_turns():
    """Force to port above the axis: port side down, which is a negative moment."""
    above, below = (loads(delta=0.2, params=with_fin(z=z).params().surface) for z in (-0.3, 0.3))
    assert above[3] < 0.0 < below[3]
    assert above[:2] == below[:2] == loads(delta=0.2)[:2]


@quick
@given(*6 * [numbers], st.floats(-1.5, 1.5), st.floats(-0.5, 0.5))
def test_it_takes_energy_in_any_attitude_and_at_any_angle(u, v, w, p, q, r, delta, z):
    fin = FinParams(77.0, -1.2, z)
    power = np.dot(loads(u, v, w, p, q, r, delta, fin), (u, v, w, p, q, r))
    assert power <= 1e-9


@pytest.mark.parametrize('sign', [1.0, -1.0], ids=['dive', 'climb'])
def test_the_turn_of_a_slocum_can_be_met(sign, fly, plant_params, start):
    """Turn rate over sin(delta) U^2 of 0.5 rad s/m^2, within a quarter."""
    vehicle = with_fin(SLENDER).params()
    trim = solve_trim(vehicle, 0.4 * sign, pitch_deg=-30.0 * sign)
    joints = (0.4 * sign, trim.pitch_mass_m, 0.0, math.radians(10.0))
    state = start((0.0, 0.0, 500.0), (0.0, math.radians(-30.0 * sign), 0.0), joints=joints)
    flight = fly(plant_params(vehicle), state, 400.0)
    speed2 = np.sum(flight.velocity[-1, :3] ** 2)
    rate = flight.r[-1] / (math.sin(math.radians(10.0)) * speed2)
    assert rate == pytest.approx(0.5, rel=0.25)
    assert flight.r[-1] == pytest.approx(flight.r[-100], rel=1e-3)


def test_it_goes_as_fast_and_as_far_as_its_file_says():
    vehicle = with_fin().params()
    at_rest, target = Joints(0.0, 0.0, 0.0, 0.0), Joints(0.0, 0.0, 0.0, 9.0)
    moved = actuators_step(at_rest, target, 0.0, vehicle, TICK_S)
    assert moved.delta == pytest.approx(math.radians(1.2) * TICK_S, rel=1e-12)
    assert actuators_step(at_rest, target, 0.0, vehicle, 1e6).delta == math.radians(26.0)


def test_without_a_fin_the_loads_are_the_very_same_numbers():
    vehicle = load_vehicle('zhang2021')
    hull = (-0.0, 1e-320, -2.0, 0.0, 3.0, math.inf)
    same = surface_loads(hull, *6 * (1.0,), 1.0, vehicle.params().surface)
    assert np.array(same).tobytes() == np.array(hull).tobytes()
    assert (vehicle.steers_by, with_fin().steers_by) == ('', 'fin')


@pytest.mark.parametrize(
    ('field', 'value', 'expected'),
    [
        ('x', 0.5, 'fin.x.value = 0.5: should be less than 0 (allowed: >= -10.0 and < 0.0)'),
        ('range', 100.0, 'fin.range.value = 100.0: should be less than or equal to 90 '),
        ('span', 1.0, 'fin.span = 1.0: unknown field (allowed fields: range, rate, dead_band, '),
    ],
)
def test_what_is_wrong_in_its_section_is_named(field, value, expected):
    with pytest.raises(ConfigurationError) as error:
        with_fin(**{field: value})
    assert expected in str(error.value)


def test_a_section_that_is_not_whole_is_refused():
    with pytest.raises(ConfigurationError, match=r'fin\.area: missing'):
        load_vehicle(changed_vehicle('zhang2021', {'fin.range': 26.0}))
