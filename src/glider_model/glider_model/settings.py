# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""Base of everything a person configures, and how its errors read."""

import re
from copy import deepcopy
from functools import lru_cache
from pathlib import Path
from typing import Any, TypeVar, get_args, get_origin

import pydantic
import yaml

SettingsT = TypeVar('SettingsT', bound='Settings')


class ConfigurationError(ValueError):
    """A file, field or option that cannot be used. The message is meant for the person."""


class Settings(pydantic.BaseModel):
    """Validated configuration: unknown fields, NaN and infinities are refused."""

    model_config = pydantic.ConfigDict(
        extra='forbid', allow_inf_nan=False, frozen=True, validate_default=True
    )


#: Numeric limits as pydantic calls them, and in a person's words.
_BOUNDS = (('ge', '>='), ('gt', '>'), ('le', '<='), ('lt', '<'))
_NOT_A_MAPPING = ('dict_type', 'model_type', 'model_attributes_type')


def _models(annotation: Any) -> list[type[pydantic.BaseModel]]:
    """Models that an annotation names, inside lists and unions too."""
    if get_origin(annotation) is None and isinstance(annotation, type):
        return [annotation] if issubclass(annotation, pydantic.BaseModel) else []
    return [model for part in get_args(annotation) for model in _models(part)]


def _has_tag(model: type[pydantic.BaseModel], tag: str) -> bool:
    """Whether a model is the member of a union that ``tag`` stands for."""
    return any(tag in get_args(field.annotation) for field in model.model_fields.values())


def _follow(model: type[pydantic.BaseModel], location: tuple):
    """Follow the location of an error.

    Returns
    -------
    path : list of str
        The location as the person wrote it: pydantic's adds the names of union members.
    holders : list of type
        Models that may hold the last part.
    field : FieldInfo or None
        The last part, if it is a field.
    """
    path, holders, inside, field = [], [model], [model], None
    for part in location:
        tagged = [one for one in inside if _has_tag(one, part)] if len(inside) > 1 else []
        if tagged:
            inside = tagged
            continue
        path.append(str(part))
        holders = inside
        field = next((m.model_fields[part] for m in holders if part in m.model_fields), None)
        if field is not None:
            inside = _models(field.annotation)
    return path, holders, field


def _allowed(error: dict, holders: list, field: pydantic.fields.FieldInfo | None) -> str:
    """Say in words what the field of an error would accept."""
    context = error.get('ctx') or {}
    if error['type'] == 'extra_forbidden':
        return f'allowed fields: {", ".join(name for m in holders for name in m.model_fields)}'
    if error['type'] in _NOT_A_MAPPING:
        models = _models(field.annotation) if field is not None else holders
        return f'allowed fields: {", ".join(name for m in models for name in m.model_fields)}'
    for key in ('expected', 'expected_tags'):
        if key in context:
            return f'allowed: {context[key]}'
    limits = [f'{word} {context[key]}' for key, word in _BOUNDS if key in context]
    if field is not None:
        limits = [
            f'{word} {getattr(item, key)}'
            for item in field.metadata
            for key, word in _BOUNDS
            if getattr(item, key, None) is not None
        ] or limits
    return f'allowed: {" and ".join(limits)}' if limits else ''


def find_field(model: type[Settings], name: str) -> pydantic.fields.FieldInfo | None:
    """Field by its dotted name; None if there is none."""
    inside, field = [model], None
    for part in name.split('.'):
        field = next((m.model_fields[part] for m in inside if part in m.model_fields), None)
        if field is None:
            return None
        inside = _models(field.annotation)
    return field


def unit_of(field: pydantic.fields.FieldInfo) -> str:
    """Unit of a field, from the first brackets of its description; empty without."""
    brackets = re.search(r'\(((?:[^()]|\([^()]*\))+)\)', field.description or '')
    return brackets[1].partition(',')[0] if brackets else ''


