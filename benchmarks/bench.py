# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""``./glider bench``: how fast the stack is, as ratios to baselines measured in the same run.

A section is a module of this folder with

    measure(progress) -> dict     figures by name; None where one cannot be measured here
    MEANING                       what each of them says, by name

``progress(text)`` tells the person what is being measured. Names carry units and belong to one
section only: ``--json`` prints all figures in one flat object.
"""

import importlib
import json
import os
import platform
import re
import sys
from pathlib import Path
from typing import Annotated, Literal

import typer
from rich.table import Table

from glider_base.errors import EXIT_FAILED, EXIT_INTERRUPTED
from glider_bringup.console import Json, messages, output, picked, repeatable

#: Modules of this folder, in the order in which they are measured.
SECTIONS = ('compute', 'memory', 'nodes', 'nodes_memory', 'sweep', 'against')

Section = Literal[SECTIONS]

app = typer.Typer(add_completion=False, pretty_exceptions_enable=False)


@app.command(
    epilog='Example: ./glider bench --only compute --json',
    context_settings={'help_option_names': ['-h', '--help']},
)
def bench(
    only: Annotated[
        list[repeatable(Section)] | None,
        typer.Option(
            help='Section; can be repeated. Default: all of them (against: with --against only).'
        ),
    ] = None,
    against: Annotated[
        Path | None,
        typer.Option(
            file_okay=False,
            exists=True,
            help='Another checkout: the section against flies the same by both, by turns.',
        ),
    ] = None,
    as_json: Json = False,
) -> None:
    """Measure how fast this machine flies.

    Every time stands beside its ratio to a baseline, measured in the same run: what the
    same work costs without this stack. Use an idle machine.
    """
    if against and not (against / 'glider').is_file():
        raise typer.BadParameter(
            f'{against} has no file glider (allowed: the folder of another checkout)',
            param_hint="'--against'",
        )
    names = [name for name in picked(only, Section) if only or against or name != 'against']
    if only and ('against' in names) != bool(against):
        raise typer.BadParameter(
            'neither without the other (allowed: --only against --against DIR)',
            param_hint="'--only against' / '--against'",
        )
    figures, options = machine(), {'against': {'checkout': against}}
    for name in names:
        section = importlib.import_module(name)
        with messages.status(name) as status:

            def progress(text: str, name=name, status=status) -> None:
                status.update(f'{name}: {text}')
                if not messages.is_terminal:
                    messages.print(f'{name}: {text}')

            measured = section.measure(progress, **options.get(name, {}))
        figures |= measured
        if not as_json:
            output.print(make_table(name, measured, section.MEANING))
    if as_json:
        print(json.dumps(figures))


def machine() -> dict:
    """What the figures were measured on."""
    text = Path('/proc/cpuinfo').read_text(encoding='utf-8')
    model = re.search(r'^model name\s*:\s*(.*)$', text, re.MULTILINE)
    return {
        'processor': model[1] if model else platform.machine(),
        'processors': len(os.sched_getaffinity(0)),
        'load_average': os.getloadavg()[0],
        'python': platform.python_version(),
    }


def make_table(title: str, figures: dict, meaning: dict[str, str]) -> Table:
    """Figures of a section for a person."""
    table = Table(title=title, title_justify='left', show_header=False)
    table.add_column(justify='left')
    table.add_column(justify='right')
    for name, value in figures.items():
        shown = f'{value:,.4g}' if isinstance(value, float) else '-' if value is None else value
        table.add_row(name, str(shown), meaning[name])
    return table


if __name__ == '__main__':
    try:
        app(prog_name='./glider bench')
    except RuntimeError as error:
        messages.print(str(error), style='red')
        sys.exit(EXIT_FAILED)
    except KeyboardInterrupt:
        messages.print('stopped by SIGINT', style='red')
        sys.exit(EXIT_INTERRUPTED)
