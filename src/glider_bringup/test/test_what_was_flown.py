# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""What was flown is told as it was flown: what was changed in a scenario, and no other one."""

import json
import shutil
from functools import partial

import numpy as np
import pytest

import command_line
from glider_base.settings import ConfigurationError
from glider_bringup.door.run import fly, open_run
from glider_guidance.settings import OLD_NAMES
from glider_mission.scenario import load_scenario

CHANGED = {'current.speed_kn': 0.6, 'profile.depth_m': 300}
SHORT = ('--engine', 'direct', '--duration', '30')
TOLD = 'with current.speed_kn=0.6, profile.depth_m=300'


glider = partial(command_line.glider, columns=200)


def refused(*arguments):
    process = glider(*arguments)
    assert process.returncode == 2, process.stderr
    assert 'Traceback' not in process.stderr
    return process.stderr


@pytest.fixture(scope='module')
def changed(tmp_path_factory):
    """Process and folder of a flight with two fields changed, and its bag."""
    folder = tmp_path_factory.mktemp('changed') / 'flight'
    sets = [word for field, value in CHANGED.items() for word in ('--set', f'{field}={value}')]
    return glider('run', *SHORT, *sets, '--bag', '--out', folder), folder


def test_what_was_changed_stands_in_every_title(changed, tmp_path):
    process, folder = changed
    assert process.returncode == 0, process.stderr
    assert TOLD in process.stdout
    assert f'but {TOLD}' in process.stderr.replace('\n', ' ')
    page = (folder / 'report.html').read_text(encoding='utf-8')
    assert TOLD in page.partition('<title>')[2].partition('</title>')[0]
    assert f'but {TOLD}' in page.partition('<h1>')[2].partition('</h1>')[0]
    assert TOLD in glider('score', folder).stdout
    assert glider('figure', folder, '--out', tmp_path / 'run.svg').returncode == 0
    assert open_run(folder).to_xarray().attrs['title'].partition('but ')[2].startswith(TOLD)


def test_comparison_says_what_was_changed_in_each(changed, tmp_path):
    other = tmp_path / 'other'
    assert glider('run', *SHORT, '--out', other).returncode == 0
    out = glider('compare', changed[1], other).stdout
    (line,) = [line for line in out.splitlines() if line.startswith('│ changed')]
    assert 'current.speed_kn=0.6' in line


def test_it_is_known_from_the_bag_alone_and_adds_up(changed):
    (bag,) = changed[1].glob('*.mcap')
    assert open_run(bag).score['changed'] == open_run(changed[1]).score['changed']
    again = load_scenario(str(changed[1] / 'scenario.yaml'), {'seed': 3, 'profile.depth_m': 200})
    assert again.changed['current.speed_kn'] == '0.6'
    assert (again.changed['profile.depth_m'], again.changed['seed']) == ('200', '3')


def test_nothing_is_told_where_nothing_was_changed():
    scenario = load_scenario('survey')
    assert scenario.described == scenario.description
    assert 'changed' not in scenario.to_yaml()
    same = load_scenario('survey', {'dives': scenario.dives, 'seed': scenario.seed})
    assert same.described == scenario.description


def test_points_may_be_an_array():
    points = np.array([[0.0, 0.0, 0.0], [500.0, 0.0, 0.0]])
    assert 'path.waypoints' in load_scenario('survey', {'path.waypoints': points}).changed


def test_numbers_of_numpy_are_told_as_others_are():
    runs = [
        fly(
            'current_8deg',
            {
                'current.speed_kn': number(0.5),
                'profile': {'depth_m': number(100.0)},
                'vehicle.hydrodynamics.K_D0': number(8.0),
            },
            seed=whole(3),
            duration=0.1,
        )
        for number, whole in ((float, int), (np.float32, np.int64))
    ]
    assert runs[0].scenario == runs[1].scenario
    assert runs[0].score['changed'] == runs[1].score['changed']


@pytest.mark.parametrize('scenario', ['survey', load_scenario('survey')])
def test_a_field_without_a_name_is_refused(scenario):
    with pytest.raises(ConfigurationError, match=r'--set 3: no name \(allowed: .*dotted name'):
        fly(scenario, {3: 1})


def test_python_tells_it_too():
    run = fly('current_8deg', {'current.speed_kn': 0.6}, duration=1.0)
    assert run.score['changed']['current.speed_kn'] == '0.6'


def test_a_run_whose_vehicle_was_changed_is_flown_on_with_it(tmp_path):
    fields = {'vehicle.hydrodynamics.K_D0': 8.0, 'seed': 3}
    run = fly('current_8deg', {**fields, 'vehicle.moving_mass.rate': 0.01}, duration=5.0)
    again = fly(run.scenario, {'vehicle.moving_mass.rate': 0.02})
    other = fly('current_8deg', {**fields, 'vehicle.moving_mass.rate': 0.02}, duration=5.0)
    assert again.scenario == other.scenario
    assert again.to_xarray().equals(other.to_xarray())
    page = again.report(tmp_path / 'report.html').read_text(encoding='utf-8')
    assert 'vehicle: vehicle.yaml' in page
    assert 'zhang2021\\0' not in page


