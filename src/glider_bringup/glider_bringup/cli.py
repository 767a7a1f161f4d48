# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""The command line: ``./glider COMMAND``, or ``glider COMMAND`` in a sourced workspace."""

import json
import os
import sys
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from dataclasses import asdict
from enum import Enum
from pathlib import Path
from typing import Annotated, Literal, get_args

import typer
from rich.console import Console
from rich.progress import (
    BarColumn,
    MofNCompleteColumn,
    Progress,
    TextColumn,
    TimeElapsedColumn,
    TimeRemainingColumn,
)
from rich.table import Table

from glider_bringup.scenario import (
    DEFAULT_SCENARIO,
    Scenario,
    load_scenario,
    parse_assignment,
    scenario_names,
)
from glider_control.control import ControlLawSettings
from glider_guidance.guidance import LosSettings
from glider_model.settings import ConfigurationError
from glider_model.signals import TICK_S
from glider_model.trim import Trim, solve_trim
from glider_model.vehicle import load_vehicle, vehicle_names

EXIT_FAILED, EXIT_USAGE, EXIT_INTERRUPTED = 1, 2, 130

app = typer.Typer(
    name='glider',
    help='Underwater gliders: simulate, guide, control, record.',
    epilog='Example: ./glider run current_8deg --controller pid',
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
    context_settings={'help_option_names': ['-h', '--help']},
)
# Standard output carries results only; progress and messages go to standard error.
# Names, descriptions and folders come from people: brackets in them are no markup.
output = Console(highlight=False, markup=False)
messages = Console(stderr=True, highlight=False, markup=False)


def _choices(name: str, model, field: str) -> type[Enum]:
    """Choices of an option, from the settings field that it sets."""
    return Enum(name, {text: text for text in get_args(model.model_fields[field].annotation)})


Engine = Enum('Engine', {text: text for text in get_args(Literal['nodes', 'direct'])})
Controller = _choices('Controller', ControlLawSettings, 'law')
Guidance = _choices('Guidance', LosSettings, 'method')
Group = Enum(
    'Group',
    {
        text: text
        for text in get_args(
            Literal['current', 'yaw', 'profile', 'robustness', 'paths', 'envelope']
        )
    },
)
Json = Annotated[
    bool, typer.Option('--json', help='Print one JSON object and nothing else on standard output.')
]


