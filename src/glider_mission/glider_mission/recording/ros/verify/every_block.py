# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""Recorded inputs through today's code, and its outputs against the recorded ones, byte by byte.

Every block gets the inputs that were recorded, not what the other blocks make of them today. A
change in one block therefore shows in that block and in no other.
"""

import itertools
from collections.abc import Callable, Iterator
from functools import partial

import numpy as np

from glider_base import wiring
from glider_base.block import optional_topics
from glider_base.ros.lockstep.health import seconds
from glider_base.signals import TICK_NS, at_tick, raised
from glider_base.wiring import WHEN_SILENT, WIRING, Wired, present, publisher
from glider_mission.blocks import BLOCKS
from glider_mission.recording.mcap_reader import Bag
from glider_mission.recording.recorded_inputs import RecordedBlock
from glider_mission.recording.ros.node_settings import NodeSettings
from glider_mission.recording.ros.recorded_run import Recording, Series
from glider_mission.recording.ros.verify.check import (
    DIFFERENT,
    IDENTICAL,
    MISSING,
    SKIPPED,
    TICKS_OF_THE_END,
    Check,
    Track,
    Verdict,
    begun_before,
)
from glider_mission.recording.ros.verify.free_running import free_running
from glider_model.plant.block import PLANT

#: Ticks that a block works through at a time.
_TICKS_AT_ONCE = 8192


def place_ticks(stamps_ns: np.ndarray) -> np.ndarray:
    """Tick of every message of a topic, -1 where its stamp is none.

    The stamp of one alone between the ticks k - 1 and k + 1 is wrong: it is that of tick k.
    """
    ticks = np.where(stamps_ns % TICK_NS == 0, stamps_ns // TICK_NS, -1)
    before = np.concatenate(([-1], ticks[:-1]))
    last = len(ticks) - 1
    for i in np.flatnonzero(ticks != before + 1):
        expected = (ticks[i - 1] if i else -1) + 1
        if i == last or (i < last and ticks[i + 1] == expected + 1):
            ticks[i] = expected
    return ticks


def by_tick(series: Series, ticks: int) -> tuple[Track, list[int]]:
    """Track of a topic in lockstep, and messages that have no place in it."""
    placed = place_ticks(series.stamps_ns)
    index = np.full(ticks, -1)
    inside = (placed >= 0) & (placed < ticks)
    backwards = np.flatnonzero(inside)[::-1]
    index[placed[backwards]] = backwards  # the first of several stays
    taken = np.zeros(len(series), bool)
    taken[index[index >= 0]] = True
    return Track(series, index), [int(i) for i in np.flatnonzero(~taken)]


def in_lockstep(block: RecordedBlock, recording: Recording, progress) -> Verdict:
    """Compare a block tick by tick."""
    series, wired = recording.series, block.block.wired
    most = max(len(one) for one in series.values())
    placed = (place_ticks(one.stamps_ns) for one in series.values())
    last = sorted(int(one[one < 2 * most + 1000].max(initial=0)) for one in placed)
    ticks = 1 + last[-2:][0]  # the stamp of one topic alone may be damaged
    clock = series.get('/clock', ())
    if len(clock) == ticks + 1 and clock.stamps_ns[-1] == ticks * TICK_NS:
        ticks += 1  # the plant ended before it had said more of its last tick
    inputs = {name: by_tick(series[name], ticks)[0] for name in block.inputs}
    late = [name for name, track in inputs.items() if track.index[0] < 0]
    if late:
        return begun_before(wired.name, late[0], series[late[0]])
    check = Check(block, recording, np.arange(ticks, dtype=np.int64) * TICK_NS)
    count = min(track.gap for track in inputs.values())
    if block.block is PLANT:  # publishes a tick before it needs the inputs of that tick
        count = min(count + 1, ticks)
    outputs = check.tracks(lambda one: by_tick(one, ticks), 'out of place or there twice')
    heard = max((track.end for track in outputs.values()), default=ticks)
    if heard + TICKS_OF_THE_END >= ticks:
        check.heard = heard
    ended, edges = '', {0, count, min(count, check.heard), *range(0, count, _TICKS_AT_ONCE)}
    for start, end in itertools.pairwise(sorted(edges | {*check.cuts(count)})):
        check.follow_orders(start)
        rows = {name: track.index[start : min(end, track.gap)] for name, track in inputs.items()}
        try:
            computed = check.run(start, end, rows)
        except Exception as error:  # of a law of somebody's own
            if start < check.heard:
                raise
            ended = f'{at_tick(raised(error), start)}, where its record ends'
            break
        for name, values in computed.items():
            if name in outputs:
                check.compare(name, outputs[name], start, values)
        progress(end / count)
    for name, track in inputs.items():
        if track.gap < max(track.end, ticks - TICKS_OF_THE_END):
            reason = track.series.unusable.get(int(track.index[track.gap]), MISSING)
            wanted = f'an input of {wired.name}, which cannot be computed any further'
            check.add_whole(check.stamps_ns[track.gap], name, wanted, reason)
    behind = ticks - check.ticks
    if behind and not check.found:
        check.notes.append(ended or f'the inputs of the last {behind} ticks are not complete')
    if check.ticks:
        check.finish_events()
    return check.verdict()


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
