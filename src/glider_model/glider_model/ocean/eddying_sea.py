# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""Seas full of eddies, made up and written as CMEMS writes them: to fly in without a download.

The sum of Gaussian eddies, each of a stream function A exp(-r^2 / 2 R^2), carried along with its
centre and weaker with depth. No water is made or lost; nothing else of it is real.
"""

import math
from pathlib import Path

import numpy as np
from pydantic import Field

from glider_base.settings import Settings, matching, number

#: Levels (m), steps of grid (deg) and time (s), and what an integer of the file stands for (m/s).
_DEPTHS = (0.5, 10.0, 30.0, 75.0, 150.0, 300.0, 500.0, 750.0, 1050.0)
_STEP_DEG, _UNIT = 1.0 / 6.0, 2e-4
#: Length of a degree of latitude (km).
_DEGREE_KM = 111.2
#: Eddies on a square degree, and how far beyond the sea there are some (km).
_A_DEGREE, _BEYOND_KM = 4.0, 60.0
#: The seed of the eddies of a forecast's error is so much larger.
_ERROR_SEED = 2**32


class EddyingSea(Settings):
    """What a made-up sea is like."""

    seed: int = number(0, (0, 2**31 - 1), 'seed of its eddies (1)')
    rms_mps: float = number(0.18, (0.0, 1.0), 'rms of each part at the top (m/s)')
    error_mps: float = number(
        0.0,
        (0.0, 1.0),
        'rms of each part of the depth mean of more eddies, which are not in the sea of the same '
        'seed: a forecast of it (m/s)',
    )
    radius_km: float = number(35.0, (10.0, 200.0), 'R of its eddies, about (km)')
    decay_m: float = number(600.0, (50.0, 5000.0), 'depth of 1/e (m)')
    days: int = number(16, (1, 400), 'days from its first time to its last (1)')
    start: str = Field(
        '2026-03-01',
        pattern=matching(r'^\d{4}-\d\d-\d\d$', 'a day such as 2026-03-01'),
        description='its first time',
    )
    south_deg: float = number(34.9, (-80.0, 80.0), 'its edges (deg)')
    north_deg: float = number(37.7, (-80.0, 80.0), 'its edges (deg)')
    west_deg: float = number(120.3, (-180.0, 360.0), 'its edges (deg)')
    east_deg: float = number(123.5, (-180.0, 360.0), 'its edges (deg)')


def currents(sea: EddyingSea) -> tuple[dict[str, np.ndarray], np.ndarray, np.ndarray]:
    """Axes of a sea by name, and its velocities to the east and to the north (m/s).

    Axes are time (hours since the start), depth (m), latitude and longitude (deg), in the order of
    the velocities' dimensions. With an error they are those of a forecast of the sea.
    """
    rng = np.random.default_rng(sea.seed)
    latitude = np.arange(sea.south_deg, sea.north_deg + 1e-9, _STEP_DEG)
    longitude = np.arange(sea.west_deg, sea.east_deg + 1e-9, _STEP_DEG)
    days, depth = np.arange(sea.days + 1.0), np.array(_DEPTHS)
    shrunk = math.cos(math.radians(float(latitude.mean())))
    x = _DEGREE_KM * shrunk * (longitude - longitude.mean())[None, None, :]
    y = _DEGREE_KM * (latitude - latitude.mean())[None, :, None]
    half_x, half_y = x.max() + _BEYOND_KM, y.max() + _BEYOND_KM
    count = round(_A_DEGREE * 4.0 * half_x * half_y / (_DEGREE_KM**2 * shrunk))
    centre_x, centre_y = (rng.uniform(-half, half, count) for half in (half_x, half_y))
    radius = sea.radius_km * rng.uniform(0.7, 1.4, count)
    strength = rng.standard_normal(count) * radius
    drift_x, drift_y = rng.normal(-3.5, 2.0, count), rng.normal(0.0, 2.0, count)  # km a day
    east, north = (np.zeros((len(days), len(latitude), len(longitude))) for _ in range(2))
    for k in range(count):
        away_x = x - centre_x[k] - (drift_x[k] * days)[:, None, None]
        away_y = y - centre_y[k] - (drift_y[k] * days)[:, None, None]
        squared = radius[k] ** 2
        bell = strength[k] / squared * np.exp(-(away_x**2 + away_y**2) / (2.0 * squared))
        east += bell * away_y
        north -= bell * away_x
    scale = sea.rms_mps / max(1e-12, math.sqrt(0.5 * np.mean(east**2 + north**2)))
    weaker = np.exp(-depth / sea.decay_m)[None, :, None, None]
    axes = {'time': 24.0 * days, 'depth': depth, 'latitude': latitude, 'longitude': longitude}
    east, north = scale * east[:, None] * weaker, scale * north[:, None] * weaker
    if sea.error_mps:
        deepest = _DEPTHS[-1] / sea.decay_m
        mean = -math.expm1(-deepest) / deepest  # of what is 1 at the top, over depth
        more = {'seed': sea.seed + _ERROR_SEED, 'rms_mps': sea.error_mps / mean, 'error_mps': 0.0}
        _, wrong_east, wrong_north = currents(sea.model_copy(update=more))
        east, north = east + wrong_east, north + wrong_north
    return axes, east, north


def write_sea(sea: EddyingSea, path: Path) -> None:
    """Write a sea as CMEMS does: NetCDF with packed integers, names and units of CF."""
    import xarray

    axes, east, north = currents(sea)
    about = {
        'time': {'units': f'hours since {sea.start}', 'calendar': 'standard'},
        'depth': {'units': 'm', 'positive': 'down'},
        'latitude': {'units': 'degrees_north'},
        'longitude': {'units': 'degrees_east'},
    }
    coords = {
        name: (name, values, {'standard_name': name, **about[name]})
        for name, values in axes.items()
    }
    packed = {'dtype': 'int16', 'scale_factor': _UNIT, '_FillValue': np.int16(-32767)}
    variables = {
        name: (
            tuple(axes),
            values,
            {'standard_name': f'{side}ward_sea_water_velocity', 'units': 'm s-1'},
        )
        for name, side, values in (('uo', 'east', east), ('vo', 'north', north))
    }
    numbers = ', '.join(f'{name} {value}' for name, value in sea)
    source = {'Conventions': 'CF-1.8', 'source': f'made up, by ./glider ocean: {numbers}'}
    data = xarray.Dataset(variables, coords, source)
    data.to_netcdf(path, engine='scipy', encoding={name: packed for name in variables})
