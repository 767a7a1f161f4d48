# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""Files of ocean models as people see them: what is in one, and charts of it."""

import math
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from scipy.integrate import trapezoid

from glider_base.frames import on_chart, within_180
from glider_base.settings import ConfigurationError
from glider_bringup.showing.figure import GREEN, ORANGE, new_figure
from glider_bringup.showing.words import count
from glider_mission.chart import place_text
from glider_mission.disk import save_figure
from glider_mission.routing.plan import Plan
from glider_mission.scenario import Scenario, check_ways, load_scenario, named_in
from glider_model.ocean.bottom import BathymetrySettings
from glider_model.ocean.fields.grid import GridSettings
from glider_model.ocean.grid_file import GRIDS, Loaded, Part, contents, time_text
from glider_model.ocean.water import ModelWaterSettings

#: Arrows along either side of a chart.
_ARROWS = 22
#: A mission without the files that it has itself.
_NO_FILES = {
    **dict.fromkeys(('current', 'navigation.forecast'), {'speed_mps': 0.0, 'direction_deg': 0.0}),
    'water.grid': {},
    'bathymetry': {},
}


class Panel(NamedTuple):
    """A chart of one quantity."""

    title: str
    label: str  #: of the colours
    colours: str
    latitudes: np.ndarray  #: float64[y] (deg)
    longitudes: np.ndarray  #: float64[x] (deg)
    values: np.ndarray  #: float[y, x]; nan: land
    #: velocities to the north and to the east, float[y, x]
    arrows: tuple[np.ndarray, np.ndarray] | None = None


class Sea(NamedTuple):
    """What is to be drawn."""

    title: str
    panels: list[Panel]
    scenario: Scenario | None


def look(file: Path) -> tuple[dict[str, Any], Sea]:
    """What is in a file, and its uppermost water in the middle of its time, if that is not huge.

    A ConfigurationError names the file, and why nothing of it can be used.
    """
    try:
        found = contents(file)
    except ValueError as error:
        raise ConfigurationError(str(error)) from None
    listing = {
        'file': str(file),
        'source': found.source,
        **dict.fromkeys(GRIDS),
        **{name: _listed(name, part) for name, part in found.parts.items()},
        'refused': found.refused,
        'mission': None,
    }
    seen = {name: part.seen for name, part in found.parts.items() if part.seen}
    panels = []
    for name, one in seen.items():
        axes = one.axes._replace(depths=one.axes.depths[:1])
        panels += _panels(name, one._replace(axes=axes, water=one.water[:, :1]))
    return listing, Sea(file.name, panels, None)


def _listed(name: str, part: Part) -> dict[str, Any]:
    """What a part of a file is, how far it goes, and the range of its numbers."""
    variables = [{**one, 'low': None, 'high': None} for one in part.variables]
    listed = {'variables': variables, **_extent(part.axes), 'seen': None, 'land_share': None}
    if name == 'currents':
        listed['speed_mps'] = None
    if part.seen is None:  # too large to look at as a whole
        return listed
    axes, water, _, land = part.seen
    numbers = list(np.moveaxis(water[0][:, ~land], -1, 0))
    if 'time' in part.axes:
        depth = {'first': axes.depths[0], 'last': axes.depths[-1]}
        listed['seen'] = {'time': time_text(axes.times[0]), 'depth_m': depth}
    listed['land_share'] = float(land.mean())
    if not land.all():
        for one, values in zip(variables, numbers, strict=True):
            one |= {'low': float(values.min()), 'high': float(values.max())}
        if name == 'currents':
            speed = np.hypot(*(values[0].astype(float) for values in numbers))
            rms = math.sqrt(float(np.mean(speed**2)))
            listed['speed_mps'] = {'rms': rms, 'max': float(speed.max())}
    return listed


def _extent(axes: dict[str, np.ndarray]) -> dict[str, Any]:
    """How far the axes of a part go."""
    names = {'depth': 'depth_m', 'latitude': 'latitude_deg', 'longitude': 'longitude_deg'}
    extent = {
        names[axis]: {'first': one[0], 'last': one[-1], 'count': len(one)}
        for axis, one in axes.items()
        if axis in names
    }
    times = axes.get('time')
    if times is None:
        return extent
    step = float(np.median(np.diff(times))) / 3600.0 if len(times) > 1 else None
    ends = {'first': time_text(times[0]), 'last': time_text(times[-1])}
    return {'times': {**ends, 'count': len(times), 'step_h': step}, **extent}


