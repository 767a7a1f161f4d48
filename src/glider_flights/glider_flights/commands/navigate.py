# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""``./glider navigate``: our navigation over a recorded flight of a real glider."""

import json
import math
from datetime import datetime, timezone
from pathlib import Path
from typing import Annotated

import numpy as np
import typer
from rich.box import SIMPLE_HEAD
from rich.table import Table

from glider_bringup.console import Cache, Json, Recording, counter, output, print_table

app = typer.Typer()
#: Characters of the name of a file in the table: its end tells files of a flight apart.
MAX_NAME = 12
#: What the rows of the small table say.
MEANING = {
    'none': 'no current',
    'persistence': 'the last current',
    'ours': 'our navigation',
    'on_board': "the vehicle's own estimate",
}


@app.command(epilog='Example: ./glider navigate flights/delayed/raw --cache flights/cache')
def navigate(
    flight: Recording,
    method: Annotated[
        str, typer.Option(help='Navigation method, as a scenario has it under navigation.')
    ] = 'dead_reckoned',
    cache: Cache = None,
    as_json: Json = False,
) -> None:
    """Navigate a recorded flight of a real glider; compare with what it made of it itself.

    The kernel of navigation_node makes of the recorded samples the depth-averaged current, the way
    through the water, and where it would surface next.
    """
    from glider_flights.navigation import navigate as navigated
    from glider_flights.navigation import summary
    from glider_flights.reading import read_flight

    with counter('reading', None) as update:
        found = read_flight(flight, cache, update)
    with counter('navigating', 2 * len(found.segments)) as update:
        rows = navigated(found, update, method)
    report = summary(found, rows, method)
    if as_json:
        print(json.dumps({'flight': str(flight), **report}))
        return
    output.print(_segments_table(found, rows))
    _print_figures(report)
    for note in report['notes']:
        output.print(note, soft_wrap=True)


def _segments_table(flight, rows) -> Table:
    begin, end = (
        datetime.fromtimestamp(one, timezone.utc) for one in (rows[0].dived_s, rows[-1].surfaced_s)
    )
    title = (
        f'{flight.kind.capitalize()}, {len(flight.files)} files, {begin:%Y-%m-%d %H:%M} to '
        f'{end:%Y-%m-%d %H:%M} UTC\n'
        'Mean current of the dive to north, east in cm/s: ours, on board, how far off\n'
        'Surfaced so far off the forecast, in m: with the last current, with ours'
    )
    table = Table(title=title, title_justify='left', box=SIMPLE_HEAD, padding=0)
    table.add_column('dive', no_wrap=True)
    for name in ('h', 'depth', 'way', 'current', 'on board', 'off', 'last', 'ours'):
        table.add_column(name, justify='right', no_wrap=True)
    for row in rows:
        own, other = row.comparable_mps, row.segment.on_board.dac_mps
        name = Path(row.segment.name).stem
        table.add_row(
            name if len(name) <= MAX_NAME else f'…{name[1 - MAX_NAME :]}',
            f'{row.seconds / 3600.0:.1f}',
            f'{row.segment.samples.depth_m.max():.0f}',
            f'{np.hypot(*row.way_m):.0f}',
            _current(own),
            _current(other),
            _number(float(np.hypot(*(own - other))), 1, 100.0),
            _number(row.missed_m['persistence'], 0),
            _number(row.missed_m['ours'], 0),
        )
    return table


def _current(mps: np.ndarray) -> str:
    return '-' if np.isnan(mps).any() else f'{100.0 * mps[0]:.1f}, {100.0 * mps[1]:.1f}'


def _number(value: float | None, digits: int, scale: float = 1.0) -> str:
    known = value is not None and math.isfinite(value)
    return f'{scale * value:,.{digits}f}' if known else '-'


def _print_figures(report: dict) -> None:
    title = f'{report["segments"]} dives, {report["under_water_s"] / 3600.0:.1f} h under water'
    over = report['on_board_current_is_mean']
    lines = [
        (f'current off that on board (cm/s; {over})', report['dac_difference_mps'], 100.0, 2),
        ('current reported less that by its dive (cm/s)', report['told_difference_mps'], 100.0, 2),
        ('way through the water off (m)', report['way_difference_m'], 1.0, 0),
        ('the same over that on board (%)', report['way_ratio'], 100.0, 1),
    ]
    for name, spread in report['prediction_m'].items():
        lines.append((f'surfaced off (m): {MEANING[name]}', spread, 1.0, 0))
    rows = [
        [
            text,
            *(_number(spread[key], digits, scale) for key in ('median', 'p90')),
            str(spread['segments']),
        ]
        for text, spread, scale, digits in lines
    ]
    print_table(title, ('', 'median', '9 of 10', 'dives'), rows, numbers_from=1)
