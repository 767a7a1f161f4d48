# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""Base of everything a person configures, and how its errors read."""

import math
import re
from collections.abc import Callable, Iterator
from functools import cache
from pathlib import Path
from typing import Any, NamedTuple, TypeVar, get_args, get_origin

import pydantic

from glider_base.errors import MAX_LINES, ConfigurationError, clipped, said_by, shown

SettingsT = TypeVar('SettingsT', bound='Settings')
ParamsT = TypeVar('ParamsT', bound=NamedTuple)


class Settings(pydantic.BaseModel):
    """Validated configuration: unknown fields, NaN and infinities are refused."""

    model_config = pydantic.ConfigDict(
        extra='forbid', allow_inf_nan=False, frozen=True, validate_default=True
    )

    def check(self) -> None:
        """Refuse what no field shows by itself, such as a depth that a vehicle is not rated for.

        A ConfigurationError names field, value and allowed range.
        """


#: What patterns of fields allow, in words.
_IN_WORDS: dict[str, str] = {}


def matching(expression: str, allowed: str) -> str:
    """Regular expression of a field, of which errors tell in words what is ``allowed``."""
    _IN_WORDS[expression] = allowed
    return expression


#: A name that files and folders may have.
FILE_NAME = matching(
    r'^[A-Za-z0-9_][A-Za-z0-9_.-]*$',
    'letters, digits, _ . and -; the first a letter, a digit or _',
)

#: Units at the end of a setting's name that kernels leave out; those of degrees become radians.
_UNITS = (
    '',
    '_m',
    '_s',
    '_kg',
    '_pa',
    '_v',
    '_mps',
    '_radps',
    '_per_s',
    '_per_s2',
    '_deg',
    '_dps',
)


def derived(params: type[ParamsT], settings: Settings, **computed: Any) -> ParamsT:
    """Kernel parameters of settings, of the type of a NamedTuple.

    Each of its fields is that of the settings of the same name, or of that name and a unit;
    numbers in degrees become radians. What is computed is given by name. A TypeError if a
    field is missing, or there is none of a name that is given.
    """
    fields = type(settings).model_fields
    for name in params._fields:
        unit = next((unit for unit in _UNITS if name + unit in fields), None)
        if unit is not None and name not in computed:
            value = getattr(settings, name + unit)
            computed[name] = math.radians(value) if unit in ('_deg', '_dps') else value
    return params(**computed)


def named(file: str, info: pydantic.ValidationInfo) -> Path:
    """A file beside the file of the settings, if that is known and has it, or else from here."""
    there = Path((info.context or {}).get('folder', '')) / file
    return there if there.exists() or not Path(file).exists() else Path(file)


def beside(file: str, info: pydantic.ValidationInfo) -> str:
    """The same as a full path, for a node that is started elsewhere, where a folder is known."""
    return str(named(file, info).resolve()) if file and info.context else file


#: ``json_schema_extra`` of a field that can be set on a node while it flies.
TUNABLE = {'tunable': True}


def number(default: Any, between: tuple[float, float], words: str, tunable: bool = False) -> Any:
    """Field for a number within limits; with ``...`` as its default it must be given."""
    extra = TUNABLE if tunable else None
    return pydantic.Field(
        default, ge=between[0], le=between[1], description=words, json_schema_extra=extra
    )


def positive(default: Any, most: float, words: str, tunable: bool = False) -> Any:
    """Field for a number above 0 and up to a limit; see `number`."""
    extra = TUNABLE if tunable else None
    return pydantic.Field(default, gt=0.0, le=most, description=words, json_schema_extra=extra)


#: Numeric limits as pydantic calls them, and in a person's words.
BOUNDS = {'ge': '>=', 'gt': '>', 'le': '<=', 'lt': '<'}
_NOT_A_MAPPING = ('dict_type', 'model_type', 'model_attributes_type')


def _models(annotation: Any) -> list[type[pydantic.BaseModel]]:
    """Models that an annotation names, inside lists and unions too."""
    if get_origin(annotation) is None and isinstance(annotation, type):
        return [annotation] if issubclass(annotation, pydantic.BaseModel) else []
    return [model for part in get_args(annotation) for model in _models(part)]


def _field(models: list[type[pydantic.BaseModel]], name: str) -> pydantic.fields.FieldInfo | None:
    """Field of the first of the models that has it; None if none has."""
    return next((m.model_fields[name] for m in models if name in m.model_fields), None)


def _has_tag(model: type[pydantic.BaseModel], tag: str) -> bool:
    """Whether a model is the member of a union that ``tag`` stands for."""
    return any(tag in get_args(field.annotation) for field in model.model_fields.values())


def _follow(model: type[pydantic.BaseModel], location: tuple):
    """Follow the location of an error, to which pydantic adds the names of union members.

    Gives the location as the person wrote it, the models that may hold its last part, and the
    field that this is; None if it is none.
    """
    path, holders, inside, field = [], [model], [model], None
    for part in location:
        is_key = field is not None and get_origin(field.annotation) is dict
        tagged = [one for one in inside if _has_tag(one, part)]
        if tagged and len(inside) > 1 and not is_key:
            inside = tagged
            continue
        path.append(str(part))
        holders = inside
        field = None if is_key else _field(holders, part)
        if field is not None:
            inside = _models(field.annotation)
    return path, holders, field


