# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""Changes to a scenario: fields by dotted name, as ``--set`` and Python give them."""

import json
import shlex
from collections.abc import Collection, Mapping
from copy import deepcopy
from typing import Any

import numpy as np

from glider_base.errors import clipped, shown
from glider_base.files import parse_yaml
from glider_base.settings import ConfigurationError, holder_of
from glider_mission.mafiles import FIELD as MAFILES
from glider_mission.mafiles import read_profile

#: Field that names the vehicle, and what the names of fields in its file begin with.
VEHICLE = 'vehicle'
#: Fields of which only one can be given: setting one of them by hand replaces the other.
_ALTERNATIVES = (
    ('speed_kn', 'speed_mps'),
    ('angle_deg', 'direction_deg'),
    ('descent_per_turn_m', 'slope_deg'),
    ('waypoints', 'waypoints_latlon'),
)


def given_fields(fields: Any, argument: str = 'set') -> dict[str, Any]:
    """Values by dotted name that a program gave; a ConfigurationError names its argument."""
    if not isinstance(fields, Mapping | None):
        raise ConfigurationError(
            f'{argument} = {shown(fields)}: not usable (allowed: values by dotted field name)'
        )
    return dict(fields or {})


def plain(value: Any) -> Any:
    """A value without arrays: numbers and lists are shown as others are."""
    if isinstance(value, dict):
        return {name: plain(inner) for name, inner in value.items()}
    if isinstance(value, list | tuple):
        return [plain(inner) for inner in value]
    return np.asarray(value).tolist() if hasattr(value, '__array__') else value


def split_changes(changes: dict[str, Any]) -> tuple[dict[str, Any], dict[str, Any]]:
    """Fields of the scenario, and those of its vehicle by their names in the vehicle's file."""
    for field in changes:
        if not isinstance(field, str):
            raise ConfigurationError(
                f'--set {shown(field)}: no name (allowed: fields by dotted name, current.speed_kn)'
            )
    inside = {field for field in changes if field.startswith(f'{VEHICLE}.')}
    return (
        {field: value for field, value in changes.items() if field not in inside},
        {field.partition('.')[2]: changes[field] for field in changes if field in inside},
    )


def _replaced(field: str, value: Any, given: Collection[str]) -> list[str]:
    """Names of the fields beside one that a value of it replaces; files, none that are given."""
    parents, _, name = field.rpartition('.')
    if name != MAFILES:
        return [*_alternatives(name)]
    try:
        return [other for other in read_profile(value) if f'{parents}.{other}' not in given]
    except ValueError:  # refused later
        return []


def _alternatives(name: str) -> tuple[str, ...]:
    """Names of the fields of which only one can be given, this one among them."""
    return next((pair for pair in _ALTERNATIVES if name in pair), (name,))


def overlap(field: str, other: str) -> bool:
    """Whether setting one field, given by its dotted name, undoes what set the other.

    Which vehicle flies, and what is changed in it, are two things.
    """
    if VEHICLE in (field, other):
        return field == other
    *parents, last = field.split('.')
    names = ['.'.join((*parents, name)) + '.' for name in _alternatives(last)]
    return any(name.startswith(f'{other}.') or f'{other}.'.startswith(name) for name in names)


def set_field(values: dict, field: str, value, given: Collection[str]) -> bool:
    """Set a field by its dotted name, making the mappings on the way; whether that changes it.

    It is one of those that are ``given``.
    """
    holder, last = holder_of(values, field), field.rpartition('.')[2]
    is_plain = isinstance(value, str | int | float)  # of an array one cannot ask it
    is_new = not is_plain or last not in holder or holder[last] != value
    for other in _replaced(field, value, given):
        holder.pop(other, None)
    holder[last] = deepcopy(value)  # which may be changed by a field inside it
    return is_new


def fields_text(changed: dict[str, str]) -> str:
    """Fields that were changed, as a person set them."""
    return ', '.join(f'{field}={value}' for field, value in changed.items())


def parse_assignment(text: str) -> tuple[str, Any]:
    """Field and value of a ``path.to.field=value`` option; the value is read as YAML.

    Raises ConfigurationError if the text has not this form.
    """
    field, sign, value = text.partition('=')
    field = field.strip()
    if not sign or not all(field.split('.')):
        raise ConfigurationError(f'--set {clipped(text)}: expected path.to.field=value')
    return field, parse_yaml(value, f'--set {clipped(text)}')


def run_command(name: str, changes: dict[str, Any], options: str = '') -> str:
    """Shell command that flies a scenario with some fields changed, by the direct engine."""
    fields = (f'{field}={json.dumps(value)}' for field, value in changes.items())
    sets = [f'--set {shlex.quote(field)}' for field in fields]
    words = ['./glider run', shlex.quote(name), '--engine direct', options, *sets]
    return ' '.join(word for word in words if word)
