# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""Sweeps as a person flies them: the same file whatever happens on the way."""

import json
import logging
import math
import os
import random
import shlex
import signal
import sys
import time
import tracemalloc
from contextlib import contextmanager
from functools import partial
from importlib import import_module
from types import SimpleNamespace

import numpy as np
import pytest
import xarray
import yaml
from scipy.io import netcdf_file

import command_line
from glider_bringup import cli
from glider_bringup.door.netcdf import write_dataset
from glider_mission.scenario import load_scenario
from glider_studies import workers as pool
from glider_studies.sweep import plan as sweep_file
from glider_studies.sweep.fly import (
    JOURNAL_FILE,
    RESULT_FILE,
    STATUSES,
    failure,
    fly_chunk,
    judge,
    make_chunks,
    write_result,
)
from glider_studies.sweep.journal import Journal
from glider_studies.sweep.netcdf import make_dataset
from glider_studies.sweep.plan import load_sweep
from glider_studies.workers import WorkError, worker_pool

#: Longer than any command here takes (s), the compilation of all kernels included.
DEADLINE_S = 300.0
#: What a scorecard has that is not a result of the flight.
NOT_COMPARED = {'wall_time_s', 'real_time_factor', 'messages_recorded', 'messages_lost', 'seed'}
NOT_COMPARED |= {'guard', 'no_progress', 'faults'}  # what happened, in words
NOT_COMPARED |= {'wh_per_dive', 'by', 'endurance_days', 'range_km'}  # follow from what is kept
#: Variants, a vector field, text in another alphabet, and one cell in which nothing can be flown.
MINE = {
    'name': 'mine',
    'description': 'Strömung [/red]',
    'scenario': 'current_8deg',
    'set': {'dives': 0, 'settle_s': 60.0, 'profile.depth_m': 300.0, 'duration_s': 6000.0},
    'dimensions': {
        'who': {
            'kind': 'variants',
            'variants': {
                'adaptive': {'control.law': 'adaptive'},
                'pid': {'control.law': 'pid', 'vehicle': 'seawing'},
            },
        },
        'angle': {'kind': 'values', 'field': 'current.angle_deg', 'values': [0, 30, 80]},
        'end': {'kind': 'values', 'field': 'initial.depth_m', 'values': [0.1, 30.0]},
    },
}


glider = partial(command_line.glider, columns=200, timeout=DEADLINE_S)


@contextmanager
def started(folder, *arguments, module='glider_bringup.cli'):
    """A process that is killed at the end; what it prints lies in a folder."""
    folder.mkdir()
    env = {**os.environ, 'COLUMNS': '200', 'PYTHONUTF8': '1'}
    process = command_line.Started(arguments, env, folder, module)
    try:
        yield process
    finally:
        process.kill()


def wait_for(what, process):
    """Wait until something is so, while a process runs."""
    end = time.monotonic() + DEADLINE_S
    while not what():
        assert time.monotonic() < end and process.poll() is None, process.poll()
        time.sleep(0.02)


def lines(path):
    return path.read_bytes().count(b'\n') if path.exists() else 0


@pytest.fixture(scope='module')
def flown(tmp_path_factory):
    """A sweep by two workers: its file, folder, and what --json printed."""
    folder = tmp_path_factory.mktemp('sweep')
    file = folder / 'mine.yaml'
    file.write_text(yaml.safe_dump(MINE, sort_keys=False, allow_unicode=True), encoding='utf-8')
    done = glider('sweep', file, '--workers', 2, '--out', folder / 'out', '--json')
    assert done.returncode == 0, done.stderr
    return SimpleNamespace(file=file, out=folder / 'out', summary=json.loads(done.stdout))


@pytest.fixture(scope='module')
def result(flown):
    return (flown.out / RESULT_FILE).read_bytes()


# ---------------------------------------------------------------------- numbers


def numbers(card, before=''):
    """Numbers of a scorecard by the names that a result gives them."""
    for name, value in card.items():
        if name in NOT_COMPARED:
            continue
        if isinstance(value, dict):
            yield from numbers(value, f'{before}{name}_')
        elif isinstance(value, list) and before == 'navigation_':
            continue  # one of each surfacing
        elif not isinstance(value, str):
            yield before + name, value


