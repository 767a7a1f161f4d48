# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""The chart of a mission: places in degrees, as people write and read them, and in metres.

Metres are north and east of the origin, by the projection of `glider_base.frames`. It stretches
lengths eastward where the latitude is not that of the origin: a mission too large for it is
refused.
"""

import re
from pathlib import Path
from typing import Any

from glider_base.errors import shown
from glider_base.frames import Origin, OriginSettings, from_geodetic, within_180
from glider_guidance.path.settings import MAX_DISTANCE_M
from glider_mission.mafiles import SUFFIX, read_goto_list

#: By this share the chart may stretch a length at a waypoint.
MAX_STRETCH = 0.05
#: Waypoints in metres that are given beside those in degrees may be off by this (m).
_SAME_M = 1.0
#: What waypoints in degrees say of the rest of a scenario, unless it says that itself.
_SAID = {'origin': {'latitude_deg', 'longitude_deg'}, 'initial': {'north_m', 'east_m'}}
#: Letters of each axis, + first, and its range (deg). A flat chart has no poles.
_AXES = {'latitude': ('NS', -85.0, 85.0), 'longitude': ('EW', -180.0, 360.0)}
_TEXT = re.compile(
    r"""([NSEW])?\s*([-+]?\d{1,3}(?!\d)(?:\.\d*)?)\s*(?:°|deg)?\s*"""
    r"""(?:(\d+(?:\.\d*)?)\s*['′]?)?\s*([NSEW])?""",
    re.IGNORECASE,
)


def degrees(value: Any, axis: str) -> float:
    """Degrees of a number or a text: 47.508, '47.508 N', '47 30.5 N', "47°30.5'N".

    The axis is latitude or longitude. A ValueError names it, the value and what is allowed.
    """
    letters, low, high = _AXES[axis]
    found = _TEXT.fullmatch(value.strip()) if isinstance(value, str) else None
    number = float('nan')
    if found:
        before, whole, minutes, after = found.groups()
        letter = (before or after or '').upper()
        is_whole = minutes is None or ('.' not in whole and float(minutes) < 60.0)
        is_signed = whole[0] in '-+' and letter
        if is_whole and not is_signed and not (before and after) and letter in f' {letters}':
            size = abs(float(whole)) + float(minutes or 0.0) / 60.0
            number = -size if whole[0] == '-' or letter == letters[1] else size
    elif isinstance(value, int | float) and not isinstance(value, bool):
        number = float(value)
    if not low <= number <= high:
        raise ValueError(
            f'{axis} = {shown(value)}: not usable (allowed: {low:g} to {high:g} deg, such as '
            f"47.508, '47.508 {letters[0]}' or '47 30.5 {letters[0]}')"
        )
    return number


def places(waypoints: Any) -> list[tuple[float, float]]:
    """Latitude and longitude (deg) of waypoints as a person wrote them, or of a list of a Slocum.

    A ValueError names the waypoint, its value and what is allowed.
    """
    field = 'waypoints_latlon'
    if isinstance(waypoints, str) and waypoints.lower().endswith(SUFFIX):
        field, waypoints = f'file {waypoints}', read_goto_list(Path(waypoints))
    if not isinstance(waypoints, list | tuple) or len(waypoints) < 2:
        raise ValueError(f'{field}: no list of waypoints to fly along (allowed: 2 and more)')
    found = []
    for number, point in enumerate(waypoints):
        name = f'waypoints_latlon.{number}'
        if not isinstance(point, list | tuple) or len(point) != 2:
            raise ValueError(f'{name} = {shown(point)}: allowed: [latitude, longitude] (deg)')
        try:
            found.append((degrees(point[0], 'latitude'), degrees(point[1], 'longitude')))
        except ValueError as error:
            raise ValueError(f'{name}: {error}') from None
    return found


def stretch(latitude: float, origin: Origin) -> float:
    """Share by which the chart of an origin makes lengths eastward too long at a latitude."""
    there = OriginSettings(latitude_deg=latitude).params()
    return origin.east / there.east - 1.0


def in_metres(path: Any, settings: OriginSettings | None) -> Any:
    """A path as a person wrote it, with waypoints in metres if it has them in degrees.

    Without an origin, where the one that was given is refused, it is their middle.
    A ValueError names a waypoint that is none, or at which the chart is too far off.
    """
    if not isinstance(path, dict) or path.get('waypoints_latlon') is None:
        return path
    found = places(path['waypoints_latlon'])
    settings = settings or OriginSettings(**_middle(found))
    origin, made = settings.params(), []
    if isinstance(path['waypoints_latlon'], str):
        path = {**path, 'waypoints_latlon': found}
    for number, place in enumerate(found):
        name = f'waypoints_latlon.{number}: {place_text(*place)}'
        north, east = from_geodetic(*place, origin)
        if max(abs(north), abs(east)) > MAX_DISTANCE_M:
            raise ValueError(
                f'{name}: {max(abs(north), abs(east)) / 1e3:,.0f} km from the chart origin, '
                f'{place_text(origin.latitude, origin.longitude)} (allowed: '
                f'<= {MAX_DISTANCE_M / 1e3:,.0f} km)'
            )
        off = stretch(place[0], origin)
        if abs(off) > MAX_STRETCH:
            raise ValueError(
                f'{name}: the mission is too large for a flat chart: lengths eastward are off '
                f'by {100.0 * off:+.1f} % there (allowed: '
                f'{100.0 * MAX_STRETCH:g} %; origin.latitude_deg = {settings.latitude_deg:g})'
            )
        made.append((north, east))
    if 'waypoints' in path and not _are_same(path['waypoints'], made):
        raise ValueError(
            'waypoints: other places than waypoints_latlon (allowed: one of the two alone)'
        )
    return {**path, 'waypoints': made}


def _are_same(waypoints: Any, made: list[tuple[float, float]]) -> bool:
    """Whether waypoints are those that were made, as in the scenario of a run."""
    try:
        pairs = [abs(a - b) for one, other in zip(waypoints, made, strict=True)
                 for a, b in zip(one[:2], other, strict=True)]  # fmt: skip
    except (TypeError, ValueError):
        return False
    return max(pairs) <= _SAME_M


def charted(values: dict[str, Any]) -> dict[str, Any]:
    """Values of a scenario, with what waypoints in degrees say of its origin and its start.

    Unless they say where, the origin is in their middle, and the vehicle starts at the first.
    """
    path = values.get('path')
    try:
        points = places(path['waypoints_latlon'])
    except (KeyError, TypeError, ValueError):  # no such path, or one that is refused later
        return values
    origin, initial = values.get('origin', {}), values.get('initial', {})
    if isinstance(origin, dict) and not _SAID['origin'] & set(origin):
        origin = {**origin, **_middle(points)}
        values = {**values, 'origin': origin}
    if isinstance(initial, dict) and not _SAID['initial'] & set(initial):
        try:
            start = from_geodetic(*points[0], OriginSettings.model_validate(origin).params())
        except ValueError:  # refused later
            return values
        initial = {**initial, 'north_m': start[0], 'east_m': start[1]}
        values = {**values, 'initial': initial}
    return values


def uncharted(values: dict[str, Any]) -> dict[str, Any]:
    """Values of a scenario without what was made of its waypoints in degrees, to be made anew."""
    for part, names in _SAID.items():
        rest = {name: value for name, value in values[part].items() if name not in names}
        if charted({**values, part: rest})[part] == values[part]:
            values = {**values, part: rest}
    for holder in (values, *values['orders']):
        path = holder.get('path', {})
        if 'waypoints_latlon' in path:
            del path['waypoints']
    return values


def _middle(points: list[tuple[float, float]]) -> dict[str, float]:
    """Middle of some places (deg), across the date line too."""
    latitudes = [latitude for latitude, _ in points]
    first = points[0][1]
    away = [within_180(longitude - first) for _, longitude in points]
    longitude = first + 0.5 * (min(away) + max(away))
    return {
        'latitude_deg': round(0.5 * (min(latitudes) + max(latitudes)), 4),
        'longitude_deg': round(within_180(longitude), 4),
    }


def place_text(latitude: float, longitude: float) -> str:
    """A place (deg) as a person reads it, to a metre or so: 36.25000 N, 122.30000 E."""
    north, east = 'N' if latitude >= 0.0 else 'S', 'E' if longitude >= 0.0 else 'W'
    return f'{abs(latitude):.5f} {north}, {abs(longitude):.5f} {east}'
