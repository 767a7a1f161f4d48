# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""The paper's law by itself: its moments, and a heading by the steering of the vehicle file.

On plants that are known exactly, so that its Lyapunov function is too.
"""

import math
from typing import NamedTuple

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from glider_base.kernel import kernel, replace
from glider_base.signals import Reference
from glider_control.law import Bank, Seen
from glider_control.laws.backstepping import (
    SCALE_ALPHA,
    SCALE_PITCH_RATE,
    SCALE_ROLL_RATE,
    SCALE_SIDE,
    SCALE_V2,
    BacksteppingSettings,
    backstepping_step,
    learnt_moments,
)
from glider_model.onboard.attitude_filter import Measured
from glider_model.onboard.command_filter import FilterParams
from glider_model.vehicle.file import load_vehicle
from glider_model.vehicle.rigid_body import GRAVITY

BANK = Bank(math.radians(30.0), FilterParams(0.5, 0.08))
DT = 0.1
SPEED, ALPHA = 0.5, 0.028
SETTINGS = BacksteppingSettings()
PARAMS = SETTINGS.params(load_vehicle('zhang2021'), BANK)


def see(heading_error=0.0, rate=0.27, **changes) -> Seen:
    """A glide on its heading, but for an error of it (rad) and the changes of what is measured."""
    theta = math.copysign(0.5, -rate)
    now = Measured(0.0, theta, 0.0, 0.0, 0.0, 0.0, rate)._replace(**changes)
    wanted = Reference(0, 0, 0, 0.0, theta, heading_error, 0.4, 0.0, rate, 0.0, 0.0, 0.0)
    return Seen(now, wanted, 0.5, 0.028, math.copysign(0.4, rate), 0.0, 0.0, False, False, 0.0)


def measured(**changes) -> Measured:
    """A steady dive, level and on its heading, but for the changes."""
    return Measured(0.0, -0.5, 0.0, 0.0, 0.0, 0.0, 0.27)._replace(**changes)


def reference(**changes) -> Reference:
    return Reference(0, 0, 0, 0.0, -0.5, 0.0, 0.4, 0.0, 0.27, 0.0, 0.0, 0.0)._replace(**changes)


def step(state, now, wanted, applied=(0.0, 0.0), held=(False, False)):
    seen = Seen(now, wanted, SPEED, ALPHA, 0.4, *applied, *held, 0.0)
    return backstepping_step(state, seen, PARAMS, DT)


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
        state, _, tau = backstepping_step(state, seen, params, DT)
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


def test_each_parameter_moves_by_its_regressor_times_the_compensated_error_of_the_rate():
    """Equation by equation: theta_i' = Gamma (Phi_i K2bar - sigma theta_i), in roll and pitch."""
    state, phi, theta = SETTINGS.initial_state(), 0.02, -0.48
    for _ in range(250):
        before = state.channels
        state, *_ = step(state, measured(phi=phi, theta=theta), reference())
    now = state.channels
    side = -0.4 * GRAVITY * math.cos(theta) * math.sin(phi) / SCALE_SIDE
    dynamic = SPEED**2 * ALPHA / SCALE_ALPHA, SPEED**2 / SCALE_V2
    for channel, regressors, was, is_, params in (
        (now.roll, (side, now.roll.rate.value / SCALE_ROLL_RATE),
         before.roll_theta, now.roll_theta, PARAMS.roll),
        (now.pitch, (*dynamic, now.pitch.rate.value / SCALE_PITCH_RATE),
         before.pitch_theta, now.pitch_theta, PARAMS.pitch),
    ):  # fmt: skip
        was, is_, phi_i = np.array(was), np.array(is_), np.array([1.0, *regressors])
        assert abs(channel.k2) > params.dead_zone and np.abs(is_).max() < params.bound
        moved = DT * params.gamma * (phi_i * channel.k2 - params.sigma * was)
        assert np.abs(moved).min() > 0.0
        assert is_ - was == pytest.approx(moved, rel=1e-6)


@pytest.mark.parametrize(
    ('channel', 'number'), [*(('roll', i) for i in range(3)), *(('pitch', i) for i in range(4))]
)
def test_the_moment_takes_off_what_each_parameter_says(channel, number):
    """tau = ... - Phi^T theta, before anything is learnt; and each is told under its own name."""
    state = SETTINGS.initial_state()
    for _ in range(50):
        state, *_ = step(state, measured(phi=0.05, theta=-0.4), reference())
    name = f'{channel}_theta'
    theta = [0.0] * len(getattr(state.channels, name))
    theta[number] = 0.5
    known = state._replace(channels=state.channels._replace(**{name: tuple(theta)}))
    now, wanted = measured(phi=0.05, theta=-0.4), reference()
    after, *without = step(state, now, wanted)
    _, *told = step(known, now, wanted)
    rate = getattr(after.channels, channel).rate.value
    side = -0.4 * GRAVITY * math.cos(-0.4) * math.sin(0.05) / SCALE_SIDE
    phi = {
        'roll': (1.0, side, rate / SCALE_ROLL_RATE),
        'pitch': (
            1.0,
            SPEED**2 * ALPHA / SCALE_ALPHA,
            SPEED**2 / SCALE_V2,
            rate / SCALE_PITCH_RATE,
        ),
    }[channel]
    moved = np.subtract(told, without)
    at = 0 if channel == 'roll' else 1
    assert moved[at] == pytest.approx(-0.5 * phi[number], rel=1e-9) and moved[1 - at] == 0.0
    learnt = learnt_moments(known.channels, PARAMS)
    names = [one for one in learnt._fields if one.startswith(channel) and one.endswith('_nm')]
    assert [getattr(learnt, one) for one in names] == theta


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


@pytest.mark.parametrize('name', ['zhang2021', 'seaglider', 'seawing'])
@pytest.mark.parametrize('rate', [0.27, -0.27])
@pytest.mark.parametrize('error', [0.2, -0.2])
def test_it_rolls_to_the_side_that_turns_the_vehicle_of_the_file(name, rate, error):
    vehicle, law = load_vehicle(name), BacksteppingSettings()
    params, state = law.params(vehicle, BANK), law.initial_state()
    for _ in range(50):
        state, *_ = backstepping_step(state, see(error, rate), params, 0.1)
    steering = vehicle.steering_rates.dive if rate > 0.0 else vehicle.steering_rates.climb
    assert np.sign(state.roll.value) == np.sign(error * steering)