@pytest.mark.parametrize('cell', [1, 10])
def test_cell_has_the_numbers_of_its_own_run(flown, cell, tmp_path):
    """Every number that ``./glider run`` prints, to the last bit, and no number more."""
    words = shlex.split(load_sweep(str(flown.file)).command(cell))
    assert words[:2] == ['./glider', 'run']
    done = glider(*words[1:], '--json', '--out', tmp_path / 'run')
    assert done.returncode == 0, done.stderr
    card = json.loads(done.stdout)
    with xarray.load_dataset(flown.out / RESULT_FILE) as data:
        who, angle, end = np.unravel_index(cell, (2, 3, 2))
        place = data.isel(who=who, angle=angle, end=end)
        assert STATUSES[int(place['status'])] == card['status']
        expected = dict(numbers(card))
        assert set(expected) == set(data.data_vars) - {'status', 'reason'}
        for name, value in expected.items():
            wanted = np.array(value if value is not None else math.nan, dtype=float)
            assert place[name].values.tobytes() == wanted.tobytes(), name


def test_summary_tells_how_the_cells_ended(flown):
    summary = flown.summary
    assert summary['cells'] == 12
    assert summary['completed'] + summary['infeasible'] == 12
    assert summary['infeasible'] > 0, 'a current of 1.0 kn at 80 deg cannot be held'
    assert summary['failures'] == []
    assert summary['file'] == str(flown.out / RESULT_FILE)


def test_file_tells_what_it_is_and_what_made_it(flown):
    plan = load_sweep(str(flown.file))
    with xarray.load_dataset(flown.out / RESULT_FILE) as data:
        assert data.attrs['sweep_yaml'] == flown.file.read_text(encoding='utf-8')
        assert data.attrs['title'] == MINE['description']
        assert yaml.safe_load(data.attrs['scenario_yaml'])['profile']['depth_m'] == 300.0
        assert [data.attrs['vehicle_yaml'], data.attrs['vehicle_seawing_yaml']] == [
            text for _, text in plan.vehicles
        ]
        assert data['angle'].attrs['units'] == 'degree'
        assert data['end'].attrs['units'] == 'm'
        assert data['angle'].attrs['scenario_field'] == 'current.angle_deg'
        assert list(data['who'].values) == ['adaptive', 'pid']
        assert list(data['angle'].values) == [0.0, 30.0, 80.0]
        for name in data.data_vars:
            assert data[name].attrs['long_name']
            assert name in ('status', 'reason') or data[name].attrs['units']
        assert data['cross_track_m_max_steady'].attrs['units'] == 'm'
        assert data['actuator_travel_roll_mass_deg'].attrs['units'] == 'degree'
        assert data['final_state_velocity_mps'].attrs['units'] == 'm/s'
        held = data['cross_track_m_max_all'].sel(who='adaptive', angle=30.0, end=0.1)
        lost = data['cross_track_m_max_all'].sel(who='adaptive', angle=80.0, end=0.1)
        assert held < lost


def test_file_opens_without_xarray(flown):
    with netcdf_file(flown.out / RESULT_FILE, mmap=False) as file:
        assert file.variables['depth_m_max'].shape == (2, 3, 2)
        assert file.variables['depth_m_max'].units == b'm'
        assert file.variables['status'].flag_meanings == ' '.join(STATUSES).encode()


# ---------------------------------------------------------------------- interruptions


def test_interrupted_and_half_a_line_later_the_file_is_the_same(flown, result, tmp_path):
    out = tmp_path / 'out'
    words = 'sweep', flown.file, '--workers', 1, '--out', out
    with started(tmp_path / 'first', *words) as process:
        wait_for(lambda: lines(out / JOURNAL_FILE) > 1, process)
        process.send_signal(signal.SIGINT)
        printed, error = process.communicate(timeout=DEADLINE_S)
    kept = lines(out / JOURNAL_FILE) - 1
    assert 1 <= kept < 12, 'interrupted in the middle'
    assert (process.returncode, printed) == (130, '')
    assert 'stopped by SIGINT' in error and 'Traceback' not in error
    assert f'{kept} of 12 cells are kept' in error
    again = error[error.index('./glider') :].split('\n')[0]
    assert not (out / RESULT_FILE).exists()

    journal = (out / JOURNAL_FILE).read_bytes()
    (out / JOURNAL_FILE).write_bytes(journal[:-30])
    done = glider(*shlex.split(again)[1:], '--workers', 2, '--json')
    assert done.returncode == 0, done.stderr
    assert (out / RESULT_FILE).read_bytes() == result
    before = (out / JOURNAL_FILE).read_bytes()
    whole = journal[: journal[:-30].rindex(b'\n') + 1]
    assert before.startswith(whole), 'what was flown is not flown again'
    assert before.count(b'\n') == 13


