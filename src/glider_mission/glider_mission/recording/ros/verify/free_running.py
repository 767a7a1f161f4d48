# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""A block of a free-running recording: which inputs a step had is found by trying."""

import itertools
from copy import copy

import numpy as np

from glider_base.kernels.packing import packed
from glider_base.ros.lockstep import health
from glider_base.ros.lockstep.health import seconds
from glider_base.ros.lockstep.step_node import Passing
from glider_base.signals import TICK_S
from glider_mission.recording.recorded_inputs import RecordedBlock
from glider_mission.recording.ros.recorded_run import Recording, Series
from glider_mission.recording.ros.verify.check import (
    TICKS_OF_THE_END,
    Check,
    Track,
    Verdict,
    begun_before,
)

#: A step has the newest message of an input, or one that is so many older.
_OLDER = range(4)
#: Behind a clock that was set back a step is looked for so many messages ahead.
_AHEAD = 1024
#: Where no message fits, one before was taken wrongly: so many steps are taken again, and in each
#: of them so many ways are followed.
_BACK, _WAYS = 16, 64
#: An input goes on by one message from step to step, or by one of these.
_ADVANCES = (1, 0, 2)
#: What comes in every tick is missed after so long (s); answers, which may come late, later.
_MISSED_S = {name: 1.5 * TICK_S for name in ('odom', 'joint_states')}


def _by_stamp(series: Series, stamps_ns: np.ndarray) -> tuple[Track, list[int]]:
    """Track of an output whose steps have these stamps in this order, and what is left over.

    A recorder may have left in the middle of a step, before it had the output that marks it.
    """
    index, left, j = np.full(len(stamps_ns), -1), [], 0
    for i, stamp_ns in enumerate(stamps_ns):
        while j < len(series) and series.stamps_ns[j] < stamp_ns:
            left.append(j)
            j += 1
        if j < len(series) and series.stamps_ns[j] == stamp_ns:
            index[i] = j
            j += 1
    after = range(j, len(series))
    return Track(series, index), [*left, *(after if len(after) > TICKS_OF_THE_END else ())]


def free_running(
    block: RecordedBlock, recording: Recording, max_age_s: float, progress
) -> Verdict:
    """Compare a block step by step, each with the inputs that it must have had.

    A step carries the newest stamp among its inputs. That names the input of guidance. Of those of
    control it names one; the others may be a message older, which is found out by trying. In a
    cycle without a new stamp a node says its answer again. ``max_age_s`` is `input_max_age_s`.
    """
    wired = block.block.wired
    ours = wired.inputs + wired.outputs
    series = {
        name: one.without_repeats() for name, one in recording.series.items() if name in ours
    }
    recording = copy(recording)
    recording.series = series
    # what is published first is published while an input is stale, too
    marker = next(name for name in reversed(wired.outputs) if name in series)
    stamps_ns = series[marker].stamps_ns
    for name in block.inputs:
        if series[name].stamps_ns[0] > stamps_ns[0]:
            return begun_before(wired.name, name, series[name])
    node, keys = recording.node(wired.node), {block.block.flags[0], health.EVENT}
    told_ns = [e.stamp_ns for e in recording.events if e.node == node and keys <= e.values.keys()]
    if told_ns and min(told_ns) < np.min(stamps_ns):  # latched: a later recorder hears it, too
        return begun_before(wired.name, marker, series[marker])
    check = Check(block, recording, stamps_ns)
    passing = Passing(max_age_s)
    check.passed[:] = [passing.ticks(int(stamp_ns)) for stamp_ns in stamps_ns]
    outputs = check.tracks(lambda one: _by_stamp(one, stamps_ns), 'which belongs to no step')
    start, cuts = 0, check.cuts(len(stamps_ns))
    taken = {name: np.full(len(stamps_ns), -1) for name in block.inputs}
    marks = []  # steps since an order, and the states before them
    while start < len(stamps_ns):
        if start in cuts:
            marks = []
        check.follow_orders(start)
        marks = [*marks[-_BACK:], (start, block.state)]
        end = min([start + 1024, len(stamps_ns), *(cut for cut in cuts if cut > start)])
        rows, computed, good = _closest(check, start, end, taken, outputs)
        if not good and (found := _otherwise(check, start, marks, taken, outputs)):
            rows, computed, good = found
        if not rows:
            wanted = f'{" and ".join(block.inputs)} of this step'
            check.add_whole(stamps_ns[start], next(iter(outputs)), wanted)
        for name, values in computed.items():
            check.compare(name, outputs[name], start, values)
        if not good:
            break
        for name, index in rows.items():
            taken[name][start : start + good] = index
        start += good
        progress(start / len(stamps_ns))
    if check.found:
        if start < len(stamps_ns):
            check.notes.append('free-running: compared up to the first difference')
        at_ns = min(one.stamp_ns for one in check.found)
        check.notes += [
            f'{name} is not on record from {seconds(begin_ns)} to {seconds(end_ns)}: if the '
            'recorder missed it there, or its node was started again, this is why'
            for name in (*block.inputs, marker)
            for begin_ns, end_ns in _silences(
                series[name].stamps_ns, at_ns, _MISSED_S.get(name, max_age_s)
            )
        ]
        check.notes += [
            f'{wired.node} was configured at {seconds(event.stamp_ns)}, and began anew: if it had '
            'learnt anything before, this is why'
            for event in recording.events
            if (event.node, event.message) == (recording.node(wired.node), health.CONFIGURED)
            and stamps_ns[0] <= event.stamp_ns <= at_ns
        ]
    elif check.ticks:
        check.finish_events()
    return check.verdict()


