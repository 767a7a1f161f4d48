# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""Monte Carlo: plants that are what their seed says, results that are the same however flown."""

import json
import math
import os
import re
import shlex
import signal
import subprocess
import sys
import time
from contextlib import nullcontext
from functools import partial

import numpy as np
import pytest

import command_line
from glider_base.frames import euler_from_quaternion
from glider_base.ros.wire.topics import TOPICS
from glider_base.settings import ConfigurationError
from glider_bringup import cli
from glider_bringup.door.run import chosen_scenario
from glider_bringup.engines.direct import HeldMission
from glider_bringup.engines.flight import mission_of
from glider_bringup.scoring.again import score_again
from glider_bringup.scoring.card import fly_scored
from glider_bringup.scoring.score import Scorer
from glider_mission.blocks import COLUMNS, ROW
from glider_mission.changes import parse_assignment
from glider_mission.recording.mcap_reader import Bag
from glider_mission.recording.ros.recorded_log import RecordedLog
from glider_mission.rules import Rules
from glider_mission.run_folder import make_result_folder
from glider_mission.scenario import load_scenario
from glider_model.vehicle.file import load_vehicle
from glider_model.vehicle.perturb import (
    ADDED_MASS,
    DAMPING,
    STATIC,
    VISCOUS,
    PerturbSettings,
    perturbed,
)
from glider_studies import montecarlo
from glider_studies.commands import montecarlo as command
from glider_studies.commands.montecarlo import _print_study
from glider_studies.montecarlo import (
    NAVIGATION,
    RESULT_FILE,
    airframe,
    judge,
    make_scenarios,
    report,
    sample_plant,
    spread,
)

#: A dive to 200 m and back, scored from its first minute on.
SHORT = {'profile.depth_m': 200.0, 'settle_s': 60.0, 'duration_s': 2400.0}
OPTIONS = [f'--set={field}={value}' for field, value in SHORT.items()]
LAWS = ['adaptive', 'backstepping', 'pid']
#: What is told of the navigation of a flight, but for surfacings; statuses of five flights.
FLOWN = dict.fromkeys(NAVIGATION) | {'fixed': 0, 'surfacing_cross_track_m': []}
NONE_UP = FLOWN | {'surfacings': 0, 'surfacing_error_m': []}
STATUSES = ('completed', 'infeasible', 'completed', 'lost', 'surfaced')
#: Topics whose numbers are compared.
RECORDED = [name for name in COLUMNS if name in TOPICS]
SPREADS = (
    *('max_steady_m', 'max_all_m', 'max_run_m'),
    *('heading_fluctuation_deg', 'pitch_error_deg', 'energy_wh', 'roll_travel_deg'),
)


glider = partial(command_line.glider, columns=100)


@pytest.fixture(scope='module')
def vehicle():
    return load_vehicle('zhang2021').params()


@pytest.fixture(scope='module')
def study(tmp_path_factory):
    """Finished process of a short study by two workers, and what it wrote."""
    folder = tmp_path_factory.mktemp('study')
    process = glider(
        *('montecarlo', 'current_8deg', '--plants', 2, '--seed', 40, '--workers', 2, '--json'),
        *(*OPTIONS, '--out', folder),
    )
    assert process.returncode == 0, process.stderr
    return process, json.loads((folder / RESULT_FILE).read_text())


# ---------------------------------------------------------------------- plants


def test_a_plant_belongs_to_its_seed(vehicle):
    assert sample_plant(7, vehicle) == sample_plant(7, vehicle) != sample_plant(8, vehicle)


def test_plants_do_not_depend_on_how_many_there_are_or_where_a_study_begins():
    many = make_scenarios('current_8deg', {}, LAWS, plants=3, seed=10)
    one = make_scenarios('current_8deg', {}, ['pid'], plants=1, seed=12)
    assert many[2, 'pid'] == one[0, 'pid']
    assert many[2, 'adaptive'].perturb == many[2, 'pid'].perturb
    assert {scenario.control.law for (_, law), scenario in many.items() if law == 'pid'} == {'pid'}


