# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""What faults do to the vehicle in the water: actuators, weight, drag and lift, gusts.

Each function is a slot, whose body without faults hands on what it is given.
"""

from typing import NamedTuple

from glider_base.kernel import kernel, replace
from glider_base.signals import Joints, Water
from glider_base.slot import only_for
from glider_model.plant.faults import kinds
from glider_model.plant.faults.kinds import FaultParams
from glider_model.vehicle.actuators import actuators_step, pump_rate, toward
from glider_model.vehicle.file import VehicleParams


class Felt(NamedTuple):
    """What the motion of a broken vehicle goes by, in the place of `PlantParams`."""

    vehicle: VehicleParams
    density: NamedTuple


@only_for(
    FaultParams,
    lambda joints, command, depth, vehicle, dt, total, params: actuators_step(
        joints, command, depth, vehicle, dt
    ),
)
@kernel
def moved(joints, command, depth, vehicle, dt, total, params):
    """Where the actuators are, offsets apart, ``dt`` s later; ``total`` is of `summed`."""
    v, off = vehicle, vehicle.errors.dead_band
    rate = pump_rate(joints.m_b, command.m_b, depth, v)
    return Joints(
        _one(joints.m_b, command.m_b, v.m_b_max, rate * dt, off.m_b, 0, total),
        _one(joints.x_p, command.x_p, v.x_p_max, v.x_p_rate * dt, off.x_p, 1, total),
        _one(joints.mu, command.mu, v.mu_max, v.mu_rate * dt, off.mu, 2, total),
        _one(joints.delta, command.delta, v.delta_max, v.delta_rate * dt, off.delta, 3, total),
    )


@kernel
def _one(position, target, limit, reach, dead_band, which, total):
    low, high = limit * total[kinds.LOW + which], limit * total[kinds.HIGH + which]
    goal = min(high, max(low, target))
    return toward(position, goal, limit, reach * total[kinds.RATE + which], dead_band)


@only_for(FaultParams, lambda joints, vehicle, total, params: joints)
@kernel
def acting(joints, vehicle, total, params):
    """Where actuators are that say they are at ``joints``."""
    v = vehicle
    mu = _away(joints.mu, v.mu_max, 2, total)
    return Joints(
        _away(joints.m_b, v.m_b_max, 0, total),
        _away(joints.x_p, v.x_p_max, 1, total),
        0.0 if total[kinds.NO_ROLL] > 0.0 else mu,
        _away(joints.delta, v.delta_max, 3, total),
    )


@kernel
def _away(position, limit, which, total):
    """Position with its offset, within the range."""
    offset = limit * total[kinds.AWAY + which]
    return position if offset == 0.0 else min(limit, max(-limit, position + offset))


@only_for(FaultParams, lambda water, total, params: water)
@kernel
def blown(water, total, params):
    """Velocity of the water around the vehicle, gusts included (NED, m/s)."""
    return Water(
        water.v_n + total[kinds.BLOWS],
        water.v_e + total[kinds.BLOWS + 1],
        water.v_d + total[kinds.BLOWS + 2],
    )


@only_for(FaultParams, lambda whole, total, params: whole)
@kernel
def felt(whole, total, params):
    """What a motion goes by: something with vehicle and density; ``whole`` is `PlantParams`."""
    v, drag, lift = whole.vehicle, total[kinds.DRAG], total[kinds.LIFT]
    vehicle = replace(
        v,
        K_D0=v.K_D0 * drag,
        K_D=v.K_D * drag,
        K_L0=v.K_L0 * lift,
        K_L=v.K_L * lift,
        ballast=v.ballast + total[kinds.HEAVY],
    )
    return Felt(vehicle, whole.density)
