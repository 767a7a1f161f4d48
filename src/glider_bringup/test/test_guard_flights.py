# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""Flights with faults, judged by where the vehicle truly is: nobody sinks who has the means."""

from typing import NamedTuple

import numpy as np
import pytest

from glider_base.signals import TICK_S
from glider_bringup.engines.direct import fly_blocks
from glider_bringup.engines.flight import mission_of
from glider_guard import rows
from glider_guard.weight import LEVEL_M, LEVEL_S
from glider_mission.blocks import COLUMNS
from glider_mission.scenario import load_scenario
from glider_model.vehicle.file import load_vehicle

#: Shallower than this is at the surface (m).
AT_SURFACE_M = 2.0
RECKONED = {'navigation.method': 'dead_reckoned', 'profile.surface_every_dives': 1}
NOISE = {
    'attitude_std_deg': 0.2,
    'heading_std_deg': 0.5,
    'rate_std_dps': 0.1,
    'position_std_m': 1.0,
}


class Flown(NamedTuple):
    """True depth (m), rows and whether the weight has been let go, tick by tick."""

    depth: np.ndarray
    told: np.ndarray
    drops: np.ndarray

    def first(self, row: int) -> float:
        """When a row was told first (s); infinite: never."""
        holds = (self.told & row) != 0
        return float(np.argmax(holds)) * TICK_S if holds.any() else np.inf

    def dropped_at(self) -> float:
        """Depth at which the weight was let go (m); NaN: it was not."""
        return float(self.depth[np.argmax(self.drops)]) if self.drops.any() else np.nan


def fly(name, duration_s, faults=(), **changes):
    """Fly a scenario with some faults."""
    fields = {'duration_s': duration_s, 'faults': list(faults), **changes}
    logs = [
        log[
            :, [COLUMNS['ground_truth/odom'].start + 2, COLUMNS['guard'], *_columns('drop_weight')]
        ]
        for log in fly_blocks(*mission_of(load_scenario(name, fields)))
    ]
    depth, told, drops = np.concatenate(logs).T
    return Flown(-depth, told.astype(np.int64), drops > 0.5)


def _columns(topic):
    return range(COLUMNS[topic].start, COLUMNS[topic].stop)


def broken(kind, depth_m=None, phase='dive', **fields):
    """A fault, from a depth in the dive on."""
    when = {} if depth_m is None else {'at_depth_m': depth_m, 'phase': phase}
    return {'kind': kind, **fields, **when}


@pytest.mark.parametrize(
    ('name', 'depth_m', 'within_m'), [('slocum_shelf', 120.0, 30.0), ('current_8deg', 800.0, 60.0)]
)
def test_a_pressure_that_freezes_in_the_dive_brings_a_vehicle_up_that_reckons(
    name, depth_m, within_m
):
    flown = fly(name, 9000.0, [broken('frozen', depth_m, sensor='depth')], **RECKONED)
    began_s = float(np.argmax(flown.depth >= depth_m)) * TICK_S
    assert flown.first(rows.SURFACES) - began_s < 120.0
    assert flown.depth.max() < depth_m + within_m
    assert flown.depth[-1] < AT_SURFACE_M
    assert not flown.drops.any()


@pytest.mark.parametrize(
    ('name', 'error_m'), [('current_8deg', -240.0), ('seaglider_1000m', -150.0)]
)
def test_a_vehicle_that_is_shown_above_the_water_does_not_dive(name, error_m):
    """Though nobody answers, by which it would know that it is at the surface."""
    above = broken('biased', sensor='depth', error=error_m)
    flown = fly(name, 3000.0, [broken('no_contact'), above])
    assert flown.first(rows.SURFACES) < 10.0
    assert flown.depth.max() < 5.0


