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

from glider_base.errors import ConfigurationError, shown
from glider_bringup.scoring.card import STOPPED, finite, fly_scored
from glider_bringup.scoring.navigation import FOURTH
from glider_bringup.scoring.scores import SCORES, studied
from glider_mission.changes import overlap, run_command
from glider_mission.scenario import Scenario, load_scenario
from glider_model.plant.faults.settings import measured
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
from glider_model.vehicle.surface import surface_loads
from glider_studies.random_faults import sample_faults, validated
from glider_studies.workers import Pool, Progress

#: Sideslip by which the moment of a steering surface is given (rad).
SLIP = 1e-6
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

#: What is shown of the navigation of each flight.
NAVIGATION = (
    'surfacings',
    'surfacing_error_m',
    'surfacing_cross_track_m',
    'dac_error_mps',
    'ellipse_95_share',
    'fixed',
    'innovation_squared',
)
#: Outcomes of flights that were not flown to their end: no percentile holds figures of them.
CUT_SHORT = ('surfaced', 'lost', *STOPPED)
RESULT_FILE = 'montecarlo.json'


# ---------------------------------------------------------------------------------- plants


def sample_plant(seed: int, vehicle: VehicleParams, reckons: bool = False) -> dict[str, Any]:
    """Draw a plant by the seed of its study plus its number: fields of a scenario.

    They are whole sections, seed, perturb, water and sensors, rounded so that they can be typed.
    Factors on numbers that are zero in this vehicle are drawn, but left out. The sensors of one
    that ``reckons``, as it does not measure where it is, have `ERRORS` too.
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
    """Whether a plant can be flown at all, beside the ``vehicle`` as its file says.

    ``pitch_moment_kg`` and ``yaw_moment_kg``: static moment per angle and V^2, with the Munk
    moment and that of a steering surface (stable: < 0 and > 0). ``steering_dive`` and
    ``steering_climb``: turn rate over sin(roll) relative to that of the file (None: no steady
    glide, or no roll). What follows: ``unstable``, ``weak_steering``.
    """
    pitch = plant.K_M + plant.a_33 - plant.a_11
    loads = surface_loads((0.0,) * 6, 1.0, SLIP, 0.0, 0.0, 0.0, 0.0, 0.0, plant.surface)
    yaw = plant.K_MY - plant.a_22 + plant.a_11 + loads[5] / SLIP
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


def _drawn(base: Scenario, seed: int, faults: int) -> dict[str, Any]:
    """What is drawn of a plant of a scenario by its seed, with as many faults."""
    vehicle = load_vehicle(base.vehicle).params()
    plant = sample_plant(seed, vehicle, base.navigation.jumps)
    if base.water.profile is not None or base.water.grid.file:  # the density is given
        plant = {**plant, 'water': {}}
    shows = measured(base.topics, base.sensors.gyro)
    drawn = sample_faults(seed, faults, base.duration_s, shows=shows)
    return {**plant, 'faults': drawn} if faults else plant


def _sample(base: Scenario, seed: int, faults: int) -> dict[str, Any]:
    """Fields of a scenario for a plant: what is not drawn is as the scenario says."""
    plant = _drawn(base, seed, faults)
    for section in ('perturb', 'sensors'):
        plant[section] = getattr(base, section).model_dump(exclude_defaults=True) | plant[section]
    return plant


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

    Of a scenario by name or path and ``changes``, fields by dotted name. What is drawn of its
    seed, perturb, water and sensors gives way to the plant's, its faults to those drawn, if any
    are. Raises ConfigurationError, naming field, value and allowed range.
    """
    base = load_scenario(name, {**changes, 'dives': 0})
    _check_changes(changes, _drawn(base, seed, faults))
    scenarios = {}
    for plant in range(plants):
        sampled = _sample(base, seed + plant, faults)
        sections = {
            'seed': sampled['seed'],
            'perturb': PerturbSettings(**sampled['perturb']),
            'water': base.water.model_copy(update=sampled['water']),
            'sensors': SensorSettings(**sampled['sensors']),
        }
        if faults:
            sections['faults'] = validated(sampled['faults'])
        for controller in controllers:
            law = base.control.model_copy(update={'law': controller})
            scenarios[plant, controller] = base.model_copy(update={**sections, 'control': law})
    return scenarios


