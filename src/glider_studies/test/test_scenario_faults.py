# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""Faults as part of a scenario: what is written, what is told of them, what verify says."""

import json

import pytest

from command_line import glider
from glider_base.settings import ConfigurationError, find_field, unit_of
from glider_mission.recording.mcap_reader import Bag
from glider_mission.recording.ros.node_settings import read_settings
from glider_mission.recording.ros.recorded_run import Recording
from glider_mission.recording.ros.verify.every_block import verify
from glider_mission.scenario import Scenario, load_scenario
from glider_model.plant.faults.settings import check_fitted
from glider_model.vehicle.file import load_vehicle
from glider_studies.montecarlo import make_scenarios, outcome
from glider_studies.random_faults import DRAWN, sample_faults, validated

SCENARIO = """
name: broken
profile: {depth_m: 40.0}
faults:
- {kind: leak, at_s: 100.0, rate_kgps: 0.001, limit_kg: 0.05, detected: false}
- {kind: spike, sensor: heading, error: 20.0, share: 0.1, at_depth_m: 10.0, phase: dive, for_s: 60.0}
- {kind: frozen, sensor: depth, at_s: 1000000.0}
"""  # noqa: E501
SILENT = {'kind': 'message', 'topic': 'altitude', 'how': 'drop', 'share': 1.0}


def fly(*words) -> dict:
    """Scorecard of a flight by the direct engine."""
    process = glider('run', *words, '--engine', 'direct', '--json')
    assert process.returncode == 0, process.stderr
    return json.loads(process.stdout)


@pytest.fixture
def written(tmp_path):
    """A scenario with three faults, of which the last does not begin."""
    path = tmp_path / 'broken.yaml'
    path.write_text(SCENARIO)
    return path


def test_a_field_of_a_fault_is_set_by_its_number(written):
    scenario = load_scenario(str(written), {'faults.1.error': 5.0, 'faults.0.limit_kg': 1.0})
    assert (scenario.faults[1].error, scenario.faults[0].limit_kg) == (5.0, 1.0)
    assert scenario.faults[2] == load_scenario(str(written)).faults[2]


def test_a_field_of_a_fault_has_a_unit_in_the_result_of_a_sweep():
    assert unit_of(find_field(Scenario, 'faults.0.rate_kgps')) == 'kg/s'
    assert find_field(Scenario, 'faults.0.colour') is None


def test_faults_survive_being_written(written, tmp_path):
    scenario = load_scenario(str(written))
    again = tmp_path / 'again.yaml'
    again.write_text(scenario.to_yaml())
    assert load_scenario(str(again)) == scenario


@pytest.mark.parametrize(
    ('field', 'value', 'words'),
    [
        ('faults.3.at_s', 1.0, ('faults.3.at_s', '0 to 2')),
        ('faults.x.at_s', 1.0, ('faults.x.at_s', '0 to 2')),
        ('faults.0', {'kind': 'leak'}, ('faults.0', 'field by field')),
        ('faults.0.rate_kgps', -1.0, ('faults.0.rate_kgps = -1.0', '> 0.0')),
        ('faults.0.colour', 'red', ('faults.0.colour', 'unknown field', 'rate_kgps')),
        ('faults.1.sensor', 'sonar', ('faults.1.sensor', 'sonar', 'heading')),
        ('faults', [{'kind': 'melt'}], ('faults.0.kind', 'melt', 'leak')),
        (
            'faults',
            [{'kind': 'stuck', 'actuator': 'steering_surface'}],
            ('faults.0.actuator', 'steering_surface', 'roll_mass'),
        ),
        ('faults.1.sensor', 'fix', ("faults.1.sensor = 'fix'", 'no fix', 'velocity')),
        ('faults', [{'kind': 'gps_silent'}], ("faults.0.kind = 'gps_silent'", 'no fix', 'depth')),
        ('faults', [SILENT], ("faults.0.topic = 'altitude'", 'measured_odom')),
    ],
)
def test_what_cannot_be_is_named(written, field, value, words):
    with pytest.raises(ConfigurationError) as caught:
        load_scenario(str(written), {field: value})
    assert all(word in str(caught.value) for word in words), caught.value
    assert not load_vehicle('zhang2021').steers_by


