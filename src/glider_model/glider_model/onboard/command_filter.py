# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""Second-order command filter with a rate limit (Farrell, Polycarpou, Sharma and Dong 2009).

Turns a raw command into one that a vehicle can follow, and gives its derivative without
differentiating.
"""

from typing import NamedTuple

from glider_base.frames import wrap_angle
from glider_base.kernel import kernel


class Filtered(NamedTuple):
    """A filtered command and its rate."""

    value: float
    rate: float


class FilterParams(NamedTuple):
    """Natural frequency (rad/s) and largest rate (1/s of the value's unit). Damping is 1."""

    frequency: float
    rate_limit: float


@kernel
def _clip(number, limit):
    return min(limit, max(-limit, number))


@kernel
def filter_error(state, error, command_rate, params, dt):
    """One step of ``dt`` s toward a command that is ``error`` away from the filtered value.

    A command that moves at a known rate (1/s of its unit) is followed without lag.
    """
    pull = _clip(0.5 * params.frequency * error + command_rate, params.rate_limit)
    rate = state.rate + dt * 2.0 * params.frequency * (pull - state.rate)
    return Filtered(state.value + dt * rate, rate)


@kernel
def filter_command(state, command, params, dt):
    """One step toward ``command``."""
    return filter_error(state, command - state.value, 0.0, params, dt)


@kernel
def filter_angle(state, command, command_rate, params, dt):
    """One step toward an angle (rad), the short way round; the value stays in [-pi, pi)."""
    moved = filter_error(state, wrap_angle(command - state.value), command_rate, params, dt)
    return Filtered(wrap_angle(moved.value), moved.rate)
