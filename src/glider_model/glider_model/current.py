# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""Velocity of the water: a sum of simple fields of depth and time.

A person writes `CurrentSettings`; `CurrentSettings.params` flattens them into the arrays that
`current_step` reads. The random part draws its numbers from a hash of (seed, component, tick).
"""

import csv
import io
import math
from itertools import pairwise
from pathlib import Path
from typing import Annotated, Literal, NamedTuple

import numpy as np
import pydantic
from pydantic import Field

from glider_model.base.errors import ConfigurationError, shown
from glider_model.base.files import read_text
from glider_model.base.kernel import kernel
from glider_model.base.noise import normal_pair, random_stream
from glider_model.base.settings import Settings
from glider_model.base.signals import Water

#: One international knot (m/s).
KNOT_MPS = 1852.0 / 3600.0
#: No component may be faster than this (m/s); the swiftest ocean currents reach about 2.5 m/s.
MAX_SPEED_MPS = 3.0
#: Rows of a profile, and components of a current: each is looked at in every tick.
MAX_ROWS, MAX_COMPONENTS = 10_000, 100
#: Deepest point of a profile (m).
MAX_DEPTH_M = 12_000.0
#: Period of the principal lunar semidiurnal tide M2, 12.4206 h (s).
M2_PERIOD_S = 12.4206 * 3600.0

_COLUMNS = ('depth_m', 'north_mps', 'east_mps', 'down_mps')
_CONSTANT, _POWER_SHEAR, _EXPONENTIAL_SHEAR, _TABLE, _TIDAL, _GAUSS_MARKOV, _STEPS = range(7)
#: A step counts as reached this long before its time (s): ticks of 0.1 s are not exact in binary.
_STEP_TOLERANCE_S = 1e-6


# ---------------------------------------------------------------------------------- what runs


class CurrentParams(NamedTuple):
    """Components of a current field, flattened; row ``i`` of each array is component ``i``."""

    kind: np.ndarray  #: int64[n], which field it is
    numbers: np.ndarray  #: float64[n, 6], its constants in SI units; their meaning is the kind's
    first: np.ndarray  #: int64[n], first row in `table`, or first index in `CurrentState.values`
    last: np.ndarray  #: int64[n], one past the last row in `table`
    stream: np.ndarray  #: uint64[n], start of its stream of random numbers
    table: (
        np.ndarray
    )  #: float64[m, 4], rows of depth (m) or time (s), then north, east, down (m/s)


class CurrentState(NamedTuple):
    """What a current field remembers from tick to tick."""

    tick: int  #: number of steps taken
    values: np.ndarray  #: float64[2 g], north and east velocity of each Gauss-Markov part (m/s)


@kernel
def current_initial(params):
    """State before the first step, Gauss-Markov parts drawn from their stationary distribution.

    Parameters
    ----------
    params : CurrentParams

    Returns
    -------
    CurrentState
    """
    count = 0
    for i in range(len(params.kind)):
        if params.kind[i] == _GAUSS_MARKOV:
            count += 2
    values = np.zeros(count)
    for i in range(len(params.kind)):
        if params.kind[i] == _GAUSS_MARKOV:
            north, east = normal_pair(params.stream[i], 0)
            values[params.first[i]] = params.numbers[i, 0] * north
            values[params.first[i] + 1] = params.numbers[i, 0] * east
    return CurrentState(0, values)


@kernel
def _profile(depth, table, first, last):
    """Velocity at ``depth`` by linear interpolation in rows [first, last), held at both ends."""
    if depth <= table[first, 0]:
        return table[first, 1], table[first, 2], table[first, 3]
    if depth >= table[last - 1, 0]:
        return table[last - 1, 1], table[last - 1, 2], table[last - 1, 3]
    low, high = first, last - 1
    while high - low > 1:
        middle = (low + high) // 2
        if table[middle, 0] <= depth:
            low = middle
        else:
            high = middle
    part = (depth - table[low, 0]) / (table[high, 0] - table[low, 0])
    return (
        table[low, 1] + part * (table[high, 1] - table[low, 1]),
        table[low, 2] + part * (table[high, 2] - table[low, 2]),
        table[low, 3] + part * (table[high, 3] - table[low, 3]),
    )


@kernel
def _latest_step(t_s, table, first, last):
    """Velocity of the latest row in [first, last) whose time has come; none before the first."""
    v_n, v_e = 0.0, 0.0
    for row in range(first, last):
        if table[row, 0] > t_s + _STEP_TOLERANCE_S:
            break
        v_n, v_e = table[row, 1], table[row, 2]
    return v_n, v_e


@kernel
def current_step(state, position, t_s, params, dt):
    """Water velocity at a place and time, and the state of the field one step later.

    Parameters
    ----------
    state : CurrentState
        State of the field at ``t_s``.
    position : tuple of 3 float
        Place p_NB (m, NED). Only the depth matters; above the surface counts as the surface.
    t_s : float
        Time since the start (s).
    params : CurrentParams
    dt : float
        Time to the next step (s).

    Returns
    -------
    state : CurrentState
        State at ``t_s + dt``.
    water : Water
        Velocity of the water over ground at ``t_s`` (m/s, NED).
    """
    fresh = CurrentState(state.tick, state.values.copy())
    return current_step_in_place(fresh, position, t_s, params, dt)


@kernel
def current_step_in_place(state, position, t_s, params, dt):
    """`current_step` for a loop that owns its state: the values are changed where they lie.

    A loop over it allocates nothing and counts no references, which takes longer than the rest.
    """
    depth = max(position[2], 0.0)
    values = state.values
    v_n, v_e, v_d = 0.0, 0.0, 0.0
    for i in range(len(params.kind)):
        kind = params.kind[i]
        numbers = params.numbers[i]
        first, last = params.first[i], params.last[i]
        if kind == _CONSTANT:
            v_n += numbers[0]
            v_e += numbers[1]
        elif kind == _POWER_SHEAR:
            share = max(1.0 - depth / numbers[2], 0.0) ** numbers[3]
            v_n += share * numbers[0]
            v_e += share * numbers[1]
        elif kind == _EXPONENTIAL_SHEAR:
            share = math.exp(-depth / numbers[2])
            v_n += share * numbers[0]
            v_e += share * numbers[1]
        elif kind == _TABLE:
            north, east, down = _profile(depth, params.table, first, last)
            v_n += north
            v_e += east
            v_d += down
        elif kind == _TIDAL:
            angle = numbers[4] * t_s + numbers[5]
            along, across = math.cos(angle), math.sin(angle)
            v_n += along * numbers[0] + across * numbers[2]
            v_e += along * numbers[1] + across * numbers[3]
        elif kind == _GAUSS_MARKOV:
            v_n += values[first]
            v_e += values[first + 1]
            # exact for any dt, so that the statistics do not depend on it
            keep = math.exp(-dt / numbers[1])
            fresh = numbers[0] * math.sqrt(1.0 - keep * keep)
            north, east = normal_pair(params.stream[i], state.tick + 1)
            values[first] = keep * values[first] + fresh * north
            values[first + 1] = keep * values[first + 1] + fresh * east
        elif kind == _STEPS:
            north, east = _latest_step(t_s, params.table, first, last)
            v_n += north
            v_e += east
    return CurrentState(state.tick + 1, values), Water(v_n, v_e, v_d)


# ------------------------------------------------------------------------- what a person writes


class _Packed(NamedTuple):
    """One component on its way into `CurrentParams`."""

    kind: int
    numbers: tuple[float, ...] = ()
    rows: tuple[tuple[float, ...], ...] = ()
    seed_offset: int = 0


class _Flow(Settings):
    """A horizontal velocity, as a speed and the direction the water flows towards."""

    speed_kn: float | None = Field(
        default=None, ge=0.0, le=5.8, description='Speed of the water (knots); or give speed_mps.'
    )
    speed_mps: float | None = Field(
        default=None,
        ge=0.0,
        le=MAX_SPEED_MPS,
        description='Speed of the water (m/s); or give speed_kn.',
    )
    angle_deg: float | None = Field(
        default=None,
        ge=-360.0,
        le=360.0,
        description='Direction the water flows towards, relative to the first leg of the path '
        '(deg, + to starboard); or give direction_deg.',
    )
    direction_deg: float | None = Field(
        default=None,
        ge=-360.0,
        le=360.0,
        description='Direction the water flows towards (deg, clockwise from north); '
        'or give angle_deg.',
    )

    def _given(self, *names: str) -> list[str]:
        return [name for name in names if getattr(self, name) is not None]

    def _has_flow(self) -> bool:
        return bool(self._given('speed_kn', 'speed_mps', 'angle_deg', 'direction_deg'))

    def _require_flow(self) -> None:
        for one, other in (('speed_kn', 'speed_mps'), ('angle_deg', 'direction_deg')):
            given = self._given(one, other)
            if len(given) != 1:
                found = ' and '.join(f'{name} = {getattr(self, name)!r}' for name in given)
                raise ValueError(
                    f'give exactly one of {one} and {other}, found {found or "neither"}'
                )

    def resolved(self, course_rad: float):
        """Copy with the speed in m/s and the direction clockwise from north.

        Parameters
        ----------
        course_rad : float
            Course of the first leg of the path (rad, clockwise from north).
        """
        if not self._has_flow():
            return self
        speed, direction = self.speed_mps, self.direction_deg
        if speed is None:
            speed = self.speed_kn * KNOT_MPS
        if direction is None:
            direction = (math.degrees(course_rad) + self.angle_deg) % 360.0
        return self.model_copy(
            update={
                'speed_kn': None,
                'speed_mps': speed,
                'angle_deg': None,
                'direction_deg': direction,
            }
        )

    def _north_east(self) -> tuple[float, float]:
        """Velocity as its north and east parts (m/s).

        Raises
        ------
        ValueError
            If the direction is relative to a path that is not known here.
        """
        if self.direction_deg is None:
            raise ValueError(
                f'angle_deg = {self.angle_deg!r} is relative to the path: '
                'call resolved(course_rad) first, or give direction_deg'
            )
        speed = self.speed_mps if self.speed_mps is not None else self.speed_kn * KNOT_MPS
        direction = math.radians(self.direction_deg)
        return speed * math.cos(direction), speed * math.sin(direction)


class _FlowComponent(_Flow):
    """A component that must have a speed and a direction."""

    @pydantic.model_validator(mode='after')
    def _check_flow(self):
        self._require_flow()
        return self


class ConstantCurrent(_FlowComponent):
    """The same velocity everywhere and always."""

    kind: Literal['constant']

    def _pack(self) -> _Packed:
        return _Packed(_CONSTANT, self._north_east())


class ShearCurrent(_FlowComponent):
    """Fastest at the surface, weaker with depth, in one direction.

    ``power`` is V (1 - z/D)^n down to the depth D and nothing below; ``exponential`` is
    V exp(-z/D).
    """

    kind: Literal['shear']
    law: Literal['power', 'exponential'] = Field(
        default='power', description='How the speed decays with depth.'
    )
    depth_m: float = Field(
        ge=1.0,
        le=MAX_DEPTH_M,
        description='Depth (m) where a power law reaches zero, or where an exponential has '
        'fallen to 1/e.',
    )
    exponent: float = Field(
        default=1.0, ge=0.1, le=10.0, description='Exponent n of the power law (1), 1 is linear.'
    )

    def _pack(self) -> _Packed:
        north, east = self._north_east()
        if self.law == 'power':
            return _Packed(_POWER_SHEAR, (north, east, self.depth_m, self.exponent))
        return _Packed(_EXPONENTIAL_SHEAR, (north, east, self.depth_m))


class TableCurrent(Settings):
    """A measured profile: velocity by depth, linear between rows and held beyond the ends.

    A file is read when the settings are validated and lives on as ``rows``, so that validated
    settings need no file. Its path is relative to the folder named ``folder`` in the validation
    context, and to the working directory if there is none.
    """

    kind: Literal['table']
    file: str | None = Field(
        default=None,
        description='CSV file with the columns depth_m, north_mps, east_mps and optionally '
        'down_mps; or give rows.',
    )
    rows: list[list[float]] | None = Field(
        default=None,
        max_length=MAX_ROWS,
        description='Rows of [depth (m), north (m/s), east (m/s)] and optionally down (m/s), '
        'by increasing depth.',
    )

    @pydantic.model_validator(mode='before')
    @classmethod
    def _read_file(cls, values, info: pydantic.ValidationInfo):
        if not isinstance(values, dict):
            return values
        file, rows = values.get('file'), values.get('rows')
        if (file is None) == (rows is None):
            found = 'neither' if file is None else 'both'
            raise ValueError(f'give exactly one of file and rows, found {found}')
        if not isinstance(file, str):
            return values
        folder = (info.context or {}).get('folder', '')
        return {**values, 'file': None, 'rows': _read_profile(Path(folder) / file)}

    @pydantic.model_validator(mode='after')
    def _check_rows(self):
        _check_profile(self.rows, range(1, len(self.rows) + 1), 'rows')
        return self

    def resolved(self, course_rad: float):
        """Return itself: the table is in north and east."""
        return self

    def _pack(self) -> _Packed:
        return _Packed(_TABLE, rows=tuple((*row, 0.0)[:4] for row in self.rows))


class TidalCurrent(_FlowComponent):
    """A tidal ellipse; the speed is its amplitude and the direction its major axis."""

    kind: Literal['tidal']
    ellipticity: float = Field(
        default=0.0,
        ge=-1.0,
        le=1.0,
        description='Minor over major axis (1); + turns clockwise seen from above.',
    )
    period_s: float = Field(
        default=M2_PERIOD_S, ge=60.0, le=4e7, description='Period (s); the default is M2.'
    )
    phase_deg: float = Field(
        default=0.0,
        ge=-360.0,
        le=360.0,
        description='Phase at the start (deg); 0 is full flow along the direction.',
    )

    def _pack(self) -> _Packed:
        north, east = self._north_east()
        minor = (-self.ellipticity * east, self.ellipticity * north)
        rate = 2.0 * math.pi / self.period_s
        return _Packed(_TIDAL, (north, east, *minor, rate, math.radians(self.phase_deg)))


class GaussMarkovCurrent(Settings):
    """Random velocity of zero mean and exponential autocorrelation, north and east independent."""

    kind: Literal['gauss_markov']
    std_mps: float = Field(
        ge=0.0, le=1.0, description='Standard deviation of the north and of the east part (m/s).'
    )
    time_constant_s: float = Field(
        ge=1.0, le=1e7, description='Time in which the autocorrelation falls to 1/e (s).'
    )
    seed_offset: int = Field(
        default=0,
        ge=0,
        le=2**31 - 1,
        description='Chooses another random history under the same seed (1).',
    )

    def resolved(self, course_rad: float):
        """Return itself: it has no direction."""
        return self

    def _pack(self) -> _Packed:
        numbers = (self.std_mps, self.time_constant_s)
        return _Packed(_GAUSS_MARKOV, numbers, seed_offset=self.seed_offset)


class CurrentStep(_Flow):
    """From ``at_s`` on the water has this velocity."""

    at_s: float = Field(ge=0.0, le=1e8, description='Time since the start (s).')
    north_mps: float | None = Field(
        default=None,
        ge=-MAX_SPEED_MPS,
        le=MAX_SPEED_MPS,
        description='Velocity to the north (m/s), with east_mps; or give a speed and a direction.',
    )
    east_mps: float | None = Field(
        default=None,
        ge=-MAX_SPEED_MPS,
        le=MAX_SPEED_MPS,
        description='Velocity to the east (m/s), with north_mps.',
    )

    @pydantic.model_validator(mode='after')
    def _check_velocity(self):
        parts = self._given('north_mps', 'east_mps')
        if not parts:
            if not self._has_flow():
                raise ValueError(
                    'give north_mps and east_mps, or a speed (speed_kn or speed_mps) and a '
                    'direction (angle_deg or direction_deg)'
                )
            self._require_flow()
        elif self._has_flow():
            raise ValueError(
                'give either north_mps and east_mps or a speed and a direction, found both'
            )
        elif len(parts) != 2:
            raise ValueError(f'give both north_mps and east_mps, found only {parts[0]}')
        else:
            _check_speed(math.hypot(self.north_mps, self.east_mps), 'north_mps and east_mps')
        return self

    def _row(self) -> tuple[float, ...]:
        if self.north_mps is not None:
            return (self.at_s, self.north_mps, self.east_mps, 0.0)
        return (self.at_s, *self._north_east(), 0.0)


class StepsCurrent(Settings):
    """A scripted current: constant from step to step, still water before the first."""

    kind: Literal['steps']
    steps: list[CurrentStep] = Field(
        min_length=1, description='Velocities and their times, by increasing at_s.'
    )

    @pydantic.model_validator(mode='after')
    def _check_times(self):
        for number, (one, after) in enumerate(pairwise(self.steps)):
            if after.at_s <= one.at_s:
                raise ValueError(
                    f'steps.{number + 1}.at_s = {after.at_s!r}: times must increase '
                    f'(allowed: > {one.at_s!r})'
                )
        return self

    def resolved(self, course_rad: float):
        """Copy with every direction clockwise from north; ``course_rad`` is the first leg's."""
        steps = [step.resolved(course_rad) for step in self.steps]
        return self.model_copy(update={'steps': steps})

    def _pack(self) -> _Packed:
        return _Packed(_STEPS, rows=tuple(step._row() for step in self.steps))


