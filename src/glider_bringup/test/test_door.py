# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""Flights and runs from Python, and the files that other programs read."""

import csv
import gc
import io
import json
import pickle
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from contextlib import nullcontext, redirect_stdout
from functools import partial
from pathlib import Path
from typing import NamedTuple

import matplotlib
import numba
import numpy as np
import pytest
import typer
import xarray
import yaml
from matplotlib import pyplot
from mcap_ros2.reader import read_ros2_messages
from rich.console import Console
from scipy.io import loadmat
from scipy.spatial.transform import Rotation
from typer.testing import CliRunner

import command_line
import glider_bringup as glider
from glider_base.frames import NO_ATTITUDE
from glider_base.kernel import kernel, on_compiling
from glider_base.settings import ConfigurationError
from glider_bringup import console
from glider_bringup.cli import OF_THE_SCRIPT, _added, app
from glider_bringup.door.dataset import numbers_of
from glider_bringup.door.export import write_mat
from glider_bringup.door.run import chosen_scenario
from glider_guidance.method import Asked
from glider_guidance.method import method_step as guidance_step
from glider_mission.blocks import COLUMNS, ROW
from glider_model.ocean.field import field_velocity
from glider_navigation.block import say
from glider_navigation.method import method_step as navigation_step

#: Half of what is named north, east and down in the world of topics: x east, y north, z up.
ENU = np.array([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, -1.0]])
FLU = np.diag([1.0, -1.0, -1.0])


@pytest.fixture(scope='module')
def flown(tmp_path_factory) -> glider.Run:
    """Four minutes in rough water, down and up again, with noise, a bag and a run folder."""
    changes = {
        'profile.prepare_s': 20.0,
        'profile.depth_m': 14.0,
        'profile.top_depth_m': 5.0,
        'sensors.attitude_std_deg': 0.1,
    }
    out = tmp_path_factory.mktemp('door') / 'run'
    return glider.fly('rough_water', changes, seed=3, duration=240.0, out=out, bag=True)


@pytest.fixture(scope='module')
def data(flown) -> xarray.Dataset:
    return flown.to_xarray()


@pytest.fixture(scope='module')
def messages(flown) -> dict[str, list]:
    """Every message of the bag, decoded by another library with the definitions in the file."""
    (file,) = flown.folder.glob('*.mcap')
    found = {}
    for message in read_ros2_messages(str(file)):
        name = message.channel.topic.removeprefix('/glider/')
        found.setdefault(name, []).append(message.ros_msg)
    return found


def columns(data: xarray.Dataset, topic: str, *names: str) -> np.ndarray:
    return np.stack([data[f'{topic}_{name}'].values for name in names], axis=1)


def xyz(vectors) -> np.ndarray:
    return np.array([(v.x, v.y, v.z) for v in vectors])


# ---------------------------------------------------------------------- the package


def run_python(program: str, *options: str) -> str:
    done = subprocess.run(
        [sys.executable, *options, '-c', program], capture_output=True, text=True, timeout=300
    )
    assert (done.returncode, done.stderr) == (0, '')
    return done.stdout


def test_import_of_the_package_loads_nothing():
    program = 'import sys, glider_bringup; print({"numba", "numpy", "rclpy"} & {*sys.modules})'
    assert run_python(program) == 'set()\n'


def test_every_public_name_is_there_and_documented():
    for name in dir(glider):
        assert getattr(glider, name).__doc__.strip()
    assert {*glider.__all__, 'sweep'} <= {*dir(glider)}
    with pytest.raises(AttributeError, match='no attribute'):
        glider.swim  # noqa: B018


def test_a_flight_and_its_dataset_need_no_ros():
    program = (
        'import sys, glider_bringup as glider\n'
        'print(len(glider.fly(duration=1.0).to_xarray().time), "rclpy" in sys.modules)'
    )
    assert run_python(program) == '10 False\n'


#: Flies what every kind of study gives its workers, and says what they have loaded. The command
#: line is imported because a worker begins by importing the program that started it.
STUDIES = """
import sys

import glider_bringup.cli
from glider_studies.paper.experiments import Case, _fly_case
from glider_studies.montecarlo import _fly_plant, make_scenarios
from glider_studies.workers import worker_pool
from glider_studies.sweep.fly import fly_chunk, make_chunks
from glider_studies.sweep.plan import load_sweep


def fly(study):
    function, task = study
    status = function(task)
    return 'glider_bringup' in sys.modules, 'rclpy' in sys.modules, status is not None


if __name__ == '__main__':
    plan = load_sweep('small')
    known = bytearray(plan.cells - 1) + b'\\0'
    known[:-1] = b'\\1' * (plan.cells - 1)
    (scenario,) = make_scenarios('current_8deg', {'duration_s': 1.0}, ['pid'], 1, 0).values()
    case = Case('one', 'pid', 'los_current', 'current_8deg', {'duration_s': 1.0})
    studies = {
        'montecarlo': (_fly_plant, scenario),
        'sweep': (fly_chunk, next(make_chunks(plan, known, 1))),
        'experiments': (_fly_case, case),
    }
    with worker_pool(1) as pool:
        print(pool.results(fly, studies, lambda done: None))
"""


