# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""Current, navigation, guidance, control, guard and plant as six nodes in one process.

In lockstep one node works at a time, so that a process each is of no use but to be killed and
launched one by one. The recorder, which writes while others work, is a process of its own.
"""

import sys

from glider_base.ros.lockstep.process import run_together
from glider_bringup.nodes.autopilot import PARTS
from glider_model.nodes.current_node import CurrentNode
from glider_model.nodes.plant_node import PlantNode


def main(args=None) -> int:
    """Run the nodes; returns the exit code."""
    return run_together([CurrentNode, *PARTS.values(), PlantNode], args)


if __name__ == '__main__':
    sys.exit(main())
