# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""Navigation as a node: sensors in; odom and what is believed of the current out."""

import sys

from glider_base.ros.lockstep.block_node import BlockNode
from glider_base.ros.lockstep.process import entry
from glider_navigation.block import NAVIGATION


class NavigationNode(BlockNode):
    """Where the vehicle believes it is. Free-running, it is silent while a sensor is."""

    def __init__(self, **kwargs) -> None:
        super().__init__(NAVIGATION, **kwargs)
        self.start_up()

    @property
    def sample_period_s(self) -> float:
        """Time (s) between two samples of what is not measured in every tick."""
        return self.settings.imu_period_s


main = entry(NavigationNode)

if __name__ == '__main__':
    sys.exit(main())