@contextmanager
def cluster(folder):
    """A Dask scheduler and two workers, started by hand; yields address and workers."""
    dask, file = partial(started, module='dask'), folder / 'scheduler.json'
    options = ['--scheduler-file', file, '--host', '127.0.0.1']
    here = [*options, '--port', 0, '--dashboard-address', '127.0.0.1:0']
    with dask(folder / 'scheduler', 'scheduler', *here) as scheduler:
        wait_for(lambda: file.exists() and file.read_text().endswith('}'), scheduler)
        worker = ['worker', *options, '--nthreads', 1, '--no-dashboard', '--no-nanny']
        worker += ['--local-directory', folder]
        with (
            dask(folder / 'first', *worker) as first,
            dask(folder / 'second', *worker) as second,
        ):
            yield json.loads(file.read_text())['address'], [first, second]


def test_worker_of_a_cluster_is_killed_and_the_file_is_the_same(flown, result, tmp_path):
    out = tmp_path / 'out'
    with cluster(tmp_path) as (address, workers):
        words = 'sweep', flown.file, '--scheduler', address, '--out', out
        with started(tmp_path / 'command', *words) as process:
            wait_for(lambda: lines(out / JOURNAL_FILE) > 1, process)
            workers[0].kill()
            assert lines(out / JOURNAL_FILE) < 13, 'killed in the middle'
            _, error = process.communicate(timeout=DEADLINE_S)
    assert process.returncode == 0, error
    assert (out / RESULT_FILE).read_bytes() == result


def test_task_that_kills_its_workers_is_given_up_and_the_others_are_done():
    def fly(task):
        for number in task:
            if number == 3:
                os.kill(os.getpid(), signal.SIGKILL)
        return sum(task)

    with worker_pool(2) as workers:
        tasks = [[i, i + 10] for i in range(6)]
        outcomes = list(workers.outcomes(fly, tasks, lambda task: [[one] for one in task]))
    assert [outcome.task for outcome in outcomes if outcome.died] == [[3]]
    done = {tuple(outcome.task): outcome.result for outcome in outcomes if not outcome.died}
    assert sum(done.values()) == sum(sum(task) for task in tasks) - 3
    assert all(result == sum(task) for task, result in done.items())


def test_what_dask_logs_in_a_worker_is_not_for_the_person():
    def heard(name):
        return logging.getLogger(name).isEnabledFor(logging.WARNING)

    names = 'distributed.worker.state_machine', 'distributed.nanny', 'tornado.application'
    with worker_pool(1) as workers:
        assert [outcome.result for outcome in workers.outcomes(heard, names)] == [False] * 3