@pytest.mark.parametrize(
    ('sensor', 'changes'),
    [
        ('position', {}),
        ('velocity', {'sensors.also_fitted': ['altitude']}),
        ('rates', {'sensors.gyro': False}),
    ],
)
def test_a_fault_of_what_a_reckoning_vehicle_does_not_measure_is_refused(sensor, changes):
    faults = {'faults': [{'kind': 'biased', 'sensor': sensor, 'error': 1.0}]}
    with pytest.raises(ConfigurationError, match=f"faults.0.sensor = '{sensor}': .*fix"):
        load_scenario('slocum_shelf', changes | faults)
    load_scenario('slocum_shelf', {'sensors.also_fitted': ['measured_odom']} | faults)


def test_drawn_faults_are_of_what_a_vehicle_has():
    for name in ('current_8deg', 'slocum_shelf'):
        for scenario in make_scenarios(name, {}, ['adaptive'], 40, seed=1, faults=3).values():
            assert len(scenario.faults) == 3
            check_fitted(scenario.faults, '', scenario.topics, scenario.sensors.gyro)


def test_a_run_tells_of_its_faults_and_verify_computes_them_again(written, tmp_path):
    out = tmp_path / 'run'
    flown = fly(str(written), '--duration', '400', '--bag', '--out', out)
    told = flown['faults']
    assert [one['kind'] for one in told] == ['leak', 'spike', 'frozen']
    assert (told[0]['t_s'], told[0]['end_s']) == (100.0, None)
    assert told[1]['end_s'] == pytest.approx(told[1]['t_s'] + 60.0)
    assert told[2]['t_s'] is None
    page = (out / 'report.html').read_text(encoding='utf-8')
    assert 'Broken on purpose: at 100.0 s: leak' in page
    bag = Bag(out)
    recording = Recording(bag, None, lambda share: None)
    verdicts = {
        one.block: one
        for one in verify(recording, read_settings(bag, out, None, tmp_path), [], lambda *_: None)
    }
    assert not verdicts['plant'].differing
    assert verdicts['plant'].ticks == 4000


def test_drawn_faults_are_those_of_their_seed_and_every_kind_is_drawn():
    drawn = [sample_faults(seed, 2, 3600.0) for seed in range(300)]
    assert drawn[7] == sample_faults(7, 2, 3600.0) != drawn[8]
    kinds = {fault.kind for faults in drawn for fault in validated(faults)}
    assert kinds == set(DRAWN)
    assert len(kinds) == 20
    assert all(0.0 <= fault['at_s'] < 3600.0 for faults in drawn for fault in faults)


def test_many_plants_break_each_in_its_own_way():
    changes = {'duration_s': 1000.0}
    broken = make_scenarios('current_8deg', changes, ['pid', 'adaptive'], 3, seed=5, faults=2)
    whole = make_scenarios('current_8deg', changes, ['pid', 'adaptive'], 3, seed=5)
    assert broken[1, 'pid'].faults == broken[1, 'adaptive'].faults != broken[2, 'pid'].faults
    for key, scenario in broken.items():
        assert len(scenario.faults) == 2
        assert scenario.model_copy(update={'faults': []}) == whole[key]


@pytest.mark.parametrize(
    ('status', 'failed', 'diverged', 'expected'),
    [
        ('completed', False, False, 'completed'),
        ('completed', False, True, 'off its path'),
        ('surfaced', False, True, 'surfaced'),
        ('lost', False, True, 'lost'),
        ('surfaced', True, True, 'failed'),
    ],
)
def test_outcome_is_the_worst_that_is_true(status, failed, diverged, expected):
    assert outcome({'status': status}, failed, diverged) == expected
