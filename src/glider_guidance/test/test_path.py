# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""Paths: geometry against closed forms and numeric derivatives, messages of wrong input."""

import math
from itertools import pairwise

import numpy as np
import pydantic
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from scipy.integrate import quad
from scipy.optimize import minimize_scalar

from glider_guidance.path.curve import (
    path_angles,
    path_closest,
    path_errors,
    path_length,
    path_point,
    path_tangent,
    path_turn,
)
from glider_guidance.path.settings import (
    HelixPath,
    PathSettings,
    SplinePath,
    StraightPath,
    WaypointPath,
)

quick = settings(max_examples=50)
read_path = pydantic.TypeAdapter(PathSettings).validate_python

coordinates = st.floats(-3000.0, 3000.0)
fractions = st.floats(0.0, 1.0)
positions = st.tuples(coordinates, coordinates, st.floats(0.0, 1500.0))

straights = st.builds(
    StraightPath,
    kind=st.just('straight'),
    start=positions,
    course_deg=st.floats(-360.0, 360.0),
    length_m=st.floats(10.0, 25_000.0),
)
helices = st.builds(
    HelixPath,
    kind=st.just('helix'),
    centre=st.tuples(coordinates, coordinates, st.just(500.0)),
    radius_m=st.floats(10.0, 300.0),
    course_deg=st.floats(-360.0, 360.0),
    direction=st.sampled_from(['cw', 'ccw']),
    turns=st.floats(0.1, 5.0),
    descent_per_turn_m=st.floats(-90.0, 90.0),
)


@st.composite
def through_waypoints(draw, model):
    """Waypoints whose legs turn by at most 120 deg and slope by at most 45 deg."""
    count = draw(st.integers(2, 7))
    point, course = np.array([0.0, 0.0, 700.0]), draw(st.floats(-math.pi, math.pi))
    points = [point]
    for _ in range(count - 1):
        length = draw(st.floats(50.0, 200.0))
        course += math.radians(draw(st.floats(-120.0, 120.0)))
        slope = draw(st.floats(-0.5, 0.5))
        point = point + length * np.array([math.cos(course), math.sin(course), slope])
        points.append(point)
    try:
        return model(kind=model.model_fields['kind'].annotation.__args__[0], waypoints=points)
    except pydantic.ValidationError as error:
        assume('turns on the spot' not in str(error) and 'slope' not in str(error))
        raise


waypoint_paths = through_waypoints(WaypointPath)
spline_paths = through_waypoints(SplinePath)
any_path = st.one_of(straights, helices, waypoint_paths, spline_paths)
NORTH = StraightPath(kind='straight', course_deg=0.0, length_m=1000.0)
TURNS = [(0.0, 0.0), (1000.0, 0.0), (1000.0, 500.0), (2500.0, 700.0)]


def point(s, params) -> np.ndarray:
    return np.array(path_point(float(s), params))


def tangent(s, params) -> np.ndarray:
    return np.array(path_tangent(float(s), params))


# ------------------------------------------------------------------------------ all paths


@quick
@given(any_path, fractions)
def test_tangent_is_the_derivative_of_the_point(path, fraction):
    params = path.params()
    h = 1e-3
    s = fraction * path_length(params)
    assume(np.min(np.abs(params.knots - s)) > 2.0 * h)
    numeric = (point(s + h, params) - point(s - h, params)) / (2.0 * h)
    np.testing.assert_allclose(tangent(s, params), numeric, atol=2e-6)


@quick
@given(any_path, st.floats(0.0, 5000.0))
def test_both_ends_go_on_straight_along_the_last_tangent(path, beyond):
    params = path.params()
    for s, sign in ((0.0, -1.0), (path_length(params), 1.0)):
        end, direction = point(s, params), tangent(s, params)
        outside = s + sign * beyond
        np.testing.assert_allclose(
            point(outside, params), end + sign * beyond * direction, atol=1e-8
        )
        np.testing.assert_array_equal(tangent(outside, params), direction)


