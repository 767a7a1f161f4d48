# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""A vehicle with a tail fin holds a path in a current, and what is recorded of it says so."""

import numpy as np
import pytest
import yaml

from glider_bringup import load_scenario
from glider_bringup.blocks import COLUMNS
from glider_bringup.door.run import fly, open_run
from glider_bringup.engines.recorded import fly_recorded
from glider_bringup.mission.run_folder import make_run_folder
from glider_bringup.scoring.card import fly_scored
from glider_bringup.scoring.one_hertz import Recorder
from glider_model.base.signals import Joints

FIN = {'range': 26.0, 'rate': 1.2, 'area': 0.05, 'lift_slope': 3.0, 'x': -1.2, 'turn_rate': 0.5}
FIELDS = {f'vehicle.fin.{name}': value for name, value in FIN.items()} | {'dives': 0}


@pytest.mark.parametrize('law', ['adaptive', 'pid'])
@pytest.mark.parametrize('real', [1.0, 0.4], ids=['as in its file', 'a fin of less than half'])
def test_both_laws_hold_a_straight_path_in_a_current(law, real):
    """Cross-track error of a metre or two in the steady glide, with the vehicle level."""
    fin = {'vehicle.fin.area': 0.05 * real}
    fields = {**FIELDS, **fin, 'control.law': law, 'duration_s': 15000.0}
    recorder = Recorder()
    flight, scores = fly_scored(load_scenario('current_8deg', fields), [recorder])
    assert flight.status == 'completed'
    assert scores['cross_track_m']['max_steady'] < 2.0
    assert scores['cross_track_m']['max_all'] < 6.0
    assert scores['guard']['events'] == []
    record = recorder.result()
    assert np.abs(record.roll[1800:]).max() < 0.5
    angle = record.joints[:, Joints._fields.index('delta')]
    assert 0.05 < np.abs(angle).max() <= np.radians(26.0)
    assert scores['actuator_travel']['roll_mass_deg'] < scores['actuator_travel']['fin_deg']


def test_a_run_is_read_back_as_it_was_flown(tmp_path):
    """Bag, dataset and scenario know the fin by its name; those of others do not."""
    fields = {**FIELDS, 'duration_s': 60.0, 'profile.prepare_s': 0.0, 'initial.heading_deg': 20.0}
    scenario = load_scenario('current_8deg', fields)
    folder = make_run_folder(scenario, tmp_path / 'run')
    fly_recorded(scenario, folder)
    flown, read = fly(scenario).to_xarray(), open_run(folder).to_xarray()
    for name in ('joint_states_fin', 'command_fin', 'joint_states_roll_mass'):
        np.testing.assert_array_equal(read[name], flown[name])
    assert np.abs(read['command_fin']).max() > 0.05
    assert yaml.safe_load((folder / 'scenario.yaml').read_text())['control']['fin']
    others = fly('current_8deg', duration=1.0)
    assert 'command_fin' not in others.to_xarray()
    assert 'fin_deg' not in others.score['actuator_travel']
    assert 'fin' not in yaml.safe_load(others.scenario.to_yaml())['control']


def test_a_vehicle_without_a_fin_has_zero_beside_its_joints():
    """The fourth column of a log row."""
    run = fly('current_8deg', duration=1.0)
    rows = run._rows()[:, COLUMNS['command']]
    assert rows.shape[1] == len(Joints._fields)
    assert rows[:, 3].tobytes() == np.zeros(len(rows)).tobytes()
