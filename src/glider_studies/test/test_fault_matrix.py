# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""A diagonal of `./glider experiments --only faults`: every fault once, in one of its phases."""

import pytest

from glider_studies.paper.experiments import Experiment, described, fly, make_experiments
from glider_studies.paper.judges import judge_clean, judge_faults, judge_hard, judge_stays

FAULTS, PHASES = (list(entries) for entries in described('fault_matrix')['cases'])
SHORT = {'duration_s': 9000.0}
(MATRIX,) = (one for one in make_experiments(['faults']) if one.name == 'fault_matrix')
#: What shows late: a contact that is missed for 6000 s, and the path that a gust drives it from.
LATE = ('no contact', 'gust')
#: Every fault flies in the phase after that of the fault before it, for a dive or two.
CASES = [
    case if case.facts['fault'] in LATE else case._replace(changes={**case.changes, **SHORT})
    for number, case in enumerate(one for one in MATRIX.cases if one.controller == 'adaptive')
    if number % len(PHASES) == number // len(PHASES) % len(PHASES)
]


class Here:
    """Flies in this process."""

    def results(self, function, cases, progress) -> dict:
        """What a function makes of each case."""
        return {key: function(case) for key, case in cases.items()}


@pytest.fixture(scope='module')
def rows() -> list[dict]:
    """A row for each flight."""
    diagonal = Experiment('faults', 'diagonal', '', '', '', CASES, judge_faults)
    return fly([diagonal], Here(), lambda done: None)[0][0]


def test_every_fault_is_flown_and_every_phase():
    assert [case.facts['fault'] for case in CASES] == FAULTS
    assert len(CASES) >= 20
    phases = [case.changes['faults'][0]['phase'] for case in CASES]
    assert {phases.count(phase) for phase in PHASES} == {6, 7}


def test_each_ends_as_it_has_to(rows):
    assert [check for check in judge_faults(rows) if not check.passed] == []


def test_some_fly_on_some_surface_and_some_drop_their_weight(rows):
    ended = {row['guard']['reaction'] for row in rows}
    assert {'none', 'surface', 'drop'} <= ended


@pytest.mark.parametrize(
    ('change', 'said'),
    [
        ({'finite': False}, 'a number is not finite'),
        ({'guard': {'reaction': 'hold'}}, 'reaction hold'),
        ({'depth_m': {'max': 1100.0}}, '1100 m deep'),
        ({'faults': [{'t_s': None}]}, 'it did not begin'),
    ],
)
def test_what_is_wrong_is_seen(rows, change, said):
    (check,) = judge_faults([{**rows[0], **change}])
    assert (check.value, check.passed) == (said, False)


def test_a_clean_mission_that_is_told_of_is_seen():
    told = {'case': 'a', 'controller': 'pid', 'hours': 999.0, 'status': 'completed'}
    checks = judge_clean([{**told, 'guard': {'events': [{'row': 'leak'}]}}])
    assert [check.passed for check in checks] == [False, False, False]
    assert all(
        one.passed for one in judge_clean([{**told, 'hours': 1e3, 'guard': {'events': []}}])
    )


def test_clean_flights_have_all_come_to_their_end():
    """One of 36 that failed took 30 of 1,080 h with it: a thousand were left, and it passed."""
    whole = {'hours': 30.0, 'status': 'completed', 'guard': {'events': []}}
    whole |= {'case': 'any', 'controller': 'pid'}
    assert all(check.passed for check in judge_clean([whole] * 36))
    for status in ('failed', 'infeasible'):
        checks = judge_clean([whole] * 35 + [{**whole, 'status': status}])
        assert [one.value for one in checks if not one.passed] == [status]


def test_surfacings_of_a_flight_that_failed_are_no_verdict():
    """Those of the others were as they have to be, so that nobody missed the rest of it."""
    known = {'surfacings': 100, 'fixed': 100, 'ellipse_95_share': 0.95, 'innovation_squared': 2.0}
    known |= {'surfacing_error_m': [9.0, 5.0], 'surfacing_cross_track_m': [0.0, 0.0]}
    known |= {'dac_error_mps': {'worst': 0.01}}
    row = {'case': 'any', 'controller': 'pid', 'status': 'completed', 'navigation': known}
    row |= {'dive_m': 200.0, 'hours': 0.1}
    cut = {**row, 'status': 'failed', 'hours': 9.0}
    never_up = {**cut, 'navigation': {**known, 'surfacing_error_m': []}}
    for judge in (judge_hard, judge_stays):
        assert all(one.passed for one in judge([row, {**row, 'hours': 9.0}]))
        for bad in (cut, never_up):
            failed = [one.value for one in judge([row, bad]) if not one.passed]
            assert failed[-1] == 'failed'
