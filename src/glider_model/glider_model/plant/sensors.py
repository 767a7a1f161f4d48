# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""What the vehicle measures: sensors with their errors.

White noise, drawn anew at every tick, is a function of (seed, tick), so that nodes and direct
engine publish the same bits:

    p      = p + n_p
    q_NB   = q(0, 0, n_psi) (x) q_NB (x) q(n_phi, n_theta, 0)
    omega  = omega + n_omega

Heading noise turns about the vertical, roll and pitch noise about the body axes: no attitude is
singular. The velocity over ground keeps its numbers in body axes. Errors that stay are those of
compass and pitch sensor:

    psi_m   = psi + bias + (D_chart - D) + deviation sin(psi - D + phase)
    theta_m = scale theta + offset
    phi_m   = phi + bias

with D the declination: a compass turns in the magnetic field, and the chart gives it its north.
A sensor that is sampled less often than each tick shows its last sample until the next. The
vehicle also says where its actuators are, with noise, and how it is.
"""

import math
from typing import Literal, NamedTuple

import numpy as np
from pydantic import Field

from glider_base.frames import (
    Origin,
    OriginSettings,
    euler_from_quaternion,
    imu_to_wire,
    odometry_to_wire,
    quaternion_from_euler,
    to_geodetic,
)
from glider_base.kernel import kernel, replace
from glider_base.noise import normal_pair, random_stream, uniform
from glider_base.settings import Settings, derived, matching, number
from glider_base.signals import TICK_S, Health, Imu, Joints, Odometry
from glider_base.wiring import ALTIMETER_REACH_M, NO_ECHO, SENSORS
from glider_model.ocean.density import pressure_at

#: Sets the streams of the sensors apart from those of the current, whose offsets are smaller.
_STREAM_OFFSET = 2**32
#: Pairs of random numbers in a tick: nine numbers, and one to spare.
_PAIRS = 5
#: Shallower than this the antenna is out of the water (m).
ANTENNA_M = 0.5
#: The error of a fix stays the same for so many ticks: that of satellites changes slowly.
FIX_ERROR_TICKS = 600
#: Status of a NavSatFix without a fix, and with one.
NO_FIX, HAS_FIX = -1.0, 0.0
#: Pressure in a closed hull below that of the air (Pa): 7 inches of mercury, in the middle of what
#: a Slocum accepts (4 to 12).
VACUUM_PA = 23700.0


class SensorSettings(Settings):
    """Errors of the sensors. Standard deviations are those of white noise."""

    attitude_std_deg: float = number(0.0, (0.0, 10.0), 'noise of roll and of pitch (deg)')
    heading_std_deg: float = number(0.0, (0.0, 45.0), 'noise of the heading (deg)')
    rate_std_dps: float = number(0.0, (0.0, 10.0), 'noise of each angular rate (deg/s)')
    position_std_m: float = number(
        0.0, (0.0, 1000.0), 'noise of depth and, where they are measured, of north and of east (m)'
    )
    compass_bias_deg: float = number(0.0, (-180.0, 180.0), 'error of the heading that stays (deg)')
    compass_deviation_deg: float = number(
        0.0, (-45.0, 45.0), 'error that goes as the sine of the magnetic heading (deg)'
    )
    compass_deviation_phase_deg: float = number(0.0, (-180.0, 180.0), 'phase of that sine (deg)')
    declination_deg: float = number(
        0.0,
        (-180.0, 180.0),
        'declination where it flies: magnetic north lies so far east of north (deg)',
    )
    chart_declination_deg: float | None = number(
        None,
        (-180.0, 180.0),
        'declination that the vehicle goes by (deg); by default the true one',
    )
    pitch_scale: float = number(1.0, (0.5, 1.5), 'measured pitch over true (-)')
    pitch_offset_deg: float = number(
        0.0, (-10.0, 10.0), 'error of pitch that stays (deg, + nose up)'
    )
    roll_bias_deg: float = number(0.0, (-10.0, 10.0), 'error of roll that stays (deg)')
    imu_period_s: float = number(
        0.1, (0.1, 30.0), 'time between two samples of attitude and pressure (s)'
    )
    imu_missed_share: float = number(0.0, (0.0, 0.9), 'share of those samples that drop out (-)')
    gyro: bool = Field(True, description='angular rates are measured')
    depth_offset_m: float = number(0.0, (-50.0, 50.0), 'error of depth that stays (m)')
    depth_resolution_m: float = number(
        0.0, (0.0, 10.0), 'steps in which depth is measured (m); 0: none'
    )
    gps_std_m: float = number(4.0, (0.0, 1000.0), 'error of a fix, north and east each (m)')
    gps_first_fix_s: float = number(
        60.0, (0.0, 3600.0), 'time with the antenna out until the first fix (s)'
    )
    fix_missed_share: float = number(
        0.0, (0.0, 1.0), 'share of surfacings without a fix, at random (-)'
    )
    fix_missed_pattern: str = Field(
        '0',
        pattern=matching('^[01]{1,60}$', '1 to 60 digits, each 0 or 1'),
        description='which surfacings have no fix, over and over from the launch on: 1 has none',
    )
    altimeter_period_s: float = number(
        1.0, (0.1, 600.0), 'time from one echo of the altimeter to the next (s)'
    )
    altimeter_std_m: float = number(0.0, (0.0, 10.0), 'noise of the height over the bottom (m)')
    also_fitted: list[Literal[SENSORS]] = Field(
        [], description='topics of sensors beside those that navigation reads'
    )

    @property
    def charted_deg(self) -> float:
        """Declination that the vehicle goes by (deg, + east)."""
        charted = self.chart_declination_deg
        return self.declination_deg if charted is None else charted

    def params(
        self,
        seed: int,
        origin: OriginSettings | None = None,
        fitted: tuple[str, ...] = SENSORS,
    ) -> 'SensorParams':
        """Kernel parameters for the errors under one seed, for the sensors that are fitted."""
        pattern = self.fix_missed_pattern
        wrong = self.charted_deg - self.declination_deg
        errors = derived(
            ImuErrors,
            self,
            compass_bias=math.radians(self.compass_bias_deg + wrong),
            compass_phase=math.radians(self.compass_deviation_phase_deg - self.declination_deg),
        )
        altimeter = AltimeterParams(
            'altitude' in fitted,
            self.altimeter_std_m,
            round(self.altimeter_period_s / TICK_S),
            np.uint64(random_stream(seed, _STREAM_OFFSET, 2)),
        )
        waits = altimeter.is_fitted and altimeter.period_ticks > 1
        return derived(
            SensorParams,
            self,
            stream=np.uint64(random_stream(seed, _STREAM_OFFSET, 0)),
            errors=errors,
            period_ticks=round(self.imu_period_s / TICK_S),
            gps=GpsParams(
                stream=np.uint64(random_stream(seed, _STREAM_OFFSET, 1)),
                std=self.gps_std_m,
                first_fix_ticks=round(self.gps_first_fix_s / TICK_S),
                missed_share=self.fix_missed_share,
                missed_bits=int(pattern[::-1], 2),
                missed_count=len(pattern),
                origin=(origin or OriginSettings()).params(),
            ),
            altimeter=altimeter,
            has_position='measured_odom' in fitted,
            has_parts=bool({'imu', 'pressure', 'fix'} & set(fitted)),
            is_held=self.imu_period_s > TICK_S or self.imu_missed_share > 0.0 or waits,
        )


class ImuErrors(NamedTuple):
    """Errors of compass and tilt sensor that stay (rad; scale -)."""

    compass_bias: float
    compass_deviation: float
    compass_phase: float
    pitch_scale: float
    pitch_offset: float
    roll_bias: float


class GpsParams(NamedTuple):
    """The receiver as the kernels see it."""

    stream: np.uint64  #: start of the random stream
    std: float  #: (m)
    first_fix_ticks: int
    missed_share: float
    missed_bits: int  #: pattern of surfacings without a fix, and its length
    missed_count: int
    origin: Origin


class AltimeterParams(NamedTuple):
    """The altimeter as the kernels see it."""

    is_fitted: bool
    std: float  #: (m)
    period_ticks: int  #: from one echo to the next
    stream: np.uint64  #: start of the random stream


class SensorParams(NamedTuple):
    """Sensors as the kernels see them."""

    stream: np.uint64  #: start of the random stream
    attitude_std: float  #: standard deviations (rad, rad, rad/s, m)
    heading_std: float
    rate_std: float
    position_std: float
    errors: ImuErrors
    period_ticks: int  #: from sample to sample
    imu_missed_share: float
    gyro: bool
    depth_offset: float  #: (m)
    depth_resolution: float
    gps: GpsParams
    altimeter: AltimeterParams
    has_position: bool  #: measured_odom is fitted
    has_parts: bool  #: imu, pressure and fix are
    is_held: bool  #: samples are shown for longer than a tick


class Sample(NamedTuple):
    """The last sample of attitude, rates, depth and height over the bottom (m)."""

    q_w: float
    q_x: float
    q_y: float
    q_z: float
    p: float
    q: float
    r: float
    p_d: float
    altitude: float


#: What stands in the place of sensors that are not fitted.
NO_POSITION, NO_IMU = 13 * (0.0,), 8 * (0.0,)
NO_SAMPLE = Sample(
    q_w=1.0, q_x=0.0, q_y=0.0, q_z=0.0, p=0.0, q=0.0, r=0.0, p_d=0.0, altitude=NO_ECHO
)


class Noise(NamedTuple):
    """Noise of one tick (m, rad, rad/s)."""

    p_n: float
    p_e: float
    p_d: float
    phi: float
    theta: float
    psi: float
    p: float
    q: float
    r: float


@kernel
def is_noisy(params):
    """Whether there is any noise."""
    angles = params.attitude_std > 0.0 or params.heading_std > 0.0
    return angles or params.rate_std > 0.0 or params.position_std > 0.0


@kernel
def noise_of_tick(tick, params):
    """Noise that belongs to a tick."""
    first = np.uint64(_PAIRS) * np.uint64(tick)
    n_1, n_2 = normal_pair(params.stream, first)
    n_3, n_4 = normal_pair(params.stream, first + np.uint64(1))
    n_5, n_6 = normal_pair(params.stream, first + np.uint64(2))
    n_7, n_8 = normal_pair(params.stream, first + np.uint64(3))
    n_9, _ = normal_pair(params.stream, first + np.uint64(4))
    return Noise(
        p_n=params.position_std * n_1,
        p_e=params.position_std * n_2,
        p_d=params.position_std * n_3,
        phi=params.attitude_std * n_4,
        theta=params.attitude_std * n_5,
        psi=params.heading_std * n_6,
        p=params.rate_std * n_7,
        q=params.rate_std * n_8,
        r=params.rate_std * n_9,
    )


@kernel
def _product(a, b):
    """Product of two quaternions."""
    return (
        a[0] * b[0] - a[1] * b[1] - a[2] * b[2] - a[3] * b[3],
        a[0] * b[1] + a[1] * b[0] + a[2] * b[3] - a[3] * b[2],
        a[0] * b[2] - a[1] * b[3] + a[2] * b[0] + a[3] * b[1],
        a[0] * b[3] + a[1] * b[2] - a[2] * b[1] + a[3] * b[0],
    )


@kernel
def add_noise(odometry: Odometry, tick: int, params: SensorParams) -> Odometry:
    """Odometry of the vehicle with the noise of a tick; without noise the very same numbers."""
    if not is_noisy(params):
        return odometry
    x, n = odometry, noise_of_tick(tick, params)
    heading = quaternion_from_euler(0.0, 0.0, n.psi)
    tilt = quaternion_from_euler(n.phi, n.theta, 0.0)
    q = _product(_product(heading, (x.q_w, x.q_x, x.q_y, x.q_z)), tilt)
    return replace(
        x,
        p_n=x.p_n + n.p_n,
        p_e=x.p_e + n.p_e,
        p_d=x.p_d + n.p_d,
        q_w=q[0],
        q_x=q[1],
        q_y=q[2],
        q_z=q[3],
        p=x.p + n.p,
        q=x.q + n.q,
        r=x.r + n.r,
    )


@kernel
def _with_errors(q_w, q_x, q_y, q_z, errors):
    """Attitude with the errors that stay; without any the very same numbers."""
    e = errors
    if (
        e.compass_bias == 0.0
        and e.compass_deviation == 0.0
        and e.pitch_scale == 1.0
        and e.pitch_offset == 0.0
        and e.roll_bias == 0.0
    ):
        return q_w, q_x, q_y, q_z
    phi, theta, psi = euler_from_quaternion(q_w, q_x, q_y, q_z)
    return quaternion_from_euler(
        phi + e.roll_bias,
        e.pitch_scale * theta + e.pitch_offset,
        psi + e.compass_bias + e.compass_deviation * math.sin(psi + e.compass_phase),
    )


@kernel
def _is_sampled(tick, params):
    """Whether attitude and pressure are sampled at a tick."""
    if tick % params.period_ticks != 0:
        return False
    if params.imu_missed_share <= 0.0 or tick == 0:
        return True
    return uniform(params.gps.stream, np.uint64(2 * tick + 1)) >= params.imu_missed_share


@kernel
def echo(height, tick, params):
    """Measured height over the bottom, of a true one (m), as a float32; `NO_ECHO` out of reach."""
    if params.std > 0.0:
        noise, _ = normal_pair(params.stream, np.uint64(tick))
        height += params.std * noise
    if height < ALTIMETER_REACH_M[0] or height > ALTIMETER_REACH_M[1]:
        return NO_ECHO
    return float(np.float32(height))


@kernel
def take_sample(
    measured: Odometry, height: float, sample: Sample, tick: int, params: SensorParams
) -> Sample:
    """What of a `Sample` is shown at a tick: each part is new, or that of the tick before.

    ``measured`` has noise, ``height`` is the true one over the bottom (m).
    """
    altitude = sample.altitude
    if params.altimeter.is_fitted and tick % params.altimeter.period_ticks == 0:
        altitude = echo(height, tick, params.altimeter)
    if not _is_sampled(tick, params):
        return replace(sample, altitude=altitude)
    x = measured
    q_w, q_x, q_y, q_z = _with_errors(x.q_w, x.q_x, x.q_y, x.q_z, params.errors)
    shown = x.p_d
    if params.depth_offset != 0.0:
        shown += params.depth_offset
    if params.depth_resolution > 0.0:
        shown = params.depth_resolution * math.floor(shown / params.depth_resolution + 0.5)
    p, q, r = (x.p, x.q, x.r) if params.gyro else (0.0, 0.0, 0.0)
    return Sample(q_w=q_w, q_x=q_x, q_y=q_y, q_z=q_z, p=p, q=q, r=r, p_d=shown, altitude=altitude)


@kernel
def _take_fix(odometry, out_ticks, surfacings, tick, params):
    """Numbers of the topic fix at a tick, by the true place of the vehicle."""
    gps = params.gps
    bit = np.int64(1) << np.int64(surfacings % gps.missed_count)
    missed = (np.int64(gps.missed_bits) & bit) != 0 or (
        uniform(gps.stream, np.uint64(2 * surfacings)) < gps.missed_share
    )
    if odometry.p_d > ANTENNA_M or out_ticks < gps.first_fix_ticks or missed:
        return NO_FIX, 0.0, 0.0, 0.0, 0.0
    n_n, n_e = normal_pair(gps.stream, np.uint64(tick // FIX_ERROR_TICKS))
    latitude, longitude = to_geodetic(
        odometry.p_n + gps.std * n_n, odometry.p_e + gps.std * n_e, gps.origin
    )
    return HAS_FIX, latitude, longitude, gps.std * gps.std, gps.std * gps.std


@kernel
def sense(odometry, height, joints, sample, out_ticks, surfacings, tick, params):
    """What the vehicle measures at a tick, for the topics of the plant.

    Numbers on the wire, in the order of the plant's outputs in `glider_base.wiring`, but for
    health and battery; zeros for what is not fitted. The odometry is the true one, as is the
    height over the bottom (m); ``joints`` is where the actuators say they are, ``sample``
    (`Sample`) that of the tick before. The antenna has been out of the water for
    ``out_ticks`` without a break.
    """
    truth = odometry_to_wire(odometry)
    measured = add_noise(odometry, tick, params)
    x = take_sample(measured, height, sample, tick, params)
    position, imu, pressure = NO_POSITION, NO_IMU, 0.0
    fix = (NO_FIX, 0.0, 0.0, 0.0, 0.0)
    if params.has_position:
        shown = replace(measured, p_d=x.p_d, q_w=x.q_w, q_x=x.q_x, q_y=x.q_y, q_z=x.q_z)
        position = odometry_to_wire(replace(shown, p=x.p, q=x.q, r=x.r))
    if params.has_parts:
        imu = imu_to_wire(Imu(x.q_w, x.q_x, x.q_y, x.q_z, x.p, x.q, x.r, params.gyro))
        pressure = pressure_at(x.p_d)
        fix = _take_fix(odometry, out_ticks, surfacings, tick, params)
    return (
        truth,
        position,
        imu,
        (pressure,),
        fix,
        (x.altitude,),
        (joints.m_b, joints.x_p, joints.mu, joints.delta),
    )


class Readings(NamedTuple):
    """Noise of the positions as the kernels see it."""

    stream: np.uint64  #: start of the random stream
    std: Joints  #: standard deviations (kg, m, rad, rad)
    is_noisy: bool  #: any of them is > 0


def make_readings(vehicle, seed: int) -> Readings:
    """Noise of the actuators of a vehicle (`VehicleParams`) under one seed."""
    std = vehicle.errors.noise
    return Readings(np.uint64(random_stream(seed, _STREAM_OFFSET, 3)), std, any(std))


@kernel
def noise_of_readings(tick, params):
    """Noise of the positions at a tick (kg, m, rad, rad)."""
    first = np.uint64(2) * np.uint64(tick)
    n_1, n_2 = normal_pair(params.stream, first)
    n_3, n_4 = normal_pair(params.stream, first + np.uint64(1))
    std = params.std
    return Joints(std.m_b * n_1, std.x_p * n_2, std.mu * n_3, std.delta * n_4)


@kernel
def read(joints, tick, params):
    """Where actuators that are at ``joints`` say that they are; without noise the very same."""
    if not params.is_noisy:
        return joints
    n = noise_of_readings(tick, params)
    return Joints(joints.m_b + n.m_b, joints.x_p + n.x_p, joints.mu + n.mu, joints.delta + n.delta)


@kernel
def health_of(state):
    """What the health sensors of a vehicle say at a tick (`Health`), all well but for contact."""
    return Health(0.0, VACUUM_PA, state.surfacing.silent_ticks * TICK_S)