@quick
@given(any_path)
def test_the_path_is_continuous(path):
    params = path.params()
    for knot in params.knots:
        before, after = point(knot - 1e-9, params), point(knot + 1e-9, params)
        np.testing.assert_allclose(before, after, atol=1e-6)


@quick
@given(any_path)
def test_course_is_that_of_the_first_tangent(path):
    course = path.course_rad()
    north, east, _ = tangent(0.0, path.params())
    assert math.cos(course - math.atan2(east, north)) == pytest.approx(1.0, abs=1e-12)


@quick
@given(st.one_of(straights, helices, waypoint_paths), fractions)
def test_s_is_the_arc_length(path, fraction):
    params = path.params()
    s = fraction * path_length(params)
    assert np.linalg.norm(tangent(s, params)) == pytest.approx(1.0, abs=1e-12)


@quick
@given(any_path, st.integers(2, 40))
def test_points_hold_every_waypoint_in_order(path, count):
    points = path.points(count)
    corners = np.array(getattr(path, 'waypoints', points[[0, -1]]))
    assert points.shape == (max(count, len(corners)), 3)
    nearest = [np.argmin(np.linalg.norm(points - corner, axis=1)) for corner in corners]
    np.testing.assert_allclose(points[nearest], corners, atol=1e-8)
    assert nearest == sorted(nearest)
    steps = [np.linalg.norm(after - one) for one, after in pairwise(points)]
    assert min(steps) > 0.0


# ------------------------------------------------------------------------------ each kind


@pytest.mark.parametrize(
    ('course_deg', 'end'),
    [(0.0, (100.0, 0.0)), (90.0, (0.0, 100.0)), (-135.0, (-70.7107, -70.7107))],
)
def test_straight(course_deg, end):
    path = StraightPath(kind='straight', start=(5.0, 6.0), course_deg=course_deg, length_m=100.0)
    params = path.params()
    np.testing.assert_allclose(point(0.0, params), [5.0, 6.0, 0.0])
    np.testing.assert_allclose(point(100.0, params), [5.0 + end[0], 6.0 + end[1], 0.0], atol=1e-3)
    assert path.course_rad() == math.radians(course_deg)
    assert path_length(params) == 100.0


@quick
@given(waypoint_paths, fractions)
def test_waypoint_legs_are_straight(path, fraction):
    waypoints, params = np.array(path.waypoints), path.params()
    lengths = np.linalg.norm(np.diff(waypoints, axis=0), axis=1)
    assert path_length(params) == pytest.approx(lengths.sum(), rel=1e-12)
    s = fraction * lengths.sum()
    arc = np.concatenate(([0.0], np.cumsum(lengths)))
    expected = [np.interp(s, arc, waypoints[:, j]) for j in range(3)]
    np.testing.assert_allclose(point(s, params), expected, atol=1e-8)


def test_a_corner_belongs_to_the_leg_that_follows():
    params = WaypointPath(kind='waypoints', waypoints=TURNS).params()
    np.testing.assert_allclose(tangent(999.9, params), [1.0, 0.0, 0.0], atol=1e-12)
    np.testing.assert_allclose(tangent(1000.0, params), [0.0, 1.0, 0.0], atol=1e-12)


@quick
@given(spline_paths)
def test_spline_passes_its_waypoints_with_continuous_curvature(path):
    params, waypoints = path.params(), np.array(path.waypoints)
    np.testing.assert_allclose([point(s, params) for s in params.knots], waypoints, atol=1e-8)
    c, h = params.coefficients, np.diff(params.knots)
    ends = np.stack(
        [
            c[:, :, 0]
            + h[:, None] * (c[:, :, 1] + h[:, None] * (c[:, :, 2] + h[:, None] * c[:, :, 3])),
            c[:, :, 1] + h[:, None] * (2.0 * c[:, :, 2] + 3.0 * h[:, None] * c[:, :, 3]),
            2.0 * c[:, :, 2] + 6.0 * h[:, None] * c[:, :, 3],
        ]
    )
    starts = np.stack([c[:, :, 0], c[:, :, 1], 2.0 * c[:, :, 2]])
    np.testing.assert_allclose(ends[:, :-1], starts[:, 1:], atol=1e-8)
    # natural ends: no curvature, so the straight continuation is C2 as well
    np.testing.assert_allclose(starts[2, 0], np.zeros(3), atol=1e-10)
    np.testing.assert_allclose(ends[2, -1], np.zeros(3), atol=1e-10)