CurrentComponent = Annotated[
    ConstantCurrent
    | ShearCurrent
    | TableCurrent
    | TidalCurrent
    | GaussMarkovCurrent
    | StepsCurrent,
    Field(discriminator='kind'),
]


class CurrentSettings(_Flow):
    """The water of a mission: one constant current, and any number of components beside it.

    Without a speed there is no constant current.
    """

    components: list[CurrentComponent] = Field(
        default=[],
        max_length=MAX_COMPONENTS,
        description='Further current fields; all of them are added up.',
    )
    seed: int = Field(
        default=0, ge=0, le=2**63 - 1, description='Seed of the random components (1).'
    )

    @pydantic.model_validator(mode='after')
    def _check_constant(self):
        if self._has_flow():
            self._require_flow()
        return self

    def resolved(self, course_rad: float) -> 'CurrentSettings':
        """Copy that needs no path: every angle absolute, every speed in m/s.

        Parameters
        ----------
        course_rad : float
            Course of the first leg of the path (rad, clockwise from north).

        Returns
        -------
        CurrentSettings
            With ``direction_deg`` and ``speed_mps`` in place of ``angle_deg`` and ``speed_kn``.
        """
        components = [component.resolved(course_rad) for component in self.components]
        return super().resolved(course_rad).model_copy(update={'components': components})

    def params(self, seed: int | None = None) -> CurrentParams:
        """Arrays that `current_step` reads.

        Parameters
        ----------
        seed : int, optional
            Seed of the random components, instead of ``self.seed``.

        Raises
        ------
        ValueError
            If an angle is still relative to the path.
        """
        seed = self.seed if seed is None else seed
        packed = [_Packed(_CONSTANT, self._north_east())] if self._has_flow() else []
        packed += [component._pack() for component in self.components]
        count = len(packed)
        kind, first, last = (np.zeros(count, dtype=np.int64) for _ in range(3))
        stream = np.zeros(count, dtype=np.uint64)
        numbers = np.zeros((count, 6))
        table = [row for part in packed for row in part.rows]
        row = random = 0
        for i, part in enumerate(packed):
            kind[i] = part.kind
            numbers[i, : len(part.numbers)] = part.numbers
            if part.kind == _GAUSS_MARKOV:
                first[i] = 2 * random
                stream[i] = random_stream(seed, part.seed_offset, random)
                random += 1
            else:
                first[i], last[i] = row, row + len(part.rows)
                row = last[i]
        return CurrentParams(
            kind, numbers, first, last, stream, np.array(table, dtype=float).reshape(-1, 4)
        )

    def initial_state(self, seed: int | None = None) -> CurrentState:
        """State before the first step; ``seed`` as in `params`."""
        return current_initial(self.params(seed))


