# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""The current of a mission as a person writes it.

`CurrentSettings.params` flattens it into the arrays that `glider_model.ocean.current` reads.
"""

import math
from itertools import pairwise
from pathlib import Path
from typing import Annotated, Literal, NamedTuple, Union, get_args

import numpy as np
import pydantic
from pydantic import Field

from glider_base import plugins
from glider_base.noise import random_stream
from glider_base.settings import Settings, named, number
from glider_base.slot import usable
from glider_model.ocean import current, fields
from glider_model.ocean.columns import MAX_DEPTH_M, MAX_ROWS, check_rows, read_columns
from glider_model.ocean.current import CurrentParams, CurrentState, current_initial
from glider_model.ocean.field import FieldSettings, Mission, NoField

#: No component may be faster than this (m/s); the swiftest ocean currents reach about 2.5 m/s.
MAX_SPEED_MPS = 3.0

_COLUMNS = ('depth_m', 'north_mps', 'east_mps', 'down_mps')
#: One international knot (m/s).
KNOT_MPS = 1852.0 / 3600.0
#: Components of a current: each is looked at in every tick.
MAX_COMPONENTS = 100
#: Period of the principal lunar semidiurnal tide M2, 12.4206 h (s).
M2_PERIOD_S = 12.4206 * 3600.0


def check_speed(speed_mps: float, where: str) -> None:
    """Refuse, by a ValueError that names the place ``where``, a speed that no water has."""
    if speed_mps > MAX_SPEED_MPS:
        raise ValueError(
            f'{where}: the speed is {speed_mps:.3f} m/s (allowed: <= {MAX_SPEED_MPS} m/s)'
        )


def check_profile(rows: list[list[float]], names, source: str) -> None:
    """Refuse a profile that cannot be interpolated; ``names`` are the numbers of its rows.

    A ValueError names the source, the row and the column at fault.
    """
    names = list(names)
    check_rows(rows, names, source, _COLUMNS)
    for name, row in zip(names, rows, strict=True):
        check_speed(math.hypot(*row[1:]), f'{source}: row {name}')


def read_profile(path: Path) -> list[list[float]]:
    """Read and check a current profile.

    A ValueError names the file, and the column and row (line of the file) at fault.
    """
    found = read_columns(path, _COLUMNS, _COLUMNS[:3])
    rows = [list(row.values()) for _, row in found]
    check_profile(rows, [number for number, _ in found], f'file {path}')
    return rows


class _Packed(NamedTuple):
    """One component on its way into `CurrentParams`."""

    kind: int
    numbers: tuple[float, ...] = ()
    rows: tuple[tuple[float, ...], ...] = ()
    seed_offset: int = 0


class _Component(Settings):
    """Part of a current."""

    def resolved(self, course_rad: float):
        """Copy that needs no path; itself, of one that has no direction.

        ``course_rad`` is the course of its first leg (rad, clockwise from north).
        """
        return self


class _Flow(_Component):
    """A horizontal velocity, as a speed and the direction the water flows towards."""

    speed_kn: float | None = number(
        None, (0.0, 5.8), 'Speed of the water (knots); or give speed_mps.'
    )
    speed_mps: float | None = number(
        None, (0.0, MAX_SPEED_MPS), 'Speed of the water (m/s); or give speed_kn.'
    )
    angle_deg: float | None = number(
        None,
        (-360.0, 360.0),
        'Direction the water flows towards, relative to the first leg of the path (deg, + to '
        'starboard); or give direction_deg.',
    )
    direction_deg: float | None = number(
        None,
        (-360.0, 360.0),
        'Direction the water flows towards (deg, clockwise from north); or give angle_deg.',
    )

    def _given(self, *names: str) -> list[str]:
        return [name for name in names if getattr(self, name) is not None]

    def _has_flow(self) -> bool:
        return bool(self._given('speed_kn', 'speed_mps', 'angle_deg', 'direction_deg'))

    def _require_flow(self):
        for one, other in (('speed_kn', 'speed_mps'), ('angle_deg', 'direction_deg')):
            given = self._given(one, other)
            if len(given) != 1:
                found = ' and '.join(f'{name} = {getattr(self, name)!r}' for name in given)
                raise ValueError(
                    f'give exactly one of {one} and {other}, found {found or "neither"}'
                )
        return self

    def resolved(self, course_rad: float):
        """Copy with the speed in m/s and the direction clockwise from north."""
        if not self._has_flow():
            return self
        direction = self.direction_deg
        if direction is None:
            direction = (math.degrees(course_rad) + self.angle_deg) % 360.0
        absolute = {'speed_mps': self._speed_mps, 'direction_deg': direction}
        return self.model_copy(update={'speed_kn': None, 'angle_deg': None, **absolute})

    @property
    def _speed_mps(self) -> float:
        return self.speed_kn * KNOT_MPS if self.speed_mps is None else self.speed_mps

    def _north_east(self) -> tuple[float, float]:
        """Velocity as its north and east parts (m/s)."""
        if self.direction_deg is None:
            raise ValueError(
                f'angle_deg = {self.angle_deg!r} is relative to the path: '
                'call resolved(course_rad) first, or give direction_deg'
            )
        speed, direction = self._speed_mps, math.radians(self.direction_deg)
        return speed * math.cos(direction), speed * math.sin(direction)


class _FlowComponent(_Flow):
    """A component that must have a speed and a direction."""

    _check_flow = pydantic.model_validator(mode='after')(_Flow._require_flow)


class ConstantCurrent(_FlowComponent):
    """The same velocity everywhere and always."""

    kind: Literal['constant']

    def _pack(self) -> _Packed:
        return _Packed(current.CONSTANT, self._north_east())


class ShearCurrent(_FlowComponent):
    """Fastest at the surface, weaker with depth, in one direction.

    ``power`` is V (1 - z/D)^n down to the depth D and nothing below; ``exponential`` is
    V exp(-z/D).
    """

    kind: Literal['shear']
    law: Literal['power', 'exponential'] = Field(
        default='power', description='How the speed decays with depth.'
    )
    depth_m: float = number(
        ...,
        (1.0, MAX_DEPTH_M),
        'Depth (m) where a power law reaches zero, or where an exponential has fallen to 1/e.',
    )
    exponent: float = number(1.0, (0.1, 10.0), 'Exponent n of the power law (1), 1 is linear.')

    def _pack(self) -> _Packed:
        north, east = self._north_east()
        if self.law == 'power':
            return _Packed(current.POWER_SHEAR, (north, east, self.depth_m, self.exponent))
        return _Packed(current.EXPONENTIAL_SHEAR, (north, east, self.depth_m))


class TableCurrent(_Component):
    """A measured profile: velocity by depth, linear between rows and held beyond the ends.

    A file is read when the settings are validated and lives on as ``rows``, so that validated
    settings need no file. It lies in the folder named ``folder`` in the validation context, or in
    the working directory.
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
        return {**values, 'file': None, 'rows': read_profile(named(file, info))}

    @pydantic.model_validator(mode='after')
    def _check_rows(self):
        check_profile(self.rows, range(1, len(self.rows) + 1), 'rows')
        return self

    def _pack(self) -> _Packed:
        return _Packed(current.TABLE, rows=tuple((*row, 0.0)[:4] for row in self.rows))


