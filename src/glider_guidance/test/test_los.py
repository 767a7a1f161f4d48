# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""Line of sight: angles against rotation matrices, crab against the velocity triangle."""

import math

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from glider_base.frames import wrap_angle
from glider_guidance.los import (
    approach_angles,
    approach_heading,
    crab_heading,
    desired_direction,
    target_rate,
)
from glider_guidance.path.curve import path_angles, path_errors, path_point, path_tangent
from glider_guidance.path.settings import HelixPath, SplinePath

quick = settings(max_examples=100)

courses = st.floats(-math.pi, math.pi)
elevations = st.floats(-1.4, 1.4)
errors = st.floats(-2000.0, 2000.0)
lookaheads = st.floats(1.0, 5000.0)
ratios = st.floats(0.05, 20.0)
water_speeds = st.floats(-1.5, 1.5)


def path_frame(gamma, rho):
    """R_NP = Rz(gamma) Ry(rho), from the two elementary rotations."""
    cg, sg, cr, sr = math.cos(gamma), math.sin(gamma), math.cos(rho), math.sin(rho)
    R_z = np.array([[cg, -sg, 0.0], [sg, cg, 0.0], [0.0, 0.0, 1.0]])
    R_y = np.array([[cr, 0.0, sr], [0.0, 1.0, 0.0], [-sr, 0.0, cr]])
    return R_z @ R_y


def unit(course, elevation):
    """Unit vector of a course and an elevation (+ up) in NED axes."""
    return np.array(
        [
            math.cos(elevation) * math.cos(course),
            math.cos(elevation) * math.sin(course),
            -math.sin(elevation),
        ]
    )


def approach(gamma_d, rho_d, e2, e3, delta_1, delta_2):
    """Direction flown (NED) at path-frame errors e2, e3 (m)."""
    chi, upsilon = desired_direction(gamma_d, rho_d, *approach_angles(e2, e3, delta_1, delta_2))
    return unit(chi, upsilon)


@quick
@given(courses, elevations, elevations, elevations)
def test_direction_is_the_approach_turned_by_the_path_frame(gamma_d, rho_d, gamma_r, rho_r):
    """Equation (10) against matrices; asin near the vertical costs half the digits."""
    chi, upsilon = desired_direction(gamma_d, rho_d, gamma_r, rho_r)
    expected = path_frame(gamma_d, rho_d) @ unit(gamma_r, rho_r)
    assert unit(chi, upsilon) == pytest.approx(expected, abs=1e-7)


@quick
@given(errors, errors, lookaheads, ratios)
def test_approach_aims_at_the_point_one_lookahead_ahead(e2, e3, delta_1, delta_2):
    """From above the line of sight meets the path delta_1 ahead; steepness by equation (9)."""
    gamma_r, rho_r = approach_angles(e2, e3, delta_1, delta_2)
    assert math.tan(gamma_r) * delta_1 == pytest.approx(-e2, rel=1e-9, abs=1e-9)
    distance = delta_2 * math.hypot(e2, delta_1)
    assert math.tan(rho_r) * distance == pytest.approx(e3, rel=1e-9, abs=1e-9)


@quick
@given(courses, st.floats(-1.0, 1.0), errors, errors, lookaheads, ratios)
def test_approach_reduces_the_error_on_either_side(gamma_d, rho_d, e2, e3, delta_1, delta_2):
    assume(abs(e2) > 0.01 and abs(e3) > 0.01)
    flown = path_frame(gamma_d, rho_d).T @ approach(gamma_d, rho_d, e2, e3, delta_1, delta_2)
    assert flown[0] > 0.0, 'never backwards along the path'
    assert flown[1] * e2 < 0.0, 'starboard of the path: to port, and the other way round'
    assert flown[2] * e3 < 0.0, 'below the path: up, and the other way round'


@quick
@given(courses, st.floats(-1.2, 1.2))
def test_on_the_path_the_direction_is_that_of_the_path(gamma_d, rho_d):
    assert approach(gamma_d, rho_d, 0.0, 0.0, 40.0, 1.0) == pytest.approx(
        path_frame(gamma_d, rho_d)[:, 0], abs=1e-7
    )


@pytest.mark.parametrize('side', [-1.0, 1.0])
@pytest.mark.parametrize('height', [-1.0, 1.0])
def test_point_that_flies_the_direction_comes_onto_the_path(side, height):
    """A point at 0.5 m/s from 200 m beside and 100 m above or below a sloping path."""
    gamma_d, rho_d = 2.9, -0.4
    R_NP = path_frame(gamma_d, rho_d)
    position = R_NP @ np.array([0.0, side * 200.0, height * 100.0])
    for _ in range(6000):
        _, e2, e3 = R_NP.T @ position
        position = position + 0.5 * 0.5 * approach(gamma_d, rho_d, e2, e3, 40.0, 1.0)
    _, e2, e3 = R_NP.T @ position
    assert abs(e2) < 1e-3
    assert abs(e3) < 1e-3