@pytest.mark.parametrize('changes', [RECKONED, {}])
def test_a_pressure_that_freezes_before_the_dive_is_no_reason_to_dive(changes):
    flown = fly('current_8deg', 4000.0, [broken('frozen', sensor='depth', at_s=20.0)], **changes)
    assert flown.depth.max() < 60.0
    assert flown.depth[-1] < AT_SURFACE_M


@pytest.mark.parametrize(
    'sensors',
    [
        {'imu_period_s': 10.0, 'imu_missed_share': 0.3},
        {'depth_resolution_m': 1.0},
        {'imu_period_s': 4.0, 'depth_resolution_m': 0.5, **NOISE},
        {'position_std_m': 4.0},
    ],
)
def test_samples_that_repeat_or_scatter_by_nature_are_no_alarm(sensors):
    """Nor is a yo of 20 m at .02 kg: the depth hardly moves."""
    slow = {'profile.depth_m': 20.0, 'profile.net_heaviness_kg': 0.02, 'dives': 0}
    flown = fly('rough_water', 10000.0, sensors=sensors, **RECKONED, **slow)
    assert not flown.told.any()


@pytest.mark.parametrize('name', ['current_8deg', 'slocum_shelf'])
def test_who_floats_nose_up_shows_one_depth_and_keeps_its_weight(name):
    """Sent up for good, with a depth in steps, and nobody hears it."""
    fields = {'sensors.depth_resolution_m': 0.1, 'profile.depth_m': 100.0, 'dives': 0}
    faults = [broken('no_contact'), broken('battery', 90.0, drop_v=8.0)]
    flown = fly(name, 4000.0, faults, **fields)
    assert np.bitwise_or.reduce(flown.told) == rows.BATTERY
    assert flown.depth[-1] < AT_SURFACE_M


@pytest.mark.parametrize(
    ('name', 'crush_m', 'faults'),
    [
        ('rough_water', 1250.0, [broken('leak', 950.0, rate_kgps=0.005, limit_kg=2.0)]),
        (
            'current_8deg',
            1250.0,
            [
                broken('stuck', 900.0, actuator='buoyancy_engine'),
                broken('mass', 900.0, mass_kg=0.5),
            ],
        ),
        (
            'slocum_shelf',
            250.0,
            [
                broken('stuck', 180.0, actuator='buoyancy_engine'),
                broken('mass', 180.0, mass_kg=0.15),
            ],
        ),
    ],
)
def test_the_weight_goes_before_the_crush_depth_and_not_after_it(name, crush_m, faults):
    flown = fly(name, 9000.0, faults)
    assert flown.dropped_at() < crush_m
    assert flown.depth.max() < crush_m
    assert flown.depth[-1] < AT_SURFACE_M


def test_a_leak_that_outgrows_the_pump_takes_nobody_below_where_it_began():
    leak = broken('leak', 590.0, rate_kgps=0.0009, limit_kg=1.6)
    flown = fly('current_8deg', 12000.0, [leak], **{'profile.depth_m': 600.0})
    assert flown.depth.max() < 640.0
    assert flown.depth[-1] < AT_SURFACE_M


@pytest.mark.parametrize(('taken_kg', 'is_too_much'), [(0.13, True), (0.06, False)])
def test_water_that_came_in_between_two_dives_is_weighed_before_the_next_turn(
    taken_kg, is_too_much
):
    """Of 0.06 kg a Seaglider still turns at 1000 m; of 0.13 kg it does not, and has no weight."""
    leak = {'kind': 'leak', 'rate_kgps': 0.0002, 'limit_kg': taken_kg, 'detected': False}
    deep = {'profile.depth_m': 1000.0, 'profile.top_depth_m': 5.0, 'profile.pitch_deg': 45.0}
    changes = {**deep, 'profile.net_heaviness_kg': 0.34, 'profile.surface_every_dives': 1}
    fields = {'vehicle': 'seaglider', 'dives': 0, 'navigation.method': 'known', **changes}
    sensors = {**NOISE, 'pitch_scale': 0.95, 'pitch_offset_deg': -0.3}
    flown = fly('noisy_sensors', 10000.0, [{**leak, 'at_s': 4300.0}], **fields, sensors=sensors)
    assert bool(flown.first(rows.TOO_HEAVY) < 10000.0) == is_too_much
    assert (flown.depth[50000:].max() < 990.0) == is_too_much
    assert flown.depth[-1] < AT_SURFACE_M


