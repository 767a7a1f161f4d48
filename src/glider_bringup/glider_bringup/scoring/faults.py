# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""When the faults of a scenario began, from the true motion alone."""

from collections.abc import Sequence

import numpy as np

from glider_base.frames import odometry_from_wire, rotate_to_ned
from glider_base.kernel import kernel
from glider_bringup.scoring.scores import seconds
from glider_mission.blocks import COLUMNS
from glider_model.plant.faults.kinds import is_due, phase_of
from glider_model.plant.faults.settings import FaultSettings, fault_params
from glider_model.plant.plant import LAUNCHED, Surfacing, surface_after

_TRUTH = COLUMNS['ground_truth/odom'].start


@kernel
def _note(log, first, tick, surfacing, params, began):
    """Note in ``began`` (int64[n]) which faults begin in some rows, the first of this tick."""
    for k in range(len(log)):
        wire = log[k, first : first + 13]
        x = odometry_from_wire(wire)
        if tick + k > 0:
            surfacing = surface_after(surfacing, x.p_d)
        down = rotate_to_ned(x.q_w, x.q_x, x.q_y, x.q_z, x.u, x.v, x.w)[2]
        phase = phase_of(x.p_d, down, surfacing.count)
        for i in range(len(began)):
            if began[i] < 0 and is_due(i, tick + k, x.p_d, phase, params):
                began[i] = tick + k
    return surfacing


class FaultTimes:
    """Takes in log rows, and tells of every fault when it began."""

    def __init__(self, faults: Sequence[FaultSettings]) -> None:
        self._faults = list(faults)
        self._params = fault_params(faults, 0)
        self._began = np.full(len(self._faults), -1, np.int64)
        self._tick = 0
        self._surfacing = Surfacing(*LAUNCHED)

    def add(self, log: np.ndarray) -> None:
        """Take in a block of log rows, float64[n, ROW]."""
        if self._faults:
            self._surfacing = _note(
                log, _TRUTH, self._tick, self._surfacing, self._params, self._began
            )
        self._tick += len(log)

    def result(self) -> list[dict]:
        """What ``score.json`` tells of each: when it began and ended (None: it did not), what."""
        times = []
        for fault, began in zip(self._faults, self._began.tolist(), strict=True):
            end = began + fault.lasts
            times.append(
                {
                    't_s': seconds(began) if began >= 0 else None,
                    'end_s': seconds(end) if 0 <= began and end < self._tick else None,
                    'kind': fault.kind,
                    'message': fault.words,
                    'when': fault.when,
                }
            )
        return times