def test_plants_fill_the_ranges_they_are_drawn_from(vehicle):
    plants = [sample_plant(seed, vehicle) for seed in range(400)]

    def column(section, field):
        return np.array([plant[section].get(field, math.nan) for plant in plants])

    def fills(numbers, low, high):
        margin = 0.02 * (high - low)
        assert low <= numbers.min() < low + margin
        assert high - margin < numbers.max() <= high
        assert numbers.mean() == pytest.approx(0.5 * (low + high), abs=3.0 * (high - low) / 60.0)

    for name in (*VISCOUS, *STATIC, *DAMPING, *ADDED_MASS):
        if getattr(vehicle, name) == 0.0:
            assert np.isnan(column('perturb', name)).all()
        else:
            half = 0.15 if name in ADDED_MASS else 0.3
            fills(column('perturb', name), 1.0 - half, 1.0 + half)
    fills(column('perturb', 'pitch_trim_m'), -0.010, 0.010)
    fills(column('perturb', 'roll_bias_deg'), -10.0, 10.0)
    fills(column('perturb', 'net_heaviness_kg'), -0.050, 0.050)
    fills(column('water', 'pycnocline_rise'), 0.0, 0.004)
    fills(column('water', 'pycnocline_depth_m'), 30.0, 300.0)
    net = column('water', 'compression_per_m') - column('water', 'hull_compression_per_m')
    fills(net, -1e-6 - 1e-9, 1e-6 + 1e-9)
    assert plants[3]['sensors'] == {
        'attitude_std_deg': 0.2,
        'heading_std_deg': 0.5,
        'rate_std_dps': 0.1,
        'position_std_m': 1.0,
    }


def test_control_and_guidance_know_the_file_only():
    (scenario,) = make_scenarios('current_8deg', {}, ['pid'], plants=1, seed=3).values()
    nominal = load_scenario('current_8deg', {'dives': 0, 'control.law': 'pid'})
    assert scenario.control_settings() == nominal.control_settings()
    assert scenario.guidance_settings() == nominal.guidance_settings()
    assert scenario.plant_settings() != nominal.plant_settings()


def test_nominal_airframe_is_stable_and_steers(vehicle):
    frame = airframe(vehicle, vehicle)
    assert frame['pitch_moment_kg'] == pytest.approx(-40.0, abs=0.1)
    assert frame['yaw_moment_kg'] == pytest.approx(80.0, abs=0.1)
    assert frame['steering_dive'] == frame['steering_climb'] == 1.0
    assert not frame['unstable'] and not frame['weak_steering']


def test_a_slocum_is_stable_by_its_fin():
    slocum = load_vehicle('slocum_g2').params()
    frame = airframe(slocum, slocum)
    fin = 0.5 * 1025.0 * 0.02 * 2.5 * 0.75  # rho/2 S a x, by its file
    assert frame['yaw_moment_kg'] == pytest.approx(33.0 - 64.4 + 14.0 + fin, abs=0.01)
    assert not frame['unstable']


@pytest.mark.parametrize(
    ('change', 'flag'),
    [({'K_M': 0.5}, 'unstable'), ({'K_MY': 0.45}, 'unstable'), ({'K_MY': 0.65}, 'weak_steering')],
)
def test_airframe_that_cannot_be_flown_is_flagged(vehicle, change, flag):
    assert airframe(vehicle, perturbed(vehicle, PerturbSettings(**change)))[flag]


# ---------------------------------------------------------------------- results


def test_percentiles_are_figures_that_so_many_plants_do_not_exceed():
    assert spread(list(range(1, 101))) == {'p50': 50, 'p95': 95, 'worst': 100}
    assert spread(list(range(1, 21)))['p95'] == 19
    assert spread([3.0, 1.0]) == {'p50': 1.0, 'p95': 3.0, 'worst': 3.0}
    assert spread([1.0, None]) == {'p50': 1.0, 'p95': None, 'worst': None}


def scores(**changes):
    """Scores of a good run, with other values for some fields."""
    good = {
        'cross_track_m': {'rms_steady': 0.1, 'max_steady': 0.5, 'max_all': 5.0, 'max_run': 9.0},
        'pitch_error_deg': {'rms_steady': 0.1, 'max_steady': 0.2},
        'heading_fluctuation_deg': {'rms_steady': 0.1, 'max_steady': 0.2},
        'final_state': {'position_ned_m': [1.0, 2.0, 3.0], 'attitude_rpy_rad': [0.0, 0.0, 0.0]},
        'status': 'completed',
        'reason': '',
        'navigation': dict.fromkeys(NAVIGATION),
        'energy': {'wh': 7.0},
        'actuator_travel': {'roll_mass_deg': 800.0},
    }
    return {**good, **changes}


