# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""``./glider map``: where over speed and angle of the current a path is held."""

import json
from pathlib import Path
from typing import Annotated, Literal

import typer

from glider_bringup.console import Json, messages, output, print_table

app = typer.Typer()


@app.command('map', epilog='Example: ./glider map sweeps/stability_map/sweep.nc --out map.png')
def draw(
    file: Annotated[
        Path, typer.Argument(metavar='FILE', help='Result of a sweep over speed and angle.')
    ],
    out: Annotated[
        Path | None, typer.Option(help='Image file: png, svg or pdf. Default: FILE with .png.')
    ] = None,
    by: Annotated[
        Literal['steady', 'surfacing'],
        typer.Option(
            help='What a cell is judged by: the steady cross-track error, or that at '
            'surfacings, from the fourth on.'
        ),
    ] = 'steady',
    as_json: Json = False,
) -> None:
    """Draw in which currents a path is held, and the limit of physics; print the shares.

    FILE is the result of ./glider sweep over current.speed_kn, current.angle_deg and at most one
    more dimension, such as stability_map, or reckoned_map by surfacing.
    """
    from glider_studies.showing import stability_map as study

    stability = study.load_map(file, by)
    image = out or file.with_suffix('.png')
    with messages.status('drawing'):
        study.draw_map(stability, image)
    rows = study.shares(stability)
    if as_json:
        print(json.dumps({'image': str(image), 'panels': rows}))
        return
    headings = ['share of the cells', *(row['panel'] or 'flights' for row in rows)]
    lines = (
        [name.replace('_', ' '), *(_share(name, row[name]) for row in rows)]
        for name in rows[0]
        if name != 'panel'
    )
    print_table(stability.title, headings, lines)
    output.print(f'drawn: {image}', soft_wrap=True)


def _share(name: str, value: float | None) -> str:
    """Text of a row: a share, a number of cells, a speed, or a dash where there is none."""
    if value is None:
        return '-'
    forms = {'cells': '{}', 'horizontal_kn': '{:.2f}'}
    return forms.get(name, '{:.1%}').format(value)
