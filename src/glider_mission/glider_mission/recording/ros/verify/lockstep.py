# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""A block of a recording in lockstep, tick by tick."""

import itertools

import numpy as np

from glider_base.ros.lockstep.health import seconds
from glider_base.signals import TICK_NS
from glider_mission.recording.recorded_inputs import RecordedBlock
from glider_mission.recording.ros.recorded_run import Recording, Series
from glider_mission.recording.ros.verify.check import (
    MISSING,
    SKIPPED,
    TICKS_OF_THE_END,
    Check,
    Track,
    Verdict,
)
from glider_model.plant.block import PLANT

#: Ticks that a block works through at a time.
_TICKS_AT_ONCE = 8192


def place_ticks(stamps_ns: np.ndarray) -> np.ndarray:
    """Tick of every message of a topic, -1 where its stamp is no tick.

    A message that stands alone between the ticks k - 1 and k + 1 is that of tick k, whatever its
    stamp says: it is the stamp that is wrong.
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
    inputs = {name: by_tick(series[name], ticks)[0] for name in block.inputs}
    late = [name for name, track in inputs.items() if track.index[0] < 0]
    if late:
        first_ns = int(series[late[0]].stamps_ns[0])
        why = f'{late[0]} is recorded from {seconds(first_ns)} on, not from the first tick'
        return Verdict(wired.name, SKIPPED, f'its state is not known: {why}')
    check = Check(block, recording, np.arange(ticks, dtype=np.int64) * TICK_NS)
    count = min(track.gap for track in inputs.values())
    if block.block is PLANT:  # publishes a tick before it needs the inputs of that tick
        count = min(count + 1, ticks)
    outputs = check.tracks(lambda one: by_tick(one, ticks), 'out of place or there twice')
    edges = {0, count, *range(0, count, _TICKS_AT_ONCE), *check.cuts(count)}
    for start, end in itertools.pairwise(sorted(edges)):
        check.follow_orders(start)
        rows = {name: track.index[start : min(end, track.gap)] for name, track in inputs.items()}
        for name, values in check.run(start, end, rows).items():
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
        check.notes.append(f'the inputs of the last {behind} ticks are not complete')
    if check.ticks:
        check.finish_events()
    return check.verdict()
