# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""One block at work on recorded inputs: where it differs from what is recorded, byte by byte."""

import struct
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from typing import NamedTuple

import numpy as np
from diagnostic_msgs.msg import DiagnosticArray
from rclpy.serialization import deserialize_message

from glider_base import wiring
from glider_base.block import Telling
from glider_base.ros.lockstep import health
from glider_base.ros.lockstep.health import ABORT, CLEAR, PARAMETERS_SET, SURFACE
from glider_base.ros.parameters import with_parameters
from glider_base.ros.wire.codec import cdr_places, to_cdr
from glider_base.settings import ConfigurationError
from glider_base.signals import TICK_NS
from glider_guidance.nodes.guidance_node import PATH_POINTS, path_message
from glider_mission.recording.recorded_inputs import RecordedBlock
from glider_mission.recording.ros.recorded_run import Recording, Series
from glider_model.plant.block import PLANT

#: Orders that change what a block does.
ORDERS = (ABORT, CLEAR, PARAMETERS_SET, SURFACE)
#: Bytes in which an event may differ from what is expected, and still be taken for it.
_BYTES_ALIKE = 16
#: Ticks at the end that may lack in a topic: whoever recorded it left in the middle of one.
TICKS_OF_THE_END = 10

IDENTICAL, DIFFERENT, SKIPPED = 'identical', 'different', 'skipped'

#: What stands where there is no field, and no message.
WHOLE, MISSING = '(message)', 'not recorded'


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
    result: str  #: IDENTICAL, DIFFERENT or SKIPPED
    reason: str = ''  #: why it was skipped
    ticks: int = 0  #: that were computed
    compared: Mapping[str, int] = {}  #: messages by topic
    differing: Mapping[str, int] = {}  #: those of them that differ, by topic
    first: Difference | None = None
    notes: Sequence[str] = ()


def begun_before(block: str, name: str, series: Series) -> Verdict:
    """Verdict on a block that had taken steps before an input of it is on record."""
    since = health.seconds(int(series.stamps_ns[0]))
    why = f'{name} is recorded from {since} on, not from its first step'
    return Verdict(block, SKIPPED, f'its state is not known: {why}')


class Track:
    """Which message of a topic belongs to each step of a block; -1 where there is none."""

    def __init__(self, series: Series, index: np.ndarray) -> None:
        self.series, self.index = series, index
        present = np.flatnonzero(index >= 0)
        self.end = int(present[-1]) + 1 if len(present) else 0  #: after the last step it has
        unusable = np.isin(index, list(series.unusable))
        gaps = np.flatnonzero((index < 0) | unusable)
        #: first step without a message that a node could use
        self.gap = int(gaps[0]) if len(gaps) else len(index)


#: The track of a topic, and the messages that have no place in it.
Place = Callable[[Series], tuple[Track, list[int]]]


