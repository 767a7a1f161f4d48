# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""Buoyancy engine, pitch mass, roll mass and steering surface: limited in range and in rate."""

from glider_model.base.kernel import kernel
from glider_model.base.signals import Joints


@kernel
def toward(position, target, limit, reach):
    """Move by at most ``reach`` toward ``target``, which is held within +-limit."""
    goal = min(limit, max(-limit, target))
    return position + min(reach, max(-reach, goal - position))


@kernel
def actuators_step(joints, command, vehicle, dt):
    """Where the actuators are one step of ``dt`` s later; they move evenly in between."""
    return Joints(
        toward(joints.m_b, command.m_b, vehicle.m_b_max, vehicle.m_b_rate * dt),
        toward(joints.x_p, command.x_p, vehicle.x_p_max, vehicle.x_p_rate * dt),
        toward(joints.mu, command.mu, vehicle.mu_max, vehicle.mu_rate * dt),
        toward(joints.delta, command.delta, vehicle.delta_max, vehicle.delta_rate * dt),
    )
