# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""What actuators of a Seaglider took out of its battery, by its table of their moves."""

from pathlib import Path
from typing import NamedTuple

import numpy as np

from glider_base.errors import ConfigurationError
from glider_flights.energy.uses import PUMP, Uses
from glider_flights.folders import Progress, read_each, said
from glider_flights.netcdf import names_of, read, refuse_missing
from glider_flights.seaglider import seaglider_files

#: Less than this is no pumping of a Seaglider: oil let in, or the valve (cc, A).
PUMPED_CC, PUMPING_A = 2.0, 0.05
_METRES_PER_CM = 0.01
#: Its moving masses: field of the vehicle file.
MASSES = {'pitch': 'pitch_mass', 'roll': 'roll_mass'}


def seaglider_uses(place: Path, progress: Progress) -> Uses:
    """Pumpings of all dives, by current, voltage and time of the motor."""
    dives, left_out = read_each(seaglider_files(place), progress, _pumpings)
    if not sum(len(dive.joules) for dive in dives):
        why = '; '.join(said(left_out))
        raise ConfigurationError(f'{place}: no pumping in its {len(dives)} files; {why}')
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


class _Dive(NamedTuple):
    """What its actuators did."""

    doings: np.ndarray  #: shape (n, 2): cc pumped out, and times depth (m)
    joules: np.ndarray  #: shape (n,)
    moved: dict[str, np.ndarray]  #: energy (J) and way of the masses, by field of a vehicle file


def _pumpings(path: Path) -> _Dive:
    """Read a dive."""
    moves = names_of('moves')
    of_masses = {one: {one: 1.0} for name in MASSES for one in _variables_of(name)}
    found = read(path, moves | of_masses)
    refuse_missing(path, found, moves, 'for the energy of a Seaglider')
    rows = {key: len(found[key]) for key in moves if key != 'cc_per_count'}
    if len(set(rows.values())) > 1:
        told = ', '.join(f'{next(iter(moves[key]))} {count}' for key, count in rows.items())
        raise ConfigurationError(f'{path}: {told} values (allowed: as many of each)')
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


def _variables_of(name: str) -> list[str]:
    """Variables of a moving mass, all of which a file may lack; the last: a count in cm or deg."""
    parts = ('ad_start', 'ad', 'i', 'volts', 'secs')
    return [*(f'gc_{name}_{part}' for part in parts), f'log_{name.upper()}_CNV']


def _moved(found: dict[str, np.ndarray], name: str) -> np.ndarray:
    """Energy (J) and way (m, deg) of one moving mass in a dive, shape (2,); zeros if not told."""
    told = [found.get(one, ()) for one in _variables_of(name)]
    if not all(map(len, told)):
        return np.zeros(2)
    before, after, amps, volts, seconds, per_count = told
    scale = abs(per_count[0]) * (_METRES_PER_CM if name == 'pitch' else 1.0)
    energy = amps * volts * np.abs(seconds)
    ran = (seconds != 0.0) & (before > 0.0) & np.isfinite(energy * after)
    return np.array([energy[ran].sum(), scale * np.abs(after - before)[ran].sum()])
