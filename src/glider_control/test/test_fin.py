# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""Steering by a tail fin: the law alone, and control of a vehicle that has one."""

import math

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from glider_base.frames import quaternion_from_euler
from glider_base.signals import TICK_S, Joints, Odometry, Reference
from glider_control.allocation import limit_surface
from glider_control.control import SATURATED_SURFACE, control_step
from glider_control.intake import REFUSED
from glider_control.law import Seen
from glider_control.settings import ControlSettings
from glider_control.surfaces.fin import MOST_SHARE, FinLawSettings, steer_by_fin
from glider_model.onboard.attitude_filter import Measured
from glider_model.vehicle.file import changed_vehicle

FIN = {'range': 26.0, 'rate': 1.2, 'area': 0.05, 'lift_slope': 3.0, 'x': -1.2, 'turn_rate': 0.5}
VEHICLE = changed_vehicle('zhang2021', {f'fin.{name}': value for name, value in FIN.items()})
LIMIT = math.radians(26.0)
LAWS = ('adaptive', 'pid')
quick = settings(max_examples=60)
PARAMS = ControlSettings(vehicle=VEHICLE).params()
NOTHING_YET = FinLawSettings().initial_state()


def steer(psi=0.0, psi_dot=0.0, wanted=0.0, wanted_dot=0.0, w=0.25, speed=0.5, state=NOTHING_YET,
          delta=0.0):  # fmt: skip
    """State and angle (rad) after one tick."""
    measured = Measured(0.0, -0.5, psi, 0.0, 0.0, psi_dot, w)
    reference = Reference(0.0, 0.0, 0.0, 0.0, -0.5, wanted, 0.0, 0.0, w, 0.0, 0.0, wanted_dot)
    seen = Seen(measured, reference, speed, 0.03, 0.4, 0.0, 0.0, False, False, delta)
    return steer_by_fin(state, seen, PARAMS.steering, TICK_S)


@pytest.mark.parametrize('w', [0.25, -0.25], ids=['dive', 'climb'])
def test_it_turns_to_the_side_of_the_reference_in_dive_and_climb(w):
    assert steer(wanted=0.05, w=w)[1] > 0.0 > steer(wanted=-0.05, w=w)[1]
    assert steer(psi=3.1, wanted=-3.1, w=w)[1] > 0.0  # the short way round


def test_a_turn_that_is_asked_for_is_that_of_the_file():
    """r = c sin(delta) V^2, with psi' already what is asked for, of a fin that is known."""
    known = FinLawSettings(share_std=0.0).initial_state()
    for speed in (0.3, 0.5):
        _, delta = steer(psi_dot=0.01, wanted_dot=0.01, speed=speed, state=known)
        assert 0.5 * math.sin(delta) * speed * speed == pytest.approx(0.01, rel=1e-12)


@quick
@given(*4 * [st.floats(-3.0, 3.0)], st.floats(-0.5, 0.5), st.floats(0.0, 2.0))
def test_the_angle_keeps_to_its_limit(psi, psi_dot, wanted, wanted_dot, w, speed):
    _, delta = steer(psi, psi_dot, wanted, wanted_dot, w, speed)
    held = limit_surface(delta, PARAMS.allocation)
    assert held == pytest.approx(min(LIMIT, max(-LIMIT, delta)), rel=1e-15)


def test_while_it_turns_over_the_fin_is_level():
    assert steer(wanted=1.0, w=0.01)[1] == 0.0


class Yaw:
    """A vehicle that turns by r' = (c sin(delta) V^2 + d - r) / 4 s, and its fin at 1.2 deg/s."""

    def __init__(self, share):
        self.share, self.state = share, NOTHING_YET
        self.psi = self.r = self.delta = 0.0

    def fly(
        self, seconds, wanted=lambda t: 0.3 * math.copysign(1.0, math.sin(t / 60.0)), **changes
    ):
        """Fly on; the heading that is wanted by time (rad) goes from side to side."""
        speed, d = changes.get('speed', 0.4), changes.get('d', 0.0)
        for tick in range(round(seconds / TICK_S)):
            self.state, asked = steer(
                self.psi,
                self.r,
                wanted(tick * TICK_S),
                w=changes.get('w', 0.2),
                speed=speed,
                state=self.state,
                delta=self.delta,
            )
            reach = 0.0 if changes.get('is_stuck') else math.radians(1.2) * TICK_S
            asked = min(LIMIT, max(-LIMIT, asked))
            self.delta += min(reach, max(-reach, asked - self.delta))
            turn = self.share * 0.5 * math.sin(self.delta) * speed * speed + d
            self.r += TICK_S / 4.0 * (turn - self.r)
            self.psi += TICK_S * self.r
        return self.state.known.b


