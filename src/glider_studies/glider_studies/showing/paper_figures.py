# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""Figures 4 to 12 of the paper, drawn again from our own flights.

We know the paper's figures by their captions and by what its text says of them, not by their
curves. Where what a figure shows is not known in detail, the sensible quantity is drawn, and the
title says what that is.
"""

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from glider_bringup.scoring.one_hertz import Record
from glider_bringup.showing.figure import BLUE, GREEN, GREY, ORANGE, dress, new_figure
from glider_mission.disk import save_figure
from glider_studies.paper.experiments import Experiment
from glider_studies.paper.tables import LAW_NAMES

#: Flights by experiment, case, controller and guidance.
Flights = dict[tuple[str, str, str, str], Record]

_COLOURS = {'adaptive': BLUE, 'backstepping': GREEN, 'pid': ORANGE}
_STYLES = {'adaptive': '-', 'backstepping': ':', 'pid': '--'}
_RED = '#c0392b'
#: Figures 5 to 7 show this much of a flight (h).
PROFILE_HOURS = 8.0
#: Limit cycles are shown in this part of a flight (h).
DETAIL_HOURS = (4.5, 5.1)
#: Scales fit what comes after this time (h).
SETTLED_HOURS = 2.0
_CRAB, _PAPER = 'crab into the estimated current', "paper's line of sight"
#: How the current of the yaw experiments is read in figures 10 and 11.
_READING = '8 deg from north'


class Drawing(NamedTuple):
    """One figure of the paper."""

    number: int
    experiment: str  #: whose flights it takes
    draw: Callable[[Any, 'Drawing', Flights, list[dict]], None]  #: figure, itself, flights, rows


def draw(
    experiments: list[Experiment],
    rows: list[list[dict]],
    records: list[list[Record | None] | dict[str, Any]],
    folder: Path,
) -> list[Path]:
    """Draw what was flown into PNG files; returns them, by number of the figure."""
    flights = {
        (one.name, case.case, case.controller, case.guidance): record
        for one, kept in zip(experiments, records, strict=True)
        if one.cases
        for case, record in zip(one.cases, kept, strict=True)
        if record is not None
    }
    rows_of = {one.name: flown for one, flown in zip(experiments, rows, strict=True)}
    files = []
    for drawing in DRAWINGS:
        if drawing.experiment not in rows_of:
            continue
        figure = new_figure(11.0, 8.0)
        drawing.draw(figure, drawing, flights, rows_of[drawing.experiment])
        file = folder / f'figure_{drawing.number:02d}.png'
        save_figure(figure, file, dpi=100)
        files.append(file)
    return files


def _of(flights: Flights, drawing: Drawing, guidance: str) -> Iterator[tuple[str, Record]]:
    """Controllers and records of the flights of an experiment that has one case."""
    for (experiment, _, controller, way), record in flights.items():
        if (experiment, way) == (drawing.experiment, guidance):
            yield controller, record


def _profiles(flights: Flights, drawing: Drawing) -> Iterator[tuple[str, Record, Any, np.ndarray]]:
    """Controllers, records, which part of them figures 5 to 7 show, and the hours of that."""
    for controller, record in _of(flights, drawing, 'los_current'):
        part = record.time_s <= PROFILE_HOURS * 3600.0
        yield controller, record, part, record.time_s[part] / 3600.0


def _plot(axis, controller: str, x, y, style: str = '-', width: float = 1.0) -> None:
    """Curve of a flight, in the colour of its controller."""
    look = {'color': _COLOURS[controller], 'label': LAW_NAMES[controller], 'linewidth': width}
    axis.plot(x, y, style, **look)


def _shown(guidance: str, hours: np.ndarray) -> np.ndarray:
    """Mask of what is shown of a flight; with the paper's guidance a part, to see its cycle."""
    first, last = (0.0, np.inf) if guidance == 'los_current' else DETAIL_HOURS
    return (hours >= first) & (hours <= last)


