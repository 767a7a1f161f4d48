# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""Control as a whole, around the plant: signs of effect, trim, noise, limits."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from glider_base.frames import euler_from_quaternion, quaternion_from_euler, rotate_to_ned
from glider_base.kernel import kernel
from glider_base.signals import TICK_S, Joints, Odometry, Reference, Water
from glider_control.control import (
    SATURATED_BUOYANCY,
    SATURATED_PITCH,
    SATURATED_ROLL,
    SATURATED_SURFACE,
    control_step,
)
from glider_control.intake import REFUSED
from glider_control.law import bank_carefully
from glider_control.settings import ControlSettings
from glider_control.stall import BEGINS_S, leave_stall, watch_stall
from glider_control.vertical_rate import Trim, rate_error, vertical_rate_law
from glider_model.onboard.attitude_filter import Measured
from glider_model.onboard.glide_polar import glide_net_heaviness, glide_vertical_rate
from glider_model.onboard.moving_mass import Righting
from glider_model.plant.plant import PlantSettings, plant_odometry, plant_step
from glider_model.plant.trim import solve_trim
from glider_model.vehicle.file import load_vehicle, vehicle_names
from glider_model.vehicle.rigid_body import GRAVITY

quick = settings(max_examples=40)

COLUMNS = 'phi theta psi down m_b x_p mu c_m_b c_x_p c_mu saturation'.split()
#: Net heaviness (kg) and pitch (deg) of the dives flown here.
GLIDES = {'zhang2021': (0.4, 30.0), 'seawing': (0.3, 35.0)}


@kernel
def _fly(plant, control, references, noise, ballast, plant_params, params, rows, dt):
    """Closed loop; ``ballast`` (kg) is missing from what the buoyancy engine says of itself."""
    still = Water(0.0, 0.0, 0.0)
    for i in range(len(rows)):
        true = plant_odometry(plant)
        phi, theta, psi = euler_from_quaternion(true.q_w, true.q_x, true.q_y, true.q_z)
        q = quaternion_from_euler(phi + noise[i, 0], theta + noise[i, 1], psi + noise[i, 2])
        seen = Odometry(
            true.p_n, true.p_e, true.p_d, q[0], q[1], q[2], q[3],
            true.u, true.v, true.w,
            true.p + noise[i, 3], true.q + noise[i, 4], true.r + noise[i, 5],
        )  # fmt: skip
        said = Joints(plant.joints.m_b + ballast, plant.joints.x_p, plant.joints.mu, 0.0)
        a = references[i]
        reference = Reference(0.0, 0.0, 0.0, 0.0, a[0], a[1], 0.0, 0.0, a[2], 0.0, 0.0, 0.0)
        control, output = control_step(control, seen, said, reference, params, dt)
        command = output.command
        down = rotate_to_ned(true.q_w, true.q_x, true.q_y, true.q_z, true.u, true.v, true.w)[2]
        row = (
            phi, theta, psi, down, plant.joints.m_b, plant.joints.x_p, plant.joints.mu,
            command.m_b, command.x_p, command.mu, float(output.saturation),
        )  # fmt: skip
        for j, number in enumerate(row):
            rows[i, j] = number
        moved = Joints(command.m_b - ballast, command.x_p, command.mu, 0.0)
        plant = plant_step(plant, moved, still, plant_params, dt)
    return plant, control


