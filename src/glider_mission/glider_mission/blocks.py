# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""All blocks of the tick, in the order in which they act, and the row of a log that they fill."""

from glider_base.wiring import FIELDS, WIRING
from glider_control.block import CONTROL
from glider_guard.block import GUARD
from glider_guidance.block import GUIDANCE
from glider_model.ocean.current_block import CURRENT
from glider_model.plant.block import PLANT
from glider_navigation.block import NAVIGATION

BLOCKS = (PLANT, CURRENT, NAVIGATION, GUIDANCE, CONTROL, GUARD)


def _columns() -> dict[str, slice | int]:
    """Columns of a log row: what the topics of one tick carry, as on the wire, then the flags."""
    columns, start = {}, 0
    for topic in (topic for wired in WIRING for topic in wired.outputs if FIELDS[topic]):
        columns[topic] = slice(start, start + len(FIELDS[topic]))
        start = columns[topic].stop
    for flag in (flag for block in BLOCKS if block.say for flag in block.flags):
        columns[flag] = start
        start += 1
    return columns


COLUMNS = _columns()
ROW = max(COLUMNS.values(), key=lambda place: place if isinstance(place, int) else 0) + 1
#: Ticks that are flown before the log is handed on: one hour.
BLOCK_TICKS = 36000
