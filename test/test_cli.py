# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""The command line as a person or a script meets it: a process, its output, its exit code."""

import json
import os
import re
import sys
from functools import partial
from pathlib import Path

import pytest
import typer
import yaml

import command_line
import glider_flights.commands
import glider_studies.commands
from glider_base.settings import ConfigurationError
from glider_bringup import cli, commands
from glider_bringup.commands import export
from glider_mission.scenario import scenario_names
from glider_model.vehicle.file import vehicle_names, vehicle_path
from glider_studies.sweep.plan import sweep_names

SHORT = ('--engine', 'direct', '--controller', 'pid', '--duration', '300')
CARD = (
    'scenario vehicle controller guidance engine seed status ticks sim_time_s wall_time_s '
    'real_time_factor messages_recorded messages_lost dives distance_along_path_m cross_track_m '
    'pitch_error_deg heading_fluctuation_deg depth_m final_state'
).split()
TRIM = (
    'speed_mps alpha_deg beta_deg pitch_deg roll_deg glide_deg horizontal_mps vertical_mps '
    'turn_rate_radps turn_radius_m converged'
).split()


glider = partial(command_line.glider, columns=120)


def refused(*arguments):
    """Message of a command that ends with exit code 2, without a traceback or a result."""
    process = glider(*arguments)
    assert process.returncode == 2, process.stderr
    assert 'Traceback' not in process.stderr
    assert process.stdout == ''
    return process.stderr


def write(path, values):
    path.write_text(yaml.safe_dump(values), encoding='utf-8')
    return path


def test_docs_have_each_kind_of_export():
    text = (Path(__file__).parents[1] / 'docs' / 'commands.md').read_text()
    kinds = '\\|'.join(re.findall(r'--to (\S+\|\w+)', text)).split('\\|')
    assert sorted(kinds) == sorted(export.SUFFIXES)


@pytest.mark.parametrize('options', [(), ('--engine', 'direct', '--bag')])
def test_what_needs_a_ros_that_is_not_there_says_so(tmp_path, options):
    """As from wheels in an environment of Python alone."""
    missing = "raise ModuleNotFoundError('no such module', name='diagnostic_msgs')"
    (tmp_path / 'diagnostic_msgs.py').write_text(missing)
    path = os.pathsep.join([str(tmp_path), os.environ.get('PYTHONPATH', '')])
    process = glider('run', *options, '--out', tmp_path / 'run', PYTHONPATH=path)
    assert process.returncode == 2
    assert 'Traceback' not in process.stderr
    assert 'no module diagnostic_msgs: ROS 2 Jazzy, or this package of it' in process.stderr
    assert '--engine direct' in process.stderr
    assert not (tmp_path / 'run').exists()


@pytest.fixture(scope='module')
def run(tmp_path_factory):
    """Process and folder of a short flight with the direct engine."""
    folder = tmp_path_factory.mktemp('run') / 'flight'
    return glider('run', 'current_8deg', *SHORT, '--seed', 3, '--out', folder, '--json'), folder


def test_run_prints_one_json_object_and_nothing_else(run):
    process, _ = run
    assert process.returncode == 0, process.stderr
    assert process.stdout.count('\n') == 1
    card = json.loads(process.stdout)
    assert set(CARD) <= set(card)


def test_card_says_what_was_flown(run):
    card = json.loads(run[0].stdout)
    flown = [card[name] for name in 'scenario controller guidance engine seed status'.split()]
    assert flown == ['current_8deg', 'pid', 'los_current', 'direct', 3, 'completed']
    assert (card['ticks'], card['sim_time_s'], card['messages_lost']) == (3000, 300.0, 0)


def test_run_folder_holds_score_scenario_and_vehicle(run):
    process, folder = run
    assert json.loads((folder / 'score.json').read_text()) == json.loads(process.stdout)
    assert (folder / 'vehicle.yaml').read_bytes() == vehicle_path('zhang2021').read_bytes()
    assert yaml.safe_load((folder / 'scenario.yaml').read_text())['name'] == 'current_8deg'


def test_run_folder_flies_the_same_again(run, tmp_path):
    """The scenario in a run folder is complete: same final state to the last bit."""
    process, folder = run
    again = glider('run', folder / 'scenario.yaml', *SHORT, '--out', tmp_path / 'again', '--json')
    assert again.returncode == 0, again.stderr
    first, second = json.loads(process.stdout), json.loads(again.stdout)
    assert second['final_state'] == first['final_state']
    assert second['seed'] == 3


def test_score_shows_a_run_without_a_bag_as_it_was_scored(run):
    process, folder = run
    again = glider('score', folder, '--json')
    assert json.loads(again.stdout) == json.loads(process.stdout)


