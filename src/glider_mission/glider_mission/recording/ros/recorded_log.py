# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""Bags to log rows: what lets one function score and draw every kind of run."""

from collections import Counter
from collections.abc import Callable, Iterable, Iterator
from typing import NamedTuple, Protocol

import numpy as np
from diagnostic_msgs.msg import DiagnosticArray
from rclpy.serialization import deserialize_message

from glider_base.ros.lockstep import health
from glider_base.ros.wire.codec import Codec
from glider_base.ros.wire.topics import TOPICS, Topic, topic_of
from glider_base.settings import ConfigurationError
from glider_base.signals import TICK_NS
from glider_base.wiring import ESTIMATES, SENSORS, WHEN_SILENT
from glider_guidance.yo.stage import STAGE_NAMES
from glider_mission.blocks import BLOCK_TICKS, COLUMNS, ROW
from glider_mission.recording.mcap_reader import Bag, Batch
from glider_model.vehicle.file import load_vehicle

_PER_TICK = [topic for topic in TOPICS.values() if topic.per_tick]

#: Topics that the score is computed from. Bags from the sea lack the first, as nobody knows it.
SCORED = ('ground_truth/odom', 'odom', 'joint_states', 'reference', 'tracking_error')


def namespaces(bag: Bag) -> list[str]:
    """Namespaces of the nodes in a bag, ``'/'`` for the root.

    Those that have a `reference`, as others may have an `odom` of theirs, if there are any.
    """
    found: dict[str, set[str]] = {}
    for topic in bag.topics:
        ours = next((one for one in TOPICS.values() if topic.name.endswith(f'/{one.name}')), None)
        if ours and topic.type_name == ours.type_name:
            found.setdefault(topic.name.removesuffix(f'/{ours.name}') or '/', set()).add(ours.name)
    return sorted([place for place in found if 'reference' in found[place]] or found)


def known_topics(namespace: str) -> dict[str, Topic]:
    """Topics by the names that they have where the nodes are in a namespace."""
    known = {topic.full_name(namespace): topic for topic in TOPICS.values()}
    # several gliders have a clock each
    return known | {f'{namespace.rstrip("/")}/clock': TOPICS['/clock']}


def _mask(text: str) -> float:
    """Sum of bits; 0 for what is none."""
    return float(int(text)) if text.isdecimal() and len(text) < 10 else 0.0


#: Columns of a row that events on /diagnostics tell, by their keys, and how they are read. NaN is
#: a stage that this version does not know.
_FLAGS = {
    'infeasible': lambda text: float(text == 'true'),
    'no_progress': _mask,
    'stage': lambda text: float(STAGE_NAMES.index(text)) if text in STAGE_NAMES else np.nan,
    'saturation': _mask,
    'guard': _mask,
}


class Decoded(NamedTuple):
    """Messages of one per-tick topic as numbers."""

    stamps_ns: np.ndarray  #: int64[n], -1 where there is none
    values: np.ndarray  #: float64[n, m], NaN where there is none
    own: np.ndarray  #: bool[n]: stamp and numbers are the whole message, byte by byte
    unusable: dict[int, str]  #: why a node would refuse a message, by row


def decode(codec: Codec, batch: Batch, chosen: np.ndarray) -> Decoded:
    """Messages of a batch, given by their indices, as a node would take them."""
    count = len(chosen)
    stamps, own = np.full(count, -1), np.zeros(count, bool)
    values, unusable = np.full((count, codec.width), np.nan), {}
    regular = np.flatnonzero(batch.size[chosen] == codec.size)
    if len(regular):
        stamps[regular], values[regular], own[regular] = codec.decode_many(
            batch.rows(chosen[regular])
        )
    for row in np.flatnonzero(~own):
        try:
            stamps[row], values[row] = codec.decode(batch.payload(chosen[row]))
        except Exception as error:  # the middleware has no class for bytes that are no message
            unusable[int(row)] = str(error).partition('\n')[0]
    for row in np.flatnonzero(own & ~np.all(np.isfinite(values), axis=1)):
        field = codec.fields[int(np.flatnonzero(~np.isfinite(values[row]))[0])]
        unusable[int(row)] = f'{field} is not finite'
    return Decoded(stamps, values, own, unusable)


