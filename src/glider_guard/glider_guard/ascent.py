# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""How the guard brings a vehicle up: first the pump, then the mass.

A vehicle that still sinks when its nose goes up slides down backward, faster than it dived: from
0.36 to 0.69 m/s in zhang2021. Held level it lies across its way, and hardly sinks. So the mass
is where it balances the rest as long as the vehicle sinks, and at its stop once it rises. What a
scale does not know of the balance, a broken part or a hull that shrinks, the pitch shows.
"""

import math
from typing import NamedTuple

from glider_base.kernel import kernel
from glider_base.signals import Joints
from glider_model.onboard.moving_mass import MovingMass, first_moments, mass_place

#: A vehicle that rises faster than this (m/s) turns its nose up; one that sinks faster lies level.
RISES_MPS = 0.05
#: One that rises nose up more slowly than this (m/s), for so long (s), is held level for as long:
#: it may lie in a stall that it rises out of. One that does not rise, level, with its pump out,
#: turns its nose up for as long: the water may sink, or it may be too heavy, and glide down where
#: its mass should hold it level. What makes it sink faster by `RISES_MPS` is given up.
SLOW_MPS, SLOW_S = 0.03, 300.0
#: Its vertical rate is averaged over this time (s): a turn throws it up for a moment.
AVERAGE_S = 20.0
#: Held level, a moment that nobody knows of is averaged over this time (s). More than what turns
#: the nose by this (rad) it is not: where the attitude errs, the mass stays near its balance.
BALANCE_S, OFF_BALANCE = 100.0, math.radians(10.0)


class AscentLimits(NamedTuple):
    """How a vehicle comes up."""

    safe: Joints  #: as buoyant as possible, mass at the climb stop, no roll, no turn
    pumped: float  #: from here on the pump has done what it can (kg)
    pump_s: float  #: and after this time, wherever it is
    mass: MovingMass
    there: float  #: the mass is this near to where it goes (m)


class Ascent(NamedTuple):
    """A vehicle on its way up, between two ticks."""

    waits_s: float  #: since it was sent up
    rate: float  #: averaged (m/s, + down)
    turned: bool  #: nose up
    #: for which it has risen too slowly so; less than 0: the other way is tried for as long
    slow_s: float
    moment: float  #: first moment that nobody knows of (kg m)
    before: float  #: the rate as the other way began to be tried (m/s, + down)


class Rise(NamedTuple):
    """What a tick shows of it; by default nothing is seen."""

    m_b: float  #: where the pump is (kg)
    x_p: float  #: where the mass is (m)
    rate: float = 0.0  #: measured vertical rate (m/s, + down)
    sees: bool = False  #: whether that is to be trusted
    moves: bool = False  #: whether it is shown at all: what is not trusted tells of a stall still
    under: bool = True  #: under water
    theta: float = 0.0  #: pitch (rad)
    is_new: bool = False  #: whether that is measured anew
    is_there: bool = False  #: where it was sent, or it goes no farther


INITIAL_ASCENT = Ascent(0.0, 0.0, False, 0.0, 0.0, 0.0)


@kernel
def _off_balance(moment, at, mass, dt):
    """First moment (kg m) that nobody knows of, a tick later: the pitch shows it."""
    s_x, _, s_z = first_moments(at.m_b, at.x_p, 0.0, mass)
    most = s_z * math.tan(OFF_BALANCE)
    shown = min(most, max(-most, -s_z * math.tan(at.theta) - s_x))
    return moment + dt / BALANCE_S * (shown - moment)


@kernel
def come_up(state: Ascent, at: Rise, limits: AscentLimits, dt: float) -> tuple[Ascent, Joints]:
    """Command of a tick on the way up."""
    sees, m_b, average = at.sees, at.m_b, at.rate
    if state.waits_s > 0.0:
        average = state.rate + dt / AVERAGE_S * (at.rate - state.rate)
    waits_s, turned = state.waits_s + dt, state.turned
    is_done = m_b <= limits.pumped or waits_s > limits.pump_s
    if is_done and not sees:
        turned = True
    elif sees and average < (0.0 if is_done else -RISES_MPS):
        turned = True
    elif sees and average > RISES_MPS:
        turned = False
    # what a way of lying does is seen once the mass is there: one may take an hour to its stop
    seen_s = dt if at.is_there else 0.0
    slow_s = min(0.0, state.slow_s + seen_s) if state.slow_s < 0.0 else 0.0
    hangs, before = is_done and m_b < 0.0, state.before
    if slow_s < 0.0:
        turned = state.turned
        if sees and average > before + RISES_MPS:
            turned, slow_s, before = not turned, -SLOW_S, average
    elif at.moves and at.under and (turned or hangs):
        slower = seen_s if average > -SLOW_MPS else -dt  # a rate that errs is now this, now that
        slow_s = max(0.0, state.slow_s + slower)
        if slow_s >= SLOW_S:
            turned, slow_s, before = not turned, -SLOW_S, average
    moment = state.moment
    if at.is_new and not state.turned:
        moment = _off_balance(moment, at, limits.mass, dt)
    safe = limits.safe
    x_p = safe.x_p if turned else mass_place(-moment, m_b, -safe.x_p, limits.mass)
    state = Ascent(waits_s, average, turned, slow_s, moment, before)
    return state, Joints(safe.m_b, x_p, 0.0, 0.0)
