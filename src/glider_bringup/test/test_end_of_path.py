# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""Missions that end with their path, and the largest error of every shipped scenario."""

import json
import math

import numpy as np
import pytest
from mcap_ros2.reader import read_ros2_messages
from typer.testing import CliRunner

import glider_bringup as glider
from glider_bringup.cli import app
from glider_bringup.engines.flight import fly as fly_flight
from glider_bringup.engines.recorded import fly_recorded
from glider_bringup.scoring.again import score_again
from glider_bringup.scoring.card import scorecard, write_score
from glider_bringup.scoring.score import Scorer, scores_of
from glider_bringup.showing.scorecard import card_rows
from glider_guidance.yo.stage import AT_END_OF_PATH, GLIDING_DOWN
from glider_mission.planned import planned_ticks
from glider_mission.run_folder import make_run_folder
from glider_mission.scenario import load_scenario, scenario_names


def fly(folder, name, with_bag=False, **changes):
    """Scorecard of a direct run into a folder."""
    scenario = load_scenario(name, {key.replace('__', '.'): v for key, v in changes.items()})
    scorer = Scorer(scenario)
    if with_bag:
        make_run_folder(scenario, folder)
        flight = fly_recorded(scenario, folder, [scorer])
    else:
        flight = fly_flight(scenario, [scorer])
    return scorecard(scenario, 'direct', flight, scores_of(scenario, scorer))


def recorded(folder, topic):
    """Messages on a topic of a bag, by the mcap package and the definitions in the file."""
    (file,) = folder.glob('*.mcap')
    for message in read_ros2_messages(str(file), topics=[topic]):
        yield message.ros_msg


@pytest.mark.parametrize('name', scenario_names())
def test_largest_error_of_the_run_is_the_largest_that_was_recorded(name, tmp_path):
    """No tick is left out. Behind noise it is the true error, from the first leg of the path."""
    folder, changes = (
        tmp_path / 'run',
        {'guidance__route': 'straight', 'guidance__replan': 'never'},
    )
    card = fly(folder, name, True, dives=0, duration_s=180.0, settle_s=100.0, **changes)
    found = card['cross_track_m']
    if name == 'noisy_sensors' or load_scenario(name).navigation.jumps:
        truth = recorded(folder, '/glider/ground_truth/odom')
        path = load_scenario(name).path
        (north, east), course = path.points(0)[0, :2], path.course_rad()
        errors = np.array(
            [
                math.cos(course) * (place.x - east) - math.sin(course) * (place.y - north)
                for place in (odom.pose.pose.position for odom in truth)
            ]
        )
        tolerance = 1e-6
    else:
        errors = np.array([error.vector.y for error in recorded(folder, '/glider/tracking_error')])
        tolerance = 0.0
    assert len(errors) == 1800
    assert found['max_run'] == pytest.approx(np.abs(errors).max(), abs=tolerance)
    assert found['max_all'] == pytest.approx(np.abs(errors[1001:]).max(), abs=tolerance)
    assert score_again(folder)['cross_track_m'] == found
    rows = dict(card_rows(card))
    assert rows['cross-track, whole run'] == f'max {found["max_run"]:.2f} m'
    assert rows['cross-track, all'].endswith('(after settling, the first 100 s)')


def test_survey_comes_up_at_its_last_waypoint():
    """Within 50 m of [1500, -500]; it used to fly on until its time was over, 2 km past it."""
    card = fly(None, 'survey')
    north, east, depth = card['final_state']['position_ned_m']
    assert math.hypot(north - 1500.0, east + 500.0) < 50.0
    assert depth < 1.0
    assert card['end_of_path_m'] < 15.0
    assert card['sim_time_s'] < 20000.0
    assert card['cross_track_m']['rms_steady'] is not None


