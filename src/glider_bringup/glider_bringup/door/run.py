# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""Flights from Python, and runs that were flown."""

import atexit
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import ExitStack, contextmanager, nullcontext
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory
from threading import Lock
from typing import TYPE_CHECKING, Any

import numpy as np

from glider_base.ros.places import given_domain
from glider_base.settings import ConfigurationError, path_of
from glider_bringup.engines.compiling import shown_once
from glider_bringup.engines.flight import Progress, Sink
from glider_bringup.engines.flight import fly as fly_direct
from glider_bringup.scoring.card import scorecard, write_score
from glider_bringup.scoring.one_hertz import Rows
from glider_bringup.scoring.score import Scorer, scores_of
from glider_bringup.scoring.traces import make_tracer
from glider_control.law import LawSettings
from glider_control.own_law import own_law
from glider_mission.changes import given_fields
from glider_mission.choices import ENGINES, chosen_fields, combination_of
from glider_mission.disk import write_whole
from glider_mission.planned import planned_ticks
from glider_mission.recording.bag_files import has_bag
from glider_mission.recording.mcap_reader import Bag
from glider_mission.run_folder import (
    REPORT_FILE,
    SCENARIO_FILE,
    TRACES_FILE,
    run_folder,
    scenario_of,
    write_scenario,
)
from glider_mission.scenario import (
    DEFAULT_SCENARIO,
    Scenario,
    changed_scenario,
    know_law,
    load_scenario,
)

if TYPE_CHECKING:
    import xarray

#: A law is known by its name until its scenario is made: not by that of another thread.
_CHOOSING = Lock()


@dataclass(frozen=True)
class Run:
    """A run that was flown, by `fly` or long ago.

    Attributes
    ----------
    scenario : Scenario
        What was flown.
    score : dict
        The scorecard, as in ``score.json``.
    folder : Path or None
        Its run folder or MCAP file; None if it lives in memory alone.
    """

    scenario: Scenario
    score: dict[str, Any]
    folder: Path | None
    _rows: Callable[[], np.ndarray] = field(repr=False, compare=False)

    def __repr__(self) -> str:
        card = self.score
        return (
            f'Run({card["scenario"]}, {card["controller"]}, {card["status"]}, '
            f'{card["sim_time_s"]:,.1f} s, folder={self.folder and str(self.folder)!r})'
        )

    def to_xarray(self) -> 'xarray.Dataset':
        """Every number of every topic, tick by tick.

        Returns
        -------
        xarray.Dataset
            One-dimensional variables over ``time`` (s), uniform in steps of 0.1 s. Names are those
            of the topics with that of the quantity, such as ``odom_depth``. World NED, body FRD,
            SI and radians, whatever the topics carry; units, meaning and frame are in ``attrs``.

        Raises
        ------
        ConfigurationError
            If the run has no bag, or it is damaged.
        """
        from glider_bringup.door.dataset import make_dataset

        return make_dataset(self._rows(), self.scenario, self.score)

    def report(self, path: str | Path | None = None) -> Path:
        """Write the report: one HTML file that needs no network.

        Parameters
        ----------
        path : str or Path, optional
            By default ``report.html`` in the run folder, or in the current one if there is none.

        Returns
        -------
        Path
            The file.

        Raises
        ------
        ConfigurationError
            If it cannot be written, or there is nothing that could be drawn.
        """
        from glider_bringup.showing.flown_run import flown_run, read_run
        from glider_bringup.showing.report import report_page

        folder = self.folder if self.folder and self.folder.is_dir() else None
        file = path_of('path', path) if path is not None else (folder or Path()) / REPORT_FILE
        if self.folder:
            flown = read_run(self.folder)
        else:
            tracer = make_tracer(self.scenario)
            tracer.add(self._rows())
            name = Path(self.scenario.name)
            flown = flown_run(name, self.scenario, self.score, tracer.result())
        write_whole(file, report_page(flown))
        return file


def chosen_scenario(
    scenario: str | Path | Scenario,
    fields: Mapping[str, Any] | None,
    controller: str | None,
    law: type[LawSettings] | Callable | None,
    guidance: str | None,
    seed: int | None,
    duration: float | str | None,
) -> Scenario:
    """The scenario that the arguments of `fly` ask for."""
    if law is not None and controller is not None:
        raise ConfigurationError(f'--controller {controller}: not with a law of your own')
    own = own_law(law) if law is not None else None
    with _CHOOSING:
        if own:
            controller = know_law(own)
        fields = chosen_fields(given_fields(fields), controller, guidance, seed, duration)
        if not isinstance(scenario, Scenario):
            return load_scenario(scenario, fields)
        return changed_scenario(scenario, fields, own) if fields else scenario


