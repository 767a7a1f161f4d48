# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""NetCDF files of flights, of version 3 or 4; `variables.yaml` says what is read of them."""

import math
import re
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from functools import cache
from pathlib import Path

import numpy as np

from glider_base.errors import ConfigurationError, installed
from glider_base.files import read_yaml
from glider_flights.record import usable
from glider_model.ocean.grid_file import only_valid

SUFFIXES = ('.nc', '.ncdf', '.nc4')
#: Our unit in those of `variables.yaml`.
_UNITS = {
    **{'': 1.0, 'rad': 1.0, 'deg': math.radians(1.0), 'cc': 1e-6, 'g': 1e-3},
    **{'cm': 1e-2, 'cm aft': -1e-2, 'inch': 0.0254, 'cm/s up': -1e-2},
}
#: Units of which the values are multiplied by something else than `variables.yaml` says; which
#: way they count it says.
SCALES = {
    **dict.fromkeys(('rad', 'radian', 'radians', 'm', 'm/s', 'm s-1', 'kg'), 1.0),
    **dict.fromkeys(('cm', 'cm/s', 'cm s-1'), 1e-2),
    **{'bar': 10.0, 'kPa': 0.1, 'hPa': 0.01, 'mbar': 0.01, 'Pa': 1e-4},
}
#: What is text, or may be.
_TEXTS = ('model', 'vehicle', 'fix_quality')
#: So large are values that are missing, where a file does not say which they are.
FILLS = 1e20
#: What a glider, or its base station, can have been set to (m, rad, dbar, m/s, deg C): others are
#: damage, in kelvin, or stand for none where a file does not say which does.
PLAUSIBLE = {
    **dict.fromkeys(('depth_m', 'depth', 'pressure'), (-50.0, 7000.0)),
    **{'pitch_rad': (-1.6, 1.6), 'roll_rad': (-3.2, 3.2), 'heading_rad': (-6.3, 6.3)},
    **{'temperature_degc': (-5.0, 45.0), 'salinity': (0.0, 50.0)},
    **{'declination_rad': (-3.2, 3.2), 'dac_north': (-5.0, 5.0), 'dac_east': (-5.0, 5.0)},
}
#: Units of some, as an error names them, and as files spell the usual one.
_USUAL = {
    'depth_m': ('m, cm', r'(m|met(er|re)s?)?'),
    'pressure': ('dbar, bar, kPa, hPa, mbar, Pa', r'(d(eci)?bars?|db)?'),
    **dict.fromkeys(('pitch_rad', 'roll_rad', 'heading_rad'), ('degrees, rad', r'(deg.*|°.*)?')),
    **dict.fromkeys(
        ('dac_north', 'dac_east'),
        ('m/s, cm/s', r'((m|met(er|re)s?) *(/|per|[. ·*])? *s(ec(onds?)?)?((\^|\*\*)?-1)?)?'),
    ),
}
_SINCE_1970 = re.compile(
    r'seconds\s+since\s+1970-0?1-0?1([T ]0?0:0?0(:0?0(\.0*)?)?)?\s*(Z|UTC|\+00:?00)?'
)
#: Flags of quality, in a variable of the same name with this ending, of what is bad, or missing;
#: numbers or characters, which may be blank.
_QUALITY, BAD = '_QC', ('4', '9', '4.0', '9.0')
#: By our name, what each name in a file is multiplied by, best name first.
Names = dict[str, dict[str, float]]


@cache
def names_of(kind: str) -> Names:
    """What is read of a kind of files, by `variables.yaml`."""
    table = read_yaml(Path(__file__).with_name('variables.yaml'))
    found: Names = {}
    for key, of in table.items():
        pairs = (
            one if isinstance(one, dict) else {one: of.get('unit', '')} for one in of.get(kind, ())
        )
        names = {name: _UNITS[unit] for pair in pairs for name, unit in pair.items()}
        found |= {key: names} if names else {}
    return found


@contextmanager
def opened(path: Path, is_wanted: Callable[[str], bool]) -> Iterator[list]:
    """The datasets of all groups of a file, of NetCDF 3 or 4, with the variables that are wanted.

    Raises ConfigurationError, also if one turns out to be damaged while it is read.
    """
    try:
        with ExitStack() as stack:
            yield _datasets(path, is_wanted, stack)
    except ConfigurationError:
        raise
    except Exception as error:  # noqa: BLE001 - of a damaged file the libraries say anything
        raise ConfigurationError(f'{path}: cannot be read as NetCDF: {error}') from None


def _datasets(path: Path, is_wanted: Callable[[str], bool], stack: ExitStack) -> list:
    import xarray

    with path.open('rb') as file:
        start = file.read(4)
    if start[:3] == b'CDF':
        dataset = xarray.open_dataset(path, engine='scipy', decode_times=False)
        others = [name for name in dataset.variables if not is_wanted(name)]
        return [stack.enter_context(dataset).drop_vars(others)]
    if start != b'\x89HDF':
        raise ValueError('it is neither NetCDF 3 nor NetCDF 4')
    with installed(f'{path}: h5netcdf, which reads NetCDF 4'):
        import h5netcdf
    file = stack.enter_context(h5netcdf.File(path, 'r', decode_vlen_strings=True))
    return [_dataset(group, is_wanted) for group in _groups(file)]


