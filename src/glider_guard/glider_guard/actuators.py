# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""Actuators that do not follow their commands."""

from typing import NamedTuple

from glider_base.kernel import kernel
from glider_base.signals import Joints
from glider_guard.rows import STUCK_BUOYANCY, STUCK_PITCH, STUCK_ROLL, STUCK_SURFACE, row
from glider_model.vehicle.actuators import MOST_NOISE, doubt, ranges

#: Of the way that its rate allows an actuator, the share that it goes at least if it follows.
STALL_RATE_SHARE = 0.1


class ActuatorLimits(NamedTuple):
    """What actuators of a vehicle can do, and when they do not follow."""

    range: Joints
    tolerance: Joints  #: off its command by less an actuator is there
    progress: Joints  #: least way in ``stall_s`` of an actuator that follows
    stall_s: float


class Follower(NamedTuple):
    """Where an actuator is, and since when it does not follow its command."""

    position: float
    way: float  #: towards its command since it last followed, wherever that went meanwhile
    waits_s: float  #: time since then


class Followers(NamedTuple):
    """All actuators."""

    buoyancy: Follower
    pitch: Follower
    roll: Follower
    surface: Follower  #: the steering surface


_STILL = Follower(0.0, 0.0, 0.0)
INITIAL_FOLLOWERS = Followers(_STILL, _STILL, _STILL, _STILL)


def make_limits(vehicle, follow_share: float, stall_s: float) -> ActuatorLimits:
    """Limits of a vehicle (VehicleParams), beyond its dead bands and what its noise may be."""
    rates = Joints(vehicle.m_b_rate, vehicle.x_p_rate, vehicle.mu_rate, vehicle.delta_rate)
    tolerance = Joints(
        *(
            max(follow_share * most, off)
            for most, off in zip(ranges(vehicle), doubt(vehicle.errors), strict=True)
        )
    )
    progress = (
        max(min(off, STALL_RATE_SHARE * rate * stall_s), 2.0 * MOST_NOISE * noise)
        for off, rate, noise in zip(tolerance, rates, vehicle.errors.noise, strict=True)
    )
    return ActuatorLimits(ranges(vehicle), tolerance, Joints(*progress), stall_s)


@kernel
def _follow(state, position, command, tolerance, progress, dt):
    """Whether an actuator follows: `Follower` of the next tick."""
    moved = position - state.position
    way = max(0.0, state.way + (moved if command > state.position else -moved))
    if abs(command - position) <= tolerance or way > progress:
        return Follower(position, 0.0, 0.0)
    return Follower(position, way, state.waits_s + dt)


@kernel
def follow(
    state: Followers, joints: Joints, command: Joints, limits: ActuatorLimits, dt: float
) -> tuple[Followers, int]:
    """All actuators a tick later, and the rows of those that do not follow.

    ``joints`` is where they are, ``command`` where they were last sent.
    """
    off, least = limits.tolerance, limits.progress
    state = Followers(
        _follow(state.buoyancy, joints.m_b, command.m_b, off.m_b, least.m_b, dt),
        _follow(state.pitch, joints.x_p, command.x_p, off.x_p, least.x_p, dt),
        _follow(state.roll, joints.mu, command.mu, off.mu, least.mu, dt),
        _follow(state.surface, joints.delta, command.delta, off.delta, least.delta, dt),
    )
    reported = row(STUCK_BUOYANCY, state.buoyancy.waits_s > limits.stall_s)
    reported |= row(STUCK_PITCH, state.pitch.waits_s > limits.stall_s)
    reported |= row(STUCK_ROLL, state.roll.waits_s > limits.stall_s)
    return state, reported | row(STUCK_SURFACE, state.surface.waits_s > limits.stall_s)
