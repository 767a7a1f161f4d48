# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""The adaptive law: command-filtered backstepping for roll and pitch, bank to turn for heading.

Zhang et al. (2021), equations (12)-(29), made whole (docs/paper.md). For each of roll and pitch,
with the angle error K1 and the rate error K2 = omega - a_s:

    a     = J3^-1 (Omega_s' - L1 K1 - h r)                          (16)
    tau   = M a_s' - B2 K2 - J3^T B1 K1bar - Phi^T theta_hat        (18)
    theta_hat' = Proj[Gamma (Phi K2bar - sigma theta_hat)]          (19)

K1bar = K1 - xi and K2bar = K2 - zeta are the errors less what the command filter and the actuators
are to blame for (Farrell et al. 2009), so that neither is learnt as a disturbance. Regressors are
scaled such that every parameter is a moment in N m. Unknown to the law: damping, static moments,
trim, steering effectiveness and its sign. Only how far it may bank goes by the file's dihedral.
"""

import math
from typing import NamedTuple

from pydantic import Field

from glider_base.frames import wrap_angle
from glider_base.kernel import kernel
from glider_base.settings import TUNABLE, Settings
from glider_base.signals import Adaptation
from glider_control.law import Bank, LawSettings, bank_carefully, law_learnt, law_step
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
from glider_model.vehicle.rigid_body import GRAVITY, rigid_body

#: Typical size of the regressors: V^2 alpha, V^2 (m^2/s^2), side force (N), rates (rad/s).
SCALE_ALPHA, SCALE_V2, SCALE_SIDE, SCALE_ROLL_RATE, SCALE_PITCH_RATE = 0.01, 0.25, 2.0, 0.05, 0.03
#: Adaptation waits this long after a turn-over (s).
LEARN_AFTER_S = 20.0
#: d_hat is held within this (rad/s).
DISTURBANCE_MAX = 0.005
#: Heading error at which roll may reach its limit (rad), while the sign of b is in doubt.
SATURATING_ERROR = 0.35
#: Heading bandwidth over b V / (V_0 |k|), the frequency up to which a turn outruns its kick (-):
#: where the kick goes against the turn, and where it goes with it and does the fast part itself.
BANDWIDTH_AGAINST_KICK, BANDWIDTH_WITH_KICK = 2.0, 1.0
#: d_hat learns from no more than this of a heading error (rad): the rest is yet to be turned.
DISTURBANCE_ERROR = 0.02
#: Natural frequency of the filter on the virtual rate command (rad/s), and its rate limit.
RATE_FILTER = FilterParams(2.0, 10.0)


class ChannelSettings(Settings):
    """Gains of one channel, roll or pitch."""

    l1_per_s: float = Field(
        0.15, gt=0.0, le=5.0, description='L1, angle error (1/s)', json_schema_extra=TUNABLE
    )
    b1: float = Field(
        6.0, gt=0.0, le=500.0, description='B1, angle (N m/rad)', json_schema_extra=TUNABLE
    )
    b2: float = Field(
        14.0, gt=0.0, le=500.0, description='B2, rate (N m s/rad)', json_schema_extra=TUNABLE
    )
    gamma: float = Field(
        0.3, ge=0.0, le=50.0, description='Gamma, adaptation (N m/rad)', json_schema_extra=TUNABLE
    )
    sigma_per_s: float = Field(
        1e-5,
        ge=0.0,
        le=1.0,
        description='sigma, leakage (rad/(N m s))',
        json_schema_extra=TUNABLE,
    )
    dead_zone_radps: float = Field(
        5e-5,
        ge=0.0,
        le=0.1,
        description='rate error below which nothing is learnt (rad/s)',
        json_schema_extra=TUNABLE,
    )
    bound: float = Field(3.0, gt=0.0, le=100.0, description='projection: largest parameter (N m)')

    def params(self, inertia: float) -> 'ChannelParams':
        """Kernel parameters of a channel that turns an inertia (kg m^2)."""
        return ChannelParams(
            l1=self.l1_per_s,
            b1=self.b1,
            b2=self.b2,
            gamma=self.gamma,
            sigma=self.sigma_per_s,
            dead_zone=self.dead_zone_radps,
            bound=self.bound,
            inertia=inertia,
        )


class RollChannelSettings(ChannelSettings):
    """Gains of the roll channel."""

    l1_per_s: float = Field(
        0.3, gt=0.0, le=5.0, description='L1, angle error (1/s)', json_schema_extra=TUNABLE
    )
    b1: float = Field(
        8.0, gt=0.0, le=500.0, description='B1, angle (N m/rad)', json_schema_extra=TUNABLE
    )
    b2: float = Field(
        12.0, gt=0.0, le=500.0, description='B2, rate (N m s/rad)', json_schema_extra=TUNABLE
    )
    dead_zone_radps: float = Field(
        5e-4,
        ge=0.0,
        le=0.1,
        description='rate error below which nothing is learnt (rad/s)',
        json_schema_extra=TUNABLE,
    )


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
        _, _, _, i_xx, i_yy, *_ = rigid_body(0.0, 0.0, kernel_vehicle)
        return AdaptiveParams(
            roll=self.roll.params(i_xx + kernel_vehicle.a_44),
            pitch=self.pitch.params(i_yy + kernel_vehicle.a_55),
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
        channel = ChannelState(rate=Filtered(0.0, 0.0), xi=0.0, zeta=0.0, tau=0.0, k1=0.0, k2=0.0)
        return AdaptiveState(
            roll=Filtered(0.0, 0.0),
            roll_channel=channel,
            pitch_channel=channel,
            roll_theta=(0.0, 0.0, 0.0),
            pitch_theta=(0.0, 0.0, 0.0, 0.0),
            steering=self.steering.initial_state(),
            disturbance_dive=0.0,
            disturbance_climb=0.0,
        )


class ChannelParams(NamedTuple):
    """Gains of one channel and the inertia it turns."""

    l1: float
    b1: float
    b2: float
    gamma: float
    sigma: float
    dead_zone: float
    bound: float
    inertia: float  #: rigid body and added (kg m^2)


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


class ChannelState(NamedTuple):
    """Filter and compensation signals of one channel."""

    rate: Filtered  #: a_s, the virtual rate command filtered (rad/s)
    xi: float  #: angle error that the filter is to blame for (rad)
    zeta: float  #: rate error that the actuator is to blame for (rad/s)
    tau: float  #: last demanded moment (N m)
    k1: float  #: compensated errors, for the monitor
    k2: float


class AdaptiveState(NamedTuple):
    """Everything the law has learnt, and its filters."""

    roll: Filtered  #: phi_s
    roll_channel: ChannelState
    pitch_channel: ChannelState
    roll_theta: tuple[float, float, float]  #: bias, side force, roll damping (N m)
    pitch_theta: tuple[float, float, float, float]  #: bias, V^2 alpha, V^2, pitch damping (N m)
    steering: Steering
    disturbance_dive: float  #: d_hat, turn rate that roll does not explain (rad/s)
    disturbance_climb: float


@kernel
def _project(theta, direction, sigma, params, dt):
    """One step of a parameter along ``direction``, with leakage, inside the bound."""
    moved = theta + dt * params.gamma * (direction - sigma * theta)
    return min(params.bound, max(-params.bound, moved))


@kernel
def channel_step(state, error, command, rate, applied, coupling, params, dt):
    """Errors, virtual rate and compensation signals of one channel, before the moment.

    Parameters
    ----------
    state : ChannelState
    error : float
        K1, measured angle less desired (rad).
    command : float
        a, virtual rate command (rad/s).
    rate : float
        Measured body rate (rad/s).
    applied : float
        Moment that the actuator makes (N m).
    coupling : float
        Element of J3 from this rate to this angle (-).

    Returns
    -------
    Filtered, xi, zeta, k1_bar, k2, k2_bar
    """
    filtered = filter_command(state.rate, command, RATE_FILTER, dt)
    xi = state.xi + dt * (-params.l1 * state.xi + coupling * (filtered.value - command))
    # damping of the zeta filter: implicit, so that a light vehicle stays stable
    zeta = (state.zeta + dt * (applied - state.tau) / params.inertia) / (
        1.0 + dt * params.b2 / params.inertia
    )
    k2 = rate - filtered.value
    return filtered, xi, zeta, error - xi, k2, k2 - zeta


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


# long: the equations stand in one place, and parts would hand on a dozen numbers each.
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

    s_phi, c_phi = math.sin(measured.phi), math.cos(measured.phi)
    t_theta = math.tan(measured.theta)
    c_theta = math.cos(measured.theta)
    # body rates from Euler rates
    p = measured.phi_dot - math.sin(measured.theta) * measured.psi_dot
    q = c_phi * measured.theta_dot + s_phi * c_theta * measured.psi_dot
    r = c_phi * c_theta * measured.psi_dot - s_phi * measured.theta_dot

    e_phi = wrap_angle(measured.phi - roll.value)
    e_theta = measured.theta - reference.theta
    a_phi = roll.rate - params.roll.l1 * e_phi
    a_theta = reference.theta_dot - params.pitch.l1 * e_theta
    a_q = (a_theta + s_phi * r) / max(c_phi, 0.2)
    a_p = a_phi - c_phi * t_theta * r - s_phi * t_theta * a_q

    rate_p, xi_p, zeta_p, k1_p, k2_p, k2bar_p = channel_step(
        state.roll_channel, e_phi, a_p, p, seen.tau_p, 1.0, params.roll, dt
    )
    rate_q, xi_q, zeta_q, k1_q, k2_q, k2bar_q = channel_step(
        state.pitch_channel, e_theta, a_q, q, seen.tau_q, c_phi, params.pitch, dt
    )

    # regressors; the side force that sideslip makes, from the lateral balance of a turn
    v2 = speed * speed
    side = params.mass * speed * r - seen.m_b * GRAVITY * c_theta * s_phi
    phi_p = (1.0, side / SCALE_SIDE, rate_p.value / SCALE_ROLL_RATE)
    phi_q = (1.0, v2 * seen.alpha / SCALE_ALPHA, v2 / SCALE_V2, rate_q.value / SCALE_PITCH_RATE)

    th_p, th_q = state.roll_theta, state.pitch_theta
    tau_p = (
        params.roll.inertia * rate_p.rate
        - params.roll.b2 * k2_p
        - params.roll.b1 * k1_p
        - (phi_p[0] * th_p[0] + phi_p[1] * th_p[1] + phi_p[2] * th_p[2])
    )
    tau_q = (
        params.pitch.inertia * rate_q.rate
        - params.pitch.b2 * k2_q
        - params.pitch.b1 * c_phi * k1_q
        - params.roll.b1 * s_phi * t_theta * k1_p
        - (phi_q[0] * th_q[0] + phi_q[1] * th_q[1] + phi_q[2] * th_q[2] + phi_q[3] * th_q[3])
    )

    if learning and not seen.roll_held and abs(k2bar_p) > params.roll.dead_zone:
        s = params.roll.sigma
        th_p = (
            _project(th_p[0], phi_p[0] * k2bar_p, s, params.roll, dt),
            _project(th_p[1], phi_p[1] * k2bar_p, s, params.roll, dt),
            _project(th_p[2], phi_p[2] * k2bar_p, s, params.roll, dt),
        )
    if learning and not seen.pitch_held and abs(k2bar_q) > params.pitch.dead_zone:
        s = params.pitch.sigma
        th_q = (
            _project(th_q[0], phi_q[0] * k2bar_q, s, params.pitch, dt),
            _project(th_q[1], phi_q[1] * k2bar_q, s, params.pitch, dt),
            _project(th_q[2], phi_q[2] * k2bar_q, s, params.pitch, dt),
            _project(th_q[3], phi_q[3] * k2bar_q, s, params.pitch, dt),
        )
    new_state = AdaptiveState(
        roll=roll,
        roll_channel=ChannelState(
            rate=rate_p, xi=xi_p, zeta=zeta_p, tau=tau_p, k1=k1_p, k2=k2bar_p
        ),
        pitch_channel=ChannelState(
            rate=rate_q, xi=xi_q, zeta=zeta_q, tau=tau_q, k1=k1_q, k2=k2bar_q
        ),
        roll_theta=th_p,
        pitch_theta=th_q,
        steering=steering,
        disturbance_dive=d_dive,
        disturbance_climb=d_climb,
    )
    return new_state, tau_p, tau_q


@law_learnt.body(AdaptiveParams)
@kernel
def adaptation(state, params):
    """What the law has learnt, with the Lyapunov functions of its errors.

    V1 = 1/2 sum B1 K1bar^2 and V2 = V1 + 1/2 sum M K2bar^2: equations (22) and (26) without the
    term of the parameter errors, which nobody knows in flight.
    """
    roll, pitch = state.roll_channel, state.pitch_channel
    v_1 = 0.5 * (params.roll.b1 * roll.k1 * roll.k1 + params.pitch.b1 * pitch.k1 * pitch.k1)
    v_2 = v_1 + 0.5 * (
        params.roll.inertia * roll.k2 * roll.k2 + params.pitch.inertia * pitch.k2 * pitch.k2
    )
    th_p, th_q = state.roll_theta, state.pitch_theta
    return Adaptation(
        roll_bias_nm=th_p[0],
        roll_side_force_nm=th_p[1],
        roll_damping_nm=th_p[2],
        pitch_bias_nm=th_q[0],
        pitch_alpha_nm=th_q[1],
        pitch_speed_nm=th_q[2],
        pitch_damping_nm=th_q[3],
        steering_dive_radps=state.steering.dive.b,
        disturbance_dive_radps=state.disturbance_dive,
        steering_climb_radps=state.steering.climb.b,
        disturbance_climb_radps=state.disturbance_climb,
        lyapunov_1=v_1,
        lyapunov_2=v_2,
    )
