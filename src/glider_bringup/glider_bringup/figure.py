# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""A picture of a run: where it went, how deep, how far off, and what the actuators did."""

from collections.abc import Iterable
from copy import copy
from pathlib import Path

import numpy as np

from glider_bringup.direct import COLUMNS, ROW
from glider_model.frames import poses_from_wire
from glider_model.signals import TICK_S

#: Topics that a picture is drawn from.
DRAWN = (
    'odom',
    'joint_states',
    'current_velocity',
    'reference',
    'tracking_error',
    'current_estimate',
)
#: A picture shows about this many points of each curve.
POINTS = 4000
#: Arrows that show the current along the track.
ARROWS = 12

_KNOT = 1852.0 / 3600.0
_BLUE, _ORANGE, _GREY, _GREEN = '#1f6fb4', '#e07b1a', '#8a8a8a', '#2f8f4e'


class Record:
    """A log thinned to one row a second. Angles in deg, NED; attributes are arrays over time."""

    def __init__(self, blocks: Iterable[np.ndarray]) -> None:
        rows, first = round(1.0 / TICK_S), 0
        thinned = []
        for block in blocks:
            thinned.append(block[(-first) % rows :: rows].copy())
            first += len(block)
        log = np.concatenate(thinned) if thinned else np.empty((0, ROW))
        self.time_s = np.arange(len(log)) * rows * TICK_S
        odom = poses_from_wire(log[:, COLUMNS['odom']])
        reference = poses_from_wire(log[:, COLUMNS['reference']])
        self.north, self.east, self.depth = odom[:, 0], odom[:, 1], odom[:, 2]
        self.target_north, self.target_east = reference[:, 0], reference[:, 1]
        self.roll, self.pitch = np.degrees(odom[:, 3]), np.degrees(odom[:, 4])
        self.heading = np.degrees(np.unwrap(odom[:, 5]))
        self.pitch_ref = np.degrees(reference[:, 4])
        self.heading_ref = np.degrees(np.unwrap(reference[:, 5]))
        error = log[:, COLUMNS['tracking_error']]
        self.cross_track, self.vertical_error = error[:, 1], error[:, 2]
        self.descending = log[:, COLUMNS['reference']][:, 9] < 0.0
        self.joints = log[:, COLUMNS['joint_states']]
        self.current = log[:, COLUMNS['current_velocity']]
        self.estimate = log[:, COLUMNS['current_estimate']]

    def thinned(self, points: int = POINTS) -> 'Record':
        """The same with about so many points."""
        step = max(1, len(self.time_s) // points)
        record = copy(self)
        for name, values in vars(self).items():
            setattr(record, name, values[::step].copy())
        return record


def draw_run(record: Record, title: str, file: Path) -> None:
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
    record = record.thinned()
    hours = record.time_s / 3600.0
    _draw_track(axes['track'], record)
    _draw_curves(axes['depth'], hours, 'Depth', 'depth (m)', (('depth', record.depth, _BLUE),))
    axes['depth'].invert_yaxis()
    _draw_curves(
        axes['cross'],
        hours,
        'Cross-track error',
        'off the path, + to starboard (m)',
        (('cross-track error', record.cross_track, _BLUE),),
    )
    for turn in np.flatnonzero(record.descending[1:] != record.descending[:-1]) + 1:
        axes['cross'].axvline(hours[turn], color=_GREY, linewidth=0.8, linestyle=':')
    if len(hours):
        axes['cross'].plot([], [], color=_GREY, linestyle=':', label='inflection')
    axes['cross'].legend(loc='upper right', fontsize='small')
    _draw_curves(
        axes['heading'],
        hours,
        'Heading',
        'heading (deg from north)',
        (('desired', record.heading_ref, _ORANGE), ('heading', record.heading, _BLUE)),
    )
    _draw_curves(
        axes['pitch'],
        hours,
        'Pitch',
        'pitch, + nose up (deg)',
        (('desired', record.pitch_ref, _ORANGE), ('pitch', record.pitch, _BLUE)),
    )
    _draw_curves(
        axes['current'],
        hours,
        'Current',
        'water velocity (kn)',
        (
            ('north', record.current[:, 1] / _KNOT, _BLUE),
            ('north, estimated', record.estimate[:, 1] / _KNOT, _ORANGE),
            ('east', record.current[:, 0] / _KNOT, _GREEN),
            ('east, estimated', record.estimate[:, 0] / _KNOT, _GREY),
        ),
    )
    _draw_curves(
        axes['joints'],
        hours,
        'Actuators',
        'share of 1 kg, 100 mm, 100 deg',
        (
            ('net heaviness / 1 kg', record.joints[:, 0], _BLUE),
            ('pitch mass / 100 mm', 10.0 * record.joints[:, 1], _ORANGE),
            ('roll mass / 100 deg', np.degrees(record.joints[:, 2]) / 100.0, _GREEN),
        ),
    )
    figure.suptitle(title)
    figure.savefig(file, dpi=100)
    pyplot.close(figure)


def _draw_track(axis, record: Record) -> None:
    """Plan view with the path and arrows of the current."""
    axis.plot(
        record.target_east / 1e3, record.target_north / 1e3, color=_ORANGE, label='desired path'
    )
    axis.plot(record.east / 1e3, record.north / 1e3, color=_BLUE, label='track')
    if len(record.east):
        axis.plot(record.east[0] / 1e3, record.north[0] / 1e3, 'o', color=_BLUE, label='start')
        pick = np.linspace(0, len(record.east) - 1, ARROWS).astype(int)
        axis.quiver(
            record.east[pick] / 1e3,
            record.north[pick] / 1e3,
            record.current[pick, 0],
            record.current[pick, 1],
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
