# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""Flying a scenario into a run folder, with either engine.

A run is a folder: a bag in rosbag2 layout, the scenario and vehicle that made it, the score.
"""

import json
import math
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from datetime import datetime
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, NamedTuple

from glider_bringup.disk import write_whole
from glider_bringup.engines.direct import MissionParams, MissionState, NotFiniteError, fly_blocks
from glider_bringup.engines.processes import NAMESPACE, node_commands, run_nodes
from glider_bringup.interrupts import interrupts_noted
from glider_bringup.mcap_reader import Bag, has_bag
from glider_bringup.mission.scenario import Scenario, load_scenario
from glider_bringup.ros.bag import BagWriter, Sync
from glider_bringup.ros.bag_log import LogWriter, RecordedLog
from glider_bringup.ros.node_parameters import node_parameters, write_parameters
from glider_bringup.scoring.score import Scorer
from glider_bringup.scoring.traces import TRACED, Tracer, Traces, load_traces
from glider_bringup.showing.figure import draw_run
from glider_bringup.showing.report import report_page
from glider_bringup.showing.web_page import FlownRun
from glider_guidance.guidance import path_time_s
from glider_guidance.profile import mission_time_s
from glider_model.files import is_file, read_json
from glider_model.ros.health import FINISHED
from glider_model.settings import ConfigurationError
from glider_model.signals import NOT_FINITE, TICK_NS, TICK_S
from glider_model.vehicle import load_vehicle, vehicle_path

SCENARIO_FILE, VEHICLE_FILE, SCORE_FILE = 'scenario.yaml', 'vehicle.yaml', 'score.json'
PARAMETERS_FILE, LOG_FILE = 'parameters.yaml', 'log.txt'
TRACES_FILE, REPORT_FILE = 'traces.npz', 'report.html'

#: Fields without which a score file is not a scorecard.
CARD_FIELDS = {
    *('scenario', 'vehicle', 'controller', 'guidance', 'engine', 'seed', 'status', 'reason'),
    *('ticks', 'sim_time_s', 'wall_time_s', 'real_time_factor', 'messages_recorded'),
    *('messages_lost', 'dives', 'distance_along_path_m', 'cross_track_m', 'pitch_error_deg'),
    *('heading_fluctuation_deg', 'depth_m', 'actuator_travel', 'final_state'),
}
#: What these fields hold: numbers, lists of numbers, or None where there is no data.
CARD_GROUPS = {
    'cross_track_m': {'rms_steady', 'max_steady', 'max_all'},
    'pitch_error_deg': {'rms_steady', 'max_steady'},
    'heading_fluctuation_deg': {'rms_steady', 'max_steady'},
    'depth_m': {'max', 'overshoot'},
    'actuator_travel': {'buoyancy_engine_kg', 'pitch_mass_m', 'roll_mass_deg'},
    'final_state': {'position_ned_m', 'attitude_rpy_rad', 'velocity_mps'},
}
STATUSES = ('completed', 'infeasible', 'aborted', 'failed')
#: Exit code of a node that refuses its parameters.
EXIT_CONFIGURATION = 2

#: Called now and then with the ticks flown and the depth (m).
Progress = Callable[[int, float], None]
#: Gets the ticks read from a bag, and about how many there are.
Reading = Callable[[int, int], None]


class Flight(NamedTuple):
    """How a flight ended, apart from what its topics tell."""

    status: str  #: completed, aborted, or failed: a number was not finite
    reason: str  #: why it was aborted, or failed
    wall_time_s: float | None  #: None if nobody measured it
    messages_recorded: int
    messages_lost: int


def planned_ticks(scenario: Scenario) -> int:
    """Ticks that a run of the scenario takes; an estimate where dives or its path end it."""
    duration_s, plant = scenario.duration_s, scenario.plant_settings()
    guidance = scenario.guidance_settings().params()
    if scenario.dives:
        dives_s = mission_time_s(guidance.profile, scenario.dives)
        duration_s = min(duration_s, dives_s + plant.surface_s)
    if guidance.ends_with_path:
        path_s = path_time_s(guidance, *scenario.constant_current())
        duration_s = min(duration_s, path_s + plant.afloat_s)
    return max(1, round(duration_s / TICK_S))


def make_run_folder(scenario: Scenario, out: Path | None) -> Path:
    """Folder of a new run, with its scenario and vehicle in it.

    Raises
    ------
    ConfigurationError
        If the folder cannot be made, or already holds something.
    """
    stamp = datetime.now().strftime('%Y%m%d-%H%M%S')
    folder = out or Path('runs') / f'{stamp}-{scenario.name}'
    for attempt in range(2, 100):
        if out or not folder.exists():
            break
        folder = Path('runs') / f'{stamp}-{scenario.name}-{attempt}'
    try:
        folder.mkdir(parents=True, exist_ok=True)
        if any(folder.iterdir()):
            raise ConfigurationError(
                f'{folder}: not empty; a run is never written over another (allowed: a new or '
                f'empty folder)'
            )
        vehicle = vehicle_path(scenario.vehicle)
        write_whole(folder / VEHICLE_FILE, vehicle.read_bytes())
        beside = scenario.model_copy(update={'vehicle': VEHICLE_FILE})
        write_whole(folder / SCENARIO_FILE, beside.to_yaml())
    except OSError as error:
        raise ConfigurationError(f'{folder}: {error.strerror}') from None
    return folder


def make_result_folder(folder: Path, result: str) -> None:
    """Folder for a study whose result is the file ``result``.

    Raises
    ------
    ConfigurationError
        If it cannot be made, or already holds a result.
    """
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise ConfigurationError(f'--out {folder}: {error.strerror}') from None
    if (folder / result).exists():
        raise ConfigurationError(
            f'--out {folder}: it has a {result} already; a result is never written over '
            f'another (allowed: another folder)'
        )


def mission_of(scenario: Scenario) -> tuple[MissionState, MissionParams]:
    """State at tick 0 and parameters of the four blocks."""
    blocks = scenario.block_settings()
    state = MissionState(*(block.initial_state() for block in blocks))
    return state, MissionParams(*(block.params() for block in blocks))


def make_tracer(scenario: Scenario) -> Tracer:
    """Tracer of a run of the scenario."""
    vehicle = load_vehicle(scenario.vehicle).params()
    return Tracer(vehicle, scenario.sensors.params(scenario.seed))


def fly_direct(
    scenario: Scenario,
    folder: Path,
    with_bag: bool,
    progress: Progress,
    tracer: Tracer | None = None,
    sync: Sync = 'end',
) -> tuple[Flight, dict]:
    """Fly with the direct engine; Ctrl-C ends it as aborted with what was flown.

    A number that is not finite ends it as failed, with what was flown before.
    """
    state, params = mission_of(scenario)
    scorer = _scorer(scenario)
    bag = _open_bag(scenario, folder, sync) if with_bag else None
    takers = [taker for taker in (scorer, tracer, bag) if taker is not None]
    status, reason, ticks = 'completed', '', 0
    start = time.perf_counter()
    with interrupts_noted() as interrupts:
        try:
            for log in fly_blocks(state, params):
                for taker in takers:
                    taker.add(log)
                ticks += len(log)
                progress(ticks, float(-log[-1, 2]))
                if interrupts:
                    status, reason = 'aborted', 'stopped by SIGINT'
                    break
        except NotFiniteError as error:
            status, reason = 'failed', str(error)
    wall_time_s = time.perf_counter() - start
    if bag and status != 'aborted':
        bag.finish(reason)
    recorded = bag.close() if bag else 0
    return Flight(status, reason, wall_time_s, recorded, 0), _score(scenario, scorer)


def _ended(complete: bool, reason: str) -> str:
    """Status of a flight that was complete, or ended early for a reason."""
    if complete:
        return 'completed'
    return 'failed' if NOT_FINITE in reason else 'aborted'


def _open_bag(scenario: Scenario, folder: Path, sync: Sync) -> LogWriter:
    attachments = [folder / SCENARIO_FILE, folder / VEHICLE_FILE]
    points = scenario.path.points(500)
    bag = BagWriter(folder, scenario.name, attachments=attachments, sync=sync)
    return LogWriter(bag, points)


def fly_nodes(
    scenario: Scenario,
    folder: Path,
    speed: float,
    progress: Progress,
    on_log: Callable[[str], None],
    namespace: str | None = None,
    tracer: Tracer | None = None,
    on_read: Callable[[int], None] = lambda ticks: None,
    sync: Sync = 'end',
) -> tuple[Flight, dict]:
    """Fly over node processes and topics; the score is read back from the bag.

    ``speed`` is in times real time, 0.0 being as fast as possible; ``on_log`` gets each line that
    a node prints, ``on_read`` the ticks that have been read back. Nodes in a ``namespace`` of
    their own have their clock in it.
    """
    attachments = (folder / SCENARIO_FILE, folder / VEHICLE_FILE)
    parameters = node_parameters(
        scenario, speed=speed, record_to=folder, attachments=attachments, sync=sync
    )
    place = namespace or NAMESPACE
    write_parameters(parameters, folder / PARAMETERS_FILE, place)
    result = run_nodes(
        node_commands(folder / PARAMETERS_FILE, place, own_clock=namespace is not None),
        folder / LOG_FILE,
        on_progress=lambda said: progress(said['tick'], said['depth_m']),
        on_log=on_log,
    )
    if result.exit_code == EXIT_CONFIGURATION:
        raise ConfigurationError(result.reason)
    completed, reason = result.status == 'completed', result.reason
    scorer = _scorer(scenario)
    recorded, lost = 0, 0
    if has_bag(folder):  # else it ended before the recorder was up
        log = _replay(Bag(folder), scorer, tracer, on_read)
        if completed and (missing := log.missing(None)):
            completed, reason = False, missing
        recorded, lost = sum(log.counts.values()), log.lost(completed)
    status = _ended(completed, reason)
    flight = Flight(status, reason, result.flight_s, recorded, lost)
    return flight, _score(scenario, scorer)


def _scorer(scenario: Scenario) -> Scorer:
    """Scorer of a run of the scenario."""
    return Scorer(scenario.sensors.params(scenario.seed))


def _score(scenario: Scenario, scorer: Scorer) -> dict:
    return scorer.result(scenario.score_rules(scorer.ticks * TICK_S))


def scorecard(scenario: Scenario, engine: str | None, flight: Flight, scores: dict) -> dict:
    """Contents of ``score.json``; a figure that is not finite is None there, and a failure."""
    scores, wrong = dict(scores), list(_not_finite(scores))
    infeasible = scores.pop('infeasible')
    status = flight.status
    if status == 'completed' and infeasible:
        status = 'infeasible'
    reason = flight.reason
    if wrong and status != 'failed':
        status, reason = 'failed', f'the score is not finite: {", ".join(wrong)}'
    sim_time_s = scores['sim_time_s']
    return {
        'scenario': scenario.name,
        'vehicle': load_vehicle(scenario.vehicle).name,
        'controller': scenario.control.law,
        'guidance': scenario.guidance.los.method,
        'engine': engine,
        'seed': scenario.seed,
        'status': status,
        'reason': reason,
        'ticks': scores.pop('ticks'),
        'sim_time_s': scores.pop('sim_time_s'),
        'wall_time_s': flight.wall_time_s,
        'real_time_factor': sim_time_s / flight.wall_time_s if flight.wall_time_s else None,
        'messages_recorded': flight.messages_recorded,
        'messages_lost': flight.messages_lost,
        **finite(scores),
    }


def finite(value: Any) -> Any:
    """The same without numbers that JSON does not have: they become None."""
    if isinstance(value, dict):
        return {name: finite(inner) for name, inner in value.items()}
    if isinstance(value, list):
        return [finite(inner) for inner in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value


def _not_finite(scores: dict) -> Iterator[str]:
    """Dotted names of the figures that are not finite."""
    for name, value in scores.items():
        if isinstance(value, dict):
            yield from (f'{name}.{inner}' for inner in _not_finite(value))
        elif value != finite(value):
            yield name


def write_score(folder: Path, card: dict) -> None:
    """Write ``score.json``."""
    write_whole(folder / SCORE_FILE, json.dumps(card, indent=2, allow_nan=False) + '\n')


def score_again(run: Path, progress: Reading = lambda ticks, total: None) -> dict:
    """Scorecard of a run, computed afresh from its bag if it has one.

    How the run ended is what its `SCORE_FILE` says, or the bag where there is none: a recording
    made by the launch file, or the MCAP file alone. A run of which ticks are missing in its bag is
    not completed, whatever is said: its status is ``aborted``, and the reason names what is
    missing. Reports, figures and comparisons keep to that.

    Parameters
    ----------
    run : Path
        Run folder, or its MCAP file.
    progress : callable, optional

    Raises
    ------
    ConfigurationError
        If it holds no run, its bag is damaged, or not one tick is in it.
    """
    old = _read_score(run)
    if not has_bag(run):
        return old
    bag = Bag(run)
    with _flown(run, bag) as (scenario, _):
        return _score_bag(run, bag, scenario, old, progress)


def _score_bag(
    run: Path,
    bag: Bag,
    scenario: Scenario,
    old: dict,
    progress: Reading,
    tracer: Tracer | None = None,
) -> dict:
    """Scorecard of a bag, which a tracer may follow; ``old`` is the one the run has, or empty."""
    scorer = _scorer(scenario)
    total = old.get('ticks') or planned_ticks(scenario)
    log = _replay(bag, scorer, tracer, lambda ticks: progress(ticks, max(ticks, total)))
    missing = log.missing(old.get('ticks'))
    if old:
        complete, reason = old['status'] not in ('aborted', 'failed'), old['reason']
    else:
        complete, reason = _end_of_run(log)
    lost = log.lost(complete)
    if not log.ticks and (lost or missing):
        why = bag.cut or (
            'its first tick is not complete, as in a free-running recording (allowed: runs in '
            'lockstep, with every message of every tick)'
        )
        raise ConfigurationError(f'{run}: cannot be scored: {why}')
    if missing and (complete or not old or log.ticks < old['ticks']):
        complete, reason = False, '; '.join(one for one in (reason, missing) if one)
    status = _ended(complete, reason)
    recorded = sum(log.counts.values())
    flight = Flight(status, reason, old.get('wall_time_s'), recorded, lost)
    engine = old.get('engine') or ('nodes' if (run / PARAMETERS_FILE).exists() else None)
    return scorecard(scenario, engine, flight, _score(scenario, scorer))


def _end_of_run(log: RecordedLog) -> tuple[bool, str]:
    """Whether the plant said in a bag that the run is complete; if not, what it said instead."""
    if log.end is None:
        return False, 'the recording was stopped before the run was complete'
    complete = log.end.phase == FINISHED
    return complete, '' if complete else log.end.message


def _replay(
    bag: Bag,
    scorer: Scorer,
    tracer: Tracer | None,
    progress: Callable[[int], None],
) -> RecordedLog:
    """Give the rows of a bag to those who want them; ``progress`` gets the ticks read."""
    takers = [taker for taker in (scorer, tracer) if taker is not None]
    log = RecordedLog(bag, TRACED if tracer else ())
    for rows in log.blocks():
        for taker in takers:
            taker.add(rows)
        progress(log.ticks)
    return log


def _read_score(run: Path) -> dict:
    """Contents of a run's score file; empty if it has none, but a bag."""
    path = run / SCORE_FILE
    if not is_file(path):
        if not run.exists():
            raise ConfigurationError(f'{run}: no such run folder or .mcap file')
        if not has_bag(run):
            raise ConfigurationError(
                f'{run}: not a run folder, it has neither a bag (.mcap) nor a {SCORE_FILE}'
            )
        return {}
    card = read_json(path)
    if not _is_card(card):
        raise ConfigurationError(f'{path}: not a scorecard of this program')
    return card


