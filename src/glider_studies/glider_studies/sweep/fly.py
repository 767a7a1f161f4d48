# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""Flying a sweep: cells in worker processes, each scored as ``./glider run`` does.

What is known of a cell goes into a journal as it comes, and from there into one NetCDF file that
depends on the inputs alone: not on the workers, their order, or interruptions.
"""

from collections.abc import Callable, Iterator
from itertools import islice
from pathlib import Path
from socket import gethostname
from typing import Any, NamedTuple

from glider_base.kernel import source_digest
from glider_base.settings import ConfigurationError, leaves
from glider_base.signals import TICK_S
from glider_bringup.door.netcdf import write_dataset
from glider_bringup.engines.flight import Outcome
from glider_bringup.scoring.card import finite, fly_scored, scorecard
from glider_bringup.scoring.score import Scorer
from glider_mission.disk import whole_file
from glider_mission.planned import planned_ticks
from glider_mission.rules import Rules
from glider_mission.scenario import Scenario, ScenarioSource, make_scenario
from glider_model.vehicle.file import vehicle_path
from glider_studies.sweep.journal import Journal
from glider_studies.sweep.netcdf import NOT_FIGURES, STATUSES, VECTORS, make_dataset, variable_name
from glider_studies.sweep.plan import Plan, vehicle_digest
from glider_studies.workers import WORKER_DIED, Pool, Progress, WorkError

JOURNAL_FILE, RESULT_FILE = 'journal.jsonl', 'sweep.nc'
FAILED = 'failed'

#: A worker is given so much simulated time at once (s): seconds of work, milliseconds of overhead.
CHUNK_S = 100_000.0
#: No more cells than this are given at once, and each thread gets this many chunks if it can.
CHUNK_CELLS, CHUNKS_EACH = 200, 8
#: Longest reason of a failure that is kept (characters).
REASON_LENGTH = 500

#: What a scorecard has that is no result: it belongs to the machine, the engine or the inputs.
NOT_RESULTS = {
    'wall_time_s',
    'real_time_factor',
    'messages_recorded',
    'messages_lost',
    'seed',
    *('guard', 'no_progress'),  # what happened, in words
    'faults',  # the same
    *('wh_per_dive', 'by', 'endurance_days', 'range_km'),  # of energy, wh is enough
}


class Chunk(NamedTuple):
    """Cells that a worker flies one after the other."""

    source: ScenarioSource
    vehicles: frozenset[str]  #: digests of vehicle files: another machine must have the same
    cells: list[tuple[int, dict[str, Any]]]  #: number and scenario fields

    def apart(self) -> list['Chunk']:
        """Each cell by itself."""
        return [self._replace(cells=[cell]) for cell in self.cells]


# ---------------------------------------------------------------------------------- in a worker


def fly_chunk(chunk: Chunk) -> list[dict[str, Any]]:
    """Fly cells: for each its number ``cell``, ``status``, ``reason``, and ``figures`` by name.

    Raises WorkError if this worker would fly another vehicle.
    """
    return [{'cell': cell, **_fly_cell(chunk, changes)} for cell, changes in chunk.cells]


def _fly_cell(chunk: Chunk, changes: dict[str, Any]) -> dict[str, Any]:
    try:
        scenario = make_scenario(chunk.source, changes)
        if vehicle_digest(scenario.vehicle) not in chunk.vehicles:
            name = vehicle_path(scenario.vehicle).stem
            raise WorkError(f'{gethostname()} has another file of {name}')
        flight, scores = fly_scored(scenario)
        card = scorecard(scenario, 'direct', flight, scores)
    except WorkError:
        raise
    except Exception as error:  # whatever it is, it is the end of this cell only
        text = str(error).replace(str(chunk.source.path), chunk.source.path.name)
        if not isinstance(error, ConfigurationError):
            text = f'{type(error).__name__}: {text}'
        return failure(text)
    return judge(card)


def failure(reason: str) -> dict[str, Any]:
    """Record of a cell that has no figures."""
    return {'status': FAILED, 'reason': reason[:REASON_LENGTH], 'figures': {}}


def judge(card: dict[str, Any]) -> dict[str, Any]:
    """Record of a cell from its scorecard; figures that are not finite make it a failure."""
    figures = _figures(card)
    wrong = [name for name, figure in figures.items() if finite(figure) != figure]
    status, reason = card['status'], card['reason']
    if wrong:
        status, reason = FAILED, f'not finite: {", ".join(wrong)}'
    elif status == FAILED:  # in flight: what it was like before is no figure of this cell
        return failure(reason)
    elif status not in STATUSES:
        status, reason = FAILED, f'{status}: {reason}'
    return {'status': status, 'reason': reason[:REASON_LENGTH], 'figures': figures}


def _figures(card: dict[str, Any]) -> dict[str, Any]:
    """Numbers and vectors of a scorecard by dotted name; None where one has no data."""
    return {
        name: value
        for name, value in leaves(card)
        if NOT_RESULTS.isdisjoint(name.split('.'))
        and (not isinstance(value, str | list) or name in VECTORS)
    }


# ---------------------------------------------------------------------------------- here


def result_names(scenario: Scenario) -> set[str]:
    """Names in a result, apart from its dimensions; a scorecard without a flight has them too."""
    empty = Scorer(scenario).result(Rules())
    card = scorecard(scenario, 'direct', Outcome('completed', '', 0.0, 0, 0), empty)
    return NOT_FIGURES | set(map(variable_name, _figures(card)))


def open_journal(plan: Plan, folder: Path, resume: bool) -> Journal:
    """Journal of a sweep in its folder, which is made.

    Raises ConfigurationError if the folder cannot be used or holds something else, or a dimension
    is called like what a result has.
    """
    taken = result_names(plan.first)
    for axis in plan.axes:
        if axis.name in taken:
            raise ConfigurationError(
                f'{plan.path}: dimensions.{axis.name}: a result has something of this name '
                f'(allowed: names other than {", ".join(sorted(taken))})'
            )
    try:
        if not resume:
            folder.mkdir(parents=True, exist_ok=True)
            if any(folder.iterdir()) and not (folder / JOURNAL_FILE).exists():
                raise ConfigurationError(f'--out {folder}: not empty (allowed: an empty folder)')
    except OSError as error:
        raise ConfigurationError(f'--out {folder}: {error.strerror}') from None
    head = {
        'sweep': plan.sweep.name,
        'cells': plan.cells,
        'code': source_digest(),
        'inputs': plan.digest,
    }
    return Journal(folder / JOURNAL_FILE, head, resume)


def flown_cells(plan: Plan, journal: Journal) -> bytearray:
    """For each cell whether the journal knows it."""
    known = bytearray(plan.cells)
    for record in journal.records():
        known[record['cell']] = 1
    return known


def make_chunks(plan: Plan, known: bytearray, threads: int) -> Iterator[Chunk]:
    """Chunks of all cells that are not known yet, in order, for so many threads at once."""
    cell_s = planned_ticks(plan.first) * TICK_S
    share = known.count(0) // (CHUNKS_EACH * max(1, threads))
    size = max(1, min(CHUNK_CELLS, share, int(CHUNK_S / cell_s)))
    unknown = (cell for cell in range(plan.cells) if not known[cell])
    while cells := [(cell, plan.changes(cell)) for cell in islice(unknown, size)]:
        yield Chunk(plan.source, plan.vehicle_digests, cells)


def fly_sweep(
    plan: Plan,
    journal: Journal,
    known: bytearray,
    pool: Pool,
    progress: Progress,
    on_wait: Callable[[], None],
) -> None:
    """Fly all cells that the journal does not know yet (`flown_cells`), into the journal.

    ``progress`` is called with the number of cells that are known, ``on_wait`` every few seconds
    while there is no worker. Raises WorkError if the scheduler is gone, or a worker has another
    program or other files.
    """
    done = sum(known)
    progress(done)
    chunks = make_chunks(plan, known, pool.threads())
    for outcome in pool.outcomes(fly_chunk, chunks, Chunk.apart, on_wait):
        if outcome.died:
            records = [{'cell': cell, **failure(WORKER_DIED)} for cell, _ in outcome.task.cells]
        else:
            records = outcome.result
        journal.append(records)
        done += len(records)
        progress(done)


def write_result(plan: Plan, journal: Journal, file: Path) -> dict[str, Any]:
    """Write the NetCDF file of a sweep whose cells are all known, if it can be written.

    Returns its summary: ``sweep``, ``file``, ``cells``, and how many of each status.
    """
    dataset = make_dataset(plan, journal.records())
    with whole_file(file) as stream:
        write_dataset(dataset, Path(stream.name))
    status = dataset['status'].values.ravel()
    return {
        'sweep': plan.sweep.name,
        'file': str(file),
        'cells': plan.cells,
        **{name: int((status == code).sum()) for code, name in enumerate(STATUSES)},
    }


def failures(plan: Plan, journal: Journal) -> list[dict[str, Any]]:
    """Coordinates of every cell that failed, why, and the command that flies it again."""
    records = (one for one in journal.records() if one['status'] == FAILED)
    failed = {one['cell']: one['reason'] for one in records}
    return [
        {'coordinates': plan.coordinates(cell), 'reason': reason, 'command': plan.command(cell)}
        for cell, reason in sorted(failed.items())
    ]
