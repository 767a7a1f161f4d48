# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""NetCDF files of flights, of version 3 or 4."""

import re
from pathlib import Path

import numpy as np

from glider_model.base.errors import ConfigurationError

SUFFIXES = ('.nc', '.ncdf', '.nc4')


def datasets(path: Path) -> list:
    """The datasets of all groups of a file, of NetCDF 3 or 4."""
    import xarray

    with path.open('rb') as file:
        start = file.read(4)
    if start[:3] == b'CDF':
        return [xarray.open_dataset(path, engine='scipy', decode_times=False)]
    if start != b'\x89HDF':
        raise ValueError('it is neither NetCDF 3 nor NetCDF 4')
    try:
        import h5netcdf  # noqa: F401 - xarray reads NetCDF 4 through it
    except ImportError:
        raise ConfigurationError(
            f'{path}: h5netcdf, which reads NetCDF 4, is not installed; install it with: '
            './glider python -m pip install --no-deps -r requirements-flights.txt'
        ) from None
    return list(xarray.open_groups(path, engine='h5netcdf', decode_times=False).values())


def seconds(xarray, variable) -> np.ndarray:
    """Times as s since 1970, whatever their unit."""
    units = str(variable.attrs.get('units', 'seconds since 1970-1-1'))
    values = np.atleast_1d(variable.values).ravel().astype(float)
    if re.match(r'seconds\s+since\s+1970-0?1-0?1\b', units):
        return values
    decoded = xarray.coding.times.decode_cf_datetime(values, units)
    return np.asarray(decoded, 'datetime64[ns]').astype(np.int64) * 1e-9
