# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""Certificates of the steering loop: one quadratic function for all vertices of a box of gains.

The inequalities, and why they hold for all gains in the box, are those of docs/theory.md, 8. `lmi`
proposes P. What is printed is computed from P alone, and `verified` by eigenvalues here.
"""

import math
from typing import NamedTuple

import numpy as np
from scipy.linalg import solve_continuous_lyapunov

from glider_base.signals import TICK_S
from glider_studies.bounds import lmi
from glider_studies.bounds.steering_loop import (
    INPUTS,
    SteeringLoop,
    Tick,
    box,
    limits,
    names,
    tick,
)

#: Times its limit that a signal that saturates may come to, and reach cross-track over the
#: lookahead distance: the region is the best that some of these give.
TRIED = ((1.0, 0.3), (1.0, 0.6), (1.5, 0.6), (2.0, 0.6))
#: Condition of P, in states over their sizes, at which the search for a region begins.
_WORST_CONDITION = 1e6
#: Typical heading error (rad), by which the states are scaled.
_ANGLE = 0.1
#: Largest heading error of a region (rad): sin(psi) / psi.
_LARGEST_HEADING = 0.6
#: Rates alpha (1/s) over the rate of the line of sight at which gains are looked for.
_RATES = (0.75, 0.9, 1.05, 1.2, 1.35)


class Gain(NamedTuple):
    """How far an input of any shape moves the vehicle cross-track."""

    p: np.ndarray
    rate: float  #: alpha (1/s)
    gain: float  #: |e| over the largest |input| (m per unit)
    holds_to: float  #: largest |input| for which nothing saturates (unit)


class Region(NamedTuple):
    """From where the vehicle comes home, though filters and roll saturate."""

    p: np.ndarray
    times: float  #: m, of the rate limits and of the integral's
    start: np.ndarray  #: (2, 2), V of a start (e, psi) at rest is [e, psi] start [e, psi]'
    aside_m: float  #: start cross-track on its heading (m)
    turned: float  #: start on the path, turned (rad)


def decreases(p: np.ndarray, one: Tick, rate: float = 0.0) -> np.ndarray:
    """Minus (V(t + h) - V + h rate V) / h as a matrix: positive definite if V falls."""
    pf = p @ one.f
    return -(pf + pf.T + TICK_S * one.f.T @ pf + rate * p)


def dissipates(p: np.ndarray, one: Tick, column: int, rate: float) -> np.ndarray:
    """The same with an input: minus (V(t + h) - V + h rate (V - v^2)) / h in (x, v)."""
    g = one.g[:, column : column + 1]
    cross = -(p @ g + TICK_S * one.f.T @ p @ g)
    corner = rate - TICK_S * g.T @ p @ g
    return np.block([[decreases(p, one, rate), cross], [cross.T, corner]])


def is_positive(matrix: np.ndarray) -> bool:
    """By its eigenvalues, when its diagonal is scaled to 1, with a margin for rounding."""
    diagonal = np.diagonal(matrix)
    if not np.all(np.isfinite(matrix)) or np.any(diagonal <= 0.0):
        return False
    scale = 1.0 / np.sqrt(diagonal)
    return bool(np.linalg.eigvalsh(matrix * np.outer(scale, scale)).min() > 1e-12)


def _symmetric(n: int) -> np.ndarray:
    """Basis (m, n, n) of the symmetric matrices."""
    basis = []
    for i in range(n):
        for j in range(i, n):
            one = np.zeros((n, n))
            one[i, j] = one[j, i] = 1.0
            basis.append(one)
    return np.array(basis)


def _scales(loop: SteeringLoop) -> np.ndarray:
    """Typical size of each state."""
    u = loop.bandwidth / abs(loop.b)
    sizes = (1.0 / loop.line_of_sight, 1.0, 1.0, loop.bandwidth, u, 0.1 * u)
    return _ANGLE * np.array(sizes[: len(names(loop))])


def _scaled(one: Tick, scale: np.ndarray) -> Tick:
    """The tick of the states over their sizes."""
    signals = {name: row * scale for name, row in one.signals.items()}
    return Tick(one.f * scale / scale[:, None], one.g / scale[:, None], signals)


def _stacked(make, basis) -> tuple[np.ndarray, np.ndarray]:
    """F_0 and F_i of blocks that are affine in P, from what makes them of a P."""
    zero = make(np.zeros_like(basis[0]))
    return zero, np.array([make(one) - zero for one in basis])


def _bordered(rows: np.ndarray, size: float):
    """[P r'; r size]: in V <= 1 no |r x| is above sqrt(size), for each of some rows."""
    n = rows.shape[1]

    def make(p):
        blocks = np.zeros((len(rows), n + 1, n + 1))
        blocks[:, :n, :n] = p
        blocks[:, :n, n] = blocks[:, n, :n] = rows
        blocks[:, n, n] = size
        return blocks

    return make


# ------------------------------------------------------------------------------------- gains


def gain(loop: SteeringLoop, column: int) -> Gain | None:
    """Smallest gain that is found from an input to the cross-track error; None: there is none."""
    scale = _scales(loop)
    ticks = [tick(loop, one) for one in box(loop)]
    # an input that moves the vehicle as far as the sizes of its states say
    size = _ANGLE * (loop.bandwidth, loop.speed, loop.bandwidth / abs(loop.b))[column]
    best = None
    for share in _RATES:
        rate = share * loop.line_of_sight * loop.speed
        scaled = [_scaled(Tick(one.f, one.g * size, one.signals), scale) for one in ticks]
        p = _propose_gain(loop, scaled, column, rate)
        if p is None:
            continue
        p = p / np.outer(scale, scale) * size**2
        if not gain_verified(p, ticks, column, rate):
            continue
        inverse = np.linalg.inv(p)
        metres = math.sqrt(inverse[0, 0])
        if best is None or metres < best.gain:
            within = min(
                limit / math.sqrt(row @ inverse @ row)
                for one in ticks
                for row, limit in zip(one.signals.values(), limits(loop).values(), strict=True)
            )
            best = Gain(p, rate, metres, within)
    return best


def gain_verified(p: np.ndarray, ticks: list[Tick], column: int, rate: float) -> bool:
    """Whether P is a certificate at every vertex, by eigenvalues."""
    return is_positive(p) and all(is_positive(dissipates(p, one, column, rate)) for one in ticks)


def reached(loop: SteeringLoop) -> np.ndarray:
    """Metres per unit (3,) that the worst course of each input does at a vertex that stays.

    The sum of the absolute impulse response, over twelve times the slowest time: no true gain of
    the box is less.
    """
    most = np.zeros(len(INPUTS))
    for one in (tick(loop, at) for at in box(loop)):
        slowest = -1.0 / np.linalg.eigvals(one.f).real.max()
        step = np.eye(len(one.f)) + TICK_S * one.f
        x, total = TICK_S * one.g, np.zeros(len(INPUTS))
        for _ in range(round(12.0 * slowest / TICK_S)):
            total += np.abs(x[0])
            x = step @ x
        most = np.maximum(most, total)
    return most


def _common(loop: SteeringLoop, ticks: list[Tick], basis: np.ndarray, rate: float):
    """Coordinates of one P whose V falls at every vertex, by ``rate`` at least; None: none."""
    identity = np.eye(len(ticks[0].f))

    def falls(p):
        return loop.lookahead_s * np.array([decreases(p, one, rate) for one in ticks])

    guess = solve_continuous_lyapunov(np.mean([one.f for one in ticks], axis=0).T, -identity)
    guess *= 1.1 / np.linalg.eigvalsh(guess)[0]
    between = [(-identity, basis), (_WORST_CONDITION * identity, -basis)]
    coordinates = np.einsum('mij,ij->m', basis, guess) / np.einsum('mij,mij->m', basis, basis)
    cost = np.trace(basis, axis1=1, axis2=2)
    return lmi.solve(cost, [_stacked(falls, basis), *between], coordinates)


def _propose_gain(loop, ticks, column, rate) -> np.ndarray | None:
    """P of the smallest gain to the first state, for ticks over their sizes."""
    n = len(ticks[0].f)
    basis = _symmetric(n)
    start = _common(loop, ticks, basis, rate)
    if start is None:
        return None

    def make(p):
        return np.array([dissipates(p, one, column, rate) for one in ticks]) / rate

    def at(y):
        return np.tensordot(y, basis, axes=1)

    while not all(map(is_positive, make(at(start)))):
        start = 0.5 * start
        if start @ start < 1e-30:
            return None
    f_0, f_i = _stacked(make, basis)
    c_0, c_i = _stacked(_bordered(np.eye(n)[:1], 0.0), basis)
    corner = np.zeros_like(c_0)
    corner[..., n, n] = 1.0
    blocks = [
        (f_0, np.concatenate((f_i, np.zeros_like(f_i[:1])))),
        (c_0, np.concatenate((c_i, corner[None]))),
    ]
    cost = np.append(np.zeros(len(basis)), 1.0)
    found = lmi.solve(cost, blocks, np.append(start, 1.1 * np.linalg.inv(at(start))[0, 0]))
    return None if found is None else at(found[:-1])


# ------------------------------------------------------------------------------------ region


def region(loop: SteeringLoop, slope, tried=TRIED) -> Region | None:
    """Largest region that is found; None: there is none.

    ``slope`` gives the least gain of the line of sight, of its slope on the path, up to a reach
    (m). ``tried`` is like `TRIED`.
    """
    best = None
    for times, part in tried:
        reach = part / loop.line_of_sight
        found = _region(loop, reach, slope(reach), times)
        if found and (best is None or found.aside_m * found.turned > best.aside_m * best.turned):
            best = found
    return best


def _at_rest(loop: SteeringLoop) -> np.ndarray:
    """State (n, 2) of a start (e, psi): its heading is what was asked for until now."""
    states = names(loop)
    start = np.zeros((len(states), 2))
    start[0, 0] = start[states.index('psi'), 1] = start[states.index('psi_s'), 1] = 1.0
    return start


def _bounds(loop: SteeringLoop, ticks: list[Tick], reach: float, times: float):
    """Rows that must stay within 1 in V <= 1."""
    n = len(ticks[0].f)
    rows = [np.eye(n)[0] / reach, np.eye(n)[1] / _LARGEST_HEADING]
    for name, limit in limits(loop).items():
        rows += [one.signals[name] / (times * limit) for one in ticks]
    return np.unique(np.array(rows).round(15), axis=0)


def region_verified(p: np.ndarray, ticks: list[Tick], rows: np.ndarray) -> bool:
    """Whether V falls at every vertex, and no row comes to 1 in V <= 1."""
    inverse = np.linalg.inv(p)
    return (
        is_positive(p)
        and all(is_positive(decreases(p, one)) for one in ticks)
        and bool(np.all(np.einsum('ij,jk,ik->i', rows, inverse, rows) <= 1.0 + 1e-9))
    )


def _largest(y: np.ndarray, basis: np.ndarray, rows: np.ndarray) -> float:
    """Largest square of a row in V <= 1; P times as large, no row comes to 1."""
    inverse = np.linalg.inv(np.tensordot(y, basis, axes=1))
    return float(np.einsum('ij,jk,ik->i', rows, inverse, rows).max())


def _region(loop, reach, slope, times) -> Region | None:
    sine = math.sin(_LARGEST_HEADING) / _LARGEST_HEADING
    least = {'line_of_sight': slope, 'sine': sine, **dict.fromkeys(limits(loop), 1.0 / times)}
    ticks = [tick(loop, one) for one in box(loop, least)]
    scale, rows = _scales(loop), _bounds(loop, ticks, reach, times)
    scaled = [_scaled(one, scale) for one in ticks]
    basis = _symmetric(len(scale))
    rest = _at_rest(loop) / scale[:, None] * scale[:2]
    cost = np.einsum('ia,mij,ja->m', rest, basis, rest)

    common = _common(loop, scaled, basis, 0.0)
    if common is None:
        return None

    def falls(p):
        return loop.lookahead_s * np.array([decreases(p, one) for one in scaled])

    within = _stacked(_bordered(rows * scale, 1.0), basis)
    found = lmi.solve(
        cost,
        [_stacked(falls, basis), within],
        common * 1.1 * _largest(common, basis, rows * scale),
    )
    if found is None:
        return None
    found = found * _largest(found, basis, rows * scale)
    p = np.tensordot(found, basis, axes=1) / np.outer(scale, scale)
    if not region_verified(p, ticks, rows):
        return None
    start = _at_rest(loop).T @ p @ _at_rest(loop)
    aside, turned = (1.0 / math.sqrt(start[i, i]) for i in range(2))
    return Region(p, times, start, aside, turned)
