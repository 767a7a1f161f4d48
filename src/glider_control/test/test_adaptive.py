# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""The adaptive law on plants that are known exactly, so that its Lyapunov function is too."""

import math
from typing import NamedTuple

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from glider_base.kernel import kernel, replace
from glider_base.signals import Reference
from glider_control.law import Bank, Seen
from glider_control.laws.adaptive import DISTURBANCE_MAX, AdaptiveSettings, adaptive_step
from glider_control.laws.backstepping import SCALE_ALPHA, SCALE_PITCH_RATE, SCALE_V2
from glider_model.onboard.attitude_filter import Measured
from glider_model.onboard.command_filter import FilterParams
from glider_model.vehicle.file import load_vehicle

DT = 0.1
SPEED, ALPHA = 0.5, 0.028
SETTINGS = AdaptiveSettings()
PARAMS = SETTINGS.params(
    load_vehicle('zhang2021'), Bank(math.radians(30.0), FilterParams(0.5, 0.08))
)


def measured(**changes) -> Measured:
    """A steady dive, level and on its heading, but for the changes."""
    return Measured(0.0, -0.5, 0.0, 0.0, 0.0, 0.0, 0.27)._replace(**changes)


def reference(**changes) -> Reference:
    return Reference(0, 0, 0, 0.0, -0.5, 0.0, 0.4, 0.0, 0.27, 0.0, 0.0, 0.0)._replace(**changes)


def step(state, now, wanted, applied=(0.0, 0.0), held=(False, False)):
    seen = Seen(now, wanted, SPEED, ALPHA, 0.4, *applied, *held, 0.0)
    return adaptive_step(state, seen, PARAMS, DT)


class Pitch(NamedTuple):
    """State of the plant in pitch."""

    theta: float
    q: float
    tau: float


@kernel
def lyapunov(channel, theta, theta_star, params):
    """V2 = 1/2 B1 K1bar^2 + 1/2 M K2bar^2 + 1/2 theta_tilde^2 / Gamma."""
    wrong = 0.0
    for i in range(len(theta)):
        wrong += (theta_star[i] - theta[i]) ** 2
    v = 0.5 * params.b1 * channel.k1**2 + 0.5 * params.inertia * channel.k2**2
    return v + 0.5 * wrong / params.gamma


@kernel
def fly_pitch(state, pitch, now, wanted, theta_star, params, log):
    """M q' = tau + Phi^T theta*, tick by tick: V2, pitch error, and whether the tick learns."""
    theta, q, tau = pitch
    for tick in range(len(log)):
        before = state.channels.pitch_theta
        measured = replace(now, theta=theta, theta_dot=q)
        seen = Seen(measured, wanted, SPEED, ALPHA, 0.4, 0.0, tau, False, False, 0.0)
        state, _, tau = adaptive_step(state, seen, params, DT)
        known = state.channels.pitch_theta
        log[tick, 0] = lyapunov(state.channels.pitch, known, theta_star, params.pitch)
        log[tick, 1] = theta - wanted.theta
        log[tick, 2] = known != before
        rates = state.channels.pitch.rate.value / SCALE_PITCH_RATE
        a, b, c, d = theta_star
        made = a + b * SPEED**2 * ALPHA / SCALE_ALPHA + c * SPEED**2 / SCALE_V2 + d * rates
        for _ in range(20):
            rate = (tau + made) / params.pitch.inertia
            theta += DT / 20 * q
            q += DT / 20 * rate
    return state, Pitch(theta, q, tau)


class PitchPlant:
    """The plant that the law assumes, with an ideal actuator."""

    def __init__(self, theta_star, error=0.0):
        self.theta_star = tuple(map(float, theta_star))
        self.pitch = Pitch(-0.5 + error, 0.0, 0.0)
        self.state = SETTINGS.initial_state()

    def fly(self, seconds):
        """Lyapunov function V2, pitch errors, and whether it learns, of every tick."""
        log = np.empty((round(seconds / DT), 3))
        self.state, self.pitch = fly_pitch(
            self.state, self.pitch, measured(), reference(), self.theta_star, PARAMS, log
        )
        return log[:, 0], log[:, 1], log[:, 2] > 0.0


parameters = st.tuples(*(st.floats(-1.0, 1.0) for _ in range(3)), st.floats(-1.5, 0.0))


@settings(max_examples=15)
@given(parameters, st.floats(-0.2, 0.2))
@example((-0.03125, 0.091796875, -0.03125, 0.0), -0.125)  # its learning is over within 30 s
def test_lyapunov_function_never_grows_on_an_unknown_plant(theta_star, error):
    """But for leakage and the sampling: it never rises by more than 1e-4 of its start in a tick.

    Adaptation begins after LEARN_AFTER_S; from then on V2 with the true parameter errors falls in
    the ticks that learn. In the dead zone nothing is learnt, and nothing is promised.
    """
    values, _, learnt = PitchPlant(theta_star, error).fly(600.0)
    begun = round(30.0 / DT)
    rises = np.diff(values[begun:])[learnt[begun + 1 :]]
    assert np.max(rises, initial=0.0) < 1e-4 * values[begun] + 1e-7
    assert np.sum(rises) <= 1e-9