def _allowed(error: dict, holders: list, field: pydantic.fields.FieldInfo | None) -> str:
    """Say in words what the field of an error would accept."""
    context = error.get('ctx') or {}
    if error['type'] == 'extra_forbidden':
        extras = (model.model_config.get('json_schema_extra') for model in holders)
        return _fields(holders) + ''.join(map(_others, extras))
    if error['type'] in _NOT_A_MAPPING:
        return _fields(_models(field.annotation) if field is not None else holders)
    for key in ('expected', 'expected_tags'):
        if key in context:
            extra = field.json_schema_extra if field is not None else None
            return f'allowed: {context[key]}' + _others(extra)
    if error['type'] == 'string_pattern_mismatch':
        return f'allowed: {_IN_WORDS.get(context["pattern"], context["pattern"])}'
    found = (field is not None and limits(field)) or context
    bounds = [f'{word} {found[key]}' for key, word in BOUNDS.items() if key in found]
    return f'allowed: {" and ".join(bounds)}' if bounds else ''


def _fields(models: list[type[pydantic.BaseModel]]) -> str:
    """Say in words what fields models have, each once."""
    names = dict.fromkeys(name for model in models for name in model.model_fields)
    return f'allowed fields: {", ".join(names)}'


def limits(field: pydantic.fields.FieldInfo) -> dict[str, float]:
    """Numeric limits of a field, by their names in `BOUNDS`."""
    pairs = ((key, getattr(item, key, None)) for item in field.metadata for key in BOUNDS)
    return {key: limit for key, limit in pairs if limit is not None}


def _others(extra: Any) -> str:
    """Where words come from that a field, or fields that a model, does not accept here."""
    others = extra.get('others') if isinstance(extra, dict) else None
    return f'; {others}' if others else ''


def find_field(model: type[Settings], name: str) -> pydantic.fields.FieldInfo | None:
    """Field by its dotted name; None if there is none."""
    inside, field = [model], None
    for part in name.split('.'):
        if field is not None and get_origin(field.annotation) is list and part.isdecimal():
            continue
        field = _field(inside, part)
        if field is None:
            return None
        inside = _models(field.annotation)
    return field


def holder_of(values: dict[str, Any], name: str) -> dict[str, Any]:
    """Mapping in nested values that holds a field, given by its dotted name; made if need be.

    A member of a list goes by its number, from 0 on: ``faults.0.at_s``. Raises ConfigurationError
    if something on the way is not a mapping, or a list has no such member.
    """
    inside: Any = values
    for parent in name.split('.')[:-1]:
        if isinstance(inside, list):
            if not parent.isdecimal() or not len(parent) < 9 or int(parent) >= len(inside):
                there = f'0 to {len(inside) - 1}' if inside else 'none, the list is empty'
                raise ConfigurationError(
                    f'--set {clipped(name)}: {clipped(parent)} is not in the list '
                    f'(allowed: {there})'
                )
            inside = inside[int(parent)]
        else:
            inside = inside.setdefault(parent, {})
        if not isinstance(inside, dict | list):
            raise ConfigurationError(
                f'--set {clipped(name)}: {clipped(parent)} is not a group of fields'
            )
    if not isinstance(inside, dict):
        raise ConfigurationError(
            f'--set {clipped(name)}: a member of a list is set field by field, or with the list'
        )
    return inside


def leaves(values: dict[str, Any], before: str = '') -> Iterator[tuple[str, Any]]:
    """Everything in nested mappings that is none itself, with its dotted name."""
    for name, value in values.items():
        if isinstance(value, dict):
            yield from leaves(value, f'{before}{name}.')
        else:
            yield f'{before}{name}', value


def nested(values: dict[str, Any]) -> dict[str, Any]:
    """Nested mappings of values by their dotted names; errors as `holder_of`."""
    tree: dict[str, Any] = {}
    for name, value in values.items():
        holder_of(tree, name)[name.rpartition('.')[2]] = value
    return tree


def unit_of(field: pydantic.fields.FieldInfo) -> str:
    """Unit of a field, from the first brackets of its description; empty without."""
    brackets = re.search(r'\(((?:[^()]|\([^()]*\))+)\)', field.description or '')
    return brackets[1].partition(',')[0] if brackets else ''


#: One thing that is wrong with values: its location as the person wrote it, and in words its
#: field, its value, what is wrong and what is allowed.
Mistake = tuple[tuple[str, ...], str]


def mistakes(error: pydantic.ValidationError, model: type[pydantic.BaseModel]) -> list[Mistake]:
    """Mistakes that an error is about: the first of them, and how many more there are."""
    found = error.errors(include_url=False)
    listed = [_mistake(item, model) for item in found[:MAX_LINES]]
    if len(found) > MAX_LINES:
        listed[-1:] = [((), f'and {len(found) - MAX_LINES + 1} more')]
    return listed


