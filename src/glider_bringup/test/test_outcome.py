# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""What became of a vehicle: the same word wherever it is told, by its true depth."""

import json
import re
from importlib.resources import files

import numpy as np
import pytest

import command_line
from glider_base.signals import TICK_S
from glider_bringup.scoring.card import STATUSES, fly_scored
from glider_bringup.scoring.score import Scorer
from glider_bringup.showing.scorecard import arrival_text, event_texts
from glider_guard.rows import CRUSHING, LEAK, NOT_RISING, STUCK_ROLL
from glider_mission.blocks import COLUMNS, ROW
from glider_mission.rules import Rules
from glider_mission.scenario import load_scenario
from glider_model.vehicle.file import load_vehicle

TRUTH, ESTIMATE = (
    COLUMNS['ground_truth/odom'],
    slice(*[COLUMNS['odom'].start + i for i in (0, 13)]),
)


def scores(
    depth, guard=0, believed=None, vehicle='zhang2021', north=0.0, target=0.0, e2=0.0, rules=None
):
    """Scores of a made-up flight at some true depths (m), with what the guard tells."""
    log = np.zeros((len(depth), ROW))
    log[:, TRUTH.start + 1], log[:, TRUTH.start + 2] = north, -depth
    log[:, TRUTH.start + 3] = 1.0
    log[:, ESTIMATE] = log[:, TRUTH.start : TRUTH.start + 13]
    if believed is not None:
        log[:, ESTIMATE.start + 2] = -believed
    reference = COLUMNS['reference'].start
    log[:, reference + 1], log[:, reference + 3] = target, 1.0
    log[:, COLUMNS['tracking_error'].start + 1] = e2
    log[:, COLUMNS['guard']] = guard
    scorer = Scorer(load_scenario(changes={'vehicle': vehicle}, recorded=True))
    scorer.add(log)
    return scorer.result(rules or Rules(0.0, 1000.0))


def ticks(seconds):
    return TICK_S * np.arange(round(seconds / TICK_S))


T = ticks(4000.0)
DIVE = np.interp(T, (0.0, 2000.0, 4000.0), (0.0, 900.0, 0.0))


def from_s(start_s, bits):
    return np.where(start_s <= T, bits, 0)


@pytest.mark.parametrize(
    ('depth', 'guard', 'status'),
    [
        (DIVE, 0, 'completed'),
        (DIVE, from_s(1000.0, STUCK_ROLL), 'completed'),
        (DIVE, from_s(1000.0, STUCK_ROLL) * (T < 2000.0), 'completed'),
        (DIVE, from_s(1500.0, LEAK), 'surfaced'),
        (DIVE, from_s(1500.0, LEAK | NOT_RISING), 'surfaced'),
        # on its way when the run ends, and just beginning with its last means
        (np.minimum(T, 900.0), from_s(1500.0, LEAK), 'surfaced'),
        (np.minimum(T, 900.0), from_s(3900.0, LEAK | NOT_RISING), 'surfaced'),
        # all has been done for long, and it lies there
        (np.minimum(T, 900.0), from_s(1500.0, LEAK | NOT_RISING), 'lost'),
        # by its true depth, whatever became of it later and whatever the guard did
        (1.5 * DIVE, 0, 'lost'),
        (1.5 * DIVE, from_s(1500.0, CRUSHING), 'lost'),
    ],
)
def test_status_is_what_became_of_the_vehicle(depth, guard, status):
    assert scores(depth, guard)['status'] == status


@pytest.mark.parametrize(('deepest_m', 'is_told'), [(1039.0, False), (1041.0, True)])
def test_a_depth_that_it_is_not_rated_for_is_told_whatever_was_measured(deepest_m, is_told):
    told = scores(DIVE / 900.0 * deepest_m, believed=DIVE)
    assert told['status'] == 'completed'
    assert ('deeper than it is rated for, 1,000 m, at' in told['reason']) == is_told


