# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""Verdicts as one JSON object, with hints for whoever looks for a cause."""

from glider_base.wiring import WIRING
from glider_mission.recording.mcap_reader import Bag
from glider_mission.recording.ros.recorded_run import Recording
from glider_mission.recording.ros.told import Told
from glider_mission.recording.ros.verify.every_block import is_lockstep
from glider_mission.recording.ros.verify.verdict import IDENTICAL, SKIPPED, Verdict, time_text


def report(bag: Bag, recording: Recording, told: Told, verdicts: list[Verdict]) -> dict:
    """Verdicts as one JSON object, with hints for whoever looks for a cause."""
    lockstep = is_lockstep(recording, told)
    compared = [verdict for verdict in verdicts if verdict.result != SKIPPED]
    notes = [bag.cut] if bag.cut else []
    if not compared:
        notes.append('nothing could be compared')
    if not lockstep:
        notes.append(
            'recorded free-running: a message that was lost, or a node that was started before '
            'the recording, looks like a difference'
        )
    return {
        'identical': bool(compared) and all(one.result == IDENTICAL for one in compared),
        'settings': told.source,
        'lockstep': lockstep,
        'namespace': recording.namespace,
        'blocks': [_block_report(one, verdicts) for one in verdicts],
        'notes': notes,
        'ignored_topics': recording.ignored,
    }


def _block_report(one: Verdict, verdicts: list[Verdict]) -> dict:
    first = one.first
    return {
        **one._asdict(),
        'first': first and {'tick': first.tick, 't_s': first.stamp_ns / 1e9, **first._asdict()},
        'notes': [*one.notes, *(_hints(one, verdicts) if first else ())],
    }


def _hints(one: Verdict, verdicts: list[Verdict]) -> list[str]:
    """What else may have led to the first difference of a block."""
    hints = []
    (wired,) = [wired for wired in WIRING if wired.name == one.block]
    for other in verdicts:
        source = other.first
        if source and source.topic in wired.inputs and source.stamp_ns <= one.first.stamp_ns:
            hints.append(
                f'its input {source.topic} differs at {time_text(source.stamp_ns)} from what '
                f'{other.block} computes: if the recording is damaged there, this is why'
            )
    return hints
