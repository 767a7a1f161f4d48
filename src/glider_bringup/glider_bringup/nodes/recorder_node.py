# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""Writes every message of a run into its folder, and says how far it has come."""

import json
import signal
import struct
import sys
import time
from collections import Counter
from contextlib import suppress
from pathlib import Path
from typing import Literal

from pydantic import Field
from rclpy.qos import QoSProfile, ReliabilityPolicy
from std_msgs.msg import Header

from glider_base.block import Said
from glider_base.errors import EXIT_FAILED
from glider_base.ros.hearing.gids import gid_of
from glider_base.ros.hearing.inputs import Input
from glider_base.ros.lockstep import health, peers
from glider_base.ros.lockstep.executor import take, take_with_info
from glider_base.ros.lockstep.node import TickNode
from glider_base.ros.lockstep.peers import FAREWELL_S
from glider_base.ros.lockstep.process import Stop, entry
from glider_base.ros.parameters import declare_settings, refuse_unknown
from glider_base.ros.wire import qos, topics
from glider_base.ros.wire.codec import MessageError, to_cdr
from glider_base.ros.wire.topics import TOPICS, recorded_topics
from glider_base.settings import ConfigurationError, Settings
from glider_base.signals import TICK_NS
from glider_base.wiring import ESTIMATES, GUARD, SENSORS, WIRING
from glider_mission.disk import DiskError
from glider_mission.recording.ros.rosbag2 import BagWriter, Sync
from glider_mission.recording.tick_sorter import TickSorter

_DRAIN_S = 0.01
_PROGRESS_S = 0.25
#: Asked to stop, it does once nothing has come for this long, or at the latest (s).
_QUIET_S, _LATEST_S = 0.2, 1.0


class RecorderSettings(Settings):
    """Where the recording goes."""

    folder: str = Field('.', description='folder of the run')
    name: str = Field('run', description='the file is called <name>_0.mcap')
    attachments: list[str] = Field([], description='files to store in the recording')
    sync: Sync = Field(
        'end',
        description='when the recording is synced to disk, to outlive a loss of power: never, at '
        'its end, or with every chunk too, before its ticks are acknowledged',
    )
    topics: list[Literal[(*SENSORS, *ESTIMATES)]] = Field(
        ['measured_odom'], description='those of the topics that not every run has'
    )
    progress: bool = Field(False, description='print progress as JSON lines on standard output')


