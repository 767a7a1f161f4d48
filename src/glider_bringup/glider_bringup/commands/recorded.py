# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""``./glider score`` and ``./glider figure``: what was recorded."""

import json
from pathlib import Path
from typing import Annotated

import typer

from glider_bringup.console import Json, Run, beside, counter, output
from glider_bringup.showing.scorecard import print_card

app = typer.Typer()


@app.command(epilog='Example: ./glider score runs/20260101-120000-current_8deg --json')
def score(
    run: Run,
    as_json: Json = False,
) -> None:
    """Score a run again, from its bag; a run without a bag shows the score it was given."""
    from glider_bringup.scoring.again import score_again

    with counter('reading the bag', None) as update:
        card = score_again(run, update)
    if as_json:
        print(json.dumps(card, allow_nan=False))
    else:
        print_card(card, run)


@app.command(epilog='Example: ./glider figure runs/20260101-120000-current_8deg --out run.png')
def figure(
    run: Run,
    out: Annotated[
        Path | None,
        typer.Option(help='Image file: png, svg or pdf. Default: run.png beside the bag.'),
    ] = None,
) -> None:
    """Draw a run: track, depth, errors, attitude, current and actuators."""
    from glider_bringup.showing.flown_run import draw

    file = out or beside(run, 'run.png')
    with counter('reading the bag', None) as update:
        draw(run, file, update)
    output.print(f'drawn: {file}', soft_wrap=True)
