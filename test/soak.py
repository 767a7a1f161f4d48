# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""``./glider test --only soak``: a long flight over nodes, and what it costs and loses."""

import json
import subprocess
import sys
import time
from pathlib import Path
from typing import Annotated, Any

import typer
from rich.table import Table

from glider_base.errors import EXIT_FAILED, EXIT_INTERRUPTED
from glider_base.signals import TICK_S
from glider_bringup.console import Json, messages, output, progress, tell
from glider_mission.scenario import Scenario, load_scenario

app = typer.Typer(pretty_exceptions_enable=False)
#: Memory is looked at so often (s of wall time).
_SAMPLE_S = 2.0
#: A process whose memory grows by more is not flat (MB per simulated hour); in a flight of less
#: than an hour nobody can tell.
FLAT_MB_PER_H = 1.0

#: Samples (h, MB) by node.
Samples = dict[str, list[tuple[float, float]]]


@app.command(epilog='Example: ./glider test --only soak current_12deg --duration 7200')
def soak(
    scenario: Annotated[
        str, typer.Argument(help='Scenario by name (./glider list) or path of its YAML file.')
    ] = 'current_12deg',
    duration: Annotated[
        str, typer.Option(metavar='S|full', help="Simulated seconds, or the scenario's duration.")
    ] = '108000',
    out: Annotated[
        Path | None, typer.Option(help="Folder for the run's files. Default: runs/<time>-<name>.")
    ] = None,
    as_json: Json = False,
) -> None:
    """Fly for 30 h over nodes, everything recorded; watch memory, count ticks, verify.

    Exit code 1 if a tick or a message is lost, a process grows by more than 1 MB in an hour of a
    flight of an hour or more, or today's code does not make what is recorded.
    """
    from glider_bringup.engines.memory import growth_mb_per_h
    from glider_mission.choices import chosen_fields
    from glider_mission.run_folder import make_run_folder

    flown = load_scenario(scenario, chosen_fields({}, duration=duration))
    folder = make_run_folder(flown, out)
    messages.print(f'{flown.name}: over nodes, into {folder}', soft_wrap=True)
    flight, lost, ticks, samples = _fly(flown, folder)
    growth = {name: growth_mb_per_h(taken) for name, taken in samples.items()}
    result = {
        'run': str(folder),
        'status': flight.status,
        'reason': flight.reason,
        'ticks': ticks,
        'ticks_lost': lost,
        'messages_recorded': flight.messages_recorded,
        'messages_lost': flight.messages_lost,
        'ticks_per_s': ticks / flight.wall_time_s,
        'rss_mb': {name: taken[-1][1] for name, taken in samples.items()},
        'growth_mb_per_h': growth,
        'largest_growth_mb_per_h': max(growth.values(), default=0.0),
        'verify': _verify(folder) if ticks else 'skipped',
    }
    if as_json:
        print(json.dumps(result))
    else:
        _print(result)
    if flight.reason.startswith('stopped by'):
        raise typer.Exit(EXIT_INTERRUPTED)
    raise typer.Exit(0 if _is_good(result) else EXIT_FAILED)


def _fly(scenario: Scenario, folder: Path) -> tuple[Any, int, int, Samples]:
    """The flight, ticks that its bag lacks and has, and memory."""
    from glider_bringup.engines.memory import memory_mb
    from glider_bringup.engines.recorded import fly_nodes
    from glider_mission.planned import planned_ticks

    samples: Samples = {}
    read, newest, looked_s = 0, -1, 0.0
    with progress(planned_ticks(scenario)) as (flying, reading):

        def look(tick: int, depth_m: float) -> None:
            nonlocal newest, looked_s
            newest = tick
            flying(tick, depth_m)
            if time.monotonic() - looked_s > _SAMPLE_S:
                looked_s = time.monotonic()
                for name, megabytes in memory_mb('VmRSS').items():
                    samples.setdefault(name, []).append((tick * TICK_S / 3600.0, megabytes))

        def count(ticks: int) -> None:
            nonlocal read
            read = ticks
            reading(ticks)

        flight = fly_nodes(scenario, folder, progress=look, on_log=tell, on_read=count)
    return flight, newest + 1 - read, read, samples


def _verify(folder: Path) -> str:
    """What a process of its own says of the bag: its memory is not that of the flight."""
    messages.print('verifying')
    done = subprocess.run(
        [sys.executable, '-m', 'glider_bringup.cli', 'verify', str(folder), '--json'],
        capture_output=True,
        text=True,
    )
    words = {0: 'identical', EXIT_FAILED: 'different'}
    return words.get(done.returncode, done.stderr.strip())


def _is_good(result: dict[str, Any]) -> bool:
    return (
        result['status'] == 'completed'
        and result['ticks_lost'] == result['messages_lost'] == 0
        and (
            result['ticks'] * TICK_S < 3600.0 or result['largest_growth_mb_per_h'] <= FLAT_MB_PER_H
        )
        and result['verify'] == 'identical'
    )


def _print(result: dict[str, Any]) -> None:
    """Print what came out for a person."""
    table = Table(show_header=False)
    rows = {
        'status': ': '.join(filter(None, (result['status'], result['reason']))),
        'ticks': f'{result["ticks"]:,}, {result["ticks_lost"]:,} lost',
        'messages': f'{result["messages_recorded"]:,}, {result["messages_lost"]:,} lost',
        'speed': f'{result["ticks_per_s"]:,.0f} ticks/s',
        **{
            name: f'{megabytes:.1f} MB, {result["growth_mb_per_h"][name]:+.3f} MB per hour'
            for name, megabytes in result['rss_mb'].items()
        },
        'verify': result['verify'],
    }
    for row in rows.items():
        table.add_row(*row)
    output.print(table)


if __name__ == '__main__':
    app(prog_name='./glider test --only soak')