def test_waypoints_in_degrees_say_anew_where_it_starts():
    """A scenario that was loaded and then changed is the one that is loaded with all of it."""
    places, moved = [[36.0, 122.0], [36.1, 122.1]], [[36.5, 122.5], [36.6, 122.6]]
    path = {'kind': 'waypoints', 'waypoints_latlon': places}
    ordered = {'path': path, 'orders': [{'at_s': 60.0, 'path': path}]}
    for before, fields in (
        ({'path': path}, {'path.waypoints_latlon': moved}),
        ({'path': path}, {'path': {**path, 'waypoints_latlon': moved}}),
        ({}, {'path': path}),
        (ordered, {'origin.latitude_deg': 36.02}),
        ({'path': path, 'origin.latitude_deg': 36.02}, {'path.waypoints_latlon': places[::-1]}),
        ({'path': path, 'initial.north_m': 50.0}, {'path.waypoints_latlon': moved}),
    ):
        flown = fly(load_scenario('current_8deg', before), fields, duration=0.1)
        at_once = fly('current_8deg', {**before, **fields}, duration=0.1)
        assert flown.scenario == at_once.scenario
        assert flown.to_xarray().equals(at_once.to_xarray())


@pytest.mark.parametrize('command', ['score', 'report'])
@pytest.mark.parametrize('name', ['scenario.yaml', 'vehicle.yaml'])
def test_a_scenario_that_was_exchanged_is_refused(changed, tmp_path, command, name):
    """Name, vehicle and rules of another flight are not put beside the numbers of this one."""
    folder = tmp_path / 'flight'
    shutil.copytree(changed[1], folder)
    other = fly('slocum_shelf', duration=1.0, out=tmp_path / 'other').folder
    shutil.copy(other / name, folder / name)
    message = refused(command, folder)
    assert name in message
    assert 'flown' in message


def test_so_it_is_in_a_run_without_a_bag(tmp_path):
    folder = fly('current_8deg', duration=1.0, out=tmp_path / 'flight').folder
    other = fly('slocum_shelf', duration=1.0, out=tmp_path / 'other').folder
    for name in ('scenario.yaml', 'vehicle.yaml'):
        shutil.copy(other / name, folder / name)
    assert 'not what was flown' in refused('report', folder)
    assert json.loads(glider('score', folder, '--json').stdout)['scenario'] == 'current_8deg'


@pytest.mark.parametrize('new', ['los_current', 'los_zhang2021'])
def test_a_run_of_before_guidance_had_its_names_is_reported(tmp_path, new):
    (old,) = (name for name, now in OLD_NAMES.items() if now == new)
    fields = {'guidance.los.method': new}
    folder = fly('current_8deg', fields, duration=1.0, out=tmp_path / 'flight').folder
    for name in ('scenario.yaml', 'score.json'):
        text = (folder / name).read_text()
        assert new in text
        (folder / name).write_text(text.replace(new, old))
    assert glider('report', folder).returncode == 0
    (folder / 'score.json').write_text((folder / 'score.json').read_text().replace(old, 'alos'))
    assert 'not what was flown' in refused('report', folder)


@pytest.mark.parametrize(
    ('changes', 'words'),
    [
        ({'profile.depth_m': 50, 'profile.top_depth_m': 50}, 'not above the lower turn'),
        ({'profile.depth_m': 50, 'profile.top_depth_m': 80}, 'not above the lower turn'),
        ({'profile.net_heaviness_kg': 1.01}, 'more than the pump of the vehicle makes'),
        ({'profile.climb_net_heaviness_kg': 1.01}, 'more than the pump of the vehicle makes'),
        ({'initial.net_heaviness_kg': 1.01}, r'net_heaviness_kg = 1.01: .*allowed: -1 to 1 kg'),
        ({'initial.net_heaviness_kg': -1.01}, r'net_heaviness_kg = -1.01: .*allowed: -1 to 1 kg'),
        ({'water': {'profile': [[0, 1025.0], [50, 1024.9], [90, 1026.0]]}}, 'turns over'),
        ({'seed': True}, 'no number'),
        ({'current.speed_kn': True}, 'no number'),
        ({'settle_s': False}, 'no number'),
    ],
)
def test_what_cannot_be_flown_is_refused(changes, words):
    with pytest.raises(ConfigurationError, match=words):
        load_scenario('current_8deg', changes)


def test_what_can_be_flown_is_not_refused():
    """Up to the limits; a cast may be unstable by what instruments err, and true is no number."""
    water = {'profile': [[0, 1025.0], [50, 1024.98], [90, 1026.0]]}
    limits = {'profile.net_heaviness_kg': 1.0, 'profile.top_depth_m': 49.9}
    load_scenario('current_8deg', {'profile.depth_m': 50, 'water': water, **limits})
    assert load_scenario('current_8deg', {'sensors.gyro': False}).sensors.gyro is False
