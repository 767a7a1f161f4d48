# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""The paper's law: command-filtered adaptive backstepping for roll and pitch.

Zhang et al. (2021), equations (12)-(29), made whole (docs/paper.md). For each of roll and pitch,
with the angle error K1 and the rate error K2 = omega - a_s:

    a     = J3^-1 (Omega_s' - L1 K1 - h r)                          (16)
    tau   = M a_s' - B2 K2 - J3^T B1 K1bar - Phi^T theta_hat        (18)
    theta_hat' = Proj[Gamma (Phi K2bar - sigma theta_hat)]          (19)

K1bar = K1 - xi and K2bar = K2 - zeta are the errors less what the command filter and the actuators
are to blame for (Farrell et al. 2009), so that neither is learnt as a disturbance. Regressors are
scaled such that every parameter is a moment in N m. Unknown to the law: damping, static moments
and trim. The paper has no law for the heading of a vehicle that banks to turn: here that is the
PID's, by the steering of the vehicle file. The adaptive law is this one with a single regressor
for each phase, and learns how the vehicle steers.
"""

import math
from typing import NamedTuple

from pydantic import Field

from glider_base.frames import wrap_angle
from glider_base.kernel import kernel, replace
from glider_base.settings import Settings, derived, number, positive
from glider_base.signals import NOTHING_LEARNT
from glider_control.heading import HeadingLawSettings, HeadingParams, heading_to_roll
from glider_control.law import Bank, bank_carefully, law_learnt, law_step
from glider_model.onboard.command_filter import Filtered, FilterParams, filter_command
from glider_model.onboard.moving_mass import Righting, make_righting
from glider_model.vehicle.file import Vehicle, VehicleParams
from glider_model.vehicle.rigid_body import GRAVITY, rigid_body

#: Typical size of the regressors: V^2 alpha, V^2 (m^2/s^2), side force (N), rates (rad/s).
SCALE_ALPHA, SCALE_V2, SCALE_SIDE, SCALE_ROLL_RATE, SCALE_PITCH_RATE = 0.01, 0.25, 2.0, 0.05, 0.03
#: Adaptation waits this long after an inflection (s).
LEARN_AFTER_S = 20.0
#: Natural frequency of the filter on the virtual rate command (rad/s), and its rate limit.
RATE_FILTER = FilterParams(2.0, 10.0)


class ChannelSettings(Settings):
    """Gains of one channel, roll or pitch."""

    l1_per_s: float = positive(0.15, 5.0, 'L1, angle error (1/s)', tunable=True)
    b1: float = positive(6.0, 500.0, 'B1, angle (N m/rad)', tunable=True)
    b2: float = positive(14.0, 500.0, 'B2, rate (N m s/rad)', tunable=True)
    gamma: float = number(0.3, (0.0, 50.0), 'Gamma, adaptation (N m/rad)', tunable=True)
    sigma_per_s: float = number(1e-5, (0.0, 1.0), 'sigma, leakage (rad/(N m s))', tunable=True)
    dead_zone_radps: float = number(
        5e-5, (0.0, 0.1), 'rate error below which nothing is learnt (rad/s)', tunable=True
    )
    bound: float = positive(3.0, 100.0, 'projection: largest parameter (N m)')

    def params(self, inertia: float) -> 'ChannelParams':
        """Kernel parameters of a channel that turns an inertia (kg m^2)."""
        return derived(ChannelParams, self, inertia=inertia)


class RollChannelSettings(ChannelSettings):
    """Gains of the roll channel."""

    l1_per_s: float = positive(0.3, 5.0, 'L1, angle error (1/s)', tunable=True)
    b1: float = positive(8.0, 500.0, 'B1, angle (N m/rad)', tunable=True)
    b2: float = positive(12.0, 500.0, 'B2, rate (N m s/rad)', tunable=True)
    dead_zone_radps: float = number(
        5e-4, (0.0, 0.1), 'rate error below which nothing is learnt (rad/s)', tunable=True
    )


class BacksteppingSettings(HeadingLawSettings):
    """Gains of the paper's law."""

    pitch: ChannelSettings = Field(ChannelSettings(), description='pitch channel')
    roll: RollChannelSettings = Field(RollChannelSettings(), description='roll channel')

    def params(self, vehicle: Vehicle, bank: Bank) -> 'BacksteppingParams':
        """Kernel parameters for a vehicle whose masses and steering are known."""
        of_file = vehicle.params()
        roll, pitch = channel_params(self.roll, self.pitch, of_file)
        return BacksteppingParams(
            roll=roll,
            pitch=pitch,
            mass=of_file.m,
            heading=self.heading_params(vehicle),
            roll_limit=bank.limit,
            roll_filter=bank.filter,
            righting=make_righting(of_file),
        )

    def initial_state(self) -> 'BacksteppingState':
        """State of a law that knows nothing yet."""
        return BacksteppingState()


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


class BacksteppingParams(NamedTuple):
    """The law as the kernels see it."""

    roll: ChannelParams
    pitch: ChannelParams
    mass: float  #: of the vehicle (kg)
    heading: HeadingParams
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


class Channels(NamedTuple):
    """Both channels, and everything that they have learnt."""

    roll: ChannelState
    pitch: ChannelState
    roll_theta: tuple[float, float, float]  #: bias, side force, roll damping (N m)
    pitch_theta: tuple[float, float, float, float]  #: bias, V^2 alpha, V^2, pitch damping (N m)


_AT_REST = ChannelState(rate=Filtered(0.0, 0.0), xi=0.0, zeta=0.0, tau=0.0, k1=0.0, k2=0.0)
#: Channels that know nothing yet.
INITIAL_CHANNELS = Channels(_AT_REST, _AT_REST, (0.0, 0.0, 0.0), (0.0, 0.0, 0.0, 0.0))


class BacksteppingState(NamedTuple):
    """Channels, the roll filter and the integrator of the heading."""

    roll: Filtered = Filtered(0.0, 0.0)  #: phi_s
    channels: Channels = INITIAL_CHANNELS
    heading_integral: float = 0.0  #: (rad/s)
    steady_s: float = 0.0  #: time since the last inflection (s)


def channel_params(
    roll: ChannelSettings, pitch: ChannelSettings, vehicle: VehicleParams
) -> tuple[ChannelParams, ChannelParams]:
    """Kernel parameters of roll and pitch, of a vehicle whose masses are known."""
    _, _, _, i_xx, i_yy, *_ = rigid_body(0.0, 0.0, vehicle)
    return roll.params(i_xx + vehicle.a_44), pitch.params(i_yy + vehicle.a_55)


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


# long: the equations stand in one place, and parts would hand on a dozen numbers each.
@kernel
def roll_and_pitch(channels, roll, seen, learning, params, dt):
    """Roll and pitch moment that hold a roll and the reference pitch.

    Parameters
    ----------
    channels : Channels
    roll : Filtered
        phi_s, the roll that is asked for (rad).
    seen : Seen
    learning : bool
        Whether the vehicle glides, so that moments can be learnt.
    params : NamedTuple
        With ``roll`` and ``pitch`` (`ChannelParams`), and ``mass`` (kg).
    dt : float
        Length of the tick (s).

    Returns
    -------
    Channels
    tau_p, tau_q : float
        (N m)
    """
    measured, reference, speed = seen.measured, seen.reference, seen.speed
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
        channels.roll, e_phi, a_p, p, seen.tau_p, 1.0, params.roll, dt
    )
    rate_q, xi_q, zeta_q, k1_q, k2_q, k2bar_q = channel_step(
        channels.pitch, e_theta, a_q, q, seen.tau_q, c_phi, params.pitch, dt
    )

    # regressors; the side force that sideslip makes, from the lateral balance of a turn
    v2 = speed * speed
    side = params.mass * speed * r - seen.m_b * GRAVITY * c_theta * s_phi
    phi_p = (1.0, side / SCALE_SIDE, rate_p.value / SCALE_ROLL_RATE)
    phi_q = (1.0, v2 * seen.alpha / SCALE_ALPHA, v2 / SCALE_V2, rate_q.value / SCALE_PITCH_RATE)

    th_p, th_q = channels.roll_theta, channels.pitch_theta
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
    channels = Channels(
        roll=ChannelState(rate=rate_p, xi=xi_p, zeta=zeta_p, tau=tau_p, k1=k1_p, k2=k2bar_p),
        pitch=ChannelState(rate=rate_q, xi=xi_q, zeta=zeta_q, tau=tau_q, k1=k1_q, k2=k2bar_q),
        roll_theta=th_p,
        pitch_theta=th_q,
    )
    return channels, tau_p, tau_q


