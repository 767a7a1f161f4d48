# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""``./glider montecarlo``: many plants that differ from their vehicle file."""

import json
from pathlib import Path
from typing import Annotated

import typer

from glider_base.errors import EXIT_FAILED
from glider_base.signals import TICK_S
from glider_bringup.console import (
    Changes,
    Controller,
    Json,
    Named,
    Scheduler,
    Workers,
    changed_fields,
    messages,
    output,
    picked,
    print_table,
    repeatable,
)
from glider_mission.disk import write_whole
from glider_mission.scenario import DEFAULT_SCENARIO
from glider_studies.workers import workers_at_work

app = typer.Typer()
#: No figure but the worst is not exceeded by 95 % of fewer flights than these.
FEW = 20


@app.command(epilog='Example: ./glider montecarlo current_12deg --plants 200 --seed 1000')
def montecarlo(
    scenario: Named = DEFAULT_SCENARIO,
    plants: Annotated[int, typer.Option(min=1, max=1_000_000, help='Number of plants.')] = 100,
    seed: Annotated[
        int, typer.Option(min=0, max=2**62, help='Plant i is drawn from seed + i.')
    ] = 0,
    controller: Annotated[
        list[repeatable(Controller)] | None,
        typer.Option(help='Attitude law; can be repeated. Default: all of them.'),
    ] = None,
    faults: Annotated[
        int, typer.Option(min=0, max=20, help='Faults drawn for each plant from its seed.')
    ] = 0,
    duration: Annotated[
        str,
        typer.Option(metavar='S|full', help="Simulated seconds, or the scenario's full duration."),
    ] = 'full',
    workers: Workers = None,
    scheduler: Scheduler = None,
    changes: Changes = None,
    out: Annotated[
        Path | None, typer.Option(help='Folder for montecarlo.json, which tells of every plant.')
    ] = None,
    as_json: Json = False,
) -> None:
    """Fly many plants that differ from their vehicle file, with noise, by the direct engine.

    Each hydrodynamic coefficient differs by up to 30 %, added mass by 15 %, trim by 10 mm, roll at
    rest by 10 deg, ballast by 50 g; water is stratified. Control knows the file only. Where the
    vehicle reckons (navigation.method), its compass, pitch, depth and fixes are off too.
    With --faults each plant breaks too. Percentiles are of the flights that were flown to their
    end; those that surfaced for good, were lost or failed are counted. Of less than 20 flights
    p95 is the worst. Exit code 1 if a flight failed.
    """
    from glider_mission.choices import number
    from glider_mission.run_folder import make_result_folder
    from glider_studies import montecarlo as study

    fields = changed_fields(changes)
    if duration != 'full':
        fields['duration_s'] = number('--duration ', duration, 'full', TICK_S, 1e8)
    laws = picked(controller, Controller)
    scenarios = study.make_scenarios(scenario, fields, laws, plants, seed, faults)
    if out:
        make_result_folder(out, study.RESULT_FILE)
    messages.print(f'{scenario}: {plants} plants, each by {" and by ".join(laws)}')
    flown = scenarios.values()
    with workers_at_work(workers, scheduler, flown, len(scenarios)) as (pool, update):
        flights, airframes = study.fly_plants(scenarios, pool, update)
    whole = study.report(scenario, fields, seed, faults, flights, airframes)
    if as_json:
        print(json.dumps({name: value for name, value in whole.items() if name != 'flown'}))
    else:
        _print_study(whole)
    if out:  # last: a disk that is full must not take what was flown
        write_whole(out / study.RESULT_FILE, json.dumps(whole, indent=2) + '\n')
    if any('failed' in row['outcomes'] for row in whole['rows']):
        raise typer.Exit(EXIT_FAILED)


def _print_study(study: dict) -> None:
    """Print the result of a Monte Carlo study for a person."""
    from glider_bringup.scoring.scores import studied

    def show(figure: dict | float | None) -> str:
        figures = figure.values() if isinstance(figure, dict) else [figure]
        return ' / '.join('-' if x is None else f'{x:,.3f}' for x in figures)

    rows = study['rows']
    navigation = [row['navigation'] for row in rows]
    lines = {
        'flown to their end': [str(row['flown_to_end']) for row in rows],
        'diverged': [str(row['diverged']) for row in rows],
        **{label: [show(row[key]) for row in rows] for key, label in studied()},
    }
    if any(one['ellipse_95_share'] is not None for one in navigation):
        lines |= {
            'surfacings': [f'{one["surfacings"]:,}' for one in navigation],
            'position error, from the 4th (m)': [show(one['error_m']) for one in navigation],
            'cross-track, from the 4th (m)': [show(one['cross_track_m']) for one in navigation],
            'inside the 95 % ellipse': [show(one['ellipse_95_share']) for one in navigation],
            'innovation squared': [show(one['innovation_squared']) for one in navigation],
        }
    lines |= {
        'plants statically unstable': [str(row['statically_unstable']) for row in rows],
        'plants that steer weakly': [str(row['weak_steering']) for row in rows],
        'worst': [f'plant {row["worst_plant"]}' for row in rows],
    }
    for name in sorted({name for row in rows for name in row['outcomes']}):
        lines[name] = [str(row['outcomes'].get(name, 0)) for row in rows]
    print_table(
        f'{study["scenario"]}, {study["plants"]} plants from seed {study["seed"]}',
        ['p50 / p95 / worst', *(row['controller'] for row in rows)],
        [[name, *texts] for name, texts in lines.items()],
    )
    if min(row['flown_to_end'] for row in rows) < FEW:
        output.print(f'p95 of less than {FEW} flights is the worst of them')
    for row in rows:
        worst = study['flown'][row['worst_plant']]['commands'][row['controller']]
        output.print(f'worst of {row["controller"]}:', worst, soft_wrap=True)
