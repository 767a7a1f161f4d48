# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""Numbers of a vehicle file: each with its unit and the source it is from."""

from functools import cache
from typing import Annotated, Literal, NamedTuple

import pydantic
from pydantic import Field

from glider_base.settings import Settings
from glider_base.signals import SEA_WATER_DENSITY


class Other(NamedTuple):
    """Another unit that a number may be given in."""

    unit: str
    factor: float  #: one of it in the unit that the number is kept in


#: Oil of a buoyancy engine, as so much sea water; and volumes.
CC = Other('cc', 1e-6 * SEA_WATER_DENSITY)
CC_PER_S = Other('cc/s', 1e-6 * SEA_WATER_DENSITY)
LITRE = Other('l', 1e-3)

#: What is often given instead of a unit, and what it makes.
HINTS = {
    'kg': '1 g = 0.001 kg, 1 cc of sea water = 0.001025 kg',
    'kg/s': '1 cc/s of sea water = 0.001025 kg/s',
    'm': '1 mm = 0.001 m',
    'm^3': '1 cc = 1e-6 m^3',
    '1/Pa': '1e-6 1/dbar = 1e-10 1/Pa',
    'deg': '1 rad = 57.296 deg',
    'kg/m': '1/2 rho S C, rho = 1025 kg/m^3',
    'kg/m/rad': '1/2 rho S C, rho = 1025 kg/m^3; per deg x 57.296 is per rad',
    'kg/m/rad^2': '1/2 rho S C, rho = 1025 kg/m^3; per deg^2 x 3282.8 is per rad^2',
}


@cache
def quantity(unit: str, also: Other | None = None, **limits: float) -> type[Settings]:
    """Model of one number with its unit and source, within limits as of pydantic's Field.

    It may be given in a unit ``also``, and is kept in ``unit``.
    """

    def convert(values):
        if not also or not isinstance(values, dict) or values.get('unit') != also.unit:
            return values
        value, source = values.get('value'), values.get('source')
        if isinstance(value, bool) or not isinstance(value, int | float):
            return {**values, 'unit': unit}
        text = f'{source} ({value:g} {also.unit})' if isinstance(source, str) else source
        return {**values, 'value': value * also.factor, 'unit': unit, 'source': text}

    value = float, Field(strict=True, description=f'number in {unit}', **limits)
    convert = pydantic.model_validator(mode='before')(convert)
    return _model(value, unit, also, __validators__={'convert': convert})


def _model(value: tuple, unit: str, also: Other | None = None, **more) -> type[Settings]:
    """Model of a value, a field as of `pydantic.create_model`, with its unit and source."""
    name = f'{unit} or {also.unit}' if also else unit
    others = {'others': ', '.join(_choices(unit, also))}
    return pydantic.create_model(
        f'Quantity[{name}]',
        __base__=Settings,
        value=value,
        unit=(Literal[unit], Field(description='unit of the value', json_schema_extra=others)),
        source=(str, Field(min_length=3, description='where the number comes from')),
        **more,
    )


def _choices(unit: str, also: Other | None) -> list[str]:
    """What is said of a unit that is not the one of a number."""
    return ([f"or '{also.unit}'"] if also else []) + ([HINTS[unit]] if unit in HINTS else [])


Positive = {'gt': 0.0, 'le': 1e5}
NotNegative = {'ge': 0.0, 'le': 1e5}
NotPositive = {'ge': -1e5, 'le': 0.0}
Signed = {'ge': -1e5, 'le': 1e5}


def required(unit: str, words: str, **limits):
    """Type of a field that has such a `quantity`, and says what it means."""
    return Annotated[quantity(unit, **limits), Field(description=words)]


def optional(unit: str, words: str, **limits):
    """Type of a field that may have one; None without."""
    return Annotated[quantity(unit, **limits) | None, Field(None, description=words)]


def vector(unit: str, words: str, not_negative: bool = False):
    """Type of a field that has three such numbers, along x, y and z."""
    limits = NotNegative if not_negative else Signed
    one = Annotated[float, Field(strict=True, **limits)]
    value = list[one], Field(min_length=3, max_length=3, description=f'numbers in {unit}')
    return Annotated[_model(value, unit), Field(description=words)]