def test_no_scheduler_at_the_address(tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(pool, 'CONNECT_S', 0.5)
    arguments = ['small', '--scheduler', 'tcp://127.0.0.1:9', '--out', str(tmp_path / 'out')]
    monkeypatch.setattr(sys, 'argv', ['glider', 'sweep', *arguments])
    assert cli.main() == 2
    assert '--scheduler tcp://127.0.0.1:9: no Dask scheduler answers' in capsys.readouterr().err


def test_worker_with_another_program_is_refused():
    work = pool.dumps((abs, -1))
    assert pool._call(pool.source_digest(), work) == 1
    with pytest.raises(WorkError, match='another version of the program'):
        pool._call('another', work)


def test_cluster_that_lacks_a_package_is_refused(tmp_path, monkeypatch):
    """Its scheduler need not know the classes of what it hands on."""
    (tmp_path / 'stranger.py').write_text('class Task:\n    pass\n')
    with monkeypatch.context() as here:
        here.syspath_prepend(tmp_path)
        task = import_module('stranger').Task()
    monkeypatch.setattr(pool, 'source_digest', lambda: 'with stranger')
    with cluster(tmp_path) as (address, _), worker_pool(scheduler=address) as workers:
        with pytest.raises(WorkError, match='another version of the program'):
            workers.results(repr, {0: task}, lambda done: None)


def test_worker_with_another_vehicle_file_is_refused(flown):
    chunk = next(make_chunks(load_sweep(str(flown.file)), bytearray(12), 2))
    with pytest.raises(WorkError, match='another file of zhang2021'):
        fly_chunk(chunk._replace(vehicles=frozenset()))


# ---------------------------------------------------------------------- resuming


@pytest.mark.parametrize(
    ('change', 'words'),
    [
        (lambda path: path.write_text(path.read_text().replace('6000', '6001')), ['inputs']),
        (lambda path: path.write_text(path.read_text() + '# a remark\n'), ['inputs']),
        (lambda path: path.write_text(path.read_text().replace('name: mine', 'name: x')), 'sweep'),
    ],
)
def test_changed_sweep_does_not_resume(flown, change, words, tmp_path, monkeypatch, capsys):
    (tmp_path / 'out').mkdir()
    journal = (flown.out / JOURNAL_FILE).read_bytes()
    (tmp_path / 'out' / JOURNAL_FILE).write_bytes(journal)
    path = tmp_path / 'mine.yaml'
    path.write_text(flown.file.read_text())
    change(path)
    arguments = ['sweep', str(path), '--out', str(tmp_path / 'out'), '--resume']
    monkeypatch.setattr(sys, 'argv', ['glider', *arguments])
    assert cli.main() == 2
    printed = capsys.readouterr().err
    assert 'belongs to another sweep' in printed
    assert all(word in printed for word in words)
    assert (tmp_path / 'out' / JOURNAL_FILE).read_bytes() == journal
    assert list((tmp_path / 'out').iterdir()) == [tmp_path / 'out' / JOURNAL_FILE]


def test_a_sweep_is_another_one_with_another_file_in_any_of_its_cells(tmp_path):
    path = tmp_path / 'waters.yaml'
    path.write_text(
        'scenario: current_8deg\n'
        'dimensions:\n'
        '  water:\n'
        '    kind: variants\n'
        '    variants:\n'
        f'      a: {{water.profile: {tmp_path}/a.csv}}\n'
        f'      b: {{water.profile: {tmp_path}/b.csv}}\n'
    )
    digests = set()
    for density in (1027.0, 1027.5):
        for name, below in (('a', 1027.0), ('b', density)):
            rows = f'depth_m,density_kgpm3\n0,1025\n1000,{below}\n'
            (tmp_path / f'{name}.csv').write_text(rows)
        digests.add(load_sweep(str(path)).digest)
    assert len(digests) == 2


def test_sweep_that_is_complete_is_not_flown_again(flown, result, monkeypatch, capsys):
    arguments = ['sweep', str(flown.file), '--out', str(flown.out), '--resume', '--json']
    monkeypatch.setattr(sys, 'argv', ['glider', *arguments])
    (flown.out / RESULT_FILE).unlink()
    assert cli.main() == 0
    assert json.loads(capsys.readouterr().out) == flown.summary
    assert (flown.out / RESULT_FILE).read_bytes() == result
    monkeypatch.setattr(sys, 'argv', ['glider', *arguments[:-2]])
    assert cli.main() == 2
    assert '--resume' in capsys.readouterr().err


# ---------------------------------------------------------------------- failures


def card(**changes):
    good = {
        'scenario': 'mine',
        'status': 'completed',
        'reason': '',
        'seed': 7,
        'wall_time_s': 1.0,
        'dives': 2,
        'cross_track_m': {'max_steady': None, 'max_all': 3.0},
        'final_state': {'position_ned_m': [1.0, 2.0, 3.0]},
    }
    return {**good, **changes}


def test_record_of_a_flight():
    assert judge(card()) == {
        'status': 'completed',
        'reason': '',
        'figures': {
            'dives': 2,
            'cross_track_m.max_steady': None,
            'cross_track_m.max_all': 3.0,
            'final_state.position_ned_m': [1.0, 2.0, 3.0],
        },
    }
    assert judge(card(status='infeasible'))['status'] == 'infeasible'


@pytest.mark.parametrize(
    ('change', 'reason'),
    [
        ({'cross_track_m': {'max_all': math.nan}}, 'not finite: cross_track_m.max_all'),
        (
            {'final_state': {'position_ned_m': [1.0, -math.inf, 3.0]}},
            'not finite: final_state.position_ned_m',
        ),
        ({'status': 'aborted', 'reason': 'stopped'}, 'aborted: stopped'),
    ],
)
def test_flight_that_went_wrong_is_a_failure_with_a_reason(change, reason):
    judged = judge(card(**change))
    assert (judged['status'], judged['reason']) == ('failed', reason)


def test_cell_that_cannot_be_flown_does_not_stop_the_others(flown):
    """Values that are good one by one may not go together: that is found in flight."""
    chunk = next(make_chunks(load_sweep(str(flown.file)), bytearray(12), 2))
    short = {'duration_s': 20.0}
    cells = [(0, short), (1, {'initial.depth_m': -5.0}), (2, {**short, 'seed': 3})]
    records = fly_chunk(chunk._replace(cells=cells))
    assert [(one['cell'], one['status']) for one in records] == [
        (0, 'completed'),
        (1, 'failed'),
        (2, 'completed'),
    ]
    assert 'initial.depth_m = -5.0' in records[1]['reason']
    assert records[1]['reason'].startswith('current_8deg.yaml'), 'no folder of this machine'


def test_file_does_not_depend_on_the_order_and_tells_of_failures(flown, tmp_path):
    plan = load_sweep(str(flown.file))
    with Journal(
        flown.out / JOURNAL_FILE, json.loads((flown.out / JOURNAL_FILE).open().readline()), True
    ) as journal:
        records = list(journal.records())
    records[3] = {'cell': records[3]['cell'], **failure('käputt')}
    files = []
    for seed in range(3):
        random.Random(seed).shuffle(records)
        write_dataset(make_dataset(plan, records), tmp_path / f'{seed}.nc')
        files.append((tmp_path / f'{seed}.nc').read_bytes())
    assert files[0] == files[1] == files[2]
    with xarray.load_dataset(tmp_path / '0.nc') as data:
        failed = data['status'] == STATUSES.index('failed')
        assert int(failed.sum()) == 1
        assert str(data['reason'].where(failed, drop=True).values.item()) == 'käputt'
        assert np.isnan(data['depth_m_max'].where(failed, drop=True)).all()
        assert (data['reason'].values == '').sum() == 11


def test_sweep_in_which_every_cell_failed_has_a_file(flown, tmp_path):
    plan = load_sweep(str(flown.file))
    records = [{'cell': cell, **failure('broken')} for cell in range(plan.cells)]
    journal = SimpleNamespace(records=lambda: records)
    summary = write_result(plan, journal, tmp_path / RESULT_FILE)
    assert (summary['failed'], summary['completed']) == (12, 0)
    with xarray.load_dataset(tmp_path / RESULT_FILE) as data:
        assert (data['reason'].values == 'broken').all()


def test_result_of_the_largest_sweep_fits_into_memory(flown, tmp_path):
    """500,000 cells in 400 MB beside what Python takes; memory grows evenly with the cells."""
    path = tmp_path / 'large.yaml'
    values = {'kind': 'grid', 'start': 0, 'step': 1}
    dimensions = {
        'a': {**values, 'field': 'initial.north_m', 'stop': 99},
        'b': {**values, 'field': 'initial.east_m', 'stop': 99},
    }
    path.write_text(yaml.safe_dump({'dimensions': dimensions}))
    plan, journal = load_sweep(str(path)), flown.out / JOURNAL_FILE
    with Journal(journal, json.loads(journal.open().readline()), True) as lines:
        record = json.dumps(next(iter(lines.records())))
    cells = ({**json.loads(record), 'cell': cell} for cell in range(plan.cells))
    tracemalloc.start()
    try:
        write_result(plan, SimpleNamespace(records=lambda: cells), tmp_path / RESULT_FILE)
        peak_mb = tracemalloc.get_traced_memory()[1] / 1e6
    finally:
        tracemalloc.stop()
    assert peak_mb * sweep_file.MAX_CELLS / plan.cells < 400.0
    assert (tmp_path / RESULT_FILE).stat().st_size < len(record) * plan.cells


def test_largest_sweep_is_planned_as_it_is_flown(tmp_path, monkeypatch):
    """Chunks are made as they are needed, not all of them at the start."""
    values = {'kind': 'grid', 'start': 0, 'step': 1}
    path = tmp_path / 'large.yaml'
    dimensions = {
        'a': {**values, 'field': 'initial.north_m', 'stop': 499},
        'b': {**values, 'field': 'initial.east_m', 'stop': 999},
    }
    path.write_text(yaml.safe_dump({'dimensions': dimensions}))
    monkeypatch.setattr(sweep_file.Plan, 'along', lambda plan, number: [load_scenario()])
    plan = load_sweep(str(path))
    assert plan.cells == sweep_file.MAX_CELLS
    chunks = make_chunks(plan, bytearray(plan.cells), 2)
    first = next(chunks)
    assert [cell for cell, _ in first.cells] == list(range(len(first.cells)))
    known = bytearray(b'\1') * plan.cells
    known[487_654] = 0
    (chunk,) = make_chunks(plan, known, 2)
    assert chunk.cells == [(487_654, {'initial.north_m': 487.0, 'initial.east_m': 654.0})]
