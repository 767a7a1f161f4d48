# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""Small linear matrix inequalities, by a barrier method (Boyd and Vandenberghe 2004, chapter 11).

Nothing rests on it: what it finds is a proposal, which `certificate` verifies by eigenvalues.
"""

import numpy as np

#: Newton steps for each weight of the barrier, and decrement at which they end.
_STEPS, _DECREMENT = 100, 1e-3
#: Growth of the weight, and gap to the optimum, relative, at which it ends.
_GROWTH, _GAP = 5.0, 1e-3


def solve(
    cost: np.ndarray, blocks: list[tuple[np.ndarray, np.ndarray]], start: np.ndarray
) -> np.ndarray | None:
    """Minimise cost' y such that F_0 + sum y_i F_i is positive definite in each block.

    Blocks are F_0 and F_i, float64[..., n, n] and float64[m, ..., n, n]: of one matrix or of a
    stack of them. The search begins at ``start``, float64[m], which need not be feasible. Returns
    y, float64[m], or None if no feasible point was found.
    """
    blocks = [
        (
            np.atleast_3d(f_0).reshape(-1, *f_0.shape[-2:]),
            f_i.reshape(len(cost), -1, *f_0.shape[-2:]),
        )
        for f_0, f_i in blocks
    ]
    worst = -min(np.linalg.eigvalsh(_at(start, block)).min() for block in blocks)
    if worst >= 0.0:
        eased = [
            (f_0, np.concatenate((f_i, np.broadcast_to(np.eye(f_0.shape[-1]), f_0.shape)[None])))
            for f_0, f_i in blocks
        ]
        slack = np.append(np.zeros_like(cost), 1.0)
        found = _follow(slack, eased, np.append(start, 1.1 * worst + 1e-6), enough=-1e-6)
        if found is None or found[-1] >= 0.0:
            return None
        start = found[:-1]
    return _follow(cost, blocks, start)


def _at(y: np.ndarray, block: tuple[np.ndarray, np.ndarray]) -> np.ndarray:
    f_0, f_i = block
    return f_0 + np.tensordot(y, f_i, axes=1)


def _barrier(y: np.ndarray, blocks) -> float:
    """- sum of log det; infinite where a block is not positive definite."""
    total = 0.0
    for block in blocks:
        try:
            factor = np.linalg.cholesky(_at(y, block))
        except np.linalg.LinAlgError:
            return np.inf
        total -= 2.0 * np.log(np.diagonal(factor, axis1=-2, axis2=-1)).sum()
    return total


def _slopes(y: np.ndarray, blocks) -> tuple[np.ndarray, np.ndarray]:
    """Gradient and Hessian of the barrier."""
    gradient, hessian = np.zeros(len(y)), np.zeros((len(y), len(y)))
    for block in blocks:
        inverse = np.linalg.inv(np.linalg.cholesky(_at(y, block)))
        scaled = inverse @ block[1] @ np.swapaxes(inverse, -1, -2)
        gradient -= np.trace(scaled, axis1=-2, axis2=-1).sum(axis=1)
        flat = scaled.reshape(len(y), -1)
        hessian += flat @ flat.T
    return gradient, hessian


def _follow(cost, blocks, y, enough: float = -np.inf) -> np.ndarray | None:
    """The minimum along the central path, or the first point whose cost is ``enough``."""
    size = sum(block[0].shape[0] * block[0].shape[-1] for block in blocks)
    weight = size / max(abs(cost @ y), 1e-9)
    while True:
        for _ in range(_STEPS):
            gradient, hessian = _slopes(y, blocks)
            gradient = gradient + weight * cost
            scale = 1.0 / np.sqrt(np.diagonal(hessian))
            scaled = hessian * np.outer(scale, scale) + 1e-12 * np.eye(len(y))
            step = -scale * np.linalg.solve(scaled, scale * gradient)
            decrement = -gradient @ step
            if not decrement > _DECREMENT:
                break
            now, share = weight * cost @ y + _barrier(y, blocks), 1.0
            while not (
                weight * cost @ (y + share * step) + _barrier(y + share * step, blocks)
                <= now - 0.1 * share * decrement
            ):
                share *= 0.5
                if share < 1e-8:
                    break
            if share < 1e-8:
                break
            y = y + share * step
            if cost @ y < enough:
                return y
        if size / weight < _GAP * abs(cost @ y) or weight > 1e12 * size:
            return y
        weight *= _GROWTH
