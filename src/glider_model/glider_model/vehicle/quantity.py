# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""Numbers of a vehicle file: each with its unit and the source it is from."""

from functools import cache
from typing import Annotated, Literal

import pydantic
from pydantic import Field

from glider_model.base.settings import Settings


@cache
def quantity(unit: str, **limits: float) -> type[Settings]:
    """Model of one number with its unit and source; ``limits`` are those of pydantic's Field."""
    return pydantic.create_model(
        f'Quantity[{unit}]',
        __base__=Settings,
        value=(float, Field(strict=True, description=f'number in {unit}', **limits)),
        unit=(Literal[unit], Field(description='unit of the value')),
        source=(str, Field(min_length=3, description='where the number comes from')),
    )


Positive = {'gt': 0.0, 'le': 1e5}
NotNegative = {'ge': 0.0, 'le': 1e5}
Signed = {'ge': -1e5, 'le': 1e5}


class Vector(Settings):
    """Three numbers along x, y, z with unit and source."""

    value: Annotated[list[float], Field(min_length=3, max_length=3)]
    unit: str
    source: Annotated[str, Field(min_length=3)]

    @pydantic.field_validator('value')
    @classmethod
    def _bounded(cls, value: list[float]) -> list[float]:
        if any(abs(number) > 1e5 for number in value):
            raise ValueError('every component must be within +-1e5')
        return value


def vector(unit: str, not_negative: bool = False):
    """Vector whose unit, and if asked sign, is checked."""

    def check(vector: Vector) -> Vector:
        if vector.unit != unit:
            raise ValueError(f'unit is {vector.unit!r} (allowed: {unit!r})')
        if not_negative and min(vector.value) < 0.0:
            raise ValueError(f'value = {vector.value} has a negative component (allowed: >= 0)')
        return vector

    return Annotated[Vector, pydantic.AfterValidator(check)]
