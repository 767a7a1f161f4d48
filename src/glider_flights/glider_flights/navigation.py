# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""Our navigation over a recorded flight, beside what was made of it on board or ashore.

It is the kernel of its node, fed as by a driver: a sample, or a fix, is there from the tick after
it was recorded, and until the next one. Where a base station wrote the buoyancy it is that of the
buoyancy engine; lift and drag are those of the flight. The way through the water is that of a
second run, which assumes no current.
"""

import itertools
import math
from collections.abc import Iterator, Sequence
from typing import Any, NamedTuple

import numpy as np

from glider_base.errors import ConfigurationError
from glider_base.frames import imu_to_wire, quaternion_from_euler, to_geodetic
from glider_base.kernel import kernel
from glider_base.kernels.packing import put
from glider_base.signals import TICK_NS, TICK_S, Imu
from glider_base.wiring import WHEN_SILENT
from glider_flights.folders import Progress
from glider_flights.record import NOT_KNOWN, Fixes, Flight, Samples, Segment, runs
from glider_mission.recording.recorded_inputs import RecordedBlock
from glider_model.ocean.density import pressure_at
from glider_model.vehicle.file import changed_vehicle
from glider_navigation.block import NAVIGATION
from glider_navigation.phase import UNDER_WATER
from glider_navigation.settings import METHODS, NavigationSettings

#: Vehicle file whose lift and drag are changed to those of a flight.
VEHICLE = 'seaglider'
#: What recorded flights tell of the topics that navigation may read.
RECORDED = ('imu', 'pressure', 'fix')
#: Of the water in which the constants of a flight hold (kg/m^3).
DENSITY = 1027.5
#: Standard deviation of a fix, north and east (m).
FIX_STD_M = 5.0
#: No engine has more oil than this (cc): all of what is recorded counts.
MOST_OIL_CC = 2000.0
#: Buoyancy tells the speed of a dive if it is known for this share of the samples.
BUOYANCY_KNOWN = 0.5
#: The stay before the first dive counts for no longer than this (s).
FIRST_STAY_S = 6.0 * 3600.0
#: The current of the last dive is recorded when the next one begins: it is made up, so long
#: (s) and so deep (m).
MADE_UP_S, MADE_UP_M = 5.0, 10.0
#: So many ticks are worked through at once.
TICKS = 36_000
#: Fixes over a shorter time say nothing of the drift at the surface (s).
SHORTEST_DRIFT_S = 60.0


class Row(NamedTuple):
    """What navigation makes of a segment; places and ways of shape (2,): north, east."""

    segment: Segment
    #: When it dived and when it came up (s since 1970), and where, by the fixes of its stays (m).
    dived_s: float
    surfaced_s: float
    dived_m: np.ndarray
    surfaced_m: np.ndarray
    way_m: np.ndarray  #: way through the water between the two (m)
    reported_mps: np.ndarray  #: current that it reported afterwards (m/s)
    #: Distance from where it surfaced to where it was forecast (m), by name; NaN for the first.
    missed_m: dict[str, float]
    over: str  #: what the vehicle's own current is a mean over, see `Flight`

    @property
    def seconds(self) -> float:
        """Time under water (s)."""
        return self.surfaced_s - self.dived_s

    @property
    def dac_mps(self) -> np.ndarray:
        """Depth-averaged current, of shape (2,): north, east (m/s)."""
        return (self.surfaced_m - self.dived_m - self.way_m) / self.seconds

    @property
    def comparable_mps(self) -> np.ndarray:
        """Our current over what the vehicle's own is a mean, of shape (2,): north, east (m/s)."""
        if self.over != 'between fixes':
            return self.dac_mps
        before, after = self.segment.before, self.segment.after
        moved_m = after.place_m[0] - before.place_m[-1]
        return (moved_m - self.way_m) / (after.time_s[0] - before.time_s[-1])


def check(method: str) -> None:
    """Refuse a method that recorded flights cannot feed; raises ConfigurationError."""
    if method not in METHODS:
        raise ConfigurationError(f'--method {method} (allowed: {", ".join(METHODS)})')
    lacking = [name for name in METHODS[method]().reads if name not in RECORDED]
    if lacking:
        raise ConfigurationError(
            f'--method {method}: reads {", ".join(lacking)}, which no flight has recorded '
            f'(allowed: what reads some of {", ".join(RECORDED)})'
        )