@pytest.mark.parametrize('share', [0.4, 1.0, 2.5])
def test_a_share_of_the_effectiveness_in_its_file_is_learnt_by_turning(share):
    """Within 15 % after ten minutes, within 10 % after half an hour; and it goes on so."""
    yaw = Yaw(share)
    assert yaw.fly(600.0) == pytest.approx(share, rel=0.15)
    assert yaw.fly(1200.0) == pytest.approx(share, rel=0.10)
    assert yaw.fly(3000.0, speed=0.3) == pytest.approx(share, rel=0.10)
    yaw.share = 0.5 * share  # part of the fin is gone
    assert yaw.fly(6000.0) == pytest.approx(0.5 * share, rel=0.15)


def test_nothing_is_learnt_while_nothing_turns():
    """Straight on, as the current and a hull that turns by itself let it; and when floating."""
    yaw = Yaw(1.0)
    yaw.fly(1800.0)
    known = yaw.state.known.b
    assert yaw.fly(600.0, w=0.01) == known
    yaw = Yaw(2.5)
    straight = yaw.fly(7200.0, wanted=lambda t: 0.0, d=0.0)
    assert straight == 1.0


def test_a_stuck_fin_teaches_nothing():
    """Wherever it is stuck and however the vehicle turns."""
    yaw = Yaw(1.0)
    known = yaw.fly(1800.0)
    for d in (0.0, 0.01, -0.02, 0.003):
        assert yaw.fly(600.0, is_stuck=True, d=d) == pytest.approx(known, rel=0.2)


def test_gusts_and_a_fin_that_turns_it_the_wrong_way_do_not_change_the_sign():
    yaw = Yaw(1.0)
    known = yaw.fly(1800.0)
    for d in (0.02, 0.0, -0.02, 0.0):
        yaw.fly(60.0, d=d)
    assert yaw.state.known.b == pytest.approx(known, rel=0.4)
    assert yaw.fly(1800.0) == pytest.approx(1.0, rel=0.15)
    assert Yaw(-1.0).fly(1200.0) == 1.0 / MOST_SHARE


def test_it_can_be_told_not_to_learn():
    state = FinLawSettings(share_std=0.0).initial_state()
    params = ControlSettings(vehicle=VEHICLE, fin={'share_std': 0.0}).params().steering
    seen = Seen(Measured(0.0, -0.5, 0.0, 0.0, 0.0, 0.02, 0.2),
                Reference(*12 * (0.0,)), 0.5, 0.03, 0.4, 0.0, 0.0, False, False, 0.3)  # fmt: skip
    for tick in range(3000):
        now = seen._replace(delta=0.3 * math.sin(0.02 * tick))
        state, _ = steer_by_fin(state, now, params, TICK_S)
    assert state.known.b == 1.0


def control(law='pid', joints=(0.4, 0.0, 0.0, 0.0), psi=0.0, ticks=1, vehicle=VEHICLE):
    """Outputs of control in a glide to the south, tick by tick; heading ``psi`` is wanted."""
    settings = ControlSettings(vehicle=vehicle, law=law)
    state, params = settings.initial_state(), settings.params()
    outputs = []
    for tick in range(ticks):
        place = (0.0, 0.0, 50.0 + 0.02 * tick)
        odometry = Odometry(*place, *quaternion_from_euler(0.0, -0.4, 0.0), 0.5, 0, 0, 0, 0, 0)
        odometry = Odometry(*(float(number) for number in odometry))
        reference = Reference(0.0, 0.0, 0.0, 0.0, -0.4, psi, 0.0, 0.0, 0.2, 0.0, 0.0, 0.0)
        state, output = control_step(state, odometry, Joints(*joints), reference, params, TICK_S)
        outputs.append(output)
    return outputs


@pytest.mark.parametrize('law', LAWS)
def test_both_laws_hold_the_vehicle_level_and_leave_the_heading_to_the_fin(law):
    output = control(law, psi=1.5, ticks=600)[-1]
    assert abs(output.command.mu) < 1e-3
    assert output.command.delta == pytest.approx(LIMIT, rel=1e-12)
    assert output.saturation & SATURATED_SURFACE
    banking = control(law, psi=1.5, ticks=600, vehicle='zhang2021', joints=(0.4, 0.0, 0.0, 0.0))
    assert abs(banking[-1].command.mu) > 0.01 and banking[-1].command.delta == 0.0
    assert not banking[-1].saturation & SATURATED_SURFACE


def test_a_fin_that_says_it_is_far_out_of_its_range_is_not_believed():
    told = control(joints=(0.4, 0.0, 0.0, 1.6 * LIMIT), ticks=20)
    assert told[0].saturation & REFUSED and told[-1].command == (-1.0, -0.06, 0.0, 0.0)
    assert not control(joints=(0.4, 0.0, 0.0, 1.4 * LIMIT))[0].saturation & REFUSED
