# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""What other distributions bring: classes that they register as entry points.

A package registers a class under a group, by the name by which people will call it:

    [project.entry-points."glider.control_laws"]
    sliding = "my_law.sliding:SlidingSettings"
"""

import importlib
import importlib.util
import os
import pkgutil
import sys
from collections.abc import Callable, Iterator
from functools import cache
from importlib.metadata import EntryPoint, entry_points
from pathlib import Path
from types import ModuleType
from typing import Any, Literal, TypeVar

import pydantic

from glider_base.errors import ConfigurationError

CONTROL_LAWS, GUIDANCE_METHODS = 'glider.control_laws', 'glider.guidance_methods'
CURRENTS, NAVIGATION_METHODS = 'glider.currents', 'glider.navigation_methods'
SURFACES, SURFACE_LAWS = 'glider.surfaces', 'glider.surface_laws'
#: Typer applications: commands of ``./glider``.
COMMANDS = 'glider.commands'
GROUPS = (CONTROL_LAWS, CURRENTS, GUIDANCE_METHODS, NAVIGATION_METHODS, SURFACE_LAWS, SURFACES)

#: Variable that says what was said already, so that the processes of a run do not say it again.
TOLD = 'GLIDER_TOLD'

ClassT = TypeVar('ClassT', bound=type)


#: All entry points, which are read once.
_installed = cache(entry_points)


@cache
def registered() -> tuple[EntryPoint, ...]:
    """Entry points of all groups, in the order of group and name."""
    found = {
        (point.group, point.name, point.value): point
        for group in GROUPS
        for point in _installed().select(group=group)
    }
    return tuple(found[key] for key in sorted(found))


def sources() -> Iterator[Path]:
    """Python files of the top-level modules of everything that is registered, imported or not."""
    for name in sorted({point.module.partition('.')[0] for point in registered()}):
        try:
            spec = importlib.util.find_spec(name)
        except (ImportError, ValueError):
            continue
        if spec is None:
            continue
        for folder in spec.submodule_search_locations or ():
            yield from sorted(Path(folder).rglob('*.py'))
        if not spec.submodule_search_locations and spec.origin:
            yield Path(spec.origin)


def classes(
    group: str,
    base: ClassT,
    package: ModuleType,
    taken: set[str],
    check: Callable[[str, type], None] = lambda name, found: None,
    complete: bool = True,
) -> dict[str, ClassT]:
    """Subclasses of ``base`` by name: one in each module of ``package``, then those registered.

    What cannot be used, such as a name in ``taken`` or a class that ``check`` raises for, is named
    on standard error, and is not there: the others fly on. Every field has a default, unless
    they need not be ``complete``.
    """
    found = {}
    for module in pkgutil.iter_modules(package.__path__):
        inside = importlib.import_module(f'{package.__name__}.{module.name}')
        kinds = (one for one in vars(inside).values() if isinstance(one, type))
        own = (one for one in kinds if issubclass(one, base) and one.__module__ == inside.__name__)
        (found[module.name],) = own
    for point in registered():
        if point.group != group:
            continue
        try:
            loaded = point.load()
            refuse_unusable(point.name, loaded, base, taken | set(found), complete)
            check(point.name, loaded)
            found[point.name] = loaded
        except (Exception, SystemExit) as error:  # it is not our code
            _tell(point, f'{type(error).__name__}: {error}'.partition('\n')[0])
    return found


def choice(found: dict[str, ClassT], default: str, group: str, words: str = '') -> tuple:
    """Field, as of `pydantic.create_model`, for the name of one of them."""
    extra, words = {'others': others(group)}, words or listed(found)
    field = pydantic.Field(default, description=words, json_schema_extra=extra)
    return Literal[tuple(found)], field


def sections(found: dict[str, ClassT]) -> dict[str, tuple]:
    """Fields for the settings of each that has some, by its name."""
    return {
        name: (one, pydantic.Field(one(), description=summary(one)))
        for name, one in found.items()
        if one.model_fields
    }


def offered(group: str) -> dict[str, EntryPoint]:
    """What is registered in a group, by name, not loaded; of one name that of the stack."""
    found = {}
    points = _installed().select(group=group)
    for point in sorted(points, key=lambda one: (not one.module.startswith('glider_'), one.value)):
        if (first := found.setdefault(point.name, point)).value != point.value:
            _tell(point, f'ValueError: its name is taken by {_origin(first)}')
    return found


def used(point: EntryPoint, use: Callable[[Any], Any]) -> Any:
    """What ``use`` makes of what is registered; None, and reported, if it cannot be used."""
    try:
        return use(point.load())
    except (Exception, SystemExit) as error:  # it may not be our code
        _tell(point, f'{type(error).__name__}: {error}'.partition('\n')[0])
        return None


def of_others(found: dict[str, ClassT], package: ModuleType) -> set[str]:
    """Names of those classes that are not from a package of ours."""
    own = f'{package.__name__}.'
    return {name for name, one in found.items() if not one.__module__.startswith(own)}


def _tell(point: EntryPoint, why: str) -> None:
    """Say on standard error that something cannot be used, unless a parent process has said it."""
    known = os.environ.get(TOLD, '').split(os.pathsep)
    name = f'{point.group}.{point.name}'
    if name not in known:
        os.environ[TOLD] = os.pathsep.join([*filter(None, known), name])
        print(ConfigurationError(f'glider: {_origin(point)}: not usable: {why}'), file=sys.stderr)


def refuse_unusable(
    name: str, one: Any, base: type, taken: set[str], complete: bool = True
) -> None:
    """Refuse what is no usable subclass of ``base``, or not by a name; see `classes`.

    A ValueError or TypeError says why, as part of a sentence.
    """
    if not name.isidentifier():
        raise ValueError('its name is no identifier (allowed: letters, digits and _)')
    if name in taken:
        raise ValueError(f'its name is taken (allowed: all but {", ".join(sorted(taken))})')
    if not (isinstance(one, type) and issubclass(one, base)):
        raise TypeError(f'it is no subclass of {base.__module__}.{base.__name__}')
    methods = (name for name in ('params', 'initial_state') if name in vars(base))
    if lacking := [name for name in methods if getattr(one, name) is vars(base)[name]]:
        raise TypeError(f'it has no {" and no ".join(lacking)}')
    try:
        if complete:
            one()
    except pydantic.ValidationError as error:
        first = error.errors(include_url=False)[0]
        field = '.'.join(map(str, first['loc']))
        raise ValueError(f'its field {field} has no usable default: {first["msg"]}') from None


def _origin(point: EntryPoint) -> str:
    owner = f'{point.dist.name} {point.dist.version}: ' if point.dist else ''
    return f'{owner}{point.group}: {point.name} = {point.value}'


def others(group: str) -> str:
    """Where classes come from that are not among ours, as part of a sentence."""
    return f'others come with packages that register them in the group {group}'


def listed(found: dict[str, type]) -> str:
    """Names of classes and what each is, as part of a sentence."""
    return '; '.join(f'{name}: {summary(one)}' for name, one in found.items())


def summary(described: type) -> str:
    """First line of a docstring as part of a sentence."""
    text = (described.__doc__ or described.__name__).strip().partition('\n')[0].rstrip('.')
    return text[:1].lower() + text[1:]
