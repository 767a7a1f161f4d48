# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""A node with a step per tick, in lockstep or at 10 Hz on the newest inputs."""

import math
import time

from glider_base.block import Said
from glider_base.ros.hearing.inputs import Input
from glider_base.ros.lockstep import health, peers
from glider_base.ros.lockstep.node import TickNode
from glider_base.ros.wire.topics import TOPICS
from glider_base.signals import TICK_NS, TICK_S
from glider_base.wiring import SAMPLED, SLOW_S, WHEN_SILENT

#: Samples of attitude and pressure are old after so many periods: two in a row may be missed.
OLD_AFTER = 3.0
_COUNTED = ('lost', 'late')
#: With use_sim_time: nobody acts, and says so, when the time has not gone on for so long (s).
_STANDS_S = 5.0
_TELL_EVERY_S = 10.0
#: So far (in ticks) the steps may be ahead of the stamps before one is left out.
_AHEAD = 0.25


class Passing:
    """Time that passes in the steps of a free-running node, by the stamps that these are given.

    A step stands for as many ticks as the stamps have gone on by: more than one if a message was
    lost or a cycle missed, but no more than an input may be old. Over many steps no time is lost
    and none is added; in between the steps may be ahead of the stamps, so that jitter does not
    make one of two. The clock of a vehicle that was set back goes on with one tick.
    """

    def __init__(self, max_age_s: float) -> None:
        self.most = max(1, round(max_age_s / TICK_S))
        self._stamp_ns = -1  #: of the last cycle
        self._passed_ns = 0  #: up to where time has passed in the steps

    def ticks(self, stamp_ns: int) -> int:
        """Ticks that have passed with a stamp; 0 if it is no step."""
        before_ns, self._stamp_ns = self._stamp_ns, stamp_ns
        if stamp_ns == before_ns:
            return 0
        if not 0 < stamp_ns - before_ns <= self.most * TICK_NS or before_ns < 0:
            self._passed_ns = stamp_ns
            return self.most if before_ns >= 0 and stamp_ns > before_ns else 1
        behind = (stamp_ns - self._passed_ns) / TICK_NS
        ticks = max(round(behind), int(behind > -_AHEAD))
        self._passed_ns += ticks * TICK_NS
        return ticks


