# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""The current of an ocean model, from a NetCDF file as CMEMS or HYCOM write it.

Between the points of the grid it is linear in place, depth and time; beyond its levels it is that
of the first or the last. What the file does not cover is refused before the flight. A vehicle that
is carried out of it finds the water of its edge.
"""

import functools
import math
from pathlib import Path
from typing import Literal, NamedTuple

import numpy as np
import pydantic
from pydantic import Field

from glider_base.frames import Origin, OriginSettings, on_chart
from glider_base.kernel import kernel
from glider_base.settings import Settings, beside
from glider_model.ocean.field import FieldSettings, Mission, bracket, field_velocity
from glider_model.ocean.grid_file import (
    VELOCITIES,
    Loaded,
    Wanted,
    Window,
    fingerprint,
    load,
)

#: Water around the path that is read too, as far as the file has it (m).
MARGIN_M = 150_000.0


class GridFileSettings(Settings):
    """A file with a grid on the chart of a mission."""

    file: str = Field(
        '', max_length=4000, description='NetCDF file, relative to the folder of the scenario.'
    )
    fingerprint: str = Field(
        '', description='Of the file, where another one is refused; a flown scenario has it.'
    )
    mission: Mission = Field(
        Mission(), description='Where and when it is flown; a scenario says it.'
    )

    _found = pydantic.field_validator('file')(beside)

    def resolved(self, mission: Mission) -> 'GridFileSettings':
        """Copy that knows where and when it is flown."""
        return self.model_copy(update={'mission': mission})

    def known(self) -> 'GridFileSettings':
        """Copy with the fingerprint of its file.

        Raises
        ------
        ValueError
            If there is no such file, or it is another one.
        """
        found = fingerprint(Path(self.file))
        if self.fingerprint not in ('', found):
            raise ValueError(
                f'file {self.file}: not the one that was flown (its fingerprint is {found}, '
                f'allowed: {self.fingerprint}, or an empty one)'
            )
        return self.model_copy(update={'fingerprint': found})


class GridSettings(GridFileSettings, FieldSettings):
    """The current of an ocean model, from a file."""

    kind: Literal['grid'] = 'grid'

    def land_at(self, norths: np.ndarray, easts: np.ndarray) -> np.ndarray:
        """Where there is land, by the nearest points of the grid, bool[n, m]."""
        loaded, _ = _loaded(self.file, self.mission)
        places = on_chart(norths, easts, self.mission.origin.params())
        nearest = [
            np.abs(axis[None, :] - one[:, None]).argmin(axis=1)
            for axis, one in zip(loaded.axes[2:], places, strict=True)
        ]
        return loaded.land[np.ix_(*nearest)]

    def params(self) -> 'GridParams':
        """Kernel parameters.

        Raises
        ------
        ValueError
            Naming the file, and what of it or of the mission is at fault.
        """
        loaded, begin = _loaded(self.file, self.mission)
        axes = loaded.axes
        return GridParams(
            times=axes.times - begin,
            depths=axes.depths,
            latitudes=axes.latitudes,
            longitudes=axes.longitudes,
            water=loaded.water,
            origin=self.mission.origin.params(),
        )


@functools.lru_cache(maxsize=4)
def _loaded(file: str, mission: Mission) -> tuple[Loaded, float]:
    """What a mission needs of a file, and its start (s since 1970)."""
    return loaded_window(Path(file), mission, VELOCITIES)


def loaded_window(
    path: Path, mission: Mission, wanted: tuple[Wanted, ...]
) -> tuple[Loaded, float]:
    """What a mission needs of a file, and its start (s since 1970); errors as `load`."""
    needed = mission_window(mission)
    loaded = load(path, widened(needed, MARGIN_M), needed, wanted)
    for place in mission.places:
        row, column = (
            int(np.argmin(np.abs(values - one)))
            for values, one in zip(
                loaded.axes[2:], _beside(place, mission.origin.longitude_deg), strict=True
            )
        )
        if loaded.land[row, column]:
            raise ValueError(
                f'file {path}: {place[0]:.4f}, {place[1]:.4f} on the path is land, by the nearest '
                'point of its grid (allowed: water)'
            )
    begin = float(loaded.axes.times[0]) if math.isnan(needed.begin) else needed.begin
    return loaded, begin


def _beside(place: tuple[float, float], longitude: float) -> tuple[float, float]:
    """A place (deg) with its longitude as near to another one as it can be."""
    return place[0], longitude + (place[1] - longitude + 180.0) % 360.0 - 180.0


def mission_window(mission: Mission) -> Window:
    """What of a grid a mission needs, and no more."""
    longitude = mission.origin.longitude_deg
    places = [_beside(one, longitude) for one in mission.places] or [
        (mission.origin.latitude_deg, longitude)
    ]
    latitudes, longitudes = zip(*places, strict=True)
    return Window(
        south=min(latitudes),
        north=max(latitudes),
        west=min(longitudes),
        east=max(longitudes),
        deepest=mission.deepest_m,
        begin=mission.origin.time_s,
        lasts=mission.lasts_s,
    )


def widened(window: Window, margin_m: float) -> Window:
    """The same with a margin around it (m)."""
    middle = OriginSettings(latitude_deg=0.5 * (window.south + window.north)).params()
    north, east = margin_m / middle.north, margin_m / middle.east
    return window._replace(
        south=window.south - north,
        north=window.north + north,
        west=max(window.west - east, 0.5 * (window.west + window.east) - 179.0),
        east=min(window.east + east, 0.5 * (window.west + window.east) + 179.0),
    )


class GridParams(NamedTuple):
    """A grid as the kernel sees it; its axes increase."""

    times: np.ndarray  #: float64[t] (s since the start)
    depths: np.ndarray  #: float64[z] (m)
    latitudes: np.ndarray  #: float64[y] (deg)
    longitudes: np.ndarray  #: float64[x] (deg), around the origin
    water: np.ndarray  #: float32[t, z, y, x, 2], to the north and to the east (m/s)
    origin: Origin


@kernel
def interpolate(t_s, depth, latitude, longitude, params):
    """Velocity of a grid to the north and to the east (m/s), linear between its points."""
    t, t_next, f_t = bracket(t_s, params.times)
    z, z_next, f_z = bracket(depth, params.depths)
    y, y_next, f_y = bracket(latitude, params.latitudes)
    x, x_next, f_x = bracket(longitude, params.longitudes)
    water = params.water
    north, east = 0.0, 0.0
    for i in range(8):
        at_t, w_t = (t_next, f_t) if i & 1 else (t, 1.0 - f_t)
        at_z, w_z = (z_next, f_z) if i & 2 else (z, 1.0 - f_z)
        at_y, w_y = (y_next, f_y) if i & 4 else (y, 1.0 - f_y)
        weight = w_t * w_z * w_y
        if weight > 0.0:
            here, there = water[at_t, at_z, at_y, x], water[at_t, at_z, at_y, x_next]
            north += weight * ((1.0 - f_x) * here[0] + f_x * there[0])
            east += weight * ((1.0 - f_x) * here[1] + f_x * there[1])
    return north, east


@field_velocity.body(GridParams)
@kernel
def grid_velocity(position, t_s, params):
    """Velocity on a grid (m/s): see `field_velocity`."""
    latitude, longitude = on_chart(position[0], position[1], params.origin)
    north, east = interpolate(t_s, position[2], latitude, longitude, params)
    return north, east, 0.0
