# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""What a run achieved: the scorecard, from the numbers on the topics alone.

The same function scores a bag and a direct run. What "run", "all" and "steady" count, and what an
inflection is, is in docs/conventions.md. What is scored is the true motion, whatever the vehicle
estimates.
"""

import math
from collections import Counter
from typing import Any

import numpy as np

from glider_base.frames import (
    euler_from_quaternion,
    heading_of,
    odometry_from_wire,
    pitch_of,
    poses_from_wire,
)
from glider_base.kernel import kernel
from glider_base.signals import TICK_S, Odometry, dive_m
from glider_bringup.scoring.energy import EnergyScorer
from glider_bringup.scoring.faults import FaultTimes
from glider_bringup.scoring.navigation import NavigationScorer
from glider_bringup.scoring.outcome import (
    COMPLETED,
    INFEASIBLE,
    SAME_M,
    BottomWatch,
    arrival_of,
    as_reported,
    ends_mission,
    outcome_of,
    way_to_end,
)
from glider_bringup.scoring.scores import EVENTS_KEPT, Flown, measured, seconds
from glider_bringup.scoring.true_motion import TrueMotion, course_at, jumps
from glider_control.intake import REFUSED
from glider_guard.rows import ALL, DROP, LATCHED, NOTE, REACTIONS, ROWS, SURFACE, reaction_of
from glider_guidance.block import say_no_progress
from glider_guidance.order import Order
from glider_guidance.orders import begins, first_ticks
from glider_guidance.path.curve import PathParams, path_length, path_point
from glider_guidance.yo.stage import AT_END_OF_PATH, GLIDING_DOWN
from glider_mission.blocks import COLUMNS
from glider_mission.rules import Rules
from glider_mission.scenario import Scenario
from glider_model.ocean.bottom import NO_BOTTOM
from glider_model.plant.plant import DIVED_M, NO_DIVES, dives_after
from glider_model.plant.sensors import make_readings, noise_of_readings
from glider_model.vehicle.file import load_vehicle

#: Heading fluctuation is about the mean over this time (s).
HEADING_MEAN_S = 300.0
#: A run is infeasible if the course could not be held for this share of the scored time.
INFEASIBLE_SHARE = 0.5

#: The course of the path is that of so much of it (m).
COURSE_M = 1.0
#: What the event of a refused measurement says.
REFUSED_SAYS = 'a measurement was refused, the last good one serves'

#: What the score needs of every tick, in the order of `_series_of`.
_SERIES = (
    *('depth', 'e2', 'reported_e2', 'pitch', 'pitch_ref', 'heading', 'rate_ref'),
    *('target_n', 'target_e', 'infeasible', 'guard', 'mask'),
    *('net_heaviness', 'pitch_mass', 'roll_mass', 'fin'),
)
_ODOM, _E2 = COLUMNS['odom'], COLUMNS['tracking_error'].start + 1
_FIRST_ODOM, _FIRST_REFERENCE, _FIRST_JOINT = (
    COLUMNS[name].start for name in ('odom', 'reference', 'joint_states')
)
_GUARD, _SATURATION, _INFEASIBLE = (
    COLUMNS[name] for name in ('guard', 'saturation', 'infeasible')
)
_TARGET = slice(_FIRST_REFERENCE, _FIRST_REFERENCE + 2)
#: Rows from one second to the next.
_EACH_S = round(1.0 / TICK_S)


@kernel
def _series_of(log, given):
    """`_SERIES` of log rows with the true motion, and as they were reported, float64[16, n]."""
    series = np.empty((len(_SERIES), len(log)))
    for k in range(len(log)):
        row, joints = log[k], log[k, _FIRST_JOINT:]
        x = odometry_from_wire(row[_FIRST_ODOM:])
        wanted = odometry_from_wire(row[_FIRST_REFERENCE:])  # but velocities are over ground
        pitch, heading = (
            pitch_of(x.q_w, x.q_x, x.q_y, x.q_z),
            heading_of(x.q_w, x.q_x, x.q_y, x.q_z),
        )
        theta = pitch_of(wanted.q_w, wanted.q_x, wanted.q_y, wanted.q_z)
        motion = (x.p_d, row[_E2], given[k, _E2], pitch, theta, heading)
        asked = (wanted.w, wanted.p_n, wanted.p_e, row[_INFEASIBLE])
        bits = (row[_GUARD], float(int(row[_SATURATION]) | int(row[_GUARD])))
        values = motion + asked + bits + (joints[0], joints[1], joints[2], joints[3])
        for i in range(len(values)):
            series[i, k] = values[i]
    return series


@kernel
def _take_off_noise(log, first_tick, readings):
    """Put where the actuators are in the place of where they say that they are, in place."""
    for row in range(log.shape[0]):
        for joint, noise in enumerate(noise_of_readings(first_tick + row, readings)):
            log[row, _FIRST_JOINT + joint] -= noise


class Scorer:
    """Collects log blocks, then gives the score."""

    def __init__(self, scenario: Scenario) -> None:
        vehicle, bottom = load_vehicle(scenario.vehicle), scenario.bottom()
        self._waiting = list(scenario.orders)
        self._followed: list[Order] = []  #: orders that held
        #: first tick of each other path that was ordered, the place there, and the path
        self._ordered: list[tuple[int, tuple[float, float], PathParams]] = []
        reckons = scenario.navigation.jumps
        #: that it needs, beside those that are always read
        self.topics = ('fix', 'believed_current', 'current_velocity') if reckons else ()
        #: of the path at its start, if the target never moves along it
        self._course_rad = scenario.path.course_rad()
        readings = make_readings(vehicle.params(), scenario.seed)
        self._readings = readings if readings.is_noisy else None
        self._steers_by = vehicle.steers_by
        #: depth that it is rated for and that it bears (m)
        self._hull = vehicle.rated_depth_m, vehicle.crush_depth_m
        self._has_weight = bool(vehicle.drop_weight)
        self._bottom = None if bottom is NO_BOTTOM else BottomWatch(bottom)
        #: waypoints before the last, north and east (m), and how near it came to each (m)
        self._waypoints = getattr(scenario.path, 'waypoints', [])[1:-1]
        self._nearest_m = np.full(len(self._waypoints), math.inf)
        self._truth = TrueMotion()
        tells = 'believed_current' in scenario.topics
        self._navigation = NavigationScorer(scenario.origin.params(), reckons, tells)
        self._faults = FaultTimes(scenario.faults)
        self._energy = EnergyScorer(vehicle.energy)
        self._blocks: list[np.ndarray] = []
        self._first: np.ndarray | None = None
        self._last: np.ndarray | None = None
        #: first tick of another path, rows before and at it, and its course there, if given
        self._reroutes: list[tuple[int, np.ndarray, np.ndarray, float | None]] = []
        self._end: tuple[int, np.ndarray] | None = None
        self._stays: list[dict[str, Any]] = []

    def add(self, log: np.ndarray) -> None:
        """Take in a block of log rows, float64[n, ROW]; nothing of it is kept by reference."""
        if not len(log):
            return
        given, log = log, self._truth.of(log)
        if self._readings:
            log = log.copy()
            _take_off_noise(log, self.ticks, self._readings)
        self._navigation.add(given, log)
        self._faults.add(log)
        self._energy.add(log)
        self._blocks.append(_series_of(log, given))
        if self._bottom:
            self._bottom.add(*np.ascontiguousarray(poses_from_wire(log[:, _ODOM])[:, :3].T))
        easts, norths = log[::_EACH_S, _FIRST_ODOM : _FIRST_ODOM + 2].T
        for k, (north, east, _) in enumerate(self._waypoints):
            near_m = np.hypot(norths - north, easts - east).min()
            self._nearest_m[k] = min(self._nearest_m[k], near_m)
        if self._first is None:
            self._first = self._last = log[0].copy()
        for row in jumps(log[:, _TARGET], self._last[_TARGET]).tolist():
            before = (log[row - 1] if row else self._last).copy()
            tick = self.ticks - len(log) + row
            self._reroutes.append((tick, before, log[row].copy(), course_at(given[row])))
        self._look_for_end(log)
        no_progress = log[:, COLUMNS['no_progress']]
        for row in begins(no_progress, self._last[COLUMNS['no_progress']]).tolist():
            said = say_no_progress(int(no_progress[row]))
            self._stays += [{'t_s': seconds(self.ticks - len(log) + row), 'message': said}]
        self._last = log[-1].copy()

    def order(self, order: Order) -> None:
        """Take in an order that is given in flight, before the rows from its time on."""
        self._waiting.append(order)

    def _look_for_end(self, log: np.ndarray) -> None:
        """Note which orders hold, and where it first comes to the end of the last path."""
        begin, stage, path_from = self.ticks - len(log), log[:, COLUMNS['stage']], 0
        before = np.concatenate(([self._last[COLUMNS['stage']] if begin else -1], stage[:-1]))
        for row, order in first_ticks(self._waiting, begin, before):
            self._waiting = [one for one in self._waiting if one is not order and not order.abort]
            self._followed.append(order)
            if order.path:
                self._end, path_from = None, row
                place = _place_of(log[row])
                self._ordered.append((begin + row, place, order.path.params()))
        away = np.flatnonzero(stage[path_from:] == GLIDING_DOWN)
        if len(away):  # who came up too far from it flies on; who holds there or aborts does not
            self._end, path_from = None, path_from + int(away[-1]) + 1
        up = path_from + np.flatnonzero(stage[path_from:] == AT_END_OF_PATH)
        if self._end is None and len(up):
            self._end = begin + int(up[0]), log[up[0]].copy()

    @property
    def ticks(self) -> int:
        """Ticks taken in."""
        return sum(block.shape[1] for block in self._blocks)

    def _series(self, name: str) -> np.ndarray:
        """One series over all blocks, float64[ticks]; not kept, for 30 h of all are 140 MB."""
        column = _SERIES.index(name)
        return np.concatenate([np.empty(0), *(block[column] for block in self._blocks)])

    def result(self, rules: Rules) -> dict:
        """Scores of everything taken in.

        Returns
        -------
        dict
            The run's part of ``score.json``: ticks, settle_s, dives, distance_along_path_m,
            end_of_path_m, arrival, no_progress, bottom, what is `measured`, actuator_travel,
            energy, guard, faults, navigation, final_state, and ``status`` and ``reason`` of a run
            that was flown to its end. A figure without data is None.
        """
        series, ticks = self._series, self.ticks
        depth, reported = series('depth'), as_reported(series('guard').astype(np.int64) & ALL)
        flies = ~ends_mission(reported) & ~(np.maximum.accumulate(depth) > self._hull[1])
        steady, scored = windows(depth, series('rate_ref') > 0.0, rules, TICK_S)
        steady &= flies
        heading, has_whole_mean = _heading_fluctuation_deg(series('heading'))
        flown = Flown(
            depth=depth,
            e2=series('e2'),
            pitch_error=np.degrees(series('pitch') - series('pitch_ref')),
            heading=heading,
            steady=steady,
            scored=scored,
            whole=steady & has_whole_mean,
            turn_m=max([rules.depth_m, *(one.depth_m for one in self._followed if one.depth_m)]),
        )
        estimated = flown._replace(e2=series('reported_e2'))
        dives = _count_dives(depth, dive_m(min(rules.depth_m, rules.shallowest_m)))
        way_m, time_s = self._along_path_m(), seconds(ticks)
        held = ~(series('infeasible')[scored & flies] > 0.0)
        infeasible = bool(len(held) and np.mean(~held) >= INFEASIBLE_SHARE)
        task, rules = self._task(rules.path), self._with_last_path(rules)
        arrival = self._arrival(rules)
        missing = self._missing(depth, dives, arrival['arrival'], task, rules)
        status, reason = outcome_of(depth, reported, self._hull, infeasible, missing)
        lacks_dives = dives < rules.dives and self._end is None
        if status == COMPLETED and lacks_dives and rules.duration_s - time_s <= TICK_S:
            reason = reason or f'its time was over after {dives} of {rules.dives} dives'
        if status in (COMPLETED, INFEASIBLE) and self._waiting:
            times = ', '.join(f'{order.at_s:,.0f} s' for order in self._waiting)
            left = f'it never came to what it was ordered at {times}'
            reason = f'{reason}; {left}' if reason else left
        pace_m = way_m if status in (COMPLETED, INFEASIBLE) else None
        return {
            'status': status,
            'reason': reason,
            'ticks': ticks,
            'sim_time_s': time_s,
            'settle_s': rules.settle_s,
            'dives': dives,
            'distance_along_path_m': way_m,
            **arrival,
            'no_progress': {'events': self._stays[:EVENTS_KEPT]},
            'bottom': self._bottom.result() if self._bottom else None,
            **measured(flown),
            'actuator_travel': self._actuator_travel(),
            'energy': self._energy.result(time_s, dives, pace_m),
            'guard': _guard(series('mask'), self._has_weight),
            'faults': self._faults.result(),
            'navigation': self._navigation.result(
                rules.navigation, measured(estimated, 'cross_track_m')['cross_track_m']
            ),
            'final_state': self._final_state(),
        }

    def _targets(self) -> np.ndarray:
        """Points of the path that guidance had come to, north and east, float64[ticks, 2]."""
        return np.stack((self._series('target_n'), self._series('target_e')), axis=1)

    def _along_path_m(self) -> float:
        """Way of the vehicle along its path (m): that of its target, and how far off it ends.

        The way from one path to another, to which it is ordered, is none.
        """
        if self._last is None:
            return 0.0
        target = self._targets()
        begin, first, course, way_m = 0, self._first, self._course_rad, 0.0
        for tick, before, row, led in (*self._reroutes, (len(target), self._last, None, None)):
            part = target[begin:tick]
            ahead_m = _along_m(first, part, course)  # looking ahead, looking back
            behind_m = _along_m(before, part[::-1], course + math.pi)
            way_m += float(np.sum(np.hypot(*np.diff(part, axis=0).T))) - ahead_m - behind_m
            begin, first, course = tick, row, course if led is None else led
        return way_m

    def _actuator_travel(self) -> dict:
        """Ways that the actuators have gone, to and fro."""
        travel = {
            'buoyancy_engine_kg': _travel(self._series('net_heaviness')),
            'pitch_mass_m': _travel(self._series('pitch_mass')),
            'roll_mass_deg': math.degrees(_travel(self._series('roll_mass'))),
        }
        if self._steers_by:
            travel[f'{self._steers_by}_deg'] = math.degrees(_travel(self._series('fin')))
        return travel

    def _with_last_path(self, rules: Rules) -> Rules:
        """Rules of the path that was ordered last."""
        for path in (order.path for order in self._followed if order.path):
            rules = rules._replace(
                path=path.params(),
                ends=path.at_end == 'stop',
                arrival_radius_m=path.arrival_radius_m,
            )
        return rules

    def _arrival(self, rules: Rules) -> dict:
        """How far from the path's end it came up there, None if it did not; see `arrival_of`."""
        if self._last is None:
            return {'end_of_path_m': None, 'arrival': None}
        tick, row = self._end or (self.ticks, self._last)
        since = self._ordered[-1][0] if self._ordered else 0
        arrival = arrival_of(
            place=_place_of(row),
            targets=self._targets()[since:],
            tick=tick,
            since=since,
            is_at_end=self._end is not None,
            rules=rules,
        )
        if arrival:
            arrival['waypoints_m'] = self._nearest_m.tolist()
        end_m = arrival['missed_m'] if arrival and self._end else None
        return {'end_of_path_m': end_m, 'arrival': arrival}

    def _task(self, path: PathParams | None) -> tuple[int, float]:
        """Tick from which it is to come to its last point, and the way there from then on (m).

        ``path`` is that of its mission. Another one to the same point is the same task, which may
        be longer: a planned route is ordered anew at every surfacing.
        """
        tick, way_m, goal = 0, math.inf, None
        begins = [(0, _place_of(self._first), path)] if path and self.ticks else []
        for since, place, path in (*begins, *self._ordered):
            before, goal = goal, path_point(path_length(path), path)[:2]
            is_same = before is not None and math.dist(before, goal) <= SAME_M
            to_end_m = way_to_end(place, path)
            tick, way_m = (tick, max(way_m, to_end_m)) if is_same else (since, to_end_m)
        return tick, way_m

    def _missing(
        self,
        depth: np.ndarray,
        dives: int,
        arrival: dict | None,
        task: tuple[int, float],
        rules: Rules,
    ) -> str:
        """What of its mission was not flown, in words; empty if nothing."""
        time_s, ended = seconds(self.ticks), self._end is not None
        if ended and arrival and not arrival['arrived']:
            return f'came up {arrival["missed_m"]:,.0f} m from the last point of its path'
        is_done = 0 < rules.dives <= dives
        goes_on = not ended and not is_done
        if rules.duration_s - time_s > TICK_S:
            # who has arrived, or is to go on, may be done before
            if (arrival or self._ordered) and goes_on:
                return 'afloat for longer than it was to wait, before the end of its path'
            later_s = [one.at_s for one in self._waiting if one.path]
            if later_s and min(later_s) < rules.duration_s and not is_done:
                return f'over before another path was ordered, at {min(later_s):,.0f} s'
            return ''
        stays = [order for order in self._followed if order.hold or order.resume]
        has_more = rules.dives or arrival or not dives
        if goes_on and has_more and stays and stays[-1].hold:
            return f'held at the surface as ordered at {stays[-1].at_s:,.0f} s, and not resumed'
        in_time = min(rules.dives, int(rules.duration_s / rules.dive_s))
        if goes_on and dives < in_time:
            return f'dives flown, of those that there was time for: {dives} of {in_time}'
        is_led_aground = self._bottom and self._bottom.touched_tick is not None
        if rules.dives_at_all and not dives and (is_led_aground or not _dives_at_all(depth)):
            return 'no dive flown, for which there was time'
        if goes_on and rules.dives_at_all and _idles(depth, rules):
            return f'no dive flown in its last {rules.dive_s:,.0f} s, ample for one'
        since, way_m = task
        ample_s = rules.spare_s + rules.pace_s * way_m
        if goes_on and arrival and time_s - seconds(since) >= ample_s:
            off = f'{arrival["missed_m"]:,.0f} m from its last point'
            return f'not at the end of its path, for which there was time in still water: {off}'
        return ''

    def _final_state(self) -> dict | None:
        """Position, attitude and velocity over ground (body axes FRD) of the last tick."""
        if self._last is None:
            return None
        odometry = _odometry_of(self._last)
        attitude = euler_from_quaternion(odometry.q_w, odometry.q_x, odometry.q_y, odometry.q_z)
        return {
            'position_ned_m': [odometry.p_n, odometry.p_e, odometry.p_d],
            'attitude_rpy_rad': list(attitude),
            'velocity_mps': [odometry.u, odometry.v, odometry.w],
        }


