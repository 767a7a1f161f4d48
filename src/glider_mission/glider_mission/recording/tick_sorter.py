# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""Brings messages that arrive topic by topic into the order of a recording: tick by tick."""

import math
from collections import deque
from collections.abc import Callable, Container, Iterable

#: A stamp so far (ns) from that of other topics is by another clock.
_OTHER_CLOCK_NS = 3600 * 10**9


class TickSorter:
    """Holds messages back until their tick is complete, then hands them on in a fixed order.

    Two recordings of one run thereby have the same bytes, whatever the order of arrival was.
    Topics are the per-tick ones in the order in which a tick is written, by calls of ``write``
    with (topic, stamp_ns, payload). Those of ``followers`` may be stamped by another clock.
    """

    def __init__(
        self,
        topics: Iterable[str],
        period_ns: int,
        write: Callable[[str, int, bytes], None],
        followers: Container[str] = (),
    ) -> None:
        self._queues: dict[str, deque[tuple[int, bytes]]] = {name: deque() for name in topics}
        self._followers = followers
        self._clock_ns: int | None = None  #: stamp that came last of any other topic
        self._first_ns = 0
        self._newest_ns: dict[str, int] = {}
        self._events: list[tuple[int, str, bytes]] = []
        self._period_ns = period_ns
        self._write = write
        self.written_ns = -period_ns  #: stamp of the newest tick that was handed on
        self.lost = 0  #: messages whose stamps were skipped

    def add(self, topic: str, stamp_ns: int, payload: bytes) -> None:
        """Take a message of a per-tick topic.

        What a free-running guard commands before it hears of the vehicle is stamped by another
        clock: it waits for the first message that is not, and is recorded with that.
        """
        begins = not self._newest_ns
        if topic not in self._followers:
            begins, self._clock_ns = not self.begun, stamp_ns
        elif self.begun and abs(stamp_ns - self._clock_ns) > _OTHER_CLOCK_NS:
            stamp_ns = self._clock_ns
        if begins:  # all topics with the same tick
            self._first_ns = stamp_ns
            self._newest_ns = dict.fromkeys(self._queues, stamp_ns - self._period_ns)
            for name, early in self._queues.items():
                self._queues[name] = deque((stamp_ns, payload) for _, payload in early)
        due_ns = self._newest_ns[topic] + self._period_ns
        self.lost += max(0, (stamp_ns - due_ns) // self._period_ns)
        self._newest_ns[topic] = stamp_ns
        self._queues[topic].append((stamp_ns, payload))

    @property
    def heard_ns(self) -> int:
        """Stamp of the newest tick of which every per-tick message has come."""
        return min(self._newest_ns.values(), default=-self._period_ns)

    def add_event(self, topic: str, stamp_ns: int, payload: bytes) -> None:
        """Take a message that belongs to a tick, but does not come with every tick.

        One with a stamp outside of the run, as that of anybody may be, is recorded with the first
        tick, or with the one that is due.
        """
        self._events.append((stamp_ns, topic, payload))

    def write_complete(self, end_tick: Callable[[int], bool], until_ns: float = math.inf) -> bool:
        """Hand on every tick that is complete, with its events; whether anything went to disk.

        ``end_tick`` is called with the stamp after each, and says whether it is on disk. After
        ``until_ns`` events may be under way.
        """
        on_disk = False
        while all(self._queues.values()) and self._next_ns() <= until_ns:
            self._write_tick()
            on_disk = end_tick(self.written_ns) or on_disk
        return on_disk

    @property
    def begun(self) -> bool:
        """Whether it is known what time it is."""
        return self._clock_ns is not None

    def write_rest(self) -> None:
        """Hand on everything, also of ticks that are not complete."""
        while any(self._queues.values()):
            self._write_tick()
        self._write_events()

    def _next_ns(self) -> int:
        return min(queue[0][0] for queue in self._queues.values() if queue)

    def _write_tick(self) -> None:
        stamp_ns = self._next_ns()
        for topic, queue in self._queues.items():
            while queue and queue[0][0] == stamp_ns:
                self._write(topic, stamp_ns, queue.popleft()[1])
        self.written_ns = max(self.written_ns, stamp_ns)  # free-running, an answer may be late
        if self._events:
            self._write_events(stamp_ns)

    def _write_events(self, until_ns: float = math.inf) -> None:
        due_ns = max(self._newest_ns.values(), default=-self._period_ns) + self._period_ns
        for stamp_ns, topic, payload in sorted(self._events):
            if stamp_ns <= until_ns:
                self._write(topic, max(self._first_ns, min(stamp_ns, due_ns)), payload)
        self._events = [event for event in self._events if event[0] > until_ns]