@pytest.mark.parametrize(
    'changes',
    [
        {'current__speed_kn': 0.0},
        {'current__speed_kn': 0.6, 'current__direction_deg': 180.0},
        {'profile__depth_m': 100.0},
        {'profile__depth_m': 1000.0},
        {'vehicle': 'seawing'},
        {'perturb__pump_rate': 0.4},
        {'profile__surface_every_dives': 3, 'profile__wait_s': 300.0},
        {'path__waypoints': [[0, 0], [2000, 0], [0, 100]], 'profile__depth_m': 500.0},
    ],
    ids=str,
)
def test_it_comes_up_there_in_other_water_and_otherwise(changes):
    """Within 30 m, though no two of them have the same number of dives left."""
    card = fly(None, 'survey', duration_s=60000.0, **changes)
    assert card['end_of_path_m'] < 30.0
    assert card['dives'] > 1


@pytest.mark.parametrize('at_end', ['stop', 'continue'])
def test_a_run_goes_on_past_the_end_of_its_path_only_if_told_to(at_end):
    fields = {'path__length_m': 400.0, 'profile__depth_m': 100.0, 'path__at_end': at_end}
    card = fly(None, 'current_8deg', dives=0, duration_s=3000.0, **fields)
    assert (card['sim_time_s'] < 2000.0) is (at_end == 'stop')
    assert (card['end_of_path_m'] is None) is (at_end == 'continue')


def test_the_last_of_its_dives_may_end_its_path_and_another_path_gives_it_no_more():
    path = {'kind': 'straight', 'course_deg': 0.0, 'length_m': 300.0, 'at_end': 'stop'}
    changes = {'dives': 1, 'profile.depth_m': 200.0, 'profile.prepare_s': 0.0, 'path': path}
    arrived = glider.fly('current_8deg', {**changes, 'duration_s': 2000.0}).score
    assert arrived['dives'] == 1 and arrived['arrival']['arrived']
    at_s = arrived['arrival']['t_s'] + 10.0
    changes['orders'] = [{'at_s': at_s, 'path': {**path, 'length_m': 2000.0}}]
    ordered = glider.fly('current_8deg', {**changes, 'duration_s': 2000.0}).score
    assert ordered['dives'] == 1 and not ordered['arrival']['arrived']
    assert ordered['sim_time_s'] == arrived['sim_time_s']


def test_it_arrives_though_it_is_carried_back_in_each_stay_at_the_surface():
    """Two dives that shared the way left made as much as the stay between them lost, for ever."""
    path = {'kind': 'straight', 'course_deg': 10.0, 'length_m': 700.0, 'at_end': 'stop'}
    changes = {'vehicle': 'seawing', 'dives': 0, 'path': path, 'duration_s': 20000.0}
    changes |= {'profile.depth_m': 100.0, 'profile.pitch_deg': 37.1, 'profile.wait_s': 600.0}
    changes |= {'profile.net_heaviness_kg': 0.386, 'profile.surface_every_dives': 1}
    changes |= {'current.speed_kn': 0.25, 'current.direction_deg': 147.0}
    arrival = glider.fly('current_8deg', changes).score['arrival']
    assert arrival['arrived'] and arrival['missed_m'] < 50.0


def test_who_comes_up_near_its_last_point_and_no_nearer_than_before_has_arrived():
    """Its last dives are shallow, where the current is strong: it dived there for ever."""
    path = {'kind': 'straight', 'course_deg': 0.0, 'length_m': 6000.0, 'at_end': 'stop'}
    flow = {'kind': 'shear', 'law': 'exponential', 'depth_m': 30.0, 'direction_deg': 180.0}
    changes = {'vehicle': 'seaglider', 'dives': 0, 'path': path, 'duration_s': 70000.0}
    changes |= {'profile.depth_m': 200.0, 'profile.pitch_deg': 20.0, 'profile.wait_s': 600.0}
    changes |= {'profile.net_heaviness_kg': 0.2, 'profile.surface_every_dives': 1}
    changes |= {'current': {'components': [{**flow, 'speed_mps': 0.45}]}}
    arrival = glider.fly('current_8deg', changes).score['arrival']
    assert arrival['arrived'] and arrival['t_s'] < 60000.0 and arrival['missed_m'] < 500.0
    near = glider.fly('current_8deg', {**changes, 'path.arrival_radius_m': 100.0}).score
    assert not near['arrival']['arrived']


