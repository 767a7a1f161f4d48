# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""Log rows that are kept: all of them, or one a second, as experiments and figures have them."""

from copy import copy

import numpy as np

from glider_base.frames import poses_from_wire
from glider_base.signals import TICK_S
from glider_mission.blocks import COLUMNS, ROW

#: Ticks of a second.
SECOND = round(1.0 / TICK_S)
#: All topics that have numbers.
TOPICS = tuple(name for name, columns in COLUMNS.items() if isinstance(columns, slice))


class Rows:
    """Takes log blocks as they come and keeps a row of every so many ticks, with these topics.

    All rows are 39 MB for each simulated hour.
    """

    def __init__(self, every: int = 1, topics: tuple[str, ...] = TOPICS) -> None:
        self.topics = topics
        self._every, self._ticks = every, 0
        self._blocks: list[np.ndarray] = []

    def add(self, log: np.ndarray) -> None:
        """Take in a block of log rows, float64[n, ROW]; nothing of it is kept by reference."""
        self._blocks.append(log[-self._ticks % self._every :: self._every].copy())
        self._ticks += len(log)

    def result(self) -> np.ndarray:
        """Everything that was kept so far, float64[n, ROW]."""
        if len(self._blocks) != 1:
            self._blocks = [np.concatenate([np.empty((0, ROW)), *self._blocks])]
        return self._blocks[0]


class Record:
    """What a log of one row a second, float64[n, ROW], says: arrays over time, NED, in deg."""

    def __init__(self, log: np.ndarray) -> None:
        self.time_s = np.arange(len(log)) * SECOND * TICK_S
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

    def thinned(self, points: int) -> 'Record':
        """The same with about so many points."""
        step = max(1, len(self.time_s) // points)
        record = copy(self)
        for name, values in vars(self).items():
            setattr(record, name, values[::step].copy())
        return record
