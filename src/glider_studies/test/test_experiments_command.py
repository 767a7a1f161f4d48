# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""Experiments: verdicts that follow from scores, results that are the same however flown."""

import copy
import json
import math
import os
import shlex
import signal
import time
from functools import partial
from typing import get_args

import numpy as np
import pytest
from rich.console import Console

import command_line
from glider_base.settings import ConfigurationError
from glider_bringup import cli
from glider_bringup.scoring.one_hertz import Record, Rows
from glider_mission.changes import parse_assignment
from glider_mission.disk import DiskError
from glider_mission.planned import horizontal_speed
from glider_mission.run_folder import make_result_folder
from glider_mission.scenario import load_scenario
from glider_model.plant.trim import solve_trim
from glider_model.vehicle.file import load_vehicle
from glider_studies import bottoms, forecasts, routes
from glider_studies.commands.experiments import Group
from glider_studies.hunt import search
from glider_studies.paper import experiments, measures
from glider_studies.paper.experiments import (
    FAILED,
    PASSED,
    RESULT_FILE,
    Case,
    Experiment,
    catalogue,
    expectation,
    fly,
    make_experiments,
    pid_better,
    report,
)
from glider_studies.paper.judges import judge_ablation, judge_envelope, judge_limits, judge_survey
from glider_studies.workers import worker_pool

ROW_FIELDS = {'case', 'controller', 'guidance', 'status', 'finite', 'cross_track_m', 'command'}


glider = partial(command_line.glider, columns=80)


# --------------------------------------------------------------------------- what is flown


@pytest.fixture(scope='module')
def planned():
    return {one.name: one for one in make_experiments(list(catalogue()))}


def test_command_line_knows_every_group():
    assert get_args(Group) == (
        *(*catalogue(), search.NAME),
        *(one.NAME for one in (routes, forecasts, bottoms)),
    )


def test_every_experiment_can_be_flown(planned):
    assert {one.group for one in planned.values()} == set(catalogue())
    for one in planned.values():
        for case in one.cases:
            scenario = case.load()
            assert scenario.dives == 0
            assert (scenario.control.law, scenario.guidance.los.method) == case[1:3]


def test_a_pid_that_is_given_the_steering_of_another_vehicle_has_that_of_its_file(planned):
    cases = [case for one in planned.values() for case in one.cases if 'PID of' in case.case]
    assert cases
    for case in cases:
        steering = load_vehicle(case.load().vehicle).steering_rates
        assert steering == load_vehicle(case.case.split()[-1]).steering_rates


def test_paper_experiments_are_of_thirty_hours(planned):
    for name, angle in {'current_8deg': 8, 'current_10deg': 10, 'current_12deg': 12}.items():
        ways = {(case.controller, case.guidance) for case in planned[name].cases}
        assert ways == {
            (law, los)
            for law in ('adaptive', 'backstepping', 'pid')
            for los in ('los_current', 'los_zhang2021')
        }
        scenario = planned[name].cases[0].load()
        assert scenario.duration_s == 30 * 3600
        assert (scenario.current.speed_kn, scenario.current.angle_deg) == (1.0, angle)


def test_every_piece_that_is_off_has_a_figure_it_was_built_for(planned):
    cases = planned['ablation'].cases
    places = {case.case.partition(', ')[0] for case in cases}
    pieces = {case.case.partition(', ')[2]: case for case in cases}
    assert len(cases) == len(places) * len(pieces)
    for name, case in pieces.items():
        if name != 'whole':
            where, _ = case.facts['built_for']
            assert where in places
            assert case.load() != pieces['whole'].load()


def test_a_piece_has_its_place_if_a_tenth_is_lost_without_it():
    def row(case, steady, status='completed'):
        return made_up(case=case, cross_track_m__max_steady=steady, status=status) | (
            {'built_for': ['here', 'cross_track_m.max_steady']} if 'whole' not in case else {}
        )

    whole = [row('here, whole', 1.0), row('there, whole', 1.0)]
    rows = [*whole, row('here, good', 1.2), row('there, good', 0.5), row('here, idle', 1.05)]
    rows += [row('here, needed', 0.1, 'infeasible')]
    checks = {check.what: check.passed for check in judge_ablation(rows)}
    assert checks == {
        'here, good: cross_track_m.max_steady': True,
        'here, idle: cross_track_m.max_steady': False,
        'here, needed: cross_track_m.max_steady': True,
    }


