# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""Sweep files: what their cells are, and how mistakes in them are told before anything flies."""

import sys
from decimal import Decimal

import numpy as np
import pytest
import yaml
from hypothesis import given
from hypothesis import strategies as st

from glider_base.settings import find_field, unit_of
from glider_bringup import cli
from glider_mission.changes import overlap
from glider_mission.choices import combination_of
from glider_mission.scenario import Scenario, load_scenario
from glider_studies.sweep.netcdf import make_dataset
from glider_studies.sweep.plan import (
    GridDimension,
    LogUniformDimension,
    NormalDimension,
    UniformDimension,
    load_sweep,
    sweep_names,
)

SPEED = {'kind': 'values', 'field': 'current.speed_kn', 'values': [0.5, 1.0]}


def write(folder, **changes):
    """Sweep file in a folder."""
    values = {'scenario': 'current_8deg', 'dimensions': {'speed': SPEED}, **changes}
    path = folder / 'mine.yaml'
    path.write_text(yaml.safe_dump(values, sort_keys=False), encoding='utf-8')
    return path


def plan_of(folder, **changes):
    return load_sweep(str(write(folder, **changes)))


def values_of(folder, **dimension):
    """Coordinates of a sweep with one dimension over the speed."""
    dimension = {'field': 'current.speed_kn', **dimension}
    return plan_of(folder, dimensions={'x': dimension}).axes[0].values


# ---------------------------------------------------------------------- cells


@pytest.mark.parametrize('name', sweep_names())
def test_sweeps_that_come_with_the_stack_are_valid(name):
    plan = load_sweep(name)
    assert plan.sweep.name == name
    assert plan.sweep.description
    assert plan.cells >= 2


def test_the_map_is_the_one_of_the_paper():
    plan = load_sweep('stability_map')
    assert plan.shape == (3, 31, 37)
    values = {axis.name: axis.values for axis in plan.axes}
    assert values['current_speed'] == [i / 20 for i in range(31)]
    assert values['current_angle'] == [5.0 * i for i in range(37)]
    cell = 2 * 31 * 37 + 20 * 37 + 2
    scenario = load_scenario('current_8deg', plan.changes(cell))
    assert scenario.guidance.los.method == 'los_zhang2021'
    assert (scenario.current.speed_kn, scenario.current.angle_deg) == (1.0, 10.0)
    assert (scenario.dives, scenario.duration_s) == (0, 50000.0)


def test_last_dimension_runs_fastest_and_every_combination_is_one_cell(tmp_path):
    variants = {
        'a': {'control.law': 'pid'},
        'b': {'control.law': 'adaptive', 'guidance.los.method': 'los_zhang2021'},
    }
    plan = plan_of(
        tmp_path,
        set={'dives': 0},
        dimensions={'who': {'kind': 'variants', 'variants': variants}, 'speed': SPEED},
    )
    cells = [plan.changes(cell) for cell in range(plan.cells)]
    assert cells == [
        {'dives': 0, **fields, 'current.speed_kn': speed}
        for fields in variants.values()
        for speed in (0.5, 1.0)
    ]
    assert plan.coordinates(2) == {'who': 'b', 'speed': 0.5}


def test_seeds_that_no_float_holds_keep_their_digits_in_the_result(tmp_path):
    seeds = [2**53, 2**53 + 1]
    dimensions = {'seed': {'kind': 'values', 'field': 'seed', 'values': seeds}}
    found = make_dataset(plan_of(tmp_path, dimensions=dimensions), []).seed.values
    assert list(map(int, found)) == seeds


tenths = st.integers(-500, 500).map(lambda n: Decimal(n) / 10)


@given(tenths, st.integers(0, 300), st.integers(1, 40).map(lambda n: Decimal(n) / 100))
def test_grid_has_the_decimal_numbers_a_person_would_type(start, steps, step):
    stop = start + steps * step
    grid = GridDimension(
        kind='grid', field='seed', start=float(start), stop=float(stop), step=float(step)
    )
    values = [value for value, _ in grid.steps()]
    assert values == [float(start + i * step) for i in range(steps + 1)]


