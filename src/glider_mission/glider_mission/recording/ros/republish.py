# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""Publishes a recording again: the same bytes, on the same topics, in the same order."""

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any, NamedTuple

import numpy as np
import rclpy
from rclpy.duration import Duration
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, HistoryPolicy, QoSProfile, ReliabilityPolicy
from rclpy.signals import SignalHandlerOptions
from rclpy.time import Time

from glider_base.files import parse_yaml
from glider_base.ros.lockstep import health
from glider_base.ros.lockstep.clock import MAX_TICKS_AHEAD
from glider_base.ros.lockstep.executor import take
from glider_base.ros.lockstep.node import COUNT_TICKS
from glider_base.ros.places import NAMESPACE_ALLOWED, QUIET, absolute_namespace, given_domain
from glider_base.ros.wire import topics
from glider_base.ros.wire.codec import to_cdr
from glider_base.ros.wire.topics import TOPICS, message_class
from glider_base.settings import ConfigurationError
from glider_base.signals import TICK_NS
from glider_base.wiring import present
from glider_mission.recording.mcap_reader import Bag, BagTopic, Batch
from glider_mission.recording.ros.recorded_log import namespaces

#: Sleeps and waits are cut into pieces of this length (s), so that Ctrl-C is noticed.
_PATIENCE_S = 0.1
#: Nothing longer is replayed (s).
MAX_DURATION_S = 1e8
#: Depth of a publisher where the recording does not say.
_DEPTH = 1024

#: Called now and then with the recorded time that has passed since the start (s).
Progress = Callable[[float], None]


class Plan(NamedTuple):
    """What is to be replayed."""

    bag: Bag
    names: dict[int, str]  #: names to publish under, by index into the topics of the bag
    namespace: str  #: of the nodes, as published
    start_ns: int  #: log times (ns) from and to which messages are published
    end_ns: int
    asked: frozenset[str]  #: names of the topics that were asked for; /clock may come unasked

    def has(self, batch: Batch) -> np.ndarray:
        """Which messages of a batch are published."""
        inside = (batch.log_ns >= self.start_ns) & (batch.log_ns <= self.end_ns)
        return inside & np.isin(batch.topic, list(self.names))

    def says(self, index: int) -> bool:
        """Whether a topic has a message that is published."""
        return any(np.any(batch.topic[self.has(batch)] == index) for batch in self.bag.batches())


# ---------------------------------------------------------------------- what to replay


def plan_replay(
    bag: Bag, topics: list[str], start_s: float, duration_s: float | None, namespace: str | None
) -> Plan:
    """Check what is asked for: part of a recording, from its beginning (s).

    ``topics`` are recorded names, or names in the namespace of the nodes; empty: all of them. The
    topics of the nodes go to ``namespace``, if it is given, instead of the recorded one. A
    ConfigurationError names the option, and what is recorded; also if nothing is to be published.
    """
    found = namespaces(bag)
    if namespace is not None and len(found) != 1:
        raise ConfigurationError(
            f'--namespace {namespace}: takes the place of one namespace, and {bag.files[0]} has '
            f'{", ".join(found) or "none of these nodes"}'
        )
    recorded = found[0] if len(found) == 1 else '/'  # to be replayed as it is
    names = [topic.name for topic in bag.topics]
    asked = [_find_topic(names, name, recorded) for name in topics] or names
    wanted = {*asked, '/clock'}.intersection(names)
    length_s = (bag.end_ns - bag.start_ns) / 1e9
    if start_s > length_s:
        raise ConfigurationError(
            f'--start {start_s:g}: beyond the end (allowed: 0 to {length_s:.1f}, the length of '
            f'the recording in s)'
        )
    if duration_s is not None and duration_s > MAX_DURATION_S:
        raise ConfigurationError(
            f'--duration {duration_s:g}: not usable (allowed: 0 to {MAX_DURATION_S:g} s)'
        )
    start_ns = bag.start_ns + round(start_s * 1e9)
    end_ns = bag.end_ns if duration_s is None else start_ns + round(duration_s * 1e9)
    published = recorded if namespace is None else absolute_namespace(namespace)
    if published is None:
        raise ConfigurationError(
            f'--namespace {namespace}: not usable (allowed: {NAMESPACE_ALLOWED})'
        )
    ours = {f'{recorded.rstrip("/")}/clock': f'{published.rstrip("/")}/clock'}
    ours |= {one.full_name(recorded): one.full_name(published) for one in TOPICS.values()}
    renamed = {name: ours.get(name, name) for name in wanted}
    plan = Plan(
        bag=bag,
        names={index: renamed[name] for index, name in enumerate(names) if name in wanted},
        namespace=published,
        start_ns=start_ns,
        end_ns=end_ns,
        asked=frozenset(renamed[name] for name in asked),
    )
    if not any(plan.has(batch).any() for batch in bag.batches()):
        begin_s, end_s = ((at - bag.start_ns) / 1e9 for at in (start_ns, end_ns))
        raise ConfigurationError(
            f'nothing to replay: no message on {", ".join(plan.names.values()) or "any topic"} '
            f'from {begin_s:.1f} s to {end_s:.1f} s of the recording'
        )
    for index in [i for i, name in plan.names.items() if name == '/clock' and not plan.says(i)]:
        del plan.names[index]  # as of free-running nodes
    return plan


