# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""Crossings of seas full of eddies: what is asked of planned routes, and what is flown."""

import pytest

from glider_model.ocean.eddying_sea import EddyingSea, write_sea
from glider_studies.routes import PLAN, WAYS, cross_one, judge, scenario_in

#: A sea in which planned routes do what is asked of them, and one that nobody can cross.
GOOD = {'reachable': True, 'straight_h': 200.0, 'planned_h': 150.0, 'erring_h': 190.0}
HOPELESS = {'reachable': False, 'straight_h': None, 'planned_h': None, 'erring_h': None}


@pytest.mark.parametrize(
    ('changes', 'failed'),
    [
        ({}, set()),
        ({'planned_h': None}, {0, 2}),  # without it nothing is left to compare
        ({'reachable': False}, {1}),
        ({'planned_h': 190.0}, {2}),
        ({'erring_h': 221.0}, {3}),
        ({'erring_h': None}, {3}),
        ({'straight_h': None, 'erring_h': None}, {2}),
    ],
)
def test_each_check_fails_by_what_it_is_about(changes, failed):
    checks = judge([{**GOOD, **changes}, HOPELESS])
    assert {number for number, check in enumerate(checks) if not check.passed} == failed


def test_the_mission_is_the_shipped_one_in_another_sea(tmp_path):
    write_sea(EddyingSea(seed=1000, rms_mps=0.3), tmp_path / 'sea.nc')
    files = 2 * (tmp_path / 'sea.nc',)
    flown = {way: scenario_in(*files, way) for way in WAYS if way != PLAN}
    assert {way: one.guidance.route for way, one in flown.items()} == {
        'straight': 'straight',
        'planned': 'planned',
        'erring': 'planned',
    }
    late_h = {(one.forecast.late_h, one.navigation.forecast.late_h) for one in flown.values()}
    assert late_h == {(12.0, 12.0)}
    assert [one.forecast.error_mps for one in flown.values()] == [0.0, 0.0, 0.15]
    assert not any(one.orders for one in flown.values())
    for one in flown.values():
        assert one.current_settings().field.params().water.std() > 0.1


def test_a_plan_by_the_true_sea_gains_on_straight_legs_in_a_strong_one():
    found = cross_one((1009, 0.42, PLAN))
    assert found['reachable']
    assert found['plan_h'] < 0.99 * found['plan_straight_h']
