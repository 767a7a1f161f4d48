# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""Linear equations, to the same bits on every processor.

LAPACK solves them too, but its last bits are those of a BLAS that is another one for each kind of
processor, and a flight makes them grow.
"""

import numpy as np


def solve(matrix: np.ndarray, right: np.ndarray) -> np.ndarray:
    """Solution x, float64[n, m], of matrix x = right, by elimination with partial pivoting.

    The matrix, float64[n, n], is not singular.
    """
    n = len(matrix)
    rows = np.hstack((matrix, right))
    for k in range(n):
        pivot = k + int(np.argmax(abs(rows[k:, k])))
        rows[[k, pivot]] = rows[[pivot, k]]
        shares = rows[k + 1 :, k] * (1.0 / rows[k, k])
        rows[k + 1 :] -= shares[:, None] * rows[k]
    for k in reversed(range(n)):
        rows[k, n:] /= rows[k, k]
        rows[:k, n:] -= rows[:k, k, None] * rows[k, n:]
    return rows[:, n:]