class Flight:
    """A glide from its own trim; ``flight.psi`` and so on are columns of its log, rad."""

    def __init__(self, vehicle='zhang2021', sign=1.0, ballast=0.0, perturb=None, **fields):
        net, pitch_deg = GLIDES[vehicle]
        model = ControlSettings.model_validate({'vehicle': vehicle, 'law': 'pid', **fields})
        self.params, self.control = model.params(), model.initial_state()
        self.pitch = -sign * math.radians(pitch_deg)
        self.rate = glide_vertical_rate(self.pitch, sign * net, self.params.polar)
        start = {
            'depth_m': 3000.0,
            'pitch_deg': math.degrees(self.pitch),
            'speed_mps': 0.5,
            'net_heaviness_kg': sign * net,
        }
        plant = PlantSettings(
            vehicle=vehicle, initial=start, duration_s=1e8, perturb=perturb or {}
        )
        self.plant_params, self.plant = plant.params(), plant.initial_state()
        trim = solve_trim(load_vehicle(vehicle).params(), sign * net, math.degrees(self.pitch))
        joints = Joints(sign * net - ballast, trim.pitch_mass_m, 0.0, 0.0)
        self.plant = self.plant._replace(joints=joints)
        self.ballast = ballast
        self.log = np.empty((0, len(COLUMNS)))

    def fly(self, seconds, psi=0.0, theta=None, rate=None, noise=None):
        ticks = round(seconds / TICK_S)
        wanted = (
            self.pitch if theta is None else theta,
            psi,
            self.rate if rate is None else rate,
        )
        references = np.ascontiguousarray(np.broadcast_to(np.array(wanted), (ticks, 3)))
        noise = np.zeros((ticks, 6)) if noise is None else noise
        rows = np.empty((ticks, len(COLUMNS)))
        self.plant, self.control = _fly(
            self.plant,
            self.control,
            references,
            noise,
            float(self.ballast),
            self.plant_params,
            self.params,
            rows,
            TICK_S,
        )
        self.log = np.concatenate([self.log, rows])
        return self

    def __getattr__(self, name):
        return self.log[:, COLUMNS.index(name)]


every_glide = pytest.mark.parametrize(
    ('vehicle', 'sign'), [(name, sign) for name in GLIDES for sign in (1.0, -1.0)]
)


@every_glide
def test_pitch_is_held_in_a_glide(vehicle, sign):
    """5 deg off the trim that it starts from: within 0.2 deg after 500 s."""
    flight = Flight(vehicle, sign)
    wanted = flight.pitch + math.radians(5.0)
    flight.fly(500.0, theta=wanted)
    assert math.degrees(flight.theta[-1]) == pytest.approx(math.degrees(wanted), abs=0.2)


@every_glide
@pytest.mark.parametrize('turn_deg', [-20.0, 20.0])
def test_heading_comes_to_the_reference_by_vehicle_and_phase(vehicle, sign, turn_deg):
    """20 deg to either side: within 1 deg after 900 s, never 10 deg to the wrong side."""
    flight = Flight(vehicle, sign).fly(900.0, psi=math.radians(turn_deg))
    heading = np.degrees(flight.psi) * math.copysign(1.0, turn_deg)
    assert heading[-1] == pytest.approx(20.0, abs=1.0)
    assert np.min(heading) > -10.0
    assert np.max(heading) < 30.0


@pytest.mark.parametrize('sign', [1.0, -1.0])
def test_mass_goes_to_the_side_that_steers(sign):
    """zhang2021 turns into its roll in the dive and against it in the climb."""
    flight = Flight('zhang2021', sign).fly(30.0, psi=math.radians(20.0))
    assert np.mean(flight.mu) * sign > 0.0


def test_vertical_rate_law_commands_the_weight_of_the_polar():
    for theta_deg, net in ((-30.0, 0.4), (-40.0, 0.7), (30.0, -0.4), (20.0, -0.2)):
        flight = Flight()
        theta = math.radians(theta_deg)
        rate = glide_vertical_rate(theta, net, flight.params.polar)
        flight.fly(TICK_S, theta=theta, rate=rate)
        assert flight.c_m_b[-1] == pytest.approx(net, abs=1e-9)


@pytest.mark.parametrize('ballast', [-0.05, 0.05])
@pytest.mark.parametrize('sign', [1.0, -1.0])
def test_integral_corrects_a_ballast_error_of_50_g(sign, ballast):
    """The vertical rate comes within 2 mm/s; the correction is the ballast within 7 g."""
    flight = Flight('zhang2021', sign, ballast).fly(6000.0)
    assert flight.down[-1] == pytest.approx(flight.rate, abs=0.002)
    trim = flight.control.trim
    assert trim.ballast + sign * trim.drag == pytest.approx(ballast, abs=0.007)