def _is_card(card) -> bool:
    """Whether a value, which may be anything, can be taken for a scorecard."""
    if not isinstance(card, dict) or not CARD_FIELDS <= set(card):
        return False
    texts = ('scenario', 'vehicle', 'controller', 'guidance', 'status', 'reason')
    numbers = ('sim_time_s', 'wall_time_s', 'real_time_factor', 'distance_along_path_m')
    counts = ('seed', 'ticks', 'messages_recorded', 'messages_lost', 'dives')
    return (
        all(isinstance(card[name], str) for name in texts)
        and card['status'] in STATUSES
        and isinstance(card['engine'], str | None)
        and all(isinstance(card[name], int) and card[name] >= 0 for name in counts)
        and all(_is_figure(card[name]) for name in numbers)
        and all(
            isinstance(card[group], dict)
            and names <= set(card[group])
            and all(_is_figure(value) for value in card[group].values())
            for group, names in CARD_GROUPS.items()
            if card['ticks'] or group != 'final_state'  # a run without a tick has none
        )
        and _is_guard(card.get('guard', {}))
    )


def _is_guard(guard) -> bool:
    """Whether a value is what control noticed in a run; runs of before tell nothing of it."""
    events = guard.get('events', []) if isinstance(guard, dict) else None
    return isinstance(events, list) and all(
        isinstance(event, dict)
        and isinstance(event.get('message'), str)
        and isinstance(event.get('t_s'), int | float)
        for event in events
    )


