# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""Flights in NetCDF as OceanGliders has it (OG1), or another trajectory by CF.

All along one time; capitals or not. Files of a Seaglider that were converted to it keep what
its actuators did (``VBD_CC``, ``PITCH_CTL``, ``ROLL_CTL``), those that ``./glider export`` writes
the file of the vehicle. ``HEADING`` is magnetic in the vocabulary of OG1.
"""

import math
from datetime import datetime, timezone
from functools import partial
from pathlib import Path

import numpy as np

from glider_base.files import parse_yaml
from glider_base.settings import validate
from glider_flights.folders import (
    Progress,
    files_in,
    gsw,
    installed,
    of_one_flight,
    read_each,
)
from glider_flights.netcdf import SUFFIXES, datasets, refuse_missing, variables
from glider_flights.reckoning import DENSITY
from glider_flights.record import (
    NOT_KNOWN,
    Flight,
    OnBoard,
    Polar,
    Samples,
    angles_at_times,
    at_times,
    instruments,
    usual,
)
from glider_flights.seaglider import DIVE_FILE, polar_of
from glider_flights.segments import LogFile, put_together
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


def read_og1(place: Path, progress: Progress) -> Flight:
    """Read a flight.

    Raises
    ------
    ConfigurationError
    """
    files, left_out = read_each(og1_files(place), progress, _read)
    files.sort(key=lambda file: file.name)
    return put_together('og1', *of_one_flight(place, files, left_out))


def _middle(known: dict[str, np.ndarray]) -> np.ndarray:
    """The usual latitude and longitude (degrees); 0 where they are not known."""
    return np.nan_to_num([usual(known.get(name, ())) for name in ('latitude', 'longitude')])


def _on_board(known: dict[str, np.ndarray], samples: Samples) -> OnBoard:
    """What a file says of the current of a segment with such samples."""
    time_s = known['time']
    inside = (time_s >= samples.time_s[0]) & (time_s <= samples.time_s[-1])
    told = [known.get(name, ()) for name in ('dac_north', 'dac_east')]
    if any(len(values) != len(time_s) for values in told):
        return OnBoard(NOT_KNOWN, NOT_KNOWN, NOT_KNOWN)
    return OnBoard(np.array([usual(values[inside]) for values in told]), NOT_KNOWN, NOT_KNOWN)


def _read(path: Path) -> LogFile:
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
        known['depth_m'] = -gsw().z_from_p(known['pressure'], latitude)
    needed = {key: wanted[key] for key in ('time', 'depth_m', 'pitch_rad')}
    refuse_missing(path, known, needed, 'of a flight in OG1 or CF')
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
    own_polar = _own_polar(path)
    of_base = own_polar is None and 'seaglider' in texts.get('model', '').lower()
    return LogFile(
        name=path.name,
        vehicle=texts.get('vehicle', ''),
        dive=0,
        begin_s=np.min(own_s, where=np.isfinite(own_s), initial=math.inf),
        fixes=fixes,
        about_deg=_middle(known),
        samples=samples,
        instruments=instruments(own_s, **known),
        body={},
        polar=own_polar or (polar_of({}) if of_base else POLAR),
        on_board=partial(_on_board, known),
        of_base_station=of_base,
        notes=notes,
    )


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
