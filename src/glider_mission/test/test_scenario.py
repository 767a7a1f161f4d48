# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""Scenarios: files that load, files that do not, and what is said about them."""

import math

import pytest
import yaml
from hypothesis import given, settings
from hypothesis import strategies as st

from glider_base.settings import ConfigurationError
from glider_guidance.settings import OLD_NAMES
from glider_mission.changes import parse_assignment
from glider_mission.scenario import (
    DEFAULT_SCENARIO,
    Scenario,
    load_scenario,
    scenario_names,
    scenario_path,
)
from glider_model.ocean.fields.jet import JetSettings
from glider_model.onboard.gate import GateSettings
from glider_model.vehicle.file import vehicle_path

quick = settings(max_examples=30)
every_scenario = pytest.mark.parametrize('name', scenario_names())

#: A file that uses most of what there is.
FULL = {
    'name': 'full',
    'description': 'ünïcode: with a colon, # a hash and [brackets]',
    'vehicle': 'seawing',
    'seed': 2**63 - 1,
    'dives': 3,
    'settle_s': 0.0,
    'path': {'kind': 'spline', 'waypoints': [[0, 0], [500.5, 1e-3], [900, 700]]},
    'profile': {'depth_m': 120.0, 'pitch_deg': 35.0, 'net_heaviness_kg': 0.3},
    'water': {'pycnocline_rise': 0.002, 'pycnocline_depth_m': 50.0},
    'current': {
        'speed_kn': 0.5,
        'angle_deg': -30.0,
        'components': [
            {'kind': 'shear', 'speed_mps': 0.1, 'angle_deg': 10.0, 'depth_m': 300.0},
            {'kind': 'tidal', 'speed_mps': 0.05, 'direction_deg': 75.0},
            {'kind': 'table', 'rows': [[0, 0.1, 0.2], [50, 1e-5, -0.1]]},
            {'kind': 'gauss_markov', 'std_mps': 0.02, 'time_constant_s': 900.0},
        ],
    },
    'guidance': {'los': {'method': 'los_zhang2021', 'delta1_m': 5.0}},
    'control': {'law': 'pid', 'pid': {'pitch_kp': 6.0}},
}


def write(folder, values, name='mission.yaml'):
    """Write a scenario file; its path as text."""
    path = folder / name
    text = values if isinstance(values, str) else yaml.safe_dump(values, allow_unicode=True)
    path.write_text(text, encoding='utf-8')
    return str(path)


def refusal(*arguments):
    """The one message about what cannot be used."""
    with pytest.raises(ConfigurationError) as caught:
        load_scenario(*arguments)
    return str(caught.value)


@every_scenario
def test_shipped_scenario_loads_under_its_own_name(name):
    scenario = load_scenario(name)
    assert scenario.name == name
    assert scenario.description


@every_scenario
def test_shipped_scenario_makes_parameters_of_all_blocks(name):
    scenario = load_scenario(name)
    for block in scenario.block_settings():
        assert block.params() is not None
        assert block.initial_state() is not None


def test_default_scenario_is_one_of_those_shipped():
    assert DEFAULT_SCENARIO in scenario_names()


@every_scenario
def test_shipped_scenario_survives_being_written(name, tmp_path):
    scenario = load_scenario(name)
    assert load_scenario(write(tmp_path, scenario.to_yaml())) == scenario


def test_full_scenario_survives_being_written(tmp_path):
    scenario = load_scenario(write(tmp_path, FULL))
    assert load_scenario(write(tmp_path, scenario.to_yaml(), 'again.yaml')) == scenario


@quick
@given(
    st.floats(10.0, 1000.0, exclude_min=True),
    st.floats(1e-9, 1.0, exclude_min=True),
    st.floats(-360.0, 360.0),
    st.integers(0, 2**63 - 1),
)
def test_numbers_survive_being_written_to_the_last_bit(depth_m, net, angle_deg, seed):
    scenario = load_scenario(
        'current_8deg',
        {
            'profile.depth_m': depth_m,
            'profile.net_heaviness_kg': net,
            'current.angle_deg': angle_deg,
            'seed': seed,
        },
    )
    again = Scenario.model_validate(yaml.safe_load(scenario.to_yaml()))
    assert again == scenario