def test_a_study_worker_loads_no_ros(tmp_path):
    program = tmp_path / 'studies.py'
    program.write_text(STUDIES)
    done = subprocess.run(
        [sys.executable, program], capture_output=True, text=True, timeout=300, cwd=tmp_path
    )
    assert done.stderr == ''
    seen = (True, False, True)
    assert done.stdout.strip() == str(dict.fromkeys(('montecarlo', 'sweep', 'experiments'), seen))


# ---------------------------------------------------------------------- numbers


def test_time_is_uniform_and_every_variable_says_what_it_is(data):
    assert np.array_equal(data.time, np.arange(2400) / 10)
    assert data.time.attrs['units'] == 's'
    for variable in data.data_vars.values():
        assert variable.dims == ('time',)
        assert {'units', 'long_name', 'topic'} <= set(variable.attrs)
    frames = {variable.attrs.get('frame') for variable in data.data_vars.values()}
    assert frames == {'NED', 'FRD', 'path', None}


def test_odometry_is_that_of_the_messages_in_ned_and_frd(data, messages):
    pose = [message.pose.pose for message in messages['odom']]
    twist = [message.twist.twist for message in messages['odom']]
    north_east_depth = xyz(one.position for one in pose) @ ENU.T
    assert np.array_equal(columns(data, 'odom', 'north', 'east', 'depth'), north_east_depth)
    velocity = xyz(one.linear for one in twist) @ FLU
    assert np.array_equal(columns(data, 'odom', 'u', 'v', 'w'), velocity)
    rates = xyz(one.angular for one in twist) @ FLU
    assert np.array_equal(columns(data, 'odom', 'p', 'q', 'r'), rates)
    imaginary = xyz(one.orientation for one in pose)
    wire = Rotation.from_quat(
        [(*v, one.orientation.w) for one, v in zip(pose, imaginary, strict=True)]
    ).as_matrix()
    expected = ENU @ wire @ FLU
    euler = columns(data, 'odom', 'roll', 'pitch', 'heading')
    turned = Rotation.from_euler('ZYX', euler[:, ::-1]).as_matrix()
    assert np.abs(turned - expected).max() < 1e-12
    quaternion = columns(data, 'odom', 'q_x', 'q_y', 'q_z', 'q_w')
    assert np.abs(Rotation.from_quat(quaternion).as_matrix() - expected).max() < 1e-12


def test_angles_are_not_known_where_navigation_has_no_attitude():
    """It says a quaternion of zeros, by which the vehicle would be level, and head north."""
    row = np.zeros(ROW)
    row[COLUMNS['odom']][3:7] = NO_ATTITUDE
    numbers = numbers_of(row, glider.load_scenario('slocum_shelf'))
    angles = [numbers[f'odom_{angle}'] for angle in ('roll', 'pitch', 'heading')]
    assert np.isnan(angles).all()


def test_joints_water_and_control_are_those_of_the_messages(data, messages):
    joints = ('buoyancy_engine', 'pitch_mass', 'roll_mass')
    for topic in ('joint_states', 'command'):
        positions = [message.position for message in messages[topic]]
        assert list(messages[topic][0].name) == list(joints)
        assert np.array_equal(columns(data, topic, *joints), positions)
    for topic in ('current_velocity', 'current_estimate'):
        velocity = xyz(message.twist.linear for message in messages[topic]) @ ENU.T
        assert np.array_equal(columns(data, topic, 'north', 'east', 'down'), velocity)
    error = xyz(message.vector for message in messages['tracking_error'])
    names = ('along', 'across', 'below')
    assert np.array_equal(columns(data, 'tracking_error', *names), error)
    wrench = [message.wrench for message in messages['wrench']]
    demanded = [(-one.force.z, one.torque.x, -one.torque.y) for one in wrench]
    names = ('heave_force', 'roll_moment', 'pitch_moment')
    assert np.array_equal(columns(data, 'wrench', *names), demanded)
    learnt = np.array([message.position for message in messages['adaptation']])
    names = [name for name in data.data_vars if name.startswith('adaptation_')]
    assert [
        f'adaptation_{name}'.startswith(own)
        for name, own in zip(messages['adaptation'][0].name, names, strict=True)
    ] == 13 * [True]
    assert np.array_equal(np.stack([data[name] for name in names], axis=1), learnt)


def test_reference_is_that_of_the_messages(data, messages):
    pose = [message.pose.pose for message in messages['reference']]
    twist = [message.twist.twist for message in messages['reference']]
    position = xyz(one.position for one in pose) @ ENU.T
    assert np.array_equal(columns(data, 'reference', 'north', 'east', 'depth'), position)
    velocity = xyz(one.linear for one in twist) @ ENU.T
    names = [f'velocity_{axis}' for axis in ('north', 'east', 'down')]
    assert np.array_equal(columns(data, 'reference', *names), velocity)
    rates = xyz(one.angular for one in twist) @ FLU
    names = [f'{angle}_rate' for angle in ('roll', 'pitch', 'heading')]
    assert np.array_equal(columns(data, 'reference', *names), rates)
    assert data.reference_pitch.min() < -0.3 < 0.3 < data.reference_pitch.max()


