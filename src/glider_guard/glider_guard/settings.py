# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""Settings of the guard, and the params of its kernel by them."""

import math

from pydantic import Field

from glider_base.settings import Settings, derived, number, positive
from glider_base.signals import Joints
from glider_guard.actuators import make_limits
from glider_guard.ascent import AscentLimits
from glider_guard.depth import DepthLimits
from glider_guard.guard import INITIAL_GUARD, GuardParams, GuardState, HealthLimits
from glider_guard.weight import ARRIVED, WeightLimits
from glider_guard.witness import WitnessLimits
from glider_model.onboard.gate import GateSettings
from glider_model.onboard.glide_polar import make_polar
from glider_model.onboard.moving_mass import make_moving_mass
from glider_model.vehicle.actuators import doubt
from glider_model.vehicle.file import load_vehicle

#: Whether the depth stays the same is seen in its average over this time (s), and so many samples:
#: longer than noise lasts, and shorter than a yo by a pump that is too slow for it, whose swing
#: would be lost.
STALL_MEAN_S, STALL_SAMPLES = 3.0, 2.0
#: What is as improbable as this does not happen.
RARE = 1e-9
#: No two samples differ by so many standard deviations of the noise of the depth for long.
JUMP_STDS = 5.0
#: Share of a battery of which all is usable that is as good as nothing (-).
EMPTY = 1e-6


class GuardLimitSettings(Settings):
    """When the guard acts, whatever the vehicle: the guard section of a scenario."""

    gate: GateSettings = Field(GateSettings(), description='odometry that is refused')
    follow_share: float = positive(
        0.02, 1.0, 'an actuator is where it was sent within this share of its range (-)'
    )
    stall_s: float = number(
        60.0,
        (1.0, 3600.0),
        'time in which an actuator has to go as much, or a tenth of what its rate allows (s)',
    )
    depth_margin_share: float = number(
        0.04, (0.0, 1.0), 'share of rated_depth by which a turn may overshoot it (-)'
    )
    depth_margin_m: float = number(15.0, (0.0, 1000.0), 'the same, at least this (m)')
    overdepth_share: float = number(
        0.25, (0.0, 10.0), 'share of the deepest target that is overdepth (-)'
    )
    overdepth_m: float = number(100.0, (1.0, 12000.0), 'the same, at least this (m)')
    overdepth_s: float = number(30.0, (0.0, 3600.0), 'for longer than this (s)')
    altitude_min_m: float = number(
        3.0,
        (0.0, 100.0),
        'least height over the bottom, where there is an altimeter (m); 0.0: any',
    )
    altitude_s: float = number(
        2.0, (0.0, 3600.0), 'an echo of the bottom lasts longer than this (s)'
    )
    climb_progress_m: float = number(5.0, (0.5, 100.0), 'way upward that counts as progress (m)')
    no_climb_s: float = number(
        900.0,
        (60.0, 86400.0),
        'a vehicle sent up that makes no progress for so long does not climb (s)',
    )
    drop_after_s: float = number(
        1200.0, (600.0, 86400.0), 'the same, surfacing for good: the weight is let go (s)'
    )
    drop_blind_s: float = number(
        1200.0,
        (600.0, 86400.0),
        'the same where the depth is not to be trusted, beside the time of the way up (s)',
    )
    climb_mps: float = number(
        0.15,
        (0.01, 1.0),
        'surfacing for good it is up in the time that its depth takes at this rate, and one of '
        'those two (m/s)',
    )
    stalled_m: float = number(5.0, (0.5, 100.0), 'depth that changes by less stays the same (m)')
    stalled_s: float = number(1800.0, (0.0, 1e6), 'longest time at the same depth (s); 0.0: any')
    under_water_s: float = number(0.0, (0.0, 1e8), 'longest time under water (s); 0.0: any')
    lag_share: float = number(
        0.5,
        (0.05, 1.0),
        'share of the way by the measured vertical rate that the depth may lag behind (-)',
    )
    lag_m: float = number(10.0, (1.0, 1000.0), 'the same, at least this (m)')
    led_m: float = number(
        60.0,
        (5.0, 1000.0),
        'way that pump and pitch lead while the depth rests within a metre, or a quarter of a '
        'way down (m), as in a stall that control ends',
    )
    jump_m: float = number(
        5.0, (1.0, 1000.0), 'under water a depth that jumps by more, and stays there, is wrong (m)'
    )
    offset_max_m: float = number(
        20.0, (2.0, 1000.0), 'so much a depth may be off at the surface, and is corrected (m)'
    )
    weight_share: float = number(
        0.98,
        (0.05, 10.0),
        'share of the range of the pump by which the vehicle may be heavier than pump and ballast '
        'make it (-)',
    )
    weight_s: float = number(300.0, (10.0, 1e5), 'time over which its weight is averaged (s)')
    still_s: float = number(30.0, (1.0, 1e5), 'under water nothing measured moves for so long (s)')
    disagree_m: float = number(20.0, (1.0, 1000.0), 'by so much odom and pressure may differ (m)')
    disagree_s: float = number(30.0, (0.0, 3600.0), 'for no longer than this (s)')
    vacuum_min_pa: float = number(
        13500.0, (0.0, 101325.0), 'least vacuum in the hull (Pa); 4 inHg'
    )
    vacuum_max_pa: float = number(
        40600.0, (0.0, 101325.0), 'most vacuum in the hull (Pa); 12 inHg'
    )
    battery_min_v: float = number(10.0, (0.0, 1000.0), 'least voltage of the battery (V)')
    health_s: float = number(
        10.0, (0.0, 3600.0), 'leak, vacuum and battery are trusted after so long (s)'
    )
    contact_s: float = number(
        259200.0, (0.0, 1e8), 'longest time without the antenna out of the water (s); 0.0: any'
    )

    def margin_m(self, rated_m: float) -> float:
        """Way (m) by which a turn may overshoot the rated depth (m)."""
        share = self.depth_margin_share * rated_m if math.isfinite(rated_m) else 0.0
        return max(self.depth_margin_m, share)


