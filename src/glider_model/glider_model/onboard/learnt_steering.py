# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""How the vehicle steers, learnt in flight: yaw rate = (b s + c s^3) V / V_0 + k phi' + d.

s is sin(phi). Both the effectiveness b and its sign belong to vehicle and phase (Seaglider: -0.040
in the dive, +0.018 in the climb), so a Kalman filter estimates (b, c, k, d) for each phase from
the measured yaw rate. It starts knowing nothing: the first turn that the path asks for tells the
sign.

The bend c: steering fades, or grows, with roll. A vehicle that steers weakly turns fastest at some
20 deg of roll and beyond 35 deg the other way.

The kick k: while the vehicle rolls, the roll mass makes more moment than gravity takes back, and
on a pitched vehicle the excess turns the nose, by about (damping in roll / damping in yaw)
tan(pitch) of the roll angle, often to the wrong side. psi - k phi is the heading that is left when
the roll is gone.

Control steers by these estimates; guidance needs them to know how slowly it has to ask. Each
learns by itself from the odometry, and so each works with any other (docs/theory.md, section 3).
"""

import math
from typing import NamedTuple

from pydantic import Field

from glider_base.kernel import kernel, replace
from glider_base.settings import Settings
from glider_model.vehicle.file import SLOWEST_GLIDE_MPS

#: Speed through the water at which steering effectiveness is given (m/s).
STEERING_SPEED = 0.5
#: A vehicle that does not bank to turn begins to learn after this time (s).
NEVER_S = 1e12
#: Nothing is learnt below this speed (m/s).
LEARN_SPEED = 0.15
#: A vehicle that turns faster than this times sin(roll) is steered by its turn (rad/s).
STRONG_STEERING = 6e-3
#: An estimate with a smaller standard deviation is believed, this share of which is no difference.
WELL_KNOWN, NO_DIFFERENCE = 3e-4, 0.4
#: The way of steering is kept at least this long (s).
KEPT_S = 300.0
#: Roll is at its limit from this share of its sine on.
AT_LIMIT = 0.98
#: Smallest kick that is of importance (-).
SMALLEST_KICK = 1e-3
#: A vehicle that is steered by its kick too follows as one whose turn outruns it here (rad/s).
KICKED_FREQUENCY = 0.015


class SteeringLearningSettings(Settings):
    """Estimator of steering effectiveness and turn-rate disturbance."""

    prior_radps: float = Field(
        0.02, gt=0.0, le=1.0, description='b before anything is known, - in the climb (rad/s)'
    )
    prior_std_radps: float = Field(
        0.02, gt=0.0, le=1.0, description='its standard deviation (rad/s)'
    )
    drift_radps: float = Field(
        0.0002, ge=0.0, le=0.1, description='change of b to be expected in 1000 s (rad/s)'
    )
    bend_std_radps: float = Field(
        0.01, gt=0.0, le=1.0, description='standard deviation of c before it is known (rad/s)'
    )
    bend_drift_radps: float = Field(
        0.0003, ge=0.0, le=0.1, description='change of c to be expected in 1000 s (rad/s)'
    )
    kick_std: float = Field(
        0.3, ge=0.0, le=5.0, description='standard deviation of k before it is known (-)'
    )
    kick_drift: float = Field(
        0.05, ge=0.0, le=5.0, description='change of k to be expected in 1000 s (-)'
    )
    disturbance_std_radps: float = Field(
        0.0001, gt=0.0, le=0.1, description='standard deviation of d before it is known (rad/s)'
    )
    disturbance_drift_radps: float = Field(
        0.00005, ge=0.0, le=0.1, description='change of d to be expected in 1000 s (rad/s)'
    )
    noise_radps: float = Field(
        0.0002, gt=0.0, le=0.1, description='yaw rate that the model does not explain (rad/s)'
    )
    correlation_s: float = Field(
        60.0, gt=0.0, le=600.0, description='time over which that is one and the same error (s)'
    )
    smoothing_s: float = Field(
        20.0,
        gt=0.0,
        le=200.0,
        description='low pass on roll and yaw rate, slower than the turn takes to build up (s)',
    )
    after_s: float = Field(
        30.0, ge=0.0, le=600.0, description='learning begins this long after an inflection (s)'
    )
    bank_deg: float = Field(
        30.0,
        gt=0.0,
        le=80.0,
        description='roll at which a vehicle has to turn, or else is steered by its kick (deg)',
    )

    def params(
        self, banks: bool = True, slowest_glide: float = SLOWEST_GLIDE_MPS
    ) -> 'SteeringParams':
        """Kernel parameters for a vehicle, of its file's slowest glide (m/s).

        One that does not bank to turn learns nothing.
        """
        return SteeringParams(
            drift=self.drift_radps**2 / 1000.0,
            bend_drift=self.bend_drift_radps**2 / 1000.0,
            kick_drift=self.kick_drift**2 / 1000.0,
            disturbance_drift=self.disturbance_drift_radps**2 / 1000.0,
            noise=self.noise_radps**2 * self.correlation_s,
            after_s=self.after_s if banks else NEVER_S,
            smoothing_s=self.smoothing_s,
            bank=math.sin(math.radians(self.bank_deg)),
            slowest_glide=slowest_glide,
        )

    def initial_state(self) -> 'Steering':
        """Estimates before the first turn."""
        return Steering(
            dive=self._phase(1.0),
            climb=self._phase(-1.0),
            bank=0.0,
            bend=0.0,
            roll_rate=0.0,
            yaw_rate=0.0,
            steady_s=0.0,
        )

    def _phase(self, sign: float) -> 'SteeringState':
        return SteeringState(
            b=sign * self.prior_radps,
            c=0.0,
            k=0.0,
            d=0.0,
            p=(
                *(self.prior_std_radps**2, 0.0, 0.0, 0.0),
                *(self.bend_std_radps**2, 0.0, 0.0),
                *(self.kick_std**2, 0.0),
                self.disturbance_std_radps**2,
            ),
            is_kicked=False,
            kept_s=0.0,
        )


class SteeringParams(NamedTuple):
    """Estimator as the kernels see it."""

    drift: float  #: variance growth of b (rad^2/s^3)
    bend_drift: float  #: variance growth of c (rad^2/s^3)
    kick_drift: float  #: variance growth of k (1/s)
    disturbance_drift: float  #: variance growth of d (rad^2/s^3)
    noise: float  #: spectral density of the yaw-rate noise (rad^2/s)
    after_s: float  #: time after a turn-over in which nothing is learnt (s)
    smoothing_s: float
    bank: float  #: sine of the roll at which a vehicle has to turn (-)
    slowest_glide: float  #: vertical rate below which it turns over (m/s)


class SteeringState(NamedTuple):
    """Estimate and covariance for one phase."""

    b: float  #: effectiveness (rad/s)
    c: float  #: how it bends with the cube of sin(roll) (rad/s)
    k: float  #: heading per roll angle while the vehicle rolls (-)
    d: float  #: turn-rate disturbance (rad/s)
    p: tuple[float, float, float, float, float, float, float, float, float, float]
    #: upper triangle of the covariance of (b, c, k, d), row by row
    is_kicked: bool  #: steered by its kick, not by its turn
    kept_s: float  #: for how long it is steered this way (s)


class Steering(NamedTuple):
    """What is known of both phases, and the smoothed measurements it is learnt from."""

    dive: SteeringState
    climb: SteeringState
    bank: float  #: sin(phi) V / V_0 (-)
    bend: float  #: sin(phi)^3 V / V_0 (-)
    roll_rate: float  #: (rad/s)
    yaw_rate: float  #: (rad/s)
    steady_s: float  #: time since the last turn-over (s)


@kernel
def speed_ratio(speed):
    """V / V_0 of the speed through the water (m/s)."""
    return max(speed, LEARN_SPEED) / STEERING_SPEED


@kernel
def learn_steering(state, bank, bend, roll_rate, yaw_rate, params, dt):
    """One Kalman step of ``dt`` s on yaw_rate = b bank + c bend + k roll_rate + d.

    Parameters
    ----------
    bank, bend : float
        sin(phi) V / V_0 and sin(phi)^3 V / V_0, smoothed as the rates are (-).
    roll_rate, yaw_rate : float
        Measured and smoothed (rad/s).
    """
    bb, bc, bk, bd, cc, ck, cd, kk, kd, dd = state.p
    bb += params.drift * dt
    cc += params.bend_drift * dt
    kk += params.kick_drift * dt
    dd += params.disturbance_drift * dt
    g_b = bb * bank + bc * bend + bk * roll_rate + bd
    g_c = bc * bank + cc * bend + ck * roll_rate + cd
    g_k = bk * bank + ck * bend + kk * roll_rate + kd
    g_d = bd * bank + cd * bend + kd * roll_rate + dd
    spread = g_b * bank + g_c * bend + g_k * roll_rate + g_d + params.noise / dt
    gain = (yaw_rate - state.b * bank - state.c * bend - state.k * roll_rate - state.d) / spread
    return SteeringState(
        b=state.b + g_b * gain,
        c=state.c + g_c * gain,
        k=state.k + g_k * gain,
        d=state.d + g_d * gain,
        p=(
            bb - g_b * g_b / spread,
            bc - g_b * g_c / spread,
            bk - g_b * g_k / spread,
            bd - g_b * g_d / spread,
            cc - g_c * g_c / spread,
            ck - g_c * g_k / spread,
            cd - g_c * g_d / spread,
            kk - g_k * g_k / spread,
            kd - g_k * g_d / spread,
            dd - g_d * g_d / spread,
        ),
        is_kicked=state.is_kicked,
        kept_s=state.kept_s + dt,
    )


@kernel
def is_to_be_kicked(state, bank):
    """Whether the vehicle is to be steered by its kick: it hardly turns, however far it rolls.

    Turned by the kick alone, the roll that is needed grows until the vehicle turns no more: it
    ends up at the bank at which b + c s^2 vanishes. That is a place to fly at if there is such a
    bank within the limit ``bank`` (sine): if at the limit the vehicle turns to the side to which
    the kick goes. If it turns against the kick even there, it can be steered by turning, and so it
    can if turn and kick go to the same side at any roll. Where nothing is known, the vehicle is
    kicked, and so rolled, until it is.
    """
    square = bank * bank
    against = state.b + square * state.c
    variance = state.p[0] + 2.0 * square * state.p[1] + square * square * state.p[4]
    if against * against + variance > STRONG_STEERING * STRONG_STEERING:
        return False
    if state.k > 0.0:
        against = -against
    if state.b * state.k > 0.0 and state.p[0] < state.b * state.b:
        return False
    std = math.sqrt(max(0.0, variance))
    doubt = NO_DIFFERENCE * std if std < WELL_KNOWN else std
    if abs(against) > doubt:
        return against < 0.0
    return state.is_kicked or state.p[0] > state.b * state.b


@kernel
def turns_well(state, bank):
    """Whether it is known that the vehicle turns fast at the limit ``bank`` (sine)."""
    square = bank * bank
    turn = state.b + square * state.c
    variance = state.p[0] + 2.0 * square * state.p[1] + square * square * state.p[4]
    return abs(turn) > STRONG_STEERING + 3.0 * math.sqrt(max(0.0, variance))


@kernel
def choose_steering(state, sine, bank):
    """Change the way of steering, if that is called for.

    A vehicle that holds its heading by its kick is left alone: given up at a large roll, the kick
    leaves a large heading error. The kick is given up where it is not enough, at the limit, and
    where the vehicle turns out to turn well: what made it look weak, as a gust does, is over.

    Parameters
    ----------
    state : SteeringState
    sine, bank : float
        Sine of the roll, smoothed, and of its limit.
    """
    is_kicked = is_to_be_kicked(state, bank)
    is_enough = state.is_kicked and abs(sine) < AT_LIMIT * bank and not turns_well(state, bank)
    if is_kicked == state.is_kicked or is_enough or state.kept_s < KEPT_S:
        return state
    return replace(state, is_kicked=is_kicked, kept_s=0.0)


@kernel
def followed_frequency(state):
    """Frequency z = |b / k| (rad/s) up to which the vehicle can be steered by its turn.

    While it rolls its kick goes the wrong way: y'' = U (b phi + k phi') has a zero there. A
    vehicle that is kicked, or whose kick goes with its turn, follows faster. Of one that is not
    known yet no less is expected than it may turn out to have.
    """
    frequency = math.sqrt(state.b * state.b + state.p[0]) / max(abs(state.k), SMALLEST_KICK)
    if state.is_kicked or state.b * state.k > 0.0:
        return max(KICKED_FREQUENCY, frequency)
    return frequency


@kernel
def learn(steering, measured, speed, params, dt):
    """One tick of learning; only the phase that is flown learns, and only in a glide.

    Parameters
    ----------
    steering : Steering
    measured : Measured
    speed : float
        Speed through the water, by the flight model (m/s).
    params : SteeringParams
    dt : float
        Length of the tick (s).
    """
    ratio = speed_ratio(speed)
    is_gliding = abs(measured.vertical_rate) > params.slowest_glide and speed > LEARN_SPEED
    steady_s = steering.steady_s + dt if is_gliding else 0.0
    share = dt / (params.smoothing_s + dt) if steady_s > dt else 1.0
    sine = math.sin(measured.phi)
    bank = steering.bank + share * (sine * ratio - steering.bank)
    bend = steering.bend + share * (sine * sine * sine * ratio - steering.bend)
    roll_rate = steering.roll_rate + share * (measured.phi_dot - steering.roll_rate)
    yaw_rate = steering.yaw_rate + share * (measured.psi_dot - steering.yaw_rate)
    dive, climb = steering.dive, steering.climb
    if steady_s > params.after_s:
        if measured.vertical_rate > 0.0:
            dive = learn_steering(dive, bank, bend, roll_rate, yaw_rate, params, dt)
            dive = choose_steering(dive, bank / ratio, params.bank)
        else:
            climb = learn_steering(climb, bank, bend, roll_rate, yaw_rate, params, dt)
            climb = choose_steering(climb, bank / ratio, params.bank)
    return Steering(
        dive=dive,
        climb=climb,
        bank=bank,
        bend=bend,
        roll_rate=roll_rate,
        yaw_rate=yaw_rate,
        steady_s=steady_s,
    )
