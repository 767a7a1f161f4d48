# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""The adaptive law by itself: what it holds, what it learns, and when it does not."""

import math

import numpy as np
import pytest

from glider_base.signals import Reference
from glider_control.law import Bank, Seen
from glider_control.laws.adaptive import AdaptiveSettings, adaptive_step
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


@pytest.mark.parametrize('held', [(True, False), (False, True)])
def test_held_actuator_teaches_nothing(held):
    state = SETTINGS.initial_state()
    for _ in range(1000):
        state, *_ = step(state, measured(phi=0.1, theta=-0.4), reference(), held=held)
    assert (state.roll_integral == (0.0, 0.0)) == held[0]
    assert (state.pitch_integral == (0.0, 0.0)) == held[1]


@pytest.mark.parametrize('rate', [0.27, -0.27])
def test_each_phase_has_an_integral_of_its_own_and_within_its_bound(rate):
    """Nose above the reference: the moment that is learnt pulls it down, and grows no further."""
    state, down = SETTINGS.initial_state(), rate > 0.0
    theta = -0.5 if down else 0.5
    for _ in range(5000):
        now = measured(theta=theta + 0.3, phi=0.3, vertical_rate=rate)
        state, *_ = step(state, now, reference(theta=theta, v_d=rate))
    flown, other = (0, 1) if down else (1, 0)
    assert state.pitch_integral[flown] == state.roll_integral[flown] == 3.0
    assert state.pitch_integral[other] == state.roll_integral[other] == 0.0


def test_a_constant_moment_is_learnt():
    """M q' = tau + 0.5 N m - 5 q: within 0.02 deg after ten minutes, and 0.5 N m is known."""
    state, theta, q, tau_q = SETTINGS.initial_state(), -0.45, 0.0, 0.0
    for _ in range(6000):
        now = measured(theta=theta, theta_dot=q)
        state, _, tau_q = step(state, now, reference())
        for _ in range(10):
            q += DT / 10 * (tau_q + 0.5 - 5.0 * q) / 20.0
            theta += DT / 10 * q
    assert math.degrees(abs(theta + 0.5)) < 0.02
    assert state.pitch_integral[0] == pytest.approx(0.5, rel=0.02)


@pytest.mark.parametrize('change', [{'vertical_rate': 0.05}, {'vertical_rate': -0.05}])
def test_nothing_is_learnt_while_the_vehicle_turns_over(change):
    state = SETTINGS.initial_state()
    for _ in range(1000):
        state, *_ = step(state, measured(theta=-0.3, phi=0.2, psi_dot=0.01, **change), reference())
    assert state.pitch_integral == state.roll_integral == (0.0, 0.0)
    assert state.steering.dive == SETTINGS.initial_state().steering.dive
    assert state.steering.climb == SETTINGS.initial_state().steering.climb


def test_a_dive_from_the_surface_teaches_no_sooner_than_one_after_an_inflection():
    """There the law is not asked: the first that it sees of a fast dive is a fast dive."""
    state, known = SETTINGS.initial_state(), SETTINGS.initial_state().steering.dive
    for _ in range(600):
        state, *_ = step(state, measured(theta=0.5, vertical_rate=-0.27), reference(v_d=-0.27))
    for _ in range(290):
        state, *_ = step(state, measured(phi=-0.3, psi_dot=0.02), reference())
        assert state.steering.dive == known
    for _ in range(20):
        state, *_ = step(state, measured(phi=-0.3, psi_dot=-0.006), reference())
    assert state.steering.dive != known


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
    assert port.steering.dive.d == -starboard.steering.dive.d
    assert port.roll_integral[0] == -starboard.roll_integral[0]
