# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""A picture of a validation: what was recorded and what the plant did, on one page."""

import math
from pathlib import Path

import numpy as np

from glider_bringup.showing.figure import BLUE, GREEN, GREY, ORANGE, draw_curves, dress, new_figure
from glider_flights.validation.result import Validation
from glider_mission.disk import save_figure

#: The curves are those of one stretch: its first so many seconds.
LONGEST_S = 4 * 3600.0


def draw_validation(result: Validation, title: str, file: Path) -> None:
    """Draw curves of the longest stretch, and all that is compared, into an image file."""
    figure = new_figure(12.0, 12.0)
    axes = figure.subplot_mosaic(
        [['depth', 'rates'], ['rate', 'rate'], ['pitch', 'pitch'], ['speed', 'off']]
    )
    track, flown = max(result.pairs, key=lambda pair: pair[0].counts.sum())
    own = track.instruments
    shown = own.time_s - own.time_s[0] <= LONGEST_S
    minutes = (own.time_s - own.time_s[0])[shown] / 60.0

    def draw(place: str, name: str, label: str, *curves) -> None:
        drawn = [(text, values[shown], colour) for text, values, colour in curves]
        draw_curves(axes[place], minutes, name, ('time (min)', label), drawn, width=1.0)

    def both(recorded: np.ndarray, simulated: np.ndarray) -> tuple:
        return ('recorded', recorded, BLUE), ('simulated', simulated, ORANGE)

    draw('depth', 'Depth', 'depth (m)', ('recorded', own.depth_m, BLUE))
    axes['depth'].invert_yaxis()
    rates = both(100.0 * track.rate_mps, 100.0 * flown.rate_mps)
    draw('rate', 'Vertical rate', '+ down (cm/s)', *rates)
    pitches = both(*map(np.degrees, (result.model.pitch(own.pitch_rad), flown.pitch_rad)))
    draw('pitch', 'Pitch', '+ nose up (deg)', *pitches)
    speeds = [('simulated', 100.0 * flown.speed_mps, ORANGE)]
    if result.adcp is not None:
        measured = np.interp(own.time_s, *result.adcp, left=math.nan, right=math.nan)
        speeds.insert(0, ('ADCP', 100.0 * measured, BLUE))
    draw('speed', 'Speed through the water', '(cm/s)', *speeds)
    _scatter(axes['rates'], result)
    _depths(axes['off'], result)
    figure.suptitle(title)
    save_figure(figure, file, dpi=100)


def _scatter(axis, result: Validation) -> None:
    """Simulated over recorded vertical rate, of all stretches."""
    recorded, simulated = (
        100.0 * np.concatenate([pair[which].rate_mps[pair[0].counts] for pair in result.pairs])
        for which in (0, 1)
    )
    axis.plot(recorded, simulated, '.', color=BLUE, markersize=1.0, rasterized=True)
    span = [float(np.nanmin(recorded)), float(np.nanmax(recorded))]
    axis.plot(span, span, color=GREY, linewidth=0.8)
    dress(axis, 'Vertical rate, all', 'recorded (cm/s)', 'simulated (cm/s)', legend=False)


def _depths(axis, result: Validation) -> None:
    """What the vertical rate is off by, over depth, in the dive and in the climb."""
    for name, phase, colour in (('dive', 1.0, BLUE), ('climb', -1.0, GREEN)):
        off, depth = [], []
        for track, one in result.pairs:
            part = track.counts & (track.phase == phase)
            off.append(100.0 * (one.rate_mps - track.rate_mps)[part])
            depth.append(track.instruments.depth_m[part])
        off, depth = np.concatenate(off), np.concatenate(depth)
        axis.plot(off, depth, '.', color=colour, markersize=1.0, label=name, rasterized=True)
    axis.invert_yaxis()
    labels = 'simulated less recorded (cm/s)', 'depth (m)'
    dress(axis, 'Vertical rate off', *labels, markerscale=8.0)
