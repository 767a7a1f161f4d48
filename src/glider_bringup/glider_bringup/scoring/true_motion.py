# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""The true motion, and what it says of the cross-track error.

A run tells it on ground_truth/odom. Those of before there was this topic tell it by the noise of
their odometry, which follows from seed and tick.
"""

import numpy as np

from glider_base.frames import odometry_from_wire, odometry_to_wire
from glider_base.kernel import kernel
from glider_bringup.blocks import COLUMNS
from glider_model.plant.sensors import SensorParams, is_noisy, remove_noise

_TRUTH, _ODOM_START = COLUMNS['ground_truth/odom'], COLUMNS['odom'].start
_ODOM = slice(_ODOM_START, _ODOM_START + 13)
_E2 = COLUMNS['tracking_error'].start + 1
#: Of the virtual target.
_EAST, _NORTH = COLUMNS['reference'].start, COLUMNS['reference'].start + 1


@kernel
def _take_off(log, first_tick, sensors):
    """Put the true odometry in the place of the measured one, in place."""
    for row in range(log.shape[0]):
        told = odometry_from_wire(log[row, _ODOM_START : _ODOM_START + 13])
        true = remove_noise(told, first_tick + row, sensors)
        for i, value in enumerate(odometry_to_wire(true)):
            log[row, _ODOM_START + i] = value


class TrueMotion:
    """Gives the log as it would be if the odometry were the truth, block by block.

    Parameters
    ----------
    sensors : SensorParams, optional
        Noise of the odometry, for runs that do not tell the truth; without it they are taken at
        their word.
    """

    def __init__(self, sensors: SensorParams | None = None) -> None:
        self._sensors = sensors if sensors is not None and is_noisy(sensors) else None
        self._tick = 0
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
        is_told = len(log) and not np.isnan(log[0, _TRUTH.start])
        if not is_told and self._sensors is None or not len(log):
            return log
        if is_told and np.array_equal(log[:, _TRUTH], log[:, _ODOM]):
            return log
        true = log.copy()
        if is_told:
            true[:, _ODOM] = log[:, _TRUTH]
        else:
            _take_off(true, self._tick, self._sensors)
        course = self._course_of_target(log[:, [_EAST, _NORTH]])
        east, north = (true[:, i] - log[:, i] for i in (_ODOM_START, _ODOM_START + 1))
        true[:, _E2] += np.cos(course) * east - np.sin(course) * north
        self._tick += len(log)
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
