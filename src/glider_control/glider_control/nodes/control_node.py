# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""Control as a node: odom, joint_states and reference in; demand and wrench out."""

import sys

from glider_base.ros.lockstep import health
from glider_base.ros.lockstep.block_node import BlockNode
from glider_base.ros.lockstep.process import entry
from glider_control.block import CONTROL


class ControlNode(BlockNode):
    """How to get there. Free-running, it is silent while an input is stale."""

    def __init__(self, **kwargs) -> None:
        super().__init__(CONTROL, **kwargs)
        self.start_up()

    def forget(self) -> None:
        """Know nothing, as at the start."""
        super().forget()
        self.refused = 0  #: samples that it has reported

    def tell(self, stamp_ns: int, flags: tuple[int, ...]) -> None:
        """Put a change of saturation on /diagnostics."""
        super().tell(stamp_ns, flags)
        refused = self.state.intake.gate.refused
        if refused != self.refused:
            self.refused = refused
            said = f'odometry: {refused} samples refused so far'
            self.event(stamp_ns, health.WARN, said, odom_refused=refused)


main = entry(ControlNode)

if __name__ == '__main__':
    sys.exit(main())
