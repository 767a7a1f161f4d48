# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""A validation from files to figures, and one table of all flights that a folder holds."""

import math
from pathlib import Path
from typing import Any, Literal, NamedTuple

import numpy as np

from glider_base.errors import ConfigurationError
from glider_base.signals import SEA_WATER_DENSITY
from glider_flights.energy import predict
from glider_flights.folders import Progress
from glider_flights.reading import files_by_kind, read_uses, read_whole
from glider_flights.record import Flight
from glider_flights.validation.fit import BY_ADCP, CONSTANTS, at_bounds, chosen, fitted
from glider_flights.validation.flying import Imposed, Model, Track, check, fly, model_of, tracks
from glider_flights.validation.score import (
    STEERED_BY,
    Adcp,
    Pair,
    measured,
    peer,
    rate_off,
    rms,
    score,
    speed_off,
    turn_rates,
)

#: Speeds of an ADCP that come with a flight, in its folder or the one above it.
ADCP_FILES = 'U_*.npy'
#: Speeds of an ADCP that are none, or larger than this (m/s), stand for nothing.
FASTEST_MPS = 5.0
#: What of a flight its constants can be fitted to; it is then tried on the other half, or on all.
Half = Literal['first', 'second', 'none']
#: A part of a flight to be fitted or tried has at least so many stretches under water.
FEWEST = 2


class Validation(NamedTuple):
    """What came out."""

    pairs: list[Pair]
    model: Model
    adcp: Adcp | None
    report: dict[str, Any]  #: figures, as `--json` prints them


def validate(
    flight: Flight,
    vehicle: str,
    impose: Imposed,
    fit: str | None,
    adcp: Adcp | None,
    progress: Progress,
    fit_on: Half | Flight | None = None,
) -> Validation:
    """Fly a vehicle along a recorded flight, with constants that ``fit`` names fitted first.

    They are fitted to the whole flight, or out of sample: to one half of it, and tried on the
    other, or to another flight. With ``none`` nothing is fitted. Raises ConfigurationError.
    """
    found = tracks(flight)
    check(flight, found, impose)
    foreign = adcp is not None and not _heard(found, adcp)
    adcp = None if foreign else adcp
    start = model_of(vehicle, flight)
    learnt_on, begun, tried = found, start, found
    if isinstance(fit_on, Flight):
        if {fit_on.kind, flight.kind} == VEHICLES.keys():
            raise ConfigurationError(
                f'{flight.label}: a {flight.kind} cannot be tried with what is fitted to a '
                f'{fit_on.kind} (allowed: --fit-on a {flight.kind})'
            )
        learnt_on, begun = tracks(fit_on), model_of(vehicle, fit_on)
        check(fit_on, learnt_on, impose)
    elif fit_on in ('first', 'second'):
        learnt_on, tried = _halves(found, flight)[:: 1 if fit_on == 'first' else -1]
    has_adcp = adcp is not None and _heard(learnt_on, adcp)
    names = chosen('none' if fit_on == 'none' else fit, flight.kind, impose, has_adcp)
    by_adcp = learnt_on if adcp is not None and set(BY_ADCP) & set(names) else []
    learnt = fitted(learnt_on, begun, impose, names, by_adcp, adcp)
    model = start
    for name in names:
        model = CONSTANTS[name].write(model, CONSTANTS[name].read(learnt))
    pairs = []
    for number, track in enumerate(tried):
        progress(number, len(tried))
        pairs.append((track, fly(track, model, impose)))
    speed = np.empty(0)
    if by_adcp and fit_on is None:
        speed = _crosswise(found, start, impose, names, adcp)
    elif adcp is not None:
        speed = np.concatenate([speed_off(*pair, adcp) for pair in pairs])
    other, why = peer(learnt_on if names else [], tried, model, names)
    unfitted, unfitted_other = pairs, other
    if names:
        unfitted = [(track, fly(track, start, impose)) for track in tried]
        unfitted_other, _ = peer([], tried, start, ())
    # the basestation's constants are in the file, fitted already
    has_other = unfitted_other is not None and unfitted_other['name'] != 'basestation'
    other_unfitted = unfitted_other['w_rmse_cmps'] if has_other else None
    report = {
        'kind': flight.kind,
        'files': len(flight.files),
        'first_file': flight.files[0],
        'last_file': flight.files[-1],
        'vehicle': vehicle,
        'imposed': impose,
        'fit_on': fit_on.files[0] if isinstance(fit_on, Flight) else fit_on or 'all',
        'fitted': {name: float(f'{CONSTANTS[name].read(model):.6g}') for name in names},
        **score(flight, pairs, model, speed),
        'peer': other,
        'unfitted': {
            'w_rmse_cmps': rms(rate_off(unfitted), 100.0),
            'peer_w_rmse_cmps': other_unfitted,
        },
        'notes': flight.notes
        + ['no speed by an ADCP at the time of the flight'] * foreign
        + _taken(flight, vehicle, found)
        + ([why] if why else [])
        + at_bounds(names, begun, learnt),
    }
    if fit_on not in (None, 'none'):
        flown_there = [(track, fly(track, learnt, impose)) for track in learnt_on]
        for turns, learnt_rates in turn_rates(flown_there).items():
            _try_turns(report[turns], learnt_rates)
    return Validation(pairs, model, adcp, report)


