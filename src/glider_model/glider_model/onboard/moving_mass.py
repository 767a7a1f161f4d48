# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""What a scale and a ruler tell of the moving mass: first moments, and what rights a vehicle.

The oil of a buoyancy engine away from the centre of buoyancy makes a first moment too. At rest the
weight below its buoyancy rights a vehicle. Under way the slip rolls it too, by its dihedral: back
in the dive, further over in the climb. S_z + m_b K_MR / K_beta (docs/theory.md, 3) tells both; if
it is less than nothing it rolls over by itself.
"""

import math
from typing import NamedTuple

from glider_base.kernel import kernel
from glider_model.vehicle.file import VehicleParams


class MovingMass(NamedTuple):
    """The moving mass, and the first moments of the hull."""

    s_x: float  #: first moment of the hull (kg m)
    s_z: float
    m_p: float  #: moving mass (kg)
    x_p0: float  #: its neutral position (m)
    R_p: float  #: its radius (m)
    pump_x: float  #: where the buoyancy engine is (m, + forward)


def make_moving_mass(vehicle: VehicleParams) -> MovingMass:
    """Moving mass of a vehicle."""
    return MovingMass(*(getattr(vehicle, name) for name in MovingMass._fields))


@kernel
def mass_place(s_x, m_b, x_p_max, mass):
    """Position x_p (m from neutral) where hull, mass and oil have the first moment ``s_x`` (kg m).

    Held within the range (m), beside oil that makes a net heaviness m_b (kg). With 0.0 the
    vehicle lies level.
    """
    x_p = (s_x - mass.s_x - m_b * mass.pump_x) / mass.m_p - mass.x_p0
    return min(x_p_max, max(-x_p_max, x_p))


@kernel
def first_moments(m_b, x_p, mu, mass):
    """First moments (kg m, 3) of hull, mass and oil.

    The mass is ``x_p`` (m) from neutral and turned by mu, the oil makes a net heaviness m_b (kg).

    S_x = s_x + m_p (x_0 + x_p) + m_b x_b,  S_y = m_p R sin mu,  S_z = s_z + m_p R cos mu
    """
    return (
        mass.s_x + mass.m_p * (mass.x_p0 + x_p) + m_b * mass.pump_x,
        mass.m_p * mass.R_p * math.sin(mu),
        mass.s_z + mass.m_p * mass.R_p * math.cos(mu),
    )


class Righting(NamedTuple):
    """What rights a vehicle at rest, and what its slip adds to that."""

    at_rest: float  #: S_z with the roll mass in the middle (kg m)
    lever: float  #: roll moment of a slip over its side force, K_MR / K_beta (m)


def make_righting(vehicle: VehicleParams) -> Righting:
    """Righting of a vehicle; without side force no slip is of account."""
    lever = vehicle.K_MR / vehicle.K_beta if vehicle.K_beta else 0.0
    return Righting(vehicle.s_z + vehicle.m_p * vehicle.R_p, lever)


@kernel
def rights_itself(m_b, share, righting):
    """Whether a glide with net heaviness m_b (kg) leaves this share of the righting at rest."""
    return righting.at_rest + m_b * righting.lever >= share * righting.at_rest
