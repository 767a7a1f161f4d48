# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""Recorded inputs through today's code, and its outputs against the recorded ones, byte by byte.

Every block gets the inputs that were recorded, not what the other blocks make of them today. A
change in one block therefore shows in that block and in no other.
"""

from collections.abc import Callable, Iterator
from functools import partial

import numpy as np

from glider_base import wiring
from glider_base.block import optional_topics
from glider_base.ros.lockstep.health import seconds
from glider_base.signals import TICK_NS, raised
from glider_base.wiring import WHEN_SILENT, WIRING, Wired, present, publisher
from glider_mission.blocks import BLOCKS
from glider_mission.recording.mcap_reader import Bag
from glider_mission.recording.recorded_inputs import RecordedBlock
from glider_mission.recording.ros.node_settings import NodeSettings
from glider_mission.recording.ros.recorded_run import Recording
from glider_mission.recording.ros.verify.check import DIFFERENT, IDENTICAL, SKIPPED, Verdict
from glider_mission.recording.ros.verify.free_running import free_running
from glider_mission.recording.ros.verify.lockstep import in_lockstep


def is_lockstep(recording: Recording, given: NodeSettings) -> bool:
    """Whether the nodes kept step: as they were set to or, if nobody says, by what it looks like.

    That is: whether each output has every tick of its inputs as often as the first: once, mostly.
    """
    if given.lockstep is not None:
        return given.lockstep
    odom = recording.series.get('odom')
    if odom is None or np.mean(odom.stamps_ns % TICK_NS == 0) < 0.5:
        return False
    outputs = [recording.series[n] for n in ('tracking_error', 'wrench') if n in recording.series]
    counts = [np.unique(one.stamps_ns, return_counts=True)[1] for one in outputs]
    return sum(int(np.count_nonzero(each != each[0])) for each in counts) <= 1


def _reason_to_skip(wired: Wired, settings, recording: Recording, lockstep: bool) -> str:
    if settings is None:
        return 'the settings say nothing about it'
    topics = optional_topics(settings)
    inputs = present(wired.inputs, topics)
    if not lockstep and (WHEN_SILENT.keys() & inputs or wired in (wiring.PLANT, wiring.CURRENT)):
        return 'free-running: which inputs it had at a tick is not on record'
    missing = [name for name in inputs if name not in recording.series]
    if missing:
        return f'its input {" and ".join(missing)} is not recorded'
    outputs = present(wired.outputs, topics)
    if not any(name in recording.series for name in outputs):
        return f'none of {", ".join(outputs)} is recorded'
    return ''


def verify(
    recording: Recording,
    given: NodeSettings,
    only: list[str],
    progress: Callable[[str, float], None],
) -> Iterator[Verdict]:
    """Compare the blocks of a recording, all or only some, in the order in which they act.

    ``progress`` is called now and then with a block's name and the share that is done, 0 to 1.
    """
    lockstep = is_lockstep(recording, given)
    for block in BLOCKS:
        name = block.wired.name
        if only and name not in only:
            continue
        settings = given.blocks[name]
        reason = _reason_to_skip(block.wired, settings, recording, lockstep)
        if reason:
            yield Verdict(name, SKIPPED, reason)
            continue
        old_s = given.old_s(block.wired.node)
        work = in_lockstep if lockstep else partial(free_running, max_age_s=old_s)
        recorded = RecordedBlock(block, settings)
        try:
            yield work(recorded, recording, progress=partial(progress, name))
        except Exception as error:  # of a law of somebody's own
            yield Verdict(name, DIFFERENT, notes=[f'not computed: {raised(error)}'])


def report(bag: Bag, recording: Recording, given: NodeSettings, verdicts: list[Verdict]) -> dict:
    """Verdicts as one JSON object, with hints for whoever looks for a cause."""
    lockstep = is_lockstep(recording, given)
    compared = [verdict for verdict in verdicts if verdict.result != SKIPPED]
    notes = [bag.cut] if bag.cut else []
    if not compared:
        notes.append('nothing could be compared')
        if recording.ignored:
            notes.append(f'recorded under other names: {", ".join(recording.ignored)}')
    if not lockstep:
        notes.append(
            'recorded free-running: a message that was lost, or a node that was started before '
            'the recording, looks like a difference'
        )
    return {
        'identical': bool(compared) and all(one.result == IDENTICAL for one in compared),
        'settings': given.source,
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
        if (
            source
            and source.topic in wired.inputs
            and publisher(source.topic).name == other.block
            and source.stamp_ns <= one.first.stamp_ns
        ):
            hints.append(
                f'its input {source.topic} differs at {seconds(source.stamp_ns)} from what '
                f'{other.block} computes: if the recording is damaged there, this is why'
            )
    return hints
