# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""Guidance as a block."""

from glider_base.block import Block, Said, block_tick
from glider_base.frames import (
    covariance_from_wire,
    odometry_from_wire,
    reference_to_wire,
    water_to_wire,
)
from glider_base.kernel import kernel
from glider_base.wiring import GUIDANCE as WIRED
from glider_guidance.guidance import GuidanceParams, guidance_abort, guidance_step, hear_fixes
from glider_guidance.settings import GuidanceSettings
from glider_guidance.yo.stage import STAGE_NAMES


@block_tick.body(GuidanceParams)
@kernel
def guidance_tick(state, t_s, inputs, params, dt):
    """One tick: odom, altitude in; reference, tracking_error, current_estimate out."""
    odometry = odometry_from_wire(inputs[0])
    state = hear_fixes(state, odometry, covariance_from_wire(inputs[0]), dt)
    state, out = guidance_step(state, odometry, inputs[1][0], params, dt)
    error = (out.error.e1, out.error.e2, out.error.e3)
    outputs = (reference_to_wire(out.reference), error, water_to_wire(out.current))
    return state, outputs, (out.stage, int(out.infeasible), out.no_progress)


def say_no_progress(waypoint: int) -> str:
    """That there is no progress."""
    return f'waypoint {waypoint} comes no nearer'


def say(stage: int, infeasible: int, no_progress: int = 0) -> Said:
    """Which stage began, whether the course can be held, and what comes no nearer."""
    name = STAGE_NAMES[stage]
    values = {'stage': name, 'infeasible': str(bool(infeasible)).lower()}
    message = name
    if infeasible:
        message += '; the course cannot be held against this current'
    if no_progress:
        message += f'; {say_no_progress(no_progress)}'
        values['no_progress'] = str(no_progress)
    return Said('ok' if message == name else 'warn', message, values)


GUIDANCE = Block(
    WIRED,
    GuidanceSettings,
    flags=('stage', 'infeasible', 'no_progress'),
    quiet=(-1, -1, 0),
    say=say,
    surface=guidance_abort,
)