def test_a_flight_that_is_cut_short_is_a_verdict_and_a_table(capsys):
    """They ended in a traceback, after all flights of all groups."""
    from glider_studies.paper import tables

    built_for = {'built_for': ['here', 'cross_track_m.max_steady']}
    lost = made_up(case='here, whole', cross_track_m__max_steady=None, status='failed')
    ablation = [lost, made_up(case='here, piece') | built_for]
    survey = [made_up(), made_up('pid')]
    del survey[1]['legs'][1]
    planned = {'ablation': judge_ablation, 'survey': judge_survey}
    found = report(
        [Experiment('', name, '', '', '', [], judge) for name, judge in planned.items()],
        [ablation, survey],
    )
    assert [one['verdict'] for one in found['experiments']] == [FAILED, PASSED]
    tables.show(found, Console(width=120))
    shown = capsys.readouterr().out
    assert 'here, piece: cross_track_m.max_steady = 0.500, allowed -' in shown
    assert 'leg on course 180 deg' in shown


@pytest.mark.parametrize('law', ['pid', 'backstepping'])
def test_what_is_better_than_the_adaptive_law_is_marked_and_the_mark_is_told(law, capsys):
    """In a narrow terminal, too, no name is cut."""
    from glider_studies.paper import tables

    rows = [made_up(), made_up(guidance='los_zhang2021'), made_up(law, path_error_m__e2_max=0.1)]
    one = Experiment('', 'current_8deg', '', '', '', [], judge_limits({}, 'adaptive'))
    tables.show(report([one], [rows]), Console(width=80))
    shown = capsys.readouterr().out
    assert '0.10*' in shown
    assert '\n* better than the adaptive law\n' in shown
    assert '…' not in shown


def test_command_of_a_row_flies_the_same_scenario(planned):
    cases = [case for one in planned.values() for case in one.cases]
    for case in cases[::7]:
        words = shlex.split(case.command())
        fields = {'dives': 0}
        for option, value in zip(words[:-1], words[1:], strict=True):
            if option == '--set':
                fields.update([parse_assignment(value)])
        fields['control.law'] = words[words.index('--controller') + 1]
        fields['guidance.los.method'] = words[words.index('--guidance') + 1]
        assert load_scenario(words[2], fields) == case.load()


def test_steering_is_changed_as_the_case_says(planned):
    """x0.4 and x2 in the dive; reversed: in the dive only."""
    shares = {
        case.case.removeprefix('steering '): case.facts['steering']
        for case in planned['robustness'].cases
        if 'steering' in case.facts
    }
    assert shares['x0.4']['dive'] == pytest.approx(0.4, abs=0.01)
    assert shares['x2']['dive'] == pytest.approx(2.0, abs=0.01)
    assert shares['reversed']['dive'] < -0.3
    assert shares['reversed']['climb'] > 0.15


def test_horizontal_speed_is_that_of_the_trimmed_vehicle():
    scenario = load_scenario('current_8deg')
    trim = solve_trim(load_vehicle('zhang2021').params(), 0.4, pitch_deg=-30.0)
    assert horizontal_speed(scenario) == pytest.approx(trim.horizontal_mps, rel=0.01)


@pytest.mark.parametrize(
    ('current', 'angle', 'expected'),
    [
        (0.30, 90.0, 'feasible'),
        (0.39, 90.0, 'marginal'),  # cross current 0.975 U_h
        (0.41, 90.0, 'infeasible'),
        (0.41, 180.0, 'infeasible'),  # no progress
        (0.39, 180.0, 'feasible'),
        (2.00, 0.0, 'feasible'),
    ],
)
def test_expectation_is_physics(current, angle, expected):
    found = expectation(0.4, current, angle)
    assert found['expected'] == expected
    across = abs(current * math.sin(math.radians(angle)))
    assert found['limit_m'] == pytest.approx(111.0 * across + 1.0)


