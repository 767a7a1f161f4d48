# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""A run as the OceanGliders community exchanges flights: NetCDF 4 in the format OG1.0.

What the vehicle measured and estimated, as a glider brings it home; nothing of the truth. Format:
https://oceangliderscommunity.github.io/OG-format-user-manual/OG_Format.html
"""

from collections.abc import Callable
from datetime import datetime, timezone
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np
import xarray
from xarray.backends import H5NetCDFStore

from glider_base.errors import ConfigurationError, installed
from glider_base.frames import on_chart, poses_from_wire, within_180
from glider_base.signals import TICK_NS
from glider_bringup.door.tracks import start_of
from glider_bringup.scoring.one_hertz import SECOND, Rows
from glider_bringup.showing.flown_run import read_run
from glider_mission.blocks import COLUMNS
from glider_mission.disk import write_whole
from glider_mission.recording.mcap_reader import Bag
from glider_mission.recording.ros.recorded_log import read_back
from glider_mission.run_folder import VEHICLE_FILE, scenario_of
from glider_mission.scenario import Scenario
from glider_model.ocean.density import depth_at
from glider_model.vehicle.file import load_vehicle, vehicle_file

#: Without a GPS in the scenario, it has a fix this often (s) where it is this shallow (m).
FIX_EVERY_S, FIX_DEPTH_M = 60.0, 1.0
#: Phases of OG1 by the stages of guidance.
PHASES = {0: 3, 1: 2, 2: 5, 3: 1, 4: 5, 5: 3, 6: 1, 7: 3}
PHASE_NAMES = 'unknown ascent descent surfacing parking inflection propelled transition'
VOCABULARY = 'http://vocab.nerc.ac.uk/collection'
DIMENSION = 'N_MEASUREMENTS'
_SECONDS = {'units': 'seconds since 1970-01-01T00:00:00Z', 'calendar': 'gregorian'}
_NORTH = {'units': 'degrees_north', 'standard_name': 'latitude'}
_EAST = {'units': 'degrees_east', 'standard_name': 'longitude'}
_DOWN = {'units': 'm', 'positive': 'down', 'axis': 'Z'}
_WAY = {'coordinates': 'TIME LATITUDE LONGITUDE DEPTH'}
_CURRENT = 'depth-averaged current of the dive, as the vehicle estimated it'


def _of(concept: str, long_name: str, **more: Any) -> dict[str, Any]:
    """Attributes of a measured variable."""
    return {'long_name': long_name, 'vocabulary': f'{VOCABULARY}/OG1/current/{concept}/', **more}


def _along(concept: str, long_name: str, units: str, standard_name: str = '') -> dict[str, Any]:
    """Attributes of a variable that is measured along the way."""
    named = {'standard_name': standard_name} if standard_name else {}
    return _of(concept, long_name, units=units, **named, **_WAY)


#: Variables over the measurements, and what they are.
VARIABLES = {
    'TIME': _of('TIME', 'time of measurement', standard_name='time', axis='T', **_SECONDS),
    'LATITUDE': _of('LAT', 'estimated latitude of the vehicle', **_NORTH),
    'LONGITUDE': _of('LON', 'estimated longitude of the vehicle', **_EAST),
    'DEPTH': _of('DEPTH', 'depth by the pressure sensor', standard_name='depth', **_DOWN),
    'TIME_GPS': _of('TIME', 'time of each GPS location', **_SECONDS),
    'LATITUDE_GPS': _of('LAT_GPS', 'latitude of each GPS location', **_NORTH),
    'LONGITUDE_GPS': _of('LON_GPS', 'longitude of each GPS location', **_EAST),
    'PITCH': _along('PITCH', 'pitch, nose up positive', 'degree', 'platform_pitch'),
    'ROLL': _along('ROLL', 'roll, to starboard positive', 'degree', 'platform_roll'),
    'HEADING': _along('HEADING', 'heading from magnetic north', 'degree'),
    'WCUR_X': _along('WCUR_X', f'{_CURRENT}, eastward', 'm s-1', 'eastward_sea_water_velocity'),
    'WCUR_Y': _along('WCUR_Y', f'{_CURRENT}, northward', 'm s-1', 'northward_sea_water_velocity'),
    'PHASE': _of(
        'PHASE',
        'behavior of the glider at sea',
        flag_values=np.arange(8, dtype=np.int8),
        flag_meanings=PHASE_NAMES,
        phase_calculation_method='stage of the mission by the guidance on board',
        **_WAY,
    ),
}


def write_og1(
    run: Path, start: str | None, file: Path, progress: Callable[[int, int], None]
) -> dict:
    """Write a run with a bag as a flight in OG1.0; its scorecard.

    Raises ConfigurationError if it has no bag, or no tick in it, if nobody knows when it was, or
    the file cannot be written.
    """
    with installed('h5netcdf, which writes NetCDF 4'):
        import h5netcdf  # xarray writes NetCDF 4 through it
    bag, sink = Bag(run), Rows(SECOND, ('imu', 'pressure', 'fix', 'odom'))
    with scenario_of(run, bag.attachments) as found:
        scenario, card = found.scenario, read_run(run, traced=False).card
        began_s = start_of(scenario, start)
        if began_s is None:
            raise ConfigurationError(
                f'{run}: origin.time is not set, so that nobody knows when it was (allowed: with '
                '--start 2026-03-01T06:00, or a run with origin.time)'
            )
        total = int(scenario.duration_s / (TICK_NS / 1e9))
        read_back(bag, scenario.vehicle, [sink], lambda ticks: progress(ticks, total))
        rows = sink.result()
        if not len(rows):
            raise ConfigurationError(f'{run}: no tick was recorded (allowed: one and more)')
        dataset = flight_dataset(rows, scenario, card, began_s)
    memory = BytesIO()  # where a disk is full HDF5 ends the process
    with h5netcdf.File(memory, 'w') as store:
        dataset.dump_to_store(
            H5NetCDFStore(store),
            unlimited_dims=[DIMENSION],
            encoding={name: _encoding(dataset[name]) for name in dataset.variables},
        )
    write_whole(file, memory.getvalue())
    return card


def _encoding(variable: xarray.DataArray) -> dict[str, Any]:
    """How a variable is kept: what has no value is filled, what is along the time is packed."""
    if variable.dtype.kind == 'f' and variable.ndim:
        return {'_FillValue': -1.0 if 'TIME' in variable.name else -9999.9, 'zlib': True}
    return {'_FillValue': None}


def flight_dataset(
    rows: np.ndarray, scenario: Scenario, card: dict, began_s: float
) -> xarray.Dataset:
    """Dataset in OG1.0 of a row for each second of a run, shape (n, ROW)."""
    time_s = np.arange(len(rows)) * SECOND * TICK_NS / 1e9
    values = _measured(time_s, rows, scenario, card)
    for name in ('TIME', 'TIME_GPS'):
        values[name] = values[name] + began_s
    dataset = xarray.Dataset(
        {name: (DIMENSION, values[name], VARIABLES[name]) for name in VARIABLES if name in values}
    )
    vehicle = load_vehicle(scenario.vehicle)
    serial, day = f'simulated_{vehicle.name}', _compact(began_s)
    charted = scenario.sensors.charted_deg
    deployed = {
        'TRAJECTORY': (f'{serial}_{day}', 'trajectory', {'cf_role': 'trajectory_id'}),
        'WMO_IDENTIFIER': ('0000000', 'wmo id', {}),
        'PLATFORM_MODEL': (vehicle.name, 'model of the glider', {}),
        'PLATFORM_SERIAL_NUMBER': (serial, 'glider serial number', {}),
        'DEPLOYMENT_TIME': (began_s, 'date of deployment', {'standard_name': 'time', **_SECONDS}),
        'DEPLOYMENT_LATITUDE': (values['LATITUDE'][0], 'latitude of deployment', _NORTH),
        'DEPLOYMENT_LONGITUDE': (values['LONGITUDE'][0], 'longitude of deployment', _EAST),
        'MAGNETIC_VARIATION': (charted, 'true less magnetic heading, + east', {'units': 'degree'}),
    }
    for name, (value, text, more) in deployed.items():
        dataset[name] = ((), value, {'long_name': text, **more})
    return dataset.assign_attrs(_about(dataset, scenario, card, serial, day))


def _measured(
    time_s: np.ndarray, rows: np.ndarray, scenario: Scenario, card: dict
) -> dict[str, np.ndarray]:
    """Variables over the measurements; times since the start (s)."""
    odom = COLUMNS['odom'].start
    place = poses_from_wire(np.ascontiguousarray(rows[:, odom : odom + 7]))
    attitude, depth = place[:, 3:], place[:, 2]
    if 'imu' in scenario.topics:
        wire = np.zeros((len(rows), 7))
        wire[:, 3:] = rows[:, COLUMNS['imu']][:, :4]
        attitude = poses_from_wire(wire)[:, 3:]
        depth = depth_at(rows[:, COLUMNS['pressure'].start])
    latitude, longitude = on_chart(place[:, 0], place[:, 1], scenario.origin.params())
    longitude = within_180(longitude)
    fix, fixed = (latitude, longitude), (depth < FIX_DEPTH_M) & (time_s % FIX_EVERY_S == 0.0)
    if 'fix' in scenario.topics:
        status, *fixes = rows[:, COLUMNS['fix']].T[:3]
        fix = np.where(time_s == 0.0, fix, fixes)  # it is known where it was put into the water
        fixed = (time_s == 0.0) | (status >= 0.0)
    fix = np.where(fixed, fix, np.nan)
    roll, pitch, heading = np.degrees(attitude).T
    stage = np.nan_to_num(rows[:, COLUMNS['stage']], nan=-1.0).astype(int)
    values = {
        'TIME': time_s,
        'LATITUDE': latitude,
        'LONGITUDE': longitude,
        'DEPTH': depth,
        'TIME_GPS': np.where(np.isfinite(fix[0]), time_s, np.nan),
        'LATITUDE_GPS': fix[0],
        'LONGITUDE_GPS': fix[1],
        'PITCH': pitch,
        'ROLL': roll,
        'HEADING': (heading - scenario.sensors.charted_deg) % 360.0,
        'PHASE': np.array([PHASES.get(one, 0) for one in stage], np.int8),
    }
    reports = (card.get('navigation') or {}).get('reports') or []
    if reports:
        values |= {name: np.full(len(time_s), np.nan) for name in ('WCUR_X', 'WCUR_Y')}
    for report in reports:
        dive = (time_s > report['dive_t_s']) & (time_s <= report['t_s'])
        if report['dac_believed_mps']:
            values['WCUR_Y'][dive], values['WCUR_X'][dive] = report['dac_believed_mps']
    return values


def _compact(time_s: float) -> str:
    """A time as OG1 writes it."""
    return f'{datetime.fromtimestamp(time_s, timezone.utc):%Y%m%dT%H%M%S}'


def _about(
    dataset: xarray.Dataset, scenario: Scenario, card: dict, serial: str, day: str
) -> dict[str, str]:
    # over the date line the westernmost is the larger one
    east = np.unwrap(dataset['LONGITUDE'], period=360.0)
    west, east = (within_180(float(one)) for one in (east.min(), east.max()))
    nobody, now = 'not given', _compact(datetime.now(timezone.utc).timestamp())
    return {
        'Conventions': 'CF-1.10, OG-1.0',
        'featureType': 'trajectory',
        'title': f'Simulated glider trajectory: {scenario.described or scenario.name}',
        'platform': 'sub-surface gliders',
        'platform_vocabulary': f'{VOCABULARY}/L06/current/27/',
        'id': f'{serial}_{day}_delayed',
        'comment': 'Simulated by the glider stack: no measurement of the sea.',
        'contributor_name': nobody,
        'contributor_email': nobody,
        'contributor_role': 'PI',
        'contributor_role_vocabulary': f'{VOCABULARY}/W08/current/',
        'contributing_institutions': nobody,
        'contributing_institutions_role': 'Operator',
        'contributing_institutions_role_vocabulary': f'{VOCABULARY}/W08/current/',
        'rtqc_method': 'No QC applied',
        'start_date': day,
        'time_coverage_start': day,
        'time_coverage_end': _compact(float(dataset['TIME'][-1])),
        'date_created': now,
        'history': f'{now} written by ./glider export --to og1',
        'geospatial_lat_min': float(dataset['LATITUDE'].min()),
        'geospatial_lat_max': float(dataset['LATITUDE'].max()),
        'geospatial_lon_min': west,
        'geospatial_lon_max': east,
        'scenario_yaml': scenario.to_yaml(vehicle=VEHICLE_FILE),
        'vehicle_yaml': vehicle_file(scenario.vehicle).decode(),
    }
