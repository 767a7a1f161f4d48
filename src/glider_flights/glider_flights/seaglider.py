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
from glider_flights.netcdf import SUFFIXES, refuse_missing, variables
from glider_flights.record import (
    NOT_KNOWN,
    Flight,
    Instruments,
    OnBoard,
    Polar,
    Samples,
    angles_at_times,
    at_times,
    instruments,
    usual,
)
from glider_flights.segments import LogFile, put_together

#: Files of dives: the number of the vehicle, three digits, and of the dive, four.
DIVE_FILE = re.compile(r'p(\d{3})(\d{4}).*\.nc.*', re.IGNORECASE)
#: What a file must have, by any of the names: first the base station's, then the vehicle's own.
NEEDED = {
    'time': ('time',),
    'depth': ('depth', 'eng_depth'),  # m, cm
    'pitch': ('eng_pitchAng', 'pitch'),
    'heading': ('eng_head', 'heading', 'head'),
    'fix_time': ('log_gps_time',),
    'fix_latitude': ('log_gps_lat',),
    'fix_longitude': ('log_gps_lon',),
}
WANTED = {
    'declination': ('magnetic_variation', 'log_gps_magvar'),
    'buoyancy': ('buoyancy',),
    'buoyancy_time': ('ctd_time',),
    'fix_quality': ('log_gps_qc',),
    'dac_east': ('depth_avg_curr_east', 'depth_avg_curr_east_gsm'),
    'dac_north': ('depth_avg_curr_north', 'depth_avg_curr_north_gsm'),
    'speed_east': ('flight_avg_speed_east', 'flight_avg_speed_east_gsm'),
    'speed_north': ('flight_avg_speed_north', 'flight_avg_speed_north_gsm'),
    'flight_s': ('total_flight_time_s',),
    'a': ('sg_cal_hd_a', 'log_HD_A'),
    'b': ('sg_cal_hd_b', 'log_HD_B'),
    'c': ('sg_cal_hd_c', 'log_HD_C'),
    's': ('sg_cal_hd_s',),
    'length': ('sg_cal_glider_length',),
}
#: What more there is for a flight model: what was measured (its unit in ours),
MEASURED = {
    'roll_rad': (('eng_rollAng', 'roll'), math.radians(1.0)),
    'pumped_m3': (('eng_vbdCC', 'vbdCC'), 1e-6),
    'mass_x_m': (('eng_pitchCtl', 'pitchCtl'), -1e-2),  # cm, + aft
    'mass_roll_rad': (('eng_rollCtl', 'rollCtl'), math.radians(1.0)),
    'temperature_degc': (('temperature', 'temperature_raw'), 1.0),
    'salinity': (('salinity', 'salinity_raw'), 1.0),
    'own_rate_mps': (('vert_speed',), -1e-2),  # cm/s, + up
}
#: and the constants of the body; ``volmax`` is the volume with the engine at its fullest.
CONSTANTS = {
    'mass': ('sg_cal_mass',),
    'volmax': ('sg_cal_volmax',),
    'bias': ('sg_cal_vbdbias',),
    'zero_count': ('log_C_VBD',),
    'fullest_count': ('sg_cal_vbd_min_cnts', 'log_VBD_MIN'),
    'counts_per_cc': ('sg_cal_vbd_cnts_per_cc',),
    'cc_per_count': ('log_VBD_CNV',),
}
#: Eriksen et al. (2001), doi:10.1109/48.972073: a (1/deg), b (Pa^1/4), c (1/deg^2), s, length (m).
ERIKSEN = {'a': 0.003836, 'b': 0.010078, 'c': 2.1e-6, 's': -0.25, 'length': 1.8}
#: At shallower pitch the base station takes a Seaglider for stalled (rad).
SHALLOWEST_RAD = math.radians(5.0)
#: A dive with its fixes is not longer than this (s).
LONGEST_DIVE_S = 2 * 86_400.0
#: Marks of the base station for values that are bad, or missing.
BAD = ('4', '9', '4.0', '9.0')


def seaglider_files(place: Path) -> list[Path]:
    """Files of dives; where none has the name of one, all NetCDF files."""
    files = files_in(place, lambda path: path.suffix.lower() in SUFFIXES)
    return [path for path in files if DIVE_FILE.fullmatch(path.name)] or files


def read_seaglider(place: Path, progress: Progress) -> Flight:
    """Read a flight.

    Raises
    ------
    ConfigurationError
    """
    dives, left_out = read_each(seaglider_files(place), progress, _read_dive)
    dives.sort(key=lambda dive: (dive.dive, dive.name))
    return put_together('seaglider', *of_one_flight(place, dives, left_out))


