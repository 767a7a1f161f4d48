# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""``./glider validate``: the plant flown the way a real glider was."""

import json
from pathlib import Path
from typing import Annotated

import typer

from glider_bringup.console import Cache, Json, counter, output, print_table
from glider_flights.validation.flying import Imposed

app = typer.Typer()


@app.command(
    epilog='Example: ./glider validate gliderflight/data/dbd --vehicle slocum_g2 --impose pitch'
)
def validate(
    flight: Annotated[
        Path,
        typer.Argument(
            metavar='FLIGHT',
            help='Folder of dbd files of a Slocum with their ebd files (or of their kind), of '
            'p*.nc of a Seaglider, of OG1 or CF NetCDF, or one such file.',
        ),
    ],
    vehicle: Annotated[str, typer.Option(help='Vehicle by name or path of its YAML file.')],
    impose: Annotated[
        Imposed,
        typer.Option(
            help='What of the recording the plant is held to: pitch and roll, or actuators.'
        ),
    ] = 'pitch',
    fit: Annotated[
        str | None,
        typer.Option(
            metavar='NAMES',
            help='Constants to be fitted to the vertical rate, such as Cd0,mass; none for none. '
            'Default: mass,Cd0; with actuators trim and righting too.',
        ),
    ] = None,
    adcp: Annotated[
        Path | None,
        typer.Option(
            metavar='FILE',
            help='Speed through the water by an ADCP: npy of shape 2, n, or CSV of time (s since '
            '1970), speed (m/s). Default: a file U_*.npy in the folder or above it.',
        ),
    ] = None,
    cache: Cache = None,
    out: Annotated[
        Path | None,
        typer.Option(help='Image file for the picture: png, svg or pdf. Default: no picture.'),
    ] = None,
    as_json: Json = False,
) -> None:
    """Fly a vehicle of ours along a recorded flight; compare vertical rate, speed, pitch, turns.

    Beside it the model of others: gliderflight, or what the base station of a Seaglider wrote.
    """
    from glider_flights.reading import read_whole
    from glider_flights.showing.validation import draw_validation
    from glider_flights.validation.result import find_adcp
    from glider_flights.validation.result import validate as validated

    measured = find_adcp(flight, adcp)
    with counter('reading', None) as update:
        found = read_whole(flight, cache, update)
    with counter('flying', None) as update:
        result = validated(found, vehicle, impose, fit, measured, update)
    if out is not None:
        title = f'{flight}: recorded, and {vehicle} with {impose} imposed'
        draw_validation(result, title, out)
    if as_json:
        print(json.dumps({'flight': str(flight), **result.report}))
        return
    _print(result.report)
    for note in result.report['notes']:
        output.print(note, soft_wrap=True)
    if out is not None:
        output.print(f'drawn: {out}', soft_wrap=True)


def _print(report: dict) -> None:
    title = (
        f'{report["vehicle"]} along {report["files"]} files of a {report["kind"]}, '
        f'{report["imposed"]} imposed'
    )
    turns, other = report['turn_rate_per_sin_roll'], report['peer']
    rows = {
        'stretches under water': report['segments'],
        'vertical rate off, rms (cm/s)': report['w_rmse_cmps'],
        'its mean, + down (cm/s)': report['w_bias_cmps'],
        'speed off the ADCP, rms (cm/s)': report['u_adcp_rmse_cmps'],
        'its mean (cm/s)': report['u_adcp_bias_cmps'],
        'pitch off, rms (deg)': report['pitch_rmse_deg'],
        **{
            f'turn rate over sin(roll), {name} (rad/s)': None
            if turn['recorded'] is None
            else f'{turn["recorded"]}, simulated {turn["simulated"]}'
            for name, turn in turns.items()
        },
        'current off that on board, median (cm/s)': report['dac_off_cmps']['median'],
        'vertical rate off, of others (cm/s)': None
        if other is None
        else f'{other["w_rmse_cmps"]} ({other["name"]})',
        'fitted': ', '.join(f'{name} {value:g}' for name, value in report['fitted'].items()),
    }
    texts = ('-' if value in (None, '') else str(value) for value in rows.values())
    print_table(title, (), zip(rows, texts, strict=True))