class GuardSettings(GuardLimitSettings):
    """Everything the guard node is set to."""

    vehicle: str = Field('zhang2021', description='vehicle: ranges and rates, depths, weight')
    pressure: bool = Field(False, description='there is a depth apart from that of odom')
    altitude: bool = Field(False, description='there is an altimeter')
    imu_period_s: float = number(0.1, (0.1, 30.0), 'time between two samples of the pressure (s)')
    imu_missed_share: float = number(0.0, (0.0, 0.9), 'share of those samples that drop out (-)')
    depth_resolution_m: float = number(
        0.0, (0.0, 10.0), 'steps in which depth is measured (m); 0: none'
    )
    position_std_m: float = number(0.0, (0.0, 1000.0), 'noise of the depth (m)')
    lost_after_s: float = number(
        10.0,
        (0.1, 3600.0),
        'free-running: an input that has been stale for so long is lost, and the vehicle surfaces '
        'for good (s)',
    )

    @property
    def topics(self) -> tuple[str, ...]:
        """Those of the topics that not every run has that it reads."""
        return tuple(name for name in ('pressure', 'altitude') if getattr(self, name))

    @property
    def _gap_s(self) -> float:
        """Time (s) within which there is a sample of the depth, as good as for certain."""
        if self.imu_missed_share == 0.0:
            return self.imu_period_s
        return self.imu_period_s * math.ceil(math.log(RARE) / math.log(self.imu_missed_share))

    def params(self) -> GuardParams:
        """Kernel parameters."""
        vehicle = load_vehicle(self.vehicle)
        energy = vehicle.energy
        limits, rated_m, gate = vehicle.params(), vehicle.rated_depth_m, self.gate.params()
        off, slowest = doubt(limits.errors), vehicle.slowest_pump_rate(rated_m)
        return GuardParams(
            gate=gate,
            actuators=make_limits(limits, self.follow_share, self.stall_s),
            depth=derived(
                DepthLimits,
                self,
                rated=rated_m,
                margin=self.margin_m(rated_m),
                crush=vehicle.crush_depth_m,
                drop_margin=vehicle.drop_margin_m,
                led_m=self.led_m + 6.0 * self.depth_resolution_m,
                stalled_s=self.stalled_s or math.inf,
                stall_mean_s=max(STALL_MEAN_S, STALL_SAMPLES * self.imu_period_s),
                under_water_s=self.under_water_s or math.inf,
                jump_m=gate.depth_jump,
            ),
            health=derived(
                HealthLimits,
                self,
                reserve=max(1.0 - energy.usable.value, EMPTY) if energy else 0.0,
                contact_s=self.contact_s or math.inf,
            ),
            weight=WeightLimits(
                polar=make_polar(limits),
                ballast=limits.ballast,
                most=self.weight_share * limits.m_b_max,
                average_s=self.weight_s,
                arrived=max(ARRIVED * limits.m_b_max, off.m_b),
                rate=slowest,
                range=limits.m_b_max,
            ),
            has_pressure=self.pressure,
            ascent=AscentLimits(
                Joints(-limits.m_b_max, -limits.x_p_max, 0.0, 0.0),
                max((ARRIVED - 1.0) * limits.m_b_max, off.m_b - limits.m_b_max),
                2.0 * limits.m_b_max / slowest,
                make_moving_mass(limits),
                max(ARRIVED * limits.x_p_max, off.x_p),
            ),
            witness=WitnessLimits(
                same_s=self.still_s + self._gap_s,
                is_rough=self.depth_resolution_m > 0.0,
                led_m=self.lag_m + 3.0 * self.depth_resolution_m,
                jump_m=self.jump_m
                + 2.0 * self.depth_resolution_m
                + JUMP_STDS * self.position_std_m,
                hold_s=gate.hold_s + self._gap_s,
                settled_s=4.0 * self.imu_period_s,
                offset_m=self.offset_max_m,
                has_rate=not self.pressure,
            ),
        )

    def initial_state(self) -> GuardState:
        """State before the first tick."""
        return INITIAL_GUARD
