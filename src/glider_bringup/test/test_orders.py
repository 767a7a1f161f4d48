# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""Orders in flight: what they do, that they are data, and that every engine follows them alike."""

import json
import pickle

import numpy as np
import pytest
from mcap.reader import make_reader
from rosbags.typesys import Stores, get_typestore
from typer.testing import CliRunner

import glider_bringup as glider
from glider_base.settings import ConfigurationError
from glider_bringup.cli import app
from glider_guidance.yo.stage import WAITING_ON_SURFACE

STORE = get_typestore(Stores.ROS2_JAZZY)
SHALLOW = {'profile.depth_m': 200.0, 'dives': 0}
EAST = {'kind': 'straight', 'course_deg': 90.0, 'length_m': 5000.0}
#: Orders at odd times, one of each kind: in the first dive, held, resumed, aborted in the next
#: dive.
ORDERS = [
    {'at_s': 60.0, 'depth_m': 15.0, 'pitch_deg': 25.0, 'wait_s': 30.0},
    {'at_s': 70.0, 'path': EAST, 'when': 'surfacing'},
    {'at_s': 160.3, 'hold': True},
    {'at_s': 260.0, 'resume': True},
    {'at_s': 425.0, 'abort': True},
]
ORDERED_S = 640.0
#: The same for nodes, which take long: each as soon as it changes something.
SOON_S = (30.0, 35.0, 40.3, 175.0, 210.0)
SOON = [{**one, 'at_s': at_s} for one, at_s in zip(ORDERS, SOON_S, strict=True)]
YO = {'profile.depth_m': 20.0, 'profile.prepare_s': 0.0, 'dives': 0}


def depths(flight, end_s: float) -> np.ndarray:
    """True depth (m) every 10 s until a time."""
    found = []
    while flight.t_s < end_s and not flight.is_over:
        flight.until(t_s=flight.t_s + 10.0)
        found.append(flight.now['ground_truth_odom_depth'])
    return np.array(found)


def ordered(*orders, start_s=900.0, **fields) -> glider.Flight:
    """A flight that was told something in its first dive."""
    flight = glider.Flight('current_8deg', {**SHALLOW, **fields})
    flight.until(t_s=start_s)
    for order in orders:
        flight.order(**order)
    return flight


def test_another_depth_holds_in_the_dive_itself():
    before = ordered(start_s=500.0)
    assert before.now['ground_truth_odom_depth'] < 120.0
    before.order(depth_m=120.0)
    assert 115.0 < depths(before, 4000.0).max() < 135.0


def test_shallower_than_it_is_it_turns_at_once():
    depth = depths(ordered({'depth_m': 100.0}, start_s=650.0), 4000.0)
    assert 120.0 < depth[0] < 160.0 and depth.max() < 175.0
    assert 90.0 < depth[120:].max() < 110.0


def test_another_pitch_is_flown():
    flight = ordered({'pitch_deg': 45.0}, start_s=400.0)
    flight.until(t_s=700.0)
    assert np.degrees(flight.now['ground_truth_odom_pitch']) == pytest.approx(-45.0, abs=3.0)


@pytest.mark.parametrize('in_flight', [False, True], ids=['known before', 'in flight'])
def test_two_hours_of_waiting_are_waited_and_the_mission_goes_on(in_flight):
    fields = {**SHALLOW, 'profile.depth_m': 50.0, 'dives': 2}
    fields |= {'profile.surface_every_dives': 1, 'profile.wait_s': 600.0}

    def stay_s(**order):
        """Time near the surface between the two dives (s)."""
        known = [{'at_s': 300.0, **order}] if order and not in_flight else []
        flight = glider.Flight('current_8deg', {**fields, 'orders': known})
        flight.until(t_s=300.0)
        if order and in_flight:
            flight.order(**order)
        depth = depths(flight, 12000.0)
        assert flight.is_over
        up, down = np.flatnonzero(np.diff((depth > 5.0).astype(int)))[-3:-1]
        return 10.0 * (down - up)

    assert stay_s(wait_s=7200.0) - stay_s() == pytest.approx(7200.0 - 600.0, abs=20.0)


