# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""A fin at the tail that turns about its vertical axis, as that of a Slocum.

The force on it is normal to its chord, as in the MMG model of a ship's rudder (Yasukawa and
Yoshimura, 2015, "Introduction of MMG standard method for ship maneuvering predictions", J. Mar.
Sci. Technol. 20, 37-52, eq. 12 and 14) without what a hull and a propeller in front of it change:

    F_N = rho/2 S a U_f^2 sin(alpha_f),   U_f sin(alpha_f) = u_f sin(delta) + v_f cos(delta)
    X = -F_N sin(delta),   Y = -F_N cos(delta),   u_f = u + z_f q,   v_f = v + x_f r - z_f p

with the slope a = 6.13 A / (A + 2.25) of an aspect ratio A (Fujii). It takes energy at any angle
and in any attitude. What the hull's coefficients say of sideslip is without the fin.
"""

import math
from typing import NamedTuple

from glider_base.kernel import kernel
from glider_base.signals import SEA_WATER_DENSITY
from glider_model.vehicle.quantity import optional, required
from glider_model.vehicle.surface import SurfaceSettings, surface_loads


class FinSettings(SurfaceSettings):
    """Tail fin."""

    area: required('m^2', 'of one side', gt=0.0, le=1.0)
    lift_slope: required(
        '1/rad', '6.13 A / (A + 2.25) by aspect ratio A', gt=0.0, le=round(2.0 * math.pi, 4)
    )
    x: required('m', 'where it is, ahead of the centre of buoyancy', ge=-10.0, lt=0.0)
    z: optional('m', 'the same below; on the x axis without', ge=-2.0, le=2.0)
    turn_rate: required(
        'rad s/m^2',
        'turn rate over sin(angle) and squared speed in a steady turn; control begins with it',
        gt=0.0,
        le=100.0,
    )

    def params(self) -> 'FinParams':
        """Kernel parameters."""
        slope = 0.5 * SEA_WATER_DENSITY * self.area.value * self.lift_slope.value
        return FinParams(slope, self.x.value, self.z.value if self.z else 0.0)


class FinParams(NamedTuple):
    """A fin as the kernels see it."""

    slope: float  #: rho/2 S a (kg/m)
    x: float  #: (m, + forward)
    z: float  #: (m, + down)


@surface_loads.body(FinParams)
@kernel
def fin_loads(loads, u, v, w, p, q, r, delta, params):
    """Loads on hull and fin: see `surface_loads`."""
    t_x, t_y, t_z, m_x, m_y, m_z = loads
    s, c = math.sin(delta), math.cos(delta)
    u_f = u + params.z * q
    v_f = v + params.x * r - params.z * p
    normal = params.slope * math.sqrt(u_f * u_f + v_f * v_f) * (u_f * s + v_f * c)
    f_x, f_y = -normal * s, -normal * c
    return (
        t_x + f_x,
        t_y + f_y,
        t_z,
        m_x - params.z * f_y,
        m_y + params.z * f_x,
        m_z + params.x * f_y,
    )
