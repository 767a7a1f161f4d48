# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""Attitude mathematics against scipy's Rotation, and the NED / ENU border."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from glider_base.frames import (
    NO_RATES,
    OriginSettings,
    body_rates,
    covariance_to_wire,
    euler_from_quaternion,
    euler_rates,
    from_geodetic,
    horizontal_to_wire,
    imu_from_wire,
    imu_to_wire,
    odometry_from_wire,
    odometry_to_wire,
    poses_from_wire,
    quaternion_from_euler,
    reference_from_wire,
    reference_to_wire,
    rotate_to_body,
    rotate_to_ned,
    swap_world,
    to_geodetic,
    water_from_wire,
    water_to_wire,
    wrap_angle,
    wrench_from_wire,
    wrench_to_wire,
)
from glider_base.signals import Covariance, Imu, Odometry, Reference, Vector, Water, Wrench

quick = settings(max_examples=60)
angles = st.floats(-math.pi, math.pi)
pitches = st.floats(-1.4, 1.4)
numbers = st.floats(-1e4, 1e4)
attitudes = st.builds(quaternion_from_euler, angles, st.floats(-1.57, 1.57), angles)
odometries = st.builds(
    lambda position, q, twist: Odometry(*position, *q, *twist),
    st.tuples(*3 * [numbers]),
    attitudes,
    st.tuples(*6 * [numbers]),
)
references = st.builds(
    Reference, *3 * [numbers], angles, pitches, angles, *3 * [numbers], *3 * [numbers]
)

#: NED to ENU and FRD to FLU as matrices.
T = np.array([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, -1.0]])
D = np.diag([1.0, -1.0, -1.0])


def matrix(q):
    return Rotation.from_quat([*q[1:], q[0]]).as_matrix()


def turned(angle, other):
    """Difference of two angles, the short way (rad)."""
    return math.remainder(angle - other, 2.0 * math.pi)


# ------------------------------------------------------------------------------------ attitude


@quick
@given(angles, pitches, angles)
def test_quaternion_is_the_zyx_one(phi, theta, psi):
    expected = Rotation.from_euler('ZYX', [psi, theta, phi]).as_matrix()
    np.testing.assert_allclose(
        matrix(quaternion_from_euler(phi, theta, psi)), expected, rtol=0, atol=1e-14
    )


@quick
@given(angles, pitches, angles)
def test_euler_angles_come_back(phi, theta, psi):
    back = euler_from_quaternion(*quaternion_from_euler(phi, theta, psi))
    assert max(abs(turned(a, b)) for a, b in zip(back, (phi, theta, psi), strict=True)) < 1e-13


@pytest.mark.parametrize('theta', [0.5 * math.pi, -0.5 * math.pi])
def test_pitch_is_finite_straight_up_and_down(theta):
    q = quaternion_from_euler(0.3, theta, 1.0)
    assert euler_from_quaternion(*q)[1] == pytest.approx(theta, abs=1e-7)


def test_pitch_is_held_where_rounding_passes_one():
    assert euler_from_quaternion(0.8, 0.0, 0.8, 0.0)[1] == 0.5 * math.pi


@quick
@given(attitudes, st.tuples(*3 * [numbers]))
def test_rotation_to_ned_is_the_matrix(q, vector):
    np.testing.assert_allclose(
        rotate_to_ned(*q, *vector), matrix(q) @ vector, rtol=1e-13, atol=1e-10
    )


@quick
@given(attitudes, st.tuples(*3 * [numbers]))
def test_rotation_to_body_is_the_inverse(q, vector):
    back = rotate_to_body(*q, *rotate_to_ned(*q, *vector))
    np.testing.assert_allclose(back, vector, rtol=1e-13, atol=1e-10)


# ---------------------------------------------------------------------------------- wrap_angle


@settings(max_examples=300)
@given(st.floats(-1e6, 1e6))
def test_wrapped_angle_stays_in_range(angle):
    assert -math.pi <= wrap_angle(angle) < math.pi