def test_a_spline_parameter_is_near_its_arc_length():
    angles = np.radians(np.arange(0.0, 360.0, 20.0))
    circle = np.column_stack((np.cos(angles), np.sin(angles))) * 1000.0
    params = SplinePath(kind='spline', waypoints=circle).params()
    length, _ = quad(lambda s: np.linalg.norm(tangent(s, params)), 0.0, path_length(params))
    assert path_length(params) == pytest.approx(length, rel=0.01)
    assert length == pytest.approx(1000.0 * angles[-1], rel=2e-3)


@pytest.mark.parametrize('s', [150.0, 420.0, 700.0])
def test_tangent_of_a_curve_in_all_three_directions(s):
    """A spline that climbs and turns: by the points beside, as it is flown."""
    bent = [(0.0, 0.0, 20.0), (250.0, 120.0, 60.0), (450.0, 30.0, 30.0), (600.0, 300.0, 90.0)]
    params = SplinePath(kind='spline', waypoints=bent).params()
    numeric = (point(s + 0.01, params) - point(s - 0.01, params)) / 0.02
    assert np.min(abs(numeric)) > 0.01
    np.testing.assert_allclose(tangent(s, params), numeric, atol=1e-6)


@pytest.mark.parametrize('direction', ['cw', 'ccw'])
def test_helix_against_its_closed_form(direction):
    radius, turns, descent = 80.0, 2.5, 120.0
    path = HelixPath(
        kind='helix',
        centre=(10.0, -20.0, 30.0),
        radius_m=radius,
        course_deg=60.0,
        direction=direction,
        turns=turns,
        descent_per_turn_m=descent,
    )
    params = path.params()
    length = turns * math.hypot(2.0 * math.pi * radius, descent)
    assert path_length(params) == pytest.approx(length, rel=1e-12)
    measured, _ = quad(lambda s: np.linalg.norm(tangent(s, params)), 0.0, length)
    assert measured == pytest.approx(length, rel=1e-9)
    assert point(0.0, params)[2] == 30.0
    assert point(length, params)[2] == pytest.approx(30.0 + turns * descent, abs=1e-9)
    for s in np.linspace(0.0, length, 23):
        north, east, _ = point(s, params)
        assert math.hypot(north - 10.0, east + 20.0) == pytest.approx(radius, abs=1e-9)
    # half a turn more than whole turns ends on the other side
    middle = 0.5 * (point(0.0, params) + point(length, params))
    np.testing.assert_allclose(middle[:2], [10.0, -20.0], atol=1e-9)


def test_clockwise_turns_to_starboard():
    helix = {'kind': 'helix', 'radius_m': 50.0, 'turns': 1.0, 'slope_deg': 0.0}
    for direction, east in (('cw', 50.0), ('ccw', -50.0)):
        params = read_path({**helix, 'course_deg': 0.0, 'direction': direction}).params()
        quarter = point(path_length(params) / 4.0, params)
        np.testing.assert_allclose(quarter, [50.0, 0.0, 0.0], atol=1e-9)
        start_to_end = quarter - point(0.0, params)
        np.testing.assert_allclose(start_to_end, [50.0, east, 0.0], atol=1e-9)


@quick
@given(st.floats(10.0, 1000.0), st.floats(0.0, 45.0))
def test_slope_and_descent_per_turn_are_one_thing(radius, slope_deg):
    helix = {'kind': 'helix', 'radius_m': radius, 'turns': 1.0}
    descent = 2.0 * math.pi * radius * math.tan(math.radians(slope_deg))
    one = read_path({**helix, 'slope_deg': slope_deg}).params()
    other = read_path({**helix, 'descent_per_turn_m': descent}).params()
    s = 0.37 * path_length(one)
    np.testing.assert_allclose(point(s, one), point(s, other), atol=1e-8)


