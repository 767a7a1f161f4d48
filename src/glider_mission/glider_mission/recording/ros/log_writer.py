# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""Log rows of the direct engine to the bag that the nodes would have left."""

from collections.abc import Iterable

import numpy as np

from glider_base.block import Telling
from glider_base.ros.lockstep import health
from glider_base.ros.lockstep.health import ABORT, PARAMETERS_SET
from glider_base.ros.parameters import changed_parameters
from glider_base.ros.wire import topics
from glider_base.ros.wire.codec import to_cdr
from glider_base.ros.wire.topics import TOPICS, topic_of
from glider_base.settings import ConfigurationError
from glider_base.signals import TICK_NS
from glider_base.wiring import GUIDANCE, present
from glider_guidance.nodes.guidance_node import PATH_POINTS, path_message, refused
from glider_guidance.order import Order
from glider_guidance.orders import changed
from glider_guidance.settings import GuidanceSettings
from glider_mission.blocks import BLOCKS, COLUMNS
from glider_mission.recording.ros.rosbag2 import BagWriter

_PLANT, _GUIDANCE = f'/glider/{topics.PLANT}', f'/glider/{GUIDANCE.node}'
_PER_TICK = [topic.name for topic in TOPICS.values() if topic.per_tick]


class LogWriter:
    """Writes the log rows of a direct run as the messages that the nodes would have published.

    The settings are those of guidance before the first tick; ``topics`` are those that not
    every run has and this one does; ``steers_by`` names the vehicle's steering surface, and is
    empty without.
    """

    def __init__(
        self,
        bag: BagWriter,
        settings: GuidanceSettings,
        topics: Iterable[str],
        steers_by: str = '',
    ) -> None:
        self._bag = bag
        self._topics = [topic_of(name, steers_by) for name in present(_PER_TICK, topics)]
        self._tick = 0
        self._tellings = [Telling(block) for block in BLOCKS if block.say]
        self._settings = settings
        self._orders: list[tuple[int, list[Order]]] = []  #: to be written, by tick
        self._events: list[tuple[int, str, bytes]] = []  #: to be written with their ticks
        self._tell_path(0)

    def follow(self, tick: int, orders: list[Order]) -> None:
        """Note the orders that hold from a tick on, whose row is still to come."""
        self._orders.append((tick, orders))

    def add(self, log: np.ndarray) -> None:
        """Add a block of rows, float64[n, ROW]."""
        stamps = (np.arange(len(log)) + self._tick) * TICK_NS
        while self._orders and self._orders[0][0] < self._tick + len(log):
            self._tell_orders(*self._orders.pop(0))
        self._tell(stamps, log)
        payloads = {}
        for topic in self._topics:
            values = log[:, COLUMNS[topic.name]] if topic.name in COLUMNS else log[:, :0]
            payloads[topic.name] = topic.codec.encode_many(stamps, values)
        self._bag.write_ticks(stamps, payloads, self._events)
        self._events.clear()
        self._tick += len(log)

    def _tell(self, stamps: np.ndarray, log: np.ndarray) -> None:
        """Note the events of each block."""
        for telling in self._tellings:
            block = telling.block
            flags = log[:, [COLUMNS[flag] for flag in block.flags]].astype(np.int64)
            node = f'/glider/{block.wired.node}'
            for row in telling.among(flags, stamps):
                stamp_ns = int(stamps[row])
                event = health.said_array(stamp_ns, node, block.say(*flags[row].tolist()))
                self._events.append((stamp_ns, '/diagnostics', to_cdr(event)))

    def _tell_path(self, stamp_ns: int) -> None:
        """Note the path that is followed from now on."""
        points = self._settings.path.points(PATH_POINTS)
        self._events.append((stamp_ns, 'path', to_cdr(path_message(points, stamp_ns))))

    def _tell_orders(self, tick: int, orders: list[Order]) -> None:
        """Note the orders that hold from a tick on: one event of a kind, and one path."""
        stamp_ns = tick * TICK_NS
        path, held = self._settings.path, {}
        for order in orders:
            before, message = self._settings, ABORT if order.abort else PARAMETERS_SET
            try:
                self._settings = changed(before, order)
            except ConfigurationError as error:
                event = health.status_array(stamp_ns, _GUIDANCE, health.WARN, refused(error), {})
                self._events.append((stamp_ns, '/diagnostics', to_cdr(event)))
                continue
            values = held.setdefault(message, {})
            values.update(changed_parameters(before, self._settings))
        if self._settings.path != path:
            self._tell_path(stamp_ns)
        for message, values in held.items():
            event = health.status_array(stamp_ns, _GUIDANCE, health.OK, message, values)
            self._events.append((stamp_ns, '/diagnostics', to_cdr(event)))

    def finish(self, failure: str = '') -> None:
        """Write that the run is complete or why it failed, as the plant says it at its end."""
        stamp_ns = max(0, self._tick - 1) * TICK_NS
        report = health.Report(_PLANT, health.FINISHED, health.COMPLETE, stamp_ns)
        if failure:
            report = health.Report(_PLANT, health.FAILED, failure, stamp_ns, level=health.ERROR)
        self._bag.write('/diagnostics', stamp_ns, to_cdr(health.report_array(report)))
