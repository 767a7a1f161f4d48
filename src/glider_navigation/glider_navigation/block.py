# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""Navigation as a block."""

from glider_model.base.block import Block, Said, block_tick
from glider_model.base.frames import from_geodetic, swap_world
from glider_model.base.kernel import kernel
from glider_model.base.signals import Joints
from glider_model.base.wiring import NAVIGATION as WIRED
from glider_model.ocean.density import depth_at
from glider_model.vehicle.file import steers_by
from glider_navigation.method import Fix, Heard, Imu, method_step
from glider_navigation.phase import KNOWN, PHASE_NAMES
from glider_navigation.settings import NavigationParams, NavigationSettings


@kernel
def _hear(inputs, origin):
    """What the sensors say, from the numbers of their topics."""
    joints, odom, imu, pressure, fix = inputs[0], inputs[1], inputs[2], inputs[3], inputs[4]
    q_w, q_x, q_y, q_z = swap_world(imu[0], imu[1], imu[2], imu[3])
    p_n, p_e = from_geodetic(fix[1], fix[2], origin)
    return Heard(
        Joints(joints[0], joints[1], joints[2], joints[3]),
        (
            odom[0],
            odom[1],
            odom[2],
            odom[3],
            odom[4],
            odom[5],
            odom[6],
            odom[7],
            odom[8],
            odom[9],
            odom[10],
            odom[11],
            odom[12],
        ),
        Imu(q_w, q_x, q_y, q_z, imu[4], -imu[5], -imu[6], imu[7] >= 0.0),
        depth_at(pressure[0]),
        Fix(fix[0] >= 0.0, p_n, p_e, 0.5 * (fix[3] + fix[4])),
    )


@kernel
def _matrix(c):
    """Covariance of east and north, row by row."""
    return c.ee, c.ne, c.ne, c.nn


@block_tick.body(NavigationParams)
@kernel
def navigation_tick(state, t_s, inputs, params, dt):
    """One tick: sensors in; odom and what is believed of the current out; see `block_tick`."""
    state, is_ = method_step(state, _hear(inputs, params.origin), params.method, dt)
    outputs = (
        is_.odom + _matrix(is_.place),
        (is_.current.e, is_.current.n) + _matrix(is_.current_covariance),
        (is_.surface.e, is_.surface.n) + _matrix(is_.surface_covariance),
    )
    return state, outputs, (is_.phase,)


def say(phase: int) -> Said:
    """Where the vehicle is between two fixes."""
    return Said('ok', PHASE_NAMES[phase], {'phase': PHASE_NAMES[phase]})


NAVIGATION = Block(
    WIRED,
    NavigationSettings,
    navigation_tick,
    flags=('phase',),
    quiet=(KNOWN,),
    say=say,
    steers_by=steers_by,
)