@pytest.mark.parametrize('depth_m', [30.0, 300.0])
def test_dives_are_counted_after_a_change_of_depth(depth_m):
    """The mission ends after as many as it has, and the score says how many that were."""
    orders = [{'at_s': 400.0, 'depth_m': depth_m}]
    run = glider.fly('current_8deg', {**SHALLOW, 'dives': 3, 'orders': orders})
    assert (run.score['status'], run.score['dives']) == ('completed', 3)
    flight = glider.Flight('current_8deg', {**SHALLOW, 'dives': 3})
    flight.until(t_s=400.0)
    flight.order(depth_m=depth_m)
    assert flight.until('end').name == 'end'
    assert flight.t_s == run.score['sim_time_s']


def test_who_holds_waits_at_the_surface_until_it_is_told_to_resume():
    """However long, and whoever flies on from there; a flight that went back has not held."""
    ends = {'dives': 1, 'path.at_end': 'stop'}
    flight = ordered(start_s=500.0, **ends)
    before = flight.state
    flight.order(hold=True)
    depth = depths(flight, 9000.0)
    assert not flight.is_over and depth[100:].max() < 1.0
    assert depth.max() < depth[0] + 20.0  # it does not slide down nose up
    other = glider.Flight('current_8deg', {**SHALLOW, **ends}).restore(flight.state)
    for one in (flight, other):
        one.order(resume=True)
        assert depths(one, 11000.0).max() > 190.0
    assert flight.restore(before).until('end', t_s=5000.0).name == 'end'


@pytest.mark.parametrize(('at_s', 'more'), [(61.0, 0), (66.0, 0), (500.0, 1), (1200.0, 0)])
def test_a_dive_counts_that_a_hold_ends_in_its_climb_and_none_that_it_cuts_short(at_s, more):
    """As the first dive begins, down in it, and up: of two dives that there are to be."""
    hold = {'orders': [{'at_s': at_s, 'hold': True}, {'at_s': 2600.0, 'resume': True}]}
    yo = {'profile.depth_m': 100.0, 'profile.surface_every_dives': 1, 'profile.wait_s': 60.0}
    run = glider.fly('slocum_shelf', {**yo, **hold, 'dives': 2, 'duration_s': 9000.0})
    depth = run.to_xarray().ground_truth_odom_depth.values
    down = depth > 20.0
    assert np.sum(down[1:] & ~down[:-1]) == run.score['dives'] == 2 + more


@pytest.mark.parametrize('start', [[0.0, 0.0], [-3000.0, 800.0]], ids=['on it', 'far before it'])
def test_the_score_of_a_path_that_is_ordered_is_that_of_the_true_motion(start):
    """North, then east: the way along either, and how far off it was, whatever it believed."""
    east = {**EAST, 'start': start}
    fields = {'profile.depth_m': 60.0, 'dives': 1, 'orders': [{'at_s': 500.0, 'path': east}]}
    run = glider.fly('slocum_shelf', fields)
    data = run.to_xarray()
    north, east = (data[f'ground_truth_odom_{name}'].values for name in ('north', 'east'))
    assert abs(data.odom_east.values - east).max() > 50.0
    off = np.concatenate((east[:5000], start[0] - north[5000:]))
    told = run.score['cross_track_m']['max_run'], run.score['distance_along_path_m']
    along = north[4999] - north[0] + east[-1] - east[5000]
    assert told == pytest.approx((abs(off).max(), along), abs=0.1)
    at = [round(10 * t_s) for t_s in run.score['navigation']['surfacing_t_s']]
    assert run.score['navigation']['surfacing_cross_track_m'] == pytest.approx(off[at], abs=0.1)


@pytest.mark.parametrize('duration_s', [1000.0, 1800.0], ids=['under way', 'arrived'])
def test_it_arrives_where_it_is_ordered_to_and_goes_as_deep_as_it_is_ordered(duration_s):
    corner = {'kind': 'waypoints', 'waypoints': [[0.0, 0.0], [200.0, 0.0], [200.0, 250.0]]}
    orders = [{'at_s': 60.0, 'path': corner, 'depth_m': 50.0}]
    fields = {**YO, 'orders': orders, 'current.speed_kn': 0.0, 'duration_s': duration_s}
    run = glider.fly('current_8deg', fields, duration='full')
    data, told = run.to_xarray(), run.score['arrival']
    north, east = (data[f'ground_truth_odom_{name}'].values for name in ('north', 'east'))
    up = np.flatnonzero(data.stage.values == 7)
    assert told['arrived'] == bool(len(up)) == (duration_s > 1000.0)
    at = up[0] if len(up) else -1
    assert told['missed_m'] == pytest.approx(np.hypot(north[at] - 200.0, east[at] - 250.0))
    assert told['left_m'] == pytest.approx(0.0 if len(up) else 250.0 - east[-1], abs=2.0)
    assert told['eta_s'] == pytest.approx(1691.0, abs=100.0)
    assert run.score['sim_time_s'] == pytest.approx(min(duration_s, 1750.0), abs=20.0)
    over_m = data.ground_truth_odom_depth.values.max() - 50.0
    assert run.score['depth_m']['overshoot'] == pytest.approx(over_m)


