# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""The paper's law by itself: its moments, and a heading by the steering of the vehicle file."""

import math

import numpy as np
import pytest

from glider_base.signals import Reference
from glider_control.law import Bank, Seen
from glider_control.laws.adaptive import AdaptiveSettings, adaptive_step
from glider_control.laws.backstepping import BacksteppingSettings, backstepping_step
from glider_model.onboard.attitude_filter import Measured
from glider_model.onboard.command_filter import FilterParams
from glider_model.vehicle.file import load_vehicle

BANK = Bank(math.radians(30.0), FilterParams(0.5, 0.08))


def see(heading_error=0.0, rate=0.27, **changes) -> Seen:
    """A glide on its heading, but for an error of it (rad) and the changes of what is measured."""
    theta = math.copysign(0.5, -rate)
    now = Measured(0.0, theta, 0.0, 0.0, 0.0, 0.0, rate)._replace(**changes)
    wanted = Reference(0, 0, 0, 0.0, theta, heading_error, 0.4, 0.0, rate, 0.0, 0.0, 0.0)
    return Seen(now, wanted, 0.5, 0.028, math.copysign(0.4, rate), 0.0, 0.0, False, False, 0.0)


def test_moments_are_those_of_the_adaptive_law_while_no_turn_is_asked_for():
    vehicle = load_vehicle('zhang2021')
    paper, adaptive = BacksteppingSettings(), AdaptiveSettings()
    of_paper, of_adaptive = paper.params(vehicle, BANK), adaptive.params(vehicle, BANK)
    one, other = paper.initial_state(), adaptive.initial_state()
    for tick in range(600):
        seen = see(theta=-0.5 + 0.05 * math.sin(0.02 * tick))
        one, *moments = backstepping_step(one, seen, of_paper, 0.1)
        other, *theirs = adaptive_step(other, seen, of_adaptive, 0.1)
        assert moments == theirs
    assert one.channels == other.channels
    assert np.abs(one.channels.pitch_theta).max() > 0.0


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
