# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""What a mission will take: whether it gets there, when, by what route and with what energy."""

import math
from collections.abc import Callable, Iterator
from typing import NamedTuple

import numpy as np

from glider_base.errors import ConfigurationError
from glider_base.signals import TICK_S
from glider_guidance.guidance import GuidanceParams
from glider_guidance.path.curve import path_entry, path_point
from glider_mission.routing.forecast_chart import erroneous, forecast_of, with_land
from glider_mission.routing.fronts import Chart, fronts, sail
from glider_mission.scenario import Scenario
from glider_model.ocean.bottom import FlatBottom, bottom_depth, least_height
from glider_model.ocean.density import immersed
from glider_model.onboard.command_filter import Filtered, filter_angle
from glider_model.onboard.glide_polar import (
    MODEL_VERTICAL_RATE,
    glide_net_heaviness,
    glide_vertical_rate,
)
from glider_model.vehicle.file import load_vehicle

#: A route is straightened where that moves it by less than the first of these (m) by which it can
#: be sailed.
_STRAIGHT_M = 1000.0, 500.0, 250.0, 0.0
#: Who is so near to where its path is entered is there (m).
_THERE_M = 1000.0
#: Whether a leg leads over land is looked at so often along it (m).
_LOOK_M = 20.0
#: How deep it is there is looked at so often (m).
_DIVE_M = 200.0
#: Errors of a forecast that are tried.
MEMBERS = 12
#: What is left of the speed of the polar for a vehicle that steers, by what eddies_10d flies (-).
_HELD_SHARE = 0.985
#: Levels of a dive at which it is looked at.
_LEVELS = 21


class Pace(NamedTuple):
    """How a vehicle gets on, by its glide polar and its profile."""

    speed: float  #: through the water, horizontally, surface intervals included (m/s)
    cycle_s: float  #: from one surface interval to the next, or of a dive without one (s)
    stay: float  #: share of the time that it is at the surface (-)
    cycle_wh: float | None  #: that it takes; None where the battery is not known
    dives: int  #: of a cycle
    dive_wh: float  #: that a dive more takes on the same way down and up: at the surface


class Route(NamedTuple):
    """A route through waypoints, and when it is at each of them."""

    corners: np.ndarray  #: float64[n, 2], north and east (m), the start among them
    passed_s: list[float]  #: when a front is at each waypoint (s); those not reached are missing
    fronts: list[np.ndarray]  #: arrivals on the chart, float64[n, m], one for each waypoint
    ends: list[int]  #: which corners are waypoints that are reached

    @property
    def arrives(self) -> bool:
        """Whether all waypoints are reached in the time."""
        return len(self.passed_s) == len(self.fronts)


class Plan(NamedTuple):
    """What a mission will take."""

    route: Route  #: straight legs, where these alone arrive
    arrivals_s: np.ndarray  #: float64[members], along the route; infinite: not in the time
    straight_s: float  #: along straight legs, by the forecast; infinite: not in the time
    pace: Pace
    chart: Chart
    end_s: float  #: when it is over: by its time, or by its dives

    @property
    def reachable(self) -> bool:
        """Whether it gets there in the time, as it sails by the forecast."""
        is_led = len(self.route.ends) == len(self.route.fronts)
        return is_led and all(map(math.isfinite, self.waypoints_s))

    def arrival_s(self, percent: float) -> float:
        """Arrival (s) that so many of the errors that were tried keep; infinite: not in time."""
        return float(np.sort(self.arrivals_s)[round(percent / 100.0 * (len(self.arrivals_s) - 1))])

    @property
    def waypoints_s(self) -> list[float]:
        """Arrivals (s) at the waypoints that are reached, along the route, by the forecast."""
        ways = [self.route.corners[: end + 1] for end in self.route.ends]
        return [sailed_s(self.chart, way, 0.0, self.pace.speed, self.end_s) for way in ways]

    @property
    def wh(self) -> float | None:
        """Energy until the arrival, of half of the errors; None where nobody knows.

        The last dives share what is left, and are shallower.
        """
        time_s, pace = self.arrival_s(50.0), self.pace
        if pace.cycle_wh is None or not math.isfinite(time_s):
            return None
        cycles = time_s / pace.cycle_s
        more = math.ceil(cycles * pace.dives) - cycles * pace.dives
        return pace.cycle_wh * cycles + pace.dive_wh * more


