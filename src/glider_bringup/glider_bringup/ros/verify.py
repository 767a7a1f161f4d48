# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""Recorded inputs through today's code, and its outputs against the recorded ones, byte by byte.

Every block gets the inputs that were recorded, not what the other blocks make of them today. A
change in one block therefore shows in that block and in no other.
"""

import itertools
import struct
from collections import Counter
from collections.abc import Callable, Iterator
from typing import NamedTuple

import numpy as np
from diagnostic_msgs.msg import DiagnosticArray
from nav_msgs.msg import Path
from rclpy.serialization import deserialize_message

from glider_bringup.blocks import BLOCKS
from glider_bringup.recorded_inputs import RecordedBlock
from glider_bringup.recording.mcap_reader import Bag
from glider_bringup.ros.recording import Event, Recording, Series, Told
from glider_guidance.nodes.guidance_node import PATH_POINTS, path_message
from glider_guidance.yo.stage import STAGE_NAMES, SURFACING
from glider_model.base import wiring
from glider_model.base.block import Telling
from glider_model.base.settings import ConfigurationError
from glider_model.base.signals import TICK_NS
from glider_model.base.wiring import WIRING, Wired
from glider_model.plant.block import PLANT
from glider_model.ros.lockstep import health
from glider_model.ros.lockstep.orders import ABORT, PARAMETERS_SET, SURFACE
from glider_model.ros.parameters import with_parameters
from glider_model.ros.wire.codec import cdr_places, to_cdr
from glider_model.ros.wire.topics import TOPICS

IDENTICAL, DIFFERENT, SKIPPED = 'identical', 'different', 'skipped'

#: Ticks that a block works through at a time.
_TICKS_AT_ONCE = 8192
#: Ticks at the end that may lack in a topic: whoever recorded it left in the middle of one.
_TICKS_OF_THE_END = 10
#: Bytes in which an event may differ from what is expected, and still be taken for it.
_BYTES_ALIKE = 16
#: Free-running: an input goes on by one message from step to step, or by one of these.
_ADVANCES = (1, 0, 2, 3, 4, 5, 6, 7, 8)

_NOT_RECORDED, _WHOLE = 'not recorded', '(message)'


class Difference(NamedTuple):
    """Where a recording and today's code differ."""

    stamp_ns: int
    topic: str
    field: str
    computed: str
    recorded: str

    @property
    def tick(self) -> int:
        """Number of the tick; of a vehicle's own clock, that many tenths of a second."""
        return self.stamp_ns // TICK_NS


class Verdict(NamedTuple):
    """What came out for one block."""

    block: str
    status: str  #: IDENTICAL, DIFFERENT or SKIPPED
    reason: str  #: why it was skipped
    ticks: int  #: that were computed
    compared: dict[str, int]  #: messages by topic
    differing: dict[str, int]  #: those of them that differ, by topic
    first: Difference | None
    notes: list[str]


# ---------------------------------------------------------------------- one message


def field_difference(expected, recorded: bytes) -> tuple[str, str, str]:
    """First field in which recorded bytes differ from a message.

    Parameters
    ----------
    expected : message
    recorded : bytes
        Anything.

    Returns
    -------
    field, computed, recorded : str
        With the bits where two numbers print alike.
    """
    raw = to_cdr(expected)
    shared = min(len(raw), len(recorded))
    at = next((i for i in range(shared) if raw[i] != recorded[i]), shared)
    if at < 4:
        return 'CDR header', raw[:4].hex(), recorded[:4].hex()
    if at >= len(raw):
        return _WHOLE, f'{len(raw)} bytes', f'{len(recorded)} bytes'
    before = 'CDR header'
    for place in cdr_places(expected):
        if at < place.start:
            break
        before = place.path
        if at < place.end:
            return place.path, *_values(place, raw, recorded)
    return f'padding after {before}', f'byte {raw[at]:#04x}', f'byte {recorded[at]:#04x}'


def _values(place, raw: bytes, recorded: bytes) -> tuple[str, str]:
    texts = [_value(place, data) for data in (raw, recorded)]
    if texts[0] == texts[1]:
        bits = [data[place.start : place.end][::-1].hex() for data in (raw, recorded)]
        texts = [f'{text} (0x{bit})' for text, bit in zip(texts, bits, strict=True)]
    return texts[0], texts[1]