@pytest.mark.parametrize(
    ('file', 'name'),
    [
        ('my_mission.yaml', 'my_mission'),
        ('Süd, Teil 2.yaml', 'S_d__Teil_2'),
        ('-x.yaml', '_x'),
        (120 * 'x' + '.yaml', 100 * 'x'),
    ],
)
def test_name_of_a_file_is_that_of_its_scenario_unless_it_says_otherwise(file, name, tmp_path):
    assert load_scenario(write(tmp_path, {'dives': 2}, file)).name == name


UNKNOWN = [
    ({'profil': {}}, None, ['profil', 'unknown field', 'profile']),
    ({'profile': {'depht_m': 5.0}}, None, ['profile.depht_m = 5.0', 'unknown field', 'depth_m']),
    ({'profile': {'depth_m': math.nan}}, None, ['profile.depth_m = nan', 'finite', '10', '12000']),
    ({'name': 'a b'}, None, ["name = 'a b' (allowed: letters, digits, _ . and -;"]),
    ({'seed': -1}, None, ['seed = -1', '>= 0']),
    ({'settle_s': -5.0}, None, ['settle_s = -5.0', '>= 0']),
    ({'profile': {'net_heaviness_kg': -0.4}}, None, ['profile.net_heaviness_kg = -0.4', '> 0']),
    ({'profile': {'pitch_deg': 89}}, None, ['profile.pitch_deg = 89', '>= 8', '<= 60']),
    ({'profile': 5}, None, ['profile = 5', 'depth_m']),
    ({'control': {'law': 'magic'}}, None, ["control.law = 'magic'", "'pid'"]),
    ({'path': {'kind': 'loop'}}, None, ["path.kind = 'loop'", "'helix'"]),
    ({'path': {'length_m': 5.0}}, None, ['path.kind', 'missing']),
    ({'path': {'kind': 'straight'}}, None, ['path.length_m', 'missing']),
    (
        {'path': {'kind': 'waypoints', 'waypoints': [[0, 0]]}},
        None,
        ['path.waypoints', '2'],
    ),
    (
        {'current': {'components': [{'kind': 'tidal', 'speed_mps': 9.0, 'direction_deg': 0.0}]}},
        None,
        ['current.components.0.speed_mps = 9.0', '<= 3.0'],
    ),
    ({'current': {'speed_kn': 1.0}}, None, ['current', 'angle_deg', 'direction_deg']),
    (
        {'current': {'speed_kn': 1.0, 'speed_mps': 0.5, 'angle_deg': 1.0}},
        None,
        ['current', 'speed_kn', 'speed_mps'],
    ),
    ({'current': {'seed': 4}}, None, ['seed belongs to the scenario']),
    ({'vehicle': 'submarine'}, None, ["vehicle = 'submarine'", 'zhang2021', 'seawing']),
    ({'vehicle': 'mine.yaml'}, None, ['mine.yaml', 'no such vehicle file']),
    ({'forecast': {'file': 'no.nc'}}, None, ['forecast.file = ', 'no.nc', 'no such file']),
    ({}, {'current.speed_kn': -1.0}, ['current.speed_kn = -1.0', '>= 0']),
    ({}, {'profile.depth': 5.0}, ['profile.depth = 5.0', 'unknown field', 'depth_m']),
    ({'profile': {}}, {'profile.depth_m.x': 1.0}, ['profile.depth_m.x']),
]


@pytest.mark.parametrize(
    ('values', 'changes', 'words'), UNKNOWN, ids=[' '.join(case[2][:2]) for case in UNKNOWN]
)
def test_mistake_is_told_with_file_field_value_and_what_is_allowed(
    values, changes, words, tmp_path
):
    path = write(tmp_path, values)
    message = refusal(path, changes)
    assert path in message or 'depth_m.x' in words[0]
    for word in words:
        assert word in message, message
    assert 'pydantic' not in message


def test_every_mistake_of_a_file_has_a_line(tmp_path):
    path = write(tmp_path, {'seed': -1, 'profile': {'depth_m': 1.0, 'pitch_deg': 'steep'}})
    lines = refusal(path).splitlines()
    assert len(lines) == 3
    assert all(line.startswith(path) for line in lines)


