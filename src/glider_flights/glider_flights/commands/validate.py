# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""``./glider validate``: the plant flown the way a real glider was."""

import json
from pathlib import Path
from typing import Annotated, get_args

import typer

from glider_base.errors import ConfigurationError
from glider_bringup.console import Cache, Json, counter, output, print_table
from glider_flights.validation.flying import Imposed

app = typer.Typer()


# long: its options stand where it begins, each with its help.
@app.command(
    epilog='Example: ./glider validate gliderflight/data/dbd --vehicle slocum_g2 --fit-on first'
)
def validate(
    flight: Annotated[
        Path | None,
        typer.Argument(
            metavar='[FLIGHT]',
            help='Folder of dbd files of a Slocum with their ebd files (or of their kind), of '
            'p*.nc of a Seaglider, of OG1 or CF NetCDF, or one such file.',
        ),
    ] = None,
    vehicle: Annotated[
        str | None,
        typer.Option(
            help='Vehicle by name or path of its YAML file. With --all by default slocum_g2 or '
            'seaglider, by the kind of the flight; of one in OG1 by its PLATFORM_MODEL.'
        ),
    ] = None,
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
            'Default: mass,Cd0, of a Seaglider lift too; with actuators trim and righting, with '
            'an ADCP pitch_scale.',
        ),
    ] = None,
    fit_on: Annotated[
        str | None,
        typer.Option(
            metavar='first|second|none|FLIGHT',
            help='Half of the flight that is fitted, and the other one tried; or another flight '
            'of such a vehicle; or nothing. Default: fitted and tried on the whole flight.',
        ),
    ] = None,
    every: Annotated[
        Path | None,
        typer.Option(
            '--all',
            metavar='FOLDER',
            help='One table of all flights in a folder and the folders in it: fitted on each '
            'half, tried on the other, turns and energy too.',
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
    from glider_flights.validation.figure import draw_validation
    from glider_flights.validation.result import Half, find_adcp, validate_all
    from glider_flights.validation.result import validate as validated

    if every is not None:
        if impose != 'pitch' or any(one is not None for one in (flight, fit_on, adcp, out)):
            raise ConfigurationError(
                f'--all {every}: stands alone (allowed with it: --vehicle, --fit, --cache, --json)'
            )
        with counter('flights', None) as update:
            table = validate_all(every, vehicle, fit, cache, update)
        if as_json:
            print(json.dumps(table))
        else:
            _print_all(table)
        return
    if flight is None or vehicle is None:
        lacks = 'FLIGHT' if flight is None else '--vehicle'
        raise ConfigurationError(f'validate: {lacks} is missing (needed, unless with --all)')
    measured = find_adcp(flight, adcp)
    with counter('reading', None) as update:
        found = read_whole(flight, cache, update)
        source = fit_on
        if fit_on is not None and fit_on not in get_args(Half):
            source = read_whole(Path(fit_on), cache, update)
    with counter('flying', None) as update:
        result = validated(found, vehicle, impose, fit, measured, update, source)
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
    from glider_flights.validation.fit import CONSTANTS

    title = (
        f'{report["vehicle"]} along {report["files"]} files of a {report["kind"]}, '
        f'{report["imposed"]} imposed'
    )
    other, unfitted = report['peer'], report['unfitted']
    rows = {
        'stretches under water': report['segments'],
        'vertical rate off, rms (cm/s)': report['w_rmse_cmps'],
        'its mean, + down (cm/s)': report['w_bias_cmps'],
        'speed off the ADCP, rms (cm/s)': report['u_adcp_rmse_cmps'],
        'its mean (cm/s)': report['u_adcp_bias_cmps'],
        'pitch off, rms (deg)': report['pitch_rmse_deg'],
        **{
            f'turn rate over sin({by}), {name} (rad/s)': None
            if turn['recorded'] is None
            else f'{turn["recorded"]}, simulated {turn["simulated"]}'
            + (f', fitted {turn["fitted"]}' if turn.get('fitted') else '')
            for by in ('roll', 'fin')
            for name, turn in report[f'turn_rate_per_sin_{by}'].items()
        },
        'current off that on board, median (cm/s)': report['dac_off_cmps']['median'],
        'vertical rate off, of others (cm/s)': None
        if other is None
        else f'{other["w_rmse_cmps"]} ({other["name"]})',
        'both with nothing fitted (cm/s)': f'{unfitted["w_rmse_cmps"]}, '
        f'{_or_dash(unfitted["peer_w_rmse_cmps"])}',
        'fitted on': report['fit_on'],
        'fitted': ', '.join(
            f'{name} {value:g} {CONSTANTS[name].unit}' for name, value in report['fitted'].items()
        ),
    }
    texts = ('-' if value in (None, '') else str(value) for value in rows.values())
    print_table(title, (), zip(rows, texts, strict=True))


def _or_dash(value: float | None, form: str = 'g') -> str:
    return '-' if value is None else format(value, form)


def _both(own: float | None, other: float | None) -> str:
    return f'{_or_dash(own, ".2f")}, {_or_dash(other, ".2f")}'


def _print_all(table: dict) -> None:
    """A row for each flight: vertical rate off (cm/s), ours and the other model's."""
    columns = ('flight', 'parts', 'unfitted', 'on first', 'on second', 'turns', 'energy')
    rows = []
    for one in table['flights']:
        first, second = one['fit_on_first'], one['fit_on_second']
        unfitted = first['unfitted']
        turns = [
            f'{by} {_or_dash(turn["recorded"])}, {_or_dash(turn["fitted"])}'
            for by in ('roll', 'fin')
            for turn in first[f'turn_rate_per_sin_{by}'].values()
            if turn['recorded'] is not None
        ]
        tried = [
            _both(half['w_rmse_cmps'], (half['peer'] or {}).get('w_rmse_cmps'))
            for half in (first, second)
        ]
        before = _both(unfitted['w_rmse_cmps'], unfitted['peer_w_rmse_cmps'])
        energy = one['energy_error_percent']
        cell = '-' if energy is None else f'{energy:+.1f} %'
        shown = (one['flight'], str(one['segments']), before, *tried)
        rows.append((*shown, '; '.join(turns) or '-', cell))
    title = (
        'Vertical rate off in the other half, rms (cm/s): ours, the other model. Turn rate over '
        'sin(roll) or sin(fin) in dives and climbs (rad/s): recorded, fitted. Energy of the '
        'second half.'
    )
    print_table(title, columns, rows)
    for name, why in table['left_out'].items():
        output.print(f'left out: {name}: {why}', soft_wrap=True)
