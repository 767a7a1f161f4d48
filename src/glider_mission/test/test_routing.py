# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""Routes: fronts against closed forms, plans of the shipped seas, and what a pilot orders."""

import math
from typing import NamedTuple

import numpy as np
import pytest

from glider_base.errors import ConfigurationError
from glider_base.kernel import kernel
from glider_guidance.yo.stage import AT_END_OF_PATH, WAITING_ON_SURFACE
from glider_mission.blocks import COLUMNS, ROW
from glider_mission.routing import pilot as piloting
from glider_mission.routing.forecast_chart import (
    erroneous,
    expected,
    forecast_of,
    observed,
    with_land,
)
from glider_mission.routing.fronts import Chart, current_on, fronts, line_arrival, made_good
from glider_mission.routing.pilot import LOOK_TICKS, Pilot
from glider_mission.routing.plan import (
    pace_of,
    plan,
    route_through,
    sailed_s,
    straightened,
    waypoints_of,
)
from glider_mission.scenario import SCENARIO_FOLDER, load_scenario
from glider_model.ocean.eddying_sea import EddyingSea, currents, write_sea
from glider_model.ocean.field import FieldSettings, field_velocity
from glider_model.ocean.grid_file import load

END_S = 1e9
SPEED = 0.3


def chart_of(current, side_m=150_000.0, points=101, times=(0.0,)):
    """Chart of a current by place, a function of north and east (m)."""
    axis = np.linspace(-side_m, side_m, points)
    north, east = np.meshgrid(axis, axis, indexing='ij')
    field = np.stack(np.broadcast_arrays(*current(north, east)), axis=-1).astype(np.float32)
    return Chart(np.array(times), axis, axis, np.stack([field] * len(times)))


@pytest.fixture(scope='module')
def hard():
    """The shipped mission among strong eddies, and its chart."""
    scenario = load_scenario('eddies_hard')
    return scenario, forecast_of(scenario, 0.1)


def test_fronts_in_a_uniform_current_are_circles_that_drift():
    """Half as fast as the vehicle: never too early, 0.3 % late on average, 1.5 % at most."""
    chart = chart_of(lambda n, e: (0.09 + 0.0 * n, -0.12 + 0.0 * e))
    arrivals, _, goal_s, _ = fronts(chart, 0.0, 0.0, 0.0, 1e7, 1e7, SPEED, END_S)
    assert goal_s == math.inf
    north, east = np.meshgrid(chart.norths, chart.easts, indexing='ij')
    far = np.maximum(np.hypot(north, east), 1e-9)
    exact = np.vectorize(made_good)(0.09, -0.12, north / far, east / far, SPEED)
    off = (arrivals / (far / exact) - 1.0)[far > 15_000.0]
    assert off.min() > -1e-6
    assert off.mean() < 3e-3
    assert off.max() < 15e-3


def test_the_fastest_way_in_a_sheared_current_is_that_of_zermelo():
    """From (3.66, -1.86) to 0 in u = -V y / h: heading from 105 to 240 deg (Bryson and Ho)."""
    first, last = math.radians(105.0), math.radians(240.0)
    length = 30_000.0

    def sec(a):
        return 1.0 / math.cos(a)

    y = sec(first) - sec(last)
    tangents = math.tan(last) + sec(last), math.tan(first) + sec(first)
    x = -0.5 * (
        sec(last) * (math.tan(last) - math.tan(first))
        - math.tan(first) * (sec(last) - sec(first))
        + math.log(tangents[0] / tangents[1])
    )
    exact_s = abs(math.tan(first) - math.tan(last)) * length / SPEED
    chart = chart_of(lambda n, e: (0.0 * n, -SPEED * n / length), 6.0 * length, 241)
    _, _, found_s, _ = fronts(chart, 0.0, y * length, x * length, 0.0, 0.0, SPEED, END_S)
    assert found_s == pytest.approx(exact_s, rel=6e-3)
    assert found_s > exact_s * (1.0 - 2e-3)


