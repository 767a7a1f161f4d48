# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""Every experiment: the paper's own, and what goes beyond them.

The tuned PID and the paper's line of sight are flown beside the adaptive law, and are told as they
are; limits apply to the adaptive law. A change that makes anything worse turns a verdict to
``failed``.
"""

import math
from typing import Any

from glider_bringup.mission.scenario import Scenario, load_scenario
from glider_bringup.studies.montecarlo import airframe
from glider_bringup.studies.paper import broken, seas
from glider_bringup.studies.paper.cases import Case, Experiment
from glider_bringup.studies.paper.limits import (
    ALL_LIMITS_M,
    HELD_SHARE,
    OPPONENT_LIMITS,
    PATH_LIMITS,
    PROFILE_LIMITS,
    RECKONED_LIMITS,
    ROBUST_LIMITS,
    SPARSE_LIMIT_M,
    STRAIGHT_LIMITS,
    TURN_MARGIN_M,
    TURN_S,
    VEHICLE_LIMIT_M,
    judge_envelope,
    judge_limits,
    judge_reckoned,
    judge_survey,
)
from glider_bringup.studies.paper.measures import (
    horizontal_speed,
    measure_attitude,
    measure_crab,
    measure_path,
    measure_survey,
)
from glider_guidance.los import crab_heading
from glider_model.ocean.current_settings import KNOT_MPS
from glider_model.vehicle.file import load_vehicle
from glider_model.vehicle.perturb import perturbed

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


#: Errors of sensors that dead reckoning is flown with.
SENSOR_ERRORS = {
    'sensors.compass_bias_deg': 1.0,
    'sensors.compass_deviation_deg': 1.0,
    'sensors.pitch_scale': 0.96,
    'sensors.gps_std_m': 5.0,
}
#: Current that every vehicle is flown in.
_HALF_KNOT = {'current.speed_kn': 0.5, 'current.angle_deg': 20.0}
#: What a vehicle is spared that is to know its place throughout.
_KNOWS = {'navigation.method': 'known', 'profile.surface_every_dives': 0, 'sensors': {}}
#: Scenario and changed fields of each vehicle.
_VEHICLES = {
    'zhang2021': ('current_8deg', _HALF_KNOT),
    'seawing': ('current_8deg', {**_HALF_KNOT, 'vehicle': 'seawing'}),
    'slocum_g2': ('slocum_shelf', {**_HALF_KNOT, **_KNOWS}),
    'seaglider': ('seaglider_1000m', {**_HALF_KNOT, **_KNOWS}),
}


def _each_vehicle(also: dict[str, Any]) -> list[Case]:
    """Every vehicle by both laws."""
    return [
        case
        for vehicle, (scenario, changes) in _VEHICLES.items()
        for case in _both_laws(scenario, vehicle, {**changes, **also})
    ]


def _vehicles_experiments() -> list[Experiment]:
    reckons = {'profile.surface_every_dives': 1, 'navigation.method': 'dead_reckoned'}
    return [
        Experiment(
            'vehicles',
            'vehicles',
            '',
            'one law, no retuning, four vehicles on a straight path in 0.5 kn at 20 deg',
            'not flown',
            _each_vehicle({}),
            judge_limits({'cross_track_m.max_steady': VEHICLE_LIMIT_M}),
        ),
        Experiment(
            'vehicles',
            'vehicles_reckoned',
            '',
            'the same without a position under water, up after every dive: compass 1 deg off and '
            '1 deg of deviation, pitch read 4 % too small, fixes 5 m',
            'not flown',
            _each_vehicle({**reckons, **SENSOR_ERRORS}),
            judge_limits(RECKONED_LIMITS),
        ),
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


def _reckoned(scenario: str, changes: dict) -> list[Case]:
    """Position known and reckoned, without and with errors of the sensors."""
    surfaces = {'profile.surface_every_dives': 1, **changes}
    known = {**surfaces, 'navigation.method': 'known'}
    reckons = {**surfaces, 'navigation.method': 'dead_reckoned'}
    return [
        *_both_laws(scenario, 'position known', known),
        *_both_laws(scenario, 'reckoned, no errors', reckons),
        *_both_laws(scenario, 'reckoned', {**reckons, **SENSOR_ERRORS}),
    ]


def _flow(speed_mps: float, direction_deg: float, share: float = 1.0, off_deg: float = 0.0):
    """Speed and direction of a current; of its forecast, with its errors."""
    return {'speed_mps': share * speed_mps, 'direction_deg': direction_deg + off_deg}


def _seas(**errors: float) -> dict[str, dict[str, Any]]:
    """Three seas, or what is forecast of them: what varies at random is not."""
    tide = {'kind': 'tidal', **_flow(0.20, 60.0, **errors)}
    rough = [
        {'kind': 'shear', **_flow(0.15, -20.0, **errors), 'law': 'exponential', 'depth_m': 200.0},
        {'kind': 'tidal', **_flow(0.08, 75.0, **errors), 'ellipticity': 0.4},
    ]
    return {
        'constant': _flow(KNOT_MPS, 12.0, **errors),
        'tidal': {**_flow(0.10, 30.0, **errors), 'components': [tide]},
        'rough_water': {**_flow(0.3 * KNOT_MPS, 60.0, **errors), 'components': rough},
    }


#: How far a forecast is off.
FORECAST_ERRORS = {'share': 0.8, 'off_deg': 10.0}
#: Scenario and changed fields of the three seas.
_IN_SEA = {
    'constant': ('current_12deg', {}),
    'tidal': ('current_12deg', {'current': _seas()['tidal']}),
    'rough_water': ('rough_water', {}),
}


def _beliefs() -> list[Case]:
    """Ways to believe the current, in three seas."""
    forecasts = _seas(**FORECAST_ERRORS)
    return [
        Case(
            f'{sea}, {belief}',
            'adaptive',
            'observer',
            scenario,
            {
                'profile.surface_every_dives': 1,
                'navigation.method': 'dead_reckoned',
                **SENSOR_ERRORS,
                **changes,
                'navigation.current': belief,
                **({'navigation.forecast': forecasts[sea]} if belief == 'forecast' else {}),
            },
        )
        for sea, (scenario, changes) in _IN_SEA.items()
        for belief in ('none', 'persistence', 'tidal', 'forecast')
    ]


def _missed() -> list[Case]:
    """Surfacings without a fix, for a week."""
    changes = {
        'profile.surface_every_dives': 1,
        'navigation.method': 'dead_reckoned',
        'duration_s': 604800.0,
        **SENSOR_ERRORS,
    }
    patterns = {'every fix': '0', 'every second missed': '01', 'three of four missed': '0111'}
    return [
        Case(
            case,
            'adaptive',
            'observer',
            'current_12deg',
            {**changes, 'sensors.fix_missed_pattern': pattern, 'path.length_m': 200000.0},
        )
        for case, pattern in patterns.items()
    ]


def _sparse() -> list[Case]:
    """Attitude sampled now and then, without a gyro, where position is known."""
    return [
        case
        for period in (0.1, 4.4, 10.0)
        for case in _both_laws(
            'current_8deg',
            f'attitude every {period:g} s, no gyro',
            {'sensors.imu_period_s': period, 'sensors.gyro': False},
        )
    ]


def _navigation_experiments() -> list[Experiment]:
    assumed = 'position measured all the time'
    return [
        Experiment(
            'navigation',
            'reckoned_12deg',
            '',
            'current_12deg, up after every dive, 30 h: compass 1 deg off and 1 deg of deviation, '
            'pitch read 4 % too small, fixes 5 m',
            assumed,
            _reckoned('current_12deg', {}),
            judge_reckoned,
        ),
        Experiment(
            'navigation',
            'reckoned_rough',
            '',
            'rough_water, the same errors: shear and tide that no navigation knows beforehand',
            assumed,
            _reckoned('rough_water', {}),
            judge_limits({}),
        ),
        Experiment(
            'navigation',
            'reckoned_beliefs',
            '',
            'what is believed of the current, in three seas; what is forecast is a '
            'fifth too weak, 10 deg off, and nothing of what is random',
            assumed,
            _beliefs(),
            judge_limits({}),
        ),
        Experiment(
            'navigation',
            'missed_fixes',
            '',
            'current_12deg for a week, surfacings without a fix',
            assumed,
            _missed(),
            judge_limits({}),
        ),
        Experiment(
            'navigation',
            'sparse_attitude',
            '',
            'current_8deg, position known, 30 h',
            assumed,
            _sparse(),
            judge_limits({'cross_track_m.max_steady': SPARSE_LIMIT_M}),
        ),
        Experiment(
            'navigation',
            'long_stays',
            '',
            'rough_water, hours at the surface under its tide',
            assumed,
            seas.stays(),
            seas.judge_stays,
        ),
        Experiment(
            'navigation',
            'hard_seas',
            '',
            'rough_water made harder, 30 h each: is the ellipse as large as it has to be',
            assumed,
            seas.hard_seas(),
            seas.judge_hard,
        ),
    ]


def _fault_experiments() -> list[Experiment]:
    return [
        Experiment(
            'faults',
            'fault_matrix',
            '',
            'current_12deg, dives to 300 m: each fault in each phase, and how it ends',
            'nothing fails',
            broken.cases(_LAWS),
            broken.judge,
        ),
        Experiment(
            'faults',
            'false_reactions',
            '',
            'missions in which nothing breaks: what the guard says of them',
            'nothing fails',
            broken.clean_cases(_LAWS),
            broken.judge_clean,
        ),
    ]


GROUPS = {
    'current': _current_experiments,
    'yaw': _yaw_experiments,
    'profile': _profile_experiments,
    'robustness': _robustness_experiments,
    'vehicles': _vehicles_experiments,
    'paths': _paths_experiments,
    'envelope': _envelope_experiments,
    'navigation': _navigation_experiments,
    'faults': _fault_experiments,
}


def make_experiments(groups: list[str]) -> list[Experiment]:
    """Experiments of some groups, in the order of `GROUPS`."""
    return [one for group, make in GROUPS.items() if group in groups for one in make()]
