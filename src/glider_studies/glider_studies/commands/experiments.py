# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""``./glider experiments``: the paper's figures, and what goes beyond them."""

import json
from pathlib import Path
from typing import Annotated, Literal

import typer

from glider_base.errors import EXIT_FAILED
from glider_bringup.console import Json, Scheduler, Workers, messages, output, picked, repeatable
from glider_mission.disk import write_whole
from glider_studies.workers import workers_at_work

app = typer.Typer()
GROUPS = (
    *('current', 'yaw', 'profile', 'robustness', 'ablation', 'vehicles', 'paths', 'envelope'),
    *('navigation', 'faults', 'random_faults', 'routes', 'forecasts', 'bottoms'),
)
Group = Literal[GROUPS]


@app.command(epilog='Example: ./glider experiments --only robustness --only paths')
def experiments(
    only: Annotated[
        list[repeatable(Group)] | None,
        typer.Option(help='Group; can be repeated. Default: all of them.'),
    ] = None,
    flights: Annotated[
        int, typer.Option(min=1, max=1_000_000, help='Missions of random_faults.')
    ] = 200,
    seed: Annotated[
        int,
        typer.Option(
            min=0, max=2**31 - 1, help='Seed of the missions, seas and bottoms that are drawn.'
        ),
    ] = 0,
    workers: Workers = None,
    scheduler: Scheduler = None,
    out: Annotated[
        Path | None, typer.Option(help='Folder for experiments.json and the figures.')
    ] = None,
    as_json: Json = False,
) -> None:
    """Fly the experiments of the paper and what goes beyond them; exit code 1 if one fails.

    By the adaptive law, by the tuned PID, and along the paper's line of sight, with the direct
    engine; the flights of the paper last 30 hours. ablation turns off one piece of the law after
    another, and asks of each whether it earns its place. random_faults breaks random missions in
    two or three random ways, and judges them by their true motion alone. routes crosses twelve
    seas full of eddies by straight legs and along planned routes; forecasts reckons its way
    through four by forecasts that err; bottoms flies over 200 bottoms with hills.
    """
    from glider_mission.run_folder import make_result_folder
    from glider_studies import bottoms, forecasts, routes
    from glider_studies.hunt import search
    from glider_studies.paper import experiments as paper
    from glider_studies.paper import tables
    from glider_studies.showing import paper_figures

    groups = picked(only, Group)
    planned = paper.make_experiments(groups)
    if search.NAME in groups:
        planned.append(search.experiment(seed, flights))
    planned += [one.experiment(seed) for one in (routes, forecasts, bottoms) if one.NAME in groups]
    total = paper.count_flights(planned)
    if out:
        make_result_folder(out, paper.RESULT_FILE)
    what = 'flights and plans' if routes.NAME in groups else 'flights'
    messages.print(f'{len(planned)} experiments, {total} {what}')
    with workers_at_work(workers, scheduler, paper.scenarios(planned), total) as (pool, update):
        rows, records = paper.fly(planned, pool, update)
    result = paper.report(planned, rows)
    for entry, counts in zip(result['experiments'], records, strict=True):
        if isinstance(counts, dict) and counts:
            entry['counts'] = counts
            result |= counts
    if as_json:
        print(json.dumps(result))
    else:
        tables.show(result, output)
    if out:  # last: a disk that is full must not take what was flown
        write_whole(out / paper.RESULT_FILE, json.dumps(result, indent=2) + '\n')
        with messages.status('drawing'):
            drawn = paper_figures.draw(planned, rows, records, out)
        for file in drawn:
            messages.print(f'drawn: {file}', soft_wrap=True)
    if any(one['verdict'] == paper.FAILED for one in result['experiments']):
        raise typer.Exit(EXIT_FAILED)
