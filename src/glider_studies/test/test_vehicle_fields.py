# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""Fields of a vehicle by ``--set``: what flies, what is kept of it, and what is refused."""

import json
import shlex
from functools import partial

import pytest
import xarray
import yaml

import command_line
from glider_base.settings import ConfigurationError
from glider_bringup.scoring.card import fly_scored
from glider_mission.changes import parse_assignment
from glider_mission.recording.mcap_reader import Bag
from glider_mission.scenario import load_scenario
from glider_model.plant.trim import solve_trim
from glider_model.vehicle.file import load_vehicle, vehicle_path
from glider_studies.montecarlo import make_scenarios
from glider_studies.sweep.plan import load_sweep

FIELD, DRAG = 'vehicle.hydrodynamics.K_D0', 'vehicle.hydrodynamics.K_D0=8.0'
SHORT = ('--duration', '60', '--no-report', '--json')


glider = partial(command_line.glider, columns=120)


def result(*arguments):
    """What a command that succeeds prints as JSON."""
    process = glider(*arguments)
    assert process.returncode == 0, process.stderr
    return json.loads(process.stdout)


@pytest.fixture(scope='module')
def flown(tmp_path_factory):
    """Scorecard and folder of a flight over topics with a vehicle that was changed."""
    folder = tmp_path_factory.mktemp('flown') / 'run'
    sets = ('--set', DRAG, '--set', 'vehicle=seawing')
    return result('run', 'current_8deg', *sets, *SHORT, '--out', folder), folder


def fly(changes):
    """Final state of a minute with the direct engine, in this process."""
    scenario = load_scenario('current_8deg', {**changes, 'dives': 0, 'duration_s': 60.0})
    _, scores = fly_scored(scenario)
    return scores['final_state']


def test_folder_has_the_vehicle_as_flown(flown):
    card, folder = flown
    assert card['vehicle'] == 'seawing'
    values, before = (
        yaml.safe_load(path.read_text(encoding='utf-8'))
        for path in (folder / 'vehicle.yaml', vehicle_path('seawing'))
    )
    changed = values['hydrodynamics'].pop('K_D0')
    assert before['hydrodynamics'].pop('K_D0')['value'] == 7.19
    assert changed == {'value': 8.0, 'unit': 'kg/m', 'source': '--set, instead of 7.19'}
    assert values == before
    parameters = yaml.safe_load((folder / 'parameters.yaml').read_text(encoding='utf-8'))
    told = {
        node['ros__parameters']['vehicle']
        for node in parameters.values()
        if 'vehicle' in node['ros__parameters']
    }
    assert told == {str(folder / 'vehicle.yaml')}
    assert Bag(folder).attachments['vehicle.yaml'] == (folder / 'vehicle.yaml').read_bytes()


def test_recording_of_a_changed_vehicle_verifies(flown):
    report = result('verify', flown[1], '--json')
    assert report['identical']
    assert [block['result'] for block in report['blocks']] == ['identical'] * 6


def test_report_tells_what_is_not_as_in_the_file_of_the_vehicle(flown, tmp_path):
    process = glider('report', flown[1], '--out', tmp_path / 'report.html')
    assert process.returncode == 0, process.stderr
    page = (tmp_path / 'report.html').read_text(encoding='utf-8')
    assert 'vehicle: seawing\nvehicle.hydrodynamics.K_D0: 8.0\n' in page


def test_folder_flies_again_and_a_file_with_the_same_number_flies_alike(flown, tmp_path):
    """By the other engine, in the other order of options, and from an edited file."""
    (tmp_path / 'mine.yaml').write_text(
        vehicle_path('seawing').read_text(encoding='utf-8').replace('value: 7.19', 'value: 8.0'),
        encoding='utf-8',
    )
    direct = ('--engine', 'direct', *SHORT, '--out')
    again = result('run', flown[1] / 'scenario.yaml', *direct, tmp_path / 'again')
    kept = [(folder / 'vehicle.yaml').read_bytes() for folder in (flown[1], tmp_path / 'again')]
    assert kept[0] == kept[1]
    last = flown[0]['final_state']
    assert again['final_state'] == last
    assert fly({'vehicle': 'seawing', FIELD: 8.0}) == last
    assert fly({'vehicle': str(tmp_path / 'mine.yaml')}) == last
    assert fly({'vehicle': 'seawing'}) != last


