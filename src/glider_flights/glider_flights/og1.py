# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""Flights in NetCDF as OceanGliders has it (OG1), or another trajectory by CF.

All along one time; capitals or not. Files of a Seaglider that were converted to it keep what
its actuators did (``VBD_CC``, ``PITCH_CTL``, ``ROLL_CTL``), those that ``./glider export`` writes
the file of the vehicle. ``HEADING`` is magnetic in the vocabulary of OG1.
"""

import math
from collections.abc import Callable
from datetime import datetime, timezone
from pathlib import Path
from typing import NamedTuple

import numpy as np

from glider_base.errors import ConfigurationError
from glider_base.files import parse_yaml
from glider_base.settings import validate
from glider_flights.folders import Part, files_in, installed, read_each, said, strangers
from glider_flights.netcdf import SUFFIXES, datasets, refuse_missing, variables
from glider_flights.reckoning import DENSITY
from glider_flights.record import (
    NOT_KNOWN,
    Fixes,
    Flight,
    Instruments,
    OnBoard,
    Polar,
    Samples,
    Segment,
    angles_at_times,
    at_times,
    instruments,
    joined,
    local_metres,
    usual,
)
from glider_flights.seaglider import DIVE_FILE, polar_of
from glider_flights.seawater import depth_of
from glider_flights.segments import cut
from glider_flights.slocum import POLAR
from glider_model.onboard.glide_polar import make_polar
from glider_model.vehicle.file import Vehicle

#: Names of variables in capitals, by ours, and what their values are multiplied by.
NAMES = {
    'time': (('TIME',), 1.0),
    'latitude': (('LATITUDE', 'LAT'), 1.0),
    'longitude': (('LONGITUDE', 'LON'), 1.0),
    'fix_time': (('TIME_GPS',), 1.0),
    'fix_latitude': (('LATITUDE_GPS',), 1.0),
    'fix_longitude': (('LONGITUDE_GPS',), 1.0),
    'pressure': (('PRES', 'PRESSURE'), 1.0),
    'depth_m': (('DEPTH', 'GLIDER_DEPTH'), 1.0),
    'pitch_rad': (('PITCH', 'GLIDER_PITCH'), math.radians(1.0)),
    'roll_rad': (('ROLL', 'GLIDER_ROLL'), math.radians(1.0)),
    'heading_rad': (('HEADING', 'HDG', 'GLIDER_HEADING'), math.radians(1.0)),
    'declination_rad': (('MAGNETIC_VARIATION',), math.radians(1.0)),
    'pumped_m3': (('VBD_CC', 'BALLAST_PUMPED', 'OIL_VOLUME'), 1e-6),
    'mass_x_m': (('PITCH_CTL',), -1e-2),  # of a Seaglider: cm, + aft
    'mass_roll_rad': (('ROLL_CTL',), math.radians(1.0)),
    'surface_rad': (('FIN', 'RUDDER'), math.radians(1.0)),
    'temperature_degc': (('TEMP', 'TEMPERATURE'), 1.0),
    'salinity': (('PSAL', 'SALINITY'), 1.0),
    'own_rate_mps': (('GLIDER_VERT_VELO_MODEL',), -1e-2),
    'buoyancy_kg': (('BUOYANCY',), 1e-3),
    'dac_north': (('DAVG_CURR_NORTH', 'WCUR_Y', 'WATERCURRENTS_V'), 1.0),
    'dac_east': (('DAVG_CURR_EAST', 'WCUR_X', 'WATERCURRENTS_U'), 1.0),
}
#: Units of which the values are multiplied by something else.
SCALES = {'rad': 1.0, 'radian': 1.0, 'radians': 1.0, 'cm/s': 1e-2, 'cm s-1': 1e-2}
TEXTS = {'model': ('PLATFORM_MODEL', 'PLATFORM_TYPE'), 'vehicle': ('PLATFORM_SERIAL_NUMBER',)}


class File(NamedTuple):
    """What one file says."""

    name: str
    vehicle: str
    model: str
    known: dict[str, np.ndarray]  #: variables by our names, times in s since 1970
    samples: Samples
    #: Shape (n, 3): time (s since 1970), latitude, longitude (degrees).
    fixes: np.ndarray
    notes: list[str]
    own_polar: Polar | None  #: of the file of the vehicle, where that is in it


def og1_files(place: Path) -> list[Path]:
    """NetCDF files, if one of them has a single time for all and fixes or pitch, as OG1 has.

    Those of a Seaglider's base station have several times, and are called ``p1710100.nc``.
    """
    files = files_in(place, lambda path: path.suffix.lower() in SUFFIXES)
    files = [path for path in files if not DIVE_FILE.fullmatch(path.name)]
    return files if any(map(_is_one, files)) else []


def _is_one(path: Path) -> bool:
    try:
        names = {name.upper() for part in datasets(path) for name in part.variables}
    except (OSError, ValueError):
        return False
    told = {'PITCH', 'GLIDER_PITCH', 'LATITUDE_GPS'} & names
    return 'TIME' in names and bool(told) and 'LOG_GPS_LAT' not in names


def read_og1(place: Path, progress: Callable[[int, int], None]) -> Flight:
    """Read a flight.

    Raises
    ------
    ConfigurationError
    """
    files, left_out = read_each(og1_files(place), progress, _read)
    files.sort(key=lambda file: file.name)
    parts = [Part(file.name, file.vehicle, file.samples.time_s) for file in files]
    left_out |= strangers(place, parts)
    files = [file for file in files if file.name not in left_out]
    notes = said(left_out)
    if not files:
        raise ConfigurationError(f'{place}: no file could be read; {"; ".join(notes)}')
    files.sort(key=lambda file: np.nanmin(file.samples.time_s))
    fixes = np.concatenate([file.fixes for file in files])
    origin = fixes[0, 1:] if len(fixes) else _middle(files[0].known)
    samples = Samples(*np.concatenate([np.stack(file.samples) for file in files], axis=1))
    cuts, unused = cut(Fixes(fixes[:, 0], local_metres(origin, *fixes.T[1:])), samples)
    of_base = 'seaglider' in files[0].model.lower() and not files[0].own_polar
    polar = files[0].own_polar or (polar_of({}) if of_base else POLAR)
    segments = []
    for one in cuts:
        middle = 0.5 * (one.before.time_s[-1] + one.after.time_s[0])
        file = [file for file in files if np.nanmin(file.samples.time_s) <= middle][-1]
        on_board = OnBoard(_dac(file, one.samples), NOT_KNOWN, NOT_KNOWN)
        segments.append(Segment(file.name, *one, on_board, polar))
    return Flight(
        kind='og1',
        files=[file.name for file in files],
        segments=segments,
        notes=notes + [note for file in files for note in file.notes] + unused,
        origin_deg=origin,
        instruments=joined(_instruments(file) for file in files),
        on_board_over='between fixes' if of_base else 'under water',
    )


def _middle(known: dict[str, np.ndarray]) -> np.ndarray:
    """The usual latitude and longitude (degrees); 0 where they are not known."""
    return np.nan_to_num([usual(known.get(name, ())) for name in ('latitude', 'longitude')])


def _dac(file: File, samples: Samples) -> np.ndarray:
    """What the file says of the current of a segment, shape (2,): north, east (m/s)."""
    time_s = file.known['time']
    inside = (time_s >= samples.time_s[0]) & (time_s <= samples.time_s[-1])
    told = [file.known.get(name, ()) for name in ('dac_north', 'dac_east')]
    if any(len(values) != len(time_s) for values in told):
        return NOT_KNOWN
    return np.array([usual(values[inside]) for values in told])


def _read(path: Path) -> File:
    known, texts = {}, {}
    wanted = {key: names for key, (names, _) in NAMES.items()} | TEXTS
    for key, _, values, units in variables(path, wanted, str.upper):
        if key in TEXTS:
            texts[key] = str(values[0]) if len(values) else ''
        else:
            known[key] = SCALES.get(units, NAMES[key][1]) * values.astype(float)
    count = len(known.get('time', ()))
    known = {
        key: values
        for key, values in known.items()
        if len(values) == count or key == 'declination_rad' or key.startswith('fix_')
    }
    fixes, notes = _fixes(known), []
    if 'pressure' in known:
        latitude = fixes[0, 1] if len(fixes) else _middle(known)[0]
        known['depth_m'] = depth_of(known['pressure'], latitude)
    needed = ('time', 'depth_m', 'pitch_rad')
    missing = [NAMES[key][0] for key in needed if not len(known.get(key, ()))]
    refuse_missing(path, missing, 'of a flight in OG1 or CF')
    if 'heading_rad' in known:
        declination, note = _declination(known, fixes)
        known['heading_rad'] = known['heading_rad'] + declination
        notes += [f'{path.name}: {note}'] if note else []
    else:
        notes.append(f'{path.name}: no variable {" or ".join(NAMES["heading_rad"][0])}')
    if not len(fixes):
        notes.append(f'{path.name}: no fix in LATITUDE_GPS, LONGITUDE_GPS')
    nothing = np.full(count, math.nan)
    own_s = known['time']
    samples = Samples(
        own_s,
        at_times(own_s, own_s, known['depth_m']),
        at_times(own_s, own_s, known['pitch_rad']),
        angles_at_times(own_s, own_s, known.get('heading_rad', nothing)),
        known.get('buoyancy_kg', nothing),
    )
    vehicle, model = texts.get('vehicle', ''), texts.get('model', '')
    return File(path.name, vehicle, model, known, samples, fixes, notes, _own_polar(path))


def _own_polar(path: Path) -> Polar | None:
    """Lift and drag of the file of a vehicle, as `glider_flights.record.Polar` has them."""
    text = datasets(path)[0].attrs.get('vehicle_yaml')
    if text is None:
        return None
    values = parse_yaml(text, f'{path}: vehicle_yaml')
    own = make_polar(validate(Vehicle, values, f'{path}: vehicle_yaml').params())
    per_pressure = 2.0 / DENSITY  # V^2 of a dynamic pressure
    return Polar(
        lift=own.K_L * per_pressure,
        drag=own.K_D0 * per_pressure ** (1.0 + 0.5 * own.n),
        induced=own.K_D * per_pressure,
        exponent=0.5 * own.n,
        area_m2=1.0,
        shallowest_rad=own.shallowest,
    )


def _fixes(known: dict[str, np.ndarray]) -> np.ndarray:
    """Fixes, each once, in the order of time."""
    latitude = known.get('fix_latitude', np.empty(0))
    longitude = known.get('fix_longitude', np.empty(0))
    times = known.get('fix_time', known.get('time', np.empty(0)))
    if not len(latitude) == len(longitude) == len(times):
        return np.empty((0, 3))
    table = np.stack([times, latitude, longitude], axis=-1)
    good = np.isfinite(table).all(axis=-1)
    good &= (np.abs(table[:, 1:]) <= (90.0, 180.0)).all(axis=-1)
    return table[good][np.unique(table[good, 0], return_index=True)[1]]


def _declination(known: dict[str, np.ndarray], fixes: np.ndarray) -> tuple[float, str]:
    """Declination (rad, + east) where the flight is, and what is to be said of it."""
    told = usual(known.get('declination_rad', ()))
    if math.isfinite(told):
        return told, ''
    latitude, longitude = fixes[0, 1:] if len(fixes) else _middle(known)
    day = datetime.fromtimestamp(usual(known['time']), timezone.utc).replace(tzinfo=None)
    with installed('ppigrf, which knows the magnetic field'):
        import ppigrf
    east, north, _ = ppigrf.igrf(longitude, latitude, 0.0, day)
    declination = math.atan2(east.item(), north.item())
    turned = f'{math.degrees(declination):.1f} deg east'
    return declination, f'HEADING is magnetic, {turned} there by IGRF'


def _instruments(file: File) -> Instruments:
    known = {name: file.known[name] for name in Instruments._fields[1:] if name in file.known}
    return instruments(file.known['time'], **known)
