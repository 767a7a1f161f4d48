# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""The paper's experiments and what goes beyond them: flown, told beside the paper, and judged.

Each experiment is a list of flights and a judgement of their scores, so that a change that makes
anything worse turns a verdict to ``failed``. The tuned PID and the paper's line of sight are flown
beside the adaptive law, and are told as they are; limits apply to the adaptive law.
"""

import json
import math
import shlex
from collections.abc import Callable, Iterator
from typing import Any, NamedTuple

import numpy as np

from glider_bringup.engines.flight import fly as fly_mission
from glider_bringup.engines.flight import mission_of
from glider_bringup.mission.scenario import Scenario, load_scenario
from glider_bringup.scoring.card import finite
from glider_bringup.scoring.one_hertz import Record, Recorder
from glider_bringup.scoring.score import make_scorer, scores_of, windows
from glider_bringup.studies.montecarlo import airframe
from glider_bringup.studies.workers import Pool, Progress
from glider_guidance.los import crab_heading
from glider_model.ocean.current_settings import KNOT_MPS
from glider_model.onboard.glide_polar import make_polar, steady_horizontal_speed
from glider_model.vehicle.file import load_vehicle
from glider_model.vehicle.perturb import perturbed

RESULT_FILE = 'experiments.json'
PASSED, FAILED = 'passed', 'failed'

#: Time between two samples of a `Record` (s).
_SAMPLE_S = 1.0
#: Points of a record that is handed on.
RECORD_POINTS = 12000
#: A leg of a survey is looked at this long after its corner (s).
CORNER_S = 600.0

# ---------------------------------------------------------------------------------- limits

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


# ---------------------------------------------------------------------------------- measures


def _rms(values: np.ndarray) -> float | None:
    return float(np.sqrt(np.mean(values * values))) if len(values) else None


def _largest(values: np.ndarray) -> float | None:
    return float(np.max(np.abs(values))) if len(values) else None


def _mean(values: np.ndarray) -> float | None:
    return float(np.mean(values)) if len(values) else None


def _windows(record: Record, scenario: Scenario) -> tuple[np.ndarray, np.ndarray]:
    """Masks of the steady and of all scored samples."""
    rules = scenario.score_rules(len(record.time_s) * _SAMPLE_S)
    return windows(record.depth, record.descending, rules, _SAMPLE_S)


def _wrap_deg(angle: np.ndarray) -> np.ndarray:
    return (angle + 180.0) % 360.0 - 180.0


def measure_attitude(record: Record, scenario: Scenario) -> dict[str, Any]:
    """Roll, heading error, and mean pitch and pitch mass in dive and climb, steady."""
    steady, _ = _windows(record, scenario)
    error = _wrap_deg(record.heading - record.heading_ref)[steady]
    down, up = steady & record.descending, steady & ~record.descending
    pitch_mass = 1e3 * record.joints[:, 1]
    return {
        'heading_error_deg': {'rms_steady': _rms(error), 'max_steady': _largest(error)},
        'roll_deg': {
            'rms_steady': _rms(record.roll[steady]),
            'max_steady': _largest(record.roll[steady]),
        },
        'trim': {
            'pitch_dive_deg': _mean(record.pitch[down]),
            'pitch_climb_deg': _mean(record.pitch[up]),
            'pitch_mass_dive_mm': _mean(pitch_mass[down]),
            'pitch_mass_climb_mm': _mean(pitch_mass[up]),
        },
    }


def measure_path(record: Record, scenario: Scenario) -> dict[str, Any]:
    """Errors across the path (e2) and normal to it (e3), after the settling time."""
    _, scored = _windows(record, scenario)
    across, below = record.cross_track[scored], record.vertical_error[scored]
    return {
        'path_error_m': {
            'e2_rms': _rms(across),
            'e3_rms': _rms(below),
            'e2_max': _largest(across),
            'e3_max': _largest(below),
        }
    }


def measure_survey(record: Record, scenario: Scenario) -> dict[str, Any]:
    """How close every waypoint was passed, and how calm the heading was in every leg."""
    closest = [
        float(np.min(np.hypot(record.north - waypoint[0], record.east - waypoint[1])))
        for waypoint in scenario.path.waypoints
    ]
    return {'waypoints_closest_m': closest, 'legs': list(_legs(record))}


def _legs(record: Record) -> Iterator[dict[str, float]]:
    """What the heading did in every leg, from `CORNER_S` after its corner on.

    Heading and course are both counted on through +-180 deg, so that a loop shows as 360 deg
    between them.
    """
    steps = np.diff(record.target_north), np.diff(record.target_east)
    moves = np.flatnonzero(np.hypot(*steps) > 0.0)
    if not len(moves):
        return
    course = np.degrees(np.unwrap(np.arctan2(steps[1][moves], steps[0][moves])))
    # as the vehicle starts near the first leg, both are counted from there
    heading = record.heading - 360.0 * round((record.heading[0] - course[0]) / 360.0)
    corners = moves[1:][np.abs(np.diff(course)) > 1.0]
    ends = [0, *corners, len(record.time_s)]
    for begin, end in zip(ends[:-1], ends[1:], strict=True):
        begin += round(CORNER_S / _SAMPLE_S)
        if end <= begin:
            continue
        middle = 0.5 * (begin + end)
        on = float(course[min(np.searchsorted(moves, middle), len(course) - 1)])
        leg = heading[begin:end]
        yield {
            'course_deg': on,
            'heading_spread_deg': float(np.ptp(leg)),
            'heading_off_course_deg': float(np.mean(leg)) - on,
        }


def measure_crab(record: Record, scenario: Scenario) -> dict[str, Any]:
    """Mean distance of the heading from the best crab angle against the current, steady."""
    steady, _ = _windows(record, scenario)
    speed, north, east = horizontal_speed(scenario), *scenario.constant_current()
    best, _, _ = crab_heading(scenario.path.course_rad(), speed, north, east)
    error = _wrap_deg(record.heading[steady] - math.degrees(best))
    return {'crab_error_deg': _mean(np.abs(error))}


# ---------------------------------------------------------------------------------- flights


class Case(NamedTuple):
    """One flight."""

    case: str  #: what sets it apart from the others of its experiment
    controller: str
    guidance: str
    scenario: str
    changes: dict[str, Any] = {}
    measures: tuple[Callable[[Record, Scenario], dict], ...] = (measure_attitude,)
    told: str = ''  #: vehicle whose steering the PID is told, instead of that of the one it flies
    facts: dict[str, Any] = {}  #: goes into the row as it is
    drawn: bool = False  #: a record of it is kept for figures

    def load(self) -> Scenario:
        """Scenario that is flown."""
        fields = {
            **self.changes,
            'dives': 0,
            'control.law': self.controller,
            'guidance.los.method': self.guidance,
        }
        return load_scenario(self.scenario, fields)

    def command(self) -> str | None:
        """Shell command that flies it again; None if a scenario cannot say it."""
        if self.told:
            return None
        sets = ' '.join(
            f'--set {shlex.quote(f"{field}={json.dumps(value)}")}'
            for field, value in self.changes.items()
        )
        words = (
            f'./glider run {self.scenario} --engine direct --duration full',
            f'--controller {self.controller} --guidance {self.guidance}',
            sets,
        )
        return ' '.join(words).rstrip()

    def key(self) -> str:
        """The same for flights that are one and the same."""
        measures = [measure.__name__ for measure in self.measures]
        return json.dumps([*self[1:5], measures, self.told])


class Experiment(NamedTuple):
    """Flights, and what is asked of them."""

    group: str
    name: str
    section: str  #: of the paper; empty: goes beyond it
    title: str
    paper: str  #: the paper's figure
    cases: list[Case]
    judge: Callable[[list[dict]], list[Check]]


def _fly_case(case: Case) -> tuple[dict[str, Any], Record | None]:
    """Fly one case in a worker: its row, and if it is drawn a record thin enough to hand on."""
    scenario = case.load()
    state, params = mission_of(scenario)
    if case.told:
        steering = load_vehicle(case.told).steering
        pid = params.control.pid._replace(
            steering_dive=steering.dive.value, steering_climb=steering.climb.value
        )
        params = params._replace(control=params.control._replace(pid=pid))
    scorer, recorder = make_scorer(scenario), Recorder()
    flight = fly_mission(scenario, [scorer, recorder], mission=(state, params))
    record, scores = recorder.result(), scores_of(scenario, scorer)
    for measure in case.measures:
        scores.update(measure(record, scenario))
    row = _row(scores, flight.status == 'failed')
    return row, record.thinned(RECORD_POINTS) if case.drawn else None


def _row(scores: dict[str, Any], failed: bool = False) -> dict[str, Any]:
    """Scores with status; a number that is not finite becomes None, and is told."""
    scores = dict(scores)
    status = 'infeasible' if scores.pop('infeasible') else 'completed'
    clean = finite(scores)
    whole = not failed and bool(scores['final_state']) and clean == scores
    return {'status': 'failed' if failed else status, 'finite': whole, **clean}


def fly(
    experiments: list[Experiment], pool: Pool, progress: Progress
) -> tuple[list[list[dict]], list[list[Record | None]]]:
    """Fly every case, in worker processes; what two experiments share is flown once.

    Returns
    -------
    rows : list of list of dict
        By experiment and case.
    records : list of list of Record
        Likewise; None for what is not drawn.
    """
    cases: dict[str, Case] = {}
    for case in (case for one in experiments for case in one.cases):
        if case.drawn or case.key() not in cases:
            cases[case.key()] = case
    flown = pool.results(_fly_case, cases, progress)
    rows = [
        [
            {
                'case': case.case,
                'controller': case.controller,
                'guidance': case.guidance,
                **case.facts,
                **flown[case.key()][0],
                'command': case.command(),
            }
            for case in one.cases
        ]
        for one in experiments
    ]
    return rows, [[flown[case.key()][1] for case in one.cases] for one in experiments]


def count_flights(experiments: list[Experiment]) -> int:
    """Number of flights that `fly` makes."""
    return len({case.key() for one in experiments for case in one.cases})


# ---------------------------------------------------------------------------------- results

#: Figures in which the two controllers are compared, and how a table names them.
COMPARED = {
    'cross_track_m.max_steady': 'max\nsteady (m)',
    'cross_track_m.rms_steady': 'rms\nsteady (m)',
    'cross_track_m.max_all': 'max\nall (m)',
    'cross_track_m.max_run': 'max\nrun (m)',
    'heading_fluctuation_deg.rms_steady': 'heading\nrms (deg)',
    'pitch_error_deg.rms_steady': 'pitch\nrms (deg)',
}
#: On a curved path, these.
COMPARED_ON_PATHS = {
    'path_error_m.e2_rms': 'e2\nrms (m)',
    'path_error_m.e2_max': 'e2\nmax (m)',
    'path_error_m.e3_rms': 'e3\nrms (m)',
    'path_error_m.e3_max': 'e3\nmax (m)',
}


def compared(rows: list[dict]) -> dict[str, str]:
    """Figures that the rows of an experiment are compared in, with the names of columns."""
    return COMPARED_ON_PATHS if 'path_error_m' in rows[0] else COMPARED


def is_better(one: float | None, other: float | None) -> bool:
    """Whether a figure is smaller than another by 0.01 at least, as printed."""
    return one is not None and (other is None or one <= other - 0.01)


def pid_better(rows: list[dict]) -> list[dict[str, Any]]:
    """Figures in which the tuned PID beats the adaptive law."""
    better = []
    adaptive = {(row['case'], row['guidance']): row for row in rows if row['controller'] != 'pid'}
    for pid in rows:
        ours = adaptive.get((pid['case'], pid['guidance']))
        if pid['controller'] != 'pid' or not ours:
            continue
        for name in compared(rows):
            one, other = figure_of(pid, name), figure_of(ours, name)
            if is_better(one, other):
                better.append(
                    {
                        'case': pid['case'],
                        'guidance': pid['guidance'],
                        'figure': name,
                        'pid': one,
                        'adaptive': other,
                    }
                )
    return better


def report(experiments: list[Experiment], rows: list[list[dict]]) -> dict[str, Any]:
    """Result of the command: what the paper says, what was flown, verdicts."""
    told = []
    for one, flown in zip(experiments, rows, strict=True):
        checks = one.judge(flown)
        passed = bool(checks) and all(check.passed for check in checks)
        told.append(
            {
                'name': one.name,
                'group': one.group,
                'section': one.section,
                'title': one.title,
                'paper': one.paper,
                'rows': flown,
                'pid_better': pid_better(flown),
                'checks': [check._asdict() for check in checks],
                'verdict': PASSED if passed else FAILED,
            }
        )
    return {'experiments': told}


# ---------------------------------------------------------------------------------- experiments

_LAWS = ('adaptive', 'pid')


def _all_ways(scenario: str) -> list[Case]:
    """Both laws, each with the default guidance and with the paper's."""
    return [
        Case('', law, guidance, scenario, drawn=True)
        for guidance in ('observer', 'paper')
        for law in _LAWS
    ]


