# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""The current of an ocean model, from a NetCDF file as CMEMS or HYCOM write it.

Between the points of the grid it is linear in place, depth and time; beyond its levels it is that
of the first or the last. What the file does not cover is refused before the flight. A vehicle that
is carried out of it finds the water of its edge.
"""

import functools
import math
import os
from collections.abc import Iterable
from pathlib import Path
from typing import ClassVar, Literal, NamedTuple

import numpy as np
import pydantic
from pydantic import Field

from glider_base.errors import ConfigurationError
from glider_base.frames import Origin, OriginSettings, on_chart, within_180
from glider_base.kernel import kernel
from glider_base.settings import Settings, beside
from glider_model.ocean.field import FieldSettings, Mission, bracket, field_velocity
from glider_model.ocean.grid_file import EDGE_DEG, GRIDS, Loaded, Window, fingerprint, load

#: Water, or bottom, around the path that is read too, as far as the file has it (m).
MARGINS_M = {'currents': 150_000.0, 'water': 150_000.0, 'bottom': 50_000.0}


class GridFileSettings(Settings):
    """A file with a grid on the chart of a mission."""

    of: ClassVar[str] = 'currents'  #: which of `GRIDS` is read

    file: str = Field(
        '',
        max_length=4000,
        description='NetCDF file, beside the scenario, or else in the working folder.',
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

    @property
    def stamp(self) -> tuple[int, int]:
        """What tells another version of its file: time of the last change (ns), and size.

        Raises ConfigurationError if the file is not the one that was flown.
        """
        if self.fingerprint:
            self.known()
        try:
            status = os.stat(self.file)
        except OSError:  # who reads it says so
            return 0, 0
        return status.st_mtime_ns, status.st_size

    def loaded(self) -> tuple[Loaded, float]:
        """What a mission needs of its file, and its start (s since 1970); errors as `load`."""
        return _loaded(self.file, self.stamp, self.mission, self.of)

    @property
    def start_s(self) -> float | None:
        """Start of a mission (s since 1970); None if its file has the water of one time."""
        loaded, start_s = self.loaded()
        return start_s if len(loaded.axes.times) > 1 else None

    def is_land(self, loaded: Loaded, place: tuple[float, float]) -> bool:
        """Whether there is land at a place (deg) of what is read: at the nearest of its points."""
        axes = zip(loaded.axes[2:], place, strict=True)
        return bool(loaded.land[tuple(np.abs(axis - one).argmin() for axis, one in axes)])

    def check_places(self, places: Iterable[tuple[float, float]], what: str) -> None:
        """Refuse places (deg) that are on land, or beyond what is read around the path.

        A ConfigurationError names the file, the place, and ``what`` it is: such as 'on the path'.
        """
        loaded, _ = self.loaded()
        latitudes, longitudes = loaded.axes[2:]
        for place in places:
            at = _beside(place, self.mission.origin.longitude_deg)
            where = f'file {self.file}: {place[0]:.4f}, {place[1]:.4f} {what} is'
            axes = zip(at, (latitudes, longitudes), strict=True)
            if not all(axis[0] - EDGE_DEG <= one <= axis[-1] + EDGE_DEG for one, axis in axes):
                raise ConfigurationError(
                    f'{where} beyond what is read of it (allowed: within {latitudes[0]:.3f} to '
                    f'{latitudes[-1]:.3f}, {longitudes[0]:.3f} to {longitudes[-1]:.3f}, around '
                    'the path as far as it has water)'
                )
            if self.is_land(loaded, at):
                raise ConfigurationError(f'{where} land (allowed: water)')

    def params(self) -> 'GridParams':
        """Kernel parameters: what was read of the file.

        A ConfigurationError names the file, and what of it or of the mission is at fault.
        """
        loaded, begin = self.loaded()
        self.check_places(self.mission.places, 'on the path')
        (times, *others), origin = loaded.axes, self.mission.origin.params()
        return GridParams(times - begin, *others, loaded.water, origin)

    def known(self) -> 'GridFileSettings':
        """Copy with the fingerprint of its file.

        Raises ConfigurationError if there is no such file, or it is another one.
        """
        found = fingerprint(Path(self.file))
        if self.fingerprint not in ('', found):
            raise ConfigurationError(
                f'file {self.file}: not the one that was flown (its fingerprint is {found}, '
                f'allowed: {self.fingerprint}, or an empty one)'
            )
        return self.model_copy(update={'fingerprint': found})


class GridSettings(GridFileSettings, FieldSettings):
    """The current of an ocean model, from a file."""

    kind: Literal['grid'] = 'grid'

    def land_at(self, norths: np.ndarray, easts: np.ndarray) -> np.ndarray:
        """Where there is land, by the nearest points of the grid, bool[n, m]."""
        loaded, _ = self.loaded()
        places = on_chart(norths, easts, self.mission.origin.params())
        nearest = [
            np.abs(axis[None, :] - one[:, None]).argmin(axis=1)
            for axis, one in zip(loaded.axes[2:], places, strict=True)
        ]
        return loaded.land[np.ix_(*nearest)]


@functools.lru_cache(maxsize=8)
def _loaded(file: str, stamp: tuple[int, int], mission: Mission, of: str) -> tuple[Loaded, float]:
    """What a mission needs of a version of a file, and its start (s since 1970)."""
    needed = mission_window(mission)
    window = widened(needed, MARGINS_M[of])
    begin_s, lasts_s = window.begin - mission.earlier_s, window.lasts + mission.earlier_s
    window = window._replace(begin=begin_s, lasts=lasts_s)
    loaded = load(Path(file), window, needed, GRIDS[of])
    begin = float(loaded.axes.times[0]) if math.isnan(needed.begin) else needed.begin
    return loaded, begin


def _beside(place: tuple[float, float], longitude: float) -> tuple[float, float]:
    """A place (deg) with its longitude as near to another one as it can be."""
    return place[0], longitude + within_180(place[1] - longitude)


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
    water: np.ndarray  #: float32[t, z, y, x, 2]; a current to the north and to the east (m/s)
    origin: Origin


@kernel
def interpolate(t_s, depth, latitude, longitude, params):
    """Both numbers of a grid, such as a velocity north and east (m/s), linear between points."""
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
