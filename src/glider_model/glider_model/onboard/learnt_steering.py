# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""How the vehicle steers, learnt in flight, and how fast it can therefore be asked to.

psi' = (b u + c u^3) (V / V_0)^n + k u' + d, with u the sine of the roll.

b is the effectiveness, its sign that of vehicle and phase. The bend c: steering fades, or grows,
with roll. The adverse or proverse yaw k: while the vehicle rolls, the roll mass makes more moment
than gravity takes back, and the excess turns the nose. d turns the vehicle by itself. n goes by
the vehicle file. A Kalman filter for each phase learns (b, c, k, d) from the measured yaw rate.

Control steers by these estimates, and guidance looks ahead by them; each learns by itself from the
odometry, and so each works with any other (docs/theory.md, section 3).
"""

import math
from typing import NamedTuple

from glider_base.kernel import kernel, replace
from glider_base.settings import Settings, number, positive
from glider_model.vehicle.file import SLOWEST_GLIDE_MPS, VehicleParams
from glider_model.vehicle.steering import steering_exponents

#: Speed through the water at which b is given, and below which nothing is learnt (m/s).
STEERING_SPEED, LEARN_SPEED = 0.5, 0.15
#: A vehicle that does not bank to turn begins to learn after this time (s).
NEVER_S = 1e12
#: What the model does not explain, as a gust, counts as so many standard deviations at most.
MOST_DEVIATIONS = 3.0
#: Largest bandwidth (rad/s), longest lookahead (s), and smallest k that is of importance (-).
BANDWIDTH_MAX, LOOKAHEAD_MAX_S, SMALLEST_KICK = 0.12, 1500.0, 1e-3
#: A weak vehicle is fed less of psi_s': this, times by how much alpha outdoes beta / z (-).
FED = 0.5
#: The vehicle rolls to this share of the roll at which it turns fastest.
SHARE_OF_PEAK = 0.7
#: Sine of the roll at which a vehicle has to turn, or else is steered by its adverse yaw, and the
#: share of it from which on it counts as at its limit: no plant comes quite to that of its file.
BANK, AT_LIMIT = 0.5, 0.9
#: Turn rate over u (rad/s) of a vehicle that is steered by its turn in any case.
STRONG_STEERING = 6e-3
#: An estimate with a smaller standard deviation is believed, this share of which is no difference.
WELL_KNOWN, NO_DIFFERENCE = 3e-4, 0.4
#: A way of steering is kept at least this long (s).
KEPT_S = 300.0
#: Lookahead of a vehicle that is steered by its adverse yaw (s).
KICKED_LOOKAHEAD_S = 150.0


class SteeringLearningSettings(Settings):
    """Estimator of (b, c, k, d), and the two weights of steering by them."""

    prior_radps: float = positive(0.02, 1.0, 'b before the first turn, - in the climb (rad/s)')
    prior_std_radps: float = positive(0.02, 1.0, 'its standard deviation (rad/s)')
    drift_radps: float = number(0.0002, (0.0, 0.1), 'change of b in 1000 s (rad/s)')
    bend_std_radps: float = positive(0.01, 1.0, 'standard deviation of c (rad/s)')
    bend_drift_radps: float = number(0.0003, (0.0, 0.1), 'change of c in 1000 s (rad/s)')
    kick_std: float = number(0.3, (0.0, 5.0), 'standard deviation of k (-)')
    kick_drift: float = number(0.05, (0.0, 5.0), 'change of k in 1000 s (-)')
    disturbance_std_radps: float = positive(0.0001, 0.1, 'standard deviation of d (rad/s)')
    disturbance_drift_radps: float = number(0.00005, (0.0, 0.1), 'change of d in 1000 s (rad/s)')
    noise_radps: float = positive(0.0002, 0.1, 'yaw rate that is not explained (rad/s)')
    correlation_s: float = positive(60.0, 600.0, 'for how long that is one and the same (s)')
    smoothing_s: float = positive(20.0, 200.0, 'low pass on u and yaw rate (s)')
    after_s: float = number(30.0, (0.0, 600.0), 'learning begins so long after an inflection (s)')
    roll_per_s: float = positive(0.032, 1.0, 'rho: u for each second of cross-track (1/s)')
    approach_s: float = number(60.0, (0.0, 3600.0), 'tau: cross-track is closed no faster (s)')

    def params(
        self,
        banks: bool = True,
        slowest_glide: float = SLOWEST_GLIDE_MPS,
        vehicle: VehicleParams | None = None,
    ) -> 'SteeringParams':
        """Kernel parameters for a vehicle; one that does not bank to turn learns nothing."""
        power = steering_exponents(vehicle) if vehicle is not None else (2.0, 2.0)
        return SteeringParams(
            self.drift_radps**2 / 1000.0,
            self.bend_drift_radps**2 / 1000.0,
            self.kick_drift**2 / 1000.0,
            self.disturbance_drift_radps**2 / 1000.0,
            self.noise_radps**2,
            self.correlation_s,
            self.after_s if banks else NEVER_S,
            self.smoothing_s,
            slowest_glide,
            *map(float, power),
            self.roll_per_s,
            self.approach_s,
            BANK,
        )

    def initial_state(self) -> 'Steering':
        """Estimates before the first turn."""
        return Steering(self.phase(1.0), self.phase(-1.0), 0.0, 0.0, 0.0, 0.0, 0.0, 1.0)

    def phase(self, sign: float) -> 'SteeringState':
        """Estimate of one phase that knows nothing."""
        b, c, k = self.prior_std_radps**2, self.bend_std_radps**2, self.kick_std**2
        p = (b, 0.0, 0.0, 0.0, c, 0.0, 0.0, k, 0.0, self.disturbance_std_radps**2)
        return SteeringState(sign * self.prior_radps, 0.0, 0.0, 0.0, p, False, 0.0)


class SteeringParams(NamedTuple):
    """Estimator and weights as the kernels see them."""

    drift: float  #: variance growth of b, c (rad^2/s^3), k (1/s) and d (rad^2/s^3)
    bend_drift: float
    kick_drift: float
    disturbance_drift: float
    noise: float  #: variance of the yaw rate that is not explained (rad^2/s^2)
    correlation_s: float
    after_s: float
    smoothing_s: float
    slowest_glide: float  #: vertical rate below which it turns over (m/s)
    power_dive: float  #: n
    power_climb: float
    rho: float  #: (1/s)
    tau: float  #: (s)
    bank: float  #: sine of the roll at which a vehicle has to turn (-)


class SteeringState(NamedTuple):
    """Estimate and covariance for one phase."""

    b: float  #: effectiveness at the reference speed (rad/s)
    c: float  #: how it bends with the cube of u (rad/s)
    k: float  #: adverse (b k < 0) or proverse yaw (-)
    d: float  #: turn-rate disturbance (rad/s)
    p: tuple[float, float, float, float, float, float, float, float, float, float]
    #: bb, bc, bk, bd, cc, ck, cd, kk, kd, dd
    is_kicked: bool  #: steered by its adverse yaw alone
    kept_s: float  #: for how long it is steered this way (s)


class Steering(NamedTuple):
    """What is known of both phases, and the smoothed measurements it is learnt from."""

    dive: SteeringState
    climb: SteeringState
    sine: float  #: u (V / V_0)^n (-)
    cube: float  #: u^3 (V / V_0)^n (-)
    sine_rate: float  #: u' (1/s)
    yaw_rate: float  #: (rad/s)
    steady_s: float  #: time since the last turn-over (s)
    ratio: float  #: (V / V_0)^n of now (-)


class Way(NamedTuple):
    """How to steer about a trim: u = trim + gain (e + k (u - trim))."""

    trim: float  #: u that turns as is wanted (-)
    most: float  #: largest u that is of use (-)
    gain: float  #: u for an error of the heading (1/rad)
    lookahead_s: float


@kernel
def speed_ratio(speed):
    """V / V_0 of the speed through the water (m/s)."""
    return max(speed, LEARN_SPEED) / STEERING_SPEED


@kernel
def learn_steering(state, sine, cube, sine_rate, yaw_rate, params, dt):
    """One Kalman step of ``dt`` s on yaw_rate = b sine + c cube + k sine_rate + d."""
    bb, bc, bk, bd, cc, ck, cd, kk, kd, dd = state.p
    bb += params.drift * dt
    cc += params.bend_drift * dt
    kk += params.kick_drift * dt
    dd += params.disturbance_drift * dt
    g_b = bb * sine + bc * cube + bk * sine_rate + bd
    g_c = bc * sine + cc * cube + ck * sine_rate + cd
    g_k = bk * sine + ck * cube + kk * sine_rate + kd
    g_d = bd * sine + cd * cube + kd * sine_rate + dd
    explained = g_b * sine + g_c * cube + g_k * sine_rate + g_d
    most = MOST_DEVIATIONS * math.sqrt(explained + params.noise)
    error = yaw_rate - state.b * sine - state.c * cube - state.k * sine_rate - state.d
    spread = explained + params.noise * params.correlation_s / dt
    gain = min(most, max(-most, error)) / spread
    return SteeringState(
        state.b + g_b * gain,
        state.c + g_c * gain,
        state.k + g_k * gain,
        state.d + g_d * gain,
        (
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
        state.is_kicked,
        state.kept_s + dt,
    )


@kernel
def _at_limit(state, bank):
    """Turn rate over u at a limit ``bank`` of u, and its standard deviation (rad/s)."""
    square = bank * bank
    variance = state.p[0] + square * (2.0 * state.p[1] + square * state.p[4])
    return state.b + square * state.c, math.sqrt(max(0.0, variance))


@kernel
def is_to_be_kicked(state, bank):
    """Whether the vehicle is to be steered by its adverse yaw alone.

    So turned it drifts to the roll at which it turns no more, and stays there with its heading
    held, if there is one within the limit ``bank`` (sine): if at the limit it does not turn
    against k. Where nothing is known it is kicked, and so rolled, until it is.
    """
    turn, std = _at_limit(state, bank)
    is_unknown = state.p[0] > state.b * state.b
    if turn * turn + std * std > STRONG_STEERING * STRONG_STEERING:
        return False
    if state.b * state.k > 0.0 and not is_unknown:
        return False
    against = -turn if state.k > 0.0 else turn
    if abs(against) > (NO_DIFFERENCE * std if std < WELL_KNOWN else std):
        return against < 0.0
    return state.is_kicked or is_unknown


@kernel
def choose_steering(state, sine, bank):
    """Change the way of steering, if that is called for.

    Given up at a large roll, the kick leaves a large heading error; so it is kept while it is
    enough, or until the vehicle turns out to turn well.

    Parameters
    ----------
    state : SteeringState
    sine, bank : float
        Sine of the roll, smoothed, and of its limit.
    """
    turn, std = _at_limit(state, bank)
    turns_well = abs(turn) > STRONG_STEERING + MOST_DEVIATIONS * std
    is_kicked = is_to_be_kicked(state, bank)
    is_enough = state.is_kicked and abs(sine) < AT_LIMIT * bank and not turns_well
    if is_kicked == state.is_kicked or is_enough or state.kept_s < KEPT_S:
        return state
    return replace(state, is_kicked=is_kicked, kept_s=0.0)


@kernel
def learn(steering, measured, speed, params, dt):
    """One tick of learning; only the phase that is flown learns, and only in a glide."""
    power = params.power_dive if measured.vertical_rate > 0.0 else params.power_climb
    ratio = speed_ratio(speed) ** power
    is_gliding = abs(measured.vertical_rate) > params.slowest_glide and speed > LEARN_SPEED
    steady_s = steering.steady_s + dt if is_gliding else 0.0
    share = dt / (params.smoothing_s + dt) if steady_s > dt else 1.0
    u = math.sin(measured.phi)
    sine = steering.sine + share * (u * ratio - steering.sine)
    cube = steering.cube + share * (u * u * u * ratio - steering.cube)
    sine_rate = steering.sine_rate + share * (measured.phi_dot - steering.sine_rate)
    yaw_rate = steering.yaw_rate + share * (measured.psi_dot - steering.yaw_rate)
    dive, climb = steering.dive, steering.climb
    if steady_s > params.after_s:
        if measured.vertical_rate > 0.0:
            dive = learn_steering(dive, sine, cube, sine_rate, yaw_rate, params, dt)
            dive = choose_steering(dive, sine / ratio, params.bank)
        else:
            climb = learn_steering(climb, sine, cube, sine_rate, yaw_rate, params, dt)
            climb = choose_steering(climb, sine / ratio, params.bank)
    return Steering(dive, climb, sine, cube, sine_rate, yaw_rate, steady_s, ratio)


@kernel
def heading_gains(slope, k, params):
    """Bandwidth a (1/s) of the heading, lookahead T (s), and the share w of psi_s' to be fed.

    For e = e2 / U, e' = psi* + k u, psi*' = b u with b the ``slope``, the u that minimises the
    integral of e^2 + tau^2 e'^2 + (u / rho)^2 is b u = -beta e - (alpha - beta k / b) psi*. With
    psi_s = -e / T, b u = w psi_s' + a (psi_s - psi*) is that u exactly.
    """
    b, kick = abs(slope), max(abs(k), SMALLEST_KICK)
    r2, t2 = params.rho * params.rho, params.tau * params.tau
    more = 1.0 + r2 * kick * kick * t2
    beta = params.rho * b / math.sqrt(more)
    alpha = math.sqrt(2.0 * beta + r2 * (kick * kick + b * b * t2) / more)
    q = math.copysign(kick, slope * k) / b
    a = alpha - beta * q
    fed = min(alpha * alpha / (4.0 * beta), FED * (alpha / abs(beta * q) - 1.0))
    fed = min(1.0, max(0.0, fed))
    rest = max(0.0, (a + fed * beta * q) ** 2 - 4.0 * fed * beta)
    x = 2.0 * beta / (a - fed * beta * q + math.sqrt(rest))
    a = beta * (1.0 + fed * q * x) / x
    return min(BANDWIDTH_MAX, a), min(LOOKAHEAD_MAX_S, 1.0 / x), fed


@kernel
def slope_at(state, square):
    """Slope b + 3 c u^2 where u^2 is so much, with its deviation: never zero (rad/s)."""
    three = 3.0 * square
    slope = state.b + three * state.c
    variance = state.p[0] + three * (2.0 * state.p[1] + three * state.p[4])
    return math.copysign(math.sqrt(slope * slope + max(0.0, variance)), slope)


@kernel
def choose_way(state, turn, ratio, limit, params):
    """How to steer where ``turn`` (rad/s) is asked for: a `Way`.

    About the roll that turns so; where steering fades with roll it stays below the peak of
    b u + c u^3. Or by the adverse yaw alone, with as much of it as is known.

    Parameters
    ----------
    state : SteeringState
    turn : float
        psi_s', that of the heading asked for (rad/s).
    ratio : float
        (V / V_0)^n (-).
    limit : float
        Largest u (-).
    params : SteeringParams
    """
    if state.is_kicked:
        gain = state.k / (state.k * state.k + state.p[7])
        return Way(0.0, limit, gain, KICKED_LOOKAHEAD_S)
    b, c, most = state.b, state.c, limit
    if b * c < 0.0:
        most = min(limit, SHARE_OF_PEAK * math.sqrt(-b / (3.0 * c)))
    _, _, fed = heading_gains(slope_at(state, 0.0) * ratio, state.k, params)
    wanted = (fed * turn - state.d) / ratio
    trim = 0.0
    for _ in range(4):
        trim += (wanted - (b + c * trim * trim) * trim) / slope_at(state, trim * trim)
        trim = min(most, max(-most, trim))
    slope = slope_at(state, trim * trim) * ratio
    a, lookahead_s, _ = heading_gains(slope, state.k, params)
    return Way(trim, most, a / slope, lookahead_s)


@kernel
def steer_to(way, error, u, k):
    """Return the u that steers to a heading ``error`` away (rad), from the u of now."""
    sine = way.trim + way.gain * (error + k * (u - way.trim))
    return min(way.most, max(-way.most, sine))


@kernel
def lookaheads(steering, params):
    """How far ahead the vehicle can follow, in dive and climb (s)."""
    dive = choose_way(steering.dive, 0.0, steering.ratio, params.bank, params)
    climb = choose_way(steering.climb, 0.0, steering.ratio, params.bank, params)
    return dive.lookahead_s, climb.lookahead_s
