# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""Flights of a Seaglider: NetCDF files of its base station, one a dive, ``p1710100.nc``.

``log_gps_*`` has three fixes a dive: two before it and one after it. ``depth_avg_curr_*`` is in
m/s; the base station has it from buoyancy and pitch, and so has this where buoyancy is there.
"""

import math
import re
from pathlib import Path

import numpy as np

from glider_base.errors import ConfigurationError
from glider_flights.folders import Progress, files_in, of_one_flight, read_each
from glider_flights.netcdf import BAD, SUFFIXES, fixes_of, names_of, read, refuse_missing
from glider_flights.record import (
    Flight,
    Instruments,
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

#: Files of dives: the number of the vehicle, three digits, and of the dive, four.
DIVE_FILE = re.compile(r'p(\d{3})(\d{4}).*\.nc.*', re.IGNORECASE)
#: What a file must have, of `variables.yaml`; first what is as long as time.
SAMPLED = ('time', 'pitch_rad', 'heading_rad', 'depth_m')
NEEDED = (*SAMPLED, 'fix_time', 'fix_latitude', 'fix_longitude')
#: Eriksen et al. (2001), doi:10.1109/48.972073: a (1/deg), b (Pa^1/4), c (1/deg^2), s, length (m).
ERIKSEN = {'a': 0.003836, 'b': 0.010078, 'c': 2.1e-6, 's': -0.25, 'length': 1.8}
#: At shallower pitch the base station takes a Seaglider for stalled (rad).
SHALLOWEST_RAD = math.radians(5.0)
#: A dive with its fixes is not longer than this (s).
LONGEST_DIVE_S = 2 * 86_400.0


def seaglider_files(place: Path) -> list[Path]:
    """Files of dives; where none has the name of one, all NetCDF files."""
    files = files_in(place, lambda path: path.suffix.lower() in SUFFIXES)
    return [path for path in files if DIVE_FILE.fullmatch(path.name)] or files


def read_seaglider(place: Path, progress: Progress) -> Flight:
    """Read a flight; raises ConfigurationError."""
    dives, left_out = read_each(seaglider_files(place), progress, _read_dive)
    dives.sort(key=lambda dive: (dive.dive, dive.name))
    return put_together('seaglider', *of_one_flight(place, dives, left_out))


def _read_dive(path: Path) -> LogFile:
    wanted = names_of('seaglider')
    found = read(path, wanted)
    count = len(found.get('time', ()))
    for key in SAMPLED:
        if key in found and len(found[key]) != count:
            raise ConfigurationError(
                f'{path}: {" or ".join(wanted[key])} has {len(found[key])} values '
                f'(allowed: as many as time, {count})'
            )
    why = 'of a dive of a Seaglider; a flight in OG1 has TIME, and PITCH or LATITUDE_GPS'
    refuse_missing(path, found, {key: wanted[key] for key in NEEDED}, why)
    quality = found.get('fix_quality', ())
    if len(quality) == len(found['fix_time']):
        found['fix_time'] = np.where(np.isin(quality.astype('U8'), BAD), np.nan, found['fix_time'])
    fixes = fixes_of(found)
    if not len(fixes):
        raise ConfigurationError(f'{path}: log_gps_lat, log_gps_lon: no usable fix (needed: 1)')
    apart_s = np.median(fixes[:, 0]) - np.nanmedian(found['time'])
    if not abs(apart_s) <= LONGEST_DIVE_S:
        raise ConfigurationError(
            f'{path}: log_gps_time is {apart_s / 86400.0:.1f} days off time (allowed: '
            f'{LONGEST_DIVE_S / 86400.0:.0f})'
        )
    own = {name: usual(values) for name, values in found.items() if name != 'fix_quality'}
    number = {name: own.get(name, math.nan) for name in wanted}
    notes = []
    if math.isnan(number['declination_rad']):
        notes.append(f'{path.name}: magnetic_variation is missing: 0 deg is taken')
    named = DIVE_FILE.fullmatch(path.name)
    samples = _samples(found, np.nan_to_num(number['declination_rad']))
    dac, speed = (
        np.array([number[f'{of}_north'], number[f'{of}_east']]) for of in ('dac', 'speed')
    )
    on_board = OnBoard(dac, speed * number['flight_s'])
    return LogFile(
        name=path.name,
        vehicle=named[1] if named else '',
        dive=int(named[2]) if named else 0,
        begin_s=fixes[0, 0],
        fixes=fixes,
        about_deg=fixes[0, 1:],
        samples=samples,
        instruments=_instruments(found, samples),
        body=_body(number),
        polar=polar_of(number),
        on_board=lambda samples: on_board,
        of_base_station=True,
        notes=notes,
    )


def _samples(found: dict[str, np.ndarray], declination: float) -> Samples:
    time_s = found['time']
    buoyancy = np.full(len(time_s), math.nan)
    weighed, own_s = found.get('buoyancy_kg', ()), found.get('ctd_time', time_s)
    if len(weighed) == len(own_s):
        buoyancy = at_times(time_s, own_s, weighed)
        known = at_times(time_s, own_s, np.isfinite(weighed).astype(float))
        buoyancy[known < 0.5] = math.nan
    pitch, heading = ((time_s, found[name]) for name in ('pitch_rad', 'heading_rad'))
    return samples_of(time_s, found['depth_m'], pitch, heading, declination, buoyancy)


def _instruments(found: dict[str, np.ndarray], samples: Samples) -> Instruments:
    measured = samples._asdict()
    for name in set(Instruments._fields).difference(measured):
        # What the CTD measured, and what was made of it, has times of its own.
        for times in ('time', 'ctd_time'):
            if name in found and len(found.get(times, ())) == len(found[name]):
                measured[name] = at_times(samples.time_s, found[times], found[name])
                break
    return instruments(**measured)


def _body(own: dict[str, float]) -> dict[str, float]:
    """What the file says of the body, the volume at the zero of the engine's cc."""
    cc_per_count = own['cc_per_count']
    if math.isnan(cc_per_count):
        cc_per_count = 1.0 / own['counts_per_cc']
    fullest_cc = (own['fullest_count'] - own['zero_count']) * cc_per_count
    volume_cc = own['volmax'] - abs(fullest_cc) - np.nan_to_num(own['bias'])
    body = {'mass_kg': own['mass'], 'volume_m3': 1e-6 * float(volume_cc)}
    return {name: value for name, value in body.items() if math.isfinite(value)}


def polar_of(own: dict[str, float]) -> Polar:
    """The file's own constants of lift and drag, else Eriksen's; angles in degrees there."""
    known = {
        name: value for name, value in own.items() if name in ERIKSEN and math.isfinite(value)
    }
    if not known.keys() >= set('abc'):
        known = {name: value for name, value in known.items() if name not in 'abc'}
    used = ERIKSEN | known
    return Polar(
        lift=math.degrees(used['a']),
        drag=used['b'],
        induced=math.degrees(math.degrees(used['c'])),
        exponent=used['s'],
        area_m2=used['length'] ** 2,
        shallowest_rad=SHALLOWEST_RAD,
    )
