# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""Door ``files``: shipped scenarios, vehicles, sweeps and a table of currents, mutated."""

import random
import re
import tempfile
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from fuzzing.counts import Counter
from fuzzing.watch import badly_told, outcome_of
from glider_base.errors import ConfigurationError
from glider_mission.scenario import load_scenario, scenario_names, scenario_path
from glider_model.vehicle.file import load_vehicle, vehicle_names, vehicle_path
from glider_studies.sweep.plan import SWEEP_FOLDER, load_sweep, sweep_names

_TABLE = b"""depth_m,north_mps,east_mps
0.0,0.30,-0.10
50.0,0.25,-0.05
400.0,0.05,0.02
1200.0,0.0,0.0
"""

#: Scalars that have broken readers.
SCALARS = (
    *('null', '~', 'yes', 'on', '""', "''", '=', '<<', '-', '.', '?', '!', '*', '&', '%'),
    *('.inf', '-.inf', '.nan', '1e999', '-1e999', '1e-999', '-0.0', '1_0', '0x', '0b_', '1:30:'),
    *('9' * 30, '9' * 5000, '-' + '9' * 400, '1:59' + ':59' * 200, '0o17', '017', '1e', '+'),
    *('2024-13-45', '2024-01-01', '0001-01-01T99:99:99Z', '2024-01-01 00:00:00 +99:99'),
    *('!!bool x', '!!int ""', '!!float x', '!!timestamp foo', '!!binary ===', '!!set {a}'),
    *('!!python/object/apply:os.getcwd []', '!!python/name:os', '!local x', '!<tag:x> y'),
    *('/dev/zero', '/dev/stdin', '/etc/passwd', '../' * 50, 'a' * 300, '/', '.yaml', 'a\\0b'),
    *('[]', '{}', '[[]]', '[1, 2]', '{a: 1}', '[1, [2]]', '{1: 2}', '{[1]: 2}', '? [a]', '| x'),
    *('"\\e[31m"', '"\\0"', '"\\ud800"', '"\\x07"', '"\\N"', '"\\U0010FFFF"', '\x1b[31m', '\x7f'),
    *('*a', '&a [*a]', '&a {a: *a}', '<<: *a', '&a 1', '[&a x, *a]', '---', '...', '%TAG ! x'),
    *('- - - -', ': : :', '#', '"', "'", '`', '@', '\t', '\r', '\u2028', '\u202e', '\ufeff', '😀'),
    *('name', 'kind', 'straight', 'table', 'true', '0', '1', '-1', '0.5', '1e4', '89.9', '12000'),
    *('1e-9', '1e-3', '0.1', '2.5', '10', '45', '-45', '60', '360', '-360', '3600', '100000'),
)
_BOMB = 'a: &a [x, x, x, x, x, x, x, x, x]\n' + ''.join(
    f'{one}: &{one} [{", ".join([f"*{before}"] * 9)}]\n'
    for before, one in zip('abcdefg', 'bcdefgh', strict=True)
)
_NUMBER = re.compile(rb'[-+]?[0-9][0-9.e+-]*')
_VALUE = re.compile(rb'(?<=[:-] )[^\n{}\[\],]+')


# ------------------------------------------------------------------------------------ mutations


def _flip(data: bytes, draw: random.Random) -> bytes:
    """A few bits, here and there."""
    changed = bytearray(data)
    for _ in range(draw.randint(1, 4) if changed else 0):
        changed[draw.randrange(len(changed))] ^= 1 << draw.randrange(8)
    return bytes(changed)


def _insert(data: bytes, draw: random.Random) -> bytes:
    """A scalar anywhere."""
    at = draw.randint(0, len(data))
    return data[:at] + draw.choice(SCALARS).encode() + data[at:]


def _delete(data: bytes, draw: random.Random) -> bytes:
    """A piece less."""
    at = draw.randint(0, len(data))
    return data[:at] + data[at + draw.choice((1, 3, 30, 300)) :]


def _repeat(data: bytes, draw: random.Random) -> bytes:
    """Some lines several times."""
    lines = data.splitlines(keepends=True)
    at = draw.randint(0, len(lines))
    part = lines[at : at + draw.randint(1, 3)]
    return b''.join([*lines[:at], *(part * draw.choice((2, 2, 50, 2000))), *lines[at:]])


def _swap(data: bytes, draw: random.Random) -> bytes:
    """Two lines in each other's place."""
    lines = data.splitlines(keepends=True)
    for _ in range(1 if lines else 0):
        i, j = draw.randrange(len(lines)), draw.randrange(len(lines))
        lines[i], lines[j] = lines[j], lines[i]
    return b''.join(lines)


