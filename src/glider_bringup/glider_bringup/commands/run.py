# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""``./glider run``."""

import json
from collections.abc import Callable
from contextlib import contextmanager, nullcontext
from importlib import import_module
from pathlib import Path
from typing import Annotated, Any, Literal

import typer

from glider_base.errors import EXIT_FAILED, EXIT_INTERRUPTED, EXIT_SURFACED
from glider_base.ros.places import NAMESPACE_ALLOWED, absolute_namespace, given_domain
from glider_base.settings import ConfigurationError
from glider_bringup.console import (
    Changes,
    Json,
    Law,
    Named,
    changed_fields,
    messages,
    progress,
    tell,
)
from glider_bringup.scoring.card import STATUSES, STOPPED
from glider_bringup.showing.scorecard import print_card, print_places
from glider_guidance.settings import METHODS, OLD_NAMES
from glider_mission.choices import ENGINES, chosen_fields, number
from glider_mission.disk import DiskError, write_whole
from glider_mission.scenario import DEFAULT_SCENARIO, Scenario, load_scenario

app = typer.Typer()
Engine = Literal[ENGINES]
When = Literal['never', 'end', 'chunk']


def guidance_method(name: str) -> str:
    """A guidance method as it is called now, by that name or the one it had before."""
    name = OLD_NAMES.get(name, name)
    if name not in METHODS:
        raise typer.BadParameter(f'{name!r}: no such method (allowed: {", ".join(METHODS)})')
    return name


# long: its options stand where it begins, each with its help.
@app.command(epilog='Example: ./glider run current_8deg --engine direct --duration full --json')
def run(
    scenario: Named = DEFAULT_SCENARIO,
    engine: Annotated[
        Engine,
        typer.Option(
            help='nodes: six ROS 2 nodes over topics; direct: one compiled loop. Same results.'
        ),
    ] = 'nodes',
    controller: Law = None,
    guidance: Annotated[
        str | None,
        typer.Option(
            parser=guidance_method,
            metavar='|'.join(METHODS),
            help="Line of sight, instead of the scenario's.",
        ),
    ] = None,
    duration: Annotated[
        str | None,
        typer.Option(
            metavar='S|full',
            help="Simulated seconds, or the scenario's full duration. Default: its dives.",
        ),
    ] = None,
    speed: Annotated[
        str, typer.Option(metavar='X|max', help='Times real time (nodes only).')
    ] = 'max',
    namespace: Annotated[
        str | None,
        typer.Option(
            help='Namespace of nodes and topics, /clock included, so that several gliders can '
            'share one ROS_DOMAIN_ID (nodes only). Default: /glider, and /clock itself.'
        ),
    ] = None,
    seed: Annotated[int | None, typer.Option(help="Seed, instead of the scenario's.")] = None,
    changes: Changes = None,
    out: Annotated[
        Path | None, typer.Option(help="Folder for the run's files. Default: runs/<time>-<name>.")
    ] = None,
    bag: Annotated[
        bool, typer.Option('--bag', help='Record a bag in a direct run too; nodes always do.')
    ] = False,
    sync: Annotated[
        When,
        typer.Option(
            help='When the recording is synced to disk, to outlive a loss of power: never, at its '
            'end, or with every chunk of 12.8 s, before the flight goes on.'
        ),
    ] = 'end',
    report: Annotated[
        bool,
        typer.Option('--report/--no-report', help='Write report.html, and what it is drawn from.'),
    ] = True,
    processes: Annotated[
        bool,
        typer.Option(
            '--processes',
            help='A process for each node, as launch files have them, instead of one for all but '
            'the recorder (nodes only).',
        ),
    ] = False,
    view: Annotated[
        bool, typer.Option('--view', help='Show the flight live in Foxglove (nodes only).')
    ] = False,
    view_port: Annotated[
        int | None, typer.Option(min=1, max=65535, help='Port of the live view. Default: 8765.')
    ] = None,
    as_json: Json = False,
) -> None:
    """Fly a scenario; record it, write its report and print the scorecard.

    Exit code 0: completed or infeasible. 3: surfaced, the guard ended the mission, or unfinished,
    its dives were not flown. 1: the vehicle is lost, or the run failed. 2: what was asked for
    cannot be done. 130: interrupted.
    """
    from glider_mission.run_folder import REPORT_FILE

    fields = chosen_fields(changed_fields(changes), controller, guidance, seed, duration)
    if sync != 'end' and engine == 'direct' and not bag:
        raise ConfigurationError(f'--sync {sync}: nothing is recorded (allowed: with --bag)')
    if view_port and not view:
        raise ConfigurationError(
            f'--view-port {view_port}: no view is open (allowed: with --view)'
        )
    rate, place = _checked(engine, speed, namespace, view, processes)
    flown = load_scenario(scenario, fields)
    layout = 'processes' if processes else 'together'
    nodes = {'speed': rate, 'namespace': place, 'layout': layout, 'on_log': tell}
    with _view(view_port or 8765, place) if view else nullcontext() as begin_view:
        card, folder, has_room = _fly(flown, engine, out, bag, sync, report, begin_view, nodes)
    page = folder / REPORT_FILE
    if as_json:
        print(json.dumps(card, allow_nan=False))
        print_places(messages, folder, page)
    else:
        print_card(card, folder, page)
    raise typer.Exit(_exit_code(card, has_room))


