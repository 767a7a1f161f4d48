# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""Writes every message of a run into its folder, and says how far it has come."""

import json
import signal
import struct
import sys
import time
from collections import deque
from pathlib import Path

from pydantic import Field
from std_msgs.msg import Header

from glider_bringup.ros.bag import BagWriter
from glider_model.ros import health, messages, qos
from glider_model.ros.codec import to_cdr
from glider_model.ros.messages import TOPICS
from glider_model.ros.parameters import declare_settings
from glider_model.ros.tick import FAREWELL_S, Input, Stop, TickNode, run, take
from glider_model.settings import ConfigurationError, Settings
from glider_model.signals import TICK_NS

_DRAIN_S = 0.02
_PROGRESS_S = 0.25


class RecorderSettings(Settings):
    """Where the recording goes."""

    folder: str = Field('.', description='folder of the run')
    name: str = Field('run', description='the file is called <name>_0.mcap')
    attachments: list[str] = Field([], description='files to store in the recording')
    progress: bool = Field(False, description='print progress as JSON lines on standard output')


class RecorderNode(TickNode):
    """Takes all topics raw; writes tick by tick in a fixed order."""

    def __init__(self, **kwargs) -> None:
        super().__init__(messages.RECORDER, **kwargs)
        self.settings = declare_settings(self, RecorderSettings)
        try:
            self.bag = BagWriter(
                Path(self.settings.folder),
                self.settings.name,
                self.get_namespace(),
                self.settings.attachments,
            )
        except OSError as error:
            raise ConfigurationError(f'{error.filename}: {error.strerror}') from None
        self.stamps: dict[str, int] = {}
        self.lost = 0
        self.has_path = False
        self.stage = ''
        self.last_odom = b''
        self.written_ns = -TICK_NS
        self.final_ns: int | None = None
        self.stopped = False
        self.progress_s = 0.0
        self.queues = {t.name: deque() for t in TOPICS.values() if t.per_tick}
        self.events: list[tuple[int, str, bytes]] = []
        for name in self.queues:
            self.add_input(name)
        self.path_in = self._subscription(TOPICS['path'], self.on_path, raw=True, gated=False)
        self.recorded = self._publisher(TOPICS['recorded'])
        self.outputs['recorded'] = (TOPICS['recorded'], self.recorded)
        signal.signal(signal.SIGINT, self.on_signal)
        signal.signal(signal.SIGTERM, self.on_signal)
        self.wall_timer(_DRAIN_S, self.drain)
        self.start_up()

    def add_input(self, name: str) -> Input:
        """Subscribe without waiting for messages: `drain` takes them all."""
        item = Input(TOPICS[name])
        profile = None if self.ticks.lockstep else qos.EVERYTHING
        item.subscription = self._subscription(item.topic, lambda raw: None, profile=profile)
        self.inputs.append(item)
        return item

    def on_signal(self, number, frame) -> None:
        self.stopped = True

    # ------------------------------------------------------------------ what comes in

    def on_path(self, raw: bytes) -> None:
        sec, nanosec = struct.unpack_from('<iI', raw, 4)
        self.events.append((sec * 1_000_000_000 + nanosec, 'path', raw))
        self.has_path = True

    def unmatched(self) -> list[str]:
        missing = super().unmatched()
        return missing or ([] if self.has_path else ['guidance_node has not published path'])

    def _on_event(self, array) -> None:
        super()._on_event(array)
        for status in array.status:
            for pair in status.values:
                if pair.key == 'stage':
                    self.stage = pair.value
        if not health.is_routine(array):
            stamp_ns = array.header.stamp.sec * 1_000_000_000 + array.header.stamp.nanosec
            self.events.append((stamp_ns, '/diagnostics', to_cdr(array)))

    def on_report(self, report: health.Report) -> None:
        if report.node == messages.PLANT and report.phase in (health.FINISHED, health.FAILED):
            self.over_since_s = time.monotonic()
            self.final_ns = report.stamp_ns if report.phase == health.FINISHED else -1

    def drain(self) -> None:
        """Take and write whatever has come; end when the run is over and all of it is here."""
        for item in self.inputs:
            self._drain_topic(item)
        while (array := take(self._events_in)) is not None:
            self._on_event(array)
        self._write_complete_ticks()
        self._print_progress()
        if self.stopped or (self.final_ns is not None and self.written_ns >= self.final_ns):
            raise Stop(0)

    def watch(self) -> None:
        if self.over_since_s is not None and time.monotonic() - self.over_since_s > FAREWELL_S:
            raise Stop(0)

    def _drain_topic(self, item) -> None:
        name, codec = item.topic.name, item.topic.codec
        queue = self.queues[name]
        while (raw := take(item.subscription)) is not None:
            stamp_ns = codec.decode_stamp(raw)
            expected_ns = self.stamps.get(name, stamp_ns - TICK_NS) + TICK_NS
            if self.ticks.lockstep and stamp_ns > expected_ns:
                self.lost += (stamp_ns - expected_ns) // TICK_NS
            self.stamps[name] = stamp_ns
            queue.append((stamp_ns, raw))

    # ------------------------------------------------------------------ what goes out

    def _write_complete_ticks(self) -> None:
        if not self.ticks.lockstep:
            self._write_rest()
            self.bag.flush()
            return
        on_disk = False
        while all(self.queues.values()):
            stamp_ns = min(queue[0][0] for queue in self.queues.values())
            self._write_tick(stamp_ns)
            on_disk = self.bag.end_tick(stamp_ns) or on_disk
        if on_disk:
            self._publish_recorded()

    def _write_tick(self, stamp_ns: int) -> None:
        for name, queue in self.queues.items():
            if queue and queue[0][0] == stamp_ns:
                raw = queue.popleft()[1]
                self.bag.write(name, stamp_ns, raw)
                if name == 'odom':
                    self.last_odom = raw
        self.written_ns = stamp_ns
        if self.events:
            self._write_events(stamp_ns)

    def _write_events(self, stamp_ns: int) -> None:
        due = sorted(event for event in self.events if event[0] <= stamp_ns)
        self.events = [event for event in self.events if event[0] > stamp_ns]
        for event_ns, name, raw in due:
            self.bag.write(name, event_ns, raw)

    def _write_rest(self) -> None:
        """Write what belongs to ticks that will not be completed."""
        while any(self.queues.values()):
            self._write_tick(min(queue[0][0] for queue in self.queues.values() if queue))

    def _publish_recorded(self) -> None:
        header = Header()
        header.stamp.sec, header.stamp.nanosec = divmod(self.written_ns, 1_000_000_000)
        self.recorded.publish(header)

    def _print_progress(self, final: bool = False) -> None:
        now = time.monotonic()
        if not self.settings.progress or not self.last_odom:
            return
        if not final and now - self.progress_s < _PROGRESS_S:
            return
        self.progress_s = now
        _, odom = TOPICS['odom'].codec.decode(self.last_odom)
        line = {
            'tick': self.written_ns // TICK_NS,
            't_s': self.written_ns / 1e9,
            'depth_m': -odom[2],
            'stage': self.stage,
            'messages': sum(self.bag.counts.values()),
            'lost': self.lost,
        }
        if final:
            complete = self.final_ns is not None and 0 <= self.final_ns <= self.written_ns
            line.update(complete=complete, counts=self.bag.counts)
        print(json.dumps(line), flush=True)

    def close(self) -> None:
        self._write_rest()
        self._write_events(2**62)
        self.bag.close()
        self._print_progress(final=True)
        if self.context.ok():
            self.report(health.FINISHED, stamp_ns=max(0, self.written_ns))
            time.sleep(0.1)


def main(args=None) -> int:
    return run(RecorderNode, args)


if __name__ == '__main__':
    sys.exit(main())
