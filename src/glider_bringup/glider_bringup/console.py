# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""What the commands share: consoles, options, progress bars."""

import json
import os
from collections.abc import Callable, Iterable
from contextlib import contextmanager
from enum import Enum
from functools import partial
from pathlib import Path
from time import perf_counter
from typing import Annotated, Any, Literal, get_args

import typer
from rich.console import Console
from rich.progress import (
    BarColumn,
    MofNCompleteColumn,
    Progress,
    ProgressColumn,
    TextColumn,
    TimeElapsedColumn,
    TimeRemainingColumn,
)
from rich.table import Table
from rich.text import Text

from glider_base.errors import EXIT_INTERRUPTED, printable
from glider_base.signals import TICK_S
from glider_bringup.engines.interrupts import stopped_by
from glider_control.settings import ControlLawSettings
from glider_mission.changes import parse_assignment


class _PlainConsole(Console):
    """Names, descriptions and folders come from people.

    Brackets in them are no markup, and what could steer a terminal is shown, not sent.
    """

    def __init__(self, **kwargs) -> None:
        super().__init__(highlight=False, markup=False, **kwargs)

    def render_str(self, text: str, **kwargs) -> Text:
        """Text of a string, wherever in a table or line it stands."""
        return super().render_str(printable(text, keep='\n\t'), **kwargs)


if os.environ.get('COLUMNS') == '0':  # of a terminal that tells no size: rich would print nothing
    del os.environ['COLUMNS']
# Standard output carries results only; progress and messages go to standard error.
output = _PlainConsole()
messages = _PlainConsole(stderr=True)


def choices(model, field: str) -> Any:
    """Choices of an option, from the settings field that it sets."""
    return Literal[get_args(model.model_fields[field].annotation)]


def repeatable(choice: Any) -> type[Enum]:
    """Choices of an option that can be repeated: of those typer takes no Literal."""
    return Enum('Choice', {text: text for text in get_args(choice)})


def picked(chosen: list[Enum] | None, choice: Any) -> list[str]:
    """Choices that were picked by an option that can be repeated; without it all there are."""
    return list(dict.fromkeys(one.value for one in chosen or repeatable(choice)))


Named = Annotated[
    str, typer.Argument(help='Scenario by name (./glider list) or path of its YAML file.')
]
Controller = choices(ControlLawSettings, 'law')
Law = Annotated[Controller | None, typer.Option(help="Attitude law, instead of the scenario's.")]
Workers = Annotated[
    int | None, typer.Option(min=1, max=1024, help='Processes. Default: one per processor.')
]
Scheduler = Annotated[
    str | None,
    typer.Option(
        metavar='ADDRESS',
        help='Fly on the Dask cluster with this scheduler, such as tcp://127.0.0.1:8786.',
    ),
]
Changes = Annotated[
    list[str] | None,
    typer.Option(
        '--set',
        metavar='FIELD=VALUE',
        help='Change a field of the scenario, such as current.speed_kn=0.5, or of its vehicle, '
        'such as vehicle.hydrodynamics.K_D0=8.0; can be repeated.',
    ),
]
Run = Annotated[
    Path, typer.Argument(metavar='RUN', help='Folder of a run or a bag, or an .mcap file.')
]
Recording = Annotated[
    Path,
    typer.Argument(
        metavar='FLIGHT',
        help='Folder of dbd files of a Slocum (or mbd, sbd, dcd, mcd, scd), folder of p*.nc '
        'of a Seaglider, or one p*.nc; to be navigated, NetCDF of OceanGliders (OG1) too.',
    ),
]
Cache = Annotated[
    Path | None,
    typer.Option(
        metavar='FOLDER',
        help="Caches (.cac) of a Slocum's files. Default: beside them, or in a folder cache "
        'or cac there or above.',
    ),
]
Json = Annotated[
    bool, typer.Option('--json', help='Print one JSON object and nothing else on standard output.')
]


def changed_fields(changes: list[str] | None) -> dict[str, Any]:
    """Values by dotted field name, of options ``--set``."""
    return dict(parse_assignment(text) for text in changes or ())


def beside(run: Path, name: str) -> Path:
    """File in a run's folder or, if the run is an MCAP file alone, beside it."""
    return (run if run.is_dir() else run.parent) / name


