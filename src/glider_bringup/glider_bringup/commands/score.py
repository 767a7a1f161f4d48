# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""``./glider score``: how good a run was."""

import json

import typer

from glider_bringup.console import Json, Run, counter
from glider_bringup.showing.scorecard import print_card

app = typer.Typer()


@app.command(epilog='Example: ./glider score runs/20260101-120000-current_8deg --json')
def score(run: Run, as_json: Json = False) -> None:
    """Score a run again, from its bag; a run without a bag shows the score it was given."""
    from glider_bringup.scoring.again import score_again

    with counter('reading the bag', None) as update:
        card = score_again(run, update)
    if as_json:
        print(json.dumps(card, allow_nan=False))
    else:
        print_card(card, run)