def _replace(pattern: re.Pattern, data: bytes, draw: random.Random) -> bytes:
    """One match of a pattern by a scalar."""
    found = list(pattern.finditer(data))
    if not found:
        return data
    start, end = draw.choice(found).span()
    return data[:start] + draw.choice(SCALARS).encode() + data[end:]


def _exchange(data: bytes, draw: random.Random) -> bytes:
    """Two values in each other's place, whatever their types."""
    found = list(_VALUE.finditer(data))
    if len(found) < 2:
        return data
    one, other = sorted(draw.sample(found, 2), key=re.Match.start)
    return (
        data[: one.start()]
        + other[0]
        + data[one.end() : other.start()]
        + one[0]
        + data[other.end() :]
    )


def _nest(data: bytes, draw: random.Random) -> bytes:
    """Many levels, opened and maybe closed."""
    opened, closed = draw.choice((('[', ']'), ('{a: ', '}'), ('- ', ''), ('? ', ''), ('(', ')')))
    depth = draw.choice((5, 39, 42, 1000, 5000))
    deep = (opened * depth + closed * depth * draw.randint(0, 1)).encode()
    found = list(_VALUE.finditer(data))
    if not found or draw.random() < 0.3:
        at = draw.randint(0, len(data))
        return data[:at] + deep + data[at:]
    start, end = draw.choice(found).span()
    return data[:start] + deep + data[end:]


def _bomb(data: bytes, draw: random.Random) -> bytes:
    """Aliases of aliases of aliases."""
    return _BOMB.encode() + data if draw.random() < 0.5 else data + b'\n' + _BOMB.encode()


_MUTATIONS: tuple[Callable[[bytes, random.Random], bytes], ...] = (
    *(_flip, _insert, _delete, _repeat, _swap, _exchange, _nest, _bomb),
    *(partial(_replace, _VALUE), partial(_replace, _NUMBER)) * 8,
)


def mutate(data: bytes, draw: random.Random) -> bytes:
    """A file with one to three things wrong with it."""
    for _ in range(draw.choice((1, 1, 2, 3))):
        data = draw.choice(_MUTATIONS)(data, draw)
    return data


# ----------------------------------------------------------------------------------------- doors


def not_finite(params: Any) -> bool:
    """Whether numbers in nested tuples and arrays are NaN or infinite."""
    if isinstance(params, tuple):
        return any(not_finite(part) for part in params)
    return bool(np.any(~np.isfinite(np.asarray(params, dtype=float))))


def _scenario(file: Path, **changes) -> bool:
    scenario = load_scenario(str(file), changes)
    blocks = (
        scenario.plant_settings(),
        scenario.current_settings(),
        scenario.guidance_settings(),
        scenario.control_settings(),
    )
    return not any(not_finite(block.params()) for block in blocks)


def _vehicle(file: Path) -> bool:
    return not not_finite(load_vehicle(str(file)).params())


def _sweep(file: Path) -> bool:
    return load_sweep(str(file)).cells > 0


def _table(file: Path) -> bool:
    table = {'kind': 'table', 'file': str(file.resolve())}
    return _scenario(scenario_path('current_8deg'), **{'current.components': [table]})


class _Source(NamedTuple):
    """A file to mutate, and the door that it goes through, which tells whether it is good."""

    kind: str
    name: str
    data: bytes
    door: Callable[[Path], bool]


def _sources() -> list[_Source]:
    shipped = (
        ('scenario', scenario_names(), scenario_path, _scenario),
        ('vehicle', vehicle_names(), vehicle_path, _vehicle),
        ('sweep', sweep_names(), lambda name: SWEEP_FOLDER / f'{name}.yaml', _sweep),
    )
    found = [
        _Source(kind, f'{name}.yaml', find(name).read_bytes(), door)
        for kind, names, find, door in shipped
        for name in names
    ]
    return [*found, _Source('table', 'profile.csv', _TABLE, _table)]


def _case(source: _Source, data: bytes, folder: Path) -> tuple[str, str]:
    """What comes of one file."""
    file = folder / source.name
    file.write_bytes(data)
    try:
        good = source.door(file)
    except ConfigurationError as error:
        why = badly_told(str(error))
        return ('wrong', why) if why else ('', '')
    return ('', '') if good else ('wrong', 'accepted, with numbers that are not finite')


def fuzz(seed: int, count: int, counter: Counter) -> None:
    """Give mutated files to what reads them for the command line."""
    sources = _sources()
    with tempfile.TemporaryDirectory() as scratch:
        folder = Path(scratch)
        for i in range(count):
            draw = random.Random(f'{seed} {i}')
            source = sources[i % len(sources)]
            data = mutate(source.data, draw)
            found = outcome_of(partial(_case, source, data, folder))
            counter.add(f'seed {seed}, file {i}, a mutated {source.kind} {source.name}', *found)
