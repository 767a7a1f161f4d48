# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""Door ``lines``: command lines over all commands and options, with hostile values.

They are run in this process, as `glider_bringup.cli.main` runs them. None flies for long: what
limits a flight is replaced by values only that are refused or smaller still.
"""

import io
import os
import random
import shlex
import signal
import sys
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager, redirect_stderr, redirect_stdout
from functools import partial
from pathlib import Path

import typer

from fuzzing.counts import Counter
from fuzzing.files import SCALARS
from fuzzing.watch import badly_told, outcome_of

#: Words that have broken command lines; numbers that are in no range, or limit to nothing.
WORDS = (
    *(one for one in SCALARS if not one.isdigit() and one not in ('2.5', '1e4', '1_0', '12000')),
    *('', ' ', '-', '--', '-1', '0', '-0', '0.0', 'nan', 'inf', '-inf', '1e400', '9' * 25, '0x1'),
    *(
        'a b',
        'a/b',
        '//',
        '..',
        '~',
        '.',
        '/',
        '/dev/null',
        '/dev/full',
        '/dev/zero',
        '/dev/stdin',
    ),
    *('\udcff', 'a\udcff.yaml', '\x1b[31mred', '\n', 'é', '[red]', '${HOME}', '$(id)', '%s%n'),
    *(
        'a' * 300,
        'a' * 300 + '.yaml',
        'a/' * 3000,
        '=' * 50,
        '[' * 3000,
        'a' * 20_000,
        '/proc/self',
    ),
    *('--help', '--json', '--set', '--nonsense', '-x', '--set=', 'current_8deg', 'zhang2021'),
)
#: Fields and values for ``--set``; most of them are hostile.
_FIELDS = (
    *('seed', 'name', 'description', 'dives', 'vehicle', 'profile.depth_m', 'profile', 'path'),
    *('current.components', 'current.speed_kn', 'path.waypoints', 'control.law', 'perturb'),
    *('vehicle.hydrodynamics.K_D0', 'vehicle.hull', 'vehicle.name', 'vehicle.rated_depth.source'),
    *('a..b', '.', 'seed.x', '__class__', '', 'initial.depth_m', 'water', 'settle_s'),
)
#: Options that wait for somebody, or open windows.
_NEVER = {'--wait-for', '--loop', '--open', '--view'}
#: Command lines begin like this, so that none takes long.
_RUN = {'--engine': 'direct', '--duration': '0.5'}
_BEGIN: dict[str, tuple[list[str], dict[str, str]]] = {
    'run': (['current_8deg'], _RUN),
    'montecarlo': (['current_8deg'], {'--plants': '1', '--duration': '0.5', '--workers': '0'}),
    'experiments': ([], {'--only': 'nothing'}),
    'sweep': (['sweep.yaml'], {'--workers': '0'}),
    'map': (['sweep.nc'], {}),
    'score': (['flown'], {}),
    'figure': (['flown'], {}),
    'report': (['flown'], {}),
    'compare': (['flown', 'flown'], {}),
    'replay': (['flown'], {'--rate': 'max', '--duration': '0.2'}),
    'verify': (['flown'], {}),
    'trim': (['zhang2021'], {'--net-heaviness-kg': '0.4', '--pitch-deg': '-30'}),
    'list': ([], {}),
    'bench': ([], {}),
    'test': ([], {}),
}
_SWEEP = """dimensions:
  speed: {kind: values, field: current.speed_kn, values: [0.5]}
set: {duration_s: 0.5, dives: 0}
"""


def options(command: str) -> list[str]:
    """Options of a command."""
    from glider_bringup.cli import app

    found = typer.main.get_command(app).get_command(None, command).params
    names = [name for one in found for name in one.opts if name.startswith('--')]
    return [name for name in names if name not in _NEVER]


def command_line(draw: random.Random) -> list[str]:
    """A command with its words, one to three of them hostile."""
    command = draw.choice(list(_BEGIN))
    words, safe = _BEGIN[command]
    words, given = list(words), dict(safe)
    extra = []
    for _ in range(draw.choice((1, 1, 2, 3))):
        word = draw.choice(WORDS)
        kind = draw.random()
        known = options(command)
        if kind < 0.25 and words:
            words[draw.randrange(len(words))] = word
        elif kind < 0.35:
            extra.append(word)
        elif known:
            name = draw.choice(known)
            if name == '--set':
                extra += [name, f'{draw.choice(_FIELDS)}={word}']
            else:
                given[name] = word
    flat = [part for pair in given.items() for part in pair]
    return [command, *words, *extra, *flat]


# ------------------------------------------------------------------------------------- one line


@contextmanager
def _inside(folder: Path, words: list[str]) -> Iterator[tuple[io.BytesIO, io.BytesIO]]:
    """Let this process be that of a command line for a while; yields what it prints."""
    out, err = io.BytesIO(), io.BytesIO()
    before, argv = Path.cwd(), sys.argv
    handlers = {n: signal.getsignal(n) for n in (signal.SIGINT, signal.SIGTERM)}
    os.chdir(folder)
    sys.argv = ['./glider', *words]
    with (
        redirect_stdout(io.TextIOWrapper(out, 'utf-8', write_through=True)),
        redirect_stderr(io.TextIOWrapper(err, 'utf-8', 'backslashreplace', write_through=True)),
    ):
        try:
            yield out, err
        finally:
            sys.argv = argv
            os.chdir(before)
            for number, handler in handlers.items():
                signal.signal(number, handler)


def _case(words: list[str], folder: Path) -> tuple[str, str]:
    """What comes of one command line."""
    from glider_bringup.cli import main

    with _inside(folder, words) as (_, err):
        code = main()
        told = err.getvalue().decode('utf-8')
    if 'Traceback' in told:
        return 'tracebacks', told[-500:]
    why = badly_told(told) if code else ''
    if code not in (0, 1, 2):
        why = f'exit code {code}'
    return ('wrong', why) if why else ('', '')


def _prepare(folder: Path) -> None:
    """Files that the command lines name: a short flight with its bag, and a sweep."""
    (folder / 'sweep.yaml').write_text(_SWEEP, encoding='utf-8')
    flight = 'run --engine direct --duration 1 --bag --no-report --out flown'.split()
    outcome, why = _case(flight, folder)
    if outcome or not (folder / 'flown').is_dir():
        raise RuntimeError(f'the flight to try commands on has failed: {why}')


def fuzz(seed: int, count: int, counter: Counter) -> None:
    """Run hostile command lines."""
    with tempfile.TemporaryDirectory() as scratch:
        folder = Path(scratch)
        _prepare(folder)
        for i in range(count):
            words = command_line(random.Random(f'{seed} {i}'))
            shown = shlex.join(word[:100] for word in words)
            case = f'seed {seed}, line {i}: ./glider {shown}'.encode('ascii', 'backslashreplace')
            counter.add(case.decode(), *outcome_of(partial(_case, words, folder)))
