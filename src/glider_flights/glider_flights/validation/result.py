# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""A validation from files to figures."""

import math
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from glider_base.errors import ConfigurationError
from glider_flights.record import Flight
from glider_flights.validation.fit import BY_ADCP, CONSTANTS, chosen, fitted
from glider_flights.validation.flying import (
    Imposed,
    Model,
    Simulated,
    check,
    fly,
    model_of,
)
from glider_flights.validation.peers import peer
from glider_flights.validation.score import Adcp, score, speed_off
from glider_flights.validation.track import Track, tracks

#: Speeds of an ADCP that come with a flight, in its folder or the one above it.
ADCP_FILES = 'U_*.npy'
#: Speeds of an ADCP that are none, or larger than this (m/s), stand for nothing.
FASTEST_MPS = 5.0


class Validation(NamedTuple):
    """What came out."""

    tracks: list[Track]
    flown: list[Simulated]
    model: Model
    adcp: Adcp | None
    report: dict[str, Any]  #: figures, as `--json` prints them


def validate(
    flight: Flight,
    vehicle: str,
    impose: Imposed,
    fit: str | None,
    adcp: Adcp | None,
    progress: Callable[[int, int], None],
) -> Validation:
    """Fly a vehicle along a recorded flight, with constants that ``fit`` names fitted to it first.

    Raises
    ------
    ConfigurationError
    """
    names = chosen(fit, flight.kind, impose, adcp is not None)
    found = tracks(flight)
    check(found, impose)
    start = model_of(vehicle, flight)
    told = found if adcp is not None and set(BY_ADCP) & set(names) else []
    model = fitted(found, start, impose, names, told, adcp)
    flown = []
    for number, track in enumerate(found):
        progress(number, len(found))
        flown.append(fly(track, model, impose))
    pitch = [model.pitch(track.instruments.pitch_rad) for track in found]
    speed = np.empty(0)
    if told:
        speed = _crosswise(found, start, impose, names, adcp)
    elif adcp is not None:
        speed = np.concatenate([speed_off(*pair, adcp) for pair in zip(found, flown, strict=True)])
    other, why = peer(flight, found, model)
    report = {
        'kind': flight.kind,
        'files': len(flight.files),
        'first_file': flight.files[0],
        'last_file': flight.files[-1],
        'vehicle': vehicle,
        'imposed': impose,
        'fitted': {name: float(f'{CONSTANTS[name].read(model):.6g}') for name in names},
        **score(flight, found, flown, pitch, speed),
        'peer': other,
        'notes': flight.notes + ([why] if why else []),
    }
    return Validation(found, flown, model, adcp, report)


def _crosswise(
    found: list[Track], start: Model, impose: Imposed, names: tuple[str, ...], adcp: Adcp
) -> np.ndarray:
    """Simulated less measured speed (m/s), by a model told of every other stretch only."""
    off = []
    for half in (0, 1):
        model = fitted(found, start, impose, names, found[1 - half :: 2], adcp)
        off += [speed_off(track, fly(track, model, impose), adcp) for track in found[half::2]]
    return np.concatenate(off)


def find_adcp(place: Path, file: Path | None) -> Adcp | None:
    """Speeds of an ADCP from a file, or from one beside a flight; None if there is none.

    Raises
    ------
    ConfigurationError
    """
    if file is None:
        folder = place if place.is_dir() else place.parent
        beside = sorted(folder.glob(ADCP_FILES)) or sorted(
            folder.resolve().parent.glob(ADCP_FILES)
        )
        if len(beside) != 1:
            return None
        file = beside[0]
    try:
        table = np.load(file) if file.suffix == '.npy' else np.loadtxt(file, delimiter=',').T
    except (OSError, ValueError) as error:
        raise ConfigurationError(f'--adcp {file}: cannot be read: {error}') from None
    if table.ndim != 2 or len(table) != 2 or not table.shape[1]:
        raise ConfigurationError(
            f'--adcp {file}: has shape {table.shape} (allowed: 2, n: time in s since 1970, speed '
            'through the water in m/s; as CSV a line for each)'
        )
    time_s, speed = np.asarray(table, float)
    good = np.isfinite(time_s)
    speed = np.where((speed > 0.0) & (speed < FASTEST_MPS), speed, math.nan)
    return Adcp(time_s[good], speed[good])
