# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""Flies experiments in worker processes: a row of figures for each flight."""

from typing import Any

from glider_bringup.engines.flight import fly as fly_mission
from glider_bringup.engines.flight import mission_of
from glider_bringup.mission.choices import Combination, combination_of
from glider_bringup.scoring.card import finite
from glider_bringup.scoring.one_hertz import Record, Recorder
from glider_bringup.scoring.score import make_scorer, scores_of
from glider_bringup.studies.paper.cases import Case, Experiment
from glider_bringup.studies.workers import Pool, Progress
from glider_model.vehicle.file import load_vehicle

#: Points of a record that is handed on.
RECORD_POINTS = 12000


def _fly_case(case: Case) -> tuple[dict[str, Any], Record | None]:
    """Fly one case in a worker: its row, and if it is drawn a record thin enough to hand on."""
    scenario = case.load()
    state, params = mission_of(scenario)
    if case.told:
        steering = load_vehicle(case.told).steering_rates
        pid = params.control.law._replace(
            steering_dive=steering.dive, steering_climb=steering.climb
        )
        params = params._replace(control=params.control._replace(law=pid))
    scorer, recorder = make_scorer(scenario), Recorder()
    flight = fly_mission(scenario, [scorer, recorder], mission=(state, params))
    record, scores = recorder.result(), scores_of(scenario, scorer)
    for measure in case.measures:
        scores.update(measure(record, scenario))
    row = _row(scores, flight.status == 'failed')
    return row, record.thinned(RECORD_POINTS) if case.drawn else None


def _row(scores: dict[str, Any], failed: bool = False) -> dict[str, Any]:
    """Scores with status; a number that is not finite becomes None, and is told."""
    scores = dict(scores)
    clean = finite(scores)
    whole = not failed and bool(scores['final_state']) and clean == scores
    return {'finite': whole, **clean, **({'status': 'failed'} if failed else {})}


def fly(
    experiments: list[Experiment], pool: Pool, progress: Progress
) -> tuple[list[list[dict]], list[list[Record | None]]]:
    """Fly every case, in worker processes; what two experiments share is flown once.

    Returns
    -------
    rows : list of list of dict
        By experiment and case.
    records : list of list of Record
        Likewise; None for what is not drawn.
    """
    cases: dict[str, Case] = {}
    for case in (case for one in experiments for case in one.cases):
        if case.drawn or case.key() not in cases:
            cases[case.key()] = case
    flown = pool.results(_fly_case, cases, progress)
    rows = [
        [
            {
                'case': case.case,
                'controller': case.controller,
                'guidance': case.guidance,
                **case.facts,
                **flown[case.key()][0],
                'command': case.command(),
            }
            for case in one.cases
        ]
        for one in experiments
    ]
    return rows, [[flown[case.key()][1] for case in one.cases] for one in experiments]


def combinations(experiments: list[Experiment]) -> set[Combination]:
    """What `fly` needs loops for."""
    return {combination_of(case.load()) for one in experiments for case in one.cases}


def count_flights(experiments: list[Experiment]) -> int:
    """Number of flights that `fly` makes."""
    return len({case.key() for one in experiments for case in one.cases})
