# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""Navigation as a block."""

from glider_base.block import Block, Said, block_tick
from glider_base.frames import (
    NO_ATTITUDE,
    covariance_to_wire,
    from_geodetic,
    horizontal_to_wire,
    imu_from_wire,
    odometry_from_wire,
)
from glider_base.kernel import kernel
from glider_base.signals import Joints
from glider_base.wiring import NAVIGATION as WIRED
from glider_model.ocean.density import depth_at
from glider_model.vehicle.file import steers_by
from glider_navigation.intake import is_blind, is_refusing, take_in
from glider_navigation.method import Fix, Received, method_step
from glider_navigation.phase import KNOWN, PHASE_NAMES
from glider_navigation.settings import NavigationParams, NavigationSettings, NavigationState


@kernel
def _hear(inputs, origin):
    """What the sensors say, from the numbers of their topics."""
    joints, odom, imu, pressure, fix = inputs[0], inputs[1], inputs[2], inputs[3], inputs[4]
    p_n, p_e = from_geodetic(fix[1], fix[2], origin)
    return Received(
        joints=Joints(joints[0], joints[1], joints[2], joints[3]),
        odom=(  # of a recording it is an array
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
        odometry=odometry_from_wire(odom),
        imu=imu_from_wire(imu),
        depth=depth_at(pressure[0]),
        fix=Fix(fix[0] >= 0.0, p_n, p_e, 0.5 * (fix[3] + fix[4])),
        altitude=inputs[5][0],
    )


@block_tick.body(NavigationParams)
@kernel
def navigation_tick(state, t_s, inputs, params, dt):
    """One tick: sensors in; odom and the estimated current out; see `block_tick`."""
    intake, received = take_in(state.intake, _hear(inputs, params.origin), params.intake, dt)
    method, estimated = method_step(state.method, received, params.method, dt)
    odom = estimated.odom
    if is_blind(intake, params.intake):
        odom = odom[:3] + NO_ATTITUDE + odom[7:]
    outputs = (
        odom + covariance_to_wire(estimated.place),
        horizontal_to_wire(estimated.current, estimated.current_covariance),
        horizontal_to_wire(estimated.surface, estimated.surface_covariance),
    )
    return NavigationState(intake, method), outputs, (estimated.phase, int(is_refusing(intake)))


def say(phase: int, refused: int) -> Said:
    """Where the vehicle is between two fixes, and whether a sensor is refused."""
    # a method of another package may have phases of its own
    name = PHASE_NAMES[phase] if phase in range(len(PHASE_NAMES)) else f'phase {phase}'
    values = {'phase': name, 'refused': str(bool(refused)).lower()}
    if refused:
        message = f'{name}; refused a measurement, the last good one serves'
        return Said('warn', message, values)
    return Said('ok', name, values)


NAVIGATION = Block(
    WIRED,
    NavigationSettings,
    flags=('phase', 'refused'),
    quiet=(KNOWN, 0),
    say=say,
    steers_by=steers_by,
)