def test_a_good_run_has_not_diverged():
    assert judge(scores()) == {
        'diverged': False,
        'outcome': 'completed',
        'reason': '',
        'max_steady_m': 0.5,
        'max_all_m': 5.0,
        'max_run_m': 9.0,
        'heading_fluctuation_deg': 0.1,
        'pitch_error_deg': 0.1,
        'energy_wh': 7.0,
        'roll_travel_deg': 800.0,
        'navigation': dict.fromkeys(NAVIGATION),
    }


@pytest.mark.parametrize(
    'change',
    [
        {'status': 'infeasible'},
        {'status': 'lost'},
        {'cross_track_m': {'max_steady': 900.0, 'max_all': 1000.1, 'max_run': 1000.1}},
        {'pitch_error_deg': {'rms_steady': math.nan}},
        {'final_state': {'position_ned_m': [1.0, math.inf, 3.0]}},
        {
            'status': 'lost',
            'navigation': dict.fromkeys(NAVIGATION) | {'surfacing_error_m': [math.nan]},
        },
    ],
)
def test_a_lost_run_has_diverged(change):
    judged = judge(scores(**change))
    assert judged['diverged']
    json.dumps(judged, allow_nan=False)


def test_percentiles_are_of_flights_that_were_flown_to_their_end(capsys):
    """A flight that failed in its first minute made them better."""
    scored = [
        scores(navigation=FLOWN | {'surfacings': i, 'surfacing_error_m': 4 * [10.0 * i]})
        for i in range(1, 6)
    ]
    for card, m, status in zip(scored, (4.0, 9.0, 0.1, 0.2, 0.3), STATUSES, strict=True):
        card['cross_track_m'] = dict.fromkeys(('max_steady', 'max_all', 'max_run'), m)
        card['status'] = status
    flights = {
        (i, 'pid'): judge(card, 'failed' if i == 2 else 'completed')
        for i, card in enumerate(scored)
    }
    frames = dict.fromkeys(range(5), {'unstable': 0, 'weak_steering': 0})
    told = report('current_8deg', {}, 0, 0, flights, frames)
    (row,) = told['rows']
    assert row['max_all_m'] == {'p50': 4.0, 'p95': 9.0, 'worst': 9.0}
    assert row['navigation']['surfacings'] == 1 + 2
    assert row['navigation']['error_m'] == {'p50': 10.0, 'p95': 20.0, 'worst': 20.0}
    counted = {'completed': 1, 'infeasible': 1, 'failed': 1, 'lost': 1, 'surfaced': 1}
    assert (row['flown_to_end'], row['outcomes']) == (2, counted)
    _print_study(told)
    printed = capsys.readouterr().out
    assert re.search(r'flown to their end +│ 2 ', printed)
    assert 'p95 of less than 20 flights is the worst' in printed
    lost = {(0, 'pid'): flights[3, 'pid']}
    (row,) = report('current_8deg', {}, 0, 0, lost, {0: frames[0]})['rows']
    assert row['max_all_m'] == {'p50': None, 'p95': None, 'worst': None}


def test_a_law_that_raises_ends_its_own_flight_only():
    class Here:
        def results(self, function, tasks, progress):
            return {key: function(task) for key, task in tasks.items()}

    def raises(seen):
        if seen.measured.vertical_rate > 0.0:
            raise ValueError('none of yours')
        return 0.0, 0.0

    changes = {}, None, raises, None, None, 300.0
    minute = {'duration_s': 60.0, 'dives': 0, 'control.law': 'pid'}
    scenarios = {
        (0, 'pid'): load_scenario('current_8deg', minute),
        (1, 'raises'): chosen_scenario('current_8deg', *changes),
    }
    flights, _ = montecarlo.fly_plants(scenarios, Here(), None)
    told = [(one['outcome'], one['reason']) for one in flights.values()]
    assert told[0] == ('completed', '') and told[1][0] == 'failed'
    assert ': ValueError: none of yours at tick ' in told[1][1]


@pytest.mark.parametrize(('status', 'code'), [('completed', 0), ('failed', 1)])
def test_a_flight_that_failed_is_exit_code_one(tmp_path, monkeypatch, status, code):
    from typer.testing import CliRunner

    judged = {(0, 'pid'): judge(scores(navigation=NONE_UP), status)}
    frame = {'unstable': 0, 'weak_steering': 0}
    monkeypatch.setattr(montecarlo, 'fly_plants', lambda *a: (judged, {0: frame}))
    monkeypatch.setattr(command, 'workers_at_work', lambda *a: nullcontext((None, None)))
    options = ['montecarlo', '--plants', '1', '--controller', 'pid', '--out', str(tmp_path)]
    assert CliRunner().invoke(cli.app, options).exit_code == code
    assert (tmp_path / RESULT_FILE).is_file()