def _check_changes(changes: dict[str, Any], plant: dict[str, Any]) -> None:
    """Refuse to change what a study says of each flight itself, such as what is drawn."""
    sections = {'perturb', 'water', 'sensors'}
    drawn = plant.keys() - sections
    drawn |= {f'{section}.{name}' for section in sections for name in plant[section]}
    for field, value in changes.items():
        if any(overlap(field, one) for one in drawn):
            why = 'drawn for each plant from --seed (allowed: fields that are not)'
        elif field == 'control.law':
            why = 'each plant is flown by each law (allowed: --controller)'
        elif field == 'dives' and value != 0:
            why = 'each plant is flown for as long (allowed: --duration)'
        else:
            continue
        raise ConfigurationError(f'--set {field}={shown(value)}: {why}')


def judge(scores: dict, status: str = 'completed', reason: str = '') -> dict[str, Any]:
    """Figures of one flight, and whether it diverged; a figure that is not finite is None.

    A flight that failed, was lost, or could not hold its course has diverged, whatever it was
    like before.
    """
    figures = {one.study[1]: one.in_card(scores) for one in SCORES if one.study}
    clean, final = finite(figures), scores['final_state'] or {}
    failed = status == 'failed' or clean != figures or finite(final) != final
    far = _farthest_m(scores) > DIVERGED_M
    diverged = failed or far or scores['status'] in ('infeasible', 'lost')
    return {
        'diverged': diverged,
        'outcome': outcome(scores, failed, diverged),
        'reason': reason or scores['reason'],
        **clean,
        'navigation': finite({name: scores['navigation'][name] for name in NAVIGATION}),
    }


def outcome(scores: dict, failed: bool, diverged: bool) -> str:
    """What became of a flight, in a word or two: its status, or that it was off its path."""
    if failed:
        return 'failed'
    if scores['status'] != 'completed':
        return scores['status']
    return 'off its path' if diverged else 'completed'


def _farthest_m(scores: dict) -> float:
    """How far a flight was off its path (m); one that reckons, where it came up.

    The first ways of such a flight are not counted: nothing has shown it the current.
    """
    navigation = scores['navigation']
    if navigation['ellipse_95_share'] is None:
        return scores['cross_track_m']['max_all'] or 0.0
    return max(map(abs, navigation['surfacing_cross_track_m'][FOURTH:]), default=0.0)


def _fly_plant(scenario: Scenario) -> dict[str, Any]:
    """Fly one scenario in a worker."""
    flight, scores = fly_scored(scenario)
    return judge(scores, flight.status, flight.reason)


def _check_plant(scenario: Scenario) -> dict[str, Any]:
    """Airframe of one scenario in a worker."""
    vehicle = load_vehicle(scenario.vehicle).params()
    return airframe(vehicle, perturbed(vehicle, scenario.perturb))


def fly_plants(
    scenarios: dict[tuple[int, str], Scenario], pool: Pool, progress: Progress
) -> tuple[dict[tuple[int, str], dict], dict[int, dict]]:
    """Fly every scenario, in worker processes.

    Returns what `judge` says by plant and controller, and what `airframe` says by plant.
    """
    plants = {plant: scenario for (plant, _), scenario in scenarios.items()}
    airframes = pool.results(_check_plant, plants, lambda done: None)
    return pool.results(_fly_plant, scenarios, progress), airframes


# ---------------------------------------------------------------------------------- results


