# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""How nodes march in step.

The header stamp is the identity of a tick. In lockstep a node acts on a tick once every input
carries that tick's stamp, so there is no timer in the loop, nothing drifts, and a run gives the
same result every time. Free-running nodes act at 10 Hz on the newest inputs and watch their age.
"""

import gc
import os
import signal
import time
from collections.abc import Callable
from pathlib import Path
from uuid import uuid4

import rclpy
from pydantic import Field
from rclpy.clock import Clock, ClockType
from rclpy.event_handler import PublisherEventCallbacks, SubscriptionEventCallbacks
from rclpy.executors import ExternalShutdownException
from rclpy.node import Node

from glider_model.base.exits import EXIT_PEER, EXIT_USAGE, say_fatal
from glider_model.base.settings import ConfigurationError, Settings
from glider_model.base.signals import TICK_NS, TICK_S, not_finite
from glider_model.ros.lockstep import health
from glider_model.ros.lockstep.executor import Gate, make_executor, take_with_info
from glider_model.ros.lockstep.health import Report
from glider_model.ros.parameters import declare_settings, refuse_unknown
from glider_model.ros.wire import qos
from glider_model.ros.wire import topics as messages
from glider_model.ros.wire.codec import MessageError, NotFiniteError, to_cdr
from glider_model.ros.wire.topics import TOPICS, Topic

#: The plant is never more than this many ticks ahead of what the recorder has on disk.
MAX_TICKS_AHEAD = 256

#: Messages that may be lost on their way without their publisher being taken for another.
MOST_LOST = 50

#: A node waits this long (wall time, s) for the recorder and its peers at the end of a run.
FAREWELL_S = 5.0

#: Middleware forgets messages of a node that is gone: leave them this time (s) to arrive, and to
#: be sent again if need be.
_LINGER_S = 0.3
#: Where Fast DDS looks for its settings, and ours.
_FASTDDS, _PROFILES = 'FASTRTPS_DEFAULT_PROFILES_FILE', Path(__file__).with_name('fastdds.xml')

#: What to do about a second glider.
ALONE = 'each glider in a ROS domain needs a namespace and a clock of its own'
_STARTUP_PERIOD_S = 0.03
#: Who starts a node by hand is told what it waits for, after this time and then this often (s).
_PATIENCE_S, _REMIND_S = 10.0, 20.0
_REPORT_AFTER = 0.4
_COUNTED = ('lost', 'late')
_TELL_EVERY_S = 10.0
#: A topic whose messages are refused is told of at most so often (s of wall time).
_REFUSED_EVERY_S = 1.0
_QUIET_PUBLISHER = PublisherEventCallbacks(use_default_callbacks=False)
_QUIET_SUBSCRIPTION = SubscriptionEventCallbacks(use_default_callbacks=False)


class Stop(Exception):  # noqa: N818
    """Ends the node with an exit code; any code but 0 comes with a message for the person."""

    def __init__(self, code: int, message: str = '') -> None:
        super().__init__(message)
        self.code = code


class TickSettings(Settings):
    """How a node keeps step; the same parameters for every node."""

    lockstep: bool = Field(
        True, description='act on ticks in step with the peers; else on the newest input at 10 Hz'
    )
    record: bool = Field(False, description='a recorder takes part: wait for it, never outrun it')
    startup_timeout_s: float = Field(
        60.0, ge=0.1, le=3600.0, description='wall time that peers have to get ready (s)'
    )
    tick_timeout_s: float = Field(
        5.0, ge=0.1, le=3600.0, description='wall time in which a tick has to be complete (s)'
    )
    input_max_age_s: float = Field(
        1.0, ge=0.05, le=3600.0, description='free-running: older input counts as stale (s)'
    )


class Input:
    """A subscription, and what it brought last."""

    def __init__(self, topic: Topic) -> None:
        self.topic = topic
        self.subscription = None
        self.stamp_ns = -1
        self.values: tuple[float, ...] = ()
        self.arrived_s = -float('inf')  #: on the clock of the cycles
        self.number = 0  #: that the publisher gave the last message; 0: none yet
        self.owner = ''  #: full name of the publisher; '' as long as it is not sure
        self.refused = 0  #: messages of other publishers, and such as cannot be used
        self.lost = 0  #: messages that lack between those that came
        self.late = 0  #: cycles that had to do with the input of the one before
        self.used_ns = -1

    def accept(self, raw: bytes) -> None:
        """Keep a message.

        Raises
        ------
        MessageError
            Naming topic and publisher, if it cannot be used.
        """
        try:
            self.stamp_ns, self.values = self.topic.codec.decode(raw, check_frames=True)
        except MessageError as error:
            said = f'{self.topic.name} of {self.topic.publisher}: {error}'
            raise type(error)(said) from None

    def is_from_another(self, info: dict) -> bool:
        """Whether a message comes from another publisher than those before.

        Publishers number their messages, so that in a line of numbers with two publishers that of
        the first goes on and that of the second does not. Not every middleware tells the numbers:
        then nobody is taken for another.

        Parameters
        ----------
        info : dict
            What rclpy tells of the message.
        """
        number = info.get('publication_sequence_number') or 0
        step = number - self.number
        goes_on = step == 1 or not (number and self.number)
        if goes_on or self.subscription.get_publisher_count() <= 1 or 1 < step <= MOST_LOST:
            self.number = number
            return False
        return True


class TickNode(Node):
    """A node that takes part in the lockstep: readiness, reports, end of the run.

    Subclasses add inputs and outputs in their constructor and call `start_up` at its end.
    """

    #: Settings class of the parameters that concern ticks.
    tick_settings = TickSettings

    def __init__(self, name: str, **kwargs) -> None:
        super().__init__(name, **kwargs)
        self.ticks = declare_settings(self, self.tick_settings)
        self.steady_clock = Clock(clock_type=ClockType.STEADY_TIME)
        is_simulated = self.get_parameter('use_sim_time').value
        self.cycle_clock = self.get_clock() if is_simulated else self.steady_clock
        self.gate = Gate()
        self.inputs: list[Input] = []
        self.outputs: dict[str, tuple[Topic, object]] = {}
        self.process = uuid4().hex
        self.reports: dict[str, Report] = {}
        events, reports = TOPICS['/diagnostics'], TOPICS['lockstep']
        self._events, self._reports = self._publisher(events), self._publisher(reports)
        self.outputs[events.name] = (events, self._events)
        self._reports_in = self._subscription(reports, self._on_reports, raw=False)
        self.gate.awaited.add(self._reports_in)
        self._awaited = None
        self._due_ns: int | None = None
        self._refused_s: dict[str, float] = {}
        self._watched_ns: int | None = None
        self._watched_since_s = 0.0
        self._startup_timer = None
        self._said = ''
        self._created_s = time.monotonic()
        self.running = False
        self.over_since_s: float | None = None

    # ------------------------------------------------------------------ inputs and outputs

    def _publisher(self, topic: Topic):
        return self.create_publisher(
            topic.message_type, topic.name, topic.qos, event_callbacks=_QUIET_PUBLISHER
        )

    def _subscription(self, topic: Topic, callback, *, raw=True, gated=True, profile=None):
        return self.create_subscription(
            topic.message_type,
            topic.name,
            callback,
            profile or topic.qos,
            callback_group=self.gate if gated else None,
            event_callbacks=_QUIET_SUBSCRIPTION,
            raw=raw,
        )

    def add_output(self, name: str) -> Callable[..., None]:
        """Publisher of a topic, as a function of (stamp_ns, numbers) for per-tick topics."""
        topic = TOPICS[name]
        publisher = self._publisher(topic)
        self.outputs[name] = (topic, publisher)
        if not topic.per_tick:
            return lambda message: publisher.publish(to_cdr(message))
        encode, publish = topic.codec.encode, publisher.publish
        return lambda stamp_ns, values=(): publish(encode(stamp_ns, values))

    def add_input(self, name: str) -> Input:
        """Subscribe to a per-tick topic. Add the one that comes last in a tick first."""
        item = Input(TOPICS[name])
        if self.ticks.lockstep:
            item.subscription = self._subscription(
                item.topic, lambda raw, info: self._on_message(item, raw, info)
            )
            if not self.inputs:
                self._await(item)
        else:
            item.subscription = self._subscription(
                item.topic,
                lambda raw, info: self._on_newest(item, raw, info),
                gated=False,
                profile=qos.NEWEST,
            )
        self.inputs.append(item)
        return item

    def event(self, stamp_ns: int, level: bytes, message: str, **values) -> None:
        """Put an event of the flight on /diagnostics, and in the log if it is an error."""
        if level == health.ERROR:
            self.get_logger().error(message)
        name = self.get_fully_qualified_name()
        self.publish_event(health.status_array(stamp_ns, name, level, message, values))

    def publish_event(self, array) -> None:
        """Put a DiagnosticArray on /diagnostics."""
        self._events.publish(to_cdr(array))

    def report(self, phase: str, message: str = '', **fields) -> None:
        """Tell the peers how this node is, and everybody if it is not well."""
        report = Report(self.get_name(), phase, message, **fields)
        if report.level != health.OK:
            named = report._replace(node=self.get_fully_qualified_name())
            self.publish_event(health.report_array(named))
        self._reports.publish(to_cdr(health.report_array(report._replace(process=self.process))))

    def _on_reports(self, array) -> None:
        """Keep the newest report of every node; once in step, of those it is in step with."""
        for report in health.reports_in(array):
            known = self.reports.get(report.node, report)
            if self.running and self.ticks.lockstep and report.process != known.process:
                continue
            self.reports[report.node] = report
            self.on_report(report)

    def on_report(self, report: Report) -> None:
        """React to the report of a node: say goodbye when the plant ends the run."""
        if report.node == messages.PLANT and report.phase == health.FAILED:
            raise Stop(0)
        if report.node == messages.PLANT and report.phase == health.FINISHED:
            self.over_since_s = time.monotonic()
            self.report(health.FINISHED, stamp_ns=report.stamp_ns)
        if self.over_since_s is not None and self.may_leave():
            raise Stop(0)

    def close(self) -> None:
        """Last act before the node is destroyed, whatever ended it; may raise `Stop`."""

    def may_leave(self) -> bool:
        """Whether nobody needs this node any more once the run is over."""
        recorder = self.reports.get(messages.RECORDER)
        recorded = recorder is not None and recorder.phase == health.FINISHED
        return recorded or not self.ticks.record

    def wall_timer(self, period_s: float, callback):
        """Timer on the steady clock, whatever use_sim_time says."""
        return self.create_timer(period_s, callback, clock=self.steady_clock)

    # ------------------------------------------------------------------ start

    def start_up(self) -> None:
        """Start looking for the peers."""
        self.report(health.STARTING, 'looking for its peers')
        self._startup_timer = self.wall_timer(_STARTUP_PERIOD_S, self._on_startup)

    def _peers_among(self, endpoints) -> set[str]:
        """Names of the nodes of this namespace that have some of these endpoints."""
        own = self.get_namespace()
        return {info.node_name for info in endpoints if info.node_namespace == own}

    def publisher_names(self, topic: Topic) -> list[str]:
        """Full names of the nodes that publish a topic, as often as they do."""
        infos = self.get_publishers_info_by_topic(topic.name)
        return [f'{info.node_namespace.rstrip("/")}/{info.node_name}' for info in infos]

    def rivals(self) -> list[str]:
        """Who else publishes what only this node may publish, in words."""
        rivals = []
        for topic, _ in self.outputs.values():
            if topic.publisher != self.get_name():
                continue
            names = self.publisher_names(topic)
            if self.get_fully_qualified_name() in names:
                names.remove(self.get_fully_qualified_name())
            rivals += [
                f'{self.resolve_topic_name(topic.name)} is published by {name} too'
                for name in names
            ]
        return rivals

    def unmatched(self) -> list[str]:
        """What is missing between this node and its peers, in words; empty if all is matched."""
        missing = self.rivals()
        for topic, publisher in self.outputs.values():
            readers = list(topic.readers) if self.ticks.lockstep else []
            if self.ticks.record and topic.recorded and self.get_name() != messages.RECORDER:
                readers.append(messages.RECORDER)
            if not readers:
                continue
            names = self._peers_among(self.get_subscriptions_info_by_topic(topic.name))
            absent = [reader for reader in readers if reader not in names]
            missing += [f'{reader} does not subscribe to {topic.name}' for reader in absent]
            if not absent and publisher.get_subscription_count() < len(readers):
                missing.append(f'{topic.name} is not connected to {" and ".join(readers)}')
        for item in self.inputs:
            infos = self.get_publishers_info_by_topic(item.topic.name)
            if item.topic.publisher not in self._peers_among(infos):
                missing.append(f'{item.topic.publisher} does not publish {item.topic.name}')
            elif item.subscription.get_publisher_count() < 1:
                missing.append(f'{item.topic.name} of {item.topic.publisher} is not connected')
        return missing

    def _on_startup(self) -> None:
        missing = self.unmatched() if self.ticks.lockstep else []
        if missing:
            if self._said != missing[0]:
                self._said = missing[0]
                self.report(health.STARTING, missing[0])
            if time.monotonic() - self._created_s > _PATIENCE_S:
                self.get_logger().warning(
                    f'waits for its peers: {"; ".join(missing)}', throttle_duration_sec=_REMIND_S
                )
            return
        self.destroy_timer(self._startup_timer)
        self.running = True
        self._watched_since_s = time.monotonic()
        self.report(health.READY)
        self.wall_timer(min(0.5, 0.1 * self.ticks.tick_timeout_s), self.watch)
        self.on_ready()

    def on_ready(self) -> None:
        """Peers are matched; free-running nodes start their timer here."""

    # ------------------------------------------------------------------ lockstep

    def step(self, stamp_ns: int, *inputs: tuple[float, ...]) -> None:
        """Act on one tick. ``inputs`` are the numbers of the inputs in the order they were added.

        Subclasses implement it.
        """
        raise NotImplementedError

    def _on_message(self, item: Input, raw: bytes, info: dict) -> None:
        if self.running:  # else it comes from somebody else's run
            self._accept(item, raw, info)
            self._fire()

    def _accept(self, item: Input, raw: bytes, info: dict) -> None:
        if item.is_from_another(info):
            self.refuse(item, self._others(item))
            return
        try:
            item.accept(raw)
        except NotFiniteError as error:
            tick = max(0, self._due_ns or 0) // TICK_NS
            raise Stop(EXIT_PEER, not_finite(f'{error}: that', tick)) from None
        except MessageError as error:
            self.refuse(item, str(error))
            return
        if self._due_ns is None and item.stamp_ns > 0:
            # of a run that is under way: one's own begins with tick 0
            item.stamp_ns, item.number = -1, 0

    def refuse(self, item: Input, why: str) -> None:
        """Tell that a message was refused, the first one at once and then now and then."""
        item.refused += 1
        now_s = time.monotonic()
        if now_s - self._refused_s.get(item.topic.name, -float('inf')) < _REFUSED_EVERY_S:
            return
        self._refused_s[item.topic.name] = now_s
        stamp_ns = max(0, self._due_ns if self._due_ns is not None else item.stamp_ns)
        values = {f'{item.topic.name}_refused': item.refused}
        self.event(stamp_ns, health.ERROR, f'message refused: {why}', **values)

    def _others(self, item: Input) -> str:
        """Who else publishes an input, in words."""
        owner = item.owner
        if self.ticks.lockstep:
            owner = f'{self.get_namespace().rstrip("/")}/{item.topic.publisher}'
        names = set(self.publisher_names(item.topic)) - {owner}
        others = ' and '.join(sorted(names)) or 'a second publisher'
        return f'{self.resolve_topic_name(item.topic.name)} is published by {others} too'

    def _fire(self) -> None:
        """Act on every tick that is complete, then wait for the input that is missing."""
        while self.over_since_s is None:
            for item in self.inputs:
                if not self._has(item):
                    self._await(item)
                    return
            self.step(self._due_ns, *[item.values for item in self.inputs])
            self._due_ns += TICK_NS

    def _await(self, item: Input) -> None:
        if self._awaited is not item.subscription:
            self.gate.replace(self._awaited, item.subscription)
            self._awaited = item.subscription

    def _has(self, item: Input) -> bool:
        """Whether an input carries the stamp of the tick that is due."""
        while self._due_ns is None or item.stamp_ns < self._due_ns:
            if self._due_ns is None and item.stamp_ns >= 0:
                self._due_ns = item.stamp_ns
                continue
            taken = take_with_info(item.subscription)
            if taken is None:
                return False
            self._accept(item, *taken)
        if item.stamp_ns > self._due_ns:
            if rivals := self.rivals():
                raise Stop(EXIT_PEER, f'{rivals[0]}; {ALONE}')
            raise Stop(
                EXIT_PEER,
                f'{item.topic.publisher} skipped a tick: {item.topic.name} came for '
                f'{seconds(item.stamp_ns)} when {seconds(self._due_ns)} was due',
            )
        return True

    # ------------------------------------------------------------------ watching

    def stuck_s(self) -> float:
        """Wall time (s) for which the tick that is due has not changed."""
        now = time.monotonic()
        if self._watched_ns != self._due_ns:
            self._watched_ns, self._watched_since_s = self._due_ns, now
        return now - self._watched_since_s

    def watch(self) -> None:
        """Look after the run every now and then."""
        if self.over_since_s is not None:
            if time.monotonic() - self.over_since_s > FAREWELL_S:
                raise Stop(0)
        elif self.ticks.lockstep:
            self.watch_tick()

    def watch_tick(self) -> None:
        """Tell the peers if this node waits for one of them; the plant ends the run."""
        if self._due_ns is not None:
            self._report_wait()

    def _report_wait(self) -> None:
        if self.stuck_s() < _REPORT_AFTER * self.ticks.tick_timeout_s:
            return
        self._watched_since_s = float('inf')
        missing = [item for item in self.inputs if not self._has(item)]
        if not missing:
            self._fire()
            return
        idle = len(missing) == len(self.inputs)
        topics = {item.topic.publisher: item.topic.name for item in missing}
        peer = messages.PLANT if idle and messages.PLANT in topics else missing[0].topic.publisher
        self.report(
            health.WAITING,
            f'waits for {topics[peer]} of {peer} at {seconds(self._due_ns)}',
            stamp_ns=self._due_ns,
            peer=peer,
            topic=topics[peer],
            level=health.OK if idle else health.WARN,
        )

    # ------------------------------------------------------------------ free-running

    def now_s(self) -> float:
        """Time (s) on the clock of the free-running cycles."""
        return self.cycle_clock.now().nanoseconds / 1e9

    def _on_newest(self, item: Input, raw: bytes, info: dict) -> None:
        """Keep an input in free-running mode.

        A stamp that stands still does not refresh it, and a message that was overtaken on its way
        is passed over. One that is older than any input may be means that the clock of the vehicle
        has been set back.
        """
        if item.is_from_another(info):
            self.refuse(item, self._others(item))
            return
        before = item.stamp_ns
        try:
            since_ns = item.topic.codec.decode_stamp(raw) - before
            if before >= 0 and -self.ticks.input_max_age_s * 1e9 <= since_ns < 0:
                return
            item.accept(raw)
        except MessageError as error:
            self.refuse(item, str(error))
            return
        if not item.owner:
            names = set(self.publisher_names(item.topic))
            item.owner = names.pop() if len(names) == 1 else ''
        if since_ns:
            item.arrived_s = self.now_s()
        if before >= 0 and since_ns <= self.ticks.input_max_age_s * 1e9:
            item.lost += max(0, round(since_ns / TICK_NS) - 1)


class BlockNode(TickNode):
    """Guidance, control, current: a step per tick, and the free-running timer around it."""

    #: What the node does while an input is stale.
    when_stale = 'silent until then'

    def __init__(self, name: str, **kwargs) -> None:
        super().__init__(name, **kwargs)
        self._stale: list[str] = []
        self._told = (0, 0)
        self._tell_s = -float('inf')

    def on_ready(self) -> None:
        """Start the timer of the free-running mode, on simulated time if that is used."""
        if not self.ticks.lockstep:
            self.create_timer(TICK_S, self._on_cycle, clock=self.cycle_clock)

    def _on_cycle(self) -> None:
        self._count()
        oldest = self.now_s() - self.ticks.input_max_age_s
        stale = [item.topic.name for item in self.inputs if item.arrived_s < oldest]
        stamp_ns = max(item.stamp_ns for item in self.inputs)
        if stamp_ns < 0:
            stamp_ns = self.get_clock().now().nanoseconds
        if stale != self._stale:
            self._stale = stale
            if stale:
                said = f'missing or stale: {", ".join(stale)}; {self.when_stale}'
                self.event(stamp_ns, health.ERROR, said)
            else:
                self.event(stamp_ns, health.OK, 'inputs are fresh again')
        if stale:
            self.on_stale(stamp_ns)
        else:
            self.step(stamp_ns, *[item.values for item in self.inputs])

    def _count(self) -> None:
        """Count what came late, and tell now and then what was lost or late."""
        for item in self.inputs:
            item.late += item.stamp_ns == item.used_ns >= 0
            item.used_ns = item.stamp_ns
        lost, late = (sum(getattr(item, kind) for item in self.inputs) for kind in _COUNTED)
        if (lost, late) == self._told or self.now_s() < self._tell_s:
            return
        level = health.WARN if lost > self._told[0] else health.OK
        self._told, self._tell_s = (lost, late), self.now_s() + _TELL_EVERY_S
        counts = {
            f'{item.topic.name}_{kind}': getattr(item, kind)
            for item in self.inputs
            for kind in _COUNTED
        }
        stamp_ns = max(item.stamp_ns for item in self.inputs)
        self.event(stamp_ns, level, f'inputs: {lost} lost, {late} late', **counts)

    def on_stale(self, stamp_ns: int) -> None:
        """Act in free-running mode while an input is stale; nothing by default."""


def seconds(stamp_ns: int) -> str:
    """Simulated time, for a message."""
    return f't = {stamp_ns / 1e9:.1f} s'


def run(node_type: Callable[[], TickNode], args=None) -> int:
    """Life of a node process: init, node, spin, clean end.

    Returns
    -------
    int
        Exit code: 0 at the end of the run and for SIGINT and SIGTERM, 1 for a full disk, 2 for a
        bad parameter, 3 for a peer that is missing, late or wrong.
    """
    os.environ.setdefault(_FASTDDS, str(_PROFILES))
    if signal.getsignal(signal.SIGINT) is signal.default_int_handler:
        signal.signal(signal.SIGINT, _leave_to_rclpy)
    try:
        rclpy.init(args=args)
    except Exception as error:
        return _say(Stop(EXIT_USAGE, f'bad command line: {error}'))
    node, stop = None, Stop(0)
    try:
        node = node_type()
        refuse_unknown(node)
        gc.freeze()  # compilers and libraries, which stay: else every full collection visits them
        with make_executor() as executor:
            executor.add_node(node)
            executor.spin()
    except ExternalShutdownException:
        pass
    except Stop as reason:
        stop = reason
    except ConfigurationError as error:
        stop = Stop(EXIT_USAGE, str(error))
    except Exception:
        if rclpy.ok():
            raise
    finally:
        signal.signal(signal.SIGINT, signal.SIG_IGN)
        signal.signal(signal.SIGTERM, signal.SIG_IGN)
        if node is not None:
            try:
                node.close()
            except Stop as reason:
                stop = stop if stop.code else reason
            time.sleep(_LINGER_S)
            node.destroy_node()
        rclpy.try_shutdown()
    return _say(stop)


def _leave_to_rclpy(number, frame) -> None:
    """Let rclpy, which hears SIGINT too, end the node at its next turn, as it does for SIGTERM.

    A KeyboardInterrupt may come while numba makes the tuples that a step returns, and numba goes
    on without them: a segmentation fault.
    """


def _say(stop: Stop) -> int:
    if stop.code:
        say_fatal(stop)
    return stop.code
