# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""The yo of slocum_shelf above bottoms that nobody tuned on: with a clearance, and without."""

from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

from glider_bringup.scoring.card import fly_scored
from glider_guard.witness import AFLOAT_M
from glider_mission.scenario import load_scenario
from glider_studies.paper.experiments import Experiment, make_study
from glider_studies.paper.judges import Check

NAME = 'bottoms'
#: How many bottoms, and the first of them; hills of each at most.
COUNT, FIRST, HILLS = 200, 3000, 8
CLEARANCE, WITHOUT = 'clearance of 10 m', 'without'
WAYS: dict[str, dict[str, Any]] = {CLEARANCE: {'profile.clearance_m': 10.0}, WITHOUT: {}}
#: Dives of a mission, which lead 3 to 10 km north; the hills stand there.
DIVES = 8
#: Corners of the chart (deg), as far apart as those of GEBCO; the mission goes north from 36, 122.
_LATITUDES = np.arange(35.95, 36.25, 1.0 / 240.0)
_LONGITUDES = np.arange(121.9, 122.1, 1.0 / 240.0)


def write_bottom(seed: int, path: Path) -> None:
    """Write a chart as GEBCO does: a plain at 120 to 300 m, and hills up to 50 m below the top."""
    import xarray

    draw = np.random.default_rng(seed)
    plain = draw.uniform(120.0, 300.0)
    depth = np.full((len(_LATITUDES), len(_LONGITUDES)), plain)
    for _ in range(draw.integers(1, HILLS + 1)):
        north, east = draw.uniform(36.0, 36.08), draw.uniform(121.98, 122.02)
        away = np.hypot(_LATITUDES[:, None] - north, 0.8 * (_LONGITUDES - east))
        height, size = draw.uniform(20.0, plain - 50.0), draw.uniform(0.005, 0.03)
        depth -= height * np.exp(-((away / size) ** 2))
    axes = {'lat': ('latitude', 'north', _LATITUDES), 'lon': ('longitude', 'east', _LONGITUDES)}
    coords = {
        name: (name, values, {'standard_name': standard, 'units': f'degrees_{side}'})
        for name, (standard, side, values) in axes.items()
    }
    attrs = {'standard_name': 'height_above_mean_sea_level', 'units': 'm'}
    heights = -np.maximum(depth, 50.0).round().astype(np.int16)
    data = xarray.Dataset({'elevation': (tuple(axes), heights, attrs)}, coords)
    data.to_netcdf(path, engine='scipy')


def fly_one(task: tuple[int, str]) -> dict[str, Any]:
    """Fly over a bottom by its seed, in a worker."""
    seed, way = task
    with TemporaryDirectory() as folder:
        chart = Path(folder) / 'bottom.nc'
        write_bottom(seed, chart)
        changes = {'dives': DIVES, 'bathymetry.file': str(chart), **WAYS[way]}
        _, scores = fly_scored(load_scenario('slocum_shelf', changes))
    bottom, place = scores['bottom'], scores['final_state']['position_ned_m']
    return {
        'touched': bottom['touched'],
        'least_m': bottom['least_height_m'],
        'noticed': bool(scores['guard']['events']),
        'came_up': place[2] <= AFLOAT_M,
        'completed': scores['status'] == 'completed',
    }


def judge(rows: list[dict[str, Any]]) -> list[Check]:
    """What is asked of the two ways."""
    turned, without = rows
    stayed = without['touched'] - without['came_up']
    return [
        Check('touched the bottom with a clearance', turned['touched'], 0, not turned['touched']),
        Check('touched it without, and did not come up', stayed, 0, not stayed),
        Check('touched it without, at least', without['touched'], 20, without['touched'] >= 20),
    ]


def experiment(seed: int) -> Experiment:
    """The bottoms of a seed, in both ways."""

    def rows(found: dict[tuple[int, str], dict]) -> tuple[list[dict], dict]:
        table = []
        for way in WAYS:
            flown = [one for key, one in found.items() if key[1] == way]
            hit, heights = [one for one in flown if one['touched']], [x['least_m'] for x in flown]
            table.append(
                {
                    'way': way,
                    'bottoms': len(flown),
                    'touched': len(hit),
                    'noticed': sum(one['noticed'] for one in hit),
                    'came_up': sum(one['came_up'] for one in hit),
                    'completed': sum(one['completed'] for one in flown),
                    'least_m': min(heights),
                    'p50_m': float(np.median(heights)),
                }
            )
        return table, {}

    first = FIRST + COUNT * seed
    tasks = {(one, way): (one, way) for one in range(first, first + COUNT) for way in WAYS}
    loops = [load_scenario('slocum_shelf')]
    return make_study(NAME, seed, judge=judge, fly=fly_one, tasks=tasks, loops=loops, rows=rows)