def test_result_is_one_json_object_of_the_promised_shape(study):
    process, _ = study
    assert process.stdout.count('\n') == 1
    result = json.loads(process.stdout)
    assert (result['scenario'], result['plants'], result['seed']) == ('current_8deg', 2, 40)
    assert [row['controller'] for row in result['rows']] == LAWS
    for row in result['rows']:
        assert list(row)[: 2 + len(SPREADS)] == ['controller', 'diverged', *SPREADS]
        assert row['diverged'] == 0
        for name in SPREADS:
            assert list(row[name]) == ['p50', 'p95', 'worst']
            most = 20000.0 if name == 'roll_travel_deg' else 60.0
            assert 0.0 <= row[name]['p50'] <= row[name]['p95'] <= row[name]['worst'] < most


def test_number_of_workers_changes_nothing(study):
    process = glider(
        *('montecarlo', 'current_8deg', '--plants', 2, '--seed', 40, '--workers', 1, '--json'),
        *OPTIONS,
    )
    assert process.stdout == study[0].stdout


def test_folder_tells_of_every_plant(study, vehicle):
    _, result = study
    assert [one['plant'] for one in result['flown']] == [0, 1]
    for one in result['flown']:
        sampled = sample_plant(40 + one['plant'], vehicle)
        assert {name: one[name] for name in sampled} == sampled
        assert list(one['flights']) == LAWS
    for row in result['rows']:
        figures = [one['flights'][row['controller']]['max_all_m'] for one in result['flown']]
        assert row['max_all_m']['worst'] == max(figures)


def test_command_of_a_plant_flies_it_again(study, tmp_path):
    """By its own command over ``./glider run``, to the same figures."""
    one = study[1]['flown'][1]
    words = shlex.split(one['commands']['pid'])
    assert words[:2] == ['./glider', 'run']
    assert dict(map(parse_assignment, words[words.index('--set') + 1 :: 2]))['seed'] == 41
    process = glider(*words[1:], '--json', '--out', tmp_path / 'again')
    assert process.returncode == 0, process.stderr
    flown = judge({'infeasible': False, **json.loads(process.stdout)})
    assert flown == one['flights']['pid']


def test_command_of_a_plant_flies_it_over_its_own_bottom(tmp_path):
    options = ('--plants', 1, '--seed', 7, '--controller', 'pid', '--duration', 900)
    folder, water = tmp_path / 'study', ('--set', 'water.bottom_m=400')
    process = glider('montecarlo', 'current_12deg', *water, *options, '--out', folder)
    assert process.returncode == 0, process.stderr
    (one,) = json.loads((folder / RESULT_FILE).read_text())['flown']
    words = shlex.split(one['commands']['pid'])
    process = glider(*words[1:], '--json', '--out', tmp_path / 'again')
    assert process.returncode == 0, process.stderr
    card = json.loads(process.stdout)
    assert judge({'infeasible': False, **card}) == one['flights']['pid']
    assert card['bottom']['least_height_m'] > 0.0


@pytest.mark.parametrize(
    ('field', 'value', 'allowed'),
    [
        ('seed', 5, 'fields that are not'),
        ('perturb.K_D0', 1.2, 'fields that are not'),
        ('sensors', {'gps_std_m': 9.0}, 'fields that are not'),
        ('water.pycnocline_rise', 0.001, 'fields that are not'),
        ('control.law', 'pid', '--controller'),
        ('dives', 4, '--duration'),
    ],
)
def test_what_a_study_says_itself_cannot_be_set(field, value, allowed):
    """It was accepted, told in the command of each plant, and not flown."""
    with pytest.raises(ConfigurationError, match=rf'--set {field}=.*allowed: {allowed}'):
        make_scenarios('reckoned_12deg', {field: value}, ['pid'], 1, 0)


def test_what_is_not_drawn_of_sensors_and_vehicle_is_as_it_was_set():
    told = {'sensors.gyro': False, 'sensors.fix_missed_share': 0.5, 'perturb.roll_range': 0.5}
    (one,) = make_scenarios('reckoned_12deg', told, ['pid'], 1, 0).values()
    assert (one.sensors.gyro, one.sensors.fix_missed_share) == (False, 0.5)
    assert one.perturb.roll_range == 0.5
    (plain,) = make_scenarios('reckoned_12deg', {}, ['pid'], 1, 0).values()
    assert one.perturb.K_D0 == plain.perturb.K_D0 != 1.0
    assert one.sensors.gps_std_m == plain.sensors.gps_std_m


