# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""What navigation takes in: what a sensor cannot have measured is refused, its last sample serves.

A sensor that shows nothing plausible for longer than ``hold_s`` and a sampling period
is lost. Without attitude or depth there is no odometry: what is published then has no attitude (a
quaternion of zeros), which nobody after navigation takes for one, and the guard brings the
vehicle up. Whether a fix lies where the vehicle can be is for the method to say. A driver may go
on with its last fix as long as it has no other one, under water too: that is none.
"""

import math
from typing import NamedTuple

from glider_base.kernel import kernel
from glider_base.signals import Imu, Joints
from glider_model.onboard.gate import (
    INITIAL_GATE,
    NORM_REFUSED,
    GateParams,
    GateState,
    are_plausible,
    gate_step,
    has_turned,
    is_slow,
    norm2,
    scaled,
)
from glider_navigation.method import Fix, Received

#: A refusal is reported for so long (s), lest every sample of a sensor that fails is an event.
REFUSAL_SHOWN_S = 2.0
#: A fix that is the same to the last digit though the vehicle went down so far (m) is an old one.
REPEATED_M = 1.0
#: Nor is one that may be farther off than 100 km (m^2).
VARIANCE_MAX = 1e10
#: No fix.
_NO_FIX = Fix(False, 0.0, 0.0, 0.0)
#: Deeper or higher than this no sensor shows (m).
DEPTH_MAX_M = 12000.0


class IntakeParams(NamedTuple):
    """What is plausible."""

    gate: GateParams
    range: Joints  #: of the actuators
    hold_s: float  #: a sample of attitude or depth serves for so long
    reads_attitude: bool  #: imu and pressure are there to be lost
    reads_odometry: bool  #: measured_odom is


class IntakeState(NamedTuple):
    """The last that was plausible, and the time since (s)."""

    odometry: GateState = INITIAL_GATE
    joints: Joints = Joints(0.0, 0.0, 0.0, 0.0)
    imu: Imu = Imu(1.0, *(6 * (0.0,)), False)
    imu_s: float = 0.0
    depth: float = 0.0
    depth_s: float = 0.0
    fix: Fix = _NO_FIX  #: the last that came, or none
    fix_depth: float = 0.0  #: the least there was since then (m)
    fix_is_old: bool = False  #: it has gone down with it
    seen: bool = False  #: there has been an attitude
    sounded: bool = False  #: there has been a depth
    refused_s: float = REFUSAL_SHOWN_S  #: since something was refused


@kernel
def _is_plausible(imu, params):
    """Whether a sample is an attitude, with rates that a glider can have; false for NaN."""
    return abs(norm2(imu) - 1.0) < NORM_REFUSED and (not imu.has_rates or is_slow(imu, params))


@kernel
def _is_fix(fix):
    """Whether a fix is one; false for NaN."""
    is_near = abs(fix.p_n) < 1e8 and abs(fix.p_e) < 1e8
    return fix.is_fix and is_near and 0.0 <= fix.variance <= VARIANCE_MAX


@kernel
def take_in(
    state: IntakeState, received: Received, params: IntakeParams, dt: float
) -> tuple[IntakeState, Received]:
    """Take in what the sensors say at a tick of ``dt`` s; anything may be in it.

    What comes out has numbers that can be worked with; its ``odom`` is as it came.
    """
    odometry = gate_step(state.odometry, received.odometry, params.gate, dt)
    refused = params.reads_odometry and odometry.age_s > 0.0
    joints = received.joints
    if not are_plausible(joints, params.range):
        joints, refused = state.joints, True
    imu, imu_s, seen = received.imu, state.imu_s + dt, state.seen
    good = _is_plausible(imu, params.gate)
    if good and seen and imu_s <= params.hold_s:
        good = not has_turned(imu, state.imu, params.gate)
    if good:
        imu, imu_s, seen = scaled(imu), 0.0, True
    else:
        imu, refused = state.imu, refused or params.reads_attitude
    depth, depth_s, sounded = received.depth, state.depth_s + dt, state.sounded
    good = abs(depth) <= DEPTH_MAX_M
    if good and sounded and depth_s <= params.hold_s:
        good = abs(depth - state.depth) <= params.gate.depth_jump
    if good:
        depth_s, sounded = 0.0, True
    else:
        depth, refused = state.depth, refused or params.reads_attitude
    fix, said = received.fix, state.fix
    if fix.is_fix and not _is_fix(fix):
        fix, refused = _NO_FIX, True
    fix_depth, fix_is_old = depth, False
    if fix.is_fix and said.is_fix and fix.p_n == said.p_n and fix.p_e == said.p_e:
        fix_depth = min(depth, state.fix_depth)
        fix_is_old = state.fix_is_old or depth > fix_depth + REPEATED_M
    said = fix
    if fix_is_old:
        fix = _NO_FIX
    altitude = received.altitude if math.isfinite(received.altitude) else 0.0
    refused_s = 0.0 if refused else state.refused_s + dt
    taken = Received(
        joints=joints,
        odom=received.odom,
        odometry=odometry.odometry,
        imu=imu,
        depth=depth,
        fix=fix,
        altitude=altitude,
    )
    state = IntakeState(
        odometry=odometry,
        joints=joints,
        imu=imu,
        imu_s=imu_s,
        depth=depth,
        depth_s=depth_s,
        fix=said,
        fix_depth=fix_depth,
        fix_is_old=fix_is_old,
        seen=seen,
        sounded=sounded,
        refused_s=refused_s,
    )
    return state, taken


@kernel
def is_refusing(state):
    """Whether something was refused a moment ago."""
    return state.refused_s < REFUSAL_SHOWN_S


@kernel
def is_blind(state, params):
    """Whether attitude or depth is lost to who makes odometry of them."""
    lost = state.imu_s > params.hold_s or state.depth_s > params.hold_s
    return params.reads_attitude and lost
