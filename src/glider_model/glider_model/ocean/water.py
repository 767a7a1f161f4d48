# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""The water of a mission beside its current: density, bottom, and what the wind does to a vehicle.

At the surface wind and waves carry a vehicle along by a share of the wind, some hundredths: leeway
and Stokes drift together. It is as if the water there went faster by that much.
"""

import math
from pathlib import Path
from typing import Any

import pydantic
from pydantic import Field

from glider_base.errors import ConfigurationError
from glider_base.kernel import kernel
from glider_base.settings import number
from glider_base.signals import Vector, Water
from glider_model.ocean.bottom import NO_BOTTOM, FlatBottom
from glider_model.ocean.cast import CastParams, cast_params, check_cast, read_cast
from glider_model.ocean.columns import MAX_ROWS
from glider_model.ocean.density import DensityParams, DensitySettings

#: The drift of wind is whole above the first depth, and there is none below the second (m).
WIND_WHOLE_M, WIND_NONE_M = 0.5, 1.5
#: Density of a cast falls with depth by no more than this (kg/m^3): the density inversion test of
#: the Argo quality control manual (test 14, doi 10.13155/33951).
INVERSION_KGPM3 = 0.03


class WaterSettings(DensitySettings):
    """Density of the water, depth of its bottom, and wind.

    A file of measured water is read when the settings are validated and lives on as its rows, so
    that validated settings need no file. Its path is relative to the folder named ``folder`` in
    the validation context, and to the working directory if there is none.
    """

    profile: list[list[float]] | None = Field(
        None,
        min_length=1,
        max_length=MAX_ROWS,
        description='measured water instead of the pycnocline: a CSV file with the columns '
        'depth_m and density_kgpm3, or temperature_degC and salinity_psu, or all of them; or a '
        'NetCDF cast (.nc); or rows of [depth (m), density (kg/m^3)] and optionally temperature '
        '(degC), by increasing depth',
    )
    bottom_m: float = number(0.0, (0.0, 12000.0), 'depth of a flat bottom (m); 0: none')
    wind_mps: float = number(0.0, (0.0, 40.0), 'speed of the wind (m/s)')
    wind_from_deg: float = number(
        0.0, (-360.0, 360.0), 'where the wind comes from (deg, clockwise from north)'
    )
    leeway_share: float = number(
        0.02, (0.0, 0.05), 'drift by wind and waves of a vehicle at the surface, over the wind (-)'
    )

    @pydantic.field_validator('profile', mode='before')
    @classmethod
    def _read_file(cls, profile: Any, info: pydantic.ValidationInfo):
        if not isinstance(profile, str):
            return profile
        return read_cast(Path((info.context or {}).get('folder', '')) / profile)

    @pydantic.model_validator(mode='after')
    def _check_rows(self):
        if self.profile is None:
            return self
        check_cast(self.profile, range(1, len(self.profile) + 1), 'profile')
        for name in ('pycnocline_rise', 'compression_per_m'):
            if getattr(self, name):
                raise ValueError(
                    f'{name} = {getattr(self, name)!r}: the profile says the density '
                    '(allowed: 0.0 beside a profile)'
                )
        return self

    def check_stable(self) -> None:
        """Refuse measured water that is lighter at depth than above by more than is measured.

        Raises
        ------
        ConfigurationError
        """
        heaviest = (0.0, 0.0)
        for depth, density, *_ in self.profile or ():
            if heaviest[1] - density > INVERSION_KGPM3:
                raise ConfigurationError(
                    f'water.profile: {density:g} kg/m^3 at {depth:g} m is lighter than '
                    f'{heaviest[1]:g} kg/m^3 at {heaviest[0]:g} m: such water turns over '
                    f'(allowed: lighter by <= {INVERSION_KGPM3:g} kg/m^3)'
                )
            heaviest = max(heaviest, (depth, density), key=lambda row: row[1])

    def params(self) -> DensityParams | CastParams:
        """Kernel parameters of the density; their type says how it is told."""
        if self.profile is None:
            return super().params()
        return cast_params(self.profile, self.hull_compression_per_m)

    def bottom(self) -> FlatBottom:
        """Kernel parameters of the bottom."""
        return FlatBottom(self.bottom_m) if self.bottom_m else NO_BOTTOM

    def wind_drift(self) -> Vector:
        """Drift by wind and waves at the surface (m/s)."""
        speed, to = self.leeway_share * self.wind_mps, math.radians(self.wind_from_deg + 180.0)
        return Vector(speed * math.cos(to), speed * math.sin(to)) if speed else NO_DRIFT


NO_DRIFT = Vector(0.0, 0.0)


@kernel
def with_wind(water, depth, drift):
    """Velocity of the water as it carries a vehicle at a depth (m) along; below, the very same."""
    if depth >= WIND_NONE_M or (drift.n == 0.0 and drift.e == 0.0):
        return water
    share = min(1.0, (WIND_NONE_M - depth) / (WIND_NONE_M - WIND_WHOLE_M))
    return Water(water.v_n + share * drift.n, water.v_e + share * drift.e, water.v_d)
