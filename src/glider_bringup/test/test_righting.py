# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""A climb so light that the vehicle does not right itself: no law rolls it over."""

import numpy as np
import pytest

from glider_base.frames import poses_from_wire
from glider_bringup.engines.direct import fly_blocks
from glider_bringup.engines.flight import mission_of
from glider_mission.blocks import COLUMNS
from glider_mission.scenario import load_scenario

#: The whole pump of a Seawing; the next leg of the path begins in the climb.
LIGHT = {
    'duration_s': 3200.0,
    'dives': 0,
    'vehicle': 'seawing',
    'profile.depth_m': 400.0,
    'profile.pitch_deg': 45.0,
    'profile.net_heaviness_kg': 1.0,
    'navigation.method': 'known',
}
#: A third more than it may be banked (deg).
MOST_ROLL_DEG = 40.0


@pytest.mark.parametrize(('law', 'dihedral'), [('adaptive', 1.0), ('adaptive', 1.3), ('pid', 1.0)])
def test_no_law_rolls_a_light_vehicle_over(law, dihedral):
    """Nor the adaptive law one with more dihedral than its file says."""
    changes = {**LIGHT, 'control.law': law, 'perturb': {'K_MR': dihedral}}
    blocks = fly_blocks(*mission_of(load_scenario('survey', changes)))
    poses = [poses_from_wire(block[:, COLUMNS['ground_truth/odom']]) for block in blocks]
    roll_deg = np.degrees(np.concatenate(poses)[:, 3])
    assert np.abs(roll_deg).max() < MOST_ROLL_DEG
