# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""NetCDF files of flights, of version 3 or 4."""

import re
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path

import numpy as np

from glider_base.errors import ConfigurationError
from glider_flights.folders import installed

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
    with installed(f'{path}: h5netcdf, which reads NetCDF 4'):
        import h5netcdf  # noqa: F401 - xarray reads NetCDF 4 through it
    return list(xarray.open_groups(path, engine='h5netcdf', decode_times=False).values())


def variables(
    path: Path, wanted: dict[str, Sequence[str]], spelt: Callable[[str], str] = str
) -> Iterator[tuple[str, str, np.ndarray, str]]:
    """Variables of a file as flat arrays, each with our name, its own and its unit.

    Parameters
    ----------
    path : Path
    wanted : dict
        Names that a variable may have in the file, by our own; times, in s since 1970, are those
        of which ours ends with ``time``.
    spelt : callable, optional
        What makes such a name of one in the file.

    Raises
    ------
    ConfigurationError
    """
    found = set()
    try:
        for dataset in datasets(path):
            with dataset:
                by_name = {spelt(str(name)): name for name in dataset.variables}
                for key, names in wanted.items():
                    name = next((name for name in names if name in by_name), None)
                    if name is None or key in found:
                        continue
                    found.add(key)
                    variable = dataset[by_name[name]]
                    units = str(variable.attrs.get('units', ''))
                    values = np.atleast_1d(variable.values).ravel()
                    if values.dtype.kind not in 'SUO' or key.endswith('time'):
                        values = values.astype(float)
                    if key.endswith('time'):
                        values = _seconds(values, units)
                    yield key, name, values, units
    except (OSError, ValueError, TypeError, KeyError, RuntimeError) as error:
        raise ConfigurationError(f'{path}: cannot be read as NetCDF: {error}') from None


def refuse_missing(path: Path, found: dict, needed: dict[str, Sequence[str]], why: str) -> None:
    """Refuse a file that lacks variables: by our names, the names that each may have.

    Raises
    ------
    ConfigurationError
    """
    missing = [names for key, names in needed.items() if not len(found.get(key, ()))]
    if missing:
        names = ', '.join(' or '.join(names) for names in missing)
        raise ConfigurationError(f'{path}: no variable {names} (needed {why})')


def _seconds(values: np.ndarray, units: str) -> np.ndarray:
    """Times as s since 1970, whatever their unit."""
    import xarray

    units = units or 'seconds since 1970-1-1'
    if re.match(r'seconds\s+since\s+1970-0?1-0?1\b', units):
        return values
    decoded = xarray.coding.times.decode_cf_datetime(values, units)
    return np.asarray(decoded, 'datetime64[ns]').astype(np.int64) * 1e-9
