# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""Sweeps: one validated YAML file that says which missions to fly.

A sweep is a scenario and dimensions. A dimension goes through values of one scenario field, or
through named variants that each set several. Every combination of values is a cell, and every cell
is a mission that ``./glider run`` can fly by itself.
"""

import hashlib
import itertools
import json
import math
from collections.abc import Iterable, Iterator
from contextlib import suppress
from decimal import Decimal
from functools import cached_property, partial
from pathlib import Path
from typing import Annotated, Any, Literal, NamedTuple

import numpy as np
import pydantic
from pydantic import Field

from glider_base.errors import shown
from glider_base.files import is_file, read_text, read_yaml, yaml_line, yaml_text
from glider_base.kernel import source_digest
from glider_base.settings import (
    FILE_NAME,
    ConfigurationError,
    Settings,
    file_names,
    find_file,
    matching,
    validate,
)
from glider_mission.changes import overlap, run_command
from glider_mission.choices import loop_of
from glider_mission.scenario import (
    DEFAULT_SCENARIO,
    Scenario,
    make_scenario,
    name_after,
    read_scenario,
    scenario_names,
)
from glider_model.vehicle.file import vehicle_file, vehicle_path

SWEEP_FOLDER = Path(__file__).parent / 'sweeps'
#: No sweep has more cells: these take days, and 0.5 GB of memory when the result is written.
MAX_CELLS = 500_000
#: No dimension has more values: each of them is checked before anything is flown.
MAX_VALUES = 10_000

_NAME = matching(r'^[A-Za-z][A-Za-z0-9_]*$', 'letters, digits and _; the first a letter')
Value = bool | int | float | str


# ------------------------------------------------------------------------- what a person writes


class _FieldDimension(Settings):
    """A dimension over one field of the scenario, whose values `_numbers` gives."""

    field: str = Field(description='scenario field by its dotted name, such as current.speed_kn')

    def steps(self) -> list[tuple[Value, dict[str, Any]]]:
        """Coordinate and fields of each step."""
        return [(value, {self.field: value}) for value in self._numbers()]


class ValuesDimension(_FieldDimension):
    """Values one by one."""

    kind: Literal['values']
    values: list[Any] = Field(
        min_length=1, max_length=MAX_VALUES, description='values in their order'
    )

    @pydantic.field_validator('values')
    @classmethod
    def _alike(cls, values: list[Value]) -> list[Value]:
        for value in values:
            is_finite = not isinstance(value, float) or math.isfinite(value)
            if not (isinstance(value, Value) and is_finite):
                raise ValueError(
                    f'{shown(value)}: not usable (allowed: numbers, texts, true, false)'
                )
        names = {bool: 'true or false', str: 'text'}
        kinds = {names.get(type(value), 'numbers') for value in values}
        if len(kinds) > 1:
            raise ValueError(f'values must be of one kind, found {" and ".join(sorted(kinds))}')
        twice = sorted({str(value) for value in values if values.count(value) > 1})
        if twice:
            raise ValueError(f'given twice: {", ".join(twice)}')
        return values

    def _numbers(self) -> list[Value]:
        return self.values


class GridDimension(_FieldDimension):
    """Values at equal distances, from start to stop, both included."""

    kind: Literal['grid']
    start: float = Field(description='first value')
    stop: float = Field(description='last value, or the bound of it')
    step: float = Field(gt=0.0, description='distance of two values')

    @pydantic.model_validator(mode='after')
    def _not_too_many(self):
        if self.stop < self.start:
            raise ValueError(f'stop = {self.stop} lies before start = {self.start}')
        if (self.stop - self.start) / self.step >= MAX_VALUES:
            raise ValueError(
                f'step = {self.step} makes more than {MAX_VALUES} values '
                f'from {self.start} to {self.stop}'
            )
        return self

    def _numbers(self) -> list[Value]:
        # decimal: 0.15 is then the number that a person would type, not 0.15000000000000002
        start, stop, step = (Decimal(repr(x)) for x in (self.start, self.stop, self.step))
        return [float(start + i * step) for i in range(int((stop - start) / step) + 1)]


class _DrawnDimension(_FieldDimension):
    """Values drawn at random by `_draw`, in increasing order."""

    samples: int = Field(ge=1, le=MAX_VALUES, description='number of values')
    seed: int = Field(ge=0, le=2**62, description='seed of the draw')

    def _numbers(self) -> list[Value]:
        draw = np.random.Generator(np.random.PCG64(self.seed))
        return [float(value) for value in np.sort(self._draw(draw))]


class UniformDimension(_DrawnDimension):
    """Values drawn uniformly."""

    kind: Literal['uniform']
    low: float = Field(description='least value')
    high: float = Field(description='largest value')

    @pydantic.model_validator(mode='after')
    def _in_order(self):
        if self.high <= self.low:
            raise ValueError(f'high = {self.high} does not lie above low = {self.low}')
        if not math.isfinite(self.high - self.low):
            raise ValueError(f'high = {self.high}: too far from low = {self.low}')
        return self

    def _draw(self, draw: np.random.Generator) -> np.ndarray:
        return draw.uniform(self.low, self.high, self.samples)


class LogUniformDimension(UniformDimension):
    """Values whose logarithm is drawn uniformly."""

    kind: Literal['log_uniform']
    low: float = Field(gt=0.0, description='least value')

    def _draw(self, draw: np.random.Generator) -> np.ndarray:
        return np.exp(draw.uniform(math.log(self.low), math.log(self.high), self.samples))


class NormalDimension(_DrawnDimension):
    """Values drawn from a normal distribution."""

    kind: Literal['normal']
    mean: float = Field(description='mean')
    std: float = Field(gt=0.0, description='standard deviation')

    def _draw(self, draw: np.random.Generator) -> np.ndarray:
        return draw.normal(self.mean, self.std, self.samples)


class VariantsDimension(Settings):
    """Named variants, each with fields of its own."""

    kind: Literal['variants']
    variants: dict[str, dict[str, Any]] = Field(
        min_length=1, max_length=MAX_VALUES, description='fields by dotted name, by variant'
    )

    def steps(self) -> list[tuple[Value, dict[str, Any]]]:
        """Coordinate and fields of each step."""
        return list(self.variants.items())


Dimension = Annotated[
    ValuesDimension
    | GridDimension
    | UniformDimension
    | LogUniformDimension
    | NormalDimension
    | VariantsDimension,
    Field(discriminator='kind'),
]


class Sweep(Settings):
    """A sweep as its file says it."""

    name: str = Field(
        pattern=FILE_NAME,
        max_length=100,
        description='name, used for files',
    )
    description: str = Field('', max_length=2000, description='what the sweep shows')
    scenario: str = Field(
        DEFAULT_SCENARIO, description='scenario by name, or path of a file relative to this one'
    )
    set: dict[str, Any] = Field({}, description='scenario fields of every cell, by dotted name')
    dimensions: dict[Annotated[str, Field(pattern=_NAME)], Dimension] = Field(
        min_length=1, max_length=16, description='dimensions, the last one running fastest'
    )


# ---------------------------------------------------------------------------------- what it means


class Axis(NamedTuple):
    """A dimension, value by value."""

    name: str
    field: str  #: scenario field; empty for variants
    values: list[Value]  #: coordinates
    changes: list[dict[str, Any]]  #: scenario fields of each value


class Plan:
    """The cells of a sweep, by its file, or by the values that would stand there.

    ``changes`` are scenario fields of every cell by dotted name, before those that the file sets.
    Raises ConfigurationError, naming file, field, value and what is allowed, for every value of
    every dimension.
    """

    def __init__(
        self, path: Path, changes: dict[str, Any] | None = None, values: dict | None = None
    ) -> None:
        self.path = path
        self.sweep = _validate(path, values)
        self.text = read_text(path) if values is None else yaml_text(values)
        self.given = dict(changes or {})
        #: scenario fields of every cell
        self.common = {
            field: value
            for field, value in self.sweep.set.items()
            if not any(overlap(field, other) for other in self.given)
        } | self.given
        self.axes = [
            Axis(name, getattr(one, 'field', ''), *map(list, zip(*one.steps(), strict=True)))
            for name, one in self.sweep.dimensions.items()
        ]
        self.shape = tuple(len(axis.values) for axis in self.axes)
        self.cells = math.prod(self.shape)
        if self.cells > MAX_CELLS:
            product = ' x '.join(map(str, self.shape))
            raise ConfigurationError(
                f'{path}: dimensions: {product} = {self.cells} cells (allowed: <= {MAX_CELLS})'
            )
        self._check_overlaps()
        try:
            self.source = read_scenario(self._scenario_name())
        except ConfigurationError as error:
            raise ConfigurationError(f'{path}: {error}') from None
        # every value of every dimension, the first cell's first
        along = [self.along(number) for number in range(len(self.axes))]
        checked = [one for scenarios in along for one in scenarios]
        if own := next((one.control.law for one in checked if type(one) is not Scenario), None):
            raise ConfigurationError(
                f'{path}: control.law = {own!r}: of this program alone, workers do not know it '
                '(allowed: one of the stack or of a package: docs/your_law.md)'
            )
        #: digests of the scenarios of all values
        self.scenarios = []
        for one in checked:  # whose vehicle has no folder
            described = one.model_copy(update={'vehicle': vehicle_path(one.vehicle).stem})
            digest = hashlib.sha256(described.model_dump_json().encode()).hexdigest()
            self.scenarios.append(digest)
        #: places along each dimension, one of each kind of loop
        self._kinds = [{loop_of(one): i for i, one in enumerate(them)} for them in along]
        vehicles: dict[Path, str] = {}  # one of every vehicle file
        for one in checked:
            vehicles.setdefault(vehicle_path(one.vehicle), one.vehicle)
        self.vehicle_digests = frozenset(map(vehicle_digest, vehicles.values()))
        #: name and text of a vehicle of each file as it flies, the first cell's first
        self.vehicles = [
            (vehicle_path(vehicle).stem, vehicle_file(vehicle).decode('utf-8-sig'))
            for vehicle in vehicles.values()
        ]

    def _scenario_name(self) -> str:
        name = self.sweep.scenario
        beside = self.path.parent / name
        return str(beside) if name not in scenario_names() and is_file(beside) else name

    def _check_overlaps(self) -> None:
        """Each field is set in one place, else one of the places would mean nothing."""
        places = [
            ('set', [field for field in self.common if field not in self.given]),
            ('--set', list(self.given)),
        ]
        for axis in self.axes:
            fields = dict.fromkeys(field for changes in axis.changes for field in changes)
            places.append((f'dimensions.{axis.name}', list(fields)))
        seen: dict[str, str] = {}
        for place, fields in places:
            for field in fields:
                for other, where in seen.items():
                    if where != place and overlap(field, other):
                        raise ConfigurationError(
                            f'{self.path}: {place}: {field} is set by {where} too, as {other} '
                            f'(allowed: each field in one place)'
                        )
            seen.update(dict.fromkeys(fields, place))

    def along(self, number: int) -> list[Scenario]:
        """Scenario of each value of a dimension by its number, beside the first of the others."""
        axis, found = self.axes[number], []
        for i, value in enumerate(axis.values):
            places = [0] * len(self.axes)
            places[number] = i
            try:
                found.append(make_scenario(self.source, self._changes(places)))
            except ConfigurationError as error:
                where = f'{self.path}: dimensions.{axis.name}: {value}'
                lines = (f'{where}: {line}' for line in str(error).splitlines())
                raise ConfigurationError('\n'.join(lines)) from None
        return found

    def _changes(self, places: Iterable[int]) -> dict[str, Any]:
        steps = (axis.changes[place] for axis, place in zip(self.axes, places, strict=True))
        return {field: value for one in (self.common, *steps) for field, value in one.items()}

    def _places(self, cell: int) -> list[int]:
        """Place of a cell along each dimension."""
        return [int(place) for place in np.unravel_index(cell, self.shape)]

    def changes(self, cell: int) -> dict[str, Any]:
        """Scenario fields of a cell."""
        return self._changes(self._places(cell))

    def coordinates(self, cell: int) -> dict[str, Value]:
        """Coordinates of a cell."""
        pairs = zip(self.axes, self._places(cell), strict=True)
        return {axis.name: axis.values[place] for axis, place in pairs}

    def command(self, cell: int) -> str:
        """Shell command that flies a cell by itself, where the sweep was started."""
        return run_command(self._scenario_name(), self.changes(cell))

    def loops(self) -> Iterator[Scenario]:
        """Scenarios that between them have the loops of all cells."""
        for places in itertools.product(*(kinds.values() for kinds in self._kinds)):
            with suppress(ConfigurationError):  # such cells fail, and say why
                yield make_scenario(self.source, self._changes(places))

    @cached_property
    def first(self) -> Scenario:
        """Scenario of the first cell."""
        return make_scenario(self.source, self.changes(0))

    @cached_property
    def digest(self) -> str:
        """Digest of everything that the numbers follow from: inputs and code."""
        parts = {
            'code': source_digest(),
            'sweep': self.text,
            'scenarios': self.scenarios,
            'set': self.common,
            'coordinates': [[axis.name, axis.values] for axis in self.axes],
            'vehicles': self.vehicles,
        }
        return hashlib.sha256(json.dumps(parts, sort_keys=True).encode()).hexdigest()


def vehicle_digest(vehicle: str) -> str:
    """Digest of the file of a vehicle given by name or path, without what is changed in it."""
    return hashlib.sha256(read_text(vehicle_path(vehicle)).encode()).hexdigest()


# ---------------------------------------------------------------------------------- files


def sweep_names() -> list[str]:
    """Names of the sweeps that come with the package."""
    return [*file_names(SWEEP_FOLDER)]


def _validate(path: Path, values: dict[str, Any] | None = None) -> Sweep:
    written = {'name': name_after(path)} | (read_yaml(path) if values is None else values)
    lines = {'line_of': partial(yaml_line, path)} if values is None else {}
    return validate(Sweep, written, str(path), **lines)


def read_sweep(name: str) -> Sweep:
    """Sweep given by name or by path, as its file says it; errors are those of `Plan`."""
    return _validate(find_file('sweep', name, SWEEP_FOLDER))


def load_sweep(name: str | Path, changes: dict[str, Any] | None = None) -> Plan:
    """Plan of a sweep given by name or by path, with some fields changed; see `Plan`."""
    return Plan(find_file('sweep', name, SWEEP_FOLDER), changes)
