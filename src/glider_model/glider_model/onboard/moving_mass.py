# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""What a scale and a ruler tell of the moving mass, and the first moments that it makes."""

import math
from typing import NamedTuple

from glider_model.base.kernel import kernel
from glider_model.vehicle.file import VehicleParams


class MovingMass(NamedTuple):
    """The moving mass, and the first moments of the hull."""

    s_x: float  #: first moment of the hull (kg m)
    s_z: float
    m_p: float  #: moving mass (kg)
    x_p0: float  #: its neutral position (m)
    R_p: float  #: its radius (m)


def make_moving_mass(vehicle: VehicleParams) -> MovingMass:
    """Moving mass of a vehicle."""
    return MovingMass(vehicle.s_x, vehicle.s_z, vehicle.m_p, vehicle.x_p0, vehicle.R_p)


@kernel
def first_moments(x_p, mu, mass):
    """First moments (kg m, 3) of hull and mass, the latter ``x_p`` (m) from neutral, turned by mu.

    S_x = s_x + m_p (x_0 + x_p),  S_y = m_p R sin mu,  S_z = s_z + m_p R cos mu
    """
    return (
        mass.s_x + mass.m_p * (mass.x_p0 + x_p),
        mass.m_p * mass.R_p * math.sin(mu),
        mass.s_z + mass.m_p * mass.R_p * math.cos(mu),
    )
