# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""``./glider test --only fuzz``: hostile use, counted."""

import json
from importlib import import_module
from typing import Annotated, Literal

import typer
from rich.table import Table

from fuzzing.counts import Counter
from glider_base.errors import EXIT_FAILED, EXIT_INTERRUPTED
from glider_bringup.console import Json, counter, messages, output, picked, repeatable

app = typer.Typer(pretty_exceptions_enable=False)
#: Doors, each a module beside this one, with the cases tried by default.
COUNTS = {'files': 1000, 'lines': 200, 'messages': 1000, 'bags': 500, 'flights': 500, 'kills': 20}
Door = Literal[tuple(COUNTS)]


@app.command(epilog='Example: ./glider test --only fuzz --door bags --count 100 --seed 7')
def fuzz(
    door: Annotated[
        list[repeatable(Door)] | None,
        typer.Option(help='Door; can be repeated. Default: all of them.'),
    ] = None,
    seed: Annotated[int, typer.Option(min=0, max=2**62, help='Seed of all cases.')] = 0,
    count: Annotated[
        int | None,
        typer.Option(
            min=1,
            max=1_000_000,
            help='Cases at each door. Default: '
            + ', '.join(f'{n} {door}' for door, n in COUNTS.items())
            + '.',
        ),
    ] = None,
    as_json: Json = False,
) -> None:
    """Try the doors of the stack: mutated files, command lines, messages, bags, flights, kills.

    Counts tracebacks, hangs (over 10 s) and wrong results given as good ones; exit code 1 if there
    is any. The same seed tries the same cases. Ctrl-C prints what was counted until then.
    """
    counts, interrupted = {}, False
    try:
        for one in picked(door, Door):
            cases = count or COUNTS[one]
            with counter(one, cases) as update:
                counts[one] = Counter(update)
                import_module(f'fuzzing.{one}').fuzz(seed, cases, counts[one])
    except KeyboardInterrupt:
        interrupted = True
    found = {name: one.result() for name, one in counts.items()}
    if as_json:
        print(json.dumps({name: one._asdict() for name, one in found.items()}))
    else:
        _print(found)
    if interrupted:
        messages.print('stopped by SIGINT')
        raise typer.Exit(EXIT_INTERRUPTED)
    if not all(one.clean for one in found.values()):
        raise typer.Exit(EXIT_FAILED)


def _print(found: dict) -> None:
    """Print the counts, and examples of what went wrong, for a person."""
    table = Table()
    for name in ('', 'tried', 'tracebacks', 'hangs', 'wrong'):
        table.add_column(name, justify='right' if name else 'left')
    for door, one in found.items():
        table.add_row(door, *(f'{n:,}' for n in one[:4]))
    output.print(table)
    for door, one in found.items():
        for example in one.examples:
            messages.print(f'{door}: {example}', soft_wrap=True)


if __name__ == '__main__':
    app(prog_name='./glider test --only fuzz')
