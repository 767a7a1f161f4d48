# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""Compiling: whoever waits for it is told."""

import gc
import os
import random
import subprocess
import sys
from typing import NamedTuple

import numba
import numpy as np
import pytest
from numba.core import errors, event, types

from glider_base.kernel import kernel, on_compiling


class Inner(NamedTuple):
    x: float
    both: tuple[int, int]


class Outer(NamedTuple):
    inner: Inner
    told: bool


def test_tuples_have_the_types_that_numba_says_they_have():
    inner = types.NamedTuple((types.float64, types.UniTuple(types.intp, 2)), Inner)
    assert numba.typeof(Outer(Inner(0.5, (1, 2)), True)) == types.NamedTuple(
        (inner, types.boolean), Outer
    )
    assert numba.typeof((1, 0.5)) == types.Tuple((types.intp, types.float64))


def make_halves():
    """A function and one that calls it, neither compiled yet."""

    @numba.njit
    def half(x):
        return 0.5 * x

    @numba.njit
    def quarter(x):
        return half(half(x))

    return half, quarter


def test_compiling_is_told_before_it_begins_once_and_only_then():
    told, seen = [], []
    _, quarter = make_halves()
    with on_compiling(lambda: told.append(len(quarter.signatures))):
        seen.append(quarter(4.0))  # compiles two functions
        seen.append(quarter(4))  # and again for another type
    with on_compiling(lambda: told.append('again')):
        seen.append(quarter(8.0))
    quarter(1j)
    assert seen == [1.0, 1.0, 2.0]
    assert told == [0]


@pytest.mark.parametrize('is_on', [True, False])
def test_no_garbage_is_looked_for_while_something_is_compiled(is_on):
    """Not in what is compiled within it either; afterwards, or after a failure, as before."""
    half, quarter = make_halves()

    @numba.njit
    def wrong(x):
        return half(x).no_such_thing

    class Watch(event.Listener):
        def on_start(self, event):
            seen.append(gc.isenabled())

        def on_end(self, event):
            seen.append(gc.isenabled() if event.data['dispatcher'] is half else False)

    seen, before = [], gc.isenabled()
    (gc.enable if is_on else gc.disable)()
    try:
        with event.install_listener('numba:compile', Watch()):
            quarter(4.0)
            assert gc.isenabled() == is_on
            with pytest.raises(numba.TypingError):
                wrong(4.0)
            assert gc.isenabled() == is_on
    finally:
        (gc.enable if before else gc.disable)()
    assert len(seen) >= 6 and not any(seen)


LAW = """
import sys
from glider_base.kernel import kernel

@kernel
def inner(x):
    if x < 0.0:
        raise ValueError('below zero', x)
    print('inner', x, 'of two')
    return 2.0 * x

@kernel
def outer(x):
    return inner(x) + 1.0

if __name__ == '__main__':
    import law
    print(law.outer(3.0))
    try:
        law.outer(-1.0)
    except ValueError as error:
        print(error.args)
    print(len(law.outer.stats.cache_hits))
"""


def test_what_is_inlined_prints_and_raises_as_it_would_alone(tmp_path):
    """It has no machine code of its own, compiled or from the cache: nothing of it is lost."""
    (tmp_path / 'law.py').write_text(LAW, encoding='utf-8')
    env = {**os.environ, 'GLIDER_CACHE': str(tmp_path / 'cache')}
    said = [
        subprocess.run(
            [sys.executable, 'law.py'], cwd=tmp_path, env=env, capture_output=True, text=True
        ).stdout.splitlines()
        for _ in range(2)
    ]
    assert [lines[:-1] for lines in said] == [
        ['inner 3.0 of two', '7.0', "('below zero', -1.0)"]
    ] * 2
    assert [lines[-1] for lines in said] == ['0', '1']


@kernel
def noisy(x):
    return x + np.random.normal()


@numba.njit
def unlike(x):
    return x + random.random()


@pytest.mark.parametrize('own', [noisy, unlike])
def test_what_draws_random_numbers_is_refused_for_it_is_never_flown_again(own):
    """Of numpy or of Python, in a kernel or in what it calls."""

    @kernel
    def outer(x):
        return 2.0 * own(x)

    with pytest.raises(errors.NumbaError, match='draws random numbers'):
        outer(1.0)