@law_step.body(BacksteppingParams)
@kernel
def backstepping_step(state, seen, params, dt):
    """Roll and pitch moment (N m) of the paper's law: see `law_step`."""
    measured = seen.measured
    params = bank_carefully(seen.m_b, params)
    is_gliding = abs(measured.vertical_rate) > params.heading.slowest_glide
    steady_s = state.steady_s + dt if is_gliding else 0.0
    command, integral = heading_to_roll(
        state.heading_integral,
        measured,
        seen.reference,
        seen.speed,
        params.roll_limit,
        params.heading,
        dt,
    )
    roll = filter_command(state.roll, command, params.roll_filter, dt)
    learning = steady_s > LEARN_AFTER_S
    channels, tau_p, tau_q = roll_and_pitch(state.channels, roll, seen, learning, params, dt)
    state = BacksteppingState(
        roll=roll, channels=channels, heading_integral=integral, steady_s=steady_s
    )
    return state, tau_p, tau_q


@kernel
def learnt_moments(channels, params):
    """What the channels have learnt, with the Lyapunov functions of their errors.

    V1 = 1/2 sum B1 K1bar^2 and V2 = V1 + 1/2 sum M K2bar^2: equations (22) and (26) without the
    term of the parameter errors, which nobody knows in flight.

    Returns
    -------
    Adaptation
        Without anything about the steering.
    """
    roll, pitch = channels.roll, channels.pitch
    v_1 = 0.5 * (params.roll.b1 * roll.k1 * roll.k1 + params.pitch.b1 * pitch.k1 * pitch.k1)
    v_2 = v_1 + 0.5 * (
        params.roll.inertia * roll.k2 * roll.k2 + params.pitch.inertia * pitch.k2 * pitch.k2
    )
    th_p, th_q = channels.roll_theta, channels.pitch_theta
    return replace(
        NOTHING_LEARNT,
        roll_bias_nm=th_p[0],
        roll_side_force_nm=th_p[1],
        roll_damping_nm=th_p[2],
        pitch_bias_nm=th_q[0],
        pitch_alpha_nm=th_q[1],
        pitch_speed_nm=th_q[2],
        pitch_damping_nm=th_q[3],
        lyapunov_1=v_1,
        lyapunov_2=v_2,
    )


@law_learnt.body(BacksteppingParams)
@kernel
def adaptation(state, params):
    """What the law has learnt of the moments; the steering is that of the file."""
    return learnt_moments(state.channels, params)
