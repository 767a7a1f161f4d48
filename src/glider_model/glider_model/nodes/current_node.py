# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""The current field, as a node: answers every odom with the water velocity at that place."""

import sys

from glider_model.current import CurrentSettings, current_step
from glider_model.frames import odometry_from_wire, water_to_wire
from glider_model.ros import messages
from glider_model.ros.parameters import declare_settings
from glider_model.ros.tick import BlockNode, run
from glider_model.signals import TICK_NS, TICK_S


class CurrentNode(BlockNode):
    """odom in, current_velocity out."""

    def __init__(self, **kwargs) -> None:
        super().__init__(messages.CURRENT, **kwargs)
        settings = declare_settings(self, CurrentSettings)
        self.params = settings.params()
        self.state = settings.initial_state()
        self.publish_velocity = self.add_output('current_velocity')
        self.add_input('odom')
        self.compile_kernels()
        self.start_up()

    def compile_kernels(self) -> None:
        """Call every kernel once, so that no tick waits for the compiler."""
        odometry = odometry_from_wire((*(3 * (0.0,)), 1.0, *(9 * (0.0,))))
        _, water = current_step(self.state, odometry[:3], 0.0, self.params, TICK_S)
        water_to_wire(water)

    def step(self, stamp_ns: int, odom) -> None:
        """Answer one tick."""
        position = odometry_from_wire(odom)[:3]
        t_s = stamp_ns // TICK_NS * TICK_S
        self.state, water = current_step(self.state, position, t_s, self.params, TICK_S)
        self.publish_velocity(stamp_ns, water_to_wire(water))


def main(args=None) -> int:
    """Run the node; returns its exit code."""
    return run(CurrentNode, args)


if __name__ == '__main__':
    sys.exit(main())
