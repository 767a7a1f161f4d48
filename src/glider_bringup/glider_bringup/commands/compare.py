# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""``./glider compare``: runs side by side."""

import json
from pathlib import Path
from typing import Annotated

import typer

from glider_base.settings import ConfigurationError
from glider_bringup.console import Json, counter, messages, output, print_table
from glider_mission.disk import write_whole

app = typer.Typer()


@app.command(epilog='Example: ./glider compare runs/adaptive runs/pid --out compared.html')
def compare(
    paths: Annotated[
        list[Path],
        typer.Argument(metavar='RUN RUN ...', help='Two or more runs: folders, or .mcap files.'),
    ],
    out: Annotated[
        Path | None,
        typer.Option(metavar='FILE', help='HTML page with the curves over each other.'),
    ] = None,
    as_json: Json = False,
) -> None:
    """Compare runs: scores side by side, and what their scenarios differ in."""
    from glider_bringup.showing import compare as compared
    from glider_bringup.showing.flown_run import read_run

    if len(paths) < 2:
        raise ConfigurationError(f'{paths[0]}: one run only (allowed: two or more)')
    names, runs = compared.labels(paths), []
    for path, name in zip(paths, names, strict=True):
        with counter(f'reading {name}', None) as update:
            flown = read_run(path, update, traced=out is not None)
        runs.append(flown._replace(label=name))
    cards, found = [run.card for run in runs], compared.differences(runs)
    if out:
        with messages.status('writing the page'):
            write_whole(out, compared.compare_page(runs))
        messages.print(f'page: {out}', soft_wrap=True)
    if as_json:
        each = zip(names, paths, cards, strict=True)
        scores = [{'run': name, 'folder': str(one), 'score': card} for name, one, card in each]
        print(json.dumps({'runs': scores, 'differences': found}))
        return
    headings = ['', *names]
    print_table('', headings, _marked(compared.score_rows(cards)), overflow='fold')
    output.print(compared.HOW_TO_READ.format(mark='*'), soft_wrap=True)
    for text in compared.caveats(cards):
        output.print(text, soft_wrap=True)
    if compared.are_equal(cards):
        output.print(compared.EQUAL)
    if found:
        rows = compared.difference_rows(found)
        print_table('what the scenarios differ in', headings, rows, overflow='fold')
    else:
        output.print('scenarios and vehicles are the same')


def _marked(rows: list) -> list[list[str]]:
    """Lines of scores as text: value, difference from the first run, mark of the better one."""

    def text(cell) -> str:
        change = f' ({cell.change})' if cell.change else ''
        return f'{cell.text}{change}{" *" if cell.better else ""}'

    return [[name, *map(text, cells)] for name, cells in rows]