def test_grid_ends_before_a_stop_that_is_no_step(tmp_path):
    values = values_of(tmp_path, kind='grid', start=0.0, stop=1.0, step=0.3)
    assert values == [0.0, 0.3, 0.6, 0.9]


def test_draws_are_what_their_seed_says():
    def draw(seed, model, **how):
        dimension = model(field='seed', samples=2000, seed=seed, **how)
        return np.array([value for value, _ in dimension.steps()])

    uniform = {'model': UniformDimension, 'kind': 'uniform', 'low': 0.5, 'high': 2.0}
    normal = {'model': NormalDimension, 'kind': 'normal', 'mean': 1.25, 'std': 0.1}
    log = {'model': LogUniformDimension, 'kind': 'log_uniform', 'low': 0.02, 'high': 2.0}
    for how in (uniform, normal, log):
        assert (draw(1, **how) == draw(1, **how)).all()
        assert (draw(1, **how) != draw(2, **how)).all()
        assert (np.diff(draw(3, **how)) > 0.0).all()
    assert np.mean(draw(3, **uniform)) == pytest.approx(1.25, abs=0.05)
    assert np.min(draw(3, **uniform)) >= 0.5 and np.max(draw(3, **uniform)) <= 2.0
    assert np.mean(draw(4, **normal)) == pytest.approx(1.25, abs=0.01)
    assert np.std(draw(4, **normal)) == pytest.approx(0.1, abs=0.01)
    assert np.median(draw(5, **log)) == pytest.approx(0.2, rel=0.15)
    assert np.min(draw(5, **log)) >= 0.02 and np.max(draw(5, **log)) <= 2.0


def test_scenario_and_vehicle_are_found_beside_the_sweep(tmp_path):
    base = load_scenario('current_8deg').model_copy(update={'name': 'beside'})
    (tmp_path / 'beside.yaml').write_text(base.to_yaml(), encoding='utf-8')
    plan = plan_of(tmp_path, scenario='beside.yaml')
    assert plan.first.name == 'beside'
    assert str(tmp_path / 'beside.yaml') in plan.command(0)
    assert [name for name, _ in plan.vehicles] == ['zhang2021']


def test_every_vehicle_that_flies_is_an_input(tmp_path):
    boats = {'kind': 'values', 'field': 'vehicle', 'values': ['seawing', 'zhang2021']}
    plan = plan_of(tmp_path, dimensions={'boat': boats})
    assert [name for name, _ in plan.vehicles] == ['seawing', 'zhang2021']


def test_laws_and_methods_of_all_cells_are_known(tmp_path):
    """Their loops are compiled before workers need them."""
    laws = {'kind': 'values', 'field': 'control.law', 'values': ['pid', 'adaptive']}
    variants = {'a': {}, 'b': {'guidance.los.method': 'los_zhang2021'}}
    plan = plan_of(
        tmp_path, dimensions={'law': laws, 'los': {'kind': 'variants', 'variants': variants}}
    )
    assert set(map(combination_of, plan.loops())) == {
        (law, method, 'known', False, '')
        for law in ('pid', 'adaptive')
        for method in ('los_current', 'los_zhang2021')
    }
    (only,) = plan_of(tmp_path).loops()
    assert combination_of(only) == ('adaptive', 'los_current', 'known', False, '')


def test_vehicles_with_a_fin_have_a_loop_of_their_own(tmp_path):
    names = ['zhang2021', 'slocum_g2', 'seawing']
    vehicles = {'kind': 'values', 'field': 'vehicle', 'values': names}
    shallow = {'profile.depth_m': 150, 'profile.net_heaviness_kg': 0.2, 'initial.depth_m': 0}
    plan = plan_of(tmp_path, set=shallow, dimensions={'vehicle': vehicles})
    assert [combination_of(one).steered for one in plan.loops()] == ['', 'slocum_g2']