def _both_laws(scenario: str, case: str, changes: dict, **fields) -> list[Case]:
    return [Case(case, law, 'observer', scenario, changes, **fields) for law in _LAWS]


def _current_experiments() -> list[Experiment]:
    papers = {8: 'holds, within 10 m', 10: 'critical, about 50 m', 12: 'lost'}
    return [
        Experiment(
            'current',
            f'current_{angle}deg',
            f'5.1.{i}',
            f'straight path, 1.0 kn at {angle} deg off it, 30 h',
            paper,
            _all_ways(f'current_{angle}deg'),
            judge_limits({**STRAIGHT_LIMITS, 'cross_track_m.max_all': ALL_LIMITS_M[angle]}),
        )
        for i, (angle, paper) in enumerate(papers.items(), 1)
    ]


def _yaw_experiments() -> list[Experiment]:
    readings = {
        '8 deg from north': {},
        '8 deg off path': {'current.angle_deg': 8.0},
    }
    papers = {
        'pid': ('5.2.1', 'gives up at 8 deg', judge_limits(OPPONENT_LIMITS, 'pid')),
        'adaptive': ('5.2.2', 'holds', judge_limits(STRAIGHT_LIMITS)),
    }
    return [
        Experiment(
            'yaw',
            f'yaw_10deg_{law}',
            section,
            f'desired yaw 10 deg in 1.0 kn at 8 deg, {law}, 30 h',
            paper,
            [
                Case(case, law, guidance, 'yaw_10deg', changes, drawn=True)
                for case, changes in readings.items()
                for guidance in ('observer', 'paper')
            ],
            judge,
        )
        for law, (section, paper, judge) in papers.items()
    ]


