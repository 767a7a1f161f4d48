# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""What an experiment is: its flights, and the judgement of what they come to."""

import json
import shlex
from collections.abc import Callable
from typing import Any, NamedTuple

from glider_bringup.mission.scenario import Scenario, load_scenario
from glider_bringup.scoring.one_hertz import Record
from glider_bringup.studies.paper.limits import Check
from glider_bringup.studies.paper.measures import measure_attitude


class Case(NamedTuple):
    """One flight."""

    case: str  #: what sets it apart from the others of its experiment
    controller: str
    guidance: str
    scenario: str
    changes: dict[str, Any] = {}
    measures: tuple[Callable[[Record, Scenario], dict], ...] = (measure_attitude,)
    told: str = ''  #: vehicle whose steering the PID is told, instead of that of the one it flies
    facts: dict[str, Any] = {}  #: goes into the row as it is
    drawn: bool = False  #: a record of it is kept for figures

    def load(self) -> Scenario:
        """Scenario that is flown."""
        fields = {
            **self.changes,
            'dives': 0,
            'control.law': self.controller,
            'guidance.los.method': self.guidance,
        }
        return load_scenario(self.scenario, fields)

    def command(self) -> str | None:
        """Shell command that flies it again; None if a scenario cannot say it."""
        if self.told:
            return None
        sets = ' '.join(
            f'--set {shlex.quote(f"{field}={json.dumps(value)}")}'
            for field, value in self.changes.items()
        )
        words = (
            f'./glider run {self.scenario} --engine direct --duration full',
            f'--controller {self.controller} --guidance {self.guidance}',
            sets,
        )
        return ' '.join(words).rstrip()

    def key(self) -> str:
        """The same for flights that are one and the same."""
        measures = [measure.__name__ for measure in self.measures]
        return json.dumps([*self[1:5], measures, self.told])


class Experiment(NamedTuple):
    """Flights, and what is asked of them."""

    group: str
    name: str
    section: str  #: of the paper; empty: goes beyond it
    title: str
    paper: str  #: the paper's figure
    cases: list[Case]
    judge: Callable[[list[dict]], list[Check]]