def in_words(listing: dict[str, Any]) -> list[tuple[str, str]]:
    """Name and text of each line of what is in a file."""
    rows, before = [('source', listing['source'] or '-')], []
    for name in GRIDS:
        part = listing[name]
        if not part:
            continue
        for one in part['variables']:
            text = f'{one["name"]} ({one["standard_name"]}, {one["units"] or "no units"})'
            if one['low'] is not None:
                text += f': {one["low"]:.2f} to {one["high"]:.2f} {one["unit"]}'
            rows.append((one['what'], text))
        if part.get('speed_mps'):
            speed = part['speed_mps']
            text = f'rms {speed["rms"]:.2f} m/s, at most {speed["max"]:.2f} m/s'
            rows.append(('speed', f'{text}, at the uppermost level'))
        where = _where(part)
        rows += [row for row in where if row not in before]
        before = where
    rows += [(name, f'cannot be used: {reason}') for name, reason in listing['refused'].items()]
    if listing['mission']:
        used = ', '.join(name for name in GRIDS if listing[name])
        covered = f'is covered by {used}' if listing['mission']['covered'] else 'is not covered'
        rows.append(('mission', f'{listing["mission"]["scenario"]} {covered}'))
    return rows


def _where(part: dict[str, Any]) -> list[tuple[str, str]]:
    """Lines of how far a part goes."""
    rows = []
    if 'times' in part:
        times, depth = part['times'], part['depth_m']
        step = f', every {times["step_h"]:g} h' if times['step_h'] else ', a steady sea'
        levels = count(depth['count'], 'level')
        rows = [
            ('times', f'{times["first"]} to {times["last"]}, {times["count"]}{step}'),
            ('depths', f'{depth["first"]:g} to {depth["last"]:g} m, {levels}'),
        ]
    if part['seen']:
        depth = part['seen']['depth_m']
        text = f'{part["seen"]["time"]}, {depth["first"]:g} to {depth["last"]:g} m'
        rows.append(('ranges are of', text))
    south, north = part['latitude_deg'], part['longitude_deg']
    corners = [place_text(south[k], within_180(north[k])) for k in ('first', 'last')]
    rows.append(('places', f'{corners[0]} to {corners[1]}, {south["count"]} x {north["count"]}'))
    if part['land_share'] is not None:
        of = 'the uppermost level' if 'times' in part else 'the chart'
        rows.append(('land', f'{100.0 * part["land_share"]:.1f} % of {of}'))
    return rows


def mission_in(listing: dict[str, Any], name: str) -> Sea:
    """What a mission meets at its start, if it flies in the water and over the bottom of a file.

    Raises ConfigurationError if the file does not cover it, and why.
    """
    file = Path(listing['file']).resolve()
    scenario = load_scenario(name, _NO_FILES)
    mission, panels = scenario.mission(), []
    with named_in('', ValueError):
        for kind in (GridSettings, ModelWaterSettings, BathymetrySettings):
            if listing[part := kind.of]:
                grid = kind(file=str(file)).resolved(mission)
                check_ways(scenario, grid, part == 'bottom' or not listing['bottom'])
                loaded, begin = grid.loaded()
                step = np.searchsorted(loaded.axes.times, begin, side='right') - 1
                axes = loaded.axes._replace(times=loaded.axes.times[step:])
                panels += _panels(part, loaded._replace(axes=axes, water=loaded.water[step:]))
    return Sea(f'{file.name} at the start of {scenario.name}', panels, scenario)


def _panels(name: str, seen: Loaded) -> list[Panel]:
    """Charts of the mean current over the levels, of the uppermost water, or of the bottom."""
    (time, *_), levels, *places = seen.axes
    if name == 'bottom':
        depth = np.where(seen.land, np.nan, seen.water[0, 0, ..., 0])
        return [Panel('bottom', 'depth of the bottom (m)', 'Blues', *places, depth)]
    at = f'at {levels[0]:g} m, {time_text(time)}'
    if name == 'currents':
        mean, title = seen.water[0, 0], f'current {at}'
        if len(levels) > 1:
            mean = trapezoid(seen.water[0], levels, axis=0) / (levels[-1] - levels[0])
            title = f'mean current, {levels[0]:g} to {levels[-1]:g} m, {time_text(time)}'
        arrows = tuple(np.where(seen.land, np.nan, mean[..., k]) for k in (0, 1))
        return [Panel(title, 'speed (m/s)', 'Blues', *places, np.hypot(*arrows), arrows)]
    water = np.where(seen.land, np.nan, np.moveaxis(seen.water[0, 0], -1, 0))
    return [
        Panel(*(f'{one.what} {at}', f'{one.what} ({one.unit})', colours), *(*places, values))
        for one, colours, values in zip(GRIDS[name], ('viridis', 'Purples'), water, strict=True)
    ]


