# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""Water of ocean models from NetCDF files: what is in a file, and a window of it.

Variables and axes are found by what the CF conventions call them, in whatever order: velocities to
the east and to the north, or temperature and salinity, on axes of time, depth, latitude and
longitude, as CMEMS and HYCOM write them. Of a file only the window that is asked for is read, step
by step. What is no such grid is refused by name. Charts of the bottom have no time and no depth.
"""

import hashlib
import math
from collections.abc import Iterator
from contextlib import contextmanager
from datetime import datetime, timezone
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from glider_base.errors import ConfigurationError, installed
from glider_base.files import is_file
from glider_model.ocean.columns import is_height

if TYPE_CHECKING:
    import xarray

#: m/s in units that files have.
_SPEEDS = {
    **dict.fromkeys(('m s-1', 'm/s', 'm s^-1', 'm.s-1', 'meter/s', 'meter second-1'), 1.0),
    **dict.fromkeys(('cm s-1', 'cm/s', 'centimeter/s'), 0.01),
}
_CELSIUS = dict.fromkeys(('degrees_C', 'degree_C', 'degC', 'Celsius', 'celsius', 'deg_C'), 1.0)
_PSU = dict.fromkeys(('1e-3', '0.001', 'psu', 'PSU', '1'), 1.0)
LENGTHS = {
    **dict.fromkeys(('m', 'meter', 'meters', 'metre', 'metres'), 1.0),
    **dict.fromkeys(('cm', 'centimeter', 'centimeters'), 0.01),
    'km': 1000.0,
}
_AXES = ('time', 'depth', 'latitude', 'longitude')
_VALID = ('valid_range', 'valid_min', 'valid_max')


class Wanted(NamedTuple):
    """A quantity of the sea, and how a file tells it."""

    what: str
    names: dict[str, str]  #: what CF calls a variable of a name that says nothing of that
    units: dict[str, float]  #: what makes m/s, degC, psu or m of them
    unit: str  #: which of these
    least: float  #: beyond these it is none of the sea
    most: float


_EAST, _NORTH = 'eastward_sea_water_velocity', 'northward_sea_water_velocity'
POTENTIAL = 'sea_water_potential_temperature'
#: What is read of a file, in this order.
VELOCITIES = (
    Wanted(
        'velocity to the north', {'vo': _NORTH, 'water_v': _NORTH}, _SPEEDS, 'm/s', -10.0, 10.0
    ),
    Wanted('velocity to the east', {'uo': _EAST, 'water_u': _EAST}, _SPEEDS, 'm/s', -10.0, 10.0),
)
TEMPERATURE_AND_SALINITY = (
    Wanted(
        'temperature',
        {'thetao': POTENTIAL, 'water_temp': 'sea_water_temperature'},
        *(_CELSIUS, 'degC', -5.0, 50.0),
    ),
    Wanted(
        'salinity',
        dict.fromkeys(('so', 'salinity'), 'sea_water_salinity'),
        *(_PSU, 'psu', 0.0, 60.0),
    ),
)
#: What CF calls a bottom that is a height, and some of what it calls one that is a depth.
_HEIGHTS = ('height_above_mean_sea_level', 'height_above_reference_ellipsoid', 'surface_altitude')
_BELOW = ('sea_floor_depth_below_mean_sea_level', 'sea_floor_depth_below_sea_surface')
#: As GEBCO and CMEMS (``deptho``) write it: without time and depth.
BOTTOM = (
    Wanted(
        'depth of the bottom',
        {
            **dict.fromkeys(('elevation', 'z'), _HEIGHTS[0]),
            **{'deptho': 'sea_floor_depth_below_geoid', 'bathymetry': 'sea_floor_depth'},
            **{name: name for name in (*_HEIGHTS, *_BELOW)},
        },
        *(LENGTHS, 'm', -9000.0, 12000.0),
    ),
)
#: What a grid is for, and what is read of it; a file may have several.
GRIDS = {'currents': VELOCITIES, 'water': TEMPERATURE_AND_SALINITY, 'bottom': BOTTOM}
#: What of a grid no regular axes have, by names of dimensions or coordinates: what it is called.
_OTHER_GRIDS = {
    's_rho': 'levels that follow the bottom, as ROMS and CROCO have',
    **dict.fromkeys(('sigma', 'ocean_s_coordinate'), 'levels that follow the bottom'),
    'projection_x_coordinate': 'a projected grid, as polar models have',
    **dict.fromkeys(('rlon', 'grid_latitude', 'grid_longitude'), 'a rotated grid'),
    'node': 'a mesh of triangles',
    'face': 'a mesh',
}
#: Bytes of a window at most.
MAX_BYTES = 400_000_000
#: Of it so many bytes are read at once: what is packed in steps together is not unpacked for each.
_BLOCK_BYTES = 50_000_000
#: A place is not beyond a file by what it was rounded, be it to float32 (deg): a metre.
EDGE_DEG = 1e-5
#: A step of an axis is a hole if it is so many times as wide as those beside it.
HOLE_STEPS = 2.5
DAY_S = 86400.0
#: The fingerprint of a file is made of its size and so many bytes at either end.
_ENDS = 1_000_000


class Window(NamedTuple):
    """What of a grid a mission needs."""

    south: float  #: (deg)
    north: float
    west: float  #: may be less than -180, and east more than 180
    east: float
    deepest: float  #: (m)
    begin: float  #: (s since 1970, UTC); nan: where the file begins
    lasts: float  #: (s)


class Axes(NamedTuple):
    """Axes of a grid, each increasing."""

    times: np.ndarray  #: (s since 1970, UTC)
    depths: np.ndarray  #: (m, + down); a file without has its one level at the surface
    latitudes: np.ndarray  #: (deg)
    longitudes: np.ndarray  #: (deg), those nearest to the middle of the window


class Loaded(NamedTuple):
    """A window of a grid."""

    axes: Axes  #: a bottom has one time and one depth
    #: float32[time, depth, latitude, longitude, n], what was wanted; a bottom's is above 0 but
    #: for land
    water: np.ndarray
    standards: tuple[str, ...]  #: what CF calls each of them
    land: np.ndarray  #: bool[latitude, longitude], of the uppermost level


class _Layout(NamedTuple):
    """Where in a dataset what is wanted and its axes are."""

    dataset: 'xarray.Dataset'
    variables: tuple[str, ...]
    standards: tuple[str, ...]  #: what CF calls them
    scales: list[float]  #: that make m/s, degC, psu or m of them
    axes: dict[str, str]  #: dimension by axis; depth may be missing
    values: dict[str, np.ndarray]  #: of each axis, as in the file; one 0 where it is missing


def engine_of(path: Path) -> str:
    """By what xarray reads a NetCDF file; a ConfigurationError if that is not installed."""
    with open(path, 'rb') as file:
        if file.read(4) != b'\x89HDF':
            return 'scipy'
    with installed(f'file {path}: h5netcdf, which reads NetCDF 4'):
        import h5netcdf  # noqa: F401 - xarray has no word of its own for that
    return 'h5netcdf'


@contextmanager
def _opened(path: Path) -> Iterator['xarray.Dataset']:
    """Dataset of a file, of which nothing is read yet.

    A ConfigurationError names the file, also of what is found wrong in it.
    """
    import xarray

    if not is_file(path):
        raise ConfigurationError(f'file {path}: no such file')
    engine = engine_of(path)
    try:
        dataset = xarray.open_dataset(path, engine=engine, decode_times=False)
    except Exception as error:  # of libraries, of many types, for files that are none
        text = f'xarray reads: {type(error).__name__}: {error}'.splitlines()[0][:200]
        raise ConfigurationError(f'file {path}: not a NetCDF file that {text}') from None
    with dataset:
        try:
            yield dataset
        except (ValueError, OSError) as error:  # also of numbers that cannot be unpacked
            raise ConfigurationError(f'file {path}: {error}') from None


def fingerprint(path: Path) -> str:
    """Whether a file is the same one, by its size and its ends: 16 hexadecimal digits.

    Raises ConfigurationError if it cannot be read.
    """
    try:
        with open(path, 'rb') as file:
            size = file.seek(0, 2)
            file.seek(0)
            digest = hashlib.sha256(f'{size} '.encode() + file.read(_ENDS))
            file.seek(max(0, size - _ENDS))
            digest.update(file.read(_ENDS))
    except OSError as error:
        raise ConfigurationError(f'file {path}: {error.strerror}') from None
    return digest.hexdigest()[:16]


def _named(dataset: 'xarray.Dataset') -> dict[str, str | None]:
    """Standard name of each variable."""
    return {str(name): one.attrs.get('standard_name') for name, one in dataset.data_vars.items()}


def _listed(dataset: 'xarray.Dataset') -> str:
    """Names of the variables that a file has, for messages."""
    return ', '.join(list(_named(dataset))[:12]) or 'none'


def _candidates(dataset: 'xarray.Dataset', wanted: Wanted) -> dict[str, str]:
    """What CF calls each variable that may be what is wanted."""
    named, known = _named(dataset), wanted.names
    found = {name: standard for name, standard in named.items() if standard in known.values()}
    return found or {name: known[name.lower()] for name in named if name.lower() in known}


def _variable(dataset: 'xarray.Dataset', wanted: Wanted) -> tuple[str, str]:
    """Name of a variable, and what CF calls it."""
    found, known = _candidates(dataset, wanted), wanted.names
    if not found:
        raise ValueError(
            f'no {wanted.what} (allowed: a variable of standard_name '
            f'{" or ".join(dict.fromkeys(known.values()))}, or called {" or ".join(known)}; it '
            f'has {_listed(dataset)})'
        )
    if len(found) > 1:
        raise ValueError(f'several of {wanted.what}: {", ".join(found)} (allowed: one)')
    return next(iter(found.items()))


def _axis_of(name: str, variable: 'xarray.Variable') -> str:
    """Which axis a coordinate is; empty if none."""
    attrs = variable.attrs
    units, standard = str(attrs.get('units', '')), attrs.get('standard_name')
    if standard in _AXES:
        return standard
    if ' since ' in units or name.lower() == 'time':
        return 'time'
    for axis, prefix in (('latitude', 'degrees_n'), ('longitude', 'degrees_e')):
        if units.lower().startswith(prefix) or name.lower() in (axis, axis[:3]):
            return axis
    is_depth = attrs.get('axis') == 'Z' or attrs.get('positive') in ('up', 'down')
    return 'depth' if is_depth or name.lower() in ('depth', 'lev') else ''


def _flat(dataset: 'xarray.Dataset') -> str:
    """Name of a latitude or longitude of two dimensions; empty if there is none."""
    for name, one in dataset.variables.items():
        if one.ndim == 2 and _axis_of(str(name), one) in ('latitude', 'longitude'):
            return str(name)
    return ''


def _find_axes(dataset: 'xarray.Dataset', name: str, allowed: tuple[str, ...]) -> dict[str, str]:
    """Dimension of a variable by axis.

    A ValueError names the dimension that is none, and what grid it seems to be.
    """
    found: dict[str, str] = {}
    for dimension in map(str, dataset[name].dims):
        coordinate = dataset.variables.get(dimension)
        axis = '' if coordinate is None else _axis_of(dimension, coordinate)
        known = ' '.join((dimension, str(getattr(coordinate, 'attrs', {}).get('standard_name'))))
        other = next((text for word, text in _OTHER_GRIDS.items() if word in known.lower()), '')
        if axis not in allowed or axis in found or other:
            if not other and (flat := _flat(dataset)):
                other = f'a curvilinear grid: {flat} has two dimensions'
            raise ValueError(
                f'{name}: dimension {dimension} is no axis{f"; {other}" if other else ""} '
                f'(allowed: regular axes of {", ".join(allowed)})'
            )
        found[axis] = dimension
    missing = [axis for axis in allowed if axis not in found and axis != 'depth']
    if missing:
        raise ValueError(f'{name}: no axis of {missing[0]} (it has {", ".join(found.values())})')
    return found


def _times(variable: 'xarray.Variable') -> np.ndarray:
    """Times of an axis (s since 1970, UTC)."""
    from xarray.coding.times import decode_cf_datetime

    units, calendar = variable.attrs.get('units'), variable.attrs.get('calendar')
    try:
        values = decode_cf_datetime(variable.values, str(units), calendar and str(calendar))
    except (ValueError, ImportError, OverflowError):  # of other calendars, by a library for them
        values = np.empty(0)
    if values.dtype.kind != 'M':
        raise ValueError(
            f'time: units = {units!r}, calendar = {calendar or "none"!r}: no times of this world '
            "(allowed: such as 'hours since 1950-01-01', of the standard calendar)"
        )
    return values.astype('datetime64[ns]').astype(np.int64) / 1e9


def scale_of(name: str, attrs: dict, units: dict[str, float], usual: str = '') -> float:
    """What the numbers of a variable are multiplied by, as its attributes tell.

    Those that tell no unit are in the ``usual`` one. A ValueError names the units that there are.
    """
    unit, known = str(attrs.get('units') or usual).strip(), {one.lower(): one for one in units}
    if unit.lower() not in known:
        raise ValueError(f'{name}: units = {unit!r} (allowed: {", ".join(units)})')
    return units[known[unit.lower()]]


def only_valid(numbers: np.ndarray, attrs: dict, packed: dict) -> np.ndarray:
    """Numbers of a variable of a file, NaN where they are not valid by CF (2.5.1).

    Limits of ``packed`` numbers that are whole numbers themselves are those of what is packed.
    """
    ends = attrs.get('valid_min', -math.inf), attrs.get('valid_max', math.inf)
    low, high = limits = np.array(attrs.get('valid_range', ends)).astype(float)
    kinds = [np.asarray(attrs[name]).dtype.kind for name in _VALID if name in attrs]
    if 'scale_factor' in packed or 'add_offset' in packed:
        scale, offset = packed.get('scale_factor', 1.0), packed.get('add_offset', 0.0)
        if all(kind in 'iu' for kind in kinds):
            low, high = sorted(scale * limits + offset)
        low, high = low - 0.5 * abs(scale), high + 0.5 * abs(scale)  # as it is rounded
    return np.where((numbers < low) | (numbers > high), math.nan, numbers)


def _allowed(wanted: tuple[Wanted, ...]) -> tuple[str, ...]:
    """Axes that what is wanted may have."""
    return _AXES[2:] if wanted is BOTTOM else _AXES


def _layout(dataset: 'xarray.Dataset', wanted: tuple[Wanted, ...]) -> _Layout:
    """Where what is wanted of a dataset and its axes are.

    A ValueError names what is missing, or is no regular grid.
    """
    found = [_variable(dataset, one) for one in reversed(wanted)][::-1]
    names, standards = zip(*found, strict=True)
    allowed = _allowed(wanted)
    axes = _find_axes(dataset, names[-1], allowed)
    if _find_axes(dataset, names[0], allowed) != axes:
        both = ' and '.join(str(dataset[name].dims) for name in names)
        raise ValueError(f'{" and ".join(names)}: on different axes, {both}, as a '
                         'staggered grid has them (allowed: both at the same places)')  # fmt: skip
    scales = []
    for one, (name, standard) in zip(wanted, found, strict=True):
        attrs = dataset[name].attrs
        for word in ('scale_factor', 'add_offset'):
            packed = dataset[name].encoding.get(word, 0)
            if np.asarray(packed).dtype.kind not in 'iuf':
                raise ValueError(f'{name}: {word} = {packed!r} (allowed: a number)')
        points = attrs.get('positive', 'up' if standard in _HEIGHTS else 'down')
        usual = 'm' if wanted is BOTTOM else ''
        scales.append(scale_of(name, attrs, one.units, usual) * (-1.0 if points == 'up' else 1.0))
    values = {axis: np.zeros(1) for axis in _AXES[:2]}
    for axis, dimension in axes.items():
        one = dataset.variables[dimension]
        values[axis] = _times(one) if axis == 'time' else np.array(one.values, dtype=float)
        if axis == 'depth':
            scale = scale_of(dimension, one.attrs, LENGTHS, 'm')
            is_up = one.attrs.get('positive') == 'up' or is_height(values[axis])
            values[axis] *= scale * (-1.0 if is_up else 1.0)
            if len(one) and values[axis].max() < 0.0:
                raise ValueError(f'{dimension}: positive up, and no level below the surface')
        if not _is_axis(values[axis]) and not (
            axis == 'longitude' and _is_axis(np.unwrap(values[axis], period=360.0))
        ):
            raise ValueError(f'{dimension}: neither increases nor decreases all along')
    return _Layout(dataset, names, standards, scales, axes, values)


def _is_axis(values: np.ndarray) -> bool:
    """Whether there are numbers, and they are in order."""
    steps = np.diff(values)
    in_order = np.isfinite(values).all() and (np.all(steps > 0) or np.all(steps < 0))
    return len(values) > 0 and in_order


def _chosen(values: np.ndarray, low: float, high: float) -> np.ndarray:
    """Indices, by increasing value, of what lies within limits, and of one on either side."""
    order = np.argsort(values, kind='stable')
    first, last = np.searchsorted(values[order], (low, high), side='left')
    last += last < len(order) and values[order][last] == high
    return order[max(0, first - 1) : last + 1]


def _runs(indices: np.ndarray) -> list[slice]:
    """Indices as slices of steps of 1 or -1: files are read in slices."""
    found = []
    for part in np.split(indices, np.flatnonzero(np.abs(np.diff(indices)) != 1) + 1):
        step = -1 if len(part) > 1 and part[1] < part[0] else 1
        end = int(part[-1]) + step
        found.append(slice(int(part[0]), None if end < 0 else end, step))
    return found


def load(
    path: Path,
    window: Window | None = None,
    needed: Window | None = None,
    wanted: tuple[Wanted, ...] = VELOCITIES,
) -> Loaded:
    """Read what is wanted of a file in a window, as far as the file has it; all of it without one.

    A ConfigurationError names the file, and what is missing in it or what of the window that is
    ``needed`` it does not cover.
    """
    with _opened(path) as dataset:
        layout = _layout(dataset, wanted)
        chosen, axes, whole = _select(layout, window)
        if needed is not None:
            _refuse_uncovered(whole, needed)
        size = _bytes(layout, chosen)
        if size > MAX_BYTES:
            raise ValueError(f'{size:,} bytes of it are needed (allowed: <= {MAX_BYTES:,})')
        return _read(layout, chosen, axes, wanted, wanted is not BOTTOM)


def _bytes(layout: _Layout, chosen: dict[str, np.ndarray]) -> int:
    """Bytes of a window."""
    return 4 * len(layout.variables) * math.prod(map(len, chosen.values()))


def _select(layout: _Layout, window: Window | None) -> tuple[dict[str, np.ndarray], Axes, Axes]:
    """Indices that a window needs, by axis, the axes that they make, and those of all."""
    values = dict(layout.values)
    longitudes = values['longitude']
    middle = 0.5 * (longitudes.min() + longitudes.max())
    first, last = _hole(np.sort(longitudes))
    if last - first > 360.0 - np.ptp(longitudes):  # of a sea across the date line
        middle = 0.5 * (first + last) + 180.0
    if window is not None:
        middle = 0.5 * (window.west + window.east)
    # the same meridians, as near to the middle as they can be
    values['longitude'] = middle + (longitudes - middle + 180.0) % 360.0 - 180.0
    if window is None:
        chosen = {axis: np.argsort(values[axis], kind='stable') for axis in _AXES}
    else:
        begin = values['time'].min() if math.isnan(window.begin) else window.begin
        limits = {
            'time': (begin, begin + window.lasts),
            'depth': (0.0, window.deepest),
            'latitude': (window.south, window.north),
            'longitude': (window.west, window.east),
        }
        chosen = {axis: _chosen(values[axis], *limits[axis]) for axis in _AXES}
    axes = Axes(*(values[axis][chosen[axis]] for axis in _AXES))
    return chosen, axes, Axes(*(np.sort(values[axis]) for axis in _AXES))


def _refuse_uncovered(axes: Axes, window: Window) -> None:
    """Refuse a grid that does not cover a window in place or time.

    A grid with one time is a steady one. Above its first level and below its last one it has the
    water of these. A ValueError names the axis, and what there is.
    """
    if len(axes.times) > 1 and not math.isnan(window.begin):
        first, last = axes.times[0], axes.times[-1]
        if window.begin < first or window.begin + window.lasts > last:
            raise ValueError(
                f'the mission goes from {time_text(window.begin)} to '
                f'{time_text(window.begin + window.lasts)} (allowed: within '
                f'{time_text(first)} to {time_text(last)}, the times of the file)'
            )
    elif len(axes.times) > 1 and window.lasts > axes.times[-1] - axes.times[0]:
        raise ValueError(
            f'the mission lasts {window.lasts:,.0f} s (allowed: '
            f'<= {axes.times[-1] - axes.times[0]:,.0f} s, the times of the file)'
        )
    begin = axes.times[0] if math.isnan(window.begin) else window.begin
    first, last = (DAY_S * day for day in _hole(axes.times / DAY_S))
    if begin < last and begin + window.lasts > first:
        raise ValueError(
            f'no water between {time_text(first)} and {time_text(last)}, of the mission '
            f'(allowed: steps of <= {HOLE_STEPS:g} times those beside them)'
        )
    for name, values, low, high in (
        ('latitude', axes.latitudes, window.south, window.north),
        ('longitude', axes.longitudes, window.west, window.east),
    ):
        first, last = _hole(values)
        low, high = low + EDGE_DEG, high - EDGE_DEG
        if low < values[0] or high > values[-1] or (low < last and high > first):
            hole = f', but not {first:.3f} to {last:.3f}' if first < last else ''
            raise ValueError(
                f'the {name} of the path goes from {low:.3f} to {high:.3f} deg '
                f'(allowed: within {values[0]:.3f} to {values[-1]:.3f}{hole}, as the file has it)'
            )


def _hole(values: np.ndarray) -> tuple[float, float]:
    """Where an axis has no points (deg, days): behind its ends, if they are turned to one side."""
    steps = [float(step) for step in np.diff(values)]
    widest = max(range(len(steps)), key=steps.__getitem__, default=0)
    beside = steps[max(0, widest - 1) : widest] + steps[widest + 1 : widest + 2]
    if not steps or steps[widest] <= (HOLE_STEPS * max(beside) if beside else 180.0):
        return math.inf, -math.inf
    return float(values[widest]), float(values[widest + 1])


def _read(
    layout: _Layout,
    chosen: dict[str, np.ndarray],
    axes: Axes,
    wanted: tuple[Wanted, ...],
    is_needed: bool = False,
) -> Loaded:
    """Numbers of a window, with the nearest water in place of land and bottom.

    Numbers that are none of what is ``wanted`` are refused, and a step without any where each
    ``is_needed``. A bottom without a number is as far above the sea as the nearest of it is from
    its surface.
    """
    shape = tuple(len(one) for one in axes)
    water = np.empty((*shape, len(layout.variables)), dtype=np.float32)
    present = {axis: layout.axes[axis] for axis in _AXES if axis in layout.axes}
    is_bottom, land = 'time' not in present, np.zeros(shape[2:], dtype=bool)
    at_once = max(1, _BLOCK_BYTES // (8 * math.prod(shape[1:])))
    for begin in range(0, shape[0], at_once):
        now = {**chosen, 'time': chosen['time'][begin : begin + at_once]}
        for component, name in enumerate(layout.variables):
            block = _cut(layout.dataset[name], present, now).reshape(-1, *shape[1:])
            for step, read in enumerate(layout.scales[component] * block, begin):
                what = name if is_bottom else f'{name} at {time_text(axes.times[step])}'
                _refuse_no_water(what, read, wanted[component], is_needed)
                dry = ~np.isfinite(read)
                filled = _fill_land(read)
                if is_bottom:
                    filled = np.where(dry, -abs(filled), filled)
                    dry = filled <= 0.0
                if step == 0:
                    land |= dry[0]
                water[step, ..., component] = filled
    return Loaded(axes, water, layout.standards, land)


def _refuse_no_water(what: str, read: np.ndarray, wanted: Wanted, is_needed: bool) -> None:
    """Refuse numbers of a step that are none of the sea, or missing where some are needed."""
    found = read[np.isfinite(read)]
    allowed = f'{wanted.least:g} to {wanted.most:g} {wanted.unit}'
    if is_needed and not len(found):
        raise ValueError(f'{what}: no number around the mission (allowed: {allowed})')
    for one in (float(found.min()), float(found.max())) if len(found) else ():
        if not wanted.least <= one <= wanted.most:
            raise ValueError(f'{what}: {one:g} {wanted.unit} (allowed: {allowed})')


def _cut(part: 'xarray.DataArray', axes: dict[str, str], chosen: dict[str, np.ndarray]):
    """Numbers of a variable where they are chosen along its axes, in the order of these."""
    import xarray

    attrs, packed = part.attrs, part.encoding
    for axis, dimension in axes.items():
        pieces = [part.isel({dimension: run}) for run in _runs(chosen[axis])]
        if len(pieces) > 1:
            pieces = [xarray.concat([piece.load() for piece in pieces], dimension)]
        (part,) = pieces
    # read first: of packed NetCDF 3 xarray transposes nothing that it has not read
    numbers = np.asarray(part.load().transpose(*axes.values()).values, dtype=float)
    return only_valid(numbers, attrs, packed)


def _fill_land(levels: np.ndarray) -> np.ndarray:
    """The nearest water in place of land, level by level; of a level without, that above it.

    Above the first level that has water it is that of this one.
    """
    from scipy.ndimage import distance_transform_edt

    first = int(np.isfinite(levels).any(axis=(1, 2)).argmax())
    for level, values in enumerate(levels[first:], first):
        dry = ~np.isfinite(values)
        if dry.all():
            values[:] = levels[level - 1] if level > first else 0.0
        elif dry.any():
            _, nearest = distance_transform_edt(dry, return_indices=True)
            values[:] = values[tuple(nearest)]
    levels[:first] = levels[first]
    return levels


class Part(NamedTuple):
    """What of a file can be used for one purpose."""

    #: of each variable its name, what it is, the standard_name it is taken for in CF, units as the
    #: file says, and the unit that is made of them
    variables: list[dict[str, str]]
    axes: dict[str, np.ndarray]  #: each increasing; a bottom has neither time nor depth
    #: in the middle of its time: all levels, or the uppermost if all are too large to be read;
    #: None if that is, too
    seen: Loaded | None


class Contents(NamedTuple):
    """What is in a file."""

    source: str  #: as the file says
    parts: dict[str, Part]  #: of currents, water and bottom those that can be used
    refused: dict[str, str]  #: those that are there and cannot be used, and why


def contents(path: Path) -> Contents:
    """What is in a file; a ValueError names the file, if nothing of it can be used, and why."""
    with _opened(path) as dataset:
        source = dataset.attrs.get('source') or dataset.attrs.get('title') or ''
        found = Contents(str(source), {}, {})
        for name, wanted in GRIDS.items():
            if any(_candidates(dataset, one) for one in wanted):
                try:
                    found.parts[name] = _part(dataset, wanted)
                except ValueError as error:
                    found.refused[name] = str(error)
        if found.parts:
            return found
        names = (name for one in sum(GRIDS.values(), ()) for name in one.names)
        nothing = (
            'no currents, no temperature and salinity, and no bottom (allowed: variables of such '
            f'standard_name, or called {", ".join(names)}; it has {_listed(dataset)})'
        )
        raise ValueError('; '.join(found.refused.values()) or nothing)


def _part(dataset: 'xarray.Dataset', wanted: tuple[Wanted, ...]) -> Part:
    """What of a dataset can be used for one purpose; errors as `_layout`."""
    layout = _layout(dataset, wanted)
    chosen, axes, _ = _select(layout, None)
    time = slice(len(axes.times) // 2, len(axes.times) // 2 + 1)
    seen = None
    for levels in (len(axes.depths), 1):
        some = {**chosen, 'time': chosen['time'][time], 'depth': chosen['depth'][:levels]}
        if _bytes(layout, some) <= MAX_BYTES:
            there = axes._replace(times=axes.times[time], depths=axes.depths[:levels])
            seen = _read(layout, some, there, wanted)
            break
    variables = [
        {
            **{'name': name, 'what': one.what, 'standard_name': standard},
            **{'units': str(dataset[name].attrs.get('units', '')), 'unit': one.unit},
        }
        for name, standard, one in zip(layout.variables, layout.standards, wanted, strict=True)
    ]
    by_name = dict(zip(_AXES, axes, strict=True))
    return Part(variables, {axis: by_name[axis] for axis in _allowed(wanted)}, seen)


def time_text(seconds: float) -> str:
    """A time (s since 1970, UTC) as a person reads it."""
    return f'{datetime.fromtimestamp(seconds, timezone.utc):%Y-%m-%dT%H:%MZ}'