def test_flags_mean_what_they_say(data):
    meanings = data.stage.attrs['flag_meanings'].split()
    named = dict(zip(data.stage.attrs['flag_values'].tolist(), meanings, strict=True))
    stages = [named[value] for value in np.unique(data.stage)]
    assert stages[:2] == ['surface_preparation', 'gliding_down']
    diving = data.stage == 1
    assert float(data.odom_pitch.where(diving).mean()) < -0.2
    masks = data.saturation.attrs['flag_masks']
    assert len(masks) == len(data.saturation.attrs['flag_meanings'].split())
    assert np.all(data.saturation.values & ~np.bitwise_or.reduce(masks) == 0)
    assert np.any(data.saturation.values & masks[0])


# ---------------------------------------------------------------------- runs


def test_run_folder_bag_and_memory_give_the_same(flown, data, tmp_path):
    (file,) = flown.folder.glob('*.mcap')
    alone = tmp_path / 'alone.mcap'
    alone.write_bytes(file.read_bytes())
    for path in (flown.folder, alone):
        again = glider.open_run(path)
        xarray.testing.assert_equal(again.to_xarray(), data)
    assert glider.open_run(flown.folder).score == flown.score
    assert json.loads((flown.folder / 'score.json').read_text()) == flown.score
    scenario = again.scenario
    del again
    gc.collect()  # the vehicle of a bag that lies alone is there, whoever keeps the run
    once_more = glider.fly(scenario, duration=240.0)
    xarray.testing.assert_equal(once_more.to_xarray(), data)


@pytest.mark.parametrize('clearance_m', [0.0, 10.0])
def test_run_over_nodes_gives_the_same_and_leaves_nothing(tmp_path, monkeypatch, clearance_m):
    monkeypatch.chdir(tmp_path)
    fields = {'profile.clearance_m': clearance_m, 'water.bottom_m': 90.0}
    over_nodes = glider.fly('survey', fields, duration=3.0, engine='nodes')
    directly = glider.fly('survey', fields, duration=3.0)
    assert over_nodes.score['status'] == 'completed'
    assert over_nodes.score['engine'] == 'nodes'
    assert over_nodes.folder is directly.folder is None
    xarray.testing.assert_equal(over_nodes.to_xarray(), directly.to_xarray())
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize('bag', [False, True])
def test_a_flight_that_is_refused_leaves_no_folder(tmp_path, bag):
    fault = {'kind': 'message', 'topic': 'odom', 'how': 'drop', 'share': 0.5}
    out, words = tmp_path / 'run', ['--set', f'faults=[{json.dumps(fault)}]']
    words = ['run', *words, '--engine', 'direct', '--out', str(out), *(['--bag'] * bag)]
    for refused in (
        lambda: CliRunner().invoke(app, words, catch_exceptions=False),
        lambda: glider.fly('current_8deg', {'faults': [fault]}, out=out, bag=bag),
    ):
        with pytest.raises(ConfigurationError, match='no messages that could go wrong'):
            refused()
        assert not out.exists()


def test_fly_gives_what_the_command_line_gives(flown, tmp_path):
    options = [
        *('run', flown.folder / 'scenario.yaml', '--engine', 'direct', '--json', '--no-report'),
        *('--duration', '240', '--out', tmp_path / 'run'),
    ]
    done = CliRunner().invoke(app, list(map(str, options)))
    card = json.loads(done.stdout)
    measured = {'wall_time_s', 'real_time_factor', 'messages_recorded'}
    for name in set(card) - measured:
        assert card[name] == flown.score[name]


def test_report_is_that_of_the_command_line(flown, tmp_path):
    file = flown.report(tmp_path / 'one.html')
    options = ['report', str(flown.folder), '--out', str(tmp_path / 'other.html')]
    assert CliRunner().invoke(app, options).exit_code == 0
    assert file.read_bytes() == (tmp_path / 'other.html').read_bytes()


