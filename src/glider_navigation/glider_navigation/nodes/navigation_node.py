# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""Navigation as a node: sensors in; odom and what is believed of the current out."""

import sys

from glider_model.base.wiring import SAMPLED
from glider_model.ros.lockstep.block_node import BlockNode
from glider_model.ros.lockstep.process import run
from glider_navigation.block import NAVIGATION

#: Samples of attitude and pressure are old after so many periods: two in a row may be missed.
OLD_AFTER = 3.0


class NavigationNode(BlockNode):
    """Where the vehicle believes it is. Free-running, it is silent while a sensor is."""

    def __init__(self, **kwargs) -> None:
        super().__init__(NAVIGATION, **kwargs)
        self.start_up()

    def max_age_s(self, topic: str) -> float:
        """Age (s) from which on an input is old: what is sampled slowly may be older."""
        at_least_s = super().max_age_s(topic)
        if topic not in SAMPLED:
            return at_least_s
        return max(at_least_s, OLD_AFTER * self.settings.imu_period_s)


def main(args=None) -> int:
    """Run the node; returns its exit code."""
    return run(NavigationNode, args)


if __name__ == '__main__':
    sys.exit(main())