@pytest.mark.parametrize(
    ('text', 'words'),
    [
        ('dives: 1\ndives: 2\n', ["'dives'", 'twice']),
        ('profile: {depth_m: 50, depth_m: 60}\n', ["'depth_m'", 'twice']),
        ('- a\n- b\n', ['expected a mapping']),
        ('', ['expected a mapping']),
        ('profile: {depth_m: [}\n', ['not valid YAML']),
        ('profile: !!python/object:os.system {}\n', ['not valid YAML']),
        ('? [1, 2]\n: 3\n', ['plain text']),
    ],
)
def test_text_that_is_no_scenario_is_refused_with_its_file(text, words, tmp_path):
    path = write(tmp_path, text)
    message = refusal(path)
    assert path in message
    for word in words:
        assert word in message


def test_binary_file_is_refused(tmp_path):
    path = tmp_path / 'mission.yaml'
    path.write_bytes(b'\xff\xfe\x00\x81')
    assert str(path) in refusal(str(path))


def test_missing_file_is_named(tmp_path):
    path = str(tmp_path / 'nowhere.yaml')
    assert path in refusal(path)


def test_unknown_name_is_answered_with_those_there_are():
    message = refusal('current_9deg')
    assert "'current_9deg'" in message
    assert all(name in message for name in scenario_names())


def test_exponent_without_a_point_is_a_number(tmp_path):
    path = write(tmp_path, 'settle_s: 1e3\nduration_s: 2E+4\n')
    scenario = load_scenario(path)
    assert (scenario.settle_s, scenario.duration_s) == (1000.0, 20000.0)


@pytest.mark.parametrize(
    ('field', 'value', 'other'),
    [
        ('speed_mps', 0.3, 'speed_kn'),
        ('speed_kn', 0.7, 'speed_mps'),
        ('direction_deg', 45.0, 'angle_deg'),
        ('angle_deg', 12.0, 'direction_deg'),
    ],
)
def test_set_replaces_the_alternative_field(field, value, other):
    scenario = load_scenario('current_8deg', {f'current.{field}': value})
    assert getattr(scenario.current, field) == value
    assert getattr(scenario.current, other) is None


def test_set_replaces_the_alternative_field_of_a_helix():
    path = load_scenario('helix', {'path.descent_per_turn_m': 500.0}).path
    assert (path.descent_per_turn_m, path.slope_deg) == (500.0, None)


def test_set_makes_the_groups_on_its_way():
    assert load_scenario('helix', {'water.pycnocline_rise': 0.002}).water.pycnocline_rise == 0.002


@pytest.mark.parametrize(
    ('text', 'field', 'value'),
    [
        ('profile.depth_m=200', 'profile.depth_m', 200),
        (' seed = 7', 'seed', 7),
        ('name=a=b', 'name', 'a=b'),
        ('path.waypoints=[[0, 0], [1, 2.5]]', 'path.waypoints', [[0, 0], [1, 2.5]]),
        ('current={speed_kn: 1.0}', 'current', {'speed_kn': 1.0}),
        ('settle_s=', 'settle_s', None),
    ],
)
def test_assignment_is_read_as_yaml(text, field, value):
    assert parse_assignment(text) == (field, value)


@pytest.mark.parametrize('text', ['profile.depth_m', '=3', 'a=[', ''])
def test_assignment_of_another_form_is_refused(text):
    with pytest.raises(ConfigurationError, match='--set'):
        parse_assignment(text)


def test_no_vehicle_starts_below_the_bottom():
    changes = {'water.bottom_m': 50.0, 'profile.depth_m': 40.0}
    assert load_scenario('current_8deg', {**changes, 'initial.depth_m': 50.0})
    with pytest.raises(ConfigurationError, match=r'initial.depth_m = 80: .*<= 50 m there'):
        load_scenario('current_8deg', {**changes, 'initial.depth_m': 80.0})


@pytest.mark.parametrize(
    'text', ['profile.depth_m=nan', 'profile.depth_m=.inf', 'profile.depth_m=', 'seed=x']
)
def test_assignment_of_a_useless_value_is_refused(text):
    field, value = parse_assignment(text)
    assert field in refusal('current_8deg', {field: value})


