# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""Lists of waypoints of a Slocum's missions: ``goto_l10.ma`` and the like, read and written.

A line for each waypoint, longitude first, in degrees and minutes as one number: -5230.0 is
52 deg 30 min W. What follows a # is a comment.
"""

import math
import re
from collections.abc import Sequence
from pathlib import Path

from glider_base.files import read_bytes

#: How such a file ends.
SUFFIX = '.ma'
#: A waypoint is reached within this distance in a file that is written (m).
REACHED_M = 100.0
_ARGUMENT = re.compile(r'b_arg:\s*(\w+)\s*(?:\([^)]*\))?\s+(\S+)')


def read_goto_list(file: Path) -> list[tuple[float, float]]:
    """Latitude and longitude (deg) of the waypoints of a list.

    Raises
    ------
    ValueError
        Naming file, line, value and what is allowed.
    """
    # Comments are in whatever encoding the pilot's editor had.
    lines = [
        line.partition('#')[0].strip() for line in read_bytes(file).decode('latin-1').split('\n')
    ]
    if not any(re.match(r'behavior_name\s*=\s*goto_l', line, re.IGNORECASE) for line in lines):
        raise ValueError(f'{file}: no list of waypoints (needed: behavior_name=goto_list)')
    arguments = {found[1]: found[2] for line in lines if (found := _ARGUMENT.match(line))}
    begin, end = '<start:waypoints>', '<end:waypoints>'
    if begin not in lines or end not in lines[lines.index(begin) :]:
        raise ValueError(f'{file}: no waypoints (needed: {begin} and {end})')
    first = lines.index(begin) + 1
    found = [
        _place(f'{file}: line {number}', line)
        for number, line in enumerate(lines[first : lines.index(end, first)], first + 1)
        if line
    ]
    told = arguments.get('num_waypoints', str(len(found)))
    if not told.isdigit() or not 1 <= int(told) <= len(found):
        raise ValueError(f'{file}: num_waypoints = {told} (allowed: 1 to {len(found)}, as it has)')
    return found[: int(told)]


def _place(where: str, line: str) -> tuple[float, float]:
    """Latitude and longitude (deg) of a line."""
    words = line.split()
    try:
        longitude, latitude = (_degrees(float(word)) for word in words[:2])
    except ValueError:
        longitude = latitude = math.nan
    if not (len(words) >= 2 and abs(latitude) <= 90.0 and abs(longitude) <= 180.0):
        raise ValueError(
            f'{where}: {line}: no waypoint (allowed: longitude and latitude, degrees and minutes '
            'as one number, such as -5230.000 4730.500)'
        )
    return latitude, longitude


def _degrees(value: float) -> float:
    """Degrees of degrees and minutes as one number; NaN if there are 60 minutes or more."""
    whole = math.trunc(value / 100.0)
    minutes = value - 100.0 * whole
    return whole + minutes / 60.0 if abs(minutes) < 60.0 else math.nan


def goto_list(name: str, places: Sequence[tuple[float, float]]) -> str:
    """The file of waypoints, latitude and longitude (deg), to 2 mm, that are gone to once."""
    lines = [f'{_minutes(longitude)} {_minutes(latitude)}' for latitude, longitude in places]
    return '\n'.join(
        [
            'behavior_name=goto_list',
            f'# {" ".join(name.split())}, written by ./glider export --to ma',
            '<start:b_arg>',
            'b_arg: start_when(enum) 0 # BAW_IMMEDIATELY',
            'b_arg: list_stop_when(enum) 7 # BAW_WHEN_WPT_DIST',
            f'b_arg: list_when_wpt_dist(m) {REACHED_M:g}',
            'b_arg: initial_wpt(enum) 0',
            f'b_arg: num_waypoints(nodim) {len(places)}',
            'b_arg: num_legs_to_run(nodim) -2 # once through the list',
            '<end:b_arg>',
            '<start:waypoints>',
            '# LON LAT',
            *lines,
            '<end:waypoints>',
            '',
        ]
    )


def _minutes(degrees: float) -> str:
    """Degrees and minutes as one number."""
    millionths = round(abs(degrees) * 60e6)
    whole, rest = divmod(millionths, 60_000_000)
    return f'{"-" if degrees < 0.0 else ""}{whole:02d}{rest / 1e6:09.6f}'
