# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""Flights of the plant: the tick loop compiled, rows as arrays."""

import numpy as np
import pytest

from glider_base.frames import quaternion_from_euler
from glider_base.kernel import kernel
from glider_base.signals import TICK_S, Joints, Water
from glider_model.ocean.water import WaterSettings
from glider_model.plant.energy import FULL
from glider_model.plant.faults.kinds import NoFaults, NoFaultState
from glider_model.plant.motion import Motion
from glider_model.plant.plant import (
    LAUNCHED,
    NO_DIVES,
    PlantParams,
    PlantState,
    dive_m,
    plant_step,
)
from glider_model.plant.sensors import NO_SAMPLE, SensorSettings, make_readings
from glider_model.vehicle.energy import NO_ENERGY
from glider_model.vehicle.file import load_vehicle


@kernel
def _fly(state, commands, waters, params, dt):
    count = len(commands)
    rows = np.empty((count + 1, 17))
    for i in range(count + 1):
        motion, joints = state.motion, state.joints
        for j, number in enumerate(motion):
            rows[i, j] = number
        for j, number in enumerate(joints):
            rows[i, 13 + j] = number
        if i < count:
            command = Joints(commands[i, 0], commands[i, 1], commands[i, 2], commands[i, 3])
            water = Water(waters[i, 0], waters[i, 1], waters[i, 2])
            state = plant_step(state, command, water, params, dt)
    return rows, state


class Flight:
    """History of a flight; row 0 is the start. Columns are those of Motion, then of Joints."""

    def __init__(self, rows, state):
        self.rows, self.state = rows, state
        self.t_s = TICK_S * np.arange(len(rows))

    def __getattr__(self, name):
        return self.rows[:, (*Motion._fields, *Joints._fields).index(name)]

    @property
    def position(self):
        return self.rows[:, 0:3]

    @property
    def quaternion(self):
        return self.rows[:, 3:7]

    @property
    def velocity(self):
        """Velocity through the water, then angular rates (m/s, rad/s)."""
        return self.rows[:, 7:13]

    @property
    def euler(self):
        """Roll, pitch, heading (rad)."""
        w, x, y, z = self.quaternion.T
        return np.stack(
            [
                np.arctan2(2 * (w * x + y * z), 1 - 2 * (x * x + y * y)),
                np.arcsin(np.clip(2 * (w * y - z * x), -1.0, 1.0)),
                np.arctan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z)),
            ],
            axis=1,
        )


def _plant_params(vehicle='zhang2021', **density):
    params = load_vehicle(vehicle).params() if isinstance(vehicle, str) else vehicle
    return PlantParams(
        params,
        WaterSettings(**density).params(),
        WaterSettings(**density).wind_drift(),
        10**9,
        0,
        0,
        0,
        dive_m(1000.0),
        SensorSettings().params(0),
        NoFaults(),
        NO_ENERGY,
        make_readings(params, 0),
    )


def _start(position=(0.0, 0.0, 100.0), euler=(0.0, 0.0, 0.0), velocity=(), joints=(0.0, 0.0, 0.0)):
    velocity = tuple(float(number) for number in velocity) or (0.4, 0.0, 0.0, 0.0, 0.0, 0.0)
    motion = Motion(
        *(float(number) for number in position), *quaternion_from_euler(*euler), *velocity
    )
    joints = Joints(*(float(number) for number in _with_surface(joints)))
    water = Water(0.0, 0.0, 0.0)
    return PlantState(
        motion, joints, water, 0, NO_DIVES, 0, -1, NO_SAMPLE, LAUNCHED, NoFaultState(), False, FULL
    )


def _with_surface(joints):
    """Positions of all actuators; without that of a steering surface, it is at 0."""
    joints = np.asarray(joints, dtype=float)
    return joints if joints.shape[-1] == 4 else np.insert(joints, 3, 0.0, axis=-1)


def _flight(params, state, seconds, commands=None, waters=(0.0, 0.0, 0.0)):
    count = round(seconds / TICK_S)
    commands = state.joints if commands is None else commands
    arrays = (
        np.ascontiguousarray(np.broadcast_to(array, (count, array.shape[-1])))
        for array in (_with_surface(commands), np.asarray(waters, dtype=float))
    )
    return Flight(*_fly(state, *arrays, params, TICK_S))


@pytest.fixture(scope='session')
def plant_params():
    """``plant_params(vehicle, **density)``: PlantParams of a vehicle by name or parameters."""
    return _plant_params


@pytest.fixture(scope='session')
def start():
    """``start(position, euler, velocity, joints)``: a PlantState at tick 0."""
    return _start


@pytest.fixture(scope='session')
def fly():
    """``fly(params, state, seconds, commands, waters)``: a Flight.

    Commands (default: actuators stay) and waters are one row, or one row per tick.
    """
    return _flight