def spread(numbers: list[float | None]) -> dict[str, float | None]:
    """Median, 95th percentile and worst of some figures; None of nothing.

    A percentile is the figure that this share of the plants does not exceed. None counts as the
    worst there is.
    """
    ranked = sorted(math.inf if number is None else number for number in numbers) or [math.inf]

    def at(share: float) -> float | None:
        number = ranked[max(1, math.ceil(share * len(ranked))) - 1]
        return number if math.isfinite(number) else None

    return {'p50': at(0.50), 'p95': at(0.95), 'worst': at(1.0)}


def _rows(
    flights: dict[tuple[int, str], dict], airframes: dict[int, dict]
) -> list[dict[str, Any]]:
    """What all plants came to, by controller: percentiles of those flown to their end."""
    weak = {
        'statically_unstable': sum(one['unstable'] for one in airframes.values()),
        'weak_steering': sum(one['weak_steering'] for one in airframes.values()),
    }
    rows = []
    for controller in dict.fromkeys(controller for _, controller in flights):
        of = [flights[plant, controller] for plant in airframes]
        whole = [flight for flight in of if flight['outcome'] not in CUT_SHORT]
        rows.append(
            {
                'controller': controller,
                'diverged': sum(flight['diverged'] for flight in of),
                **{key: spread([flight[key] for flight in whole]) for key, _ in studied()},
                **weak,
                'navigation': pooled([flight['navigation'] for flight in whole]),
                'flown_to_end': len(whole),
                'outcomes': dict(Counter(flight['outcome'] for flight in of)),
                'worst_plant': max(airframes, key=lambda plant: _badness(of[plant])),
            }
        )
    return rows


def pooled(flights: list[dict]) -> dict[str, Any]:
    """How well vehicles knew where they were, over all surfacings of what is shown of them.

    A figure without data is None.
    """

    def mean(name: str, weight: str, some: list[dict]) -> float | None:
        weights = sum(one[weight] for one in some)
        return sum(one[name] * one[weight] for one in some) / weights if weights else None

    later = [error for one in flights for error in one['surfacing_error_m'][FOURTH:]]
    beside = [abs(m) for one in flights for m in one['surfacing_cross_track_m'][FOURTH:]]
    known = [one for one in flights if one['ellipse_95_share'] is not None]
    fixed = [one for one in flights if one['fixed']]
    return {
        'surfacings': sum(one['surfacings'] for one in flights),
        'error_m': spread(later) if later else None,
        'cross_track_m': spread(beside) if beside else None,
        'ellipse_95_share': mean('ellipse_95_share', 'surfacings', known),
        'innovation_squared': mean('innovation_squared', 'fixed', fixed),
    }


def _badness(flight: dict) -> tuple[bool, float]:
    """What the worst flight has most of."""
    worst = flight['max_steady_m']
    return flight['diverged'], math.inf if worst is None else worst


def report(
    name: str,
    changes: dict[str, Any],
    seed: int,
    faults: int,
    flights: dict[tuple[int, str], dict],
    airframes: dict[int, dict],
) -> dict[str, Any]:
    """Result of a study: a row for each controller, and of every plant what it is, how it flew.

    The first arguments are those of `make_scenarios`.
    """
    base = load_scenario(name, changes)
    plants = []
    for plant, frame in airframes.items():
        sampled = _sample(base, seed + plant, faults)
        water = {f'water.{name}': value for name, value in sampled['water'].items()}
        fields = {**changes, 'dives': 0, **sampled, **water}
        del fields['water']
        runs = {controller: flight for (i, controller), flight in flights.items() if i == plant}
        again = {law: run_command(name, fields, f'--controller {law}') for law in runs}
        plants.append(
            {'plant': plant, **sampled, 'airframe': frame, 'flights': runs, 'commands': again}
        )
    rows = _rows(flights, airframes)
    result = {'scenario': base.name, 'plants': len(airframes), 'seed': seed, 'rows': rows}
    return {**result, 'flown': plants}