@pytest.mark.parametrize('seed', range(4))
def test_no_straight_line_is_faster_than_the_fronts_say(seed):
    """And who sails the route in the same sea arrives as they say."""
    rng = np.random.default_rng(seed)
    still = chart_of(lambda n, e: (0.0 * n, 0.0 * e), 90_000.0, 61, np.arange(60) * 10_800.0)
    chart = erroneous(still, 0.12, 35.0, seed, 0)
    start, goal = rng.uniform(-60_000.0, 60_000.0, (2, 2))
    route = route_through(chart, np.array([start, goal]), 0.0, SPEED, END_S)
    straight_s = line_arrival(chart, 0.0, *start, *goal, SPEED)
    assert route.passed_s[0] <= straight_s * (1.0 + 1e-9)
    assert sailed_s(chart, route.corners, 0.0, SPEED, END_S) == pytest.approx(
        route.passed_s[0], rel=0.06
    )


@pytest.mark.parametrize(('along', 'across'), [(0.1, 0.0), (-0.2, 0.0), (0.0, 0.18), (-0.1, 0.18)])
def test_who_sails_in_an_even_current_is_there_by_the_triangle_of_velocities(along, across):
    """Over 6 km, of which the last ones are sailed in the current, too."""
    chart = chart_of(lambda n, e: (across + 0.0 * n, along + 0.0 * e))
    exact_s = 6000.0 / (along + math.sqrt(SPEED**2 - across**2))
    way = np.array([[0.0, 0.0], [0.0, 6000.0]])
    assert sailed_s(chart, way, 0.0, SPEED, END_S) == pytest.approx(exact_s, rel=1e-3)
    assert sailed_s(chart, way, 0.0, SPEED, 0.99 * exact_s) == math.inf


@pytest.mark.parametrize('scale', [0.3, 1.0, 10.0])
def test_short_legs_take_the_time_that_they_take_one_by_one(scale):
    """Corners are not cut: the vehicle, too, is led through them."""
    corners = [[0, 0], [1500, 0], [1500, 1000], [500, 1000], [500, -500], [1500, -500]]
    route = scale * np.array(corners, dtype=float)
    v_n, v_e = 0.08, 0.13
    chart = chart_of(lambda n, e: (v_n + 0.0 * n, v_e + 0.0 * e))
    exact_s = 0.0
    for way in np.diff(route, axis=0):
        length = math.hypot(*way)
        exact_s += length / made_good(v_n, v_e, *(way / length), SPEED)
    assert sailed_s(chart, route, 0.0, SPEED, END_S) == pytest.approx(exact_s, rel=0.02)


def test_nothing_sails_over_land():
    """An island across the way: the route leads around it, a closed bay is not left."""
    chart = chart_of(lambda n, e: (0.0 * n, 0.0 * e), 60_000.0, 41)
    north, east = np.meshgrid(chart.norths, chart.easts, indexing='ij')
    island = with_land(chart, (abs(east) < 3500.0) & (north < 40_000.0))
    ends = np.array([[0.0, -30_000.0], [0.0, 30_000.0]])
    route = route_through(island, ends, 0.0, SPEED, END_S)
    assert route.corners[:, 0].max() > 40_000.0
    assert route.passed_s[0] > 2.0 * math.hypot(30_000.0, 40_000.0) / SPEED
    wall = with_land(chart, abs(east) < 3500.0)
    assert not route_through(wall, ends, 0.0, SPEED, END_S).arrives


def test_a_straightened_route_stays_near_and_keeps_its_ends():
    way = np.array([[0.0, 0.0], [100.0, 3000.0], [-100.0, 6000.0], [9000.0, 9000.0]])
    found = np.array(straightened(way, 1000.0))
    np.testing.assert_array_equal(found, way[[0, 2, 3]])


def test_an_error_has_the_size_that_was_asked_for_and_loses_no_water():
    still = chart_of(lambda n, e: (0.0 * n, 0.0 * e), 200_000.0, 101, np.arange(8) * 10_800.0)
    one, other = (erroneous(still, 0.15, 40.0, 3, member).current for member in (1, 2))
    assert math.sqrt(0.5 * np.mean(one**2) * 2.0) == pytest.approx(0.15, rel=1e-3)
    assert abs(np.corrcoef(one.ravel(), other.ravel())[0, 1]) < 0.4
    north = np.gradient(one[0, ..., 0], axis=0) + np.gradient(one[0, ..., 1], axis=1)
    assert np.abs(north[2:-2, 2:-2]).max() < 0.15 * 0.02


