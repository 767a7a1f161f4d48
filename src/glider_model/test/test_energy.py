# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""The ledger: what a vehicle takes out of its battery, and what the battery says."""

import pytest

from glider_base.signals import TICK_S, Battery, Joints
from glider_base.wiring import PLANT
from glider_model.plant.block import plant_move, plant_outputs
from glider_model.plant.energy import FULL, battery_of, spend, spent
from glider_model.plant.plant import LAUNCHED, PlantSettings
from glider_model.vehicle.energy import NO_ENERGY
from glider_model.vehicle.file import changed_vehicle, load_vehicle

STILL = (0.0, 0.0, 0.0)
REST = Joints(0.0, 0.0, 0.0, 0.0)
UNDER = LAUNCHED._replace(is_under=True, silent_ticks=9)
OUT = LAUNCHED._replace(count=1, out_ticks=1)


@pytest.fixture(scope='module')
def params():
    return load_vehicle('zhang2021').energy.params()


def spends(params, before=REST, after=REST, depths=(500.0, 500.0), stays=(UNDER, UNDER), dt=0.1):
    return spend(FULL, before, after, depths, stays, params, dt)


def cc(kg):
    return kg * 1e6 / 1025.0


@pytest.mark.parametrize('depth_m', [0.0, 500.0, 1000.0])
def test_oil_that_is_pumped_out_takes_its_line_in_depth(params, depth_m):
    told = spends(params, after=Joints(-0.2, 0.0, 0.0, 0.0), depths=(depth_m, depth_m))
    assert told.pump == pytest.approx(cc(0.2) * (2.4888 + 0.012276 * depth_m), rel=1e-12)
    assert told.masses == told.calls == 0.0


def test_oil_that_is_let_in_gives_nothing_back(params):
    """The line is below zero down to 32 m."""
    deep, shallow = (
        spends(params, before=Joints(-0.2, 0.0, 0.0, 0.0), depths=(z, z)).pump for z in (500, 10)
    )
    assert deep == pytest.approx(cc(0.2) * (-0.17935 + 0.005574 * 500.0), rel=1e-12)
    assert shallow == 0.0


@pytest.mark.parametrize(
    ('depths', 'stays', 'watts'),
    [
        ((500.0, 500.1), (UNDER, UNDER), 1.3137),
        ((500.1, 500.0), (UNDER, UNDER), 1.003),
        ((0.2, 0.3), (OUT, OUT), 1.003),
    ],
)
def test_electronics_take_what_their_phase_takes(params, depths, stays, watts):
    params = params._replace(surface=1.003)
    told = spends(params, depths=depths, stays=stays)
    assert told.hotel == pytest.approx(0.1 * watts, rel=1e-12)
    assert told.power == pytest.approx(watts, rel=1e-12)


def test_masses_take_as_much_as_they_move(params):
    params = params._replace(pitch=6000.0, roll=30.0, steer=7.0)
    told = spends(params, Joints(0.0, 0.002, -0.1, 0.3), Joints(0.0, -0.001, 0.1, 0.2))
    assert told.masses == pytest.approx(18.0 + 6.0 + 0.7, rel=1e-12)


def test_a_vehicle_that_comes_up_calls_once_and_for_as_long_as_it_may(params):
    params, ledger = params._replace(call_start=100.0, call=4.0, call_s=25.0), FULL
    before = UNDER
    for _ in range(600):  # a minute
        ledger = spend(ledger, REST, REST, (0.2, 0.2), (before, OUT), params, TICK_S)
        before = OUT
    assert ledger.calls == pytest.approx(200.0, rel=1e-9)


def test_a_dive_ends_the_call(params):
    ledger = spend(FULL, REST, REST, (0.2, 0.2), (UNDER, OUT), params, TICK_S)
    assert ledger.call_s > 600.0
    ledger = spend(ledger, REST, REST, (5.0, 5.0), (OUT, UNDER), params, TICK_S)
    again = spend(ledger, REST, REST, (0.2, 0.2), (OUT, OUT), params, TICK_S)
    assert again.calls == ledger.calls


def test_the_battery_says_what_is_left(params):
    ledger = FULL._replace(pump=0.25 * params.capacity, power=30.0)
    told = battery_of(ledger, params)
    full_ah = 3381.0 / 15.0
    assert told == pytest.approx((15.0, -2.0, 0.75 * full_ah, full_ah, 0.75), rel=1e-6)
    assert battery_of(FULL._replace(hotel=2.0 * params.capacity), params).percentage == 0.0


def test_without_a_section_nothing_is_known_but_the_voltage():
    told = battery_of(spends(NO_ENERGY, after=Joints(-0.2, 0.0, 0.0, 0.0)), NO_ENERGY)
    assert told == Battery(15.0, 0.0, -1.0, -1.0, -1.0)


def dived(vehicle: str):
    """States of a plant that pumps itself from 20 m to the surface, and its params."""
    start = {'depth_m': 20.0, 'net_heaviness_kg': 0.0}
    settings = PlantSettings(vehicle=vehicle, initial=start)
    state, params, states = settings.initial_state(), settings.params(), []
    for _ in range(3000):
        states.append(state)
        state = plant_move(state, ((-0.8, -0.03, 0.1, 0.0), STILL, (0.0,)), params, TICK_S)
    return states, params


@pytest.fixture(scope='module')
def risen():
    return dived('zhang2021')


def test_the_plant_keeps_its_ledger(risen):
    states, params = risen
    last = states[-1]
    assert last.surfacing.out_ticks > 0
    energy = params.energy
    parts = last.ledger
    # pumped between 20 m and the surface
    least, most = (cc(0.8) * (2.4888 + 0.012276 * z) for z in (0.0, 20.0))
    assert least < parts.pump < most
    assert parts.masses == pytest.approx(energy.pitch * 0.03 + energy.roll * 0.1, rel=1e-9)
    called_s = TICK_S * last.surfacing.out_ticks
    assert parts.calls == pytest.approx(energy.call_start + energy.call * called_s, rel=1e-6)
    told = Battery(*plant_outputs(last, params)[0][PLANT.outputs.index('battery') - 1])
    assert told.charge == pytest.approx((energy.capacity - spent(parts)) / 54000.0, rel=1e-6)


def test_what_it_takes_moves_nothing(risen):
    """A vehicle whose pump takes a hundred times as much flies the very same way."""
    changed = changed_vehicle('zhang2021', {'energy.pump_out': 99.0, 'energy.hotel_climb': 99.0})
    states, _ = dived(changed)
    assert states[-1].ledger.pump > 10.0 * risen[0][-1].ledger.pump
    assert states[-1].motion == risen[0][-1].motion