@pytest.mark.parametrize(
    ('begins_m', 'depth_m'), [(8.0, 20.0), (40.0, 50.0), (199.0, 200.0), (300.0, 200.0)]
)
def test_a_mission_that_begins_under_water_flies_its_dives(begins_m, depth_m):
    """Two: it comes up after each."""
    changes = {'initial.depth_m': begins_m, 'profile.depth_m': depth_m, 'dives': 2}
    stays = {'profile.surface_every_dives': 1, 'profile.wait_s': 70.0}
    run = glider.fly('current_8deg', {**changes, **stays, 'duration_s': 6000.0})
    depth = run.to_xarray().odom_depth.values
    assert np.count_nonzero(np.diff((depth < 3.0).astype(int)) == 1) == 2
    assert (run.score['status'], run.score['dives']) == ('completed', 2)


def test_who_cannot_steer_has_not_completed_its_survey():
    """Its time is ample, and it ends 2 km away; without the fault it arrives."""
    stuck = {'kind': 'stuck', 'actuator': 'roll_mass', 'at_s': 1000.0}
    score = glider.fly('survey', {'faults': [stuck]}).score
    missed = f'{score["arrival"]["missed_m"]:,.0f} m from its last point'
    assert score['arrival']['missed_m'] > 1000.0
    assert score['status'] == 'unfinished'
    assert f', for which there was time in still water: {missed}' in score['reason']
    short = glider.fly('survey', {'faults': [stuck], 'duration_s': 12000.0}).score
    assert (short['status'], short['arrival']['arrived']) == ('completed', False)


NORTH = {'kind': 'straight', 'course_deg': 0.0, 'length_m': 1000.0}
STUCK = {'kind': 'stuck', 'actuator': 'roll_mass', 'at_s': 300.0}
HELIX = {'kind': 'helix', 'radius_m': 2000.0, 'centre': [0, 0, 20], 'slope_deg': 5.0, 'turns': 0.5}
FAR = {'kind': 'straight', 'start': [12000.0, 0.0], 'course_deg': 0.0, 'length_m': 500.0}
SURVEY = load_scenario('survey').path.model_dump(mode='json')


@pytest.mark.parametrize(
    ('name', 'changes', 'missing'),
    [
        # it takes 10 km to a path of 1 km, and to one that is ordered
        ('survey', {'initial.north_m': -8000.0, 'path': NORTH, 'duration_s': 17000.0}, ''),
        ('survey', {'duration_s': 20000.0, 'orders': [{'at_s': 3000.0, 'path': FAR}]}, ''),
        # dives of 60 m, of which there was time for seven, become dives of 600 m
        (
            'current_8deg',
            {
                'profile.depth_m': 60.0,
                'dives': 10,
                'duration_s': 9000.0,
                'orders': [{'at_s': 600.0, 'depth_m': 600.0}],
            },
            'its time was over after 2 of 10 dives',
        ),
        # its time is over between two ticks
        ('survey', {'faults': [STUCK], 'duration_s': 21600.04}, 'not at the end of its path'),
        # a pilot who sends it to the same point again and again has no other mission
        (
            'survey',
            {
                'faults': [STUCK],
                'duration_s': 26000.0,
                'orders': [{'at_s': at_s, 'path': SURVEY} for at_s in (5000.0, 15000.0, 24000.0)],
            },
            'not at the end of its path',
        ),
        # who was held for some minutes had ample time all the same
        (
            'survey',
            {
                'faults': [STUCK],
                'duration_s': 26000.0,
                'orders': [{'at_s': 2000.0, 'hold': True}, {'at_s': 3000.0, 'resume': True}],
            },
            'not at the end of its path',
        ),
        (
            'helix',
            {
                'faults': [STUCK],
                'path': HELIX,
                'initial.east_m': -2000.0,
                'duration_s': 30000.0,
                'guard.stalled_s': 30000.0,
            },
            'not at the end of its path',
        ),
        # too light to dive: neither its one dive nor its path in depth
        (
            'helix',
            {
                'perturb.net_heaviness_kg': -1.0,
                'path': {'kind': 'waypoints', 'waypoints': [[0, 0, 20], [350, 0, 150]]},
                'initial.depth_m': 0.1,
                'dives': 1,
                'duration_s': 8000.0,
            },
            'not at the end of its path',
        ),
    ],
)
def test_what_there_was_time_for_goes_by_the_way_and_the_orders(name, changes, missing):
    score = glider.fly(name, changes).score
    assert score['reason'].startswith(missing) and bool(score['reason']) == bool(missing)
    was_no_time = missing.startswith('its time') or not missing
    assert score['status'] == ('completed' if was_no_time else 'unfinished')
    if arrival := score['arrival']:
        assert not arrival['arrived']
        assert arrival['left_m'] > 0.0
        assert arrival['eta_s'] is None or arrival['eta_s'] > score['sim_time_s']