def test_vehicle_file_is_looked_for_beside_the_scenario(tmp_path, monkeypatch):
    mission = tmp_path / 'missions'
    (mission / 'boats').mkdir(parents=True)
    (mission / 'boats' / 'mine.yaml').write_bytes(vehicle_path('seawing').read_bytes())
    path = write(mission, {'vehicle': 'boats/mine.yaml'})
    monkeypatch.chdir(tmp_path)
    scenario = load_scenario(path)
    monkeypatch.chdir('/')
    assert scenario.vehicle == str(mission / 'boats' / 'mine.yaml')
    assert scenario.plant_settings().params().vehicle.m == pytest.approx(65.28, abs=0.1)


@pytest.mark.parametrize(
    ('field', 'value', 'allowed'),
    [
        ('moving_mass.mass', -18.0, '> 0'),
        ('hull.length', math.nan, '20'),
        ('buoyancy_engine.range', 1e9, '<= 50'),
    ],
)
def test_vehicle_file_with_a_mistake_is_refused_with_the_scenario(field, value, allowed, tmp_path):
    """Before anything is flown or written."""
    values = yaml.safe_load(vehicle_path('zhang2021').read_text(encoding='utf-8'))
    group, name = field.split('.')
    values[group][name]['value'] = value
    vehicle = write(tmp_path, values, 'mine.yaml')
    message = refusal(write(tmp_path, {'vehicle': 'mine.yaml'}))
    assert vehicle in message
    assert f'{field}.value = {value}' in message
    assert allowed in message


def test_a_vehicle_that_there_is_not_is_told_with_all_else_that_is_wrong(tmp_path):
    text = 'profile:\n  depth_m: -5.0\nseed: -1\nvehicle: submarine\n'
    path = write(tmp_path, text)
    lines = refusal(path).splitlines()
    assert len(lines) == 3 and all(line.startswith(f'{path}:') for line in lines)
    assert any(line.startswith(f"{path}:4: vehicle = 'submarine'") for line in lines)
    for said in ('seed = -1', 'profile.depth_m = -5'):
        assert sum(said in line for line in lines) == 1


def test_current_table_is_looked_for_beside_the_scenario(tmp_path, monkeypatch):
    (tmp_path / 'profile.csv').write_text('depth_m,north_mps,east_mps\n0,0.1,0.2\n100,0,0\n')
    components = [{'kind': 'table', 'file': 'profile.csv'}]
    path = write(tmp_path, {'current': {'components': components}})
    monkeypatch.chdir('/')
    assert load_scenario(path).current.components[0].rows == [[0.0, 0.1, 0.2], [100.0, 0.0, 0.0]]


@pytest.mark.parametrize(
    ('csv', 'words'),
    [
        ('depth_m,north_mps\n0,0.1\n', ['east_mps', 'missing']),
        ('depth_m,north_mps,east_mps\n0,0.1,x\n', ['row 2', 'east_mps', "'x'"]),
        ('depth_m,north_mps,east_mps\n9,0,0\n3,0,0\n', ['row 3', 'depth_m', 'increase']),
        (None, ['profile.csv']),
    ],
)
def test_current_table_with_a_mistake_is_named_with_row_and_column(csv, words, tmp_path):
    if csv:
        (tmp_path / 'profile.csv').write_text(csv)
    components = [{'kind': 'table', 'file': 'profile.csv'}]
    path = write(tmp_path, {'current': {'components': components}})
    message = refusal(path)
    for word in [path, str(tmp_path / 'profile.csv'), *words]:
        assert word in message


def test_written_scenario_needs_no_table_file(tmp_path):
    table = tmp_path / 'profile.csv'
    table.write_text('depth_m,north_mps,east_mps\n0,0.1,0.2\n100,0,0\n')
    components = [{'kind': 'table', 'file': 'profile.csv'}]
    scenario = load_scenario(write(tmp_path, {'current': {'components': components}}))
    table.unlink()
    again = load_scenario(write(tmp_path, {**yaml.safe_load(scenario.to_yaml())}))
    assert again.current == scenario.current


