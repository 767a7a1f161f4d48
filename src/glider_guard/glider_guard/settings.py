# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""Settings of the guard, and what its kernel is told by them."""

import math

from pydantic import Field

from glider_guard.actuators import INITIAL_FOLLOWERS, make_limits
from glider_guard.ascent import INITIAL_ASCENT, AscentLimits
from glider_guard.depth import INITIAL_DEPTHS, DepthLimits
from glider_guard.guard import GuardParams, GuardState, Taken
from glider_guard.health import INITIAL_HEALTH, HealthLimits
from glider_guard.weight import INITIAL_WEIGHT, PUMP_ARRIVED, WeightLimits
from glider_model.base.settings import Settings
from glider_model.base.signals import Joints
from glider_model.onboard.gate import INITIAL_GATE, GateSettings
from glider_model.onboard.glide_polar import make_polar
from glider_model.vehicle.actuators import doubt
from glider_model.vehicle.file import load_vehicle


class GuardLimitSettings(Settings):
    """When the guard acts, whatever the vehicle: the guard section of a scenario."""

    gate: GateSettings = Field(GateSettings(), description='odometry that is refused')
    follow_share: float = Field(
        0.02,
        gt=0.0,
        le=1.0,
        description='an actuator is where it was sent within this share of its range (-)',
    )
    stall_s: float = Field(
        60.0,
        ge=1.0,
        le=3600.0,
        description='time in which an actuator has to go as much, or a tenth of what its rate '
        'allows (s)',
    )
    depth_margin_m: float = Field(
        15.0, ge=0.0, le=1000.0, description='way by which a turn may overshoot rated_depth (m)'
    )
    overdepth_share: float = Field(
        0.25, ge=0.0, le=10.0, description='share of the deepest target that is overdepth (-)'
    )
    overdepth_m: float = Field(
        100.0, ge=1.0, le=12000.0, description='the same, at least this (m)'
    )
    overdepth_s: float = Field(30.0, ge=0.0, le=3600.0, description='for longer than this (s)')
    altitude_min_m: float = Field(
        3.0,
        ge=0.0,
        le=100.0,
        description='least height over the bottom, where there is an altimeter (m); 0.0: any',
    )
    altitude_s: float = Field(
        2.0, ge=0.0, le=3600.0, description='the bottom is heard for longer than this (s)'
    )
    climb_progress_m: float = Field(
        5.0, ge=0.5, le=100.0, description='way upward that counts as progress (m)'
    )
    no_climb_s: float = Field(
        900.0,
        ge=60.0,
        le=86400.0,
        description='a vehicle sent up that makes no progress for so long does not climb (s)',
    )
    drop_after_s: float = Field(
        1200.0,
        ge=600.0,
        le=86400.0,
        description='the same, surfacing for good: the weight is let go (s)',
    )
    drop_blind_s: float = Field(
        14400.0,
        ge=600.0,
        le=86400.0,
        description='the same where the depth is not to be believed (s)',
    )
    stalled_m: float = Field(
        5.0, ge=0.5, le=100.0, description='depth that changes by less stays the same (m)'
    )
    stalled_s: float = Field(
        1800.0, ge=0.0, le=1e6, description='longest time at the same depth (s); 0.0: any'
    )
    under_water_s: float = Field(
        0.0, ge=0.0, le=1e8, description='longest time under water (s); 0.0: any'
    )
    lag_share: float = Field(
        0.5,
        ge=0.05,
        le=1.0,
        description='share of the way by the measured vertical rate that the depth may lag behind '
        '(-)',
    )
    lag_m: float = Field(10.0, ge=1.0, le=1000.0, description='the same, at least this (m)')
    weight_share: float = Field(
        0.8,
        ge=0.05,
        le=10.0,
        description='share of the range of the pump by which the vehicle may be heavier than pump '
        'and ballast make it (-)',
    )
    weight_s: float = Field(
        300.0, ge=10.0, le=1e5, description='time over which its weight is averaged (s)'
    )
    still_s: float = Field(
        30.0, ge=1.0, le=1e5, description='under water nothing measured moves for so long (s)'
    )
    disagree_m: float = Field(
        20.0, ge=1.0, le=1000.0, description='by so much odom and pressure may differ (m)'
    )
    disagree_s: float = Field(30.0, ge=0.0, le=3600.0, description='for no longer than this (s)')
    vacuum_min_pa: float = Field(
        13500.0, ge=0.0, le=101325.0, description='least vacuum in the hull (Pa); 4 inHg'
    )
    vacuum_max_pa: float = Field(
        40600.0, ge=0.0, le=101325.0, description='most vacuum in the hull (Pa); 12 inHg'
    )
    battery_min_v: float = Field(
        10.0, ge=0.0, le=1000.0, description='least voltage of the battery (V)'
    )
    health_s: float = Field(
        10.0,
        ge=0.0,
        le=3600.0,
        description='leak, vacuum and battery are believed after so long (s)',
    )
    contact_s: float = Field(
        259200.0,
        ge=0.0,
        le=1e8,
        description='longest time without the antenna out of the water (s); 0.0: any',
    )


