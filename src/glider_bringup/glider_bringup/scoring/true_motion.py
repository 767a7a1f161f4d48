# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""The true motion, as ground_truth/odom tells it, and what it says of the cross-track error."""

import numpy as np

from glider_mission.blocks import COLUMNS

_TRUTH, _ODOM_START = COLUMNS['ground_truth/odom'], COLUMNS['odom'].start
_ODOM = slice(_ODOM_START, _ODOM_START + 13)
_E2 = COLUMNS['tracking_error'].start + 1
#: Of the virtual target.
_EAST, _NORTH = COLUMNS['reference'].start, COLUMNS['reference'].start + 1


class TrueMotion:
    """Gives the log as it would be if the odometry were the truth, block by block.

    A run of a vehicle at sea, where nobody knows it, is taken at its word.
    """

    def __init__(self) -> None:
        self._target: np.ndarray | None = None
        self._course = 0.0

    def of(self, log: np.ndarray) -> np.ndarray:
        """Log rows with true odometry and cross-track error.

        Parameters
        ----------
        log : float64[n, ROW]
            The next rows; not changed.

        Returns
        -------
        float64[n, ROW]
            ``log`` itself if the odometry is the truth.
        """
        if not len(log) or np.isnan(log[0, _TRUTH.start]):
            return log
        if np.array_equal(log[:, _TRUTH], log[:, _ODOM]):
            return log
        true = log.copy()
        true[:, _ODOM] = log[:, _TRUTH]
        course = self._course_of_target(log[:, [_EAST, _NORTH]])
        east, north = (true[:, i] - log[:, i] for i in (_ODOM_START, _ODOM_START + 1))
        true[:, _E2] += np.cos(course) * east - np.sin(course) * north
        return true

    def _course_of_target(self, target: np.ndarray) -> np.ndarray:
        """Course (rad) on which the virtual target, float64[n, 2] east and north, has come.

        While it stands still its course is the last one it had; before its first move it is that
        of this move.
        """
        before = target[0] if self._target is None else self._target
        way = np.diff(target, axis=0, prepend=before[np.newaxis])
        moves = np.any(way != 0.0, axis=1)
        if self._target is None and moves.any():
            first = np.argmax(moves)
            self._course = float(np.arctan2(way[first, 0], way[first, 1]))
        last = np.maximum.accumulate(np.where(moves, np.arange(len(way)), -1))
        course = np.where(last < 0, self._course, np.arctan2(way[last, 0], way[last, 1]))
        self._target, self._course = target[-1], float(course[-1])
        return course
