# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""The current field, as a node: answers every odom with the water velocity at that place."""

import sys

from glider_base.ros.lockstep.block_node import BlockNode
from glider_base.ros.lockstep.process import entry
from glider_model.ocean.current_block import CURRENT


class CurrentNode(BlockNode):
    """odom in, current_velocity out."""

    def __init__(self, **kwargs) -> None:
        super().__init__(CURRENT, **kwargs)
        self.start_up()


main = entry(CurrentNode)

if __name__ == '__main__':
    sys.exit(main())