@quick
@given(st.floats(-1000.0, 1000.0))
def test_wrapped_angle_is_the_same_direction(angle):
    assert abs(turned(wrap_angle(angle), angle)) < 1e-12


@quick
@given(st.floats(-3.141592, 3.141592))
def test_angle_in_range_is_left_alone(angle):
    assert wrap_angle(angle) == angle


@pytest.mark.parametrize(
    ('angle', 'wrapped'),
    [(math.pi, -math.pi), (-math.pi, -math.pi), (3.0 * math.pi, -math.pi), (0.0, 0.0)],
)
def test_half_a_turn_wraps_to_the_negative(angle, wrapped):
    assert wrap_angle(angle) == wrapped


# --------------------------------------------------------------------------- NED / FRD, ENU / FLU


@quick
@given(attitudes)
def test_swapped_attitude_turns_flu_into_enu(q):
    np.testing.assert_allclose(matrix(swap_world(*q)), T @ matrix(q) @ D, rtol=0, atol=1e-14)


@quick
@given(attitudes)
def test_swapped_attitude_comes_back(q):
    back = np.array(swap_world(*swap_world(*q)))
    sign = math.copysign(1.0, back @ np.array(q))
    np.testing.assert_allclose(sign * back, q, rtol=0, atol=1e-15)


@quick
@given(attitudes)
def test_swapped_attitude_has_no_negative_scalar(q):
    assert swap_world(*q)[0] >= 0.0


@quick
@given(angles, pitches, angles)
def test_euler_angles_on_the_wire(phi, theta, psi):
    q = swap_world(*quaternion_from_euler(phi, theta, psi))
    yaw, pitch, roll = Rotation.from_quat([*q[1:], q[0]]).as_euler('ZYX')
    assert abs(turned(roll, phi)) < 1e-13
    assert abs(pitch + theta) < 1e-13
    assert abs(turned(yaw, 0.5 * math.pi - psi)) < 1e-13


def test_level_and_north_on_the_wire():
    """Heading north is yaw 90 deg, heading east is yaw 0."""
    half = math.sqrt(0.5)
    assert swap_world(1.0, 0.0, 0.0, 0.0) == pytest.approx((half, 0.0, 0.0, half), abs=1e-15)
    east = quaternion_from_euler(0.0, 0.0, 0.5 * math.pi)
    assert swap_world(*east) == pytest.approx((1.0, 0.0, 0.0, 0.0), abs=1e-15)


def test_world_and_body_vectors_on_the_wire():
    wire = odometry_to_wire(Odometry(1.0, 2.0, 3.0, 1.0, 0.0, 0.0, 0.0, 4, 5, 6, 7, 8, 9))
    assert wire[:3] == (2.0, 1.0, -3.0)
    assert wire[7:] == (4.0, -5.0, -6.0, 7.0, -8.0, -9.0)


@quick
@given(odometries)
def test_odometry_vectors_come_back_exactly(odometry):
    back = odometry_from_wire(odometry_to_wire(odometry))
    assert back[:3] == odometry[:3]
    assert back[7:] == odometry[7:]


@quick
@given(odometries)
def test_odometry_attitude_comes_back(odometry):
    back = odometry_from_wire(odometry_to_wire(odometry))
    np.testing.assert_allclose(matrix(back[3:7]), matrix(odometry[3:7]), rtol=0, atol=3e-15)


@quick
@given(odometries)
def test_ground_velocity_is_the_same_in_both_worlds(odometry):
    """Turning the body twist by the attitude on the wire gives the ENU velocity."""
    wire = odometry_to_wire(odometry)
    ned = rotate_to_ned(*odometry[3:7], *odometry[7:10])
    np.testing.assert_allclose(
        matrix(wire[3:7]) @ wire[7:10], water_to_wire(Water(*ned)), rtol=0, atol=1e-10
    )


@quick
@given(references)
def test_reference_vectors_come_back_exactly(reference):
    back = reference_from_wire(reference_to_wire(reference))
    assert back[:3] == reference[:3]
    assert back[6:] == reference[6:]


