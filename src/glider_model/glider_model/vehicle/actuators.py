# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""Buoyancy engine, pitch mass, roll mass and steering surface: limited in range and in rate.

One with a dead band runs until it is that near to where it is sent. A pump is the slower the
deeper it pumps out. What is 0 in `ActuatorErrors` leaves every number as it is without.
"""

from typing import NamedTuple

from glider_base.kernel import kernel
from glider_base.signals import Joints


class ActuatorErrors(NamedTuple):
    """How actuators err; all 0: not at all."""

    dead_band: Joints  #: nearer than this they stop
    noise: Joints  #: standard deviation of where they say that they are
    rate_per_m: float  #: share of the pump's rate that a metre of depth takes off (1/m)


def ranges(vehicle) -> Joints:
    """How far the actuators of a vehicle (`VehicleParams`) go to either side (kg, m, rad, rad)."""
    return Joints(vehicle.m_b_max, vehicle.x_p_max, vehicle.mu_max, vehicle.delta_max)


#: Standard deviations that noise stays within for all that matters.
MOST_NOISE = 4.0


def doubt(errors: ActuatorErrors) -> Joints:
    """How far an actuator that works may say it is from where it was sent, and stay there."""
    return Joints(
        *(
            band + MOST_NOISE * noise
            for band, noise in zip(errors.dead_band, errors.noise, strict=True)
        )
    )


@kernel
def toward(position, target, limit, reach, dead_band):
    """Move by at most ``reach`` toward ``target``, which is held within +-limit."""
    goal = min(limit, max(-limit, target))
    if dead_band > 0.0 and abs(goal - position) <= dead_band:
        return position
    return position + min(reach, max(-reach, goal - position))


@kernel
def pump_rate(position, target, depth, vehicle):
    """Rate (kg/s) of the buoyancy engine at a depth (m)."""
    if vehicle.errors.rate_per_m > 0.0 and target < position:
        return vehicle.m_b_rate * max(0.0, 1.0 - vehicle.errors.rate_per_m * max(0.0, depth))
    return vehicle.m_b_rate


@kernel
def actuators_step(joints, command, depth, vehicle, dt):
    """Where the actuators are one step of ``dt`` s later; they move evenly in between."""
    v, off = vehicle, vehicle.errors.dead_band
    rate = pump_rate(joints.m_b, command.m_b, depth, v)
    return Joints(
        toward(joints.m_b, command.m_b, v.m_b_max, rate * dt, off.m_b),
        toward(joints.x_p, command.x_p, v.x_p_max, v.x_p_rate * dt, off.x_p),
        toward(joints.mu, command.mu, v.mu_max, v.mu_rate * dt, off.mu),
        toward(joints.delta, command.delta, v.delta_max, v.delta_rate * dt, off.delta),
    )
