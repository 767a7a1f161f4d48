# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""``./glider figure``: a run as an image."""

from pathlib import Path
from typing import Annotated

import typer

from glider_bringup.console import Json, Run, beside, counter, print_written
from glider_bringup.showing.scorecard import tell_stopped

app = typer.Typer()


@app.command(epilog='Example: ./glider figure runs/20260101-120000-current_8deg --out run.png')
def figure(
    run: Run,
    out: Annotated[
        Path | None,
        typer.Option(help='Image file: png, svg or pdf. Default: run.png beside the bag.'),
    ] = None,
    as_json: Json = False,
) -> None:
    """Draw a run: track, depth, errors, attitude, current and actuators."""
    from glider_bringup.showing.figure import draw_run
    from glider_bringup.showing.flown_run import read_run

    file = out or beside(run, 'run.png')
    with counter('reading the bag', None) as update:
        flown = read_run(run, update)
        draw_run(flown, file)
    tell_stopped(flown.card)
    print_written('drawn', run, file, as_json)
