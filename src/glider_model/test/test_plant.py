# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""What must hold for any flight of the plant: energy, symmetry, invariance, signs, limits."""

import math

import numpy as np
import pytest
from hypothesis import Phase, given, settings
from hypothesis import strategies as st
from pydantic import ValidationError

from glider_base.frames import euler_from_quaternion
from glider_base.signals import TICK_S, Joints, Water
from glider_model.plant.motion import acceleration, integrate
from glider_model.plant.plant import (
    NO_DIVES,
    PlantSettings,
    plant_finished,
    plant_odometry,
    plant_step,
)
from glider_model.vehicle.actuators import actuators_step
from glider_model.vehicle.file import load_vehicle
from glider_model.vehicle.perturb import PerturbSettings, perturbed
from glider_model.vehicle.rigid_body import GRAVITY, make_inertia, solve_mass

# Flights are not shrunk, which would take minutes, and are the same ones each time.
flights = settings(max_examples=15, derandomize=True, phases=[Phase.explicit, Phase.generate])
quick = settings(max_examples=60)
GLIDERS = ['zhang2021', 'seawing']
names = st.sampled_from(GLIDERS)
STILL = Water(0.0, 0.0, 0.0)


def attitude(odometry):
    """Roll, pitch, heading (rad) of an odometry."""
    return euler_from_quaternion(odometry.q_w, odometry.q_x, odometry.q_y, odometry.q_z)


@st.composite
def glides(draw):
    """Euler angles, velocity and actuators within the flight domain, diving or climbing."""
    sign = draw(st.sampled_from([1.0, -1.0]))
    phi, psi = draw(st.tuples(st.floats(-0.6, 0.6), st.floats(-3.1, 3.1)))
    theta, m_b, x_p = draw(
        st.tuples(st.floats(0.2, 0.8), st.floats(0.2, 0.6), st.floats(0.01, 0.03))
    )
    speed = draw(st.floats(0.3, 0.7))
    small = draw(st.tuples(*5 * [st.floats(-0.08, 0.08)]))
    velocity = (speed, speed * small[0], speed * small[1], *small[2:])
    joints = (sign * m_b, sign * x_p, draw(st.floats(-0.8, 0.8)))
    return (phi, -sign * theta, psi), velocity, joints


# -------------------------------------------------------------------------------------- energy


def energies(flight, vehicle):
    """Kinetic (with added mass) plus potential energy of weight and metacentre (J), per row."""
    joints = Joints(*flight.rows[0, 13:17])
    inertia = make_inertia(joints.x_p, joints.mu, vehicle)
    M = np.linalg.inv(np.array([solve_mass(*load, inertia, vehicle) for load in np.eye(6)]))
    nu = flight.velocity
    w, x, y, z = flight.quaternion.T
    down = np.stack([2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)])
    first_moment = np.array([inertia.s_x, inertia.s_y, inertia.s_z])
    kinetic = 0.5 * np.einsum('ij,jk,ik->i', nu, M, nu)
    return kinetic - joints.m_b * GRAVITY * flight.p_d - GRAVITY * first_moment @ down


@flights
@given(name=names, glide=glides())
def test_energy_never_grows(name, glide, fly, plant_params, start):
    """Actuators frozen, still water: from tick to tick over 60 s."""
    euler, velocity, joints = glide
    params = plant_params(name)
    flight = fly(params, start((0.0, 0.0, 500.0), euler, velocity, joints), 60.0)
    energy = energies(flight, params.vehicle)
    assert np.diff(energy).max() < 1e-9 * np.abs(energy).max()


def test_energy_is_what_the_water_takes(fly, plant_params, start):
    """Without viscosity nothing takes it: 60 s of tumbling keep it to 1e-6 of what moves.

    In steps of 12.5 ms: it is the equations that are tested, not the length of the step.
    """
    params = plant_params('seawing')
    viscous = [name for name in params.vehicle._fields if name.startswith(('K_', 'D_'))]
    params = params._replace(vehicle=params.vehicle._replace(**dict.fromkeys(viscous, 0.0)))
    state = start(
        (0.0, 0.0, 500.0), (0.4, -0.3, 0.0), (0.5, 0.1, -0.1, 0.3, 0.1, 0.1), (0, 0, 0.3)
    )
    flight = fly(params, state, 60.0)
    motion = state.motion
    for row in flight.rows:
        row[:13] = motion
        motion, _ = integrate(motion, state.joints, state.joints, STILL, STILL, params, TICK_S, 8)
    assert np.ptp(energies(flight, params.vehicle)) < 1e-5  # J, of 30 J that move


