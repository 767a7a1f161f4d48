# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""Dead reckoning by a forecast that errs more or less, in seas that nobody tuned on."""

from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

from glider_bringup.scoring.card import fly_scored
from glider_mission.scenario import Scenario, load_scenario
from glider_model.ocean.eddying_sea import EddyingSea, write_sea
from glider_navigation.forecast import ForecastSettings
from glider_studies.paper.experiments import Experiment, make_study
from glider_studies.paper.judges import Check

NAME = 'forecasts'
#: rms of each part of the current at the top (m/s) in each of the seas, and the first of them.
SIZES, FIRST = (0.18, 0.18, 0.42, 0.42), 2000
#: rms by which the depth-averaged current of a forecast is off (m/s), and how long is flown (s).
ERRORS, DURATION_S = (0.0, 0.05, 0.15), 120.0 * 3600.0
PERSISTENCE = 'persistence'
#: What is used of a forecast: all of it, or the share that there is in the sea.
WAYS = {'whole forecast': 0.0, 'its share': ForecastSettings().share_std}
CASES = [(PERSISTENCE, 0.0), *((way, error) for error in ERRORS for way in WAYS)]
#: The first surfacings are not judged: all that is known at first is the forecast.
_SETTLED = 3
#: By its share a vehicle is off at most so many times as far as by the better of the others.
LIMIT = 1.1


def scenario_in(sea: Path, forecast: Path, way: str) -> Scenario:
    """The mission in a sea, and what is used of a forecast."""
    changes = {'orders': [], 'duration_s': DURATION_S, 'current.field.file': str(sea)}
    if way != PERSISTENCE:
        field = {'kind': 'grid', 'file': str(forecast)}
        used = {'field': field, 'share_std': WAYS[way]}
        changes |= {'navigation.current': 'forecast', 'navigation.forecast': used}
    return load_scenario('eddies_10d', changes)


def fly_one(task: tuple[int, float, str, float]) -> list[float]:
    """Fly a sea by its seed and rms, by a forecast of an error; how far off it came up (m)."""
    seed, rms_mps, way, error_mps = task
    with TemporaryDirectory() as folder:
        sea, forecast = Path(folder) / 'sea.nc', Path(folder) / 'forecast.nc'
        for file, off in (sea, 0.0), (forecast, error_mps):
            write_sea(EddyingSea(seed=seed, rms_mps=rms_mps, error_mps=off), file)
        _, scores = fly_scored(scenario_in(sea, forecast, way))
    return scores['navigation']['surfacing_error_m'][_SETTLED:]


def judge(rows: list[dict[str, Any]]) -> list[Check]:
    """What is asked of a forecast that weighs itself: to be no worse than the better way."""
    found = {(row['way'], row['error_mps']): row for row in rows}
    checks = []
    for error in ERRORS:
        for name, words in ('p50_m', 'median'), ('p90_m', '90th percentile'):
            others = found[PERSISTENCE, 0.0], found['whole forecast', error]
            least = min(row[name] for row in others)
            share = found['its share', error][name] / least
            what = f'{words} by a forecast off by {error} m/s, over the better of the others'
            checks.append(Check(what, share, LIMIT, share <= LIMIT))
    return checks


def experiment(seed: int) -> Experiment:
    """The seas of a seed, reckoned through in all ways."""

    def rows(found: dict[tuple, list[float]]) -> tuple[list[dict], dict]:
        table = []
        for way, error in CASES:
            off = np.concatenate(
                [misses for key, misses in found.items() if key[1:] == (way, error)]
            )
            p50, p90 = np.quantile(off, (0.5, 0.9)).tolist()
            figures = {'surfacings': len(off), 'p50_m': p50, 'p90_m': p90}
            table.append({'way': way, 'error_mps': error, **figures})
        return table, {}

    seas = enumerate(SIZES, FIRST + len(SIZES) * seed)
    tasks = {(sea, *case): (sea, rms, *case) for sea, rms in seas for case in CASES}
    loops = [load_scenario('eddies_10d', {'orders': []})]
    return make_study(NAME, seed, judge=judge, fly=fly_one, tasks=tasks, loops=loops, rows=rows)
