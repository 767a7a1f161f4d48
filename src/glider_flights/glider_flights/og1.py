# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""Flights in NetCDF as OceanGliders has it (OG1), or another trajectory by CF.

All along one time; capitals or not. Files of a Seaglider that were converted to it keep what
its actuators did (``VBD_CC``, ``PITCH_CTL``, ``ROLL_CTL``), those that ``./glider export`` writes
the file of the vehicle. ``HEADING`` is magnetic in the vocabulary of OG1.
"""

import math
from functools import partial
from pathlib import Path

import numpy as np

from glider_base.errors import ConfigurationError
from glider_base.files import parse_yaml
from glider_base.settings import validate
from glider_flights.folders import (
    Progress,
    declination_at,
    files_in,
    gsw,
    of_one_flight,
    read_each,
)
from glider_flights.navigation import DENSITY
from glider_flights.netcdf import SUFFIXES, fixes_of, names_of, opened, read, refuse_missing
from glider_flights.record import (
    DIVE_DEPTH_M,
    LONGEST_GAP_S,
    Flight,
    LogFile,
    OnBoard,
    Polar,
    Samples,
    at_times,
    instruments,
    put_together,
    samples_of,
    usual,
)
from glider_flights.seaglider import DIVE_FILE, polar_of
from glider_flights.slocum import POLAR
from glider_model.ocean.columns import is_height
from glider_model.onboard.glide_polar import make_polar
from glider_model.vehicle.file import Vehicle

#: By which variables a file is one of such a flight, or one of a Seaglider's base station.
_MARKS = ('TIME', 'PITCH', 'GLIDER_PITCH', 'LATITUDE_GPS', 'LOG_GPS_LAT')


def og1_files(place: Path) -> list[Path]:
    """NetCDF files, if one of them has a single time for all and fixes or pitch, as OG1 has.

    Those of a Seaglider's base station have several times, and are called ``p1710100.nc``.
    """
    files = files_in(place, lambda path: path.suffix.lower() in SUFFIXES)
    files = [path for path in files if not DIVE_FILE.fullmatch(path.name)]
    return files if any(map(_is_one, files)) else []


def _is_one(path: Path) -> bool:
    try:
        with opened(path, lambda name: name.upper() in _MARKS) as groups:
            names = {str(name).upper() for part in groups for name in part.variables}
    except ConfigurationError:
        return False
    return names > {'TIME'} and 'LOG_GPS_LAT' not in names


def read_og1(place: Path, progress: Progress) -> Flight:
    """Read a flight; raises ConfigurationError."""
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
    dac = [known.get(name) for name in ('dac_north', 'dac_east')]
    if any(values is None for values in dac):
        return OnBoard()
    return OnBoard(np.array([usual(values[inside]) for values in dac]))


def _read(path: Path) -> LogFile:
    wanted = names_of('og1')
    known = read(path, wanted, str.upper)
    model, vehicle = (
        str(values[0]) if len(values) else ''
        for values in (known.pop(name, ()) for name in ('model', 'vehicle'))
    )
    count = len(known.get('time', ()))
    known = {
        key: values
        for key, values in known.items()
        if len(values) == count or key == 'declination_rad' or key.startswith('fix_')
    }
    fixes, notes = fixes_of(known), []
    if 'pressure' in known:
        latitude = fixes[0, 1] if len(fixes) else _middle(known)[0]
        by_pressure = -gsw().z_from_p(known['pressure'], latitude)
        by_depth = known.get('depth_m', by_pressure)
        known['depth_m'] = np.where(np.isfinite(by_pressure), by_pressure, by_depth)
    needed = {key: wanted[key] for key in ('time', 'depth_m', 'pitch_rad')}
    refuse_missing(path, known, needed, 'along the time, of a flight in OG1 or CF')
    if is_height(known['depth_m'][np.abs(known['depth_m']) > DIVE_DEPTH_M]):
        raise ConfigurationError(
            f"{path}: depths are below 0 all along (allowed: + down, or positive = 'up')"
        )
    if 'heading_rad' in known:
        declination, note = _declination(known, fixes)
        known['heading_rad'] = known['heading_rad'] + declination
        notes += [f'{path.name}: {note}'] if note else []
    else:
        notes.append(f'{path.name}: no variable {" or ".join(wanted["heading_rad"])}')
    if not len(fixes):
        notes.append(f'{path.name}: no fix in LATITUDE_GPS, LONGITUDE_GPS')
    own_s = known['time']
    depth_m = at_times(own_s, own_s, known['depth_m'], LONGEST_GAP_S)
    pitch = own_s, known['pitch_rad']
    heading = own_s, known.get('heading_rad', np.full(count, math.nan))
    samples = samples_of(own_s, depth_m, pitch, heading, 0.0, known.get('buoyancy_kg'))
    own_polar = _own_polar(path)
    of_base = own_polar is None and 'seaglider' in model.lower()
    return LogFile(
        name=path.name,
        vehicle=vehicle,
        begin_s=np.min(own_s, where=np.isfinite(own_s), initial=math.inf),
        fixes=fixes,
        about_deg=_middle(known),
        samples=samples,
        instruments=instruments(own_s, **known),
        polar=own_polar or (polar_of({}) if of_base else POLAR),
        on_board=partial(_on_board, known),
        of_base_station=of_base,
        notes=notes,
        model=model,
    )


def _own_polar(path: Path) -> Polar | None:
    """Lift and drag of the file of a vehicle, as `glider_flights.record.Polar` has them."""
    with opened(path, lambda _: False) as groups:
        text = groups[0].attrs.get('vehicle_yaml')
    if text is None:
        return None
    values = parse_yaml(str(text), f'{path}: vehicle_yaml')
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


def _declination(known: dict[str, np.ndarray], fixes: np.ndarray) -> tuple[float, str]:
    """Declination (rad, + east) where the flight is, and what is to be said of it."""
    recorded = usual(known.get('declination_rad', ()))
    if math.isfinite(recorded):
        return recorded, ''
    place = fixes[0, 1:] if len(fixes) else _middle(known)
    declination, source = declination_at(*place, usual(known['time']))
    return declination, f'HEADING is magnetic, {source}'
