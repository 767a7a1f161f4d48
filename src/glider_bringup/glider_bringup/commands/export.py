# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""``./glider export``: runs for other programs."""

from pathlib import Path
from typing import Annotated, Literal

import typer

from glider_base.errors import ConfigurationError
from glider_bringup.console import Json, Run, beside, counter, messages, print_written
from glider_bringup.showing.scorecard import tell_stopped
from glider_mission.disk import write_whole

app = typer.Typer()
#: Kinds of files, and how they end; that of a Slocum is a folder.
SUFFIXES = {
    'netcdf': '.nc',
    'csv': '.csv',
    'mat': '.mat',
    'og1': '.og1.nc',
    'geojson': '.geojson',
    'kml': '.kml',
    'gpx': '.gpx',
    'slocum': '_mafiles',
}
Kind = Literal[tuple(SUFFIXES)]


@app.command(epilog='Example: ./glider export runs/20260101-120000-current_8deg --to mat')
def export(
    run: Run,
    to: Annotated[
        Kind,
        typer.Option(
            help='netcdf: for xarray and other readers of NetCDF 3; csv: one row a tick; mat: '
            'structs for MATLAB and Octave; og1: what it measured, in the format of OceanGliders; '
            'geojson, kml, gpx: tracks, waypoints and surfacings on a chart; slocum: a folder '
            "with its mission, as a Slocum's goto_l10.ma, yo10.ma and surfac10.ma."
        ),
    ],
    out: Annotated[
        Path | None,
        typer.Option(
            metavar='FILE', help='Default: run.nc, run.csv, run_mafiles ... beside the bag.'
        ),
    ] = None,
    start: Annotated[
        str | None,
        typer.Option(
            metavar='TIME',
            help='When it started (UTC, as 2026-03-01T06:00), of a run without origin.time; for '
            'netcdf, og1, geojson, kml and gpx.',
        ),
    ] = None,
    as_json: Json = False,
) -> None:
    """Write a run for other programs.

    netcdf, csv and mat have every number of its bag, with names and units: world NED, body FRD, SI
    and radians, whatever the topics carry; docs/python.md has the names.
    """
    if start is not None and to in ('csv', 'mat', 'slocum'):
        raise ConfigurationError(
            f'--start {start}: not of {to}, which has no dates (allowed: netcdf, og1, geojson, '
            'kml, gpx)'
        )
    file = out or beside(run, f'run{SUFFIXES[to]}')
    if to == 'og1':
        from glider_bringup.door.og1 import write_og1

        with counter('reading the bag', None) as update:
            card = write_og1(run, start, file, update)
    elif to == 'slocum':
        from glider_bringup.door.tracks import write_mafiles
        from glider_bringup.showing.flown_run import read_run

        flown = read_run(run, traced=False)
        write_mafiles(flown, file)
        card = flown.card
    elif to in ('geojson', 'kml', 'gpx'):
        from glider_bringup.door.tracks import CHARTS, chart_of, start_of
        from glider_bringup.showing.flown_run import read_run

        with counter('reading', None) as update:
            flown = read_run(run, update)
        write_whole(file, CHARTS[to](chart_of(flown, start_of(flown.scenario, start))))
        card = flown.card
    else:
        card = _write_all(run, to, file, start)
    tell_stopped(card)
    print_written('written', run, file, as_json)


def _write_all(run: Path, kind: str, file: Path, start: str | None) -> dict:
    """Write every number of a run; its scorecard."""
    from glider_bringup.door.export import WRITERS, dataset_of
    from glider_bringup.door.run import open_run
    from glider_bringup.door.tracks import start_of

    with messages.status('reading the bag'):
        flown = open_run(run)
        began_s = start_of(flown.scenario, start) if kind == 'netcdf' else None
        dataset = dataset_of(flown, began_s)
    with counter('writing', dataset.sizes['time']) as update:
        WRITERS[kind](dataset, file, update)
    return flown.score
