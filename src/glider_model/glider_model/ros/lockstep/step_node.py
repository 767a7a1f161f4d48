# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""A node with a step per tick, in lockstep or at 10 Hz on the newest inputs."""

from glider_model.base.signals import TICK_S
from glider_model.ros.lockstep import health
from glider_model.ros.lockstep.node import TickNode

_COUNTED = ('lost', 'late')
_TELL_EVERY_S = 10.0


class StepNode(TickNode):
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