def draw_sea(sea: Sea, file: Path) -> None:
    """Draw charts of a sea, and the path of a mission.

    Raises ConfigurationError if the image cannot be written, or all there is is too large.
    """
    if not sea.panels:
        raise ConfigurationError(
            f'{file}: not drawn: all of {sea.title} is too large (allowed: the window of a '
            'mission, by --mission)'
        )
    rows, columns = -(-len(sea.panels) // 2), min(2, len(sea.panels))
    figure = new_figure(8.0 * columns, 6.5 * rows)
    has_land = any(np.isnan(panel.values).any() for panel in sea.panels)
    figure.suptitle(f'{sea.title} (grey: land)' if has_land else sea.title)
    for place, panel in enumerate(sea.panels, 1):
        axis = _draw_panel(figure, (rows, columns, place), panel)
        axis.set_title(panel.title)
        axis.set_aspect(1.0 / math.cos(math.radians(float(np.mean(panel.latitudes)))))
        axis.set_facecolor('#c9c2b8')
        if sea.scenario:
            _draw_path(axis, sea.scenario)
    save_figure(figure, file, 150)


def draw_plan(made: Plan, scenario: Scenario, file: Path) -> None:
    """Draw a plan: the current at the start, fronts of each leg every 12 h, route and path.

    Raises ConfigurationError if the image cannot be written.
    """
    chart, origin = made.chart, scenario.origin.params()
    ways = np.concatenate([scenario.path.points(200)[:, :2], made.route.corners])
    first, last = ways.min(axis=0), ways.max(axis=0)
    around = 1.5 * max(*(last - first), 2.0 * (chart.norths[1] - chart.norths[0]))
    n, e = (
        np.flatnonzero(np.abs(axis - middle) <= around)
        for axis, middle in zip(chart[1:3], 0.5 * (first + last), strict=True)
    )
    latitudes, longitudes = on_chart(chart.norths[n], chart.easts[e], origin)
    north, east = np.moveaxis(chart.current[0][np.ix_(n, e)], -1, 0)
    label = 'depth-averaged current at the start (m/s)'
    speed = np.hypot(north, east)
    panel = Panel('', label, 'Blues', latitudes, longitudes, speed, (north, east))
    axis = _draw_panel(new_figure(8.0, 6.5), (1, 1, 1), panel)
    axis.set_title(f'{scenario.name}: fronts every 12 h of each leg')
    axis.set_aspect(1.0 / math.cos(math.radians(origin.latitude)))
    for arrivals in filter(np.size, made.route.fronts):  # empty of a leg that is not begun
        reached = np.ma.masked_invalid(arrivals[np.ix_(n, e)] / 3600.0)
        if reached.count():
            levels = np.arange(0.0, float(reached.max()) + 12.0, 12.0)
            axis.contour(longitudes, latitudes, reached, levels, colors='#666666', linewidths=0.5)
    _draw_path(axis, scenario)
    latitude, longitude = on_chart(*made.route.corners.T, origin)
    label = 'planned route' if made.reachable else 'does not arrive in its time'
    axis.plot(longitude, latitude, color=GREEN, label=label)
    axis.legend(loc='upper right', fontsize='small')
    save_figure(axis.figure, file, 150)


def _draw_panel(figure: Any, place: tuple[int, int, int], panel: Panel) -> Any:
    """Axis of a figure with colours, and with arrows of a current."""
    axis = figure.add_subplot(*place, xlabel='longitude (deg)', ylabel='latitude (deg)')
    axis.xaxis.set_major_formatter(lambda degree, _: f'{within_180(degree):.8g}')
    latitudes, longitudes = panel.latitudes, panel.longitudes
    drawn = axis.pcolormesh(longitudes, latitudes, panel.values, cmap=panel.colours)
    figure.colorbar(drawn, label=panel.label)
    if panel.arrows:
        thin = [slice(None, None, -(-len(one) // _ARROWS)) for one in (latitudes, longitudes)]
        north, east = (one[tuple(thin)] for one in panel.arrows)
        axis.quiver(longitudes[thin[1]], latitudes[thin[0]], east, north, width=0.002)
    return axis


def _draw_path(axis: Any, scenario: Scenario) -> None:
    north, east, *_ = scenario.path.points(200).T
    latitude, longitude = on_chart(north, east, scenario.origin.params())
    axis.plot(longitude, latitude, color=ORANGE, label=scenario.name)
    axis.plot(longitude[:1], latitude[:1], 'o', color=ORANGE)
    axis.legend(loc='upper right', fontsize='small')
