# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""One table of all flights that a folder holds: fitted on one half, tried on the other."""

from pathlib import Path
from typing import Any

from glider_base.errors import ConfigurationError
from glider_flights.energy.uses import predict
from glider_flights.folders import Progress
from glider_flights.reading import files_by_kind, read_uses, read_whole
from glider_flights.validation.result import validate
from glider_flights.validation.score import STEERED_BY

#: The vehicle file that stands for a kind of vehicle, unless another one is named.
VEHICLES = {'slocum': 'slocum_g2', 'seaglider': 'seaglider', 'og1': 'seaglider'}
#: Both ways.
HALVES = ('first', 'second')
#: What is told of each.
OF_HALF = (
    *('segments', 'fitted', 'w_rmse_cmps', 'w_bias_cmps', 'peer', 'unfitted'),
    *STEERED_BY,
)


def flights_in(folder: Path) -> list[Path]:
    """The folder and those in it that hold files of a flight themselves, in order.

    Raises
    ------
    ConfigurationError
        If there is none.
    """
    if not folder.is_dir():
        raise ConfigurationError(f'--all {folder}: there is no such folder')
    inside = sorted(path for path in folder.rglob('*') if path.is_dir())
    found = [
        path
        for path in [folder, *inside]
        if any(any(files_by_kind(one).values()) for one in path.iterdir() if one.is_file())
    ]
    if not found:
        raise ConfigurationError(
            f'--all {folder}: no files of a flight in it, nor in a folder in it (allowed: .dbd, '
            '.mbd, .sbd, .dcd, .mcd, .scd of a Slocum, NetCDF)'
        )
    return found


def validate_all(
    folder: Path, vehicle: str | None, fit: str | None, cache: Path | None, progress: Progress
) -> dict[str, Any]:
    """Figures of every flight in a folder, as `--json` prints them; what has none is named."""
    places, rows, left_out = flights_in(folder), [], {}
    for number, place in enumerate(places):
        progress(number, len(places))
        name = str(place.relative_to(folder))
        try:
            rows.append({'flight': name, **_row(place, vehicle, fit, cache)})
        except ConfigurationError as error:
            left_out[name] = str(error)
    progress(len(places), len(places))
    return {'folder': str(folder), 'flights': rows, 'left_out': left_out}


def _row(place: Path, vehicle: str | None, fit: str | None, cache: Path | None) -> dict[str, Any]:
    """Figures of one flight."""
    flight = read_whole(place, cache, lambda *_: None)
    chosen = vehicle or VEHICLES[flight.kind]
    halves = {
        half: validate(flight, chosen, 'pitch', fit, None, lambda *_: None, half).report
        for half in HALVES
    }
    energy, why = None, []
    try:
        uses = read_uses(place, cache, lambda *_: None)
        energy = predict(place, uses, None)['error_percent']
    except ConfigurationError as error:
        why = [f'energy: {error}']
    first = halves['first']
    notes = list(dict.fromkeys(note for one in halves.values() for note in one['notes']))
    return {
        'kind': flight.kind,
        'vehicle': chosen,
        'segments': sum(one['segments'] for one in halves.values()),
        **{
            f'fit_on_{half}': {name: one[name] for name in OF_HALF} for half, one in halves.items()
        },
        'peer': (first['peer'] or {}).get('name'),
        'energy_error_percent': energy,
        'notes': notes + why,
    }