def test_digest_is_that_of_the_inputs(tmp_path):
    (tmp_path / 'elsewhere').mkdir()
    digest = plan_of(tmp_path).digest
    assert plan_of(tmp_path / 'elsewhere').digest == digest
    assert plan_of(tmp_path, set={'duration_s': 1000.0}).digest != digest
    assert plan_of(tmp_path, scenario='current_10deg').digest != digest
    other = {**SPEED, 'values': [0.5, 1.1]}
    assert plan_of(tmp_path, dimensions={'speed': other}).digest != digest


@pytest.mark.parametrize(
    ('field', 'unit'),
    [
        ('current.speed_kn', 'knots'),
        ('current.angle_deg', 'deg'),
        ('profile.depth_m', 'm'),
        ('control.pid.pitch_ki', 'N m/(rad s)'),
        ('perturb.K_L', '-'),
        ('dives', ''),
    ],
)
def test_unit_of_a_field_is_in_its_description(field, unit):
    assert unit_of(find_field(Scenario, field)) == unit


def test_field_that_is_not_there_is_not_found():
    assert find_field(Scenario, 'current.speed') is None
    assert find_field(Scenario, 'dives.x') is None


@pytest.mark.parametrize(
    ('field', 'other', 'same'),
    [
        ('current.speed_kn', 'current.speed_kn', True),
        ('current.speed_kn', 'current.speed_mps', True),
        ('current', 'current.speed_mps', True),
        ('current.speed_mps', 'current', True),
        ('current.speed_kn', 'current.angle_deg', False),
        ('seed', 'sensors', False),
    ],
)
def test_fields_that_undo_each_other(field, other, same):
    assert overlap(field, other) is overlap(other, field) is same


# ---------------------------------------------------------------------- mistakes


def one(**dimension):
    return {'dimensions': {'x': dimension}}


