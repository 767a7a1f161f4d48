# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""Adaptive line of sight: against its differential equations solved by scipy; and its limits."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import solve_ivp

from glider_base.signals import TrackingError, Water
from glider_guidance.method import Leg, LosGains, Situation
from glider_guidance.methods.alos import CRAB_MAX, AlosSettings, alos_step
from glider_model.onboard.learnt_steering import SteeringLearningSettings
from glider_model.vehicle.file import load_vehicle

DT = 0.5
SETTINGS = AlosSettings()
PARAMS = SETTINGS.params(LosGains(), load_vehicle('zhang2021'))
TURNING = SteeringLearningSettings().params(load_vehicle('zhang2021').params())


def step(state, e2, course=0.0, is_gliding=True, heading=0.0):
    """State and heading (rad) asked for after one tick, ``e2`` (m) beside the path."""
    seen = Situation(
        course=course,
        elevation=0.0,
        error=TrackingError(0.0, e2, 0.0),
        follows_path=False,
        ground_n=0.4,
        ground_e=0.0,
        speed=0.4,
        glide_speed=0.4,
        current=Water(0.0, 0.0, 0.0),
        steering=SteeringLearningSettings().initial_state(),
        turning=TURNING,
        leg=Leg(
            stage=2,
            descends=True,
            is_gliding=is_gliding,
            is_surfaced=False,
            turns_over=not is_gliding,
            begins_to_turn_over=False,
            glided_s=100.0,
            glided_before_s=99.9,
            lead_s=60.0,
            lead_before_s=60.0,
            to_turn_s=1000.0,
        ),
        heading=heading,
    )
    state, asked = alos_step(state, seen, PARAMS, DT)
    return state, asked.heading


@settings(max_examples=15)
@given(st.floats(-60.0, 60.0), st.floats(0.2, 0.5), st.floats(-0.7, 0.7), st.floats(-3.0, 3.0))
def test_it_follows_its_differential_equations(start, speed, crab, course):
    """y' = U sin(psi + beta - pi_h) within 1 %, beta the crab; and comes to the path."""
    state, e2, ways = SETTINGS.initial_state(), start, []
    for _ in range(round(4000.0 / DT)):
        state, heading = step(state, e2, course)
        e2 += DT * speed * math.sin(heading + crab - course)
        ways.append(e2)
    far, gamma = PARAMS.lookahead, PARAMS.gamma

    def slope(t, x):
        y, beta = x
        return [
            speed * math.sin(crab - beta - math.atan(y / far)),
            gamma * far * y / math.hypot(far, y),
        ]

    solved = solve_ivp(slope, (0.0, 4000.0), [start, 0.0], rtol=1e-8, t_eval=np.arange(0, 4000, 5))
    ours = np.array([start, *ways])[:: round(5.0 / DT)][: len(solved.t)]
    assert ours == pytest.approx(solved.y[0], abs=0.01 * max(20.0, np.abs(solved.y[0]).max()))
    assert abs(e2) < 2.0
    assert state.crab == pytest.approx(crab, abs=0.05)


def test_it_learns_in_a_glide_only_and_keeps_its_heading_in_a_turn_over():
    state, heading = step(SETTINGS.initial_state(), 30.0, is_gliding=False, heading=0.7)
    assert (state.crab, heading) == (0.0, 0.7)
    assert step(state, 30.0)[0].crab > 0.0


@given(st.floats(-1e5, 1e5), st.floats(-3.0, 3.0))
def test_heading_is_an_angle_and_the_crab_is_bounded(e2, course):
    state = SETTINGS.initial_state()._replace(crab=math.copysign(CRAB_MAX, e2))
    state, heading = step(state, e2, course)
    assert abs(state.crab) <= CRAB_MAX
    assert -math.pi <= heading < math.pi
