# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""The benchmarks: their floor in C is the plant's arithmetic, and the command prints figures."""

import json
import sys
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from glider_mission.scenario import load_scenario

FOLDER = Path(__file__).resolve().parents[1] / 'benchmarks'


@pytest.fixture(scope='module')
def floor():
    """Module of the floor and of the plant's flight."""
    sys.path.insert(0, str(FOLDER))
    try:
        import floor

        if not floor.compiler():
            pytest.skip('no C compiler')
        yield floor
    finally:
        sys.path.remove(str(FOLDER))


def motions(way, flight):
    """Where one of the two plants goes."""
    rows = np.full((len(flight[2]), 13), np.nan)
    way(*flight, rows)
    return rows


def flight_of(floor, **changes):
    fields = {field.replace('__', '.'): value for field, value in changes.items()}
    return floor.flight_of(load_scenario('current_8deg', {'dives': 0, **fields}))


@pytest.fixture(scope='module')
def library(floor):
    return floor.Floor(*flight_of(floor, duration_s=0.1)[:2])


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
        {'duration_s': 3000.0, 'vehicle': 'seawing', 'perturb__K_p': 10.0},
        # nothing damps the roll: many ticks are several steps
        {'duration_s': 3000.0, 'profile__depth_m': 60.0, 'perturb__D_p': 0.0},
    ],
)
def test_floor_computes_the_bits_of_the_plant(floor, library, changes):
    flight = flight_of(floor, **changes)
    ways = floor.plant_steps, library.plant_steps
    assert floor.compare(*(motions(way, flight) for way in ways)) > 10000


def test_a_floor_with_other_arithmetic_is_refused(floor, library):
    state, params, *given = flight_of(floor, duration_s=300.0)
    vehicle = params.vehicle
    other = params._replace(vehicle=vehicle._replace(K_D=np.nextafter(vehicle.K_D, 0.0)))
    engine = motions(floor.plant_steps, (state, params, *given))
    in_c = motions(library.plant_steps, (state, other, *given))
    with pytest.raises(RuntimeError, match='not the arithmetic of the plant, at tick'):
        floor.compare(engine, in_c)


def test_bench_prints_one_object_of_figures(floor, monkeypatch):
    """Of shorter flights than the figures are of, which are named after 30 h."""
    import bench
    import memory

    monkeypatch.setattr(memory, 'FLIGHT_S', 20.0)
    monkeypatch.setattr(memory, '_FLY', memory._FLY.replace('108000.0', '1000.0'))
    done = CliRunner().invoke(bench.app, ['--only', 'memory', '--json'])
    assert done.exit_code == 0, done.output
    figures = json.loads(done.stdout)
    assert figures['mission_30h_peak_rss_mb'] > figures['imported_rss_mb'] > 30.0


def test_bench_of_the_command_line_sends_to_the_script(glider):
    done = glider('bench')
    assert (done.returncode, done.stdout) == (2, '')
    assert './glider' in done.stderr


@pytest.mark.parametrize('options', [[], ['--against', str(FOLDER.parent)]])
def test_bench_without_another_checkout_has_no_section_against(monkeypatch, options):
    """It was an empty table."""
    monkeypatch.syspath_prepend(str(FOLDER))
    import bench

    for name in bench.SECTIONS:
        monkeypatch.setattr(f'{name}.measure', lambda progress, **given: {'figure': 1.0})
        monkeypatch.setattr(f'{name}.MEANING', {'figure': 'what it says'})
    done = CliRunner().invoke(bench.app, options)
    assert done.exit_code == 0, done.output
    titles = [line.strip() for line in done.stdout.splitlines() if line.strip() in bench.SECTIONS]
    assert titles == list(bench.SECTIONS[: None if options else -1])


@pytest.mark.parametrize(
    ('options', 'told'),
    [
        (['--against', str(FOLDER)], 'has no file glider'),
        (['--only', 'against'], 'neither without the other'),
        (['--only', 'compute', '--against', str(FOLDER.parent)], 'neither without the other'),
    ],
)
def test_bench_beside_no_other_checkout_is_refused(monkeypatch, options, told):
    monkeypatch.syspath_prepend(str(FOLDER))
    import bench

    monkeypatch.setattr(bench, 'machine', lambda: pytest.fail('measures'))
    done = CliRunner().invoke(bench.app, options)
    output = ' '.join(done.output.replace('│', '').split())
    assert (done.exit_code, told in output) == (2, True), output