# long: most of it says what its parameters are.
def fly(
    scenario: str | Path | Scenario = DEFAULT_SCENARIO,
    set: Mapping[str, Any] | None = None,
    *,
    controller: str | None = None,
    law: type[LawSettings] | Callable | None = None,
    guidance: str | None = None,
    seed: int | None = None,
    duration: float | str | None = None,
    engine: str = 'direct',
    out: str | Path | None = None,
    bag: bool = False,
    progress: bool = False,
) -> Run:
    """Fly a scenario, as ``./glider run`` does.

    Ctrl-C ends a flight, whose status is then ``aborted``; what was flown is kept.

    Parameters
    ----------
    scenario : str, Path or Scenario
        By name, by path of its YAML file, or as it was loaded.
    set : mapping, optional
        Scenario fields to change, by dotted name, such as ``{'current.speed_kn': 0.8}``.
    controller, guidance, seed : optional
        Attitude law, line of sight and seed instead of those of the scenario.
    law : type or callable, optional
        A control law of your own program or notebook, called by its name: a subclass of
        `glider_control.law.LawSettings`, or a function of what a law sees that returns the roll
        and the pitch moment (N m). Direct engine only. Who verifies or scores the recording needs
        the law, too.
    duration : float or 'full', optional
        Simulated time (s), or that of the whole scenario. By default its dives.
    engine : str
        ``'direct'``, one compiled loop, or ``'nodes'``, ROS 2 processes. Same results.
    out : str or Path, optional
        Run folder: scenario, vehicle, score, and what its report is drawn from. Without one
        nothing is written.
    bag : bool
        Whether the direct engine records a bag into the run folder; nodes always do.
    progress : bool
        Whether a bar is shown on standard error.

    Raises
    ------
    ConfigurationError
        Naming field, value and allowed range.
    """
    from glider_bringup.console import progress as bar

    if engine not in ENGINES:
        raise ConfigurationError(
            f'--engine {engine!s:.80}: unknown (allowed: {", ".join(ENGINES)})'
        )
    if bag and out is None:
        raise ConfigurationError('--bag: a bag needs a run folder (allowed: with --out)')
    if law is not None and engine != 'direct':
        raise ConfigurationError(
            f'--engine {engine}: its processes have no law of your program (allowed: direct)'
        )
    if engine == 'nodes':
        given_domain()
    flown = chosen_scenario(scenario, set, controller, law, guidance, seed, duration)
    kept = out is not None
    out = path_of('out', out) if kept else None
    rows, tracer = Rows(), make_tracer(flown)
    in_bag = kept and (bag or engine == 'nodes')
    sinks = [*([] if in_bag else [rows]), *([tracer] if kept else [])]
    with (
        _run_folder(flown, out, engine) as folder,
        bar(planned_ticks(flown)) if progress else nullcontext((None, None)) as shown,
    ):
        flown, card = fly_by(engine, flown, folder, sinks, shown, bag)
        if kept:
            write_score(folder, card)
            tracer.result().save(folder / TRACES_FILE)
    source = partial(_rows_of, folder, flown.vehicle) if in_bag else rows.result
    return Run(flown, card, folder if kept else None, source)


@contextmanager
def _run_folder(scenario: Scenario, out: Path | None, engine: str) -> Iterator[Path | None]:
    """Folder of a run: a new one, one that nodes need for as long as they fly, or none."""
    with ExitStack() as stack:
        if out is None and engine == 'nodes':
            out = Path(stack.enter_context(TemporaryDirectory())) / 'run'
        yield stack.enter_context(run_folder(scenario, out)) if out is not None else None


def fly_by(
    engine: str,
    scenario: Scenario,
    folder: Path | None,
    sinks: Iterable[Sink],
    shown: tuple[Progress | None, Callable[[int], None] | None],
    bag: bool,
    sync: str = 'end',
    **nodes: Any,
) -> tuple[Scenario, dict[str, Any]]:
    """Fly with the engine of this name, into a folder if there is a bag; give the scorecard too.

    ``shown`` is called in flight, and while a bag is read back; `fly_nodes` takes the ``nodes``.
    The scenario that comes back, and stands in the folder, has the orders that were given in
    flight.
    """
    from glider_bringup.console import compiling

    scorer, (flying, reading) = Scorer(scenario), shown
    sinks = [scorer, *sinks]
    with shown_once(combination_of(scenario), compiling) if engine == 'direct' else nullcontext():
        if engine == 'direct' and not bag:  # nothing of ROS is needed
            flight = fly_direct(scenario, sinks, flying)
        else:
            from glider_bringup.engines.recorded import fly_nodes, fly_recorded

            if engine == 'direct':
                flight = fly_recorded(scenario, folder, sinks, flying, sync)
            else:
                nodes |= {'sync': sync, 'on_read': reading or (lambda ticks: None)}
                flight = fly_nodes(scenario, folder, sinks, flying, **nodes)
    if flight.orders:
        scenario = scenario.with_orders(flight.orders)
        if folder:
            write_scenario(scenario, folder)
    return scenario, scorecard(scenario, engine, flight, scores_of(scenario, scorer))


def open_run(path: str | Path) -> Run:
    """A run that was flown before.

    Parameters
    ----------
    path : str or Path
        Run folder, or an MCAP file.

    Raises
    ------
    ConfigurationError
        If there is no run, or its bag is damaged.
    """
    from glider_bringup.showing.flown_run import read_run

    path = path_of('path', path)
    card = read_run(path, traced=False).card
    with ExitStack() as stack:
        attachments = Bag(path).attachments if has_bag(path) else {}
        scenario = stack.enter_context(scenario_of(path, attachments)).scenario
        if not (path / SCENARIO_FILE).is_file():
            # what a bag alone brings is there as long as the program: scenarios name its vehicle
            atexit.register(stack.pop_all().close)
    return Run(scenario, card, path, partial(_rows_of, path, scenario.vehicle))


def _rows_of(path: Path, vehicle: str) -> np.ndarray:
    """Rows of the bag of a run, float64[ticks, ROW]."""
    from glider_mission.recording.ros.recorded_log import read_back

    rows = Rows()
    read_back(Bag(path), vehicle, [rows])
    return rows.result()
