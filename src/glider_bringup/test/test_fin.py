# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""A vehicle with a tail fin holds a path in a current, and what is recorded of it says so."""

import numpy as np
import pytest
import yaml

from glider_base.signals import Joints
from glider_bringup import load_scenario
from glider_bringup.door.run import fly, open_run
from glider_bringup.engines.recorded import fly_recorded
from glider_bringup.scoring.card import fly_scored
from glider_bringup.scoring.one_hertz import SECOND, Record, Rows
from glider_bringup.showing.compare import score_rows
from glider_mission.blocks import COLUMNS
from glider_mission.run_folder import make_run_folder

FIN = {'range': 26.0, 'rate': 1.2, 'area': 0.05, 'lift_slope': 3.0, 'x': -1.2, 'turn_rate': 0.5}
FIELDS = {f'vehicle.fin.{name}': value for name, value in FIN.items()} | {'dives': 0}


@pytest.mark.parametrize('law', ['adaptive', 'pid'])
@pytest.mark.parametrize('real', [1.0, 0.4], ids=['as in its file', 'a fin of less than half'])
def test_both_laws_hold_a_straight_path_in_a_current(law, real):
    """Cross-track error of a metre or two in the steady glide, with the vehicle level."""
    fin = {'vehicle.fin.area': 0.05 * real}
    fields = {**FIELDS, **fin, 'control.law': law, 'duration_s': 15000.0}
    recorder = Rows(SECOND)
    flight, scores = fly_scored(load_scenario('current_8deg', fields), [recorder])
    assert flight.status == 'completed'
    assert scores['cross_track_m']['max_steady'] < 2.0
    assert scores['cross_track_m']['max_all'] < 6.0
    assert scores['guard']['events'] == []
    record = Record(recorder.result())
    assert np.abs(record.roll[1800:]).max() < 0.5
    angle = record.joints[:, Joints._fields.index('delta')]
    assert 0.05 < np.abs(angle).max() <= np.radians(26.0)
    assert scores['actuator_travel']['roll_mass_deg'] < scores['actuator_travel']['fin_deg']


#: Its place is known throughout, and what it measures is so.
KNOWN = {'navigation.method': 'known', 'profile.surface_every_dives': 0, 'sensors': {}}


def shelf(law, share, **changes):
    """A Slocum whose fin has a share of its area, on the shelf in half a knot."""
    fields = {'dives': 0, 'duration_s': 9000.0, 'settle_s': 1800.0, 'control.law': law}
    fields |= {'vehicle.fin.area': 0.02 * share, **KNOWN} | changes
    run = fly(load_scenario('slocum_shelf', fields))
    assert run.score['status'] == 'completed'
    rate = run.to_xarray()['adaptation_steering_dive'].to_numpy()
    return run.score, rate / (0.5 * 0.5**2)


#: Turn rate of a Slocum's fin over that of its file, by its share of the area there:
#: `./glider trim slocum_g2 --fin-deg 3 --set vehicle.fin.area=...` at 0.205 kg and -25 deg.
REAL = {0.4: 0.486, 2.5: 1.62}


@pytest.mark.parametrize('law', ['adaptive', 'pid'])
def test_how_well_the_fin_turns_is_learnt_by_either_law(law):
    """A weak fin then errs less than one that is taken for that of its file, a strong one is
    moved less; both hold the path.
    """
    fixed = {'control.fin.share_std': 0.0}
    (weak, share), (weak_fixed, _) = shelf(law, 0.4), shelf(law, 0.4, **fixed)
    assert share[-1] == pytest.approx(REAL[0.4], rel=0.15)
    error, error_fixed = (one['cross_track_m'] for one in (weak, weak_fixed))
    assert error['rms_steady'] < 0.9 * error_fixed['rms_steady']
    (strong, share), (strong_fixed, _) = shelf(law, 2.5), shelf(law, 2.5, **fixed)
    assert share[-1] == pytest.approx(REAL[2.5], rel=0.15)
    way, way_fixed = (one['actuator_travel']['fin_deg'] for one in (strong, strong_fixed))
    assert way < 0.95 * way_fixed
    for scores in (weak, strong):
        assert scores['cross_track_m']['max_steady'] < 1.0
        assert scores['guard']['events'] == []


@pytest.mark.parametrize(
    ('broken', 'rel'),
    [
        ({'kind': 'gust', 'east_mps': 0.8, 'for_s': 600.0}, 0.3),
        ({'kind': 'stuck', 'actuator': 'steering_surface', 'for_s': 1500.0}, 0.4),
    ],
    ids=['a gust', 'a fin stuck for a while'],
)
def test_what_breaks_teaches_no_nonsense(broken, rel):
    scores, share = shelf('adaptive', 1.0, faults=[{**broken, 'at_s': 3000.0}])
    assert share[-1] == pytest.approx(1.0, rel=rel)
    assert 0.5 < share.min() < share.max() < 2.0


def test_a_run_is_read_back_as_it_was_flown(tmp_path):
    """Bag, dataset and scenario know the fin by its name; those of others do not."""
    fields = {**FIELDS, 'duration_s': 60.0, 'profile.prepare_s': 0.0, 'initial.heading_deg': 20.0}
    scenario = load_scenario('current_8deg', fields)
    folder = make_run_folder(scenario, tmp_path / 'run')
    fly_recorded(scenario, folder)
    run = fly(scenario)
    flown, read = run.to_xarray(), open_run(folder).to_xarray()
    for name in ('joint_states_fin', 'command_fin', 'joint_states_roll_mass'):
        np.testing.assert_array_equal(read[name], flown[name])
    assert np.abs(read['command_fin']).max() > 0.05
    assert yaml.safe_load((folder / 'scenario.yaml').read_text())['control']['fin']
    others = fly('current_8deg', duration=1.0)
    assert 'command_fin' not in others.to_xarray()
    assert 'fin_deg' not in others.score['actuator_travel']
    way = f'{run.score["actuator_travel"]["fin_deg"]:,.0f} deg'
    compared = dict(score_rows([run.score, others.score]))['fin travel']
    assert [cell.text for cell in compared] == [way, '-']
    assert 'fin' not in yaml.safe_load(others.scenario.to_yaml())['control']


def test_a_vehicle_without_a_fin_has_zero_beside_its_joints():
    """The fourth column of a log row."""
    run = fly('current_8deg', duration=1.0)
    rows = run._rows()[:, COLUMNS['command']]
    assert rows.shape[1] == len(Joints._fields)
    assert rows[:, 3].tobytes() == np.zeros(len(rows)).tobytes()
