# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""What the vehicle's health sensors say."""

import pytest

from glider_base.signals import TICK_S, Health, Joints
from glider_base.wiring import PLANT
from glider_model.plant.block import plant_move, plant_outputs
from glider_model.plant.plant import PlantSettings
from glider_model.plant.sensors import VACUUM_PA

STILL = (0.0, 0.0, 0.0)


def said(state, params) -> Health:
    """Numbers of the topic health at a tick."""
    outputs, _ = plant_outputs(state, params)
    return Health(*outputs[PLANT.outputs.index('health') - 1])


def after(state, params, ticks: int, command: Joints):
    for _ in range(ticks):
        state = plant_move(state, (tuple(command), STILL, (0.0,)), params, TICK_S)
    return state


def test_a_vehicle_is_well_when_it_is_launched():
    settings = PlantSettings()
    told = said(settings.initial_state(), settings.params())
    assert told == Health(0.0, VACUUM_PA, 0.0)


@pytest.mark.parametrize(('depth_m', 'heaviness_kg', 'age_s'), [(0.1, -1.0, 0.0), (50, 1.0, 5.0)])
def test_contact_ages_while_the_antenna_is_under_water(depth_m, heaviness_kg, age_s):
    start = {'depth_m': depth_m, 'net_heaviness_kg': heaviness_kg}
    settings = PlantSettings(initial=start)
    state = settings.initial_state()
    state = after(state, settings.params(), 50, state.joints)
    assert said(state, settings.params()).contact_age_s == pytest.approx(age_s, abs=1e-9)
