# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""``./glider trim`` and ``./glider list``: vehicles, scenarios and sweeps."""

import json
from dataclasses import asdict
from typing import Annotated

import typer
from rich.table import Table

from glider_bringup.console import Json, changed_fields, messages, output
from glider_bringup.door.studies import scenarios, vehicles
from glider_bringup.mission.scenario import split_changes
from glider_bringup.studies.sweep.plan import read_sweep, sweep_names
from glider_model.base.exits import EXIT_FAILED
from glider_model.base.settings import ConfigurationError
from glider_model.plant.trim import Trim, solve_trim
from glider_model.vehicle.file import changed_vehicle, load_vehicle

app = typer.Typer()


@app.command(epilog='Example: ./glider trim zhang2021 --net-heaviness-kg 0.4 --pitch-deg -30')
def trim(
    vehicle: Annotated[str, typer.Argument(help='Vehicle by name or path of its YAML file.')],
    net_heaviness_kg: Annotated[
        float, typer.Option('--net-heaviness-kg', help='Net heaviness, + sinks (kg).')
    ],
    pitch_deg: Annotated[
        float | None, typer.Option('--pitch-deg', help='Pitch, + nose up (deg).')
    ] = None,
    pitch_mass_m: Annotated[
        float | None,
        typer.Option('--pitch-mass-m', help='Pitch mass from its neutral position (m).'),
    ] = None,
    roll_mass_deg: Annotated[
        float, typer.Option('--roll-mass-deg', help='Roll mass, + to starboard (deg).')
    ] = 0.0,
    changes: Annotated[
        list[str] | None,
        typer.Option(
            '--set',
            metavar='FIELD=VALUE',
            help='Change a field of the vehicle, such as vehicle.hydrodynamics.K_D0=8.0; can be '
            'repeated.',
        ),
    ] = None,
    as_json: Json = False,
) -> None:
    """Solve the steady glide or spiral of a vehicle."""
    others, fields = split_changes(changed_fields(changes))
    if others:
        raise ConfigurationError(
            f'--set {next(iter(others))}: not a field of a vehicle (allowed: vehicle.*)'
        )
    changed = load_vehicle(changed_vehicle(vehicle, fields))
    solution = solve_trim(
        changed.params(), net_heaviness_kg, pitch_deg, pitch_mass_m, roll_mass_deg
    )
    values = asdict(solution)
    if as_json:
        print(json.dumps(values))
    else:
        _print_trim(vehicle, solution)
    if not solution.converged:
        messages.print("no steady state found within the vehicle's ranges", style='red')
        raise typer.Exit(EXIT_FAILED)


def _print_trim(vehicle: str, solution: Trim) -> None:
    table = Table(title=vehicle, show_header=False, title_justify='left')
    for name, value in asdict(solution).items():
        if value is None:
            value = 'straight'
        table.add_row(name, f'{value:.5g}' if isinstance(value, float) else str(value))
    output.print(table)


@app.command('list', epilog='Example: ./glider list --json')
def list_all(as_json: Json = False) -> None:
    """List the scenarios, vehicles and sweeps that come with the stack."""
    listed = {
        'scenarios': scenarios(),
        'vehicles': vehicles(),
        'sweeps': {name: read_sweep(name).description for name in sweep_names()},
    }
    if as_json:
        print(json.dumps(listed))
        return
    for title, entries in listed.items():
        table = Table(title=title.capitalize(), show_header=False, title_justify='left')
        for name, description in entries.items():
            table.add_row(name, description)
        output.print(table)


@app.command(epilog='Example: ./glider test')
def test() -> None:
    """Run all tests: each package's, then those of the whole system."""
    raise ConfigurationError('test: run it through the ./glider script of the workspace')


@app.command(epilog='Example: ./glider python my_study.py')
def python() -> None:
    """Run Python with the stack in it: a program, -m MODULE, or an interpreter."""
    raise ConfigurationError('python: run it through the ./glider script of the workspace')


@app.command(epilog='Example: ./glider jupyter lab examples/first_flight.ipynb')
def jupyter() -> None:
    """Run Jupyter with the stack in it, once it is installed there."""
    raise ConfigurationError('jupyter: run it through the ./glider script of the workspace')


@app.command(epilog='Example: ./glider bench --only compute --json')
def bench() -> None:
    """Measure how fast this machine flies, as ratios to floors measured in the same run."""
    raise ConfigurationError('bench: run it through the ./glider script of the workspace')