def _is_figure(value) -> bool:
    """Whether a value is a figure of a scorecard: a number, None, or three numbers."""
    if isinstance(value, list):
        return len(value) == 3 and all(isinstance(one, int | float) for one in value)
    return value is None or isinstance(value, int | float)


@contextmanager
def _flown(run: Path, bag: Bag | None) -> Iterator[tuple[Scenario, str]]:
    """Scenario of a run, and the text of its file.

    It is the file beside the bag or, if there is none, the one stored in it.
    """
    file = run / SCENARIO_FILE
    if file.is_file():
        yield load_scenario(str(file), recorded=True), file.read_text(encoding='utf-8')
        return
    stored = bag.attachments if bag else {}
    if SCENARIO_FILE not in stored:
        raise ConfigurationError(
            f'{run}: no {SCENARIO_FILE} beside the bag, and none stored in it: put the one that '
            f'was flown beside it'
        )
    with TemporaryDirectory() as folder:
        for name in {SCENARIO_FILE, VEHICLE_FILE} & set(stored):
            (Path(folder) / name).write_bytes(stored[name])
        try:
            scenario = load_scenario(str(Path(folder) / SCENARIO_FILE), recorded=True)
        except ConfigurationError as error:
            raise ConfigurationError(str(error).replace(folder, f'{run}: stored')) from None
        yield scenario, stored[SCENARIO_FILE].decode()


