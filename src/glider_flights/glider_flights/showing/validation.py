# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""A picture of a validation: what was recorded and what the plant did, on one page."""

import math
from pathlib import Path

import numpy as np

from glider_bringup.mission.disk import save_figure
from glider_flights.validation.result import Validation

_BLUE, _ORANGE, _GREY, _GREEN = '#1f6fb4', '#e07b1a', '#8a8a8a', '#2f8f4e'
#: The curves are those of one stretch: its first so many seconds.
LONGEST_S = 4 * 3600.0


def draw_validation(result: Validation, title: str, file: Path) -> None:
    """Draw curves of the longest stretch, and all that is compared, into an image file."""
    import matplotlib

    matplotlib.use('Agg')
    from matplotlib import pyplot

    figure, axes = pyplot.subplot_mosaic(
        [['depth', 'rates'], ['rate', 'rate'], ['pitch', 'pitch'], ['speed', 'off']],
        figsize=(12.0, 12.0),
        layout='constrained',
    )
    number = int(np.argmax([track.counts.sum() for track in result.tracks]))
    track, flown = result.tracks[number], result.flown[number]
    own = track.instruments
    shown = own.time_s - own.time_s[0] <= LONGEST_S
    minutes = (own.time_s - own.time_s[0])[shown] / 60.0
    _curves(
        axes['depth'], minutes, 'Depth', 'depth (m)', [('recorded', own.depth_m[shown], _BLUE)]
    )
    axes['depth'].invert_yaxis()
    recorded = 100.0 * track.rate_mps[shown]
    simulated = 100.0 * flown.rate_mps[shown]
    both = [('recorded', recorded, _BLUE), ('simulated', simulated, _ORANGE)]
    _curves(axes['rate'], minutes, 'Vertical rate', '+ down (cm/s)', both)
    pitch = np.degrees(result.model.pitch(own.pitch_rad))[shown]
    both = [
        ('recorded', pitch, _BLUE),
        ('simulated', np.degrees(flown.pitch_rad)[shown], _ORANGE),
    ]
    _curves(axes['pitch'], minutes, 'Pitch', '+ nose up (deg)', both)
    speeds = [('simulated', 100.0 * flown.speed_mps[shown], _ORANGE)]
    if result.adcp is not None:
        measured = np.interp(own.time_s[shown], *result.adcp, left=math.nan, right=math.nan)
        speeds.insert(0, ('ADCP', 100.0 * measured, _BLUE))
    _curves(axes['speed'], minutes, 'Speed through the water', '(cm/s)', speeds)
    _scatter(axes['rates'], result)
    _depths(axes['off'], result)
    figure.suptitle(title)
    save_figure(figure, file, dpi=100)


def _curves(axis, minutes, title: str, label: str, curves) -> None:
    for name, values, colour in curves:
        axis.plot(minutes, values, color=colour, linewidth=1.0, label=name)
    axis.set(title=title, xlabel='time (min)', ylabel=label)
    axis.grid(alpha=0.3)
    if len(curves) > 1:
        axis.legend(loc='upper right', fontsize='small')


def _scatter(axis, result: Validation) -> None:
    """Simulated over recorded vertical rate, of all stretches."""
    recorded, simulated = (
        100.0 * np.concatenate([rate[track.counts] for track, rate in pairs])
        for pairs in (
            [(track, track.rate_mps) for track in result.tracks],
            list(zip(result.tracks, [one.rate_mps for one in result.flown], strict=True)),
        )
    )
    axis.plot(recorded, simulated, '.', color=_BLUE, markersize=1.0, rasterized=True)
    span = [float(np.nanmin(recorded)), float(np.nanmax(recorded))]
    axis.plot(span, span, color=_GREY, linewidth=0.8)
    axis.set(title='Vertical rate, all', xlabel='recorded (cm/s)', ylabel='simulated (cm/s)')
    axis.grid(alpha=0.3)


def _depths(axis, result: Validation) -> None:
    """What the vertical rate is off by, over depth, in the dive and in the climb."""
    for name, phase, colour in (('dive', 1.0, _BLUE), ('climb', -1.0, _GREEN)):
        parts = [
            (
                100.0 * (one.rate_mps - track.rate_mps)[track.counts & (track.phase == phase)],
                track.instruments.depth_m[track.counts & (track.phase == phase)],
            )
            for track, one in zip(result.tracks, result.flown, strict=True)
        ]
        off, depth = (np.concatenate(values) for values in zip(*parts, strict=True))
        axis.plot(off, depth, '.', color=colour, markersize=1.0, label=name, rasterized=True)
    axis.invert_yaxis()
    axis.set(
        title='Vertical rate off', xlabel='simulated less recorded (cm/s)', ylabel='depth (m)'
    )
    axis.grid(alpha=0.3)
    axis.legend(loc='upper right', fontsize='small', markerscale=8.0)
