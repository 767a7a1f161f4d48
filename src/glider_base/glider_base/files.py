# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""Reads what people write, YAML and JSON, without trusting it.

A text is read event by event: how deep and how large it is, is known before anything is built.
Scalars are YAML 1.1 as PyYAML reads it, with two exceptions: ``1e-3`` is a number, and dates are
text. Numbers of base 8 and 60, tags, directives for tags, and repeated keys are refused; names of
fields are text.
"""

import json
import os
import re
import stat
from collections.abc import Iterable, Iterator
from copy import deepcopy
from functools import lru_cache
from pathlib import Path
from typing import Any

import yaml

from glider_base.errors import ConfigurationError, shown

#: Size of a file of text (bytes).
MAX_BYTES = 1_000_000
#: Values in a YAML text; those that an alias repeats count again.
MAX_VALUES = 200_000
#: Mappings and lists inside each other, in YAML and in JSON.
MAX_DEPTH = 40
#: Characters of a number.
MAX_DIGITS = 100

# Text has line ends and tabs, but no other control characters and no halves of characters.
_CONTROL = re.compile('[\0-\b\v\f\x0e-\x1f\x7f-\x9f\ud800-\udfff\ufffe\uffff]')
_TAG_DIRECTIVE = re.compile('^%TAG', re.MULTILINE)
# A course of 045 is 37 in YAML 1.1, and 1:30 is 90.
_OTHER_BASE = re.compile('[-+]?0[0_]*[1-7][0-7_]+|.*:.*')

Location = tuple[str, ...]


def read_bytes(path: Path) -> bytes:
    """Content of a regular file of at most `MAX_BYTES`.

    Raises ConfigurationError if there is no such file, it is no regular one, cannot be read, or is
    larger.
    """
    try:
        # devices and pipes are not opened at all; should one come in between, nothing waits for it
        if not stat.S_ISREG(os.stat(path).st_mode):
            raise ConfigurationError(f'{path}: not a regular file')
        with open(
            path, 'rb', opener=lambda name, flags: os.open(name, flags | os.O_NONBLOCK)
        ) as f:
            data = f.read(MAX_BYTES + 1)
    except (OSError, ValueError) as error:
        if isinstance(error, ConfigurationError):
            raise
        raise ConfigurationError(f'{path}: {getattr(error, "strerror", None) or error}') from None
    if len(data) > MAX_BYTES:
        raise ConfigurationError(
            f'{path}: larger than {MAX_BYTES:,} bytes (allowed: <= {MAX_BYTES:,})'
        )
    return data


def is_file(path: Path) -> bool:
    """Whether there is a file; whatever cannot be a path of one is none."""
    try:
        return path.is_file()
    except (OSError, ValueError):
        return False


def read_text(path: Path) -> str:
    """Text of a regular file in UTF-8; errors as `read_bytes`, or naming the line that is none."""
    data = read_bytes(path)
    try:
        return data.decode('utf-8-sig')
    except UnicodeDecodeError as error:
        line = data.count(b'\n', 0, error.start) + 1
        raise ConfigurationError(
            f'{path}:{line}: not UTF-8 text, byte 0x{data[error.start]:02x}'
        ) from None


# ------------------------------------------------------------------------------------------ YAML


class _RefusedError(Exception):
    """What is wrong with a text, and in which line."""

    def __init__(self, line: int, what: str) -> None:
        super().__init__(what)
        self.line, self.what = line, what


_CONSTRUCTED = ('null', 'bool', 'int', 'float')


class _Resolver(yaml.resolver.Resolver):
    """Which kind of value a plain scalar is; anything but those above is text."""

    yaml_implicit_resolvers = {
        first: [pair for pair in pairs if pair[0].rpartition(':')[2] in _CONSTRUCTED]
        for first, pairs in yaml.resolver.Resolver.yaml_implicit_resolvers.items()
    }


_Resolver.add_implicit_resolver(
    'tag:yaml.org,2002:float',
    re.compile(r'^[-+]?([0-9]+\.?[0-9]*|\.[0-9]+)([eE][-+]?[0-9]+)$'),
    list('-+0123456789.'),
)
_RESOLVER, _CONSTRUCTOR = _Resolver(), yaml.constructor.SafeConstructor()


def _scalar(event: yaml.ScalarEvent) -> Any:
    """Value of a scalar."""
    text, line = event.value, event.start_mark.line + 1
    control = _CONTROL.search(text)
    if control:
        raise _RefusedError(line, f'control character {shown(control[0])} in a value')
    tag = _RESOLVER.resolve(yaml.ScalarNode, text, event.implicit)
    kind = tag.rpartition(':')[2]
    if kind not in _CONSTRUCTED:
        return text
    if len(text) > MAX_DIGITS:
        raise _RefusedError(line, f'a number of {len(text)} characters (allowed: <= {MAX_DIGITS})')
    if _OTHER_BASE.fullmatch(text):
        raise _RefusedError(line, f'{text}: of base 8 or 60 (allowed: such as 45 and 45.5)')
    try:
        return getattr(_CONSTRUCTOR, f'construct_yaml_{kind}')(yaml.ScalarNode(tag, text))
    except ValueError:
        raise _RefusedError(line, f'{shown(text)} is not a number') from None


class _Builder:
    """Builds the value of a text from its events.

    Neither deep nor repeated values cost anything before they are refused.
    """

    def __init__(self, events: Iterable[yaml.Event]) -> None:
        self._events = self._plain(events)
        self._anchors: dict[str, tuple[Any, int]] = {}  #: value, and how many it is
        self._count = 0
        self.lines: dict[Location, int] = {}
        first = next(self._events, None)
        self.value = None if first is None else self._built(first, ())  #: nothing is None
        for event in self._events:
            raise _RefusedError(event.start_mark.line + 1, 'a second document (allowed: one)')

    @staticmethod
    def _plain(events: Iterable[yaml.Event]) -> Iterator[yaml.Event]:
        """Events that values are made of; none of them has a tag."""
        for event in events:
            tag = getattr(event, 'tag', None)
            if tag is not None:
                name = shown(tag.replace('tag:yaml.org,2002:', '!!'))
                line = event.start_mark.line + 1
                raise _RefusedError(line, f'tag {name} (allowed: values without tags)')
            if isinstance(event, yaml.NodeEvent | yaml.CollectionEndEvent):
                yield event

    def _built(self, event: yaml.NodeEvent, where: Location) -> Any:
        """Value that begins with an event."""
        line = event.start_mark.line + 1
        self.lines.setdefault(where, line)
        before = self._count
        self._count_more(1, line)
        if isinstance(event, yaml.AliasEvent):
            if event.anchor not in self._anchors:
                raise _RefusedError(line, f'alias {shown(event.anchor)} of nothing above')
            value, count = self._anchors[event.anchor]
            self._count_more(count - 1, line)
            return deepcopy(value)
        if isinstance(event, yaml.ScalarEvent):
            try:
                value = _scalar(event)
            except _RefusedError as error:
                said = [*filter(None, ['.'.join(where)]), error.what]
                raise _RefusedError(line, ': '.join(said)) from None
        elif len(where) >= MAX_DEPTH:
            raise _RefusedError(line, f'nested more than {MAX_DEPTH} deep')
        elif isinstance(event, yaml.SequenceStartEvent):
            value = [self._built(one, (*where, str(i))) for i, one in enumerate(self._inside())]
        else:
            value = {}
            for name in self._inside():
                key = self._key(name, value)
                self.lines[(*where, key)] = name.start_mark.line + 1
                value[key] = self._built(next(self._events), (*where, key))
        if event.anchor:
            self._anchors[event.anchor] = value, self._count - before
        return value

    def _inside(self) -> Iterator[yaml.NodeEvent]:
        """Events with which the values of a mapping or list begin, each once it is built."""
        while not isinstance(event := next(self._events), yaml.CollectionEndEvent):
            yield event

    @staticmethod
    def _key(event: yaml.NodeEvent, others: dict[str, Any]) -> str:
        """Name of a field."""
        line = event.start_mark.line + 1
        if not isinstance(event, yaml.ScalarEvent) or event.anchor:
            raise _RefusedError(line, 'the name of a field must be plain text')
        if _CONTROL.search(event.value):
            raise _RefusedError(line, f'control character in the name {shown(event.value)}')
        if event.value in others:
            raise _RefusedError(line, f'field {shown(event.value)} is given twice')
        return event.value

    def _count_more(self, count: int, line: int) -> None:
        self._count += count
        if self._count > MAX_VALUES:
            raise _RefusedError(line, f'more than {MAX_VALUES:,} values')


@lru_cache(maxsize=16)
def _parse(text: str) -> tuple[Any, dict[Location, int]]:
    """What a YAML text says, and the line of each value; files are read for many missions."""
    odd = _CONTROL.search(text) or _TAG_DIRECTIVE.search(text)
    if odd:
        what = 'control character' if _CONTROL.match(odd[0]) else 'directive'
        raise _RefusedError(text.count('\n', 0, odd.start()) + 1, f'{what} {shown(odd[0])}')
    try:
        builder = _Builder(yaml.parse(text, Loader=yaml.CSafeLoader))
    except yaml.MarkedYAMLError as error:
        what = ', '.join(part for part in (error.context, error.problem) if part)
        raise _RefusedError(error.problem_mark.line + 1, what) from None
    return builder.value, builder.lines


def parse_yaml(text: str, source: str) -> Any:
    """Value of a YAML text; a `ConfigurationError` names ``source``, and the line of several."""
    try:
        return deepcopy(_parse(text)[0])
    except _RefusedError as error:
        where = f'{source}:{error.line}' if '\n' in text else source
        raise ConfigurationError(f'{where}: not valid YAML: {error.what}') from None


def read_yaml(path: Path) -> dict[str, Any]:
    """Mapping of a YAML file; errors as `read_text` and `parse_yaml`, and if it is none."""
    values = parse_yaml(read_text(path), str(path))
    if not isinstance(values, dict):
        raise ConfigurationError(f'{path}: expected a mapping of fields, found {shown(values)}')
    return values


def yaml_line(path: Path, location: Location) -> int | None:
    """Line of a file that `read_yaml` has read in which a value or its owner stands."""
    try:
        lines = _parse(read_text(path))[1]
    except (ConfigurationError, _RefusedError):  # it has changed since
        return None
    owners = (location[:end] for end in range(len(location), 0, -1))
    return next((lines[owner] for owner in owners if owner in lines), None)


class _Dumper(yaml.SafeDumper):
    """Writes in quotes what `parse_yaml` would not read as text."""


_Dumper.yaml_implicit_resolvers = {
    first: [*pairs, *_Resolver.yaml_implicit_resolvers.get(first, [])]
    for first, pairs in yaml.SafeDumper.yaml_implicit_resolvers.items()
}


def yaml_text(values: Any) -> str:
    """Text that `parse_yaml` reads back to equal values."""
    return yaml.dump(values, Dumper=_Dumper, sort_keys=False, allow_unicode=True)


# ------------------------------------------------------------------------------------------ JSON


def _number(text: str) -> int:
    if len(text) > MAX_DIGITS:
        raise ValueError(f'a number of {len(text)} characters (allowed: <= {MAX_DIGITS})')
    return int(text)


def _check_depth(value: Any) -> None:
    """Refuse what is nested too deeply; a level at a time."""
    level = [value]
    for _ in range(MAX_DEPTH + 1):
        level = [
            part
            for one in level
            if isinstance(one, (dict, list))
            for part in (one.values() if isinstance(one, dict) else one)
        ]
    if level:
        raise ValueError(f'nested more than {MAX_DEPTH} deep')


def parse_json(text: str | bytes, source: str) -> Any:
    """Value of a JSON text; a `ConfigurationError` names its ``source``."""
    try:
        value = json.loads(text, parse_int=_number)
        _check_depth(value)
    except RecursionError:
        raise ConfigurationError(f'{source}: not valid JSON: nested too deeply') from None
    except ValueError as error:
        raise ConfigurationError(f'{source}: not valid JSON: {error}') from None
    return value


def read_json(path: Path) -> Any:
    """Value of a file of JSON; errors as `read_text` and `parse_json`."""
    return parse_json(read_text(path), str(path))
