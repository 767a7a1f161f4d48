# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""Attitude mathematics and the border between NED / FRD and ENU / FLU.

Inside, everything is NED (world) and FRD (body). On topics everything is ENU and FLU, by REP-103
and REP-105. The functions ``*_to_wire`` and ``*_from_wire`` are the only conversions in the
repository; the direct engine applies them too, so that it computes with exactly the numbers that
a node reads from a message.

World vectors swap x and y and negate z. Body vectors negate y and z.
"""

import math
from datetime import datetime, timezone
from typing import NamedTuple

import numpy as np
from pydantic import Field, field_validator

from glider_base.kernel import kernel
from glider_base.settings import Settings, number
from glider_base.signals import Covariance, Imu, Odometry, Reference, Water, Wrench

_HALF_SQRT2 = math.sqrt(0.5)
#: WGS 84: semi-major axis (m), and the first eccentricity squared (-).
_AXIS, _ECCENTRICITY2 = 6378137.0, 6.69437999014e-3
UTC = timezone.utc  # noqa: UP017, which Python 3.10 does not have
#: What a sensor_msgs/Imu says where there are no rates, and in the place of a quaternion where
#: there is no attitude.
NO_RATES, NO_ATTITUDE = -1.0, (0.0, 0.0, 0.0, 0.0)


@kernel
def wrap_angle(angle):
    """Angle (rad) brought into [-pi, pi), but for the rounding of its last digit."""
    return angle - 2.0 * math.pi * math.floor((angle + math.pi) / (2.0 * math.pi))


def within_180(degrees):
    """Angle or longitude (deg) brought into [-180, 180), float or array."""
    return (degrees + 180.0) % 360.0 - 180.0


@kernel
def rotate_to_ned(q_w, q_x, q_y, q_z, x, y, z):
    """Turn a body vector into NED: ``R_NB [x, y, z]`` for the unit quaternion q_NB."""
    t_x = 2.0 * (q_y * z - q_z * y)
    t_y = 2.0 * (q_z * x - q_x * z)
    t_z = 2.0 * (q_x * y - q_y * x)
    return (
        x + q_w * t_x + q_y * t_z - q_z * t_y,
        y + q_w * t_y + q_z * t_x - q_x * t_z,
        z + q_w * t_z + q_x * t_y - q_y * t_x,
    )


@kernel
def rotate_to_body(q_w, q_x, q_y, q_z, x, y, z):
    """Turn a NED vector into body axes: ``R_NB^T [x, y, z]``."""
    return rotate_to_ned(q_w, -q_x, -q_y, -q_z, x, y, z)


@kernel
def quaternion_from_euler(phi, theta, psi):
    """Unit quaternion q_NB (w, x, y, z) of roll, pitch, heading in rad (Fossen zyx)."""
    c1, s1 = math.cos(0.5 * phi), math.sin(0.5 * phi)
    c2, s2 = math.cos(0.5 * theta), math.sin(0.5 * theta)
    c3, s3 = math.cos(0.5 * psi), math.sin(0.5 * psi)
    return (
        c1 * c2 * c3 + s1 * s2 * s3,
        s1 * c2 * c3 - c1 * s2 * s3,
        c1 * s2 * c3 + s1 * c2 * s3,
        c1 * c2 * s3 - s1 * s2 * c3,
    )


@kernel
def euler_from_quaternion(q_w, q_x, q_y, q_z):
    """Roll, pitch, heading (rad) of q_NB."""
    phi = math.atan2(2.0 * (q_w * q_x + q_y * q_z), 1.0 - 2.0 * (q_x * q_x + q_y * q_y))
    return phi, pitch_of(q_w, q_x, q_y, q_z), heading_of(q_w, q_x, q_y, q_z)


@kernel
def angles_if_any(quaternion):
    """Roll, pitch, heading (rad) of q_NB, q_w first; NaN each of `NO_ATTITUDE`."""
    if quaternion == NO_ATTITUDE:
        return math.nan, math.nan, math.nan
    return euler_from_quaternion(quaternion[0], quaternion[1], quaternion[2], quaternion[3])


@kernel
def pitch_of(q_w, q_x, q_y, q_z):
    """Pitch (rad) of q_NB alone, held within +-pi/2 against rounding; NaN of a NaN."""
    return math.asin(min(max(2.0 * (q_w * q_y - q_z * q_x), -1.0), 1.0))


@kernel
def heading_of(q_w, q_x, q_y, q_z):
    """Heading (rad) of q_NB alone."""
    return math.atan2(2.0 * (q_w * q_z + q_x * q_y), 1.0 - 2.0 * (q_y * q_y + q_z * q_z))


@kernel
def euler_rates(phi, theta, p, q, r):
    """Rates of roll, pitch, heading (rad/s) from those about the body axes."""
    s_phi, c_phi = math.sin(phi), math.cos(phi)
    c_theta = max(0.1, math.cos(theta))
    psi_dot = (s_phi * q + c_phi * r) / c_theta
    return p + math.sin(theta) * psi_dot, c_phi * q - s_phi * r, psi_dot


@kernel
def body_rates(phi, theta, phi_dot, theta_dot, psi_dot):
    """Rates about the body axes (rad/s) from those of roll, pitch, heading."""
    s_phi, c_phi = math.sin(phi), math.cos(phi)
    s_theta, c_theta = math.sin(theta), math.cos(theta)
    return (
        phi_dot - s_theta * psi_dot,
        c_phi * theta_dot + s_phi * c_theta * psi_dot,
        -s_phi * theta_dot + c_phi * c_theta * psi_dot,
    )


@kernel
def swap_world(q_w, q_x, q_y, q_z):
    """Quaternion of the same attitude in the other convention: q_NB (FRD) <-> q_EL (FLU).

    With T turning NED into ENU and D turning FRD into FLU, both half-turns,
    q_EL = q_T q_NB q_D. The map is its own inverse up to the sign of the quaternion, which
    stands for the same attitude; the result is given with q_w >= 0.
    """
    w = _HALF_SQRT2 * (q_w + q_z)
    x = _HALF_SQRT2 * (q_x + q_y)
    y = _HALF_SQRT2 * (q_x - q_y)
    z = _HALF_SQRT2 * (q_w - q_z)
    if w < 0.0:
        return -w, -x, -y, -z
    return w, x, y, z


@kernel
def odometry_to_wire(odometry):
    """Odometry as ENU / FLU numbers: position, quaternion w x y z, linear, angular (13)."""
    place = odometry.p_e, odometry.p_n, -odometry.p_d
    attitude = swap_world(odometry.q_w, odometry.q_x, odometry.q_y, odometry.q_z)
    linear = odometry.u, -odometry.v, -odometry.w
    angular = odometry.p, -odometry.q, -odometry.r
    return place + attitude + linear + angular


@kernel
def odometry_from_wire(wire):
    """Odometry from the 13 numbers of ``odometry_to_wire``."""
    p_n, p_e, p_d = wire[1], wire[0], -wire[2]
    q_w, q_x, q_y, q_z = swap_world(wire[3], wire[4], wire[5], wire[6])
    u, v, w = wire[7], -wire[8], -wire[9]
    p, q, r = wire[10], -wire[11], -wire[12]
    return Odometry(p_n, p_e, p_d, q_w, q_x, q_y, q_z, u, v, w, p, q, r)


@kernel
def imu_to_wire(imu):
    """Attitude and rates as ENU / FLU numbers: quaternion w x y z, rates, `NO_RATES` or 0 (8)."""
    q_w, q_x, q_y, q_z = swap_world(imu.q_w, imu.q_x, imu.q_y, imu.q_z)
    rates = 0.0 if imu.has_rates else NO_RATES
    return q_w, q_x, q_y, q_z, imu.p, -imu.q, -imu.r, rates


@kernel
def imu_from_wire(wire):
    """Attitude and rates from the 8 numbers of ``imu_to_wire``."""
    q_w, q_x, q_y, q_z = swap_world(wire[0], wire[1], wire[2], wire[3])
    return Imu(q_w, q_x, q_y, q_z, wire[4], -wire[5], -wire[6], wire[7] >= 0.0)


@kernel
def poses_from_wire(wire):
    """Poses of many messages, float64[n, >= 7] laid out as by ``odometry_to_wire``.

    They are float64[n, 6]: north, east, depth (m), roll, pitch, heading (rad), which are NaN
    where there is `NO_ATTITUDE`.
    """
    poses = np.empty((wire.shape[0], 6))
    for i in range(wire.shape[0]):
        poses[i, 0], poses[i, 1], poses[i, 2] = wire[i, 1], wire[i, 0], -wire[i, 2]
        quaternion = swap_world(wire[i, 3], wire[i, 4], wire[i, 5], wire[i, 6])
        poses[i, 3], poses[i, 4], poses[i, 5] = angles_if_any(quaternion)
    return poses


@kernel
def reference_to_wire(reference):
    """Reference as ENU / FLU numbers, laid out like odometry (13).

    The twist is expressed in the world frame: linear is the desired velocity over ground,
    angular the Euler rates (roll, pitch, yaw) in the ENU sense.
    """
    q = quaternion_from_euler(reference.phi, reference.theta, reference.psi)
    place = reference.p_e, reference.p_n, -reference.p_d
    linear = reference.v_e, reference.v_n, -reference.v_d
    angular = reference.phi_dot, -reference.theta_dot, -reference.psi_dot
    return place + swap_world(q[0], q[1], q[2], q[3]) + linear + angular


@kernel
def reference_from_wire(wire):
    """Reference from the 13 numbers of ``reference_to_wire``."""
    q_w, q_x, q_y, q_z = swap_world(wire[3], wire[4], wire[5], wire[6])
    phi, theta, psi = euler_from_quaternion(q_w, q_x, q_y, q_z)
    p_n, p_e, p_d = wire[1], wire[0], -wire[2]
    v_n, v_e, v_d = wire[8], wire[7], -wire[9]
    phi_dot, theta_dot, psi_dot = wire[10], -wire[11], -wire[12]
    return Reference(p_n, p_e, p_d, phi, theta, psi, v_n, v_e, v_d, phi_dot, theta_dot, psi_dot)


@kernel
def water_to_wire(water):
    """Water velocity as ENU numbers (3)."""
    return water.v_e, water.v_n, -water.v_d


@kernel
def water_from_wire(wire):
    """Water velocity from ENU numbers."""
    return Water(wire[1], wire[0], -wire[2])


@kernel
def covariance_to_wire(covariance):
    """Covariance of a horizontal vector as that of east and north, row by row (4)."""
    return covariance.ee, covariance.ne, covariance.ne, covariance.nn


#: Which numbers of an odometry on the wire are variances of its place, east and north.
VARIANCES = [13, 16]


@kernel
def covariance_from_wire(odom):
    """Covariance of the horizontal place of an odometry, from its numbers."""
    return Covariance(odom[16], odom[14], odom[13])


@kernel
def horizontal_to_wire(vector, covariance):
    """A horizontal vector as its east and north parts, with their covariance (6)."""
    return (vector.e, vector.n) + covariance_to_wire(covariance)


@kernel
def wrench_to_wire(wrench):
    """Demanded force and moments in FLU: force z, torque x, torque y (3)."""
    return -wrench.tau_w, wrench.tau_p, -wrench.tau_q


@kernel
def wrench_from_wire(wire):
    """Demanded force and moments from the 3 numbers of ``wrench_to_wire``."""
    return Wrench(-wire[0], wire[1], -wire[2])


class OriginSettings(Settings):
    """Where the origin of `map` lies on the Earth.

    Latitude and longitude on WGS 84 are turned into metres by an equirectangular projection with
    the two radii of curvature at the origin: exact there, and its own inverse to rounding
    everywhere. Away from the origin lengths eastward are wrong by tan(latitude) north / 6378 km:
    at 36 degrees 0.1 % for 9 km, 1 % for 88 km.
    """

    latitude_deg: float = number(36.0, (-85.0, 85.0), 'Latitude (deg, + north).')
    longitude_deg: float = number(122.0, (-180.0, 180.0), 'Longitude (deg, + east).')
    time: str = Field(
        '', description='Time of the start (UTC, as 2026-03-01T06:00), if anything asks for it.'
    )

    @field_validator('time')
    @classmethod
    def _in_utc(cls, text: str) -> str:
        try:
            moment = datetime.fromisoformat(text.replace('Z', '+00:00')) if text else None
            if moment is not None and moment.tzinfo is not None:
                moment = moment.astimezone(UTC).replace(tzinfo=None)
            if moment is not None and not 1900 <= moment.year < 2200:
                raise ValueError
        except (ValueError, OverflowError):
            raise ValueError(
                'not a time (allowed: as 2026-03-01 or 2026-03-01T06:00Z, of 1900 to 2199)'
            ) from None
        return '' if moment is None else f'{moment.isoformat()}Z'

    @property
    def time_s(self) -> float:
        """Time of the start (s since 1970, UTC); not a number where there is none."""
        if not self.time:
            return math.nan
        return datetime.fromisoformat(self.time[:-1]).replace(tzinfo=UTC).timestamp()

    def params(self) -> 'Origin':
        """Kernel parameters."""
        sine = math.sin(math.radians(self.latitude_deg))
        share = 1.0 - _ECCENTRICITY2 * sine * sine
        meridian = _AXIS * (1.0 - _ECCENTRICITY2) / share**1.5
        parallel = _AXIS / math.sqrt(share) * math.cos(math.radians(self.latitude_deg))
        degree = math.radians(1.0)
        return Origin(self.latitude_deg, self.longitude_deg, meridian * degree, parallel * degree)


class Origin(NamedTuple):
    """The origin as kernels see it."""

    latitude: float  #: (deg)
    longitude: float
    north: float  #: length of a degree (m)
    east: float


@kernel
def on_chart(p_n, p_e, origin):
    """Latitude and longitude (deg) of places north and east of the origin (m), float or arrays.

    The longitude goes on across the date line, so that charts around the origin have no seam.
    """
    return origin.latitude + p_n / origin.north, origin.longitude + p_e / origin.east


@kernel
def to_geodetic(p_n, p_e, origin):
    """Latitude and longitude (deg) of a place north and east of the origin (m)."""
    latitude, longitude = on_chart(p_n, p_e, origin)
    if longitude > 180.0:
        longitude -= 360.0
    elif longitude < -180.0:
        longitude += 360.0
    return latitude, longitude


@kernel
def from_geodetic(latitude, longitude, origin):
    """North and east of the origin (m) of a latitude and a longitude (deg)."""
    d_longitude = longitude - origin.longitude
    if d_longitude > 180.0:
        d_longitude -= 360.0
    elif d_longitude < -180.0:
        d_longitude += 360.0
    return (latitude - origin.latitude) * origin.north, d_longitude * origin.east
