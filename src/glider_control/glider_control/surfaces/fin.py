# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""Steering by a tail fin: the angle whose turn is the one that is wanted.

In a steady turn psi' = s c sin(delta) V^2, with c from the vehicle's file and s learnt. Wanted is

    turn = psi_s' + k_psi e + k_d (psi_s' - psi') + d,   d' = k_i e

with the heading error e, as of a law that banks to turn. It turns to the same side in dive and
climb, so that there is one d and one s.

The share s is that of the file's effectiveness which the vehicle really has. A Kalman filter of
one number compares the yaw rate with c sin(delta) V^2 for the angle at which the fin *is*, delayed
as a turn takes to build up. Of both what lasts is taken off: a fin that is bent or stuck, a hull
that turns by itself and a current tell nothing of s, changes of the angle do. What the model does
not explain, as a gust, counts as a few standard deviations at most, and s never changes its sign.
"""

import math
from typing import NamedTuple

from glider_base.frames import wrap_angle
from glider_base.kernel import kernel, replace
from glider_base.settings import number, positive
from glider_base.signals import Adaptation
from glider_control.surface import SurfaceLawSettings, steer, surface_learnt
from glider_model.onboard.learnt_steering import LEARN_SPEED, STEERING_SPEED
from glider_model.vehicle.file import Vehicle

#: Below this vertical rate the vehicle turns over, or floats: the speed is not known (m/s).
GLIDING_VERTICAL_RATE = 0.05
#: d is held within this (rad/s).
INTEGRAL_MAX = 0.005
#: The share s is held within these (-).
LEAST_SHARE, MOST_SHARE = 0.2, 5.0
#: An error counts as so many standard deviations at most.
MOST_DEVIATIONS = 2.0


class FinLawSettings(SurfaceLawSettings):
    """Gains of steering by a tail fin."""

    heading_kp_per_s: float = number(0.05, (0.0, 1.0), 'k_psi, heading (1/s)', tunable=True)
    heading_ki_per_s2: float = number(2e-4, (0.0, 0.1), 'heading integral (1/s^2)', tunable=True)
    heading_kd: float = number(0.5, (0.0, 5.0), 'yaw-rate damping (-)', tunable=True)
    share_std: float = number(
        0.7,
        (0.0, 5.0),
        'standard deviation of s before anything is known; 0: it is not learnt (-)',
    )
    share_drift: float = number(0.05, (0.0, 5.0), 'change of s to be expected in 1000 s (-)')
    noise_radps: float = positive(0.0003, 0.1, 'yaw rate that the model does not explain (rad/s)')
    correlation_s: float = positive(
        60.0, 600.0, 'time over which that is one and the same error (s)'
    )
    build_up_s: float = positive(4.0, 200.0, 'time in which a turn builds up (s)')
    smoothing_s: float = positive(10.0, 200.0, 'low pass on angle and yaw rate (s)')
    lasting_s: float = positive(
        300.0, 2000.0, 'what lasts longer than this tells nothing of s (s)'
    )
    after_s: float = number(
        90.0, (0.0, 600.0), 'learning begins this long after an inflection (s)'
    )

    def params(self, vehicle: Vehicle) -> 'FinLawParams':
        """Kernel parameters for a vehicle whose fin is known."""
        return FinLawParams(
            heading_kp=self.heading_kp_per_s,
            heading_ki=self.heading_ki_per_s2,
            heading_kd=self.heading_kd,
            turn_rate=vehicle.fin.turn_rate.value,
            limit=math.radians(vehicle.fin.range.value),
            share_drift=self.share_drift**2 / 1000.0 if self.share_std > 0.0 else 0.0,
            noise=self.noise_radps,
            correlation_s=self.correlation_s,
            build_up_s=self.build_up_s,
            smoothing_s=self.smoothing_s,
            lasting_s=self.lasting_s,
            after_s=self.after_s,
        )

    def initial_state(self) -> 'FinLawState':
        """Integral at zero, a fin as in the file."""
        return FinLawState(
            heading_integral=0.0,
            share=1.0,
            variance=self.share_std**2,
            built_up=0.0,
            sine=0.0,
            turn=0.0,
            lasting_sine=0.0,
            lasting_turn=0.0,
            steady_s=0.0,
        )


class FinLawParams(NamedTuple):
    """Gains, how the vehicle turns, and how that is learnt."""

    heading_kp: float
    heading_ki: float
    heading_kd: float
    turn_rate: float  #: over sin(delta) V^2, of the file (rad s/m^2)
    limit: float  #: largest angle (rad)
    share_drift: float  #: variance growth of s (1/s)
    noise: float  #: (rad/s)
    correlation_s: float
    build_up_s: float
    smoothing_s: float
    lasting_s: float
    after_s: float


class FinLawState(NamedTuple):
    """Integral, and what is known of the fin."""

    heading_integral: float  #: d (rad/s)
    share: float  #: s (-)
    variance: float  #: of s (-)
    built_up: float  #: sin(delta), delayed as a turn builds up (-)
    sine: float  #: the same, smoothed (-)
    turn: float  #: yaw rate, smoothed (rad/s)
    lasting_sine: float  #: what of the two lasts (-, rad/s)
    lasting_turn: float
    steady_s: float  #: time since the last turn-over (s)


@kernel
def learn_share(state, seen, params, dt):
    """One tick of learning how the fin turns the vehicle: see the head of this file."""
    speed, turn = seen.speed, seen.measured.psi_dot
    is_gliding = abs(seen.measured.vertical_rate) >= GLIDING_VERTICAL_RATE
    steady_s = state.steady_s + dt if is_gliding and speed > LEARN_SPEED else 0.0
    built_up, sine = math.sin(seen.delta), math.sin(seen.delta)
    if steady_s > dt:
        built_up = state.built_up + dt / (params.build_up_s + dt) * (sine - state.built_up)
        part = dt / (params.smoothing_s + dt)
        sine = state.sine + part * (built_up - state.sine)
        turn = state.turn + part * (turn - state.turn)
    part = dt / (params.lasting_s + dt) if steady_s > params.after_s else 1.0
    lasting_sine = state.lasting_sine + part * (sine - state.lasting_sine)
    lasting_turn = state.lasting_turn + part * (turn - state.lasting_turn)
    share, variance = state.share, state.variance
    if steady_s > params.after_s:
        variance += params.share_drift * dt
        change = params.turn_rate * speed * speed * (sine - lasting_sine)
        error = turn - lasting_turn - share * change
        square = variance * change * change
        most = MOST_DEVIATIONS * math.sqrt(square + params.noise * params.noise)
        error = min(most, max(-most, error))
        spread = square + params.noise * params.noise * params.correlation_s / dt
        share += variance * change / spread * error
        share = min(MOST_SHARE, max(LEAST_SHARE, share))
        variance -= variance * square / spread
    return FinLawState(
        heading_integral=state.heading_integral,
        share=share,
        variance=variance,
        built_up=built_up,
        sine=sine,
        turn=turn,
        lasting_sine=lasting_sine,
        lasting_turn=lasting_turn,
        steady_s=steady_s,
    )


@steer.body(FinLawParams)
@kernel
def steer_by_fin(state, seen, params, dt):
    """Angle (rad) of the fin: see `steer`."""
    measured, reference = seen.measured, seen.reference
    learnt = learn_share(state, seen, params, dt)
    if abs(measured.vertical_rate) < GLIDING_VERTICAL_RATE:
        return learnt, 0.0
    integral = state.heading_integral
    error = wrap_angle(reference.psi - measured.psi)
    turn = (
        reference.psi_dot
        + params.heading_kp * error
        + params.heading_kd * (reference.psi_dot - measured.psi_dot)
        + integral
    )
    speed = max(seen.speed, LEARN_SPEED)
    sine = turn / (learnt.share * params.turn_rate * speed * speed)
    delta = math.asin(min(1.0, max(-1.0, sine)))
    if abs(delta) < params.limit or delta * error < 0.0:
        moved = integral + dt * params.heading_ki * error
        integral = min(INTEGRAL_MAX, max(-INTEGRAL_MAX, moved))
    return replace(learnt, heading_integral=integral), min(params.limit, max(-params.limit, delta))


@surface_learnt.body(FinLawParams)
@kernel
def fin_learnt(learnt, state, params):
    """Turn rate over sin(delta) at 0.5 m/s, alike in dive and climb, and what is there without."""
    rate = state.share * params.turn_rate * STEERING_SPEED * STEERING_SPEED
    told = (rate, -state.heading_integral)
    return Adaptation(*learnt[:7], *told, *told, *learnt[11:])