@quick
@given(references)
def test_reference_angles_come_back(reference):
    back = reference_from_wire(reference_to_wire(reference))
    assert max(abs(turned(back[i], reference[i])) for i in (3, 4, 5)) < 1e-13


def test_reference_rates_are_those_of_the_angles_on_the_wire():
    """A small step in time changes roll, pitch and yaw on the wire by rate times step."""
    step, rates = 1e-6, (0.02, -0.03, 0.05)
    angles = (0.2, -0.4, 1.0)
    later = tuple(a + step * rate for a, rate in zip(angles, rates, strict=True))

    def wire(angles):
        return reference_to_wire(Reference(0.0, 0.0, 0.0, *angles, 0.0, 0.0, 0.0, *rates))

    def wire_euler(angles):
        q = wire(angles)[3:7]
        return Rotation.from_quat([*q[1:], q[0]]).as_euler('ZYX')[::-1]

    slope = (wire_euler(later) - wire_euler(angles)) / step
    np.testing.assert_allclose(slope, wire(angles)[10:], rtol=0, atol=1e-8)


@quick
@given(st.builds(Water, *3 * [numbers]))
def test_water_comes_back_exactly(water):
    assert water_from_wire(water_to_wire(water)) == water


def test_water_to_the_north_is_along_y():
    assert water_to_wire(Water(0.3, 0.1, 0.2)) == (0.1, 0.3, -0.2)


@quick
@given(st.builds(Wrench, *3 * [numbers]))
def test_wrench_comes_back_exactly(wrench):
    assert wrench_from_wire(wrench_to_wire(wrench)) == wrench


def test_wrench_in_flu():
    """Heave up and pitch nose-down positive, roll unchanged."""
    assert wrench_to_wire(Wrench(1.0, 2.0, 3.0)) == (-1.0, 2.0, -3.0)


@quick
@given(odometries, st.booleans())
def test_imu_on_the_wire_is_that_of_odometry_and_comes_back(odometry, has_rates):
    imu = Imu(*odometry[3:7], *odometry[10:], has_rates)
    wire = imu_to_wire(imu)
    assert wire[:7] == odometry_to_wire(odometry)[3:7] + odometry_to_wire(odometry)[10:]
    assert (wire[7] == NO_RATES) == (not has_rates)
    back = imu_from_wire(wire)
    assert back[4:] == imu[4:]
    assert matrix(back[:4]) == pytest.approx(matrix(imu[:4]), abs=1e-14)


def test_covariance_on_the_wire_is_that_of_the_turned_vector():
    covariance, vector = Covariance(1.0, 0.2, 3.0), Vector(4.0, 5.0)
    swap = T[:2, :2]
    turned_matrix = swap @ np.array([[1.0, 0.2], [0.2, 3.0]]) @ swap.T
    assert covariance_to_wire(covariance) == tuple(turned_matrix.ravel())
    assert horizontal_to_wire(vector, covariance)[:2] == tuple(swap @ vector)
    assert horizontal_to_wire(vector, covariance)[2:] == covariance_to_wire(covariance)


@quick
@given(angles, pitches, st.tuples(*3 * [st.floats(-5.0, 5.0)]))
def test_rates_of_angles_and_body_belong_together(phi, theta, rates):
    assert body_rates(phi, theta, *euler_rates(phi, theta, *rates)) == pytest.approx(
        rates, abs=1e-12
    )


def test_poses_of_many_messages_are_those_of_each():
    """North, east, depth and attitude, in the order given, against the single conversions."""
    rng = np.random.default_rng(3)
    angles = rng.uniform((-3.0, -1.5, -3.1), (3.0, 1.5, 3.1), (20, 3))
    places = rng.uniform(-100.0, 100.0, (20, 3))
    wire = [
        odometry_to_wire(Odometry(*place, *quaternion_from_euler(*angle), *(6 * (0.0,))))
        for place, angle in zip(places, angles, strict=True)
    ]
    poses = poses_from_wire(np.array(wire))
    np.testing.assert_array_equal(poses[:, :3], places)
    np.testing.assert_allclose(poses[:, 3:], angles, rtol=0.0, atol=1e-12)