@pytest.mark.parametrize('when', ['once', 'surfacing'])
def test_another_path_is_entered_at_its_nearest_point(when):
    flight = ordered({'path': EAST, 'when': when}, **{'profile.surface_every_dives': 1})
    north = flight.now['reference_north']
    flight.step()
    jumps = abs(flight.now['reference_north'] - north) > 10.0
    assert jumps == (when == 'once')
    flight.until('surfacing')
    flight.step(100)
    assert abs(flight.now['reference_north']) < 1e-6
    east = flight.now['odom_east']
    flight.until(t_s=flight.t_s + 4000.0)
    assert flight.now['odom_east'] > east + 100.0


@pytest.mark.parametrize(('at_s', 'when'), [(2000.0, 'surfacing'), (3200.0, 'once')])
def test_who_is_at_the_end_of_its_path_flies_the_next_one(at_s, when):
    """It is up at 3,000 s. The next path is a box of 1.6 km, whose end is as near as its start."""
    first = {'kind': 'straight', 'course_deg': 0.0, 'length_m': 800.0}
    box = [[850, 0], [1250, 0], [1250, 400], [850, 400], [850, 0]]
    order = {'at_s': at_s, 'when': when, 'path': {'kind': 'waypoints', 'waypoints': box}}
    changes = {'path': first, 'orders': [order], 'profile.surface_every_dives': 1}
    run = glider.fly('survey', {**changes, 'current.speed_kn': 0.0, 'duration_s': 15000.0})
    data = run.to_xarray()
    for north, east in box:
        off = np.hypot(data.ground_truth_odom_north - north, data.ground_truth_odom_east - east)
        assert off.min() < 100.0
    assert (run.score['status'], run.score['arrival']['arrived']) == ('completed', True)


def test_a_path_beyond_the_sea_that_is_read_is_refused_as_in_a_scenario():
    """So the orders of a flight are always those of a scenario that flies it again."""
    sea = {'guidance.route': 'straight', 'orders': []}
    flight = glider.Flight('eddies_10d', sea, duration=1200)
    far = {'kind': 'waypoints', 'waypoints': [[0, 0, 0], [900_000, 0, 0]]}
    with pytest.raises(ConfigurationError, match=r'^order: current.field.*beyond what is read'):
        flight.order(path=far)
    assert not flight.orders
    flight.order(path={**far, 'waypoints': [[0, 0, 0], [9_000, 0, 0]]})
    flight.until()
    again = glider.fly('eddies_10d', {**sea, 'orders': flight.orders}, duration=1200)
    assert again.to_xarray()['odom_north'].values[-1] == flight.now['odom_north']


@pytest.mark.parametrize('told', [{'hold': True}, {'abort': True}, {'resume': True}])
def test_who_has_arrived_is_told_something_there_and_has_arrived(told):
    short = {'kind': 'straight', 'length_m': 300.0}
    orders = [{'at_s': 1050.0, 'hold': True}] if 'resume' in told else []
    orders.append({'at_s': 1100.0, **told})
    changes = {'path': short, 'current.speed_kn': 0.0, 'duration_s': 1300.0, 'orders': orders}
    run = glider.fly('survey', {**changes, 'profile.surface_every_dives': 1})
    up_s = 0.1 * np.argmax(run.to_xarray().stage.values == 7)
    assert 0.0 < up_s < 1050.0 and run.score['sim_time_s'] == 1300.0
    arrival = run.score['arrival']
    assert (arrival['arrived'], arrival['t_s']) == (True, pytest.approx(up_s, abs=0.2))


