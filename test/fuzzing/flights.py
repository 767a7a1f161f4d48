# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""Flights of scenarios whose numbers are extreme and allowed: finite, or refused before flight.

A few numeric fields of the scenario at a time are put at their limits or somewhere inside, with
every vehicle and either attitude law; half of the flights turn over at a shallow depth. A third of
the vehicles do not know their place, and break on the way.
"""

import math
from collections.abc import Iterator
from functools import partial
from typing import Any, get_args

import numpy as np
import pydantic

from fuzzing.counts import Counter
from fuzzing.watch import outcome_of, time_limit_after
from glider_base.settings import ConfigurationError, limits
from glider_bringup.scoring.card import finite, fly_scored, scorecard
from glider_guidance.yo.machine import ProfileSettings
from glider_mission.scenario import Scenario, load_scenario
from glider_model.ocean.current_settings import MAX_SPEED_MPS
from glider_model.plant.faults.settings import measured
from glider_model.vehicle.file import load_vehicle, vehicle_names
from glider_studies.random_faults import sample_faults

#: Sections of a scenario whose numbers are drawn.
SECTIONS = (
    *('perturb', 'initial', 'water', 'sensors', 'navigation', 'profile', 'guidance', 'control'),
    'guard',
)
#: What is chosen in every flight, beside a current.
LAWS, GUIDANCES = ('adaptive', 'pid'), ('los_current', 'los_zhang2021')
#: What is set for those that do not know their place.
RECKONS = {
    'navigation.method': 'dead_reckoned',
    'guidance.los.method': 'los_current',
    'profile.surface_every_dives': 1,
}
#: The same for those with a steering surface.
STEERS = {'control.law': 'adaptive', 'guidance.los.method': 'los_current'}
#: What they measure.
SHOWN = measured(('imu', 'pressure', 'fix'))
#: Sections that the plant alone is told: half of the flights draw from these only.
PLANT_SECTIONS = ('perturb', 'initial', 'water')
#: What says which loop is compiled, beside whether there are faults; and a flight to compile it.
LOOP = ('vehicle', 'control.law', *RECKONS)
FIRST = {'dives': 0, 'duration_s': 1.0, 'profile.depth_m': 60.0, 'profile.net_heaviness_kg': 0.1}
#: Share of the flights by dead reckoning and with faults, and how many of them.
BREAKS, FAULTS = 0.33, 2
#: Most fields changed in one flight.
FIELDS = 8
DURATION_S, SHALLOW_M = (100.0, 600.0), (10.0, 60.0)
#: Share of numbers at a limit; the rest lies between, evenly or by order of magnitude.
AT_A_LIMIT = 0.6


def numeric_fields(model: type[pydantic.BaseModel], before: str) -> Iterator[tuple[str, Any]]:
    """Dotted names of the numbers in a group of fields, and their fields."""
    for name, field in model.model_fields.items():
        kinds = get_args(field.annotation) or (field.annotation,)
        for kind in kinds:
            if isinstance(kind, type) and issubclass(kind, pydantic.BaseModel):
                yield from numeric_fields(kind, f'{before}{name}.')
        if kinds[0] in (int, float) and field.metadata:  # else it is not a person's to set
            yield f'{before}{name}', field


def range_of(field: Any) -> tuple[float, float]:
    """Lowest and highest number that a field allows."""
    allowed = limits(field)
    low, high = allowed.get('ge', allowed.get('gt')), allowed.get('le', allowed.get('lt'))
    near = 1e-6 * (high - low)
    return low + near * ('gt' in allowed), high - near * ('lt' in allowed)


def _number(draw: np.random.Generator, field: Any) -> float | int:
    """A number that a field allows, likely one of its limits."""
    low, high = range_of(field)
    if draw.random() < AT_A_LIMIT:
        number = (low, high)[draw.integers(2)]
    elif low > 0.0 and draw.random() < 0.5:
        number = math.exp(draw.uniform(math.log(low), math.log(high)))
    else:
        number = draw.uniform(low, high)
    return round(number) if int in (field.annotation, *get_args(field.annotation)) else number


def draw_changes(seed: int, case: int) -> dict[str, Any]:
    """Fields of a case, by dotted name."""
    draw = np.random.Generator(np.random.PCG64([seed, case]))
    sections = SECTIONS if draw.random() < 0.5 else PLANT_SECTIONS
    groups = {name: Scenario.model_fields[name].annotation for name in sections}
    fields = dict(
        field for name, model in groups.items() for field in numeric_fields(model, f'{name}.')
    )
    changes: dict[str, Any] = {
        'vehicle': str(draw.choice(vehicle_names())),
        'control.law': str(draw.choice(LAWS)),
        'guidance.los.method': str(draw.choice(GUIDANCES)),
        'seed': int(draw.integers(2**31)),
        'dives': 0,
        'duration_s': round(draw.uniform(*DURATION_S), 1),
        'current.speed_mps': draw.uniform(0.0, MAX_SPEED_MPS),
        'current.angle_deg': draw.uniform(-180.0, 180.0),
    }
    most = load_vehicle(changes['vehicle']).params().m_b_max
    if most < ProfileSettings().net_heaviness_kg:
        changes['profile.net_heaviness_kg'] = most
    if draw.random() < 0.5:
        changes['profile.depth_m'] = draw.uniform(*SHALLOW_M)
    if load_vehicle(changes['vehicle']).steers_by:
        changes |= STEERS
    elif draw.random() < BREAKS:
        of = int(draw.integers(2**31)), FAULTS, changes['duration_s']
        faults = sample_faults(*of, shows=SHOWN)
        changes |= {**RECKONS, 'faults': faults}
    for name in draw.choice(sorted(fields), draw.integers(1, FIELDS + 1), replace=False):
        changes[str(name)] = _number(draw, fields[name])
    return changes


def _fly(changes: dict[str, Any]) -> tuple[str, str]:
    """Outcome of a flight for `Counter.add`, and why."""
    numbers = []

    class Taker:
        def add(self, log: np.ndarray) -> None:
            numbers.append(bool(np.isfinite(log).all()))

    try:
        scenario = load_scenario(changes=changes)
    except ConfigurationError:
        return '', ''
    flight, scores = fly_scored(scenario, [Taker()])
    card = scorecard(scenario, 'direct', flight, scores)
    if card['status'] == 'failed':
        return 'wrong', card['reason']
    if not all(numbers) or card != finite(card):
        return 'wrong', f'not finite, and {card["status"]}'
    return '', ''


def fuzz(seed: int, count: int, counter: Counter) -> None:
    """Fly ``count`` cases; refused before the flight, or finite to its end, is well."""
    compiled = []
    for case in range(count):
        changes = draw_changes(seed, case)
        loop = {name: changes[name] for name in LOOP if name in changes}
        if 'faults' in changes:
            loop['faults'] = sample_faults(0, FAULTS, 1.0, shows=SHOWN)
        if loop not in compiled:  # which is no case's fault
            compiled.append(loop)
            _fly({**FIRST, **loop})
        told = ' '.join(f'--set {name}={value}' for name, value in changes.items())
        outcome, why = outcome_of(partial(_fly, changes), time_limit_after)
        counter.add(f'./glider run --engine direct {told}', outcome, why)
