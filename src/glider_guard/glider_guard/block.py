# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""The guard as a block."""

import math
from collections.abc import Mapping

from glider_base.block import Block, Said, block_tick
from glider_base.frames import covariance_from_wire, odometry_from_wire
from glider_base.kernel import kernel, replace
from glider_base.signals import Battery, Health, Joints
from glider_base.wiring import GUARD as WIRED
from glider_guard.guard import INITIAL_GUARD, GuardParams, Received, guard_step
from glider_guard.rows import HOLD, ORDERED, REACTIONS, reaction_of
from glider_guard.rows import say as said_of
from glider_guard.settings import GuardSettings
from glider_guard.witness import AFLOAT_M, HEARD_S
from glider_model.ocean.density import depth_at
from glider_model.vehicle.file import steers_by

#: A change of what is reported is an event at most once in this time (ns).
TELL_EVERY_NS = 1_000_000_000


@block_tick.body(GuardParams)
@kernel
def guard_tick(state, t_s, inputs, params, dt):
    """One tick: what `GUARD` reads in; command, drop_weight out; see `block_tick`."""
    demand, reference, odom, joints, health, battery, pressure, altitude = inputs
    received = Received(
        demand=Joints(demand[0], demand[1], demand[2], demand[3]),
        odometry=odometry_from_wire(odom),
        joints=Joints(joints[0], joints[1], joints[2], joints[3]),
        target=-reference[2],
        depth=depth_at(pressure[0]),
        altitude=altitude[0],
        health=Health(health[0], health[1], health[2]),
        battery=Battery(battery[0], battery[1], battery[2], battery[3], battery[4]),
        known=covariance_from_wire(odom),
    )
    missed_s = t_s - state.t_s - dt
    if state.tick > 0 and missed_s > dt:
        # before a silence, or a pause: as old as that, and what was gone meanwhile is no lag
        seen, depths = state.witness, state.depths
        fallen = received.odometry.p_d - state.taken.gate.odometry.p_d
        if not abs(fallen) <= params.depth.jump_m:  # that is set anew
            fallen = 0.0
        depths = replace(
            depths,
            mean=depths.mean + fallen,
            lag_m=depths.lag_m + fallen,
            astray_m=depths.astray_m + fallen,
        )
        state = replace(state, witness=replace(seen, own_s=seen.own_s + missed_s), depths=depths)
    state, out = guard_step(state, received, params, dt)
    state = replace(state, t_s=t_s)
    command = (out.command.m_b, out.command.x_p, out.command.mu, out.command.delta)
    return state, (command, (1.0 if out.drops else 0.0,)), (out.reported,)


def is_seen_up(fresh: Mapping[str, tuple[float, ...]]) -> bool:
    """Whether inputs that still come show a vehicle at the surface: by a depth, or a contact."""
    depths = [depth_at(fresh['pressure'][0])] if 'pressure' in fresh else []
    depths += [odometry_from_wire(fresh['odom']).p_d] if 'odom' in fresh else []
    contact_age_s = fresh['health'][2] if 'health' in fresh else -1.0
    return min(depths, default=math.inf) < AFLOAT_M or 0.0 <= contact_age_s < HEARD_S


@kernel
def guard_surface(state):
    """Bring the vehicle to the surface, now and for good."""
    return replace(state, reported=state.reported | ORDERED)


@kernel
def guard_clear(state):
    """Forget what has latched, and how long anything has lasted."""
    return replace(INITIAL_GUARD, taken=state.taken, command=state.command)


def say(reported: int) -> Said:
    """Rows that hold, and the reaction to them."""
    reaction = reaction_of(reported)
    level = 'ok' if not reported else 'warn' if reaction <= HOLD else 'error'
    values = {'guard': reported, 'reaction': REACTIONS[reaction]}
    return Said(level, said_of(reported) or 'nothing to react to', values)


GUARD = Block(
    WIRED,
    GuardSettings,
    flags=('guard',),
    quiet=(0,),
    every_ns=TELL_EVERY_NS,
    say=say,
    surface=guard_surface,
    clear=guard_clear,
    steers_by=steers_by,
)