class TidalCurrent(_FlowComponent):
    """A tidal ellipse; the speed is its amplitude and the direction its major axis."""

    kind: Literal['tidal']
    ellipticity: float = number(
        0.0, (-1.0, 1.0), 'Minor over major axis (1); + turns clockwise seen from above.'
    )
    period_s: float = number(M2_PERIOD_S, (60.0, 4e7), 'Period (s); the default is M2.')
    phase_deg: float = number(
        0.0, (-360.0, 360.0), 'Phase at the start (deg); 0 is full flow along the direction.'
    )

    def _pack(self) -> _Packed:
        north, east = self._north_east()
        minor = (-self.ellipticity * east, self.ellipticity * north)
        rate = 2.0 * math.pi / self.period_s
        return _Packed(current.TIDAL, (north, east, *minor, rate, math.radians(self.phase_deg)))


class GaussMarkovCurrent(_Component):
    """Random velocity of zero mean and exponential autocorrelation, north and east independent."""

    kind: Literal['gauss_markov']
    std_mps: float = number(
        ..., (0.0, 1.0), 'Standard deviation of the north and of the east part (m/s).'
    )
    time_constant_s: float = number(
        ..., (1.0, 1e7), 'Time in which the autocorrelation falls to 1/e (s).'
    )
    seed_offset: int = number(
        0, (0, 2**31 - 1), 'Chooses another random history under the same seed (1).'
    )

    def _pack(self) -> _Packed:
        numbers = (self.std_mps, self.time_constant_s)
        return _Packed(current.GAUSS_MARKOV, numbers, seed_offset=self.seed_offset)


