# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""The current field as a block: the velocity of the water where the vehicle is."""

from glider_base.block import Block, block_tick
from glider_base.frames import odometry_from_wire, water_to_wire
from glider_base.kernel import kernel
from glider_base.wiring import CURRENT as WIRED
from glider_model.ocean.current import CurrentParams, current_step
from glider_model.ocean.current_settings import CurrentSettings


@block_tick.body(CurrentParams)
@kernel
def current_tick(state, t_s, inputs, params, dt):
    """One tick: ground_truth/odom in, current_velocity out; see `block_tick`."""
    odometry = odometry_from_wire(inputs[0])
    position = (odometry.p_n, odometry.p_e, odometry.p_d)
    state, water = current_step(state, position, t_s, params, dt)
    return state, (water_to_wire(water),), ()


CURRENT = Block(WIRED, CurrentSettings)