def test_who_comes_up_abeam_of_its_last_point_but_far_from_it_has_not_arrived():
    """It knows no current but from fixes, and has its first one there: a dive of 800 m."""
    path = {'kind': 'straight', 'course_deg': 0.0, 'length_m': 1000.0}
    changes = {'dives': 0, 'duration_s': 20000.0, 'current.direction_deg': 90.0, 'path': path}
    changes |= {'navigation.method': 'dead_reckoned', 'profile.depth_m': 800.0}
    far = glider.fly('current_8deg', changes).score
    missed_m = far['arrival']['missed_m']
    assert (far['status'], far['arrival']['arrived']) == ('unfinished', False)
    assert far['reason'] == f'came up {missed_m:,.0f} m from the last point of its path'
    assert far['end_of_path_m'] == missed_m > 1000.0
    assert dict(card_rows(far))['arrival'].endswith('too far off to have arrived')
    path |= {'arrival_radius_m': math.ceil(missed_m)}
    assert glider.fly('current_8deg', changes).score['status'] == 'completed'


@pytest.mark.parametrize('name', ['spline', 'helix'])
def test_who_comes_up_from_the_end_of_a_path_in_depth_has_arrived(name):
    """It ends hundreds of metres deep, and a climb leads it on by more than a kilometre."""
    score = glider.fly(name, {'duration_s': 9000.0}).score
    assert score['arrival']['missed_m'] > 1000.0
    assert (score['status'], score['arrival']['arrived']) == ('completed', True)


def test_who_cannot_steer_has_not_followed_its_path_in_depth():
    stuck = {'kind': 'stuck', 'actuator': 'roll_mass', 'at_s': 100.0}
    path = {'kind': 'waypoints', 'waypoints': [[0, 0, 10], [400, 0, 200], [900, 200, 20]]}
    score = glider.fly('spline', {'duration_s': 6000.0, 'path': path, 'faults': [stuck]}).score
    assert (score['status'], score['arrival']['arrived']) == ('unfinished', False)


def test_the_last_metres_are_not_dived_for_on_one_spot():
    """29 m are left at its upper turn; dives of 2 m led nowhere, until its guard sent it up."""
    path = {'kind': 'straight', 'course_deg': 0.0, 'length_m': 1657.0}
    changes = {'vehicle': 'slocum_g2', 'path': path, 'profile.depth_m': 115.0, 'dives': 0}
    changes |= {'profile.net_heaviness_kg': 0.173, 'profile.pitch_deg': 16.0}
    changes |= {'current.speed_kn': 0.1, 'current.direction_deg': 161.0, 'duration_s': 20000.0}
    score = glider.fly('current_8deg', changes).score
    assert (score['status'], score['guard']['events']) == ('completed', [])
    assert score['arrival']['missed_m'] < 50.0