# --------------------------------------------------------------------------- verdicts


def made_up(controller='adaptive', guidance='los_current', case='', **fields):
    """Row of a good flight, with some of its figures changed (dots as double underscores)."""
    row = {
        'case': case,
        'controller': controller,
        'guidance': guidance,
        'status': 'completed',
        'finite': True,
        'cross_track_m': {'rms_steady': 0.1, 'max_steady': 0.5, 'max_all': 4.0, 'max_run': 8.0},
        'pitch_error_deg': {'rms_steady': 0.1, 'max_steady': 0.4},
        'heading_fluctuation_deg': {'rms_steady': 0.1, 'max_steady': 0.4},
        'depth_m': {'max': 1003.0, 'overshoot': 3.0},
        'path_error_m': {'e2_rms': 0.3, 'e2_max': 0.6, 'e3_rms': 1.0, 'e3_max': 2.0},
        'waypoints_closest_m': [0.0, 3.0, 9.9],
        'legs': [
            {'course_deg': 0.0, 'heading_spread_deg': 10.0, 'heading_off_course_deg': -20.0},
            {'course_deg': 180.0, 'heading_spread_deg': 10.0, 'heading_off_course_deg': 20.0},
        ],
        'expected': 'feasible',
        'limit_m': 5.0,
        'crab_error_deg': 0.1,
    }
    for field, value in fields.items():
        *groups, last = field.split('__')
        target = row
        for group in groups:
            target = target[group]
        target[last] = value
    return row


def passes(judge, *rows):
    checks = judge(list(rows))
    return bool(checks) and all(check.passed for check in checks)


@pytest.mark.parametrize(
    ('name', 'fields'),
    [
        ('current_8deg', {'cross_track_m__max_all': 5.01}),
        ('current_8deg', {'cross_track_m__max_steady': 1.01}),
        ('current_8deg', {'cross_track_m__rms_steady': 0.31}),
        ('current_8deg', {'pitch_error_deg__rms_steady': 0.41}),
        ('current_8deg', {'pitch_error_deg__max_steady': 2.01}),
        ('current_8deg', {'heading_fluctuation_deg__rms_steady': 0.31}),
        ('current_8deg', {'cross_track_m__max_steady': None}),
        ('current_8deg', {'status': 'infeasible'}),
        ('current_10deg', {'cross_track_m__max_all': 6.01}),
        ('current_12deg', {'cross_track_m__max_all': 7.01}),
        ('yaw_10deg_adaptive', {'heading_fluctuation_deg__rms_steady': 0.31}),
        ('profile', {'depth_m__overshoot': 20.1}),
        ('robustness', {'cross_track_m__max_steady': 3.01}),
        ('helix', {'path_error_m__e2_rms': 0.51}),
        ('spline', {'path_error_m__e3_rms': 1.71}),
        ('survey', {'waypoints_closest_m': [0.0, 3.0, 10.1]}),
        ('envelope', {'cross_track_m__max_all': 5.01}),
    ],
)
def test_a_regression_fails_its_experiment(planned, name, fields):
    judge = planned[name].judge
    assert passes(judge, made_up())
    assert not passes(judge, made_up(**fields))


def test_limits_are_for_the_adaptive_law_alone(planned):
    lost = {'cross_track_m__max_steady': 9000.0, 'status': 'infeasible'}
    for name in ('current_12deg', 'robustness'):
        rows = [made_up(), made_up('pid', **lost), made_up('adaptive', 'los_zhang2021', **lost)]
        assert passes(planned[name].judge, *rows)


def test_the_opponent_must_not_become_a_straw_man(planned):
    judge = planned['yaw_10deg_pid'].judge
    assert passes(judge, made_up('pid'))
    assert not passes(judge, made_up('pid', cross_track_m__max_steady=3.1))


