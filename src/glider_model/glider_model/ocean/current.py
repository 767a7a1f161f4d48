# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""Velocity of the water: a sum of components by depth and time, and one field by place too.

`current_step` reads the arrays that `CurrentSettings.params` makes of what a person writes. The
random part draws its numbers from a hash of (seed, component, tick).
"""

import math
from typing import NamedTuple

import numpy as np

from glider_base.kernel import kernel
from glider_base.noise import normal_pair
from glider_base.signals import Water
from glider_model.ocean.field import bracket, field_velocity

#: Kinds of components.
CONSTANT, POWER_SHEAR, EXPONENTIAL_SHEAR, TABLE, TIDAL, GAUSS_MARKOV, STEPS = range(7)
#: A step counts as reached this long before its time (s): ticks of 0.1 s are not exact in binary.
_STEP_TOLERANCE_S = 1e-6


class CurrentParams(NamedTuple):
    """Components of a current field, flattened; row ``i`` of each array is component ``i``."""

    kind: np.ndarray  #: int64[n], which field it is
    numbers: np.ndarray  #: float64[n, 6], its constants in SI units; their meaning is the kind's
    first: np.ndarray  #: int64[n], first row in `table`, or first index in `CurrentState.values`
    last: np.ndarray  #: int64[n], one past the last row in `table`
    stream: np.ndarray  #: uint64[n], start of its stream of random numbers
    #: float64[m, 4], rows of depth (m) or time (s), then north, east, down (m/s)
    table: np.ndarray
    field: NamedTuple  #: of the field by place that was chosen


class CurrentState(NamedTuple):
    """What a current field remembers from tick to tick."""

    tick: int  #: number of steps taken
    values: np.ndarray  #: float64[2 g], north and east velocity of each Gauss-Markov part (m/s)


@kernel
def current_initial(params: CurrentParams) -> CurrentState:
    """State before the first step, Gauss-Markov parts drawn from their stationary distribution."""
    count = 0
    for i in range(len(params.kind)):
        if params.kind[i] == GAUSS_MARKOV:
            count += 2
    values = np.zeros(count)
    for i in range(len(params.kind)):
        if params.kind[i] == GAUSS_MARKOV:
            north, east = normal_pair(params.stream[i], 0)
            values[params.first[i]] = params.numbers[i, 0] * north
            values[params.first[i] + 1] = params.numbers[i, 0] * east
    return CurrentState(0, values)


@kernel
def _profile(depth, table, first, last):
    """Velocity at ``depth`` by linear interpolation in rows [first, last), held at both ends."""
    low, high, part = bracket(depth, table[first:last, 0])
    one, other = table[first + low], table[first + high]
    return (
        one[1] + part * (other[1] - one[1]),
        one[2] + part * (other[2] - one[2]),
        one[3] + part * (other[3] - one[3]),
    )


@kernel
def _latest_step(t_s, table, first, last):
    """Velocity of the latest row in [first, last) whose time has come; none before the first."""
    v_n, v_e = 0.0, 0.0
    for row in range(first, last):
        if table[row, 0] > t_s + _STEP_TOLERANCE_S:
            break
        v_n, v_e = table[row, 1], table[row, 2]
    return v_n, v_e


@kernel
def current_step(
    state: CurrentState, position, t_s, params: CurrentParams, dt
) -> tuple[CurrentState, Water]:
    """Water velocity (m/s, NED) at a place and time, and the state of the field ``dt`` s later.

    The position p_NB is 3 numbers (m, NED), and above the surface counts as the surface; ``t_s``
    is the time since the start (s), of which is the state.
    """
    values = state.values.copy()
    water = current_in_place(state.tick, values, position, t_s, params, dt)
    return CurrentState(state.tick + 1, values), water


@kernel
def current_in_place(tick, values, position, t_s, params, dt):
    """Water velocity of `current_step` for a loop that owns its state, and counts the ticks.

    The values are changed where they lie: it allocates nothing.
    """
    depth = max(position[2], 0.0)
    numbers = params.numbers
    v_n, v_e, v_d = 0.0, 0.0, 0.0
    for i in range(len(params.kind)):
        kind = params.kind[i]
        first, last = params.first[i], params.last[i]
        if kind == CONSTANT:
            v_n += numbers[i, 0]
            v_e += numbers[i, 1]
        elif kind == POWER_SHEAR:
            share = max(1.0 - depth / numbers[i, 2], 0.0) ** numbers[i, 3]
            v_n += share * numbers[i, 0]
            v_e += share * numbers[i, 1]
        elif kind == EXPONENTIAL_SHEAR:
            share = math.exp(-depth / numbers[i, 2])
            v_n += share * numbers[i, 0]
            v_e += share * numbers[i, 1]
        elif kind == TABLE:
            north, east, down = _profile(depth, params.table, first, last)
            v_n += north
            v_e += east
            v_d += down
        elif kind == TIDAL:
            angle = numbers[i, 4] * t_s + numbers[i, 5]
            along, across = math.cos(angle), math.sin(angle)
            v_n += along * numbers[i, 0] + across * numbers[i, 2]
            v_e += along * numbers[i, 1] + across * numbers[i, 3]
        elif kind == GAUSS_MARKOV:
            v_n += values[first]
            v_e += values[first + 1]
            # exact for any dt, so that the statistics do not depend on it
            keep = math.exp(-dt / numbers[i, 1])
            fresh = numbers[i, 0] * math.sqrt(1.0 - keep * keep)
            north, east = normal_pair(params.stream[i], tick + 1)
            values[first] = keep * values[first] + fresh * north
            values[first + 1] = keep * values[first + 1] + fresh * east
        elif kind == STEPS:
            north, east = _latest_step(t_s, params.table, first, last)
            v_n += north
            v_e += east
    north, east, down = field_velocity((position[0], position[1], depth), t_s, params.field)
    return Water(v_n + north, v_e + east, v_d + down)