def test_without_the_integral_a_ballast_error_stays():
    still = {'ki_kg_per_m': 0.0, 'drag_ki_kg_per_m': 0.0}
    flight = Flight(ballast=0.05, buoyancy=still).fly(3000.0)
    assert flight.rate - flight.down[-1] > 0.01


def test_integral_waits_while_the_vehicle_turns_over():
    """From dive to climb the pump needs 200 s: nothing is learned in the first 150 s."""
    flight = Flight().fly(600.0)
    settled = flight.control.trim
    flight.fly(150.0, theta=-flight.pitch, rate=-flight.rate)
    assert flight.control.trim == settled


@pytest.mark.parametrize('perturb', [{'K_D0': 1.3}, {'K_D0': 0.75}])
def test_drag_that_differs_is_known_when_the_vehicle_turns_over(perturb):
    """The second climb begins at its vertical rate: a third of the error that there is without."""
    errors = {}
    for drag_ki in (0.0, 0.002):
        buoyancy = {'drag_ki_kg_per_m': drag_ki}
        flight = Flight(perturb=perturb, buoyancy=buoyancy).fly(2500.0)
        for side in (-1.0, 1.0, -1.0):
            start = len(flight.down)
            flight.fly(2500.0, theta=side * flight.pitch, rate=side * flight.rate)
        glide = slice(start + round(300.0 / TICK_S), start + round(900.0 / TICK_S))
        errors[drag_ki] = np.mean(np.abs(flight.down[glide] + flight.rate))
    assert errors[0.0] > 0.01
    assert errors[0.002] < 0.34 * errors[0.0]


@pytest.mark.parametrize('ballast', [-0.15, 0.15])
@pytest.mark.parametrize('sign', [1.0, -1.0])
def test_a_slow_glide_that_turns_over_is_pumped_the_right_way_at_once(sign, ballast):
    """Seven times its weight is missing: that is ballast, and is none when it turns over."""
    flight = Flight('zhang2021', sign)
    pitch = math.radians(-22.0 * sign)
    rate = glide_vertical_rate(pitch, 0.02 * sign, flight.params.polar)
    flight.ballast = ballast
    flight.fly(5000.0, theta=pitch, rate=rate)
    before = flight.c_m_b[-1]
    flight.fly(20.0, theta=pitch, rate=-rate)
    assert np.all(sign * flight.c_m_b[-200:] < sign * before)


@pytest.mark.parametrize(('shows', 'taken'), [(0.0, 0.0), (0.06, 0.05), (-0.06, -0.05)])
def test_a_vertical_rate_that_the_depth_does_not_follow_is_put_right(shows, taken):
    """But for 0.01 m/s: 0.3 m of noise in the depth are no error of the rate."""
    noise = np.random.default_rng(1).normal(0.0, 0.3, 60000)
    depth, error, off, offs = 100.0, 0.0, 0.0, []
    for tick, wrong in enumerate(noise):
        true = 100.0 + 0.02 * tick * TICK_S + wrong
        error, off = rate_error(error, 0.02 + shows, true - depth, TICK_S)
        depth = true
        offs.append(off)
    assert np.mean(offs[40000:]) == pytest.approx(taken, abs=0.002)
    assert abs(off - taken) < 0.005


@pytest.mark.parametrize('rate', [0.1, -0.3])
def test_a_depth_that_stands_still_puts_a_rate_right_in_ten_minutes(rate):
    error = 0.0
    for _ in range(6000):
        error, off = rate_error(error, rate, 0.0, TICK_S)
    assert error == pytest.approx(rate * (1.0 - math.exp(-1.0)), rel=1e-3)
    assert off == pytest.approx(error - math.copysign(0.01, rate))