def _value(place, data: bytes) -> str:
    """Value of a field in bytes that may end before it."""
    if len(data) < place.start + (4 if place.code == 's' else place.end - place.start):
        return 'cut off'
    if place.code != 's':
        return str(struct.unpack_from('<' + place.code, data, place.start)[0])
    (length,) = struct.unpack_from('<I', data, place.start)
    text = data[place.start + 4 : place.start + 4 + length]
    if len(text) < length:
        return f'a string of {length} bytes'
    return repr(text[:-1].decode(errors='backslashreplace') if text[-1:] == b'\0' else text)


def _message_difference(topic: str, stamp_ns: int, values, recorded: bytes) -> Difference:
    codec = TOPICS[topic].codec
    expected = deserialize_message(codec.encode(stamp_ns, values), codec.message_type)
    return Difference(stamp_ns, topic, *field_difference(expected, recorded))


# ---------------------------------------------------------------------- lockstep: which tick


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


class _Track:
    """Which message of a topic belongs to each step of a block; -1 where there is none."""

    def __init__(self, series: Series, index: np.ndarray) -> None:
        self.series, self.index = series, index
        present = np.flatnonzero(index >= 0)
        self.end = int(present[-1]) + 1 if len(present) else 0  #: after the last step it has
        unusable = np.isin(index, list(series.unusable))
        gaps = np.flatnonzero((index < 0) | unusable)
        #: first step without a message that a node could use
        self.gap = int(gaps[0]) if len(gaps) else len(index)


def _by_tick(series: Series, ticks: int) -> tuple[_Track, list[int]]:
    """Track of a topic in lockstep, and messages that have no place in it."""
    placed = place_ticks(series.stamps_ns)
    index = np.full(ticks, -1)
    inside = (placed >= 0) & (placed < ticks)
    backwards = np.flatnonzero(inside)[::-1]
    index[placed[backwards]] = backwards  # the first of several stays
    taken = np.zeros(len(series), bool)
    taken[index[index >= 0]] = True
    return _Track(series, index), [int(i) for i in np.flatnonzero(~taken)]


# ---------------------------------------------------------------------- the comparison