class RecorderNode(TickNode):
    """Takes all topics raw; writes tick by tick in a fixed order."""

    def __init__(self, **kwargs) -> None:
        super().__init__(topics.RECORDER, **kwargs)
        self.settings = declare_settings(self, RecorderSettings)
        refuse_unknown(self)  # before there is a file
        recorded = recorded_topics(self.settings.topics)
        per_tick = [topic.name for topic in recorded if topic.per_tick]
        try:
            self.bag = BagWriter(
                Path(self.settings.folder),
                self.settings.name,
                {topic.name: self.resolve_topic_name(topic.name) for topic in recorded},
                self.settings.attachments,
                recorded,
                sync=self.settings.sync,
            )
        except DiskError as error:
            raise Stop(EXIT_FAILED, str(error)) from None
        except OSError as error:
            raise ConfigurationError(f'{error.filename}: {error.strerror}') from None
        strange = {'fix', *GUARD.outputs}  # may be stamped by another clock
        self.order = TickSorter(per_tick, TICK_NS, self.bag.write, strange)
        self.recorded_ns = -TICK_NS  #: newest tick that outlives this process
        self.heard_ns = -TICK_NS  #: newest tick of which it has said that all messages are here
        self.has_path = self.replayed = False
        self.held: dict[str, tuple[bytes, dict]] = {}  #: messages of nobody knows whom, by topic
        self.stage, self.last_odom, self.newest_ns, self.depth_m = '', b'', 0, 0.0
        self.end: tuple[int, bytes] | None = None  #: what the plant said last
        self.heard: Counter[str] = Counter()  #: events by the node that reported them
        self.settled_ns: dict[str, int] = {}  #: newest tick of which a node's events are all here
        self.final_ns: int | None = None
        self.stopped_s: float | None = None  #: when it was asked to stop
        self.came_s = 0.0  #: when the newest message came
        self.begun = False
        self.progress_s = 0.0
        place = self.get_namespace().rstrip('/')
        self.replay = f'{place}/{topics.REPLAY}'
        self.tellers = [f'{place}/{wired.node}' for wired in WIRING]
        names = ('recorded', 'heard') if self.ticks.lockstep else ()
        self.words = {name: self._publisher(TOPICS[name]) for name in names}
        self.outputs |= {name: (TOPICS[name], word) for name, word in self.words.items()}
        for name in per_tick:
            self.add_input(name)
        self._subscription(TOPICS['path'], self.on_path, gated=False)
        self.events = self._subscription(TOPICS['/diagnostics'], self.on_event, raw=False)
        self.counts = self._subscription(TOPICS['told'], self.on_count, raw=False)
        self.counted: dict[str, health.EventCount] = {}
        signal.signal(signal.SIGINT, self.on_signal)
        signal.signal(signal.SIGTERM, self.on_signal)
        self.wall_timer(_DRAIN_S, self.drain)
        self.start_up()

    def add_input(self, name: str) -> Input:
        """Subscribe without waiting for messages: `drain` takes them all."""
        item = Input(TOPICS[name], self.ticks.lockstep, topics.REPLAY)
        self.subscribe(item)
        self.inputs.append(item)
        return item

    def subscribe(self, item: Input, profile: QoSProfile | None = None) -> None:
        """Ask for the messages of an input, by the profile of its topic or another one."""
        item.subscription = self._subscription(
            item.topic, lambda raw, info: self.keep(item, raw, info), profile=profile
        )

    def hear_best_effort(self, item: Input) -> None:
        """Take what comes of a topic that somebody publishes with best effort.

        By its own profile a topic is sent again until it is here, however late that is.
        """
        offers = (info.qos_profile for info in self.get_publishers_info_by_topic(item.topic.name))
        reliable = ReliabilityPolicy.RELIABLE
        if item.subscription.qos_profile.reliability == reliable and any(
            offer.reliability != reliable for offer in offers
        ):
            self.destroy_subscription(item.subscription)
            self.subscribe(item, qos.EVERYTHING)

    def refuse_stranger(self, item: Input, gid: bytes) -> None:
        """Pass over a message of somebody else: those who need the topic tell."""

    def tell_successor(self, item: Input, silent_s: float) -> None:
        """Nothing: those who need the topic tell."""

    def condition(self) -> Said:
        """How this node is."""
        return Said('ok', 'recording')

    def on_signal(self, number, frame) -> None:
        """Remember to stop; `drain` does it, with everything that is under way."""
        self.stopped_s = self.stopped_s or time.monotonic()

    def unmatched(self) -> list[str]:
        """What is missing; the path is part of it, so that it is recorded first.

        A replay stands for all nodes.
        """
        missing = [] if self.is_replayed() else super().unmatched()
        return missing or ([] if self.has_path else ['guidance_node has not published path'])

    def is_replayed(self) -> bool:
        """Whether what comes is a recording, published again.

        In lockstep that is found out once, before the first tick: a replay that has said
        everything may be gone while its last messages are still to be taken.
        """
        if not (self.running and self.ticks.lockstep):
            publishers = self.get_publishers_info_by_topic('odom')
            self.replayed = any(info.node_name == topics.REPLAY for info in publishers)
        return self.replayed

    def on_matched(self) -> None:
        """Forget what came before this run begins: it is somebody else's."""
        if self.ticks.lockstep and not self.is_replayed():
            for item in self.inputs:
                while take(item.subscription) is not None:
                    pass

    def on_path(self, raw: bytes) -> None:
        """Keep a path, under the stamp it carries; once in step, only one that was ordered."""
        if len(raw) < 12:
            return  # bytes that are no message
        sec, nanosec = struct.unpack_from('<iI', raw, 4)
        stamp_ns = sec * 1_000_000_000 + nanosec
        if stamp_ns == 0 and self.begun and not self.is_replayed():
            return  # of a second glider
        self.order.add_event('path', stamp_ns, raw)
        self.has_path = True

    def on_count(self, array) -> None:
        """Learn how many events a node has reported; not from the node of a second glider."""
        count = health.count_in(array)
        report = self.reports.get(count.node.rpartition('/')[2]) if count else None
        if count and (count.node == self.replay or (report and report.process == count.process)):
            self.counted[count.node] = count

    def on_event(self, array) -> None:
        """Keep what happens to this glider; the end of a flight is kept by `on_report`."""
        self.heard.update([*(status.name for status in array.status[:1]), self.replay])
        if not health.concerns(array, self.get_namespace()):
            return
        if health.end_of_run(array):
            if self.is_replayed():
                self.end = health.stamp_of(array), to_cdr(array)
            return
        for status in array.status:
            for pair in status.values:
                if pair.key == 'stage':
                    self.stage = pair.value
        self.order.add_event('/diagnostics', health.stamp_of(array), to_cdr(array))

    def on_report(self, report: health.Report) -> None:
        """Learn the last tick from the plant, and keep what it says about the end."""
        name = f'{self.get_namespace().rstrip("/")}/{topics.PLANT}'
        heard = (item for item in self.inputs if item.stamp_ns >= 0)
        if not self.ticks.lockstep and not any(self.may_be(name, item) for item in heard):
            return  # that of somebody else: the vehicle is another
        if report.node == topics.PLANT and report.phase in (health.FINISHED, health.FAILED):
            self.over_since_s = time.monotonic()
            self.final_ns = report.stamp_ns if report.phase == health.FINISHED else -1
            named = report._replace(node=name, process='')
            self.end = report.stamp_ns, to_cdr(health.report_array(named))

    def may_be(self, name: str, item: Input) -> bool:
        """Whether an input is that of a node, whose name may have come after its messages.

        Where the middleware tells nobody apart, it may be anybody's.
        """
        owner = item.owner
        if not owner.name and owner.gid:
            return peers.publishers(self, item.topic).get(owner.gid) == name
        return owner.name in (name, '')

    def keep(self, item: Input, raw: bytes, info: dict) -> None:
        """Keep a message until its tick is complete.

        Passed over are an old one in lockstep, one of a second publisher, one from before the
        beginning of time, and bytes that are no message: those who need it tell.
        """
        try:
            stamp_ns = item.topic.codec.decode_stamp(raw)
        except MessageError:
            return
        if not self.is_of_owner(item, info):
            return
        if self.ticks.lockstep and not self.begun:
            if stamp_ns > 0 and not self.is_replayed():
                item.owner.restart()
                return  # of a run that is under way: one's own begins with tick 0
            self.begun = True
        if stamp_ns > item.stamp_ns or not self.ticks.lockstep:
            item.stamp_ns = stamp_ns
            self.order.add(item.topic.name, stamp_ns, raw)
            if item.topic.name == 'odom':
                self.last_odom, self.newest_ns = raw, stamp_ns

    def next_of(self, item: Input) -> tuple[bytes, dict] | None:
        """Next message of an input; in lockstep the first one waits until it is known whose it is.

        A replay publishes as soon as its subscribers are there, and its name may come later.
        """
        name = item.topic.name
        taken = self.held.pop(name, None) or take_with_info(item.subscription)
        if taken is None or item.owner.gid or not self.ticks.lockstep:
            return taken
        gid = gid_of(taken[1])
        if gid and not peers.publishers(self, item.topic).get(gid):
            self.held[name] = taken
            return None
        return taken

    def drain(self) -> None:
        """Take and write whatever has come; end when the run is over and all of it is here."""
        for item in self.inputs if self.running else ():
            while (taken := self.next_of(item)) is not None:
                self.keep(item, *taken)
                self.came_s = time.monotonic()
        for subscription, hear in ((self.counts, self.on_count), (self.events, self.on_event)):
            while (array := take(subscription)) is not None:
                hear(array)
        try:
            self.save()
        except DiskError as error:
            raise Stop(EXIT_FAILED, str(error)) from None
        if self.running:
            self._pulse.beat(self.newest_ns, self.newest_ns)
        if self.last_odom and time.monotonic() - self.progress_s > _PROGRESS_S:
            self.print_progress()
        if self.is_stopped() or (
            self.final_ns is not None and self.order.written_ns >= self.final_ns
        ):
            raise Stop(0)

    def is_stopped(self) -> bool:
        """Whether it was asked to stop, and what nodes said that are dead by now has come."""
        if self.stopped_s is None:
            return False
        now_s = time.monotonic()
        quiet_s = now_s - max(self.came_s, self.stopped_s)
        return quiet_s > _QUIET_S or now_s - self.stopped_s > _LATEST_S

    def save(self) -> None:
        """Write what has come as far as it is complete, and let the plant go on."""
        if not self.ticks.lockstep:
            if self.order.begun:  # what is reported before the first tick is recorded with it
                self.order.write_rest()
            self.bag.flush()
            return
        if self.order.heard_ns > self.heard_ns:
            self.heard_ns = self.order.heard_ns
            self.say('heard', self.heard_ns)
        if self.order.write_complete(self.end_tick, self.whole_ns()):
            self.say('recorded', self.recorded_ns)

    def whole_ns(self) -> int:
        """Newest tick of which no event is under way any more: all who tell have counted them."""
        for count in self.counted.values():
            if self.heard[count.node] >= count.events:
                self.settled_ns[count.node] = count.stamp_ns
        tellers = [self.replay] if self.is_replayed() else self.tellers
        return min(self.settled_ns.get(teller, -TICK_NS) for teller in tellers)

    def end_tick(self, stamp_ns: int) -> bool:
        """Say that a tick is complete; whether all up to it can be acknowledged."""
        if not self.bag.end_tick(stamp_ns):
            return False
        self.recorded_ns = stamp_ns
        return True

    def say(self, name: str, stamp_ns: int) -> None:
        """Let the plant go on."""
        header = Header(frame_id=self.process)
        header.stamp.sec, header.stamp.nanosec = divmod(stamp_ns, 1_000_000_000)
        self.words[name].publish(header)

    def print_progress(self, **more) -> None:
        """Print one JSON line for whoever started this process."""
        if not self.settings.progress:
            return
        self.progress_s = time.monotonic()
        with suppress(MessageError):  # a number that is none is recorded, but not shown
            if self.last_odom:
                self.depth_m = -TOPICS['odom'].codec.decode(self.last_odom)[1][2]
        line = {
            'tick': self.newest_ns // TICK_NS,
            't_s': self.newest_ns / 1e9,
            'depth_m': self.depth_m,
            'stage': self.stage,
            'messages': sum(self.bag.counts.values()),
            'lost': self.order.lost if self.ticks.lockstep else 0,
        }
        print(json.dumps({**line, **more}), flush=True)

    def watch(self) -> None:
        """Do not wait for ever for ticks that do not come, nor write what nobody will find."""
        try:
            self.bag.refuse_vanished()
        except DiskError as error:
            raise Stop(EXIT_FAILED, str(error)) from None
        if self.over_since_s is not None and time.monotonic() - self.over_since_s > FAREWELL_S:
            raise Stop(0)
        for item in () if self.ticks.lockstep else self.inputs:
            self.hear_best_effort(item)

    def close(self) -> None:
        """Write what is left, and complete the folder."""
        try:
            self.order.write_rest()
            if self.end:
                self.bag.write('/diagnostics', *self.end)
            self.bag.close()
        except ConfigurationError as error:
            raise Stop(EXIT_FAILED, str(error)) from None
        complete = self.final_ns is not None and 0 <= self.final_ns <= self.order.written_ns
        self.print_progress(complete=complete, counts=self.bag.counts)
        if self.context.ok():
            self.report(health.FINISHED, stamp_ns=max(0, self.order.written_ns))


main = entry(RecorderNode)

if __name__ == '__main__':
    sys.exit(main())
