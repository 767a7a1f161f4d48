# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""The direct engine: the steps of the six nodes in one compiled loop.

What a message would do to the numbers (NED to ENU and back, through a quaternion) is done here
too, so that a run over topics and a direct run of one scenario agree to the last bit.
"""

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from glider_bringup.blocks import BLOCK_TICKS, COLUMNS, ROW
from glider_control.block import control_tick
from glider_control.control import ControlParams, ControlState
from glider_guard.block import guard_tick
from glider_guard.guard import GuardParams, GuardState
from glider_guidance.block import guidance_tick
from glider_guidance.guidance import GuidanceParams, GuidanceState
from glider_model.base.block import put
from glider_model.base.frames import odometry_from_wire, water_to_wire
from glider_model.base.kernel import kernel
from glider_model.base.signals import TICK_S, Joints
from glider_model.base.wiring import FIELDS, PLANT, publisher
from glider_model.ocean.current import CurrentParams, CurrentState, current_step_in_place
from glider_model.plant.block import plant_move, plant_outputs
from glider_model.plant.plant import PlantParams, PlantState, not_finite, state_fault
from glider_navigation.block import navigation_tick
from glider_navigation.settings import NavigationParams

#: Places among what the plant measures, which does not include /clock.
PRESSURE, ALTITUDE, HEALTH, BATTERY = (
    PLANT.outputs.index(topic) - 1 for topic in ('pressure', 'altitude', 'health', 'battery')
)


class NotFiniteError(Exception):
    """A flight came to numbers that are none. The message says which, and when."""


class MissionParams(NamedTuple):
    """Parameters of the six blocks."""

    plant: PlantParams
    current: CurrentParams
    navigation: NavigationParams
    guidance: GuidanceParams
    control: ControlParams
    guard: GuardParams


class MissionState(NamedTuple):
    """States of the six blocks."""

    plant: PlantState
    current: CurrentState
    navigation: NamedTuple  #: of the method that was chosen
    guidance: GuidanceState
    control: ControlState
    guard: GuardState


@kernel
def fly(state, params, log, dt):
    """Fly until the log is full or the mission ends.

    Parameters
    ----------
    state : MissionState
        Used up: the values of its current are changed where they lie.
    params : MissionParams
    log : float64[n, ROW]
        One row is filled for each tick.
    dt : float
        Length of the tick (s).

    Returns
    -------
    MissionState
        State after the last tick that was filled in.
    int
        Number of rows filled.
    bool
        Whether the mission has ended.
    """
    plant, current, navigation, guidance, control, guard = state
    for row in range(log.shape[0]):
        t_s = plant.tick * dt
        measured, finished = plant_outputs(plant, params.plant)
        joints, sensors = measured[-1], measured[1:-3]
        place = odometry_from_wire(measured[0])
        position = (place.p_n, place.p_e, place.p_d)
        current, velocity = current_step_in_place(current, position, t_s, params.current, dt)
        water = water_to_wire(velocity)
        navigation, believed, phase = navigation_tick(
            navigation, t_s, (joints, *sensors), params.navigation, dt
        )
        odom = believed[0]
        guidance, guided, stage = guidance_tick(guidance, t_s, (odom,), params.guidance, dt)
        seen = (guided[0], odom, joints)
        control, controlled, limits = control_tick(control, t_s, seen, params.control, dt)
        well, power = measured[HEALTH], measured[BATTERY]
        pressure, altitude = measured[PRESSURE], measured[ALTITUDE]
        seen = (controlled[0], guided[0], odom, joints, well, power, pressure, altitude)
        guard, guarded, told = guard_tick(guard, t_s, seen, params.guard, dt)
        plant = plant_move(plant, (guarded[0], water, guarded[1]), params.plant, dt)
        said = (phase, stage, limits, told)
        put(log, row, 0, (*measured, water, *believed, *guided, *controlled, *guarded, *said))
        if finished:
            state = MissionState(plant, current, navigation, guidance, control, guard)
            return state, row + 1, True
    state = MissionState(plant, current, navigation, guidance, control, guard)
    return state, log.shape[0], False


def _finite_rows(log: np.ndarray) -> int:
    """Number of rows before the first one with a number that is not finite."""
    if np.isfinite(log.sum()):
        return len(log)
    wrong = np.flatnonzero(~np.isfinite(log).all(axis=1))
    return int(wrong[0]) if len(wrong) else len(log)


def _fault(row: np.ndarray, tick: int) -> str:
    """What of a log row is not finite, in words; the first in the order of the blocks."""
    odometry = odometry_from_wire(tuple(row[COLUMNS['ground_truth/odom']]))
    fault = state_fault(odometry, Joints(*row[COLUMNS['joint_states']]), tick)
    topics = (name for name in COLUMNS if name in FIELDS)
    wrong = (name for name in topics if not np.isfinite(row[COLUMNS[name]]).all())
    return fault or next(not_finite(f'{publisher(name).name}: {name}', tick) for name in wrong)


def fly_blocks(state: MissionState, params: MissionParams) -> Iterator[np.ndarray]:
    """Fly a mission block by block.

    Yields
    ------
    float64[n, ROW]
        Log rows, n <= BLOCK_TICKS. The array is used again for the next block.

    Raises
    ------
    NotFiniteError
        After the last tick of which every number is finite.
    """
    log = np.empty((BLOCK_TICKS, ROW))
    current = CurrentState(state.current.tick, state.current.values.copy())
    state = state._replace(current=current)
    finished, ticks = False, 0
    while not finished:
        state, rows, finished = fly(state, params, log, TICK_S)
        good = _finite_rows(log[:rows])
        if good:
            yield log[:good]
        if good < rows:
            raise NotFiniteError(_fault(log[good], ticks + good))
        ticks += rows