def error_lines(error: pydantic.ValidationError, model: type[pydantic.BaseModel]) -> list[str]:
    """One line per mistake: field, value, what is wrong, what is allowed."""
    lines = []
    for item in error.errors(include_url=False):
        kind, context, value = item['type'], item.get('ctx') or {}, item['input']
        path, holders, field = _follow(model, item['loc'])
        message = item['msg'].removeprefix('Value error, ').replace('Input should', 'should')
        if kind == 'extra_forbidden':
            message = 'unknown field'
        elif kind == 'missing':
            message = 'missing'
        elif kind in _NOT_A_MAPPING:
            message = 'expected a mapping of fields'
        elif kind in ('union_tag_invalid', 'union_tag_not_found'):
            path.append(context['discriminator'].strip("'"))
            value = context.get('tag', value)
            message = 'unknown' if 'tag' in context else 'missing'
        shown = '' if isinstance(value, dict) else f' = {value!r}'
        allowed = _allowed(item, holders, field)
        where = '.'.join(path) or '(file)'
        lines.append(f'{where}{shown}: {message}' + (f' ({allowed})' if allowed else ''))
    return lines


def validate(
    model: type[SettingsT], values: Any, source: str, folder: Path | None = None
) -> SettingsT:
    """Validate ``values`` as ``model``; files that it names are looked for in ``folder``.

    Raises
    ------
    ConfigurationError
        Naming ``source`` (a file or option), the field, its value and the allowed range.
    """
    try:
        return model.model_validate(values, context={'folder': folder} if folder else None)
    except pydantic.ValidationError as error:
        lines = error_lines(error, model)
        raise ConfigurationError('\n'.join(f'{source}: {line}' for line in lines)) from None


def file_names(folder: Path) -> list[str]:
    """Names of the YAML files that come with a package in ``folder``."""
    return sorted(path.stem for path in folder.glob('*.yaml'))


def find_file(what: str, name: str, folder: Path) -> Path:
    """File of a scenario, vehicle or the like, given by name or by path.

    Raises
    ------
    ConfigurationError
        If neither ``folder`` has a file of that name nor there is such a file.
    """
    known = folder / f'{name}.yaml'
    if known.is_file():
        return known
    path = Path(name)
    if path.suffix not in ('.yaml', '.yml'):
        raise ConfigurationError(
            f'{what} = {name!r}: no such {what} '
            f'(allowed: {", ".join(file_names(folder))}, or a path to a .yaml file)'
        )
    if not path.is_file():
        raise ConfigurationError(f'{path}: no such {what} file')
    return path


def read_yaml(path: Path) -> dict:
    """Read a YAML mapping.

    Raises
    ------
    ConfigurationError
        If the file is missing, unreadable, not YAML, or not a mapping.
    """
    try:
        values = deepcopy(_parse(path.read_text(encoding='utf-8')))
    except OSError as error:
        raise ConfigurationError(f'{path}: {error.strerror or error}') from None
    except (yaml.YAMLError, UnicodeDecodeError) as error:
        raise ConfigurationError(f'{path}: not valid YAML: {error}') from None
    if not isinstance(values, dict):
        raise ConfigurationError(f'{path}: expected a mapping of fields, found {values!r}')
    return values


@lru_cache(maxsize=16)
def _parse(text: str) -> Any:
    """What a YAML text says; the same few files are read for each of many missions."""
    return yaml.load(text, Loader=_Loader)


class _Loader(yaml.SafeLoader):
    """YAML 1.2 floats (``1e-3`` is a number) and no silently repeated keys."""


def _mapping(loader: _Loader, node: yaml.MappingNode) -> dict:
    seen = set()
    for key, _ in node.value:
        if not isinstance(key, yaml.ScalarNode):
            raise yaml.constructor.ConstructorError(
                None, None, 'the name of a field must be plain text', key.start_mark
            )
        name = loader.construct_object(key)
        if name in seen:
            raise yaml.constructor.ConstructorError(
                None, None, f'field {name!r} is given twice', key.start_mark
            )
        seen.add(name)
    return yaml.SafeLoader.construct_mapping(loader, node, deep=True)


_Loader.add_constructor(yaml.resolver.BaseResolver.DEFAULT_MAPPING_TAG, _mapping)
_Loader.add_implicit_resolver(
    'tag:yaml.org,2002:float',
    re.compile(r'^[-+]?(\d+\.?\d*|\.\d+)([eE][-+]?\d+)$'),
    list('-+0123456789.'),
)
