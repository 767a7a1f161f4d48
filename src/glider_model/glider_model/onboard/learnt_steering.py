# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""How the vehicle steers, learnt in flight, and how fast it can therefore be asked to.

psi' = (b u + c u^3) (V / V_0)^n + k u' + d, with u the sine of the roll (docs/theory.md, 3).

b is the effectiveness, its sign that of vehicle and phase; c its bend with roll; k the adverse or
proverse yaw; d turns the vehicle by itself; n is of the vehicle file. Control steers by what is
learnt, and guidance looks ahead by it; each learns by itself, and so works with any other.
"""

import math
from typing import NamedTuple

from glider_base.kernel import kernel, replace
from glider_base.settings import Settings, derived, number, positive
from glider_model.vehicle.file import VehicleParams
from glider_model.vehicle.steering import STEERING_SPEED, steering_exponents

#: Below this speed nothing is learnt (m/s); what the model does not explain, as a gust, counts as
#: so many standard deviations at most.
LEARN_SPEED, MOST_DEVIATIONS = 0.15, 3.0
#: Largest bandwidth (rad/s), and smallest k that is of importance (-).
BANDWIDTH_MAX, SMALLEST_KICK = 0.12, 1e-3
#: A weak vehicle is fed this of psi_s', times by how much alpha outdoes beta / z (-); and it is
#: rolled to this share of the roll at which it turns fastest.
FED, SHARE_OF_PEAK = 0.5, 0.7
#: Sine of the roll at which a vehicle has to turn, or else is steered by its adverse yaw, and the
#: share of it from which on it counts as at its limit: no plant comes quite to that of its file.
BANK, AT_LIMIT = 0.5, 0.9
#: Turn rate over u (rad/s) of who is steered by its turn in any case; and the deviation (rad/s) of
#: one that is known, of which this share is no difference.
STRONG_STEERING, WELL_KNOWN, NO_DIFFERENCE = 6e-3, 3e-4, 0.4
#: A way of steering is kept so long at least; lookahead of who steers well, as by adverse yaw (s).
KEPT_S, WELL_S = 300.0, 150.0


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
    smoothing_s: float = positive(20.0, 200.0, 'low pass on u and yaw rate, wait of integrals (s)')
    after_s: float = number(30.0, (0.0, 600.0), 'learning begins so long after an inflection (s)')
    roll_per_s: float = positive(0.032, 1.0, 'rho: u for each second of cross-track (1/s)')
    approach_s: float = number(60.0, (0.0, 3600.0), 'tau: cross-track is closed no faster (s)')

    def params(self, vehicle: VehicleParams, most: float = 1.0) -> 'SteeringParams':
        """Kernel parameters, for roll up to ``most`` (its sine); 0: it does not bank to turn."""
        return derived(
            SteeringParams,
            self,
            slowest_glide=vehicle.slowest_glide,
            power=steering_exponents(vehicle),
            bank=min(BANK, most),
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
    """Estimator and weights as the kernels see them: the settings, and what is of the vehicle."""

    drift: float
    bend_drift: float
    kick_drift: float
    disturbance_drift: float
    noise: float
    correlation_s: float
    smoothing_s: float
    after_s: float
    roll_per_s: float
    approach_s: float
    slowest_glide: float  #: vertical rate below which it turns over (m/s)
    power: tuple[float, float]  #: n in dive and climb
    bank: float  #: sine of the roll at which a vehicle has to turn (-); 0: it does not bank to


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
    steady_s: float  #: time since the last inflection (s)
    ratio: float  #: (V / V_0)^n of now (-)


@kernel
def speed_ratio(speed):
    """V / V_0 of the speed through the water (m/s)."""
    return max(speed, LEARN_SPEED) / STEERING_SPEED


@kernel
def learn_steering(state, sine, cube, sine_rate, yaw_rate, params, dt):
    """One Kalman step of ``dt`` s on yaw_rate = b sine + c cube + k sine_rate + d."""
    bb, bc, bk, bd, cc, ck, cd, kk, kd, dd = state.p
    bb += params.drift**2 / 1000.0 * dt
    cc += params.bend_drift**2 / 1000.0 * dt
    kk += params.kick_drift**2 / 1000.0 * dt
    dd += params.disturbance_drift**2 / 1000.0 * dt
    g_b = bb * sine + bc * cube + bk * sine_rate + bd
    g_c = bc * sine + cc * cube + ck * sine_rate + cd
    g_k = bk * sine + ck * cube + kk * sine_rate + kd
    g_d = bd * sine + cd * cube + kd * sine_rate + dd
    noise = params.noise**2
    explained = g_b * sine + g_c * cube + g_k * sine_rate + g_d
    most = MOST_DEVIATIONS * math.sqrt(explained + noise)
    error = yaw_rate - state.b * sine - state.c * cube - state.k * sine_rate - state.d
    spread = explained + noise * params.correlation_s / dt
    gain = min(most, max(-most, error)) / spread
    b, c = state.b + g_b * gain, state.c + g_c * gain
    k, d = state.k + g_k * gain, state.d + g_d * gain
    p = (
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
    )
    return SteeringState(b, c, k, d, p, state.is_kicked, state.kept_s + dt)


@kernel
def turn_over_u(state, square):
    """Turn rate over u, b + c u^2 (rad/s), where u^2 is ``square``, and its variance."""
    variance = state.p[0] + square * (2.0 * state.p[1] + square * state.p[4])
    return state.b + square * state.c, max(0.0, variance)


@kernel
def choose_steering(state, sine, bank):
    """Change the way of steering, if the smoothed ``sine`` of the roll and its limit call for it.

    Who does not turn against k at the limit is steered by adverse yaw alone, and so drifts to the
    roll at which it turns no more; so is who is not known, until it is. Given up at a large roll
    that leaves a large heading error: it is kept while it is enough, until the vehicle turns well.
    """
    turn, variance = turn_over_u(state, bank * bank)
    std, is_unknown = math.sqrt(variance), state.p[0] > state.b * state.b
    against = -turn if state.k > 0.0 else turn
    is_kicked = state.is_kicked or is_unknown
    if abs(against) > (NO_DIFFERENCE * std if std < WELL_KNOWN else std):
        is_kicked = against < 0.0
    is_proverse = state.b * state.k > 0.0 and not is_unknown
    if is_proverse or turn * turn + std * std > STRONG_STEERING * STRONG_STEERING:
        is_kicked = False
    turns_well = abs(turn) > STRONG_STEERING + MOST_DEVIATIONS * std
    is_enough = state.is_kicked and abs(sine) < AT_LIMIT * bank and not turns_well
    if is_kicked == state.is_kicked or is_enough or state.kept_s < KEPT_S:
        return state
    return replace(state, is_kicked=is_kicked, kept_s=0.0)


@kernel
def learn(steering, measured, speed, params, dt):
    """One tick of learning; only the phase that is flown learns, and only in a glide."""
    down = measured.vertical_rate > 0.0
    ratio = speed_ratio(speed) ** params.power[0 if down else 1]
    is_gliding = abs(measured.vertical_rate) > params.slowest_glide and speed > LEARN_SPEED
    steady_s = steering.steady_s + dt if is_gliding else 0.0
    share = dt / (params.smoothing_s + dt) if steady_s > dt else 1.0
    u = math.sin(measured.phi)
    sine = steering.sine + share * (u * ratio - steering.sine)
    cube = steering.cube + share * (u * u * u * ratio - steering.cube)
    sine_rate = steering.sine_rate + share * (measured.phi_dot - steering.sine_rate)
    yaw_rate = steering.yaw_rate + share * (measured.psi_dot - steering.yaw_rate)
    dive, climb = steering.dive, steering.climb
    if params.bank > 0.0 and steady_s > params.after_s:
        new = learn_steering(dive if down else climb, sine, cube, sine_rate, yaw_rate, params, dt)
        new = choose_steering(new, sine / ratio, params.bank)
        dive, climb = (new, climb) if down else (dive, new)
    return Steering(dive, climb, sine, cube, sine_rate, yaw_rate, steady_s, ratio)


@kernel
def heading_gains(slope, k, params):
    """Bandwidth a (1/s) of the heading, lookahead T (s), and the share w of psi_s' to be fed.

    For e = e2 / U, e' = psi* + k u, psi*' = b u with b the ``slope``, the u that minimises the
    integral of e^2 + tau^2 e'^2 + (u / rho)^2 is b u = -beta e - (alpha - beta k / b) psi*. With
    psi_s = -e / T, b u = w psi_s' + a (psi_s - psi*) is that u exactly, or nearly for proverse
    yaw (docs/theory.md, 3).
    """
    rho, t2 = params.roll_per_s, params.approach_s**2
    b, kick = abs(slope), max(abs(k), SMALLEST_KICK)
    more = 1.0 + rho * rho * kick * kick * t2
    beta = rho * b / math.sqrt(more)
    alpha = math.sqrt(2.0 * beta + rho * rho * (kick * kick + b * b * t2) / more)
    q = math.copysign(kick, slope * k) / b
    a = alpha - beta * q
    fed = max(0.0, min(1.0, alpha * alpha / (4.0 * beta), FED * (alpha / abs(beta * q) - 1.0)))
    rest = max(0.0, (a + fed * beta * q) ** 2 - 4.0 * fed * beta)
    x = 2.0 * beta / (a - fed * beta * q + math.sqrt(rest))
    a = beta * (1.0 + fed * q * x) / x
    return min(BANDWIDTH_MAX, a), 1.0 / x, fed


@kernel
def slope_at(state, square):
    """Slope b + 3 c u^2 where u^2 is so much, with its deviation: never zero (rad/s)."""
    slope, variance = turn_over_u(state, 3.0 * square)
    return math.copysign(math.sqrt(slope * slope + variance), slope)


@kernel
def steer_to(state, error, turn, u, ratio, limit, params):
    """U, and the lookahead (s), that steer to a heading ``error`` (rad) away, turning by ``turn``.

    Here ``turn`` is in rad/s, ``u`` that of now, ``ratio`` (V / V_0)^n, ``limit`` the largest u.
    About the u that turns so; where steering fades with roll, below the peak of b u + c u^3. Or by
    the adverse yaw alone, with as much of it as is known.
    """
    b, c, k, trim, most = state.b, state.c, state.k, 0.0, limit
    if state.is_kicked:
        gain, lookahead_s = k / (k * k + state.p[7]), WELL_S
    else:
        if b * c < 0.0:
            most = min(limit, SHARE_OF_PEAK * math.sqrt(-b / (3.0 * c)))
        fed = heading_gains(slope_at(state, 0.0) * ratio, k, params)[2] if turn != 0.0 else 0.0
        wanted = (fed * turn - state.d) / ratio
        for _ in range(4):
            trim += (wanted - (b + c * trim * trim) * trim) / slope_at(state, trim * trim)
            trim = min(most, max(-most, trim))
        slope = slope_at(state, trim * trim) * ratio
        a, lookahead_s, _ = heading_gains(slope, k, params)
        gain = a / slope
    sine = trim + gain * (error + k * (u - trim))
    return min(most, max(-most, sine)), lookahead_s


@kernel
def lookahead(steering, down, params):
    """How far ahead (s) the vehicle can follow in a dive, or in a climb."""
    phase = steering.dive if down else steering.climb
    return steer_to(phase, 0.0, 0.0, 0.0, steering.ratio, params.bank, params)[1]