@pytest.mark.parametrize('course_deg', [0.0, 90.0, -135.0])
def test_angle_of_the_current_is_relative_to_the_first_leg(course_deg):
    scenario = load_scenario('current_8deg', {'path.course_deg': course_deg})
    current = scenario.current_settings()
    assert math.cos(math.radians(current.direction_deg - course_deg - 8.0)) == pytest.approx(1.0)
    assert current.speed_mps == pytest.approx(0.514444, abs=1e-6)


def test_seed_of_the_scenario_is_that_of_its_current():
    assert load_scenario('rough_water', {'seed': 42}).current_settings().seed == 42


@pytest.mark.parametrize(
    ('settle_s', 'time_s', 'expected'),
    [
        (None, 10000.0, 1800.0),
        (None, 3600.0, 1800.0),
        (None, 2000.0, 1000.0),
        (None, 108000.0, 7200.0),
        (300.0, 108000.0, 300.0),
    ],
)
def test_settling_time_is_the_files_or_that_of_the_length_of_the_run(settle_s, time_s, expected):
    scenario = load_scenario('current_8deg', {'settle_s': settle_s})
    assert scenario.settle_time_s(time_s) == expected


def test_settling_of_shallow_dives_is_over_after_one_of_them():
    """200 m at 0.269 m/s."""
    assert load_scenario('survey').settle_time_s(15000.0) == pytest.approx(743.0, abs=2.0)


@pytest.mark.parametrize('name', scenario_names())
@pytest.mark.parametrize('vehicle', ['zhang2021', 'seawing'])
def test_windows_of_dives_to_1000_m_are_as_they_always_were(name, vehicle):
    """What was published of them was scored so."""
    scenario = load_scenario(name, {'vehicle': vehicle, 'profile.depth_m': 1000.0})
    rules = scenario.score_rules(10000.0)
    assert (rules.margin_s, rules.steady_depth_m) == (600.0, 30.0)
    assert rules.settle_s == (scenario.settle_s or 1800.0)
    assert scenario.score_rules(20000.0).settle_s == (scenario.settle_s or 7200.0)


def test_run_that_stops_with_its_path_is_not_ended_by_a_wait_of_its_mission():
    """Only by a longer time afloat than any of them; one that continues is not at all."""
    waits = {'profile.surface_every_dives': 2, 'profile.wait_s': 300.0, 'profile.prepare_s': 40.0}
    assert load_scenario('survey').plant_settings().afloat_s == 60.0
    assert load_scenario('survey', waits).plant_settings().afloat_s == 400.0
    assert load_scenario('survey', {'path.at_end': 'continue'}).plant_settings().afloat_s == 0.0


@pytest.mark.parametrize('kind', ['waypoints', 'spline'])
@pytest.mark.parametrize(
    'waypoints',
    [
        [[36.1, 120.3], [36.2, 120.5]],
        [[-54.0, -179.9], [-54.5, -178.0], [-53.0, -177.0]],
        [[10.0, 20.0], [12.0, 20.0], [12.0, 22.0], [10.0, 22.0]],
    ],
)
def test_waypoints_that_look_like_degrees_are_refused_with_a_hint(kind, waypoints):
    told = r'path\.waypoints = .*\(allowed: >= .* m; metres north and east of the start, not '
    with pytest.raises(ConfigurationError, match=told + 'latitude and longitude'):
        load_scenario('survey', {'path.kind': kind, 'path.waypoints': waypoints})


@pytest.mark.parametrize(
    'waypoints', [[[0.0, 0.0], [0.0, 100.0], [90.0, 100.0]], [[1.0, 1.0], [12.0, 1.0]]]
)
def test_short_legs_in_metres_are_no_degrees(waypoints):
    assert load_scenario('survey', {'path.waypoints': waypoints}).path.waypoints[1][0] < 90.0


def test_load_does_not_change_a_scenario_loaded_before():
    plain = load_scenario('current_8deg')
    load_scenario('current_8deg', {'profile.depth_m': 50.0})
    assert load_scenario('current_8deg') == plain


