# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""``./glider trim``: the steady glide of a vehicle."""

import json
import math
from dataclasses import asdict
from typing import Annotated

import typer

from glider_base.errors import EXIT_FAILED
from glider_base.settings import ConfigurationError
from glider_bringup.console import Json, changed_fields, messages, print_table
from glider_mission.changes import split_changes
from glider_model.plant.trim import solve_trim
from glider_model.vehicle.file import changed_vehicle, load_vehicle
from glider_model.vehicle.sections import LIFT_AND_DRAG

app = typer.Typer()


@app.command(epilog='Example: ./glider trim zhang2021 --net-heaviness-kg 0.4 --pitch-deg -30')
def trim(
    vehicle: Annotated[str, typer.Argument(help='Vehicle by name or path of its YAML file.')],
    net_heaviness_kg: Annotated[float, typer.Option(help='Net buoyancy, + sinks (kg).')],
    pitch_deg: Annotated[float | None, typer.Option(help='Pitch, + nose up (deg).')] = None,
    pitch_mass_m: Annotated[
        float | None, typer.Option(help='Pitch mass from its neutral position (m).')
    ] = None,
    roll_mass_deg: Annotated[float, typer.Option(help='Roll mass, + to starboard (deg).')] = 0.0,
    fin_deg: Annotated[
        float,
        typer.Option(help='Tail fin, or other steering surface, + to starboard (deg).'),
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
    params = changed.params()
    solution = solve_trim(
        params, net_heaviness_kg, pitch_deg, pitch_mass_m, roll_mass_deg, fin_deg
    )
    of_vehicle = {
        'steering': changed.steering_rates._asdict(),
        'coefficients': {name: getattr(params, name) for name in LIFT_AND_DRAG},
    }
    numbers = asdict(solution)
    turn, sine = solution.turn_rate_radps, math.sin(math.radians(solution.fin_deg))
    if turn and sine and not solution.roll_mass_deg:
        numbers['fin_turn_rate'] = turn / (sine * solution.speed_mps**2)
    if as_json:
        print(json.dumps(numbers | of_vehicle))
    else:
        _print_trim(vehicle, numbers, of_vehicle)
    if not solution.converged:
        messages.print("no steady state found within the vehicle's ranges", style='red')
        raise typer.Exit(EXIT_FAILED)


def _print_trim(vehicle: str, rows: dict, of_vehicle: dict[str, dict[str, float]]) -> None:
    """Print a solution, and what follows from the vehicle's file whatever the glide."""
    for group, numbers in of_vehicle.items():
        rows |= {f'{group} {name}': number for name, number in numbers.items()}
    texts = (
        'straight' if value is None else f'{value:.5g}' if isinstance(value, float) else str(value)
        for value in rows.values()
    )
    print_table(vehicle, (), zip(rows, texts, strict=True))
