# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""The water of a mission beside its current: density, bottom, and what the wind does to a vehicle.

The density is given by some numbers, by a cast, or by temperature and salinity of an ocean model,
in a file as CMEMS or HYCOM write it. Of these become density, by TEOS-10, and temperature in
place. Between the points of the grid both are linear in place, depth and time; beyond its levels
they are those of the first or the last.

At the surface wind and waves carry a vehicle along by a share of the wind, some hundredths: leeway
and Stokes drift together. It is as if the water there went faster by that much.
"""

import functools
import math
from typing import Any, ClassVar, NamedTuple

import numpy as np
import pydantic
from pydantic import Field

from glider_base.errors import ConfigurationError
from glider_base.frames import from_geodetic, on_chart
from glider_base.kernel import kernel, replace
from glider_base.settings import named, number
from glider_base.signals import SEA_WATER_DENSITY, Vector, Water
from glider_base.slot import only_for
from glider_model.ocean.bottom import NO_BOTTOM, FlatBottom
from glider_model.ocean.cast import CastParams, cast_params, check_cast, density_of, read_cast
from glider_model.ocean.columns import MAX_ROWS
from glider_model.ocean.density import (
    SPECIFIC_WEIGHT,
    DensityParams,
    DensitySettings,
    displacing,
    immersed,
)
from glider_model.ocean.fields.grid import GridFileSettings, GridParams, interpolate
from glider_model.ocean.grid_file import POTENTIAL

#: The drift of wind is whole above the first depth, and there is none below the second (m).
WIND_WHOLE_M, WIND_NONE_M = 0.5, 1.5
#: Density of a cast falls with depth by no more than this (kg/m^3): the density inversion test of
#: the Argo quality control manual (test 14, doi 10.13155/33951).
INVERSION_KGPM3 = 0.03


class ModelWaterParams(NamedTuple):
    """Water of a model as the kernels see it, at a place and time."""

    grid: GridParams  #: of rho / rho_0 - 1, of `SEA_WATER_DENSITY`, and temperature (degC)
    surface: float  #: the first at the surface where and when the mission begins
    hull_compression: float  #: of a vehicle whose file has no volume (1/Pa)
    n: float  #: where the vehicle is (m)
    e: float
    t_s: float


class ModelWaterSettings(GridFileSettings):
    """Temperature and salinity of an ocean model, from a file."""

    of: ClassVar[str] = 'water'

    def params(self, hull_compression_per_m: float) -> ModelWaterParams:
        """Kernel parameters.

        A ValueError names the file, and what of it or of the mission is at fault.
        """
        grid = super().params()._replace(water=_density(self, self.stamp))
        n, e = 0.0, 0.0
        if self.mission.places:
            n, e = from_geodetic(*self.mission.places[0], grid.origin)
        made = ModelWaterParams(
            grid=grid,
            surface=0.0,
            hull_compression=hull_compression_per_m / SPECIFIC_WEIGHT,
            n=n,
            e=e,
            t_s=0.0,
        )
        return made._replace(surface=water_there(0.0, made)[0])


@functools.lru_cache(maxsize=4)
def _density(settings: ModelWaterSettings, stamp: tuple[int, int]) -> np.ndarray:
    """The water of the params, of a version of a file."""
    loaded, _ = settings.loaded()
    temperature, salinity = (loaded.water[..., i].astype(float) for i in range(2))
    depths = loaded.axes.depths[:, None, None]
    density, temperature = density_of(
        f'file {settings.file}', depths, temperature, salinity, loaded.standards[0] == POTENTIAL
    )
    water = np.stack((density / SEA_WATER_DENSITY - 1.0, temperature), axis=-1)
    return water.astype(np.float32)


@kernel
def water_there(depth, params):
    """Density over `SEA_WATER_DENSITY`, less 1, and temperature (degC) at a depth (m)."""
    latitude, longitude = on_chart(params.n, params.e, params.grid.origin)
    return interpolate(params.t_s, depth, latitude, longitude, params.grid)


@immersed.body(ModelWaterParams)
@kernel
def _in_model_water(depth, m_b, vehicle, params):
    """Of a vehicle without a volume neutral at the surface where and when the mission begins."""
    rise, temperature = water_there(max(depth, 0.0), params)
    volume, compressibility = vehicle.volume, vehicle.compressibility
    if volume == 0.0:
        volume = vehicle.m / (SEA_WATER_DENSITY * (1.0 + params.surface))
        compressibility = params.hull_compression
    warmer = temperature - vehicle.reference_temperature
    return displacing(m_b, volume, compressibility, warmer, 1.0 + rise, depth, vehicle)


@only_for(ModelWaterParams, lambda whole, n, e, t_s, params: whole)
@kernel
def around(whole, n, e, t_s, params):
    """Something with ``density``, the params of the water, at a place (m) and time (s)."""
    return replace(whole, density=replace(params, n=n, e=e, t_s=t_s))


class WaterSettings(DensitySettings):
    """Density of the water, depth of its bottom, and wind.

    A file of measured water is read when the settings are validated and lives on as its rows, so
    that validated settings need no file. It lies in the folder named ``folder`` in the validation
    context, or in the working directory.
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
    grid: ModelWaterSettings = Field(
        ModelWaterSettings(),
        description='temperature and salinity of an ocean model instead of the pycnocline',
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
        return read_cast(named(profile, info))

    @pydantic.model_validator(mode='after')
    def _check_rows(self):
        if self.profile is None and not self.grid.file:
            return self
        source = 'grid' if self.grid.file else 'profile'
        if self.profile is not None:
            check_cast(self.profile, range(1, len(self.profile) + 1), 'profile')
            if self.grid.file:
                raise ValueError('profile: the grid says the density (allowed: one of them)')
        for name in ('pycnocline_rise', 'compression_per_m'):
            if getattr(self, name):
                raise ValueError(
                    f'{name} = {getattr(self, name)!r}: the {source} says the density '
                    f'(allowed: 0.0 beside a {source})'
                )
        return self

    def check_stable(self) -> None:
        """Refuse measured water that is lighter at depth than above by more than is measured.

        Raises ConfigurationError.
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

    def params(self) -> DensityParams | CastParams | ModelWaterParams:
        """Kernel parameters of the density; their type says how it is given."""
        if self.grid.file:
            return self.grid.params(self.hull_compression_per_m)
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
