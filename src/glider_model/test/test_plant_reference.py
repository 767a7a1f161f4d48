# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""The plant against an independent one: absolute velocity, 6 x 6 matrices, scipy's DOP853.

The reference is written from Fossen (2021) and Graver (2005) and shares no formula with the
kernels. Its velocity is over ground, its C_RB the Lagrangian one, its masses are added up body by
body, its weights act on each body where it is:

    M_RB nu' + C_RB(nu) nu + M_A nu_r' + C_A(nu_r) nu_r = tau,   nu_r = nu - [R^T v_c; 0]

Inside a tick the plant holds the water velocity in p' = R nu_r + v_c and takes v_c' as the
difference to the tick before; the reference lets v_c run evenly from one value to the next for the
dynamics, integrates the path through the water, and adds the held velocities to it.
"""

import itertools
import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from glider_base.signals import TICK_S, Joints, Water
from glider_model.plant.motion import Motion, derivative, integrate, phi_functions
from glider_model.vehicle.file import load_vehicle
from glider_model.vehicle.rigid_body import make_inertia

G = 9.81


def S(a):
    """Cross-product matrix."""
    return np.array([[0.0, -a[2], a[1]], [a[2], 0.0, -a[0]], [-a[1], a[0], 0.0]])


def R_NB(q):
    """Rotation matrix of a quaternion w, x, y, z, normalised."""
    q = q / math.sqrt(q @ q)
    e = S(q[1:])
    return np.eye(3) + 2.0 * q[0] * e + 2.0 * e @ e


def R_x(angle):
    c, s = math.cos(angle), math.sin(angle)
    return np.array([[1.0, 0.0, 0.0], [0.0, c, -s], [0.0, s, c]])


def R_y(angle):
    c, s = math.cos(angle), math.sin(angle)
    return np.array([[c, 0.0, s], [0.0, 1.0, 0.0], [-s, 0.0, c]])


def R_z(angle):
    c, s = math.cos(angle), math.sin(angle)
    return np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])


class Reference:
    """A vehicle file as a textbook's matrices."""

    def __init__(self, name):
        file = load_vehicle(name)
        body, mass, added = file.rigid_body, file.moving_mass, file.added_mass
        self.hull_mass, self.moving_mass = body.hull_mass.value, mass.mass.value
        self.m = self.hull_mass + self.moving_mass
        self.r_hull = np.array(body.hull_center_of_mass.value)
        self.hull_inertia = np.diag(body.hull_inertia.value)
        self.neutral_x, self.radius = mass.neutral_x.value, mass.radius.value
        self.own_inertia = np.diag(mass.inertia.value)
        self.M_A = np.diag([*added.linear.value, *added.angular.value])
        self.M_A[1, 5] = self.M_A[5, 1] = added.sway_yaw.value
        self.M_A[2, 4] = self.M_A[4, 2] = added.heave_pitch.value
        hydro = file.hydrodynamics
        self.k = {
            name: getattr(hydro, name).value
            for name in type(hydro).model_fields
            if name.startswith('K_')
        }
        self.linear = np.array([*hydro.linear_damping.value, *hydro.linear_angular_damping.value])
        self.quadratic = np.array(
            [*hydro.quadratic_damping.value, *hydro.quadratic_angular_damping.value]
        )

    def bodies(self, x_p, mu):
        """Position of the moving mass, centre of mass of all, inertia about the origin."""
        r_p = np.array([self.neutral_x + x_p, 0.0, 0.0]) + R_x(-mu) @ [0.0, 0.0, self.radius]
        r_g = (self.hull_mass * self.r_hull + self.moving_mass * r_p) / self.m
        own = R_x(-mu) @ self.own_inertia @ R_x(-mu).T
        return r_p, r_g, self.hull_inertia + own - self.moving_mass * S(r_p) @ S(r_p)

    def forces(self, v_r, omega):
        """Viscous forces and moments, wind axes to body (Graver 2005, ch. 4)."""
        k, speed = self.k, math.sqrt(v_r @ v_r)
        alpha, beta = math.atan2(v_r[2], v_r[0]), math.asin(v_r[1] / speed)
        R_BC = R_y(-alpha) @ R_z(beta)
        lift_angle = math.sin(alpha) * math.cos(alpha)
        force = [
            -(k['K_D0'] + k['K_D'] * math.sin(alpha) ** 2),
            k['K_beta'] * math.sin(beta),
            -(k['K_L0'] + k['K_L'] * lift_angle),
        ]
        moment = [
            k['K_MR'] * math.sin(beta),
            k['K_M0'] + k['K_M'] * lift_angle,
            k['K_MY'] * math.sin(beta),
        ]
        # damping about axes that turn with the flow while alpha is small
        R_BD = R_y(-math.asin(math.sin(alpha) * math.cos(alpha) ** 4))
        damping = R_BD @ np.diag([k['K_p'], k['K_q'], k['K_r']]) @ R_BD.T @ omega
        nu = np.concatenate([v_r, omega])
        wind = speed**2 * np.concatenate([R_BC @ force, R_BC @ moment + damping])
        return wind - (self.linear + self.quadratic * abs(nu)) * nu

    def derivative(self, x, joints, v_c, v_c_rate):
        """Of path through the water, q, nu over ground."""
        m_b, x_p, mu, _ = joints
        q, v, omega = x[3:7], x[7:10], x[10:13]
        R = R_NB(q)
        r_p, r_g, I_o = self.bodies(x_p, mu)
        water = R.T @ v_c
        v_r = v - water
        M_RB = np.block([[self.m * np.eye(3), -self.m * S(r_g)], [self.m * S(r_g), I_o]])
        momentum = self.m * (v + S(omega) @ r_g)
        spin = S(self.m * S(r_g) @ v + I_o @ omega)
        coriolis_rb = -np.concatenate(
            [S(momentum) @ omega, S(momentum) @ v + spin @ omega]
        )  # [[0, -S(p)], [-S(p), -S(h)]] nu
        added = self.M_A @ np.concatenate([v_r, omega])
        coriolis_a = -np.concatenate(
            [S(added[:3]) @ omega, S(added[:3]) @ v_r + S(added[3:]) @ omega]
        )
        down = R.T @ [0.0, 0.0, 1.0]
        gravity = np.concatenate(
            [
                m_b * G * down,
                S(self.hull_mass * self.r_hull + self.moving_mass * r_p) @ (G * down),
            ]
        )
        # nu_r' = nu' - [water_rate; 0]
        water_rate = R.T @ v_c_rate - S(omega) @ water
        right = (
            self.forces(v_r, omega)
            + gravity
            - coriolis_rb
            - coriolis_a
            + self.M_A[:, :3] @ water_rate
        )
        w, e = q[0], q[1:]
        q_rate = 0.5 * np.concatenate([[-e @ omega], w * omega + S(e) @ omega])
        return np.concatenate([R @ v - v_c, q_rate, np.linalg.solve(M_RB + self.M_A, right)])

    def segment(self, x, start, joint_rate, v_c, v_c_rate, seconds, tolerance):
        """Integrate while actuators and water run evenly."""
        answer = solve_ivp(
            lambda t, y: self.derivative(y, start + joint_rate * t, v_c + v_c_rate * t, v_c_rate),
            (0.0, seconds),
            x,
            method='DOP853',
            rtol=tolerance,
            atol=tolerance,
        )
        assert answer.success
        return answer.y[:, -1]