def test_a_path_in_three_dimensions_ends_at_the_surface_too():
    """The path ends 20 m deep: it comes up from there, along its last course."""
    path = {'kind': 'waypoints', 'waypoints': [[0, 0, 10], [400, 0, 200], [900, 200, 20]]}
    card = fly(None, 'spline', duration_s=6000.0, path=path)
    assert card['sim_time_s'] < 3000.0
    assert card['end_of_path_m'] < 100.0


def test_the_end_of_the_path_is_recorded_and_scored_alike_from_the_bag(tmp_path):
    folder = tmp_path / 'run'
    fields = {'path__waypoints': [[0, 0], [300, 0]], 'current__speed_kn': 0.2}
    card = fly(folder, 'survey', True, **fields)
    write_score(folder, card)
    told = [
        pair.value
        for array in recorded(folder, '/diagnostics')
        for status in array.status
        for pair in status.values
        if pair.key == 'stage'
    ]
    assert told[-1] == 'at the end of the path'
    assert score_again(folder)['end_of_path_m'] == card['end_of_path_m']
    text = dict(card_rows(card))['arrival']
    assert text.startswith(f'came up {card["end_of_path_m"]:.1f} m from its last point after ')


@pytest.mark.parametrize(
    ('name', 'changes'),
    [
        ('survey', {}),
        ('survey', {'current.speed_kn': 0.0}),
        ('survey', {'profile.depth_m': 800.0}),
    ],
)
def test_estimated_time_knows_the_end_of_the_path(name, changes):
    """What the progress bar is drawn from, within 10 %."""
    estimate = planned_ticks(load_scenario(name, changes))
    card = fly(None, name, **{key.replace('.', '__'): value for key, value in changes.items()})
    assert estimate == pytest.approx(card['ticks'], rel=0.1)


def test_who_comes_up_far_from_its_last_point_flies_on_to_it(tmp_path):
    """Dead-reckoned, without a fix on the way, it comes up downstream. Over nodes too."""
    path = {'kind': 'waypoints', 'waypoints': [[0, 0], [150, 0]], 'arrival_radius_m': 40.0}
    changes = {'dives': 0, 'duration_s': 5000.0, 'path': path, 'profile.depth_m': 25.0}
    changes |= {'current.speed_kn': 0.3, 'current.direction_deg': 90.0, 'profile.wait_s': 30.0}
    changes |= {'navigation.method': 'dead_reckoned', 'profile.surface_every_dives': 20}
    changes |= {'sensors.gps_first_fix_s': 20.0, 'profile.prepare_s': 0.0}
    whole = glider.fly('current_8deg', changes)
    assert whole.score['arrival']['arrived'] and whole.score['arrival']['missed_m'] < 40.0
    assert whole.score['status'] == 'completed'
    data = whole.to_xarray()
    up = np.flatnonzero(np.diff((data.stage.values == AT_END_OF_PATH).astype(int)) == 1)
    assert len(up) > 1 and data.ground_truth_odom_east.values[up[0]] > 40.0
    changes['duration_s'] = 0.1 * (up[0] + 300)
    runs = [
        glider.fly('current_8deg', changes, engine=engine, bag=True, out=tmp_path / engine)
        for engine in ('direct', 'nodes')
    ]
    assert runs[1].score['arrival'] == runs[0].score['arrival']
    assert score_again(tmp_path / 'nodes')['arrival'] == runs[0].score['arrival']
    assert runs[0].score['arrival']['missed_m'] > 15.0
    flown = [run.to_xarray().ground_truth_odom_north.values for run in runs]
    assert flown[0].tobytes() == flown[1].tobytes()
    assert flown[0].tobytes() == data.ground_truth_odom_north.values[: len(flown[0])].tobytes()
    done = CliRunner().invoke(app, ['verify', str(tmp_path / 'nodes'), '--json'])
    assert done.exit_code == 0 and json.loads(done.stdout)['identical'], done.output