# ------------------------------------------------------------------------ symmetry, invariance


@flights
@given(name=names, glide=glides())
def test_port_and_starboard_are_mirror_images(name, glide, fly, plant_params, start):
    (phi, theta, psi), (u, v, w, p, q, r), (m_b, x_p, mu) = glide
    params = plant_params(name)
    one = fly(
        params,
        start((1.0, 2.0, 100.0), (phi, theta, psi), (u, v, w, p, q, r), (m_b, x_p, mu)),
        60.0,
        (0.3, 0.01, 0.2),
        (0.1, 0.2, 0.0),
    )
    other = fly(
        params,
        start((1.0, -2.0, 100.0), (-phi, theta, -psi), (u, -v, w, -p, q, -r), (m_b, x_p, -mu)),
        60.0,
        (0.3, 0.01, -0.2),
        (0.1, -0.2, 0.0),
    )
    # p, q as quaternion x and z, y position, v, p, r, mu change sign
    mirror = np.array([1, -1, 1, 1, -1, 1, -1, 1, -1, 1, -1, 1, -1, 1, 1, -1, -1])
    np.testing.assert_allclose(other.rows * mirror, one.rows, rtol=0, atol=1e-10)


@flights
@given(name=names, glide=glides(), turn=st.floats(-3.0, 3.0))
def test_heading_does_not_matter(name, glide, turn, fly, plant_params, start):
    """Turned start and turned current: the same velocities, the track turned.

    To 1e-6 m: inside a step the quaternion is not of length 1, which turns and stretches a little.
    """
    (phi, theta, psi), velocity, joints = glide
    params, command = plant_params(name), (0.3, 0.01, 0.2)
    c, s = math.cos(turn), math.sin(turn)
    R = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
    position, current = np.array([3.0, -5.0, 80.0]), np.array([0.2, -0.1, 0.0])
    one = fly(params, start(position, (phi, theta, psi), velocity, joints), 60.0, command, current)
    other = fly(
        params,
        start(R @ position, (phi, theta, psi + turn), velocity, joints),
        60.0,
        command,
        R @ current,
    )
    np.testing.assert_allclose(other.velocity, one.velocity, rtol=0, atol=1e-10)
    np.testing.assert_allclose(other.position, one.position @ R.T, rtol=0, atol=1e-6)


@flights
@given(name=names, glide=glides(), shift=st.tuples(*3 * [st.floats(-1000.0, 1000.0)]))
def test_place_does_not_matter(name, glide, shift, fly, plant_params, start):
    euler, velocity, joints = glide
    params, command = plant_params(name), (0.3, 0.01, 0.2)
    position = np.array([0.0, 0.0, 1500.0])
    one = fly(params, start(position, euler, velocity, joints), 60.0, command)
    other = fly(params, start(position + shift, euler, velocity, joints), 60.0, command)
    np.testing.assert_array_equal(other.rows[:, 3:], one.rows[:, 3:])
    np.testing.assert_allclose(other.position - shift, one.position, rtol=0, atol=1e-9)


@flights
@given(name=names, glide=glides(), current=st.tuples(*3 * [st.floats(-1.5, 1.5)]))
def test_constant_current_only_translates_the_track(
    name, glide, current, fly, plant_params, start
):
    euler, velocity, joints = glide
    params, command = plant_params(name), (0.3, 0.01, 0.2)
    state = start((0.0, 0.0, 500.0), euler, velocity, joints)
    still = fly(params, state, 60.0, command)
    moving = fly(params, state, 60.0, command, current)
    np.testing.assert_array_equal(moving.rows[:, 3:], still.rows[:, 3:])
    drift = still.t_s[:, None] * current
    np.testing.assert_allclose(moving.position - drift, still.position, rtol=0, atol=1e-9)


# ------------------------------------------------------------------------------ changing current


def test_a_current_that_grows_leaves_the_vehicle_behind(plant_params, start):
    """v_c' acts on the rigid-body mass: a share m / (m + a_11) of the change, level and ahead."""
    params = plant_params('zhang2021')
    state = start(velocity=(1e-9, 0.0, 0.0, 0.0, 0.0, 0.0))
    state = plant_step(state, state.joints, STILL, params, TICK_S)
    step = plant_step(state, state.joints, Water(1e-4, 0.0, 0.0), params, TICK_S)
    expected = -1e-4 * 69.0 / (69.0 + 1.3)
    assert step.motion.u - state.motion.u == pytest.approx(expected, rel=1e-3)  # m/s


