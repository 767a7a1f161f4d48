# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""The guard as a node: demand and all that is measured in; command and drop_weight out."""

import sys

from std_srvs.srv import Trigger

from glider_base.ros.lockstep import health
from glider_base.ros.lockstep.block_node import BlockNode
from glider_base.ros.lockstep.process import entry
from glider_base.signals import TICK_S, Joints
from glider_base.wiring import at_rest
from glider_guard.ascent import INITIAL_ASCENT, Rise, come_up
from glider_guard.block import GUARD, is_seen_up
from glider_guard.depth import late_s
from glider_guard.rows import SURFACE, reaction_of
from glider_guard.witness import AFLOAT_M, SURFACE_M


class GuardNode(BlockNode):
    """The last word. Free-running, it surfaces the vehicle when an input is stale.

    The service clear_guard forgets what has latched, at the surface only.
    """

    def __init__(self, **kwargs) -> None:
        super().__init__(GUARD, **kwargs)
        self.create_service(Trigger, 'clear_guard', self.on_clear)
        self.start_up()

    def forget(self) -> None:
        """Know nothing, as at the start."""
        super().forget()
        self.stale_ticks, self.blind_ticks, self.ascent = 0, 0, INITIAL_ASCENT

    def pause(self) -> None:
        """Act no more, until `begin`; nobody knows how deep it is then."""
        super().pause()
        self.flags = None

    def heard_rivals(self) -> list[str]:
        """Who else says what nobody tells apart, in words: the vehicle obeys all who command."""
        return super().heard_rivals() + self.rivals()

    def on_clear(self, request, response):
        """Serve ``clear_guard``; while an input is stale nobody knows how deep the vehicle is."""
        depth = self.state.depths.depth
        is_known = self.flags is not None and not self._stale
        response.success = bool(is_known and depth < SURFACE_M)
        if response.success:
            self.clear()
            response.message = 'cleared'
        else:
            missing = f'depth not known without {", ".join(self._stale) or "input"}'
            why = f'{depth:.1f} m deep' if is_known else missing
            response.message = f'{why}: only at the surface, above {SURFACE_M:g} m, is it cleared'
        return response

    @property
    def when_stale(self) -> str:
        """What the node does while an input is stale."""
        is_for_good = reaction_of(self.state.reported) >= SURFACE
        return 'surfacing for good' if is_for_good else 'commanding the safe state until then'

    @property
    def sample_period_s(self) -> float:
        """Time (s) between two samples of what is not measured in every tick."""
        return self.settings.imu_period_s

    def compile_kernels(self) -> None:
        """Call every kernel once, so that no tick waits for the compiler."""
        super().compile_kernels()
        self._come_up()
        self._drop_s()
        is_seen_up({name: at_rest(name) for name in ('odom', 'pressure')})

    def _come_up(self, cycles: int = 1) -> Joints:
        """Command of a cycle, or of some at once, in which nothing is seen."""
        joints = self.state.taken.joints
        unseen = Rise(joints.m_b, joints.x_p)
        for _ in range(cycles):
            self.ascent, command = come_up(self.ascent, unseen, self.params.ascent, TICK_S)
        return command

    def step(self, stamp_ns: int, *inputs: tuple[float, ...]) -> None:
        """Answer one tick."""
        self.stale_ticks, self.blind_ticks, self.ascent = 0, 0, INITIAL_ASCENT
        super().step(stamp_ns, *inputs)

    def on_stale(self, stamp_ns: int, cycles: int) -> None:
        """Command what surfaces the vehicle, after a while for good; let the weight go at last.

        That is where it was under water, goes on to say how its actuators are, and is not seen up.
        """
        before, self.stale_ticks = self.stale_ticks, self.stale_ticks + cycles
        if before < round(self.settings.lost_after_s / TICK_S) <= self.stale_ticks:
            self.surface(health.SURFACE)
            said = f'input lost for {self.settings.lost_after_s:g} s: surfacing for good'
            self.event(stamp_ns, health.ERROR, said)
        publish_command, publish_weight = self.senders
        publish_command(stamp_ns, self._come_up(cycles))
        is_there = self.state.depths.depth > AFLOAT_M and 'joint_states' not in self._stale
        is_blind = is_there and not is_seen_up(self._fresh())
        before, self.blind_ticks = self.blind_ticks, is_blind * (self.blind_ticks + cycles)
        drop_s = self._drop_s()
        if self.blind_ticks * TICK_S > drop_s:
            if before * TICK_S <= drop_s:
                said = f'input lost, not seen up for {drop_s:,.0f} s: the weight is let go'
                self.event(stamp_ns, health.ERROR, said)
            publish_weight(stamp_ns, (1.0,))

    def _drop_s(self) -> float:
        """Time (s) without input within which it should be up from its last depth."""
        limits = self.params.depth
        return late_s(limits.drop_blind_s, self.state.depths.depth, limits)

    def _fresh(self) -> dict[str, tuple[float, ...]]:
        """Numbers of the inputs that are not old."""
        now_s = self.now_s()
        return {
            item.topic.name: item.values
            for item in self.inputs
            if item.values and now_s - item.arrived_s <= self.max_age_s(item.topic.name)
        }


main = entry(GuardNode)

if __name__ == '__main__':
    sys.exit(main())
