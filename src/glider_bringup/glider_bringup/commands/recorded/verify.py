# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""``./glider verify``: whether today's code does what is recorded."""

import json
import tempfile
from functools import partial
from pathlib import Path
from typing import Annotated, Literal

import typer

from glider_base.errors import EXIT_FAILED
from glider_base.wiring import WIRING
from glider_bringup.console import (
    Json,
    Run,
    compiling,
    interrupt_shown,
    output,
    picked,
    print_table,
    repeatable,
    shares,
)

app = typer.Typer()
BlockName = Literal[tuple(block.name for block in WIRING)]


@app.command(epilog='Example: ./glider verify runs/20260101-120000-current_8deg')
def verify(
    run: Run,
    settings: Annotated[
        Path | None,
        typer.Option(help="Scenario or parameter file, instead of the recording's own."),
    ] = None,
    only: Annotated[
        list[repeatable(BlockName)] | None,
        typer.Option(help='Block; can be repeated. Default: all of them.'),
    ] = None,
    namespace: Annotated[
        str | None, typer.Option(help='Of the nodes; needed if several are recorded.')
    ] = None,
    as_json: Json = False,
) -> None:
    """Feed recorded inputs to today's code; compare its outputs byte by byte.

    Exit code 1, and the first tick, topic and field that differ, unless all of them are identical.
    """
    from glider_base.kernel import on_compiling
    from glider_bringup.engines.interrupts import interrupts_noted
    from glider_mission.recording.mcap_reader import Bag
    from glider_mission.recording.ros.node_settings import read_settings
    from glider_mission.recording.ros.recorded_run import Recording
    from glider_mission.recording.ros.verify.every_block import report as report_of
    from glider_mission.recording.ros.verify.every_block import verify as verify_blocks

    wanted = picked(only, BlockName)
    compiling_shown = partial(
        compiling, 'compiling the mathematics of a block for these settings, once'
    )
    with interrupt_shown(), tempfile.TemporaryDirectory() as scratch, shares() as update:
        bag = Bag(run)
        given = read_settings(bag, run, settings, Path(scratch))
        recording = Recording(
            bag, namespace, lambda share: update('reading', share), given.steers_by
        )
        with interrupts_noted() as noted, on_compiling(compiling_shown):

            def go_on(*done) -> None:
                update(*done)
                if noted:
                    raise KeyboardInterrupt(noted[0])

            verdicts = list(verify_blocks(recording, given, wanted, go_on))
    report = report_of(bag, recording, given, verdicts)
    if as_json:
        print(json.dumps({'run': str(run), **report}))
    else:
        _print(report)
    if not report['identical']:
        raise typer.Exit(EXIT_FAILED)


def _print(report: dict) -> None:
    rows = []
    for one in report['blocks']:
        compared, differing = (sum(one[key].values()) for key in ('compared', 'differing'))
        numbers = [f'{n:,}' for n in (one['ticks'], compared, differing)]
        rows.append([one['block'], one['result'], *numbers])
    headings = ('block', 'result', 'ticks', 'messages', 'differ')
    print_table(f'settings: {report["settings"]}', headings, rows, numbers_from=2)
    for one in report['blocks']:
        for line in _lines(one, report['lockstep']):
            output.print(f'{one["block"]}: {line}', soft_wrap=True)
    for note in report['notes']:
        output.print(note, soft_wrap=True)


def _lines(one: dict, lockstep: bool) -> list[str]:
    """What is to be said about a block."""
    lines = [f'skipped: {one["reason"]}'] if one['reason'] else []
    first = one['first']
    if first:
        at = f'tick {first["tick"]:,} (t = {first["t_s"]:.1f} s)'
        if not lockstep:
            at = f't = {first["t_s"]:.3f} s'
        what = f'{first["field"]}: computed {first["computed"]}, recorded {first["recorded"]}'
        if first['field'] == '(message)':
            what = f'{first["computed"]}: {first["recorded"]}'
        lines.append(f'first difference at {at}, {first["topic"]}, {what}')
        counts = ', '.join(f'{name} {count:,}' for name, count in one['differing'].items())
        lines.append(f'messages that differ: {counts}')
    return lines + one['notes']
