# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""Compiling: whoever waits for it is told."""

import numba

from glider_base.kernel import compiling_told


def test_compiling_is_told_before_it_begins_once_and_only_then():
    told, seen = [], []

    @numba.njit
    def half(x):
        return 0.5 * x

    @numba.njit
    def quarter(x):
        return half(half(x))

    with compiling_told(lambda: told.append(len(quarter.signatures))):
        seen.append(quarter(4.0))  # compiles two functions
        seen.append(quarter(4))  # and again for another type
    with compiling_told(lambda: told.append('again')):
        seen.append(quarter(8.0))
    quarter(1j)
    assert seen == [1.0, 1.0, 2.0]
    assert told == [0]
