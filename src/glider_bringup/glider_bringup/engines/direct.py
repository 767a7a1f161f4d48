# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""The direct engine: the steps of the six nodes in one compiled loop.

What a message would do to the numbers (NED to ENU and back, through a quaternion) is done here
too, so that a run over topics and a direct run of one scenario agree to the last bit.
"""

from collections.abc import Callable, Iterator
from types import SimpleNamespace
from typing import NamedTuple

import numpy as np
from numba.experimental import structref
from numba.extending import overload

from glider_base.frames import odometry_from_wire, water_to_wire
from glider_base.kernel import INLINED, kernel
from glider_base.kernels.holding import Held, HeldType
from glider_base.kernels.packing import put
from glider_base.signals import TICK_S, Joints
from glider_base.wiring import FIELDS, publisher
from glider_control.block import control_tick
from glider_control.control import ControlParams, ControlState
from glider_guard.block import guard_tick
from glider_guard.guard import GuardParams, GuardState
from glider_guidance.block import guidance_tick
from glider_guidance.guidance import GuidanceParams, GuidanceState
from glider_guidance.yo.stage import AT_END_OF_PATH
from glider_mission.blocks import BLOCK_TICKS, COLUMNS, ROW
from glider_model.ocean.current import CurrentParams, CurrentState, current_in_place
from glider_model.plant.block import Measured, plant_move, plant_outputs
from glider_model.plant.plant import PlantParams, PlantState, not_finite, state_fault
from glider_navigation.block import navigation_tick
from glider_navigation.settings import NavigationParams


class FlightError(Exception):
    """A flight cannot go on: a number is none, or a law raises. It says what, and when."""


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


def _empty(blocks):
    return SimpleNamespace()


@overload(_empty, jit_options=INLINED)
def _new_empty(blocks):
    kind = HeldType(list(zip(MissionState._fields, blocks, strict=True)))
    return lambda blocks: structref.new(kind)


@kernel
def _joined(blocks):
    held = _empty(blocks)
    held.plant, held.current, held.navigation = blocks[0], blocks[1], blocks[2]
    held.guidance, held.control, held.guard = blocks[3], blocks[4], blocks[5]
    return held


@kernel
def fly_held(held, log, halts, dt):
    """Rows filled, and whether the mission has ended; see `HeldMission.fly`."""
    in_plant, plant = held.plant.params, held.plant.state
    in_current, current = held.current.params, held.current.state
    in_navigation, navigation = held.navigation.params, held.navigation.state
    in_guidance, guidance = held.guidance.params, held.guidance.state
    in_control, control = held.control.params, held.control.state
    in_guard, guard = held.guard.params, held.guard.state
    flown, values = current.tick, current.values.copy()  # changed where they lie
    rows, finished = 0, False
    for row in range(log.shape[0]):
        t_s = plant.tick * dt
        numbers, finished = plant_outputs(plant, in_plant)
        measured = Measured(*numbers)
        joints, pressure = measured.joint_states, measured.pressure
        sensors = (measured.measured_odom, measured.imu, pressure, measured.fix, measured.altitude)
        place = odometry_from_wire(measured.ground_truth_odom)
        position = (place.p_n, place.p_e, place.p_d)
        velocity = current_in_place(flown + row, values, position, t_s, in_current, dt)
        water = water_to_wire(velocity)
        navigation, estimated, phase = navigation_tick(
            navigation, t_s, (joints, *sensors), in_navigation, dt
        )
        odom, before = estimated[0], guidance.profile.stage
        guidance, guided, stage = guidance_tick(
            guidance, t_s, (odom, measured.altitude), in_guidance, dt
        )
        seen = (guided[0], odom, joints)
        control, controlled, limits = control_tick(control, t_s, seen, in_control, dt)
        condition = (measured.health, measured.battery, pressure, measured.altitude)
        heard = (controlled[0], guided[0], odom, joints, *condition)
        guard, guarded, reported = guard_tick(guard, t_s, heard, in_guard, dt)
        plant = plant_move(plant, (guarded[0], water, guarded[1]), in_plant, dt)
        said = (phase, stage, limits, reported)
        put(log, row, 0, (*numbers, water, *estimated, *guided, *controlled, *guarded, *said))
        rows = row + 1
        if finished or (halts and stage[0] == AT_END_OF_PATH != before):
            break
    held.current.state = CurrentState(flown + rows, values)
    held.plant.state, held.navigation.state = plant, navigation
    held.guidance.state, held.control.state, held.guard.state = guidance, control, guard
    return rows, finished


class HeldMission:
    """A mission in the memory of compiled code, which flies it on.

    To hand a state to Python and back costs many times what the tick itself does. The state that
    was given does not change with it.
    """

    def __init__(self, state: MissionState, params: MissionParams) -> None:
        self._blocks, self._params = tuple(map(Held, state, params)), params
        self.blocks = _joined(tuple(block.held for block in self._blocks))

    @property
    def state(self) -> MissionState:
        """State between two ticks."""
        return MissionState(*(block.state for block in self._blocks))

    @state.setter
    def state(self, state: MissionState) -> None:
        for block, own in zip(self._blocks, state, strict=True):
            block.state = own

    def set_params(self, params: MissionParams) -> None:
        """Fly on with other parameters."""
        for block, own, before in zip(self._blocks, params, self._params, strict=True):
            if own is not before:
                block.set_params(own)
        self._params = params

    def fly(self, log: np.ndarray, halts: bool = False) -> tuple[int, bool]:
        """Fly until the log, float64[n, ROW], is full or the mission ends.

        If it ``halts``, no further than where it comes to the end of its path. Returns how many
        rows were filled, and whether the mission has ended. Where a law raises, the state has not
        changed.
        """
        return fly_held(self.blocks, log, halts, TICK_S)


def fly(
    state: MissionState, params: MissionParams, log: np.ndarray
) -> tuple[MissionState, int, bool]:
    """Fly until the log, float64[n, ROW], is full or the mission ends.

    Returns the state after the last row that was filled in, the number of rows, and whether the
    mission has ended. Neither state nor params are changed.
    """
    held = HeldMission(state, params)
    rows, is_over = held.fly(log)
    return held.state, rows, is_over


def finite_rows(log: np.ndarray) -> int:
    """Number of rows before the first one with a number that is not finite."""
    if np.isfinite(log.sum()):
        return len(log)
    wrong = np.flatnonzero(~np.isfinite(log).all(axis=1))
    return int(wrong[0]) if len(wrong) else len(log)


def fault_of(row: np.ndarray, tick: int) -> str:
    """What of a log row is not finite, in words; the first in the order of the blocks."""
    odometry = odometry_from_wire(tuple(row[COLUMNS['ground_truth/odom']]))
    fault = state_fault(odometry, Joints(*row[COLUMNS['joint_states']]), tick)
    topics = (name for name in COLUMNS if name in FIELDS)
    wrong = (name for name in topics if not np.isfinite(row[COLUMNS[name]]).all())
    return fault or next(not_finite(f'{publisher(name).name}: {name}', tick) for name in wrong)


def blocks_of(
    advance: Callable[[np.ndarray], tuple[int, bool]], ticks: int = BLOCK_TICKS
) -> Iterator[np.ndarray]:
    """Fly block by block; ``advance`` fills rows of a log, and says how many, and if it is over.

    Yields float64[n, ROW], n <= ``ticks``, which is used again for the next block. Raises
    FlightError after the last tick of which every number is finite.
    """
    log = np.empty((ticks, ROW))
    finished, flown = False, 0
    while not finished:
        rows, finished = advance(log)
        good = finite_rows(log[:rows])
        if good:
            yield log[:good]
        if good < rows:
            raise FlightError(fault_of(log[good], flown + good))
        flown += rows


def fly_blocks(state: MissionState, params: MissionParams) -> Iterator[np.ndarray]:
    """Fly a mission block by block; see `blocks_of`. No orders are followed."""
    return blocks_of(HeldMission(state, params).fly)