def _taken(flight: Flight, vehicle: str, found: list[Track]) -> list[str]:
    """Notes of a vehicle that stands for the other kind of flight, and of water that is taken."""
    usual = VEHICLES.get(flight.kind, vehicle)
    other_kind = usual != vehicle and vehicle in VEHICLES.values()
    no_water = any(np.isnan(track.density_kgpm3).all() for track in found)
    return [f'a {flight.kind} flew this: its vehicle is {usual}, not {vehicle}'] * other_kind + [
        f'no temperature or no salinity: water of {SEA_WATER_DENSITY:g} kg/m3 is taken'
    ] * no_water


def _heard(found: list[Track], adcp: Adcp) -> bool:
    """Whether an ADCP measured at the time of one of these stretches."""
    return any(np.isfinite(measured(one, adcp)).any() for one in found)


def _halves(found: list[Track], flight: Flight) -> tuple[list[Track], list[Track]]:
    """The stretches of a flight in two parts, of as many samples that are compared."""
    samples = np.cumsum([int(track.counts.sum()) for track in found])
    cut = int(np.argmin(np.abs(samples - 0.5 * samples[-1]))) + 1
    parts = found[:cut], found[cut:]
    for part in parts:
        if len(part) < FEWEST:
            raise ConfigurationError(
                f'{flight.label}: too few dives, stretches under water: {len(found)} (needed: '
                f'{FEWEST} in each half)'
            )
    return parts


def _try_turns(rates: dict[str, Any], learnt: dict[str, Any]) -> None:
    """Add how the plant turns, scaled by what it turned too much in the part that it was given."""
    for phase, rate in rates.items():
        known = learnt[phase]
        rate['fitted'] = None
        if None not in (known['recorded'], rate['simulated']) and known['simulated']:
            scale = known['recorded'] / known['simulated']
            rate['fitted'] = round(rate['simulated'] * scale, 4)


def _crosswise(
    found: list[Track], start: Model, impose: Imposed, names: tuple[str, ...], adcp: Adcp
) -> np.ndarray:
    """Simulated less measured speed (m/s), by a model given every other stretch only."""
    off = []
    for half in (0, 1):
        model = fitted(found, start, impose, names, found[1 - half :: 2], adcp)
        off += [speed_off(track, fly(track, model, impose), adcp) for track in found[half::2]]
    return np.concatenate(off)


def find_adcp(place: Path, file: Path | None) -> Adcp | None:
    """Speeds of an ADCP from a file, or from one beside a flight; None if there is none.

    Raises ConfigurationError.
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
        table = np.asarray(table, float)
    except (OSError, ValueError, TypeError, EOFError) as error:
        raise ConfigurationError(f'--adcp {file}: cannot be read: {error}') from None
    if table.ndim != 2 or len(table) != 2 or not table.shape[1]:
        raise ConfigurationError(
            f'--adcp {file}: has shape {table.shape} (allowed: 2, n: time in s since 1970, speed '
            'through the water in m/s; as CSV a line for each)'
        )
    time_s, speed = table
    good = np.isfinite(time_s)
    speed = np.where((speed > 0.0) & (speed < FASTEST_MPS), speed, math.nan)
    if np.isnan(speed).all():
        raise ConfigurationError(
            f'--adcp {file}: no speed of a glider (allowed: m/s, > 0, < {FASTEST_MPS:g})'
        )
    return Adcp(time_s[good], speed[good])


# ---- all flights of a folder

#: The vehicle file that stands for a kind of files, or of vehicle, unless another one is named.
VEHICLES = {'slocum': 'slocum_g2', 'seaglider': 'seaglider'}
#: Both ways.
HALVES = ('first', 'second')
#: What is shown of each.
OF_HALF = (*('segments', 'fitted', 'w_rmse_cmps', 'w_bias_cmps', 'peer', 'unfitted'), *STEERED_BY)


def flights_in(folder: Path) -> list[Path]:
    """The folder and those in it that hold files of a flight themselves, in order.

    Raises ConfigurationError if there is none.
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


def _vehicle_of(flight: Flight) -> str:
    name = f'{flight.kind} {flight.model}'.lower()
    found = next((VEHICLES[kind] for kind in VEHICLES if kind in name), None)
    if found is None:
        raise ConfigurationError(
            f'{flight.label}: PLATFORM_MODEL is {flight.model or "missing"} (allowed without '
            f'--vehicle: a model with {" or ".join(VEHICLES)} in its name)'
        )
    return found


def _row(place: Path, vehicle: str | None, fit: str | None, cache: Path | None) -> dict[str, Any]:
    """Figures of one flight."""
    flight = read_whole(place, cache, lambda *_: None)
    chosen, adcp = vehicle or _vehicle_of(flight), find_adcp(place, None)
    halves = {
        half: validate(flight, chosen, 'pitch', fit, adcp, lambda *_: None, half).report
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
