# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""ROS parameters from validated settings, and back.

A `Settings` model is declared field by field: nested models become dotted names; bool, int, float
and str become parameters of that type with description and range. Everything else (lists, unions,
optional values) becomes a parameter that holds the value as JSON or YAML text. Parameters are
read-only unless their field says ``json_schema_extra={'tunable': True}``.
"""

import json
import sys
from collections.abc import Callable, Iterable, Iterator
from typing import Any, Literal, NamedTuple, TypeVar, get_args, get_origin

import pydantic
import yaml
from pydantic.fields import FieldInfo
from rcl_interfaces.msg import (
    FloatingPointRange,
    IntegerRange,
    ParameterDescriptor,
    SetParametersResult,
)
from rclpy.node import Node
from rclpy.parameter import Parameter

from glider_base.errors import ConfigurationError, clipped, shown
from glider_base.files import parse_json, parse_yaml
from glider_base.settings import Settings, limits, made, mistakes, nested, validate

SettingsT = TypeVar('SettingsT', bound=Settings)

_PLAIN = (bool, int, float, str)
_MISSING = object()
_LARGEST = {float: sys.float_info.max, int: 2**63 - 1}
_RANGES = {
    float: ('floating_point_range', FloatingPointRange),
    int: ('integer_range', IntegerRange),
}


class _Leaf(NamedTuple):
    """One parameter: its dotted name, the field behind it, and what the model defaults to."""

    name: str
    field: FieldInfo
    default: Any

    @property
    def kind(self) -> type | None:
        """Python type of a plain parameter; None for one that holds JSON or YAML text."""
        if self.choices:
            return str
        return self.field.annotation if self.field.annotation in _PLAIN else None

    @property
    def choices(self) -> tuple[str, ...]:
        """What a parameter that is one of several words can be."""
        if get_origin(self.field.annotation) is not Literal:
            return ()
        words = get_args(self.field.annotation)
        return words if all(isinstance(word, str) for word in words) else ()

    @property
    def limits(self) -> tuple | None:
        """Smallest and largest value of a number; None if everything is allowed."""
        largest = _LARGEST.get(self.kind)
        bounds = limits(self.field) if largest else {}
        found = {key[0]: self.kind(limit) for key, limit in bounds.items()}
        return (found.get('g', -largest), found.get('l', largest)) if found else None


def _leaves(model: type[Settings], default: Settings | None, prefix: str = '') -> Iterator[_Leaf]:
    for name, field in model.model_fields.items():
        if default is not None:
            value = getattr(default, name)
        else:
            value = field.get_default(call_default_factory=True)
            value = None if field.is_required() else value
        kind = field.annotation
        if isinstance(kind, type) and issubclass(kind, pydantic.BaseModel):
            yield from _leaves(kind, value, f'{prefix}{name}.')
        else:
            yield _Leaf(prefix + name, field, value)


def _text(field: FieldInfo, value) -> str:
    return pydantic.TypeAdapter(field.annotation).dump_json(value).decode()


def _descriptor(leaf: _Leaf) -> ParameterDescriptor:
    extra = leaf.field.json_schema_extra
    descriptor = ParameterDescriptor(
        description=leaf.field.description or '',
        read_only=not (isinstance(extra, dict) and extra.get('tunable', False)),
        dynamic_typing=leaf.kind is None,
    )
    if leaf.kind is None:
        descriptor.additional_constraints = 'JSON or YAML text'
    if leaf.choices:
        descriptor.additional_constraints = f'one of {", ".join(leaf.choices)}'
    if limits := leaf.limits:
        name, kind = _RANGES[leaf.kind]
        setattr(descriptor, name, [kind(from_value=limits[0], to_value=limits[1])])
    return descriptor


def _declare(node: Node, leaf: _Leaf) -> None:
    """Declare a parameter; one that was given of another type, or out of its range, is refused."""
    limits, reason = leaf.limits, ''
    # rclpy has no public name for what the command line and parameter files give to a node
    given = node._parameter_overrides.get(leaf.name)
    value = leaf.default if leaf.kind else _text(leaf.field, leaf.default)
    if given is not None:
        value = given.value
    elif leaf.field.is_required() and leaf.default is None:
        value, reason = None, 'this parameter has to be given'
    if leaf.kind and type(value) is not leaf.kind:
        is_whole = leaf.kind is float and type(value) is int
        hint = f', write {float(value)}' if is_whole else ''
        reason = reason or f'expected a {leaf.kind.__name__}{hint}'
    elif limits and not limits[0] <= value <= limits[1]:
        reason = 'out of range'
    if reason:
        allowed = f' (allowed: {limits[0]} to {limits[1]})' if limits else ''
        raise ConfigurationError(
            f'{node.get_name()}: parameter {leaf.name} = {shown(value)}: {reason}{allowed}'
        )
    node.declare_parameter(leaf.name, value, _descriptor(leaf))


def _parse(leaf: _Leaf, value, source: str):
    """Value of a parameter as the model takes it."""
    if leaf.kind is not None or not isinstance(value, str):
        return value
    for parse in (parse_json, parse_yaml):
        try:
            return parse(value, leaf.name)
        except ConfigurationError as error:
            why = f'not JSON or YAML: {error}'
    raise ConfigurationError(f'{source} {leaf.name} = {shown(value)}: {why}')


def _validated(node: Node, model: type[SettingsT], leaves, values: dict[str, Any]) -> SettingsT:
    source = f'{node.get_name()}: parameter'
    tree = {leaf.name: _parse(leaf, values[leaf.name], source) for leaf in leaves}
    try:
        settings = made(model, nested(tree), source)
        settings.check()
        return settings
    except pydantic.ValidationError as error:
        lines = (f'{source} {text}' for _, text in mistakes(error, model))
        raise ConfigurationError('\n'.join(lines)) from None


def declare_settings(
    node: Node, model: type[SettingsT], on_change: Callable[[SettingsT], None] | None = None
) -> SettingsT:
    """Declare the parameters of ``model`` on ``node`` and return the values they were given.

    ``on_change`` is called with the new settings after a tunable parameter was set at run time. A
    set that the model refuses as a whole, or of which it makes no params, is rejected and changes
    nothing. A ConfigurationError names the parameter, its value and the allowed range.
    """
    leaves = list(_leaves(model, None))
    for leaf in leaves:
        _declare(node, leaf)

    def current() -> dict[str, Any]:
        return {leaf.name: node.get_parameter(leaf.name).value for leaf in leaves}

    settings = _validated(node, model, leaves, current())
    if on_change is None:
        return settings
    names = {leaf.name for leaf in leaves}

    def check(parameters: list[Parameter]) -> SetParametersResult:
        changed = {item.name: item.value for item in parameters if item.name in names}
        try:
            _validated(node, model, leaves, {**current(), **changed}).params()
        except ConfigurationError as error:
            return SetParametersResult(successful=False, reason=str(error))
        return SetParametersResult(successful=True)

    def apply(parameters: list[Parameter]) -> None:
        if any(item.name in names for item in parameters):
            on_change(_validated(node, model, leaves, current()))

    node.add_on_set_parameters_callback(check)
    node.add_post_set_parameters_callback(apply)
    return settings


def refuse_unknown(node: Node) -> None:
    """Refuse parameters that a node was given and has not declared; ROS would not say a word."""
    # rclpy has no public name for what the command line and parameter files give to a node
    given = sorted(node._parameter_overrides)
    reason = unknown_parameters(node, [x for x in given if not x.startswith('qos_overrides.')])
    if reason:
        raise ConfigurationError(reason)


def unknown_parameters(node: Node, names: Iterable[str]) -> str:
    """Which parameters a node does not have, and those that it has, in words; empty if none."""
    unknown = [name for name in names if not node.has_parameter(name)]
    known = ', '.join(sorted(node.get_parameters_by_prefix(''))) if unknown else ''
    return '\n'.join(
        f'{node.get_name()}: parameter {clipped(name)}: unknown (allowed: {known})'
        for name in unknown
    )


def to_parameters(settings: Settings) -> dict[str, Any]:
    """Nested parameters that `declare_settings` turns back into equal ``settings``."""
    return nested(
        {
            leaf.name: leaf.default if leaf.kind else _text(leaf.field, leaf.default)
            for leaf in _leaves(type(settings), settings)
        }
    )


def changed_parameters(before: Settings, after: Settings) -> dict[str, str]:
    """Parameters in which two settings of one kind differ: the later values, as JSON, by name."""
    old, new = (
        {leaf.name: _text(leaf.field, leaf.default) for leaf in _leaves(type(one), one)}
        for one in (before, after)
    )
    return {name: text for name, text in new.items() if text != old[name]}


def with_parameters(settings: SettingsT, values: dict[str, str]) -> SettingsT:
    """Settings with some parameters changed, as JSON by dotted name; errors as `validate`."""
    kept = {leaf.name: leaf.default for leaf in _leaves(type(settings), settings)}
    try:
        given = {name: json.loads(text) for name, text in values.items()}
    except (ValueError, RecursionError):
        raise ConfigurationError(f'parameters {shown(values)}: not JSON') from None
    return validate(type(settings), nested({**kept, **given}), 'parameter')


def from_parameters(model: type[SettingsT], values: dict[str, Any], source: str) -> SettingsT:
    """Settings from nested parameters as of `to_parameters`, without those of others.

    Errors are those of `validate`.
    """
    tree = {}
    for leaf in _leaves(model, None):
        branch: Any = values
        for part in leaf.name.split('.'):
            branch = branch.get(part, _MISSING) if isinstance(branch, dict) else _MISSING
        if branch is not _MISSING:
            tree[leaf.name] = _parse(leaf, branch, f'{source}:')
    return validate(model, nested(tree), source)


class _ParameterDumper(yaml.SafeDumper):
    """Writes what rcl's YAML parser reads back to the same type and the same bits."""


_ParameterDumper.add_representer(
    str, lambda dumper, text: dumper.represent_scalar('tag:yaml.org,2002:str', text, style='"')
)


def parameters_yaml(nodes: dict[str, dict[str, Any]], namespace: str = '/glider') -> str:
    """Text of a parameter file for ``--params-file``.

    Of nested parameters, as of `to_parameters`, by the names of nodes in a namespace.
    """
    prefix = '/' + namespace.strip('/') + '/' if namespace.strip('/') else '/'
    tree = {f'{prefix}{name}': {'ros__parameters': values} for name, values in nodes.items()}
    return yaml.dump(
        tree, Dumper=_ParameterDumper, sort_keys=False, width=sys.maxsize, allow_unicode=True
    )