@pytest.mark.parametrize(
    ('method', 'fitted', 'told'),
    [
        ('known', ['measured_odom'], []),
        (
            'dead_reckoned',
            ['imu', 'pressure', 'fix'],
            ['believed_current', 'believed_surface_current'],
        ),
    ],
)
def test_sensors_and_topics_follow_from_the_way_to_navigate(method, fitted, told):
    scenario = load_scenario('current_8deg', {'navigation.method': method})
    assert scenario.plant_settings().fitted == fitted
    assert list(scenario.navigation.topics) == fitted + told


@pytest.mark.parametrize('part', ['guidance', 'control'])
def test_a_belief_may_jump_at_a_fix_unless_somebody_says_otherwise(part):
    def jump_m(**changes):
        scenario = load_scenario('current_8deg', changes)
        return getattr(scenario, f'{part}_settings')().gate.position_jump_m

    reckoned = {'navigation.method': 'dead_reckoned'}
    assert jump_m() == GateSettings().position_jump_m == 100.0
    assert jump_m(**reckoned) > 1e7
    assert jump_m(**reckoned, **{f'{part}.gate.position_jump_m': 77.0}) == 77.0


def test_navigation_is_told_of_vehicle_launch_and_sensors():
    changes = {
        'vehicle': 'seawing',
        'initial.north_m': 12.0,
        'initial.east_m': -7.0,
        'sensors.imu_period_s': 4.0,
        'sensors.gyro': False,
        'origin.latitude_deg': -10.0,
    }
    told = load_scenario('current_8deg', changes).navigation_settings()
    assert (told.vehicle, told.north_m, told.east_m) == ('seawing', 12.0, -7.0)
    assert (told.imu_period_s, told.gyro, told.origin.latitude_deg) == (4.0, False, -10.0)


@pytest.mark.parametrize('part', sorted({*Scenario.model_fields} - {'changed', 'current'}))
def test_a_field_that_is_set_to_what_it_is_changes_no_other(part):
    plain = load_scenario('current_8deg')
    section = plain.model_dump(mode='json')[part]
    for name, value in section.items() if isinstance(section, dict) else ():
        if value is not None:
            same = load_scenario('current_8deg', {f'{part}.{name}': value})
            assert getattr(same, part) == getattr(plain, part)


def test_fields_that_are_given_stay_as_they_are():
    """A field inside a section that is given too changes the scenario, not what was given."""
    fields = {'sensors': {}, 'sensors.gps_std_m': 7.0}
    assert load_scenario('current_8deg', fields).sensors.gps_std_m == 7.0
    assert fields == {'sensors': {}, 'sensors.gps_std_m': 7.0}


@pytest.mark.parametrize(('old', 'new'), OLD_NAMES.items())
def test_what_guidance_was_called_before_is_understood(old, new):
    for name in (old, new):
        scenario = load_scenario('current_8deg', {'guidance.los.method': name})
        assert scenario.guidance.los.method == new


def test_a_file_lies_beside_the_scenario_or_else_in_the_working_folder(tmp_path, monkeypatch):
    (tmp_path / 'there').mkdir()
    (tmp_path / 'here').mkdir()
    monkeypatch.chdir(tmp_path / 'here')
    mine = tmp_path / 'there/mine.yaml'
    mine.write_text(scenario_path('current_8deg').read_text())
    changes = {
        'water.profile': 'cast.csv',
        'current.components': [{'kind': 'table', 'file': 'flow.csv'}],
    }

    def written(folder, density):
        (tmp_path / folder / 'cast.csv').write_text(f'depth_m,density_kgpm3\n0,{density}\n')
        (tmp_path / folder / 'flow.csv').write_text('depth_m,north_mps,east_mps\n0,0.1,0\n')

    with pytest.raises(ConfigurationError, match='there/flow.csv'):
        load_scenario(str(mine), changes)
    written('here', 1020.0)
    for name in ('current_8deg', str(mine)):
        assert load_scenario(name, changes).water.profile == [[0.0, 1020.0]]
    written('there', 1025.0)
    assert load_scenario(str(mine), changes).water.profile == [[0.0, 1025.0]]


def test_a_field_of_somebody_that_makes_no_params_is_named(monkeypatch):
    monkeypatch.setattr(JetSettings, 'params', lambda self: 1 / 0)
    with pytest.raises(ConfigurationError, match='current.field.params: .*ZeroDivisionError: div'):
        load_scenario('helix', {'current.field.kind': 'jet'})