def test_a_pump_with_little_left_that_turns_the_vehicle_is_enough():
    """Heavier than its file says, and by its hull, it just rises from where it is sent."""
    shear = {'kind': 'shear', 'speed_mps': 1.0, 'direction_deg': 322.0, 'depth_m': 200.0}
    glide = {'profile.net_heaviness_kg': 0.02, 'profile.pitch_deg': 24.1, **RECKONED}
    glide |= {'profile.depth_m': 881.2, 'profile.top_depth_m': 5.0, 'vehicle': 'seaglider'}
    water = {'current.components': [{**shear, 'law': 'exponential'}]}
    weight = {'perturb.net_heaviness_kg': 0.136}
    flown = fly('current_10deg', 24000.0, [], dives=0, **glide, **water, **weight)
    assert not (flown.told & rows.TOO_HEAVY).any()
    assert flown.depth.max() > 880.0
    assert flown.depth[-1] < 750.0


def test_a_rate_that_a_fast_current_and_a_pitch_feign_weighs_nothing():
    """By 1.1 deg a position that is known rises by 0.05 m/s; 0.1 kg heavier than in its file."""
    glide = {'profile.net_heaviness_kg': 0.098, 'profile.pitch_deg': 16.2}
    glide |= {'profile.depth_m': 586.5, 'profile.top_depth_m': 5.0, 'vehicle': 'seaglider'}
    sea = {'current.speed_mps': 2.5, 'current.direction_deg': 127.9}
    off = {'sensors.pitch_offset_deg': 1.1, 'perturb.net_heaviness_kg': 0.1}
    flown = fly('yaw_10deg', 24000.0, [], dives=0, **glide, **sea, **off)
    assert not (flown.told & rows.SURFACES).any()
    assert flown.depth[200000:].max() > 350.0


def test_who_glides_down_where_its_mass_should_hold_it_level_turns_its_nose_up():
    """0.85 kg on a Seaglider for 45 min, of which its pump takes half: it went to 1,484 m."""
    mass = {'kind': 'mass', 'mass_kg': 0.849, 'at_s': 12235.8, 'phase': 'dive', 'for_s': 2682.0}
    glide = {'profile.net_heaviness_kg': 0.123, 'profile.pitch_deg': 23.1, **RECKONED}
    glide |= {'profile.depth_m': 548.0, 'profile.top_depth_m': 5.0, 'vehicle': 'seaglider'}
    glide['profile.surface_every_dives'] = 2
    flown = fly('yaw_10deg', 18000.0, [mass], dives=0, **glide)
    assert flown.depth.max() < 700.0
    assert flown.depth[-1] < AT_SURFACE_M


def test_a_pump_that_still_turns_the_vehicle_spares_the_weight():
    """0.5 kg more at 950 m, of 0.6 kg that the pump has left."""
    flown = fly('current_8deg', 9000.0, [broken('mass', 950.0, mass_kg=0.5)])
    assert not flown.drops.any()
    assert flown.depth[-1] < AT_SURFACE_M


@pytest.mark.parametrize('changes', [RECKONED, {}])
def test_a_depth_that_is_60_m_off_at_launch_is_no_depth_to_dive_by(changes):
    bias = broken('biased', sensor='depth', error=-60.0)
    flown = fly('slocum_shelf', 4000.0, [bias], **changes)
    assert flown.first(rows.DEPTH_WRONG) < 60.0
    assert flown.depth.max() < AT_SURFACE_M


