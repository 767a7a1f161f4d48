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
from numba.core import types
from numba.experimental import structref
from numba.extending import overload

from glider_base.frames import odometry_from_wire, water_to_wire
from glider_base.kernel import INLINED, kernel
from glider_base.kernels.packing import packed, pour, put
from glider_base.signals import TICK_S, Joints
from glider_base.wiring import FIELDS, publisher
from glider_control.block import control_tick
from glider_control.control import ControlParams, ControlState
from glider_guard.block import guard_tick
from glider_guard.guard import GuardParams, GuardState
from glider_guidance.block import guidance_tick
from glider_guidance.guidance import GuidanceParams, GuidanceState
from glider_mission.blocks import BLOCK_TICKS, COLUMNS, ROW
from glider_model.ocean.current import CurrentParams, CurrentState, current_step_in_place
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


@structref.register
class HeldType(types.StructRef):
    """Type of `HeldMission` in compiled code."""

    @property
    def key(self):
        """What tells it from others: the types of its fields. numba goes by their names alone."""
        return self._fields


class HeldMission(structref.StructRefProxy):
    """State and parameters of a mission, where compiled code finds them and changes them.

    To hand a state to Python and back costs many times what the tick itself does.
    """


structref.define_boxing(HeldType, HeldMission)


def _empty(state, params):
    return SimpleNamespace()


@overload(_empty, jit_options=INLINED)
def _new_empty(state, params):
    kind = HeldType([('state', state.instance_type), ('params', params.instance_type)])
    return lambda state, params: structref.new(kind)


@kernel
def _hold(state, params):
    held = _empty(state[0], params[0])
    pour(held, 'state', state)
    pour(held, 'params', params)
    return held


def hold(state: MissionState, params: MissionParams) -> HeldMission:
    """Have a mission held. The state that was given does not change with it."""
    return _hold(packed(state), packed(params))


@kernel
def fly_held(held, log, dt):
    """Fly until the log is full or the mission ends; rows filled, and whether it has ended.

    Where a law raises, what is held has not changed.
    """
    in_plant, in_current, in_navigation, in_guidance, in_control, in_guard = held.params
    plant, current, navigation, guidance, control, guard = held.state
    current = CurrentState(current.tick, current.values.copy())  # changed where they lie
    rows, finished = 0, False
    for row in range(log.shape[0]):
        t_s = plant.tick * dt
        numbers, finished = plant_outputs(plant, in_plant)
        measured = Measured(*numbers)
        joints, pressure = measured.joint_states, measured.pressure
        sensors = (measured.measured_odom, measured.imu, pressure, measured.fix, measured.altitude)
        place = odometry_from_wire(measured.ground_truth_odom)
        position = (place.p_n, place.p_e, place.p_d)
        current, velocity = current_step_in_place(current, position, t_s, in_current, dt)
        water = water_to_wire(velocity)
        navigation, estimated, phase = navigation_tick(
            navigation, t_s, (joints, *sensors), in_navigation, dt
        )
        odom = estimated[0]
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
        if finished:
            break
    held.state = MissionState(
        plant=plant,
        current=current,
        navigation=navigation,
        guidance=guidance,
        control=control,
        guard=guard,
    )
    return rows, finished


@kernel
def held_state(held):
    """What is held, a `MissionState`."""
    return held.state


@kernel
def _set_state(held, state):
    pour(held, 'state', state)


def set_held(held: HeldMission, state: MissionState) -> None:
    """Hold another state."""
    _set_state(held, packed(state))


@kernel
def _set_params(held, params):
    pour(held, 'params', params)


def set_held_params(held: HeldMission, params: MissionParams) -> None:
    """Fly on with other parameters."""
    _set_params(held, packed(params))


def fly(
    state: MissionState, params: MissionParams, log: np.ndarray, dt: float
) -> tuple[MissionState, int, bool]:
    """Fly until the log, float64[n, ROW], is full or the mission ends, in ticks of ``dt`` s.

    Returns the state after the last row that was filled in, the number of rows, and whether the
    mission has ended. Neither state nor params are changed.
    """
    held = hold(state, params)
    rows, finished = fly_held(held, log, dt)
    return held_state(held), rows, finished


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
    held = hold(state, params)
    return blocks_of(lambda log: fly_held(held, log, TICK_S))
