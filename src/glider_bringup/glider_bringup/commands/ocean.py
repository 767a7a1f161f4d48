# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""``./glider ocean``: what is in a file of an ocean model, and whether it covers a mission."""

import json
from pathlib import Path
from typing import Annotated

import typer

from glider_base.settings import ConfigurationError
from glider_bringup.console import Json, messages, output, print_table
from glider_bringup.showing.ocean import draw_sea, in_words, look, mission_in
from glider_mission.disk import whole_file
from glider_model.ocean.eddying_sea import EddyingSea, write_sea

app = typer.Typer()


@app.command(epilog='Example: ./glider ocean cmems_mod_glo_phy.nc --mission survey --out sea.png')
def ocean(
    file: Annotated[Path, typer.Argument(help='NetCDF file of an ocean model.')],
    mission: Annotated[
        str | None,
        typer.Option(metavar='SCENARIO', help='Whether it covers this mission, if it flew in it.'),
    ] = None,
    out: Annotated[
        Path | None,
        typer.Option(help='Image file: png, svg or pdf, of what it has, and of the mission.'),
    ] = None,
    make: Annotated[
        int | None,
        typer.Option(
            metavar='SEED', min=0, help='First make the file: a sea full of eddies, by this seed.'
        ),
    ] = None,
    rms: Annotated[
        float,
        typer.Option(
            min=0.0, max=1.0, help='rms of each part of what --make makes, at the top (m/s).'
        ),
    ] = 0.18,
    error: Annotated[
        float,
        typer.Option(
            min=0.0,
            max=1.0,
            help='It makes a forecast of that sea instead: each part of its depth-averaged '
            'current, north and east, is off by this rms (m/s).',
        ),
    ] = 0.0,
    as_json: Json = False,
) -> None:
    """Tell what is in a file, whether it covers a mission, and draw it.

    That is what can be used of it: currents, temperature and salinity, depth of the bottom. Exit
    code 2: there is nothing of these, or it does not cover the mission.
    """
    if make is not None:
        if file.exists():
            raise ConfigurationError(f'{file}: is there already (allowed: a new file)')
        with whole_file(file) as stream:
            write_sea(EddyingSea(seed=make, rms_mps=rms, error_mps=error), Path(stream.name))
    with messages.status('reading'):
        listing, sea = look(file)
        refused = ''
        if mission is not None:
            try:
                sea = mission_in(listing, mission)
            except ConfigurationError as error:
                sea, refused = None, str(error)
            listing['mission'] = {'scenario': mission, 'covered': not refused, 'reason': refused}
        if out and sea:
            draw_sea(sea, out)
            listing['drawn'] = str(out)
    if as_json:
        print(json.dumps(listing, allow_nan=False))
    else:
        print_table(str(file), (), in_words(listing))
    if refused:
        raise ConfigurationError(refused)
    if out and not as_json:
        output.print(f'drawn: {out}', soft_wrap=True)
