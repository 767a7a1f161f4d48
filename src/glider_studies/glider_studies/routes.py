# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""The mission of eddies_10d in seas that nobody tuned on: straight, and along planned routes."""

import math
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

from glider_bringup.scoring.card import fly_scored
from glider_bringup.showing.words import hours_of
from glider_mission.routing.plan import plan
from glider_mission.scenario import Scenario, load_scenario
from glider_model.ocean.eddying_sea import EddyingSea, write_sea
from glider_studies.paper.experiments import Experiment, make_study
from glider_studies.paper.judges import Check

NAME = 'routes'
#: rms of each part of the current at the top (m/s), and seas of each.
SIZES, SEAS = (0.18, 0.3, 0.42), 4
#: The first sea; those that are shipped are of other seeds.
FIRST = 1000
_PLANNED = {'guidance.route': 'planned', 'guidance.replan': 'surfacing'}
#: Planned with the true sea for a forecast, and ways to cross it. Forecasts are so late then (h),
#: of who plans and of the vehicle, or have errors as well (m/s, rms of each part).
LATE_H, ERROR_MPS = 12.0, 0.15
PLAN, ERRING = 'plan', 'erring'
WAYS: dict[str, dict[str, Any]] = {
    PLAN: {'forecast.late_h': 0.0},
    'straight': {},
    'planned': _PLANNED,
    ERRING: {**_PLANNED, 'forecast.error_mps': ERROR_MPS},
}
#: A planned route takes at most this share of the time of straight legs, and by a forecast that
#: errs never more than this share.
GAIN, LOSS = 0.9, 1.1


def scenario_in(sea: Path, forecast: Path, way: str) -> Scenario:
    """The mission in a sea, in one of `WAYS`; a forecast is taken along."""
    used = {'field': {'kind': 'grid', 'file': str(forecast)}, 'late_h': LATE_H}
    changes = {
        'orders': [],
        'current.field.file': str(sea),
        'forecast.file': str(forecast),
        'forecast.late_h': LATE_H,
        'navigation.current': 'forecast',
        'navigation.forecast': used,
    }
    return load_scenario('eddies_10d', {**changes, **WAYS[way]})


def cross_one(task: tuple[int, float, str]) -> dict[str, Any]:
    """Make a sea by its seed and rms, and plan or fly the mission in it, in a worker."""
    seed, rms_mps, way = task
    with TemporaryDirectory() as folder:
        sea, forecast = Path(folder) / 'sea.nc', Path(folder) / 'forecast.nc'
        off = ERROR_MPS if way == ERRING else 0.0
        for file, error in (sea, 0.0), (forecast, off):
            write_sea(EddyingSea(seed=seed, rms_mps=rms_mps, error_mps=error), file)
        scenario = scenario_in(sea, forecast, way)
        if way == PLAN:
            sure = plan(scenario)
            return {
                'reachable': sure.reachable,
                'plan_h': hours_of(sure.arrival_s(50.0)),
                'plan_straight_h': hours_of(sure.straight_s),
            }
        _, scores = fly_scored(scenario)
    arrival = scores['arrival']
    return {f'{way}_h': hours_of(arrival['t_s'] if arrival['arrived'] else math.inf)}


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


def experiment(seed: int) -> Experiment:
    """The seas of a seed, crossed in all ways."""
    seas = {
        FIRST + len(SIZES) * SEAS * seed + SEAS * k + number: rms_mps
        for k, rms_mps in enumerate(SIZES)
        for number in range(SEAS)
    }

    def rows(found: dict[tuple[int, str], dict]) -> tuple[list[dict], dict]:
        return [
            {'sea': sea, 'rms_mps': rms_mps}
            | {name: figure for way in WAYS for name, figure in found[sea, way].items()}
            for sea, rms_mps in seas.items()
        ], {}

    tasks = {(sea, way): (sea, rms_mps, way) for sea, rms_mps in seas.items() for way in WAYS}
    loops = [load_scenario('eddies_10d', {'orders': []})]
    return make_study(NAME, seed, judge=judge, fly=cross_one, tasks=tasks, loops=loops, rows=rows)