def pace_of(scenario: Scenario) -> Pace:
    """How the vehicle of a mission gets on, by its polar."""
    params = scenario.guidance_settings().params()
    profile, every = params.profile, params.profile.surface_every
    dives = max(1, every)
    stay_s = (profile.wait_ticks + profile.prepare_ticks) * TICK_S if every else 0.0
    turns = dives - (every > 0)  # that are not at the surface
    glide_s = 2.0 * (dives * profile.depth - turns * profile.top_depth) / profile.glide_rate
    oil, weights = _oil_and_weights(scenario, params)
    slower_s = glide_s * _slower(weights, params)
    cycle_s = glide_s + slower_s + 2.0 * dives * profile.lead_s + stay_s
    speed = _HELD_SHARE * glide_s * params.profile_speed / cycle_s
    cycle_wh, dive_wh = _energy(scenario, params, oil, cycle_s, stay_s)
    return Pace(speed, cycle_s, stay_s / cycle_s, cycle_wh, dives, dive_wh)


def _oil_and_weights(scenario: Scenario, params: GuidanceParams) -> tuple[np.ndarray, np.ndarray]:
    """Oil (kg, + sinks) that the weights of dive and climb ask for, and what these are (kg).

    float64[2, _LEVELS] each. Where the pump has less than that, the weights are less.
    """
    profile, body = params.profile, load_vehicle(scenario.vehicle).params()
    water = scenario.resolved_water().params()
    empty = [immersed(z, 0.0, body, water) for z in _levels(params).tolist()]
    nets, ratios = np.array([(one.net, one.ratio) for one in empty]).T
    wanted = np.array([[profile.net_heaviness], [-profile.climb_net_heaviness]])
    oil = (wanted - nets) / ratios
    there = np.clip(oil, -body.m_b_max, body.m_b_max)
    return oil, np.where(there == oil, wanted, nets + ratios * there)


def _levels(params: GuidanceParams) -> np.ndarray:
    """Depths (m), float64[_LEVELS], at which a dive is looked at."""
    return np.linspace(0.0, params.profile.depth, _LEVELS)


def _slower(weights: np.ndarray, params: GuidanceParams) -> float:
    """How much longer than by its weights a dive takes by those of `_oil_and_weights` (-)."""
    profile, more = params.profile, 0.0
    dive = -profile.pitch, profile.net_heaviness, profile.dive_rate
    climb = profile.climb_pitch, -profile.climb_net_heaviness, profile.climb_rate
    for levels, (pitch, wanted, rate) in zip(weights, (dive, climb), strict=True):
        for weight in levels[levels != wanted].tolist():
            weight = wanted * max(0.0, weight / wanted)  # of one that floats up: nothing
            slow = abs(glide_vertical_rate(pitch, weight, params.polar))
            more += (1.0 / max(slow, MODEL_VERTICAL_RATE) - 1.0 / rate) / _LEVELS
    return 0.5 * profile.glide_rate * more


def _energy(
    scenario: Scenario, params: GuidanceParams, oil: np.ndarray, cycle_s: float, stay_s: float
) -> tuple[float | None, float]:
    """Energy (Wh) of `Pace.cycle_s`: pump, electronics and, at the surface, a call; `dive_wh`."""
    vehicle, profile = load_vehicle(scenario.vehicle), params.profile
    if vehicle.energy is None:
        return None, 0.0
    energy, body = vehicle.energy.params(), vehicle.params()
    sinking, rising = np.clip(oil, -body.m_b_max, body.m_b_max)
    out_kg = np.maximum(0.0, -np.diff(sinking)) + np.maximum(0.0, np.diff(rising))
    heavy = oil[0, -1]
    law = scenario.control.buoyancy  # it takes a part of what the water makes of it for drag
    as_drag = law.drag_ki_kg_per_m / (law.ki_kg_per_m + law.drag_ki_kg_per_m or 1.0)
    out_kg[-1] += sinking[-1] - rising[-1]
    out_kg[-1] += 2.0 * as_drag * max(0.0, heavy - profile.net_heaviness)
    # as much pumped out at a level, and let in again (J/kg)
    costs = np.maximum(0.0, energy.out + energy.out_per_m * _levels(params))
    costs += max(0.0, energy.let_in)
    dives, call, top = max(1, profile.surface_every), 0.0, 0.0
    if stay_s:
        over_kg = min(_over_kg(params, vehicle.slowest_pump_rate(0.0)), body.m_b_max + rising[0])
        top = max(0.0, over_kg) * costs[0]
        call = energy.call_start + energy.call * min(energy.call_s, stay_s)
    hotel = 0.5 * (energy.dive + energy.climb) * (cycle_s - stay_s) + energy.surface * stay_s
    flat = (dives * out_kg.sum() * costs[0] + top + call) / dives
    return (dives * out_kg @ costs[1:] + top + call + hotel) / 3600.0, flat / 3600.0


