# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""Which files are those of a flight, and the libraries that read them."""

import math
from collections import Counter
from collections.abc import Callable, Iterable
from datetime import datetime, timezone
from pathlib import Path
from typing import TypeVar

import numpy as np

from glider_base.errors import ConfigurationError, installed

#: There is no later date (s since 1970): the end of 2099.
LATEST_S = 4.1e9
#: No glider is at sea for longer (s): files further apart are of two flights, or of a wrong clock.
LONGEST_FLIGHT_S = 400 * 86_400.0
#: Gets how many files, or other things, are done, and how many there are.
Progress = Callable[[int, int], None]


File = TypeVar('File')


def files_in(place: Path, wanted: Callable[[Path], bool]) -> list[Path]:
    """The wanted files: the place itself, those in it, or those in the one folder below it.

    Raises ConfigurationError if several folders below it have some: they may be of several
    flights.
    """
    if place.is_file():
        return [place] if wanted(place) else []
    files = sorted(path for path in place.iterdir() if path.is_file() and wanted(path))
    if files:
        return files
    files = sorted(path for path in place.rglob('*') if path.is_file() and wanted(path))
    folders = sorted({path.parent for path in files})
    if len(folders) > 1:
        raise ConfigurationError(
            f'{place}: files of flights in {len(folders)} folders below it, such as '
            f'{folders[0]} and {folders[1]}; give one of them'
        )
    return files


def gsw():
    """The library of sea water, TEOS-10."""
    with installed('gsw, which knows sea water'):
        import gsw
    return gsw


def declination_at(latitude_deg: float, longitude_deg: float, time_s: float) -> tuple[float, str]:
    """Magnetic declination (rad, + east) by IGRF at a time (s since 1970), and how to say it."""
    with installed('ppigrf, which knows the magnetic field'):
        import ppigrf
    day = datetime.fromtimestamp(time_s, timezone.utc).replace(tzinfo=None)
    east, north, _ = ppigrf.igrf(longitude_deg, latitude_deg, 0.0, day)
    declination = math.atan2(east.item(), north.item())
    return declination, f'{math.degrees(declination):.1f} deg east there by IGRF'


def read_each(
    files: list[Path], progress: Progress, read: Callable[[Path], File]
) -> tuple[list[File], dict[str, str]]:
    """What can be read of files, and why others cannot be, by name; of one alone, it is raised.

    Raises ConfigurationError.
    """
    found, left_out = [], {}
    for number, path in enumerate(files):
        progress(number, len(files))
        try:
            found.append(read(path))
        except ConfigurationError as error:
            if len(files) == 1 or 'not installed' in str(error):
                raise
            left_out[path.name] = str(error).removeprefix(f'{path}: ')
    return found, left_out


def of_one_flight(
    place: Path, files: list[File], left_out: dict[str, str]
) -> tuple[list[File], list[str]]:
    """Files that are of the flight that most of them are of, and a sentence for each other one.

    Not those of another vehicle, far off in time, or of a time at which the vehicle wrote another
    file. What they say is in the order in which the vehicle wrote them: each has a ``name``, its
    ``vehicle``, '' if it does not say, and the times of its samples, ``time_s`` (s since 1970),
    NaN or not. ``left_out`` says why some are left out already, by name. Raises ConfigurationError
    if no vehicle has more files than each of the others, or none is left.
    """
    left_out = left_out | _strangers(place, files)
    notes = said(left_out)
    kept = [file for file in files if file.name not in left_out]
    if not kept:
        raise ConfigurationError(f'{place}: no file could be read; {"; ".join(notes)}')
    return kept, notes


def usual_vehicle(place: Path, vehicles: Iterable[str]) -> str:
    """The vehicle that most files are of; empty without any.

    Raises ConfigurationError if no vehicle has more than each of the others.
    """
    counts = Counter(vehicles).most_common()
    if len(counts) > 1 and counts[0][1] == counts[1][1]:
        raise ConfigurationError(
            f'{place}: files of several vehicles, {", ".join(sorted(dict(counts)))} '
            '(allowed: those of one, or most of one)'
        )
    return counts[0][0] if counts else ''


def _strangers(place: Path, files: list[File]) -> dict[str, str]:
    """Files that are not of the flight that most of them are of, by name, and why not."""
    vehicle = usual_vehicle(place, [file.vehicle for file in files if file.vehicle])
    found, dates = {}, {}
    for file in files:
        time_s = file.time_s
        dated = time_s[(time_s > 0.0) & (time_s < LATEST_S)]
        if file.vehicle and file.vehicle != vehicle:
            found[file.name] = f'it is of {file.vehicle}, most are of {vehicle}'
        elif len(dated):
            dates[file.name] = dated
        else:
            found[file.name] = 'it has no samples with a date'
    return found | (_of_other_times(dates) if dates else {})


def _of_other_times(dates: dict[str, np.ndarray]) -> dict[str, str]:
    """Files whose times (s since 1970) cannot be right, by name, and why not."""
    names = list(dates)
    begin, middle, end = np.array([np.percentile(one, (5, 50, 95)) for one in dates.values()]).T
    usual = np.sort(middle)[len(names) // 2]
    found = {
        name: f'its dates are about {_day(at)}, most are about {_day(usual)}'
        for name, at in zip(names, middle, strict=True)
        if abs(at - usual) > LONGEST_FLIGHT_S
    }
    near = np.flatnonzero(np.abs(middle - usual) <= LONGEST_FLIGHT_S)
    longest = near[_longest_row(begin[near], end[near])]
    for one in np.setdiff1d(near, longest):
        same = longest[(begin[longest] < end[one]) & (end[longest] > begin[one])]
        if len(same):
            found[names[one]] = f'it is of the time of {names[same[0]]}'
    return found


def _day(time_s: float) -> str:
    return f'{datetime.fromtimestamp(time_s, timezone.utc):%Y-%m-%d}'


def _longest_row(begin: np.ndarray, end: np.ndarray) -> list[int]:
    """Indices of the most times, from ``begin`` to ``end``, of which each is after the last."""
    before, length = np.full(len(begin), -1), np.ones(len(begin), int)
    for index in range(len(begin)):
        earlier = np.flatnonzero(end[:index] <= begin[index])
        if len(earlier):
            before[index] = earlier[length[earlier].argmax()]
            length[index] += length[before[index]]
    found = [int(length.argmax())]
    while before[found[-1]] >= 0:
        found.append(int(before[found[-1]]))
    return found[::-1]


def said(left_out: dict[str, str]) -> list[str]:
    """A sentence for each reason for which files are left out, with their names."""
    names: dict[str, list[str]] = {}
    for name, why in left_out.items():
        names.setdefault(why, []).append(name)
    return [f'left out: {", ".join(those)}: {why}' for why, those in names.items()]