def _groups(group) -> Iterator:
    """A group of NetCDF 4, and all within it."""
    yield group
    for inner in group.groups.values():
        yield from _groups(inner)


def _dataset(group, is_wanted: Callable[[str], bool]):
    """What is wanted of a group; xarray itself first opens all, of a Seaglider hundreds."""
    import xarray

    store = xarray.backends.H5NetCDFStore(group)
    variables = {
        name: store.open_store_variable(name, group.variables[name])
        for name in group.variables
        if is_wanted(name)
    }
    dataset = xarray.Dataset(variables, attrs=store.get_attrs())
    return xarray.decode_cf(dataset, decode_times=False)


def read(path: Path, wanted: Names, spelt: Callable[[str], str] = str) -> dict[str, np.ndarray]:
    """Variables of a file as flat arrays in our units, by our names.

    Times, in s since 1970, are those of which ours ends with ``time``. ``spelt`` makes a wanted
    name of one in the file. What a file flags as bad is NaN. Raises ConfigurationError, also for a
    depth, pressure or angle in a unit that is not known.
    """
    found: dict[str, np.ndarray] = {}
    every = {name + end for names in wanted.values() for name in names for end in ('', _QUALITY)}
    with opened(path, lambda name: spelt(name) in every) as groups:
        for dataset in groups:
            by_name = {spelt(str(name)): name for name in dataset.variables}
            for key, names in wanted.items():
                name = next((name for name in names if name in by_name), None)
                if name is None or key in found:
                    continue
                variable = dataset[by_name[name]]
                if key in _TEXTS:
                    found[key] = np.atleast_1d(variable.values).ravel()
                    continue
                found[key] = values = _in_ours(f'{path}: {name}', key, variable, names[name])
                flags = dataset.get(f'{by_name[name]}{_QUALITY}')
                if flags is not None and flags.size == values.size:
                    values[np.isin(flags.values.ravel().astype('U8'), BAD)] = math.nan
    return found


def _in_ours(name: str, key: str, variable, scale: float) -> np.ndarray:
    """Values of a variable in our units, by its attributes; NaN for what cannot be."""
    attrs = variable.attrs
    unit = str(attrs.get('units', ''))
    try:
        values = np.atleast_1d(variable.values).ravel().astype(float)
    except (TypeError, ValueError) as error:
        raise ConfigurationError(f'{name} has what is no number: {error}') from None
    values = only_valid(values, attrs, variable.encoding)
    values[np.abs(values) >= FILLS] = math.nan
    if key.endswith('time'):
        return _seconds(name, values, unit)
    if key in _USUAL and unit not in SCALES:
        usual, spelt = _USUAL[key]
        if not re.fullmatch(spelt, unit.strip(), re.IGNORECASE):
            raise ConfigurationError(f'{name} is in {unit!r} (allowed: {usual})')
    if key == 'depth_m' and attrs.get('positive') == 'up':
        scale = -scale
    values = values * math.copysign(SCALES.get(unit, scale), scale)
    lowest, highest = PLAUSIBLE.get(key, (-math.inf, math.inf))
    values[(values < lowest) | (values > highest)] = math.nan
    return values


def refuse_missing(path: Path, found: dict, needed: Names, why: str) -> None:
    """Refuse a file that lacks something that is needed; raises ConfigurationError."""
    missing = [names for key, names in needed.items() if not len(found.get(key, ()))]
    if missing:
        names = ', '.join(' or '.join(names) for names in missing)
        raise ConfigurationError(f'{path}: no variable {names} (needed {why})')


def fixes_of(found: dict[str, np.ndarray]) -> np.ndarray:
    """Usable fixes, each once, in the order of time: time, latitude, longitude, float[n, 3]."""
    none = np.empty(0)
    latitude, longitude = (found.get(f'fix_{name}', none) for name in ('latitude', 'longitude'))
    times = found.get('fix_time', found.get('time', none))
    if not len(latitude) == len(longitude) == len(times):
        return np.empty((0, 3))
    # CF has longitudes to 360 degrees, too, and a track over the date line may go on to -181
    turns = np.where(np.abs(longitude) <= 360.0, np.round(longitude / 360.0), 0.0)
    longitude = longitude - 360.0 * turns
    table = np.stack([times, latitude, longitude], axis=-1)
    good = np.isfinite(table).all(axis=-1) & usable(table[:, 1:])
    return table[good][np.unique(table[good, 0], return_index=True)[1]]


def _seconds(name: str, values: np.ndarray, units: str) -> np.ndarray:
    """Times as s since 1970, whatever their unit."""
    import xarray

    units = units or 'seconds since 1970-1-1'
    if _SINCE_1970.fullmatch(units):
        return values
    try:
        decoded = xarray.coding.times.decode_cf_datetime(values, units)
    except (ImportError, ValueError):  # xarray tries cftime, which may not be there
        raise ConfigurationError(
            f'{name} holds no times in {units!r} (allowed: such as seconds since 1970-01-01)'
        ) from None
    decoded = np.asarray(decoded, 'datetime64[ns]')
    return np.where(np.isnat(decoded), math.nan, decoded.astype(np.int64) * 1e-9)