class _Under(NamedTuple):
    """What came out of the ticks from a dive until the next one."""

    dived_s: float
    surfaced_s: float
    way_m: np.ndarray
    reported_mps: np.ndarray  #: at the end: the current of the segment before


def _at_surface(stay: Fixes, nearest: int, time_s: float) -> tuple[float, np.ndarray]:
    """A time (s since 1970) and where it was then (m), by the slope through the fixes of a stay.

    If they say nothing of the drift, the time and the place of the nearest fix.
    """
    fix_s, fix_m = stay.time_s[nearest], stay.place_m[nearest]
    if len(stay.time_s) < 2 or np.ptp(stay.time_s) < SHORTEST_DRIFT_S:
        return fix_s, fix_m
    drift_mps = np.polyfit(stay.time_s - stay.time_s[0], stay.place_m, 1)[0]
    return time_s, fix_m + drift_mps * (time_s - fix_s)


def _navigated(
    flight: Flight, run: Sequence[Segment], method: str, current: str, progress
) -> Iterator[_Under]:
    """What came out of each segment of a run, and of the dive that is made up after it."""
    fixes = _fixes_of(run)
    begin_s, end_s = fixes.time_s[0] - 1.0, fixes.time_s[-1] + 1.0
    made_up = Samples(*np.array([end_s, MADE_UP_M, -0.4, 0.0, math.nan])[:, None])
    parts_of_run = [*(segment.samples for segment in run), made_up]
    samples = Samples(*(np.concatenate(values) for values in zip(*parts_of_run, strict=True)))
    start = _settings(flight, run[0], method, current, fixes.place_m[0])
    block, driver = RecordedBlock(NAVIGATION, start), _Driver(samples, fixes, start)
    edges = [begin_s, *(one.before.time_s[-1] for one in run[1:]), end_s, end_s + MADE_UP_S]
    for number, (since_s, until_s) in enumerate(itertools.pairwise(edges)):
        segment = run[min(number, len(run) - 1)]
        block.tune(_settings(flight, segment, method, current, fixes.place_m[0]))
        ticks = [round((edge - begin_s) / TICK_S) for edge in (since_s, until_s)]
        parts = [
            _published(block, driver, np.arange(first, min(first + TICKS, ticks[1])), begin_s)
            for first in range(ticks[0], ticks[1], TICKS)
        ]
        dive_s = -math.inf if number == len(run) else segment.after.time_s[0] + 1.0
        if number < len(run):
            progress()
        yield _under(*(np.concatenate(part) for part in zip(*parts, strict=True)), dive_s)


def _published(block: RecordedBlock, driver: '_Driver', ticks: np.ndarray, begin_s: float):
    """Times, places, reported currents and phases of some ticks."""
    time_s = begin_s + TICK_S * ticks
    outputs, flags = block.run(ticks * TICK_NS, driver.inputs(time_s))
    current = outputs.get('believed_current', np.full((len(ticks), 2), math.nan))
    return time_s, outputs['odom'][:, 1::-1], current[:, 1::-1], flags[:, 0]


def _under(time_s, place_m, reported_mps, phase, until_s: float) -> _Under:
    """What came out of some ticks, of which those under water count until a time."""
    under = np.flatnonzero((phase == UNDER_WATER) & (time_s <= until_s))
    if not len(under):
        return _Under(math.nan, math.nan, NOT_KNOWN, reported_mps[-1])
    steps = np.diff(place_m, axis=0, prepend=place_m[:1])[under]
    return _Under(time_s[under[0]], time_s[under[-1]], steps.sum(axis=0), reported_mps[-1])


def _fixes_of(run: Sequence[Segment]) -> Fixes:
    """Fixes of a run, each once."""
    stays = [run[0].before, *(segment.after for segment in run)]
    time_s, place_m = (np.concatenate(values) for values in zip(*stays, strict=True))
    counts = time_s >= run[0].before.time_s[-1] - FIRST_STAY_S
    return Fixes(time_s[counts], place_m[counts])


def _settings(
    flight: Flight, segment: Segment, method: str, current: str, launched_m: np.ndarray
) -> NavigationSettings:
    """Navigation of a vehicle with the lift and drag of a segment."""
    latitude, longitude = flight.origin_deg.tolist()
    settings = {
        'method': method,
        'current': current,
        'vehicle': _vehicle(segment),
        'origin': {'latitude_deg': latitude, 'longitude_deg': longitude},
        'north_m': float(launched_m[0]),
        'east_m': float(launched_m[1]),
        'imu_period_s': 30.0,
        'gyro': False,
    }
    is_weighed = np.isfinite(segment.samples.buoyancy_kg).mean() > BUOYANCY_KNOWN
    if 'speed_by' in METHODS[method].model_fields and is_weighed:
        settings[method] = {'speed_by': 'buoyancy'}
    return NavigationSettings(**settings)