def manoeuvre():
    """Commands and water velocity of 330 s: both ways in pitch, roll and buoyancy."""
    ticks = 3300
    t = TICK_S * np.arange(ticks)
    commands = np.empty((ticks, 3))
    # A dive and a climb, their apogee without a stall: at no speed the forces have no derivative,
    # and a fixed step loses its order. 3 mm/s and 6 deg/s end inside a tick.
    commands[:, 0] = np.select([t < 100, t < 220], [0.35, -0.30], -0.18)
    commands[:, 1] = np.select([t < 80, t < 180, t < 290], [0.0185, 0.0052, -0.0171], -0.0083)
    commands[:, 2] = np.select([t < 35, t < 115, t < 215], [0.0, 0.40, -0.55], 0.22)
    # constant, turning within 30 s, constant, changing within 2 s, constant
    slow, fast = (
        np.clip((t - begin) / seconds, 0.0, 1.0)[:, None]
        for begin, seconds in ((50.0, 30.0), (275.0, 2.0))
    )
    waters = np.array([0.20, -0.10, 0.0]) + slow * [-0.35, 0.25, 0.0] + fast * [0.1, -0.1, 0.0]
    return commands, waters


def reference_flight(name, flight, waters, tolerance=1e-10):
    """Reference states at the ends of the segments: tick, path over ground, q, nu_r."""
    reference = Reference(name)
    joints = flight.rows[:, 13:17]
    held = np.vstack([np.zeros(3), np.cumsum(waters * TICK_S, axis=0)])
    # velocity at each tick; before the first there is no difference to take
    v_c = np.vstack([waters[0], waters])
    rates = np.hstack([np.diff(joints, axis=0), np.diff(v_c, axis=0)]) / TICK_S
    breaks = np.flatnonzero(np.abs(np.diff(rates, axis=0)).max(axis=1) > 1e-9) + 1
    ends = [*breaks, len(waters)]
    x = flight.rows[0, :13].copy()
    x[7:10] += R_NB(x[3:7]).T @ v_c[0]
    rows, begin = [], 0
    for end in ends:
        seconds = (end - begin) * TICK_S
        rate = (joints[end] - joints[begin]) / seconds
        v_c_rate = (v_c[end] - v_c[begin]) / seconds
        x = reference.segment(x, joints[begin], rate, v_c[begin], v_c_rate, seconds, tolerance)
        q = x[3:7] / np.linalg.norm(x[3:7])
        v_r = x[7:10] - R_NB(q).T @ v_c[end]
        rows.append(np.concatenate([x[:3] + held[end], q, v_r, x[10:13]]))
        begin = end
    return np.array(ends), np.array(rows)


