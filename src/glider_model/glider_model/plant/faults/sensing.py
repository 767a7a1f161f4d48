# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""What faults do to what the vehicle tells: its sensors, and those of its own health.

`with_faults` is a slot, whose body without faults hands on what it is given.
"""

import math

import numpy as np

from glider_base.frames import euler_from_quaternion, quaternion_from_euler, swap_world
from glider_base.kernel import kernel, replace
from glider_base.slot import only_for
from glider_model.ocean.density import depth_at, pressure_at
from glider_model.plant.faults import kinds
from glider_model.plant.faults.kinds import (
    ATTITUDE,
    DEPTH,
    FIX,
    PLACE,
    RATES,
    VELOCITY,
    FaultParams,
    FaultState,
    any_begun,
    begun,
    summed,
)
from glider_model.plant.sensors import HAS_FIX, NO_FIX

#: Of water in the hull the detector notices this much (kg).
NOTICED_KG = 0.01
#: Metres in a degree of latitude.
_METRES_PER_DEG = 111195.0


@only_for(FaultParams, lambda numbers, state, sensors, params: numbers)
@kernel
def with_faults(numbers, state, sensors, params):
    """Numbers of the topics of a tick, in the order of the plant's outputs, as faults make them.

    ``numbers`` are as without. ``state`` is that of the plant.
    """
    faults = begun(state, params)
    if not any_begun(faults):
        return numbers
    total = summed(faults, state.tick, params)
    truth, position, imu, pressure, fix = numbers[:5]
    health, battery, joints = numbers[-3:]
    if total[kinds.NO_FIXES] > 0.0:
        fix = (NO_FIX, 0.0, 0.0, 0.0, 0.0)
    right = _seen((truth, position, imu, pressure, fix), sensors)
    seen = _wrong(right, faults.shown, total)
    if sensors.has_position:
        position = _position(position, seen, right)
    if sensors.has_parts:
        imu = _imu(imu, seen, right)
        if seen[DEPTH] != right[DEPTH]:
            pressure = (pressure_at(seen[DEPTH]),)
        if seen[FIX] != right[FIX] or seen[FIX + 1] != right[FIX + 1]:
            variance = sensors.gps.std * sensors.gps.std
            fix = (seen[FIX + 2], seen[FIX], seen[FIX + 1], variance, variance)
    health, battery = _health(health, total), _battery(battery, total)
    return (truth, position, imu, pressure, fix) + numbers[5:-3] + (health, battery, joints)


@kernel
def remembered(faults, numbers, sensors):
    """State of the faults for the tick after one of which these are the numbers measured."""
    return FaultState(faults.began, _seen(numbers[:5], sensors))


@kernel
def _seen(numbers, sensors):
    """What the sensors show, by the places of `kinds`."""
    _, position, imu, pressure, fix = numbers
    seen = np.zeros(kinds.SHOWN)
    q, rates, depth = imu[:4], imu[4:7], 0.0
    if sensors.has_position:
        q, rates, depth = position[3:7], position[10:], -position[2]
        seen[PLACE], seen[PLACE + 1] = position[1], position[0]
        seen[VELOCITY] = position[7]
        seen[VELOCITY + 1], seen[VELOCITY + 2] = -position[8], -position[9]
    elif sensors.has_parts:
        depth = depth_at(pressure[0])
    q = swap_world(q[0], q[1], q[2], q[3])
    seen[0], seen[1], seen[2] = euler_from_quaternion(q[0], q[1], q[2], q[3])
    seen[RATES], seen[RATES + 1], seen[RATES + 2] = rates[0], -rates[1], -rates[2]
    seen[DEPTH] = depth
    seen[FIX], seen[FIX + 1], seen[FIX + 2] = fix[1], fix[2], fix[0]
    return seen


@kernel
def _wrong(right, shown, total):
    """What they show with their faults, where ``shown`` is what they showed the tick before."""
    seen = right.copy()
    seen[2] += total[kinds.DEVIATES] * math.sin(right[2])
    seen[2] += total[kinds.DEVIATES + 1] * math.cos(right[2])
    for k in range(kinds.SHOWN):
        error = total[kinds.ERROR + k]
        if k >= FIX:
            error = _of_fix(k, error, right)
        seen[k] += error
        if total[kinds.IS_OLD + k] > 0.0:
            seen[k] = shown[k]
    return seen


@kernel
def _of_fix(k, error, right):
    """Error (m) of a number of a fix in its own unit; 0 where there is none."""
    if right[FIX + 2] != HAS_FIX or k == FIX + 2:
        return 0.0
    east = math.cos(math.radians(right[FIX])) if k == FIX + 1 else 1.0
    return error / (_METRES_PER_DEG * east)


@kernel
def _attitude(q, seen, right):
    """Quaternion (ENU / FLU) that is shown for ``q``; without a fault the very same."""
    for k in range(ATTITUDE, ATTITUDE + 3):
        if seen[k] != right[k]:
            x = quaternion_from_euler(seen[0], seen[1], seen[2])
            return swap_world(x[0], x[1], x[2], x[3])
    return q


@kernel
def _flu(seen, first):
    """Three numbers of the body axes as on the wire."""
    return seen[first], -seen[first + 1], -seen[first + 2]


@kernel
def _position(position, seen, right):
    """Numbers of measured_odom; those without a fault are the very same."""
    place = (seen[PLACE + 1], seen[PLACE], -seen[DEPTH])
    q = _attitude(position[3:7], seen, right)
    return place + q + _flu(seen, VELOCITY) + _flu(seen, RATES)


@kernel
def _imu(imu, seen, right):
    """Numbers of imu; those without a fault are the very same."""
    return _attitude(imu[:4], seen, right) + _flu(seen, RATES) + imu[7:]


@kernel
def _health(health, total):
    """What the health sensors say of it."""
    return replace(
        health,
        leak=1.0 if total[kinds.WATER] >= NOTICED_KG else health.leak,
        vacuum_pa=max(0.0, health.vacuum_pa - total[kinds.PASCALS]),
        contact_age_s=max(health.contact_age_s, total[kinds.ALONE_S]),
    )


@kernel
def _battery(battery, total):
    """What the battery says of itself; without a fault the very same."""
    voltage = battery.voltage
    if total[kinds.VOLTS] > 0.0:
        voltage = np.float64(np.float32(max(0.0, voltage - total[kinds.VOLTS])))
    return replace(battery, voltage=voltage)
