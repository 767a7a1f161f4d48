# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""What the vertical rate tells of the weight: heavier than its pump says, by a leak or by drag.

In a steady glide the polar tells the net heaviness of pitch and vertical rate. By how much that is
more than pump and ballast make is what nobody knows of: water in the hull, growth, a lost wing.
"""

import math
from typing import NamedTuple

from glider_guard.rows import TOO_HEAVY
from glider_model.base.kernel import kernel
from glider_model.onboard.glide_polar import Polar, glide_net_heaviness

#: Shallower (rad) or slower (m/s) than this it is no steady glide.
LEAST_PITCH, LEAST_RATE = math.radians(12.0), 0.03
#: The pump is this near (share of its range) to where it goes.
PUMP_ARRIVED = 0.05


class WeightLimits(NamedTuple):
    """When a vehicle is too heavy."""

    polar: Polar
    ballast: float  #: net heaviness with the pump in the middle (kg)
    most: float  #: that nobody knows of (kg)
    average_s: float
    arrived: float  #: the pump is this near to where it goes (kg)
    rate: float  #: of the pump (kg/s)


class Weight(NamedTuple):
    """What is known of the weight, between two ticks."""

    off: float  #: more than pump and ballast make, averaged (kg)


INITIAL_WEIGHT = Weight(0.0)


@kernel
def stopping_m(theta, rate, limits):
    """Way (m) that a vehicle sinks on while its pump takes off the weight that it sinks by.

    The rate goes with the root of the weight, which falls with time: two thirds of rate by time.
    """
    if rate <= 0.0:
        return 0.0
    weight = glide_net_heaviness(theta, rate, limits.polar)
    return 2.0 / 3.0 * rate * weight / limits.rate


@kernel
def weigh(state, theta, rate, m_b, sent, limits, dt):
    """Take in pitch (rad), vertical rate (m/s, + down) and pump, where it is and is sent (kg).

    Returns
    -------
    Weight
    int
        Rows that hold.
    """
    off = state.off
    glides = abs(theta) > LEAST_PITCH and abs(rate) > LEAST_RATE
    if glides and abs(m_b - sent) <= limits.arrived:
        weight = glide_net_heaviness(theta, rate, limits.polar)
        off += (dt / limits.average_s) * (weight - m_b - limits.ballast - off)
    return Weight(off), TOO_HEAVY if off > limits.most else 0
