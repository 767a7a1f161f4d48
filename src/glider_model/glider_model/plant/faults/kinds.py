# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""Which faults there are at a tick, and what they add up to.

A fault begins at the first tick at which its conditions hold, and that tick is all that is
remembered of it: what it does then is a pure function of the tick, random numbers included.
"""

from typing import NamedTuple

import numpy as np

from glider_base.frames import rotate_to_ned
from glider_base.kernel import kernel
from glider_base.noise import normal_pair, uniform
from glider_base.signals import TICK_S
from glider_base.slot import only_for

#: Kinds. A stuck actuator is a slow one, and a frozen sensor one that always drops out.
LEAK, MASS, FOULING, LOOSE, GUST = range(5)
SLOW, OFFSET, PARTIAL, JAM = range(5, 9)
DROPOUT, BIASED, SPIKE, NOISIER = range(9, 13)
COMPASS, GPS_SILENT, BATTERY, VACUUM, NO_CONTACT = range(13, 18)
#: What a person calls them. Of messages, the last one, the vehicle knows nothing.
KINDS = (
    *('leak', 'mass', 'fouling', 'loose_roll_mass', 'gust'),
    *('slow', 'offset', 'partial', 'jam'),
    *('dropout', 'biased', 'spike', 'noisier'),
    *('compass', 'gps_silent', 'battery', 'vacuum', 'no_contact', 'message'),
)
#: Phases.
ANY, DIVE, TURN, CLIMB, SURFACE = range(5)
#: A vehicle that sinks or rises slower than this does neither (m/s),
STEADY_MPS = 0.03
#: and is at depth below this (m), at the surface above this (m).
DEEP_M, SURFACE_M = 3.0, 1.5

#: Numbers that sensors show: roll, pitch, heading, three rates, depth, north, east, three
#: velocities, latitude, longitude, whether there is a fix.
SHOWN = 15
ATTITUDE, RATES, DEPTH, PLACE, VELOCITY, FIX = 0, 3, 6, 7, 9, 12
#: What faults add up to: places in an array.
#: heaviness and detected water (kg), factors, shares of no roll moment and of no fix,
HEAVY, WATER, DRAG, LIFT, NO_ROLL, NO_FIXES = range(6)
#: loss of voltage (V) and of vacuum (Pa), time without contact (s),
VOLTS, PASCALS, ALONE_S = range(6, 9)
#: velocity of a gust (m/s), parts of the deviation with the sine and the cosine of heading (rad);
BLOWS, DEVIATES = 9, 12
#: of each actuator the factor on its rate, its range and its offset, as shares of its range;
RATE, LOW, HIGH, AWAY = range(14, 30, 4)
#: of each number that is shown its error, and whether it is that of the tick before.
ERROR, IS_OLD = 30, 30 + SHOWN
_SUM = IS_OLD + SHOWN


class NoFaults(NamedTuple):
    """Parameters of a vehicle in which nothing breaks: nothing of this is compiled for it."""


class FaultParams(NamedTuple):
    """Faults as the kernels see them, one row each."""

    kind: np.ndarray  #: int64[n]
    target: np.ndarray  #: int64[n]: actuator, or the first number of a sensor
    count: np.ndarray  #: int64[n]: its numbers
    numbers: np.ndarray  #: float64[n, 4], by kind
    from_tick: np.ndarray  #: int64[n]
    depth: np.ndarray  #: float64[n] (m); NaN: at any
    phase: np.ndarray  #: int64[n]
    ticks: np.ndarray  #: int64[n]: how long it lasts
    stream: np.ndarray  #: uint64[n]: start of its random stream
    repeats: bool  #: a sensor shows what it showed before, so that this is to be remembered


class NoFaultState(NamedTuple):
    """State of them."""


class FaultState(NamedTuple):
    """What is remembered of faults. The arrays are never changed, but replaced."""

    began: np.ndarray  #: int64[n]: tick at which each began; -1: not yet
    shown: np.ndarray  #: float64[SHOWN]: what sensors showed at the tick before, if one repeats it


@only_for(FaultParams, lambda state, params: state.faults)
@kernel
def begun(state, params):
    """State of the faults at a tick, with those that begin then; ``state`` is the plant's.

    What was shown is that of the tick before still.
    """
    faults, motion = state.faults, state.motion
    began = faults.began
    down = (
        rotate_to_ned(
            motion.q_w, motion.q_x, motion.q_y, motion.q_z, motion.u, motion.v, motion.w
        )[2]
        + state.water.v_d
    )
    phase = phase_of(motion.p_d, down, state.surfacing.count)
    for i in range(len(began)):
        if faults.began[i] < 0 and is_due(i, state.tick, motion.p_d, phase, params):
            began = began.copy()
            began[i] = state.tick
    return FaultState(began, faults.shown)


@kernel
def phase_of(depth, down, surfacings):
    """Phase of a vehicle at a depth (m) that moves down (m/s), after so many surfacings."""
    if depth < SURFACE_M and surfacings > 0:
        return SURFACE
    if down > STEADY_MPS:
        return DIVE
    if down < -STEADY_MPS:
        return CLIMB
    return TURN if depth > DEEP_M else ANY


@kernel
def is_due(i, tick, depth, phase, params):
    """Whether all conditions of a fault hold."""
    wanted = params.phase[i]
    if tick < params.from_tick[i] or (wanted != ANY and wanted != phase):
        return False
    if np.isnan(params.depth[i]):
        return True
    if wanted == CLIMB:
        return depth <= params.depth[i]
    return depth >= params.depth[i]


@kernel
def any_begun(faults):
    """Whether there is anything to see of faults."""
    for began in faults.began:
        if began >= 0:
            return True
    return False


@only_for(FaultParams, lambda faults, tick, params: ())
@kernel
def summed(faults, tick, params):
    """What all faults, as of `begun`, add up to at a tick, float64[_SUM] by the places above."""
    total = np.zeros(_SUM)
    total[DRAG] = total[LIFT] = 1.0
    total[RATE : RATE + 4] = 1.0
    total[LOW : LOW + 4] = -1.0
    total[HIGH : HIGH + 4] = 1.0
    for i in range(len(faults.began)):
        if faults.began[i] < 0:
            continue
        elapsed = tick - faults.began[i]
        _in_the_hull(total, i, elapsed, params)
        if elapsed < params.ticks[i]:
            kind, numbers, target = params.kind[i], params.numbers[i], params.target[i]
            _on_the_body(total, kind, elapsed * TICK_S, numbers)
            _on_an_actuator(total, kind, target, elapsed, numbers)
            _on_a_sensor(total, i, tick, params)
            if kind == BATTERY:
                total[VOLTS] += numbers[0] * _grown(elapsed * TICK_S, numbers[1])
            elif kind == NO_CONTACT:
                total[ALONE_S] = max(total[ALONE_S], elapsed * TICK_S)
            elif kind == GPS_SILENT:
                total[NO_FIXES] = 1.0
    return total


@kernel
def _grown(elapsed_s, over_s):
    """Share (0 to 1) of what comes about evenly in ``over_s``."""
    return 1.0 if elapsed_s >= over_s else elapsed_s / over_s


@kernel
def _in_the_hull(total, i, elapsed, params):
    """What does not go away when the fault is over; and gusts, which take their time to fall."""
    kind, numbers = params.kind[i], params.numbers[i]
    lasted_s = min(elapsed, params.ticks[i]) * TICK_S
    if kind == LEAK:
        water = min(numbers[1], numbers[0] * lasted_s)
        total[HEAVY] += water
        total[WATER] += numbers[2] * water
    elif kind == VACUUM:
        total[PASCALS] += numbers[0] * lasted_s
    elif kind == GUST:
        over_s = max(0, elapsed - params.ticks[i]) * TICK_S
        share = max(0.0, _grown(lasted_s, numbers[3]) - over_s / numbers[3])
        total[BLOWS : BLOWS + 3] += share * numbers[:3]


@kernel
def _on_the_body(total, kind, elapsed_s, numbers):
    if kind == MASS:
        total[HEAVY] += numbers[0]
    elif kind == FOULING:
        share = _grown(elapsed_s, numbers[2])
        total[DRAG] *= 1.0 + share * (numbers[0] - 1.0)
        total[LIFT] *= 1.0 + share * (numbers[1] - 1.0)
    elif kind == LOOSE:
        total[NO_ROLL] = 1.0


@kernel
def _on_an_actuator(total, kind, target, elapsed, numbers):
    if kind == SLOW:
        total[RATE + target] *= numbers[0]
    elif kind == JAM:
        period = max(1, round(numbers[0] / TICK_S))
        if elapsed % period < numbers[1] * period:
            total[RATE + target] = 0.0
    elif kind == OFFSET:
        total[AWAY + target] += numbers[0]
    elif kind == PARTIAL:
        total[LOW + target] = max(total[LOW + target], numbers[0])
        total[HIGH + target] = min(total[HIGH + target], numbers[1])


@kernel
def _on_a_sensor(total, i, tick, params):
    kind, numbers = params.kind[i], params.numbers[i]
    if kind == COMPASS:
        total[DEVIATES] += numbers[0]
        total[DEVIATES + 1] += numbers[1]
    if kind < DROPOUT or kind > NOISIER:
        return
    chance = uniform(params.stream[i], np.uint64(2 * tick))
    for k in range(params.target[i], params.target[i] + params.count[i]):
        if kind == DROPOUT:
            if chance <= numbers[0] and tick > 0:
                total[IS_OLD + k] = 1.0
        elif kind == BIASED:
            total[ERROR + k] += numbers[0]
        elif kind == SPIKE:
            if chance < numbers[1]:
                sign = uniform(params.stream[i], np.uint64(2 * tick + 1))
                total[ERROR + k] += numbers[0] if sign < 0.5 else -numbers[0]
        else:
            number = np.uint64(SHOWN * tick + k)
            total[ERROR + k] += numbers[0] * normal_pair(params.stream[i], number)[0]
