# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""What rights a vehicle that is rolled, by its file."""

import math

import pytest

from glider_model.onboard.righting import make_righting, rights_itself
from glider_model.vehicle.file import load_vehicle, vehicle_names


def test_a_light_seawing_does_not_right_itself():
    """Dihedral rolls it over in the climb and back in the dive; at rest all is left."""
    righting = make_righting(load_vehicle('seawing').params())
    assert rights_itself(-0.64, 0.0, righting)
    assert not rights_itself(-0.66, 0.0, righting)
    assert rights_itself(0.66, 1.0, righting)
    assert rights_itself(0.0, 1.0, righting)


@pytest.mark.parametrize('name', sorted(set(vehicle_names()) - {'seawing'}))
def test_the_others_right_themselves_with_the_whole_pump(name):
    vehicle = load_vehicle(name).params()
    righting = make_righting(vehicle)
    assert math.isfinite(righting.lever)
    for m_b in (-vehicle.m_b_max, vehicle.m_b_max):
        assert rights_itself(m_b, 0.25, righting)
