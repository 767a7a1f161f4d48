# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""A block of a recording in lockstep, tick by tick."""

import itertools

import numpy as np

from glider_base.signals import TICK_NS
from glider_mission.recording.recorded_inputs import RecordedBlock
from glider_mission.recording.ros.recorded_run import Recording
from glider_mission.recording.ros.verify.check import Check, finish_events
from glider_mission.recording.ros.verify.ticks import TICKS_OF_THE_END, by_tick, place_ticks
from glider_mission.recording.ros.verify.verdict import (
    NOT_RECORDED,
    SKIPPED,
    WHOLE,
    Difference,
    Verdict,
    time_text,
)
from glider_model.plant.block import PLANT

#: Ticks that a block works through at a time.
_TICKS_AT_ONCE = 8192


def in_lockstep(block: RecordedBlock, recording: Recording, progress) -> Verdict:
    """Compare a block tick by tick."""
    series, wired = recording.series, block.block.wired
    most = max(len(one) for one in series.values())
    ticks = 1 + max(
        int(placed[placed < 2 * most + 1000].max(initial=0))
        for placed in (place_ticks(one.stamps_ns) for one in series.values())
    )
    inputs = {name: by_tick(series[name], ticks)[0] for name in block.inputs}
    late = [name for name, track in inputs.items() if track.index[0] < 0]
    if late:
        first_ns = int(series[late[0]].stamps_ns[0])
        why = f'{late[0]} is recorded from {time_text(first_ns)} on, not from the first tick'
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
            reason = track.series.unusable.get(int(track.index[track.gap]), NOT_RECORDED)
            wanted = f'an input of {wired.name}, which cannot be computed any further'
            check.add(Difference(int(check.stamps_ns[track.gap]), name, WHOLE, wanted, reason))
    behind = ticks - check.ticks
    if behind and not check.found:
        check.notes.append(f'the inputs of the last {behind} ticks are not complete')
    if check.ticks:
        finish_events(check)
    return check.verdict()
