# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""The ledger: what has been taken out of the battery, tick by tick, and by what.

It follows from where the actuators say they are and from the true depth, and changes neither. So
whoever has these of a flight, as a score has, comes to the same numbers by the same kernel.
"""

from typing import NamedTuple

import numpy as np

from glider_base.kernel import kernel
from glider_base.signals import Battery


class Ledger(NamedTuple):
    """What has been taken out since the start (J), and what is under way."""

    pump: float
    hotel: float
    masses: float  #: pitch mass, roll mass and steering surface
    calls: float
    power: float  #: mean of the last tick (W)
    call_s: float  #: what is left of a call (s)


FULL = Ledger(pump=0.0, hotel=0.0, masses=0.0, calls=0.0, power=0.0, call_s=0.0)
#: What is not known of a battery.
NOT_MEASURED = -1.0


@kernel
def spent(ledger):
    """All that has been taken out (J)."""
    return ledger.pump + ledger.hotel + ledger.masses + ledger.calls


@kernel
def _pumped(heavier, depth, params):
    """Energy (J) that a change of net heaviness (kg) takes at a depth (m)."""
    z = max(0.0, depth)
    if heavier < 0.0:
        return -heavier * max(0.0, params.out + params.out_per_m * z)
    return heavier * max(0.0, params.let_in + params.let_in_per_m * z)


@kernel
def spend(ledger, before, after, depths, surfacings, params, dt):
    """Ledger after a tick of ``dt`` s.

    ``before`` and ``after`` are `Joints`: where the actuators were and are. Of depths (m) and
    surfacings (`Surfacing`) there are two, before and after.
    """
    if params.capacity <= 0.0:
        return ledger
    is_out = surfacings[1].out_ticks > 0
    if is_out:
        hotel = params.surface
    else:
        hotel = params.dive if depths[1] >= depths[0] else params.climb
    call, call_s = 0.0, ledger.call_s
    if surfacings[1].is_under:
        call_s = 0.0
    elif surfacings[0].is_under:
        call, call_s = params.call_start, params.call_s
    if is_out and call_s > 0.0:
        lasts = min(dt, call_s)
        call += params.call * lasts
        call_s -= lasts
    pump = _pumped(after.m_b - before.m_b, depths[1], params)
    masses = params.pitch * abs(after.x_p - before.x_p) + params.roll * abs(after.mu - before.mu)
    masses += params.steer * abs(after.delta - before.delta)
    return Ledger(
        pump=ledger.pump + pump,
        hotel=ledger.hotel + hotel * dt,
        masses=ledger.masses + masses,
        calls=ledger.calls + call,
        power=(pump + masses + call) / dt + hotel,
        call_s=call_s,
    )


@kernel
def battery_of(ledger, params):
    """What the battery says (`Battery`), as 32 bits hold it; its voltage does not sag."""
    if params.capacity <= 0.0:
        return Battery(params.voltage, 0.0, NOT_MEASURED, NOT_MEASURED, NOT_MEASURED)
    left = max(0.0, params.capacity - spent(ledger))
    coulombs = 3600.0 * params.voltage
    return Battery(
        np.float64(np.float32(params.voltage)),
        np.float64(np.float32(-ledger.power / params.voltage)),
        np.float64(np.float32(left / coulombs)),
        np.float64(np.float32(params.capacity / coulombs)),
        np.float64(np.float32(left / params.capacity)),
    )
