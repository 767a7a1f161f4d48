# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""``./glider test --only mutants``: how many changes of a kernel the tests notice."""

import importlib.util
import json
import os
import random
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from queue import SimpleQueue
from typing import Annotated, Literal

import typer
from rich.table import Table

from glider_base.errors import EXIT_FAILED
from glider_bringup.console import Json, counter, messages, output, picked, repeatable
from mutants.changes import Change, changes

app = typer.Typer(pretty_exceptions_enable=False)
ROOT = Path(__file__).resolve().parents[2]
PACKAGES = ('control', 'guidance', 'navigation')
Package = Literal[PACKAGES]
#: What is to be noticed (-).
LEAST_SHARE = 0.95


@app.command(epilog='Example: ./glider test --only mutants --package control --count 50 --seed 7')
def mutants(
    package: Annotated[
        list[repeatable(Package)] | None,
        typer.Option(help='Package; can be repeated. Default: all of them.'),
    ] = None,
    count: Annotated[
        int, typer.Option(min=1, max=100_000, help='Changes that are drawn; at most all.')
    ] = 100,
    seed: Annotated[int, typer.Option(min=0, max=2**62, help='Seed of the draw.')] = 0,
    workers: Annotated[
        int | None, typer.Option(min=1, max=64, help='Processes. Default: one per processor.')
    ] = None,
    as_json: Json = False,
) -> None:
    """Change one thing in a kernel of control, guidance or navigation, and see who notices.

    First the fast tests of the package, then short flights, and ticks from disturbed states along
    them, to the last bit, which test_flight_digests has too. What nobody notices is printed; exit
    code 1 if that is more than one in twenty.
    """
    drawn = _drawn(picked(package, Package), count, seed)
    with counter('changes', len(drawn)) as update:
        by = _judged(drawn, workers or os.cpu_count() or 1, update)
    survived = [change for change in drawn if not by[change]]
    killed = len(drawn) - len(survived)
    report = {
        'mutants': len(drawn),
        'killed': killed,
        'by_tests': sum(one == 'tests' for one in by.values()),
        'by_flights': sum(one == 'flights' for one in by.values()),
        'share': killed / len(drawn),
        'seed': seed,
        'survived': [_told(change) for change in survived],
    }
    if as_json:
        print(json.dumps(report))
    else:
        _print(report)
    if report['share'] < LEAST_SHARE:
        raise typer.Exit(EXIT_FAILED)


def _drawn(packages: list[str], count: int, seed: int) -> list[Change]:
    """Changes drawn from those of all kernels, in the order of files."""
    found: list[Change] = []
    for name in packages:
        spec = importlib.util.find_spec(f'glider_{name}')
        folder = Path(spec.submodule_search_locations[0]).resolve()
        for path in sorted(folder.rglob('*.py')):
            module = '.'.join([f'glider_{name}', *path.relative_to(folder).with_suffix('').parts])
            found += changes(module, path)
    drawn = random.Random(seed).sample(range(len(found)), min(count, len(found)))
    return [found[number] for number in sorted(drawn)]


def _judged(drawn: list[Change], workers: int, update) -> dict[Change, str]:
    """By whom each change is noticed; empty: by nobody."""
    free: SimpleQueue = SimpleQueue()
    for _ in range(workers):
        free.put(_worker())

    def ask(package: str, change: Change | None, **known) -> dict:
        worker = free.get()
        try:
            tests = str(ROOT / 'src' / package / 'test')
            line = json.dumps({'change': change, 'tests': tests, **known})
            worker.stdin.write(f'{line}\n')
            worker.stdin.flush()
            return json.loads(worker.stdout.readline())
        finally:
            free.put(worker)

    def judge(change: Change) -> str:
        package = change.module.partition('.')[0]
        found = ask(package, change, **known[package])['by']
        done.append(change)
        update(len(done), len(drawn))
        return found

    done: list[Change] = []
    packages = sorted({change.module.partition('.')[0] for change in drawn})
    with ThreadPoolExecutor(workers) as pool:
        known = dict(zip(packages, pool.map(lambda one: ask(one, None), packages), strict=True))
        by = dict(zip(drawn, pool.map(judge, drawn), strict=True))
    for _ in range(workers):
        free.get().stdin.close()
    return by


def _worker() -> subprocess.Popen:
    """A process that judges changes, one after another."""
    env = {**os.environ, 'NUMBA_DISABLE_JIT': '1', 'OMP_NUM_THREADS': '1'}
    return subprocess.Popen(
        [sys.executable, '-m', 'mutants.trial'],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
        env=env,
        cwd=ROOT,
    )


def _told(change: Change) -> str:
    place = Path(change.path).relative_to(ROOT)
    return f'{place}:{change.line}: {change.before}  ->  {change.after}'


def _print(report: dict) -> None:
    table = Table()
    for name in ('changes', 'noticed', 'by tests', 'by flights alone', 'share'):
        table.add_column(name, justify='right')
    numbers = [report[name] for name in ('mutants', 'killed', 'by_tests', 'by_flights')]
    table.add_row(*map(str, numbers), f'{report["share"]:.1%}')
    output.print(table)
    for line in report['survived']:
        messages.print(f'not noticed: {line}', soft_wrap=True)


if __name__ == '__main__':
    app()
