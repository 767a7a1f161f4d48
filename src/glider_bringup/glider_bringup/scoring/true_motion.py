# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""The true motion, as ground_truth/odom tells it, and what it says of the cross-track error."""

import math

import numpy as np

from glider_base.kernel import kernel
from glider_mission.blocks import COLUMNS

_TRUTH_START, _ODOM_START = (COLUMNS[name].start for name in ('ground_truth/odom', 'odom'))
#: Of an odometry without its covariance.
_NUMBERS = 13
_TRUTH, _ODOM = (slice(start, start + _NUMBERS) for start in (_TRUTH_START, _ODOM_START))
_E1, _E2 = COLUMNS['tracking_error'].start, COLUMNS['tracking_error'].start + 1
#: Of the virtual target.
_EAST, _NORTH = COLUMNS['reference'].start, COLUMNS['reference'].start + 1
#: A target that moves farther than this between two ticks (m) is on another path: it moves no
#: faster than 3 m/s, and a step on board stands for a second at most.
JUMP_M = 3.0
#: The course to a target is that of guidance's errors if it is so far away (m).
_AWAY_M = 1.0


def jumps(target: np.ndarray, before: np.ndarray) -> np.ndarray:
    """Rows in which the virtual target, float64[n, 2], is on another path than a row earlier."""
    return np.flatnonzero(_jumped(target, before))


@kernel
def _jumped(target, before):
    jumped = np.empty(len(target), np.bool_)
    east, north = before
    for row in range(len(target)):
        last_east, last_north = east, north
        east, north = target[row, 0], target[row, 1]
        jumped[row] = math.hypot(east - last_east, north - last_north) > JUMP_M
    return jumped


@kernel
def _tells_the_truth(log):
    """Whether the odometry of log rows is the true motion."""
    for row in range(len(log)):
        for i in range(_NUMBERS):
            if log[row, _ODOM_START + i] != log[row, _TRUTH_START + i]:
                return False
    return True


def course_at(row: np.ndarray) -> float | None:
    """Course of the path (rad) by what guidance tells in a row; None of who is on its target."""
    east, north = row[[_ODOM_START, _ODOM_START + 1]] - row[[_EAST, _NORTH]]
    if math.hypot(east, north) <= _AWAY_M:
        return None
    return math.atan2(east, north) - math.atan2(row[_E2], row[_E1])


class TrueMotion:
    """Gives the log as it would be if the odometry were the truth, block by block.

    A run of a vehicle at sea, where nobody knows it, is taken at its word.
    """

    def __init__(self) -> None:
        self._target: np.ndarray | None = None
        self._course = 0.0
        self._rows = np.empty((0, 0))  #: of the last block, used again

    def of(self, log: np.ndarray) -> np.ndarray:
        """Log rows, float64[n, ROW], with true odometry and cross-track error.

        ``log`` are the next rows; they are not changed, and given back if the odometry is the
        truth. Else what is given holds until the next call.
        """
        if not len(log) or np.isnan(log[0, _TRUTH_START]):
            return log
        if _tells_the_truth(log):
            return log
        if len(log) > len(self._rows):
            self._rows = np.empty_like(log)
        true = self._rows[: len(log)]
        true[:] = log
        true[:, _ODOM] = log[:, _TRUTH]
        course = self._course_of_target(log)
        east, north = (true[:, i] - log[:, i] for i in (_ODOM_START, _ODOM_START + 1))
        true[:, _E2] += np.cos(course) * east - np.sin(course) * north
        return true

    def _course_of_target(self, log: np.ndarray) -> np.ndarray:
        """Course (rad) on which the virtual target of log rows, float64[n, ROW], has come.

        While it stands still its course is the last one it had. Where a path begins, it is that
        by which guidance tells where the vehicle is, or of its next move.
        """
        target = log[:, [_EAST, _NORTH]]
        before = target[0] if self._target is None else self._target
        way = np.diff(target, axis=0, prepend=before[np.newaxis])
        begins = np.zeros(len(way), dtype=bool)
        begins[jumps(target, before)] = True
        begins[0] |= self._target is None
        moves = np.any(way != 0.0, axis=1) & ~begins
        course = np.arctan2(way[:, 0], way[:, 1])
        for row in np.flatnonzero(begins).tolist():
            there, after = course_at(log[row]), np.flatnonzero(moves[row:])
            if there is None:
                there = course[row + after[0]] if len(after) else self._course
            course[row] = there
        last = np.maximum.accumulate(np.where(moves | begins, np.arange(len(way)), -1))
        course = np.where(last < 0, self._course, course[last])
        self._target, self._course = target[-1], float(course[-1])
        return course