def test_of_a_forecast_that_errs_is_believed_what_errors_leave_of_its_variance():
    """Less wrong than as it is, by as much as is told; of errors alone nothing is left."""
    off = []
    still = chart_of(
        lambda n, e: (0.1 + 0.0 * n, 0.0 * e), 200_000.0, 101, np.arange(2) * 10_800.0
    )
    for seed in range(8):
        sea = erroneous(still, 0.12, 40.0, seed, 0)
        found, error_mps = expected(erroneous(sea, 0.1, 40.0, seed, 1), 0.1)
        wrong = math.sqrt(float(np.mean((found.current - sea.current) ** 2)))
        off.append((wrong, error_mps))
    wrong, told = np.mean(off, axis=0)
    assert wrong < 0.085
    assert wrong == pytest.approx(told, rel=0.1)
    nothing, error_mps = expected(erroneous(still, 0.1, 40.0, 6, 0), 0.11)
    np.testing.assert_allclose(nothing.current, still.current, atol=0.02)
    assert error_mps == 0.0


def test_a_file_errs_by_itself(hard):
    """No error is added to it; of what it says is believed what its error leaves."""
    scenario, sure = hard
    file = SCENARIO_FOLDER / scenario.current.field.file
    told = {**scenario.forecast.model_dump(), 'file': str(file), 'error_mps': 0.05}
    found = forecast_of(load_scenario('eddies_hard', {'forecast': told}), 0.1)
    left, error_mps = expected(sure.chart, 0.05)
    np.testing.assert_array_equal(found.chart.current, left.current)
    assert found.error_mps == error_mps


def test_a_plan_counts_on_the_surface_for_the_time_of_the_stays(hard):
    """By eddies that are weaker with depth as exp(-z / 600 m): at the top twice their mean."""
    _, forecast = hard
    dives, chart = forecast.chart, forecast.sailed(forecast.chart)
    at_top = 1.0 / (0.6 * -math.expm1(-1000.0 / 600.0))
    there = np.abs(dives.current) > 0.05
    ratio = (chart.current[there] / dives.current[there]).mean()
    assert ratio == pytest.approx(0.9 + 0.1 * at_top, rel=5e-3)


def test_what_was_observed_corrects_the_forecast_where_it_was():
    chart = chart_of(lambda n, e: (0.1 + 0.0 * n, 0.0 * e), times=(0.0, 86_400.0))
    seen = np.array([[0.0, 10_000.0, 0.0, -0.1, 0.05]])
    for error_mps in (0.15, 0.0):  # it shows of itself that it is off
        found = observed(chart, seen, error_mps, 40.0)
        np.testing.assert_allclose(current_on(found, *seen[0, :3]), seen[0, 3:], atol=0.006)
        np.testing.assert_allclose(current_on(found, 0.0, -150_000.0, 0.0), (0.1, 0.0), atol=1e-3)
    assert observed(chart, seen[:0], 0.0, 40.0) is chart


def test_straight_legs_do_for_gentle_eddies_and_not_for_strong_ones():
    gentle, hard = (plan(load_scenario(f'eddies_{name}')) for name in ('10d', 'hard'))
    assert gentle.reachable
    assert hard.reachable
    assert gentle.straight_s < 10.0 * 86_400.0
    assert hard.straight_s == math.inf
    assert gentle.arrival_s(50.0) < 1.01 * gentle.straight_s
    assert 100.0 < gentle.wh < 500.0


def test_a_route_that_was_found_can_be_sailed_as_it_was_straightened(tmp_path):
    """In a sea where the current is as fast as the vehicle, and no corner may be cut by 1 km."""
    write_sea(EddyingSea(seed=3009, rms_mps=0.3), tmp_path / 'sea.nc')
    sea = {'orders': [], 'forecast.late_h': 0.0, 'current.field.file': str(tmp_path / 'sea.nc')}
    made = plan(load_scenario('eddies_10d', sea))
    assert made.reachable and made.straight_s == math.inf
    assert made.arrival_s(50.0) < 1.03 * made.route.passed_s[-1]


def test_errors_of_the_forecast_widen_what_a_plan_says():
    sure = plan(load_scenario('eddies_10d'))
    unsure = plan(load_scenario('eddies_10d', {'forecast.error_mps': 0.05}))
    assert sure.arrival_s(10.0) == sure.arrival_s(90.0)
    assert unsure.arrival_s(10.0) < unsure.arrival_s(50.0) < unsure.arrival_s(90.0)