def test_score_of_a_bag_is_that_of_the_flight(tmp_path):
    """The direct engine's bag, read back: every figure to the last bit."""
    folder = tmp_path / 'flight'
    flown = glider('run', 'rough_water', *SHORT, '--bag', '--out', folder, '--json')
    assert flown.returncode == 0, flown.stderr
    card = json.loads(flown.stdout)
    assert card['messages_recorded'] > 9 * 3000
    assert json.loads(glider('score', folder, '--json').stdout) == card


def test_run_for_a_person_ends_with_the_scorecard(tmp_path):
    process = glider('run', *SHORT, '--set', 'settle_s=0', '--out', tmp_path / 'flight')
    assert process.returncode == 0, process.stderr
    for word in ('completed', 'cross-track', 'depth', str(tmp_path / 'flight')):
        assert word in process.stdout.replace('\n', '')


def test_description_with_brackets_is_only_text(tmp_path):
    values = {'description': 'to [/the] [red edge', 'dives': 0, 'duration_s': 10.0}
    path = write(tmp_path / 'mission.yaml', values)
    out = tmp_path / 'with [/brackets]'
    process = glider('run', path, '--engine', 'direct', '--out', out)
    assert process.returncode == 0, process.stderr
    assert 'to [/the] [red edge' in process.stderr
    assert 'with [/brackets]' in process.stdout


def test_second_run_does_not_overwrite_the_first(run):
    process, folder = run
    assert str(folder) in refused('run', *SHORT, '--out', folder).replace('\n', '')
    assert json.loads((folder / 'score.json').read_text()) == json.loads(process.stdout)


def test_list_names_everything_that_is_shipped():
    listed = json.loads(glider('list', '--json').stdout)
    assert sorted(listed['scenarios']) == scenario_names()
    assert sorted(listed['vehicles']) == vehicle_names()
    assert sorted(listed['sweeps']) == sweep_names()


def test_terminal_of_no_width_shows_the_same():
    path = os.environ.get('PYTHONPATH', '')
    for words in (('list',), ('list', '--help')):
        shown = [glider(*words, columns=width, PYTHONPATH=path).stdout for width in (0, 80)]
        assert 'slocum_g2' in shown[1] or 'Example' in shown[1]
        assert shown[0] == shown[1]


def test_trim_prints_the_steady_glide():
    """Against model figures: 0.4 kg and -30 deg give about 0.51 m/s along -31.6 deg."""
    process = glider('trim', 'zhang2021', '--net-heaviness-kg', 0.4, '--pitch-deg', -30, '--json')
    glide = json.loads(process.stdout)
    assert set(TRIM) <= set(glide)
    assert glide['converged'] is True
    assert glide['speed_mps'] == pytest.approx(0.513, abs=0.005)
    assert glide['glide_deg'] == pytest.approx(-31.6, abs=0.3)


def test_trim_prints_the_same_numbers_to_a_person_and_to_a_program():
    words = ['trim', 'slocum_g2', '--net-heaviness-kg', 0.2, '--pitch-deg', -25, '--fin-deg', 10]
    table = glider(*words).stdout
    numbers = json.loads(glider(*words, '--json').stdout)
    assert 'fin_turn_rate' in numbers
    for name in numbers.keys() - {'steering', 'coefficients', 'converged'}:
        assert re.search(rf'{name} +│ {re.escape(format(numbers[name], ".5g"))} ', table)


