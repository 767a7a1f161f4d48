# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""What a scale and a ruler tell of the moving mass, and the first moments that it makes.

The oil of a buoyancy engine that is not at the centre of buoyancy makes one too.
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
