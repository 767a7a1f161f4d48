# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""A run's dataset as a file of another world: NetCDF, CSV, MATLAB."""

import json
from collections.abc import Callable
from datetime import datetime, timezone
from pathlib import Path

import xarray
from scipy.io import savemat

from glider_base.errors import ConfigurationError
from glider_bringup.door.netcdf import write_dataset
from glider_bringup.door.run import Run
from glider_mission.disk import whole_file
from glider_mission.run_folder import VEHICLE_FILE
from glider_model.vehicle.file import vehicle_file

#: Rows of a CSV file that are written at once: an hour.
_ROWS = 36_000
#: A variable of a MAT-file of version 5 has to be smaller.
MAT_BYTES = 2**31

#: Called with the rows that are written.
Progress = Callable[[int], None]


def dataset_of(run: Run, began_s: float | None = None) -> xarray.Dataset:
    """Dataset of a run, with its score, scenario and vehicle as they stand in a run folder.

    Its time is one by CF where it is known when the run started (s since 1970). Raises
    ConfigurationError if no tick was recorded, of which no file could be read.
    """
    dataset = run.to_xarray()
    if not dataset.sizes['time']:
        raise ConfigurationError(f'{run.folder}: no tick was recorded (allowed: one and more)')
    if began_s is not None:
        began = datetime.fromtimestamp(began_s, timezone.utc).replace(tzinfo=None)
        dataset.time.attrs |= {
            'units': f'seconds since {began.isoformat()}Z',
            **{'calendar': 'standard', 'standard_name': 'time', 'axis': 'T'},
        }
    return dataset.assign_attrs(
        score_json=json.dumps(run.score),
        scenario_yaml=run.scenario.to_yaml(vehicle=VEHICLE_FILE),
        vehicle_yaml=vehicle_file(run.scenario.vehicle).decode(),
    )


def write_netcdf(dataset: xarray.Dataset, file: Path, progress: Progress) -> None:
    """Write NetCDF 3 with 64-bit offsets: units, long names and frames are attributes."""
    with whole_file(file) as stream:
        write_dataset(dataset, Path(stream.name))
    progress(dataset.sizes['time'])


def write_csv(dataset: xarray.Dataset, file: Path, progress: Progress) -> None:
    """Write one row a tick under a line of ``name [unit]``; numbers read back to the same bits."""
    variables = {'time': dataset['time'], **dataset.data_vars}
    header = [f'{name} [{variable.attrs["units"]}]' for name, variable in variables.items()]
    rows = dataset.sizes['time']
    with whole_file(file) as stream:
        stream.write((','.join(header) + '\n').encode())
        for start in range(0, rows, _ROWS):
            part = dataset.isel(time=slice(start, start + _ROWS)).to_dataframe()
            stream.write(part.to_csv(header=False, na_rep='nan').encode())
            progress(min(rows, start + _ROWS))


def write_mat(dataset: xarray.Dataset, file: Path, progress: Progress) -> None:
    """Write a MAT-file of version 5 with the structs data, units, long_names, flags and about.

    The fields of the first three are called alike; ``flags`` says what the numbers of a state or
    mask mean, ``about`` what was flown. Raises ConfigurationError if there are more numbers than
    such a file may have in a struct.
    """
    if dataset.nbytes >= MAT_BYTES:
        raise ConfigurationError(
            f'{file}: cannot be written: the run has {dataset.nbytes / 1e9:.1f} GB of numbers, '
            f'and a MAT-file takes less than {MAT_BYTES / 1e9:.1f} GB (allowed: netcdf, csv)'
        )
    variables = {'time': dataset['time'], **dataset.data_vars}
    content = {
        'data': {name: variable.values for name, variable in variables.items()},
        'units': {name: variable.attrs['units'] for name, variable in variables.items()},
        'long_names': {name: variable.attrs['long_name'] for name, variable in variables.items()},
        'flags': {
            name: {
                key.removeprefix('flag_'): value
                for key, value in variable.attrs.items()
                if key.startswith('flag_')
            }
            for name, variable in variables.items()
            if 'flag_meanings' in variable.attrs
        },
        'about': dict(dataset.attrs),
    }
    with whole_file(file) as stream:
        savemat(stream, content, long_field_names=True, oned_as='column')
    progress(dataset.sizes['time'])


WRITERS: dict[str, Callable[[xarray.Dataset, Path, Progress], None]] = {
    'netcdf': write_netcdf,
    'csv': write_csv,
    'mat': write_mat,
}