def _odometry_of(row: np.ndarray) -> Odometry:
    return odometry_from_wire(tuple(row[_ODOM].tolist()))


def _place_of(row: np.ndarray) -> tuple[float, float]:
    """North and east (m)."""
    odometry = _odometry_of(row)
    return odometry.p_n, odometry.p_e


def scores_of(scenario: Scenario, scorer: Scorer) -> dict:
    """Scores of what a scorer has taken in, by the rules of its scenario."""
    return scorer.result(scenario.score_rules(scorer.ticks * TICK_S))


def _guard(mask: np.ndarray, has_weight: bool) -> dict:
    """What the guard noticed in flight and did, and what control refused, as they reported it.

    ``mask`` is the sum of the bits of `glider_guard.rows` and of `glider_control`, both reported
    together before there was a guard; a vehicle that ``has_weight`` can do more than surface.
    """
    gravest = DROP if has_weight else SURFACE
    rows = {row.bit: (row.name, REACTIONS[min(row.reaction, gravest)], row.says) for row in ROWS}
    rows[REFUSED] = ('measurement_refused', REACTIONS[NOTE], REFUSED_SAYS)
    reported = as_reported(mask.astype(np.int64) & (ALL | REFUSED))
    events, before, count = [], 0, Counter()
    for tick in np.flatnonzero(np.diff(reported, prepend=0)).tolist():
        new = int(reported[tick]) & ~before
        before = int(reported[tick])
        events += [
            {'t_s': seconds(tick), 'row': row, 'reaction': reaction, 'message': says}
            for bit, (row, reaction, says) in rows.items()
            if new & bit and count[bit] < EVENTS_KEPT
        ]
        count.update(bit for bit in rows if new & bit)
    return {
        'state': 'latched' if before & LATCHED else 'flying',
        'reaction': REACTIONS[min(reaction_of(before), gravest)],
        'events': events,
    }


