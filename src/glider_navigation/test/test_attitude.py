# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""Attitude between samples against a motion that is known, turned by scipy's rotations."""

import math

import numpy as np
import pytest
from scipy.signal import lfilter
from scipy.spatial.transform import Rotation

from glider_base.kernel import kernel
from glider_base.signals import TICK_S, Imu, Joints
from glider_model.onboard.moving_mass import make_moving_mass
from glider_model.vehicle.file import SteeringSettings, load_vehicle
from glider_navigation.attitude import attitude_step, initial_attitude

VEHICLE = load_vehicle('zhang2021')
MASS = make_moving_mass(VEHICLE.params())
#: Of the file: m_p R, first moments of all else, and turn rates over sine of roll.
LEVER, M_P, S_Z = 18.0 * 0.020, 18.0, 51.0 * 0.00392157
K_DIVE, K_CLIMB = 0.0287, -0.0370
#: The sea turns the vehicle, too (rad/s), and its trim is not quite that of the file (rad).
D, LISTS, NOSE_UP = math.radians(0.02), math.radians(1.5), math.radians(2.0)
TILTS_S = 2.0


@kernel
def _follow(state, q, rates, has_rates, x_p, mu, mass, dt):
    rows = np.empty((len(q), 7))
    for i in range(len(q)):
        imu = Imu(
            q[i, 0], q[i, 1], q[i, 2], q[i, 3], rates[i, 0], rates[i, 1], rates[i, 2], has_rates
        )
        joints = Joints(0.0, x_p[i], mu[i], 0.0)
        state, is_, is_new = attitude_step(state, imu, joints, mass, dt)
        rows[i, 0], rows[i, 1], rows[i, 2] = is_.angles.phi, is_.angles.theta, is_.angles.psi
        rows[i, 3], rows[i, 4], rows[i, 5] = is_.p, is_.q, is_.r
        rows[i, 6] = is_new
    return rows, state


class Motion:
    """A vehicle that steers to and fro by its roll mass, and how it turns, tick by tick."""

    def __init__(self, seconds, pitch_mass_m, heading=0.0, k=None, every_s=47.0):
        t_s = TICK_S * np.arange(round(seconds / TICK_S))
        wanted = np.radians(20.0) * np.sign(np.sin(math.pi * t_s / every_s) + 0.3)
        ramp = round(math.radians(20.0) / math.radians(6.0) / TICK_S)
        self.mu = np.convolve(wanted, np.ones(ramp) / ramp)[: len(t_s)]
        self.x_p = np.broadcast_to(np.asarray(pitch_mass_m, dtype=float), t_s.shape).copy()
        s_z = S_Z + LEVER * np.cos(self.mu)
        self.phi = LISTS + self._lag(np.arctan2(LEVER * np.sin(self.mu), s_z))
        self.theta = NOSE_UP + self._lag(-np.arctan2(M_P * self.x_p, s_z))
        if k is None:
            k = np.where(self.theta < 0.0, K_DIVE, K_CLIMB)
        psi_dot = k * np.sin(self.phi) + D
        self.psi = heading + np.concatenate([[0.0], np.cumsum(TICK_S * psi_dot)[:-1]])

    @staticmethod
    def _lag(x):
        """Filter of first order, at rest at the beginning."""
        fade = math.exp(-TICK_S / TILTS_S)
        return lfilter([1.0 - fade], [1.0, -fade], x - x[0]) + x[0]

    @property
    def body_rates(self):
        """Rates about the body axes (rad/s), by the turn from tick to tick."""
        euler = np.stack([self.psi, self.theta, self.phi], axis=1)
        turns = Rotation.from_euler('ZYX', euler)
        rates = (turns[:-1].inv() * turns[1:]).as_rotvec() / TICK_S
        return np.concatenate([rates[:1], rates])


@pytest.fixture
def follow(quaternions):
    """``follow(motion, period_s, vehicle, gyro)``: rows of what is believed, and the state."""

    def run(motion, period_s, vehicle=VEHICLE, gyro=False):
        q = quaternions(motion.phi, motion.theta, motion.psi)
        every = round(period_s / TICK_S)
        last = np.arange(len(q)) // every * every
        rates = motion.body_rates[last] if gyro else np.zeros((len(q), 3))
        state = initial_attitude(vehicle)
        q, x_p, mu = np.ascontiguousarray(q[last]), motion.x_p, motion.mu
        return _follow(state, q, rates, gyro, x_p, mu, MASS, TICK_S)

    return run


def vehicle_that_turns(dive, climb):
    """The vehicle with another turn rate in its file."""
    values = {
        name: {'value': k, 'unit': 'rad/s', 'source': 'test'}
        for name, k in (('dive', dive), ('climb', climb))
    }
    return VEHICLE.model_copy(update={'steering': SteeringSettings.model_validate(values)})


def wrapped(angle):
    return np.angle(np.exp(1j * angle))


def rms_deg(error):
    return math.degrees(math.sqrt(np.mean(np.square(error))))


@pytest.mark.parametrize('pitch_mass_m', [0.020, -0.020], ids=['dive', 'climb'])
def test_attitude_between_samples_stays_near_the_truth(follow, pitch_mass_m):
    """Ten seconds between samples, in which a held sample would be some degrees off."""
    motion = Motion(1800.0, pitch_mass_m)
    rows, _ = follow(motion, 10.0)
    later = slice(round(300.0 / TICK_S), None)
    held = np.arange(len(rows)) // 100 * 100
    for column, truth, most_deg in ((0, motion.phi, 0.3), (1, motion.theta, 0.3)):
        error = wrapped(rows[:, column] - truth)[later]
        assert np.degrees(np.max(np.abs(error))) < most_deg
    error = wrapped(rows[:, 2] - motion.psi)[later]
    by_held = wrapped(motion.psi[held] - motion.psi)[later]
    assert rms_deg(error) < 0.1
    assert rms_deg(error) < 0.1 * rms_deg(by_held)