@pytest.mark.parametrize('error', [-15.0, 12.0])
def test_an_offset_is_taken_off_at_the_surface_and_told(error):
    """Dives go to 200 m of water, and not to 215 or 188."""
    bias = broken('biased', sensor='depth', error=error)
    flown = fly('slocum_shelf', 9000.0, [bias], **RECKONED)
    assert flown.first(rows.DEPTH_OFFSET) < 60.0
    assert not (flown.told & rows.SURFACES).any()
    assert 195.0 < flown.depth.max() < 204.0


@pytest.mark.parametrize('changes', [RECKONED, {}])
@pytest.mark.parametrize(
    ('name', 'at_m', 'error', 'least_m'),
    [('current_8deg', 600.0, -300.0, 650.0), ('slocum_shelf', 190.0, -19.6, 208.0)],
)
def test_a_depth_that_jumps_and_stays_there_is_not_set_anew_quietly(
    name, at_m, error, least_m, changes
):
    bias = broken('biased', at_m, sensor='depth', error=error)
    flown = fly(name, 9000.0, [bias], **changes)
    assert flown.depth.max() < least_m
    assert flown.first(rows.DEPTH_WRONG) < np.inf
    assert flown.depth[-1] < AT_SURFACE_M


@pytest.mark.parametrize('changes', [RECKONED, {}])
def test_guidance_and_guard_agree_about_the_rated_depth(changes):
    """45 deg with the whole pump in rough water to the depth that the hull is rated for."""
    steep = {'profile.pitch_deg': 45.0, 'profile.net_heaviness_kg': 1.0, 'dives': 0}
    flown = fly('rough_water', 20000.0, sensors=NOISE, **steep, **changes)
    assert 950.0 < flown.depth.max() < 1015.0
    assert not flown.told.any()


@pytest.mark.parametrize(
    ('vehicle', 'pitch_deg', 'heavier_kg'),
    [('seaglider', 20.0, 0.1), ('zhang2021', 20.0, 0.3), ('seawing', 45.0, 0.3)],
)
def test_a_vehicle_that_is_held_level_sinks_on_by_no_more_than_is_reckoned_with(
    vehicle, pitch_deg, heavier_kg
):
    """With nearly all of its buoyancy against it, and more that its file does not know of."""
    most = load_vehicle(vehicle).params().m_b_max
    flown = fly(
        'current_8deg',
        7000.0,
        [{'kind': 'vacuum', 'rate_paps': 5000.0, 'at_s': 1000.0}],
        vehicle=vehicle,
        **{
            'dives': 0,
            'profile.depth_m': 900.0,
            'profile.pitch_deg': pitch_deg,
            'profile.net_heaviness_kg': round(0.95 * most, 3),
            'perturb.net_heaviness_kg': heavier_kg,
        },
    )
    at = round(flown.first(rows.VACUUM) / TICK_S)
    rate = (flown.depth[at] - flown.depth[at - 100]) / (100 * TICK_S)
    assert flown.depth[at] > 100.0 and rate > 0.15
    assert flown.depth.max() - flown.depth[at] < LEVEL_M + LEVEL_S * rate


@pytest.mark.parametrize(
    ('vehicle', 'rate_kgps', 'limit_kg'), [('slocum_g2', 4.8e-5, 0.6), ('zhang2021', 1.0e-4, 2.5)]
)
@pytest.mark.parametrize('is_detected', [True, False])
def test_who_floats_with_a_leak_stays_up_when_the_water_outgrows_the_pump(
    vehicle, rate_kgps, limit_kg, is_detected
):
    """The weight goes as soon as the vehicle sinks again, whatever it was sent up for."""
    leak = {'kind': 'leak', 'rate_kgps': rate_kgps, 'limit_kg': limit_kg, 'at_s': 600.0}
    faults = [{**leak, 'detected': is_detected}]
    if not is_detected:
        faults.append({'kind': 'vacuum', 'rate_paps': 5000.0, 'at_s': 700.0})
    shelf = {'profile.depth_m': 50.0, 'profile.net_heaviness_kg': 0.1, 'dives': 0}
    flown = fly('current_8deg', 16000.0, faults, vehicle=vehicle, sensors=NOISE, **shelf)
    up = np.argmax((flown.depth < 1.0) & ((flown.told & rows.SURFACES) != 0))
    assert 0 < up and flown.drops[-1]
    assert flown.depth[up:].max() < 5.0