def read_run(
    run: Path, progress: Reading = lambda ticks, total: None, traced: bool = True
) -> FlownRun:
    """A run as pages and figures show it: as it was kept when it was flown, else from its bag.

    Parameters
    ----------
    run : Path
        Run folder, or its MCAP file.
    progress : callable, optional
    traced : bool
        Whether its traces are wanted; if not, and it has a scorecard, its bag is not read.

    Raises
    ------
    ConfigurationError
        If it holds no run, its bag is damaged, or there is nothing that could be drawn.
    """
    card, kept = _read_score(run), run / TRACES_FILE
    bag = Bag(run) if has_bag(run) else None
    with _flown(run, bag) as (scenario, as_flown):
        is_kept = card and (not traced or kept.is_file())
        if is_kept and (bag is None or _covers(bag, card)):
            traces = load_traces(kept) if traced else None
        elif bag is None:
            raise ConfigurationError(
                f'{run}: nothing to draw, it has neither {TRACES_FILE} nor a bag (allowed: a '
                f'run flown without --no-report, or with a bag)'
            )
        else:
            tracer = make_tracer(scenario) if traced else None
            card = _score_bag(run, bag, scenario, card, progress, tracer)
            traces = tracer.result() if tracer else None
        return _flown_run(run, scenario, as_flown, card, traces)


