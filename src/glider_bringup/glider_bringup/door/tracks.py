# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""A run on other people's charts: GeoJSON (RFC 7946), KML 2.2 and GPX 1.1.

Where the vehicle was and where it believed to be, its waypoints, and where it came up.
"""

import itertools
import json
import math
from datetime import datetime, timedelta, timezone
from itertools import zip_longest
from pathlib import Path
from typing import Any, NamedTuple
from xml.etree import ElementTree

import numpy as np

from glider_base.errors import ConfigurationError
from glider_base.frames import OriginSettings, to_geodetic
from glider_bringup.scoring.scores import reckoned
from glider_bringup.showing.web_page import FlownRun
from glider_mission.disk import not_written, write_whole
from glider_mission.mafiles import mafiles
from glider_mission.scenario import Scenario

#: A track has no more points than this: more are slow to draw in a browser.
MOST_POINTS = 4000
KML, GPX = 'http://www.opengis.net/kml/2.2', 'http://www.topografix.com/GPX/1/1'


class Line(NamedTuple):
    """A way over the chart."""

    name: str
    places: list[tuple[float, float]]  #: latitude, longitude (deg)
    depths_m: list[float]
    times: list[str]  #: UTC as ISO 8601; empty where nobody knows when it was


class Point(NamedTuple):
    """A surfacing."""

    name: str
    place: tuple[float, float]  #: latitude, longitude (deg)
    time: str
    told: dict[str, Any]  #: what else is known of it


class Chart(NamedTuple):
    """What of a run is on a chart."""

    name: str
    route: list[tuple[float, float]]  #: waypoints: latitude, longitude (deg)
    lines: list[Line]
    surfacings: list[Point]

    @property
    def as_line(self) -> Line:
        """The route as a line over the chart."""
        return Line('route', self.route, [0.0] * len(self.route), [])


def start_of(scenario: Scenario, start: str | None) -> float | None:
    """When a run started (s since 1970): as its scenario says, or else as told; None if unknown.

    Raises
    ------
    ConfigurationError
        If both say it, or it is no time.
    """
    told = scenario.origin.time
    if start is not None:
        if told:
            raise ConfigurationError(
                f'--start {start}: the run has origin.time = {told} (allowed: without --start)'
            )
        try:
            told = OriginSettings(time=start).time
        except ValueError:
            told = ''
        if not told:
            raise ConfigurationError(f'--start {start}: not a time (allowed: as 2026-03-01T06:00)')
    return datetime.fromisoformat(told.replace('Z', '+00:00')).timestamp() if told else None


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
        return f'{moment:%Y-%m-%dT%H:%M:%SZ}'

    traces = flown.traces.thinned(MOST_POINTS)
    samples, lines = traces.samples, []
    for name, of in (('track', 'track'), ('believed track', 'believed')):
        columns = samples[f'{of}_north_m'], samples[f'{of}_east_m'], samples['track_depth_m']
        known = np.flatnonzero(np.isfinite(columns).all(axis=0))
        north, east, depth = (column[known] for column in columns)
        times = [when(2.0 * traces.spacing_s * at) for at in known] if began_s is not None else []
        lines.append(Line(name, places(north, east), [round(float(d), 2) for d in depth], times))
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
    norths, easts = np.array([point[:2] for point in waypoints or flown.path_points()]).T
    return Chart(
        scenario.name, places(norths, easts), [line for line in lines if line.places], surfacings
    )


def _cut(places: list[list[float]], times: list[str]) -> tuple[list, list]:
    """A line, longitude first, in parts on one side of the date line each; so are its times."""
    parts, said = [places[:1]], [times[:1]]
    for k, (one, after) in enumerate(itertools.pairwise(places), 1):
        if abs(after[0] - one[0]) > 180.0:
            edge = math.copysign(180.0, one[0])
            share = (edge - one[0]) / ((after[0] + 2.0 * edge - one[0]) or 1.0)
            rest = [a + share * (b - a) for a, b in zip(one[1:], after[1:], strict=True)]
            parts[-1].append([edge, *rest])
            parts.append([[-edge, *rest]])
            said[-1] += times[k : k + 1]
            said.append(times[k : k + 1])
        parts[-1].append(after)
        said[-1] += times[k : k + 1]
    return parts, said


def geojson(chart: Chart) -> bytes:
    """A FeatureCollection: lines of route and tracks, points of surfacings."""

    def at(place: tuple[float, float], *depth: float) -> list[float]:
        return [round(place[1], 7), round(place[0], 7), *(-d for d in depth)]

    def feature(kind: str, coordinates: list, **told: Any) -> dict[str, Any]:
        geometry = {'type': kind, 'coordinates': coordinates}
        return {'type': 'Feature', 'properties': told, 'geometry': geometry}

    def way(name: str, places: list[list[float]], times: list[str]) -> dict[str, Any]:
        parts, said = _cut(places, times)
        kind, inside, when = ('LineString', parts[0], said[0])
        if len(parts) > 1:
            kind, inside, when = ('MultiLineString', parts, said)
        return feature(kind, inside, name=name, **({'times': when} if times else {}))

    features = []
    if chart.route:
        features.append(way('route', [at(place) for place in chart.route], []))
    for line in chart.lines:
        pairs = zip(line.places, line.depths_m, strict=True)
        features.append(way(line.name, [at(*pair) for pair in pairs], line.times))
    for point in chart.surfacings:
        told = {'name': point.name} | ({'time': point.time} if point.time else {}) | point.told
        features.append(feature('Point', at(point.place), **told))
    return json.dumps({'type': 'FeatureCollection', 'features': features}).encode()


def kml(chart: Chart) -> bytes:
    """A document with a placemark for each line and surfacing."""

    def placemark(name: str, time: str, kind: str, places, depths_m) -> ElementTree.Element:
        pairs = zip(places, depths_m, strict=True)
        told = (f'{place[1]:.7f},{place[0]:.7f},{-depth:.2f}' for place, depth in pairs)
        mode = 'absolute' if any(depths_m) else 'clampToGround'
        shape = _element(
            kind, _element('altitudeMode', mode), _element('coordinates', ' '.join(told))
        )
        stamp = [_element('TimeStamp', _element('when', time))] if time else []
        return _element('Placemark', _element('name', name), *stamp, shape)

    marks = [
        placemark(line.name, '', 'LineString', line.places, line.depths_m)
        for line in [chart.as_line, *chart.lines]
        if line.places
    ]
    marks += [
        placemark(one.name, one.time, 'Point', [one.place], [0.0]) for one in chart.surfacings
    ]
    document = _element('Document', _element('name', chart.name), *marks)
    return _text(_element('kml', document, xmlns=KML))


def gpx(chart: Chart) -> bytes:
    """Surfacings as waypoints, the waypoints as a route, the tracks as tracks."""

    def at(tag: str, place, time: str = '', name: str = '', depth: float | None = None):
        told = {'ele': '' if depth is None else f'{-depth:.2f}', 'time': time, 'name': name}
        inside = [_element(key, text) for key, text in told.items() if text]
        return _element(tag, *inside, lat=f'{place[0]:.7f}', lon=f'{place[1]:.7f}')

    inside = [at('wpt', one.place, one.time, one.name) for one in chart.surfacings]
    if chart.route:
        route = (at('rtept', place) for place in chart.route)
        inside.append(_element('rte', _element('name', chart.name), *route))
    for line in chart.lines:
        rows = zip_longest(line.places, line.times, line.depths_m, fillvalue='')
        points = (at('trkpt', place, time, depth=depth) for place, time, depth in rows)
        inside.append(_element('trk', _element('name', line.name), _element('trkseg', *points)))
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

    Raises
    ------
    ConfigurationError
        If its path has no waypoints or it follows a path in three dimensions, or the files cannot
        be written.
    """
    scenario = flown.scenario
    path, profile, origin = scenario.path, scenario.profile, scenario.origin.params()
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