class RecordedLog:
    """A bag as the log rows that the direct engine would have given, and what else it tells.

    Topics that are ``also`` read beside `SCORED` are NaN in ticks that lack them, the columns of
    all others in every tick. ``steers_by`` names the vehicle's steering surface; empty without.
    What it counts and the end are known when all `blocks` are taken. Raises ConfigurationError if
    the bag holds several gliders.
    """

    def __init__(self, bag: Bag, also: Iterable[str] = (), steers_by: str = '') -> None:
        self._bag = bag
        self.ticks = 0  #: rows given so far
        self.counts: Counter[str] = Counter()  #: messages by topic
        self.end: health.Report | None = None  #: what the plant said about the end of the run
        found = namespaces(bag)
        if len(found) > 1:
            raise ConfigurationError(
                f'{bag.files[0]}: several gliders are recorded: {", ".join(found)}; a bag of one '
                'is needed'
            )
        (self._namespace,) = found or '/'
        #: that no event of these nodes is there, in words
        self.untold = f'nothing on /diagnostics is of {self._namespace}: nobody knows how it ended'
        known = known_topics(self._namespace)
        #: Our names of what is recorded, and those of others, by index.
        self._topics = [getattr(known.get(one.name), 'name', one.name) for one in bag.topics]
        self._names = (*SCORED, *also)
        self._codecs = {name: topic_of(name, steers_by).codec for name in self._names}
        #: Tick, column and new value, in the order in which they came.
        self._flags: list[tuple[int, str, float]] = []
        self._unusable: dict[tuple[str, int], str] = {}
        self.lacks = ''  #: or what the first tick lacks that is not whole, in words
        self._log = np.empty((2 * BLOCK_TICKS, ROW))
        self._begun = 0  #: rows in use: NaN but for what was put there
        self._start, self._over = 0, False

    def blocks(self) -> Iterator[np.ndarray]:
        """Rows of consecutive ticks, until the first tick that lacks one of `SCORED`.

        They are float64[n, ROW], valid until the next are asked for. A `ConfigurationError` says
        where the bag is damaged.
        """
        for batch in self._bag.batches():
            found = {}
            for index in np.unique(batch.topic):
                name, chosen = self._topics[index], np.flatnonzero(batch.topic == index)
                self.counts[name] += len(chosen)
                if name == '/diagnostics':
                    self._hear(batch, chosen)
                elif name in self._codecs and not self._over:
                    found[name] = decode(self._codecs[name], batch, chosen)
            yield from self._put(found)
        while not self._over:
            yield from self._shift()

    @property
    def _needed(self) -> tuple[str, ...]:
        """Of `SCORED`, those that every tick has to have."""
        return SCORED if self.counts['ground_truth/odom'] else SCORED[1:]

    def _hear(self, batch: Batch, chosen: np.ndarray) -> None:
        """Note what events say about the flags of a row, and about the end of the run."""
        for index in chosen:
            try:
                array = deserialize_message(batch.payload(index), DiagnosticArray)
            except Exception:  # the middleware has no class for bytes that are no message
                continue
            if not health.concerns(array, self._namespace):
                continue
            self.untold = ''
            self.end = self.end or health.end_of_run(array)
            tick = health.stamp_of(array) // TICK_NS
            for status in array.status:
                values = {pair.key: pair.value for pair in status.values}
                if health.EVENT not in values:  # a recorder from outside keeps repeats, too
                    continue
                if 'stage' in values:  # and nothing else that has to be said each time
                    values.setdefault('no_progress', '0')
                self._flags += [
                    (tick, key, _FLAGS[key](value))
                    for key, value in values.items()
                    if key in _FLAGS
                ]

    def _begin(self, rows: int) -> None:
        """Have at least so many rows begun."""
        if rows > self._begun:
            self._log[self._begun : rows] = np.nan
            self._begun = rows

    def _put(self, found: dict[str, Decoded]) -> Iterator[np.ndarray]:
        """Put messages into their rows; gives the rows that are far behind."""
        while found and not self._over:
            later = {}
            for name, (stamps_ns, values, own, unusable) in found.items():
                ticks = stamps_ns // TICK_NS - self._start
                usable = ticks >= 0
                for row, why in unusable.items():
                    self._unusable.setdefault((name, int(stamps_ns[row]) // TICK_NS), why)
                    usable[row] = False
                now = usable & (ticks < len(self._log))
                self._begin(1 + int(ticks[now].max(initial=-1)))
                self._log[ticks[now], COLUMNS[name]] = values[now]
                if len(rest := np.flatnonzero(usable & ~now)):
                    later[name] = Decoded(stamps_ns[rest], values[rest], own[rest], {})
            # a stamp that leads far ahead is damaged, unless the others have come so far
            found = later if later.keys() & {*SCORED} else {}
            if found:  # a recorder from outside keeps no strict order
                yield from self._shift()

    def _shift(self) -> Iterator[np.ndarray]:
        """The first block up to a tick that lacks something; then the second takes its place."""
        self._begin(min(self._begun + 1, BLOCK_TICKS))
        block = self._log[: min(self._begun, BLOCK_TICKS)]
        numbers = block[:, [COLUMNS[name].start for name in self._needed]]
        missing = np.flatnonzero(np.any(np.isnan(numbers), axis=1))
        rows = int(missing[0]) if len(missing) else BLOCK_TICKS
        if len(missing):
            tick, name = self._start + rows, self._needed[np.argmax(np.isnan(numbers[rows]))]
            why = self._unusable.get((name, tick), 'not recorded')
            self.lacks = f'tick {tick:,} (t = {tick * TICK_NS / 1e9:.1f} s) lacks {name}: {why}'
            self._over = True
        block[:, [COLUMNS[name] for name in _FLAGS if name != 'stage']] = 0.0
        for tick, column, value in self._flags:
            block[max(0, tick - self._start) :, COLUMNS[column]] = value
        self.ticks += rows
        yield block[:rows]
        self._begun = max(0, self._begun - BLOCK_TICKS)
        self._log[: self._begun] = self._log[BLOCK_TICKS:][: self._begun]
        self._start += BLOCK_TICKS

    def missing(self, ticks: int | None) -> str:
        """What lacks of a run, in words; empty if nothing does.

        Where nobody knows how many ticks were flown, what the plant said in the bag counts; of a
        run that was cut short the last two may not be whole, as in `lost`.
        """
        unsure = 0
        if ticks is None and self.end:
            ticks = self.end.stamp_ns // TICK_NS + 1
            unsure = 0 if self.end.phase == health.FINISHED else 2
        lacking = [self._bag.cut] if self._bag.cut else []
        if ticks is not None and self.ticks < ticks - unsure:
            lacking.append(f'{self.ticks:,} of {ticks:,} ticks are there')
            lacking += [] if self._bag.cut else [self.lacks]
        return '; '.join(lacking)

    def lost(self, complete: bool) -> int:
        """Number of per-tick messages that ought to be recorded but are not.

        A run that was cut short (``complete`` is false) may lack messages of its last two ticks,
        which is not a loss: a node that ended within a tick may have let the others begin the
        next one.
        """
        unsure = 0 if complete else 2
        return sum(max(0, less - unsure) for less in self.lacking().values())

    def lacking(self) -> dict[str, int]:
        """Messages that per-tick topics have less than the one that has most, by topic."""
        counts = self.recorded()
        ticks = max(counts.values())
        return {name: ticks - count for name, count in counts.items() if count < ticks}

    def recorded(self) -> dict[str, int]:
        """Messages of every topic that ought to have one per tick, by topic."""
        left_out = {*SENSORS, *ESTIMATES, *WHEN_SILENT}.difference(self._topics)
        if not self.counts['ground_truth/odom']:
            left_out |= {'ground_truth/odom'}
        names = (topic.name for topic in _PER_TICK if topic.name not in left_out)
        return {name: self.counts[name] for name in names}


class Reader(Protocol):
    """A sink that also says what it needs, so that no more is read from a bag."""

    topics: tuple[str, ...]  #: that it needs, beside those of the score

    def add(self, log: np.ndarray) -> None:
        """Take in the next rows, float64[n, ROW]; they are valid until the next are read."""


def read_back(
    bag: Bag,
    vehicle: str,
    sinks: Iterable[Reader],
    progress: Callable[[int], None] = lambda ticks: None,
) -> RecordedLog:
    """Give the rows of a bag of a vehicle to sinks; ``progress`` gets the ticks read.

    A `ConfigurationError` says where the bag is damaged.
    """
    sinks = tuple(sinks)
    also = {topic for sink in sinks for topic in sink.topics}
    log = RecordedLog(bag, also, load_vehicle(vehicle).steers_by)
    for rows in log.blocks():
        for sink in sinks:
            sink.add(rows)
        progress(log.ticks)
    return log
