# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""What a navigation method is: settings, params, state, and a kernel that fills `method_step`.

A method makes the odometry that guidance and control act on, of what the sensors say.
"""

from typing import TYPE_CHECKING, ClassVar, NamedTuple

from glider_base.frames import Origin
from glider_base.settings import Settings
from glider_base.signals import Covariance, Imu, Joints, Odometry, Vector
from glider_base.slot import returns, slot
from glider_model.vehicle.file import Vehicle

if TYPE_CHECKING:  # it loads the fields of packages, in whose file a method may be
    from glider_navigation.forecast import ForecastSettings


class Start(NamedTuple):
    """What is known before the first tick."""

    vehicle: Vehicle
    origin: Origin
    p_n: float  #: where the vehicle is put into the water (m)
    p_e: float
    imu_period_s: float
    gyro: bool
    current: str  #: how the current is to be estimated
    forecast: 'ForecastSettings'  #: of it


class NavigationMethodSettings(Settings):
    """Settings of a navigation method; every field has a default.

    A subclass is called by the name of its file in `glider_navigation.methods`, or by that of its
    entry point in the group ``glider.navigation_methods``. Its fields are those of
    ``navigation.NAME``; the first line of its docstring says what it does.
    """

    #: Topics of sensors that it needs, of `glider_base.wiring.SENSORS`.
    reads: ClassVar[tuple[str, ...]] = ()
    #: Topics that it fills beside odom, of `glider_base.wiring.ESTIMATES`.
    tells: ClassVar[tuple[str, ...]] = ()

    def params(self, start: Start) -> NamedTuple:
        """Kernel parameters, of a type of the method's own."""
        raise NotImplementedError

    def initial_state(self, start: Start) -> NamedTuple:
        """State before the first tick, of the type that `method_step` returns."""
        raise NotImplementedError


class Fix(NamedTuple):
    """A place by satellite, relative to the origin (m)."""

    is_fix: bool
    p_n: float
    p_e: float
    variance: float  #: north and east each (m^2)


class Received(NamedTuple):
    """What the sensors say at a tick; zero for what is not fitted.

    A sensor that is sampled less often shows its last sample again.
    """

    joints: Joints
    odom: tuple[float, ...]  #: measured_odom as on the wire, whatever is in it
    odometry: Odometry  #: the same, as far as it is plausible
    imu: Imu
    depth: float  #: (m)
    fix: Fix
    altitude: float  #: height over the bottom (m); 0.0: no echo


class Estimate(NamedTuple):
    """What navigation estimates."""

    odom: tuple[float, ...]  #: odometry as on the wire
    place: Covariance  #: of its horizontal position (m^2)
    current: Vector  #: mean of the water column (m/s)
    current_covariance: Covariance
    surface: Vector  #: current at the surface, the drift of wind included (m/s)
    surface_covariance: Covariance
    phase: int  #: of `glider_navigation.phase`


NONE = Covariance(0.0, 0.0, 0.0)


@slot
@returns('state after the tick', Estimate)
def method_step(state, received, params, dt):
    """One tick of a navigation method, of ``dt`` s, by the type of its params.

    They are those of `NavigationMethodSettings.params`; what it has received is a `Received`.
    """