def test_a_pump_stuck_in_the_dive_leaves_a_vehicle_that_is_held_level_slower_by_far():
    """A Seaglider is not level with its mass in the middle, nor nose up while it sinks."""
    stuck = broken('stuck', 120.0, actuator='buoyancy_engine')
    steep = {'profile.pitch_deg': 45.0, 'profile.net_heaviness_kg': 0.341}
    flown = fly('seaglider_1000m', 3600.0, [stuck], **steep)
    told = round(flown.first(rows.SURFACES) / TICK_S)
    dives = (flown.depth[told] - flown.depth[told - 100]) / 10.0
    level = (flown.depth[told + 3000] - flown.depth[told + 2000]) / 100.0
    assert dives > 0.4
    assert level < 0.1


SEAGLIDER = {'vehicle': 'seaglider', 'dives': 0, 'guard.depth_margin_m': 500.0}


def test_a_glide_too_slow_for_the_thresholds_turns_where_it_was_sent():
    """At 0.045 m/s, which is all that 0.02 kg make."""
    slow = {
        'profile.depth_m': 100.0,
        'profile.pitch_deg': 25.0,
        'profile.net_heaviness_kg': 0.02,
        'perturb.net_heaviness_kg': 0.007,
    }
    flown = fly('current_8deg', 20000.0, **SEAGLIDER, **slow)
    deep = flown.depth > 90.0
    assert flown.depth.max() < 110.0
    assert np.count_nonzero(deep[1:] & ~deep[:-1]) > 2


def test_the_first_turn_is_led_by_the_rate_that_a_vehicle_shows():
    """It weighs a third more at 1000 m than its file says: it turned 45 m too late."""
    steep = {
        'profile.depth_m': 1000.0,
        'profile.pitch_deg': 45.0,
        'profile.net_heaviness_kg': 0.341,
        'perturb.net_heaviness_kg': 0.05,
    }
    flown = fly('current_8deg', 4000.0, **SEAGLIDER, **steep)
    assert 950.0 < flown.depth.max() < 1025.0


def test_a_shallow_yo_with_a_slow_pump_is_flown():
    """10 m at 45 deg with the whole pump: turned by a full lead it hung at 8 m."""
    steep = {
        'profile.depth_m': 20.0,
        'profile.pitch_deg': 45.0,
        'profile.net_heaviness_kg': 0.95,
        'dives': 0,
    }
    flown = fly('current_8deg', 4000.0, **steep)
    assert 12.0 < flown.depth.max() < 25.0
    assert not flown.told.any()


#: Errors of attitude sensors that are glued in, and how fast the water goes under them.
TILTED = {'pitch_offset_deg': 0.4, 'roll_bias_deg': 1.5}
FAST = {'current.speed_mps': 2.5, 'current.direction_deg': 319.0}


def test_a_slow_yo_that_begins_in_a_stall_is_flown():
    """Nose too high for its balance, a Seaglider slid backward, the faster the heavier it was."""
    yo = {'profile.depth_m': 20.0, 'profile.pitch_deg': 29.4, 'profile.net_heaviness_kg': 0.08}
    drags = {'K_D0': 0.82, 'K_D': 0.78, 'K_L': 1.16, 'K_M': 0.86, 'pitch_trim_m': -0.0071}
    flown = fly('rough_water', 3600.0, **SEAGLIDER, perturb=drags, **yo)
    assert flown.told[-1] == 0
    turns = np.flatnonzero(np.diff(flown.depth > 15.0))
    assert len(turns) > 6
    assert flown.depth.max() < 30.0