@pytest.mark.parametrize(
    ('dives', 'lasts_s', 'status'),
    [(1, 4000.0, 'completed'), (2, 4000.0, 'unfinished'), (2, 5000.0, 'completed')],
)
def test_a_mission_is_unfinished_if_its_time_is_over_before_its_dives(dives, lasts_s, status):
    rules = Rules(0.0, 1000.0, dives=dives, duration_s=lasts_s, dive_s=1800.0)
    told = scores(np.maximum(DIVE, 6.0), rules=rules)
    assert told['status'] == status
    deep = '; 6 m deep at the end'
    says = (
        f'dives flown, of those that there was time for: 1 of 2{deep}'
        if status == 'unfinished'
        else ''
    )
    assert told['reason'] == says


def test_a_vehicle_that_is_too_light_to_dive_has_not_completed_its_mission(tmp_path):
    changes = ('duration_s=12000', 'faults=[{kind: mass, mass_kg: -1.0}]')
    sets = [word for change in changes for word in ('--set', change)]
    done = command_line.glider('run', '--engine', 'direct', '--out', tmp_path / 'run', *sets)
    assert done.returncode == 3
    card = json.loads((tmp_path / 'run/score.json').read_text())
    assert (card['status'], card['dives']) == ('unfinished', 0)
    page = (tmp_path / 'run/report.html').read_text(encoding='utf-8')
    assert 'Unfinished: dives flown, of those that there was time for: 0 of 1.' in page
    assert 'Nothing went wrong' not in page


@pytest.mark.parametrize(
    ('bottom_m', 'status'), [(8.0, 'unfinished'), (14.0, 'unfinished'), (35.0, 'completed')]
)
@pytest.mark.parametrize('at_end', ['stop', 'continue'])
def test_a_mission_in_water_that_is_too_shallow_to_dive_is_unfinished(bottom_m, status, at_end):
    """It is to end by its path or its time, and waits at the surface until then.

    Over a shelf the bottom turns its dives, at 21 m of 200.
    """
    shallow = {'water.bottom_m': bottom_m, 'profile.clearance_m': 15.0}
    changes = {**shallow, 'dives': 0, 'duration_s': 6000.0, 'path.at_end': at_end}
    _, told = fly_scored(load_scenario('slocum_shelf', changes), [])
    assert told['status'] == status
    assert told['reason'].startswith('no dive flown' if status == 'unfinished' else '')


@pytest.mark.parametrize(
    ('fields', 'status'),
    [
        ({'sensors.depth_offset_m': 1.5}, 'unfinished'),
        ({}, 'completed'),
        ({'profile.wait_s': 18000.0}, 'completed'),
        ({'orders': [{'at_s': 3600.0, 'wait_s': 18000.0}]}, 'completed'),
        ({'orders': [{'at_s': 3600.0, 'hold': True}]}, 'completed'),
    ],
)
def test_a_mission_that_ceased_to_dive_is_unfinished(fields, status):
    """It has no number of dives and is to go on; its depth shows 1.5 m, so it waits to come up."""
    yo = {'profile.depth_m': 100.0, 'profile.surface_every_dives': 1, 'dives': 0}
    changes = {**yo, 'duration_s': 21600.0, **fields}
    _, told = fly_scored(load_scenario('current_8deg', changes), [])
    assert (told['status'], told['dives'] > 0) == (status, True)
    assert told['reason'].startswith('no dive flown' if status == 'unfinished' else '')


#: It is at the end of its path before it has flown its dives.
SHORT = {'dives': 4, 'path.length_m': 400.0, 'path.at_end': 'stop'}


