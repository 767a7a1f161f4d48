# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""PID law: signs of effect, integrators, symmetry."""

import math

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from rclpy.parameter import Parameter

from glider_base.signals import TICK_S, Reference
from glider_control.heading import HEADING_INTEGRAL_MAX, heading_to_roll
from glider_control.law import Seen
from glider_control.laws.pid import PidSettings, PidState, pid_step
from glider_control.nodes.control_node import ControlNode
from glider_control.settings import ControlSettings
from glider_model.onboard.attitude_filter import Measured
from glider_model.onboard.command_filter import Filtered
from glider_model.vehicle.file import SLOWEST_GLIDE_MPS

quick = settings(max_examples=60)

AT_REST = PidState(0.0, 0.0, 0.0, Filtered(0.0, 0.0))
#: Heading error to starboard: the roll that turns there, by vehicle and phase.
STEERING = [
    ('zhang2021', 0.3, 1.0),
    ('zhang2021', -0.3, -1.0),
    ('seawing', 0.3, -1.0),
    ('seawing', -0.3, -1.0),
]

angles = st.floats(-math.pi, math.pi)
small = st.floats(-0.5, 0.5)
vertical_rates = st.sampled_from([-0.3, -0.2, 0.2, 0.3])


def params_of(vehicle='zhang2021', **gains):
    return (
        ControlSettings.model_validate({'vehicle': vehicle, 'law': 'pid', 'pid': gains})
        .params()
        .law
    )


PARAMS = {name: params_of(name) for name in ('zhang2021', 'seawing')}


def measured(phi=0.0, theta=0.0, psi=0.0, p=0.0, q=0.0, r=0.0, w=0.3):
    return Measured(phi, theta, psi, p, q, r, w)


def asked(theta=0.0, psi=0.0, theta_dot=0.0, psi_dot=0.0):
    zeros = 3 * (0.0,)
    return Reference(*zeros, 0.0, theta, psi, *zeros, 0.0, theta_dot, psi_dot)


def steer(seen, reference, vehicle='zhang2021', state=AT_REST, speed=0.5):
    """Commanded roll (rad) and heading integral after one tick."""
    law, integral = PARAMS[vehicle], state.heading_integral
    return heading_to_roll(integral, seen, reference, speed, law.roll_limit, law.heading, TICK_S)


def control(seen, reference, state=AT_REST, pitch_held=False, roll_held=False, params=None):
    """State, roll moment and pitch moment (N m) after one tick."""
    sight = Seen(seen, reference, 0.5, 0.03, 0.4, 0.0, 0.0, roll_held, pitch_held, 0.0)
    return pid_step(state, sight, params or PARAMS['zhang2021'], TICK_S)


@quick
@given(st.floats(-1.0, 1.0), st.floats(-1.0, 1.0))
def test_pitch_moment_points_from_the_pitch_to_the_reference(theta, wanted):
    _, _, tau_q = control(measured(theta=theta), asked(theta=wanted))
    assert tau_q * (wanted - theta) >= 0.0
    assert tau_q == pytest.approx(8.0 * (wanted - theta), rel=0.01, abs=1e-9)


def test_pitch_rate_is_damped_and_fed_forward():
    """Moment against the rate, none at the rate that is asked for."""
    assert control(measured(q=0.02), asked())[2] == pytest.approx(-0.2, rel=1e-9)
    assert control(measured(q=0.02), asked(theta_dot=0.02))[2] == 0.0


def test_roll_moment_is_against_the_roll():
    assert control(measured(phi=0.2), asked())[1] < 0.0
    assert control(measured(phi=-0.2), asked())[1] > 0.0


def test_roll_rate_is_damped():
    assert control(measured(p=0.1), asked())[1] == pytest.approx(-0.2, rel=1e-9)


@pytest.mark.parametrize(('vehicle', 'vertical_rate', 'side'), STEERING)
@pytest.mark.parametrize('error', [-0.1, 0.1])
def test_roll_steers_toward_the_heading_by_vehicle_and_phase(vehicle, vertical_rate, side, error):
    roll, _ = steer(measured(w=vertical_rate), asked(psi=error), vehicle)
    assert roll * error * side > 0.0


@pytest.mark.parametrize(('vehicle', 'vertical_rate', 'side'), STEERING)
def test_yaw_rate_is_damped_and_fed_forward(vehicle, vertical_rate, side):
    turning = measured(r=0.01, w=vertical_rate)
    assert steer(turning, asked(), vehicle)[0] * side < 0.0
    assert steer(measured(w=vertical_rate), asked(psi_dot=0.01), vehicle)[0] * side > 0.0


@pytest.mark.parametrize('vehicle', ['zhang2021', 'seawing'])
@quick
@given(turn=st.floats(-0.008, 0.008), w=vertical_rates, speed=st.floats(0.3, 0.8))
def test_roll_makes_the_turn_rate_asked_for(vehicle, turn, w, speed):
    """psi_dot = b V / 0.5 sin(phi) without an error, b of the vehicle file."""
    params = PARAMS[vehicle]
    b = params.heading.steering_dive if w > 0.0 else params.heading.steering_climb
    roll, _ = steer(measured(r=turn, w=w), asked(psi_dot=turn), vehicle, speed=speed)
    bound = math.sin(math.radians(30.0))
    expected = min(bound, max(-bound, turn / (b * speed / 0.5)))
    assert math.sin(roll) == pytest.approx(expected, abs=1e-12)


