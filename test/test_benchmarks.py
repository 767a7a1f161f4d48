# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""The benchmarks: their floor in C is the engine's arithmetic, and the command prints figures."""

import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from glider_bringup.mission import mission_of
from glider_bringup.scenario import load_scenario

FOLDER = Path(__file__).resolve().parents[1] / 'benchmarks'


@pytest.fixture(scope='module')
def floor():
    """Module of the floor."""
    sys.path.insert(0, str(FOLDER))
    try:
        import floor

        if not floor.compiler():
            pytest.skip('no C compiler')
        yield floor
    finally:
        sys.path.remove(str(FOLDER))


def mission(**changes):
    fields = {field.replace('__', '.'): value for field, value in changes.items()}
    return mission_of(load_scenario('current_8deg', {'dives': 0, **fields}))


@pytest.fixture(scope='module')
def library(floor):
    return floor.Floor(*mission())


@pytest.mark.parametrize(
    'changes',
    [
        {'duration_s': 6000.0},
        {'duration_s': 6000.0, 'profile__depth_m': 120.0},
        {'duration_s': 4000.0, 'profile__depth_m': 60.0, 'profile__surface_every_dives': 1},
        {'dives': 1, 'profile__depth_m': 100.0, 'profile__wait_s': 60.0},
        {'duration_s': 3000.0, 'current__angle_deg': -70.0, 'path__course_deg': 130.0},
        {'duration_s': 3000.0, 'initial__north_m': -900.0, 'initial__east_m': 300.0},
        {'duration_s': 3000.0, 'perturb__pump_rate': 0.8, 'water__pycnocline_rise': 0.002},
    ],
)
def test_floor_computes_the_bits_of_the_engine(floor, library, changes):
    state, params = mission(**changes)
    assert floor.ticks_compared(library, state, params) > 10000


def test_a_floor_with_other_arithmetic_is_refused(floor, library, monkeypatch):
    state, params = mission(duration_s=300.0)
    seconds = np.nextafter(params.guidance.lookahead_s, 0.0)
    other = params._replace(guidance=params.guidance._replace(lookahead_s=seconds))
    fly = library.fly_blocks
    monkeypatch.setattr(library, 'fly_blocks', lambda state, _: fly(state, other))
    with pytest.raises(RuntimeError, match='not the arithmetic of the engine, at tick'):
        floor.ticks_compared(library, state, params)


def bench(section: str) -> dict:
    """Figures of a section, as the command prints them."""
    done = subprocess.run(
        [sys.executable, FOLDER / 'bench.py', '--only', section, '--json'],
        capture_output=True,
        text=True,
        timeout=300,
    )
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout)


def test_bench_prints_one_object_of_figures():
    figures = bench('memory')
    assert figures['mission_30h_peak_rss_mb'] > figures['imported_rss_mb'] > 30.0


def test_storage_of_a_sweep_fits_the_memory_that_its_limit_is_for():
    figures = bench('storage')
    assert figures['result_rss_mb'] < figures['result_peak_rss_mb']
    assert figures['result_largest_peak_rss_mb'] < 600.0
    assert figures['netcdf_bytes_per_cell'] < figures['journal_bytes_per_cell']


def test_bench_of_the_command_line_sends_to_the_script(glider):
    done = glider('bench')
    assert (done.returncode, done.stdout) == (2, '')
    assert './glider' in done.stderr