class CurrentStep(_Flow):
    """From ``at_s`` on the water has this velocity."""

    at_s: float = number(..., (0.0, 1e8), 'Time since the start (s).')
    north_mps: float | None = number(
        None,
        (-MAX_SPEED_MPS, MAX_SPEED_MPS),
        'Velocity to the north (m/s), with east_mps; or give a speed and a direction.',
    )
    east_mps: float | None = number(
        None, (-MAX_SPEED_MPS, MAX_SPEED_MPS), 'Velocity to the east (m/s), with north_mps.'
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
            check_speed(math.hypot(self.north_mps, self.east_mps), 'north_mps and east_mps')
        return self

    def _row(self) -> tuple[float, ...]:
        if self.north_mps is not None:
            return (self.at_s, self.north_mps, self.east_mps, 0.0)
        return (self.at_s, *self._north_east(), 0.0)


class StepsCurrent(_Component):
    """A scripted current: constant from step to step, still water before the first."""

    kind: Literal['steps']
    steps: list[CurrentStep] = Field(
        min_length=1, description='Velocities and their times, by increasing at_s.'
    )

    @pydantic.model_validator(mode='after')
    def _check_times(self):
        for i, (one, after) in enumerate(pairwise(self.steps)):
            if after.at_s <= one.at_s:
                raise ValueError(
                    f'steps.{i + 1}.at_s = {after.at_s!r}: times must increase '
                    f'(allowed: > {one.at_s!r})'
                )
        return self

    def resolved(self, course_rad: float):
        """Copy with every direction clockwise from north; ``course_rad`` is the first leg's."""
        steps = [step.resolved(course_rad) for step in self.steps]
        return self.model_copy(update={'steps': steps})

    def _pack(self) -> _Packed:
        return _Packed(current.STEPS, rows=tuple(step._row() for step in self.steps))


CurrentComponent = Annotated[
    ConstantCurrent
    | ShearCurrent
    | TableCurrent
    | TidalCurrent
    | GaussMarkovCurrent
    | StepsCurrent,
    Field(discriminator='kind'),
]


def _check_kind(name: str, settings: type[FieldSettings]) -> None:
    """Refuse a field that is not of the kind by which it is called."""
    kind = settings.model_fields.get('kind')
    if kind is None or kind.default != name or get_args(kind.annotation) != (name,):
        raise TypeError(f"it needs kind: Literal['{name}'] = '{name}'")


#: Settings of every field by place, by its kind.
FIELDS = plugins.classes(plugins.CURRENTS, FieldSettings, fields, set(), _check_kind)
CurrentField = Annotated[Union[tuple(FIELDS.values())], Field(discriminator='kind')]  # noqa: UP007


class SumOfCurrents(_Flow):
    """One constant current, and any number of components beside it.

    Without a speed there is no constant current.
    """

    components: list[CurrentComponent] = Field(
        default=[],
        max_length=MAX_COMPONENTS,
        description='Further current fields; all of them are added up.',
    )
    field: CurrentField | None = Field(
        default=None,
        description='One more current, by place and time, added to the others; '
        f'{plugins.listed(FIELDS)}.',
        json_schema_extra={'others': plugins.others(plugins.CURRENTS)},
    )

    @pydantic.model_validator(mode='after')
    def _check_constant(self):
        return self._require_flow() if self._has_flow() else self

    def resolved(self, course_rad: float, mission: Mission | None = None) -> 'SumOfCurrents':
        """Copy that needs no path: every angle absolute, every speed in m/s.

        ``mission`` is where and when it is flown, which a field by place may have to know.
        """
        components = [component.resolved(course_rad) for component in self.components]
        field = self.field.resolved(mission) if self.field and mission else self.field
        changed = {'components': components, 'field': field}
        return super().resolved(course_rad).model_copy(update=changed)

    def params(self, seed: int = 0) -> CurrentParams:
        """Arrays that `current_step` reads; ``seed`` is that of the random components.

        A ValueError if an angle is still relative to the path.
        """
        packed = [_Packed(current.CONSTANT, self._north_east())] if self._has_flow() else []
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
            if part.kind == current.GAUSS_MARKOV:
                first[i] = 2 * random
                stream[i] = random_stream(seed, part.seed_offset, random)
                random += 1
            else:
                first[i], last[i] = row, row + len(part.rows)
                row = last[i]
        field = usable('current.field: params', self.field.params) if self.field else NoField()
        return CurrentParams(
            kind=kind,
            numbers=numbers,
            first=first,
            last=last,
            stream=stream,
            table=np.array(table, dtype=float).reshape(-1, 4),
            field=field,
        )


class CurrentSettings(SumOfCurrents):
    """The water of a mission."""

    seed: int = number(0, (0, 2**63 - 1), 'Seed of the random components (1).')

    def params(self, seed: int | None = None) -> CurrentParams:
        """Arrays that `current_step` reads; ``seed`` instead of that of the settings."""
        return super().params(self.seed if seed is None else seed)

    def initial_state(self, seed: int | None = None) -> CurrentState:
        """State before the first step; ``seed`` as in `params`."""
        return current_initial(self.params(seed))
