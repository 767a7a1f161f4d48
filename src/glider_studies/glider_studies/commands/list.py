# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""``./glider list``: scenarios, vehicles and sweeps."""

import json

import typer

from glider_bringup.console import Json, print_table
from glider_bringup.door.shipped import scenarios, vehicles
from glider_studies.sweep.plan import read_sweep, sweep_names

app = typer.Typer()


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
        print_table(title.capitalize(), (), entries.items())