def test_the_first_tick_knows_no_change_of_current(plant_params, start):
    params, state = plant_params('zhang2021'), start()
    still = plant_step(state, state.joints, STILL, params, TICK_S)
    moving = plant_step(state, state.joints, Water(0.5, 0.0, 0.0), params, TICK_S)
    assert moving.motion[3:] == still.motion[3:]


def test_odometry_is_over_ground(plant_params, start):
    """The difference of two positions is the odometry's velocity, within the tick (m/s)."""
    params, state = plant_params('zhang2021'), start(euler=(0.2, -0.5, 1.0))
    water = Water(0.3, -0.2, 0.05)
    for _ in range(50):
        state = plant_step(state, state.joints, water, params, TICK_S)
    after = plant_step(state, state.joints, water, params, TICK_S)
    moved = (np.array(after.motion[:3]) - np.array(state.motion[:3])) / TICK_S
    ground = []
    for each in (state, after):
        odometry = plant_odometry(each)
        w, x, y, z = odometry[3:7]
        e = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
        ground.append((np.eye(3) + 2 * w * e + 2 * e @ e) @ odometry[7:10])
    np.testing.assert_allclose(moved, np.mean(ground, axis=0), rtol=0, atol=1e-4)


def test_odometry_repeats_pose_and_rates(start):
    state = start((1.0, 2.0, 3.0), (0.1, 0.2, 0.3), (0.4, 0.01, 0.02, 0.03, 0.04, 0.05))
    assert plant_odometry(state) == state.motion


def test_attitude_of_an_odometry(start):
    angles = attitude(plant_odometry(start(euler=(0.1, -0.5, 2.0))))
    assert angles == pytest.approx((0.1, -0.5, 2.0), abs=1e-14)


# ------------------------------------------------------------------------------ signs of effect


@pytest.mark.parametrize('name', GLIDERS)
def test_pitch_mass_forward_puts_the_nose_down(name, fly, plant_params, start):
    flight = fly(plant_params(name), start(), 20.0, (0.0, 0.01, 0.0))
    assert math.degrees(flight.euler[-1, 1]) < -3.0


@pytest.mark.parametrize('name', GLIDERS)
def test_pitch_mass_aft_puts_the_nose_up(name, fly, plant_params, start):
    flight = fly(plant_params(name), start(), 20.0, (0.0, -0.01, 0.0))
    assert math.degrees(flight.euler[-1, 1]) > 3.0


@pytest.mark.parametrize('name', GLIDERS)
def test_more_net_weight_sinks_faster(name, fly, plant_params, start):
    depths = [
        fly(plant_params(name), start(joints=(m_b, 0.016, 0.0)), 120.0).p_d[-1]
        for m_b in (0.2, 0.3, 0.4, 0.6)
    ]
    assert min(np.diff(depths)) > 1.0  # m


@pytest.mark.parametrize('name', GLIDERS)
def test_a_light_vehicle_rises(name, fly, plant_params, start):
    flight = fly(plant_params(name), start(joints=(-0.3, -0.016, 0.0)), 120.0)
    assert flight.p_d[-1] < 90.0  # m, from 100


@pytest.mark.parametrize('name', GLIDERS)
@pytest.mark.parametrize('sign', [1.0, -1.0])
def test_roll_mass_to_a_side_rolls_to_it(name, sign, fly, plant_params, start):
    """To starboard in the dive as in the climb."""
    for m_b in (0.3, -0.3):
        state = start(euler=(0.0, -0.5 * m_b / 0.3, 0.0), joints=(m_b, 0.05 * m_b, 0.0))
        flight = fly(plant_params(name), state, 60.0, (m_b, 0.05 * m_b, 0.3 * sign))
        assert math.degrees(flight.euler[-1, 0]) * sign > 3.0


@pytest.mark.parametrize(
    ('name', 'm_b', 'turn'),
    [('zhang2021', 0.3, 1), ('zhang2021', -0.3, -1), ('seawing', 0.3, -1), ('seawing', -0.3, -1)],
)
def test_side_to_which_a_roll_turns(name, m_b, turn, fly, plant_params, start):
    """zhang2021 turns into its roll in the dive and against it in the climb, seawing against."""
    state = start(euler=(0.0, -0.5 * m_b / 0.3, 0.0), joints=(m_b, 0.055 * m_b, 0.3))
    flight = fly(plant_params(name), state, 300.0)
    assert flight.euler[-1, 0] > 0.05
    assert turn * flight.r[-1] > 1e-4  # rad/s