@quick
@given(courses, st.floats(0.05, 1.5), water_speeds, water_speeds)
def test_crab_makes_good_the_course(course, speed, current_n, current_e):
    """The velocity triangle: way through the water plus current is along the course."""
    heading, progress, feasible = crab_heading(course, speed, current_n, current_e)
    assume(feasible)
    ground = speed * unit(heading, 0.0)[:2] + np.array([current_n, current_e])
    assert ground == pytest.approx(progress * unit(course, 0.0)[:2], abs=1e-7)


@quick
@given(courses, st.floats(0.05, 1.5), water_speeds, water_speeds)
def test_course_is_infeasible_exactly_when_no_heading_holds_it(
    course, speed, current_n, current_e
):
    current = np.array([current_n, current_e])
    along = float(current @ unit(course, 0.0)[:2])
    across = float(current @ unit(course + math.pi / 2.0, 0.0)[:2])
    room = speed * speed - across * across
    held = along + math.sqrt(max(room, 0.0))
    assume(abs(room) > 1e-9 and abs(held) > 1e-9)
    _, _, feasible = crab_heading(course, speed, current_n, current_e)
    assert feasible == (room > 0.0 and held > 0.0)


@pytest.mark.parametrize('share', [-0.5, 0.6, 1.1])
def test_error_of_the_current_ends_where_it_is_balanced(share):
    """At Delta1 |w| / P / sqrt(1 - (w / V)^2); an error above V carries it off."""
    course, speed, lookahead, e2 = 0.4, 0.4, 60.0, 0.0
    estimate = -0.1 * math.sin(course), 0.1 * math.cos(course)  # 0.1 m/s to starboard
    _, progress, _ = crab_heading(course, speed, *estimate)
    error = share * progress
    for _ in range(40000):
        gamma_r, _ = approach_angles(e2, 0.0, lookahead, 1.0)
        heading = approach_heading(course, gamma_r, progress, speed, *estimate)
        e2 += 1.0 * (0.1 + error + speed * math.sin(heading - course))
    most = min(progress, 0.9 * speed - 0.1 * math.copysign(1.0, error))
    if abs(error) < most:
        balanced = lookahead * error / progress / math.sqrt(1.0 - (error / most) ** 2)
        assert e2 == pytest.approx(balanced, rel=1e-6)
    else:
        assert abs(e2) > 50.0


@quick
@given(
    courses,
    st.floats(0.1, 0.5),
    st.floats(0.0, 4.0),
    st.floats(-0.3, 0.3),
    st.floats(30.0, 200.0),
    st.sampled_from([-500.0, 500.0]),
)
def test_the_turn_onto_the_path_is_one_that_a_glider_can_follow(
    course, speed, following, crossing, lookahead_s, e2
):
    """From afar, with whatever current behind it, and on the path at the end."""
    sine, cosine = math.sin(course), math.cos(course)
    along, across = following * speed, crossing * speed
    current = (along * cosine - across * sine, along * sine + across * cosine)
    progress = speed * math.sqrt(1.0 - crossing**2) + along
    turns, before = [], None
    for _ in range(12000):
        gamma_r, _ = approach_angles(e2, 0.0, lookahead_s * progress, 1.0)
        heading = approach_heading(course, gamma_r, progress, speed, *current)
        turns.append(0.0 if before is None else abs(wrap_angle(heading - before)))
        before, e2 = heading, e2 + across + speed * math.sin(heading - course)
    assert max(turns) < 0.9 / lookahead_s
    assert abs(e2) < 1e-3


@quick
@given(courses, st.floats(0.1, 0.5), st.floats(-0.95, 0.69), st.sampled_from([-1.0, 1.0]))
def test_a_path_is_come_to_by_as_much_as_the_current_across_leaves(course, speed, against, side):
    """Square to it, in a current along it that is faster than the vehicle."""
    along, starboard = unit(course, 0.0)[:2], unit(course + math.pi / 2.0, 0.0)[:2]
    across = -side * against * speed
    current = 4.0 * speed * along + across * starboard
    heading = approach_heading(course, side * math.pi / 2.0, 4.0 * speed, speed, *current)
    comes = side * (across + speed * math.sin(heading - course))
    assert comes == pytest.approx(max(0.3, 0.9 - against) * speed, rel=1e-6)