@pytest.fixture(scope='module', params=['zhang2021', 'seawing'])
def both(request, fly, plant_params, start):
    commands, waters = manoeuvre()
    state = start((10.0, -20.0, 150.0), (0.05, -0.3, 2.0), (0.4, 0.01, -0.02, 0.01, -0.02, 0.03))
    flight = fly(plant_params(request.param), state, 330.0, commands, waters)
    ends, rows = reference_flight(request.param, flight, waters)
    return flight.rows[ends, :13], rows


def test_manoeuvre_position_agrees_with_dop853(both):
    plant, reference = both
    assert np.abs(plant[:, :3] - reference[:, :3]).max() < 1e-3  # m


def test_manoeuvre_attitude_agrees_with_dop853(both):
    plant, reference = both
    assert np.abs(plant[:, 3:7] - reference[:, 3:7]).max() < 1e-4


def test_manoeuvre_velocity_agrees_with_dop853(both):
    plant, reference = both
    assert np.abs(plant[:, 7:] - reference[:, 7:]).max() < 5e-5  # m/s, rad/s


def test_manoeuvre_is_one(both):
    """The comparison is worth something: the vehicle turns, rolls, dives and climbs in it."""
    plant, _ = both
    assert np.ptp(plant[:, 2]) > 15.0  # m
    assert np.ptp(plant[:, 7]) > 0.2  # m/s
    assert np.abs(plant[:, 10:]).max() > 0.01  # rad/s


#: A second in which everything moves, far from a glide, and its actuators and water.
SECOND = {'euler': (0.2, -0.4, 1.0), 'velocity': (0.5, 0.05, -0.03, 0.2, -0.1, 0.05)}
BEGIN, END = Joints(0.3, 0.01, -0.2, 0.0), Joints(0.31, 0.013, -0.1, 0.0)
WATER, WATER_RATE = np.array([0.2, 0.1, 0.0]), np.array([0.01, -0.02, 0.0])


def errors_of_a_second(name, factor, steps, plant_params, start):
    """Largest error of the motion after `SECOND` against DOP853, for some numbers of steps.

    ``factor`` scales all damping of the rates.
    """
    params = plant_params(name)
    stiff = {
        field: factor * getattr(params.vehicle, field)
        for field in ('D_p', 'D_q', 'D_r', 'K_p', 'K_q', 'K_r')
    }
    params = params._replace(vehicle=params.vehicle._replace(**stiff))
    reference = Reference(name)
    reference.linear[3:] *= factor
    for field in ('K_p', 'K_q', 'K_r'):
        reference.k[field] *= factor
    state = start(**SECOND)
    x, before = np.array(state.motion), WATER - WATER_RATE
    x[7:10] += R_NB(x[3:7]).T @ before
    begin, end = np.array(BEGIN), np.array(END)
    x = reference.segment(x, begin, end - begin, before, WATER_RATE, 1.0, 1e-13)
    x[:3] += WATER
    x[3:7] /= np.linalg.norm(x[3:7])
    x[7:10] -= R_NB(x[3:7]).T @ WATER
    given = state.motion, BEGIN, END, Water(*WATER), Water(*WATER_RATE), params, 1.0
    return np.array([np.abs(np.array(integrate(*given, n)[0]) - x).max() for n in steps])


