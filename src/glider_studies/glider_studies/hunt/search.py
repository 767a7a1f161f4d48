# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""Flies missions with their faults and without, and shrinks what goes wrong."""

from collections import Counter
from collections.abc import Iterator
from typing import Any, NamedTuple

from glider_bringup.engines.flight import fly
from glider_bringup.scoring.card import fly_scored, scorecard
from glider_guard.rows import LATCHED, ROWS
from glider_mission.changes import run_command
from glider_mission.scenario import Scenario
from glider_studies.hunt.missions import Mission, draw_mission
from glider_studies.hunt.oracle import Truth, Verdict, judge, unfounded
from glider_studies.paper.experiments import Experiment, make_study
from glider_studies.paper.judges import Check

NAME = 'random_faults'
#: What may go wrong with a flight with faults.
KINDS = ('lost', 'untold', 'late', 'not_finite')
#: What may with one without.
FALSE = 'false_reaction'


class Flown(NamedTuple):
    """What became of a mission."""

    verdict: Verdict  #: with its faults
    faults: list[dict[str, Any]]  #: the smallest set that does the same harm
    latched: str  #: what the guard reported of the same mission without faults
    hours: float  #: of that mission


def _verdict(scenario: Scenario) -> Verdict:
    """Fly, and judge."""
    truth = Truth()
    flight, scores = fly_scored(scenario, [truth])
    card = scorecard(scenario, 'direct', flight, scores)
    begun_s = [one['t_s'] for one in scores['faults'] if one['t_s'] is not None]
    return judge(scenario, truth, card['status'], card['reason'], begun_s)


def _shrunk(mission: Mission, verdict: Verdict) -> tuple[Verdict, list[dict[str, Any]]]:
    """The same kind of harm by as few faults as possible."""
    faults = mission.faults
    for fault in mission.faults:
        fewer = [one for one in faults if one is not fault]
        smaller = _verdict(mission.load(fewer))
        if smaller.kind == verdict.kind:
            verdict, faults = smaller, fewer
    return verdict, faults


def _fly_mission(place: tuple[int, int]) -> Flown:
    """Fly a mission, by seed and number, in a worker."""
    mission = draw_mission(*place)
    verdict, faults = _verdict(mission.load()), mission.faults
    if verdict.kind:
        verdict, faults = _shrunk(mission, verdict)
    truth = Truth()
    clean = mission.load([])
    flight = fly(clean, [truth])
    rows = unfounded(clean, truth, LATCHED)
    latched = ', '.join(row.name for row in ROWS if rows & row.bit)
    if flight.status == 'failed':
        latched = flight.reason
    return Flown(verdict, faults, latched, len(truth.depth) / 3600.0)


def scenarios(seed: int, flights: int) -> Iterator[Scenario]:
    """What is flown."""
    for number in range(flights):
        mission = draw_mission(seed, number)
        yield from (mission.load(), mission.load([]))


def command(mission: Mission, faults: list[dict[str, Any]]) -> str:
    """Shell command that flies a mission with some faults again."""
    fields = {**mission.changes, 'faults': [*mission.aging, *faults]}
    return run_command(mission.scenario, fields, '--duration full')


def judge_search(rows: list[dict[str, Any]]) -> list[Check]:
    """Nothing may go wrong, with faults or without."""
    wrong = _wrong(rows)
    return [Check(kind, count, 0, count == 0) for kind, count in wrong.items()]


def _wrong(rows: list[dict[str, Any]]) -> dict[str, int]:
    found = Counter(row['kind'] for row in rows)
    return {kind: found[kind] for kind in KINDS} | {'false_reactions': found[FALSE]}


def experiment(seed: int, flights: int) -> Experiment:
    """Missions 0 to ``flights`` of a seed.

    Beside its rows it tells the counts of flights, lost, untold, late, not_finite,
    false_reactions, hours.
    """

    def rows(flown: dict[int, Flown]) -> tuple[list[dict], dict[str, Any]]:
        table = []
        for number, one in flown.items():
            mission = draw_mission(seed, number)
            harms = [(one.verdict, one.faults)] if one.verdict.kind else []
            harms += [(Verdict(FALSE, one.latched), [])] if one.latched else []
            table += [
                {'flight': number, **said._asdict(), 'command': command(mission, faults)}
                for said, faults in harms
            ]
        hours = round(sum(one.hours for one in flown.values()), 1)
        return table, {'flights': flights, **_wrong(table), 'hours': hours}

    places = {number: (seed, number) for number in range(flights)}
    loops = scenarios(seed, flights)
    return make_study(
        NAME, seed, judge=judge_search, fly=_fly_mission, tasks=places, loops=loops, rows=rows
    )