def test_no_flight_is_no_pass():
    assert not passes(judge_limits({}), made_up('pid'))
    one = Experiment('yaw', 'empty', '', '', '', [], judge_limits({}))
    assert report([one], [[]])['experiments'][0]['verdict'] == FAILED


@pytest.mark.parametrize(
    'leg',
    [
        {'heading_spread_deg': 46.0},  # dithers
        {'heading_off_course_deg': 340.0},  # came round in a loop
    ],
)
def test_survey_with_a_loop_or_dithering_fails(leg):
    row = made_up()
    row['legs'][1].update(leg)
    assert not passes(judge_survey, row)


def test_survey_that_is_cut_short_fails():
    row = made_up()
    del row['legs'][1]
    assert not passes(judge_survey, row)


def test_envelope_beyond_the_limit_must_be_flagged_and_hold_the_best_crab():
    beyond = {'expected': 'infeasible', 'cross_track_m__max_all': 5000.0}
    assert passes(judge_envelope, made_up(status='infeasible', **beyond))
    assert not passes(judge_envelope, made_up(**beyond))
    assert not passes(judge_envelope, made_up(status='infeasible', crab_error_deg=2.1, **beyond))
    assert not passes(judge_envelope, made_up(status='infeasible', finite=False, **beyond))


def test_envelope_between_both_limits_asks_for_finite_numbers_only():
    between = {'expected': 'marginal', 'cross_track_m__max_all': 500.0, 'status': 'infeasible'}
    assert passes(judge_envelope, made_up(**between))
    assert not passes(judge_envelope, made_up(finite=False, **between))


def test_where_the_pid_is_better_is_told():
    rows = [
        made_up(case='a'),
        made_up('pid', case='a', cross_track_m__max_steady=0.4, cross_track_m__max_all=4.1),
        made_up('pid', case='b', cross_track_m__max_steady=0.4),
    ]
    for row in rows:
        del row['path_error_m']
    better = pid_better(rows)
    assert [(one['case'], one['figure']) for one in better] == [('a', 'cross_track_m.max_steady')]
    assert (better[0]['pid'], better[0]['adaptive']) == (0.4, 0.5)


def test_numbers_that_json_does_not_have_are_told_as_none():
    scores = {
        'infeasible': False,
        'cross_track_m': {'max_all': math.nan},
        'final_state': {'a': [1]},
    }
    row = experiments._row(scores)
    assert (row['finite'], row['cross_track_m']['max_all']) == (False, None)
    scores['cross_track_m']['max_all'] = 1.0
    assert experiments._row(scores)['finite'] is True


# --------------------------------------------------------------------------- measures


def survey_record(heading):
    """Target along three legs, north, west and south, 2000 s each; heading as given (deg)."""
    record = copy.copy(Record(Rows().result()))
    time_s = np.arange(6000.0)
    course = np.radians(np.repeat([0.0, -90.0, -180.0], 2000))
    record.time_s = time_s
    record.target_north = np.concatenate(([0.0], np.cumsum(np.cos(course))[:-1]))
    record.target_east = np.concatenate(([0.0], np.cumsum(np.sin(course))[:-1]))
    record.heading = heading(time_s, np.degrees(course))
    return record


def test_legs_of_a_calm_survey():
    legs = list(measures._legs(survey_record(lambda t, course: course + 10.0)))
    assert [round(leg['course_deg']) for leg in legs] == [0, -90, -180]
    for leg in legs:
        assert leg['heading_spread_deg'] == pytest.approx(0.0, abs=1e-9)
        assert leg['heading_off_course_deg'] == pytest.approx(10.0, abs=1e-9)


def test_heading_may_be_counted_from_anywhere():
    legs = list(measures._legs(survey_record(lambda t, course: course - 720.0)))
    assert legs[0]['heading_off_course_deg'] == pytest.approx(0.0, abs=1e-9)


def test_a_loop_shows_in_the_legs():
    def loop(t, course):
        return course + 360.0 * np.clip((t - 2100.0) / 100.0, 0.0, 1.0)

    legs = list(measures._legs(survey_record(loop)))
    assert legs[1]['heading_off_course_deg'] == pytest.approx(360.0)