def test_a_stall_that_control_ends_is_no_frozen_depth():
    """Half of the pump taken back, nose 40 deg down, and hardly deeper meanwhile."""
    glide = {'profile.depth_m': 934.0, 'profile.pitch_deg': 20.3}
    drags = {'K_D0': 1.16, 'K_D': 0.74, 'K_L': 1.18, 'K_M': 0.85, 'pitch_trim_m': -0.0087}
    heavy = {'profile.net_heaviness_kg': 0.137, 'perturb': {**drags, 'net_heaviness_kg': 0.04}}
    flown = fly('current_8deg', 3600.0, **glide, **heavy, **SEAGLIDER)
    assert flown.depth[6000] < 10.0
    assert flown.depth[-1] > 300.0
    assert not flown.told.any()


def test_a_turn_after_a_climb_that_growth_slowed_is_no_frozen_depth():
    """The climb showed its drag as weight, by which it would sink before its slow pump has it."""
    steep = {'profile.pitch_deg': 45.0, 'profile.net_heaviness_kg': 0.95, 'dives': 0}
    changes = {**RECKONED, **steep, 'profile.top_depth_m': 5.0, 'profile.surface_every_dives': 2}
    growth = broken('fouling', drag=1.6, over_s=7000.0)
    assert not fly('current_12deg', 14000.0, [growth], **changes).told.any()


def test_a_turn_with_the_whole_pump_that_ends_in_a_stall_is_flown():
    """It slid tail first below the surface, and hung there until its depth was disbelieved."""
    steep = {'profile.depth_m': 200.0, 'profile.pitch_deg': 45.0, 'profile.top_depth_m': 5.0}
    most = {'profile.net_heaviness_kg': 0.341, 'profile.surface_every_dives': 3}
    drags = {'K_D0': 0.84, 'K_D': 0.86, 'K_L': 1.15, 'K_M': 0.72, 'pitch_trim_m': -0.0083}
    drags['net_heaviness_kg'] = -0.049
    flown = fly('slocum_shelf', 6000.0, **SEAGLIDER, perturb=drags, **steep, **most)
    assert not flown.told.any()
    assert np.count_nonzero(np.diff(flown.depth > 100.0)) > 6


def test_a_slow_climb_that_begins_in_a_stall_is_flown():
    """Light before its nose was up it slid tail first: its depth was disbelieved."""
    slow = {'profile.depth_m': 900.0, 'profile.pitch_deg': 40.0, 'profile.net_heaviness_kg': 0.02}
    flown = fly('slocum_shelf', 16000.0, **SEAGLIDER, **slow, **FAST)
    assert not flown.told.any()
    assert flown.depth[-1] < 700.0


def test_a_pitch_that_freezes_over_fast_ground_does_not_freeze_the_depth():
    """With its pump stuck it sinks slowly; by its pitch it rises fast: that is way."""
    faults = [
        broken('frozen', sensor='pitch', at_s=1050.0),
        broken('stuck', actuator='buoyancy_engine', at_s=1270.0),
    ]
    dive = {'profile.depth_m': 270.0, 'profile.pitch_deg': 28.8, 'profile.net_heaviness_kg': 0.27}
    water = {'current.speed_mps': 2.5, 'current.direction_deg': 51.3}
    flown = fly('yaw_10deg', 9000.0, faults, **dive, **water)
    assert flown.depth.max() < 500.0
    assert flown.depth[-1] < AT_SURFACE_M


def test_who_is_fouled_until_it_hangs_in_its_dive_comes_up():
    """It stalled, rose and stalled again, a little deeper each time, to the end of its run."""
    growth = broken('fouling', drag=10.0, lift=0.3, over_s=5000.0)
    flown = fly('slocum_shelf', 7000.0, [growth])
    assert flown.depth.max() > 80.0 and flown.depth[-1] < AT_SURFACE_M


