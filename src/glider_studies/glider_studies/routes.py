# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""The mission of eddies_10d in seas that nobody tuned on: straight, and along planned routes."""

import math
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, NamedTuple

import numpy as np

from glider_bringup.scoring.card import fly_scored
from glider_mission.choices import Combination, combination_of
from glider_mission.routing.plan import plan
from glider_mission.scenario import Scenario, load_scenario
from glider_model.ocean.eddying_sea import EddyingSea, write_sea
from glider_studies.paper.experiments import Experiment, told
from glider_studies.paper.judges import Check
from glider_studies.workers import Pool, Progress

NAME = 'routes'
#: rms of each part of the current at the top (m/s), and seas of each.
SIZES, SEAS = (0.18, 0.3, 0.42), 4
#: The first sea; those that are shipped are of other seeds.
FIRST = 1000
_PLANNED = {'guidance.route': 'planned', 'guidance.replan': 'surfacing'}
#: How a sea is crossed: the forecast is 12 h late, or has an error of 0.15 m/s as well.
WAYS: dict[str, dict[str, Any]] = {
    'straight': {},
    'planned': _PLANNED,
    'erring': {**_PLANNED, 'forecast.error_mps': 0.15},
}
#: A planned route takes at most this share of the time of straight legs, and by a forecast that
#: errs never more than this share.
GAIN, LOSS = 0.9, 1.1
_TITLE = 'planned routes and straight legs, 192 km through eddies'


class Crossing(NamedTuple):
    """What came of a mission in a sea."""

    arrival_h: float | None  #: None: not in its time
    reachable: bool  #: whether a plan by the true sea says that it arrives
    plan_h: float | None  #: when, by that plan
    plan_straight_h: float | None  #: along straight legs, by that plan


def scenario_in(sea: Path, way: str) -> Scenario:
    """The mission in a sea, crossed in one of `WAYS`."""
    return load_scenario('eddies_10d', {'orders': [], 'current.field.file': str(sea), **WAYS[way]})


def _cross(task: tuple[int, float, str]) -> Crossing:
    """Make a sea by its seed and rms, and cross it, in a worker."""
    seed, rms_mps, way = task
    with TemporaryDirectory() as folder:
        sea = Path(folder) / 'sea.nc'
        write_sea(EddyingSea(seed=seed, rms_mps=rms_mps), sea)
        scenario = scenario_in(sea, way)
        # with the true sea for a forecast
        sure = plan(scenario.model_copy(update={'forecast': type(scenario.forecast)()}))
        _, scores = fly_scored(scenario)
    arrival = scores['arrival']
    return Crossing(
        arrival['t_s'] / 3600.0 if arrival['arrived'] else None,
        sure.reachable,
        *(
            when_s / 3600.0 if math.isfinite(when_s) else None
            for when_s in (sure.arrival_s(50.0), sure.straight_s)
        ),
    )


def combinations() -> set[Combination]:
    """What loops the flights need."""
    return {combination_of(load_scenario('eddies_10d', {'orders': []}))}


def judge(rows: list[dict[str, Any]]) -> list[Check]:
    """What is asked of planned routes, over all seas."""
    missed = sum(row['reachable'] and row['planned_h'] is None for row in rows)
    unsaid = sum(not row['reachable'] and row['planned_h'] is not None for row in rows)
    straight = [row for row in rows if row['straight_h'] is not None]
    both = [row['planned_h'] / row['straight_h'] for row in straight if row['planned_h']]
    share = float(np.median(both)) if both else None
    worse = sum(
        row['erring_h'] is None or row['erring_h'] > LOSS * row['straight_h'] for row in straight
    )
    return [
        Check('reachable, but not reached on a planned route', missed, 0, missed == 0),
        Check('not reachable, but reached on a planned route', unsaid, 0, unsaid == 0),
        Check('time of straight legs, median share', share, GAIN, bool(both) and share <= GAIN),
        Check('later than straight legs by a forecast that errs', worse, 0, worse == 0),
    ]


def cross(seed: int, pool: Pool, progress: Progress) -> dict[str, Any]:
    """Cross the seas of a seed in all ways; returns an entry of ``experiments.json``."""
    seas = {
        FIRST + len(SIZES) * SEAS * seed + SEAS * k + number: rms_mps
        for k, rms_mps in enumerate(SIZES)
        for number in range(SEAS)
    }
    tasks = {(sea, way): (sea, rms, way) for sea, rms in seas.items() for way in WAYS}
    flown = pool.results(_cross, tasks, progress)
    rows = [
        {
            'sea': sea,
            'rms_mps': rms_mps,
            'reachable': flown[sea, 'straight'].reachable,
            'plan_h': flown[sea, 'straight'].plan_h,
            'plan_straight_h': flown[sea, 'straight'].plan_straight_h,
            **{f'{way}_h': flown[sea, way].arrival_h for way in WAYS},
        }
        for sea, rms_mps in seas.items()
    ]
    title = f'{_TITLE}, seed {seed}'
    return told(Experiment(NAME, NAME, '', title, '-', [], judge), rows)


def count_flights() -> int:
    """Flights that it takes."""
    return len(SIZES) * SEAS * len(WAYS)
