# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""Log rows of the direct engine to the bag that the nodes would have left."""

from collections.abc import Iterable

import numpy as np

from glider_bringup.blocks import BLOCKS, COLUMNS
from glider_bringup.recording.ros.rosbag2 import BagWriter
from glider_guidance.nodes.guidance_node import path_message
from glider_model.base.block import Telling
from glider_model.base.signals import TICK_NS
from glider_model.base.wiring import present
from glider_model.ros.lockstep import health
from glider_model.ros.wire import topics
from glider_model.ros.wire.codec import to_cdr
from glider_model.ros.wire.topics import TOPICS, topic_of

_PLANT = f'/glider/{topics.PLANT}'
_PER_TICK = [topic.name for topic in TOPICS.values() if topic.per_tick]


class LogWriter:
    """Writes the log rows of a direct run as the messages that the nodes would have published.

    Parameters
    ----------
    bag : BagWriter
    path_points : float64[n, 3]
        Path that guidance publishes, NED (m).
    topics : iterable of str
        Those of the topics that not every run has that there are in this one.
    steers_by : str
        Name of the vehicle's steering surface; empty without.
    """

    def __init__(
        self,
        bag: BagWriter,
        path_points: np.ndarray,
        topics: Iterable[str],
        steers_by: str = '',
    ) -> None:
        self._bag = bag
        self._topics = [topic_of(name, steers_by) for name in present(_PER_TICK, topics)]
        self._tick = 0
        self._tellings = [Telling(block) for block in BLOCKS if block.say]
        bag.write('path', 0, to_cdr(path_message(path_points)))

    def add(self, log: np.ndarray) -> None:
        """Add a block of rows, float64[n, ROW]."""
        stamps = (np.arange(len(log)) + self._tick) * TICK_NS
        self._tell(stamps, log)
        payloads = {}
        for topic in self._topics:
            values = log[:, COLUMNS[topic.name]] if topic.name in COLUMNS else log[:, :0]
            payloads[topic.name] = topic.codec.encode_many(stamps, values)
        self._bag.write_ticks(stamps, payloads)
        self._tick += len(log)

    def _tell(self, stamps: np.ndarray, log: np.ndarray) -> None:
        """Write the events of each block."""
        for telling in self._tellings:
            block = telling.block
            flags = log[:, [COLUMNS[flag] for flag in block.flags]].astype(np.int64)
            node = f'/glider/{block.wired.node}'
            for row in telling.among(flags, stamps):
                stamp_ns = int(stamps[row])
                event = health.said_array(stamp_ns, node, block.say(*flags[row].tolist()))
                self._bag.write('/diagnostics', stamp_ns, to_cdr(event))

    def finish(self, failure: str = '') -> None:
        """Write that the run is complete or why it failed, as the plant says it at its end."""
        stamp_ns = max(0, self._tick - 1) * TICK_NS
        report = health.Report(_PLANT, health.FINISHED, health.COMPLETE, stamp_ns)
        if failure:
            report = health.Report(_PLANT, health.FAILED, failure, stamp_ns, level=health.ERROR)
        self._bag.write('/diagnostics', stamp_ns, to_cdr(health.report_array(report)))

    def close(self) -> int:
        """Complete the bag; the number of messages in it."""
        self._bag.close()
        return sum(self._bag.counts.values())
