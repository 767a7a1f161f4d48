# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""Time of a tick of the plant, under commands and water of a flight of the direct engine."""

import time
from collections.abc import Callable

import numpy as np

from glider_base.frames import water_from_wire
from glider_base.kernel import kernel
from glider_base.signals import TICK_S, Joints, Water
from glider_bringup.engines.direct import fly_blocks
from glider_bringup.engines.flight import mission_of
from glider_mission.blocks import COLUMNS
from glider_mission.scenario import Scenario
from glider_model.plant.plant import plant_step

#: Dives, turns, the surface: straight path, constant current, no noise.
SCENARIO = 'current_8deg'
SHALLOW = {
    'dives': 0,
    'duration_s': 6000.0,
    'profile.depth_m': 150.0,
    'profile.surface_every_dives': 2,
}
#: A fin, a volume, and water of which temperature and density are measured.
_FIN = {'range': 26.0, 'rate': 1.2, 'area': 0.02, 'lift_slope': 2.5, 'x': -1.0, 'turn_rate': 0.5}
SEA = {
    **{f'vehicle.fin.{name}': value for name, value in _FIN.items()},
    'vehicle.volume': 69.0 / 1025.0,
    'vehicle.compressibility': 5e-10,
    'vehicle.thermal_expansion': 7e-5,
    'vehicle.reference_temperature': 15.0,
    'water.profile': [[0.0, 1025.0, 18.0], [60.0, 1026.5, 12.0], [1000.0, 1032.0, 5.0]],
}


@kernel
def _plant_steps(plant, params, commands, waters, dt, motions):
    for row in range(len(commands)):
        command = Joints(commands[row, 0], commands[row, 1], commands[row, 2], commands[row, 3])
        water = Water(waters[row, 0], waters[row, 1], waters[row, 2])
        plant = plant_step(plant, command, water, params, dt)
        for i, value in enumerate(plant.motion):
            motions[row, i] = value


def plant_steps(plant, params, commands, waters, motions) -> None:
    """Fill ``motions`` (n, 13) with where the plant goes under commands and waters (n, 3)."""
    _plant_steps(plant, params, commands, waters, TICK_S, motions)


def flight_of(scenario: Scenario) -> tuple:
    """State and parameters of the plant, and the commands and waters (n, 3) of its flight."""
    state, params = mission_of(scenario)
    log = np.concatenate([block.copy() for block in fly_blocks(state, params)])
    commands = np.ascontiguousarray(log[:, COLUMNS['command']])
    waters = np.array([water_from_wire(row) for row in log[:, COLUMNS['current_velocity']]])
    return state.plant, params.plant, commands, waters


def cost_s(function: Callable, *arguments) -> float:
    """Processor time (s) of a call."""
    start = time.thread_time()
    function(*arguments)
    return time.thread_time() - start