def test_pitch_goes_with_the_mass_through_a_turn_over(follow):
    """From dive to climb in a quarter of a minute, seen by two samples."""
    t_s = TICK_S * np.arange(9000)
    motion = Motion(900.0, np.clip(0.020 - 0.003 * (t_s - 450.0), -0.020, 0.020))
    rows, _ = follow(motion, 10.0)
    later = slice(200, None)
    assert np.degrees(np.max(np.abs(rows[:, 1] - motion.theta)[later])) < 0.5
    held = np.arange(len(rows)) // 100 * 100
    assert np.degrees(np.max(np.abs(motion.theta[held] - motion.theta))) > 20.0


@pytest.mark.parametrize('share', [0.5, 1.0, 2.0, -1.0, 0.0])
@pytest.mark.parametrize('phase', ['dive', 'climb'])
def test_what_a_file_says_wrong_of_turning_is_learnt(follow, share, phase):
    """Half, twice, wrong sign, nothing: within 5 % in half an hour, the other phase as it was."""
    vehicle = vehicle_that_turns(share * K_DIVE, share * K_CLIMB)
    motion = Motion(1800.0, 0.020 if phase == 'dive' else -0.020)
    _, state = follow(motion, 10.0, vehicle)
    learnt, other = state.turn.dive.k, state.turn.climb.k
    truth, as_told = K_DIVE, share * K_CLIMB
    if phase == 'climb':
        learnt, other, truth, as_told = other, learnt, K_CLIMB, share * K_DIVE
    assert learnt == pytest.approx(truth, rel=0.05)
    assert other == as_told
    assert state.turn.d == pytest.approx(D, abs=math.radians(0.02))


def test_rates_between_sparse_samples_are_those_of_the_motion(follow):
    """Without a gyro: not those of a while ago, but of now."""
    motion = Motion(1800.0, 0.020)
    rows, _ = follow(motion, 10.0)
    error = np.degrees(rows[:, 3:6] - motion.body_rates)[6000:]
    assert np.sqrt(np.mean(error**2, axis=0)) == pytest.approx(np.zeros(3), abs=0.1)
    assert np.corrcoef(rows[6000:, 5], motion.body_rates[6000:, 2])[0, 1] > 0.98


@pytest.mark.parametrize('period_s', [0.1, 0.5, 1.0])
def test_dense_samples_give_rates_near_the_truth(follow, period_s):
    """Whatever the file says of turning, which is wrong here: 0.1 deg/s of a rate of 0.3."""
    motion = Motion(600.0, 0.020, every_s=60.0)
    rows, _ = follow(motion, period_s, vehicle_that_turns(-K_DIVE, -K_CLIMB))
    error = np.degrees(rows[:, 5] - motion.body_rates[:, 2])[600:]
    assert math.sqrt(np.mean(error**2)) < 0.1
    assert rms_deg(motion.body_rates[600:, 2]) > 0.25


def test_rates_of_a_gyro_are_passed_on(follow):
    motion = Motion(60.0, 0.020)
    rows, _ = follow(motion, TICK_S, gyro=True)
    assert rows[:, 3:6] == pytest.approx(motion.body_rates, abs=1e-12)
    assert np.all(rows[:, 6] == 1.0)


@pytest.mark.parametrize('period_s', [0.1, 4.0, 10.0])
def test_a_repeated_sample_is_not_a_new_one(follow, period_s):
    rows, _ = follow(Motion(120.0, 0.020), period_s)
    every = round(period_s / TICK_S)
    assert np.flatnonzero(rows[:, 6]).tolist() == list(range(0, 1200, every))


@pytest.mark.parametrize('period_s', [0.5, 10.0])
@pytest.mark.parametrize('way', [1.0, -1.0], ids=['starboard', 'port'])
def test_a_turn_through_south_is_as_any_other(follow, period_s, way):
    """Round and round: the heading stays in [-180, 180) deg, and what is learnt as it was."""
    motion = Motion(1800.0, 0.020)
    motion.psi = way * (motion.psi + 0.02 * TICK_S * np.arange(len(motion.psi)))
    south, north = motion, Motion(1800.0, 0.020)
    north.psi = motion.psi - 0.5 * way
    assert np.ptp(motion.psi) > 4.0 * math.pi
    rows, state = follow(south, period_s)
    turned, same = follow(north, period_s)
    assert np.all((rows[:, 2] >= -math.pi) & (rows[:, 2] < math.pi))
    assert wrapped(rows[:, 2] - turned[:, 2] - 0.5 * way) == pytest.approx(0.0, abs=1e-9)
    assert rows[:, 3:6] == pytest.approx(turned[:, 3:6], abs=1e-9)
    assert state.turn.dive.k == pytest.approx(same.turn.dive.k, rel=1e-9)


def test_who_has_spun_between_samples_is_not_believed_to_spin_for_good(follow):
    """A turn of a whole circle from sample to sample looks like none."""
    motion = Motion(9000.0, 0.020)
    t_s = TICK_S * np.arange(len(motion.psi))
    motion.psi = motion.psi + np.cumsum(TICK_S * np.where(t_s < 6000.0, 0.2 * t_s / 6000.0, 0.0))
    rows, _ = follow(motion, 30.0)
    assert rms_deg(wrapped(rows[:, 2] - motion.psi)[t_s > 8000.0]) < 5.0