MISTAKES = {
    'unknown field of the scenario': (
        one(kind='values', field='current.spede_kn', values=[1]),
        ['dimensions.x: 1', 'current.spede_kn = 1', 'unknown field', 'speed_kn'],
    ),
    'unknown field that is set': ({'set': {'dive': 1}}, ['dive = 1', 'unknown field', 'dives']),
    'value out of range, not the first': (
        one(kind='values', field='current.speed_kn', values=[1.0, 7.0]),
        ['dimensions.x: 7.0', 'current.speed_kn = 7.0', '<= 5.8'],
    ),
    'drawn value out of range': (
        one(kind='normal', field='current.speed_kn', mean=0.0, std=1.0, samples=50, seed=0),
        ['dimensions.x: -', 'current.speed_kn = -', '>= 0'],
    ),
    'unknown field of the sweep': ({'dimension': {}}, ['dimension', 'unknown field']),
    'no dimension': ({'dimensions': {}}, ['dimensions']),
    'empty dimension': (one(kind='values', field='seed', values=[]), ['dimensions.x.values = []']),
    'no variant': (one(kind='variants', variants={}), ['dimensions.x.variants']),
    'unknown kind': (one(kind='list', field='seed'), ["x.kind = 'list'", 'grid', 'log_uniform']),
    'no kind': (one(field='seed', values=[1]), ['x.kind', 'missing']),
    'not a number': (
        one(kind='values', field='current.speed_kn', values=[float('nan')]),
        ['dimensions.x.values', 'nan'],
    ),
    'given twice': (one(kind='values', field='seed', values=[1, 2, 1]), ['given twice: 1']),
    'called like a field': (
        {'dimensions': {'seed': {'kind': 'values', 'field': 'seed', 'values': [1, 1]}}},
        ['dimensions.seed.values = [1, 1]'],
    ),
    'called like a kind': (
        {'dimensions': {'grid': {'kind': 'values', 'field': 'seed', 'values': [1, 1]}}},
        ['dimensions.grid.values = [1, 1]'],
    ),
    'of two kinds': (one(kind='values', field='seed', values=[1, 'a']), ['numbers and text']),
    'grid backwards': (
        one(kind='grid', field='seed', start=2, stop=1, step=1),
        ['stop = 1.0 lies before start = 2.0'],
    ),
    'grid without end': (
        one(kind='grid', field='seed', start=0, stop=1e9, step=1e-9),
        ['more than 10000 values'],
    ),
    'grid that does not move': (
        one(kind='grid', field='seed', start=0, stop=1, step=0),
        ['step = 0', '> 0'],
    ),
    'logarithm of zero': (
        one(kind='log_uniform', field='settle_s', low=0, high=1, samples=3, seed=0),
        ['low = 0', '> 0'],
    ),
    'name with a space': (
        {'dimensions': {'my x': SPEED}},
        ['dimensions.my x', 'letters, digits and _'],
    ),
    'one field in two dimensions': (
        {'dimensions': {'a': SPEED, 'b': {**SPEED, 'field': 'current.speed_mps'}}},
        ['dimensions.b', 'current.speed_mps is set by dimensions.a', 'each field in one place'],
    ),
    'one field set and in a dimension': (
        {'set': {'current.speed_kn': 1.0}},
        ['dimensions.speed', 'is set by set too'],
    ),
    'ten million cells': (
        {
            'dimensions': {
                name: {'kind': 'grid', 'field': field, 'start': 0, 'stop': 999, 'step': step}
                for name, field, step in (
                    ('a', 'seed', 1), ('b', 'initial.north_m', 1), ('c', 'initial.east_m', 111)
                )
            }
        },
        ['1000 x 1000 x 10 = 10000000 cells', '<= 500000'],
    ),
    'a dimension that a result has': (
        {'dimensions': {'status': SPEED}},
        ['dimensions.status', 'a result has'],
    ),
    'unknown scenario': ({'scenario': 'nowhere'}, ["scenario = 'nowhere'", 'current_8deg']),
}  # fmt: skip


@pytest.mark.parametrize('case', MISTAKES)
def test_mistake_is_told_before_anything_is_written(case, tmp_path, monkeypatch, capsys):
    """Called in this process, where anything but a message would be an exception."""
    changes, words = MISTAKES[case]
    path = write(tmp_path, **changes)
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, 'argv', ['glider', 'sweep', str(path)])
    assert cli.main() == 2
    printed = capsys.readouterr()
    assert printed.out == ''
    for word in [str(path), *words]:
        assert word in printed.err
    assert list(tmp_path.iterdir()) == [path], 'nothing is left behind'


@pytest.mark.parametrize(
    ('options', 'words'),
    [
        (['nowhere'], ["sweep = 'nowhere'", 'small', 'stability_map']),
        (['nowhere.yaml'], ['nowhere.yaml', 'no such sweep file']),
        (['small', '--resume'], ['--resume', 'journal.jsonl']),
        (['small', '--out', '/dev/null'], ['--out /dev/null']),
        (['small', '--out', '/proc/nowhere'], ['--out /proc/nowhere']),
    ],
)
def test_wrong_options_are_refused(options, words, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, 'argv', ['glider', 'sweep', *options])
    assert cli.main() == 2
    printed = capsys.readouterr()
    assert printed.out == ''
    for word in words:
        assert word in printed.err
    assert list(tmp_path.iterdir()) == [], 'nothing is left behind'


def test_folder_with_something_else_in_it_is_refused(tmp_path, monkeypatch, capsys):
    (tmp_path / 'thesis.txt').write_text('years of work')
    monkeypatch.setattr(sys, 'argv', ['glider', 'sweep', 'small', '--out', str(tmp_path)])
    assert cli.main() == 2
    assert 'not empty' in capsys.readouterr().err
