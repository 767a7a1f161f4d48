# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""Sweeps from Python."""

from collections.abc import Iterable, Mapping
from contextlib import nullcontext
from numbers import Integral
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import xarray

from glider_base.errors import ConfigurationError, shown
from glider_base.settings import path_of
from glider_bringup.console import compiling, counter
from glider_bringup.door.netcdf import read_dataset
from glider_mission.changes import given_fields, plain
from glider_mission.scenario import DEFAULT_SCENARIO, scenario_names, scenario_path
from glider_studies.sweep import fly as study
from glider_studies.sweep.plan import Plan, load_sweep
from glider_studies.workers import worker_pool


def _plan(
    name: str | Path | Mapping, scenario: str | Path | None, changes: dict[str, Any]
) -> Plan:
    """Plan of a sweep by name or file, or of a mapping."""
    if not isinstance(name, Mapping):
        if scenario is not None:
            raise ConfigurationError(
                f'scenario {scenario!s:.80}: the sweep {name!s:.80} has one of its own (allowed: '
                'with a mapping of fields)'
            )
        return load_sweep(name, changes)
    if not name:
        raise ConfigurationError('sweep: no field to go through (allowed: one or more)')
    for field, values in name.items():
        if isinstance(values, str) or not isinstance(values, Iterable):
            raise ConfigurationError(
                f'sweep: {field!s:.80} = {shown(values)}: not usable (allowed: a list of values)'
            )
    dimensions = {
        str(one).replace('.', '_'): {'kind': 'values', 'field': one, 'values': plain(list(values))}
        for one, values in name.items()
    }
    over = str(DEFAULT_SCENARIO if scenario is None else scenario)
    if over not in scenario_names():
        over = str(scenario_path(over).resolve())
    return Plan(Path('sweep.yaml'), changes, {'scenario': over, 'dimensions': dimensions})


def sweep(
    name: str | Path | Mapping[str, Iterable[Any]],
    *,
    scenario: str | Path | None = None,
    set: Mapping[str, Any] | None = None,
    workers: int | None = None,
    scheduler: str | None = None,
    out: str | Path | None = None,
    resume: bool = False,
    progress: bool = False,
) -> xarray.Dataset:
    """Fly every combination of values of a sweep file or a mapping, as ``./glider sweep`` does.

    Workers are processes that begin by importing your program: what is not to run in them too
    stands under ``if __name__ == '__main__':``.

    Parameters
    ----------
    name : str, Path or mapping
        Sweep by name, path of its YAML file, or values by the dotted name of a scenario field,
        such as ``{'current.speed_kn': [0.0, 0.5]}``. Its dimensions are then called like the
        fields with ``_`` for ``.``: ``current_speed_kn``.
    scenario : str or Path, optional
        What a mapping is flown over, by default ``current_8deg``; a sweep file says it itself.
    set : mapping, optional
        Scenario fields of every flight, by dotted name.
    workers : int, optional
        Processes; by default one per processor.
    scheduler : str, optional
        Address of the scheduler of a Dask cluster, instead.
    out : str or Path, optional
        Folder of journal and result. Without one nothing is kept.
    resume : bool
        Go on where an interrupted sweep in this folder has stopped.
    progress : bool
        Whether a bar is shown on standard error.

    Returns
    -------
    xarray.Dataset
        Every figure of the scorecard over the dimensions of the sweep. ``status`` says how each
        flight ended, ``reason`` why one failed.

    Raises
    ------
    ConfigurationError
        Naming file, field, value and allowed range.
    """
    if workers is not None and not (isinstance(workers, Integral) and 1 <= workers <= 1024):
        raise ConfigurationError(f'workers = {shown(workers)}: not usable (allowed: 1 to 1024)')
    plan = _plan(name, scenario, given_fields(set))
    bar = counter('flying', plan.cells) if progress else nullcontext(lambda done: None)
    with nullcontext(out) if out is not None else TemporaryDirectory() as place:
        folder = path_of('out', place)
        with study.open_journal(plan, folder, resume) as journal:
            known = study.flown_cells(plan, journal)
            if not all(known):
                loops = plan.loops()
                with worker_pool(workers, scheduler, loops, compiling) as pool, bar as update:
                    study.fly_sweep(plan, journal, known, pool, update, lambda: None)
            study.write_result(plan, journal, folder / study.RESULT_FILE)
        return read_dataset(folder / study.RESULT_FILE)
