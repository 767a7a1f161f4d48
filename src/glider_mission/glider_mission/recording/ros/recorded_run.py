# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""A bag in memory: the numbers of its per-tick topics, its events, and the path."""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from diagnostic_msgs.msg import DiagnosticArray
from rclpy.serialization import deserialize_message

from glider_base.ros.lockstep import health
from glider_base.ros.wire.codec import Codec, to_cdr
from glider_base.ros.wire.topics import topic_of
from glider_base.settings import ConfigurationError
from glider_mission.recording.mcap_reader import Bag
from glider_mission.recording.ros.recorded_log import decode, known_topics, namespaces

#: Messages of foreign layout whose bytes are kept, for each topic.
_KEPT = 1000


class Series:
    """All messages of one per-tick topic, in the order of their log times.

    Once it is closed it has ``stamps_ns`` int64[n], ``values`` float64[n, m], and ``own`` bool[n]:
    whether stamp and numbers are the whole message, byte by byte.
    """

    def __init__(self, codec: Codec) -> None:
        self.codec = codec
        self.raw: dict[int, bytes] = {}  #: messages that are not, by index; the first thousand
        self.unusable: dict[int, str] = {}  #: why a node would refuse a message, by index
        self._blocks: list[tuple[np.ndarray, np.ndarray, np.ndarray]] = []
        self._count = 0

    def add(self, batch, chosen: np.ndarray) -> None:
        """Take messages of a batch."""
        decoded = decode(self.codec, batch, chosen)
        for row in np.flatnonzero(~decoded.own)[: max(0, _KEPT - len(self.raw))]:
            self.raw[self._count + int(row)] = batch.payload(chosen[row])
        for row, why in decoded.unusable.items():
            self.unusable[self._count + row] = why
        self._blocks.append(decoded[:3])
        self._count += len(chosen)

    def close(self) -> None:
        """Make the arrays."""
        self.stamps_ns, self.values, self.own = (
            np.concatenate(arrays) for arrays in zip(*self._blocks, strict=True)
        )
        self._blocks.clear()

    def __len__(self) -> int:
        return self._count

    def without_repeats(self) -> 'Series':
        """The same without messages that only say the one before them again."""
        stamps_ns, bits = self.stamps_ns, self.values.view(np.int64)
        again = (stamps_ns[1:] == stamps_ns[:-1]) & np.all(bits[1:] == bits[:-1], axis=1)
        kept = np.flatnonzero(~np.append(False, again & self.own[1:] & self.own[:-1]))
        places = {int(place): i for i, place in enumerate(kept)}
        one = Series(self.codec)
        one._count = len(kept)
        one.stamps_ns, one.values, one.own = stamps_ns[kept], self.values[kept], self.own[kept]
        one.raw = {places[i]: raw for i, raw in self.raw.items()}
        one.unusable = {places[i]: why for i, why in self.unusable.items() if i in places}
        return one

    def payload(self, index: int) -> bytes:
        """Bytes of a message; empty if they were not kept."""
        if self.own[index]:
            return self.codec.encode(int(self.stamps_ns[index]), self.values[index])
        return self.raw.get(index, b'')


class Event(NamedTuple):
    """A message on /diagnostics."""

    stamp_ns: int
    node: str  #: name of its first status; '' if it cannot be read
    message: str
    values: dict[str, str]
    raw: bytes


class Recording:
    """A bag in memory.

    The namespace of the nodes may be left out if there is only one. ``progress`` is called now and
    then with the share that is read, 0 to 1. ``steers_by`` names the vehicle's steering surface,
    and is empty without. Raises ConfigurationError if the bag holds no topic of ours or those of
    several namespaces, or is damaged.
    """

    def __init__(
        self,
        bag: Bag,
        namespace: str | None,
        progress: Callable[[float], None],
        steers_by: str = '',
    ) -> None:
        self.namespace = choose_namespace(bag, namespace)
        known = known_topics(self.namespace)
        self.series: dict[str, Series] = {}
        self.paths: list[bytes] = []
        self.events: list[Event] = []
        self.recorded = set()  #: names of topics that are there, with or without messages
        self.ignored: list[str] = []  #: topics that are not ours, or of another type
        sinks: dict[int, Callable] = {}
        for index, recorded in enumerate(bag.topics):
            topic = known.get(recorded.name)
            if topic is None or recorded.type_name != topic.type_name:
                self.ignored.append(f'{recorded.name} ({recorded.type_name})')
                continue
            self.recorded.add(topic.name)
            if topic.per_tick:
                self.series[topic.name] = Series(topic_of(topic.name, steers_by).codec)
                sinks[index] = self.series[topic.name].add
            elif topic.name == 'path':
                sinks[index] = lambda batch, chosen: self.paths.extend(map(batch.payload, chosen))
            elif topic.name == '/diagnostics':
                sinks[index] = self._add_events
        for batch in bag.batches():
            for index, take in sinks.items():
                chosen = np.flatnonzero(batch.topic == index)
                if len(chosen):
                    take(batch, chosen)
            progress((batch.log_ns[-1] - bag.start_ns) / max(1, bag.end_ns - bag.start_ns))
        self.series = {name: series for name, series in self.series.items() if len(series)}
        for series in self.series.values():
            series.close()

    def node(self, name: str) -> str:
        """Full name of a node, as it stands on /diagnostics, or of a topic."""
        return f'{self.namespace.rstrip("/")}/{name}'

    def _add_events(self, batch, chosen) -> None:
        for index in chosen:
            raw = batch.payload(index)
            try:
                array = deserialize_message(raw, DiagnosticArray)
                status = array.status[0]
            except Exception:  # damaged, or without a status
                self.events.append(Event(int(batch.log_ns[index]), '', '', {}, raw))
                continue
            values = {pair.key: pair.value for pair in status.values}
            stamp_ns, said = health.stamp_of(array), to_cdr(array)
            if raw == said + bytes(-len(said) % 4):  # the middleware sends whole words
                raw = said
            self.events.append(Event(stamp_ns, status.name, status.message, values, raw))


def choose_namespace(bag: Bag, given: str | None) -> str:
    """Namespace of the nodes in a bag, ``'/'`` for the root."""
    found = namespaces(bag)
    named = ', '.join(found)
    if given is not None:
        wanted = '/' + given.strip('/')
        if wanted not in found:
            raise ConfigurationError(
                f'--namespace {given}: nothing of it is in {bag.files[0]} '
                f'(allowed: {named or "none, it has no topic of these nodes"})'
            )
        return wanted
    if not found:
        topics = ', '.join(topic.name for topic in bag.topics) or 'none'
        cut = f'; {bag.cut}' if bag.cut else ''
        raise ConfigurationError(
            f'{bag.files[0]}: no topic of these nodes is recorded (recorded: {topics}){cut}'
        )
    if len(found) > 1:
        raise ConfigurationError(
            f'{bag.files[0]}: several namespaces are recorded: give --namespace (allowed: {named})'
        )
    return found[0]