@quick
@given(courses, st.floats(0.05, 0.5), st.floats(1.001, 5.0), st.sampled_from([-1.0, 1.0]))
def test_infeasible_course_is_flown_square_to_it_against_the_current(course, speed, excess, side):
    starboard = unit(course + math.pi / 2.0, 0.0)[:2]
    current = side * excess * speed * starboard
    heading, _, feasible = crab_heading(course, speed, current[0], current[1])
    assert not feasible
    assert unit(heading, 0.0)[:2] == pytest.approx(-side * starboard, abs=1e-9)
    approaching = approach_heading(course, 0.0, speed, speed, *current)
    assert unit(approaching, 0.0)[:2] == pytest.approx(-side * starboard, abs=1e-9)


@quick
@given(courses, st.floats(0.0, 2.0), st.floats(-3.0, 3.0), st.floats(-3.0, 3.0))
def test_crab_is_always_a_finite_heading(course, speed, current_n, current_e):
    heading, progress, _ = crab_heading(course, speed, current_n, current_e)
    assert abs(heading) <= math.pi + 1e-12
    assert math.isfinite(progress)


@quick
@given(
    st.floats(-3.0, 3.0),
    errors,
    st.floats(0.1, 3.0),
    st.floats(1e-3, 5.0),
    st.floats(0.5, 5.0),
)
def test_target_rate_is_equation_7_within_its_bounds(progress, e1, slope, delta, rate_max):
    rate = target_rate(progress, e1, slope, delta, rate_max)
    assert rate == pytest.approx(
        np.clip((progress + delta * e1) / slope, 0.0, rate_max), rel=1e-12
    )


HELIX = HelixPath(
    kind='helix',
    centre=(30.0, -20.0, 50.0),
    radius_m=120.0,
    course_deg=25.0,
    slope_deg=28.0,
    turns=3.0,
    direction='ccw',
)
SPLINE = SplinePath(
    kind='spline',
    waypoints=[(0.0, 0.0, 10.0), (200.0, 50.0, 80.0), (350.0, 300.0, 60.0), (300.0, 600.0, 200.0)],
)


@pytest.mark.parametrize('path', [HELIX, SPLINE], ids=['helix', 'spline'])
@quick
@given(
    share=st.floats(0.05, 0.95),
    offset=st.tuples(*3 * [st.floats(-50.0, 50.0)]),
    speed=st.floats(0.1, 1.5),
    gamma_r=st.floats(-1.3, 1.3),
    rho_r=st.floats(-1.3, 1.3),
    s_rate=st.floats(0.0, 2.0),
)
def test_error_kinematics(path, share, offset, speed, gamma_r, rho_r, s_rate):
    """Equation (6), corrected, against central differences of the errors.

    e1' = H c(gamma_r) c(rho_r) - H_d + gamma_d' c(rho_d) e2 - rho_d' e3
    e2' = H s(gamma_r) c(rho_r) - gamma_d' c(rho_d) e1 - gamma_d' s(rho_d) e3
    e3' = -H s(rho_r) + gamma_d' s(rho_d) e2 + rho_d' e1
    """
    params = path.params()
    s = share * params.knots[-1]
    # a spline's curvature has a kink in its derivative at a waypoint
    assume(min(abs(s - knot) for knot in params.knots) > 0.1)
    gamma_d, rho_d = path_angles(*path_tangent(s, params))
    position = np.array(path_point(s, params)) + path_frame(gamma_d, rho_d) @ np.array(offset)
    velocity = speed * path_frame(gamma_d, rho_d) @ unit(gamma_r, rho_r)

    def moved(t):
        at = s + t * s_rate
        angles = path_angles(*path_tangent(at, params))
        e = path_errors(*(position + t * velocity), at, *angles, params)
        return np.array([*e, *angles])

    step = 1e-3
    change = moved(step) - moved(-step)
    change[3] = (change[3] + math.pi) % (2.0 * math.pi) - math.pi
    rate = change / (2.0 * step)
    e1, e2, e3 = path_errors(*position, s, gamma_d, rho_d, params)
    gamma_rate, rho_rate = rate[3], rate[4]
    H_d = np.linalg.norm(path_tangent(s, params)) * s_rate
    c, s_ = math.cos, math.sin
    expected = [
        speed * c(gamma_r) * c(rho_r) - H_d + gamma_rate * c(rho_d) * e2 - rho_rate * e3,
        speed * s_(gamma_r) * c(rho_r) - gamma_rate * c(rho_d) * e1 - gamma_rate * s_(rho_d) * e3,
        -speed * s_(rho_r) + gamma_rate * s_(rho_d) * e2 + rho_rate * e1,
    ]
    assert rate[:3] == pytest.approx(expected, abs=1e-5)
