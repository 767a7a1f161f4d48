# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""Steering by a tail fin, by the same estimator and the same gains as by roll.

psi' = s c sin(delta) (V / V_0)^2 + d, with c from the vehicle's file: the share s of it that the
vehicle really has takes the place of b, with no bend, no adverse yaw, and one phase for dive and
climb. It is learnt from the angle at which the fin *is*, delayed as a turn takes to build up.
"""

import math
from typing import NamedTuple

from glider_base.frames import wrap_angle
from glider_base.kernel import kernel, replace
from glider_base.settings import number, positive
from glider_base.signals import Adaptation
from glider_control.surface import SurfaceLawSettings, steer, surface_learnt
from glider_model.onboard.glide_polar import MODEL_VERTICAL_RATE
from glider_model.onboard.learnt_steering import (
    LEARN_SPEED,
    SteeringLearningSettings,
    SteeringParams,
    SteeringState,
    learn_steering,
    speed_ratio,
    steer_to,
)
from glider_model.vehicle.file import Vehicle
from glider_model.vehicle.steering import STEERING_SPEED

#: The share s is held within this and one over it (-).
MOST_SHARE = 5.0


class FinLawSettings(SurfaceLawSettings):
    """What is expected of a tail fin."""

    share_std: float = number(0.7, (0.0, 5.0), 'deviation of s at first; 0: not learnt (-)')
    share_drift: float = number(0.05, (0.0, 5.0), 'change of s to be expected in 1000 s (-)')
    build_up_s: float = positive(4.0, 200.0, 'time in which a turn builds up (s)')
    after_s: float = number(90.0, (0.0, 600.0), 'learning begins so long after an inflection (s)')

    def params(self, vehicle: Vehicle) -> 'FinLawParams':
        """Kernel parameters for a vehicle whose fin is known."""
        learning = SteeringLearningSettings(kick_drift=0.0, bend_drift_radps=0.0)
        drift = self.share_drift if self.share_std > 0.0 else 0.0
        steering = learning.params(vehicle.params())._replace(drift=drift, after_s=self.after_s)
        turn_rate = vehicle.fin.turn_rate.value * STEERING_SPEED * STEERING_SPEED
        return FinLawParams(steering, turn_rate, self.build_up_s)

    def initial_state(self) -> 'FinLawState':
        """A fin as in the file."""
        known = SteeringLearningSettings().phase(1.0)
        known = known._replace(b=1.0, p=(self.share_std**2, *(0.0,) * 8, known.p[9]))
        return FinLawState(known, 0.0, 0.0, 0.0, 0.0)


class FinLawParams(NamedTuple):
    """Estimator, and what the file says of the turn."""

    steering: SteeringParams
    turn_rate: float  #: over sin(delta), at 0.5 m/s (rad/s)
    build_up_s: float


class FinLawState(NamedTuple):
    """What is known of the fin, and what it is learnt from."""

    known: SteeringState  #: b is the share s (-)
    built_up: float  #: turn by the file (rad/s), delayed as a turn builds up
    by_file: float  #: the same, smoothed
    turn: float  #: yaw rate, smoothed (rad/s)
    steady_s: float  #: time since the last inflection (s)


@steer.body(FinLawParams)
@kernel
def steer_by_fin(state, seen, params, dt):
    """Angle (rad) of the fin: see `steer`."""
    measured, reference, steering = seen.measured, seen.reference, params.steering
    known, turn = state.known, measured.psi_dot
    is_gliding = abs(measured.vertical_rate) >= MODEL_VERTICAL_RATE
    steady_s = state.steady_s + dt if is_gliding and seen.speed > LEARN_SPEED else 0.0
    ratio = params.turn_rate * speed_ratio(seen.speed) ** 2.0
    built_up = by_file = math.sin(seen.delta) * ratio
    if steady_s > dt:
        share = dt / (steering.smoothing_s + dt)
        built_up = state.built_up + dt / (params.build_up_s + dt) * (by_file - state.built_up)
        by_file = state.by_file + share * (built_up - state.by_file)
        turn = state.turn + share * (turn - state.turn)
    if steady_s > steering.after_s:
        known = learn_steering(known, by_file, 0.0, 0.0, turn, steering, dt)
        known = replace(known, b=min(MOST_SHARE, max(1.0 / MOST_SHARE, known.b)))
    state = FinLawState(known, built_up, by_file, turn, steady_s)
    if not is_gliding:
        return state, 0.0
    error = wrap_angle(reference.psi - measured.psi)
    u, _ = steer_to(known, error, reference.psi_dot, 0.0, ratio, 1.0, steering)
    return state, math.asin(u)


@surface_learnt.body(FinLawParams)
@kernel
def fin_learnt(learnt, state, params):
    """Turn rate over sin(delta) at 0.5 m/s, alike in dive and climb, and what is there without."""
    own = (state.known.b * params.turn_rate, state.known.d)
    return Adaptation(*learnt[:7], *own, *own, *learnt[11:])
