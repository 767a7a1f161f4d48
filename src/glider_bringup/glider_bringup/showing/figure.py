# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""A picture of a run: where it went, how deep, how far off, and what the actuators did."""

from pathlib import Path
from typing import Any

import numpy as np

from glider_bringup.showing.panels import actuators_of
from glider_bringup.showing.web_page import FlownRun
from glider_mission.disk import save_figure

#: A picture shows at most this many values of each curve.
POINTS = 8192
#: Arrows that show the current along the track.
ARROWS = 12

#: What is one of a curve of an actuator, by its unit.
_WHOLE = {'kg': 1.0, 'mm': 100.0, 'deg': 100.0}

BLUE, ORANGE, GREY, GREEN = '#1f6fb4', '#e07b1a', '#8a8a8a', '#2f8f4e'
#: Panels by their place: title, axis, and curves with name, curve of the traces, colour, and how
#: much of it is one.
_PANELS = {
    'depth': ('Depth', 'depth (m)', [('depth', 'depth_m', BLUE, 1.0)]),
    'cross': (
        'Cross-track error',
        'off the path, + to starboard (m)',
        [
            ('estimated', 'measured_cross_track_m', ORANGE, 1.0),
            ('cross-track error', 'cross_track_m', BLUE, 1.0),
        ],
    ),
    'heading': (
        'Heading',
        'heading (deg from north)',
        [('desired', 'heading_ref_deg', ORANGE, 1.0), ('heading', 'heading_deg', BLUE, 1.0)],
    ),
    'pitch': (
        'Pitch',
        'pitch, + nose up (deg)',
        [('desired', 'pitch_ref_deg', ORANGE, 1.0), ('pitch', 'pitch_deg', BLUE, 1.0)],
    ),
    'current': (
        'Current',
        'water velocity (kn)',
        [
            ('north', 'current_north_kn', BLUE, 1.0),
            ('north, estimated', 'estimate_north_kn', ORANGE, 1.0),
            ('east', 'current_east_kn', GREEN, 1.0),
            ('east, estimated', 'estimate_east_kn', GREY, 1.0),
        ],
    ),
}


def new_figure(width: float, height: float) -> Any:
    """Empty figure of matplotlib (inch)."""
    from matplotlib.figure import Figure

    return Figure(figsize=(width, height), layout='constrained')


def dress(
    axis, title: str, x: str, y: str, legend: bool = True, above: bool = False, **more
) -> None:
    """Title, labels, grid and above the curves a legend, beside the title or, ``above``, below."""
    axis.set_title(title, loc='left', pad=30.0 if above else None)
    axis.set(xlabel=x, ylabel=y)
    axis.grid(alpha=0.3)
    if legend:
        place = {'loc': 'lower right', 'bbox_to_anchor': (1.0, 1.0), 'borderaxespad': 0.0}
        axis.legend(fontsize='small', ncols=2, frameon=False, **place, **more)


def draw_curves(axis, x, title: str, labels: tuple[str, str], curves, width: float = 1.2) -> None:
    """Curves, each with name, values and colour, with a legend if there are several."""
    for name, values, colour in curves:
        axis.plot(x, values, color=colour, linewidth=width, label=name)
    dress(axis, title, *labels, legend=len(curves) > 1)


def draw_run(run: FlownRun, file: Path) -> None:
    """Draw a run into an image file; the suffix of ``file`` says which kind (png, svg, pdf)."""
    figure = new_figure(12.0, 12.0)
    axes = figure.subplot_mosaic(
        [['track', 'depth'], ['track', 'cross'], ['heading', 'pitch'], ['current', 'joints']]
    )
    traces = run.traces.thinned(POINTS)
    hours, reckons = traces.time_s() / 3600.0, traces.has('place_error_m')
    _draw_track(axes['track'], traces.samples)
    for turn_s in traces.inflections_s():
        axes['cross'].axvline(turn_s / 3600.0, color=GREY, linewidth=0.8, linestyle=':')
    if len(hours):
        axes['cross'].plot([], [], color=GREY, linestyle=':', label='inflection')
    moved = []
    for (one, _), colour in zip(actuators_of(run), (BLUE, ORANGE, GREEN, GREY), strict=False):
        text = f'{one.title.lower()} / {_WHOLE[one.unit]:g} {one.unit}'
        moved.append((text, one.position, colour, _WHOLE[one.unit]))
    joints = 'Actuators', 'share of 1 kg, 100 mm, 100 deg', moved
    for place, (name, label, curves) in {**_PANELS, 'joints': joints}.items():
        shown = [
            (text, traces.curves[curve] / one, colour)
            for text, curve, colour, one in curves
            if reckons or not curve.startswith('measured_')
        ]
        draw_curves(axes[place], hours, name, ('time (h)', label), shown)
    axes['depth'].invert_yaxis()
    figure.suptitle(f'{run.scenario.name}: {run.scenario.described}', wrap=True)
    save_figure(figure, file, dpi=100)


def _draw_track(axis, samples: dict[str, np.ndarray]) -> None:
    """Plan view with the path and arrows of the current."""
    (north, east), target, estimated = (
        (samples[f'{what}_north_m'] / 1e3, samples[f'{what}_east_m'] / 1e3)
        for what in ('track', 'target', 'believed')
    )
    axis.plot(*target[::-1], color=ORANGE, label='desired path')
    axis.plot(east, north, color=BLUE, label='track')
    if np.any(np.isfinite(estimated[0])):
        axis.plot(*estimated[::-1], color=GREEN, linestyle='--', label='estimated track')
    if len(east):
        axis.plot(east[0], north[0], 'o', color=BLUE, label='start')
        pick = np.linspace(0, len(east) - 1, ARROWS).astype(int)
        water = [samples[f'water_{name}_kn'][pick] for name in ('east', 'north')]
        if np.any(np.nan_to_num(water)):
            axis.quiver(east[pick], north[pick], *water, color=GREY, width=0.004, label='current')
    axis.set_aspect('equal', adjustable='datalim')
    dress(axis, 'Track', 'east (km)', 'north (km)')
