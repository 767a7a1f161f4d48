# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""What the vehicle says of itself: where its actuators are, and how it is.

Positions have noise, a function of (seed, tick). The hull has no model of its own: without faults
it is as it was at the start.
"""

from typing import NamedTuple

import numpy as np

from glider_base.kernel import kernel
from glider_base.noise import normal_pair, random_stream
from glider_base.signals import TICK_S, Health, Joints

#: Sets this stream apart from those of the sensors and of the current.
_STREAM_OFFSET, _STREAM = 2**32, 3
#: Pressure in a closed hull below that of the air (Pa): 7 inches of mercury, in the middle of what
#: a Slocum accepts (4 to 12).
VACUUM_PA = 23700.0


class Readings(NamedTuple):
    """Noise of the positions as the kernels see it."""

    stream: np.uint64  #: start of the random stream
    std: Joints  #: standard deviations (kg, m, rad, rad)
    is_noisy: bool  #: any of them is > 0


def make_readings(vehicle, seed: int) -> Readings:
    """Noise of the actuators of a vehicle (`VehicleParams`) under one seed."""
    std = vehicle.errors.noise
    return Readings(np.uint64(random_stream(seed, _STREAM_OFFSET, _STREAM)), std, any(std))


@kernel
def noise_of_readings(tick, params):
    """Noise of the positions at a tick (kg, m, rad, rad)."""
    first = np.uint64(2) * np.uint64(tick)
    n_1, n_2 = normal_pair(params.stream, first)
    n_3, n_4 = normal_pair(params.stream, first + np.uint64(1))
    std = params.std
    return Joints(std.m_b * n_1, std.x_p * n_2, std.mu * n_3, std.delta * n_4)


@kernel
def read(joints, tick, params):
    """Where actuators that are at ``joints`` say that they are; without noise the very same."""
    if not params.is_noisy:
        return joints
    n = noise_of_readings(tick, params)
    return Joints(joints.m_b + n.m_b, joints.x_p + n.x_p, joints.mu + n.mu, joints.delta + n.delta)


@kernel
def health_of(state):
    """What the health sensors of a vehicle say at a tick (`Health`), all well but for contact."""
    return Health(0.0, VACUUM_PA, state.surfacing.silent_ticks * TICK_S)
