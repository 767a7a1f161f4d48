# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""A run on other people's charts: GeoJSON (RFC 7946), KML 2.2 and GPX 1.1.

Where the vehicle was and its estimated positions, its waypoints, and where it came up.
"""

import itertools
import json
import math
from datetime import datetime, timedelta, timezone
from pathlib import Path
from typing import Any, NamedTuple
from xml.etree import ElementTree

import numpy as np

from glider_base.errors import ConfigurationError
from glider_base.frames import OriginSettings, to_geodetic
from glider_base.signals import TICK_S
from glider_bringup.scoring.scores import reckoned
from glider_bringup.showing.web_page import FlownRun
from glider_guidance.orders import changed
from glider_mission.disk import not_written, write_whole
from glider_mission.mafiles import mafiles
from glider_mission.scenario import Scenario

#: A track has no more points than this: more are slow to draw in a browser.
MOST_POINTS = 4000
_TIME = '%Y-%m-%dT%H:%M:%SZ'
KML, GPX = 'http://www.opengis.net/kml/2.2', 'http://www.topografix.com/GPX/1/1'


class Row(NamedTuple):
    """A place of a line, and when it was there."""

    latitude: float  #: (deg)
    longitude: float
    depth_m: float | None = None  #: None of what has none
    time: str = ''  #: UTC as ISO 8601; empty where nobody knows when it was


class Point(NamedTuple):
    """A surfacing."""

    name: str
    place: tuple[float, float]  #: latitude, longitude (deg)
    time: str
    about: dict[str, Any]  #: what else is known of it


class Chart(NamedTuple):
    """What of a run is on a chart."""

    name: str
    lines: dict[str, list[Row]]  #: by their names: the route, by its waypoints, and the tracks
    surfacings: list[Point]


def start_of(scenario: Scenario, start: str | None) -> float | None:
    """When a run started (s since 1970): as its scenario says, or else as given; None if unknown.

    Raises ConfigurationError if both say it, or it is no time.
    """
    own = scenario.origin.time
    if start is not None:
        if own:
            raise ConfigurationError(
                f'--start {start}: the run has origin.time = {own} (allowed: without --start)'
            )
        try:
            own = OriginSettings(time=start).time
        except ValueError:
            own = ''
        if not own:
            raise ConfigurationError(
                f'--start {start}: not a time (allowed: as 2026-03-01T06:00, of 1900 to 2199)'
            )
    return datetime.fromisoformat(own.replace('Z', '+00:00')).timestamp() if own else None


def chart_of(flown: FlownRun, began_s: float | None) -> Chart:
    """What of a run is on a chart; times where it is known when it started (s since 1970)."""
    scenario = flown.scenario
    origin = scenario.origin.params()

    def places(norths, easts) -> list[tuple[float, float]]:
        pairs = zip(norths, easts, strict=True)
        return [to_geodetic(float(north), float(east), origin) for north, east in pairs]

    def when(t_s: float) -> str:
        if began_s is None:
            return ''
        moment = datetime.fromtimestamp(began_s, timezone.utc) + timedelta(seconds=float(t_s))
        return f'{moment:{_TIME}}'

    traces = flown.traces.thinned(MOST_POINTS)
    samples, tracks = traces.samples, {}
    for name, of in (('track', 'track'), ('estimated track', 'believed')):
        columns = samples[f'{of}_north_m'], samples[f'{of}_east_m'], samples['track_depth_m']
        known = np.flatnonzero(np.isfinite(columns).all(axis=0))
        north, east, depth = (column[known] for column in columns)
        seconds = np.minimum(2.0 * traces.spacing_s * known, (traces.ticks - 1) * TICK_S)
        rows = zip(places(north, east), depth.tolist(), map(when, seconds), strict=True)
        tracks[name] = [Row(*one, round(m, 2), time) for one, m, time in rows]
    surfacings = [
        Point(
            f'surfacing {number}',
            to_geodetic(*map(float, report['true_ned_m'][:2]), origin),
            when(report['t_s']),
            {name: report[name] for name in ('t_s', 'error_m', 'dac_believed_mps')},
        )
        for number, report in enumerate((reckoned(flown.card) or {}).get('reports', []), 1)
    ]
    waypoints = None if flown.is_rerouted else getattr(scenario.path, 'waypoints', None)
    points = waypoints or flown.path_points()
    if scenario.path.kind == 'straight' and not flown.is_rerouted:
        points = [points[0], points[-1]]  # a plotter takes a hundred points or so
    norths, easts = np.array([point[:2] for point in points]).T
    lines = {'route': [Row(*place) for place in places(norths, easts)], **tracks}
    return Chart(scenario.name, {name: rows for name, rows in lines.items() if rows}, surfacings)


def _parts(line: list[Row]) -> list[list[Row]]:
    """A line in parts on one side of the date line each, as RFC 7946 has it (section 3.1.9)."""
    parts = [line[:1]]
    for one, after in itertools.pairwise(line):
        if abs(after.longitude - one.longitude) > 180.0:
            edge = math.copysign(180.0, one.longitude)
            way = after.longitude + 2.0 * edge - one.longitude
            share = (edge - one.longitude) / (way or 1.0)
            latitude = one.latitude + share * (after.latitude - one.latitude)
            there = after._replace(latitude=latitude, longitude=edge)
            if one.depth_m is not None:
                depth = one.depth_m + share * (after.depth_m - one.depth_m)
                there = there._replace(depth_m=round(depth, 2))
            if one.time:
                began, ended = (datetime.strptime(row.time, _TIME) for row in (one, after))
                there = there._replace(time=f'{began + share * (ended - began):{_TIME}}')
            parts[-1].append(there)
            parts.append([there._replace(longitude=-edge)])
        parts[-1].append(after)
    return parts


def geojson(chart: Chart) -> bytes:
    """A FeatureCollection: lines of route and tracks, points of surfacings."""

    def at(latitude: float, longitude: float, depth: float | None = None) -> list[float]:
        return [round(longitude, 7), round(latitude, 7), *([] if depth is None else [-depth])]

    def feature(kind: str, coordinates: list, **about: Any) -> dict[str, Any]:
        geometry = {'type': kind, 'coordinates': coordinates}
        return {'type': 'Feature', 'properties': about, 'geometry': geometry}

    features = []
    for name, line in chart.lines.items():
        parts = _parts(line)
        inside = [[at(*row[:3]) for row in part] for part in parts]
        when = [[row.time for row in part] for part in parts] if line[0].time else []
        kind = 'MultiLineString'
        if len(parts) == 1:
            kind, inside, when = 'LineString', inside[0], when and when[0]
        about = {'name': name} | ({'times': when} if when else {})
        features.append(feature(kind, inside, **about))
    for point in chart.surfacings:
        about = {'name': point.name} | ({'time': point.time} if point.time else {}) | point.about
        features.append(feature('Point', at(*point.place), **about))
    return json.dumps({'type': 'FeatureCollection', 'features': features}).encode()


def kml(chart: Chart) -> bytes:
    """A document with a placemark for each line and surfacing."""

    def shape(kind: str, rows: list[Row], is_deep: bool = False) -> ElementTree.Element:
        places = (f'{x:.7f},{y:.7f},{-(depth or 0.0):.2f}' for y, x, depth, _ in rows)
        mode = _element('altitudeMode', 'absolute' if is_deep else 'clampToGround')
        return _element(kind, mode, _element('coordinates', ' '.join(places)))

    marks = []
    for name, line in chart.lines.items():
        is_deep = any(row.depth_m for row in line)
        parts = [shape('LineString', part, is_deep) for part in _parts(line)]
        whole = parts[0] if len(parts) == 1 else _element('MultiGeometry', *parts)
        marks.append(_element('Placemark', _element('name', name), whole))
    for one in chart.surfacings:
        stamp = [_element('TimeStamp', _element('when', one.time))] if one.time else []
        place = shape('Point', [Row(*one.place)])
        marks.append(_element('Placemark', _element('name', one.name), *stamp, place))
    document = _element('Document', _element('name', chart.name), *marks)
    return _text(_element('kml', document, xmlns=KML))


def gpx(chart: Chart) -> bytes:
    """Surfacings as waypoints, the waypoints as a route, the tracks as tracks."""

    def at(tag: str, row: Row, name: str = '') -> ElementTree.Element:
        depth = '' if row.depth_m is None else f'{-row.depth_m:.2f}'
        children = {'ele': depth, 'time': row.time, 'name': name}
        inside = [_element(key, text) for key, text in children.items() if text]
        east = min(row.longitude, 179.9999999)  # less than 180, by its schema
        return _element(tag, *inside, lat=f'{row.latitude:.7f}', lon=f'{east:.7f}')

    inside = [at('wpt', Row(*one.place, None, one.time), one.name) for one in chart.surfacings]
    for name, line in chart.lines.items():
        if name == 'route':
            for part in _parts(line):
                route = (at('rtept', row) for row in part)
                inside.append(_element('rte', _element('name', chart.name), *route))
            continue
        parts = (_element('trkseg', *(at('trkpt', row) for row in part)) for part in _parts(line))
        inside.append(_element('trk', _element('name', name), *parts))
    return _text(_element('gpx', *inside, version='1.1', creator='glider stack', xmlns=GPX))


def _element(tag: str, *inside: ElementTree.Element | str, **about: str) -> ElementTree.Element:
    made = ElementTree.Element(tag, about)
    for one in inside:
        if isinstance(one, str):
            made.text = one
        else:
            made.append(one)
    return made


def _text(root: ElementTree.Element) -> bytes:
    ElementTree.indent(root)
    return ElementTree.tostring(root, encoding='UTF-8', xml_declaration=True)


CHARTS = {'geojson': geojson, 'kml': kml, 'gpx': gpx}


def write_mafiles(flown: FlownRun, folder: Path) -> None:
    """Write the mission of a run into a folder, as files of a Slocum's.

    Orders at its start are a part of it, such as a planned route. Raises ConfigurationError if
    there are later ones, its path has no waypoints, it follows a path in three dimensions, or the
    files cannot be written.
    """
    scenario = flown.scenario
    told, origin = scenario.guidance_settings(), scenario.origin.params()
    for number, order in enumerate(scenario.orders):
        if order.tick > 1 or order.abort or order.hold:
            raise ConfigurationError(
                f'{flown.label}: orders.{number}: files of a Slocum say no later orders (allowed: '
                'those of a path or a profile, at_s = 0)'
            )
        told = changed(told, order)
    path, profile = told.path, told.profile
    if path.kind != 'waypoints':
        raise ConfigurationError(
            f'{flown.label}: path.kind = {path.kind}: has no waypoints (allowed: waypoints)'
        )
    if profile.mode != 'profile':
        raise ConfigurationError(
            f'{flown.label}: profile.mode = {profile.mode}: has no yo (allowed: profile)'
        )
    places = [to_geodetic(*point[:2], origin) for point in path.waypoints]
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise not_written(folder, error) from None
    for name, text in mafiles(scenario.name, places, profile).items():
        write_whole(folder / name, text)
