# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""The stages of a yo: the paper's four, the inflections between them, and the ends."""

from glider_base.kernel import kernel

SURFACE_PREPARATION, GLIDING_DOWN, INFLECTING_UP, GLIDING_UP, INFLECTING_DOWN = range(5)
WAITING_ON_SURFACE, SURFACING, AT_END_OF_PATH = range(5, 8)

STAGE_NAMES = (
    'surface preparation',
    'gliding down',
    'inflecting up',
    'gliding up',
    'inflecting down',
    'waiting on the surface',
    'surfacing on abort',
    'at the end of the path',
)

#: Shallower than this the vehicle has reached the surface (m).
AT_SURFACE_M = 1.0


@kernel
def is_descending(stage):
    """Whether a stage asks the vehicle to go down."""
    return stage == GLIDING_DOWN or stage == INFLECTING_DOWN


@kernel
def is_gliding(stage):
    """Whether a stage is a steady glide, not a turn or the surface."""
    return stage == GLIDING_DOWN or stage == GLIDING_UP