def _profile_experiments() -> list[Experiment]:
    return [
        Experiment(
            'profile',
            'profile',
            '5.1, figures 5 to 7',
            'depth, pitch and roll of the flights of 5.1.1',
            'dives 0-1000 m at a pitch of -+30 deg',
            _both_laws('current_8deg', '', {}, drawn=True),
            judge_limits(PROFILE_LIMITS),
        )
    ]


def steering_share(scenario: Scenario) -> dict[str, float]:
    """Turn rate over sin(roll) of the plant over that of its file, in dive and climb."""
    vehicle = load_vehicle(scenario.vehicle).params()
    frame = airframe(vehicle, perturbed(vehicle, scenario.perturb))
    return {'dive': frame['steering_dive'], 'climb': frame['steering_climb']}


#: Factors on K_MY that change the steering effectiveness, by what they make of it in the dive.
K_MY_FACTORS = {'x0.4': 0.76, 'x2': 1.74, 'reversed': 0.56}
#: One controller, no retuning: what is wrong with the vehicle.
FAULTS = {
    'nominal': {},
    'seawing': {'vehicle': 'seawing'},
    'static roll 10 deg': {'perturb.roll_bias_deg': 10.0},
    **{f'steering {what}': {'perturb.K_MY': factor} for what, factor in K_MY_FACTORS.items()},
    'pitch trim 10 mm off': {'perturb.pitch_trim_m': 0.010},
    'pump at 1/3 rate': {'perturb.pump_rate': 0.3333},
    'roll mass at 1/3 travel': {'perturb.roll_range': 0.3333},
}


