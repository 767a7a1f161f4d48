# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""``./glider energy``: the ledger of a vehicle file, fitted to flights of real gliders."""

import json
from pathlib import Path
from typing import Annotated

import typer

from glider_bringup.console import Cache, Json, Recording, counter, output, print_table

app = typer.Typer()
#: What the parts of a flight are.
PARTS = {'slocum': 'half hours', 'seaglider': 'pumpings'}


@app.command(epilog='Example: ./glider energy flights/sg561 --fit-on flights/sg171')
def energy(
    flight: Recording,
    fit_on: Annotated[
        Path | None,
        typer.Option(
            metavar='FLIGHT',
            help='Another flight, whose first half is fitted. Default: that of FLIGHT itself.',
        ),
    ] = None,
    cache: Cache = None,
    as_json: Json = False,
) -> None:
    """Fit pump and hotel load to half of a recorded flight; predict the energy of the rest.

    Of a Seaglider the energy of its pump, of a Slocum all that its counter of charge counted.
    """
    from glider_flights.energy import UNITS, predict
    from glider_flights.reading import read_uses

    fitted = None
    with counter('reading', None) as update:
        uses = read_uses(flight, cache, update)
        if fit_on is not None:
            fitted = read_uses(fit_on, cache, update)
    report = predict(flight, uses, fitted)
    if as_json:
        on = str(fit_on or flight)
        print(json.dumps({'flight': str(flight), 'fitted_on': on, **report}))
        return
    parts = PARTS[report['vehicle']]
    rows = {
        f'{name}, {how}': f'{value:.4g} {UNITS[name]}'
        for how in ('fitted', 'measured')
        for name, value in report[how].items()
    }
    rows |= {
        'fitted on': f'{report["fitted_parts"]} {parts}, the first half of {fit_on or flight}',
        'recorded': f'{report["recorded_wh"]:,.2f} Wh in {report["predicted_parts"]} {parts}',
        'predicted': f'{report["predicted_wh"]:,.2f} Wh, {report["error_percent"]:+.1f} %',
    }
    print_table(f'{report["vehicle"].capitalize()}, {report["files"]} files', (), rows.items())
    for note in report['notes']:
        output.print(note, soft_wrap=True)
