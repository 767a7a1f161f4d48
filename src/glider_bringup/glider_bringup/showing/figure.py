# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""A picture of a run: where it went, how deep, how far off, and what the actuators did."""

from pathlib import Path

import numpy as np

from glider_bringup.mission.disk import save_figure
from glider_bringup.scoring.traces import Traces

#: A picture shows at most this many values of each curve.
POINTS = 8192
#: Arrows that show the current along the track.
ARROWS = 12

_BLUE, _ORANGE, _GREY, _GREEN = '#1f6fb4', '#e07b1a', '#8a8a8a', '#2f8f4e'


def draw_run(traces: Traces, title: str, file: Path) -> None:
    """Draw a run into an image file; the suffix of ``file`` says which kind (png, svg, pdf)."""
    import matplotlib

    matplotlib.use('Agg')
    from matplotlib import pyplot

    figure, axes = pyplot.subplot_mosaic(
        [['track', 'depth'], ['track', 'cross'], ['heading', 'pitch'], ['current', 'joints']],
        figsize=(12.0, 12.0),
        height_ratios=[1.0, 1.0, 1.0, 1.0],
        layout='constrained',
    )
    traces = traces.thinned(POINTS)
    curves = traces.curves
    hours = traces.time_s() / 3600.0
    _draw_track(axes['track'], traces.samples)
    believed = ()
    if traces.has('place_error_m'):
        believed = (('believed', curves['measured_cross_track_m'], _ORANGE),)
    _draw_curves(
        axes['depth'], hours, 'Depth', 'depth (m)', (('depth', curves['depth_m'], _BLUE),)
    )
    axes['depth'].invert_yaxis()
    _draw_curves(
        axes['cross'],
        hours,
        'Cross-track error',
        'off the path, + to starboard (m)',
        (*believed, ('cross-track error', curves['cross_track_m'], _BLUE)),
    )
    for turn_s in traces.inflections_s():
        axes['cross'].axvline(turn_s / 3600.0, color=_GREY, linewidth=0.8, linestyle=':')
    if len(hours):
        axes['cross'].plot([], [], color=_GREY, linestyle=':', label='inflection')
    axes['cross'].legend(loc='upper right', fontsize='small')
    _draw_curves(
        axes['heading'],
        hours,
        'Heading',
        'heading (deg from north)',
        (
            ('desired', curves['heading_ref_deg'], _ORANGE),
            ('heading', curves['heading_deg'], _BLUE),
        ),
    )
    _draw_curves(
        axes['pitch'],
        hours,
        'Pitch',
        'pitch, + nose up (deg)',
        (('desired', curves['pitch_ref_deg'], _ORANGE), ('pitch', curves['pitch_deg'], _BLUE)),
    )
    _draw_curves(
        axes['current'],
        hours,
        'Current',
        'water velocity (kn)',
        (
            ('north', curves['current_north_kn'], _BLUE),
            ('north, estimated', curves['estimate_north_kn'], _ORANGE),
            ('east', curves['current_east_kn'], _GREEN),
            ('east, estimated', curves['estimate_east_kn'], _GREY),
        ),
    )
    _draw_curves(
        axes['joints'],
        hours,
        'Actuators',
        'share of 1 kg, 100 mm, 100 deg',
        (
            ('net heaviness / 1 kg', curves['buoyancy_engine_kg'], _BLUE),
            ('pitch mass / 100 mm', curves['pitch_mass_mm'] / 100.0, _ORANGE),
            ('roll mass / 100 deg', curves['roll_mass_deg'] / 100.0, _GREEN),
        ),
    )
    figure.suptitle(title)
    save_figure(figure, file, dpi=100)


def _draw_track(axis, samples: dict[str, np.ndarray]) -> None:
    """Plan view with the path and arrows of the current."""
    north, east = samples['track_north_m'] / 1e3, samples['track_east_m'] / 1e3
    target_north, target_east = samples['target_north_m'] / 1e3, samples['target_east_m'] / 1e3
    axis.plot(target_east, target_north, color=_ORANGE, label='desired path')
    axis.plot(east, north, color=_BLUE, label='track')
    believed = samples['believed_north_m'] / 1e3, samples['believed_east_m'] / 1e3
    if np.any(np.isfinite(believed[0])):
        axis.plot(*believed[::-1], color=_GREEN, linestyle='--', label='believed track')
    if len(east):
        axis.plot(east[0], north[0], 'o', color=_BLUE, label='start')
        pick = np.linspace(0, len(east) - 1, ARROWS).astype(int)
        axis.quiver(
            east[pick],
            north[pick],
            samples['water_east_kn'][pick],
            samples['water_north_kn'][pick],
            color=_GREY,
            width=0.004,
            label='current',
        )
    axis.set_aspect('equal', adjustable='datalim')
    axis.set(title='Track', xlabel='east (km)', ylabel='north (km)')
    axis.grid(alpha=0.3)
    axis.legend(loc='upper right', fontsize='small')


def _draw_curves(axis, hours, title: str, label: str, curves) -> None:
    """Curves over time with a title and a labelled axis."""
    for name, values, colour in curves:
        axis.plot(hours, values, color=colour, linewidth=1.2, label=name)
    axis.set(title=title, xlabel='time (h)', ylabel=label)
    axis.grid(alpha=0.3)
    if len(curves) > 1:
        axis.legend(loc='upper right', fontsize='small')