# ----------------------------------------------------------------------------------- actuators

joints = st.builds(
    Joints, st.floats(-1.0, 1.0), st.floats(-0.06, 0.06), st.floats(-1.0, 1.0), st.just(0.0)
)
targets = st.builds(Joints, *4 * [st.floats(-1e3, 1e3)])


@quick
@given(joints, targets)
def test_actuators_keep_to_their_rates(position, target):
    vehicle = load_vehicle('zhang2021').params()
    moved = np.array(actuators_step(position, target, 0.0, vehicle, TICK_S)) - np.array(position)
    rates = np.array([0.004, 0.003, math.radians(6.0), 0.0])
    assert np.all(np.abs(moved) <= rates * TICK_S * (1.0 + 1e-9))


@quick
@given(joints, targets)
def test_actuators_keep_to_their_ranges(position, target):
    vehicle = load_vehicle('zhang2021').params()
    moved = actuators_step(position, target, 0.0, vehicle, 1e6)
    limits = (1.0, 0.06, math.radians(60.0), 0.0)
    expected = np.clip(target, np.negative(limits), limits)
    np.testing.assert_allclose(moved, expected, rtol=0, atol=1e-12)


def test_actuators_stay_where_they_are_wanted():
    vehicle, position = load_vehicle('zhang2021').params(), Joints(0.123, -0.0456, 0.789, 0.0)
    assert actuators_step(position, position, 0.0, vehicle, TICK_S) == position


def test_pump_takes_its_time(fly, plant_params, start):
    """0.4 kg at 4 g/s: 100 s, evenly."""
    flight = fly(plant_params(), start(), 120.0, (0.4, 0.0, 0.0))
    np.testing.assert_allclose(flight.m_b, np.minimum(0.4, 0.004 * flight.t_s), rtol=0, atol=1e-12)


# ------------------------------------------------------------------------------- any attitude


@settings(flights, max_examples=40)
@given(
    name=names,
    q=st.tuples(*4 * [st.floats(-1.0, 1.0)]).filter(lambda q: sum(x * x for x in q) > 0.01),
    velocity=st.tuples(*3 * [st.floats(-1.0, 1.0)]),
    rates=st.tuples(*3 * [st.floats(-0.5, 0.5)]),
    command=st.tuples(st.floats(-2.0, 2.0), st.floats(-1.0, 1.0), st.floats(-2.0, 2.0)),
)
def test_any_attitude_stays_finite(name, q, velocity, rates, command, fly, plant_params, start):
    state = start((0.0, 0.0, 400.0), velocity=(*velocity, *rates))
    q = np.array(q) / np.linalg.norm(q)
    state = state._replace(
        motion=state.motion._replace(
            **dict(zip(('q_w', 'q_x', 'q_y', 'q_z'), q.tolist(), strict=True))
        )
    )
    flight = fly(plant_params(name), state, 200.0, command)
    assert np.isfinite(flight.rows).all()
    assert np.linalg.norm(flight.velocity[-1, :3]) < 2.0  # m/s
    np.testing.assert_allclose(np.linalg.norm(flight.quaternion, axis=1), 1.0, atol=1e-14)


@pytest.mark.parametrize('name', GLIDERS)
@pytest.mark.parametrize(
    ('theta', 'velocity'),
    [
        (0.3, (-0.5, 0.0, 0.0)),  # tail first
        (0.0, (0.0, 0.0, 0.5)),  # flat, alpha 90 deg
        (0.0, (0.0, 0.5, 0.0)),  # sideways
        (-0.5 * math.pi, (0.5, 0.0, 0.0)),  # straight down
        (0.5 * math.pi, (0.5, 0.0, 0.0)),  # straight up
        (0.0, (0.0, 0.0, 0.0)),  # not at all
    ],
)
def test_odd_starts_end_in_a_glide(name, theta, velocity, fly, plant_params, start):
    state = start((0, 0, 300), (0, theta, 0), (*velocity, 0, 0, 0), (0.3, 0.016, 0.0))
    flight = fly(plant_params(name), state, 600.0)
    assert 0.3 < flight.u[-1] < 0.6  # m/s
    assert -40.0 < math.degrees(flight.euler[-1, 1]) < -20.0


# ------------------------------------------------------------------------------------ end of run