class StepNode(TickNode):
    """Guidance, control, current: a step per tick, and the free-running timer around it."""

    #: What the node does while an input is stale.
    when_stale = 'silent until then'

    def __init__(self, name: str, **kwargs) -> None:
        super().__init__(name, **kwargs)
        self._stale: list[str] = []
        self.cycles = 0  #: cycles of the free-running mode that there should have been
        self.missed = 0  #: those of them that there were not: the machine was too slow
        self.passed = 1  #: ticks that have passed since the last step, this one included
        self._cycle_s: float | None = None
        StepNode.forget(self)  # its own alone: a subclass has made nothing yet
        self._rivals: list[str] = []
        self._stood = (0.0, time.monotonic())  #: time of the cycles, and when it went on last (s)
        self._reported = (0, 0, 0)
        self._tell_s = -float('inf')

    def forget(self) -> None:
        """Know nothing, as at the start: the next cycle is a step, whatever its stamp."""
        self._passing = Passing(self.ticks.input_max_age_s)

    def on_ready(self) -> None:
        """Start the timer of the free-running mode, on simulated time if that is used."""
        if not self.ticks.lockstep:
            self.begin()

    def begin(self) -> None:
        """Act at 10 Hz from now on, in the free-running mode."""
        self._cycle_s = None
        self._timer = self.create_timer(TICK_S, self._on_cycle, self.gate, clock=self.cycle_clock)

    def pause(self) -> None:
        """Act no more, until `begin`."""
        self.destroy_timer(self._timer)

    def watch(self) -> None:
        """Free-running, tell also of rivals, and that cycles cease, as /clock stands still."""
        super().watch()
        rivals = [] if self.ticks.lockstep else sorted(self.heard_rivals())
        if rivals and rivals != self._rivals:
            self.event(self._newest_ns(), health.ERROR, '; '.join(rivals))
        self._rivals = rivals
        (before_s, since_s), now_s = self._stood, self.now_s()
        if now_s > before_s:
            since_s = time.monotonic()
        elif not self.ticks.lockstep and time.monotonic() - since_s > _STANDS_S:
            said = 'use_sim_time, and no /clock that goes on: nothing is done until it does'
            self.event(self._newest_ns(), health.ERROR, said)
            since_s = math.inf  # once
        self._stood = now_s, since_s

    def heard_rivals(self) -> list[str]:
        """Who else says what nobody tells apart, in words: that is the time of /clock."""
        is_simulated, clock = self.cycle_clock is not self.steady_clock, TOPICS['/clock']
        names = sorted({*peers.publishers(self, clock).values()} - {''}) if is_simulated else []
        if len(names) < 2:
            return []
        name = self.resolve_topic_name(clock.name)
        return [f'{name} is published by {" and ".join(names)}; {peers.ALONE}']

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
        now_s = self.now_s()
        due = self._cycles_since(now_s)
        self.cycles, self.missed = self.cycles + due, self.missed + due - 1
        self._count()
        old = [
            item.topic.name
            for item in self.inputs
            if now_s - item.arrived_s > self.max_age_s(item.topic.name)
        ]
        stale = [name for name in old if name not in WHEN_SILENT]
        stamp_ns = self._newest_ns()
        if stale != self._stale:
            self._stale = stale
            if stale:
                self.event(stamp_ns, health.ERROR, self._missing())
            else:
                self.event(stamp_ns, health.OK, 'inputs are fresh again')
        if stale:
            # in a longer pause nobody was silent
            self.on_stale(stamp_ns, due if due <= self._passing.most else 1)
        elif not (passed := self._passing.ticks(stamp_ns)):
            self.repeat()
        else:
            self.passed = passed
            silent = {name: WHEN_SILENT[name] for name in old}
            self.step(
                stamp_ns, *[silent.get(item.topic.name, item.values) for item in self.inputs]
            )
        self._pulse.beat(round(now_s * 1e9), self.get_clock().now().nanoseconds)

    def _newest_ns(self) -> int:
        """Stamp of the newest input; as long as there is none, the time."""
        # who may be silent does not tell the time
        stamp_ns = max(item.stamp_ns for item in self._ticking)
        return stamp_ns if stamp_ns >= 0 else self.get_clock().now().nanoseconds

    def condition(self) -> Said:
        """How this node is: without its inputs it is not well."""
        if self._stale:
            return Said('error', self._missing())
        return super().condition()

    def _missing(self) -> str:
        now_s, named = self.now_s(), []
        for item in self.inputs:
            name = item.topic.name
            if name in self._stale:
                stands = now_s - item.stood_s <= self.max_age_s(name)
                named.append(f'{name} (its stamp stands still)' if stands else name)
        return f'missing or stale: {", ".join(named)}; {self.when_stale}'

    def _cycles_since(self, now_s: float) -> int:
        """Cycles that there should have been since the last one, this one included."""
        since_s = TICK_S if self._cycle_s is None else now_s - self._cycle_s
        if not 0.0 <= since_s <= self.ticks.input_max_age_s:
            # the clock was set, or this node stopped: nobody was silent, and nothing came later
            for item in self.inputs:
                if item.excused_ns != item.stamp_ns:  # once, or a coarse /clock hid a silence
                    item.arrived_s += max(0.0, since_s)
                    item.excused_ns = item.stamp_ns
                item.arrived_s = min(item.arrived_s, now_s)
                item.owner.heard_s = min(item.owner.heard_s, now_s)
            self._tell_s = min(self._tell_s, now_s)
            if self.cycle_clock is not self.steady_clock:  # no slow machine: /clock may be set
                since_s = TICK_S
        self._cycle_s = now_s
        return max(1, round(since_s / TICK_S))

    @property
    def _ticking(self) -> list[Input]:
        """Inputs of which a message is due in every tick."""
        seldom = {*SAMPLED, *WHEN_SILENT}
        return [item for item in self.inputs if item.topic.name not in seldom]

    def _count(self) -> None:
        """Count what came late, and tell now and then what was lost or late."""
        ticking = self._ticking
        for item in ticking:
            item.late += item.stamp_ns == item.used_ns >= 0
            item.used_ns = item.stamp_ns
        lost, late = (sum(getattr(item, kind) for item in ticking) for kind in _COUNTED)
        counted = lost, late, self.missed
        if counted == self._reported or self.now_s() < self._tell_s:
            return
        is_worse = lost > self._reported[0] or self.missed > self._reported[2]
        level = health.WARN if is_worse else health.OK
        self._reported, self._tell_s = counted, self.now_s() + _TELL_EVERY_S
        counts = {
            f'{item.topic.name}_{kind}': getattr(item, kind)
            for item in ticking
            for kind in _COUNTED
        }
        said = f'inputs: {lost} lost, {late} late'
        if self.missed:
            said += f'; {self.missed} of {self.cycles} cycles missed: this machine is too slow'
        self.event(self._newest_ns(), level, said, cycles_missed=self.missed, **counts)

    def repeat(self) -> None:
        """Act in a cycle in which no time has passed by the stamps; nothing by default."""

    def on_stale(self, stamp_ns: int, cycles: int) -> None:
        """Act in free-running mode while an input is stale; nothing by default.

        The cycles are those since the last one, this one included.
        """

    def close(self) -> None:
        """Say goodbye if another node of this process has learnt first that the run is over."""
        if self.running and self.over_since_s is None and self.context.ok():
            self.report(health.FINISHED)