def tell(line: str) -> None:
    """Put a line on standard error."""
    messages.print(line, soft_wrap=True)


def print_table(
    title: str, headings: Iterable[str], rows: Iterable[Iterable[str]], numbers_from=99, **options
) -> None:
    """Print a table for a person on standard output; without headings it has none.

    Columns from ``numbers_from`` on are set to the right; ``options`` are those of all columns.
    """
    headings = list(headings)
    table = Table(title=title or None, title_justify='left', show_header=bool(headings))
    for place, heading in enumerate(headings):
        side = 'right' if place >= numbers_from else 'left'
        table.add_column(heading, justify=side, **options)
    for row in rows:
        table.add_row(*row)
    output.print(table)


def print_written(word: str, run: Path, file: Path, as_json: bool) -> None:
    """Say on standard output which file was made of a run."""
    if as_json:
        print(json.dumps({'run': str(run), 'file': str(file)}))
    else:
        output.print(f'{word}: {file}', soft_wrap=True)


#: Columns of progress bars, beside what is done and the bar itself; made anew for each bar.
PERCENT = partial(TextColumn, '{task.percentage:3.0f} %')
STATE = partial(TextColumn, '{task.fields[state]}')
COUNT, ELAPSED, REMAINING = MofNCompleteColumn, TimeElapsedColumn, TimeRemainingColumn


#: Progress bars that are shown now: of these there is one at a time.
_shown: list[Progress] = []


def compiling(line: str) -> Callable[[], None] | None:
    """Say that something is compiled: on a terminal by a bar with a clock, else by a line.

    Returns what takes the bar away again. Where a bar is shown already, this one stands below it.
    """
    if not messages.is_terminal:
        tell(line)
        return None
    if _shown:
        bar = _shown[-1]
        task = bar.add_task(line, total=None, state='')
        return partial(bar.remove_task, task)
    columns = TextColumn('{task.description}'), BarColumn(), ELAPSED()
    bar = Progress(*columns, console=messages, transient=True)
    bar.add_task(line, total=None)
    bar.start()
    return bar.stop


@contextmanager
def progress_bar(description: str, total: float | None, *columns: Callable[[], ProgressColumn]):
    """Progress bar, which goes when it is done; yields its update, see `rich.progress`."""
    made = [TextColumn('{task.description}'), BarColumn(), *(column() for column in columns)]
    with Progress(*made, console=messages, transient=True) as bar:
        _shown.append(bar)
        try:
            yield partial(bar.update, bar.add_task(description, total=total, state=''))
        finally:
            _shown.remove(bar)


@contextmanager
def progress(ticks: int):
    """Progress bar of a flight: simulated time, real-time factor and depth.

    Yields what is to be called in flight, with ticks and depth (m), and what while the recording
    is read back, with ticks.
    """
    start_s = perf_counter()
    with progress_bar('starting', ticks, PERCENT, STATE, ELAPSED, REMAINING) as update:

        def flying(flown: int, depth_m: float) -> None:
            factor = flown * TICK_S / (perf_counter() - start_s)
            state = f'{flown * TICK_S:,.0f} s  x{factor:,.0f}  depth {depth_m:6.1f} m'
            update(completed=min(flown, ticks), description='flying', state=state)

        def reading(read: int) -> None:
            state = 'of the recording'
            update(completed=min(read, ticks), description='scoring', state=state)

        yield flying, reading


@contextmanager
def counter(description: str, total: int | None):
    """Progress bar that counts, with the time left; yields its update, which may give a total."""
    with progress_bar(description, total, COUNT, ELAPSED, REMAINING) as update:
        yield lambda done, total=total: update(completed=done, total=total)


@contextmanager
def shares():
    """Progress bar of several pieces of work; yields its update (what, share that is done)."""
    with progress_bar('opening', 1.0, PERCENT, ELAPSED) as update:
        yield lambda what, share: update(description=what, completed=share)


@contextmanager
def interrupt_shown():
    """Ctrl-C or SIGTERM ends what is done in the block, is said, and is the exit code."""
    try:
        yield
    except KeyboardInterrupt as error:
        messages.print(stopped_by(error), style='red')
        raise typer.Exit(EXIT_INTERRUPTED) from None