def test_a_mission_that_is_too_short_is_not_reachable():
    made = plan(load_scenario('eddies_hard', {'duration_s': 4e5}))
    assert not made.reachable
    assert made.arrival_s(50.0) == math.inf
    assert made.wh is None


def test_a_mission_that_is_over_between_its_front_and_its_sail_is_not_reachable():
    """Fronts run straight from point to point; a vehicle sails a little longer."""
    ample = plan(load_scenario('eddies_hard'))
    front_s, sailed = ample.route.passed_s[-1], ample.waypoints_s[-1]
    assert front_s + 60.0 < sailed
    made = plan(load_scenario('eddies_hard', {'duration_s': 0.5 * (front_s + sailed)}))
    assert made.arrival_s(50.0) == math.inf
    assert not made.reachable


def test_a_helix_is_not_planned_along_a_chord_nor_a_path_that_is_followed_down_as_dives():
    with pytest.raises(ConfigurationError, match='path.kind = helix: no legs'):
        plan(load_scenario('helix'))
    with pytest.raises(ConfigurationError, match='profile.mode = path: no dives'):
        plan(load_scenario('spline'))


def row_at(place, stage, believed=(0.0, 0.0), target=None):
    """Log row of a vehicle at a place, with guidance's target there or elsewhere."""
    row = np.zeros(ROW)
    row[COLUMNS['reference']][:2] = (place if target is None else target)[::-1]
    row[COLUMNS['odom'].start], row[COLUMNS['odom'].start + 1] = place[1], place[0]
    row[COLUMNS['stage']] = stage
    row[COLUMNS['believed_current']][:2] = believed[::-1]
    return row


def test_a_pilot_plans_at_the_start_and_at_each_surfacing_once(hard):
    scenario, *_ = hard
    pilot = Pilot(scenario)
    first = pilot.order(0, None)
    start, end = waypoints_of(scenario)[[0, -1]]
    np.testing.assert_allclose(first.path.waypoints[0][:2], start)
    np.testing.assert_allclose(first.path.waypoints[-1][:2], end)
    place, given = start + 4000.0, []
    for stage, looks in ((1, 3), (5, 8), (1, 3), (5, 8)):
        for _ in range(looks):
            tick = LOOK_TICKS * (len(given) + 1)
            given.append(pilot.order(tick, row_at(place, stage, (0.1, 0.0))))
    told = [number for number, order in enumerate(given) if order]
    assert told == [5, 16]
    assert pilot.orders == [first, *(given[number] for number in told)]
    np.testing.assert_allclose(given[5].path.waypoints[0][:2], place)


def test_a_waypoint_that_guidance_came_by_is_not_gone_back_to(hard):
    """However far the vehicle is carried past it, as on straight legs; one that it did not is."""
    scenario, *_ = hard
    start, first, second = waypoints_of(scenario)[:3]
    for before_m, is_passed in ((500.0, True), (3000.0, False)):
        pilot = Pilot(scenario)
        pilot.order(0, None)
        come = first - before_m * (first - start) / math.dist(first, start)
        beyond = first + (-6e3, 3e3)
        rows = [row_at(0.5 * (start + first), 1), row_at(first + (0.0, 4e3), 1, target=come)]
        rows += [row_at(beyond, 5)] * 8
        told = [pilot.order(LOOK_TICKS * k, row) for k, row in enumerate(rows, 1)]
        (order,) = filter(None, told)
        nearest = min(np.hypot(*(np.array(one[:2]) - first)) for one in order.path.waypoints)
        assert (nearest > 1.0) == is_passed


def test_legs_that_are_shorter_than_a_waypoint_is_passed_by_are_all_flown(hard):
    """Of waypoints a kilometre apart none is passed by who has just begun."""
    corners = [(1000.0, 0.0), (1000.0, 1000.0)]
    ways = [(0.0, 0.0), *corners, *map(tuple, waypoints_of(hard[0])[1:].tolist())]
    path = {'kind': 'waypoints', 'waypoints': ways}
    pilot = Pilot(load_scenario('eddies_hard', {'path': path}))
    pilot.order(0, None)
    rows = [*(8 * [row_at((300.0, 0.0), 1)]), *(8 * [row_at((300.0, 0.0), 5)])]
    told = [pilot.order(LOOK_TICKS * k, row) for k, row in enumerate(rows, 1)]
    (order,) = filter(None, told)
    on_route = [one[:2] for one in order.path.waypoints]
    assert all(min(math.dist(one, corner) for one in on_route) < 1.0 for corner in corners)


