# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""The node that makes time: it starts the ticks, paces them, and ends the run.

One node of the graph publishes the inputs of each tick and completes it when the answers are
there. That is the plant; a replay could do the same.
"""

import time
from functools import partial

from rclpy.subscription import Subscription
from std_msgs.msg import Header
from std_srvs.srv import SetBool

from glider_base.errors import EXIT_PEER
from glider_base.ros.hearing.inputs import Input
from glider_base.ros.lockstep import health, peers
from glider_base.ros.lockstep.executor import take
from glider_base.ros.lockstep.health import Report, seconds
from glider_base.ros.lockstep.node import TickNode, TickSettings
from glider_base.ros.lockstep.process import Stop
from glider_base.ros.wire import topics
from glider_base.ros.wire.topics import TOPICS
from glider_base.settings import number
from glider_base.signals import TICK_NS, TICK_S
from glider_base.wiring import WIRING

#: The plant is never more than this many ticks ahead of what the recorder has on disk, or of what
#: has come to it. What is on its way to a process waits in a queue of 512 messages (Fast DDS:
#: port_queue_capacity), 22 of which are a tick at most. More would be dropped and sent again, but
#: not by a node that is killed: what it had said would be lost with it.
MAX_TICKS_AHEAD = {'recorded': 256, 'heard': 20}

#: Nodes of a run that is just over are out of sight within this time (s).
_RIVALS_LEAVE_S = 5.0
#: Another plant that was there before the first tick is in sight within this time (s) after it.
_RIVALS_SHOW_S = 5.0


class ClockSettings(TickSettings):
    """How the node that makes time keeps step."""

    speed: float = number(0.0, (0.0, 1e6), 'times real time; 0.0: as fast as possible')


class ClockNode(TickNode):
    """Starts, paces and ends the run.

    Subclasses implement `publish_tick` and `complete_tick`, and add their inputs before
    `start_up`.
    """

    tick_settings = ClockSettings

    def __init__(self, name: str, **kwargs) -> None:
        super().__init__(name, **kwargs)
        self.tick = 0
        self._published = -1
        self._paused = False
        self._tick_s = TICK_S / self.ticks.speed if self.ticks.speed else 0.0  #: of wall time
        self._start_s = 0.0  #: wall time at which tick 0 was due, so that nothing drifts
        self._pace_timer = self.wall_timer(1.0, self._on_pace)
        self._pace_timer.cancel()
        self._clock_started_s = self._flies_since_s = time.monotonic()
        #: what the recorder says on each topic, and up to when it has (ns)
        self._leads: dict[str, Subscription] = {}
        self._said_ns = dict.fromkeys(MAX_TICKS_AHEAD, -TICK_NS)
        self._held_by = ''  #: topic on which it has not said enough for the tick that is due
        for name in MAX_TICKS_AHEAD if self.ticks.record else ():
            hear = partial(self._on_recorder, name)
            self._leads[name] = self._subscription(TOPICS[name], hear, raw=False)
        self.create_service(SetBool, 'pause', self._on_pause)

    # ------------------------------------------------------------------ for subclasses

    def publish_tick(self, stamp_ns: int) -> None:
        """Publish what the peers need to work on this tick."""
        raise NotImplementedError

    def complete_tick(self, *inputs: tuple[float, ...]) -> bool:
        """Integrate to the next tick; return False if this one was the last."""
        raise NotImplementedError

    # ------------------------------------------------------------------ start

    def start_up(self) -> None:
        """Start looking for the peers, for a limited time."""
        self._clock_started_s = time.monotonic()
        super().start_up()
        self._startup_watch = self.wall_timer(0.25, self._on_startup_watch)

    def _peers(self) -> list[str]:
        every = WIRING if self.ticks.lockstep else ()  # free-running nobody leaves with it
        names = [wired.node for wired in every if wired.node != self.get_name()]
        return [*names, topics.RECORDER] if self.ticks.record else names

    def unmatched(self) -> list[str]:
        """What is missing before time can start, in words."""
        names = self._peers()
        absent = [name for name in names if name not in self.reports]
        if absent:
            return [f'{name} has not appeared' for name in absent]
        starting = [name for name in names if self.reports[name].phase == health.STARTING]
        return super().unmatched() or [
            f'{name} is not ready: {self.reports[name].message}' for name in starting
        ]

    def _on_startup_watch(self) -> None:
        if self.running:
            self._look_for_another_plant()
            return
        waited_s = time.monotonic() - self._clock_started_s
        if waited_s > _RIVALS_LEAVE_S and (rivals := self.rivals()):
            self._leave_to(rivals[0])
        if waited_s > self.ticks.startup_timeout_s:
            missing = '; '.join(self.unmatched())
            self.fail(f'not ready after {self.ticks.startup_timeout_s:g} s: {missing}')

    def _look_for_another_plant(self) -> None:
        """Leave to one that was there before, as soon as it is in sight and has a name.

        Free-running, one of its own name is itself, before it was started again.
        """
        clock = TOPICS['/clock']
        own = '' if self.ticks.lockstep else self.get_fully_qualified_name()
        for name in {*peers.others(self, clock)} - {'', own}:
            self._leave_to(peers.published_by(self, clock, name))
        if time.monotonic() - self._flies_since_s > _RIVALS_SHOW_S:
            self.destroy_timer(self._startup_watch)

    def _leave_to(self, rival: str) -> None:
        """Stop without a report: in one namespace it would end the other run too."""
        raise Stop(EXIT_PEER, f'{rival}; {peers.ALONE}')

    def on_ready(self) -> None:
        """Start time."""
        self._flies_since_s = time.monotonic()
        self._due_ns = 0
        self._start_s = time.monotonic()
        if self.ticks.lockstep:
            self._release()
        else:
            self.publish_tick(0)
            self._published = 0
            self.wall_timer(TICK_S / (self.ticks.speed or 1.0), self._on_cycle)

    # ------------------------------------------------------------------ ticks

    def step(self, stamp_ns: int, *inputs: tuple[float, ...]) -> None:
        """Complete the tick that is due, and go on to the next one or end the run."""
        if self.complete_tick(*inputs):
            self.tick += 1
            self._release()
        else:
            self.over_since_s = time.monotonic()
            report = Report(
                self.get_fully_qualified_name(), health.FINISHED, health.COMPLETE, stamp_ns
            )
            self.publish_event(health.report_array(report))
            self.count_events(stamp_ns)
            self.report(health.FINISHED, health.COMPLETE, stamp_ns=stamp_ns)

    def _on_cycle(self) -> None:
        """One free-running tick, with whatever inputs came last."""
        if not self._paused and self.over_since_s is None:
            self._pulse.beat(self.tick * TICK_NS, self.tick * TICK_NS)
            self.step(self.tick * TICK_NS, *[item.values for item in self.inputs])

    def _release(self) -> None:
        """Publish the tick that is due, unless something holds it back."""
        if self._paused or self._published == self.tick:
            return
        if self.ticks.lockstep:
            self._held_by = next(filter(self._is_ahead, self._leads), '')
            if self._held_by:
                self.gate.awaited.add(self._leads[self._held_by])
                return
            wait_s = self._start_s + self.tick * self._tick_s - time.monotonic()
            if self._tick_s and wait_s > 0.0:
                self._pace_timer.timer_period_ns = max(1, int(wait_s * 1e9))
                self._pace_timer.reset()
                return
        self._published = self.tick
        self.publish_tick(self.tick * TICK_NS)

    def _on_pace(self) -> None:
        self._pace_timer.cancel()
        self._release()

    def too_early(self, item: Input) -> str:
        """What is wrong with the answer to a tick that this plant has not published, in words.

        There may be another plant, which has not been discovered yet.
        """
        place = self.get_namespace().rstrip('/')
        return (
            f'{self.resolve_topic_name(item.topic.name)} is published by '
            f'{place}/{item.topic.publisher} for {seconds(item.stamp_ns)} when '
            f'{seconds(self._due_ns)} is due: it follows another plant, or is wrong; {peers.ALONE}'
        )

    def _is_ahead(self, name: str) -> bool:
        """Whether a tick has to wait for what the recorder says on a topic."""
        least_ns = (self.tick - MAX_TICKS_AHEAD[name]) * TICK_NS
        while self._said_ns[name] < least_ns and (message := take(self._leads[name])) is not None:
            self._keep_said(name, message)
        return self._said_ns[name] < least_ns

    def _keep_said(self, name: str, message: Header) -> None:
        recorder = self.reports.get(topics.RECORDER)
        if recorder is not None and message.frame_id == recorder.process:  # no second glider's
            self._said_ns[name] = message.stamp.sec * 1_000_000_000 + message.stamp.nanosec

    def _on_recorder(self, name: str, message: Header) -> None:
        self._keep_said(name, message)
        self.gate.awaited.discard(self._leads[name])
        self._held_by = ''
        self._release()

    def _on_pause(self, request, response):
        self._paused = request.data
        if not self._paused:
            self._start_s = time.monotonic() - self.tick * self._tick_s
            if self.running:
                self._release()
        response.success = True
        response.message = f'{"paused" if self._paused else "running"} at tick {self.tick}'
        return response

    # ------------------------------------------------------------------ watching, end

    def on_report(self, report: Report) -> None:
        """Leave once everybody has said goodbye."""
        if self.over_since_s is not None and self.may_leave():
            raise Stop(0)

    def may_leave(self) -> bool:
        """Whether all peers have said goodbye."""
        peers = [self.reports.get(peer) for peer in self._peers()]
        return all(peer is not None and peer.phase == health.FINISHED for peer in peers)

    def watch_tick(self) -> None:
        """End the run, and name the culprit, if a tick takes too long."""
        waits_for_time = self._published != self.tick and not self._held_by
        if self._paused or waits_for_time:
            self._seen_ns = None  # it counts from the next look on
        elif self.stuck_s() > self.ticks.tick_timeout_s:
            self.fail(self._blame())

    def _blame(self) -> str:
        """Find the node at which the tick hangs, by following who waits for whom."""
        if self._held_by:
            what = {'recorded': 'has nothing on disk', 'heard': 'has not heard everything'}
            return (
                f'{topics.RECORDER} {what[self._held_by]} after '
                f'{seconds(self._said_ns[self._held_by])}; the run waits at '
                f'{seconds(self._due_ns)}'
            )
        missing = [item for item in self.inputs if not self._has(item)]
        if not missing:
            return f'{self.get_name()} did not act on a complete tick'
        topic, culprit = missing[0].topic.name, missing[0].topic.publisher
        for _ in self._peers():
            report = self.reports.get(culprit)
            waits = report is not None and report.phase == health.WAITING
            if not waits or report.stamp_ns != self._due_ns:
                break
            if report.peer == self.get_name():
                return f'{culprit} {report.message}, which was published: it did not arrive'
            culprit, topic = report.peer, report.topic
        return (
            f'{culprit} did not publish {topic} for {seconds(self._due_ns)} within '
            f'{self.ticks.tick_timeout_s:g} s'
        )

    def fail(self, message: str) -> None:
        """End the run, and tell everybody why."""
        self.report(health.FAILED, message, stamp_ns=self._due_ns or 0, level=health.ERROR)
        raise Stop(EXIT_PEER, message)