# ---------------------------------------------------------------------------------- profile files


def _check_speed(speed_mps: float, where: str) -> None:
    if speed_mps > MAX_SPEED_MPS:
        raise ValueError(
            f'{where}: the speed is {speed_mps:.3f} m/s (allowed: <= {MAX_SPEED_MPS} m/s)'
        )


def _check_profile(rows: list[list[float]], names, source: str) -> None:
    """Refuse a profile that cannot be interpolated; ``names`` are the numbers of its rows."""
    if not rows:
        raise ValueError(f'{source}: no rows (allowed: at least 1)')
    names = list(names)
    for i, row in enumerate(rows):
        where = f'{source}: row {names[i]}'
        if len(row) not in (3, 4):
            raise ValueError(
                f'{where}: {len(row)} columns (allowed: {", ".join(_COLUMNS[:3])}, '
                f'and optionally {_COLUMNS[3]})'
            )
        if not 0.0 <= row[0] <= MAX_DEPTH_M:
            raise ValueError(
                f'{where}, column depth_m = {row[0]!r} (allowed: >= 0.0 and <= {MAX_DEPTH_M})'
            )
        if i > 0 and row[0] <= rows[i - 1][0]:
            raise ValueError(
                f'{where}, column depth_m = {row[0]!r}: depths must increase '
                f'(allowed: > {rows[i - 1][0]!r}, the depth of row {names[i - 1]})'
            )
        _check_speed(math.hypot(*row[1:]), where)