def _mistake(item: dict, model: type[pydantic.BaseModel]) -> Mistake:
    kind, context, value = item['type'], item.get('ctx') or {}, item['input']
    path, holders, field = _follow(model, item['loc'])
    message = item['msg'].removeprefix('Value error, ').replace('Input should', 'should')
    if kind == 'extra_forbidden':
        message = 'unknown field'
    elif kind == 'missing':
        message = 'missing'
    elif kind == 'string_pattern_mismatch':
        message = ''
    elif kind in _NOT_A_MAPPING:
        message = 'expected a mapping of fields'
    elif kind in ('union_tag_invalid', 'union_tag_not_found'):
        path.append(context['discriminator'].strip("'"))
        value = context.get('tag', value)
        message = 'unknown' if 'tag' in context else 'missing'
    given = '' if isinstance(value, dict) else f' = {shown(value)}'
    allowed = _allowed(item, holders, field)
    where = ('.'.join(clipped(part) for part in path) + given).removeprefix(' = ')
    text = ': '.join(filter(None, [where, message])) + (f' ({allowed})' if allowed else '')
    return tuple(path), text


def made(
    model: type[SettingsT], values: Any, source: str, context: dict[str, Any] | None = None
) -> SettingsT:
    """Settings of a model, which may have code that is not ours: what this raises is named.

    Raises pydantic.ValidationError for values that are refused, else ConfigurationError.
    """
    try:
        return model.model_validate(values, context=context)
    except pydantic.ValidationError:
        raise
    except (Exception, SystemExit) as error:
        raise ConfigurationError(f'{source}: {said_by(error, calls=2)}') from error


def validate(
    model: type[SettingsT],
    values: Any,
    source: str,
    folder: Path | None = None,
    line_of: Callable[[tuple[str, ...]], int | None] = lambda location: None,
    changed: str = '',
) -> SettingsT:
    """Validate ``values``, which come from the file or option ``source``, as ``model``.

    Files that they name are looked for in ``folder``. ``line_of`` tells by the location of a value
    in which line of the file it stands, if in any; ``changed`` in words what was changed since it
    was read. A ConfigurationError names source, line, field, its value and the allowed range.
    """
    _refuse_flags_for_numbers(model, values, f'{source}{changed}')
    try:
        return made(model, values, f'{source}{changed}', {'folder': folder} if folder else None)
    except pydantic.ValidationError as error:
        lines = []
        for location, text in mistakes(error, model):
            line = line_of(location)
            lines.append(
                f'{source}:{line}{changed}: {text}' if line else f'{source}{changed}: {text}'
            )
        raise ConfigurationError('\n'.join(lines)) from None


def _flags(values: Any, name: str = '') -> Iterator[tuple[str, bool]]:
    """Every true and false in nested values, with its dotted name."""
    if isinstance(values, dict | list):
        items = values.items() if isinstance(values, dict) else enumerate(values)
        for key, inner in items:
            yield from _flags(inner, f'{name}.{key}' if name else str(key))
    elif isinstance(values, bool):
        yield name, values


def _refuse_flags_for_numbers(model: type[Settings], values: Any, source: str) -> None:
    """Refuse true and false where a number stands: Python takes them for 1 and 0."""
    for name, value in _flags(values):
        field = find_field(model, name)
        kinds = get_args(field.annotation) or (field.annotation,) if field is not None else ()
        if bool not in kinds and (int in kinds or float in kinds):
            flag = str(value).lower()
            raise ConfigurationError(f'{source}: {name} = {flag}: no number (allowed: a number)')


@cache
def file_names(folder: Path) -> tuple[str, ...]:
    """Names of the YAML files that come with a package in ``folder``."""
    return tuple(sorted(path.stem for path in folder.glob('*.yaml')))


def path_of(argument: str, value: Any) -> Path:
    """Path that a program gave as an argument; a ConfigurationError if it is none."""
    if not isinstance(value, str | Path) or '\0' in str(value):
        raise ConfigurationError(f'{argument} = {shown(value)}: not usable (allowed: a path)')
    return Path(value)


def find_file(what: str, name: str | Path, folder: Path) -> Path:
    """File of a scenario, vehicle or the like, given by name or by path.

    Raises ConfigurationError if neither ``folder`` has a file of that name nor there is such a
    file.
    """
    name, names = str(name), file_names(folder)
    path = Path(name)
    if name in names:
        return folder / f'{name}.yaml'
    if path.suffix not in ('.yaml', '.yml'):
        raise ConfigurationError(
            f'{what} = {shown(name)}: no such {what} '
            f'(allowed: {", ".join(names)}, or a path to a .yaml file)'
        )
    try:
        path.stat()
    except FileNotFoundError:
        raise ConfigurationError(f'{path}: no such {what} file') from None
    except (OSError, ValueError) as error:
        raise ConfigurationError(f'{path}: {getattr(error, "strerror", None) or error}') from None
    return path