def test_who_is_too_light_for_the_water_at_its_depth_comes_up():
    """Led out of one stall after the other it went up and down to the end of its run."""
    flown = fly('slocum_shelf', 5000.0, **{'water.pycnocline_rise': 0.0045})
    assert flown.depth.max() > 90.0 and flown.depth[-1] < AT_SURFACE_M


def test_way_over_ground_that_a_tilt_shows_as_way_up_is_none():
    """It believed to rise as it was asked to, and sank out of its yo."""
    yo = {'profile.depth_m': 20.0, 'profile.top_depth_m': 3.0, 'profile.pitch_deg': 16.9}
    slow = {'profile.net_heaviness_kg': 0.05, 'profile.surface_every_dives': 2, 'dives': 0}
    tilted = {f'sensors.{name}': value for name, value in {**NOISE, **TILTED}.items()}
    aging = [broken('fouling', drag=1.5, over_s=14400.0)]
    flown = fly('yaw_10deg', 9000.0, aging, vehicle='slocum_g2', **yo, **slow, **tilted, **FAST)
    assert not flown.told.any()
    assert flown.depth.max() < 40.0
    assert np.count_nonzero(np.diff(flown.depth > 15.0)) > 6


def test_a_light_vehicle_in_sinking_water_comes_up():
    """Its pump stuck by 0.18 kg light; held level it sank with the water (468 of seed 17902)."""
    sinks = {'north_mps': 0.8001, 'east_mps': -0.4968, 'down_mps': 0.06231, 'at_s': 7306.4}
    faults = [
        broken('gust', 360.0, 'climb', **sinks),
        broken('stuck', actuator='buoyancy_engine', at_s=11046.5) | {'phase': 'turn'},
    ]
    yo = {'profile.depth_m': 738.5, 'profile.top_depth_m': 5.0, 'profile.pitch_deg': 18.7}
    slow = {'profile.net_heaviness_kg': 0.243, 'profile.surface_every_dives': 2, 'dives': 0}
    reckons = {'vehicle': 'seaglider', 'seed': 547776703, 'navigation.method': 'dead_reckoned'}
    flown = fly('yaw_10deg', 14000.0, faults, **reckons, **yo, **slow)
    assert flown.depth[118000] > 10.0
    assert flown.depth[-1] < AT_SURFACE_M


def test_a_pump_that_chases_what_sensors_err_by_is_no_fault():
    """Demands swing by 0.15 kg between samples of attitude (763 of seed 45869)."""
    errs = {**NOISE, 'compass_bias_deg': 1.7734, 'compass_deviation_deg': 1.4326}
    errs |= {'compass_deviation_phase_deg': -174.9206, 'roll_bias_deg': 1.2025}
    errs |= {'pitch_scale': 1.0481, 'pitch_offset_deg': -0.9337, 'depth_offset_m': -0.1607}
    errs |= {'gps_std_m': 7.5027, 'gps_first_fix_s': 102.3732, 'imu_period_s': 5.1}
    yo = {'navigation.method': 'dead_reckoned', 'profile.surface_every_dives': 3, 'dives': 0}
    flown = fly('spline', 4000.0, seed=1818021652, sensors=errs, **yo)
    assert flown.depth.max() > 900.0
    assert flown.first(rows.STUCK_BUOYANCY) == np.inf


def test_a_depth_that_moves_is_not_told_to_stand_still_alone():
    """It lost 0.85 kg in its dive, and rose by 10 m in a minute."""
    flown = fly('current_8deg', 900.0, [broken('mass', mass_kg=-0.85, at_s=500.0)])
    at = round(flown.first(rows.FROZEN) / TICK_S)
    assert flown.depth[at - 600] - flown.depth[at] > 5.0
    assert 'goes elsewhere' in rows.say(int(flown.told[at]))
