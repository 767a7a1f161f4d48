# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""Fields that are changed by name: in a kernel the same as in Python."""

from typing import NamedTuple

import numba
import pytest
from numba.core.errors import TypingError

from glider_base.kernel import replace


class Inner(NamedTuple):
    """Two numbers."""

    count: int
    depth: float


class Outer(NamedTuple):
    """A number of each kind, and another tuple."""

    tick: int
    is_out: bool
    inner: Inner
    rate: float


BEFORE = Outer(3, False, Inner(7, 0.1), -0.25)


def change(values, tick, rate):
    """Fields out of their order, and one of a tuple inside."""
    return replace(values, rate=rate, inner=replace(values.inner, depth=2.0 * rate), tick=tick)


def test_compiled_it_is_what_namedtuple_itself_does():
    after = BEFORE._replace(tick=4, rate=0.3, inner=Inner(7, 0.6))
    assert change(BEFORE, 4, 0.3) == after
    assert numba.njit(change)(BEFORE, 4, 0.3) == after


def test_two_in_one_kernel_that_change_other_fields_of_the_same_type_stay_two():
    class Pair(NamedTuple):
        a: int
        b: int

    def either(pair, which):
        return replace(pair, a=5) if which else replace(pair, b=5)

    compiled = numba.njit(either)
    assert compiled(Pair(1, 2), True) == Pair(5, 2)
    assert compiled(Pair(1, 2), False) == Pair(1, 5)


def test_a_field_that_is_not_there_is_refused():
    def wrong(values):
        return replace(values, depth=1.0)

    with pytest.raises((TypeError, ValueError), match='depth'):  # CPython 3.13, before
        wrong(BEFORE)
    with pytest.raises((TypingError, TypeError), match='Outer has no field depth'):
        numba.njit(wrong)(BEFORE)
