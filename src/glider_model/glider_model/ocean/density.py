# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""Density of the water: stratification, compression of water and hull, and the surface."""

import math
from typing import NamedTuple

from pydantic import Field

from glider_model.base.kernel import kernel
from glider_model.base.settings import Settings

#: Pressure of the air (Pa), and weight of sea water, 1025 kg/m^3 under 9.81 m/s^2 (N/m^3).
SURFACE_PRESSURE, SPECIFIC_WEIGHT = 101325.0, 1025.0 * 9.81


class DensitySettings(Settings):
    """Density of the water relative to the depth at which the vehicle was ballasted (surface)."""

    pycnocline_rise: float = Field(
        0.0,
        ge=0.0,
        le=0.05,
        description='relative density rise across the pycnocline (-); 0.004 is 4 kg/m^3',
    )
    pycnocline_depth_m: float = Field(
        100.0, ge=1.0, le=5000.0, description='e-folding depth of the pycnocline (m)'
    )
    compression_per_m: float = Field(
        0.0,
        ge=0.0,
        le=1e-4,
        description='relative density rise by pressure (1/m); sea water 4.5e-6',
    )
    hull_compression_per_m: float = Field(
        0.0,
        ge=0.0,
        le=1e-4,
        description='relative loss of hull volume with depth (1/m); aluminium 3e-6 to 5e-6',
    )

    def params(self) -> 'DensityParams':
        """Kernel parameters."""
        return DensityParams(
            self.pycnocline_rise,
            1.0 / self.pycnocline_depth_m,
            self.compression_per_m - self.hull_compression_per_m,
        )


class DensityParams(NamedTuple):
    """Density profile as the kernels see it."""

    rise: float  #: relative density rise across the pycnocline
    inverse_depth: float  #: (1/m)
    net_compression: float  #: water less hull (1/m)


@kernel
def buoyancy_gain(depth, mass, density):
    """Extra buoyancy dm(z) (kg) of a vehicle of ``mass`` kg at ``depth`` m."""
    z = max(depth, 0.0)
    rise = (
        density.rise * (1.0 - math.exp(-z * density.inverse_depth)) if density.rise > 0.0 else 0.0
    )
    return mass * (rise + density.net_compression * z)


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
