# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""What the commands share: consoles, exit codes, options, progress bars."""

from collections.abc import Callable
from contextlib import contextmanager
from enum import Enum
from pathlib import Path
from typing import Annotated, get_args

import typer
from rich.console import Console
from rich.progress import (
    BarColumn,
    MofNCompleteColumn,
    Progress,
    TextColumn,
    TimeElapsedColumn,
    TimeRemainingColumn,
)
from rich.text import Text

from glider_bringup.mission.scenario import Scenario
from glider_control.settings import ControlLawSettings
from glider_model.errors import ConfigurationError, printable
from glider_model.signals import TICK_S

EXIT_FAILED, EXIT_USAGE, EXIT_INTERRUPTED = 1, 2, 130


class _PlainConsole(Console):
    """Names, descriptions and folders come from people.

    Brackets in them are no markup, and what could steer a terminal is shown, not sent.
    """

    def __init__(self, **kwargs) -> None:
        super().__init__(highlight=False, markup=False, **kwargs)

    def render_str(self, text: str, **kwargs) -> Text:
        """Text of a string, wherever in a table or line it stands."""
        return super().render_str(printable(text, keep='\n\t'), **kwargs)


# Standard output carries results only; progress and messages go to standard error.
output = _PlainConsole()
messages = _PlainConsole(stderr=True)


def choices(name: str, model, field: str) -> type[Enum]:
    """Choices of an option, from the settings field that it sets."""
    return Enum(name, {text: text for text in get_args(model.model_fields[field].annotation)})


Controller = choices('Controller', ControlLawSettings, 'law')
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
Run = Annotated[
    Path, typer.Argument(metavar='RUN', help='Folder of a run or a bag, or an .mcap file.')
]
Json = Annotated[
    bool, typer.Option('--json', help='Print one JSON object and nothing else on standard output.')
]


def beside(run: Path, name: str) -> Path:
    """File in a run's folder or, if the run is an MCAP file alone, beside it."""
    return (run if run.is_dir() else run.parent) / name


def number(option: str, text: str, word: str, low: float, high: float) -> float:
    """Number of an option that also takes a word."""
    try:
        number = float(text)
    except ValueError:
        number = float('nan')
    if not low <= number <= high:
        raise ConfigurationError(
            f'{option} {text}: not usable (allowed: {low:g} to {high:g}, or {word})'
        )
    return number


@contextmanager
def progress(scenario: Scenario, ticks: int):
    """Progress bar of a flight: simulated time, real-time factor and depth.

    Yields what is to be called in flight, with ticks and depth (m), and what while the recording
    is read back, with ticks.
    """
    bar = Progress(
        TextColumn('{task.description}'),
        BarColumn(),
        TextColumn('{task.percentage:3.0f} %'),
        TextColumn('{task.fields[state]}'),
        TimeElapsedColumn(),
        TimeRemainingColumn(),
        console=messages,
        transient=True,
    )
    task = bar.add_task('starting', total=ticks, state='')

    def flying(flown: int, depth_m: float) -> None:
        elapsed = bar.tasks[0].elapsed or 0.0
        factor = flown * TICK_S / elapsed if elapsed > 0.0 else 0.0
        bar.update(
            task,
            completed=min(flown, ticks),
            description='flying',
            state=f'{flown * TICK_S:,.0f} s  x{factor:,.0f}  depth {depth_m:6.1f} m',
        )

    def reading(read: int) -> None:
        state = 'of the recording'
        bar.update(task, completed=min(read, ticks), description='scoring', state=state)

    with bar:
        yield flying, reading


@contextmanager
def workers_at_work(
    workers: int | None, scheduler: str | None, advice: Callable[[], str] = lambda: ''
):
    """Workers that fly; yields their pool.

    What ends their work early is told, with what ``advice`` adds, and is the exit code.
    """
    from glider_bringup.pool import WorkError, worker_pool

    if workers and scheduler:
        raise ConfigurationError(
            f'--workers {workers}: not with --scheduler, whose cluster has workers of its own'
        )
    try:
        with worker_pool(workers, scheduler) as pool:
            yield pool
        return
    except KeyboardInterrupt:
        reason, code = 'stopped by SIGINT', EXIT_INTERRUPTED
    except WorkError as error:
        reason, code = str(error), EXIT_FAILED
    messages.print(reason + advice(), style='red', soft_wrap=True)
    raise typer.Exit(code)


@contextmanager
def counter(description: str, total: int | None):
    """Progress bar that counts, with the time left; yields its update, which may give a total."""
    bar = Progress(
        TextColumn('{task.description}'),
        BarColumn(),
        MofNCompleteColumn(),
        TimeElapsedColumn(),
        TimeRemainingColumn(),
        console=messages,
        transient=True,
    )
    task = bar.add_task(description, total=total)
    with bar:
        yield lambda done, total=total: bar.update(task, completed=done, total=total)


@contextmanager
def shares():
    """Progress bar of several pieces of work; yields its update (what, share that is done)."""
    bar = Progress(
        TextColumn('{task.description}'),
        BarColumn(),
        TextColumn('{task.percentage:3.0f} %'),
        TimeElapsedColumn(),
        console=messages,
        transient=True,
    )
    task = bar.add_task('opening', total=1.0)
    with bar:
        yield lambda what, share: bar.update(task, description=what, completed=share)
