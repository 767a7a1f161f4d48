# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""The plant as a block: what it measures begins a tick, and it moves when the tick is over."""

from collections import namedtuple

from glider_base.block import Block
from glider_base.frames import water_from_wire
from glider_base.kernel import kernel
from glider_base.signals import Joints
from glider_base.wiring import PLANT as WIRED
from glider_model.plant.plant import PlantSettings, plant_finished, plant_step, tell
from glider_model.vehicle.file import steers_by

#: Numbers of what the plant measures, by the names of the topics. The clock has none.
Measured = namedtuple('Measured', (topic.replace('/', '_') for topic in WIRED.outputs[1:]))


@kernel
def plant_outputs(state, params):
    """What the plant says of a tick: the numbers of its topics, and whether it is the last one."""
    return tell(state, params), plant_finished(state, params)


@kernel
def plant_move(state, inputs, params, dt):
    """State a tick later, under command, current_velocity and drop_weight."""
    command, water, drop = inputs
    target = Joints(command[0], command[1], command[2], command[3])
    return plant_step(state, target, water_from_wire(water), params, dt, drop[0] > 0.5)


@kernel
def measure_held(held):
    """`plant_outputs` of a plant that is held."""
    return plant_outputs(held.state, held.params)


@kernel
def move_held(held, inputs, dt):
    """Have a plant that is held do `plant_move`."""
    held.state = plant_move(held.state, inputs, held.params, dt)


PLANT = Block(WIRED, PlantSettings, ('finished',), steers_by=steers_by)