def _draw_current(figure, drawing: Drawing, flights: Flights, rows: list[dict]) -> None:
    """Track and cross-track error, with our guidance and with the paper's."""
    name = drawing.experiment
    angle = name.removeprefix('current_').removesuffix('deg')
    axes = figure.subplot_mosaic([['track', 'ours'], ['track', 'paper']], width_ratios=[1.0, 2.0])
    track = axes['track']
    for guidance, colour, width, label in (
        ('los_zhang2021', _RED, 0.4, _PAPER),
        ('los_current', BLUE, 1.5, _CRAB),
    ):
        record = flights[name, '', 'adaptive', guidance]
        track.plot(record.east, record.north / 1e3, color=colour, linewidth=width, label=label)
    for guidance, axis in (('los_current', axes['ours']), ('los_zhang2021', axes['paper'])):
        for controller, record in _of(flights, drawing, guidance):
            hours, error = record.time_s / 3600.0, record.cross_track
            part = _shown(guidance, hours)
            _plot(axis, controller, hours[part], error[part], _STYLES[controller])
    track.axvline(0.0, color=GREY, linewidth=0.8, linestyle=':', label='desired path')
    title = 'Track, adaptive (scales differ)'
    dress(track, title, 'east of the path (m)', 'north (km)', above=True)
    dress(axes['ours'], f'Cross-track error, {_CRAB}', 'time (h)', 'off the path (m)')
    title = f'Cross-track error, {_PAPER}: part of a dive'
    dress(axes['paper'], title, 'time (h)', 'off the path (m)', above=True)
    figure.suptitle(
        f'After figure {drawing.number} of the paper: 1.0 kn at {angle} deg off the path\n'
        'The peaks are the start and the turns of the dives'
    )


def _draw_depth(figure, drawing: Drawing, flights: Flights, rows: list[dict]) -> None:
    """Depth over time and along the path."""
    over_time, along = figure.subplots(2, 1)
    for controller, record, part, hours in _profiles(flights, drawing):
        for axis, x in ((over_time, hours), (along, record.north[part] / 1e3)):
            _plot(axis, controller, x, record.depth[part], _STYLES[controller], 1.5)
    for axis in (over_time, along):
        axis.axhline(1000.0, color=GREY, linewidth=0.8, linestyle=':', label='target depth')
        axis.invert_yaxis()
    dress(over_time, 'Depth over time', 'time (h)', 'depth (m)')
    dress(along, 'Depth along the path', 'along the path (km)', 'depth (m)')
    figure.suptitle(
        'After figure 5 of the paper: profile 0-1000 m, current of 1.0 kn at 8 deg off the path'
    )


def _draw_pitch(figure, drawing: Drawing, flights: Flights, rows: list[dict]) -> None:
    """Trim angle and what makes it."""
    pitch, error, mass = figure.subplots(3, 1, sharex=True)
    for controller, record, part, hours in _profiles(flights, drawing):
        if controller == 'adaptive':
            pitch.plot(hours, record.pitch_ref[part], color=GREY, linewidth=2.5, label='desired')
        _plot(pitch, controller, hours, record.pitch[part])
        _plot(error, controller, hours, (record.pitch - record.pitch_ref)[part])
        _plot(mass, controller, hours, 1e3 * record.joints[part, 1])
    dress(pitch, 'Trim angle (pitch), positive nose up', '', 'pitch (deg)')
    dress(error, 'Pitch less desired pitch', '', 'error (deg)')
    dress(mass, 'Pitch mass, positive forward', 'time (h)', 'position (mm)')
    figure.suptitle(
        'After figure 6 of the paper: trim angle, current of 1.0 kn at 8 deg off the path'
    )


def _draw_roll(figure, drawing: Drawing, flights: Flights, rows: list[dict]) -> None:
    """Roll and what makes it."""
    roll, mass = figure.subplots(2, 1, sharex=True)
    for controller, record, part, hours in _profiles(flights, drawing):
        _plot(roll, controller, hours, record.roll[part])
        _plot(mass, controller, hours, np.degrees(record.joints[part, 2]))
    dress(roll, 'Roll, positive starboard side down', '', 'roll (deg)')
    dress(mass, 'Roll mass, positive to starboard', 'time (h)', 'angle (deg)')
    figure.suptitle('After figure 7 of the paper: roll, current of 1.0 kn at 8 deg off the path')