class _Check:
    """One block at work, and what has been found so far."""

    def __init__(self, block: RecordedBlock, recording: Recording, stamps_ns: np.ndarray) -> None:
        self.block, self.recording, self.stamps_ns = block, recording, stamps_ns
        self.found: list[Difference] = []
        self.compared: Counter[str] = Counter()
        self.differing: Counter[str] = Counter()
        self.notes: list[str] = []
        self.flags = np.zeros((len(stamps_ns), len(block.block.flags)), np.int64)
        self.ticks = 0
        self._orders = _orders(recording.events, recording.node(block.block.wired.node))

    def add(self, difference: Difference) -> None:
        """Keep a difference."""
        self.differing[difference.topic] += 1
        self.found.append(difference)

    # .................................................................. steps

    def cuts(self, count: int) -> list[int]:
        """Steps before which an order changes the block."""
        at = {int(np.searchsorted(self.stamps_ns, order.stamp_ns)) for order in self._orders}
        return sorted(i for i in at if i < count)

    def follow_orders(self, step: int) -> None:
        """Do what was asked of the block before a step."""
        stamp_ns = self.stamps_ns[step]
        while self._orders and self._orders[0].stamp_ns <= stamp_ns:
            order = self._orders.pop(0)
            if order.message in (ABORT, SURFACE):
                self.block.surface()
                continue
            try:
                self.block.tune(with_parameters(self.block.settings, order.values))
            except ConfigurationError as error:
                self.notes.append(f'parameters set at {_time(order.stamp_ns)}: {error}')

    def run(self, start: int, end: int, rows: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
        """Outputs of the steps from start to end; rows are the messages of the inputs."""
        series = self.recording.series
        inputs = {name: series[name].values[index] for name, index in rows.items()}
        computed, self.flags[start:end] = self.block.run(self.stamps_ns[start:end], inputs)
        self.ticks = end
        return computed

    def differs(self, track: _Track, start: int, values: np.ndarray) -> np.ndarray:
        """Which of the steps from ``start`` on have another message than computed; bool[n]."""
        index = track.index[start : start + len(values)]
        series = track.series
        recorded = series.values[index]
        same = np.all(recorded.view(np.int64) == values.view(np.int64), axis=1)
        stamps_ns = self.stamps_ns[start : start + len(values)]
        same &= (series.stamps_ns[index] == stamps_ns) & series.own[index]
        return ~same & (index >= 0)

    def compare(self, name: str, track: _Track, start: int, values: np.ndarray) -> None:
        """Compare the outputs on one topic, for the steps from ``start`` on."""
        index = track.index[start : start + len(values)]
        self.compared[name] += int(np.count_nonzero(index >= 0))
        found = np.flatnonzero(self.differs(track, start, values))
        self.differing[name] += len(found)
        if len(found):
            row = int(found[0])
            raw = track.series.payload(int(index[row]))
            stamp_ns = int(self.stamps_ns[start + row])
            self.found.append(_message_difference(name, stamp_ns, values[row], raw))
        for row in np.flatnonzero(index < 0):
            if start + row < track.end or track.end + _TICKS_OF_THE_END < len(track.index):
                self.miss(name, start + int(row))

    def miss(self, name: str, step: int) -> None:
        """Keep that the message of a step is not there."""
        self.differing[name] += 1
        stamp_ns = int(self.stamps_ns[step])
        self.found.append(Difference(stamp_ns, name, _WHOLE, 'a message', _NOT_RECORDED))

    # .................................................................. events, path, verdict

    def compare_path(self) -> None:
        """Compare the path that guidance published."""
        if 'path' not in self.recording.recorded:
            self.notes.append('path is not recorded')
            return
        path: Path = path_message(self.block.settings.path.points(PATH_POINTS))
        raw = to_cdr(path)
        stamp_ns = int(self.stamps_ns[0])
        self.compared['path'] += len(self.recording.paths)
        for recorded in self.recording.paths:
            if recorded != raw:
                self.add(Difference(stamp_ns, 'path', *field_difference(path, recorded)))
        if not self.recording.paths:
            self.add(Difference(stamp_ns, 'path', _WHOLE, 'a message', _NOT_RECORDED))

    def compare_events(self, expected: list[DiagnosticArray], is_ours) -> None:
        """Compare the events that the block tells with those on record."""
        if '/diagnostics' not in self.recording.recorded:
            self.notes.append('/diagnostics is not recorded')
            return
        end_ns = int(self.stamps_ns[self.ticks - 1])
        left = Counter(event.raw for event in self.recording.events)
        missing = []
        for array in expected:
            raw = to_cdr(array)
            if left[raw]:
                left[raw] -= 1
                self.compared['/diagnostics'] += 1
            else:
                missing.append((array, raw))
        rest = []
        for event in self.recording.events:
            if left[event.raw]:
                left[event.raw] -= 1
                rest.append(event)
        for array, raw in missing:
            stamp = array.header.stamp
            stamp_ns = stamp.sec * 1_000_000_000 + stamp.nanosec
            alike = [e for e in rest if len(e.raw) == len(raw) and _alike(e.raw, raw)]
            if alike:
                rest.remove(alike[0])
                found = field_difference(array, alike[0].raw)
                self.compared['/diagnostics'] += 1
            else:
                found = (_WHOLE, _text(array), _NOT_RECORDED)
            self.add(Difference(stamp_ns, '/diagnostics', *found))
        for event in rest:
            if is_ours(event) and event.stamp_ns <= end_ns:
                text = event.message
                found = Difference(
                    event.stamp_ns, '/diagnostics', _WHOLE, repr(text), 'not computed'
                )
                self.add(found)

    def verdict(self) -> Verdict:
        """What came out."""
        self.differing = Counter({name: n for name, n in self.differing.items() if n})
        first = min(self.found, key=lambda one: one.stamp_ns, default=None)
        return Verdict(
            self.block.block.wired.name,
            DIFFERENT if first else IDENTICAL,
            '',
            self.ticks,
            dict(self.compared),
            dict(self.differing),
            first,
            self.notes,
        )


def _time(stamp_ns: int) -> str:
    return f't = {stamp_ns / 1e9:.1f} s'


def _text(array: DiagnosticArray) -> str:
    return repr(array.status[0].message)


def _alike(one: bytes, other: bytes) -> bool:
    return sum(a != b for a, b in zip(one, other, strict=True)) <= _BYTES_ALIKE


def _orders(events: list[Event], node: str) -> list[Event]:
    """Orders that a node was given in flight, in the order in which it followed them."""
    asked = [e for e in events if e.node == node and e.message in (ABORT, PARAMETERS_SET, SURFACE)]
    return sorted(asked, key=lambda event: event.stamp_ns)


def _finish_events(check: _Check) -> None:
    """Compare what the block tells on /diagnostics, and the path."""
    stamps_ns, flags = check.stamps_ns[: check.ticks], check.flags[: check.ticks]
    block = check.block.block
    node = check.recording.node(block.wired.node)
    if block.wired == wiring.GUIDANCE:
        check.compare_path()
    if block.say:
        told = Telling(block, int(stamps_ns[0])).among(flags, stamps_ns)
        arrays = [
            health.said_array(int(stamps_ns[i]), node, block.say(*flags[i].tolist())) for i in told
        ]
        check.compare_events(arrays, lambda e: e.node == node and block.flags[0] in e.values)
    elif block is PLANT:
        ends = [int(stamp_ns) for stamp_ns in stamps_ns[flags[:, 0] > 0]]
        arrays = [
            health.report_array(health.Report(node, health.FINISHED, health.COMPLETE, stamp_ns))
            for stamp_ns in ends
        ]
        check.compare_events(arrays, lambda e: e.node == node and e.message == health.COMPLETE)


# ---------------------------------------------------------------------- lockstep


def _in_lockstep(block: RecordedBlock, recording: Recording, progress) -> Verdict:
    """Compare a block tick by tick."""
    series, wired = recording.series, block.block.wired
    most = max(len(one) for one in series.values())
    ticks = 1 + max(
        int(placed[placed < 2 * most + 1000].max(initial=0))
        for placed in (place_ticks(one.stamps_ns) for one in series.values())
    )
    inputs = {name: _by_tick(series[name], ticks)[0] for name in wired.inputs}
    late = [name for name, track in inputs.items() if track.index[0] < 0]
    if late:
        first_ns = int(series[late[0]].stamps_ns[0])
        return skipped(
            wired.name,
            f'its state is not known: {late[0]} is recorded from {_time(first_ns)} on, not from '
            f'the first tick',
        )
    check = _Check(block, recording, np.arange(ticks, dtype=np.int64) * TICK_NS)
    count = min(track.gap for track in inputs.values())
    if block.block is PLANT:  # publishes a tick before it needs the inputs of that tick
        count = min(count + 1, ticks)
    outputs = {}
    for name in wired.outputs:
        if name not in series:
            check.notes.append(f'{name} is not recorded')
            continue
        outputs[name], strays = _by_tick(series[name], ticks)
        for i in strays:
            stamp_ns = int(series[name].stamps_ns[i])
            text = f'message {i} of the topic, out of place or there twice'
            check.add(Difference(stamp_ns, name, _WHOLE, text, 'not computed'))
    edges = {0, count, *range(0, count, _TICKS_AT_ONCE), *check.cuts(count)}
    for start, end in itertools.pairwise(sorted(edges)):
        check.follow_orders(start)
        rows = {name: track.index[start : min(end, track.gap)] for name, track in inputs.items()}
        for name, values in check.run(start, end, rows).items():
            if name in outputs:
                check.compare(name, outputs[name], start, values)
        progress(end / count)
    for name, track in inputs.items():
        if track.gap < max(track.end, ticks - _TICKS_OF_THE_END):
            reason = track.series.unusable.get(int(track.index[track.gap]), _NOT_RECORDED)
            wanted = f'an input of {wired.name}, which cannot be computed any further'
            check.add(Difference(int(check.stamps_ns[track.gap]), name, _WHOLE, wanted, reason))
    behind = ticks - check.ticks
    if behind and not check.found:
        check.notes.append(f'the inputs of the last {behind} ticks are not complete')
    if check.ticks:
        _finish_events(check)
    return check.verdict()


# ---------------------------------------------------------------------- free-running


def _by_stamp(series: Series, stamps_ns: np.ndarray) -> tuple[_Track, list[int]]:
    """Track of an output whose steps have these stamps in this order, and what is left over."""
    index, left, j = np.full(len(stamps_ns), -1), [], 0
    for i, stamp_ns in enumerate(stamps_ns):
        while j < len(series) and series.stamps_ns[j] < stamp_ns:
            left.append(j)
            j += 1
        if j < len(series) and series.stamps_ns[j] == stamp_ns:
            index[i] = j
            j += 1
    return _Track(series, index), [*left, *range(j, len(series))]


def _free_running(block: RecordedBlock, recording: Recording, progress) -> Verdict:
    """Compare a block step by step, each with the inputs that it must have had.

    A step carries the newest stamp among its inputs. That names the input of guidance. Of those of
    control it names one; the others may be a message older, which is found out by trying.
    """
    wired = block.block.wired
    ours = wired.inputs + wired.outputs
    series = {name: one for name, one in recording.series.items() if name in ours}
    # what is published first is published while an input is stale, too
    marker = next((name for name in reversed(wired.outputs) if name in series), None)
    if marker is None:
        return skipped(wired.name, f'none of {", ".join(wired.outputs)} is recorded')
    stamps_ns = series[marker].stamps_ns
    if wired == wiring.CONTROL:
        safe = np.array(block.params.safe_command)
        if marker == 'command':
            stamps_ns = stamps_ns[~np.all(series[marker].values == safe, axis=1)]
    check = _Check(block, recording, stamps_ns)
    outputs = {}
    for name in wired.outputs:
        if name not in series:
            check.notes.append(f'{name} is not recorded')
            continue
        outputs[name], left = _by_stamp(series[name], stamps_ns)
        for i in left:
            if name != 'command' or not np.array_equal(series[name].values[i], safe):
                text = f'message {i} of the topic, which belongs to no step'
                stamp_ns = int(series[name].stamps_ns[i])
                check.add(Difference(stamp_ns, name, _WHOLE, text, 'not computed'))
    start, cuts = 0, check.cuts(len(stamps_ns))
    first = {name: _newest(series[name], stamps_ns[0]) for name in wired.inputs}
    options = _options({name: [n, n - 1, n - 2, n - 3] for name, n in first.items()})
    while start < len(stamps_ns):
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
        options = _options({name: [n + more for more in _ADVANCES] for name, n in last.items()})
        progress(start / len(stamps_ns))
    if check.found:
        check.notes.append('free-running: compared up to the first difference')
    elif check.ticks:
        _finish_events(check)
    return check.verdict()


def _newest(series: Series, stamp_ns: int) -> int:
    return int(np.searchsorted(series.stamps_ns, stamp_ns, 'right')) - 1


def _options(choices: dict[str, list[int]]) -> list[dict[str, int]]:
    """Choices of one message of each input, the likely ones first."""
    ranked = itertools.product(*(enumerate(places) for places in choices.values()))
    in_order = sorted(ranked, key=lambda option: sum(rank for rank, _ in option))
    return [dict(zip(choices, (place for _, place in one), strict=True)) for one in in_order]


def _consecutive(check: _Check, start: int, end: int, begin: dict[str, int]):
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


def _identical(check: _Check, start: int, rows, outputs) -> int:
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


def _keep_difference(check: _Check, step: int, options, outputs) -> None:
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
    stamp_ns = int(check.stamps_ns[step])
    check.add(Difference(stamp_ns, topic, _WHOLE, wanted, _NOT_RECORDED))


# ---------------------------------------------------------------------- a recording


def keeps_step(recording: Recording) -> bool:
    """Whether a recording looks like lockstep: each output has every tick of its inputs once."""
    odom = recording.series.get('odom')
    if odom is None or np.mean(odom.stamps_ns % TICK_NS == 0) < 0.5:
        return False
    outputs = [recording.series[n] for n in ('tracking_error', 'wrench') if n in recording.series]
    repeated = sum(int(np.count_nonzero(np.diff(one.stamps_ns) == 0)) for one in outputs)
    return repeated <= 1


def skipped(block: str, reason: str) -> Verdict:
    """Verdict on a block that cannot be compared."""
    return Verdict(block, SKIPPED, reason, 0, {}, {}, None, [])


def _reason_to_skip(wired: Wired, settings, recording: Recording, lockstep: bool) -> str:
    if settings is None:
        return 'the settings say nothing about it'
    missing = [name for name in wired.inputs if name not in recording.series]
    if missing:
        return f'its input {" and ".join(missing)} is not recorded'
    if not any(name in recording.series for name in wired.outputs):
        return f'none of {", ".join(wired.outputs)} is recorded'
    if not lockstep and wired in (wiring.PLANT, wiring.CURRENT):
        return 'free-running: which inputs it had at a tick is not on record'
    return ''


def verify(
    recording: Recording,
    told: Told,
    only: list[str],
    progress: Callable[[str, float], None],
) -> Iterator[Verdict]:
    """Compare every block of a recording.

    Parameters
    ----------
    recording : Recording
    told : Told
        What the nodes were told.
    only : list of str
        Blocks to compare; empty: all of them.
    progress : callable
        Called now and then with the name of a block and the share that is done, 0 to 1.

    Yields
    ------
    Verdict
        For each block, in the order in which they act in a tick.
    """
    lockstep = keeps_step(recording) if told.lockstep is None else told.lockstep
    for block in BLOCKS:
        name = block.wired.name
        if only and name not in only:
            continue
        settings = told.blocks[name]
        reason = _reason_to_skip(block.wired, settings, recording, lockstep)
        if reason:
            yield skipped(name, reason)
            continue
        work = _in_lockstep if lockstep else _free_running
        recorded = RecordedBlock(block, settings)
        yield work(recorded, recording, lambda share, name=name: progress(name, share))


def report(bag: Bag, recording: Recording, told: Told, verdicts: list[Verdict]) -> dict:
    """Verdicts as one JSON object, with hints for whoever looks for a cause."""
    lockstep = keeps_step(recording) if told.lockstep is None else told.lockstep
    compared = [verdict for verdict in verdicts if verdict.status != SKIPPED]
    notes = [note for note in (bag.cut, told.note) if note]
    if not compared:
        notes.append('nothing could be compared')
    if not lockstep:
        notes.append(
            'recorded free-running: a message that was lost, or a node that was started before '
            'the recording, looks like a difference'
        )
    return {
        'identical': bool(compared) and all(one.status == IDENTICAL for one in compared),
        'settings': told.source,
        'lockstep': lockstep,
        'namespace': recording.namespace,
        'blocks': [_block_report(one, verdicts, recording) for one in verdicts],
        'notes': notes,
        'ignored_topics': recording.ignored,
    }


def _block_report(one: Verdict, verdicts: list[Verdict], recording: Recording) -> dict:
    first = one.first
    return {
        'block': one.block,
        'result': one.status,
        'reason': one.reason,
        'ticks': one.ticks,
        'compared': one.compared,
        'differing': one.differing,
        'first': first and {'tick': first.tick, 't_s': first.stamp_ns / 1e9, **first._asdict()},
        'notes': one.notes + (_hints(one, verdicts, recording) if first else []),
    }


def _hints(one: Verdict, verdicts: list[Verdict], recording: Recording) -> list[str]:
    """What else may have led to the first difference of a block."""
    hints = []
    (wired,) = [wired for wired in WIRING if wired.name == one.block]
    for other in verdicts:
        source = other.first
        if source and source.topic in wired.inputs and source.stamp_ns <= one.first.stamp_ns:
            hints.append(
                f'its input {source.topic} differs at {_time(source.stamp_ns)} from what '
                f'{other.block} computes: if the recording is damaged there, this is why'
            )
    told = [event for event in recording.events if event.node == recording.node(wired.node)]
    aborted = any(event.values.get('stage') == STAGE_NAMES[SURFACING] for event in told)
    if aborted and not any(event.message == ABORT for event in told):
        hints.append('an abort is not on record: older versions did not record the call itself')
    return hints