def test_report_of_a_run_in_memory_lies_where_one_is(flown, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    file = glider.fly(flown.scenario, duration=60.0).report()
    assert file.resolve() == tmp_path / 'report.html'
    assert 'rough_water' in file.read_text()
    assert '60.0 s' in file.read_text()


WRONG = {
    'scenario': (['nowhere'], {'scenario': 'nowhere'}),
    'field': (['--set', 'current.speed_kn=99'], {'set': {'current.speed_kn': 99}}),
    'unknown': (['--set', 'depth=9'], {'set': {'depth': 9}}),
    'duration': (['--duration', '-1'], {'duration': -1}),
    'seed': (['--seed', '-1'], {'seed': -1}),
}


@pytest.mark.parametrize('case', WRONG)
def test_mistake_is_told_in_the_words_of_the_command_line(case):
    options, choices = WRONG[case]
    told = CliRunner().invoke(app, ['run', '--engine', 'direct', *options])
    with pytest.raises(ConfigurationError) as error:
        glider.fly(**choices)
    assert isinstance(told.exception, glider.ConfigurationError)
    assert str(error.value) == str(told.exception)


SPEEDS = {'current.speed_kn': [0.0]}


@pytest.mark.parametrize(
    ('call', 'text'),
    [
        (lambda: glider.fly(engine='rocket'), '--engine rocket: unknown (allowed: nodes, direct)'),
        (lambda: glider.fly(bag=True), '--bag: a bag needs a run folder'),
        (lambda: glider.fly(controller='fuzzy'), "control.law = 'fuzzy'"),
        (lambda: glider.fly(out=3), 'out = 3: not usable (allowed: a path)'),
        (lambda: glider.fly(out='a\0'), "out = 'a\\x00': not usable (allowed: a path)"),
        (
            lambda: glider.fly(set={'path': 3}),
            'course_deg, length_m, waypoints, waypoints_latlon, c',
        ),
        (
            lambda: glider.fly(set=[]),
            'set = []: not usable (allowed: values by dotted field name)',
        ),
        (lambda: glider.load_scenario(3), "scenario = '3': no such scenario (allowed: current"),
        (lambda: glider.load_scenario('helix', 3), 'changes = 3: not usable (allowed: values by'),
        (lambda: glider.open_run(None), 'path = None: not usable (allowed: a path)'),
        (
            lambda: glider.sweep(SPEEDS, set=[1]),
            'set = [1]: not usable (allowed: values by dotted',
        ),
        (lambda: glider.sweep(SPEEDS, out=3), 'out = 3: not usable (allowed: a path)'),
        (lambda: glider.sweep(SPEEDS, workers=10**9), 'not usable (allowed: 1 to 1024)'),
        (lambda: glider.sweep(SPEEDS, workers=2, scheduler='x:1'), 'not with --scheduler'),
        (lambda: glider.sweep({3: [0]}), 'dimensions.3.field = 3: should be a valid string'),
        (lambda: glider.sweep({'seed': [object()]}), 'not usable (allowed: numbers, texts, true'),
    ],
)
def test_mistake_is_told(call, text, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    with pytest.raises(ConfigurationError) as error:
        call()
    assert text in str(error.value)
    assert not list(tmp_path.iterdir())


def test_law_of_a_program_is_not_swept_for_workers_do_not_know_it():
    chosen_scenario('helix', None, None, level, None, None, None)
    for axes in ({'control.law': ['pid', 'level']}, SPEEDS):
        with pytest.raises(ConfigurationError, match="law = 'level': of this program alone"):
            glider.sweep(axes, set={} if 'control.law' in axes else {'control.law': 'level'})


def test_value_of_an_axis_that_is_none_is_told_in_a_line():
    with pytest.raises(ConfigurationError) as error:
        glider.sweep({'current.speed_kn': [0.0, float('nan')]})
    says = 'nan: not usable (allowed: numbers, texts, true, false)'
    assert str(error.value).endswith(f'current_speed_kn.values = [0.0, nan]: {says}')


def test_addresses_that_are_none_do_not_end_the_sweeps_to_come():
    for _ in range(3):
        with pytest.raises(ConfigurationError, match='--scheduler 3: no Dask scheduler answers'):
            glider.sweep(SPEEDS, scheduler=3)


def test_field_of_a_loaded_scenario_is_validated_too(flown):
    with pytest.raises(ConfigurationError, match='current.speed_kn = 99'):
        glider.fly(flown.scenario, {'current.speed_kn': 99})


@pytest.mark.parametrize('progress', [True, False])
def test_bar_is_shown_where_it_is_asked_for(progress, capsys, monkeypatch):
    terminal = io.StringIO()
    monkeypatch.setattr(
        'glider_bringup.console.messages', Console(file=terminal, force_terminal=True)
    )
    glider.fly(duration=1.0, progress=progress)
    assert ('flying' in terminal.getvalue()) is progress
    assert capsys.readouterr() == ('', '')


def test_sweep_gives_its_file_and_goes_on_from_its_journal(tmp_path, flown):
    plan = tmp_path / 'seeds.yaml'
    plan.write_text(
        f'scenario: {flown.folder}/scenario.yaml\n'
        'dimensions:\n  seed: {kind: values, field: seed, values: [3, 4]}\n'
    )
    out = tmp_path / 'out'
    result = glider.sweep(plan, workers=1, out=out)
    assert result.sizes == {'seed': 2, 'ned': 3, 'rpy': 3, 'frd': 3}
    assert float(result.cross_track_m_max_run[0]) == flown.score['cross_track_m']['max_run']
    with xarray.open_dataset(out / 'sweep.nc') as file:
        xarray.testing.assert_identical(file.load(), result)
    xarray.testing.assert_identical(glider.sweep(plan, out=out, resume=True), result)
    with pytest.raises(ConfigurationError, match='--resume'):
        glider.sweep(plan, out=out)


# ---------------------------------------------------------------------- other programs


@pytest.fixture(scope='module')
def export(flown, tmp_path_factory):
    """Function that exports the run, and gives the file."""

    def run(kind: str) -> Path:
        file = tmp_path_factory.mktemp('export') / 'file'
        done = CliRunner().invoke(
            app, ['export', str(flown.folder), '--to', kind, '--out', str(file)]
        )
        assert done.exit_code == 0, done.output
        return file

    return run


def test_netcdf_keeps_numbers_units_and_attributes(export, data):
    with xarray.open_dataset(export('netcdf')) as read:
        xarray.testing.assert_equal(read, data)
        for name, variable in data.variables.items():
            assert read[name].dtype == variable.dtype
            for attribute, value in variable.attrs.items():
                assert np.array_equal(read[name].attrs[attribute], value)
        assert data.attrs.items() <= read.attrs.items()
        assert yaml.safe_load(read.attrs['scenario_yaml'])['name'] == data.attrs['scenario']
        assert json.loads(read.attrs['score_json'])['seed'] == data.attrs['seed']
        assert 'zhang2021' in read.attrs['vehicle_yaml']


def test_run_that_is_too_large_for_a_mat_file_is_refused(tmp_path):
    """MATLAB reads no variable of 2 GB and more from such a file, and scipy writes none of 4."""
    row = np.broadcast_to(0.0, 2**28)
    one = ('time', row, {'units': 'm', 'long_name': 'depth'})
    data = xarray.Dataset({'depth': one}, coords={'time': one})
    with pytest.raises(ConfigurationError, match=r'run\.mat: .* 4\.3 GB .*allowed: netcdf, csv'):
        write_mat(data, tmp_path / 'run.mat', print)
    assert not list(tmp_path.iterdir())


def test_csv_has_one_row_a_tick_under_names_with_units(export, data):
    with export('csv').open(newline='') as stream:
        header, *rows = csv.reader(stream)
    assert header[:4] == ['time [s]', 'odom_north [m]', 'odom_east [m]', 'odom_depth [m]']
    assert 'wrench_roll_moment [N m]' in header
    numbers = np.array(rows, dtype=float)
    assert len(numbers) == 2400
    for heading, column in zip(header, numbers.T, strict=True):
        assert np.array_equal(column, data[heading.partition(' ')[0]])


def test_mat_has_structs_of_numbers_units_and_names(export, data):
    read = loadmat(export('mat'), squeeze_me=True, struct_as_record=False)
    numbers, units, texts = read['data'], read['units'], read['long_names']
    assert numbers._fieldnames == units._fieldnames == texts._fieldnames
    assert set(numbers._fieldnames) == set(data.variables)
    for name in data.variables:
        assert np.array_equal(getattr(numbers, name), data[name])
        assert getattr(units, name) == data[name].attrs['units']
        assert getattr(texts, name) == data[name].attrs['long_name']
    assert read['flags'].stage.meanings == data.stage.attrs['flag_meanings']
    assert read['about'].controller == 'adaptive'
    assert loadmat(export('mat'))['data']['odom_depth'][0, 0].shape == (2400, 1)


def test_files_are_called_after_the_run_unless_they_are_given_a_name(flown):
    done = CliRunner().invoke(app, ['export', str(flown.folder), '--to', 'netcdf'])
    assert done.exit_code == 0
    assert str(flown.folder / 'run.nc') in ''.join(done.stdout.split('\n'))


def test_run_without_a_bag_says_so(tmp_path):
    run = glider.fly(duration=1.0, out=tmp_path / 'run')
    assert len(run.to_xarray().time) == 10
    with pytest.raises(ConfigurationError, match='a direct one with --bag'):
        glider.open_run(run.folder).to_xarray()
    done = CliRunner().invoke(app, ['export', str(run.folder), '--to', 'csv'])
    assert isinstance(done.exception, ConfigurationError)
    assert not (run.folder / 'run.csv').exists()


# ---------------------------------------------------------------------------------- laws, plots


#: As in a cell of a notebook.
CELL = """
from typing import NamedTuple

from glider_control.law import LawSettings, law_step
from glider_base.kernel import kernel


class Level(NamedTuple):
    '''Gains of a law that holds pitch.'''

    k: float


class Turns(NamedTuple):
    '''How often it was called.'''

    count: int


class LevelLaw(LawSettings):
    '''Holds pitch, and counts.'''

    k: float = 25.0

    def params(self, vehicle, bank):
        return Level(self.k)

    def initial_state(self):
        return Turns(0)


@law_step.body(Level)
@kernel
def level_step(state, seen, params, dt):
    error = seen.reference.theta - seen.measured.theta
    pitch = params.k * error - 40.0 * seen.measured.theta_dot
    return Turns(state.count + 1), -20.0 * seen.measured.phi_dot, pitch
"""

#: What tells of a law on `adaptation`, but for what there is to tell.
LEARNT = """
from glider_control.law import law_learnt


@law_learnt.body(Level)
def learnt(state, params):
    return params.k, 0.0
"""


def run_cell(text):
    """The law of a cell of a notebook, from its settings to its step."""
    names = {'__name__': '__main__'}
    exec(compile(text, '<ipython-input-1>', 'exec'), names)
    return names['LevelLaw']


@pytest.fixture(scope='module')
def level_law():
    return run_cell(CELL)


def level(seen):
    """The same, without a state."""
    error = seen.reference.theta - seen.measured.theta
    return -20.0 * seen.measured.phi_dot, 25.0 * error - 40.0 * seen.measured.theta_dot


def three_moments(seen):
    return 0.0, 0.0, 0.0


def moments_in_words(seen):
    return 0.0, 'none'


def moment_in_a_word(seen):
    return 'none'


def moments_of_a_bank(seen):
    if seen.measured.phi > 0.1:
        return -1.0, 0.0


def moments_by_an_import(seen):
    from math import tanh

    return tanh(seen.m_b), 0.0


def moments_of_a_vector(seen):
    return np.zeros(2), 0.0


def moment_of_a_doubt(seen):
    return seen.roll_held, 1


def moment_on_two_axes(seen):
    return 0.0, 1.0j


def two_or_three(seen):
    return (0.0, 0.0) if seen.m_b > 0.0 else (0.0, 0.0, 0.0)


def test_law_of_a_program_is_flown_as_a_class_and_as_a_function(level_law, tmp_path):
    """They are one law: the same flight, each under its name."""
    changes = {'dives': 0, 'duration_s': 400.0}
    one = glider.fly('current_8deg', changes, law=level_law, out=tmp_path / 'one', bag=True)
    two = glider.fly('current_8deg', changes, law=level)
    carried = glider.Flight('current_8deg', changes, law=level)
    carried.step(1000)
    state = pickle.loads(pickle.dumps(carried.state))
    carried.restore(state).until()
    assert carried.now['odom_pitch'] == two.to_xarray().odom_pitch.values[-1]
    with on_compiling(lambda: pytest.fail('a law that was flown before is compiled again')):
        glider.fly('current_8deg', changes, law=level)
    with pytest.raises(TypeError, match=r'law level, .* not pickled, .* Run.score'):
        pickle.dumps(two)
    shipped = pickle.loads(pickle.dumps(glider.fly('current_8deg', changes)))
    assert (one.score['controller'], two.score['controller']) == ('LevelLaw', 'level')
    xarray.testing.assert_equal(one.to_xarray(), two.to_xarray())
    assert not one.to_xarray().odom_pitch.equals(shipped.to_xarray().odom_pitch)
    told = yaml.safe_load((one.folder / 'scenario.yaml').read_text())
    assert told['control'] == {**told['control'], 'law': 'LevelLaw', 'LevelLaw': {'k': 25.0}}
    assert glider.open_run(one.folder).score == one.score
    page = one.report()
    assert 'LevelLaw' in page.read_text(encoding='utf-8')
    changed = glider.fly('current_8deg', {**changes, 'control.LevelLaw.k': 60.0}, law=level_law)
    assert not changed.to_xarray().odom_pitch.equals(one.to_xarray().odom_pitch)
    held = glider.Flight('current_8deg', changes, law=level_law)
    assert held.until().name == 'end'
    assert held.now['odom_pitch'] == one.to_xarray().odom_pitch.values[-1]
    again = glider.fly(one.scenario)
    xarray.testing.assert_equal(again.to_xarray(), one.to_xarray())
    # a program that has not the law is told so
    line = command_line.glider('verify', one.folder)
    assert line.returncode == 2
    assert 'LevelLaw' in line.stderr and 'Traceback' not in line.stderr


def test_threads_each_fly_the_law_that_they_were_given():
    laws = [run_cell(CELL) for _ in range(8)]
    with ThreadPoolExecutor(len(laws)) as threads:
        chosen = list(
            threads.map(
                lambda law: chosen_scenario('helix', {}, None, law, None, None, None), laws
            )
        )
    assert [type(one.control.chosen) for one in chosen] == laws


def test_a_cell_that_is_run_anew_flies_what_stands_in_it_now(level_law):
    changes = {'dives': 0, 'duration_s': 400.0}
    before = glider.fly('current_8deg', changes, law=level_law)
    other = run_cell(  # a step is compiled, whether it is marked as a kernel or not
        CELL.replace('-20.0 * seen.measured.phi_dot', '3.0').replace('@kernel\n', '')
    )
    after = glider.fly('current_8deg', changes, law=other)
    assert before.score['controller'] == after.score['controller'] == 'LevelLaw'
    assert abs(before.to_xarray().odom_roll).max() < 0.01
    assert abs(after.to_xarray().odom_roll).max() > 0.2
    for again in (
        glider.fly(before.scenario, seed=0),
        glider.fly('current_8deg', changes, law=level_law),
    ):
        xarray.testing.assert_equal(again.to_xarray(), before.to_xarray())
    for choices, name in (
        ({'controller': 'pid'}, 'pid'),
        ({'law': level}, 'level'),
        ({'set': {'control.law': 'LevelLaw'}}, 'LevelLaw'),
    ):
        run = glider.fly(before.scenario, duration=1.0, **choices)
        assert run.score['controller'] == name
        assert ('LevelLaw' in run.scenario.to_yaml()) is (name == 'LevelLaw')


@pytest.mark.parametrize(
    ('law', 'choices', 'words'),
    [
        ('adaptive', {}, ['LawSettings', 'controller']),
        (lambda seen: (0.0, 0.0), {}, ['<lambda>', 'letters']),
        (lambda state, seen: (0.0, 0.0), {}, ['one parameter']),
        (level, {'engine': 'nodes'}, ['nodes', 'direct']),
        (level, {'controller': 'pid'}, ['pid']),
        (three_moments, {}, ['three_moments (', 'test_door.py', 'returns 3', 'roll moment']),
        (
            moments_in_words,
            {},
            ['moments_in_words (', 'test_door.py', 'str', 'as pitch moment', 'returns 2'],
        ),
        (moment_in_a_word, {}, ['moment_in_a_word (', 'str', 'alone', 'roll moment']),
        (
            moments_of_a_bank,
            {},
            ['moments_of_a_bank (', 'returns nothing', 'returns 2', 'pitch mo'],
        ),
        (moments_by_an_import, {}, ['moments_by_an_import (', 'test_door.py', 'IMPORT_NAME']),
        (
            two_or_three,
            {},
            ['two_or_three (', 'test_door.py', 'unify', 'returns 2', 'roll moment'],
        ),
        (
            run_cell(
                CELL.replace('    return Turns(state', '    if pitch:\n        return Turns(state')
            ),
            {},
            ['level_step (<ipython-input-1>', 'returns nothing', 'returns 3', 'state after'],
        ),
        (
            run_cell(CELL.replace('count + 1', 'count + 0.5')),
            {},
            ['level_step (<ipython-input-1>', 'returns Turns', 'which was Turns', '0.0'],
        ),
        (
            run_cell(CELL.replace('return Turns(0)', "return {'count': 0}")),
            {},
            ["control.law: initial_state: {'count': 0}: not usable", 'NamedTuple of numbers'],
        ),
        (
            run_cell(CELL.replace('Level(self.k)', 'Level([1, self.k])')),
            {},
            ['control.law: params.k: [1, 25.0]: not usable', 'NamedTuple of numbers'],
        ),
        (
            run_cell(CELL.replace('Level(self.k)', 'Level(vehicle.keel.value)')),
            {},
            ['control.law: params: <ipython-input-1>, line ', ': AttributeError: ', 'keel'],
        ),
        (
            run_cell(CELL.replace('return Turns(0)', 'return Turns(1 // 0)')),
            {},
            ['control.law: initial_state: <ipython-input-1>, line ', ': ZeroDivisionError: '],
        ),
        (
            run_cell(CELL.replace('Level(self.k)', "exit('no licence')")),
            {},
            ['control.law: params: <ipython-input-1>, line ', ': SystemExit: no licence'],
        ),
        (moment_on_two_axes, {}, ['moment_on_two_axes (', 'complex128 as pitch moment']),
        (moments_of_a_vector, {}, ['moments_of_a_vector (', 'array(', 'as roll moment']),
        (run_cell(CELL.replace('def initial', 'def first')), {}, ['LevelLaw', 'no initial_state']),
        (run_cell(CELL.partition('@law')[0]), {}, ['law_step: no body for params of type Level']),
        (run_cell(CELL + LEARNT), {}, ['learnt (<ipython-input-1>', 'returns 2', 'roll_bias_nm']),
    ],
)
def test_law_that_cannot_be_flown_is_told(law, choices, words, tmp_path):
    """By its words, and it leaves no folder behind."""
    folder = tmp_path / 'run'
    with pytest.raises(glider.ConfigurationError) as error:
        glider.fly('current_8deg', law=law, out=folder, bag=True, **choices)
    assert not folder.exists()
    assert all(word in str(error.value) for word in words)
    assert len(str(error.value).splitlines()) == 1


def test_a_truth_value_is_a_moment_of_0_or_1():
    run = glider.fly('current_8deg', {'profile.prepare_s': 0.0}, law=moment_of_a_doubt, duration=1)
    assert run.score['status'] == 'completed'


@pytest.mark.parametrize(
    ('call', 'what'),
    [(guidance_step, 'Asked'), (navigation_step, 'Estimate'), (field_velocity, 'to the north')],
)
def test_method_that_returns_nothing_somewhere_is_told(call, what):
    class Params(NamedTuple):
        at: float

    @call.body(Params)
    @kernel
    def sometimes(first, second, params, dt=0.1):
        if dt > params.at:
            return first, second

    @kernel
    def tick(params):
        return call(0.0, 0.0, params)

    with pytest.raises(
        glider.ConfigurationError, match=rf'sometimes \(.*test_door.*nothing.*{what}'
    ):
        tick(Params(0.0))


@kernel
def number(at):
    return at


@kernel
def bare_tuple(at):
    return at, 0.0, at, 0.0, 0.0, True


@kernel
def text_within(at):
    return Asked('north', 0.0, at, 0.0, 0.0, True)


@kernel
def too_few(at):
    return Asked(at, 0.0, at)


@pytest.mark.parametrize(
    ('made', 'words'),
    [
        (number, 'returns float64 as Asked'),
        (bare_tuple, r'returns Tuple\(.*as Asked'),
        (text_within, r'returns Asked\(.*as Asked'),
        (too_few, "Asked'>': missing a required argument: 'current_n'"),
    ],
)
def test_method_that_asks_for_something_else_is_told(made, words):
    class Params(NamedTuple):
        at: float

    @guidance_step.body(Params)
    @kernel
    def other(state, seen, params, dt):
        return state, made(params.at)

    @kernel
    def tick(params):
        return guidance_step(0.0, 0.0, params, 0.1)

    with pytest.raises(glider.ConfigurationError, match=rf'other \(.*test_door.*{words}'):
        tick(Params(0.0))


def test_phase_of_another_package_has_a_number():
    assert (say(3, 0).message, say(77, 0).message) == ('fixed', 'phase 77')


def test_depth_is_drawn_downward_and_nothing_else(data):
    matplotlib.use('Agg')
    deep = data.where(data.odom_depth >= 0.0, drop=True)
    other = xarray.DataArray([1.0, 2.0], attrs={'positive': 'down'})  # not ours
    for draw, is_down in (
        (data.odom_depth.plot, True),
        (deep.ground_truth_odom_depth[5:].plot.line, True),
        (data.reference_depth.plot.step, True),
        (partial(data.odom_depth.plot, yincrease=True), False),
        (data.odom_pitch.plot, False),
        (other.plot, False),
    ):
        assert draw()[0].axes.yaxis_inverted() == is_down
        pyplot.close('all')


def test_a_printed_dataset_holds_no_files(data):
    """As text and in a notebook: the scenario is not in it, nor is the vehicle."""
    for text in (repr(data), data._repr_html_()):
        assert 'rated_depth' not in text
        assert 'pitch_error_deg' not in text
    assert len(repr(data)) < 20_000


def test_sweep_of_a_mapping_is_that_of_its_file(tmp_path):
    file = tmp_path / 'two.yaml'
    axis = {'kind': 'values', 'field': 'current.speed_kn', 'values': [0.0, 0.5]}
    values = {'scenario': 'current_8deg', 'dimensions': {'current_speed_kn': axis}}
    values['set'] = {'dives': 0, 'duration_s': 60.0}
    file.write_text(yaml.safe_dump(values))
    axes = {'current.speed_kn': np.array([0.0, 0.5])}
    of_mapping = glider.sweep(axes, scenario='current_8deg', set=values['set'], workers=1)
    xarray.testing.assert_equal(of_mapping, glider.sweep(file, workers=1))
    with pytest.raises(glider.ConfigurationError, match=r'current.speed_kn'):
        glider.sweep({'current.speed_kn': [99.0]})
    with pytest.raises(glider.ConfigurationError, match='no field'):
        glider.sweep({})
    for choices, text in (
        ({'workers': 0}, 'workers = 0: .*allowed: 1 to 1024'),
        ({'workers': '2'}, "workers = '2': .*allowed: 1 to 1024"),
        ({'scenario': 'current_8deg'}, 'has one of its own'),
    ):
        with pytest.raises(glider.ConfigurationError, match=text):
            glider.sweep('small', **choices)
    for axes in ({'current.speed_kn': 0.5}, {'control.law': 'pid'}):
        (field,) = axes
        with pytest.raises(glider.ConfigurationError, match=rf'{field} = .*a list of values'):
            glider.sweep(axes)


@pytest.mark.parametrize('name', sorted(typer.main.get_command(app).list_commands(None)))
def test_every_command_prints_json_or_says_that_it_does_not(name):
    command = typer.main.get_command(app).get_command(None, name)
    options = [option for one in command.params for option in one.opts]
    assert '--json' in options or 'no JSON' in command.help or name in OF_THE_SCRIPT


@pytest.mark.parametrize(
    ('functions', 'called', 'words'),
    [
        (['count'], 'count', ['x']),
        (['greet'], 'hello', ['x']),  # one function: the command, whatever it is called
        (['one', 'two'], 'many', ['two', 'x']),
    ],
)
def test_a_command_of_a_package_goes_by_the_name_of_its_entry_point(functions, called, words):
    package = typer.Typer()
    for name in functions:
        package.command(name)(lambda word: print(word))
    command = _added(called, package)
    assert command.name == called
    told = io.StringIO()
    with redirect_stdout(told):
        command.main(words, standalone_mode=False)
    assert told.getvalue() == 'x\n'


def test_compiling_shows_a_bar_with_a_clock_on_a_terminal(monkeypatch):
    """Alone and below a bar that is shown already; it is gone when it is compiled."""
    for beside in (False, True):
        shown = io.StringIO()
        terminal = console._PlainConsole(file=shown, force_terminal=True, width=120)
        monkeypatch.setattr(console, 'messages', terminal)
        with console.progress_bar('flying', 5, console.ELAPSED) if beside else nullcontext():
            with on_compiling(partial(console.compiling, 'compiling the law')):
                numba.njit(lambda x: x + 1.0)(1.0)
            assert not [bar for bar in console._shown if len(bar.tasks) > 1]
        assert 'compiling the law' in shown.getvalue()
        assert '0:00:0' in shown.getvalue()


def test_compiling_is_one_line_where_there_is_no_terminal(monkeypatch):
    shown = io.StringIO()
    monkeypatch.setattr(console, 'messages', console._PlainConsole(file=shown))
    with on_compiling(partial(console.compiling, 'compiling the law')):
        numba.njit(lambda x: x + 1.0)(1.0)
        numba.njit(lambda x: x + 2.0)(1.0)
    assert shown.getvalue() == 'compiling the law\n'
