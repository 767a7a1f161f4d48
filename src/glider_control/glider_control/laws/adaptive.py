# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""The adaptive law: backstepping for roll and pitch, and a heading by learnt steering.

Roll and pitch are those of `backstepping`, the paper's law. The roll that turns the vehicle goes
by what is learnt of its steering in flight. Unknown to the law: damping, static moments, trim,
steering effectiveness and its sign. Only how far it may bank goes by the file's dihedral.
"""

import math
from typing import NamedTuple

from pydantic import Field

from glider_base.frames import wrap_angle
from glider_base.kernel import kernel, replace
from glider_base.settings import TUNABLE
from glider_control.law import Bank, LawSettings, bank_carefully, law_learnt, law_step
from glider_control.laws.backstepping import (
    INITIAL_CHANNELS,
    LEARN_AFTER_S,
    ChannelParams,
    Channels,
    ChannelSettings,
    RollChannelSettings,
    channel_params,
    learnt_moments,
    roll_and_pitch,
)
from glider_control.turning import roll_to_kick, roll_to_turn, sure_disturbance
from glider_model.onboard.command_filter import Filtered, FilterParams, filter_command
from glider_model.onboard.learnt_steering import (
    SMALLEST_KICK,
    Steering,
    SteeringLearningSettings,
    SteeringParams,
    learn,
    speed_ratio,
)
from glider_model.onboard.righting import Righting, make_righting
from glider_model.vehicle.file import Vehicle

#: d_hat is held within this (rad/s).
DISTURBANCE_MAX = 0.005
#: Heading error at which roll may reach its limit (rad), while the sign of b is in doubt.
SATURATING_ERROR = 0.35
#: Heading bandwidth over b V / (V_0 |k|), the frequency up to which a turn outruns its kick (-):
#: where the kick goes against the turn, and where it goes with it and does the fast part itself.
BANDWIDTH_AGAINST_KICK, BANDWIDTH_WITH_KICK = 2.0, 1.0
#: d_hat learns from no more than this of a heading error (rad): the rest is yet to be turned.
DISTURBANCE_ERROR = 0.02


class AdaptiveSettings(LawSettings):
    """Gains of the adaptive law."""

    pitch: ChannelSettings = Field(ChannelSettings(), description='pitch channel')
    roll: RollChannelSettings = Field(RollChannelSettings(), description='roll channel')
    heading_kp_per_s: float = Field(
        0.035, ge=0.0, le=1.0, description='k_psi, heading (1/s)', json_schema_extra=TUNABLE
    )
    heading_ki_per_s2: float = Field(
        2e-4,
        ge=0.0,
        le=0.1,
        description='adaptation of the turn-rate disturbance (1/s^2)',
        json_schema_extra=TUNABLE,
    )
    heading_kd: float = Field(
        0.1, ge=0.0, le=5.0, description='yaw-rate damping (-)', json_schema_extra=TUNABLE
    )
    steering: SteeringLearningSettings = Field(
        SteeringLearningSettings(), description='estimator of the steering effectiveness'
    )

    def params(self, vehicle: Vehicle, bank: Bank) -> 'AdaptiveParams':
        """Kernel parameters for a vehicle whose masses, but nothing else, are known."""
        kernel_vehicle = vehicle.params()
        steering = self.steering.params(bank.limit > 0.0, kernel_vehicle.slowest_glide)
        roll, pitch = channel_params(self.roll, self.pitch, kernel_vehicle)
        return AdaptiveParams(
            roll=roll,
            pitch=pitch,
            heading_kp=self.heading_kp_per_s,
            heading_ki=self.heading_ki_per_s2,
            heading_kd=self.heading_kd,
            steering=steering._replace(bank=min(steering.bank, math.sin(bank.limit))),
            mass=kernel_vehicle.m,
            roll_limit=bank.limit,
            roll_filter=bank.filter,
            righting=make_righting(kernel_vehicle),
        )

    def initial_state(self) -> 'AdaptiveState':
        """State of a law that knows nothing yet."""
        return AdaptiveState(
            roll=Filtered(0.0, 0.0),
            channels=INITIAL_CHANNELS,
            steering=self.steering.initial_state(),
            disturbance_dive=0.0,
            disturbance_climb=0.0,
        )


class AdaptiveParams(NamedTuple):
    """Adaptive law as the kernels see it."""

    roll: ChannelParams
    pitch: ChannelParams
    heading_kp: float
    heading_ki: float
    heading_kd: float
    steering: SteeringParams
    mass: float  #: of the vehicle (kg)
    roll_limit: float  #: (rad)
    roll_filter: FilterParams
    righting: Righting


class AdaptiveState(NamedTuple):
    """Everything the law has learnt, and its filters."""

    roll: Filtered  #: phi_s
    channels: Channels
    steering: Steering
    disturbance_dive: float  #: d_hat, turn rate that roll does not explain (rad/s)
    disturbance_climb: float


@kernel
def bank_to_turn(steering, disturbance, measured, reference, speed, learning, params, dt):
    """Roll command (rad) that steers to the reference heading, and the new d_hat.

    phi_s = asin sat((turn - d_hat) / (b_hat V / V_0)), d_hat' = -w^2 k_i e,
    turn = w (psi_s' + k_psi e + k_d (psi_s' - psi')).

    The share w keeps the bandwidth at what the vehicle can follow. To turn, it has to roll, and
    the kick of the roll goes the wrong way: y'' = U (b phi + k phi') has a zero at z = b / |k|.
    With a bandwidth of 2 z, and a line of sight that looks 3 / z ahead, the poles lie at 0.8 z and
    are damped by 0.8. d_hat waits while the roll command is at its limit and until the sign of b
    is known. A vehicle that hardly turns is steered by its kick alone.
    """
    limit = math.sin(params.roll_limit)
    ratio = speed_ratio(speed)
    effectiveness = abs(steering.b) * ratio
    is_known = steering.p[0] < steering.b * steering.b
    bandwidth = effectiveness * limit / SATURATING_ERROR
    if is_known:
        times = BANDWIDTH_AGAINST_KICK if steering.b * steering.k < 0.0 else BANDWIDTH_WITH_KICK
        bandwidth = times * effectiveness / max(abs(steering.k), SMALLEST_KICK)
    share = min(1.0, bandwidth / params.heading_kp)
    asked = share * reference.psi_dot
    # the heading that is left when the roll is gone, but for the roll of the turn asked for
    turning, _ = roll_to_turn(steering, asked - sure_disturbance(steering), ratio, limit)
    roll_left = measured.phi - math.asin(turning)
    error = wrap_angle(reference.psi - measured.psi + steering.k * roll_left)
    psi_dot = measured.psi_dot - steering.k * measured.phi_dot
    turn = (
        asked
        + share * params.heading_kp * error
        + share * params.heading_kd * (reference.psi_dot - psi_dot)
        - disturbance
    )
    sine, most = roll_to_turn(steering, turn, ratio, limit)
    if steering.is_kicked:
        sine = 0.0
    if learning:
        sine = min(limit, max(-limit, sine + roll_to_kick(steering, error)))
    if learning and is_known and not steering.is_kicked and abs(sine) < most:
        learnt = min(DISTURBANCE_ERROR, max(-DISTURBANCE_ERROR, error))
        moved = disturbance - dt * share * share * params.heading_ki * learnt
        disturbance = min(DISTURBANCE_MAX, max(-DISTURBANCE_MAX, moved))
    return math.asin(sine), disturbance


@law_step.body(AdaptiveParams)
@kernel
def adaptive_step(state, seen, params, dt):
    """Roll and pitch moment (N m) of the adaptive law: see `law_step`."""
    measured, reference, speed = seen.measured, seen.reference, seen.speed
    params = bank_carefully(seen.m_b, params)
    steering = learn(state.steering, measured, speed, params.steering, dt)
    learning = steering.steady_s > LEARN_AFTER_S
    d_dive, d_climb = state.disturbance_dive, state.disturbance_climb
    roll_command = 0.0
    if steering.steady_s > 0.0 and measured.vertical_rate > 0.0:
        roll_command, d_dive = bank_to_turn(
            steering.dive, d_dive, measured, reference, speed, learning, params, dt
        )
    elif steering.steady_s > 0.0:
        roll_command, d_climb = bank_to_turn(
            steering.climb, d_climb, measured, reference, speed, learning, params, dt
        )
    roll = filter_command(state.roll, roll_command, params.roll_filter, dt)

    channels, tau_p, tau_q = roll_and_pitch(state.channels, roll, seen, learning, params, dt)
    state = AdaptiveState(
        roll=roll,
        channels=channels,
        steering=steering,
        disturbance_dive=d_dive,
        disturbance_climb=d_climb,
    )
    return state, tau_p, tau_q


@law_learnt.body(AdaptiveParams)
@kernel
def adaptation(state, params):
    """What the law has learnt: moments, with their Lyapunov functions, and steering."""
    return replace(
        learnt_moments(state.channels, params),
        steering_dive_radps=state.steering.dive.b,
        disturbance_dive_radps=state.disturbance_dive,
        steering_climb_radps=state.steering.climb.b,
        disturbance_climb_radps=state.disturbance_climb,
    )
