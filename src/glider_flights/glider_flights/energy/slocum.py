# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""What a Slocum took out of its battery: its counter of charge, times the voltage."""

from pathlib import Path

import numpy as np

from glider_base.errors import ConfigurationError
from glider_flights.energy.uses import HOTEL, PUMP, Uses
from glider_flights.folders import Progress
from glider_flights.record import SURFACE_DEPTH_M, at_times, vertical_rate
from glider_flights.slocum import Sensors, read_sensors, slocum_files

#: A Slocum's parts are so long (s): several dives of a shallow one, less than one of a deep one.
PART_S = 1800.0
#: Of a longer time between two samples nothing is known (s): the files of it are missing.
GAP_S = 600.0
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
    """Half hours of what the counter of charge counted, times the voltage."""
    sensors, files, _, notes = read_sensors(slocum_files(place), cache, progress, SENSORS)
    (time_s, charge), (volts_s, volts), (oil_s, oil) = (
        _liveliest(place, sensors, names) for names in (CHARGE, VOLTAGE, OIL)
    )
    if len(sensors['m_depth'][0]) < 2:
        raise ConfigurationError(f'{place}: no value of m_depth in its {len(files)} files')
    steps_s = np.diff(time_s)
    known = (steps_s > 0.0) & (steps_s <= GAP_S)
    volts = np.interp(time_s, volts_s, volts)
    joules = _COULOMBS * np.diff(charge) * 0.5 * (volts[1:] + volts[:-1])
    depth = np.interp(time_s, *sensors['m_depth'])
    sinks = vertical_rate(time_s, depth)[1:] > 0.0
    middle = 0.5 * (depth[1:] + depth[:-1])
    is_up = middle < SURFACE_DEPTH_M
    calls = np.nan_to_num(at_times(time_s, *sensors[CALL]))[1:] > 0.5
    pumped = np.diff(np.interp(time_s, oil_s, oil))
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