def _vehicle(segment: Segment) -> str:
    """Name of a vehicle with the lift and drag of a segment."""
    polar = segment.polar
    pressure = 0.5 * DENSITY  # at 1 m/s
    per_v2 = pressure * polar.area_m2
    coefficients = {
        'eriksen': None,
        'merckelbach': None,
        'K_D0': polar.drag * per_v2 * pressure**polar.exponent,
        'K_D': polar.induced * per_v2,
        'K_L0': 0.0,
        'K_L': polar.lift * per_v2,
        'speed_exponent': 2.0 * polar.exponent,
    }
    changes = {f'hydrodynamics.{name}': value for name, value in coefficients.items()}
    changes |= {
        'buoyancy_engine.range': MOST_OIL_CC,
        'pump_x': 0.0,  # nothing is recorded of the masses that oppose it
        'shallowest_glide': math.degrees(polar.shallowest_rad),
    }
    return changed_vehicle(VEHICLE, changes)


class _Driver:
    """What drivers of the sensors would deliver of a recorded flight, as on the wire."""

    def __init__(self, samples: Samples, fixes: Fixes, start: NavigationSettings) -> None:
        self.time_s, self.fix_s = samples.time_s, fixes.time_s
        self.pressure = pressure_at(samples.depth_m)
        self.imu = _imu_rows(samples.pitch_rad, samples.heading_rad)
        # Where none is recorded, in an inflection, none tells the speed.
        self.joints = np.outer(-np.nan_to_num(samples.buoyancy_kg), [1.0, 0.0, 0.0, 0.0])
        origin, variance = start.origin.params(), FIX_STD_M**2
        self.fix = np.array(
            [(0.0, *to_geodetic(*place, origin), variance, variance) for place in fixes.place_m]
        )

    def inputs(self, time_s: np.ndarray) -> dict[str, np.ndarray]:
        """Numbers of the topics at the ticks of these times (s since 1970)."""
        last = np.searchsorted(self.time_s, time_s, 'right') - 1
        begun = last >= 0  # before, it lies still at the surface
        fix = np.tile(WHEN_SILENT['fix'], (len(time_s), 1))
        received = np.searchsorted(time_s, self.fix_s)
        inside = (received < len(time_s)) & (self.fix_s > time_s[0] - TICK_S)
        fix[received[inside]] = self.fix[inside]
        return {
            'joint_states': np.where(begun[:, None], self.joints[last], 0.0),
            'imu': self.imu[np.maximum(last, 0)],
            'pressure': np.where(begun, self.pressure[last], pressure_at(0.0))[:, None],
            'fix': fix,
        }


@kernel
def _imu_rows(pitch_rad, heading_rad):
    """Attitudes as on the wire, float64[n, 8]: without roll, which does not matter, or rates."""
    rows = np.empty((len(pitch_rad), 8))
    for i in range(len(pitch_rad)):
        q_w, q_x, q_y, q_z = quaternion_from_euler(0.0, pitch_rad[i], heading_rad[i])
        put(rows, i, 0, (imu_to_wire(Imu(q_w, q_x, q_y, q_z, 0.0, 0.0, 0.0, False)),))
    return rows


# ---------------------------------------------------------------------------------- beside it

#: Method of navigation, if nothing else is said.
METHOD = 'dead_reckoned'
#: A current that is further off than this has its reason printed (m/s).
FAR_OFF_MPS = 0.02
#: Names of the forecasts.
FORECASTS = ('none', 'persistence', 'ours')


def navigate(flight: Flight, progress: Progress, method: str = METHOD) -> list[Row]:
    """Navigate all segments, in the order of time, each by what was known before it.

    Raises ConfigurationError if there is no such method, or it reads what was not recorded.
    """
    check(method)
    rows: list[Row] = []
    done = itertools.count(1)

    def one_more() -> None:
        progress(next(done), 2 * len(flight.segments))

    # Between others there is a dive that is not known.
    for run in runs(
        flight.segments, lambda last, one: one.before.time_s[-1] == last.after.time_s[-1]
    ):
        still, led = (
            list(_navigated(flight, run, method, current, one_more))
            for current in ('none', 'persistence')
        )
        last_mps = None
        for segment, under, one, after in zip(run, still, led, led[1:], strict=False):
            reckoned = one.way_m, after.reported_mps, last_mps
            rows.append(_row(segment, under, *reckoned, flight.on_board_over))
            last_mps = after.reported_mps
    return rows


