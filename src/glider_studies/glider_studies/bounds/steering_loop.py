# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""The loop of cross-track and heading in one phase, as a linear tick with gains in a box.

State, inputs and equations are those of docs/theory.md, 8. What is nonlinear is a gain that lies
between its least value and 1 as long as its signal stays within a limit: a saturation at L is one
between 1/m and 1 while the signal is below m L.
"""

import itertools
import math
from typing import NamedTuple

import numpy as np

from glider_base.signals import TICK_S
from glider_model.onboard.command_filter import FilterParams

#: Inputs of the loop, with their units.
INPUTS = {'turn rate': 'rad/s', 'current': 'm/s', 'roll': 'rad'}
#: Box of b / b_hat and of k / k_hat.
BOX = (0.7, 1.3)


class SteeringLoop(NamedTuple):
    """One phase: vehicle as it is estimated to be, and gains of guidance and law there."""

    speed: float  #: horizontal, through the water (m/s)
    b: float  #: turn rate over u at this speed (rad/s); of the real vehicle times the box
    k: float  #: heading per u while u changes (-)
    line_of_sight: float  #: heading over cross-track error, + (rad/m)
    heading_filter: FilterParams
    law: tuple[float, ...]  #: u over (psi_s, psi_s', psi, psi', u, u')
    limit: float  #: of u (rad)
    roll_filter: FilterParams | None  #: None: steered by a surface
    leg_s: float  #: time of a glide (s)

    @property
    def bandwidth(self) -> float:
        """Turn rate over the heading error, a (rad/s)."""
        return -self.law[2] * self.b

    @property
    def lookahead_s(self) -> float:
        """T (s)."""
        return 1.0 / (self.line_of_sight * self.speed)

    @property
    def zero(self) -> float:
        """Zero z = -b / k (rad/s): in the right half-plane, above 0, where the kick is adverse."""
        return -self.b / self.k if self.k else math.inf


class Gains(NamedTuple):
    """Where in its box each gain is (-)."""

    b: float = 1.0
    k: float = 1.0
    line_of_sight: float = 1.0
    sine: float = 1.0  #: sin(psi) / psi
    heading_rate: float = 1.0  #: of the heading filter
    u: float = 1.0  #: of the roll, or fin, that the law asks for
    roll_rate: float = 1.0  #: of the roll filter


#: A vehicle that is as it is estimated to be, and nothing saturates.
AS_LEARNT = Gains()


class Tick(NamedTuple):
    """A tick as matrices: x(t + h) = x + h (F x + G inputs), and signals that saturate."""

    f: np.ndarray  #: (n, n)
    g: np.ndarray  #: (n, 3)
    signals: dict[str, np.ndarray]  #: rows (n,) of what is limited


def names(loop: SteeringLoop) -> list[str]:
    """Names of the states."""
    roll = ['u', "u'"] if loop.roll_filter else []
    return ['e', 'psi', 'psi_s', "psi_s'", *roll]


def limits(loop: SteeringLoop) -> dict[str, float]:
    """Where each signal saturates, by its name."""
    found = {'heading_rate': loop.heading_filter.rate_limit, 'u': loop.limit}
    if loop.roll_filter:
        found['roll_rate'] = loop.roll_filter.rate_limit
    return found


def tick(loop: SteeringLoop, gains: Gains = AS_LEARNT) -> Tick:
    """The tick of 0.1 s, composed in the order in which guidance, law and vehicle act."""
    states = names(loop)
    n, h = len(states), TICK_S
    rows = np.eye(n + len(INPUTS))
    at = {name: rows[i] for i, name in enumerate(states)}
    d, w, delta = rows[n:]
    b, k = gains.b * loop.b, gains.k * loop.k
    e, psi_left = at['e'], at['psi']

    asked = -gains.line_of_sight * loop.line_of_sight * e
    heading, rate, pull_h = _filtered(
        at['psi_s'], at["psi_s'"], asked, gains.heading_rate, loop.heading_filter
    )
    after = {'psi_s': heading, "psi_s'": rate}
    if loop.roll_filter:
        u, u_rate = at['u'] + delta, at["u'"]
        psi = psi_left + k * u
        seen = (heading, rate, psi, b * u + k * u_rate + d, u, u_rate)
        command = sum(one * row for one, row in zip(loop.law, seen, strict=True))
        after['u'], after["u'"], pull_r = _filtered(
            at['u'], u_rate, gains.u * command, gains.roll_rate, loop.roll_filter
        )
        u = after['u'] + delta
    else:  # a fin is at once where the law wants it, and the turn rate is its own
        psi, pull_r = psi_left, None
        known = loop.law[0] * heading + loop.law[1] * rate + loop.law[2] * psi
        command = (known + loop.law[3] * (b * delta + d)) / (1.0 - loop.law[3] * gains.u * b)
        u = gains.u * command + delta
    after['e'] = e + h * (loop.speed * gains.sine * psi + w)
    after['psi'] = psi_left + h * (b * u + d)
    change = np.array([after[name] - at[name] for name in states]) / h
    signals = {'heading_rate': pull_h, 'u': command, 'roll_rate': pull_r}
    return Tick(change[:, :n], change[:, n:], {name: signals[name][:n] for name in limits(loop)})


def _filtered(value, rate, command, gain, params):
    """One step of `filter_command` on rows, and its signal that saturates."""
    h, frequency = TICK_S, params.frequency
    pull = 0.5 * frequency * (command - value)
    rate = rate + h * 2.0 * frequency * (gain * pull - rate)
    return value + h * rate, rate, pull


def box(loop: SteeringLoop, least: dict[str, float] | None = None) -> list[Gains]:
    """Vertices of the box of gains: of b and k `BOX`; of others ``least``, if it says it, to 1."""
    edges = {'b': BOX, **({'k': BOX} if loop.k else {})}
    edges |= {name: (low, 1.0) for name, low in (least or {}).items() if low < 1.0}
    return [
        Gains(**dict(zip(edges, at, strict=True))) for at in itertools.product(*edges.values())
    ]


def sensitivity(loop: SteeringLoop, gains: Gains = AS_LEARNT) -> float:
    """Largest |S| at the input of the vehicle: from an error of u to u itself."""
    one = tick(loop, gains)
    n = len(one.f)
    identity = np.eye(n)
    if loop.roll_filter:
        row, direct = identity[names(loop).index('u')], 0.0
    else:
        fed = loop.law[3] * gains.b * loop.b
        row, direct = one.signals['u'], fed / (1.0 - fed)
    largest = 0.0
    for omega in np.geomspace(1e-4, math.pi / TICK_S, 400):
        shift = (np.exp(1j * omega * TICK_S) - 1.0) / TICK_S
        inner = np.linalg.solve(shift * identity - one.f, one.g[:, 2])
        largest = max(largest, abs(1.0 + direct + row @ inner))
    return largest