def test_a_run_that_is_over_before_an_order_says_so_and_without_another_path_is_unfinished():
    short = {'kind': 'straight', 'length_m': 300.0}
    changes = {'path': short, 'current.speed_kn': 0.0, 'duration_s': 9000.0}
    for order, status in (({'path': EAST}, 'unfinished'), ({'depth_m': 50.0}, 'completed')):
        told = glider.fly('survey', {**changes, 'orders': [{'at_s': 6000.0, **order}]}).score
        assert told['arrival']['arrived'] and told['sim_time_s'] < 6000.0
        assert told['status'] == status and 'ordered' in told['reason']
        assert told['reason'].endswith('at 6,000 s')


def test_a_run_whose_course_could_not_be_held_says_what_it_never_came_to():
    changes = {'profile.depth_m': 100.0, 'current.speed_mps': 1.2, 'current.angle_deg': 90.0}
    later = [{'at_s': 6000.0, 'depth_m': 50.0}]
    told = glider.fly('current_8deg', {**changes, 'orders': later}).score
    assert told['status'] == 'infeasible' and told['sim_time_s'] < 6000.0
    assert told['reason'] == 'it never came to what it was ordered at 6,000 s'


@pytest.mark.parametrize('start', [(-3.0, 5.0), (3.0, -5.0)])
def test_a_box_is_flown_round_wherever_beside_its_start_it_begins(start):
    """On the one side its last leg is nearer than its first."""
    box = [[0, 0], [400, 0], [400, 400], [0, 400], [0, 0]]
    changes = {'path': {'kind': 'waypoints', 'waypoints': box}, 'current.speed_kn': 0.0}
    changes |= {'initial.north_m': start[0], 'initial.east_m': start[1]}
    score = glider.fly('survey', {**changes, 'duration_s': 10000.0}).score
    assert score['arrival']['arrived'] and score['arrival']['t_s'] > 1200.0 / 0.4


def test_who_aborts_comes_up_for_good():
    flight = ordered({'abort': True})
    assert depths(flight, 5000.0)[-1] < 1.0
    for order in ({'depth_m': 50.0}, {'resume': True}, {'abort': True}):
        with pytest.raises(ConfigurationError, match='aborted'):
            flight.order(**order)


@pytest.mark.parametrize(
    ('asked', 'says'),
    [
        ({}, 'nothing: not one order'),
        ({'hold': True, 'depth_m': 50.0}, 'hold, depth_m: not one order'),
        ({'depth_m': 5000.0}, r'profile.depth_m = 5000: deeper .* \(allowed: <= 1000 m'),
        ({'depth_m': 10.0}, 'profile.top_depth_m = 10: not above the lower turn'),
        ({'pitch_deg': 61.0}, r'pitch_deg = 61.0: .*<= 60'),
        ({'resume': True}, 'resume: the vehicle does not hold'),
        ({'hold': True, 'when': 'surfacing'}, 'not with hold'),
        ({'path': {'kind': 'straight'}}, 'path.length_m: missing'),
        ({'speed': 1.0}, 'speed = 1.0: unknown field'),
        ({'hold': True, 'at_s': 2000.0}, 'at_s: it holds from the next tick on'),
    ],
)
def test_what_makes_no_sense_is_refused_and_changes_nothing(asked, says):
    flight, same = ordered(), ordered()
    with pytest.raises(ConfigurationError, match=says):
        flight.order(**asked)
    flight.step(10)
    same.step(10)
    assert pickle.dumps(flight.state) == pickle.dumps(same.state)


def test_a_path_in_three_dimensions_takes_no_depth():
    flight = glider.Flight('helix')
    for asked in ({'depth_m': 50.0}, {'pitch_deg': 20.0}, {'hold': True}):
        with pytest.raises(ConfigurationError, match='three dimensions'):
            flight.order(**asked)


def test_orders_of_a_scenario_are_checked_one_after_the_other():
    with pytest.raises(ConfigurationError, match=r'orders.1.resume: the vehicle does not hold'):
        glider.Flight('current_8deg', {'orders': [ORDERS[0], ORDERS[3]]})
    with pytest.raises(ConfigurationError, match=r'orders.1.at_s = 4000: .* aborted before'):
        glider.Flight('current_8deg', {'orders': [ORDERS[4], {'at_s': 4000.0, 'hold': True}]})