def finished(params, dives=0, **state_fields):
    dives = NO_DIVES._replace(count=dives)
    state = PlantSettings().initial_state()._replace(dives=dives, **state_fields)
    return plant_finished(state, params)


def test_run_ends_with_its_duration():
    params = PlantSettings(duration_s=10.0).params()
    assert [finished(params, tick=tick) for tick in (0, 98, 99)] == [False, False, True]


def test_run_ends_at_the_surface_after_its_dives():
    params = PlantSettings(dives=2, surface_s=5.0).params()
    assert not finished(params, dives=1, surface_ticks=1000)
    assert not finished(params, dives=2, surface_ticks=49)
    assert finished(params, dives=2, surface_ticks=50)


def test_run_without_dives_does_not_end_at_the_surface():
    assert not finished(PlantSettings().params(), dives=5, surface_ticks=10**6)


def test_a_dive_counts_wherever_it_turns(plant_params, start):
    """Down by 20 m and up by 20 m; going to and fro by less in the meantime counts once."""
    params, history = plant_params(), []
    state = start()
    for depth in (90.0, 100.0, 112.0, 95.0, 91.0, 75.0, 90.0, 96.0, 79.0, 70.0, 40.0, 61.0, 1.0):
        motion = state.motion._replace(p_d=depth)
        state = plant_step(state._replace(motion=motion), state.joints, STILL, params, TICK_S)
        history.append(state.dives.count)
    assert history == [0, 0, 0, 0, 1, 1, 1, 1, 1, 2, 2, 2, 3]


def test_time_at_the_surface_starts_anew(plant_params, start):
    params, state, history = plant_params(), start(), []
    for depth in (1.0, 1.0, 2.0, 1.0):
        motion = state.motion._replace(p_d=depth)
        state = plant_step(state._replace(motion=motion), state.joints, STILL, params, TICK_S)
        history.append(state.surface_ticks)
    assert history == [1, 2, 0, 1]


# ------------------------------------------------------------------------------------- settings


def test_initial_state_is_the_one_asked_for():
    settings = PlantSettings(
        initial={
            'north_m': 1.0,
            'east_m': 2.0,
            'depth_m': 3.0,
            'heading_deg': 90.0,
            'pitch_deg': -20.0,
            'speed_mps': 0.4,
            'net_heaviness_kg': 0.3,
        }
    )
    state = settings.initial_state()
    assert state.motion[:3] == (1.0, 2.0, 3.0)
    assert attitude(plant_odometry(state)) == pytest.approx(
        (0.0, math.radians(-20.0), 0.5 * math.pi), abs=1e-14
    )
    assert state.motion[7:] == (0.4, 0.0, 0.0, 0.0, 0.0, 0.0)
    assert state.joints == Joints(0.3, 0.0, 0.0, 0.0)


@pytest.mark.parametrize(
    'values', [{'duration_s': 0.0}, {'dives': -1}, {'initial': {'pitch_deg': 90.0}}]
)
def test_settings_out_of_range_are_refused(values):
    with pytest.raises(ValidationError):
        PlantSettings(**values)


def test_acceleration_of_a_heavy_body_at_rest(plant_params, start):
    """Level and at rest: m_b g / (m + a_33) down, nothing else (m/s^2, rad/s^2)."""
    params = plant_params('zhang2021')
    inertia = make_inertia(0.0, 0.0, params.vehicle)
    motion = start(velocity=(0.0,) * 6).motion
    rate = acceleration(
        motion, Joints(0.5, 0.0, 0.0, 0.0), inertia, STILL, params.vehicle, params.density
    )
    assert rate[2] == pytest.approx(0.5 * 9.81 / (69.0 + 60.53), rel=1e-12)
    assert np.abs(np.delete(rate, 2)).max() < 1e-15


def test_a_weight_that_is_let_go_lifts_and_turns_nothing(plant_params, start):
    """By W g / (m + a_33); the oil, which pitches a Slocum, has not moved (m/s, rad/s)."""
    params = plant_params('slocum_g2')
    v, state = params.vehicle, start(velocity=(0.0,) * 6)
    kept, after = (
        plant_step(state, Joints(0.0, 0.0, 0.0, 0.0), STILL, params, TICK_S, drops).motion
        for drops in (False, True)
    )
    assert np.abs(np.subtract(after[-3:], kept[-3:])).max() < 1e-4
    lifted_mps = v.drop_weight * GRAVITY / (v.m + v.a_33) * TICK_S
    assert kept.w - after.w == pytest.approx(lifted_mps, rel=0.01)


