# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""Fixes that contradict navigation: told at the first, up for good at the second; no sea does."""

import math

import pytest

from glider_base.signals import Covariance, Odometry
from glider_guard import rows
from glider_guard.guard import fix_rows
from glider_model.onboard.fix_watch import FixWatch, watch_fixes

WAY_S, STAY_S, STD_M = 5000, 600, 100.0


def fly(jumps, drifts):
    """Rows after each of some dives, by the jumps at fixes and the drifts between (m/s)."""
    watch, told, n, e = FixWatch(), [], 0.0, 0.0
    for way, (drift_n, drift_e) in enumerate(drifts):
        for second in range(STAY_S):
            if way > 0 and second == 60:
                n, e = n + WAY_S * jumps[way - 1][0], e + WAY_S * jumps[way - 1][1]
            n, e = n + drift_n, e + drift_e
            variance = 25.0 if way == 0 or second >= 60 else STD_M**2
            watch = step(watch, n, e, 0.0, drift_n, drift_e, variance)
        told.append(fix_rows(watch))
        for second in range(WAY_S):
            watch = step(watch, n, e, 50.0, 0.0, 0.0, STD_M**2 * (second + 1.0) / WAY_S)
        told[-1] = fix_rows(watch)
    return told


def step(watch, n, e, depth, v_n, v_e, variance):
    x = Odometry(n, e, depth, 1.0, 0.0, 0.0, 0.0, v_n, v_e, 0.0, 0.0, 0.0, 0.0)
    return watch_fixes(watch, x, Covariance(variance, 0.0, variance), 1.0)


NOTE, BOTH = rows.CONTRADICTED, rows.CONTRADICTED | rows.ASTRAY


def test_a_jump_that_no_drift_explains_is_told_and_a_second_ends_the_mission():
    jumps = [(0.5, 0.0), (0.0, 0.02), (0.6, 0.0), (0.5, 0.3)]
    assert fly(jumps, 5 * [(0.2, 0.1)]) == [0, 0, 0, NOTE, BOTH]


def test_six_surfacings_in_accord_end_the_note():
    jumps = [(0.0, 0.0), (0.6, 0.0), *(6 * [(0.0, 0.01)])]
    assert fly(jumps, 9 * [(0.0, 0.0)]) == [0, 0, *(6 * [NOTE]), 0]


def test_a_current_that_turns_round_shows_in_the_drift_too():
    """In the middle of a dive: a third of it in that one, the rest in the next."""
    turned = [(0.5, 0.0), (0.5, 0.0), (0.5, 0.0), (-0.5, 0.0), (-0.5, 0.0), (-0.5, 0.0)]
    jumps = [(0.5, 0.0), (0.0, 0.0), (-0.35, 0.0), (-0.65, 0.0), (0.0, 0.0)]
    assert fly(jumps, turned) == 6 * [0]


@pytest.mark.parametrize('odometry', [math.nan, math.inf, 1e30])
def test_what_cannot_be_is_not_watched(odometry):
    x = Odometry(*(13 * (odometry,)))
    known = Covariance(odometry, odometry, odometry)
    assert watch_fixes(FixWatch(), x, known, 0.1) == FixWatch()
