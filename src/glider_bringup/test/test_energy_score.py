# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""Energy of a flight: on the topic, in the score and on the card, all by one ledger."""

import numpy as np
import pytest

from glider_base.files import read_yaml, yaml_text
from glider_base.signals import TICK_S, Battery
from glider_bringup.scoring.card import fly_scored, scorecard
from glider_bringup.showing.scorecard import card_rows
from glider_mission.blocks import COLUMNS
from glider_mission.scenario import load_scenario
from glider_model.vehicle.file import load_vehicle, vehicle_path

SHALLOW = {'profile.depth_m': 60.0, 'dives': 2, 'sensors.attitude_std_deg': 0.2}


class Batteries:
    """Keeps what the battery says of a flight."""

    def __init__(self) -> None:
        self.rows: list[np.ndarray] = []

    def add(self, log: np.ndarray) -> None:
        self.rows.append(log[:, COLUMNS['battery']].copy())

    def of(self, field: str) -> np.ndarray:
        return np.concatenate(self.rows)[:, Battery._fields.index(field)]


@pytest.fixture(scope='module')
def flown():
    """Scenario, flight, scores, and batteries of two dives."""
    scenario, batteries = load_scenario('current_8deg', SHALLOW), Batteries()
    return scenario, *fly_scored(scenario, [batteries]), batteries


def test_the_score_is_what_the_battery_lost(flown):
    _, _, scores, batteries = flown
    told, section = scores['energy'], load_vehicle('zhang2021').energy
    lost_ah = batteries.of('charge')[0] - batteries.of('charge')[-1]
    assert told['wh'] == pytest.approx(section.voltage.value * lost_ah, abs=2e-3)
    assert sum(told['by'].values()) == pytest.approx(told['wh'], rel=1e-12)
    # charge is the sum of the current, but for what the last tick of all will take
    drawn_ah = -batteries.of('current').sum() * TICK_S / 3600.0
    assert drawn_ah == pytest.approx(lost_ah, rel=1e-4)


def test_the_parts_are_of_a_size_that_can_be_worked_out(flown):
    _, _, scores, _ = flown
    told, travel = scores['energy'], scores['actuator_travel']
    section, hours = load_vehicle('zhang2021').energy, scores['sim_time_s'] / 3600.0
    watts = (section.hotel_climb.value, section.hotel_dive.value)
    assert hours * watts[0] < told['by']['hotel'] < hours * watts[1]
    masses = section.pitch_mass.value * travel['pitch_mass_m']
    masses += section.roll_mass.value * travel['roll_mass_deg']
    assert told['by']['masses'] == pytest.approx(masses / 3600.0, rel=1e-6)
    # every kg that was pumped out was pumped at 0 to 62 m; no more than half of the way is out
    most = 0.5 * travel['buoyancy_engine_kg'] * 975.61 * (2.4888 + 0.012276 * 62.0) / 3600.0
    assert 0.3 * most < told['by']['pump'] < 1.2 * most


def test_endurance_and_range_are_those_of_the_usable_part(flown):
    _, _, scores, _ = flown
    told = scores['energy']
    times = 0.9 * 3381.0 / told['wh']
    assert scores['dives'] == 2
    assert told['wh_per_dive'] == pytest.approx(told['wh'] / 2.0)
    assert told['endurance_days'] == pytest.approx(times * scores['sim_time_s'] / 86400.0)
    assert told['range_km'] == pytest.approx(1e-3 * times * scores['distance_along_path_m'])


def test_no_vehicle_flies_on_with_an_empty_battery():
    """Not even one all of whose battery is usable: then nothing is left to keep."""
    energy = {'vehicle.energy.capacity.value': 0.6, 'vehicle.energy.usable.value': 1.0}
    changes = {**SHALLOW, **energy, 'dives': 0, 'duration_s': 2000.0}
    _, scores = fly_scored(load_scenario('current_8deg', changes), [])
    assert (scores['status'], scores['guard']['events'][0]['row']) == ('surfaced', 'battery')


def test_the_card_says_it(flown):
    scenario, flight, scores, _ = flown
    rows = dict(card_rows(scorecard(scenario, 'direct', flight, scores)))
    assert f'{scores["energy"]["wh"]:.1f} Wh' in rows['energy']
    assert f'{scores["energy"]["endurance_days"]:.1f} days' in rows['battery lasts']


def test_a_vehicle_that_says_nothing_of_its_battery_has_no_figures(tmp_path):
    values = read_yaml(vehicle_path('zhang2021'))
    del values['energy']
    (tmp_path / 'old.yaml').write_text(yaml_text(values), encoding='utf-8')
    changes = {'vehicle': str(tmp_path / 'old.yaml'), 'dives': 0, 'duration_s': 60.0}
    scenario, batteries = load_scenario('current_8deg', changes), Batteries()
    flight, scores = fly_scored(scenario, [batteries])
    assert scores['energy']['wh'] is None and set(scores['energy']['by'].values()) == {None}
    assert set(batteries.of('percentage')) == {-1.0}
    assert 'energy' not in dict(card_rows(scorecard(scenario, 'direct', flight, scores)))
    assert flight.status == 'completed'
