# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""``./glider export``: runs for other programs."""

from enum import Enum
from pathlib import Path
from typing import Annotated

import typer

from glider_bringup.console import Json, Run, beside, counter, messages, print_written

app = typer.Typer()
Kind = Enum('Kind', {text: text for text in ('netcdf', 'csv', 'mat')})


@app.command(epilog='Example: ./glider export runs/20260101-120000-current_8deg --to mat')
def export(
    run: Run,
    to: Annotated[
        Kind,
        typer.Option(
            help='netcdf: for xarray and other readers of NetCDF 3; csv: one row a tick; mat: '
            'structs for MATLAB and Octave.'
        ),
    ],
    out: Annotated[
        Path | None,
        typer.Option(metavar='FILE', help='Default: run.nc, run.csv or run.mat beside the bag.'),
    ] = None,
    as_json: Json = False,
) -> None:
    """Write every number of a run's bag into one file, with names and units.

    World NED, body FRD, SI and radians, whatever the topics carry; docs/python.md has the names.
    """
    from glider_bringup.door.export import SUFFIXES, WRITERS, dataset_of
    from glider_bringup.door.run import open_run

    file = out or beside(run, f'run{SUFFIXES[to.value]}')
    with messages.status('reading the bag'):
        dataset = dataset_of(open_run(run))
    with counter('writing', dataset.sizes['time']) as update:
        WRITERS[to.value](dataset, file, update)
    print_written('written', run, file, as_json)
