# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""Many plants that differ from their vehicle file, each flown by the same controllers.

Control and guidance know the file; the plants are drawn around it. Plant i of seed S is a function
of S + i alone, so that it is the same plant in every study, under every controller, whatever the
number of plants and of worker processes.
"""

import math
from collections import Counter
from typing import Any

import numpy as np

from glider_bringup.mission.scenario import Scenario, load_scenario, run_command
from glider_bringup.scoring.card import fly_scored
from glider_bringup.scoring.navigation import FOURTH
from glider_bringup.studies.random_faults import outcome, sample_faults, validated
from glider_bringup.studies.workers import Pool, Progress
from glider_model.plant.sensors import SensorSettings
from glider_model.plant.trim import solve_trim
from glider_model.vehicle.file import VehicleParams, load_vehicle
from glider_model.vehicle.perturb import (
    ADDED_MASS,
    DAMPING,
    STATIC,
    VISCOUS,
    PerturbSettings,
    perturbed,
)

#: What a plant differs by: uniformly, by at most so much.
COEFFICIENT_SPREAD, ADDED_MASS_SPREAD = 0.3, 0.15
PITCH_TRIM_M, ROLL_BIAS_DEG, NET_HEAVINESS_KG = 0.010, 10.0, 0.050
PYCNOCLINE_RISE, PYCNOCLINE_DEPTH_M = (0.0, 0.004), (30.0, 300.0)
#: Compression of sea water, and by how much that of a hull differs from it (1/m).
WATER_COMPRESSION_PER_M, NET_COMPRESSION_PER_M = 4.5e-6, 1e-6
SENSORS = {
    'attitude_std_deg': 0.2,
    'heading_std_deg': 0.5,
    'rate_std_dps': 0.1,
    'position_std_m': 1.0,
}

#: Errors of the sensors of a vehicle that reckons, uniformly in these ranges. A compass swung on
#: shore is left with 1 to 5 deg; an attack angle or a buoyancy that is not known, with 5 % of
#: speed; first fixes take as long as in recorded Slocum and Seaglider flights.
ERRORS = {
    'compass_bias_deg': (-3.0, 3.0),
    'compass_deviation_deg': (-2.0, 2.0),
    'compass_deviation_phase_deg': (-180.0, 180.0),
    'pitch_scale': (0.95, 1.05),
    'pitch_offset_deg': (-1.0, 1.0),
    'roll_bias_deg': (-2.0, 2.0),
    'depth_offset_m': (-0.3, 0.3),
    'gps_std_m': (2.0, 8.0),
    'gps_first_fix_s': (5.0, 150.0),
}

#: A run this far off its path has lost it (m).
DIVERGED_M = 1000.0
#: A plant whose turn rate over sin(roll) falls to this share of its file's steers weakly.
WEAK_STEERING = 0.25
#: Glide that stability and steering are judged in, with half of the pump's range at most.
_GLIDE_KG, _GLIDE_PITCH_DEG, _ROLL_MASS_DEG = 0.4, 30.0, 10.0

#: What is told of the flights of a controller, and where a scorecard has it.
FIGURES = {
    'max_steady_m': ('cross_track_m', 'max_steady'),
    'max_all_m': ('cross_track_m', 'max_all'),
    'max_run_m': ('cross_track_m', 'max_run'),
    'heading_fluctuation_deg': ('heading_fluctuation_deg', 'rms_steady'),
    'pitch_error_deg': ('pitch_error_deg', 'rms_steady'),
    'energy_wh': ('energy', 'wh'),
}
#: What is told of the navigation of each flight.
NAVIGATION = (
    'surfacings',
    'surfacing_error_m',
    'surfacing_cross_track_m',
    'dac_error_mps',
    'ellipse_95_share',
    'fixed',
    'innovation_squared',
)
RESULT_FILE = 'montecarlo.json'


# ---------------------------------------------------------------------------------- plants


def sample_plant(seed: int, vehicle: VehicleParams, reckons: bool = False) -> dict[str, Any]:
    """Draw a plant.

    Numbers are rounded, so that they can be typed. Factors on numbers that are zero in this
    vehicle are drawn, but left out.

    Parameters
    ----------
    seed : int
        Seed of the study plus number of the plant.
    vehicle : VehicleParams
    reckons : bool
        It does not measure where it is: its sensors have `ERRORS` too.

    Returns
    -------
    dict
        Fields of a scenario, whole sections: seed, perturb, water, sensors.
    """
    draw = np.random.Generator(np.random.PCG64(seed)).uniform
    spreads = dict.fromkeys((*VISCOUS, *STATIC, *DAMPING), COEFFICIENT_SPREAD)
    spreads.update(dict.fromkeys(ADDED_MASS, ADDED_MASS_SPREAD))
    factors = {name: round(draw(1.0 - part, 1.0 + part), 4) for name, part in spreads.items()}
    pitch_trim = draw(-PITCH_TRIM_M, PITCH_TRIM_M)
    roll_bias = draw(-ROLL_BIAS_DEG, ROLL_BIAS_DEG)
    net_heaviness = draw(-NET_HEAVINESS_KG, NET_HEAVINESS_KG)
    rise, depth = draw(*PYCNOCLINE_RISE), draw(*PYCNOCLINE_DEPTH_M)
    compression = draw(-NET_COMPRESSION_PER_M, NET_COMPRESSION_PER_M)
    errors = {name: round(draw(*within), 4) for name, within in ERRORS.items()}
    return {
        'seed': seed,
        'perturb': {
            **{name: factor for name, factor in factors.items() if getattr(vehicle, name) != 0.0},
            'pitch_trim_m': round(pitch_trim, 5),
            'roll_bias_deg': round(roll_bias, 3),
            'net_heaviness_kg': round(net_heaviness, 4),
        },
        'water': {
            'pycnocline_rise': round(rise, 6),
            'pycnocline_depth_m': round(depth, 1),
            'compression_per_m': WATER_COMPRESSION_PER_M,
            'hull_compression_per_m': round(WATER_COMPRESSION_PER_M - compression, 9),
        },
        'sensors': SENSORS | (errors if reckons else {}),
    }


def airframe(vehicle: VehicleParams, plant: VehicleParams) -> dict[str, Any]:
    """Whether a plant can be flown at all: its static stability and its steering.

    Parameters
    ----------
    vehicle, plant : VehicleParams
        As its file says, and as it is.

    Returns
    -------
    dict
        ``pitch_moment_kg`` and ``yaw_moment_kg``, static moment per angle and V^2 with the Munk
        moment (stable: < 0 and > 0); ``steering_dive`` and ``steering_climb``, turn rate over
        sin(roll) relative to that of the file (None: no steady glide, or no roll); what follows:
        ``unstable``, ``weak_steering``.
    """
    pitch = plant.K_M + plant.a_33 - plant.a_11
    yaw = plant.K_MY - plant.a_22 + plant.a_11
    steering = {}
    for phase, sign in (('steering_dive', 1.0), ('steering_climb', -1.0)):
        nominal, actual = _turn_rate_over_roll(vehicle, sign), _turn_rate_over_roll(plant, sign)
        steering[phase] = actual / nominal if nominal and actual is not None else None
    return {
        'pitch_moment_kg': pitch,
        'yaw_moment_kg': yaw,
        **steering,
        'unstable': pitch >= 0.0 or yaw <= 0.0,
        'weak_steering': vehicle.mu_max > 0.0
        and any(share is None or share < WEAK_STEERING for share in steering.values()),
    }


def _turn_rate_over_roll(vehicle: VehicleParams, sign: float) -> float | None:
    """Turn rate per sine of roll (rad/s) in a dive (sign 1) or climb (-1)."""
    heaviness = sign * min(_GLIDE_KG, 0.5 * vehicle.m_b_max) - vehicle.ballast
    pitch = -sign * _GLIDE_PITCH_DEG
    mass = min(_ROLL_MASS_DEG, math.degrees(vehicle.mu_max))
    trims = [
        solve_trim(vehicle, heaviness, pitch_deg=pitch, roll_mass_deg=roll_mass)
        for roll_mass in (-mass, mass)
    ]
    port, starboard = (math.sin(math.radians(trim.roll_deg)) for trim in trims)
    if not all(trim.converged for trim in trims) or port == starboard:
        return None
    return (trims[1].turn_rate_radps - trims[0].turn_rate_radps) / (starboard - port)


# ---------------------------------------------------------------------------------- flights


def make_scenarios(
    name: str,
    changes: dict[str, Any],
    controllers: list[str],
    plants: int,
    seed: int,
    faults: int = 0,
) -> dict[tuple[int, str], Scenario]:
    """Scenario of every flight, by plant and controller.

    Parameters
    ----------
    name : str
        Scenario by name or path. Its seed, perturb, density and sensors give way to the plant's.
    changes : dict
        Further fields, by dotted name.
    faults : int
        Faults drawn for each plant, instead of those of the scenario; 0: none are drawn.

    Raises
    ------
    ConfigurationError
        Naming field, value and allowed range.
    """
    base = load_scenario(name, {**changes, 'dives': 0})
    vehicle = load_vehicle(base.vehicle).params()
    scenarios = {}
    for plant in range(plants):
        sampled = sample_plant(seed + plant, vehicle, base.navigation.jumps)
        sections = {
            'seed': sampled['seed'],
            'perturb': PerturbSettings(**sampled['perturb']),
            'water': base.water.model_copy(update=sampled['water']),
            'sensors': SensorSettings(**sampled['sensors']),
        }
        if faults:
            drawn = sample_faults(seed + plant, faults, base.duration_s)
            sections['faults'] = validated(drawn)
        for controller in controllers:
            law = base.control.model_copy(update={'law': controller})
            scenarios[plant, controller] = base.model_copy(update={**sections, 'control': law})
    return scenarios


def judge(scores: dict, status: str = 'completed') -> dict[str, Any]:
    """Figures of one flight, and whether it diverged; a figure that is not finite is None.

    A flight that failed, was lost, or could not hold its course has diverged, whatever it was
    like before.
    """
    figures = {name: scores[group][field] for name, (group, field) in FIGURES.items()}
    numbers = [number for number in figures.values() if number is not None]
    final = scores['final_state'] or {}
    numbers += [number for vector in final.values() for number in vector]
    finite = all(math.isfinite(number) for number in numbers)
    far = _farthest_m(scores) > DIVERGED_M
    figures = {
        name: number if number is not None and math.isfinite(number) else None
        for name, number in figures.items()
    }
    failed = status == 'failed' or not finite
    told = scores['navigation']
    diverged = failed or far or scores['status'] in ('infeasible', 'lost')
    return {
        'diverged': diverged,
        'outcome': outcome(scores, failed, diverged),
        **figures,
        'navigation': {name: told[name] for name in NAVIGATION},
    }


def _farthest_m(scores: dict) -> float:
    """How far a flight was off its path (m); one that reckons, where it came up.

    The first ways of such a flight are not counted: nobody has told it of the current.
    """
    told = scores['navigation']
    if told['ellipse_95_share'] is None:
        return scores['cross_track_m']['max_all'] or 0.0
    return max(map(abs, told['surfacing_cross_track_m'][FOURTH:]), default=0.0)


def _fly_plant(scenario: Scenario) -> dict[str, Any]:
    """Fly one scenario in a worker."""
    flight, scores = fly_scored(scenario)
    return judge(scores, flight.status)


def _check_plant(scenario: Scenario) -> dict[str, Any]:
    """Airframe of one scenario in a worker."""
    vehicle = load_vehicle(scenario.vehicle).params()
    return airframe(vehicle, perturbed(vehicle, scenario.perturb))


def fly_plants(
    scenarios: dict[tuple[int, str], Scenario], pool: Pool, progress: Progress
) -> tuple[dict[tuple[int, str], dict], dict[int, dict]]:
    """Fly every scenario, in worker processes.

    Returns
    -------
    flights : dict
        What `judge` says, by plant and controller.
    airframes : dict
        What `airframe` says, by plant.
    """
    plants = {plant: scenario for (plant, _), scenario in scenarios.items()}
    airframes = pool.results(_check_plant, plants, lambda done: None)
    return pool.results(_fly_plant, scenarios, progress), airframes


# ---------------------------------------------------------------------------------- results


def spread(numbers: list[float | None]) -> dict[str, float | None]:
    """Median, 95th percentile and worst of some figures.

    A percentile is the figure that this share of the plants does not exceed. None counts as the
    worst there is.
    """
    ranked = sorted(math.inf if number is None else number for number in numbers)

    def at(share: float) -> float | None:
        number = ranked[max(1, math.ceil(share * len(ranked))) - 1]
        return number if math.isfinite(number) else None

    return {'p50': at(0.50), 'p95': at(0.95), 'worst': at(1.0)}


def summarise(
    scenario: str,
    seed: int,
    flights: dict[tuple[int, str], dict],
    airframes: dict[int, dict],
) -> dict[str, Any]:
    """Result of a study: one row for each controller."""
    rows = []
    for controller in dict.fromkeys(controller for _, controller in flights):
        of = {plant: flights[plant, controller] for plant in airframes}
        rows.append(
            {
                'controller': controller,
                'diverged': sum(flight['diverged'] for flight in of.values()),
                **{name: spread([flight[name] for flight in of.values()]) for name in FIGURES},
                'statically_unstable': sum(one['unstable'] for one in airframes.values()),
                'weak_steering': sum(one['weak_steering'] for one in airframes.values()),
                'navigation': _navigation([flight['navigation'] for flight in of.values()]),
                'outcomes': dict(Counter(flight['outcome'] for flight in of.values())),
                'worst_plant': max(of, key=lambda plant: _badness(of[plant])),
            }
        )
    return {'scenario': scenario, 'plants': len(airframes), 'seed': seed, 'rows': rows}


def _navigation(flights: list[dict]) -> dict[str, Any]:
    """How well the vehicles of a controller knew where they were, over all surfacings."""
    known = [one for one in flights if one['ellipse_95_share'] is not None]
    fixed = [one for one in flights if one['fixed']]
    surfacings, fixes = (
        sum(one[name] for one in some) for some, name in ((known, 'surfacings'), (fixed, 'fixed'))
    )
    later = [one['surfacing_error_m'][FOURTH:] for one in flights]
    beside = [one['surfacing_cross_track_m'][FOURTH:] for one in flights]
    return {
        'surfacings': sum(one['surfacings'] for one in flights),
        'error_m': spread([error for one in later for error in one]) if any(later) else None,
        'cross_track_m': spread([abs(e) for one in beside for e in one]) if any(beside) else None,
        'ellipse_95_share': surfacings
        and sum(one['ellipse_95_share'] * one['surfacings'] for one in known) / surfacings,
        'innovation_squared': fixes
        and sum(one['innovation_squared'] * one['fixed'] for one in fixed) / fixes,
    }


def _badness(flight: dict) -> tuple[bool, float]:
    """What the worst flight has most of."""
    worst = flight['max_steady_m']
    return flight['diverged'], math.inf if worst is None else worst


def command(name: str, changes: dict[str, Any], controller: str, sampled: dict[str, Any]) -> str:
    """Shell command that flies one plant again; ``changes`` are those of `make_scenarios`."""
    fields = {**changes, 'dives': 0, **sampled}
    return run_command(name, fields, f'--controller {controller}')


def report(
    name: str,
    changes: dict[str, Any],
    summary: dict[str, Any],
    flights: dict[tuple[int, str], dict],
    airframes: dict[int, dict],
    faults: int = 0,
) -> dict[str, Any]:
    """Result of a study with every plant in it: what it is, how it flew, how to fly it again."""
    base = load_scenario(name, changes)
    vehicle, reckons = load_vehicle(base.vehicle).params(), base.navigation.jumps
    plants = []
    for plant, frame in airframes.items():
        sampled = sample_plant(summary['seed'] + plant, vehicle, reckons)
        if faults:
            drawn = sample_faults(summary['seed'] + plant, faults, base.duration_s)
            sampled = {**sampled, 'faults': drawn}
        runs = {controller: flight for (i, controller), flight in flights.items() if i == plant}
        plants.append(
            {
                'plant': plant,
                **sampled,
                'airframe': frame,
                'flights': runs,
                'commands': {law: command(name, changes, law, sampled) for law in runs},
            }
        )
    return {**summary, 'flown': plants}
