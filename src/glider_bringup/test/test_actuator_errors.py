# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""Flights with actuators that err: held, repeated, scored by where they are, and not accused."""

import pytest

from glider_bringup.door.run import fly
from glider_mission.scenario import load_scenario

#: Dead bands far beyond what the guard allows by itself, 2 % of the range.
BANDS = {'buoyancy_engine.dead_band': 0.02, 'moving_mass.dead_band': 0.001}
NOISE = {'buoyancy_engine.noise': 0.002, 'moving_mass.noise': 2e-4}
FIN = {**BANDS, 'fin.dead_band': 2.0}
ROLL = {**BANDS, 'moving_mass.rotation_dead_band': 2.0}
FIN_NOISE = {**FIN, **NOISE, 'fin.noise': 0.5}
ROLL_NOISE = {**ROLL, **NOISE, 'moving_mass.rotation_noise': 0.5}


#: Its place is known throughout, and what it measures is so.
KNOWN = {'navigation.method': 'known', 'profile.surface_every_dives': 0, 'sensors': {}}


def flown(name, errors, **fields):
    changes = {'dives': 0, 'settle_s': 1800.0, **KNOWN, **fields}
    changes |= {f'vehicle.{field}': value for field, value in errors.items()}
    return fly(load_scenario(name, changes))


@pytest.mark.parametrize(
    ('name', 'errors', 'seconds', 'law'),
    [
        ('slocum_shelf', FIN, 12000.0, 'adaptive'),
        ('slocum_shelf', FIN_NOISE, 12000.0, 'adaptive'),
        ('slocum_shelf', FIN_NOISE, 12000.0, 'pid'),
        ('seaglider_1000m', ROLL, 16000.0, 'pid'),
        ('seaglider_1000m', ROLL_NOISE, 16000.0, 'adaptive'),
        ('seaglider_1000m', ROLL_NOISE, 16000.0, 'pid'),
    ],
)
def test_the_guard_does_not_take_a_dead_band_for_a_stuck_actuator(name, errors, seconds, law):
    run = flown(name, errors, duration_s=seconds, **{'control.law': law})
    assert run.score['status'] == 'completed'
    assert run.score['guard']['events'] == []
    assert run.score['cross_track_m']['max_steady'] < 3.0


def test_what_is_stuck_is_still_found():
    """Through the noise of what it says."""
    fault = {'kind': 'stuck', 'actuator': 'buoyancy_engine', 'at_s': 1500.0}
    run = flown('seaglider_1000m', ROLL_NOISE, duration_s=4000.0, faults=[fault])
    assert 'buoyancy_engine_stuck' in {event['row'] for event in run.score['guard']['events']}


def test_noise_repeats_to_the_last_bit_and_is_no_way_that_they_go():
    """Told is the noise, scored the way without it; another seed has another noise."""
    noise = {'buoyancy_engine.noise': 1e-4, 'moving_mass.noise': 1e-5, 'fin.noise': 0.02}
    short = {'duration_s': 1500.0}
    ideal, one, again = (flown('slocum_shelf', errors, **short) for errors in ({}, noise, noise))
    other = flown('slocum_shelf', noise, **short, seed=1)
    told = [run.to_xarray()['joint_states_fin'].to_numpy() for run in (one, again, other)]
    assert told[0].tobytes() == told[1].tobytes() != told[2].tobytes()
    assert one.score['actuator_travel'] == again.score['actuator_travel']
    for name in ('buoyancy_engine_kg', 'fin_deg'):
        way, ideal_way = (run.score['actuator_travel'][name] for run in (one, ideal))
        assert way == pytest.approx(ideal_way, rel=0.3)
    assert one.score['energy']['wh'] == pytest.approx(ideal.score['energy']['wh'], rel=0.02)


def test_a_turn_is_led_by_the_pump_that_it_has_at_depth():
    """At half its rate at 200 m it starts sooner, and overshoots no more."""
    slow = {'buoyancy_engine.rate_per_m': 0.0025}
    ideal, run = (flown('slocum_shelf', one, duration_s=9000.0) for one in ({}, slow))
    assert run.score['guard']['events'] == []
    assert 0.0 <= run.score['depth_m']['overshoot'] < ideal.score['depth_m']['overshoot'] + 1.0
    assert run.score['cross_track_m']['max_steady'] < 1.0
