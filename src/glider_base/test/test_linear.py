# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""Linear equations: the solution is one, and that of LAPACK."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from glider_base.linear import solve


@given(st.integers(1, 30), st.integers(1, 3), st.integers(0, 2**32 - 1))
def test_the_solution_is_that_of_lapack(n, m, seed):
    rng = np.random.default_rng(seed)
    matrix, right = rng.normal(size=(n, n)), rng.normal(size=(n, m))
    before = matrix.copy(), right.copy()
    found = solve(matrix, right)
    assert found.shape == (n, m)
    tolerance = 1e-13 * np.linalg.cond(matrix) * abs(found).max()
    np.testing.assert_allclose(found, np.linalg.solve(matrix, right), rtol=0.0, atol=tolerance)
    np.testing.assert_array_equal(matrix, before[0])
    np.testing.assert_array_equal(right, before[1])


def test_rows_are_changed_where_the_diagonal_is_nothing_or_small():
    matrix = np.array([[0.0, 1.0, 0.0], [1e-18, 0.0, 1.0], [2.0, 1.0, 1.0]])
    x = np.array([[3.0], [-1.0], [0.5]])
    np.testing.assert_allclose(solve(matrix, matrix @ x), x, rtol=1e-15)
