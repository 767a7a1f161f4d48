# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""Reading a recorded flight, or its energy, of whichever kind of vehicle its files are."""

import math
from functools import partial
from pathlib import Path

import numpy as np

from glider_base.errors import ConfigurationError
from glider_flights.energy import Uses, seaglider_uses, slocum_uses
from glider_flights.folders import Progress, said
from glider_flights.og1 import og1_files, read_og1
from glider_flights.record import DIVE_DEPTH_M, Flight, vertical_rate
from glider_flights.seaglider import read_seaglider, seaglider_files
from glider_flights.slocum import read_slocum, slocum_files

#: Where a glider sinks or rises by more than this (m/s), its nose further down or up than that
#: (rad), a pitch shows its sign; of more of such samples than this it has the other one.
RATE_MPS, PITCH_RAD, MOST_AGAINST = 0.05, math.radians(5.0), 0.9
#: Where the pitch tells no speed in more than this share of them, ways are said to be short.
MOST_LEVEL = 0.2
#: Radians that are said to be degrees are less than this (rad), however steep a glide is.
LEVEL_RAD = math.radians(0.5 * math.pi)


def files_by_kind(place: Path) -> dict[str, list[Path]]:
    """Files of flights by the kind of vehicle, or of file."""
    in_og1 = og1_files(place)
    dives = [path for path in seaglider_files(place) if path not in in_og1]
    return {'a Slocum': slocum_files(place), 'a Seaglider': dives, 'OG1': in_og1}


def read_flight(place: Path, cache: Path | None, progress: Progress) -> Flight:
    """Read a flight with at least one segment, from a folder or one file.

    Without a ``cache``, the folder of a Slocum's caches, they are looked for. Raises
    ConfigurationError.
    """
    flight = _nose_up(place, _read(place, cache, progress, read_slocum, read_seaglider, read_og1))
    if not flight.segments:
        why = '; '.join(flight.notes)
        raise ConfigurationError(
            f'{place}: no dive between two fixes in its {len(flight.files)} files'
            + (f': {why}' if why else '')
        )
    return flight


def read_whole(place: Path, cache: Path | None, progress: Progress) -> Flight:
    """Read a flight with its instruments, whether or not it has segments; see `read_flight`."""
    slocum = partial(read_slocum, whole=True)
    return _nose_up(place, _read(place, cache, progress, slocum, read_seaglider, read_og1))


def read_uses(place: Path, cache: Path | None, progress: Progress) -> Uses:
    """Read what a flight took out of its battery; see `read_flight`."""
    return _read(place, cache, progress, slocum_uses, seaglider_uses)


def _nose_up(place: Path, flight: Flight) -> Flight:
    """The flight, whose nose is up where it rises; raises ConfigurationError."""
    moved = shown = against = 0
    steepest = 0.0
    for samples in (segment.samples for segment in flight.segments):
        rate, pitch = vertical_rate(samples.time_s, samples.depth_m), samples.pitch_rad
        moves = (np.abs(rate) > RATE_MPS) & (samples.depth_m > DIVE_DEPTH_M)
        moved += moves.sum()
        steepest = np.max(np.abs(pitch[moves]), initial=steepest)
        shows = moves & (np.abs(pitch) > PITCH_RAD)
        shown += shows.sum()
        against += (shows & (rate * pitch > 0.0)).sum()
    if against > MOST_AGAINST * shown:
        raise ConfigurationError(
            f'{place}: the pitch is nose up while it sinks, or down while it rises, in '
            f'{against / shown:.0%} of its samples (allowed: + nose up)'
        )
    level = moved - shown + against
    if level > MOST_LEVEL * moved:
        flight.notes.append(
            f'the pitch is level, or of the other sign, in {level / moved:.0%} of the samples '
            'that sink or rise, as where it is recorded too seldom: ways are too short'
        )
    if flight.kind == 'og1' and moved and steepest < LEVEL_RAD:
        raise ConfigurationError(
            f'{place}: the pitch is {math.degrees(steepest):.2f} degrees at most where it sinks '
            'and rises (allowed: degrees, or units = rad)'
        )
    return flight


def _read(place: Path, cache: Path | None, progress: Progress, slocum, seaglider, og1=None):
    """What that function says of a flight which is for the kind of most of the files."""
    if not place.exists():
        raise ConfigurationError(f'{place}: there is no such folder or file')
    if cache is not None and not cache.is_dir():
        raise ConfigurationError(f'--cache {cache}: there is no such folder')
    files = files_by_kind(place)
    readers = {
        'a Slocum': partial(slocum, place, cache, progress),
        'a Seaglider': partial(seaglider, place, progress),
    }
    if og1:
        readers['OG1'] = partial(og1, place, progress)
    kind = max(readers, key=lambda kind: len(files[kind]))
    if not files[kind]:
        raise ConfigurationError(
            f'{place}: no files of a flight in it (allowed: .dbd, .mbd, .sbd, .dcd, .mcd, .scd of '
            'a Slocum, p*.nc of a Seaglider'
            + (', NetCDF with TIME as OG1 has it)' if og1 else ')')
        )
    flight = readers.pop(kind)()
    others = {
        path.name: f'it is of {other}, most are of {kind}'
        for other in readers
        for path in files[other]
    }
    return flight._replace(notes=said(others) + flight.notes)