@pytest.mark.parametrize(
    ('fields', 'orders', 'says'),
    [
        ({'dives': 3}, [{'hold': True}], 'held'),
        ({'dives': 0, 'path.at_end': 'stop'}, [{'hold': True}], 'held'),
        ({'dives': 0}, [{'hold': True, 'at_s': 60.0}], 'held'),
        ({'dives': 0}, [{'hold': True}], ''),
        ({'dives': 1}, [{'hold': True}], ''),
        ({'dives': 3}, [{'hold': True}, {'resume': True, 'at_s': 3000.0}], ''),
        ({'dives': 2}, [{'hold': True}, {'resume': True, 'at_s': 1600.0}], ''),
        (SHORT, [{'hold': True, 'at_s': 300.0}, {'resume': True, 'at_s': 900.0}], ''),
        (SHORT, [{'hold': True, 'at_s': 3000.0}], ''),
        (
            {'dives': 2, 'sensors.depth_offset_m': 1.5},
            [{'hold': True}, {'resume': True, 'at_s': 1600.0}],
            'dives flown',
        ),
    ],
)
def test_a_mission_that_is_held_before_it_has_flown_is_unfinished(fields, orders, says):
    yo = {'profile.depth_m': 100.0, 'profile.surface_every_dives': 1, 'profile.wait_s': 60.0}
    told = [{'at_s': 1500.0, **order} for order in orders]
    changes = {**yo, 'duration_s': 6000.0, 'orders': told, **fields}
    _, told = fly_scored(load_scenario('current_8deg', changes), [])
    assert told['status'] == ('unfinished' if says else 'completed')
    assert told['reason'].startswith(says) and bool(told['reason']) == bool(says)


def test_a_shallow_last_dive_is_none_where_there_was_no_time_for_a_deep_one():
    """It counts two dives and is done, and has come up once."""
    path = {'kind': 'straight', 'course_deg': 119.2, 'length_m': 800.0, 'at_end': 'stop'}
    changes = {
        'vehicle': 'seawing',
        'perturb.net_heaviness_kg': 0.174,
        'dives': 2,
        'duration_s': 7262.0,
        'path': path,
        'profile.depth_m': 1000.0,
        'profile.prepare_s': 0.0,
        'orders': [{'at_s': 186.2, 'depth_m': 36.2}],
    }
    _, told = fly_scored(load_scenario('survey', changes), [])
    assert (told['status'], told['dives']) == ('unfinished', 1)
    assert told['reason'].startswith('afloat')


def test_way_that_is_left_counts_that_the_vehicle_was_carried_back():
    path = {'kind': 'waypoints', 'waypoints': [[0, 0], [20000, 0]], 'at_end': 'stop'}
    back = {'current.angle_deg': 180.0, 'orders': [{'at_s': 3600.0, 'hold': True}]}
    changes = {**back, 'path': path, 'dives': 0, 'duration_s': 14400.0, 'profile.depth_m': 100.0}
    _, told = fly_scored(load_scenario('current_8deg', changes), [])
    assert told['distance_along_path_m'] < -1000.0
    left_m = 20000.0 - told['final_state']['position_ned_m'][0]
    assert told['arrival']['left_m'] == pytest.approx(left_m, abs=1.0)
    assert told['arrival']['eta_s'] is None


@pytest.mark.parametrize(('dives', 'at_end'), [(0, 'stop'), (4, 'stop'), (0, 'continue')])
def test_a_mission_that_drifts_before_the_end_of_its_path_is_unfinished(dives, at_end):
    """Its depth shows 1.5 m at the surface, so it waits to come up, long before its time."""
    path = {'kind': 'waypoints', 'waypoints': [[0, 0], [3000, 0]], 'at_end': 'stop'}
    yo = {'profile.depth_m': 100.0, 'profile.surface_every_dives': 1, 'path': path}
    orders = [{'at_s': 60.0, 'path': {**path, 'at_end': at_end}}]
    changes = {**yo, 'dives': dives, 'sensors.depth_offset_m': 1.5, 'orders': orders}
    _, told = fly_scored(load_scenario('current_8deg', changes), [])
    assert (told['status'], told['dives']) == ('unfinished', 1)
    assert told['reason'].startswith('afloat')


