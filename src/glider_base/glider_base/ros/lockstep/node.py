# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""A node that marches in step.

The header stamp is the identity of a tick. In lockstep a node acts on a tick once every input
carries that tick's stamp, so there is no timer in the loop, nothing drifts, and a run gives the
same result every time. Free-running nodes act at 10 Hz on the newest inputs and watch their age.
"""

import time
from collections.abc import Callable
from functools import partial
from uuid import uuid4

from pydantic import Field
from rcl_interfaces.msg import SetParametersResult
from rclpy.clock import Clock, ClockType
from rclpy.event_handler import PublisherEventCallbacks, SubscriptionEventCallbacks
from rclpy.node import Node
from rclpy.parameter import Parameter
from rosgraph_msgs.msg import Clock as ClockMessage

from glider_base.block import Said
from glider_base.errors import EXIT_PEER
from glider_base.ros.hearing.gids import gid_of, shown
from glider_base.ros.hearing.inputs import Input
from glider_base.ros.hearing.owner import Verdict
from glider_base.ros.lockstep import health, peers
from glider_base.ros.lockstep.bad_line import BadLine
from glider_base.ros.lockstep.executor import Gate, take_with_info
from glider_base.ros.lockstep.health import Report, seconds
from glider_base.ros.lockstep.peers import ALONE, FAREWELL_S, REPORT_AFTER, wait_of
from glider_base.ros.lockstep.process import Stop
from glider_base.ros.message_fault import MessageFault
from glider_base.ros.parameters import declare_settings, unknown_parameters
from glider_base.ros.wire import qos, topics
from glider_base.ros.wire.codec import MessageError, NotFiniteFieldError, to_cdr
from glider_base.ros.wire.topics import TOPICS, Topic, topic_of
from glider_base.settings import ConfigurationError, Settings, number
from glider_base.signals import TICK_NS, not_finite, raised
from glider_base.wiring import CONDITION, WHEN_SILENT

#: A node looks for its peers this often (s), and after a while in so small a share of its wait.
_STARTUP_PERIOD_S, _STARTUP_SHARE = 0.03, 0.02
#: A node in lockstep says after so many ticks how many events it has reported.
COUNT_TICKS = 64
#: Who starts a node by hand reads what it waits for, after this time and then this often (s).
_PATIENCE_S, _REMIND_S = 10.0, 20.0
_QUIET_PUBLISHER = PublisherEventCallbacks(use_default_callbacks=False)
_QUIET_SUBSCRIPTION = SubscriptionEventCallbacks(use_default_callbacks=False)


class TickSettings(Settings):
    """How a node keeps step; the same parameters for every node."""

    lockstep: bool = Field(
        True, description='act on ticks in step with the peers; else on the newest input at 10 Hz'
    )
    record: bool = Field(False, description='a recorder takes part: wait for it, never outrun it')
    startup_timeout_s: float = number(
        60.0, (0.1, 3600.0), 'wall time that peers have to get ready (s)'
    )
    tick_timeout_s: float = number(
        5.0, (0.1, 3600.0), 'wall time in which a tick has to be complete (s)'
    )
    input_max_age_s: float = number(
        1.0, (0.2, 3600.0), 'free-running: older input counts as stale, two cycles or more (s)'
    )
    message_faults: list[MessageFault] = Field(
        [], description='what goes wrong with messages of this node'
    )
    message_seed: int = number(0, (0, 2**63 - 1), 'seed of which are struck')


class TickNode(Node):
    """A node that takes part in the lockstep: readiness, reports, end of the run.

    Subclasses add inputs and outputs in their constructor and call `start_up` at its end.
    """

    #: Settings class of the parameters that concern ticks.
    tick_settings = TickSettings
    #: Name of the vehicle's steering surface, which its joints are read and published with.
    steers_by = ''

    def __init__(self, name: str, **kwargs) -> None:
        super().__init__(name, **kwargs)
        if self.get_name() != name:  # it would have no parameters, and be obeyed by nobody
            said = f'__node:={self.get_name()}: not usable: the others know {name} by its name'
            raise ConfigurationError(f'{said} (allowed: another namespace, -r __ns:=/NAME)')
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
        self._pulse = health.Pulse(self, self._publisher(events._replace(qos=qos.REPEATED)))
        self._event_counts, self.events_reported = self._publisher(TOPICS['told']), 0
        self._reports_in = self._subscription(reports, self._on_reports, raw=False)
        self.gate.awaited.add(self._reports_in)
        self._awaited = None
        self._due_ns: int | None = None
        self._seen_ns: int | None = None  #: the tick that was due when the watch looked last
        self._seen_s = 0.0  #: wall time since when it has been
        self._startup_timer = None
        self._said = ''
        self._created_s = time.monotonic()
        self.running = False
        self.over_since_s: float | None = None

    def set_parameters_atomically(self, parameter_list: list[Parameter]) -> SetParametersResult:
        """Set parameters at run time; one that there is not is refused by its name.

        rclpy refuses it too, and says ``undeclared parameter(s): []``. It would take use_sim_time,
        by which only a node that starts chooses its clock.
        """
        names = [parameter.name for parameter in parameter_list]
        reason = unknown_parameters(self, names)
        if 'use_sim_time' in names:
            reason = 'use_sim_time: a node goes by one clock from its start (allowed: no change)'
        if reason:
            return SetParametersResult(successful=False, reason=reason)
        return super().set_parameters_atomically(parameter_list)

    # ------------------------------------------------------------------ inputs and outputs

    def create_subscription(self, msg_type, topic, callback, *args, **kwargs):
        """Subscribe; rclpy, which subscribes to /clock so, lets a negative time end the node."""
        if msg_type is ClockMessage and not kwargs.get('raw'):
            callback = partial(self._on_time, Input(TOPICS['/clock'], False), callback)
        return super().create_subscription(msg_type, topic, callback, *args, **kwargs)

    def create_service(self, srv_type, srv_name, callback, **kwargs):
        """Offer a service; a request that it fails at is logged and ends no node.

        rclpy fails at a parameter of a type that there is not.
        """

        def serve(request, response):
            try:
                return callback(request, response)
            except Stop:
                raise
            except Exception as error:
                self.get_logger().error(f'{srv_name}: request refused: {raised(error)}')
                return response

        return super().create_service(srv_type, srv_name, serve, **kwargs)

    def _on_time(self, item: Input, take: Callable, message: ClockMessage) -> None:
        """Let rclpy take the time."""
        if message.clock.sec >= 0:
            take(message)
        else:
            said = f'/clock: clock.sec is {message.clock.sec} (allowed: >= 0)'
            self.refuse(item, lambda: said)

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
        topic = topic_of(name, self.steers_by)
        publisher = self._publisher(topic)
        self.outputs[name] = (topic, publisher)
        if not topic.per_tick:
            return lambda message: publisher.publish(to_cdr(message))
        encode, publish = topic.codec.encode, publisher.publish
        faults = [fault for fault in self.ticks.message_faults if fault.topic == name]
        if faults:
            line = BadLine(self, topic, faults, self.ticks.message_seed, publish)
            return lambda stamp_ns, values=(): line.send(stamp_ns, encode(stamp_ns, values))
        return lambda stamp_ns, values=(): publish(encode(stamp_ns, values))

    def add_input(self, name: str) -> Input:
        """Subscribe to a per-tick topic. Add the one that comes last in a tick first."""
        item = Input(topic_of(name, self.steers_by), self.ticks.lockstep)
        if self.ticks.lockstep:
            item.subscription = self._subscription(
                item.topic, lambda raw, info: self._on_message(item, raw, info)
            )
            if not self.inputs:
                self._await(item)
        else:
            item.subscription = self._subscription(
                item.topic, lambda raw, info: self._on_free(item, raw, info), profile=qos.FREE
            )
            self.gate.awaited.add(item.subscription)
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
        self.events_reported += 1
        self._events.publish(to_cdr(array))

    def condition(self) -> Said:
        """How this node is, as it repeats it on /diagnostics."""
        return Said('ok', 'running')

    def count_events(self, stamp_ns: int) -> None:
        """Tell the recorder how many events there were up to a tick, so that it has them all."""
        name = self.get_fully_qualified_name()
        count = health.EventCount(name, self.events_reported, stamp_ns, self.process)
        self._event_counts.publish(to_cdr(health.count_array(count)))

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
        """React to the report of a node: say goodbye when the plant ends the run.

        Free-running there is no end: a vehicle flies on, whatever simulated one is beside it.
        """
        if not self.ticks.lockstep:
            return
        if report.node == topics.PLANT and report.phase == health.FAILED:
            raise Stop(0)
        if report.node == topics.PLANT and report.phase == health.FINISHED:
            self.over_since_s = time.monotonic()
            self.count_events(report.stamp_ns)
            self.report(health.FINISHED, stamp_ns=report.stamp_ns)
        if self.over_since_s is not None and self.may_leave():
            raise Stop(0)

    def close(self) -> None:
        """Last act before the node is destroyed, whatever ended it; may raise `Stop`."""

    def may_leave(self) -> bool:
        """Whether nobody needs this node any more once the run is over."""
        recorder = self.reports.get(topics.RECORDER)
        recorded = recorder is not None and recorder.phase == health.FINISHED
        return recorded or not self.ticks.record

    def wall_timer(self, period_s: float, callback):
        """Timer on the steady clock, whatever use_sim_time says."""
        return self.create_timer(period_s, callback, self.gate, clock=self.steady_clock)

    # ------------------------------------------------------------------ start

    def start_up(self) -> None:
        """Start looking for the peers."""
        self.report(health.STARTING, 'looking for its peers')
        self._startup_timer = self.wall_timer(_STARTUP_PERIOD_S, self._on_startup)

    def rivals(self) -> list[str]:
        """Who else publishes what only this node may publish, in words."""
        return peers.rivals(self, [topic for topic, _ in self.outputs.values()])

    def unmatched(self) -> list[str]:
        """What is missing between this node and its peers, in words; empty if all is matched."""
        missing = self.rivals()
        for topic, publisher in self.outputs.values():
            readers = list(topic.readers) if self.ticks.lockstep else []
            if self.ticks.record and topic.recorded and self.get_name() != topics.RECORDER:
                readers.append(topics.RECORDER)
            missing += peers.missing_readers(self, topic, publisher, readers)
        for item in self.inputs:
            missing += peers.missing_publisher(self, item)
        return missing

    def _on_startup(self) -> None:
        missing = self.unmatched() if self.ticks.lockstep else []
        if missing:
            if self._said != missing[0]:
                self._said = missing[0]
                self.report(health.STARTING, missing[0])
            waited_s = time.monotonic() - self._created_s
            period_s = max(_STARTUP_PERIOD_S, min(1.0, _STARTUP_SHARE * waited_s))
            self._startup_timer.timer_period_ns = int(1e9 * period_s)
            if waited_s > _PATIENCE_S:
                self.get_logger().warning(
                    f'waits for its peers: {"; ".join(missing)}', throttle_duration_sec=_REMIND_S
                )
            return
        self.destroy_timer(self._startup_timer)
        self.on_matched()
        self.running = True
        self.report(health.READY)
        self.wall_timer(min(0.5, 0.1 * self.ticks.tick_timeout_s), self.watch)
        self.on_ready()

    def on_matched(self) -> None:
        """Last act before this node says that it is ready, after which ticks may come."""

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
        if not self.is_of_owner(item, info):
            return
        try:
            item.accept(raw)
        except NotFiniteFieldError as error:
            tick = max(0, self._due_ns or 0) // TICK_NS
            raise Stop(EXIT_PEER, not_finite(f'{error}: that', tick)) from None
        except MessageError as error:
            self.refuse(item, partial(str, error))
            return
        if self._due_ns is None and item.stamp_ns > 0:
            # of a run that is under way: one's own begins with tick 0
            item.stamp_ns = -1
            item.owner.restart()

    def refuse(self, item: Input, why: Callable[[], str]) -> None:
        """Tell that a message was refused, the first one at once and then now and then."""
        if item.refuse():
            stamp_ns = max(0, self._due_ns if self._due_ns is not None else item.stamp_ns)
            values = {f'{item.topic.name}_refused': item.refused}
            self.event(stamp_ns, health.ERROR, f'message refused: {why()}', **values)

    def is_of_owner(self, item: Input, info: dict) -> bool:
        """Whether a message is of whom the topic belongs to; tells if not, and if that changes."""
        gid, owner = gid_of(info), item.owner
        now_s = 0.0 if self.ticks.lockstep else self.now_s()
        if owner.owns(gid, now_s):
            return True
        before, silent_s = owner.gid, now_s - owner.heard_s
        verdict = Verdict.STRANGE
        if not owner.is_strange(gid):
            names = peers.publishers(self, item.topic)
            patience_s = self.max_age_s(item.topic.name)
            verdict = owner.claimed(gid, names, self.get_namespace(), now_s, patience_s)
        if verdict is Verdict.STRANGE:
            self.refuse_stranger(item, gid)
        elif verdict is Verdict.TAKEN_OVER:
            for other in self.inputs:
                if other is not item:
                    other.owner.follow(before, gid)
            self.tell_successor(item, silent_s)
        return verdict in (Verdict.OWNED, Verdict.TAKEN_OVER)

    def max_age_s(self, topic: str) -> float:
        """Age (s) from which on an input is old in free-running mode."""
        return self.ticks.input_max_age_s

    def refuse_stranger(self, item: Input, gid: bytes) -> None:
        """Tell that somebody else publishes an input."""
        self.refuse(item, lambda: peers.stranger(self, item, gid))

    def tell_successor(self, item: Input, silent_s: float) -> None:
        """Tell that an input is somebody else's from now on."""
        owner, topic = item.owner, self.resolve_topic_name(item.topic.name)
        how_long = f' for {silent_s:.1f} s' if silent_s >= 0.0 else ''  # less: it was set back
        said = (
            f'{topic}: {owner.name} ({shown(owner.gid)}) takes the place of '
            f'{owner.before or "a node without a name"}, which was silent{how_long}'
        )
        self.event(max(0, item.stamp_ns), health.WARN, said)

    def _fire(self) -> None:
        """Act on every tick that is complete, then wait for the input that is missing."""
        while self.over_since_s is None:
            for item in self.inputs:
                if not self._has(item):
                    self._await(item)
                    return
            self.step(self._due_ns, *[item.values for item in self.inputs])
            self._pulse.beat(self._due_ns, self._due_ns)
            if not (self._due_ns // TICK_NS + 1) % COUNT_TICKS:
                self.count_events(self._due_ns)
            self._due_ns += TICK_NS

    def _await(self, item: Input) -> None:
        if self._awaited is not item.subscription:
            self.gate.awaited.discard(self._awaited)
            self.gate.awaited.add(item.subscription)
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
            rivals = self.rivals()
            raise Stop(EXIT_PEER, f'{rivals[0]}; {ALONE}' if rivals else self.too_early(item))
        return True

    def too_early(self, item: Input) -> str:
        """What is wrong with an input whose publisher is ahead, in words."""
        return (
            f'{item.topic.publisher} skipped a tick: {item.topic.name} came for '
            f'{seconds(item.stamp_ns)} when {seconds(self._due_ns)} was due'
        )

    # ------------------------------------------------------------------ watching

    def watch(self) -> None:
        """Look after the run every now and then."""
        if self.over_since_s is not None:
            if time.monotonic() - self.over_since_s > FAREWELL_S:
                raise Stop(0)
        elif self.ticks.lockstep:
            self.watch_tick()

    def stuck_s(self) -> float:
        """Wall time (s) for which the same tick has been due, as far as the watch has seen."""
        if self._seen_ns != self._due_ns:
            self._seen_ns, self._seen_s = self._due_ns, time.monotonic()
        return time.monotonic() - self._seen_s

    def watch_tick(self) -> None:
        """Tell the peers if this node waits for one of them; the plant ends the run."""
        if self._due_ns is None:
            return
        if self.stuck_s() < REPORT_AFTER * self.ticks.tick_timeout_s:
            return
        self._seen_s = float('inf')  # once for a tick
        missing = [item for item in self.inputs if not self._has(item)]
        if missing:
            self.report(health.WAITING, **wait_of(missing, len(self.inputs), self._due_ns))
        else:
            self._fire()

    # ------------------------------------------------------------------ free-running

    def now_s(self) -> float:
        """Time (s) on the clock of the free-running cycles."""
        return self.cycle_clock.now().nanoseconds / 1e9

    def _on_free(self, item: Input, raw: bytes, info: dict) -> None:
        """Keep an input, and what has come behind it: a stranger may say more than the owner."""
        taken = raw, info
        while taken is not None:
            self._on_newest(item, *taken)
            taken = take_with_info(item.subscription)

    def _on_newest(self, item: Input, raw: bytes, info: dict) -> None:
        """Keep an input in free-running mode."""
        if not self.is_of_owner(item, info):
            return
        try:
            item.accept_newest(raw, self.now_s(), self.ticks.input_max_age_s)
            name = item.topic.name
            may_repeat = name not in CONDITION and item.stamp_ns > 0  # its last fix, or echo
            is_old = item.stood_s - item.arrived_s > self.max_age_s(name)
            if name in WHEN_SILENT and is_old and not may_repeat:
                raise MessageError(f'{name}: its stamp stands still at {item.stamp_ns / 1e9:g} s')
        except NotFiniteFieldError as error:
            if item.topic.name in ('fix', 'altitude'):  # without a fix or an echo
                item.values = WHEN_SILENT[item.topic.name]
            else:
                self.refuse(item, partial(str, error))
        except MessageError as error:
            self.refuse(item, partial(str, error))
