# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""A node with a step per tick, in lockstep or at 10 Hz on the newest inputs."""

from glider_model.base.signals import TICK_S
from glider_model.base.wiring import SAMPLED, SLOW_S, WHEN_SILENT
from glider_model.ros.lockstep import health
from glider_model.ros.lockstep.inputs import Input
from glider_model.ros.lockstep.node import TickNode

#: Samples of attitude and pressure are old after so many periods: two in a row may be missed.
OLD_AFTER = 3.0
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

    @property
    def sample_period_s(self) -> float:
        """Time (s) between two samples of what is not measured in every tick."""
        return TICK_S

    def max_age_s(self, topic: str) -> float:
        """Age (s) from which on an input is old in free-running mode."""
        at_least_s = max(self.ticks.input_max_age_s, SLOW_S.get(topic, 0.0))
        if topic not in SAMPLED:
            return at_least_s
        return max(at_least_s, OLD_AFTER * self.sample_period_s)

    def _on_cycle(self) -> None:
        self._count()
        now_s = self.now_s()
        old = {
            item.topic.name
            for item in self.inputs
            if now_s - item.arrived_s > self.max_age_s(item.topic.name)
        }
        stale = [
            item.topic.name for item in self.inputs if item.topic.name in old - {*WHEN_SILENT}
        ]
        stamp_ns = max(item.stamp_ns for item in self._ticking)
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
            silent = {name: WHEN_SILENT[name] for name in old}
            self.step(
                stamp_ns, *[silent.get(item.topic.name, item.values) for item in self.inputs]
            )

    @property
    def _ticking(self) -> list[Input]:
        """Inputs of which a message is due in every tick."""
        return [item for item in self.inputs if item.topic.name not in SAMPLED]

    def _count(self) -> None:
        """Count what came late, and tell now and then what was lost or late."""
        ticking = self._ticking
        for item in ticking:
            item.late += item.stamp_ns == item.used_ns >= 0
            item.used_ns = item.stamp_ns
        lost, late = (sum(getattr(item, kind) for item in ticking) for kind in _COUNTED)
        if (lost, late) == self._told or self.now_s() < self._tell_s:
            return
        level = health.WARN if lost > self._told[0] else health.OK
        self._told, self._tell_s = (lost, late), self.now_s() + _TELL_EVERY_S
        counts = {
            f'{item.topic.name}_{kind}': getattr(item, kind)
            for item in ticking
            for kind in _COUNTED
        }
        stamp_ns = max(item.stamp_ns for item in ticking)
        self.event(stamp_ns, level, f'inputs: {lost} lost, {late} late', **counts)

    def on_stale(self, stamp_ns: int) -> None:
        """Act in free-running mode while an input is stale; nothing by default."""

    def close(self) -> None:
        """Say goodbye if another node of this process has heard first that the run is over."""
        if self.running and self.over_since_s is None and self.context.ok():
            self.report(health.FINISHED)