class GuardSettings(GuardLimitSettings):
    """Everything the guard node is told."""

    vehicle: str = Field('zhang2021', description='vehicle: ranges and rates, depths, weight')
    pressure: bool = Field(False, description='there is a depth apart from that of odom')
    altitude: bool = Field(False, description='there is an altimeter')
    imu_period_s: float = Field(
        0.1, ge=0.1, le=30.0, description='time between two samples of the pressure (s)'
    )
    lost_after_s: float = Field(
        10.0,
        ge=0.1,
        le=3600.0,
        description='free-running: an input that has been stale for so long is lost, and the '
        'vehicle surfaces for good (s)',
    )

    @property
    def topics(self) -> tuple[str, ...]:
        """Those of the topics that not every run has that it reads."""
        return tuple(name for name in ('pressure', 'altitude') if getattr(self, name))

    def params(self) -> GuardParams:
        """Kernel parameters."""
        vehicle = load_vehicle(self.vehicle)
        limits, rated_m, gate = vehicle.params(), vehicle.rated_depth_m, self.gate.params()
        off, slowest = doubt(limits.errors), vehicle.slowest_pump_rate(rated_m)
        return GuardParams(
            gate,
            make_limits(limits, self.follow_share, self.stall_s),
            DepthLimits(
                rated_m,
                self.depth_margin_m,
                vehicle.crush_depth_m,
                self.overdepth_share,
                self.overdepth_m,
                self.overdepth_s,
                self.altitude_min_m,
                self.altitude_s,
                self.climb_progress_m,
                self.no_climb_s,
                self.drop_after_s,
                max(self.drop_after_s, self.drop_blind_s),
                self.stalled_m,
                self.stalled_s or math.inf,
                self.under_water_s or math.inf,
                self.lag_m,
                self.lag_share,
                self.still_s,
                gate.depth_jump,
                self.disagree_m,
                self.disagree_s,
            ),
            HealthLimits(
                self.vacuum_min_pa,
                self.vacuum_max_pa,
                self.battery_min_v,
                1.0 - vehicle.energy.usable.value if vehicle.energy else 0.0,
                self.contact_s or math.inf,
                self.health_s,
            ),
            WeightLimits(
                make_polar(limits),
                limits.ballast,
                self.weight_share * limits.m_b_max,
                self.weight_s,
                max(PUMP_ARRIVED * limits.m_b_max, off.m_b),
                slowest,
            ),
            self.pressure,
            AscentLimits(
                Joints(-limits.m_b_max, -limits.x_p_max, 0.0, 0.0),
                max((PUMP_ARRIVED - 1.0) * limits.m_b_max, off.m_b - limits.m_b_max),
                2.0 * limits.m_b_max / slowest,
            ),
        )

    def initial_state(self) -> GuardState:
        """State before the first tick."""
        rest = Joints(0.0, 0.0, 0.0, 0.0)
        taken = Taken(INITIAL_GATE, rest, 0.0, rest, 0.0, 0.0, 0.0, 0.0)
        return GuardState(
            0,
            taken,
            INITIAL_FOLLOWERS,
            INITIAL_DEPTHS,
            INITIAL_HEALTH,
            INITIAL_WEIGHT,
            INITIAL_ASCENT,
            rest,
            0,
        )