def test_who_lies_afloat_on_a_path_in_depth_is_unfinished():
    """It follows its path up to the surface, and cannot follow it along there."""
    points = [[0, 0, 20], [150, 0, 100], [300, 0, 0], [1500, 0, 0], [1700, 0, 100]]
    start = {'path': {'kind': 'waypoints', 'waypoints': points}, 'initial.east_m': 0.0}
    _, told = fly_scored(load_scenario('helix', {**start, 'duration_s': 9000.0}), [])
    assert (told['status'], told['arrival']['arrived']) == ('unfinished', False)
    assert told['reason'].startswith('afloat')


def test_a_mission_that_ends_in_a_deeper_dive_than_those_before_flew_some():
    yo = {'profile.depth_m': 12.0, 'profile.net_heaviness_kg': 0.15}
    yo |= {'profile.surface_every_dives': 1, 'profile.wait_s': 60.0}
    deeper = {'dives': 0, 'duration_s': 4000.0, 'orders': [{'at_s': 2500.0, 'depth_m': 600.0}]}
    _, told = fly_scored(load_scenario('current_8deg', {**yo, **deeper}), [])
    assert told['depth_m']['max'] > 100.0
    assert (told['status'], told['dives'] > 1) == ('completed', True)


@pytest.mark.parametrize('vehicle', ['slocum_g2', 'seaglider'])
def test_a_mission_whose_dives_begin_slowly_goes_on(vehicle):
    """With so little weight it takes longer than a minute to leave the surface."""
    path = {'kind': 'waypoints', 'waypoints': [[0, 0], [20000, 0]], 'at_end': 'stop'}
    yo = {'profile.depth_m': 60.0, 'profile.surface_every_dives': 1, 'profile.pitch_deg': 15.0}
    changes = {**yo, 'profile.net_heaviness_kg': 0.02, 'dives': 0, 'duration_s': 12000.0}
    changes |= {'vehicle': vehicle, 'path': path}
    _, told = fly_scored(load_scenario('current_8deg', changes), [])
    assert (told['status'], told['sim_time_s']) == ('completed', 12000.0)
    assert told['dives'] >= 2


@pytest.mark.parametrize(
    ('vehicle', 'dives', 'profile'),
    [
        ('zhang2021', 2, {'depth_m': 60.0, 'top_depth_m': 30.0}),
        ('zhang2021', 2, {'depth_m': 100.0, 'top_depth_m': 30.0}),
        # a light one turns before it is as deep as it should be, or as shallow
        ('seaglider', 1, {'depth_m': 15.0, 'pitch_deg': 41.0, 'net_heaviness_kg': 0.32}),
        ('seawing', 1, {'depth_m': 30.0, 'pitch_deg': 20.0, 'net_heaviness_kg': 0.8}),
        ('seawing', 6, {'depth_m': 180.0, 'pitch_deg': 45.0, 'net_heaviness_kg': 0.85}),
    ],
)
def test_dives_count_wherever_they_turn(vehicle, dives, profile):
    """A mission that has flown its dives is over once it is up, and is told so."""
    profile = {f'profile.{name}': value for name, value in profile.items()}
    changes = {'vehicle': vehicle, 'dives': dives, 'duration_s': 7000.0, **profile}
    _, told = fly_scored(load_scenario('current_8deg', changes), [])
    assert (told['status'], told['dives']) == ('completed', dives)
    assert told['sim_time_s'] < 900.0 * dives


@pytest.mark.parametrize('status', STATUSES)
def test_every_status_has_a_colour_of_its_badge(status):
    """White words on a ground of none are not read."""
    style = (files('glider_bringup') / 'showing/web/page.css').read_text()
    grounds = re.findall(r'([^{}]*)\{ background: var\(--(?:good|warn|alert)\)', style)
    assert any(re.search(rf'\.badge\b.*\.{status}\b', one) for one in grounds)