@pytest.mark.parametrize(
    ('changes', 'words'),
    [
        ({'hydrodynamics.K_D9': 8.0}, ['hydrodynamics.K_D9', 'unknown field', 'K_D0, K_D, K_L0']),
        ({'hydrodynamics.K_D0': -1.0}, ['hydrodynamics.K_D0.value = -1.0', '>= 0']),
        ({'hydrodynamics.K_D0': 'much'}, ['hydrodynamics.K_D0.value', 'much', 'number']),
        ({'hydrodynamics.K_D0': True}, ['hydrodynamics.K_D0.value', 'True', 'number']),
        ({'hydrodynamics.K_D0.unit': 'kg'}, ['hydrodynamics.K_D0.unit', 'kg', 'kg/m']),
        ({'hull': 3.0}, ['hull = 3.0', 'allowed fields: length, diameter']),
        ({'rigid_body.hull_center_of_mass': [0.0, 1.0]}, ['hull_center_of_mass.value', '3 items']),
        ({'added_mass.sway_yaw': 99999.0}, ['mass matrix is not positive definite']),
        ({'mass.of.all': 1.0}, ['mass', 'unknown field', 'rigid_body']),
    ],
    ids=str,
)
def test_field_is_checked_like_the_file(changes, words):
    changes = {f'vehicle.{field}': value for field, value in changes.items()}
    with pytest.raises(ConfigurationError) as raised:
        load_scenario('current_8deg', changes)
    (field, _), *_ = changes.items()
    told = f'{vehicle_path("zhang2021")} with {field}='
    for word in (told, *words):
        assert word in str(raised.value)


def test_name_of_a_changed_vehicle_cannot_be_typed(tmp_path):
    """One way to change a vehicle: its fields, which are told in every message."""
    with pytest.raises(ConfigurationError, match='control character'):
        parse_assignment(r'vehicle="seawing\0{}"')
    (tmp_path / 'mine.yaml').write_text(r'vehicle: "seawing\0{}"', encoding='utf-8')
    with pytest.raises(ConfigurationError, match='control character'):
        load_scenario(str(tmp_path / 'mine.yaml'))


def test_field_inside_a_text_is_refused():
    with pytest.raises(ConfigurationError, match='name is not a group of fields'):
        load_scenario('current_8deg', {'vehicle.name.first': 'x'})


def test_mistake_is_one_message_and_nothing_is_written(tmp_path):
    process = glider('run', '--set', f'{FIELD}=-1', '--out', tmp_path / 'out')
    assert process.returncode == 2
    assert process.stdout == ''
    assert process.stderr.splitlines() == [
        f'{vehicle_path("zhang2021")} with {FIELD}=-1: hydrodynamics.K_D0.value = -1: '
        'should be greater than or equal to 0 (allowed: >= 0.0 and <= 100000.0)'
    ]
    assert not (tmp_path / 'out').exists()


def test_depth_is_held_against_the_rating_that_was_set(tmp_path):
    with pytest.raises(ConfigurationError, match='allowed: <= 500 m'):
        load_scenario('current_8deg', {'vehicle.rated_depth': 500.0})
    values = yaml.safe_load(vehicle_path('zhang2021').read_text(encoding='utf-8'))
    del values['rated_depth'], values['crush_depth']
    (tmp_path / 'old.yaml').write_text(yaml.safe_dump(values), encoding='utf-8')
    changes = {'vehicle': str(tmp_path / 'old.yaml'), 'vehicle.rated_depth': 1500.0}
    vehicle = load_vehicle(load_scenario('current_8deg', changes).vehicle)
    assert vehicle.rated_depth_m == 1500.0
    assert vehicle.rated_depth.unit == 'm'


def test_vector_and_source_can_be_set():
    changes = {
        'vehicle.hydrodynamics.linear_damping': [0.1, 0.2, 0.3],
        'vehicle.hull.diameter.value': 0.23,
        'vehicle.hull.length.source': 'tape measure',
        'vehicle.hull.length': 2.5,
    }
    vehicle = load_vehicle(load_scenario('current_8deg', changes).vehicle)
    assert vehicle.params().D_w == 0.3
    assert (vehicle.hull.length.value, vehicle.hull.length.source) == (2.5, 'tape measure')
    assert vehicle.changed() == {
        'hull.diameter': 0.23,
        'hydrodynamics.linear_damping': [0.1, 0.2, 0.3],
    }
    diameter = vehicle.hull.diameter
    assert (diameter.value, diameter.source) == (0.23, '--set, instead of 0.22')


