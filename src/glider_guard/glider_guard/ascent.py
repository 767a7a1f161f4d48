# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""How the guard brings a vehicle up: first the pump, then the mass.

A vehicle that still sinks when its nose goes up slides down backward, faster than it dived: from
0.36 to 0.69 m/s in zhang2021. Held level it lies across its way, and hardly sinks. So the mass
waits in the middle until the vehicle rises, or until the pump has done what it can.
"""

from typing import NamedTuple

from glider_model.base.kernel import kernel
from glider_model.base.signals import Joints

#: A vehicle that rises faster than this (m/s) has turned over.
RISES_MPS = 0.05


class AscentLimits(NamedTuple):
    """How a vehicle comes up."""

    safe: Joints  #: as buoyant as possible, mass at the climb stop, no roll, no turn
    pumped: float  #: from here on the pump has done what it can (kg)
    pump_s: float  #: and after this time, wherever it is


class Ascent(NamedTuple):
    """A vehicle on its way up, between two ticks."""

    waits_s: float  #: with the mass in the middle
    turned: bool  #: nose up


INITIAL_ASCENT = Ascent(0.0, False)


@kernel
def come_up(state, rate, sees, m_b, limits, dt):
    """Command of a tick on the way up.

    Parameters
    ----------
    state : Ascent
    rate : float
        Measured vertical rate (m/s, + down).
    sees : bool
        Whether that is to be believed.
    m_b : float
        Where the pump is (kg).
    limits : AscentLimits
    dt : float

    Returns
    -------
    Ascent, Joints
    """
    waits_s = state.waits_s + dt
    rises = sees and rate < -RISES_MPS
    turned = state.turned or rises or m_b <= limits.pumped or waits_s > limits.pump_s
    safe = limits.safe
    return Ascent(waits_s, turned), Joints(safe.m_b, safe.x_p if turned else 0.0, 0.0, 0.0)