@pytest.mark.parametrize('beyond_m', [-0.1, 0.1])
def test_hull_gives_way_at_its_crush_depth(beyond_m):
    crush_m = load_vehicle('slocum_g2').crush_depth_m
    depth = DIVE / 900.0 * (crush_m + beyond_m)
    told = scores(depth, vehicle='slocum_g2')
    assert told['status'] == ('lost' if beyond_m > 0.0 else 'completed')


def test_a_vehicle_that_sinks_for_ever_is_lost_at_the_bottom_of_the_deepest_sea():
    """8 kg too heavy it would be some 16 km deep in the time of the scenario."""
    heavy = {'faults': [{'kind': 'mass', 'at_s': 600.0, 'mass_kg': 8.0}], 'dives': 0}
    scenario = load_scenario('current_8deg', {**heavy, 'duration_s': 14400.0})
    _, told = fly_scored(scenario, [])
    assert told['status'] == 'lost'
    assert told['depth_m']['max'] == pytest.approx(12000.0, abs=1.0)


def test_what_it_believed_of_its_depth_saves_no_vehicle():
    told = scores(1.5 * DIVE, believed=0.5 * DIVE)
    assert told['status'] == 'lost'
    assert '1,350.0 m' in told['reason']


def test_what_cannot_be_held_is_infeasible_but_not_if_the_vehicle_is_lost():
    for depth, status in ((DIVE, 'infeasible'), (1.5 * DIVE, 'lost')):
        log_scores = scorer_with(depth, infeasible=True)
        assert log_scores['status'] == status


def scorer_with(depth, infeasible):
    log = np.zeros((len(depth), ROW))
    log[:, TRUTH.start + 2], log[:, TRUTH.start + 3] = -depth, 1.0
    log[:, ESTIMATE] = log[:, TRUTH.start : TRUTH.start + 13]
    log[:, COLUMNS['reference'].start + 3] = 1.0
    log[:, COLUMNS['infeasible']] = infeasible
    scorer = Scorer(load_scenario())
    scorer.add(log)
    return scorer.result(Rules(0.0, 1000.0))


def test_nothing_is_steady_after_the_guard_has_acted_or_the_hull_gave_way():
    """1 m off before, 50 m off after."""
    for depth, guard in (
        (0 * T + 500.0, from_s(2000.0, LEAK)),
        (np.where(T < 2000.0, 500.0, 1300.0), 0),
    ):
        track = scores(depth, guard, e2=np.where(T < 2000.0, 1.0, 50.0))['cross_track_m']
        assert track['max_steady'] == 1.0
        assert track['max_run'] == 50.0


@pytest.mark.parametrize('guard', [0, from_s(1500.0, LEAK)])
def test_battery_of_a_mission_that_ended_lasts_for_nothing(guard):
    energy = scores(DIVE, guard, north=0.3 * T, target=0.3 * T)['energy']
    assert energy['wh'] > 0.0
    for name in ('endurance_days', 'range_km'):
        assert (energy[name] is None) == np.any(guard)


@pytest.mark.parametrize(
    ('vehicle', 'reaction'), [('zhang2021', 'drop'), ('seaglider', 'surface')]
)
def test_no_weight_is_dropped_by_a_vehicle_that_has_none(vehicle, reaction):
    guard = scores(DIVE, from_s(1500.0, NOT_RISING), vehicle=vehicle)['guard']
    assert guard['reaction'] == guard['events'][0]['reaction'] == reaction


def test_what_ended_the_mission_is_told_however_often_something_else_was_before():
    """A row that comes and goes 200 times, then a leak."""
    guard = np.where(np.floor(T / 5.0) % 2, STUCK_ROLL, 0) | from_s(2000.0, LEAK)
    told = scores(DIVE, guard)
    assert [one['row'] for one in told['guard']['events']].count('leak') == 1
    often, leak = event_texts(told, 'guard')
    assert often.endswith('(100 times or more)')
    assert leak == 'at 2,000.0 s: surface: there is water in the hull'