def _find_topic(names: list[str], name: str, namespace: str) -> str:
    """Recorded name of a topic that is given by it, or as in the namespace of the nodes."""
    for candidate in (name, f'{namespace.rstrip("/")}/{name}'):
        if candidate in names:
            return candidate
    raise ConfigurationError(
        f'--topics {name}: not recorded (recorded: {", ".join(sorted(names)) or "nothing"})'
    )


def qos_of(topic: BagTopic) -> QoSProfile:
    """Quality of service to publish a topic with: the strongest that was recorded.

    Version 9 of rosbag2 writes policies as words, older ones as numbers.
    """
    try:
        profiles = parse_yaml(topic.qos, topic.name) or [{}]
        found = [_profile(profile) for profile in profiles]
    except (TypeError, AttributeError, ValueError, KeyError) as error:
        raise ConfigurationError(
            f'{topic.name}: quality of service not readable: {error!r}'
        ) from None
    depths, reliabilities, durabilities = zip(*found, strict=True)
    return QoSProfile(
        history=HistoryPolicy.KEEP_LAST,
        depth=max(depths),
        reliability=min(reliabilities),
        durability=min(durabilities),
    )


def _profile(profile: dict) -> tuple[int, ReliabilityPolicy, DurabilityPolicy]:
    def policy(name: str, unknown):
        """What is printed, of the kind of that which is taken where nothing known is."""
        kind, value = type(unknown), profile.get(name, 0)
        if isinstance(value, int):
            return kind(value) if value in (1, 2) else unknown
        return kind.__members__.get(value.upper(), unknown)

    keeps_all = policy('history', HistoryPolicy.KEEP_LAST) is HistoryPolicy.KEEP_ALL
    return (
        _DEPTH if keeps_all else int(profile.get('depth') or _DEPTH),
        policy('reliability', ReliabilityPolicy.RELIABLE),
        policy('durability', DurabilityPolicy.VOLATILE),
    )


# ---------------------------------------------------------------------- replaying


