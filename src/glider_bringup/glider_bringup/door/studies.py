# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""Sweeps, trims and lists from Python."""

from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager, nullcontext
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Any

import numpy as np

from glider_base.files import yaml_text
from glider_base.settings import ConfigurationError
from glider_bringup.mission.scenario import (
    DEFAULT_SCENARIO,
    load_scenario,
    scenario_names,
    scenario_path,
)
from glider_model.plant.trim import Trim, solve_trim
from glider_model.vehicle.file import load_vehicle, vehicle_names

if TYPE_CHECKING:
    import xarray


def scenarios() -> dict[str, str]:
    """Names of the scenarios that come with the stack, and what each shows."""
    return {name: load_scenario(name).description for name in scenario_names()}


def vehicles() -> dict[str, str]:
    """Names of the vehicles that come with the stack, and what each is."""
    return {name: load_vehicle(name).description for name in vehicle_names()}


def trim(
    vehicle: str | Path,
    net_heaviness_kg: float,
    *,
    pitch_deg: float | None = None,
    pitch_mass_m: float | None = None,
    roll_mass_deg: float = 0.0,
    fin_deg: float = 0.0,
) -> Trim:
    """Steady glide or spiral of a vehicle, as ``./glider trim`` solves it.

    Parameters
    ----------
    vehicle : str or Path
        By name, or path of its YAML file.
    net_heaviness_kg : float
        Positive sinks (kg).
    pitch_deg, pitch_mass_m : float, optional
        One of them: pitch (deg, nose up), or the pitch mass from its neutral position (m).
    roll_mass_deg : float
        Roll mass, positive to starboard (deg).
    fin_deg : float
        Tail fin, or other steering surface, positive to starboard (deg).

    Returns
    -------
    Trim
        Its field ``converged`` is False if there is no steady state.

    Raises
    ------
    ConfigurationError
        If both or neither of pitch and pitch mass are given, or an actuator does not go there.
    """
    params = load_vehicle(str(vehicle)).params()
    return solve_trim(params, net_heaviness_kg, pitch_deg, pitch_mass_m, roll_mass_deg, fin_deg)


@contextmanager
def _sweep_file(name: str | Path | Mapping, scenario: str | Path) -> Iterator[str]:
    """Name or file of a sweep; of a mapping a file is made."""
    if not isinstance(name, Mapping):
        if scenario != DEFAULT_SCENARIO:
            raise ConfigurationError(
                f'scenario {scenario}: the sweep {name} has one of its own (allowed: with a '
                'mapping of fields)'
            )
        yield str(name)
        return
    if not name:
        raise ConfigurationError('sweep: no field to go through (allowed: one or more)')
    dimensions = {
        field.replace('.', '_'): {
            'kind': 'values',
            'field': field,
            'values': np.asarray(list(values)).tolist(),
        }
        for field, values in name.items()
    }
    over = str(scenario)
    if over not in scenario_names():
        over = str(scenario_path(over).resolve())
    with TemporaryDirectory() as place:
        file = Path(place) / 'sweep.yaml'
        file.write_text(yaml_text({'scenario': over, 'dimensions': dimensions}), encoding='utf-8')
        yield str(file)


def sweep(
    name: str | Path | Mapping[str, Iterable[Any]],
    *,
    scenario: str | Path = DEFAULT_SCENARIO,
    set: Mapping[str, Any] | None = None,
    workers: int | None = None,
    scheduler: str | None = None,
    out: str | Path | None = None,
    resume: bool = False,
    progress: bool = False,
) -> 'xarray.Dataset':
    """Fly every combination of values of a sweep file or a mapping, as ``./glider sweep`` does.

    Workers are processes that begin by importing your program: what is not to run in them too
    stands under ``if __name__ == '__main__':``.

    Parameters
    ----------
    name : str, Path or mapping
        Sweep by name, path of its YAML file, or values by the dotted name of a scenario field,
        such as ``{'current.speed_kn': [0.0, 0.5]}``. Its dimensions are then called like the
        fields with ``_`` for ``.``: ``current_speed_kn``.
    scenario : str or Path
        What a mapping is flown over; a sweep file says it itself.
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
    from glider_bringup.console import compiling, counter
    from glider_bringup.studies.sweep import fly as study
    from glider_bringup.studies.sweep.netcdf import read_dataset
    from glider_bringup.studies.sweep.plan import load_sweep
    from glider_bringup.studies.workers import worker_pool

    with _sweep_file(name, scenario) as file:
        plan = load_sweep(file, dict(set or {}))
    bar = counter('flying', plan.cells) if progress else nullcontext(lambda done: None)
    with nullcontext(out) if out is not None else TemporaryDirectory() as place:
        folder = Path(place)
        with study.open_journal(plan, folder, resume) as journal:
            known = study.flown_cells(plan, journal)
            if not all(known):
                loops = plan.combinations
                with worker_pool(workers, scheduler, loops, compiling) as pool, bar as update:
                    study.fly_sweep(plan, journal, known, pool, update, lambda: None)
            study.write_result(plan, journal, folder / study.RESULT_FILE)
        return read_dataset(folder / study.RESULT_FILE)