def test_an_order_is_refused_that_would_leave_one_to_come_without_sense():
    fields = {**SHALLOW, 'orders': [{'at_s': 950.0, 'hold': True}, {'at_s': 960.0, 'abort': True}]}
    flight = glider.Flight('current_8deg', fields)
    flight.until(t_s=900.0)
    for asked, says in (({'hold': True}, 'holds already'), ({'abort': True}, 'aborted before')):
        with pytest.raises(ConfigurationError, match=says):
            flight.order(**asked)
    flight.order(depth_m=100.0)
    flight.until(t_s=970.0)
    with pytest.raises(ConfigurationError, match='aborted'):
        flight.order(depth_m=50.0)


@pytest.fixture(scope='module')
def flown():
    """All orders as data, flown at once, row by row."""
    run = glider.fly('current_8deg', {**YO, 'orders': ORDERS}, duration=ORDERED_S)
    return run.to_xarray()


def test_they_are_followed(flown):
    """Turned at 15 m, up while held, down again when resumed, up for good when aborted."""
    depth = flown['ground_truth_odom_depth'].sel(time=slice(0.0, ORDERED_S))
    at = {t_s: depth.sel(time=t_s, method='nearest').item() for t_s in (255.0, 425.0, 639.0)}
    assert 14.5 < depth.max() < 17.5
    assert at[255.0] < 1.0 < 4.0 < at[425.0] and at[639.0] < 1.0


def test_given_in_flight_they_have_the_bits_of_those_in_the_scenario(flown):
    """And of a flight whose state is kept and restored while an order waits for the surface."""
    flight = glider.Flight('current_8deg', YO, duration=ORDERED_S)
    for one in ORDERS:
        flight.until(t_s=one['at_s'])
        flight.order(**{name: value for name, value in one.items() if name != 'at_s'})
        kept = pickle.dumps(flight.state)
        flight.until(t_s=one['at_s'] + 15.0)
        flight.restore(pickle.loads(kept))
    flight.until(t_s=ORDERED_S)
    assert flight.orders == ORDERS
    last = flown.isel(time=-1)
    for name in last.data_vars:
        assert np.float64(flight.now[name]).tobytes() == np.float64(last[name].item()).tobytes()


def test_nodes_follow_them_to_the_same_bits_and_verify_says_so(tmp_path):
    flight = {'scenario': 'current_8deg', 'set': {**YO, 'orders': SOON}, 'duration': 220.0}
    folders = {engine: tmp_path / engine for engine in ('direct', 'nodes')}
    direct, nodes = (
        glider.fly(**flight, engine=engine, bag=True, out=folder).to_xarray()
        for engine, folder in folders.items()
    )
    for name in direct.data_vars:
        assert direct[name].values.tobytes() == nodes[name].values.tobytes(), name
    # up to be held, on the other path from there, to dive when resumed, up for good when aborted
    depth, heading = direct['ground_truth_odom_depth'], direct['reference_heading']
    assert depth.values[900] > 4.0 > 1.0 > depth.values[1700] and heading.values[-1] > 0.2
    waits = direct['stage'].values[[1700, 2090, 2190]] == WAITING_ON_SURFACE
    assert waits.tolist() == [True, False, True]
    told = []
    for folder in folders.values():
        done = CliRunner().invoke(app, ['verify', str(folder), '--json'])
        assert done.exit_code == 0 and json.loads(done.stdout)['identical'], done.output
        told.append(orders_in(folder))
    assert told[0] == told[1] and len(told[0]) == len(ORDERS)


def orders_in(folder) -> list[tuple[int, str, str]]:
    """Orders on record: tick, what, and what it changed."""
    reader, found = make_reader(next(folder.glob('**/*.mcap')).open('rb')), []
    for _, _, message in reader.iter_messages(topics=['/diagnostics']):
        array = STORE.deserialize_cdr(message.data, 'diagnostic_msgs/msg/DiagnosticArray')
        for status in array.status:
            if status.message in ('parameters set', 'abort'):
                stamp = array.header.stamp
                values = sorted((pair.key, pair.value) for pair in status.values)
                found.append((stamp.sec * 10 + stamp.nanosec // 10**8, status.message, values))
    return found
