# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""All blocks of the tick, in the order in which they act."""

from glider_control.block import CONTROL
from glider_guidance.block import GUIDANCE
from glider_model.ocean.current_block import CURRENT
from glider_model.plant.block import PLANT

BLOCKS = (PLANT, CURRENT, GUIDANCE, CONTROL)
