# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""A log thinned to one row a second: what experiments measure and the paper's figures show."""

from copy import copy

import numpy as np

from glider_base.frames import poses_from_wire
from glider_base.signals import TICK_S
from glider_mission.blocks import COLUMNS, ROW

#: Of so many ticks one is kept.
_EVERY = round(1.0 / TICK_S)


class Recorder:
    """Takes log blocks as they come and keeps one row a second of them."""

    def __init__(self) -> None:
        self._rows: list[np.ndarray] = []
        self._ticks = 0

    def add(self, log: np.ndarray) -> None:
        """Take in a block of log rows, float64[n, ROW]; nothing of it is kept by reference."""
        self._rows.append(log[-self._ticks % _EVERY :: _EVERY].copy())
        self._ticks += len(log)

    def result(self) -> 'Record':
        """What was kept of everything taken in so far."""
        return Record(np.concatenate([np.empty((0, ROW)), *self._rows]))


class Record:
    """A log thinned to one row a second. Angles in deg, NED; attributes are arrays over time.

    Parameters
    ----------
    log : float64[n, ROW]
        One row a second.
    """

    def __init__(self, log: np.ndarray) -> None:
        self.time_s = np.arange(len(log)) * _EVERY * TICK_S
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

    def thinned(self, points: int) -> 'Record':
        """The same with about so many points."""
        step = max(1, len(self.time_s) // points)
        record = copy(self)
        for name, values in vars(self).items():
            setattr(record, name, values[::step].copy())
        return record