def _draw_yaw(figure, drawing: Drawing, flights: Flights, rows: list[dict]) -> None:
    """Heading and cross-track error with our guidance, heading with the paper's."""
    controller = drawing.experiment.removeprefix('yaw_10deg_')
    colour, label = _COLOURS[controller], LAW_NAMES[controller]
    ours, across, paper = figure.subplots(3, 1)
    for guidance, axis in (('los_zhang2021', paper), ('los_current', ours)):
        record = flights[drawing.experiment, _READING, controller, guidance]
        hours = record.time_s / 3600.0
        part = _shown(guidance, hours)
        axis.plot(hours[part], record.heading[part], color=colour, label='heading')
        axis.plot(hours[part], record.heading_ref[part], '--', color=GREY, label='desired')
        axis.axhline(10.0, color=GREEN, linestyle=':', label='desired yaw (course)')
    across.plot(hours, record.cross_track, color=colour, linewidth=1.0)
    steady = record.heading[hours > SETTLED_HOURS]
    ours.set_ylim(min(np.min(steady), 8.0) - 1.0, max(np.max(steady), 12.0) + 4.0)
    y = 'heading\n(deg from north)'
    dress(ours, f'Heading, {_CRAB}', 'time (h)', y)
    dress(across, f'Cross-track error, {_CRAB}', 'time (h)', 'off the path (m)', legend=False)
    dress(paper, f'Heading, {_PAPER}: part of a dive', 'time (h)', y)
    figure.suptitle(
        f'After figure {drawing.number} of the paper '
        '(its print swaps the captions of 10 and 11):\n'
        f'{label} at a desired yaw of 10 deg, current of 1.0 kn to {_READING}'
    )


def _place(rows: list[dict]) -> tuple[list[float], list[float]]:
    """Angles and speeds of the currents of rows."""
    return [row['angle_deg'] for row in rows], [row['speed_kn'] for row in rows]


def _draw_envelope(figure, drawing: Drawing, flights: Flights, rows: list[dict]) -> None:
    """Error with turns over speed and angle of the current, and the limit of physics."""
    axis = figure.subplots()
    held = [row for row in rows if row['status'] != 'infeasible']
    lost = [row for row in rows if row['status'] == 'infeasible']
    errors = [row['cross_track_m']['max_all'] for row in held]
    look = {'c': errors, 's': 260.0, 'cmap': 'viridis_r', 'label': 'course held'}
    dots = axis.scatter(*_place(held), **look)
    axis.scatter(*_place(lost), marker='x', color=_RED, s=80.0, label='flagged infeasible')
    for error, *place in zip(errors, *_place(held), strict=True):
        above = {'textcoords': 'offset points', 'xytext': (0, 11), 'ha': 'center'}
        axis.annotate(f'{error:.0f}', place, **above, fontsize='small')
    angle = np.linspace(0.5, 180.0, 400)
    # U_h in knots: that of a row, from its cross current and that over U_h
    row = max(rows, key=lambda one: one['cross_share'])
    across = row['speed_kn'] * np.sin(np.radians(row['angle_deg']))
    speed = across / row['cross_share']
    limit = np.where(angle < 90.0, speed / np.sin(np.radians(angle)), speed)
    axis.plot(angle, limit, color=GREY, label='limit of physics')
    axis.plot([10.0], [1.0], '*', color='black', markersize=14.0, label="paper's limit")
    axis.set_ylim(0.0, 1.75)
    axis.set_xlim(-5.0, 185.0)
    figure.colorbar(dots, label='largest cross-track error with turns (m)')
    dress(axis, '', 'angle of the current off the path (deg)', 'current (kn)', legend=False)
    figure.legend(loc='outside lower center', ncols=4)
    figure.suptitle(
        'After figure 12 of the paper: where the adaptive law holds the course\n'
        'Numbers: largest cross-track error with turns (m)'
    )


#: The print swaps the captions of figures 10 and 11; these follow the text.
DRAWINGS = (
    Drawing(4, 'current_8deg', _draw_current),
    Drawing(5, 'profile', _draw_depth),
    Drawing(6, 'profile', _draw_pitch),
    Drawing(7, 'profile', _draw_roll),
    Drawing(8, 'current_10deg', _draw_current),
    Drawing(9, 'current_12deg', _draw_current),
    Drawing(10, 'yaw_10deg_pid', _draw_yaw),
    Drawing(11, 'yaw_10deg_adaptive', _draw_yaw),
    Drawing(12, 'envelope', _draw_envelope),
)