def test_a_plant_flies_in_the_water_of_a_cast():
    cast = {'water.profile': [[0.0, 1024.0], [100.0, 1027.0], [1200.0, 1030.0]]}
    for one in make_scenarios('current_12deg', cast, ['pid'], 2, 7).values():
        assert one.water.profile == cast['water.profile']
        assert one.plant_settings().params()


def test_table_names_the_worst_plant_and_its_command():
    process = glider('montecarlo', 'current_8deg', '--plants', 1, '--controller', 'pid', *OPTIONS)
    assert process.returncode == 0, process.stderr
    for words in ('p50 / p95 / worst', 'statically unstable', 'steer weakly', 'plant 0'):
        assert words in process.stdout
    assert './glider run current_8deg --engine direct --controller pid' in process.stdout


@pytest.mark.parametrize('method', ['dead_reckoned', 'known'])
def test_table_of_a_study_too_short_for_a_fourth_surfacing(method, capsys):
    """It ended in a traceback, and told a share of 0 where nobody reckoned."""
    name, changes = 'reckoned_12deg', {**SHORT, 'profile.depth_m': 60.0, 'settle_s': 10.0}
    changes |= {'profile.surface_every_dives': 1, 'navigation.method': method}
    (scenario,) = make_scenarios(name, changes, ['pid'], 1, 0).values()
    _, scores = fly_scored(scenario)
    flown, frames = {(0, 'pid'): judge(scores)}, {0: {'unstable': 0, 'weak_steering': 0}}
    study = report(name, changes, 0, 0, flown, frames)
    _print_study(study)
    told, printed = study['rows'][0]['navigation'], capsys.readouterr().out
    assert (told['surfacings'] > 0, told['error_m']) == (True, None)
    assert (told['ellipse_95_share'] is None) == (method == 'known')
    assert (told['innovation_squared'] is None) == (method == 'known')
    assert ('inside the 95 % ellipse' in printed) == (method == 'dead_reckoned')


@pytest.mark.parametrize(
    ('options', 'message'),
    [
        (['--plants', '0'], '--plants'),
        (['--seed', '-1'], '--seed'),
        (['--workers', '0'], '--workers'),
        (['--controller', 'lqr'], '--controller'),
        (['--duration', 'long'], '--duration long: not usable (allowed: 0.1 to 1e+08, or full)'),
        (['--set', 'profile.depth_m=1'], 'profile.depth_m = 1: should be greater than'),
        (['no_such_scenario'], "scenario = 'no_such_scenario': no such scenario"),
    ],
)
def test_wrong_options_are_refused(options, message):
    process = glider('montecarlo', *options)
    assert process.returncode == 2
    assert message in process.stderr
    assert 'Traceback' not in process.stderr
    assert process.stdout == ''


def test_a_result_is_never_written_over(tmp_path):
    (tmp_path / RESULT_FILE).write_text('{}')
    with pytest.raises(ConfigurationError, match='never written over'):
        make_result_folder(tmp_path, montecarlo.RESULT_FILE)
    make_result_folder(tmp_path / 'at_once', montecarlo.RESULT_FILE)
    with pytest.raises(ConfigurationError, match='another study is at work here'):
        make_result_folder(tmp_path / 'at_once', montecarlo.RESULT_FILE)


def _descendants(pid):
    """Processes that a process has started, by /proc."""
    found = []
    for entry in os.listdir('/proc'):
        if entry.isdigit():
            try:
                with open(f'/proc/{entry}/stat') as file:
                    parent = int(file.read().rsplit(')', 1)[1].split()[1])
            except OSError:
                continue
            if parent == pid:
                found += [int(entry), *_descendants(int(entry))]
    return found