def travel(column):
    """Way that a motor is sent (m or rad)."""
    return float(np.sum(np.abs(np.diff(column))))


def test_noise_does_not_move_the_motors():
    """0.05 deg and 0.02 deg/s of noise: filter and dead band save nine tenths of the pitch way."""
    seconds = 1500.0
    noise = np.random.default_rng(3).standard_normal((round(seconds / TICK_S), 6))
    noise *= np.radians([0.05, 0.05, 0.05, 0.02, 0.02, 0.02])
    bare = {'attitude_s': 0.01, 'pitch_dead_band_m': 0.0, 'roll_dead_band_deg': 0.0}
    plain = Flight(filters=bare).fly(seconds, noise=noise)
    quiet = Flight().fly(seconds, noise=noise)
    settled = slice(round(300.0 / TICK_S), None)
    assert travel(quiet.x_p[settled]) < 0.1 * travel(plain.x_p[settled])
    assert np.degrees(np.std(quiet.theta[settled])) < 0.1


def test_commands_stay_still_in_a_settled_glide():
    """Without noise the dead bands leave every motor at rest most of the time."""
    flight = Flight().fly(1500.0)
    late = flight.log[round(900.0 / TICK_S) :]
    for name in ('c_m_b', 'c_x_p', 'c_mu'):
        moves = np.count_nonzero(np.diff(late[:, COLUMNS.index(name)]))
        assert moves < 0.05 * len(late), name


def step(odometry, reference, joints=(0.0, 0.0, 0.0, 0.0), vehicle='zhang2021', ticks=1):
    """Output after some ticks at one and the same measurement."""
    model = ControlSettings(vehicle=vehicle, law='pid')
    state, params = model.initial_state(), model.params()
    for _ in range(ticks):
        state, output = control_step(state, odometry, Joints(*joints), reference, params, TICK_S)
    return output, params


def odometry(phi=0.0, theta=-0.5, psi=0.0, u=0.5, omega=(0.0, 0.0, 0.0)):
    return Odometry(0.0, 0.0, 50.0, *quaternion_from_euler(phi, theta, psi), u, 0.0, 0.0, *omega)


def reference(theta=-0.5, psi=0.0, v_d=0.25):
    return Reference(0.0, 0.0, 0.0, 0.0, theta, psi, 0.0, 0.0, v_d, 0.0, 0.0, 0.0)


LEVEL = odometry()


@pytest.mark.parametrize(
    ('seen', 'wanted', 'bit'),
    [
        (odometry(theta=0.9), reference(theta=-0.9), SATURATED_PITCH),
        (odometry(omega=(5.0, 0.0, 0.0)), reference(), SATURATED_ROLL),
        (LEVEL, reference(v_d=2.0), SATURATED_BUOYANCY),
    ],
    ids=['pitch', 'roll', 'buoyancy'],
)
def test_saturated_actuator_is_reported(seen, wanted, bit):
    output, params = step(seen, wanted)
    assert output.saturation & bit
    limits = params.allocation
    reached = {
        SATURATED_PITCH: abs(output.command.x_p) == limits.x_p_max,
        SATURATED_ROLL: abs(output.command.mu) == limits.mu_max,
        SATURATED_BUOYANCY: abs(output.command.m_b) == limits.m_b_max,
    }
    assert reached[bit]


def test_nothing_is_reported_in_a_glide():
    assert np.all(Flight().fly(600.0).saturation[1000:] == 0.0)


@pytest.mark.parametrize('vehicle', vehicle_names())
@quick
@given(
    angles=st.tuples(st.floats(-3.1, 3.1), st.floats(-1.5, 1.5), st.floats(-3.1, 3.1)),
    omega=st.tuples(*3 * [st.floats(-1.0, 1.0)]),
    wanted=st.tuples(st.floats(-1.5, 1.5), st.floats(-3.1, 3.1), st.floats(-2.0, 2.0)),
    u=st.floats(-2.0, 2.0),
)
def test_commands_are_within_the_ranges_whatever_is_measured(vehicle, angles, omega, wanted, u):
    output, params = step(
        odometry(*angles, u=u, omega=omega), reference(*wanted), vehicle=vehicle, ticks=3
    )
    limits = params.allocation
    assert abs(output.command.m_b) <= limits.m_b_max
    assert abs(output.command.x_p) <= limits.x_p_max
    assert abs(output.command.mu) <= limits.mu_max


