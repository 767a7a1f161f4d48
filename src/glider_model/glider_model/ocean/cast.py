# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""Measured water: density and temperature by depth, from a CSV file or a NetCDF cast.

What is read becomes a table with a row for each metre, between which the kernels interpolate. In
such water the viscous forces go with the density too.
"""

from pathlib import Path
from typing import NamedTuple

import numpy as np

from glider_base.errors import ConfigurationError, installed
from glider_base.kernel import kernel
from glider_base.signals import SEA_WATER_DENSITY
from glider_model.ocean.columns import MAX_ROWS, check_rows, is_height, read_columns
from glider_model.ocean.density import SPECIFIC_WEIGHT, displacing, immersed
from glider_model.ocean.grid_file import LENGTHS, engine_of, only_valid, scale_of

#: Columns of a file: density, or what it follows from by TEOS-10.
COLUMNS = ('depth_m', 'density_kgpm3', 'temperature_degC', 'salinity_psu')
#: Their names in the CF conventions.
_STANDARD_NAMES = {
    'depth': 'depth_m',
    'sea_water_pressure': 'pressure_dbar',
    'sea_water_density': 'density_kgpm3',
    'sea_water_temperature': 'temperature_degC',
    'sea_water_practical_salinity': 'salinity_psu',
    'sea_water_salinity': 'salinity_psu',
}
#: What numbers are multiplied by, and the unit of those that tell none.
_PRESSURES = {
    **dict.fromkeys(('dbar', 'decibar', 'dbars', 'decibars', 'db'), 1.0),
    **{'bar': 10.0, 'kPa': 0.1, 'hPa': 0.01, 'mbar': 0.01, 'Pa': 1e-4},
}
_UNITS = {'depth_m': (LENGTHS, 'm'), 'pressure_dbar': (_PRESSURES, 'dbar')}
#: What no water is beyond.
RANGES = dict(zip(COLUMNS[1:], ((950.0, 1100.0), (-5.0, 50.0), (0.0, 60.0)), strict=True))
#: Latitude (deg) of the gravity by which pressure follows from depth.
_LATITUDE = 45.0


class CastParams(NamedTuple):
    """Measured water as the kernels see it."""

    rows: np.ndarray  #: float64[n, 2], at each metre: density over `SEA_WATER_DENSITY`, degC
    has_temperature: bool
    hull_compression: float  #: of a vehicle whose file has no volume (1/Pa)


@kernel
def look_up(depth, rows):
    """Density over `SEA_WATER_DENSITY` and temperature (degC) at a depth (m), held at the ends."""
    last = len(rows) - 1
    if not depth > 0.0:
        return rows[0, 0], rows[0, 1]
    if depth >= last:
        return rows[last, 0], rows[last, 1]
    above = int(depth)
    part = depth - above
    return (
        rows[above, 0] + part * (rows[above + 1, 0] - rows[above, 0]),
        rows[above, 1] + part * (rows[above + 1, 1] - rows[above, 1]),
    )


@immersed.body(CastParams)
@kernel
def _in_measured_water(depth, m_b, vehicle, params):
    """Of a vehicle without a volume neutral at the surface of this water."""
    ratio, temperature = look_up(depth, params.rows)
    volume, compressibility = vehicle.volume, vehicle.compressibility
    if volume == 0.0:
        volume = vehicle.m / (SEA_WATER_DENSITY * params.rows[0, 0])
        compressibility = params.hull_compression
    warmer = temperature - vehicle.reference_temperature if params.has_temperature else 0.0
    return displacing(m_b, volume, compressibility, warmer, ratio, depth, vehicle)


def cast_params(rows: list[list[float]], hull_compression_per_m: float) -> CastParams:
    """Kernel parameters of checked rows of depth (m), density (kg/m^3) and, if known, degC."""
    table = np.array(rows, dtype=float)
    depths = np.arange(int(np.ceil(table[-1, 0])) + 1, dtype=float)
    metres = np.zeros((len(depths), 2))
    metres[:, 0] = np.interp(depths, table[:, 0], table[:, 1]) / SEA_WATER_DENSITY
    has_temperature = table.shape[1] > 2
    if has_temperature:
        metres[:, 1] = np.interp(depths, table[:, 0], table[:, 2])
    return CastParams(metres, has_temperature, hull_compression_per_m / SPECIFIC_WEIGHT)


def check_cast(rows: list[list[float]], names, source: str) -> None:
    """Refuse rows that cannot be interpolated, or are no water; ``names`` are their numbers.

    A ValueError names the source, the row and the column at fault.
    """
    names, columns = list(names), ('depth_m', 'density_kgpm3', 'temperature_degC')
    check_rows(rows, names, source, columns, alike=True)
    for column, numbers in zip(columns[1:], [*zip(*rows, strict=True)][1:], strict=False):
        _check_range(column, numbers, names, source)


def _check_range(column: str, numbers, names, source: str) -> None:
    """Refuse numbers of a column that no water has; ``names`` are those of their rows."""
    least, most = RANGES[column]
    for name, number in zip(names, numbers, strict=True):
        if not least <= number <= most:
            raise ValueError(
                f'{source}: row {name}, column {column} = {float(number)!r} '
                f'(allowed: >= {least} and <= {most})'
            )


def read_cast(path: Path) -> list[list[float]]:
    """Read and check a cast: rows of depth (m), density (kg/m^3) and, if it says so, degC.

    A ValueError names the file and what of it is at fault.
    """
    source = f'file {path}'
    if path.suffix == '.nc':
        found = _read_netcdf(path, source)
    else:
        found = read_columns(path, COLUMNS, ('depth_m',))
    if not found:
        raise ValueError(f'{source}: no rows (allowed: at least 1)')
    columns = set(found[0][1])
    if 'density_kgpm3' not in columns and not columns >= {'temperature_degC', 'salinity_psu'}:
        raise ValueError(
            f'{source}: column density_kgpm3 is missing (allowed: density_kgpm3, or '
            'temperature_degC and salinity_psu)'
        )
    names = [name for name, _ in found]
    table = {name: np.array([row[name] for _, row in found]) for name in columns}
    if 'density_kgpm3' not in table:
        for name in COLUMNS[2:]:
            _check_range(name, table[name], names, source)
        measured = (table[name] for name in ('depth_m', *COLUMNS[2:]))
        table['density_kgpm3'], _ = density_of(source, *measured)
    order = [name for name in ('depth_m', *COLUMNS[1:3]) if name in table]
    rows = [[float(number) for number in row] for row in zip(*map(table.get, order), strict=True)]
    check_cast(rows, names, source)
    return rows


def density_of(
    source: str,
    depth_m: np.ndarray,
    temperature_degC: np.ndarray,  # noqa: N803, as the column is called
    salinity_psu: np.ndarray,
    is_potential: bool = False,
) -> tuple[np.ndarray, np.ndarray]:
    """Density (kg/m^3) and temperature (degC) in place, by TEOS-10 with reference salinity.

    A ValueError names the source, if there is no library for it.
    """
    with installed(f'{source}: gsw, which makes density of temperature and salinity'):
        import gsw
    pressure = gsw.p_from_z(-depth_m, _LATITUDE)
    salinity = gsw.SR_from_SP(salinity_psu)
    if is_potential:
        conservative = gsw.CT_from_pt(salinity, temperature_degC)
        temperature_degC = gsw.t_from_CT(salinity, conservative, pressure)  # noqa: N806
    else:
        conservative = gsw.CT_from_t(salinity, temperature_degC, pressure)
    return gsw.rho(salinity, conservative, pressure), temperature_degC


def _read_netcdf(path: Path, source: str) -> list[tuple[int, dict[str, float]]]:
    """Samples of a cast by depth, those that lack a number left out, those of a depth averaged."""
    import xarray

    try:
        with xarray.open_dataset(path, engine=engine_of(path), decode_times=False) as dataset:
            found, told = {}, {}
            for name, variable in {**dataset.coords, **dataset.data_vars}.items():
                known = _STANDARD_NAMES.get(variable.attrs.get('standard_name'), name)
                if known in (*COLUMNS, 'pressure_dbar') and variable.ndim == 1:
                    values, attrs = np.asarray(variable.values, dtype=float), variable.attrs
                    found.setdefault(known, only_valid(values, attrs, variable.encoding))
                    told.setdefault(known, (f'{source}: {name}', attrs))
    except ConfigurationError:
        raise
    except (OSError, ValueError, TypeError, ImportError) as error:
        raise ValueError(f'{source}: not a NetCDF file that xarray reads: {error}') from None
    for known in found.keys() & _UNITS.keys():
        found[known] *= scale_of(*told[known], *_UNITS[known])
    if 'depth_m' not in found and 'pressure_dbar' in found:
        found['depth_m'] = 1e4 * found['pressure_dbar'] / SPECIFIC_WEIGHT
    found.pop('pressure_dbar', None)
    if len({len(values) for values in found.values()}) != 1 or 'depth_m' not in found:
        raise ValueError(
            f'{source}: no profile along one dimension (allowed: variables {", ".join(COLUMNS)}, '
            f'or of standard_name {", ".join(_STANDARD_NAMES)})'
        )
    if is_height(found['depth_m']):
        found['depth_m'] = -found['depth_m']
    table = np.stack(list(found.values()), axis=1)
    table = table[np.isfinite(table).all(axis=1)]
    column = list(found).index('depth_m')
    depths, which = np.unique(np.maximum(table[:, column], 0.0), return_inverse=True)
    if not 0 < len(depths) <= MAX_ROWS:
        raise ValueError(f'{source}: {len(depths)} depths (allowed: 1 to {MAX_ROWS})')
    means = np.zeros((len(depths), table.shape[1]))
    np.add.at(means, which, table)
    means /= np.bincount(which)[:, None]
    means[:, column] = depths
    return [(i + 1, dict(zip(found, map(float, row), strict=True))) for i, row in enumerate(means)]
