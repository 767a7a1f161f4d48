# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""What the flights are held to: limits of the adaptive law, and judgements by them."""

from collections.abc import Callable
from typing import Any, NamedTuple

#: Straight path in a current, adaptive law: largest figures allowed (m, deg).
STRAIGHT_LIMITS = {
    'cross_track_m.max_steady': 1.0,
    'cross_track_m.rms_steady': 0.3,
    'pitch_error_deg.rms_steady': 0.4,
    'pitch_error_deg.max_steady': 2.0,
    'heading_fluctuation_deg.rms_steady': 0.3,
}
#: Largest cross-track error with turns, by the angle of the current (m).
ALL_LIMITS_M = {8: 5.0, 10: 6.0, 12: 7.0}
#: The tuned PID is the opponent: if it gets worse than this, it is a straw man.
OPPONENT_LIMITS = {
    'cross_track_m.max_steady': 3.0,
    'cross_track_m.max_all': 10.0,
    'heading_fluctuation_deg.rms_steady': 1.0,
}
PROFILE_LIMITS = {
    'pitch_error_deg.rms_steady': 0.4,
    'pitch_error_deg.max_steady': 2.0,
    'depth_m.overshoot': 20.0,
}
ROBUST_LIMITS = {'cross_track_m.max_steady': 3.0}
PATH_LIMITS = {'path_error_m.e2_rms': 0.5, 'path_error_m.e3_rms': 1.7}
WAYPOINT_LIMIT_M = 10.0
#: From the fourth surfacing on, where a vehicle came up and how it went under water (m), with
#: errors of the sensors and without.
RECKONED_LIMITS = {
    'navigation.from_fourth.surfacing_cross_track_m': 50.0,
    'navigation.from_fourth.under_water_rms_m': 30.0,
}
FAULTLESS_LIMITS = {'navigation.from_fourth.surfacing_cross_track_m': 20.0}
#: Attitude that is sampled now and then (m).
SPARSE_LIMIT_M = 3.0
#: The same law on every vehicle, in 0.5 kn at 20 deg.
VEHICLE_LIMIT_M = 3.0
#: In a leg, after its corner: spread of the heading, and how far it may be from the course (deg).
HEADING_SPREAD_LIMIT_DEG, OFF_COURSE_LIMIT_DEG = 45.0, 90.0
#: Envelope: cross current over U_h up to which a course must be held; error allowed with turns.
HELD_SHARE, TURN_S, TURN_MARGIN_M = 0.95, 111.0, 1.0
#: Mean distance of the heading from the best crab where no course can be held (deg).
CRAB_LIMIT_DEG = 2.0


class Check(NamedTuple):
    """One figure against its limit."""

    what: str
    value: float | str | None
    limit: float | str  #: or what is required
    passed: bool


def figure_of(row: dict, name: str) -> Any:
    """Figure of a row by its dotted name."""
    for part in name.split('.'):
        row = row[part]
    return row


def _at_most(what: str, value: float | None, limit: float) -> Check:
    """A figure that is missing or not finite has not been reached."""
    return Check(what, value, limit, value is not None and value <= limit)


def within(row: dict, limits: dict[str, float]) -> list[Check]:
    """Whether a flight was completed, and its figures are within limits."""
    who = ', '.join(text for text in (row['case'], row['controller']) if text)
    checks = [Check(f'{who}: status', row['status'], 'completed', row['status'] == 'completed')]
    return checks + [
        _at_most(f'{who}: {name}', figure_of(row, name), limit) for name, limit in limits.items()
    ]


def _flown(rows: list[dict], controller: str, guidance: str = 'observer') -> list[dict]:
    """Rows of one controller and guidance."""
    return [row for row in rows if row['controller'] == controller and row['guidance'] == guidance]


def judge_limits(
    limits: dict[str, float], controller: str = 'adaptive'
) -> Callable[[list[dict]], list[Check]]:
    """Judgement that holds every flight of a controller to the same limits."""

    def judge(rows: list[dict]) -> list[Check]:
        return [check for row in _flown(rows, controller) for check in within(row, limits)]

    return judge


def judge_reckoned(rows: list[dict]) -> list[Check]:
    """The default way to reckon keeps near its path once the current has been met."""
    limits = {'reckoned': RECKONED_LIMITS, 'reckoned, no errors': FAULTLESS_LIMITS}
    return [
        check
        for row in _flown(rows, 'adaptive')
        if row['case'] in limits
        for check in within(row, limits[row['case']])
    ]


def judge_survey(rows: list[dict]) -> list[Check]:
    """Every waypoint is passed closely, and no leg has a loop or a dithering heading in it."""
    checks = []
    for row in _flown(rows, 'adaptive'):
        checks += within(row, {})
        for i, distance in enumerate(row['waypoints_closest_m']):
            checks.append(_at_most(f'adaptive: waypoint {i} (m)', distance, WAYPOINT_LIMIT_M))
        flown, planned = len(row['legs']), len(row['waypoints_closest_m']) - 1
        checks.append(Check('adaptive: legs flown', flown, planned, flown == planned))
        for leg in row['legs']:
            what = f'adaptive: leg on course {leg["course_deg"]:.0f} deg'
            spread, off = leg['heading_spread_deg'], leg['heading_off_course_deg']
            checks.append(_at_most(f'{what}: spread of heading', spread, HEADING_SPREAD_LIMIT_DEG))
            checks.append(_at_most(f'{what}: heading off it', abs(off), OFF_COURSE_LIMIT_DEG))
    return checks


def judge_envelope(rows: list[dict]) -> list[Check]:
    """Held wherever physics allows it with a margin, flagged where it does not, always finite."""
    checks = []
    for row in rows:
        what = f'{row["case"]}, {row["controller"]}'
        checks.append(Check(f'{what}: finite', str(row['finite']), 'True', row['finite']))
        if row['expected'] == 'feasible':
            checks += within(row, {'cross_track_m.max_all': row['limit_m']})
        elif row['expected'] == 'infeasible':
            status = row['status']
            checks.append(Check(f'{what}: status', status, 'infeasible', status == 'infeasible'))
            checks.append(_at_most(f'{what}: crab', row['crab_error_deg'], CRAB_LIMIT_DEG))
    return checks
