# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""The adaptive law: roll by what is learnt of the steering, and PI-D on roll and pitch.

u = sat(u_0 + a / b (e + k (u - u_0))), with u_0 the roll that turns by psi_s' - d (`choose_way`).
For each of roll and pitch tau = -kp e + kd (command' - rate) - I, I' = ki e, with an integral for
each phase: the paper's backstepping with one regressor. Unknown to the law: damping, static
moments, trim, steering effectiveness and its sign.
"""

import math
from typing import NamedTuple

from pydantic import Field

from glider_base.frames import wrap_angle
from glider_base.kernel import kernel
from glider_base.settings import Settings, number, positive
from glider_base.signals import Adaptation
from glider_control.law import Bank, LawSettings, bank_carefully, law_learnt, law_step
from glider_model.onboard.command_filter import Filtered, FilterParams, filter_command
from glider_model.onboard.learnt_steering import (
    Steering,
    SteeringLearningSettings,
    SteeringParams,
    choose_way,
    learn,
    steer_to,
)
from glider_model.onboard.righting import Righting, make_righting
from glider_model.vehicle.file import Vehicle

#: Integrals wait this long after a turn-over (s), and are held within this (N m).
LEARN_AFTER_S, INTEGRAL_MAX = 20.0, 3.0


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
        x, roll, pitch = vehicle.params(), self.roll, self.pitch
        steering = self.steering.params(bank.limit > 0.0, x.slowest_glide, x)
        return AdaptiveParams(
            Gains(roll.kp, roll.ki, roll.kd),
            Gains(pitch.kp, pitch.ki, pitch.kd),
            steering._replace(bank=min(steering.bank, math.sin(bank.limit))),
            bank.limit,
            bank.filter,
            make_righting(x),
        )

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
    is_down: bool  #: in a dive


@kernel
def hold(integrals, error, rate_error, down, learns, gains, dt):
    """Moment (N m) of a PI-D with an integral for each phase, and the integrals."""
    integral = integrals[0] if down else integrals[1]
    tau = -gains.kp * error - gains.kd * rate_error - integral
    if learns:
        moved = integral + dt * gains.ki * error
        integral = min(INTEGRAL_MAX, max(-INTEGRAL_MAX, moved))
    return tau, (integral, integrals[1]) if down else (integrals[0], integral)


@law_step.body(AdaptiveParams)
@kernel
def adaptive_step(state, seen, params, dt):
    """Roll and pitch moment (N m): see `law_step`."""
    params = bank_carefully(seen.m_b, params)
    now, wanted = seen.measured, seen.reference
    steering = learn(state.steering, now, seen.speed, params.steering, dt)
    down = now.vertical_rate > 0.0
    command = 0.0
    if steering.steady_s > 0.0:
        phase = steering.dive if down else steering.climb
        u, limit = math.sin(now.phi), math.sin(params.roll_limit)
        way = choose_way(phase, wanted.psi_dot, steering.ratio, limit, params.steering)
        error = wrap_angle(wanted.psi - now.psi)
        command = math.asin(steer_to(way, error, u, phase.k))
    roll = filter_command(state.roll, command, params.roll_filter, dt)
    learns = steering.steady_s > LEARN_AFTER_S
    tau_p, in_roll = hold(
        state.roll_integral,
        wrap_angle(now.phi - roll.value),
        now.phi_dot - roll.rate,
        down,
        learns and not seen.roll_held,
        params.roll,
        dt,
    )
    tau_q, in_pitch = hold(
        state.pitch_integral,
        now.theta - wanted.theta,
        now.theta_dot - wanted.theta_dot,
        down,
        learns and not seen.pitch_held,
        params.pitch,
        dt,
    )
    return AdaptiveState(roll, in_roll, in_pitch, steering, down), tau_p, tau_q


@law_learnt.body(AdaptiveParams)
@kernel
def adaptation(state, params):
    """What the law has learnt: the integrals of the phase that is flown, and the steering."""
    dive, climb = state.steering.dive, state.steering.climb
    phase = 0 if state.is_down else 1
    return Adaptation(
        roll_bias_nm=state.roll_integral[phase],
        roll_side_force_nm=0.0,
        roll_damping_nm=0.0,
        pitch_bias_nm=state.pitch_integral[phase],
        pitch_alpha_nm=0.0,
        pitch_speed_nm=0.0,
        pitch_damping_nm=0.0,
        steering_dive_radps=dive.b,
        disturbance_dive_radps=dive.d,
        steering_climb_radps=climb.b,
        disturbance_climb_radps=climb.d,
        lyapunov_1=0.0,
        lyapunov_2=0.0,
    )