class Check:
    """One block at work, and what has been found so far."""

    def __init__(self, block: RecordedBlock, recording: Recording, stamps_ns: np.ndarray) -> None:
        self.block, self.recording, self.stamps_ns = block, recording, stamps_ns
        self.found: list[Difference] = []
        self.compared: Counter[str] = Counter()
        self.differing: Counter[str] = Counter()
        self.notes: list[str] = []
        self.flags = np.zeros((len(stamps_ns), len(block.block.flags)), np.int64)
        self.passed = np.ones(len(stamps_ns), np.int64)  #: ticks that pass in a step
        self.ticks = 0
        self.heard = len(stamps_ns)  #: steps after which it may have ended before it reported
        #: paths that guidance followed, one after the other, and from when (ns)
        self.paths = [(block.settings.path, 0)] if block.block.wired == wiring.GUIDANCE else []
        node = recording.node(block.block.wired.node)
        asked = [e for e in recording.events if e.node == node and e.message in ORDERS]
        if np.all(np.diff(stamps_ns) >= 0):  # else a clock was set back: as they came
            asked.sort(key=lambda event: event.stamp_ns)
        #: given in flight, each with the step before which it was followed
        self._orders, step = [], 0
        for order in asked:
            left_ns = stamps_ns[step:]
            at = [*np.flatnonzero(left_ns == order.stamp_ns)[:1]]
            at += [*np.flatnonzero(left_ns >= order.stamp_ns)[:1], len(left_ns)]
            step += int(at[0])
            self._orders.append((step, order))

    def add(self, difference: Difference) -> None:
        """Keep a difference."""
        self.differing[difference.topic] += 1
        self.found.append(difference)

    def add_whole(self, at_ns: int, topic: str, computed: str, recorded: str = MISSING) -> None:
        """Keep that a message is recorded or computed that is not the other."""
        self.add(Difference(int(at_ns), topic, WHOLE, computed, recorded))

    def tracks(self, place: Place, why: str) -> dict[str, Track]:
        """Tracks of the outputs that are recorded; ``why`` tells of what has no place."""
        tracks = {}
        for name in self.block.outputs:
            series = self.recording.series.get(name)
            if series is None:
                self.notes.append(f'{name} is not recorded')
                continue
            tracks[name], left = place(series)
            for i in left:
                text = f'message {i} of the topic, {why}'
                self.add_whole(series.stamps_ns[i], name, text, 'not computed')
        return tracks

    # .................................................................. steps

    def cuts(self, count: int) -> list[int]:
        """Steps before which an order changes the block."""
        return sorted({step for step, _ in self._orders if step < count})

    def follow_orders(self, step: int) -> None:
        """Do what was asked of the block before a step."""
        while self._orders and self._orders[0][0] <= step:
            _, order = self._orders.pop(0)
            if order.message in (ABORT, SURFACE):
                self.block.surface()
                continue
            if order.message == CLEAR:
                self.block.clear()
                continue
            try:
                settings = with_parameters(self.block.settings, order.values)
                if self.paths and settings.path != self.paths[-1][0]:
                    self.paths.append((settings.path, order.stamp_ns))
                self.block.tune(settings)
            except ConfigurationError as error:
                self.notes.append(f'parameters set at {health.seconds(order.stamp_ns)}: {error}')

    def run(self, start: int, end: int, rows: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
        """Outputs of the steps from start to end; rows are the messages of the inputs."""
        series = self.recording.series
        inputs = {name: series[name].values[index] for name, index in rows.items()}
        computed, self.flags[start:end] = self.block.run(
            self.stamps_ns[start:end], inputs, self.passed[start:end]
        )
        self.ticks = end
        return computed

    def differs(self, track: Track, start: int, values: np.ndarray) -> np.ndarray:
        """Which of the steps from ``start`` on have another message than computed; bool[n]."""
        index = track.index[start : start + len(values)]
        series = track.series
        recorded = series.values[index]
        same = np.all(recorded.view(np.int64) == values.view(np.int64), axis=1)
        stamps_ns = self.stamps_ns[start : start + len(values)]
        same &= (series.stamps_ns[index] == stamps_ns) & series.own[index]
        return ~same & (index >= 0)

    def compare(self, name: str, track: Track, start: int, values: np.ndarray) -> None:
        """Compare the outputs on one topic, for the steps from ``start`` on."""
        index = track.index[start : start + len(values)]
        self.compared[name] += int(np.count_nonzero(index >= 0))
        found = np.flatnonzero(self.differs(track, start, values))
        self.differing[name] += len(found)
        if len(found):
            row = int(found[0])
            raw = track.series.payload(int(index[row]))
            stamp_ns = int(self.stamps_ns[start + row])
            codec = track.series.codec
            expected = deserialize_message(codec.encode(stamp_ns, values[row]), codec.message_type)
            self.found.append(Difference(stamp_ns, name, *field_difference(expected, raw)))
        for row in np.flatnonzero(index < 0):
            if start + row < track.end or track.end + TICKS_OF_THE_END < len(track.index):
                self.add_whole(self.stamps_ns[start + row], name, 'a message')

    # .................................................................. events, path, verdict

    def compare_paths(self) -> None:
        """Compare the paths that guidance published: that of its settings, and those ordered."""
        if 'path' not in self.recording.recorded:
            self.notes.append('path is not recorded')
            return
        paths = [path_message(path.points(PATH_POINTS), at_ns) for path, at_ns in self.paths]
        expected = [to_cdr(path) for path in paths]
        stamp_ns = int(self.stamps_ns[0])
        self.compared['path'] += len(self.recording.paths)
        for recorded in self.recording.paths:
            if recorded not in expected:
                self.add(Difference(stamp_ns, 'path', *field_difference(paths[0], recorded)))
        for raw in expected:
            if raw not in self.recording.paths:
                self.add_whole(stamp_ns, 'path', 'a message')

    def compare_events(self, expected: list[DiagnosticArray], is_ours) -> None:
        """Compare the events that the block tells with those on record."""
        if '/diagnostics' not in self.recording.recorded:
            self.notes.append('/diagnostics is not recorded')
            return
        end_ns = int(self.stamps_ns[self.ticks - 1])
        made = [(array, to_cdr(array)) for array in expected]
        recorded = [(event, event.raw) for event in self.recording.events]
        missing = _unmatched(made, recorded)
        self.compared['/diagnostics'] += len(made) - len(missing)
        rest = [event for event, _ in _unmatched(recorded, made)]
        for array, raw in missing:
            at_ns = health.stamp_of(array)
            alike = (e for e in rest if len(e.raw) == len(raw) and _alike(e.raw, raw))
            if event := next(alike, None):
                rest.remove(event)
                found = field_difference(array, event.raw)
                self.add(Difference(at_ns, '/diagnostics', *found))
                self.compared['/diagnostics'] += 1
            elif np.searchsorted(self.stamps_ns, at_ns) < self.heard:
                self.add_whole(at_ns, '/diagnostics', repr(array.status[0].message))
        for event in rest:
            if is_ours(event) and event.stamp_ns <= end_ns:
                said = repr(event.message)
                self.add_whole(event.stamp_ns, '/diagnostics', said, 'not computed')

    def finish_events(self) -> None:
        """Compare what the block tells on /diagnostics, and the path."""
        stamps_ns, flags = self.stamps_ns[: self.ticks], self.flags[: self.ticks]
        block = self.block.block
        node = self.recording.node(block.wired.node)
        if block.wired == wiring.GUIDANCE:
            self.compare_paths()
        if block.say:
            ticks = Telling(block, int(stamps_ns[0])).among(flags, stamps_ns)
            said = ((int(stamps_ns[i]), block.say(*flags[i].tolist())) for i in ticks)
            arrays = [health.said_array(stamp_ns, node, one) for stamp_ns, one in said]
            keys = {block.flags[0], health.EVENT}
            self.compare_events(arrays, lambda e: e.node == node and keys <= e.values.keys())
        elif block is PLANT:
            ends = map(int, stamps_ns[flags[:, 0] > 0])
            reports = (health.Report(node, health.FINISHED, health.COMPLETE, at) for at in ends)
            arrays = [health.report_array(one) for one in reports]
            self.compare_events(arrays, lambda e: e.node == node and e.message == health.COMPLETE)

    def verdict(self) -> Verdict:
        """What came out."""
        first = min(self.found, key=lambda one: one.stamp_ns, default=None)
        return Verdict(
            block=self.block.block.wired.name,
            result=DIFFERENT if first else IDENTICAL,
            ticks=self.ticks,
            compared=dict(self.compared),
            differing={name: n for name, n in self.differing.items() if n},
            first=first,
            notes=self.notes,
        )


def _unmatched(pairs: list[tuple], others: list[tuple]) -> list[tuple]:
    """Those of some things with their bytes that none of the others has, one for one."""
    left, unmatched = Counter(raw for _, raw in others), []
    for thing, raw in pairs:
        if not left[raw]:
            unmatched.append((thing, raw))
        left[raw] -= bool(left[raw])
    return unmatched


def _alike(one: bytes, other: bytes) -> bool:
    return sum(a != b for a, b in zip(one, other, strict=True)) <= _BYTES_ALIKE


def field_difference(expected, recorded: bytes) -> tuple[str, str, str]:
    """First field in which any bytes differ from a message, and what is computed and recorded.

    With the bits where two numbers print alike.
    """
    raw = to_cdr(expected)
    shared = min(len(raw), len(recorded))
    at = next((i for i in range(shared) if raw[i] != recorded[i]), shared)
    if at < 4:
        return 'CDR header', raw[:4].hex(), recorded[:4].hex()
    if at >= len(raw):
        return WHOLE, f'{len(raw)} bytes', f'{len(recorded)} bytes'
    before = 'CDR header'
    for place in cdr_places(expected):
        if at < place.start:
            break
        before = place.path
        if at < place.end:
            texts = [_value(place, data) for data in (raw, recorded)]
            if texts[0] == texts[1]:
                bits = [data[place.start : place.end][::-1].hex() for data in (raw, recorded)]
                texts = [f'{text} (0x{bit})' for text, bit in zip(texts, bits, strict=True)]
            return place.path, *texts
    return f'padding after {before}', f'byte {raw[at]:#04x}', f'byte {recorded[at]:#04x}'


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