@pytest.mark.parametrize(
    ('name', 'factor', 'steps', 'low', 'high'),
    [
        # not stiff: order 4
        ('zhang2021', 0.0, [10, 20, 40], 3.8, 4.4),
        ('seawing', 1.0, [10, 20, 40], 3.8, 4.4),
        # the pole of roll is 37 1/s: order 4 where the step is short for it, ...
        ('zhang2021', 1.0, [80, 160, 320], 3.6, 4.4),
        # ... and where it is long less, as theory has it for stiff parts (Hochbruck and
        # Ostermann 2005: 2 in the worst case), without ever being unstable
        ('zhang2021', 10.0, [10, 20, 40], 1.5, 3.0),
        ('zhang2021', 100.0, [10, 20, 40], 0.5, 3.0),
    ],
)
def test_error_falls_with_the_order(name, factor, steps, low, high, plant_params, start):
    errors = errors_of_a_second(name, factor, steps, plant_params, start)
    slope = -np.polyfit(np.log(steps), np.log(errors), 1)[0]
    assert low < slope < high, errors
    assert errors[-1] > 1e-12  # above rounding


@pytest.mark.parametrize('name', ['zhang2021', 'seawing'])
def test_without_damping_it_is_the_classical_method(name, plant_params, start):
    """A Runge-Kutta 4 written down here, on the derivative of the plant."""
    params = plant_params(name)
    viscous = dict.fromkeys(('D_p', 'D_q', 'D_r', 'K_p', 'K_q', 'K_r'), 0.0)
    vehicle = params.vehicle._replace(**viscous)
    params, x = params._replace(vehicle=vehicle), start(**SECOND).motion
    still, h = Water(0.0, 0.0, 0.0), TICK_S
    inertia = make_inertia(BEGIN.x_p, BEGIN.mu, vehicle)

    def f(y):
        k = derivative(Motion(*y), BEGIN, inertia, still, still, vehicle, params.density)
        return np.array(k)

    y = np.array(x)
    k_1 = f(y)
    k_2 = f(y + 0.5 * h * k_1)
    k_3 = f(y + 0.5 * h * k_2)
    y += h / 6.0 * (k_1 + 2.0 * k_2 + 2.0 * k_3 + f(y + h * k_3))
    y[3:7] /= np.linalg.norm(y[3:7])
    motion, _ = integrate(x, BEGIN, BEGIN, still, still, params, h, 1)
    np.testing.assert_allclose(np.array(motion), y, rtol=0, atol=1e-14)


@pytest.mark.parametrize('z', [0.0, -1e-9, -1e-3, -0.3, -0.5, -0.7, -3.0, -40.0, -2000.0])
def test_phi_functions(z):
    """Against their integrals, by Gauss and Legendre."""
    s, weight = np.polynomial.legendre.leggauss(60)
    # the integrand is concentrated at the end where the decay is fast
    edges = 1.0 - np.array([1.0, 0.3, 0.1, 0.03, 0.01, 0.003, 0.001, 0.0])
    for k, value in enumerate(phi_functions(z)[1:], 1):
        parts = [
            0.5 * (b - a) * weight @ (np.exp((1 - x) * z) * x ** (k - 1) / math.factorial(k - 1))
            for a, b in itertools.pairwise(edges)
            for x in [0.5 * (a + b) + 0.5 * (b - a) * s]
        ]
        assert value == pytest.approx(sum(parts), rel=1e-13)
    assert phi_functions(z)[0] == pytest.approx(math.exp(z), rel=1e-14)


@pytest.mark.parametrize('name', ['zhang2021', 'seawing'])
def test_a_single_tick_agrees_with_dop853(name, plant_params, start):
    """Everything moves at once, far from a glide: alpha 25 deg, beta 20 deg, roll 60 deg."""
    state = start(euler=(1.0, 0.7, -2.0), velocity=(0.5, 0.2, 0.25, 0.3, -0.2, 0.25))
    begin, end = Joints(-0.3, 0.02, 0.6, 0.0), Joints(-0.25, 0.03, 0.7, 0.0)
    water, rate = np.array([0.3, -0.2, 0.0]), np.array([0.1, 0.2, 0.0])
    motion, _ = integrate(
        state.motion, begin, end, Water(*water), Water(*rate), plant_params(name), TICK_S, 1024
    )
    reference, x = Reference(name), np.array(state.motion)
    before = water - rate * TICK_S
    x[7:10] += R_NB(x[3:7]).T @ before
    joint_rate = (np.array(end) - np.array(begin)) / TICK_S
    x = reference.segment(x, np.array(begin), joint_rate, before, rate, TICK_S, 1e-13)
    x[:3] += water * TICK_S
    x[7:10] -= R_NB(x[3:7]).T @ water
    assert np.abs(np.array(motion) - x).max() < 1e-10
    assert np.abs(np.array(motion) - np.array(Motion(*state.motion))).max() > 1e-3
