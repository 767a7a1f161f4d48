# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""What is left of a path, against closed forms."""

import math

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from glider_guidance.path.curve import path_length
from glider_guidance.path.settings import HelixPath, SplinePath, StraightPath, WaypointPath
from glider_guidance.yo.end_of_path import way_left

quick = settings(max_examples=50)

SPEED = 0.42


@quick
@given(
    st.floats(-180.0, 180.0),
    st.floats(0.0, 2999.0),
    st.floats(-20.0, 20.0),
    st.floats(0.0, 0.4),
    st.floats(-math.pi, math.pi),
)
def test_straight_leg_takes_its_length_over_the_speed_made_good(course, s, e1, current, bearing):
    """Cross current balanced: sqrt(U^2 - across^2) + along."""
    across, along = current * math.sin(bearing), current * math.cos(bearing)
    progress = math.sqrt(SPEED**2 - across**2) + along
    assume(progress > 0.02)
    path = StraightPath(kind='straight', course_deg=course, length_m=3000.0).params()
    towards = math.radians(course) + bearing
    left = way_left(
        s, e1, SPEED, current * math.cos(towards), current * math.sin(towards), math.inf, path
    )
    assert left.glide_s == pytest.approx((3000.0 - s - e1) / progress, rel=1e-9, abs=1e-6)
    assert left.drift == pytest.approx(along / progress, abs=1e-9)


def test_each_leg_counts_with_the_speed_that_the_current_leaves_on_it():
    """There and back along 1000 m in 0.2 m/s."""
    path = WaypointPath(kind='waypoints', waypoints=[(0.0, 0.0), (1000.0, 0.0), (0.0, 1.0)])
    left = way_left(0.0, 0.0, SPEED, 0.2, 0.0, math.inf, path.params())
    assert left.glide_s == pytest.approx(1000.0 / 0.62 + 1000.0 / 0.22, rel=1e-3)
    half = way_left(1500.0, 0.0, SPEED, 0.2, 0.0, math.inf, path.params())
    assert half.glide_s == pytest.approx(500.0 / 0.22, rel=1e-3)


@pytest.mark.parametrize(
    'path',
    [
        WaypointPath(kind='waypoints', waypoints=[(0, 0, 0), (300, 0, 100), (300, 400, 100)]),
        SplinePath(kind='spline', waypoints=[(0, 0, 0), (300, 80, 90), (500, 400, 30)]),
        HelixPath(kind='helix', radius_m=150.0, turns=1.3, slope_deg=30.0),
    ],
)
def test_in_still_water_it_is_the_horizontal_way(path):
    points = path.points(20000)
    way = np.hypot(*np.diff(points[:, :2], axis=0).T).sum()
    left = way_left(0.0, 0.0, SPEED, 0.0, 0.0, math.inf, path.params())
    assert left.glide_s == pytest.approx(way / SPEED, rel=1e-3)
    ended = way_left(path_length(path.params()), 0.0, SPEED, 0.0, 0.0, math.inf, path.params())
    assert ended.glide_s == pytest.approx(0.0, abs=1e-9)


def test_leg_that_cannot_be_made_good_is_never_done():
    path = WaypointPath(kind='waypoints', waypoints=[(0.0, 0.0), (1000.0, 0.0), (0.0, 1.0)])
    left = way_left(0.0, 0.0, SPEED, 0.43, 0.0, math.inf, path.params())
    assert left.glide_s == math.inf
    assert way_left(0.0, 0.0, SPEED, 0.0, 0.0, 2000.0, path.params()).glide_s == math.inf