@quick
@given(st.floats(-0.004, 0.004))
def test_pump_ignores_changes_within_its_dead_band(change):
    """5 g around where the buoyancy engine is when control starts."""
    _, params = step(LEVEL, reference())
    rate = glide_vertical_rate(-0.5, 0.4, params.polar)
    output, _ = step(LEVEL, reference(v_d=rate), joints=(0.4 + change, 0.0, 0.0, 0.0))
    assert output.command.m_b == 0.4 + change


@quick
@given(st.floats(0.006, 0.3), st.sampled_from([-1.0, 1.0]))
def test_pump_follows_changes_beyond_its_dead_band(change, side):
    _, params = step(LEVEL, reference())
    rate = glide_vertical_rate(-0.5, 0.4, params.polar)
    output, _ = step(LEVEL, reference(v_d=rate), joints=(0.4 + side * change, 0.0, 0.0, 0.0))
    assert output.command.m_b == pytest.approx(0.4, abs=2e-3)


def test_wrench_is_the_demand_before_the_dead_band():
    """The engine starts 4 g off: the pump stays, the demand is still told."""
    _, params = step(LEVEL, reference())
    rate = glide_vertical_rate(-0.5, 0.4, params.polar)
    output, _ = step(LEVEL, reference(v_d=rate), joints=(0.396, 0.0, 0.0, 0.0))
    assert output.wrench.tau_w == pytest.approx(0.4 * GRAVITY, abs=1e-4 * GRAVITY)
    assert output.command.m_b == 0.396


def test_mirrored_flight_is_the_mirror_image():
    """20 deg to port for 20 deg to starboard: roll, heading and mass negated to the last bit."""
    starboard = Flight().fly(600.0, psi=math.radians(20.0))
    port = Flight().fly(600.0, psi=-math.radians(20.0))
    for name in ('phi', 'psi', 'mu'):
        column = COLUMNS.index(name)
        assert np.array_equal(starboard.log[:, column], -port.log[:, column]), name
    assert np.array_equal(starboard.down, port.down)


def test_what_control_tells_is_a_bit_for_each_thing():
    bits = SATURATED_BUOYANCY, SATURATED_PITCH, SATURATED_ROLL, SATURATED_SURFACE, REFUSED
    assert [bit.bit_count() for bit in bits] == [1] * 5
    assert np.bitwise_or.reduce(bits) == sum(bits)


@pytest.mark.parametrize(
    ('v_d', 'rate', 'led_s'),
    [(-0.2, -0.21, 0.0), (-0.2, -0.19, -99.9), (0.2, 0.21, -99.9), (0.2, 0.19, -99.9)],
)
def test_who_is_led_out_of_a_stall_is_so_until_it_rises_as_it_is_asked_to(v_d, rate, led_s):
    """In a dive for as long as was meant."""
    params = ControlSettings(vehicle='zhang2021').params()
    now = Measured(0.0, 0.5, 0.0, 0.0, 0.0, 0.0, rate)
    wanted = Reference(*(8 * (0.0,)), v_d, *(3 * (0.0,)))
    assert watch_stall(-100.0, now, wanted, 0.4, params, TICK_S) == pytest.approx(led_s)


