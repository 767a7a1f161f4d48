# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""Every experiment: the paper's own, and what goes beyond them; flown, and judged.

They are those of `experiments.yaml`. The tuned PID and the paper's line of sight are flown beside
the adaptive law, and are shown as they are; limits apply to the adaptive law. A change that makes
anything worse turns a verdict to ``failed``.
"""

import json
import math
import operator
from collections.abc import Callable, Hashable, Iterable, Iterator
from functools import cache, partial
from itertools import product
from pathlib import Path
from typing import Any, NamedTuple

from glider_base.files import read_yaml
from glider_bringup.scoring.card import finite, fly_scored
from glider_bringup.scoring.one_hertz import SECOND, Record, Rows
from glider_guidance.los import crab_heading
from glider_mission.changes import run_command
from glider_mission.planned import horizontal_speed
from glider_mission.scenario import Scenario, load_scenario
from glider_model.ocean.current_settings import KNOT_MPS
from glider_model.vehicle.file import load_vehicle
from glider_model.vehicle.perturb import perturbed
from glider_studies.montecarlo import airframe, sample_plant
from glider_studies.paper.judges import JUDGES, Check, figure_of, judge_limits
from glider_studies.paper.measures import MEASURES
from glider_studies.workers import Pool, Progress

RESULT_FILE = 'experiments.json'
PASSED, FAILED = 'passed', 'failed'
#: Points of a record that is handed on.
RECORD_POINTS = 12000
#: Envelope: cross current over U_h up to which a course must be held; error allowed with turns.
HELD_SHARE, TURN_S, TURN_MARGIN_M = 0.95, 111.0, 1.0

#: Figures in which the two controllers are compared, and how a table names them.
COMPARED = {
    'cross_track_m.max_steady': 'max\nsteady (m)',
    'cross_track_m.rms_steady': 'rms\nsteady (m)',
    'cross_track_m.max_all': 'max\nall (m)',
    'cross_track_m.max_run': 'max\nrun (m)',
    'heading_fluctuation_deg.rms_steady': 'heading\nrms (deg)',
    'pitch_error_deg.rms_steady': 'pitch\nrms (deg)',
}
#: On a curved path, these.
COMPARED_ON_PATHS = {
    'path_error_m.e2_rms': 'e2\nrms (m)',
    'path_error_m.e2_max': 'e2\nmax (m)',
    'path_error_m.e3_rms': 'e3\nrms (m)',
    'path_error_m.e3_max': 'e3\nmax (m)',
}

#: What a case in the file has that is shown in its row.
_FACTS = ('reactions', 'beside_m', 'hours', 'dive_m', 'built_for')


class Case(NamedTuple):
    """One flight."""

    case: str  #: what sets it apart from the others of its experiment
    controller: str
    guidance: str
    scenario: str
    changes: dict[str, Any] = {}
    measures: tuple[str, ...] = ('attitude',)
    facts: dict[str, Any] = {}  #: goes into the row as it is
    drawn: bool = False  #: a record of it is kept for figures

    def load(self) -> Scenario:
        """Scenario that is flown."""
        chosen = {'control.law': self.controller, 'guidance.los.method': self.guidance}
        return load_scenario(self.scenario, {**self.changes, 'dives': 0, **chosen})

    def command(self) -> str:
        """Shell command that flies it again."""
        options = f'--duration full --controller {self.controller} --guidance {self.guidance}'
        return run_command(self.scenario, self.changes, options)

    def key(self) -> str:
        """The same for flights that are one and the same."""
        return json.dumps([*self[1:5], self.measures])


class Experiment(NamedTuple):
    """Flights, and what is asked of them: cases of the file, or a study of tasks."""

    group: str
    name: str
    section: str  #: of the paper; empty: goes beyond it
    title: str
    paper: str  #: the paper's figure
    cases: list[Case]
    judge: Callable[[list[dict]], list[Check]]
    fly: Callable[[Any], Any] | None = None  #: what a worker does with a task
    tasks: dict[Hashable, Any] = {}
    loops: Iterable[Scenario] = ()  #: whose loops they need
    #: Rows, and what else is shown of all flights, of what came of each task.
    rows: Callable[[dict[Hashable, Any]], tuple[list[dict], dict[str, Any]]] | None = None


# ---------------------------------------------------------------------------------- the file


@cache
def _file() -> dict[str, Any]:
    return read_yaml(Path(__file__).with_name('experiments.yaml'))


def catalogue() -> dict[str, dict[str, dict[str, Any]]]:
    """Experiments by group and name, as the file has them."""
    return _file()['experiments']


def described(name: str) -> dict[str, Any]:
    """What the file says of an experiment."""
    groups = (*catalogue().values(), _file()['studies'])
    return next((group[name] for group in groups if name in group), {})


def make_study(name: str, seed: int, **study: Any) -> Experiment:
    """Experiment of a study that the file describes; it has judge, fly, tasks, loops and rows."""
    title = f'{described(name)["title"]}, seed {seed}'
    return Experiment(name, name, '', title, '-', [], **study)


def make_experiments(groups: list[str]) -> list[Experiment]:
    """Experiments of some groups, in the order of the file."""
    return [
        _experiment(group, name, one)
        for group, experiments in catalogue().items()
        if group in groups
        for name, one in experiments.items()
    ]


def _experiment(group: str, name: str, one: dict[str, Any]) -> Experiment:
    limits = judge_limits(
        _merged(one.get('limits', {})), one.get('limited', 'adaptive'), one.get('limits_of')
    )
    title, cases = one['title'], _cases(name, one)
    if name == 'robustness':
        cases = [case._replace(facts=_changed(case)) for case in cases]
    elif name == 'envelope':
        speed = horizontal_speed(load_scenario(one['scenario']))
        title = title.format(speed=speed)
        cases = [case._replace(facts=_in_current(case, speed)) for case in cases]
    paper = one.get('paper', 'not flown')
    judge = JUDGES.get(name, limits)
    return Experiment(group, name, one.get('section', ''), title, paper, cases, judge)


def _merged(mappings: dict[str, Any] | list[dict[str, Any]]) -> dict[str, Any]:
    """Fields of some mappings; parts of a fault are put together."""
    together: dict[str, Any] = {}
    for one in mappings if isinstance(mappings, list) else [mappings]:
        fault = {**together.pop('fault', {}), **one['fault']} if 'fault' in one else None
        together.update(one if fault is None else {**one, 'fault': fault})
    return together


def _entries(axis: dict[str, Any]) -> list[tuple[str, dict[str, Any]]]:
    """Name and fields of each entry of a mapping of cases."""
    if 'each' in axis:
        return [(axis['name'].format(value), {axis['each']: value}) for value in axis['of']]
    return [(name, _merged(fields)) for name, fields in axis.items()]


def _cases(experiment: str, one: dict[str, Any]) -> list[Case]:
    """Flights of an experiment."""
    cases = []
    for entries in product(*map(_entries, one.get('cases', []))):
        names = [name for name, _ in entries if name]
        fields = _merged([_merged(one.get('set', {})), *(fields for _, fields in entries)])
        facts = {name: fields.pop(name) for name in _FACTS if name in fields}
        if 'labelled' in one:
            facts[one['labelled']] = names[0]
        scenario = fields.pop('scenario', one.get('scenario', experiment))
        laws = fields.pop('laws', one.get('laws', ['adaptive', 'pid']))
        if 'plant' in fields:
            seed = fields.pop('plant')
            vehicle = load_vehicle(load_scenario(scenario, fields).vehicle).params()
            plant = sample_plant(seed, vehicle)
            water = {f'water.{name}': value for name, value in plant.pop('water').items()}
            fields |= {**plant, **water}
        if 'fault' in fields:
            fields['faults'] = [fields.pop('fault')]
        name = one['named'].format(*names) if 'named' in one else ', '.join(names)
        measures = tuple(one.get('measures', ['attitude']))
        cases += [
            Case(name, law, method, scenario, fields, measures, facts, 'drawn' in one)
            for method in one.get('guidance', ['los_current'])
            for law in laws
        ]
    return cases


def _changed(case: Case) -> dict[str, Any]:
    """What is wrong with the vehicle of a case, and how it steers if that is.

    That is its turn rate over sin(roll) over that of its file, in dive and climb.
    """
    facts = {'changes': case.changes}
    if 'perturb.K_MY' in case.changes:
        scenario = load_scenario(case.scenario, case.changes)
        vehicle = load_vehicle(scenario.vehicle).params()
        frame = airframe(vehicle, perturbed(vehicle, scenario.perturb))
        facts['steering'] = {name: frame[f'steering_{name}'] for name in ('dive', 'climb')}
    return facts


def _in_current(case: Case, speed: float) -> dict[str, Any]:
    """The current of a case, and what is expected in it."""
    knots, angle = case.changes['current.speed_kn'], case.changes['current.angle_deg']
    facts = {'speed_kn': knots, 'angle_deg': angle}
    return {**facts, **expectation(speed, knots * KNOT_MPS, angle)}


def expectation(speed: float, current_mps: float, angle_deg: float) -> dict[str, Any]:
    """What physics allows in a current so fast and at such an angle off the path.

    ``speed`` is the horizontal one through the water U_h (m/s).
    """
    angle = math.radians(angle_deg)
    across = abs(current_mps * math.sin(angle))
    _, progress, feasible = crab_heading(
        0.0, speed, current_mps * math.cos(angle), current_mps * math.sin(angle)
    )
    expected = 'marginal' if feasible else 'infeasible'
    if feasible and across <= HELD_SHARE * speed:
        expected = 'feasible'
    return {
        'expected': expected,
        'cross_share': across / speed,
        'progress_mps': progress,
        'limit_m': TURN_S * across + TURN_MARGIN_M,
    }


# ---------------------------------------------------------------------------------- flights


def _fly_case(case: Case) -> tuple[dict[str, Any], Record | None]:
    """Fly one case in a worker: its row, and if it is drawn a record thin enough to hand on."""
    scenario = case.load()
    kept = Rows(SECOND)
    flight, scores = fly_scored(scenario, [kept])
    record = Record(kept.result())
    for measure in case.measures:
        scores.update(MEASURES[measure](record, scenario))
    row = _row(scores, flight.status == 'failed')
    return row, record.thinned(RECORD_POINTS) if case.drawn else None


def _row(scores: dict[str, Any], failed: bool = False) -> dict[str, Any]:
    """Scores with status; a number that is not finite becomes None, and is named."""
    clean = finite(scores)
    whole = not failed and bool(scores['final_state']) and clean == scores
    return {'finite': whole, **clean, **({'status': 'failed'} if failed else {})}


def _tasks(experiments: list[Experiment]) -> dict[Hashable, Callable[[], Any]]:
    """What is to be done; what two experiments share once, with its record if one is drawn."""
    cases: dict[str, Case] = {}
    for case in (case for one in experiments for case in one.cases):
        if case.drawn or case.key() not in cases:
            cases[case.key()] = case
    return {key: partial(_fly_case, case) for key, case in cases.items()} | {
        (one.name, key): partial(one.fly, task)
        for one in experiments
        for key, task in one.tasks.items()
    }


def fly(
    experiments: list[Experiment], pool: Pool, progress: Progress
) -> tuple[list[list[dict]], list[list[Record | None] | dict[str, Any]]]:
    """Fly all experiments, in worker processes.

    Returns rows by experiment and case; and the record of each case (None for what is not drawn),
    or what else is shown of a study.
    """
    flown = pool.results(operator.call, _tasks(experiments), progress)
    found = []
    for one in experiments:
        if one.tasks:
            found.append(one.rows({key: flown[one.name, key] for key in one.tasks}))
            continue
        results = [flown[case.key()] for case in one.cases]
        rows = [
            {
                'case': case.case,
                'controller': case.controller,
                'guidance': case.guidance,
                **case.facts,
                **row,
                'command': case.command(),
            }
            for case, (row, _) in zip(one.cases, results, strict=True)
        ]
        found.append((rows, [record for _, record in results]))
    return [rows for rows, _ in found], [others for _, others in found]


def scenarios(experiments: list[Experiment]) -> Iterator[Scenario]:
    """What `fly` needs the loops of."""
    for one in experiments:
        yield from (case.load() for case in one.cases)
        yield from one.loops


def count_flights(experiments: list[Experiment]) -> int:
    """Number of flights that `fly` makes."""
    return len(_tasks(experiments))


# ---------------------------------------------------------------------------------- verdicts


def compared(rows: list[dict]) -> dict[str, str]:
    """Figures that the rows of an experiment are compared in, with the names of columns."""
    return COMPARED_ON_PATHS if 'path_error_m' in rows[0] else COMPARED


def is_better(one: float | None, other: float | None) -> bool:
    """Whether a figure is smaller than another by 0.01 at least, as printed."""
    return one is not None and (other is None or one <= other - 0.01)


def by_case(rows: list[dict], law: str) -> dict[tuple[str, str], dict]:
    """Rows of a law by case and guidance."""
    return {(row['case'], row['guidance']): row for row in rows if row.get('controller') == law}


def pid_better(rows: list[dict]) -> list[dict[str, Any]]:
    """Figures in which the tuned PID beats the adaptive law."""
    ours, theirs = by_case(rows, 'adaptive'), by_case(rows, 'pid')
    pairs = (
        (case, guidance, name, figure_of(theirs[case, guidance], name), figure_of(row, name))
        for (case, guidance), row in ours.items()
        if (case, guidance) in theirs
        for name in compared(rows)
    )
    fields = ('case', 'guidance', 'figure', 'pid', 'adaptive')
    return [dict(zip(fields, pair, strict=True)) for pair in pairs if is_better(*pair[3:])]


def verdict_of(one: Experiment, rows: list[dict]) -> dict[str, Any]:
    """What the paper says, what was flown, and the verdict, of one experiment."""
    checks = one.judge(rows)
    passed = bool(checks) and all(check.passed for check in checks)
    return {
        'name': one.name,
        'group': one.group,
        'section': one.section,
        'title': one.title,
        'paper': one.paper,
        'rows': rows,
        'pid_better': pid_better(rows),
        'checks': [check._asdict() for check in checks],
        'verdict': PASSED if passed else FAILED,
    }


def report(experiments: list[Experiment], rows: list[list[dict]]) -> dict[str, Any]:
    """Result of the command, over all experiments."""
    return {'experiments': list(map(verdict_of, experiments, rows))}