def test_dithering_shows_in_the_legs():
    legs = list(measures._legs(survey_record(lambda t, c: c + 60.0 * np.sin(t / 30.0))))
    assert all(leg['heading_spread_deg'] > 100.0 for leg in legs)


# --------------------------------------------------------------------------- flights


SHORT = {'duration_s': 1200.0, 'profile.depth_m': 50.0, 'settle_s': 60.0}


def test_results_do_not_depend_on_workers():
    cases = [Case('', law, 'los_current', 'current_8deg', SHORT) for law in ('adaptive', 'pid')]
    told = Case('told', 'pid', 'los_current', 'current_8deg', {**SHORT, 'vehicle': 'seawing'})
    other = {'vehicle.steering.dive': 0.0287, 'vehicle.steering.climb': -0.037}
    cases += [told, told._replace(case='told another', changes={**told.changes, **other})]
    one = Experiment('current', 'short', '', '', '', cases, judge_limits({}))
    counts, results = [], []
    for workers in (1, 2):
        with worker_pool(workers) as pool:
            rows, records = fly([one], pool, counts.append)
        assert records == [[None] * 4]
        results.append(json.dumps(report([one], rows), allow_nan=False))
    assert results[0] == results[1]
    assert counts == [1, 2, 3, 4] * 2
    rows = json.loads(results[0])['experiments'][0]['rows']
    assert rows[2]['final_state'] != rows[3]['final_state']  # what the PID is told matters
    assert 'vehicle.steering.dive=0.0287' in rows[3]['command']


@pytest.fixture(scope='module')
def paths():
    return glider('experiments', '--only', 'paths', '--json')


def test_command_prints_one_json_object_and_nothing_else(paths):
    assert paths.returncode == 0, paths.stderr
    assert paths.stdout.count('\n') == 1
    told = json.loads(paths.stdout)['experiments']
    assert [one['name'] for one in told] == ['helix', 'spline', 'survey']
    for one in told:
        assert {'name', 'section', 'paper', 'rows', 'verdict'} <= set(one)
        assert one['verdict'] == PASSED
        for row in one['rows']:
            assert set(row) >= ROW_FIELDS
    assert len(told[0]['rows']) == 16
    assert len(told[2]['rows'][0]['waypoints_closest_m']) == 6


def test_result_for_a_person_fits_a_narrow_terminal(paths, capsys):
    from glider_studies.paper import tables

    result = json.loads(paths.stdout)
    result['experiments'][0]['verdict'] = FAILED
    result['experiments'][0]['checks'][0].update(passed=False, value=3.0)
    tables.show(result, Console(width=80, force_terminal=False))
    shown = capsys.readouterr().out
    assert 'verdict: failed' in shown
    assert '= 3.000, allowed' in shown
    assert '2 of 3 experiments passed' in shown
    assert '…' not in shown


def test_figures_are_drawn_of_what_was_flown(tmp_path):
    """Only those whose flights there are."""
    from glider_studies.showing import paper_figures

    cases = [Case('', 'pid', 'los_current', 'current_8deg', SHORT, drawn=True)]
    one = Experiment('profile', 'profile', '', '', '', cases, judge_limits({}, 'pid'))
    with worker_pool(1) as pool:
        rows, records = fly([one], pool, lambda done: None)
    files = paper_figures.draw([one], rows, records, tmp_path)
    assert [file.name for file in files] == ['figure_05.png', 'figure_06.png', 'figure_07.png']
    for file in files:
        assert file.read_bytes().startswith(b'\x89PNG')


@pytest.mark.parametrize(
    ('options', 'message'),
    [(['--only', 'weather'], '--only'), (['--workers', '0'], '--workers')],
)
def test_wrong_options_are_refused(options, message):
    process = glider('experiments', *options)
    assert (process.returncode, process.stdout) == (2, '')
    assert message in process.stderr
    assert 'Traceback' not in process.stderr


