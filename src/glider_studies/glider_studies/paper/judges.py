# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""What the flights are held to: limits, and other judgements."""

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from glider_model.vehicle.file import load_vehicle
from glider_studies.montecarlo import pooled

WAYPOINT_LIMIT_M = 10.0
#: In a leg, after its corner: spread of the heading, and how far it may be from the course (deg).
HEADING_SPREAD_LIMIT_DEG, OFF_COURSE_LIMIT_DEG = 45.0, 90.0
#: Mean distance of the heading from the best crab where no course can be held (deg).
CRAB_LIMIT_DEG = 2.0
#: Share inside of the 95 % ellipse over all hard seas; mean squared innovation.
INSIDE, INNOVATION = (0.93, 0.97), (1.5, 3.0)
#: Stays of so many hours are long. Largest error of the mean current after them (m/s), share
#: inside, median error over that after short stays (m).
LONG_H, STAY_DAC_MPS, STAY_INSIDE, STAY_MORE_M = 2, 0.1, 0.9, 100.0
#: Farther below what the hull is rated for nobody comes whom his buoyancy can bring up (m).
BELOW_RATED_M = 20.0
#: Who surfaces for good is shallower than this at the end (m).
SURFACED_M = 5.0
LEAST_CLEAN_H = 1000.0
#: A piece of the law has its place if the figure it was built for is so many times worse without.
EARNED = 1.1


class Check(NamedTuple):
    """One figure against its limit."""

    what: str
    value: float | str | None
    limit: float | str | None  #: or what is required
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


def _flown(rows: list[dict], controller: str = 'adaptive') -> list[dict]:
    """Rows of one controller, with our guidance."""
    flown = (controller, 'los_current')
    return [row for row in rows if (row['controller'], row['guidance']) == flown]


def judge_limits(
    limits: dict[str, float],
    controller: str = 'adaptive',
    limits_of: dict[str, dict[str, float]] | None = None,
) -> Callable[[list[dict]], list[Check]]:
    """Judgement that holds flights of a controller to the same limits, or to those by case."""

    def judge(rows: list[dict]) -> list[Check]:
        return [
            check
            for row in _flown(rows, controller)
            if limits_of is None or row['case'] in limits_of
            for check in within(row, limits if limits_of is None else limits_of[row['case']])
        ]

    return judge


def judge_survey(rows: list[dict]) -> list[Check]:
    """Every waypoint is passed closely, and no leg has a loop or a dithering heading in it."""
    checks = []
    for row in _flown(rows):
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


def _not_ended(rows: list[dict]) -> list[Check]:
    """Flights that did not come to their end: what they measured until then is no verdict."""
    return [check for row in rows for check in within(row, {}) if not check.passed]


def _later(row: dict) -> float | None:
    """Median error (m) at the surfacings that a stay came before, without the first of all."""
    later = row['navigation']['surfacing_error_m'][1:]
    return float(np.median(later)) if later else None


def judge_hard(rows: list[dict]) -> list[Check]:
    """Over all of them the ellipse is as large as it has to be."""
    known = pooled([row['navigation'] for row in rows])
    checks = [
        Check(
            f'{what} of {known["surfacings"]} surfacings',
            known[name],
            f'{low} to {high}',
            known[name] is not None and low <= known[name] <= high,
        )
        for what, name, (low, high) in (
            ('inside 95 %', 'ellipse_95_share', INSIDE),
            ('innovation squared', 'innovation_squared', INNOVATION),
        )
    ]
    return [*checks, *_not_ended(rows)]


def judge_stays(rows: list[dict]) -> list[Check]:
    """Hours at the surface do not make the next surfacings worse than minutes do."""
    long = [row for row in rows if row['hours'] >= LONG_H]
    known = pooled([row['navigation'] for row in long])
    what, inside = f'inside 95 % of {known["surfacings"]} surfacings', known['ellipse_95_share']
    checks = [Check(what, inside, STAY_INSIDE, (inside or 0.0) >= STAY_INSIDE)]
    short = {row['dive_m']: _later(row) for row in rows if row['hours'] < LONG_H}
    for row in long:
        dac, error = row['navigation']['dac_error_mps']['worst'], _later(row)
        beside = short[row['dive_m']]
        most = None if beside is None else beside + STAY_MORE_M
        checks.append(_at_most(f'{row["case"]}: DAC error (m/s)', dac, STAY_DAC_MPS))
        passed = error is not None and most is not None and error <= most
        checks.append(Check(f'{row["case"]}: error (m)', error, most, passed))
    return [*checks, *_not_ended(rows)]


def judge_clean(rows: list[dict]) -> list[Check]:
    """Whether the guard had nothing to say, in hours enough, and each flight came to its end."""
    hours = sum(row['hours'] for row in rows if row['status'] == 'completed')
    events = [
        Check(f'{row["case"]}, {row["controller"]}', event['row'], 'nothing reported', False)
        for row in rows
        for event in row['guard']['events']
    ]
    enough = Check(
        'hours flown', f'{hours:,.0f} h', f'{LEAST_CLEAN_H:,.0f} h', hours >= LEAST_CLEAN_H
    )
    reported = Check('reported by the guard', str(len(events)), '0', not events)
    return [enough, reported, *events, *_not_ended(rows)]


def _faults_of(row: dict, deepest_m: float) -> str:
    """What of a flight is not as it has to be, in words; empty if all is."""
    reaction = row['guard']['reaction']
    if not row['finite']:
        return 'a number is not finite'
    if reaction not in row['reactions']:
        return f'reaction {reaction}'
    if row['faults'][0]['t_s'] is None:
        return 'it did not begin'
    _, east_m, depth_m = row['final_state']['position_ned_m']
    if reaction in ('surface', 'drop') and depth_m > SURFACED_M:
        return f'{depth_m:.0f} m deep at the end'
    if row['depth_m']['max'] > deepest_m:
        return f'{row["depth_m"]["max"]:.0f} m deep'
    if row['beside_m'] is not None and abs(east_m) > row['beside_m']:
        return f'{abs(east_m):.0f} m cross-track at the end'
    return ''


def judge_faults(rows: list[dict]) -> list[Check]:
    """Whether each flight ended as its fault has to end."""
    deepest_m = load_vehicle('zhang2021').rated_depth_m + BELOW_RATED_M
    checks = []
    for row in rows:
        wrong = _faults_of(row, deepest_m)
        what = f'{row["case"]}, {row["controller"]}'
        checks.append(
            Check(what, wrong or 'as it has to', ' or '.join(row['reactions']), not wrong)
        )
    return checks


def judge_ablation(rows: list[dict]) -> list[Check]:
    """Without a piece what it was built for is worse by a tenth, or the path is lost."""
    by_case, checks = {row['case']: row for row in rows}, []
    for case, row in by_case.items():
        where, name = row.get('built_for', ('', ''))
        if where and case.startswith(f'{where}, '):
            whole, without = figure_of(by_case[f'{where}, whole'], name), figure_of(row, name)
            least = None if whole is None else EARNED * whole
            lost = row['status'] != 'completed' or without is None
            earned = least is not None and (lost or without >= least)
            checks.append(Check(f'{case}: {name}', without, least, earned))
    return checks


#: Judgements of experiments, where they are not by limits alone.
JUDGES = {
    'survey': judge_survey,
    'ablation': judge_ablation,
    'envelope': judge_envelope,
    'long_stays': judge_stays,
    'hard_seas': judge_hard,
    'fault_matrix': judge_faults,
    'false_reactions': judge_clean,
}