def _read_profile(path: Path) -> list[list[float]]:
    """Read and check a current profile.

    Raises
    ------
    ValueError
        Naming the file, and the column and row (line of the file) at fault.
    """
    source = f'file {path}'
    try:
        reader = csv.reader(io.StringIO(read_text(path), newline=''), skipinitialspace=True)
        lines = [(reader.line_num, cells) for cells in reader if any(map(str.strip, cells))]
    except ConfigurationError as error:
        raise ValueError(f'file {error}') from None
    except csv.Error as error:
        raise ValueError(f'{source}: not a CSV text file: {error}') from None
    header = [name.strip() for name in lines[0][1]] if lines else []
    missing = [name for name in _COLUMNS[:3] if name not in header]
    if missing:
        raise ValueError(
            f'{source}: row {lines[0][0] if lines else 1}: column {missing[0]} is missing '
            f'(allowed: {", ".join(_COLUMNS)})'
        )
    for name in header:
        if name not in _COLUMNS or header.count(name) > 1:
            wrong = 'repeated' if name in _COLUMNS else 'unknown'
            raise ValueError(
                f'{source}: row {lines[0][0]}: column {shown(name)} is {wrong} '
                f'(allowed: {", ".join(_COLUMNS)})'
            )
    if len(lines) > MAX_ROWS + 1:
        raise ValueError(f'{source}: {len(lines) - 1} rows (allowed: <= {MAX_ROWS})')
    rows = []
    for number, cells in lines[1:]:
        if len(cells) != len(header):
            raise ValueError(
                f'{source}: row {number}: {len(cells)} cells for {len(header)} columns'
            )
        cell = dict(zip(header, cells, strict=True))
        where = f'{source}: row {number}, column'
        rows.append([_number(cell[name], f'{where} {name}') for name in _COLUMNS if name in cell])
    _check_profile(rows, [number for number, _ in lines[1:]], source)
    return rows


def _number(text: str, where: str) -> float:
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise ValueError(f'{where} = {shown(text)}: not a finite number')
    return value
