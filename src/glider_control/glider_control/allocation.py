# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""From demanded moments to the positions of the moving mass, and back.

The moving mass makes moments by gravity alone:

    tau_p = g (S_y g_z - S_z g_y),   S_y = s_y + m_p R sin mu
    tau_q = g (S_z g_x - S_x g_z),   S_x = s_x + m_p (x_0 + x_p),  S_z = s_z + m_p R cos mu

with (g_x, g_y, g_z) the direction of gravity in body axes. Both are solved exactly.
"""

import math
from typing import NamedTuple

from glider_base.kernel import kernel
from glider_model.onboard.moving_mass import (
    MovingMass,
    first_moments,
    make_moving_mass,
    mass_place,
)
from glider_model.vehicle.actuators import ranges
from glider_model.vehicle.file import VehicleParams
from glider_model.vehicle.rigid_body import GRAVITY

#: Nose-up or nose-down beyond this, gravity gives no pitch authority: g_z is held here (-).
SMALLEST_G_Z = 0.2


class AllocationParams(NamedTuple):
    """Masses and ranges of the actuators."""

    mass: MovingMass
    m_b_max: float  #: ranges (kg, m, rad, rad)
    x_p_max: float
    mu_max: float
    delta_max: float  #: 0 without a steering surface


def make_allocation(vehicle: VehicleParams) -> AllocationParams:
    """What allocation needs to know of a vehicle: what a scale and a ruler tell."""
    return AllocationParams(make_moving_mass(vehicle), *ranges(vehicle))


@kernel
def gravity_direction(phi, theta):
    """Direction of gravity in body axes."""
    return (
        -math.sin(theta),
        math.cos(theta) * math.sin(phi),
        math.cos(theta) * math.cos(phi),
    )


@kernel
def allocate_roll(tau_p, phi, theta, params):
    """Rotation mu (rad) of the roll mass that makes the roll moment ``tau_p`` (N m).

    A sin mu - B cos mu = tau_p + g s_z g_y with A = m_p R g g_z and B = m_p R g g_y.
    Held within the range; out of reach, the end of the range on the demanded side.
    """
    _, g_y, g_z = gravity_direction(phi, theta)
    mass = params.mass
    lever = mass.m_p * mass.R_p * GRAVITY
    a, b = lever * g_z, lever * g_y
    demand = (tau_p + GRAVITY * mass.s_z * g_y) / max(math.sqrt(a * a + b * b), 1e-9)
    mu = math.asin(min(1.0, max(-1.0, demand))) + math.atan2(b, a)
    return min(params.mu_max, max(-params.mu_max, mu))


@kernel
def allocate_pitch(tau_q, m_b, mu, phi, theta, params):
    """Position x_p (m from neutral) of the pitch mass that makes the pitch moment ``tau_q``.

    x_p = (S_z g_x - tau_q / g) / (g_z m_p) - (s_x + m_b x_b) / m_p - x_0, held within the range,
    beside oil that makes a net heaviness m_b (kg).
    """
    g_x, _, g_z = gravity_direction(phi, theta)
    mass = params.mass
    _, _, s_z = first_moments(m_b, 0.0, mu, mass)
    s_x = (s_z * g_x - tau_q / GRAVITY) / max(g_z, SMALLEST_G_Z)
    return mass_place(s_x, m_b, params.x_p_max, mass)


@kernel
def limit_surface(delta, params):
    """Angle (rad) of the steering surface, held within the range."""
    return math.copysign(params.delta_max, delta) if abs(delta) > params.delta_max else delta


@kernel
def moments(m_b, x_p, mu, phi, theta, params):
    """Roll and pitch moment (N m) that oil and given positions of the moving mass make."""
    g_x, g_y, g_z = gravity_direction(phi, theta)
    s_x, s_y, s_z = first_moments(m_b, x_p, mu, params.mass)
    return GRAVITY * (s_y * g_z - s_z * g_y), GRAVITY * (s_z * g_x - s_x * g_z)
