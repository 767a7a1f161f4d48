# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""``./glider sweep``: what happens over whole ranges of settings."""

import json
import shlex
from functools import partial
from pathlib import Path
from typing import Annotated

import typer

from glider_base.errors import EXIT_FAILED
from glider_bringup.console import (
    Changes,
    Json,
    Scheduler,
    Workers,
    changed_fields,
    messages,
    output,
    print_table,
)
from glider_studies.workers import workers_at_work

app = typer.Typer()
#: So many of the cells that failed are named one by one.
FAILURES_SHOWN = 5
#: Fields over which a sweep can be drawn as a map.
MAPPED = {'current.speed_kn', 'current.angle_deg'}


@app.command(epilog='Example: ./glider sweep small --workers 2 --out sweeps/small')
def sweep(
    name: Annotated[
        str,
        typer.Argument(
            metavar='SWEEP', help='Sweep by name (./glider list) or path of its YAML file.'
        ),
    ],
    workers: Workers = None,
    scheduler: Scheduler = None,
    out: Annotated[
        Path | None, typer.Option(help='Folder of journal and result. Default: sweeps/<name>.')
    ] = None,
    changes: Changes = None,
    resume: Annotated[
        bool, typer.Option('--resume', help='Go on where an interrupted sweep has stopped.')
    ] = False,
    as_json: Json = False,
) -> None:
    """Fly every combination of the values in a sweep file; write one NetCDF file.

    Each cell has the numbers that ./glider run gives for it. The file is the same to the last byte
    whatever the number of workers and of interruptions. Exit code 1 if a cell failed.
    """
    from glider_studies.sweep import fly as study
    from glider_studies.sweep.plan import load_sweep

    with messages.status('checking every value of the sweep'):
        plan = load_sweep(name, changed_fields(changes))
    folder = out or Path('sweeps') / plan.sweep.name
    product = ' x '.join(f'{len(axis.values)} {axis.name}' for axis in plan.axes)
    messages.print(f'{plan.sweep.name}: {product} = {plan.cells} cells', soft_wrap=True)
    words = ['./glider', 'sweep', name, '--out', str(folder), '--resume']
    words += [word for text in changes or () for word in ('--set', text)]
    words += ['--scheduler', scheduler] if scheduler else []

    def advice() -> str:
        flown = sum(study.flown_cells(plan, journal))
        return f'; {flown} of {plan.cells} cells are kept, go on with\n  {shlex.join(words)}'

    with study.open_journal(plan, folder, resume) as journal:
        known = study.flown_cells(plan, journal)
        if not all(known):
            waits = partial(messages.print, 'no worker is connected: waiting for one')
            loops = plan.loops()
            with workers_at_work(workers, scheduler, loops, plan.cells, advice) as (pool, update):
                study.fly_sweep(plan, journal, known, pool, update, waits)
        with messages.status('writing the result'):
            summary = study.write_result(plan, journal, folder / study.RESULT_FILE)
            failures = study.failures(plan, journal)
    if as_json:
        print(json.dumps({**summary, 'failures': failures}))
    else:
        counts = {name: f'{n:,}' for name, n in summary.items() if name not in ('sweep', 'file')}
        print_table(summary['sweep'], (), counts.items())
        output.print(f'result: {summary["file"]}', soft_wrap=True)
        if MAPPED <= {axis.field for axis in plan.axes}:
            messages.print(f'draw it: {shlex.join(["./glider", "map", summary["file"]])}')
    for failure in failures[:FAILURES_SHOWN]:
        messages.print(f'failed: {failure["reason"]}\n  {failure["command"]}', soft_wrap=True)
    if len(failures) > FAILURES_SHOWN:
        messages.print(f'and {len(failures) - FAILURES_SHOWN} more, see "reason" in the result')
    if failures:
        raise typer.Exit(EXIT_FAILED)