# ------------------------------------------------------------------------------ path frame


@pytest.mark.parametrize(
    ('direction', 'gamma_d', 'rho_d'),
    [
        ((1.0, 0.0, 0.0), 0.0, 0.0),
        ((0.0, 2.0, 0.0), math.pi / 2.0, 0.0),
        ((1.0, 0.0, 1.0), 0.0, -math.pi / 4.0),
        ((-1.0, 0.0, -1.0), math.pi, math.pi / 4.0),
    ],
)
def test_angles_of_a_tangent(direction, gamma_d, rho_d):
    assert path_angles(*direction) == pytest.approx((gamma_d, rho_d), abs=1e-12)


def test_signs_of_the_errors_on_a_path_to_the_north():
    errors = path_errors(7.0, 3.0, 2.0, 5.0, 0.0, 0.0, NORTH.params())
    assert errors == pytest.approx((2.0, 3.0, 2.0))  # ahead, east is to starboard, below


@quick
@given(any_path, st.floats(-0.2, 1.2), positions)
def test_errors_are_the_offset_in_the_path_frame(path, fraction, position):
    params = path.params()
    s = fraction * path_length(params)
    direction = tangent(s, params)
    gamma_d, rho_d = path_angles(*direction)
    rz = np.array(
        [
            [math.cos(gamma_d), -math.sin(gamma_d), 0.0],
            [math.sin(gamma_d), math.cos(gamma_d), 0.0],
            [0.0, 0.0, 1.0],
        ]
    )
    ry = np.array(
        [
            [math.cos(rho_d), 0.0, math.sin(rho_d)],
            [0.0, 1.0, 0.0],
            [-math.sin(rho_d), 0.0, math.cos(rho_d)],
        ]
    )
    q = rz @ ry
    np.testing.assert_allclose(q[:, 0], direction / np.linalg.norm(direction), atol=1e-12)
    offset = np.array(position) - point(s, params)
    errors = path_errors(*position, s, gamma_d, rho_d, params)
    np.testing.assert_allclose(errors, q.T @ offset, atol=1e-8)


@quick
@given(any_path, fractions, st.tuples(*[st.floats(-50.0, 50.0)] * 3))
def test_a_horizontal_frame_splits_horizontal_and_vertical_errors(path, fraction, offset):
    params = path.params()
    s = fraction * path_length(params)
    gamma_d, _ = path_angles(*tangent(s, params))
    errors = path_errors(*(point(s, params) + offset), s, gamma_d, 0.0, params)
    assert errors.e3 == pytest.approx(offset[2], abs=1e-9)
    assert math.hypot(errors.e1, errors.e2) == pytest.approx(math.hypot(*offset[:2]), abs=1e-9)


# ------------------------------------------------------------------------------ closest point


def distance(s, position, horizontal, params) -> float:
    offset = np.array(position) - point(s, params)
    return float(np.linalg.norm(offset[:2] if horizontal else offset))


@quick
@given(any_path, positions, st.booleans())
def test_closest_is_no_farther_than_any_other_point(path, position, horizontal):
    params = path.params()
    length = path_length(params)
    s = path_closest(*position, horizontal, params)
    assert 0.0 <= s <= length
    grid = np.linspace(0.0, length, 400)
    coarse = grid[np.argmin([distance(x, position, horizontal, params) for x in grid])]
    bounds = (max(coarse - grid[1], 0.0), min(coarse + grid[1], length))
    fine = minimize_scalar(
        distance, bounds=bounds, args=(position, horizontal, params), method='bounded'
    )
    assert distance(s, position, horizontal, params) <= fine.fun + 1e-5


