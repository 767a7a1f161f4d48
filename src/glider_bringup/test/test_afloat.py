# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""At the surface there is nothing to steer by, nor to learn: no vehicle is swung there."""

from types import SimpleNamespace

import numpy as np
import pytest

from glider_base.frames import poses_from_wire
from glider_bringup.engines.flight import fly
from glider_guidance.yo.stage import GLIDING_UP
from glider_mission.blocks import COLUMNS
from glider_mission.scenario import load_scenario

#: Shallow dives, up after each for ten minutes.
DIVES = {
    'duration_s': 7200.0,
    'dives': 0,
    'profile.surface_every_dives': 1,
    'profile.depth_m': 100.0,
    'profile.wait_s': 600.0,
    'profile.net_heaviness_kg': 0.15,
    'profile.pitch_deg': 25.0,
}
#: No glider rolls further (deg), nor is deeper at the surface (m).
MOST_ROLL_DEG, AFLOAT_M = 45.0, 1.0


class Motion:
    """True depth (m) and roll (deg), and roll mass and steering surface (rad), once a second."""

    def __init__(self) -> None:
        self._rows = []

    def add(self, log) -> None:
        self._rows.append(log[::10].copy())

    def result(self):
        log = np.concatenate(self._rows)
        pose = poses_from_wire(log[:, COLUMNS['ground_truth/odom']])
        joints = log[:, COLUMNS['joint_states']]
        return pose[:, 2], np.degrees(pose[:, 3]), joints[:, 2:4]


@pytest.mark.parametrize('law', ['adaptive', 'pid'])
@pytest.mark.parametrize('method', ['known', 'dead_reckoned'])
@pytest.mark.parametrize('vehicle', ['zhang2021', 'seawing', 'seaglider', 'slocum_g2'])
def test_no_vehicle_swings_at_the_surface(vehicle, method, law):
    changes = {**DIVES, 'vehicle': vehicle, 'navigation.method': method, 'control.law': law}
    motion = Motion()
    fly(load_scenario('current_8deg', changes), [motion])
    depth, roll, steering = motion.result()
    assert np.abs(roll).max() < MOST_ROLL_DEG
    afloat = depth < AFLOAT_M
    assert np.count_nonzero(np.diff(afloat.astype(int)) == 1) >= 2  # it came up twice
    # a minute after it came up nothing moves any more until it dives
    rests = np.array([afloat[max(0, i - 60) : i + 1].all() for i in range(len(afloat))])
    moved = np.abs(np.diff(steering, axis=0)).max(axis=1)
    assert rests.sum() > 600
    assert moved[rests[1:] & rests[:-1]].max() == 0.0


@pytest.mark.parametrize('offset_m', [-1.5, 0.95, 2.9])
@pytest.mark.parametrize('name', ['slocum_shelf', 'seaglider_1000m'])
def test_an_offset_of_the_depth_sensor_keeps_no_vehicle_at_the_surface(name, offset_m):
    """It is as deep as waves are high, and shows a vehicle that floats below the surface."""
    changes = {'sensors.depth_offset_m': offset_m, 'profile.depth_m': 150.0, 'dives': 0}
    motion = Motion()
    fly(load_scenario(name, {**changes, 'duration_s': 14_400.0}), [motion])
    depth, *_ = motion.result()
    goes_down = np.diff((depth > 120.0).astype(int)) == 1
    assert np.count_nonzero(goes_down) >= 4  # it dives on
    assert depth.max() < 165.0


@pytest.mark.parametrize('vehicle', ['seaglider', 'slocum_g2', 'zhang2021'])
def test_a_climb_is_as_fast_as_it_is_asked_to_be_after_a_stay_at_the_surface(vehicle):
    """In water like that of eddies_10d, which makes the pump work for it."""
    changes = {'vehicle': vehicle, 'profile.depth_m': 180.0, 'dives': 4, 'duration_s': 20_000.0}
    water = {'water.pycnocline_rise': 0.002, 'water.pycnocline_depth_m': 30.0}
    rows = []
    scenario = load_scenario('current_8deg', {**DIVES, **changes, **water})
    fly(scenario, [SimpleNamespace(add=lambda log: rows.append(log[::10].copy()))])
    log = np.concatenate(rows)
    depth = poses_from_wire(log[:, COLUMNS['ground_truth/odom']])[:, 2]
    climbs = np.flatnonzero(np.diff((log[:, COLUMNS['stage']].ravel() == GLIDING_UP).astype(int)))
    for begin, end in climbs.reshape(-1, 2)[1:]:  # from the second on
        steady = slice(begin + (end - begin) // 3, begin + 2 * (end - begin) // 3)
        asked_mps = log[steady, COLUMNS['reference'].start + 9].mean()
        risen_mps = -np.polyfit(np.arange(steady.stop - steady.start), depth[steady], 1)[0]
        assert risen_mps == pytest.approx(asked_mps, rel=0.12)
