# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""Density of the water: stratification, compression of water and hull, and the surface.

What a vehicle weighs in it, `immersed`, is a slot by the kind of water: here the one that is given
by three numbers, in `glider_model.ocean.cast` a measured one.
"""

import math
from typing import NamedTuple

from glider_base.kernel import kernel
from glider_base.settings import Settings, number
from glider_base.signals import SEA_WATER_DENSITY
from glider_base.slot import slot

#: Pressure of the air (Pa), and weight of sea water under 9.81 m/s^2 (N/m^3).
SURFACE_PRESSURE, SPECIFIC_WEIGHT = 101325.0, SEA_WATER_DENSITY * 9.81


class DensitySettings(Settings):
    """Density of the water relative to the depth at which the vehicle was ballasted (surface)."""

    pycnocline_rise: float = number(
        0.0, (0.0, 0.05), 'relative density rise across the pycnocline (-); 0.004 is 4 kg/m^3'
    )
    pycnocline_depth_m: float = number(
        100.0, (1.0, 5000.0), 'e-folding depth of the pycnocline (m)'
    )
    compression_per_m: float = number(
        0.0, (0.0, 1e-4), 'relative density rise by pressure (1/m); sea water 4.5e-6'
    )
    hull_compression_per_m: float = number(
        0.0,
        (0.0, 1e-4),
        'relative loss of hull volume with depth (1/m); aluminium 3e-6 to 5e-6. Of no account for '
        'a vehicle whose file has a volume',
    )

    def params(self) -> 'DensityParams':
        """Kernel parameters."""
        return DensityParams(
            self.pycnocline_rise,
            1.0 / self.pycnocline_depth_m,
            self.compression_per_m - self.hull_compression_per_m,
            self.compression_per_m,
        )


class DensityParams(NamedTuple):
    """Density profile as the kernels see it."""

    rise: float  #: relative density rise across the pycnocline
    inverse_depth: float  #: (1/m)
    net_compression: float  #: water less hull (1/m)
    compression: float  #: of the water (1/m)


class Immersed(NamedTuple):
    """A vehicle in the water."""

    net: float  #: its net weight (kg, + sinks)
    oil: float  #: what of that the buoyancy engine makes, where it is (kg, + sinks)
    ratio: float  #: density of the water over `SEA_WATER_DENSITY` (-)


@slot
def immersed(depth, m_b, vehicle, params):
    """What a vehicle (`VehicleParams`) weighs at a depth (m), by the type of the water's params.

    It is `Immersed`; above the surface as at it. ``m_b`` is the net heaviness by the buoyancy
    engine in water of `SEA_WATER_DENSITY` (kg, + sinks).
    """


@kernel
def displacing(m_b, volume, compressibility, warmer, ratio, depth, vehicle):
    """What a vehicle of a volume weighs, `Immersed`: Merckelbach et al. (2019).

    m_net = m - rho (V (1 - eps P + a_T (T - T_0)) + V_b),  V_b = -m_b / rho_0,  P over the surface

    The volume V (m^3) is that at the surface and at T_0, the compressibility eps in 1/Pa,
    ``warmer`` T - T_0 (K), the ratio rho / rho_0 with rho_0 = `SEA_WATER_DENSITY`; the rest
    is as of `immersed`.
    """
    pressure = SPECIFIC_WEIGHT * max(depth, 0.0)
    stretch = 1.0 - compressibility * pressure + vehicle.thermal_expansion * warmer
    oil = m_b * ratio
    hull = vehicle.m - SEA_WATER_DENSITY * ratio * volume * stretch
    return Immersed(oil + vehicle.ballast + hull, oil, ratio)


@kernel
def density_rise(z, density):
    """Relative rise of the density by the pycnocline from the surface to a depth z >= 0 (m)."""
    if density.rise > 0.0:
        return density.rise * (1.0 - math.exp(-z * density.inverse_depth))
    return 0.0


@kernel
def buoyancy_gain(depth, mass, density):
    """Extra buoyancy dm(z) (kg) of a vehicle of ``mass`` kg at ``depth`` m."""
    z = max(depth, 0.0)
    return mass * (density_rise(z, density) + density.net_compression * z)


@immersed.body(DensityParams)
@kernel
def _in_given_water(depth, m_b, vehicle, params):
    """Of a vehicle without a volume neutral at the surface, with coefficients as they are."""
    if vehicle.volume == 0.0:
        gain = buoyancy_gain(depth, vehicle.m, params)
        return Immersed(m_b + vehicle.ballast - gain, m_b, 1.0)
    z = max(depth, 0.0)
    ratio = 1.0 + density_rise(z, params) + params.compression * z
    return displacing(m_b, vehicle.volume, vehicle.compressibility, 0.0, ratio, depth, vehicle)


@kernel
def emerged_fraction(depth, radius):
    """Fraction of the hull above the surface: 0 below ``radius``, 1 above ``-radius`` (m)."""
    if depth >= radius:
        return 0.0
    out = min(1.0, (radius - depth) / (2.0 * radius))
    return out * out * (3.0 - 2.0 * out)


@kernel
def pressure_at(depth):
    """Absolute pressure (Pa) at a depth (m), in water of one density."""
    return SURFACE_PRESSURE + SPECIFIC_WEIGHT * depth


@kernel
def depth_at(pressure):
    """Depth (m) of an absolute pressure (Pa), in water of one density."""
    return (pressure - SURFACE_PRESSURE) / SPECIFIC_WEIGHT
