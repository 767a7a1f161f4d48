# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""Control as a block."""

from glider_base.block import Block, Said, block_tick
from glider_base.frames import odometry_from_wire, reference_from_wire, wrench_to_wire
from glider_base.kernel import kernel
from glider_base.signals import Joints
from glider_base.wiring import CONTROL as WIRED
from glider_control.control import (
    SATURATED_BUOYANCY,
    SATURATED_PITCH,
    SATURATED_ROLL,
    SATURATED_SURFACE,
    ControlParams,
    control_step,
)
from glider_control.intake import REFUSED, TELL_EVERY_NS
from glider_control.settings import ControlSettings
from glider_model.vehicle.file import steers_by

#: Actuators by the bits of the saturation mask that say that they are at their limits.
AT_LIMIT = {
    SATURATED_BUOYANCY: 'buoyancy engine',
    SATURATED_PITCH: 'pitch mass',
    SATURATED_ROLL: 'roll mass',
    SATURATED_SURFACE: 'steering surface',
}


@block_tick.body(ControlParams)
@kernel
def control_tick(state, t_s, inputs, params, dt):
    """One tick: reference, odom, joint_states in; demand, wrench, adaptation out."""
    reference, odom, joints = inputs
    state, out = control_step(
        state,
        odometry_from_wire(odom),
        Joints(joints[0], joints[1], joints[2], joints[3]),
        reference_from_wire(reference),
        params,
        dt,
    )
    command = (out.command.m_b, out.command.x_p, out.command.mu, out.command.delta)
    return state, (command, wrench_to_wire(out.wrench), out.adaptation), (out.saturation,)


def say(saturation: int) -> Said:
    """What control has noticed, and which actuators are at their limits."""
    at_limit = ', '.join(name for bit, name in AT_LIMIT.items() if saturation & bit)
    said = [
        'refused a measurement, the last good one serves' if saturation & REFUSED else '',
        f'at its limit: {at_limit}' if at_limit else '',
    ]
    message = '; '.join(text for text in said if text)
    level = 'warn' if message else 'ok'
    return Said(level, message or 'no actuator at its limit', {'saturation': saturation})


CONTROL = Block(
    WIRED,
    ControlSettings,
    flags=('saturation',),
    quiet=(0,),
    every_ns=TELL_EVERY_NS,
    say=say,
    steers_by=steers_by,
)
