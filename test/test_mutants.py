# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""Tests notice a change: a few here, as many as one likes by ``./glider test --only mutants``."""

import ast
import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

from mutants.changes import changes, mutated

ROOT = Path(__file__).resolve().parents[1]
ALLOCATION = ROOT / 'src/glider_control/glider_control/allocation.py'
SOURCE = '''
"""A file."""
LIMIT, STEP = 2.0, 3
NAME = 'no number'


@kernel
def step(a, b):
    """Not this 5."""
    if a < b and not b:
        return -min(a, 1.5) * b
    return a if b == 0 else math.sin(a) + b


def plain(a):
    return a + 1
'''


def test_changes_are_those_of_kernels_and_their_numbers(tmp_path):
    path = tmp_path / 'made.py'
    path.write_text(SOURCE)
    found = [(one.before, one.after) for one in changes('made', path)]
    assert sorted(found) == sorted(
        [
            ('2.0', '3.0'),
            ('3', '4'),
            ('a < b and (not b)', 'a < b or not b'),
            ('a < b', 'a >= b'),
            ('not b', 'b'),
            ('-min(a, 1.5) * b', '-min(a, 1.5) / b'),
            ('-min(a, 1.5)', 'min(a, 1.5)'),
            ('min', 'max'),
            ('1.5', '2.25'),
            ('a if b == 0 else math.sin(a) + b', 'math.sin(a) + b if b == 0 else a'),
            ('b == 0', 'b != 0'),
            ('0', '1'),
            ('math.sin(a) + b', 'math.sin(a) - b'),
            ('math.sin', 'math.cos'),
        ]
    )
    plain = ast.unparse(ast.parse(SOURCE))
    made = [ast.unparse(mutated(one)) for one in changes('made', path)]
    assert plain not in made and len(set(made)) == len(made)


@pytest.fixture(scope='module')
def judge():
    """Ask a process that judges changes."""
    paths = [str(ROOT / 'test'), os.environ.get('PYTHONPATH', '')]
    trial = subprocess.Popen(
        [sys.executable, '-m', 'mutants.trial'],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
        env={**os.environ, 'NUMBA_DISABLE_JIT': '1', 'PYTHONPATH': os.pathsep.join(paths)},
        cwd=ROOT,
    )

    def ask(**asked) -> dict:
        asked['tests'] = str(ROOT / 'src/glider_control/test/test_allocation.py')
        trial.stdin.write(json.dumps(asked) + '\n')
        trial.stdin.flush()
        return json.loads(trial.stdout.readline())

    yield ask
    trial.stdin.close()
    trial.wait(30)


def test_a_sign_or_a_limit_of_the_allocation_is_noticed(judge):
    """By the tests of that file alone."""
    known = judge(change=None, fly=False)
    assert len(known['times']) > 10
    found = changes('glider_control.allocation', ALLOCATION)
    of_sign = [one for one in found if ' + ' in one.before or ' - ' in one.before]
    for one in of_sign[:2]:
        assert judge(change=one, **known) == {'by': 'tests'}, one