def test_plants_are_drawn_around_the_changed_vehicle_and_fly_again(tmp_path):
    options = ('current_8deg', '--plants', 1, '--controller', 'pid', '--duration', 60)
    result('montecarlo', *options, '--set', DRAG, '--workers', 1, '--json', '--out', tmp_path)
    study = json.loads((tmp_path / 'montecarlo.json').read_text(encoding='utf-8'))
    (plant,) = study['flown']
    words = shlex.split(plant['commands']['pid'])
    assert words[:2] == ['./glider', 'run']
    assert DRAG in words
    card = result(*words[1:], '--json', '--no-report', '--out', tmp_path / 'again')
    assert card['cross_track_m']['max_all'] == plant['flights']['pid']['max_all_m']
    vehicle = load_vehicle(str(tmp_path / 'again' / 'vehicle.yaml')).params()
    assert vehicle.K_D0 == 8.0
    (scenario,) = make_scenarios('current_8deg', {FIELD: 8.0}, ['pid'], 1, 0).values()
    flown = scenario.plant_settings().params().vehicle.K_D0
    assert flown == pytest.approx(8.0 * plant['perturb']['K_D0'])


SWEEP = {
    'scenario': 'current_8deg',
    'set': {'dives': 0, 'duration_s': 60.0, 'vehicle': 'seawing', 'control.law': 'adaptive'},
    'dimensions': {'drag': {'kind': 'values', 'field': FIELD, 'values': [7.0, 8.0]}},
}


def test_sweep_goes_through_a_field_of_the_vehicle(flown, tmp_path):
    """A cell is the run of its command; ``--set`` goes before what the file sets."""
    file, out = tmp_path / 'drag.yaml', tmp_path / 'out'
    file.write_text(yaml.safe_dump(SWEEP), encoding='utf-8')
    sets = ('--set', 'control.law=pid', '--set', 'vehicle.hull.length=2.1')
    summary = result('sweep', file, *sets, '--workers', 1, '--out', out, '--json')
    assert summary['completed'] == 2
    changes = {'control.law': 'pid', 'vehicle.hull.length': 2.1}
    command = shlex.split(load_sweep(str(file), changes).command(1))
    assert DRAG in command and 'vehicle="seawing"' in command
    card = result(*command[1:], '--json', '--no-report', '--out', tmp_path / 'run')
    assert card['controller'] == 'pid'
    with xarray.load_dataset(out / 'sweep.nc') as data:
        assert data['drag'].attrs['units'] == 'kg/m'
        assert data['drag'].attrs['scenario_field'] == FIELD
        north = data['final_state_position_ned_m'].sel(drag=8.0, ned='north')
        assert float(north) == card['final_state']['position_ned_m'][0]
        other = data['final_state_position_ned_m'].sel(drag=7.0, ned='north')
        assert float(other) != float(north)
        vehicle = yaml.safe_load(data.attrs['vehicle_yaml'])
        assert vehicle['hydrodynamics']['K_D0']['value'] == 7.0, 'that of the first cell'
        assert vehicle['hull']['length']['value'] == 2.1
        assert json.loads(data.attrs['set']) == changes


def test_sweep_sets_a_field_of_the_vehicle_in_one_place(tmp_path):
    file = tmp_path / 'drag.yaml'
    file.write_text(yaml.safe_dump(SWEEP), encoding='utf-8')
    with pytest.raises(ConfigurationError, match=r'K_D0 is set by --set too'):
        load_sweep(str(file), {FIELD: 1.0})
    digests = {load_sweep(str(file), changes).digest for changes in ({}, {'dives': 1})}
    assert len(digests) == 2, 'a journal of the one is none of the other'
    file.write_text(yaml.safe_dump({**SWEEP, 'set': {f'{FIELD}.value': 1.0}}), encoding='utf-8')
    with pytest.raises(ConfigurationError, match='is set by set too'):
        load_sweep(str(file))


def test_trim_of_a_changed_vehicle():
    options = ('trim', 'zhang2021', '--net-heaviness-kg', 0.4, '--pitch-deg', -30)
    after = result(*options, '--set', 'vehicle.hydrodynamics.K_D0=20', '--json')
    vehicle = load_vehicle('zhang2021').params()
    assert after['speed_mps'] < solve_trim(vehicle, 0.4, pitch_deg=-30.0).speed_mps
    slow = solve_trim(vehicle._replace(K_D0=20.0), 0.4, pitch_deg=-30.0)
    assert after['speed_mps'] == slow.speed_mps
    process = glider(*options, '--set', 'current.speed_kn=1')
    assert process.returncode == 2
    assert 'current.speed_kn: not a field of a vehicle' in process.stderr