def _read_dive(path: Path) -> LogFile:
    more = CONSTANTS | {key: names for key, (names, _) in MEASURED.items()}
    found = read_variables(path, NEEDED | WANTED | more)
    for key in ('time', 'pitch', 'heading', 'depth'):
        if key in found and len(found[key]) != len(found.get('time', ())):
            raise ConfigurationError(
                f'{path}: {" or ".join(NEEDED[key])} has {len(found[key])} values '
                f'(allowed: as many as time, {len(found.get("time", ()))})'
            )
    refuse_missing(path, found, NEEDED, 'of a dive of a Seaglider')
    fixes = np.stack([found['fix_time'], found['fix_latitude'], found['fix_longitude']], axis=-1)
    good = np.isfinite(fixes).all(axis=-1) & (np.abs(fixes[:, 1:]) <= (90.0, 180.0)).all(axis=-1)
    quality = found.get('fix_quality', ())
    if len(quality) == len(fixes):
        good &= ~np.isin(quality.astype('U8'), BAD)
    if not good.any():
        raise ConfigurationError(f'{path}: log_gps_lat, log_gps_lon: no usable fix (needed: 1)')
    apart_s = np.nanmedian(fixes[good, 0]) - np.nanmedian(found['time'])
    if not abs(apart_s) <= LONGEST_DIVE_S:
        raise ConfigurationError(
            f'{path}: log_gps_time is {apart_s / 86400.0:.1f} days off time (allowed: '
            f'{LONGEST_DIVE_S / 86400.0:.0f})'
        )
    declination, notes = _number(found, 'declination'), []
    if math.isnan(declination):
        notes.append(f'{path.name}: magnetic_variation is missing: 0 deg is taken')
        declination = 0.0
    named = DIVE_FILE.fullmatch(path.name)
    samples = _samples(found, math.radians(declination))
    dac, speed = (
        np.array([_number(found, f'{what}_{way}') for way in ('north', 'east')])
        for what in ('dac', 'speed')
    )
    on_board = OnBoard(dac, speed * _number(found, 'flight_s'), NOT_KNOWN)
    return LogFile(
        name=path.name,
        vehicle=named[1] if named else '',
        dive=int(named[2]) if named else 0,
        begin_s=fixes[good][0, 0],
        fixes=fixes[good],
        about_deg=fixes[good][0, 1:],
        samples=samples,
        instruments=_instruments(found, samples),
        body=_body(found),
        polar=polar_of(found),
        on_board=lambda samples: on_board,
        of_base_station=True,
        notes=notes,
    )


def _samples(found: dict[str, np.ndarray], declination: float) -> Samples:
    time_s = found['time']
    buoyancy = np.full(len(time_s), math.nan)
    grams = found.get('buoyancy', ())
    own_s = found.get('buoyancy_time', time_s)
    if len(grams) == len(own_s):
        buoyancy = 1e-3 * at_times(time_s, own_s, grams)
        known = at_times(time_s, own_s, np.isfinite(grams).astype(float))
        buoyancy[known < 0.5] = math.nan
    pitch, heading = (np.radians(found[name]) for name in ('pitch', 'heading'))
    heading = angles_at_times(time_s, time_s, heading) + declination
    return Samples(time_s, found['depth'], at_times(time_s, time_s, pitch), heading, buoyancy)


def _instruments(found: dict[str, np.ndarray], samples: Samples) -> Instruments:
    measured = {}
    for name, (_, unit) in MEASURED.items():
        # What the CTD measured, and what was made of it, has times of its own.
        for times in ('time', 'buoyancy_time'):
            if name in found and len(found.get(times, ())) == len(found[name]):
                measured[name] = unit * at_times(samples.time_s, found[times], found[name])
                break
    return instruments(
        samples.time_s,
        depth_m=samples.depth_m,
        pitch_rad=samples.pitch_rad,
        heading_rad=samples.heading_rad,
        **measured,
    )


def _body(found: dict[str, np.ndarray]) -> dict[str, float]:
    """What the file says of the body, the volume at the zero of the engine's cc."""
    own = {name: _number(found, name) for name in CONSTANTS}
    cc_per_count = own['cc_per_count']
    if math.isnan(cc_per_count):
        cc_per_count = 1.0 / own['counts_per_cc']
    fullest_cc = (own['fullest_count'] - own['zero_count']) * cc_per_count
    bias_cc = 0.0 if math.isnan(own['bias']) else own['bias']
    body = {
        'mass_kg': own['mass'],
        'volume_m3': 1e-6 * (own['volmax'] - abs(fullest_cc) - bias_cc),
    }
    return {name: value for name, value in body.items() if math.isfinite(value)}


def polar_of(found: dict[str, np.ndarray]) -> Polar:
    """The file's own constants of lift and drag, else Eriksen's; angles in degrees there."""
    own = {name: _number(found, name) for name in ERIKSEN}
    used = {name: ERIKSEN[name] if math.isnan(own[name]) else own[name] for name in ERIKSEN}
    if any(math.isnan(own[name]) for name in 'abc'):
        used |= {name: ERIKSEN[name] for name in 'abc'}
    return Polar(
        lift=math.degrees(used['a']),
        drag=used['b'],
        induced=math.degrees(math.degrees(used['c'])),
        exponent=used['s'],
        area_m2=used['length'] ** 2,
        shallowest_rad=SHALLOWEST_RAD,
    )


def _number(found: dict[str, np.ndarray], name: str) -> float:
    """The usual value of a variable; NaN if it is missing."""
    return usual(found.get(name, ()))


def read_variables(path: Path, wanted: dict[str, tuple[str, ...]]) -> dict[str, np.ndarray]:
    """Variables by our names, see `variables`; depth in m."""
    return {
        key: values / 100.0 if name == 'eng_depth' else values
        for key, name, values, _ in variables(path, wanted)
    }