class _Output:
    """A publisher that never has more on the way than it keeps."""

    def __init__(self, node: Node, name: str, topic: BagTopic) -> None:
        self.name, self.qos = name, qos_of(topic)
        try:
            kind = message_class(topic.type_name)
        except (ImportError, AttributeError, ValueError):
            raise ConfigurationError(
                f'{topic.name}: its type {topic.type_name!r} is not installed here; choose others '
                f'with --topics'
            ) from None
        self.publisher = node.create_publisher(kind, name, self.qos)
        self.count = 0
        self._on_the_way = 0

    def publish(self, raw: bytes) -> None:
        """Publish a message, once there is room for it."""
        if self._on_the_way >= max(1, self.qos.depth // 2):
            self.wait()
        self.publisher.publish(raw)
        self.count += 1
        self._on_the_way += 1

    def wait(self) -> None:
        """Wait until every subscriber has what was published."""
        if self.qos.reliability is ReliabilityPolicy.RELIABLE:
            _wait_for_acks(self.publisher)
        self._on_the_way = 0


def _wait_for_acks(publisher) -> None:
    """Wait until every subscriber has what was published; Ctrl-C is noticed."""
    while not publisher.wait_for_all_acked(Duration(seconds=_PATIENCE_S)):
        pass


class _Brake:
    """Keeps a replay from running away from a recorder in lockstep, as a plant does."""

    def __init__(self, node: Node, plan: Plan) -> None:
        topic = TOPICS['recorded']
        needed = present((topic.name for topic in TOPICS.values() if topic.per_tick), ())
        names = {TOPICS[name].full_name(plan.namespace) for name in needed}
        self._whole = names <= set(plan.names.values())
        self._node, self._word = node, topic.full_name(plan.namespace)
        self._subscription = node.create_subscription(
            topic.message_type, self._word, lambda message: None, topic.qos
        )
        self._recorded_ns: int | None = None

    def wait(self, log_ns: int) -> None:
        """Wait until the recorder is not too far behind."""
        if self._recorded_ns is None:
            self._recorded_ns = log_ns
        while self._whole and log_ns - self._recorded_ns > MAX_TICKS_AHEAD['recorded'] * TICK_NS:
            message = take(self._subscription)
            if message is not None:
                self._recorded_ns = Time.from_msg(message.stamp).nanoseconds
            elif self._node.count_publishers(self._word) > 0:  # a recorder in lockstep listens
                time.sleep(0.001)
            else:
                self._recorded_ns = log_ns


class _Count:
    """Tells a recorder in lockstep how many events there were, as the nodes do by themselves."""

    def __init__(self, node: Node, namespace: str) -> None:
        topic = TOPICS['told']
        self.publisher = node.create_publisher(
            topic.message_type, topic.full_name(namespace), topic.qos
        )
        self._name = node.get_fully_qualified_name()
        self._events, self._newest_ns, self._reported_ns = 0, -TICK_NS, -TICK_NS

    def add(self, log_ns: int, name: str) -> None:
        """Count a message of a topic; the count is published now and then, when a tick is over."""
        since_ns = abs(self._newest_ns - self._reported_ns)
        if log_ns != self._newest_ns and since_ns >= COUNT_TICKS * TICK_NS:
            self.tell()
        self._newest_ns = log_ns
        self._events += name == '/diagnostics'

    def tell(self) -> None:
        """Say how many events there were up to what was published last."""
        self._reported_ns = self._newest_ns
        tally = health.EventCount(self._name, self._events, self._newest_ns)
        self.publisher.publish(to_cdr(health.count_array(tally)))


@contextmanager
def replay(plan: Plan, rate: float) -> Iterator['Replay']:
    """Node that replays a plan; it is gone when the context ends."""
    given_domain()
    rclpy.init(args=['--ros-args', QUIET], signal_handler_options=SignalHandlerOptions.NO)
    try:
        node = Node(
            topics.REPLAY,
            namespace=plan.namespace,
            enable_rosout=False,
            start_parameter_services=False,
        )
        try:
            yield Replay(node, plan, rate)
        finally:
            node.destroy_node()
    finally:
        rclpy.shutdown()


class Replay:
    """Publishers for what is to be replayed.

    The rate is times real time; infinite: as fast as subscribers take it.
    """

    def __init__(self, node: Node, plan: Plan, rate: float) -> None:
        self._plan, self._rate = plan, rate
        self._outputs = {
            index: _Output(node, name, plan.bag.topics[index])
            for index, name in plan.names.items()
        }
        clock, has_clock = TOPICS['/clock'], '/clock' in plan.names.values()
        # published by the log times of a recording that has none
        self._own_clock = (
            None if has_clock else node.create_publisher(clock.message_type, clock.name, clock.qos)
        )
        self._count = _Count(node, plan.namespace)
        self._brake = _Brake(node, plan)

    def wait_for(self, count: int, say: Callable[[str], None]) -> None:
        """Wait until every topic that was asked for has that many subscribers."""
        asked, said = [one for one in self._outputs.values() if one.name in self._plan.asked], []
        while missing := [
            one.name for one in asked if one.publisher.get_subscription_count() < count
        ]:
            if missing != said:
                said = missing
                say(f'waiting for {count} subscribers of {", ".join(missing)}')
            time.sleep(0.02)

    def run(self, progress: Progress) -> dict[str, Any]:
        """Publish everything once; returns the ``counts`` of messages by topic, and ``wall_s``."""
        began_s = time.monotonic()
        clock_ns = -TICK_NS
        span_s = (self._plan.end_ns - self._plan.start_ns) / 1e9
        shown_s = 0.0
        for log_ns, index, raw in recorded_messages(self._plan):
            passed_s = (log_ns - self._plan.start_ns) / 1e9
            due_s = began_s + passed_s / self._rate
            while (left_s := due_s - time.monotonic()) > 0.0:
                time.sleep(min(left_s, _PATIENCE_S))
                progress(passed_s - max(0.0, due_s - time.monotonic()) * self._rate)
            self._brake.wait(log_ns)
            self._count.add(log_ns, self._plan.names[index])
            if self._own_clock is not None and log_ns - clock_ns >= TICK_NS:
                clock_ns = log_ns
                self._own_clock.publish(TOPICS['/clock'].codec.encode(log_ns, ()))
            self._outputs[index].publish(raw)
            now_s = time.monotonic()
            if now_s - shown_s > _PATIENCE_S:
                shown_s = now_s
                progress(passed_s)
        self._count.tell()
        for output in self._outputs.values():
            output.wait()
        _wait_for_acks(self._count.publisher)
        progress(span_s)
        counts = {output.name: output.count for output in self._outputs.values()}
        return {'counts': counts, 'wall_s': time.monotonic() - began_s}


def recorded_messages(plan: Plan) -> Iterator[tuple[int, int, bytes]]:
    """Log time, topic and payload of the messages to publish.

    Those that a latched topic held at the start come first, under the time of the start.
    """
    held: dict[int, list[bytes]] = {}
    profiles = {index: qos_of(plan.bag.topics[index]) for index in plan.names}
    latched = [
        index
        for index, profile in profiles.items()
        if profile.durability is DurabilityPolicy.TRANSIENT_LOCAL
    ]
    for batch in plan.bag.batches():
        if batch.log_ns[0] > plan.end_ns:
            break
        for i in np.flatnonzero((batch.log_ns < plan.start_ns) & np.isin(batch.topic, latched)):
            index = int(batch.topic[i])
            kept = held.setdefault(index, [])
            kept.append(batch.payload(i))
            del kept[: -profiles[index].depth]
        for i in np.flatnonzero(plan.has(batch)):
            for index, kept in held.items():
                yield from ((plan.start_ns, index, raw) for raw in kept)
            held = {}
            yield int(batch.log_ns[i]), int(batch.topic[i]), batch.payload(i)
