# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""A run in bounded memory, with every peak in it: what reports, comparisons and figures show.

Time is cut into at most `BUCKETS` buckets of equal length, and of each quantity the smallest and
the largest value in a bucket are kept, in the order in which they came. When the buckets are used
up, neighbours are joined, so that a run of any length takes the same memory, and what is kept of a
run does not depend on the blocks in which it came. Buckets begin with two ticks: a run of up to
2 `BUCKETS` ticks is kept whole.
"""

import math
from dataclasses import dataclass, replace
from itertools import pairwise
from pathlib import Path
from typing import NamedTuple

import numpy as np

from glider_base.frames import poses_from_wire, wrap_angle
from glider_base.kernel import kernel
from glider_base.settings import ConfigurationError
from glider_base.signals import TICK_S, Adaptation
from glider_bringup.scoring.navigation import ELLIPSE_95
from glider_bringup.scoring.true_motion import TrueMotion
from glider_mission.blocks import COLUMNS
from glider_mission.disk import whole_file
from glider_mission.scenario import Scenario
from glider_model.ocean.current_settings import KNOT_MPS
from glider_model.vehicle.file import VehicleParams, load_vehicle

#: Most buckets that are kept of a run.
BUCKETS = 2**15
#: Topics that traces are made from, beside those that the score needs.
TRACED = ('current_velocity', 'current_estimate', 'command', 'adaptation', 'battery')
#: Of what is kept: changes with names and meaning.
VERSION = 3

_FLAGS = (
    *('buoyancy_engine_at_limit', 'pitch_mass_at_limit', 'roll_mass_at_limit'),
    *('surface_at_limit', 'infeasible'),
)
#: Actuators, as a log row has them: name, unit of their curves, and a position in that unit.
_JOINTS = (
    ('buoyancy_engine', 'kg', np.asarray),
    ('pitch_mass', 'mm', lambda metres: 1e3 * metres),
    ('roll_mass', 'deg', np.degrees),
    ('surface', 'deg', np.degrees),
)
_MEASURED = ('depth_m', 'cross_track_m', 'roll_deg', 'pitch_deg', 'heading_deg')
#: Quantities of which extremes are kept.
CURVES = (
    *('depth_m', 'depth_ref_m', 'cross_track_m', 'vertical_error_m'),
    *('roll_deg', 'pitch_deg', 'pitch_ref_deg', 'heading_deg', 'heading_ref_deg'),
    *('current_north_kn', 'current_east_kn', 'estimate_north_kn', 'estimate_east_kn'),
    *('buoyancy_engine_kg', 'pitch_mass_mm', 'roll_mass_deg'),
    *('buoyancy_engine_ref_kg', 'pitch_mass_ref_mm', 'roll_mass_ref_deg'),
    *('surface_deg', 'surface_ref_deg'),  # of a vehicle with a steering surface
    'battery_percent',  # of one that tells of its battery
    *('descending', *_FLAGS),
    *Adaptation._fields,
    *(f'measured_{name}' for name in _MEASURED),
    *('place_error_m', 'place_bound_m'),
)
#: Quantities that are sampled at the beginning of each bucket, all at the same time.
SAMPLES = (
    *('track_north_m', 'track_east_m', 'track_depth_m'),
    *('target_north_m', 'target_east_m', 'target_depth_m'),
    *('water_north_kn', 'water_east_kn'),
    *('believed_north_m', 'believed_east_m'),
)


@dataclass(frozen=True)
class Traces:
    """What was kept of a run."""

    ticks: int
    spacing_s: float  #: time between two values of a curve: half a bucket (s)
    curves: dict[str, np.ndarray]  #: float32[2 n] by name: extremes; NaN where there was no value
    samples: dict[str, np.ndarray]  #: float32[n + 1]: beginning of each bucket, and the last tick
    missing: dict[str, int]  #: ticks without a finite value, by name of the curve
    flagged: dict[str, int]  #: ticks in which a flag was set, by its name

    def has(self, name: str) -> bool:
        """Whether there is any value of a curve."""
        return bool(np.any(np.isfinite(self.curves[name])))

    def largest(self, name: str) -> float:
        """Largest magnitude of a curve; 0 if it has no value."""
        values = self.curves[name]
        return float(np.max(np.abs(values), initial=0.0, where=np.isfinite(values)))

    def time_s(self) -> np.ndarray:
        """Times (s) of the values of every curve."""
        return self.spacing_s * np.arange(len(self.curves['depth_m']))

    def first_s(self, flag: str) -> float | None:
        """When a flag was set first (s, to half a bucket); None if it never was."""
        at = np.flatnonzero(self.curves[flag] > 0.0)
        return float(at[0]) * self.spacing_s if len(at) else None

    def inflections_s(self) -> np.ndarray:
        """Times (s, to half a bucket) at which the desired vertical rate changes its sign."""
        descending = self.curves['descending']
        known = np.flatnonzero(np.isfinite(descending))
        turns = np.flatnonzero(np.diff(descending[known])) + 1
        return known[turns] * self.spacing_s

    def thinned(self, most: int) -> 'Traces':
        """The same in fewer, longer buckets, so that a curve has at most so many values."""
        thin = self
        while len(thin.curves['depth_m']) > max(2, most):
            thin = replace(
                thin,
                spacing_s=2.0 * thin.spacing_s,
                curves={name: halve(values.copy()) for name, values in thin.curves.items()},
                samples={
                    name: np.append(values[:-1:2], values[-1:])
                    for name, values in thin.samples.items()
                },
            )
        return thin

    def save(self, file: Path) -> None:
        """Write everything into a NumPy archive, whole or not at all.

        Raises ConfigurationError if it cannot be written.
        """
        with whole_file(file) as stream:
            np.savez_compressed(
                stream,
                version=VERSION,
                ticks=self.ticks,
                spacing_s=self.spacing_s,
                missing=np.array([self.missing[name] for name in CURVES]),
                flagged=np.array([self.flagged[name] for name in _FLAGS]),
                **self.curves,
                **self.samples,
            )


def load_traces(file: Path) -> Traces:
    """Read what `Traces.save` wrote.

    Raises ConfigurationError if the file cannot be read, or is of another version of this program.
    """
    try:
        with np.load(file) as archive:
            if bad := archive.zip.testzip():
                raise ConfigurationError(f'{file}: damaged: the checksum (CRC) of {bad} is wrong')
            if int(archive['version']) != VERSION:
                raise ConfigurationError(f'{file}: made by another version of this program')
            return Traces(
                int(archive['ticks']),
                float(archive['spacing_s']),
                {name: archive[name] for name in CURVES},
                {name: archive[name] for name in SAMPLES},
                dict(zip(CURVES, archive['missing'].tolist(), strict=True)),
                dict(zip(_FLAGS, archive['flagged'].tolist(), strict=True)),
            )
    except ConfigurationError:
        raise
    except FileNotFoundError as error:
        raise ConfigurationError(f'{file}: {error.strerror}') from None
    except Exception as error:  # of damaged bytes numpy, zipfile and zlib make all kinds
        raise ConfigurationError(f'{file}: damaged: {error}') from None


class Dive(NamedTuple):
    """From the beginning of a descent to that of the next, or to the end of the run."""

    from_s: float
    to_s: float
    deepest_m: float
    way_m: float  #: horizontal, from where it began to where it ended, in a straight line
    off_path_m: float  #: largest distance from the path to either side
    battery_percent: float  #: what is left at its end; NaN if it is not known


def dives_of(traces: Traces) -> list[Dive]:
    """Dives of a run; times to half a bucket of its traces.

    A descent begins where the desired vertical rate turns downward. What comes before the first
    one belongs to no dive.
    """
    descending = traces.curves['descending']
    known = np.flatnonzero(np.isfinite(descending))
    downward = np.diff(descending[known], prepend=0.0) > 0.0
    begins = known[downward].tolist()
    return [_dive(traces, start, end) for start, end in pairwise([*begins, len(descending)])]


def _dive(traces: Traces, start: int, end: int) -> Dive:
    """Dive of the values of curves from ``start`` to before ``end``."""
    places = (traces.samples['track_north_m'], traces.samples['track_east_m'])
    last = len(places[0]) - 1
    first, to = min(start // 2, last), min(-(-end // 2), last)
    north, east = (float(place[to] - place[first]) for place in places)
    battery = traces.curves['battery_percent'][start:end]
    battery = battery[np.isfinite(battery)]
    return Dive(
        from_s=start * traces.spacing_s,
        to_s=end * traces.spacing_s,
        deepest_m=_largest(traces.curves['depth_m'][start:end]),
        way_m=float(np.hypot(north, east)),
        off_path_m=_largest(traces.curves['cross_track_m'][start:end]),
        battery_percent=float(battery[-1]) if len(battery) else np.nan,
    )


def _largest(values: np.ndarray) -> float:
    """Largest magnitude; NaN of nothing."""
    known = np.abs(values[np.isfinite(values)])
    return float(known.max()) if len(known) else np.nan


class Tracer:
    """Takes log blocks as they come and keeps `Traces` of them.

    What was measured, or estimated, is kept beside the truth where it is another. The actuators of
    ``vehicle`` have limits. If it ``reckons`` its place, how far off that is is kept, too.
    """

    topics = TRACED

    def __init__(self, vehicle: VehicleParams, reckons: bool = False) -> None:
        limits = [vehicle.m_b_max, vehicle.x_p_max, vehicle.mu_max, vehicle.delta_max or np.nan]
        self._limits = np.array(limits)
        self._truth, self._reckons = TrueMotion(), reckons
        self._ticks, self._size, self._heading = 0, 2, np.nan
        self._points = {name: np.full(2 * BUCKETS, np.nan, np.float32) for name in CURVES}
        self._samples = np.full((BUCKETS, len(SAMPLES)), np.nan, np.float32)
        self._last = np.empty((0, len(SAMPLES)), np.float32)
        self._missing = dict.fromkeys(CURVES, 0)
        self._flagged = dict.fromkeys(_FLAGS, 0)

    def add(self, log: np.ndarray) -> None:
        """Take in a block of log rows, float64[n, ROW]; nothing of it is kept by reference."""
        if not len(log):
            return
        true = self._truth.of(log)
        curves = _curves(true, _poses(true, self._heading), self._limits)
        if true is not log:
            measured = _motion(log, _poses(log, self._heading))
            curves.update({f'measured_{name}': measured[name] for name in _MEASURED})
        if self._reckons:
            curves.update(_place(log))
        samples = _samples(true, log if self._reckons else None)
        for name in _FLAGS:
            self._flagged[name] += int(np.count_nonzero(curves[name] > 0.0))
        known = curves['heading_deg'][np.isfinite(curves['heading_deg'])]
        self._heading = np.radians(known[-1]) if len(known) else self._heading
        self._last = samples[-1:].astype(np.float32)
        start = 0
        while start < len(log):
            if self._ticks == BUCKETS * self._size:
                self._join()
            end = min(len(log), start + BUCKETS * self._size - self._ticks)
            for name, values in curves.items():
                points = self._points[name]
                self._missing[name] += _fold(values[start:end], self._ticks, self._size, points)
            first = -(-self._ticks // self._size)
            begins = samples[start + first * self._size - self._ticks : end : self._size]
            self._samples[first : first + len(begins)] = begins
            self._ticks += end - start
            start = end

    def result(self) -> Traces:
        """What was kept of everything taken in so far."""
        buckets = -(-self._ticks // self._size)
        samples = np.concatenate((self._samples[:buckets], self._last)).T.copy()
        return Traces(
            self._ticks,
            0.5 * self._size * TICK_S,
            {name: points[: 2 * buckets].copy() for name, points in self._points.items()},
            dict(zip(SAMPLES, samples, strict=True)),
            dict(self._missing),
            dict(self._flagged),
        )

    def _join(self) -> None:
        """Join neighbouring buckets, which must all be full."""
        for points in self._points.values():
            halve(points)
        self._samples[: BUCKETS // 2] = self._samples[::2]
        self._size *= 2


def make_tracer(scenario: Scenario) -> Tracer:
    """Tracer of a run of a scenario."""
    return Tracer(load_vehicle(scenario.vehicle).params(), scenario.navigation.jumps)


def _poses(log: np.ndarray, heading_before: float) -> np.ndarray:
    """Poses of log rows, float64[n, 6], as `poses_from_wire` gives them.

    Headings go on through +-180 deg from ``heading_before`` (rad), NaN if there was none.
    """
    odom = poses_from_wire(log[:, COLUMNS['odom']])
    _unwrap(odom[:, 5], heading_before)
    return odom


def _motion(log: np.ndarray, odom: np.ndarray) -> dict[str, np.ndarray]:
    """Quantities of the motion of log rows with such poses, by their names, float64[n] each."""
    return {
        'depth_m': odom[:, 2],
        'cross_track_m': log[:, COLUMNS['tracking_error']][:, 1],
        'roll_deg': np.degrees(odom[:, 3]),
        'pitch_deg': np.degrees(odom[:, 4]),
        'heading_deg': np.degrees(odom[:, 5]),
    }


def _curves(log: np.ndarray, odom: np.ndarray, limits: np.ndarray) -> dict[str, np.ndarray]:
    """Those and all others but what was measured or is estimated."""
    reference = poses_from_wire(log[:, COLUMNS['reference']])
    _bring_near(reference[:, 5], odom[:, 5])
    rising = log[:, COLUMNS['reference']][:, 9]
    joints = log[:, COLUMNS['joint_states']]
    current = log[:, COLUMNS['current_velocity']] / KNOT_MPS
    estimate = log[:, COLUMNS['current_estimate']] / KNOT_MPS
    command = log[:, COLUMNS['command']]
    held = (np.abs(command) >= limits).astype(float).T
    actuators = {}
    for i, (joint, unit, shown) in enumerate(_JOINTS):
        actuators[f'{joint}_at_limit'] = held[i]
        if np.isfinite(limits[i]):  # there is one
            actuators[f'{joint}_{unit}'] = shown(joints[:, i])
            actuators[f'{joint}_ref_{unit}'] = shown(command[:, i])
    battery = {}
    left = log[:, COLUMNS['battery']][:, -1]
    if np.any(left >= 0.0):  # less than nothing is not known
        battery = {'battery_percent': np.where(left >= 0.0, 100.0 * left, np.nan)}
    return {
        **_motion(log, odom),
        'depth_ref_m': np.maximum(0.0, reference[:, 2]),  # an order to surface points above
        'vertical_error_m': log[:, COLUMNS['tracking_error']][:, 2],
        'pitch_ref_deg': np.degrees(reference[:, 4]),
        'heading_ref_deg': np.degrees(reference[:, 5]),
        'current_north_kn': current[:, 1],
        'current_east_kn': current[:, 0],
        'estimate_north_kn': estimate[:, 1],
        'estimate_east_kn': estimate[:, 0],
        **actuators,
        **battery,
        'descending': np.where(np.isfinite(rising), rising < 0.0, np.nan),
        'infeasible': log[:, COLUMNS['infeasible']],
        **dict(zip(Adaptation._fields, log[:, COLUMNS['adaptation']].T, strict=True)),
    }


def _place(log: np.ndarray) -> dict[str, np.ndarray]:
    """How far the estimated place is off the true one, and how far it may be: by name, float64[n].

    The bound is the longer half axis of the 95 % ellipse of the estimate.
    """
    odom, truth = log[:, COLUMNS['odom']], log[:, COLUMNS['ground_truth/odom']]
    xx, xy, yy = odom[:, 13], odom[:, 14], odom[:, 16]
    largest = 0.5 * (xx + yy) + np.hypot(0.5 * (xx - yy), xy)
    return {
        'place_error_m': np.hypot(odom[:, 0] - truth[:, 0], odom[:, 1] - truth[:, 1]),
        'place_bound_m': np.sqrt(ELLIPSE_95 * largest),
    }


def _samples(log: np.ndarray, given: np.ndarray | None) -> np.ndarray:
    """What is sampled of log rows, float64[n, len(SAMPLES)]; ``given`` has the estimated place."""
    position, target = log[:, COLUMNS['odom']], log[:, COLUMNS['reference']]
    current = log[:, COLUMNS['current_velocity']] / KNOT_MPS
    estimated = np.full((len(log), 2), np.nan) if given is None else given[:, COLUMNS['odom']]
    return np.stack(
        (
            *(position[:, 1], position[:, 0], -position[:, 2]),
            *(target[:, 1], target[:, 0], -target[:, 2]),
            *(current[:, 1], current[:, 0]),
            *(estimated[:, 1], estimated[:, 0]),
        ),
        axis=1,
    )


@kernel
def _unwrap(heading, before):
    """Make headings (rad) go on from ``before``; in place."""
    for i in range(len(heading)):
        if math.isfinite(heading[i]):
            if math.isfinite(before):
                heading[i] = before + wrap_angle(heading[i] - before)
            before = heading[i]


@kernel
def _bring_near(reference, heading):
    """Make angles (rad) be near headings; in place."""
    for i in range(len(heading)):
        reference[i] = heading[i] + wrap_angle(reference[i] - heading[i])


@kernel
def _widen(first, second, value):
    """Extremes in the order in which they came, with one more: a new extreme is the last."""
    if math.isnan(first):
        return value, value
    if value > max(first, second):
        return min(first, second), value
    if value < min(first, second):
        return max(first, second), value
    return first, second


@kernel
def _fold(values, tick, size, points):
    """Take values of ticks from ``tick`` on into buckets of ``size`` ticks; count the not finite.

    ``points``, float32[2 b], are the extremes of every bucket, NaN where there is none yet.
    """
    missing, start = 0, 0
    while start < len(values):
        bucket = (tick + start) // size
        end = min(len(values), (bucket + 1) * size - tick)
        first, second = points[2 * bucket], points[2 * bucket + 1]
        for i in range(start, end):
            value = np.float32(values[i])
            if math.isfinite(value):
                first, second = _widen(first, second, value)
            else:
                missing += 1
        points[2 * bucket], points[2 * bucket + 1] = first, second
        start = end
    return missing


@kernel
def halve(points):
    """Join neighbouring buckets of float32[2 b]; the first half, float32[b], holds the result."""
    joined = 0
    for at in range(0, len(points), 4):
        first, second = points[at], points[at + 1]
        for i in range(at + 2, min(at + 4, len(points))):
            if math.isfinite(points[i]):
                first, second = _widen(first, second, points[i])
        points[joined], points[joined + 1] = first, second
        joined += 2
    points[joined:] = np.nan
    return points[:joined]