@quick
@given(angles, angles, st.floats(-0.05, 0.05), vertical_rates, st.floats(0.0, 2.0))
def test_commanded_roll_is_within_its_limit(psi, wanted, r, w, speed):
    roll, _ = steer(measured(psi=psi, r=r, w=w), asked(psi=wanted), speed=speed)
    assert abs(roll) <= math.radians(30.0) + 1e-12


def test_heading_is_approached_the_short_way_round():
    """From 175 deg to -175 deg is 10 deg to starboard."""
    roll, _ = steer(measured(psi=math.radians(175.0)), asked(psi=math.radians(-175.0)))
    direct, _ = steer(measured(), asked(psi=math.radians(10.0)))
    assert roll == pytest.approx(direct, abs=1e-12)


@quick
@given(st.floats(-0.99, 0.99), angles, small)
def test_vehicle_that_turns_over_is_not_steered(share, error, integral):
    state = AT_REST._replace(heading_integral=integral)
    seen = measured(w=share * SLOWEST_GLIDE_MPS)
    assert steer(seen, asked(psi=error), state=state) == (0.0, integral)


def test_heading_integral_waits_while_the_roll_is_at_its_limit():
    assert steer(measured(), asked(psi=2.0))[1] == 0.0


def test_heading_integral_unwinds_while_the_roll_is_at_its_limit():
    """A rate demand to starboard beyond the limit, the heading already past to starboard."""
    state = AT_REST._replace(heading_integral=0.004)
    _, integral = steer(measured(psi=0.1), asked(psi_dot=0.1), state=state)
    assert integral < 0.004


@pytest.mark.parametrize('error', [-0.1, 0.1])
def test_integrals_wait_while_their_actuator_is_held(error):
    start = PidState(0.5, 0.3, 0.0, Filtered(0.0, 0.0))
    seen = measured(phi=error, theta=error)
    state, _, _ = control(seen, asked(), start, pitch_held=True, roll_held=True)
    assert (state.pitch_integral, state.roll_integral) == (0.5, 0.3)


def test_integrals_grow_with_their_errors():
    """One tick: K_I e dt in N m, heading in rad/s."""
    state, _, _ = control(measured(phi=-0.2), asked(theta=0.1, psi=0.05))
    assert state.pitch_integral == pytest.approx(0.08 * 0.1 * TICK_S, rel=1e-9)
    assert state.roll_integral == pytest.approx(0.4 * 0.2 * TICK_S, rel=0.05)
    assert state.heading_integral == pytest.approx(2e-4 * 0.05 * TICK_S, rel=1e-9)


@quick
@given(st.sampled_from([-1.0, 1.0]))
def test_integrals_are_bounded(side):
    params = params_of(pitch_ki=100.0, roll_ki=100.0, heading_ki_per_s2=0.1, heading_kp_per_s=0.0)
    state = AT_REST
    for _ in range(200):
        state, _, _ = control(
            measured(phi=-0.8 * side), asked(theta=side, psi=0.5 * side), state, params=params
        )
    assert state.pitch_integral == side * 3.0
    assert state.roll_integral == side * 2.0
    assert abs(state.heading_integral) <= HEADING_INTEGRAL_MAX


@quick
@given(small, small, small, small, vertical_rates)
def test_mirrored_vehicle_is_controlled_in_the_mirror(phi, psi, p, r, w):
    """Starboard for port: roll moment negated to the last bit, pitch moment the same."""
    state, tau_p, tau_q = control(measured(phi, 0.1, psi, p, 0.01, 0.1 * r, w), asked(-0.4, 0.2))
    seen = measured(-phi, 0.1, -psi, -p, 0.01, -0.1 * r, w)
    mirror, mirror_p, mirror_q = control(seen, asked(-0.4, -0.2))
    assert (mirror_p, mirror_q) == (-tau_p, tau_q)
    assert (mirror.roll_integral, mirror.heading_integral, mirror.roll.value) == (
        -state.roll_integral,
        -state.heading_integral,
        -state.roll.value,
    )


def test_a_parameter_of_which_a_law_makes_nothing_is_refused_and_its_node_flies_on(
    context, monkeypatch
):
    """As one of somebody's own may; on board the guard is in the same process."""
    overrides = [Parameter('lockstep', value=False), Parameter('law', value='pid')]
    node = ControlNode(context=context, parameter_overrides=overrides)
    try:
        params = node.params

        def divided(law, vehicle, bank):
            return params.law if law.pitch_kp != 5.0 else 1 / 0

        monkeypatch.setattr(PidSettings, 'params', divided)
        said = node.set_parameters_atomically([Parameter('pid.pitch_kp', value=5.0)])
        assert not said.successful and 'ZeroDivisionError' in said.reason
        assert node.settings.pid.pitch_kp != 5.0 and node.params == params
        assert node.set_parameters_atomically([Parameter('pid.pitch_kp', value=6.0)]).successful
    finally:
        node.close()
        node.destroy_node()