@app.command(epilog='Example: ./glider run current_8deg --engine direct --duration full --json')
def run(
    scenario: Annotated[
        str, typer.Argument(help='Scenario by name (./glider list) or path of its YAML file.')
    ] = DEFAULT_SCENARIO,
    engine: Annotated[
        Engine,
        typer.Option(
            help='nodes: ROS 2 processes over topics; direct: one compiled loop. Same results.'
        ),
    ] = Engine.nodes,
    controller: Annotated[
        Controller | None, typer.Option(help="Attitude law, instead of the scenario's.")
    ] = None,
    guidance: Annotated[
        Guidance | None, typer.Option(help="Line of sight, instead of the scenario's.")
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
    seed: Annotated[int | None, typer.Option(help="Seed, instead of the scenario's.")] = None,
    changes: Annotated[
        list[str] | None,
        typer.Option(
            '--set', metavar='FIELD=VALUE', help='Change a scenario field; can be repeated.'
        ),
    ] = None,
    out: Annotated[
        Path | None, typer.Option(help="Folder for the run's files. Default: runs/<time>-<name>.")
    ] = None,
    bag: Annotated[
        bool, typer.Option('--bag', help='Record a bag in a direct run too; nodes always do.')
    ] = False,
    as_json: Json = False,
) -> None:
    """Fly a scenario; record it and print the scorecard."""
    fields = dict(parse_assignment(text) for text in changes or [])
    if controller:
        fields['control.law'] = controller.value
    if guidance:
        fields['guidance.los.method'] = guidance.value
    if seed is not None:
        fields['seed'] = seed
    if duration is not None:
        fields['dives'] = 0
        if duration != 'full':
            fields['duration_s'] = _number('--duration', duration, 'full', TICK_S, 1e8)
    rate = 0.0 if speed == 'max' else _number('--speed', speed, 'max', 0.01, 1e6)
    if rate and engine is Engine.direct:
        raise ConfigurationError('--speed: the direct engine knows only max')
    flown = load_scenario(scenario, fields)
    card, folder = _fly(flown, engine, rate, out, bag)
    if as_json:
        print(json.dumps(card))
    else:
        _print_card(card, folder)
    if card['status'] == 'aborted':
        raise typer.Exit(
            EXIT_INTERRUPTED if card['reason'].startswith('stopped by') else EXIT_FAILED
        )


def _fly(scenario: Scenario, engine: Engine, rate: float, out: Path | None, bag: bool):
    """Fly and score a scenario with a progress bar; the scorecard and the run folder."""
    from glider_bringup import mission

    folder = mission.make_run_folder(scenario, out)
    messages.print(f'{scenario.name}: {scenario.description}')
    with _progress(scenario, mission.planned_ticks(scenario)) as update:
        if engine is Engine.nodes:
            flight, scores = mission.fly_nodes(scenario, folder, rate, update, _print_log)
        else:
            flight, scores = mission.fly_direct(scenario, folder, bag, update)
    card = mission.scorecard(scenario, engine.value, flight, scores)
    mission.write_score(folder, card)
    if flight.reason:
        messages.print(f'{flight.status}: {flight.reason}', style='red')
    return card, folder


def _print_log(line: str) -> None:
    """Show a line that a node printed."""
    messages.print(line, soft_wrap=True)


def _number(option: str, text: str, word: str, low: float, high: float) -> float:
    """Number of an option that also takes a word."""
    try:
        number = float(text)
    except ValueError:
        number = float('nan')
    if not low <= number <= high:
        raise ConfigurationError(
            f'{option} {text}: not usable (allowed: {low:g} to {high:g}, or {word})'
        )
    return number


@contextmanager
def _progress(scenario: Scenario, ticks: int):
    """Progress bar with simulated time, real-time factor and depth; yields its update."""
    bar = Progress(
        TextColumn('{task.description}'),
        BarColumn(),
        TextColumn('{task.percentage:3.0f} %'),
        TextColumn('{task.fields[state]}'),
        TimeElapsedColumn(),
        TimeRemainingColumn(),
        console=messages,
        transient=True,
    )
    task = bar.add_task('starting', total=ticks, state='')

    def update(flown: int, depth_m: float) -> None:
        elapsed = bar.tasks[0].elapsed or 0.0
        factor = flown * TICK_S / elapsed if elapsed > 0.0 else 0.0
        bar.update(
            task,
            completed=min(flown, ticks),
            description='flying',
            state=f'{flown * TICK_S:,.0f} s  x{factor:,.0f}  depth {depth_m:6.1f} m',
        )

    with bar:
        yield update


def _print_card(card: dict, folder: Path) -> None:
    """Print the scorecard for a person."""

    def show(value, unit: str, digits: int = 2) -> str:
        return '-' if value is None else f'{value:,.{digits}f} {unit}'

    track, pitch = card['cross_track_m'], card['pitch_error_deg']
    heading, depth = card['heading_fluctuation_deg'], card['depth_m']
    travel = card['actuator_travel']
    rows = (
        ('status', card['status'] + (f' ({card["reason"]})' if card['reason'] else '')),
        ('flown', f'{card["vehicle"]}, {card["controller"]}, LOS {card["guidance"]}'),
        ('engine', f'{card["engine"]}, seed {card["seed"]}'),
        ('simulated time', show(card['sim_time_s'], 's', 1)),
        ('real-time factor', show(card['real_time_factor'], '', 0)),
        (
            'messages',
            f'{card["messages_recorded"]:,} recorded, {card["messages_lost"]} lost',
        ),
        ('dives', str(card['dives'])),
        ('along path', show(card['distance_along_path_m'], 'm', 0)),
        ('cross-track, steady', f'rms {show(track["rms_steady"], "m", 3)}, max '
         f'{show(track["max_steady"], "m", 3)}'),
        ('cross-track, all', f'max {show(track["max_all"], "m")}'),
        ('pitch error, steady', f'rms {show(pitch["rms_steady"], "deg", 3)}, max '
         f'{show(pitch["max_steady"], "deg", 3)}'),
        ('heading fluctuation', f'rms {show(heading["rms_steady"], "deg", 3)}, max '
         f'{show(heading["max_steady"], "deg", 3)}'),
        ('depth', f'max {show(depth["max"], "m", 1)}, overshoot '
         f'{show(depth["overshoot"], "m", 1)}'),
        ('actuator travel', f'pump {show(travel["buoyancy_engine_kg"], "kg", 1)}, pitch mass '
         f'{show(travel["pitch_mass_m"], "m")}, roll mass '
         f'{show(travel["roll_mass_deg"], "deg", 0)}'),
    )  # fmt: skip
    table = Table(title=card['scenario'], show_header=False, title_justify='left')
    for name, text in rows:
        table.add_row(name, text)
    output.print(table)
    output.print(f'run folder: {folder}', soft_wrap=True)


@app.command(epilog='Example: ./glider montecarlo current_12deg --plants 200 --seed 1000')
def montecarlo(
    scenario: Annotated[
        str, typer.Argument(help='Scenario by name (./glider list) or path of its YAML file.')
    ] = DEFAULT_SCENARIO,
    plants: Annotated[int, typer.Option(min=1, max=1_000_000, help='Number of plants.')] = 100,
    seed: Annotated[
        int, typer.Option(min=0, max=2**62, help='Plant i is drawn from seed + i.')
    ] = 0,
    controller: Annotated[
        list[Controller] | None,
        typer.Option(help='Attitude law; can be repeated. Default: all of them.'),
    ] = None,
    duration: Annotated[
        str,
        typer.Option(metavar='S|full', help="Simulated seconds, or the scenario's full duration."),
    ] = 'full',
    workers: Annotated[
        int | None, typer.Option(min=1, max=1024, help='Processes. Default: one per processor.')
    ] = None,
    changes: Annotated[
        list[str] | None,
        typer.Option(
            '--set', metavar='FIELD=VALUE', help='Change a scenario field; can be repeated.'
        ),
    ] = None,
    out: Annotated[
        Path | None, typer.Option(help='Folder for montecarlo.json, which tells of every plant.')
    ] = None,
    as_json: Json = False,
) -> None:
    """Fly many plants that differ from their vehicle file, with noise, by the direct engine.

    Each hydrodynamic coefficient differs by up to 30 %, added mass by 15 %, trim by 10 mm, roll at
    rest by 10 deg, ballast by 50 g; water is stratified. Control knows the file only.
    """
    from glider_bringup import mission
    from glider_bringup import montecarlo as study

    fields = dict(parse_assignment(text) for text in changes or [])
    if duration != 'full':
        fields['duration_s'] = _number('--duration', duration, 'full', TICK_S, 1e8)
    laws = list(dict.fromkeys(one.value for one in controller or Controller))
    scenarios = study.make_scenarios(scenario, fields, laws, plants, seed)
    if out:
        mission.make_result_folder(out, study.RESULT_FILE)
    messages.print(f'{scenario}: {plants} plants, each by {" and by ".join(laws)}')
    with _workers_at_work(), _counter('flying', len(scenarios)) as update:
        flights, airframes = study.fly_plants(scenarios, workers or os.cpu_count() or 1, update)
    name = next(iter(scenarios.values())).name
    summary = study.summarise(name, seed, flights, airframes)
    whole = study.report(scenario, fields, summary, flights, airframes)
    if out:
        text = json.dumps(whole, indent=2) + '\n'
        (out / study.RESULT_FILE).write_text(text, encoding='utf-8')
    if as_json:
        print(json.dumps(summary))
    else:
        _print_study(whole)


@contextmanager
def _workers_at_work():
    """Say what ended the work of worker processes early, and leave with its exit code."""
    try:
        yield
    except KeyboardInterrupt:
        messages.print('stopped by SIGINT', style='red')
        raise typer.Exit(EXIT_INTERRUPTED) from None
    except BrokenProcessPool:
        messages.print('a worker process was killed; give fewer --workers', style='red')
        raise typer.Exit(EXIT_FAILED) from None


@contextmanager
def _counter(description: str, total: int):
    """Progress bar that counts, with the time left; yields its update."""
    bar = Progress(
        TextColumn('{task.description}'),
        BarColumn(),
        MofNCompleteColumn(),
        TimeElapsedColumn(),
        TimeRemainingColumn(),
        console=messages,
        transient=True,
    )
    task = bar.add_task(description, total=total)
    with bar:
        yield lambda done: bar.update(task, completed=done)


def _print_study(study: dict) -> None:
    """Print the result of a Monte Carlo study for a person."""

    def show(figure: dict) -> str:
        return ' / '.join('-' if x is None else f'{x:,.3f}' for x in figure.values())

    rows = study['rows']
    table = Table(
        title=f'{study["scenario"]}, {study["plants"]} plants from seed {study["seed"]}',
        title_justify='left',
    )
    table.add_column('p50 / p95 / worst')
    for row in rows:
        table.add_column(row['controller'])
    lines = (
        ('diverged', lambda row: str(row['diverged'])),
        ('max steady (m)', lambda row: show(row['max_steady_m'])),
        ('max all (m)', lambda row: show(row['max_all_m'])),
        ('heading rms (deg)', lambda row: show(row['heading_fluctuation_deg'])),
        ('pitch rms (deg)', lambda row: show(row['pitch_error_deg'])),
        ('plants statically unstable', lambda row: str(row['statically_unstable'])),
        ('plants that steer weakly', lambda row: str(row['weak_steering'])),
        ('worst', lambda row: f'plant {row["worst_plant"]}'),
    )
    for name, text in lines:
        table.add_row(name, *map(text, rows))
    output.print(table)
    for row in study['rows']:
        worst = study['flown'][row['worst_plant']]['commands'][row['controller']]
        output.print(f'worst of {row["controller"]}:', worst, soft_wrap=True)


@app.command(epilog='Example: ./glider experiments --only robustness --only paths')
def experiments(
    only: Annotated[
        list[Group] | None, typer.Option(help='Group; can be repeated. Default: all of them.')
    ] = None,
    workers: Annotated[
        int | None, typer.Option(min=1, max=1024, help='Processes. Default: one per processor.')
    ] = None,
    out: Annotated[
        Path | None, typer.Option(help='Folder for experiments.json and the figures.')
    ] = None,
    as_json: Json = False,
) -> None:
    """Fly the experiments of the paper and what goes beyond them; exit code 1 if one fails.

    By the adaptive law, by the tuned PID, and along the paper's line of sight, with the direct
    engine: 135 flights, most of them of 30 hours.
    """
    from glider_bringup import experiment_tables, mission, paper_figures
    from glider_bringup import experiments as study

    planned = study.make_experiments([one.value for one in only or Group])
    flights = study.count_flights(planned)
    if out:
        mission.make_result_folder(out, study.RESULT_FILE)
    messages.print(f'{len(planned)} experiments, {flights} flights')
    with _workers_at_work(), _counter('flying', flights) as update:
        rows, records = study.fly(planned, workers or os.cpu_count() or 1, update)
    result = study.report(planned, rows)
    if out:
        with messages.status('drawing'):
            drawn = paper_figures.draw(planned, rows, records, out)
        text = json.dumps(result, indent=2) + '\n'
        (out / study.RESULT_FILE).write_text(text, encoding='utf-8')
        for file in drawn:
            messages.print(f'drawn: {file}', soft_wrap=True)
    if as_json:
        print(json.dumps(result))
    else:
        experiment_tables.show(result, output)
    if any(one['verdict'] == study.FAILED for one in result['experiments']):
        raise typer.Exit(EXIT_FAILED)


@app.command(epilog='Example: ./glider trim zhang2021 --net-heaviness-kg 0.4 --pitch-deg -30')
def trim(
    vehicle: Annotated[str, typer.Argument(help='Vehicle by name or path of its YAML file.')],
    net_heaviness_kg: Annotated[
        float, typer.Option('--net-heaviness-kg', help='Net heaviness, + sinks (kg).')
    ],
    pitch_deg: Annotated[
        float | None, typer.Option('--pitch-deg', help='Pitch, + nose up (deg).')
    ] = None,
    pitch_mass_m: Annotated[
        float | None,
        typer.Option('--pitch-mass-m', help='Pitch mass from its neutral position (m).'),
    ] = None,
    roll_mass_deg: Annotated[
        float, typer.Option('--roll-mass-deg', help='Roll mass, + to starboard (deg).')
    ] = 0.0,
    as_json: Json = False,
) -> None:
    """Solve the steady glide or spiral of a vehicle."""
    solution = solve_trim(
        load_vehicle(vehicle).params(), net_heaviness_kg, pitch_deg, pitch_mass_m, roll_mass_deg
    )
    values = asdict(solution)
    if as_json:
        print(json.dumps(values))
    else:
        _print_trim(vehicle, solution)
    if not solution.converged:
        messages.print("no steady state found within the vehicle's ranges", style='red')
        raise typer.Exit(EXIT_FAILED)


def _print_trim(vehicle: str, solution: Trim) -> None:
    table = Table(title=vehicle, show_header=False, title_justify='left')
    for name, value in asdict(solution).items():
        if value is None:
            value = 'straight'
        table.add_row(name, f'{value:.5g}' if isinstance(value, float) else str(value))
    output.print(table)


@app.command(epilog='Example: ./glider score runs/20260101-120000-current_8deg --json')
def score(
    folder: Annotated[Path, typer.Argument(metavar='RUN', help='Folder of a run.')],
    as_json: Json = False,
) -> None:
    """Score a run again, from its bag; a run without a bag shows the score it was given."""
    from glider_bringup import mission

    with messages.status('reading the bag'):
        card = mission.score_again(folder)
    if as_json:
        print(json.dumps(card))
    else:
        _print_card(card, folder)


@app.command(epilog='Example: ./glider figure runs/20260101-120000-current_8deg --out run.png')
def figure(
    folder: Annotated[Path, typer.Argument(metavar='RUN', help='Folder of a run with a bag.')],
    out: Annotated[
        Path | None, typer.Option(help='Image file: png, svg or pdf. Default: RUN/run.png.')
    ] = None,
) -> None:
    """Draw a run: track, depth, errors, attitude, current and actuators."""
    from glider_bringup import mission

    file = out or folder / 'run.png'
    with messages.status('reading the bag'):
        mission.draw(folder, file)
    output.print(f'drawn: {file}', soft_wrap=True)


@app.command('list', epilog='Example: ./glider list --json')
def list_all(as_json: Json = False) -> None:
    """List the scenarios and vehicles that come with the stack."""
    scenarios = {name: load_scenario(name).description for name in scenario_names()}
    vehicles = {name: load_vehicle(name).description for name in vehicle_names()}
    if as_json:
        print(json.dumps({'scenarios': scenarios, 'vehicles': vehicles}))
        return
    for title, entries in (('Scenarios', scenarios), ('Vehicles', vehicles)):
        table = Table(title=title, show_header=False, title_justify='left')
        for name, description in entries.items():
            table.add_row(name, description)
        output.print(table)


@app.command(epilog='Example: ./glider test')
def test() -> None:
    """Run all tests: each package's, then those of the whole system."""
    raise ConfigurationError('test: run it through the ./glider script of the workspace')


def main() -> int:
    """Run the command line; mistakes of the user become one message and exit code 2."""
    try:
        app(prog_name='./glider')
    except ConfigurationError as error:
        for line in str(error).splitlines():
            messages.print(line, style='red', soft_wrap=True)
        return EXIT_USAGE
    return 0


if __name__ == '__main__':
    sys.exit(main())
