# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""Tuples of numbers that go to compiled code by arrays arrive as they were."""

import sys
from typing import NamedTuple

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numba.core import types
from numba.experimental import structref
from numba.extending import overload

from glider_base.kernel import kernel
from glider_base.kernels.packing import packed, pour, put

FLOATS = st.floats(allow_nan=False)
INTEGERS = st.integers(-(2**63), 2**63 - 1)


class Inner(NamedTuple):
    x: float
    is_on: bool
    count: int


class Outer(NamedTuple):
    inner: Inner
    pair: tuple[float, float]
    nothing: tuple
    stream: np.uint64
    values: np.ndarray


@structref.register
class BoxType(types.StructRef):
    """Type of `Box` in compiled code."""


class Box(structref.StructRefProxy):
    """Holds a tuple, or another one in its place."""


structref.define_boxing(BoxType, Box)


@kernel
def boxed(values):
    return Box(values)


@overload(Box)
def _new_box(values):
    kind = BoxType([('values', values)])

    def new(values):
        made = structref.new(kind)
        made.values = values
        return made

    return new


@kernel
def poured(box, values):
    pour(box, 'values', values)


@kernel
def opened(box):
    return box.values


def through(first, then):
    """What is in a box that held something else of its kind before."""
    box = boxed(first)
    poured(box, packed(then))
    return opened(box)


@kernel
def write(table, row, start, tuples):
    put(table, row, start, tuples)


@given(FLOATS, st.booleans(), INTEGERS, FLOATS, st.integers(0, 2**64 - 1))
def test_what_was_packed_is_what_arrives(x, is_on, count, y, stream):
    values = np.array([x, y])
    sent = Outer(Inner(x, is_on, count), (y, -0.0), (), np.uint64(stream), values)
    before = Outer(Inner(1.0, True, 2), (3.0, 4.0), (), np.uint64(5), np.zeros(3))
    got = through(before, sent)
    assert type(got) is Outer and type(got.inner) is Inner
    assert (got.inner, got.nothing, int(got.stream)) == (sent.inner, (), stream)
    assert [type(one) for one in got.inner] == [float, bool, int]
    assert np.array(got.pair).tobytes() == np.array(sent.pair).tobytes()
    assert got.values.ctypes.data == values.ctypes.data


def test_an_array_that_arrives_lives_on():
    before = np.zeros(7)
    got = through((Inner(0.0, True, 1), before), (Inner(1.0, False, 2), np.arange(1000.0)))
    assert got[1].sum() == 499500.0
    assert sys.getrefcount(before) == 2  # nobody else has it any more


@pytest.mark.parametrize('row', [0, 2])
def test_tuples_are_put_into_a_row_one_after_the_other(row):
    table = np.full((3, 9), np.nan)
    write(table, row, 1, ((1.5, 2.5), (), (3, True), Inner(4.0, False, 5)))
    assert table[row, 1:8].tolist() == [1.5, 2.5, 3.0, 1.0, 4.0, 0.0, 5.0]
    assert np.isnan(table).sum() == 20