def test_a_waypoint_that_the_current_leads_past_is_not_gone_round_an_eddy_for(tmp_path):
    """By a sea in which the vehicle comes up 3 km from its first waypoint, and is carried past."""
    write_sea(EddyingSea(seed=3016, rms_mps=0.42), tmp_path / 'sea.nc')
    sea = {'orders': [], 'current.field.file': str(tmp_path / 'sea.nc')}
    sea |= {'guidance.route': 'planned', 'guidance.replan': 'surfacing'}
    scenario = load_scenario('eddies_10d', sea)
    first = waypoints_of(scenario)[1]
    for place, is_passed in (((26_700.0, 24_400.0), True), ((25_000.0, 25_000.0), False)):
        pilot, look = Pilot(scenario), 13 * 60
        pilot.order(0, None)
        rows = [row_at(place, 1), *(8 * [row_at(place, 5)])]
        told = [pilot.order(LOOK_TICKS * (look + k), row) for k, row in enumerate(rows)]
        (order,) = filter(None, told)
        nearest = min(math.dist(one[:2], first) for one in order.path.waypoints)
        assert (nearest > 2000.0) == is_passed


def test_a_route_is_flown_that_a_slower_vehicle_can_follow(tmp_path):
    """At a place from where the fastest route crosses an eddy by nothing to spare."""
    write_sea(EddyingSea(seed=3010, rms_mps=0.42), tmp_path / 'sea.nc')
    sea = {'orders': [], 'current.field.file': str(tmp_path / 'sea.nc')}
    sea |= {'guidance.route': 'planned', 'guidance.replan': 'surfacing'}
    scenario, t_s = load_scenario('eddies_10d', sea), 267_000.0
    place = np.array([68_100.0, 5200.0])
    pace, ways = pace_of(scenario), waypoints_of(scenario)
    forecast = forecast_of(scenario, pace.stay)
    chart, left = forecast.sailed(forecast.chart), np.vstack((place, ways[3:]))
    fastest = route_through(chart, left, t_s, pace.speed, END_S)
    pilot = Pilot(scenario)
    pilot.order(0, None)
    rows = [*(row_at(way, 1) for way in ways[1:3]), *(8 * [row_at(place, 5)])]
    told = [pilot.order(2_670_000 + LOOK_TICKS * k, row) for k, row in enumerate(rows, -7)]
    (order,) = filter(None, told)
    flown = np.array([one[:2] for one in order.path.waypoints])
    times = [
        sailed_s(chart, way, t_s, share * pace.speed, t_s + 1e6) - t_s
        for way, share in ((fastest.corners, 0.95), (flown, 0.95), (flown, 1.0))
    ]
    assert times[0] == math.inf
    assert times[1] < 110.0 * 3600.0
    assert times[2] < fastest.passed_s[-1] - t_s + 12.0 * 3600.0


def test_a_pilot_who_shall_not_replan_or_is_nearly_there_says_nothing(hard):
    """Nearly there is who has the last point alone to come to, and a straight leg leads there."""
    scenario, *_ = hard
    *passed, end = waypoints_of(scenario)[1:]
    for replan, targets, place, speaks in (
        ('never', passed, (0.0, 0.0), False),
        ('surfacing', passed, end - 3000.0, False),
        ('surfacing', passed, end + 3000.0, True),
        ('surfacing', passed[:-1], end - 3000.0, True),
    ):
        pilot = Pilot(load_scenario('eddies_hard', {'guidance.replan': replan}))
        pilot.order(0, None)
        rows = [row_at(target, 1) for target in targets] + 8 * [row_at(place, 5)]
        told = [pilot.order(LOOK_TICKS * k, row) for k, row in enumerate(rows, 1)]
        assert any(told) == speaks