def test_what_is_not_recorded_has_no_attitude():
    assert np.all(np.isnan(poses_from_wire(np.full((1, 7), np.nan))))


# ------------------------------------------------------------------------------ on the Earth


def earth_centred(latitude_deg, longitude_deg):
    """Place on the ellipsoid of WGS 84, in axes that turn with the Earth (m)."""
    a, f = 6378137.0, 1.0 / 298.257223563
    phi, lam = math.radians(latitude_deg), math.radians(longitude_deg)
    e2 = f * (2.0 - f)
    n = a / math.sqrt(1.0 - e2 * math.sin(phi) ** 2)
    across = n * math.cos(phi)
    return np.array(
        [across * math.cos(lam), across * math.sin(lam), n * (1.0 - e2) * math.sin(phi)]
    )


@pytest.mark.parametrize(
    ('latitude_deg', 'north_m', 'east_m'),
    [
        (0.0, 110_574.0, 111_320.0),
        (15.0, 110_649.0, 107_550.0),
        (30.0, 110_852.0, 96_486.0),
        (45.0, 111_132.0, 78_847.0),
        (60.0, 111_412.0, 55_800.0),
        (-60.0, 111_412.0, 55_800.0),
        (75.0, 111_618.0, 28_902.0),
    ],
)
def test_a_degree_is_as_long_as_tables_say(latitude_deg, north_m, east_m):
    """Lengths of a degree on WGS 84, to the metre that tables give."""
    origin = OriginSettings(latitude_deg=latitude_deg, longitude_deg=20.0).params()
    north, _ = from_geodetic(latitude_deg + 1e-3, 20.0, origin)
    _, east = from_geodetic(latitude_deg, 20.0 + 1e-3, origin)
    assert 1e3 * north == pytest.approx(north_m, abs=1.0)
    assert 1e3 * east == pytest.approx(east_m, abs=1.0)


@quick
@given(
    st.floats(-60.0, 60.0), st.floats(-180.0, 180.0), st.floats(-1e4, 1e4), st.floats(-1e4, 1e4)
)
def test_a_place_is_where_the_ellipsoid_has_it(latitude_deg, longitude_deg, p_n, p_e):
    """Distance from the origin within what the docstring says of the projection."""
    settings_ = OriginSettings(latitude_deg=latitude_deg, longitude_deg=longitude_deg)
    place = to_geodetic(p_n, p_e, settings_.params())
    chord = earth_centred(*place) - earth_centred(latitude_deg, longitude_deg)
    share = (math.tan(math.radians(abs(latitude_deg))) * abs(p_n) + 1e3) / 6378e3
    assert np.linalg.norm(chord) == pytest.approx(math.hypot(p_n, p_e), rel=share, abs=1e-3)


@quick
@given(
    st.floats(-85.0, 85.0),
    st.floats(-180.0, 180.0),
    st.floats(-1e5, 1e5),
    st.floats(-1e5, 1e5),
)
def test_a_place_comes_back_from_its_latitude_and_longitude(latitude_deg, longitude_deg, n, e):
    """Also across the antimeridian, where longitudes go on from -180 deg."""
    settings_ = OriginSettings(latitude_deg=latitude_deg, longitude_deg=longitude_deg)
    origin = settings_.params()
    latitude, longitude = to_geodetic(n, e, origin)
    assert -180.0 <= longitude <= 180.0
    assert from_geodetic(latitude, longitude, origin) == pytest.approx((n, e), abs=1e-6)


def test_north_is_north_and_east_is_east():
    origin = OriginSettings(latitude_deg=36.0, longitude_deg=179.999).params()
    latitude, longitude = to_geodetic(1000.0, 0.0, origin)
    assert latitude > 36.0
    assert longitude == 179.999
    latitude, longitude = to_geodetic(0.0, 1000.0, origin)
    assert latitude == 36.0
    assert -180.0 <= longitude < -179.98
