# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""A block of a free-running recording: which inputs a step had is found by trying."""

import itertools
from copy import copy

import numpy as np

from glider_base.ros.lockstep import health
from glider_base.ros.lockstep.health import seconds
from glider_base.ros.lockstep.step_node import Passing
from glider_base.signals import TICK_S
from glider_mission.recording.recorded_inputs import RecordedBlock
from glider_mission.recording.ros.recorded_run import Recording, Series
from glider_mission.recording.ros.verify.check import Check, Track, Verdict

#: A step has the newest message of an input, or one that is so many older.
_OLDER = range(4)
#: Behind a clock that was set back a step is looked for so many messages ahead.
_AHEAD = 1024
#: An input goes on by one message from step to step, or by one of these.
_ADVANCES = (1, 0, 2)
#: What comes in every tick is missed after so long (s); answers, which may come late, later.
_MISSED_S = {name: 1.5 * TICK_S for name in ('odom', 'joint_states')}


def _by_stamp(series: Series, stamps_ns: np.ndarray) -> tuple[Track, list[int]]:
    """Track of an output whose steps have these stamps in this order, and what is left over."""
    index, left, j = np.full(len(stamps_ns), -1), [], 0
    for i, stamp_ns in enumerate(stamps_ns):
        while j < len(series) and series.stamps_ns[j] < stamp_ns:
            left.append(j)
            j += 1
        if j < len(series) and series.stamps_ns[j] == stamp_ns:
            index[i] = j
            j += 1
    return Track(series, index), [*left, *range(j, len(series))]


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
    check = Check(block, recording, stamps_ns)
    passing = Passing(max_age_s)
    check.passed[:] = [passing.ticks(int(stamp_ns)) for stamp_ns in stamps_ns]
    outputs = check.tracks(lambda one: _by_stamp(one, stamps_ns), 'which belongs to no step')
    start, cuts = 0, check.cuts(len(stamps_ns))
    last = None
    while start < len(stamps_ns):
        choices = {}
        for name in block.inputs:
            before = last and last[name]
            newest = _newest(series[name].stamps_ns, stamps_ns[start], before or 0)
            choices[name] = _places(newest, before)
        check.follow_orders(start)
        end = min([start + 1024, len(stamps_ns), *(cut for cut in cuts if cut > start)])
        rows, good = _closest(check, start, end, _options(choices), outputs)
        if not good:
            break
        start += good
        last = {name: int(index[good - 1]) for name, index in rows.items()}
        progress(start / len(stamps_ns))
    if check.found:
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


def _options(choices: dict[str, list[int]]) -> list[dict[str, int]]:
    """Choices of one message of each input, the likely ones first."""
    ranked = itertools.product(*(enumerate(places) for places in choices.values()))
    in_order = sorted(ranked, key=lambda option: sum(rank for rank, _ in option))
    return [dict(zip(choices, (place for _, place in one), strict=True)) for one in in_order]


def _consecutive(check: Check, start: int, end: int, begin: dict[str, int]):
    """Messages of the inputs for the steps from ``start`` on, as long as their stamps fit."""
    wanted_ns = check.stamps_ns[start:end]
    fits = np.ones(end - start, bool)
    newest_ns = np.full(end - start, -1)
    rows = {}
    for name, place in begin.items():
        series = check.recording.series[name]
        rows[name] = place + np.arange(end - start)
        inside = np.clip(rows[name], 0, len(series) - 1)
        fits &= (rows[name] == inside) & ~np.isin(inside, list(series.unusable))
        newest_ns = np.maximum(newest_ns, series.stamps_ns[inside])
    misfits = np.flatnonzero(~fits | (newest_ns != wanted_ns))
    count = int(misfits[0]) if len(misfits) else end - start
    return {name: index[:count] for name, index in rows.items()}


def _closest(check: Check, start: int, end: int, options, outputs):
    """Compare by that of the options for the inputs of a step that gives most of its outputs.

    Returns the messages of the inputs, and how many steps from ``start`` on are identical. The
    block is left after them; if there are none, what differs is kept.
    """
    before, least = check.block.state, np.inf
    rows, computed, good, count = {}, {}, 0, 0
    for begin in options:
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
    if not rows:
        wanted = f'{" and ".join(check.block.inputs)} of this step'
        check.add_whole(check.stamps_ns[start], next(iter(outputs)), wanted)
        return rows, 0
    steps = max(1, good)
    if good < count:
        check.block.state = before
        check.run(start, start + steps, {name: index[:steps] for name, index in rows.items()})
    for name, track in outputs.items():
        check.compare(name, track, start, computed[name][:steps])
    return rows, good
