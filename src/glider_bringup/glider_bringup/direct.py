# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""The direct engine: the four steps of the nodes in one compiled loop.

What a message would do to the numbers (NED to ENU and back, through a quaternion) is done here
too, so that a run over topics and a direct run of one scenario agree to the last bit.
"""

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from glider_control.control import ControlParams, ControlState, control_step
from glider_guidance.guidance import GuidanceParams, GuidanceState, guidance_step
from glider_model.current import CurrentParams, CurrentState, current_step_in_place
from glider_model.frames import (
    odometry_from_wire,
    odometry_to_wire,
    reference_from_wire,
    reference_to_wire,
    water_from_wire,
    water_to_wire,
    wrench_to_wire,
)
from glider_model.kernel import kernel
from glider_model.plant import (
    PlantParams,
    PlantState,
    not_finite,
    plant_finished,
    plant_joints,
    plant_measurement,
    plant_step,
    state_fault,
)
from glider_model.signals import TICK_S, Joints

#: Columns of a log row: what the topics of one tick carry, as on the wire, and three flags.
COLUMNS = {
    'odom': slice(0, 13),
    'joint_states': slice(13, 16),
    'current_velocity': slice(16, 19),
    'reference': slice(19, 32),
    'tracking_error': slice(32, 35),
    'current_estimate': slice(35, 38),
    'command': slice(38, 41),
    'wrench': slice(41, 44),
    'adaptation': slice(44, 57),
    'stage': 57,
    'infeasible': 58,
    'saturation': 59,
}
ROW = 60
#: Block that a column comes from, where it is not the plant.
_BLOCKS = {
    'current_velocity': 'current',
    **dict.fromkeys(('reference', 'tracking_error', 'current_estimate'), 'guidance'),
    **dict.fromkeys(('command', 'wrench', 'adaptation'), 'control'),
}
#: Ticks that are flown before the log is handed on: one hour.
BLOCK_TICKS = 36000


class NotFiniteError(Exception):
    """A flight came to numbers that are none. The message says which, and when."""


class MissionParams(NamedTuple):
    """Parameters of the four blocks."""

    plant: PlantParams
    current: CurrentParams
    guidance: GuidanceParams
    control: ControlParams


class MissionState(NamedTuple):
    """States of the four blocks."""

    plant: PlantState
    current: CurrentState
    guidance: GuidanceState
    control: ControlState


@kernel
def put(log, row, start, values):
    """Write numbers into a row, from a column on."""
    for i, value in enumerate(values):
        log[row, start + i] = value


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
    plant, current, guidance, control = state
    for row in range(log.shape[0]):
        odometry_wire = odometry_to_wire(plant_measurement(plant, params.plant))
        odometry = odometry_from_wire(odometry_wire)
        joints = plant_joints(plant)
        position = (odometry.p_n, odometry.p_e, odometry.p_d)
        current, water = current_step_in_place(
            current, position, plant.tick * dt, params.current, dt
        )
        water_wire = water_to_wire(water)
        guidance, guided = guidance_step(guidance, odometry, params.guidance, dt)
        reference_wire = reference_to_wire(guided.reference)
        reference = reference_from_wire(reference_wire)
        control, controlled = control_step(
            control, odometry, joints, reference, params.control, dt
        )
        put(log, row, 0, odometry_wire)
        put(log, row, 13, joints)
        put(log, row, 16, water_wire)
        put(log, row, 19, reference_wire)
        put(log, row, 32, guided.error)
        put(log, row, 35, water_to_wire(guided.current))
        put(log, row, 38, controlled.command)
        put(log, row, 41, wrench_to_wire(controlled.wrench))
        put(log, row, 44, controlled.adaptation)
        log[row, 57] = guided.stage
        log[row, 58] = guided.infeasible
        log[row, 59] = controlled.saturation
        finished = plant_finished(plant, params.plant)
        plant = plant_step(
            plant, controlled.command, water_from_wire(water_wire), params.plant, dt
        )
        if finished:
            return MissionState(plant, current, guidance, control), row + 1, True
    return MissionState(plant, current, guidance, control), log.shape[0], False


def _finite_rows(log: np.ndarray) -> int:
    """Number of rows before the first one with a number that is not finite."""
    if np.isfinite(log.sum()):
        return len(log)
    wrong = np.flatnonzero(~np.isfinite(log).all(axis=1))
    return int(wrong[0]) if len(wrong) else len(log)


def _fault(row: np.ndarray, tick: int) -> str:
    """What of a log row is not finite, in words; the first in the order of the blocks."""
    odometry = odometry_from_wire(tuple(row[COLUMNS['odom']]))
    fault = state_fault(odometry, Joints(*row[COLUMNS['joint_states']]), tick)
    wrong = (name for name in _BLOCKS if not np.isfinite(row[COLUMNS[name]]).all())
    return fault or next(not_finite(f'{_BLOCKS[name]}: {name}', tick) for name in wrong)


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