@quick
@given(st.one_of(straights, waypoint_paths, spline_paths), fractions)
def test_closest_to_a_point_of_the_path_is_that_point(path, fraction):
    params = path.params()
    here = point(fraction * path_length(params), params)
    s = path_closest(*here, False, params)
    np.testing.assert_allclose(point(s, params), here, atol=2e-6)


@quick
@given(st.floats(-200.0, 1200.0), st.floats(-500.0, 500.0), st.floats(0.0, 1000.0), st.booleans())
def test_closest_on_a_straight_leg_is_the_foot_of_the_perpendicular(
    north, east, depth, horizontal
):
    s = path_closest(north, east, depth, horizontal, NORTH.params())
    assert s == pytest.approx(min(max(north, 0.0), 1000.0), abs=1e-9)


def test_closest_at_an_outer_corner_is_the_corner():
    params = WaypointPath(kind='waypoints', waypoints=TURNS).params()
    assert path_closest(1100.0, -100.0, 0.0, True, params) == pytest.approx(1000.0, abs=1e-9)


def test_closest_of_equal_turns_seen_from_above_is_the_first():
    helix = {'kind': 'helix', 'radius_m': 50.0, 'turns': 7.3, 'descent_per_turn_m': 20.0}
    params = read_path({**helix, 'course_deg': 0.0}).params()
    turn = math.hypot(2.0 * math.pi * 50.0, 20.0)
    assert path_closest(90.0, 0.0, 70.0, True, params) == pytest.approx(0.25 * turn, abs=1e-6)
    s = path_closest(90.0, 0.0, 65.0, False, params)
    assert s == pytest.approx(3.25 * turn, abs=1e-6)


# ------------------------------------------------------------------------------ wrong input


@pytest.mark.parametrize(
    ('values', 'message'),
    [
        ({'kind': 'loop'}, "'straight', 'waypoints', 'spline', 'helix'"),
        ({'kind': 'straight', 'course_deg': 0.0}, 'length_m\n.*required'),
        (
            {'kind': 'straight', 'course_deg': 0.0, 'length_m': 0.0},
            'length_m\n.*greater than or equal to 1',
        ),
        ({'kind': 'straight', 'course_deg': math.nan, 'length_m': 9.0}, 'course_deg\n.*finite'),
        (
            {'kind': 'straight', 'course_deg': 0.0, 'length_m': 9.0, 'start': [1.0]},
            r'start = \[1.0\]: 1 numbers .allowed: \[north, east\]',
        ),
        (
            {'kind': 'straight', 'course_deg': 0.0, 'length_m': 9.0, 'start': [0.0, 0.0, -2.0]},
            r'start = \[0.0, 0.0, -2.0\]: the depth is allowed >= 0.0 and <= 12000.0 m',
        ),
        (
            {'kind': 'straight', 'course_deg': 0.0, 'length_m': 9.0, 'start': [0.0, 2e6]},
            'north and east are allowed >= -1000000.0 and <= 1000000.0 m',
        ),
        ({'kind': 'waypoints', 'waypoints': [[0.0, 0.0]]}, 'at least 2 items'),
        ({'kind': 'spline', 'waypoints': [[0.0, 0.0]]}, 'at least 2 items'),
        ({'kind': 'waypoints', 'waypoints': [[0.0, 0.0], [0.0, math.nan]]}, '1.1\n.*finite'),
        (
            {'kind': 'waypoints', 'waypoints': [[0.0, 0.0], [5.0, 0.0], [5.0, 0.0]]},
            r'waypoints 1 and 2 coincide: .* are 0.000 m apart .allowed: >= 1.0 m',
        ),
        (
            {'kind': 'spline', 'waypoints': [[0.0, 0.0], [5.0, 0.0], [5.0, 0.5]]},
            'waypoints 1 and 2 coincide: .* are 0.500 m apart',
        ),
        (
            {'kind': 'waypoints', 'waypoints': [[0.0, 0.0], [4.0, 0.0], [9.5, 0.0]]},
            'the whole path is 9.500 m long .allowed: >= 10.0 m',
        ),
        (
            {'kind': 'waypoints', 'waypoints': [[0.0, 0.0], [5.0, 0.0, 10.0]]},
            'all waypoints need a depth, or none',
        ),
        (
            {'kind': 'waypoints', 'waypoints': [[0.0, 0.0, 0.0], [0.0, 0.0, 90.0]]},
            'between waypoints 0 and 1 has a slope of 90.0 deg .allowed: >= -80.0 and <= 80.0',
        ),
        (
            {'kind': 'spline', 'waypoints': [[0, 0, 0], [10, 0, 0], [10, 0, 400], [20, 0, 400]]},
            'between waypoints 1 and 2 has a slope of',
        ),
        (
            {'kind': 'spline', 'waypoints': [[0, 0], [100, 0], [0, 0]]},
            'the spline turns on the spot near waypoint 1',
        ),
        (
            {'kind': 'helix', 'radius_m': 0.5, 'turns': 1.0, 'slope_deg': 5.0},
            'radius_m\n.*greater than or equal to 1',
        ),
        (
            {'kind': 'helix', 'radius_m': 20_000.0, 'turns': 1.0, 'slope_deg': 5.0},
            'radius_m\n.*less than or equal to 10000',
        ),
        (
            {'kind': 'helix', 'radius_m': 50.0, 'turns': 1.0},
            'exactly one of descent_per_turn_m and slope_deg, found neither',
        ),
        (
            {
                'kind': 'helix',
                'radius_m': 50.0,
                'turns': 1.0,
                'slope_deg': 5.0,
                'descent_per_turn_m': 5.0,
            },
            'exactly one of descent_per_turn_m and slope_deg, found both',
        ),
        (
            {'kind': 'helix', 'radius_m': 1.0, 'turns': 1.0, 'descent_per_turn_m': 90.0},
            'descent_per_turn_m = 90.0 on radius_m = 1.0 is a slope of 86.0 deg .allowed: >= -80',
        ),
        (
            {'kind': 'helix', 'radius_m': 50.0, 'turns': 2.0, 'descent_per_turn_m': -10.0},
            'ends at a depth of -20.0 m .allowed: >= 0.0 and <= 12000.0',
        ),
        ({'kind': 'straight', 'course': 0.0, 'length_m': 9.0}, 'course\n.*not permitted'),
    ],
)
def test_a_wrong_path_says_what_is_allowed(values, message):
    with pytest.raises(pydantic.ValidationError, match=message):
        read_path(values)


