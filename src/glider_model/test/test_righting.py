# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""What rights a vehicle that is rolled, by its file, against its steady spirals."""

import pytest

from glider_model.onboard.moving_mass import make_righting, rights_itself
from glider_model.plant.trim import solve_trim
from glider_model.vehicle.file import load_vehicle, vehicle_names


def rolls_with_its_mass(vehicle, m_b, pitch_deg):
    """Whether it is steady rolled to the side of its roll mass, or to the other side only."""
    spiral = solve_trim(vehicle, m_b, pitch_deg=pitch_deg, roll_mass_deg=1.0)
    assert spiral.converged
    return spiral.roll_deg > 0.0


@pytest.mark.parametrize('pitch_deg', [20.0, 30.0, 45.0])
@pytest.mark.parametrize('m_b', [-0.95, -0.8, -0.6, -0.3, 0.3, 0.6, 0.95])
def test_a_light_seawing_is_steady_against_its_roll_mass_only(m_b, pitch_deg):
    vehicle = load_vehicle('seawing').params()
    with_it = rolls_with_its_mass(vehicle, m_b, pitch_deg if m_b < 0.0 else -pitch_deg)
    assert rights_itself(m_b, 0.0, make_righting(vehicle)) == with_it


@pytest.mark.parametrize('name', sorted(set(vehicle_names()) - {'seawing'}))
def test_the_others_right_themselves_with_the_whole_pump(name):
    vehicle = load_vehicle(name).params()
    for m_b in (-vehicle.m_b_max, vehicle.m_b_max):
        assert rights_itself(m_b, 0.25, make_righting(vehicle))
        if vehicle.mu_max and name != 'zhang2021_table1':  # which does not glide
            assert rolls_with_its_mass(vehicle, m_b, 30.0 if m_b < 0.0 else -30.0)