def _over_kg(params: GuidanceParams, pump_kgps: float) -> float:
    """What is pumped out (kg) beyond a climb's before a dive, as the nose goes over.

    The pump follows, at its rate, the weight of the climb at the pitch that is asked for. That of
    a shallow one is more.
    """
    pitch, step = Filtered(params.profile.climb_pitch, 0.0), pump_kgps * TICK_S
    heavy = climb = glide_net_heaviness(pitch.value, -params.profile.climb_rate, params.polar)
    for _ in range(params.profile.prepare_ticks):
        pitch = filter_angle(pitch, -params.profile.pitch, 0.0, params.pitch_filter, TICK_S)
        wanted = glide_net_heaviness(pitch.value, -params.profile.climb_rate, params.polar)
        if wanted > heavy:
            break
        heavy = max(wanted, heavy - step)
    return climb - heavy


def route_through(
    chart: Chart, waypoints: np.ndarray, t_s: float, speed: float, end_s: float
) -> Route:
    """Fastest way from the first of some places, float64[n, 2] (m), to one after the other.

    At a speed through the water (m/s), from a start to the end of the time (s); straight on from
    where it does not get on any more.
    """
    corners, passed, found, ends = [waypoints[0]], [], [], []
    columns = len(chart.easts)
    for place, goal in zip(waypoints, waypoints[1:], strict=False):
        arrivals, before, goal_s, last = fronts(
            chart, t_s, *map(float, place), *map(float, goal), speed, end_s
        )
        found.append(arrivals)
        if not math.isfinite(goal_s):
            break
        points, point = [], last
        while point >= 0:
            points.append((chart.norths[point // columns], chart.easts[point % columns]))
            point = before[point]
        way, late_s = np.array([place, *points[::-1], goal]), 2.0 * goal_s - t_s
        for within_m in _STRAIGHT_M:
            leg = straightened(way, within_m)
            if math.isfinite(sailed_s(chart, np.array(leg), t_s, speed, late_s)):
                break
        corners += leg[1:]
        passed.append(goal_s)
        ends.append(len(corners) - 1)
        t_s = goal_s
    done = len(passed) + 1
    missing = [np.empty((0, 0))] * (len(waypoints) - 1 - len(found))
    return Route(np.array([*corners, *waypoints[done:]]), passed, [*found, *missing], ends)


def places_along(route: np.ndarray, step_m: float) -> np.ndarray:
    """North and east (m), float64[n, 2], of places on straight legs, so far apart at most."""
    legs = zip(route, route[1:], strict=False)
    return np.concatenate(
        [np.linspace(a, b, 2 + int(np.hypot(*(b - a)) / step_m)) for a, b in legs]
    )


def bottom_under(route: np.ndarray, bottom: NamedTuple) -> float:
    """Least depth of the bottom (m) under straight legs."""
    norths, easts = places_along(route, _LOOK_M).T.copy()
    return least_height(norths, easts, np.zeros(len(norths)), bottom)[0]


def as_dived(scenario: Scenario) -> Scenario:
    """A mission with dives as deep as its altimeter lets them be, where straight legs can dive.

    It is the harmonic mean, by which as many dives are flown as over the bottom as it is.
    """
    profile, bottom = scenario.profile, scenario.bottom()
    places = places_along(waypoints_of(scenario), _DIVE_M) if profile.clearance_m else []
    deepest = np.array([bottom_depth(*place, bottom) - profile.clearance_m for place in places])
    deepest = deepest[deepest > profile.top_depth_m]
    if not len(deepest):
        return scenario
    depth_m = float(1.0 / np.mean(1.0 / np.minimum(deepest, profile.depth_m)))
    profile = profile.model_copy(update={'depth_m': depth_m})
    return scenario.model_copy(update={'profile': profile})


def crossing(
    chart: Chart, land: np.ndarray, bottom: NamedTuple, route: np.ndarray
) -> tuple[int, int] | None:
    """Point of a chart that is nearest to where straight legs lead over land; None: nowhere.

    There is land by the bottom where that is charted, else by the nearest points, bool[n, m].
    """
    norths, easts = places_along(route, _LOOK_M).T.copy()
    step = chart.norths[1] - chart.norths[0]
    rows, columns = (
        np.rint((along - axis[0]) / step).astype(int).clip(0, len(axis) - 1)
        for along, axis in zip((norths, easts), (chart.norths, chart.easts), strict=True)
    )
    is_over = land[rows, columns] & isinstance(bottom, FlatBottom)
    least_m, where = least_height(norths, easts, np.zeros(len(norths)), bottom)
    is_over[where] |= least_m <= 0.0
    first = is_over.argmax()
    return (int(rows[first]), int(columns[first])) if is_over[first] else None


def route_round(
    chart: Chart,
    land: np.ndarray,
    bottom: NamedTuple,
    waypoints: np.ndarray,
    t_s: float,
    speed: float,
    end_s: float,
) -> Route:
    """`route_through` that leads over no land, nor over what the bottom has of it between points.

    Where it would, the nearest point of the chart becomes land, and the route is sought again.
    """
    while True:
        route = route_through(with_land(chart, land), waypoints, t_s, speed, end_s)
        point = crossing(chart, land, bottom, route.corners) if route.arrives else None
        if point is None or land[point]:
            return route
        land[point] = True


def straightened(points: np.ndarray, within_m: float) -> list[np.ndarray]:
    """Fewer corners, none left out that is farther off (m; Douglas and Peucker 1973)."""
    first, last = points[0], points[-1]
    if len(points) < 3:
        return [first, last]
    chord = last - first
    length = max(1e-9, float(np.hypot(*chord)))
    away = points - first
    off = np.abs(away[:, 0] * chord[1] - away[:, 1] * chord[0]) / length
    farthest = int(off.argmax())
    if off[farthest] <= within_m:
        return [first, last]
    before, after = points[: farthest + 1], points[farthest:]
    return straightened(before, within_m)[:-1] + straightened(after, within_m)


def sailed_s(chart: Chart, route: np.ndarray, t_s: float, speed: float, end_s: float) -> float:
    """Arrival (s) of a vehicle that follows a route; infinite: not in the time."""
    return sail(chart, t_s, np.ascontiguousarray(route), speed, end_s)


def waypoints_of(scenario: Scenario) -> np.ndarray:
    """Where a mission starts, joins its path, and the corners after that (m), float64[n, 2]."""
    path, initial = scenario.path.params(), scenario.initial
    start = initial.north_m, initial.east_m, initial.depth_m
    s = path_entry(*start, scenario.profile.mode != 'path', path)
    ways = np.array([path_point(at, path)[:2] for at in (s, *path.knots[path.knots > s])])
    is_there = len(ways) > 1 and np.hypot(*(ways[0] - start[:2])) < _THERE_M
    return np.vstack((start[:2], ways[int(is_there) :]))


def with_errors(chart: Chart, error_mps: float, scenario: Scenario) -> Iterator[Chart]:
    """A chart with one after the other of `MEMBERS` errors; as it is if it has none."""
    forecast = scenario.forecast
    for member in range(MEMBERS if error_mps > 0.0 else 0):
        yield erroneous(chart, error_mps, forecast.error_km, scenario.seed, member + 1)
    if not error_mps:
        yield chart


def plan(scenario: Scenario, progress: Callable[[int], None] = lambda done: None) -> Plan:
    """Plan a mission by its forecast; errors as `forecast_of`, and of paths without legs or dives.

    ``progress`` gets how many of `MEMBERS` + 1 steps are done.
    """
    if scenario.path.kind == 'helix':
        raise ConfigurationError(
            'path.kind = helix: no legs to be planned (allowed: straight, waypoints, spline)'
        )
    if scenario.profile.mode == 'path':
        raise ConfigurationError('profile.mode = path: no dives to be planned (allowed: profile)')
    scenario = as_dived(scenario)
    pace, end_s = pace_of(scenario), scenario.duration_s
    forecast = forecast_of(scenario, pace.stay)
    chart, land = forecast.sailed(forecast.chart), forecast.land
    if scenario.dives:
        every = scenario.profile.surface_every_dives
        cycles = scenario.dives / max(1, every)
        # the last wait is not flown
        left_out_s = min(1.0, cycles) * scenario.profile.wait_s if every else 0.0
        end_s = min(end_s, cycles * pace.cycle_s - left_out_s)
    waypoints = waypoints_of(scenario)
    bottom = scenario.bottom()
    route = route_round(chart, land, bottom, waypoints, 0.0, pace.speed, end_s)
    progress(1)
    straight_s, arrivals = math.inf, []
    if not crossing(chart, land, bottom, waypoints):
        straight_s = sailed_s(chart, waypoints, 0.0, pace.speed, end_s)
    made = Plan(route, np.empty(0), straight_s, pace, chart, end_s)
    if not made.reachable and math.isfinite(straight_s):
        route = route._replace(corners=waypoints, ends=[*range(1, len(waypoints))])
        made = made._replace(route=route)
    arrives = made.reachable
    for sea in with_errors(chart, scenario.forecast.error_mps, scenario):
        s = sailed_s(sea, route.corners, 0.0, pace.speed, end_s) if arrives else math.inf
        arrivals.append(s)
        progress(len(arrivals) + 1)
    return made._replace(arrivals_s=np.array(arrivals))
