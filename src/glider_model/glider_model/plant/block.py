# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""The plant as a block: what it measures begins a tick, and it moves when the tick is over."""

from glider_model.base.block import Block
from glider_model.base.frames import odometry_to_wire, water_from_wire
from glider_model.base.kernel import kernel
from glider_model.base.signals import Joints
from glider_model.base.wiring import PLANT as WIRED
from glider_model.plant.plant import (
    PlantSettings,
    plant_finished,
    plant_joints,
    plant_measurement,
    plant_step,
)


@kernel
def plant_outputs(state, params):
    """What the plant says of a tick: odom and joint_states, and whether it is the last one."""
    odom = odometry_to_wire(plant_measurement(state, params))
    joints = plant_joints(state)
    return (odom, (joints.m_b, joints.x_p, joints.mu)), plant_finished(state, params)


@kernel
def plant_move(state, inputs, params, dt):
    """State a tick later, under command and current_velocity."""
    command, water = inputs
    target = Joints(command[0], command[1], command[2])
    return plant_step(state, target, water_from_wire(water), params, dt)


PLANT = Block(WIRED, PlantSettings, plant_move, ('finished',))
