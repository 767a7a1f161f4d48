# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""What control takes in: odometry, actuators and reference that cannot be are refused.

The last good ones serve for a while. What else may fail is for the guard to see, which acts after
control (`glider_guard`).
"""

import math
from typing import NamedTuple

from glider_base.kernel import kernel
from glider_base.signals import Joints, Reference
from glider_model.onboard.gate import (
    INITIAL_GATE,
    GateParams,
    GateState,
    are_plausible,
    gate_step,
    is_lost,
)

#: Reported: something was refused.
REFUSED = 64
#: A change of what is reported is an event at most once in this time (ns).
TELL_EVERY_NS = 1_000_000_000
#: A refusal is reported for so long (s): an event is, once a second at most.
REFUSAL_SHOWN_S = 2.0


class IntakeParams(NamedTuple):
    """What is plausible."""

    gate: GateParams
    range: Joints  #: of the actuators


class IntakeState(NamedTuple):
    """The last that was plausible."""

    gate: GateState = INITIAL_GATE  #: the odometry that serves
    joints: Joints = Joints(0.0, 0.0, 0.0, 0.0)
    joints_s: float = 0.0  #: time since (s)
    reference: Reference = Reference(*(12 * (0.0,)))
    reference_s: float = 0.0
    refused_s: float = REFUSAL_SHOWN_S  #: time since something was refused


@kernel
def _is_finite(reference):
    """Whether every number that control uses of a reference is finite."""
    a = reference
    return math.isfinite(
        a.p_d + a.phi + a.theta + a.psi + a.v_d + a.phi_dot + a.theta_dot + a.psi_dot
    )


@kernel
def take_in(state, odometry, joints, reference, params, dt):
    """Take in what a tick brings; what cannot be is refused, and the last good ones serve.

    With odometry (``gate.odometry``), ``joints`` and ``reference`` of the `IntakeState` that it
    returns one can work.
    """
    gate = gate_step(state.gate, odometry, params.gate, dt)
    joints_s, reference_s, refused_s = 0.0, 0.0, state.refused_s + dt
    if not are_plausible(joints, params.range):
        joints, joints_s = state.joints, state.joints_s + dt
    if not _is_finite(reference):
        reference, reference_s = state.reference, state.reference_s + dt
    if gate.age_s > 0.0 or joints_s > 0.0 or reference_s > 0.0:
        refused_s = 0.0
    return IntakeState(
        gate=gate,
        joints=joints,
        joints_s=joints_s,
        reference=reference,
        reference_s=reference_s,
        refused_s=refused_s,
    )


@kernel
def is_refusing(state):
    """Whether something was refused a moment ago."""
    return state.refused_s < REFUSAL_SHOWN_S


@kernel
def is_blind(state, params):
    """Whether there is nothing left to control by."""
    hold_s = params.gate.hold_s
    return (
        is_lost(state.gate, params.gate) or state.joints_s > hold_s or state.reference_s > hold_s
    )