def _silences(stamps_ns: np.ndarray, at_ns: int, least_s: float) -> list[tuple[int, int]]:
    """From when to when a topic, int64[n], is silent for so long, by a time or just before it."""
    after = int(np.searchsorted(stamps_ns, at_ns))
    around = map(int, stamps_ns[max(0, after - 1) : after + 2])
    return [(a, b) for a, b in itertools.pairwise(around) if b - a > 1e9 * least_s]


def _newest(stamps_ns: np.ndarray, stamp_ns: int, before: int) -> int:
    """Newest of an input's messages at a stamp, int64[n]; the step before had that ``before``."""
    newest_ns = np.maximum.accumulate(stamps_ns)
    newest = int(np.searchsorted(newest_ns, stamp_ns, 'right')) - 1
    if newest < before or newest_ns[newest] != stamps_ns[newest]:  # the clock was set back
        same = np.flatnonzero(stamps_ns[before : before + _AHEAD] == stamp_ns)
        newest = before + int(same[0]) if len(same) else newest
    return newest


def _places(newest: int, last: int | None) -> list[int]:
    """Messages of an input that a step may have had, the likely ones first.

    What an input was is not always seen in what came of it, so that the one of the step before
    may be taken wrongly: by the newest the steps that follow are right again.
    """
    likely = [newest - older for older in _OLDER]
    if last is None:
        return likely
    likely[1:1] = [last + more for more in _ADVANCES]
    return [place for place in dict.fromkeys(likely) if place >= last]


def _options(check: Check, step: int, before: dict[str, int] | None) -> list[dict[str, int]]:
    """Choices of one message of each input of a step, the likely ones first.

    ``before`` are those of the step before; None at the first one.
    """
    choices = {}
    for name in check.block.inputs:
        last = before and before[name]
        stamps_ns = check.recording.series[name].stamps_ns
        choices[name] = _places(_newest(stamps_ns, check.stamps_ns[step], last or 0), last)
    ranked = itertools.product(*(enumerate(places) for places in choices.values()))
    in_order = sorted(ranked, key=lambda option: sum(rank for rank, _ in option))
    return [dict(zip(choices, (place for _, place in one), strict=True)) for one in in_order]


def _before(taken: dict[str, np.ndarray], step: int) -> dict[str, int] | None:
    """Messages of the inputs that the step before had; None at the first one."""
    return {name: int(index[step - 1]) for name, index in taken.items()} if step else None