def windows(
    depth: np.ndarray, descending: np.ndarray, rules: Rules, step_s: float
) -> tuple[np.ndarray, np.ndarray]:
    """Masks of the steady and of all scored samples.

    ``depth`` (m) and ``descending``, whether the desired vertical rate points down, are of samples
    ``step_s`` s apart, from the start of the run on.
    """
    scored = np.arange(len(depth)) * step_s > rules.settle_s
    steady = scored & (depth > rules.steady_depth_m)
    margin = round(rules.margin_s / step_s)
    for turn in np.flatnonzero(descending[1:] != descending[:-1]) + 1:
        steady[max(0, turn - margin) : turn + margin + 1] = False
    return steady, scored


def _heading_fluctuation_deg(heading: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Heading less its running mean over HEADING_MEAN_S (deg), and where that mean is whole."""
    half = round(0.5 * HEADING_MEAN_S / TICK_S)
    whole = np.zeros(len(heading), np.bool_)
    whole[half : len(heading) - half] = True
    return np.degrees(_less_its_mean(heading, half)), whole


@kernel
def _less_its_mean(heading, half):
    """Heading (rad) less its mean over ``half`` ticks before and after, the way round it went."""
    ticks, turned = len(heading), 0.0
    unwrapped, total = np.empty(ticks), np.zeros(ticks + 1)
    for k in range(ticks):
        step = heading[k] - heading[max(0, k - 1)]
        if abs(step) > math.pi:
            turned += (step + math.pi) % (2.0 * math.pi) - math.pi - step
        unwrapped[k] = heading[k] + turned - heading[0]
        total[k + 1] = total[k] + unwrapped[k]
    less = np.empty(ticks)
    for k in range(ticks):
        first, last = max(k - half, 0), min(k + half + 1, ticks)
        less[k] = unwrapped[k] - (total[last] - total[first]) / (last - first)
    return less


@kernel
def _count_dives(depth, dive):
    """Number of times that the vehicle dived and came back, as the plant counts them.

    A climb that is its last one leads to above ``dive`` (m).
    """
    dives = NO_DIVES
    for now in depth:
        dives = dives_after(dives, now, dive)
    is_up = dives.is_down or dives.turn < dive
    return dives.count if is_up else max(0, dives.count - 1)


def _dives_at_all(depth: np.ndarray) -> bool:
    """Whether it went down and came back, however little: over a shelf a bottom turns dives."""
    deepest_m = float(np.max(depth, initial=0.0))
    return deepest_m > DIVED_M and _count_dives(depth, dive_m(deepest_m)) > 0


def _idles(depth: np.ndarray, rules: Rules) -> bool:
    """Whether it has been at the surface at last for as long as a stay and a dive take."""
    return bool(np.max(depth[-math.ceil(rules.dive_s / TICK_S) :], initial=0.0) <= DIVED_M)


def _along_m(row: np.ndarray, target: np.ndarray, course_rad: float) -> float:
    """How far the vehicle of a log row is from the first of some targets towards the others (m).

    That is on the course to the first of them that is away by `COURSE_M`, or else ``course_rad``.
    """
    towards = np.array([math.cos(course_rad), math.sin(course_rad)])
    if far := _first_away(target):
        away = target[far] - target[0]
        towards = away / np.hypot(*away)
    odometry = _odometry_of(row)
    return float(towards @ (odometry.p_n - target[0, 0], odometry.p_e - target[0, 1]))


@kernel
def _first_away(target):
    """Index of the first target that is `COURSE_M` away from the one they begin with; 0: none."""
    for i in range(len(target)):
        if math.hypot(target[i, 0] - target[0, 0], target[i, 1] - target[0, 1]) > COURSE_M:
            return i
    return 0


def _travel(position: np.ndarray) -> float:
    """Way that an actuator has gone, to and fro."""
    return float(np.sum(np.abs(np.diff(position))))