@pytest.mark.parametrize('speed', [0.5, 0.0, -0.67])
def test_way_along_the_path_is_that_of_the_vehicle(speed):
    """The target waits for a vehicle that is carried back; range is that of the vehicle too."""
    target = np.maximum(0.0, speed * T) + np.minimum(T, 49.0)
    told = scores(DIVE, north=speed * T, target=target)
    assert told['distance_along_path_m'] == pytest.approx(speed * T[-1], abs=1e-6)
    flights = told['energy']['endurance_days'] * 86400.0 / told['sim_time_s']
    expected = 1e-3 * flights * max(0.0, speed * T[-1])
    assert told['energy']['range_km'] == pytest.approx(expected, abs=1e-9)


# ------------------------------------------------------------------------------------ told


glider = command_line.glider
DEEP = ('--set', 'profile.depth_m=800', '--set', 'initial.depth_m=600')
LEAKS = {
    # of what the pump takes off, and of more than pump and weight together
    'surfaced': ('rough_water', '{kind: leak, rate_kgps: 0.001, limit_kg: 0.2, at_s: 200}'),
    'lost': ('seaglider_1000m', '{kind: leak, rate_kgps: 0.02, limit_kg: 8.0, at_s: 200}'),
}
CODES = {'surfaced': 3, 'lost': 1}


@pytest.fixture(scope='module', params=['surfaced', 'lost'])
def ended(request, tmp_path_factory):
    """Status, process and folder of a flight that springs a leak."""
    folder = tmp_path_factory.mktemp(request.param) / 'flight'
    name, fault = LEAKS[request.param]
    known = ('--set', 'navigation.method=known')
    flight = ('--engine', 'direct', '--duration', '3000', *DEEP, *known)
    process = glider('run', name, *flight, '--set', f'faults=[{fault}]', '--out', folder)
    return request.param, process, folder


def test_run_ends_with_the_exit_code_of_its_status(ended):
    status, process, _ = ended
    assert process.returncode == CODES[status], process.stderr
    assert f'{status} (' in process.stdout
    assert 'battery lasts' not in process.stdout


def test_card_and_report_say_the_same_word_first(ended):
    status, _, folder = ended
    card = json.loads((folder / 'score.json').read_text())
    assert card['status'] == status
    page = (folder / 'report.html').read_text(encoding='utf-8')
    badge, verdict = page.partition(f'<span class="badge {status}">')[2].split('</span>', 1)
    assert status in badge.lower()
    assert verdict.startswith(f'{status.capitalize()}: ')
    deepest = page.partition('deepest point')[2].partition('</div>')[0]
    assert ('beyond' in deepest) == (status == 'lost')
    first = page.partition('<ul class="findings">')[2].partition('</li>')[0]
    assert 'class="problem"' in first
    assert f'{status.capitalize()}: ' not in first  # the verdict has said it


@pytest.mark.parametrize('command', ['score', 'report'])
def test_commands_about_it_succeed_and_say_the_word(ended, command):
    status, _, folder = ended
    process = glider(command, folder)
    assert process.returncode == 0, process.stderr
    assert status in process.stdout


def test_compare_says_it_of_each_run(ended):
    status, _, folder = ended
    other = folder.parent / 'other'
    if not other.exists():
        glider('run', '--engine', 'direct', '--duration', '60', '--out', other)
    process = glider('compare', folder, other)
    assert process.returncode == 0, process.stderr
    assert f'{status.capitalize()} before its end: 1 of 2 runs' in process.stdout


@pytest.mark.parametrize(('status', 'goes_on'), [('unfinished', True), ('surfaced', False)])
def test_who_is_up_for_good_has_no_pace(status, goes_on):
    arrival = {'place_latlon_deg': None, 't_s': None, 'left_m': 500.0, 'eta_s': 3700.0}
    text = arrival_text({'status': status, 'sim_time_s': 100.0, 'arrival': arrival})
    assert text.startswith('did not arrive in')
    assert ('at its pace' in text) == goes_on
