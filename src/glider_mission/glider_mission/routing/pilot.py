# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""Who plans a route before the flight and, if asked to, anew at every surfacing.

A pilot knows the forecast and what the vehicle tells at the surface: its place by fixes, and the
mean current of the dive segment before the last. That corrects the forecast. Where a planned
route gains too little to be worth the errors of the forecast, straight legs are flown.
"""

import math

import numpy as np

from glider_base.errors import ConfigurationError
from glider_base.signals import TICK_S
from glider_guidance.order import Order
from glider_guidance.orders import is_surfaced
from glider_guidance.path.settings import WaypointPath
from glider_guidance.yo.stage import AT_END_OF_PATH
from glider_mission.blocks import COLUMNS
from glider_mission.routing.forecast_chart import forecast_of, observed
from glider_mission.routing.fronts import line_arrival
from glider_mission.routing.plan import (
    Route,
    as_dived,
    crossing,
    pace_of,
    route_round,
    sailed_s,
    waypoints_of,
    with_errors,
)
from glider_mission.scenario import Scenario

#: The pilot looks so often (ticks).
LOOK_TICKS = 600
#: At the surface a place is known after this time, or half of the stay if that is shorter (s).
_LISTEN_S = 180.0
#: A waypoint is passed from this near on (m), or from the middle of a shorter leg. The vehicle is
#: carried past one this near (m) to which no straight leg leads, nor any route within so long (s).
#: From this near on to the last, nothing changes while a straight leg leads there.
_PASSED_M, _NEAR_M, _ROUND_S = 2000.0, 8000.0, 86_400.0
#: A route for so much less speed is flown where it takes no longer than the fastest one by this
#: time (s): who falls behind on that may miss its last chance to cross an eddy.
_SPARED, _LATER_S = 0.95, 43_200.0
#: A planned route has to be faster than straight legs by this share, in the middle of the errors
#: that the forecast may have.
LEAST_GAIN = 0.03
#: Routes may take so long (s), whatever time the mission has.
_HORIZON_S = 60.0 * 86_400.0
#: Corners of a route are farther apart than this (m).
_APART_M = 200.0

_ODOM, _TARGET = COLUMNS['odom'].start, COLUMNS['reference'].start
_BELIEVED, _STAGE = COLUMNS['believed_current'], COLUMNS['stage']


class Pilot:
    """Gives the orders of a mission whose route is planned; errors as `forecast_of`."""

    def __init__(self, scenario: Scenario) -> None:
        scenario = as_dived(scenario)
        pace = pace_of(scenario)
        self._scenario, self._speed = scenario, pace.speed
        self._forecast = forecast_of(scenario, pace.stay)
        chart = self._forecast.chart
        self._errors = [
            sea.current - chart.current
            for sea in with_errors(chart, self._forecast.error_mps, scenario)
        ]
        self._bottom = scenario.bottom()
        self._waypoints, self._next = waypoints_of(scenario), 1
        self._replans = scenario.guidance.replan == 'surfacing'
        self._listen_s = min(_LISTEN_S, 0.5 * scenario.profile.wait_s)
        self._seen: list[tuple[float, ...]] = []
        self._last: tuple[float, np.ndarray] = (0.0, self._waypoints[0])
        self._way: tuple[float, ...] = ()  #: middle of the last dive segment: time, north, east
        self._up_s = 0.0  #: time for which it has been at the surface
        self._was_ordered, self._is_straight = True, True
        self.orders: list[Order] = []  #: that it gave

    def order(self, tick: int, row: np.ndarray | None) -> Order | None:
        """What the vehicle is ordered at a tick, a multiple of `LOOK_TICKS`, if anything.

        The row float64[ROW] is that of the tick before in the log; None: it begins.
        """
        t_s = round(tick * TICK_S, 1)
        if row is None:
            return self._order_for(t_s, self._waypoints[0])
        if not self._replans:
            return None
        place, target = (np.array([row[at + 1], row[at]]) for at in (_ODOM, _TARGET))
        self._pass(target)
        stage = int(row[_STAGE])
        if stage == AT_END_OF_PATH:  # it has arrived, or guidance has it fly on to the last point
            return None
        if not is_surfaced(stage):
            self._up_s, self._was_ordered = 0.0, False
            return None
        self._up_s += LOOK_TICKS * TICK_S
        if self._was_ordered or self._up_s < self._listen_s:
            return None
        self._was_ordered = True
        self._look(t_s, place, row[_BELIEVED])
        return self._order_for(t_s, place)

    def _pass(self, target: np.ndarray) -> None:
        """Note the waypoints that are passed, by the point of the route that guidance came to.

        As on straight legs, one that the vehicle is carried past is not gone back to.
        """
        before, goal = self._waypoints[self._next - 1 : self._next + 1]
        near_m = min(_PASSED_M, 0.5 * math.dist(before, goal))
        if self._next < len(self._waypoints) - 1 and math.dist(target, goal) < near_m:
            self._next += 1

    def _look(self, t_s: float, place: np.ndarray, estimated: np.ndarray) -> None:
        """Note the current of the segment before the one that is over: this one is known later.

        Navigation takes a dive segment in when it leaves the surface after it.
        """
        (before_s, before), way = self._last, self._way
        self._last, self._way = (t_s, place), (0.5 * (t_s + before_s), *(0.5 * (place + before)))
        east, north = float(estimated[0]), float(estimated[1])
        if way and math.isfinite(east) and math.isfinite(north) and (east or north):
            self._seen.append((*way, north, east))

    def _comes_round(self, coast: tuple, left: np.ndarray, t_s: float) -> bool:
        """Whether a route of no more than `_ROUND_S` leads to the first of what is left."""
        return route_round(*coast, left[:2], t_s, self._speed, t_s + _ROUND_S).arrives

    def _route(self, coast: tuple, left: np.ndarray, t_s: float) -> Route:
        """Route through what is left, with speed to spare where that costs little."""
        fastest, spared = (
            route_round(*coast, left, t_s, share * self._speed, t_s + _HORIZON_S)
            for share in (1.0, _SPARED)
        )
        if not (fastest.arrives and spared.arrives):
            return fastest
        later_s = spared.passed_s[-1] - fastest.passed_s[-1]
        return spared if later_s < _LATER_S else fastest

    def _order_for(self, t_s: float, place: np.ndarray) -> Order | None:
        """Order to follow the best route from a place; None where it follows that already."""
        seen = np.array(self._seen).reshape(-1, 5)
        forecast, error_km = self._forecast, self._scenario.forecast.error_km
        chart = forecast.sailed(observed(forecast.chart, seen, forecast.error_mps, error_km))
        left, end_s = np.vstack((place, self._waypoints[self._next :])), t_s + _HORIZON_S
        coast, is_last = (chart, forecast.land, self._bottom), len(left) == 2
        if math.dist(*left[:2]) < _NEAR_M:
            leads = math.isfinite(line_arrival(chart, t_s, *left[:2].ravel(), self._speed))
            if leads and is_last:
                return None
            if not (leads or is_last or self._comes_round(coast, left, t_s)):
                self._next, left = self._next + 1, np.delete(left, 1, axis=0)
        route = self._route(coast, left, t_s)
        is_land = crossing(*coast, left) is not None
        seas = [chart._replace(current=chart.current + error) for error in self._errors]
        planned_s, straight_s = (
            float(np.median([sailed_s(sea, way, t_s, self._speed, end_s) for sea in seas]))
            for way in (route.corners, left)
        )
        is_faster = planned_s - t_s < (1.0 - LEAST_GAIN) * (straight_s - t_s)
        is_worth_it = route.arrives and (is_land or is_faster)
        if not is_worth_it and is_land and t_s == 0.0:
            raise ConfigurationError(
                'guidance.route: no way round the land between waypoints is found (allowed: '
                'waypoints farther from land than 3 km, or straight legs beside it)'
            )
        if not is_worth_it and (is_land or self._is_straight):
            return None
        self._is_straight = not is_worth_it
        corners = route.corners if is_worth_it else left
        apart = np.hypot(*np.diff(corners, axis=0).T) > _APART_M
        corners = corners[[True, *apart]]
        if len(corners) < 2:
            return None
        path = WaypointPath(
            kind='waypoints',
            waypoints=[tuple(map(float, corner)) for corner in corners],
            **self._scenario.path.ending(),
        )
        order = Order(at_s=t_s, path=path)
        self.orders.append(order)
        return order
