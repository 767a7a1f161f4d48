# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""Flights in NetCDF as OceanGliders has it (OG1), or another trajectory by CF.

All along one time; capitals or not. Files of a Seaglider that were converted to it keep what
its actuators did (``VBD_CC``, ``PITCH_CTL``, ``ROLL_CTL``).
"""

import math
from collections.abc import Callable
from pathlib import Path

import numpy as np

from glider_flights.folders import files_in
from glider_flights.netcdf import SUFFIXES, datasets, refuse_missing, variables
from glider_flights.record import Flight, Instruments, instruments, joined, usual
from glider_flights.seawater import depth_of

#: Names of variables in capitals, by ours, and what their values are multiplied by.
NAMES = {
    'time': (('TIME',), 1.0),
    'latitude': (('LATITUDE', 'LAT'), 1.0),
    'longitude': (('LONGITUDE', 'LON'), 1.0),
    'pressure': (('PRES', 'PRESSURE'), 1.0),
    'depth_m': (('DEPTH',), 1.0),
    'pitch_rad': (('PITCH',), math.radians(1.0)),
    'roll_rad': (('ROLL',), math.radians(1.0)),
    'heading_rad': (('HEADING', 'HDG'), math.radians(1.0)),
    'pumped_m3': (('VBD_CC', 'BALLAST_PUMPED', 'OIL_VOLUME'), 1e-6),
    'mass_x_m': (('PITCH_CTL',), -1e-2),  # of a Seaglider: cm, + aft
    'mass_roll_rad': (('ROLL_CTL',), math.radians(1.0)),
    'surface_rad': (('FIN', 'RUDDER'), math.radians(1.0)),
    'temperature_degc': (('TEMP', 'TEMPERATURE'), 1.0),
    'salinity': (('PSAL', 'SALINITY'), 1.0),
    'own_rate_mps': (('GLIDER_VERT_VELO_MODEL',), -1e-2),
}
NEEDED = ('time', 'pitch_rad', 'pumped_m3')


def og1_files(place: Path) -> list[Path]:
    """NetCDF files with one time for all: those of a Seaglider's base station have several."""
    files = files_in(place, lambda path: path.suffix.lower() in SUFFIXES)
    return [path for path in files if _is_one(path)]


def _is_one(path: Path) -> bool:
    try:
        names = {name.upper() for part in datasets(path) for name in part.variables}
    except (OSError, ValueError):
        return False
    return {'TIME', 'PITCH'} <= names and 'LOG_GPS_LAT' not in names


def read_og1(place: Path, progress: Callable[[int, int], None]) -> Flight:
    """Read a flight; without segments, as what is a fix is not told.

    Raises
    ------
    ConfigurationError
    """
    files, parts, origins = og1_files(place), [], []
    for number, path in enumerate(files):
        progress(number, len(files))
        found = _read(path)
        origin = [usual(found.get(name, ())) for name in ('latitude', 'longitude')]
        origins.append(np.nan_to_num(origin))
        parts.append(_instruments(found, origins[-1][0]))
    return Flight(
        kind='og1',
        files=[path.name for path in files],
        segments=[],
        notes=[],
        origin_deg=origins[0],
        instruments=joined(parts),
    )


def _read(path: Path) -> dict[str, np.ndarray]:
    """Variables by our names; times in s since 1970."""
    found = {}
    wanted = {key: names for key, (names, _) in NAMES.items()}
    for key, _, values, units in variables(path, wanted, str.upper):
        found[key] = (1.0 if units.startswith('rad') else NAMES[key][1]) * values.astype(float)
    missing = [NAMES[key][0] for key in NEEDED if key not in found]
    refuse_missing(path, missing, 'of a flight in OG1 or CF')
    return found


def _instruments(found: dict[str, np.ndarray], latitude: float) -> Instruments:
    count = len(found['time'])
    known = {
        name: found[name] for name in Instruments._fields[1:] if len(found.get(name, ())) == count
    }
    if len(found.get('pressure', ())) == count:
        known['depth_m'] = depth_of(found['pressure'], latitude)
    return instruments(found['time'], **known)