MISTAKES = [
    (['run', 'nowhere'], ["'nowhere'", 'current_8deg']),
    (['run', 'nowhere.yaml'], ['nowhere.yaml', 'no such']),
    (['run', '--set', 'profile.depth_m=5'], ['profile.depth_m = 5', '>= 10', '<= 12000']),
    (['run', '--set', 'profile.depth_m=.nan'], ['profile.depth_m = nan', '>= 10']),
    (['run', '--set', 'profil.depth_m=50'], ['profil', 'unknown field', 'profile']),
    (['run', '--set', 'depth'], ['--set depth', 'path.to.field=value']),
    (['run', '--duration', 'long'], ['--duration long', 'full']),
    (['run', '--duration', 'nan'], ['--duration nan', 'full']),
    (['run', '--speed', '0'], ['--speed 0', 'max']),
    (['run', '--engine', 'direct', '--speed', '2'], ['--speed', 'max']),
    (['run', '--namespace', 'a b'], ['--namespace a b', 'letters']),
    (['run', '--engine', 'direct', '--namespace', 'sea'], ['--namespace sea', 'direct']),
    (['run', '--engine', 'direct', '--sync', 'chunk'], ['--sync chunk', '--bag']),
    (['run', '--seed', '-1'], ['seed = -1', '>= 0']),
    (['run', '--engine', 'warp'], ['warp', 'nodes', 'direct']),
    (['run', '--controller', 'magic'], ['magic', 'pid']),
    (['trim', 'boat', '--net-heaviness-kg', '0.4', '--pitch-deg', '-30'], ["'boat'", 'seawing']),
    (['trim', 'zhang2021', '--net-heaviness-kg', '9', '--pitch-deg', '-30'], ['9', '1 kg']),
    (['trim', 'zhang2021', '--net-heaviness-kg', '0.4'], ['pitch']),
    (['score', '.'], ['not a run folder']),
    (['autopilot', 'helix', '--ros-args', '-r', '__ns:=/a'], ['__ns:=/a', '--namespace']),
    (['autopilot', 'helix', '--ros-args', '-r', '__node:=a'], ['__node:=a', 'by their names']),
    (['autopilot', 'helix', '--ros-args', '-r', '__name:=a'], ['__name:=a', 'by their names']),
    (['autopilot', 'helix', '--ros-args', '-p', 'gaurd_node:lost_after_s:=9.0'], ['guard_node']),
]


@pytest.mark.parametrize(
    ('arguments', 'words'), MISTAKES, ids=[' '.join(case[0]) for case in MISTAKES]
)
def test_mistake_ends_with_one_message_and_exit_code_2(
    arguments, words, tmp_path, monkeypatch, capsys
):
    """Called in this process, where anything but a message would be an exception."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, 'argv', ['glider', *arguments])
    try:
        code = cli.main()
    except SystemExit as end:
        code = end.code
    printed = capsys.readouterr()
    assert code == 2
    assert printed.out == ''
    for word in words:
        assert word in printed.err
    assert list(tmp_path.iterdir()) == [], 'nothing is left behind'


@pytest.mark.parametrize(
    ('values', 'words'),
    [
        ({'profile': {'dept_m': 50}}, ['profile.dept_m = 50', 'unknown field', 'depth_m']),
        ({'settle_s': float('nan')}, ['settle_s = nan', '>= 0']),
        ({'vehicle': 'boat.yaml'}, ['boat.yaml', 'no such vehicle file']),
    ],
)
def test_mistake_in_a_scenario_file_is_told_with_the_file(values, words, tmp_path):
    path = write(tmp_path / 'mission.yaml', values)
    message = refused('run', path, '--out', tmp_path / 'out', '--json')
    for word in [str(path), *words]:
        assert word in message
    assert not (tmp_path / 'out').exists()


def test_mistake_in_a_vehicle_file_is_told_before_anything_is_written(tmp_path):
    """The same --out is free for the next attempt."""
    values = yaml.safe_load(vehicle_path('zhang2021').read_text(encoding='utf-8'))
    values['moving_mass']['mass']['value'] = -18.0
    vehicle = write(tmp_path / 'mine.yaml', values)
    path = write(tmp_path / 'mission.yaml', {'vehicle': 'mine.yaml'})
    message = refused('run', path, '--out', tmp_path / 'out')
    for word in (str(vehicle), 'moving_mass.mass.value = -18.0', '> 0'):
        assert word in message
    assert not (tmp_path / 'out').exists()


def test_every_file_of_commands_is_the_command_of_its_name():
    files = [
        file
        for package in (commands, glider_flights.commands, glider_studies.commands)
        for file in Path(package.__file__).parent.rglob('*.py')
    ]
    names = {file.stem for file in files if file.name != '__init__.py'}
    group = typer.main.get_command(cli.app)
    assert group.list_commands(None) == [*cli.ORDER, *cli.OF_THE_SCRIPT]
    assert set(cli.ORDER) == names
    for name in names:
        assert group.get_command(None, name).name == name


def test_a_new_file_is_a_new_command_after_the_others(tmp_path, monkeypatch):
    (tmp_path / 'drift.py').write_text('raise OSError\n')  # it is not imported to be listed
    monkeypatch.setattr(commands, '__path__', [*commands.__path__, str(tmp_path)])
    listed = typer.main.get_command(cli.app).list_commands(None)
    assert listed == [*cli.ORDER, 'drift', *cli.OF_THE_SCRIPT]


@pytest.mark.parametrize('name', cli.OF_THE_SCRIPT)
def test_what_the_script_does_is_refused_here(name):
    with pytest.raises(ConfigurationError, match=f'^{name}: run it through the ./glider script'):
        cli.app([name, '--only', 'fuzz', '-c', '1'], standalone_mode=False)
