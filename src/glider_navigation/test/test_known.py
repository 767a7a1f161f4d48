# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""Position is measured: what is measured is believed, and attitude between its samples."""

import math

import numpy as np
import pytest

from glider_base.frames import odometry_from_wire, odometry_to_wire
from glider_base.signals import TICK_S, Imu, Joints, Odometry
from glider_navigation.method import Fix, Received, method_step
from glider_navigation.phase import KNOWN
from glider_navigation.settings import NavigationSettings

NO_IMU = Imu(1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, False)
NO_FIX = Fix(False, 0.0, 0.0, 0.0)
#: Roll that the moving mass of zhang2021 makes when it is turned by so much (rad).
MU = math.radians(20.0)
ROLL = math.atan2(0.36 * math.sin(MU), 0.20 + 0.36 * math.cos(MU))


class Navigation:
    """Navigation that is told numbers of the wire, tick by tick."""

    def __init__(self, **settings):
        settings = NavigationSettings(**settings)
        self.params, self.state = settings.params().method, settings.initial_state().method

    def tick(self, wire, mu=0.0):
        received = Received(
            Joints(0.0, 0.0, mu, 0.0), wire, odometry_from_wire(wire), NO_IMU, 0.0, NO_FIX, 0.0
        )
        self.state, believed = method_step(self.state, received, self.params, TICK_S)
        return believed


def wire(quaternion, rates=(0.0, 0.0, 0.0), north=0.0):
    """Odometry as on the wire, of an attitude q_NB and body rates (rad/s)."""
    q = (float(number) for number in quaternion)
    return odometry_to_wire(Odometry(north, -2.0, 123.4, *q, 0.4, 0.01, 0.02, *rates))


def test_all_is_passed_on_to_the_last_bit():
    """With a gyro and a sample in every tick, whatever the numbers, minus zero too."""
    navigation, rng = Navigation(), np.random.default_rng(4)
    for _ in range(200):
        numbers = rng.normal(0.0, 1.0, 13) * 10.0 ** rng.uniform(-12.0, 6.0, 13)
        numbers[rng.integers(13)] = -0.0
        believed = navigation.tick(tuple(numbers.tolist()))
        assert np.array(believed.odom).tobytes() == numbers.tobytes()
        assert believed.phase == KNOWN
        assert tuple(believed.place) == (0.0, 0.0, 0.0)


@pytest.mark.parametrize('gyro', [True, False], ids=['gyro', 'no gyro'])
def test_between_samples_attitude_goes_on_and_the_place_is_measured(gyro, quaternions):
    """The roll mass is turned after the first sample: the vehicle banks and turns as it makes it.

    Heading by the turn rate 0.0287 sin(roll) of zhang2021's dive, integrated here in closed
    steps; the next sample is believed as it is.
    """
    navigation = Navigation(gyro=gyro, imu_period_s=10.0)
    first, next_ = quaternions(0.0, -0.4, [3.1, 0.7])
    navigation.tick(wire(first, (0.01, 0.02, 0.03)))
    phi = psi = 0.0
    for i in range(1, 100):
        measured = wire(first, (0.01, 0.02, 0.03), north=float(i))
        odom = navigation.tick(measured, mu=MU).odom
        phi = ROLL * -math.expm1(-i * TICK_S / 2.0)
        psi += TICK_S * 0.0287 * math.sin(phi)
        expected = wire(quaternions(phi, -0.4, 3.1 + psi))[3:7]
        assert odom[:3] == measured[:3]
        assert odom[7:10] == measured[7:10]
        assert abs(np.dot(odom[3:7], expected)) > math.cos(math.radians(0.5))
    assert math.degrees(2.0 * math.acos(abs(np.dot(odom[3:7], measured[3:7])))) > 10.0
    measured = wire(next_, (0.01, 0.02, 0.03))
    odom = navigation.tick(measured, mu=MU).odom
    assert abs(np.dot(odom[3:7], measured[3:7])) == pytest.approx(1.0, abs=1e-12)
    if gyro:
        assert odom[10:] == pytest.approx(measured[10:], abs=1e-12)
    else:
        assert max(np.abs(np.subtract(odom[10:], (0.01, -0.02, -0.03)))) > 1e-3


def test_without_a_gyro_rates_are_made_of_samples(quaternions):
    """What the odometry says of rates is of no account: it turns at 0.05 rad/s."""
    navigation = Navigation(gyro=False)
    attitudes = quaternions(0.0, 0.0, 0.05 * TICK_S * np.arange(300))
    for quaternion in attitudes:
        odom = navigation.tick(wire(quaternion, (9.0, 9.0, 9.0))).odom
    assert odom[10:] == pytest.approx((0.0, 0.0, -0.05), abs=1e-3)
    assert abs(np.dot(odom[3:7], wire(attitudes[-1])[3:7])) == pytest.approx(1.0, abs=1e-12)