def _covers(bag: Bag, card: dict) -> bool:
    """Whether a bag goes as far as the scorecard of its run."""
    return not bag.cut and bag.end_ns >= (card['ticks'] - 1) * TICK_NS


def _flown_run(
    run: Path, scenario: Scenario, as_flown: str, card: dict, traces: Traces | None
) -> FlownRun:
    """A run with its name and vehicle."""
    vehicle = load_vehicle(scenario.vehicle)
    rules = scenario.score_rules(card['sim_time_s'])
    return FlownRun(run.resolve().name, scenario, as_flown, vehicle, card, traces, rules)


def keep_traces(scenario: Scenario, folder: Path, card: dict, tracer: Tracer) -> FlownRun:
    """Keep what was traced of a flight in its run folder.

    Raises
    ------
    ConfigurationError
        If it cannot be written.
    """
    traces = tracer.result()
    traces.save(folder / TRACES_FILE)
    as_flown = (folder / SCENARIO_FILE).read_text(encoding='utf-8')
    return _flown_run(folder, scenario, as_flown, card, traces)


def write_report(run: FlownRun, file: Path) -> None:
    """Write the report of a run.

    Raises
    ------
    ConfigurationError
        If the file cannot be written.
    """
    write_whole(file, report_page(run))


def draw(run: Path, file: Path, progress: Reading = lambda ticks, total: None) -> None:
    """Draw a run into an image file.

    Raises
    ------
    ConfigurationError
        If it holds no run, or the image cannot be written.
    """
    flown = read_run(run, progress)
    title = f'{flown.scenario.name}: {flown.scenario.description}'
    draw_run(flown.traces, title, file)