@pytest.mark.skipif(not os.path.isdir('/proc/self'), reason='needs /proc')
@pytest.mark.parametrize('number', [signal.SIGINT, signal.SIGTERM, signal.SIGKILL])
def test_no_worker_outlives_the_command(number, tmp_path):
    """Ctrl-C goes to the whole group, as from a terminal; the others to the command alone."""
    command = [sys.executable, '-m', 'glider_bringup.cli', 'montecarlo', '--controller', 'pid']
    process = subprocess.Popen(
        command,
        stderr=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
        start_new_session=True,
        env={**os.environ, 'TMPDIR': str(tmp_path)},
    )
    try:
        end = time.monotonic() + 120.0
        while len(children := _descendants(process.pid)) < 2 + 1:  # workers, resource tracker
            assert time.monotonic() < end and process.poll() is None
            time.sleep(0.05)
        if number == signal.SIGKILL:
            process.kill()
            process.wait()
        else:
            (os.killpg if number == signal.SIGINT else os.kill)(process.pid, number)
            out, error = process.communicate(timeout=120.0)
            assert (process.returncode, out) == (130, '')
            assert f'stopped by {number.name}' in error
            assert 'Traceback' not in error
            assert not [*tmp_path.glob('glider-*')]
        end = time.monotonic() + 60.0
        while any(os.path.exists(f'/proc/{child}') for child in children):
            assert time.monotonic() < end
            time.sleep(0.05)
    finally:
        if process.poll() is None:
            os.killpg(process.pid, signal.SIGKILL)
            process.wait()
        process.stdout.close()
        process.stderr.close()


# ---------------------------------------------------------------------- noise in a mission


NOISE = {f'sensors.{field}': value for field, value in montecarlo.SENSORS.items()}


@pytest.fixture(scope='module')
def noisy_flight():
    """Scenario, log, and for every tick the position (NED) and quaternion that the plant had."""
    fields = {
        **SHORT,
        **NOISE,
        'profile.depth_m': 60.0,
        'duration_s': 1500.0,
        'dives': 0,
        'seed': 5,
        'path.course_deg': 30.0,
        'initial.heading_deg': 30.0,
        'initial.east_m': 3.0,
    }
    scenario = load_scenario('current_8deg', fields)
    held = HeldMission(*mission_of(scenario))
    log, truth, finished = np.empty((15000, ROW)), [], False
    for tick in range(len(log)):
        truth.append(held.state.plant.motion[:7])
        _, finished = held.fly(log[tick : tick + 1])
    assert finished
    return scenario, log, np.array(truth)


def test_score_with_noise_is_that_of_the_true_motion(noisy_flight):
    scenario, log, truth = noisy_flight
    scorer = Scorer(scenario)
    for block in (log[:7000], log[7000:7001], log[7001:]):
        scorer.add(block)
    result = scorer.result(Rules(60.0, 60.0))
    course = math.radians(30.0)
    across = math.cos(course) * truth[:, 1] - math.sin(course) * truth[:, 0]
    expected = np.max(np.abs(across[601:]))
    assert result['cross_track_m']['max_all'] == pytest.approx(expected, abs=1e-6)
    assert result['depth_m']['max'] == pytest.approx(np.max(truth[:, 2]), abs=1e-9)
    final = result['final_state']
    assert final['position_ned_m'] == pytest.approx(list(truth[-1, :3]), abs=1e-9)
    attitude = euler_from_quaternion(*truth[-1, 3:])
    assert final['attitude_rpy_rad'] == pytest.approx(list(attitude), abs=1e-12)


def of_the_sea(log):
    """The log of a vehicle whose true motion nobody knows."""
    told = log.copy()
    told[:, COLUMNS['ground_truth/odom']] = np.nan
    return told


def test_what_is_recorded_is_what_was_measured(noisy_flight):
    scenario, log, truth = noisy_flight
    east = COLUMNS['odom'].start
    noise = log[:, [east + 1, east]] - truth[:, :2]
    assert np.std(noise) == pytest.approx(1.0, rel=0.02)
    apparent = Scorer(scenario)
    apparent.add(of_the_sea(log))
    assert apparent.result(Rules(60.0, 60.0))['depth_m']['max'] > np.max(truth[:, 2]) + 0.5


def test_nodes_and_direct_engine_agree_with_noise_on_a_perturbed_plant(vehicle, tmp_path):
    sampled = sample_plant(11, vehicle)
    options = [f'--set={field}={json.dumps(value)}' for field, value in sampled.items()]
    cards, digests = [], []
    for engine in ('nodes', 'direct'):
        folder = tmp_path / engine
        process = glider(
            *('run', 'current_8deg', '--engine', engine, '--bag', '--duration', 60, '--json'),
            *('--set', 'settle_s=10', '--out', folder, *options),
        )
        assert process.returncode == 0, process.stderr
        cards.append(json.loads(process.stdout))
        rows = np.concatenate(
            [block.copy() for block in RecordedLog(Bag(folder), RECORDED).blocks()]
        )
        digests.append(rows.tobytes())
    assert digests[0] == digests[1]
    for name in ('ticks', 'cross_track_m', 'depth_m', 'final_state'):
        assert cards[0][name] == cards[1][name]
    assert score_again(tmp_path / 'nodes') == cards[0]