@pytest.mark.parametrize(
    ('end_m', 'radius_m', 'speed_kn'), [(100.0, 40.0, 0.3), (300.0, 20.0, 0.2)]
)
def test_who_comes_up_beside_its_last_point_dives_again_however_near_it_is(
    end_m, radius_m, speed_kn
):
    """It is too near for a dive that is worth it, and not near enough: an order led nowhere."""
    path = {'kind': 'waypoints', 'waypoints': [[0, 0], [end_m, 0]], 'arrival_radius_m': radius_m}
    changes = {'dives': 0, 'duration_s': 8000.0, 'path': path, 'profile.depth_m': 40.0}
    changes |= {'current.speed_kn': speed_kn, 'current.direction_deg': 90.0}
    changes |= {'navigation.method': 'dead_reckoned', 'profile.surface_every_dives': 20}
    run = glider.fly('current_8deg', changes)
    assert run.score['arrival']['arrived'] and run.score['arrival']['missed_m'] < radius_m
    data = run.to_xarray()
    before, after = data.stage.values[:-1], data.stage.values[1:]
    dives = np.flatnonzero((before != GLIDING_DOWN) & (after == GLIDING_DOWN))
    depth_m = data.ground_truth_odom_depth.values
    deepest_m = [float(part.max()) for part in np.split(depth_m, dives)[1:]]
    assert len(deepest_m) > 1 and min(deepest_m) > 8.0


@pytest.mark.parametrize('method', ['known', 'dead_reckoned'])
def test_who_has_come_up_at_its_last_point_has_arrived_though_it_drifts_on(method, tmp_path):
    """The current carries it out of the radius before the run is over. Over nodes too."""
    path = {'kind': 'waypoints', 'waypoints': [[0, 0], [150, 0]], 'arrival_radius_m': 40.0}
    changes = {'dives': 0, 'duration_s': 5000.0, 'path': path, 'profile.depth_m': 20.0}
    current = {'speed_mps': 0.4, 'direction_deg': 0.0}
    changes |= {'current': current, 'profile.wait_s': 110.0, 'profile.surface_every_dives': 1}
    changes |= {'navigation': {'method': method, 'current': 'forecast', 'forecast': current}}
    changes |= {'sensors.gps_first_fix_s': 20.0, 'profile.prepare_s': 0.0}
    runs = [
        glider.fly('current_8deg', changes, engine=engine, bag=True, out=tmp_path / engine)
        for engine in ('direct', 'nodes')
    ]
    data = runs[0].to_xarray()
    at_end = data.stage.values == AT_END_OF_PATH
    assert np.count_nonzero(np.diff(at_end.astype(int))) == 1 and at_end[-1]
    assert data.ground_truth_odom_north.values[-1] > 190.0
    flown = [run.to_xarray().ground_truth_odom_north.values.tobytes() for run in runs]
    assert flown[0] == flown[1]
    for run in runs:
        assert run.score['status'] == 'completed'
        assert run.score['arrival']['arrived'] and run.score['arrival']['missed_m'] < 40.0


def test_how_near_it_came_to_its_waypoints_is_told():
    corner = {'kind': 'waypoints', 'waypoints': [[0.0, 0.0], [300.0, 100.0], [300.0, 400.0]]}
    changes = {'path': corner, 'dives': 0, 'duration_s': 4000.0, 'profile.depth_m': 50.0}
    run = glider.fly('current_8deg', changes)
    data, arrival = run.to_xarray(), run.score['arrival']
    north, east = (data[f'ground_truth_odom_{name}'].values for name in ('north', 'east'))
    assert arrival['arrived']
    assert arrival['waypoints_m'] == [
        pytest.approx(np.hypot(north - 300.0, east - 100.0).min(), abs=0.5)
    ]