def _robustness_experiments() -> list[Experiment]:
    cases = []
    for case, changes in FAULTS.items():
        facts = {'changes': changes}
        if 'perturb.K_MY' in changes:
            facts['steering'] = steering_share(load_scenario('current_8deg', changes))
        cases += _both_laws('current_8deg', case, changes, facts=facts)
        if 'vehicle' in changes:
            pid = Case(f'{case}, PID of zhang2021', 'pid', 'observer', 'current_8deg', changes)
            cases.append(pid._replace(told='zhang2021', facts=facts))
    return [
        Experiment(
            'robustness',
            'robustness',
            '',
            'one controller, no retuning, 1.0 kn at 8 deg, 30 h',
            'not flown',
            cases,
            judge_limits(ROBUST_LIMITS),
        )
    ]


#: Depth that every helix descends to, at its slope of 31.6 deg (m).
_HELIX_DEPTH_M, _HELIX_SLOPE_DEG = 800.0, 31.6


def _helix(radius: float, direction: str) -> dict[str, Any]:
    """A helix that starts north of where the vehicle is put, whatever its radius and sense."""
    descent = 2.0 * math.pi * radius * math.tan(math.radians(_HELIX_SLOPE_DEG))
    return {
        'path.radius_m': radius,
        'path.direction': direction,
        'path.turns': round(_HELIX_DEPTH_M / descent, 3),
        'path.at_end': 'continue',  # scored on a helix until its time is over
        'initial.east_m': -radius if direction == 'cw' else radius,
    }


