# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""``./glider recover``: a recording whose end is missing, made whole."""

import json
from contextlib import suppress
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import typer

from glider_base.settings import ConfigurationError
from glider_base.signals import TICK_S
from glider_bringup.console import Json, Run, counter, messages, output

app = typer.Typer()


@app.command(epilog='Example: ./glider recover runs/20260101-120000-current_8deg')
def recover(run: Run, as_json: Json = False) -> None:
    """Make a recording whole whose end is missing, and say what is.

    A recorder that was killed, or a machine without power, leaves a file without an index and no
    metadata.yaml. Both are made from what is there; a recording that is whole is left as it is.
    Exit code 0 in both cases, 2 where there is nothing to recover.
    """
    from glider_mission.recording import recover as work

    with counter('reading', None) as update:
        done = work.recover(run, update)
    state = 'recovered' if done['rebuilt'] else 'whole'
    found = {'run': str(run), 'state': state, **done, **_ticks(run)}
    if as_json:
        print(json.dumps(found))
    else:
        _print(found)


def _ticks(run: Path) -> dict[str, Any]:
    """What there is tick by tick, and what lacks; None where nobody can know."""
    from glider_bringup.scoring.card import read_score
    from glider_mission.planned import planned_ticks
    from glider_mission.recording.mcap_reader import Bag
    from glider_mission.recording.ros.node_settings import read_settings
    from glider_mission.recording.ros.recorded_log import read_back
    from glider_mission.recording.ros.rosbag2 import CHUNK_TICKS
    from glider_mission.run_folder import scenario_of

    found = dict.fromkeys(('ticks', 'ticks_flown', 'ticks_planned', 'acknowledged_tick'))
    found['lacking'] = {}
    bag = Bag(run)
    try:
        with TemporaryDirectory() as scratch:
            if read_settings(bag, run, None, Path(scratch)).lockstep is False:
                raise ConfigurationError(f'{run}: its nodes were free-running')
        with scenario_of(run, bag.attachments) as flown:
            log = read_back(bag, flown.scenario.vehicle, [])
            if not log.ticks and log.counts:
                raise ConfigurationError(f'{run}: {log.lacks}, as in a free-running recording')
            found['ticks_planned'] = planned_ticks(flown.scenario)
    except ConfigurationError as error:  # of others, or what was flown is not known
        messages.print(f'ticks are not counted: {error}', soft_wrap=True)
        return found
    found['ticks'], in_chunks = log.ticks, log.ticks - log.ticks % CHUNK_TICKS
    found['acknowledged_tick'] = in_chunks - 1 if in_chunks else None
    found['lacking'] = log.lacking()
    with suppress(ConfigurationError):
        found['ticks_flown'] = read_score(run).get('ticks')
    return found


def _print(found: dict[str, Any]) -> None:
    if found['rebuilt']:
        output.print(f'recovered: {", ".join(found["rebuilt"])}', soft_wrap=True)
    else:
        output.print('whole: left as it is')
    span = f't = {found["start_s"]:,.1f} s to {found["end_s"]:,.1f} s'
    there = f'{found["messages"]:,} messages, {span}'
    if found['ticks'] is not None:
        there = f'{found["ticks"]:,} ticks, {there}'
    output.print(f'there: {there}')
    if found['acknowledged_tick'] is not None:
        tick = found['acknowledged_tick']
        output.print(f'last acknowledged tick: {tick:,} (t = {tick * TICK_S:,.1f} s)')
    for text in _missing(found):
        output.print(f'missing: {text}', soft_wrap=True)


def _missing(found: dict[str, Any]) -> list[str]:
    missing = [*found['dropped']]
    if missing:
        missing[-1] += f'; {found["dropped_bytes"]:,} bytes in all'
    missing += [f'{count:,} messages of {name}' for name, count in found['lacking'].items()]
    for name, what in (('ticks_flown', 'that were flown'), ('ticks_planned', 'of the scenario')):
        ticks = found[name]
        if ticks is not None and ticks > found['ticks']:
            missing.append(f'{ticks - found["ticks"]:,} of {ticks:,} ticks {what}')
            break
    return missing