def _row(segment: Segment, under: _Under, led_m, reported_mps, last_mps, over: str) -> Row:
    """What came out; forecasts know the current of the dive before, if there is one."""
    dived_s, dived_m = _at_surface(segment.before, -1, under.dived_s)
    surfaced_s, surfaced_m = _at_surface(segment.after, 0, under.surfaced_s)
    dive, missed = (dived_s, surfaced_s, dived_m, surfaced_m), dict.fromkeys(FORECASTS, math.nan)
    row = Row(segment, *dive, under.way_m, reported_mps, missed, over)
    if last_mps is not None:
        for name, current in (('none', np.zeros(2)), ('persistence', last_mps)):
            missed[name] = float(np.hypot(*(row.dac_mps - current))) * row.seconds
        missed['ours'] = float(np.hypot(*(surfaced_m - (dived_m + led_m))))
    missed['on_board'] = float(np.hypot(*(surfaced_m - segment.on_board.surfaced_m)))
    return row


def summary(flight: Flight, rows: list[Row], method: str = METHOD) -> dict[str, Any]:
    """Figures of a flight, as `--json` prints them."""
    dac = [np.hypot(*(row.comparable_mps - row.segment.on_board.dac_mps)) for row in rows]
    differences = [np.hypot(*(row.reported_mps - row.dac_mps)) for row in rows]
    way = [_way_off(row) for row in rows]
    through_water = [np.hypot(*row.way_m) for row in rows]
    ratio = [
        own / np.hypot(*row.segment.on_board.way_m)
        for own, row in zip(through_water, rows, strict=True)
    ]
    names = list(FORECASTS)
    if any(math.isfinite(row.missed_m['on_board']) for row in rows):
        names.append('on_board')
    return {
        'vehicle': flight.kind,
        'method': method,
        'files': len(flight.files),
        'first_file': flight.files[0],
        'last_file': flight.files[-1],
        'segments': len(rows),
        'duration_s': round(rows[-1].surfaced_s - rows[0].dived_s, 1),
        'under_water_s': round(sum(row.seconds for row in rows), 1),
        'through_water_m': round(float(np.nansum(through_water)), 1),
        'on_board_current_is_mean': flight.on_board_over,
        'dac_difference_mps': _spread(dac, 4),
        'told_difference_mps': _spread(differences, 4),
        'way_difference_m': _spread(way, 1),
        'way_ratio': _spread(ratio, 4),
        'prediction_m': {name: _spread([row.missed_m[name] for row in rows], 1) for name in names},
        'notes': flight.notes + _why_far_off(rows, dac),
    }


def _why_far_off(rows: list[Row], dac: list[float]) -> list[str]:
    """Why the current is far off, if it is: what fixes and samples of such dives can tell."""
    off = _spread(dac, 4)['median']
    if off is None or off <= FAR_OFF_MPS:
        return []
    seconds = float(np.median([row.seconds for row in rows]))
    apart_s = float(np.median([np.median(np.diff(row.segment.samples.time_s)) for row in rows]))
    way_m = _spread([_way_off(row) for row in rows], 1)['median']
    by_way = (
        ''
        if way_m is None
        else (f', ways {way_m:.0f} m off those on board are {100.0 * way_m / seconds:.1f} cm/s')
    )
    return [
        f'current {100.0 * off:.1f} cm/s off that on board: in dives of {seconds / 60.0:.0f} min '
        f'{FIX_STD_M:g} m of each of two fixes are {140.0 * FIX_STD_M / seconds:.1f} cm/s'
        f'{by_way}, and samples {apart_s:.0f} s apart leave open when it left the surface and '
        'when it came back'
    ]


def _way_off(row: Row) -> float:
    """How far our way through the water is off that on board (m)."""
    return float(np.hypot(*(row.way_m - row.segment.on_board.way_m)))


def _spread(values: list[float], digits: int) -> dict[str, Any]:
    """Median and 90th percentile of what is known, and how many that are."""
    known = [value for value in values if math.isfinite(value)]
    if not known:
        return {'median': None, 'p90': None, 'segments': 0}
    return {
        'median': round(float(np.median(known)), digits),
        'p90': round(float(np.percentile(known, 90)), digits),
        'segments': len(known),
    }