def _paths_experiments() -> list[Experiment]:
    helices = [
        case
        for radius in (60.0, 100.0, 150.0, 300.0)
        for direction in ('cw', 'ccw')
        for case in _both_laws(
            'helix',
            f'radius {radius:.0f} m, {direction}',
            _helix(radius, direction),
            measures=(measure_attitude, measure_path),
        )
    ]
    spline = _both_laws('spline', 'spline', {}, measures=(measure_attitude, measure_path))
    survey = _both_laws('survey', '', {}, measures=(measure_attitude, measure_survey))
    judge = judge_limits(PATH_LIMITS)
    return [
        Experiment(
            'paths', 'helix', '', 'descending helix in still water', 'not flown', helices, judge
        ),
        Experiment(
            'paths', 'spline', '', 'curved descent in still water', 'not flown', spline, judge
        ),
        Experiment(
            'paths',
            'survey',
            '',
            'five-leg survey in 0.3 kn',
            'not flown',
            survey,
            judge_survey,
        ),
    ]


def horizontal_speed(scenario: Scenario) -> float:
    """U_h (m/s) that the vehicle's polar gives for the scenario's pitch and net heaviness."""
    polar = make_polar(load_vehicle(scenario.vehicle).params())
    pitch = -math.radians(scenario.profile.pitch_deg)
    return steady_horizontal_speed(pitch, scenario.profile.net_heaviness_kg, polar)


def expectation(speed: float, current_mps: float, angle_deg: float) -> dict[str, Any]:
    """What physics allows in a current so fast and at such an angle off the path.

    Parameters
    ----------
    speed : float
        Horizontal speed through the water U_h (m/s).
    """
    angle = math.radians(angle_deg)
    across = abs(current_mps * math.sin(angle))
    _, progress, feasible = crab_heading(
        0.0, speed, current_mps * math.cos(angle), current_mps * math.sin(angle)
    )
    expected = 'marginal' if feasible else 'infeasible'
    if feasible and across <= HELD_SHARE * speed:
        expected = 'feasible'
    return {
        'expected': expected,
        'cross_share': across / speed,
        'progress_mps': progress,
        'limit_m': TURN_S * across + TURN_MARGIN_M,
    }


def _envelope_experiments() -> list[Experiment]:
    speed = horizontal_speed(load_scenario('current_8deg'))
    cases = []
    for quarter in range(1, 7):
        for angle in range(0, 181, 15):
            knots = 0.25 * quarter
            changes = {
                'current.speed_kn': knots,
                'current.angle_deg': float(angle),
                'duration_s': 40000.0,
            }
            facts = {'speed_kn': knots, 'angle_deg': float(angle)}
            cases.append(
                Case(
                    f'{knots:g} kn at {angle} deg',
                    'adaptive',
                    'observer',
                    'current_8deg',
                    changes,
                    measures=(measure_attitude, measure_crab),
                    facts={**facts, **expectation(speed, knots * KNOT_MPS, angle)},
                )
            )
    return [
        Experiment(
            'envelope',
            'envelope',
            '5.1, figure 12',
            f'speed and angle of the current, 11 h each; U_h = {speed:.3f} m/s',
            'limit at 10 deg for 1.0 kn',
            cases,
            judge_envelope,
        )
    ]


GROUPS = {
    'current': _current_experiments,
    'yaw': _yaw_experiments,
    'profile': _profile_experiments,
    'robustness': _robustness_experiments,
    'paths': _paths_experiments,
    'envelope': _envelope_experiments,
}


def make_experiments(groups: list[str]) -> list[Experiment]:
    """Experiments of some groups, in the order of `GROUPS`."""
    return [one for group, make in GROUPS.items() if group in groups for one in make()]
