# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""Position is measured, as by acoustics and a Doppler log: what is measured is the estimate.

Who acts on odometry has a gate of his own, so that it is handed on as it is.

Where attitude is sampled less often than each tick, or rates are not measured, both are made of
the samples; see `glider_navigation.attitude`.
"""

from typing import ClassVar, NamedTuple

from glider_base.frames import odometry_to_wire, quaternion_from_euler
from glider_base.kernel import kernel, replace
from glider_base.signals import TICK_S, Imu, Vector
from glider_model.onboard.moving_mass import MovingMass, make_moving_mass
from glider_navigation.attitude import AttitudeState, attitude_step, initial_attitude
from glider_navigation.method import NONE, Estimate, NavigationMethodSettings, Start, method_step
from glider_navigation.phase import KNOWN


class KnownSettings(NavigationMethodSettings):
    """Position is measured in every tick."""

    reads: ClassVar[tuple[str, ...]] = ('measured_odom',)

    def params(self, start: Start) -> 'KnownParams':
        """Kernel parameters."""
        as_measured = start.gyro and start.imu_period_s <= TICK_S
        return KnownParams(as_measured, start.gyro, make_moving_mass(start.vehicle.params()))

    def initial_state(self, start: Start) -> 'KnownState':
        """Nothing is kept of what is measured in every tick."""
        return KnownState(initial_attitude(start.vehicle))


class KnownParams(NamedTuple):
    """What of the odometry can be taken as it is."""

    as_measured: bool  #: all of it
    gyro: bool  #: rates are measured
    mass: MovingMass


class KnownState(NamedTuple):
    """What is kept from tick to tick."""

    attitude: AttitudeState


_STILL = Vector(0.0, 0.0)
_BELIEVED = Estimate(13 * (0.0,), NONE, _STILL, NONE, _STILL, NONE, KNOWN)


@method_step.body(KnownParams)
@kernel
def known_step(state, received, params, dt):
    """Take what is measured; see `method_step`."""
    odom, attitude = received.odom, state.attitude
    if not params.as_measured:
        x = received.odometry
        imu = Imu(
            q_w=x.q_w, q_x=x.q_x, q_y=x.q_y, q_z=x.q_z, p=x.p, q=x.q, r=x.r, has_rates=params.gyro
        )
        attitude, now, _ = attitude_step(state.attitude, imu, received.joints, params.mass, dt)
        q = quaternion_from_euler(now.angles.phi, now.angles.theta, now.angles.psi)
        odom = odometry_to_wire(
            replace(x, q_w=q[0], q_x=q[1], q_y=q[2], q_z=q[3], p=now.p, q=now.q, r=now.r)
        )
    return KnownState(attitude), replace(_BELIEVED, odom=odom)
