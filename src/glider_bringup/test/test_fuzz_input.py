# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""``./glider test --only fuzz --door files --door lines``, in little."""

import json
import random

import pytest
from typer.testing import CliRunner

from fuzzing import files, lines, watch
from fuzzing.__main__ import app
from fuzzing.counts import Counter, Counts
from glider_base.errors import ConfigurationError


@pytest.fixture
def counter() -> Counter:
    """Counts, at which nobody looks meanwhile."""
    return Counter(lambda tried: None)


def test_mutated_files_do_no_harm(counter):
    files.fuzz(7, 60, counter)
    assert counter.result() == Counts(60, 0, 0, 0)


def test_hostile_command_lines_do_no_harm(counter):
    lines.fuzz(7, 12, counter)
    assert counter.result() == Counts(12, 0, 0, 0)


def test_ctrl_c_prints_what_was_counted(monkeypatch):
    def fuzz(seed, count, counter):
        counter.add('one')
        counter.add('another', 'wrong', 'it was')
        raise KeyboardInterrupt

    monkeypatch.setattr(files, 'fuzz', fuzz)
    done = CliRunner().invoke(app, ['--door', 'files', '--door', 'lines', '--json'])
    assert done.exit_code == 130
    (found,) = json.loads(done.stdout).items()
    wrong = {'wrong': 1, 'examples': ['wrong: another: it was']}
    assert found == ('files', {'tried': 2, 'tracebacks': 0, 'hangs': 0, **wrong})


def test_shipped_files_are_good():
    assert all(source.door(file) for source, file in shipped())


def shipped():
    """Every source that is a file, with its file."""
    for source in files._sources():
        if source.kind != 'table':
            finders = {'scenario': files.scenario_path, 'vehicle': files.vehicle_path}
            find = finders.get(source.kind, lambda name: files.SWEEP_FOLDER / f'{name}.yaml')
            yield source, find(source.name.removesuffix('.yaml'))


def test_the_same_seed_makes_the_same_cases():
    data = files._sources()[0].data
    one, again, other = (
        [files.mutate(data, random.Random(f'{seed} {i}')) for i in range(20)] for seed in (1, 1, 2)
    )
    assert one == again
    assert one != other
    words = [lines.command_line(random.Random(f'{seed} 3')) for seed in (1, 1, 2)]
    assert words[0] == words[1] != words[2]


@pytest.mark.parametrize(
    ('answer', 'outcome', 'why'),
    [
        (lambda: True, '', ''),
        (lambda: False, 'wrong', 'not finite'),
        (lambda: told('x: 1'), '', ''),
        (lambda: {}['x'], 'tracebacks', 'KeyError'),
        (lambda: forever(), 'hangs', 'no answer'),
    ],
)
def test_outcomes_are_told_apart(tmp_path, monkeypatch, answer, outcome, why):
    monkeypatch.setattr(watch, 'HANG_S', 0.2)
    source = files._Source('vehicle', 'x.yaml', b'', lambda file: answer())
    found = watch.outcome_of(lambda: files._case(source, b'', tmp_path))
    assert found[0] == outcome
    assert why in found[1]


def told(text: str) -> bool:
    raise ConfigurationError(text)


def forever() -> bool:
    while True:
        pass


@pytest.mark.parametrize(('text', 'bad'), [('a\nb', False), ('\x1b', True), ('x' * 20_001, True)])
def test_error_has_to_be_short_and_printable(text, bad):
    assert bool(watch.badly_told(text)) is bad