# ---------------------------------------------------------------------------------- wind

WIND = {'wind_mps': 10.0, 'wind_from_deg': 300.0, 'leeway_share': 0.03}


def test_wind_carries_a_vehicle_that_floats_to_leeward(fly, plant_params, start):
    """As fast as the share of the wind says, out of where it comes from."""
    commands = np.broadcast_to([-0.5, 0.0, 0.0], (12000, 3))
    state = start((0.0, 0.0, 0.0), velocity=(0.0,) * 6, joints=(-0.5, 0.0, 0.0))
    calm, blown = (
        fly(plant_params(**wind), state, 1200.0, commands).position for wind in ({}, WIND)
    )
    drift = (blown[-1] - blown[6000] - calm[-1] + calm[6000])[:2] / 600.0
    assert drift == pytest.approx(0.3 * np.array([-0.5, math.sqrt(0.75)]), abs=0.003)


def test_wind_is_felt_by_nobody_under_water(fly, plant_params, start):
    commands = np.broadcast_to([0.5, 0.02, 0.0], (3000, 3))
    state = start((0.0, 0.0, 2.0))
    calm, blown = (fly(plant_params(**wind), state, 300.0, commands).rows for wind in ({}, WIND))
    assert np.array_equal(calm, blown)


# ---------------------------------------------------------------------------------- extremes


@pytest.mark.parametrize('name', [*GLIDERS, 'zhang2021_table1'])
@pytest.mark.parametrize(
    'factors',
    [
        {'D_p': 3.1},
        {'D_p': 10.0},
        {'K_p': 10.0, 'K_q': 10.0, 'K_r': 10.0},
        {'D_v': 0.0, 'D_vv': 10.0},  # of table1: damping that feeds the side-slip
        {'D_p': 0.0, 'K_p': 0.0, 'K_MR': -10.0},
        {'K_D0': 0.0, 'K_D': 0.0, 'D_u': 0.0, 'D_w': 0.0},
        {'K_L': 10.0, 'a_33': 0.0},
        {'K_M': -10.0, 'K_MY': -10.0, 'D_r': 0.0, 'K_r': 0.0},
    ],
    ids=str,
)
def test_extremes_stay_finite(name, factors, fly, plant_params, start):
    """300 s from 1.5 m/s, 5 kg too heavy: turns over, spins, falls, and not above 20 m/s."""
    vehicle = perturbed(
        load_vehicle(name).params(), PerturbSettings(net_heaviness_kg=5.0, **factors)
    )
    state = start(euler=(0.3, -0.6, 0.0), velocity=(1.5, 0.3, -0.2, 0.1, 0.1, 0.1))
    commands = np.repeat([[0.5, 0.03, 0.8], [-0.5, -0.03, -0.8]], 1500, axis=0)
    flight = fly(plant_params(vehicle), state, 300.0, commands)
    assert np.isfinite(flight.rows).all()
    assert np.linalg.norm(flight.velocity[:, :3], axis=1).max() < 20.0


@pytest.mark.parametrize(
    'changes',
    [
        {'hull_radius': 0.005},  # a surface like a stiff spring
        {'D_u': 1e5, 'D_v': 1e5, 'D_w': 1e5},
        {'D_p': 1e5, 'D_q': 1e5, 'D_r': 1e5, 'D_pp': 1e5, 'D_rr': 1e5},
        {'K_D': 1e5, 'K_L': 1e5},
        {'K_p': -1e5, 'K_q': -1e5, 'K_r': -1e5},
        {'K_M': -1e4, 'K_MY': 1e4, 'K_MR': -1e4},
    ],
    ids=str,
)
def test_stiff_vehicles_stay_finite(changes, fly, plant_params, start):
    """Ends of the ranges of a vehicle file, static moments a hundredfold, through the surface."""
    vehicle = load_vehicle('zhang2021').params()._replace(**changes)
    state = start((0.0, 0.0, 2.0), (0.3, 0.5, 0.0), (0.5, 0.1, -0.1, 0.1, 0.1, 0.1), (-0.5, 0, 0))
    commands = np.repeat([[-0.5, -0.02, 0.5], [0.5, 0.02, -0.5]], 1000, axis=0)
    flight = fly(plant_params(vehicle), state, 200.0, commands)
    assert np.isfinite(flight.rows).all()
    assert np.linalg.norm(flight.velocity[:, :3], axis=1).max() < 20.0