def _consecutive(check: Check, start: int, end: int, begin: dict[str, int]):
    """Messages of the inputs for the steps from ``start`` on, as long as their stamps fit."""
    wanted_ns = check.stamps_ns[start:end]
    fits = np.ones(end - start, bool)
    newest_ns = np.full(end - start, -1)
    rows = {}
    for name, place in begin.items():
        series = check.recording.series[name]
        rows[name] = place + np.arange(end - start)
        inside = np.maximum(np.minimum(rows[name], len(series) - 1), 0)
        fits &= rows[name] == inside
        if series.unusable:
            fits &= ~np.isin(inside, list(series.unusable))
        newest_ns = np.maximum(newest_ns, series.stamps_ns[inside])
    misfits = np.flatnonzero(~fits | (newest_ns != wanted_ns))
    count = int(misfits[0]) if len(misfits) else end - start
    return {name: index[:count] for name, index in rows.items()}


def _closest(check: Check, start: int, end: int, taken, outputs):
    """Find the option for the inputs of a step that gives most of its outputs.

    Returns the messages of the inputs and what is computed of them, as long as that is identical,
    and how many steps from ``start`` on are. If none is, it is that of the first one. The block is
    left after them.
    """
    before, least = check.block.state, np.inf
    rows, computed, good, count = {}, {}, 0, 0
    for begin in _options(check, start, _before(taken, start)):
        tried = _consecutive(check, start, end, begin)
        if not (steps := min(map(len, tried.values()))):
            continue
        check.block.state = before
        found = check.run(start, start + steps, tried)
        wrong = np.array([check.differs(outputs[name], start, found[name]) for name in outputs])
        if np.sum(wrong[:, 0]) < least:
            least, rows, computed, count = np.sum(wrong[:, 0]), tried, found, steps
            good = int(np.argmax(np.append(np.any(wrong, axis=0), True)))
        if good:
            break
    steps = max(1, good)
    rows = {name: index[:steps] for name, index in rows.items()}
    if good < count:
        check.block.state = before
        check.run(start, start + steps, rows)
    return rows, {name: computed[name][:steps] for name in outputs if rows}, good


def _otherwise(check: Check, at: int, marks, taken, outputs):
    """Find other messages for some steps before one that none fits, so that one does.

    Returns what `_closest` does, or None. ``taken`` is put right for the steps before, and
    ``marks`` are kept where it has not changed.
    """
    begin = max(at - _BACK, marks[0][0])
    first, check.block.state = next(one for one in reversed(marks) if one[0] <= begin)
    if first < begin:
        check.run(first, begin, {name: index[first:begin] for name, index in taken.items()})
    begun = check.block.state
    ways = [(begun, [_before(taken, begin)])]
    for step in range(begin, at + 1):
        ways = _ways_on(check, step, ways, outputs)
    if not ways:
        return None
    for name, index in taken.items():
        index[begin : at + 1] = [option[name] for option in ways[0][1][1:]]
    marks[:] = [one for one in marks if one[0] <= begin]
    check.block.state = begun
    rows = {name: index[begin : at + 1] for name, index in taken.items()}
    found = check.run(begin, at + 1, rows)
    rows = {name: index[-1:] for name, index in rows.items()}
    return rows, {name: found[name][-1:] for name in outputs}, 1


def _ways_on(check: Check, step: int, ways, outputs):
    """States after a step, each with the messages that lead to it, that give its outputs.

    Of those that come to the same state the oldest messages leave most to choose from.
    """
    found = {}
    tried = ((*one, option) for one in ways for option in _options(check, step, one[1][-1]))
    for state, way, option in tried:
        rows = _consecutive(check, step, step + 1, option)
        if not min(map(len, rows.values())):
            continue
        check.block.state = state
        computed = check.run(step, step + 1, rows)
        if any(check.differs(outputs[name], step, computed[name]) for name in outputs):
            continue
        _, numbers, others = packed(check.block.state)
        bits = tuple(np.asarray(one).tobytes() for one in (*numbers, *others))
        if bits not in found or sum(option.values()) < sum(found[bits][1][-1].values()):
            found[bits] = check.block.state, [*way, option]
    return [*found.values()][:_WAYS]