@settings(max_examples=15)
@given(parameters)
def test_pitch_error_ends_inside_the_ultimate_bound(theta_star):
    """0.1 deg after 30 min: the dead zone of learning over L1, doubled."""
    _, errors, _ = PitchPlant(theta_star).fly(1800.0)
    bound = 2.0 * PARAMS.pitch.dead_zone / PARAMS.pitch.l1
    assert np.max(np.abs(errors[-1000:])) < bound
    assert bound < math.radians(0.1)


def test_constant_moments_are_learnt_whatever_they_are_called():
    """The sum Phi^T theta_hat cancels the plant's; single parameters are not told apart."""
    plant = PitchPlant((0.3, -0.5, 0.2, 0.0))
    plant.fly(1800.0)
    phi = np.array([1.0, SPEED**2 * ALPHA / SCALE_ALPHA, SPEED**2 / SCALE_V2, 0.0])
    assert phi @ plant.state.channels.pitch_theta == pytest.approx(
        phi @ plant.theta_star, abs=0.01
    )


def test_parameters_stay_within_the_projection():
    plant = PitchPlant((50.0, 0.0, 0.0, 0.0))
    plant.fly(600.0)
    assert np.max(np.abs(plant.state.channels.pitch_theta)) == PARAMS.pitch.bound


@pytest.mark.parametrize('held', [(True, False), (False, True)])
def test_held_actuator_teaches_nothing(held):
    state = SETTINGS.initial_state()
    for _ in range(1000):
        state, *_ = step(state, measured(phi=0.1, theta=-0.4), reference(), held=held)
    assert (state.channels.roll_theta == (0.0, 0.0, 0.0)) == held[0]
    assert (state.channels.pitch_theta == (0.0, 0.0, 0.0, 0.0)) == held[1]


@pytest.mark.parametrize('change', [{'vertical_rate': 0.05}, {'vertical_rate': -0.05}])
def test_nothing_is_learnt_while_the_vehicle_turns_over(change):
    state = SETTINGS.initial_state()
    for _ in range(1000):
        state, *_ = step(state, measured(theta=-0.3, phi=0.2, psi_dot=0.01, **change), reference())
    assert state.channels.pitch_theta == (0.0, 0.0, 0.0, 0.0)
    assert state.steering.dive == SETTINGS.initial_state().steering.dive
    assert state.steering.climb == SETTINGS.initial_state().steering.climb


def test_nose_low_makes_a_nose_up_moment_and_the_other_way_round():
    for theta, sign in ((-0.6, 1.0), (-0.4, -1.0)):
        _, _, tau_q = step(SETTINGS.initial_state(), measured(theta=theta), reference())
        assert np.sign(tau_q) == sign


@pytest.mark.parametrize('rate', [0.27, -0.27])
@pytest.mark.parametrize('sign', [1.0, -1.0])
def test_roll_goes_to_the_side_that_turns_the_right_way(rate, sign):
    """Told that steering is reversed, the law rolls to the other side."""
    state = SETTINGS.initial_state()
    known = state.steering.dive._replace(b=0.03 * sign)
    state = state._replace(steering=state.steering._replace(dive=known, climb=known))
    for _ in range(50):
        now = measured(vertical_rate=rate, theta=-0.5 if rate > 0.0 else 0.5)
        wanted = reference(psi=0.2, v_d=rate, theta=now.theta)
        state, *_ = step(state, now, wanted)
    assert np.sign(state.roll.value) == sign


def test_vehicle_has_to_turn_at_the_roll_that_it_may_take():
    """With a smaller limit of roll, the way of steering is decided at that."""
    vehicle, roll_filter = load_vehicle('zhang2021'), FilterParams(0.5, 0.08)
    for limit_deg, bank_deg in ((20.0, 20.0), (30.0, 30.0), (45.0, 30.0)):
        params = SETTINGS.params(vehicle, Bank(math.radians(limit_deg), roll_filter))
        assert params.steering.bank == pytest.approx(math.sin(math.radians(bank_deg)))


def test_disturbance_estimate_is_bounded():
    state = SETTINGS.initial_state()
    steering = state.steering
    state = state._replace(steering=steering._replace(dive=steering.dive._replace(b=0.5)))
    for _ in range(20000):
        state, *_ = step(state, measured(psi=-0.3), reference())
    assert abs(state.disturbance_dive) == DISTURBANCE_MAX


def test_mirror_image_gives_mirror_image():
    """Port and starboard exchanged: roll moment, roll and disturbance change their sign only."""
    port, starboard = SETTINGS.initial_state(), SETTINGS.initial_state()
    for tick in range(600):
        swing = 0.1 * math.sin(0.05 * tick)
        for side in (1.0, -1.0):
            now = measured(phi=side * swing, psi=side * 0.05, psi_dot=side * 0.002)
            result = step(port if side > 0 else starboard, now, reference())
            if side > 0:
                port, tau_port, pitch_port = result
            else:
                starboard, tau_starboard, pitch_starboard = result
        assert tau_port == pytest.approx(-tau_starboard, abs=1e-15)
        assert pitch_port == pytest.approx(pitch_starboard, abs=1e-15)
    assert port.disturbance_dive == -starboard.disturbance_dive
