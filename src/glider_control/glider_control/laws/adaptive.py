# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""The adaptive law: roll by what is learnt of the steering, and PI-D on roll and pitch.

u = sat(u_0 + a / b (e + k (u - u_0))), with u_0 the roll that turns by psi_s' - d (`steer_to`).
For each of roll and pitch tau = -kp e + kd (command' - rate) - I, I' = ki e, with an integral for
each phase (docs/theory.md, 3). Of the vehicle's file it takes n and what rights it alone.
"""

import math
from typing import NamedTuple

from pydantic import Field

from glider_base.frames import wrap_angle
from glider_base.kernel import kernel, replace
from glider_base.settings import Settings, derived, number, positive
from glider_base.signals import NOTHING_LEARNT
from glider_control.law import Bank, LawSettings, bank_carefully, law_learnt, law_step
from glider_model.onboard.command_filter import Filtered, FilterParams, filter_command
from glider_model.onboard.learnt_steering import (
    Steering,
    SteeringLearningSettings,
    SteeringParams,
    learn,
    steer_to,
)
from glider_model.onboard.moving_mass import Righting, make_righting
from glider_model.vehicle.file import Vehicle

#: Integrals are held within this (N m).
INTEGRAL_MAX = 3.0


class RollSettings(Settings):
    """PI-D of roll."""

    kp: float = positive(6.5, 500.0, 'angle (N m/rad)', tunable=True)
    ki: float = number(0.1, (0.0, 50.0), 'integral (N m/(rad s))', tunable=True)
    kd: float = number(6.0, (0.0, 500.0), 'rate (N m s/rad)', tunable=True)


class PitchSettings(Settings):
    """PI-D of pitch."""

    kp: float = positive(8.1, 500.0, 'angle (N m/rad)', tunable=True)
    ki: float = number(0.16, (0.0, 50.0), 'integral (N m/(rad s))', tunable=True)
    kd: float = number(14.0, (0.0, 500.0), 'rate (N m s/rad)', tunable=True)


class AdaptiveSettings(LawSettings):
    """Gains of the adaptive law."""

    pitch: PitchSettings = Field(PitchSettings(), description='pitch')
    roll: RollSettings = Field(RollSettings(), description='roll')
    steering: SteeringLearningSettings = Field(SteeringLearningSettings(), description='steering')

    def params(self, vehicle: Vehicle, bank: Bank) -> 'AdaptiveParams':
        """Kernel parameters."""
        of_file = vehicle.params()
        gains = derived(Gains, self.roll), derived(Gains, self.pitch)
        steering = self.steering.params(of_file, math.sin(bank.limit))
        return AdaptiveParams(*gains, steering, *bank, make_righting(of_file))

    def initial_state(self) -> 'AdaptiveState':
        """State of a law that knows nothing yet."""
        none = (0.0, 0.0)
        return AdaptiveState(Filtered(0.0, 0.0), none, none, self.steering.initial_state(), True)


class Gains(NamedTuple):
    """PI-D of one angle."""

    kp: float
    ki: float
    kd: float


class AdaptiveParams(NamedTuple):
    """The law as the kernels see it."""

    roll: Gains
    pitch: Gains
    steering: SteeringParams
    roll_limit: float  #: (rad)
    roll_filter: FilterParams
    righting: Righting


class AdaptiveState(NamedTuple):
    """Everything the law has learnt, and the roll asked for."""

    roll: Filtered
    roll_integral: tuple[float, float]  #: in dive and climb (N m)
    pitch_integral: tuple[float, float]
    steering: Steering
    is_down: bool  #: in a dive; that ends at the surface, where the law is not asked


@kernel
def hold(integrals, error, rate_error, down, learns, gains, dt):
    """Moment (N m) of a PI-D with an integral for each phase, and the integrals."""
    integral = integrals[0] if down else integrals[1]
    tau = -gains.kp * error - gains.kd * rate_error - integral
    if learns:
        integral = min(INTEGRAL_MAX, max(-INTEGRAL_MAX, integral + dt * gains.ki * error))
    return tau, (integral, integrals[1]) if down else (integrals[0], integral)


@law_step.body(AdaptiveParams)
@kernel
def adaptive_step(state, seen, params, dt):
    """Roll and pitch moment (N m): see `law_step`."""
    params = bank_carefully(seen.m_b, params)
    now, wanted = seen.measured, seen.reference
    down = now.vertical_rate > 0.0
    steering = state.steering if down == state.is_down else replace(state.steering, steady_s=0.0)
    steering = learn(steering, now, seen.speed, params.steering, dt)
    command = 0.0
    if steering.steady_s > 0.0:
        phase = steering.dive if down else steering.climb
        u, limit = math.sin(now.phi), math.sin(params.roll_limit)
        error = wrap_angle(wanted.psi - now.psi)
        u, _ = steer_to(phase, error, wanted.psi_dot, u, steering.ratio, limit, params.steering)
        command = math.asin(u)
    roll = filter_command(state.roll, command, params.roll_filter, dt)
    # what is measured is of this phase once a low pass has forgotten the inflection
    learns = steering.steady_s > params.steering.smoothing_s
    learns_p, learns_q = learns and not seen.roll_held, learns and not seen.pitch_held
    e_p, e_q = wrap_angle(now.phi - roll.value), now.theta - wanted.theta
    rate_p, rate_q = now.phi_dot - roll.rate, now.theta_dot - wanted.theta_dot
    tau_p, in_roll = hold(state.roll_integral, e_p, rate_p, down, learns_p, params.roll, dt)
    tau_q, in_pitch = hold(state.pitch_integral, e_q, rate_q, down, learns_q, params.pitch, dt)
    return AdaptiveState(roll, in_roll, in_pitch, steering, down), tau_p, tau_q


@law_learnt.body(AdaptiveParams)
@kernel
def adaptation(state, params):
    """What the law has learnt: the integrals of the phase that is flown, and the steering."""
    steering, phase = state.steering, 0 if state.is_down else 1
    return replace(
        NOTHING_LEARNT,
        roll_bias_nm=state.roll_integral[phase],
        pitch_bias_nm=state.pitch_integral[phase],
        steering_dive_radps=steering.dive.b,
        disturbance_dive_radps=steering.dive.d,
        steering_climb_radps=steering.climb.b,
        disturbance_climb_radps=steering.climb.d,
    )