@pytest.mark.parametrize(
    ('v_d', 'left_s', 'm_b'), [(0.2, 1.0, 0.0), (0.2, -1.0, 0.4), (-0.2, 1.0, 0.4)]
)
def test_the_pump_of_who_stalls_in_a_dive_waits_in_the_middle_until_shortly_before_the_end(
    v_d, left_s, m_b
):
    wanted = Reference(*(8 * (0.0,)), v_d, *(3 * (0.0,)))
    led, trim, reference = leave_stall(-BEGINS_S - left_s, 0.4, Trim(0.1, 0.2), wanted)
    assert led == m_b
    assert trim == (Trim(0.0, 0.0) if v_d > 0.0 else Trim(0.1, 0.2))
    assert reference.theta == math.copysign(math.radians(60.0), -v_d)


@pytest.mark.parametrize('law', ['adaptive', 'backstepping', 'pid'])
@pytest.mark.parametrize(('m_b', 'share'), [(0.3, 1.0), (-0.9, 1.0), (0.7, 1.0), (0.8, 1.0 / 3.0)])
def test_who_is_left_less_than_a_quarter_of_its_righting_rolls_a_third_as_far_and_fast(
    law, m_b, share
):
    params = ControlSettings(vehicle='zhang2021', law=law).params().law
    params = params._replace(righting=Righting(at_rest=2.0, lever=-2.0))
    careful = bank_carefully(m_b, params)
    assert careful.roll_limit == pytest.approx(share * params.roll_limit)
    rate = share * params.roll_filter.rate_limit
    assert careful.roll_filter == params.roll_filter._replace(rate_limit=pytest.approx(rate))


@pytest.mark.parametrize(
    ('theta', 'm_b', 'rate', 'stalls'),
    [
        (-0.5, 0.95, 0.0, True),
        (-0.5, 0.95, 0.04, True),  # a quarter of what is asked for is 0.05
        (-0.5, 0.95, 0.06, False),
        (-0.1, 0.95, 0.0, False),  # the nose is hardly down
        (-0.5, 0.30, 0.0, False),  # no more than its glide takes
    ],
)
@pytest.mark.parametrize('down', [1.0, -1.0], ids=['dive', 'climb'])
def test_who_is_heavy_with_its_nose_down_and_does_not_sink_for_two_minutes_stalls(
    down, theta, m_b, rate, stalls
):
    """Or light with its nose up."""
    params = ControlSettings(vehicle='zhang2021').params()
    now = Measured(0.0, down * theta, 0.0, 0.0, 0.0, 0.0, down * rate)
    pitch, v_d = down * math.radians(-30.0), down * 0.2
    wanted = Reference(*(4 * (0.0,)), pitch, *(3 * (0.0,)), v_d, *(3 * (0.0,)))
    stall_s, times = 0.0, []
    for _ in range(1210):
        stall_s = watch_stall(stall_s, now, wanted, down * m_b, params, TICK_S)
        times.append(stall_s)
    assert max(times) == pytest.approx(120.0 if stalls else 0.0, abs=0.15)
    assert min(times) == (-240.0 if stalls else 0.0)


@pytest.mark.parametrize('down', [1.0, -1.0], ids=['dive', 'climb'])
@pytest.mark.parametrize(('learnt', 'counts'), [(-0.3, -0.3), (-0.8, -0.5), (0.4, 0.4)])
def test_a_hull_has_half_of_the_drag_in_its_file_at_least(down, learnt, counts):
    params = ControlSettings(vehicle='zhang2021').params()
    pitch, v_d = down * math.radians(-30.0), down * 0.2
    wanted = Reference(*(4 * (0.0,)), pitch, *(3 * (0.0,)), v_d, *(3 * (0.0,)))
    now = Measured(0.0, pitch, 0.0, 0.0, 0.0, 0.0, v_d)
    glide = glide_net_heaviness(pitch, v_d, params.polar)
    far = Joints(-0.9 * down, 0.0, 0.0, 0.0)  # nothing is learnt while the pump is on its way
    m_b, trim = vertical_rate_law(
        Trim(0.0, learnt * abs(glide)), now, wanted, far, False, params, TICK_S
    )
    assert m_b == pytest.approx((1.0 + counts) * glide)
    assert trim.drag == learnt * abs(glide)