def _checked(
    engine: Engine, speed: str, namespace: str | None, view: bool, processes: bool
) -> tuple[float, str | None]:
    """Speed (0.0: max) and absolute namespace of a flight, if its engine knows what is asked.

    A ConfigurationError names the option, and what is allowed.
    """
    rate = 0.0 if speed == 'max' else number('--speed ', speed, 'max', 0.01, 1e6)
    if rate and engine == 'direct':
        raise ConfigurationError('--speed: the direct engine knows only max')
    place = absolute_namespace(namespace) if namespace else None
    if namespace and (place is None or engine == 'direct'):
        allowed = 'nothing, with the direct engine' if place else NAMESPACE_ALLOWED
        raise ConfigurationError(f'--namespace {namespace}: not usable (allowed: {allowed})')
    if processes and engine == 'direct':
        raise ConfigurationError('--processes: the direct engine has no nodes')
    if view and engine == 'direct':
        raise ConfigurationError('--view: the direct engine has no topics to show; use nodes')
    if engine == 'nodes':
        given_domain()
    return rate, place


def _exit_code(card: dict, has_room: bool) -> int:
    """Exit code of a flight; its score is there, whatever became of it."""
    if card['status'] in STOPPED:
        return EXIT_INTERRUPTED if card['reason'].startswith('stopped by') else EXIT_FAILED
    if card['status'] == 'lost' or not has_room:
        return EXIT_FAILED
    return EXIT_SURFACED if card['status'] in ('surfaced', 'unfinished') else 0


@contextmanager
def _view(port: int, namespace: str | None):
    """Live view, and the word how to open it; yields what lets it begin."""
    from glider_bringup.engines.live_view import live_view

    with live_view(port, namespace) as (address, begin):
        tell(
            'live view: in Foxglove choose Open connection, Foxglove WebSocket, '
            f'ws://localhost:{port}, or open {address}'
        )
        yield begin


def _fly(
    scenario: Scenario,
    engine: Engine,
    out: Path | None,
    bag: bool,
    sync: str,
    report: bool,
    begin_view: Callable[[], None] | None,
    nodes: dict[str, Any],
) -> tuple[dict, Path, bool]:
    """Fly and score a scenario with a progress bar; ``nodes`` are options of that engine.

    Returns the scorecard, the run folder, and whether the disk had room for score and report.
    """
    from glider_bringup.door.run import fly_by
    from glider_bringup.scoring.card import write_score
    from glider_bringup.scoring.traces import make_tracer
    from glider_mission.planned import planned_ticks, unballasted
    from glider_mission.run_folder import run_folder

    if bag or engine == 'nodes':  # else nothing of ROS is needed; with it, it is there
        import_module('glider_bringup.engines.recorded')
    tracer = make_tracer(scenario) if report else None
    with run_folder(scenario, out) as folder:
        messages.print(f'{scenario.name}: {scenario.described}')
        for note in scenario.unsteered + unballasted(scenario):
            tell(note)
        with progress(planned_ticks(scenario)) as (flying, reading):
            if begin_view:
                flying = _after_first(begin_view, flying)
            shown, sinks = (flying, reading), [tracer] if tracer else []
            scenario, card = fly_by(engine, scenario, folder, sinks, shown, bag, sync, **nodes)
    has_room = True
    try:
        write_score(folder, card)
    except ConfigurationError as error:  # what was flown is shown all the same
        messages.print(f'no score: {error}', style='red', soft_wrap=True)
        has_room = False
    if tracer and has_room:
        has_room = _write_report(scenario, folder, card, tracer)
    if card['reason']:
        text = f'{card["status"]}: {card["reason"]}'
        messages.print(text, style=STATUSES[card['status']], soft_wrap=True)
    return card, folder, has_room


def _write_report(scenario: Scenario, folder: Path, card: dict, tracer) -> bool:
    """Write the report of a run that has its score already: whatever happens, that is kept.

    Returns whether the disk had room for it.
    """
    from glider_bringup.showing.flown_run import keep_traces
    from glider_bringup.showing.report import report_page
    from glider_mission.run_folder import REPORT_FILE

    file = folder / REPORT_FILE
    try:
        with messages.status('writing the report'):
            write_whole(file, report_page(keep_traces(scenario, folder, card, tracer)))
    except (Exception, KeyboardInterrupt) as error:
        cause = str(error) or type(error).__name__
        messages.print(f'no report: {cause}', style='red', soft_wrap=True)
        return not isinstance(error, DiskError)
    return True


def _after_first(begin: Callable[[], None], update: Callable) -> Callable:
    """Progress that lets something begin when it is called for the first time."""
    waiting = [begin]

    def call(*flown) -> None:
        if waiting:
            waiting.pop()()
        update(*flown)

    return call
