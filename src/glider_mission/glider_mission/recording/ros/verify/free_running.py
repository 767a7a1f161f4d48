# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""A block of a free-running recording: which inputs a step had is found by trying."""

import itertools

import numpy as np

from glider_mission.recording.recorded_inputs import RecordedBlock
from glider_mission.recording.ros.recorded_run import Recording, Series
from glider_mission.recording.ros.verify.check import Check, Track, Verdict

#: A step has the newest message of an input, or one that is so many older.
_OLDER = range(4)
#: An input goes on by one message from step to step, or by one of these.
_ADVANCES = (1, 0, 2)


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


def free_running(block: RecordedBlock, recording: Recording, progress) -> Verdict:
    """Compare a block step by step, each with the inputs that it must have had.

    A step carries the newest stamp among its inputs. That names the input of guidance. Of those of
    control it names one; the others may be a message older, which is found out by trying.
    """
    wired = block.block.wired
    ours = wired.inputs + wired.outputs
    series = {name: one for name, one in recording.series.items() if name in ours}
    # what is published first is published while an input is stale, too
    marker = next(name for name in reversed(wired.outputs) if name in series)
    stamps_ns = series[marker].stamps_ns
    check = Check(block, recording, stamps_ns)
    outputs = check.tracks(
        lambda one: _by_stamp(one, stamps_ns),
        'which belongs to no step',
    )
    start, cuts = 0, check.cuts(len(stamps_ns))
    last = None
    while start < len(stamps_ns):
        choices = {}
        for name in block.inputs:
            behind = int(np.searchsorted(series[name].stamps_ns, stamps_ns[start], 'right'))
            choices[name] = _places(behind - 1, last and last[name])
        options = _options(choices)
        check.follow_orders(start)
        end = min([start + 1024, len(stamps_ns), *(cut for cut in cuts if cut > start)])
        for begin in options:
            rows = _consecutive(check, start, end, begin)
            good = _identical(check, start, rows, outputs)
            if good:
                break
        else:
            _keep_difference(check, start, options, outputs)
            break
        start += good
        last = {name: int(index[good - 1]) for name, index in rows.items()}
        progress(start / len(stamps_ns))
    if check.found:
        check.notes.append('free-running: compared up to the first difference')
    elif check.ticks:
        check.finish_events()
    return check.verdict()


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


def _identical(check: Check, start: int, rows, outputs) -> int:
    """Steps from ``start`` on that are identical; the block is left after the last of them."""
    count = min(len(index) for index in rows.values())
    if not count:
        return 0
    before = check.block.state
    computed = check.run(start, start + count, rows)
    wrong = [np.flatnonzero(check.differs(outputs[n], start, computed[n])) for n in outputs]
    good = min((int(steps[0]) for steps in wrong if len(steps)), default=count)
    if good < count:
        check.block.state = before
        if good:
            check.run(start, start + good, {name: index[:good] for name, index in rows.items()})
    for name, track in outputs.items():
        check.compare(name, track, start, computed[name][:good])
    return good


def _keep_difference(check: Check, step: int, options, outputs) -> None:
    """Put on record that no choice of inputs gives the outputs of a step, by the closest one."""
    before, tried = check.block.state, []
    for begin in options:
        rows = _consecutive(check, step, step + 1, begin)
        if min(len(index) for index in rows.values()):
            check.block.state = before
            computed = check.run(step, step + 1, rows)
            wrong = sum(int(check.differs(outputs[n], step, computed[n])[0]) for n in outputs)
            tried.append((wrong, len(tried), computed))
    if tried:
        _, _, computed = min(tried)
        for name, track in outputs.items():
            check.compare(name, track, step, computed[name])
        return
    topic = next(iter(outputs))
    wanted = f'{" and ".join(check.block.inputs)} of this step'
    check.add_whole(check.stamps_ns[step], topic, wanted)