def test_who_is_up_at_the_end_of_the_path_is_not_sent_away(hard):
    """Where no leg leads to the last point any more, it has come by it."""
    scenario, *_ = hard
    *passed, end = waypoints_of(scenario)[1:]
    for stage, speaks in ((WAITING_ON_SURFACE, True), (AT_END_OF_PATH, False)):
        pilot = Pilot(scenario)
        pilot.order(0, None)
        rows = [row_at(target, 1) for target in passed] + 8 * [row_at(end + 3000.0, stage)]
        told = [pilot.order(LOOK_TICKS * k, row) for k, row in enumerate(rows, 1)]
        assert any(told) == speaks


def test_straight_legs_are_flown_where_a_plan_gains_little(monkeypatch):
    monkeypatch.setattr(piloting, 'LEAST_GAIN', 0.5)
    assert Pilot(load_scenario('eddies_10d', {'guidance.route': 'planned'})).order(0, None) is None


def test_the_pace_is_that_of_the_polar_less_the_stays():
    scenario = load_scenario('eddies_10d')
    params = scenario.guidance_settings().params()
    pace, longer = pace_of(scenario), pace_of(load_scenario('eddies_10d', {'profile.wait_s': 6e3}))
    assert 0.9 * params.profile_speed < pace.speed < params.profile_speed
    assert longer.cycle_s == pytest.approx(pace.cycle_s + 5400.0)
    assert longer.speed * longer.cycle_s == pytest.approx(pace.speed * pace.cycle_s)


@pytest.mark.parametrize(('name', 'seed', 'rms'), [('10d', 3, 0.18), ('hard', 5, 0.42)])
def test_the_shipped_seas_are_what_the_command_makes(name, seed, rms, tmp_path):
    write_sea(EddyingSea(seed=seed, rms_mps=rms), tmp_path / 'sea.nc')
    made, shipped = load(tmp_path / 'sea.nc'), load(SCENARIO_FOLDER / f'eddies_{name}.nc')
    for one, other in zip(made.axes, shipped.axes, strict=True):
        np.testing.assert_allclose(one, other)
    np.testing.assert_allclose(made.water, shipped.water, rtol=0.0, atol=2.1e-4)


def test_a_made_sea_is_as_strong_as_it_was_asked_to_be_and_loses_no_water():
    axes, east, north = currents(EddyingSea(seed=2, rms_mps=0.3))
    rms = math.sqrt(0.5 * np.mean(east[:, 0] ** 2 + north[:, 0] ** 2))
    assert rms == pytest.approx(0.3, rel=2e-3)
    degree_m = 111_200.0
    shrunk = math.cos(math.radians(float(axes['latitude'].mean())))
    spread = np.gradient(east[0, 0], axes['longitude'] * degree_m * shrunk, axis=1)
    spread += np.gradient(north[0, 0], axes['latitude'] * degree_m, axis=0)
    turning = np.gradient(north[0, 0], axes['longitude'] * degree_m * shrunk, axis=1)
    assert np.abs(spread[1:-1, 1:-1]).max() < 0.35 * np.abs(turning).max()


class Ending(FieldSettings):
    """A current of somebody's own that is not there behind its last hour."""

    kind: str = 'ending'
    last_s: float = 3600.0
    raises: bool = True

    def params(self) -> 'EndingParams':
        return EndingParams(self.last_s, self.raises)


class EndingParams(NamedTuple):
    last: float
    raises: bool


@field_velocity.body(EndingParams)
@kernel
def ending_velocity(position, t_s, params):
    if t_s > params.last and params.raises:
        raise ValueError('the sea is over')
    return 0.1 if t_s <= params.last else math.nan, 0.0, 0.0


def test_a_current_of_somebody_that_raises_or_is_no_number_is_told_in_a_line():
    survey = load_scenario('survey', {'current.speed_kn': 0.0})

    def by(**fields):
        field = survey.current.model_copy(update={'field': Ending(**fields)})
        return forecast_of(survey.model_copy(update={'current': field}), 0.1)

    np.testing.assert_allclose(by(last_s=1e9).chart.current[..., 0], 0.1, rtol=1e-6)
    who = r'^current.field: ending_velocity \(.*\): ValueError: the sea is over'
    with pytest.raises(ConfigurationError, match=who):
        by()
    with pytest.raises(ConfigurationError, match='field: nan m/s after 10,800 s at north -60,000'):
        by(raises=False)
