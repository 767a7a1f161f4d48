# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""What a real glider took out of its battery, and the numbers of a vehicle file that say so.

A flight is cut into parts of which energy and doings were recorded: pumpings of a Seaglider, by
its table of actuator moves; half hours of a Slocum, by its counter of charge times the voltage.
Their energy is a sum of fields of a vehicle file, each times what was done of it (seconds in a
phase, cc pumped out, cc times depth). Least squares find them, none below zero.
"""

from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from scipy.ndimage import median_filter
from scipy.optimize import nnls

from glider_base.errors import ConfigurationError
from glider_flights.folders import Progress, read_each, said, usual_vehicle
from glider_flights.netcdf import names_of, read, refuse_missing
from glider_flights.record import SURFACE_DEPTH_M, at_bound, at_times, vertical_rate
from glider_flights.seaglider import DIVE_FILE, seaglider_files
from glider_flights.slocum import Sensors, read_sensors, slocum_files

#: Fields of a vehicle file that are fitted, and their units.
PUMP = {'pump_out': 'J/cc', 'pump_out_per_m': 'J/cc/m'}
HOTEL = {'hotel_dive': 'W', 'hotel_climb': 'W', 'hotel_surface': 'W', 'call_power': 'W'}
UNITS = {**HOTEL, **PUMP, 'pitch_mass': 'J/m', 'roll_mass': 'J/deg'}


class Uses(NamedTuple):
    """Energy of the parts of a flight, and what it went into."""

    kind: str  #: 'slocum' or 'seaglider'
    files: int
    fields: tuple[str, ...]  #: of a vehicle file, m of them
    doings: np.ndarray  #: shape (n, m): what they multiply (s, cc, cc m)
    joules: np.ndarray  #: shape (n,)
    first_half: np.ndarray  #: bool, shape (n,)
    masses: dict[str, float]  #: what the moving masses took as they moved, where that is recorded
    notes: list[str]  #: what a person should know of the files: a sentence each


def predict(place: Path, uses: Uses, fitted: Uses | None) -> dict[str, Any]:
    """Energy of a flight as predicted and as recorded, as `--json` prints it.

    Fitted on the first half of another flight, it is all of this one that is predicted; else its
    second half by its first. Raises ConfigurationError if the two are not of one kind, or there is
    too little to be fitted.
    """
    source = fitted or uses
    if source.kind != uses.kind:
        raise ConfigurationError(
            f'{place}: a {uses.kind} cannot be predicted from a {source.kind} '
            f'(allowed: --fit-on a {uses.kind})'
        )
    predicted = np.ones(len(uses.joules), bool) if fitted else ~uses.first_half
    if source.first_half.sum() < len(uses.fields) or not predicted.any():
        raise ConfigurationError(
            f'{place}: {source.first_half.sum()} parts to fit {len(uses.fields)} numbers on '
            f'(needed: {len(uses.fields)})'
        )
    numbers, _ = nnls(source.doings[source.first_half], source.joules[source.first_half])
    recorded = float(uses.joules[predicted].sum())
    if not recorded > 0.0:
        raise ConfigurationError(f'{place}: no energy is recorded in what is to be predicted')
    predicted_j = float((uses.doings[predicted] @ numbers).sum())
    found = {
        name: float(number)
        for name, number, done in zip(uses.fields, numbers, source.doings.T, strict=True)
        if done[source.first_half].any()
    }
    bound = [at_bound(name, 0.0, UNITS[name]) for name, one in found.items() if one == 0.0]
    return {
        'vehicle': uses.kind,
        'files': uses.files,
        'fitted': found,
        'fitted_parts': int(source.first_half.sum()),
        'predicted_parts': int(predicted.sum()),
        'recorded_wh': recorded / 3600.0,
        'predicted_wh': predicted_j / 3600.0,
        'error_percent': 100.0 * (predicted_j / recorded - 1.0),
        'measured': uses.masses,
        'notes': [*uses.notes, *(fitted.notes if fitted else ()), *bound],
    }


# ---- a Seaglider

#: Less than this is no pumping of a Seaglider: oil let in, or the valve (cc, A).
PUMPED_CC, PUMPING_A = 2.0, 0.05
#: Its moving masses: field of the vehicle file.
MASSES = {'pitch': 'pitch_mass', 'roll': 'roll_mass'}


def seaglider_uses(place: Path, progress: Progress) -> Uses:
    """Pumpings of all dives, by current, voltage and time of the motor."""
    files, strangers = _of_one_vehicle(place)
    dives, left_out = read_each(files, progress, _pumpings)
    left_out |= strangers
    if not sum(len(dive.joules) for dive in dives):
        why = '; '.join([f'{place}: no pumping in its {len(dives)} files', *said(left_out)])
        raise ConfigurationError(why)
    number = np.repeat(np.arange(len(dives)), [len(dive.joules) for dive in dives])
    moved = {field: sum(dive.moved[field] for dive in dives) for field in MASSES.values()}
    return Uses(
        'seaglider',
        len(dives),
        tuple(PUMP),
        np.concatenate([dive.doings for dive in dives]),
        np.concatenate([dive.joules for dive in dives]),
        number < len(dives) // 2,
        {field: float(took / way) for field, (took, way) in moved.items() if way > 0.0},
        said(left_out),
    )


def _of_one_vehicle(place: Path) -> tuple[list[Path], dict[str, str]]:
    """Files of dives by the vehicle that most are of, each dive once; why others are left out."""
    files, left_out, dives = seaglider_files(place), {}, set()
    named = {path: DIVE_FILE.fullmatch(path.name) for path in files}
    vehicle = usual_vehicle(place, [found[1] for found in named.values() if found])
    for path, found in named.items():
        if found and found[1] != vehicle:
            left_out[path.name] = f'it is of {found[1]}, most are of {vehicle}'
        elif found and found[2] in dives:
            left_out[path.name] = 'another file is of its dive'
        dives.add(found[2] if found and path.name not in left_out else '')
    return [path for path in files if path.name not in left_out], left_out


class _Dive(NamedTuple):
    """What its actuators did."""

    doings: np.ndarray  #: shape (n, 2): cc pumped out, and times depth (m)
    joules: np.ndarray  #: shape (n,)
    moved: dict[str, np.ndarray]  #: energy (J) and way of the masses, by field of a vehicle file


def _pumpings(path: Path) -> _Dive:
    """Read a dive."""
    moves = names_of('moves')
    of_masses = {f'{name}_{key}': of for name in MASSES for key, of in names_of(name).items()}
    found = read(path, moves | of_masses)
    refuse_missing(path, found, moves, 'for the energy of a Seaglider')
    rows = {key: len(found[key]) for key in moves if key != 'cc_per_count'}
    if len(set(rows.values())) > 1:
        lengths = ', '.join(f'{next(iter(moves[key]))} {count}' for key, count in rows.items())
        raise ConfigurationError(f'{path}: {lengths} values (allowed: as many of each)')
    counts = found['after_1'] + found['after_2'] - found['before_1'] - found['before_2']
    pumped = 0.5 * counts * found['cc_per_count'][0]
    energy = found['amps'] * found['volts'] * np.abs(found['seconds'])
    ran = (pumped > PUMPED_CC) & (found['amps'] > PUMPING_A)
    ran &= np.isfinite(energy * found['depth'])
    return _Dive(
        np.stack([pumped, pumped * found['depth']], axis=-1)[ran],
        energy[ran],
        {field: _moved(found, name) for name, field in MASSES.items()},
    )


def _moved(found: dict[str, np.ndarray], name: str) -> np.ndarray:
    """Energy (J) and way (m, deg) of one moving mass in a dive, shape (2,); zeros without one."""
    columns = [found.get(f'{name}_{key}', ()) for key in names_of(name)]
    if not all(map(len, columns)):
        return np.zeros(2)
    before, after, amps, volts, seconds, per_count = columns
    energy = amps * volts * np.abs(seconds)
    ran = (seconds != 0.0) & (before > 0.0) & np.isfinite(energy * after)
    return np.array([energy[ran].sum(), abs(per_count[0]) * np.abs(after - before)[ran].sum()])


# ---- a Slocum

#: A Slocum's parts are so long (s): several dives of a shallow one, less than one of a deep one.
PART_S = 1800.0
#: Of a longer time between two samples nothing is known (s): the files of it are missing.
GAP_S = 600.0
#: No Slocum draws more (W), or less than nothing: its counter was set back, or is wrong.
MOST_W = 1000.0
#: Less oil (cc) between two samples is noise of what measures it.
LEAST_CC = 0.5
#: A count of charge (Ah) in coulombs.
_COULOMBS = 3600.0

#: Sensors of a Slocum: what is needed by any of its names, then one that is used if it is there.
CHARGE = ('m_coulomb_amphr_total', 'm_coulomb_amphr')
VOLTAGE = ('m_battery', 'm_bms_main_battery_voltage')
OIL = ('m_de_oil_vol', 'm_ballast_pumped')
CALL = 'm_iridium_on'
SENSORS = ('m_depth', *CHARGE, *VOLTAGE, *OIL, CALL)


def slocum_uses(place: Path, cache: Path | None, progress: Progress) -> Uses:
    """Half hours of what the counter of charge counted, times the voltage.

    One sample of voltage or oil that stands out from both beside it is none.
    """
    sensors, files, _, notes = read_sensors(slocum_files(place), cache, progress, SENSORS)
    (time_s, charge), (volts_s, volts), (oil_s, oil) = (
        _liveliest(place, sensors, names) for names in (CHARGE, VOLTAGE, OIL)
    )
    if len(sensors['m_depth'][0]) < 2:
        raise ConfigurationError(f'{place}: no value of m_depth in its {len(files)} files')
    steps_s = np.diff(time_s)
    volts = np.interp(time_s, volts_s, median_filter(volts, 3, mode='nearest'))
    joules = _COULOMBS * np.diff(charge) * 0.5 * (volts[1:] + volts[:-1])
    depth = at_times(time_s, *sensors['m_depth'], GAP_S)
    sinks = vertical_rate(time_s, depth)[1:] > 0.0
    middle = 0.5 * (depth[1:] + depth[:-1])
    known = (steps_s > 0.0) & (steps_s <= GAP_S) & np.isfinite(middle)
    known &= (joules >= 0.0) & (joules <= MOST_W * steps_s)
    if not known.any():
        raise ConfigurationError(
            f'{place}: its counter of charge is recorded every {np.median(steps_s):.0f} s, '
            f'of which no step can be used (needed: every {GAP_S:.0f} s or less, with a depth)'
        )
    is_up = middle < SURFACE_DEPTH_M
    calls = np.nan_to_num(at_times(time_s, *sensors[CALL]))[1:] > 0.5
    pumped = np.diff(np.interp(time_s, oil_s, median_filter(oil, 3, mode='nearest')))
    pumped[pumped < LEAST_CC] = 0.0
    doings = np.stack(
        [
            steps_s * (sinks & ~is_up),
            steps_s * (~sinks & ~is_up),
            steps_s * is_up,
            steps_s * calls,
            pumped,
            pumped * middle,
        ],
        axis=-1,
    )[known]
    part = (np.cumsum(steps_s[known]) / PART_S).astype(int)
    starts = np.flatnonzero(np.diff(part, prepend=-1))
    summed = np.add.reduceat(doings, starts), np.add.reduceat(joules[known], starts)
    first_half = np.arange(len(starts)) < len(starts) // 2
    return Uses('slocum', len(files), (*HOTEL, *PUMP), *summed, first_half, {}, notes)


def _liveliest(place: Path, sensors: Sensors, names: tuple[str, ...]) -> tuple:
    """That of some sensors which says most: a vehicle may have all of them, and fill in one."""
    best = max(names, key=lambda name: len(np.unique(sensors[name][1])))
    if len(np.unique(sensors[best][1])) < 2:
        raise ConfigurationError(
            f'{place}: {" or ".join(names)} is not recorded (needed for its energy)'
        )
    return sensors[best]
