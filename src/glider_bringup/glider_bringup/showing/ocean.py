# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""Currents of an ocean model as people see them: what is in a file, and a chart."""

import math
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from glider_base.frames import on_chart
from glider_base.settings import ConfigurationError
from glider_bringup.showing.figure import GREEN, ORANGE, new_figure
from glider_mission.chart import place_told
from glider_mission.disk import save_figure
from glider_mission.routing.plan import Plan
from glider_mission.scenario import Scenario, load_scenario
from glider_model.ocean.grid_file import Axes, Loaded, Window, contents, load, told_time

#: Arrows along either side of a chart.
_ARROWS = 22


class Sea(NamedTuple):
    """Water to be drawn."""

    title: str
    loaded: Loaded
    scenario: Scenario | None


def look(file: Path) -> tuple[dict[str, Any], Sea | None]:
    """What is in a file, and its uppermost water in the middle of its time, if that is not huge.

    Raises
    ------
    ConfigurationError
        Naming the file, and what is missing in it.
    """
    try:
        found = contents(file)
    except ValueError as error:
        raise ConfigurationError(str(error)) from None
    axes = found.axes
    told = {
        'file': str(file),
        'variables': found.variables,
        'source': found.source,
        **_extent(axes),
        'land_share': None,
        'speed_mps': None,
        'mission': None,
    }
    middle = float(axes.times[len(axes.times) // 2])
    everywhere = Window(
        *(axes.latitudes[0], axes.latitudes[-1], axes.longitudes[0], axes.longitudes[-1]),
        *(0.0, middle, 0.0),
    )
    try:
        loaded = load(file, everywhere)
    except ValueError:  # too large to look at as a whole
        return told, None
    speed = np.hypot(*np.moveaxis(loaded.water[0, 0], -1, 0))[~loaded.land]
    told['land_share'] = float(loaded.land.mean())
    if len(speed):
        rms, most = math.sqrt(float(np.mean(speed**2))), float(speed.max())
        told['speed_mps'] = {'rms': rms, 'max': most}
    return told, Sea(f'{file.name}, {told_time(middle)}', loaded, None)


def _extent(axes: Axes) -> dict[str, Any]:
    """How far the axes of a file go."""
    times, *places = axes
    return {
        'times': {
            'first': told_time(times[0]),
            'last': told_time(times[-1]),
            'count': len(times),
            'step_h': float(np.median(np.diff(times))) / 3600.0 if len(times) > 1 else None,
        },
        **{
            name: {'first': one[0], 'last': one[-1], 'count': len(one)}
            for name, one in zip(('depth_m', 'latitude_deg', 'longitude_deg'), places, strict=True)
        },
    }


def in_words(told: dict[str, Any]) -> list[tuple[str, str]]:
    """Name and text of each line of what is in a file."""
    times, depth = told['times'], told['depth_m']
    step = f', every {times["step_h"]:g} h' if times['step_h'] else ', a steady sea'
    south, north = told['latitude_deg'], told['longitude_deg']
    corners = [place_told(south[k], (north[k] + 180.0) % 360.0 - 180.0) for k in ('first', 'last')]
    rows = [
        ('velocities', ' and '.join(told['variables'])),
        ('source', told['source'] or '-'),
        ('times', f'{times["first"]} to {times["last"]}, {times["count"]}{step}'),
        ('depths', f'{depth["first"]:g} to {depth["last"]:g} m, {depth["count"]}'),
        ('places', f'{corners[0]} to {corners[1]}, {south["count"]} x {north["count"]}'),
    ]
    if told['land_share'] is not None:
        rows.append(('land', f'{100.0 * told["land_share"]:.1f} % of the uppermost level'))
    if told['speed_mps']:
        speed = told['speed_mps']
        rows.append(('speed there', f'rms {speed["rms"]:.2f} m/s, at most {speed["max"]:.2f} m/s'))
    if told['mission']:
        covered = 'is covered' if told['mission']['covered'] else 'is not covered'
        rows.append(('mission', f'{told["mission"]["scenario"]} {covered}'))
    return rows


def mission_in(file: Path, name: str) -> Sea:
    """Water that a mission meets at its start, if it flies in the currents of a file.

    Raises
    ------
    ConfigurationError
        If the file does not cover it, and why.
    """
    field = {'kind': 'grid', 'file': str(file.resolve())}
    scenario = load_scenario(name, {'current.field': field})
    params = scenario.current_settings().field.params()
    axes = Axes(params.times, params.depths, params.latitudes, params.longitudes)
    none = np.zeros((len(axes.latitudes), len(axes.longitudes)), dtype=bool)
    loaded = Loaded(axes, params.water, (), none)
    return Sea(f'{file.name} at the start of {scenario.name}', loaded, scenario)


def draw_sea(sea: Sea, file: Path) -> None:
    """Draw a chart of the mean current over the levels that were read, and the path of a mission.

    Raises
    ------
    ConfigurationError
        If the image cannot be written.
    """
    axes, water = sea.loaded.axes, sea.loaded.water[0]
    levels = axes.depths
    share = np.gradient(levels) if len(levels) > 1 else np.ones(1)
    mean = np.tensordot(share / share.sum(), water, axes=1)
    north, east = (np.where(sea.loaded.land, np.nan, mean[..., k]) for k in (0, 1))
    depths = f'{levels[0]:g} m' if len(levels) == 1 else f'{levels[0]:g} to {levels[-1]:g} m'
    label = 'speed of the mean current (m/s)'
    axis = _draw_current(axes.latitudes, axes.longitudes, north, east, label)
    axis.set_title(f'{sea.title}, {depths}')
    axis.set_aspect(1.0 / math.cos(math.radians(float(np.mean(axes.latitudes)))))
    axis.set_facecolor('#c9c2b8')
    if sea.scenario:
        _draw_path(axis, sea.scenario)
    save_figure(axis.figure, file, 150)


def draw_plan(made: Plan, scenario: Scenario, file: Path) -> None:
    """Draw a plan: the current at the start, fronts of each leg every 12 h, route and path.

    Raises
    ------
    ConfigurationError
        If the image cannot be written.
    """
    chart, origin = made.chart, scenario.origin.params()
    latitudes, longitudes = on_chart(chart.norths, chart.easts, origin)
    north, east = np.moveaxis(chart.current[0], -1, 0)
    label = 'depth-averaged current at the start (m/s)'
    axis = _draw_current(latitudes, longitudes, north, east, label)
    axis.set_title(f'{scenario.name}: fronts every 12 h of each leg')
    axis.set_aspect(1.0 / math.cos(math.radians(origin.latitude)))
    for arrivals in made.route.fronts:
        reached = np.ma.masked_invalid(arrivals / 3600.0)
        if reached.count():
            levels = np.arange(0.0, float(reached.max()) + 12.0, 12.0)
            axis.contour(longitudes, latitudes, reached, levels, colors='#666666', linewidths=0.5)
    _draw_path(axis, scenario)
    latitude, longitude = on_chart(*made.route.corners.T, origin)
    axis.plot(longitude, latitude, color=GREEN, label='planned route')
    axis.legend(loc='upper right', fontsize='small')
    save_figure(axis.figure, file, 150)


def _draw_current(latitudes, longitudes, north, east, label: str) -> Any:
    """Axis of a new figure with a current (m/s): how fast it is, and arrows."""
    figure = new_figure(8.0, 6.5)
    axis = figure.add_subplot(xlabel='longitude (deg)', ylabel='latitude (deg)')
    drawn = axis.pcolormesh(longitudes, latitudes, np.hypot(north, east), cmap='Blues')
    figure.colorbar(drawn, label=label)
    rows, columns = (slice(None, None, -(-len(one) // _ARROWS)) for one in (latitudes, longitudes))
    places = longitudes[columns], latitudes[rows]
    axis.quiver(*places, east[rows, columns], north[rows, columns], width=0.002)
    return axis


def _draw_path(axis: Any, scenario: Scenario) -> None:
    north, east, *_ = scenario.path.points(200).T
    latitude, longitude = on_chart(north, east, scenario.origin.params())
    axis.plot(longitude, latitude, color=ORANGE, label=scenario.name)
    axis.plot(longitude[:1], latitude[:1], 'o', color=ORANGE)
    axis.legend(loc='upper right', fontsize='small')
