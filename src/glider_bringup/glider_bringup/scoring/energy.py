# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""What a flight took out of the battery, and how far the battery would bring it at this pace.

By the kernel of the plant's ledger, from where the actuators were and from the true depth: so a
recording made before the vehicle had a ledger is scored too.
"""

import numpy as np

from glider_base.kernel import kernel
from glider_base.signals import TICK_S, Joints
from glider_mission.blocks import COLUMNS
from glider_model.plant.energy import FULL, spend, spent
from glider_model.plant.plant import LAUNCHED, surface_after
from glider_model.vehicle.energy import NO_ENERGY, EnergySettings

_DOWN, _JOINTS = COLUMNS['odom'].start + 2, COLUMNS['joint_states'].start
_J_PER_WH, _DAY_S = 3600.0, 86400.0


@kernel
def _joints_of(row):
    return Joints(row[_JOINTS], row[_JOINTS + 1], row[_JOINTS + 2], row[_JOINTS + 3])


@kernel
def _spend_rows(ledger, surfacing, last, log, params):
    """Ledger and surfacing after the rows of a log, whose ``last`` row before them is given."""
    depth, now = -last[_DOWN], _joints_of(last)
    for k in range(len(log)):
        depths = (depth, -log[k, _DOWN])
        before, surfacing = surfacing, surface_after(surfacing, depths[1])
        was, now, surfacings = now, _joints_of(log[k]), (before, surfacing)
        ledger = spend(ledger, was, now, depths, surfacings, params, TICK_S)
        depth = depths[1]
    return ledger, surfacing


class EnergyScorer:
    """Takes in log rows, and tells what was taken out of the battery, if that is known."""

    def __init__(self, energy: EnergySettings | None) -> None:
        self._params = energy.params() if energy else NO_ENERGY
        self._usable_wh = energy.usable_wh if energy else None
        self._ledger, self._surfacing = FULL, LAUNCHED
        self._last: np.ndarray | None = None

    def add(self, log: np.ndarray) -> None:
        """Take in log rows with the true odometry, float64[n, ROW]."""
        if self._usable_wh is None or not len(log):
            return
        last = self._last
        if last is None:
            last, log = log[0], log[1:]
        self._last = log[-1].copy() if len(log) else last.copy()
        self._ledger, self._surfacing = _spend_rows(
            self._ledger, self._surfacing, last, log, self._params
        )

    def result(self, sim_time_s: float, dives: int, way_m: float | None) -> dict:
        """The part ``energy`` of ``score.json``; None where nothing is known.

        Endurance and range are those of the usable part of a full battery at the mean power and
        the pace of this flight, ``way_m`` along the path; where that is None the mission ended,
        and nothing goes on at this pace.
        """
        names = ('pump', 'hotel', 'masses', 'calls')
        wh = spent(self._ledger) / _J_PER_WH
        if self._usable_wh is None or wh <= 0.0:
            empty = dict.fromkeys(('wh', 'wh_per_dive', 'by', 'endurance_days', 'range_km'))
            return {**empty, 'by': dict.fromkeys(names)}
        flights = self._usable_wh / wh
        return {
            'wh': wh,
            'wh_per_dive': wh / dives if dives else None,
            'by': {name: getattr(self._ledger, name) / _J_PER_WH for name in names},
            'endurance_days': None if way_m is None else flights * sim_time_s / _DAY_S,
            'range_km': None if way_m is None else 1e-3 * flights * max(0.0, way_m),
        }