def test_a_result_is_never_written_over(tmp_path):
    (tmp_path / RESULT_FILE).write_text('{}')
    with pytest.raises(ConfigurationError, match='never written over'):
        make_result_folder(tmp_path, RESULT_FILE)


def test_a_failed_verdict_is_exit_code_one(tmp_path, monkeypatch):
    from typer.testing import CliRunner

    one = Experiment('paths', 'helix', '', 'made up', 'not flown', [], judge_limits({}))
    monkeypatch.setattr(experiments, 'make_experiments', lambda groups: [one])
    for rows, code in (([made_up()], 0), ([made_up(status='infeasible')], 1)):
        monkeypatch.setattr(experiments, 'fly', lambda *a, rows=rows: ([rows], [[]]))
        out = tmp_path / str(code)
        options = ['--only', 'paths', '--json', '--out', str(out)]
        assert CliRunner().invoke(cli.app, ['experiments', *options]).exit_code == code
        assert (out / RESULT_FILE).is_file()


def test_a_disk_that_is_full_takes_no_result(tmp_path, monkeypatch):
    from typer.testing import CliRunner

    def full(path, text):
        raise DiskError(f'{path}: cannot be written: No space left on device')

    one = Experiment('paths', 'helix', '', 'made up', 'not flown', [], judge_limits({}))
    monkeypatch.setattr(experiments, 'make_experiments', lambda groups: [one])
    monkeypatch.setattr(experiments, 'fly', lambda *a: ([[made_up()]], [[]]))
    studies = {'experiments': ['--only', 'paths'], 'montecarlo': ['--plants', '1']}
    studies['montecarlo'] += ['--controller', 'pid', '--duration', '10', '--workers', '1']
    for study, options in studies.items():
        monkeypatch.setattr(f'glider_studies.commands.{study}.write_whole', full)
        done = CliRunner().invoke(
            cli.app, [study, *options, '--json', '--out', str(tmp_path / study)]
        )
        assert isinstance(done.exception, DiskError)
        assert json.loads(done.stdout)


def test_interrupt_ends_the_command(tmp_path):
    options = ['experiments', '--only', 'current', '--workers', '1']
    process = command_line.Started(options, {**os.environ}, tmp_path)
    try:
        while not (tmp_path / 'stderr').exists() or not (tmp_path / 'stderr').read_text():
            assert process.poll() is None
            time.sleep(0.05)
        time.sleep(1.5)
        process.send_signal(signal.SIGINT)
        out, error = process.communicate(timeout=300.0)
        assert (process.returncode, out) == (130, '')
        assert error.startswith('3 experiments, 18 flights\n')
        assert 'stopped by SIGINT' in error
        assert 'Traceback' not in error
    finally:
        process.kill()


def test_every_vehicle_flies_with_position_known_and_reckoned(planned):
    """By both laws; the limits are those of navigation, and hold for the adaptive law."""
    known, reckoned = planned['vehicles'], planned['vehicles_reckoned']
    flown = [(one.case, one.controller) for one in known.cases]
    assert flown == [(one.case, one.controller) for one in reckoned.cases]
    assert len({case for case, _ in flown}) == 4 and len(flown) == 8
    assert {one.load().navigation.method for one in known.cases} == {'known'}
    for scenario in (one.load() for one in reckoned.cases):
        assert scenario.navigation.method == 'dead_reckoned'
        assert scenario.profile.surface_every_dives == 1
        assert scenario.sensors.compass_bias_deg == 1.0 and scenario.sensors.pitch_scale == 0.96

    def verdict(controller, beside_m):
        from_fourth = {'surfacing_cross_track_m': beside_m, 'under_water_rms_m': 10.0}
        row = {'case': 'seaglider', 'controller': controller, 'guidance': 'los_current'}
        row |= {'status': 'completed', 'navigation': {'from_fourth': from_fourth}}
        return [check.passed for check in reckoned.judge([row])]

    assert all(verdict('adaptive', 49.0)) and not all(verdict('adaptive', 51.0))
    assert verdict('pid', 51.0) == []