def test_paths_survive_json():
    for values in (
        {'kind': 'straight', 'course_deg': 0.1, 'length_m': 9.0},
        {'kind': 'waypoints', 'waypoints': TURNS},
        {'kind': 'spline', 'waypoints': TURNS},
        {'kind': 'helix', 'radius_m': 50.0, 'turns': 1.0, 'slope_deg': 5.0},
    ):
        path = read_path(values)
        assert pydantic.TypeAdapter(PathSettings).validate_json(path.model_dump_json()) == path


def test_every_field_says_what_it_is():
    for model in (StraightPath, WaypointPath, SplinePath, HelixPath):
        for name, entry in model.model_json_schema()['properties'].items():
            assert name == 'kind' or entry['description'].endswith('.'), name


def test_turn_of_a_helix_is_its_curvature():
    for direction, sign in (('cw', 1.0), ('ccw', -1.0)):
        path = HelixPath(
            kind='helix', centre=(0.0, 0.0), radius_m=150.0, direction=direction, slope_deg=30.0,
            turns=2.0,
        )  # fmt: skip
        # horizontal way is cos(slope) of the way
        expected = sign * np.cos(np.radians(30.0)) / 150.0
        assert path_turn(200.0, path.params()) == pytest.approx(expected, rel=1e-9)


def test_corner_of_a_survey_is_not_a_turn():
    path = WaypointPath(kind='waypoints', waypoints=[(0.0, 0.0), (100.0, 0.0), (100.0, 100.0)])
    assert [path_turn(s, path.params()) for s in (50.0, 99.5, 150.0)] == [0.0, 0.0, 0.0]
