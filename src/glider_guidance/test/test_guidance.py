# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""Guidance as a whole, with a vehicle that flies exactly as it is asked to."""

import math
from typing import NamedTuple

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from glider_base.frames import quaternion_from_euler, rotate_to_body
from glider_base.kernel import kernel
from glider_base.signals import TICK_S, Odometry
from glider_base.wiring import NO_ECHO
from glider_guidance.current_observer import ObserverState
from glider_guidance.guidance import INFEASIBLE_S, WaterState, guidance_abort, guidance_step
from glider_guidance.path.settings import HelixPath, StraightPath, WaypointPath
from glider_guidance.settings import GuidanceSettings
from glider_guidance.yo.stage import GLIDING_DOWN, INFLECTING_UP, SURFACING
from glider_model.onboard.glide_polar import glide_horizontal_speed
from glider_model.onboard.learnt_steering import SteeringLearningSettings, lookahead

quick = settings(max_examples=25)

#: Slower than this a vehicle may fly worse than its polar says (m/s).
STALL_RATE = 0.15
#: The vertical rate follows the one asked for with this time constant (s).
LAG_S = 40.0
COLUMNS = (
    'n e d t_n t_e t_d phi theta psi v_n v_e v_d phi_dot theta_dot psi_dot '
    'e1 e2 e3 c_n c_e c_d stage infeasible'
).split()


class Point(NamedTuple):
    """Where the vehicle is, how it points and sinks."""

    n: float
    e: float
    d: float
    theta: float
    psi: float
    rate: float


@kernel
def _odometry(point, current, polar, stall=1.0):
    q = quaternion_from_euler(0.0, point.theta, point.psi)
    horizontal = glide_horizontal_speed(point.theta, point.rate, polar)
    if abs(point.rate) < STALL_RATE:
        horizontal *= stall
    v_n = horizontal * math.cos(point.psi) + current[0]
    v_e = horizontal * math.sin(point.psi) + current[1]
    u, v, w = rotate_to_body(q[0], q[1], q[2], q[3], v_n, v_e, point.rate)
    odometry = Odometry(point.n, point.e, point.d, q[0], q[1], q[2], q[3], u, v, w, 0.0, 0.0, 0.0)
    return odometry, v_n, v_e


@kernel
def _fly(state, point, current, stall, params, rows, dt):
    for i in range(len(rows)):
        odometry, v_n, v_e = _odometry(point, current, params.polar, stall)
        state, output = guidance_step(state, odometry, NO_ECHO, params, dt)
        reference = output.reference
        rows[i, 0], rows[i, 1], rows[i, 2] = point.n, point.e, point.d
        for j, number in enumerate(reference):
            rows[i, 3 + j] = number
        for j, number in enumerate(output.error):
            rows[i, 15 + j] = number
        for j, number in enumerate(output.current):
            rows[i, 18 + j] = number
        rows[i, 21], rows[i, 22] = output.stage, output.infeasible
        d = point.d + dt * point.rate
        rate = point.rate + dt / LAG_S * (reference.v_d - point.rate)
        if d < 0.0:
            d, rate = 0.0, 0.0
        point = Point(
            point.n + dt * v_n, point.e + dt * v_e, d, reference.theta, reference.psi, rate
        )
    return state, point


class Flight:
    """A flight: ``flight.e2`` and so on are the columns of its log, angles in rad."""

    def __init__(
        self, guidance, start=(0.0, 0.0, 0.0), current=(0.0, 0.0), psi=0.0, theta=0.0, stall=1.0
    ):
        self.stall = stall
        self.params = guidance.params()
        self.state = guidance.initial_state()
        self.point = Point(*(float(x) for x in start), float(theta), float(psi), 0.0)
        self.current = tuple(float(x) for x in current)
        self.log = np.empty((0, len(COLUMNS)))

    def fly(self, seconds):
        rows = np.empty((round(seconds / TICK_S), len(COLUMNS)))
        self.state, self.point = _fly(
            self.state, self.point, self.current, self.stall, self.params, rows, TICK_S
        )
        self.log = np.concatenate([self.log, rows])
        return self

    def __getattr__(self, name):
        return self.log[:, COLUMNS.index(name)]


def straight(course_deg=0.0, start=(0.0, 0.0), **fields):
    """Guidance along a straight path; other sections by name."""
    path = StraightPath(kind='straight', course_deg=course_deg, start=start, length_m=50000.0)
    return GuidanceSettings.model_validate({'path': path, **fields})


def turned(vector, angle):
    """Horizontal vectors turned clockwise by an angle (rad)."""
    c, s = math.cos(angle), math.sin(angle)
    return np.asarray(vector) @ np.array([[c, s], [-s, c]])


def wrapped(angle):
    return (angle + math.pi) % (2.0 * math.pi) - math.pi


def step(guidance, point, current=(0.0, 0.0), observer=(0.0, 0.0, 0.0, 0.0)):
    """Output of one tick at a point, with a given estimate."""
    params = guidance.params()
    state = guidance.initial_state()._replace(water=WaterState(ObserverState(*observer), 0.0))
    odometry, _, _ = _odometry(Point(*(float(x) for x in point)), current, params.polar)
    return guidance_step(state, odometry, NO_ECHO, params, TICK_S)


LEGS = [(0.0, 0.0), (500.0, 0.0), (500.0, 400.0), (1500.0, 900.0)]


@pytest.mark.parametrize('angle_deg', [37.0, 90.0, 143.0, 180.0, -101.0])
@pytest.mark.parametrize('method', ['los_current', 'los_zhang2021'])
def test_turned_and_shifted_world_gives_the_same_flight(method, angle_deg):
    """Path, current and vehicle turned and shifted together, over three legs: 1 mm, 1e-6 rad."""
    angle, shift = math.radians(angle_deg), np.array([5000.0, -12000.0])
    flights = []
    for a, offset in ((0.0, np.zeros(2)), (angle, shift)):
        path = WaypointPath(
            kind='waypoints', waypoints=[tuple(turned(leg, a) + offset) for leg in LEGS]
        )
        guidance = GuidanceSettings.model_validate(
            {'path': path, 'los': {'method': method, 'delta1_m': 200.0}}
        )
        start = (*(turned((-50.0, 60.0), a) + offset), 0.0)
        flights.append(
            Flight(guidance, start, turned((0.15, 0.1), a), psi=wrapped(0.4 + a)).fly(3600.0)
        )
    one, other = flights
    positions = np.stack([one.n, one.e], axis=1)
    there = np.stack([other.n, other.e], axis=1)
    assert np.abs(there - turned(positions, angle) - shift).max() < 1e-3
    assert np.abs(wrapped(other.psi - one.psi - angle)).max() < 1e-6
    assert np.abs(other.e2 - one.e2).max() < 1e-3


@pytest.mark.parametrize('course_deg', [180.0, -180.0, 179.9, 270.0, 90.0, 0.0])
def test_heading_reference_has_no_jump(course_deg):
    """Also on a course whose crab angle crosses the seam of +-180 deg."""
    course = math.radians(course_deg)
    guidance = straight(course_deg)
    current = turned((0.0, 0.12), course)
    flight = Flight(guidance, (*turned((0.0, 30.0), course), 0.0), current, wrapped(course))
    flight.fly(3000.0)
    steps = wrapped(np.diff(flight.psi))
    assert np.max(np.abs(steps)) <= guidance.filters.heading_rate_radps * TICK_S + 1e-12
    # the crab of 0.12 m/s is 17 deg, the approach from 30 m adds 37 deg
    assert np.max(np.abs(wrapped(flight.psi - course))) < math.radians(60.0)


def test_leg_due_south_after_one_due_east_turns_by_the_short_way():
    path = WaypointPath(kind='waypoints', waypoints=[(0, 0), (0, 400), (-800, 399.9)])
    guidance = GuidanceSettings.model_validate({'path': path})
    flight = Flight(guidance, psi=math.pi / 2.0).fly(3000.0)
    heading = np.unwrap(flight.psi)
    assert heading[-1] == pytest.approx(math.pi, abs=math.radians(1.0))
    assert np.min(heading) > math.radians(85.0)


@quick
@given(st.floats(-math.pi, math.pi), st.floats(0.0, 0.25), st.floats(-math.pi, math.pi))
def test_vehicle_comes_onto_the_path_in_a_current_slower_than_itself(course, speed, angle):
    """Within 0.1 m of it after 4000 s from 100 m beside, the estimate within 1 mm/s."""
    guidance = straight(math.degrees(course), profile={'depth_m': 5000.0})
    current = turned((speed, 0.0), angle)
    start = (*turned((0.0, 100.0), course), 0.0)
    flight = Flight(guidance, start, current, course).fly(4000.0)
    assert abs(flight.e2[-1]) < 0.1
    assert (flight.c_n[-1], flight.c_e[-1]) == pytest.approx(current, abs=1e-3)


@pytest.mark.parametrize('beside', [400.0, 1500.0])
def test_vehicle_comes_onto_the_path_in_a_faster_current_that_it_can_balance(beside):
    """1.0 kn at 8 deg: the course of the path is feasible, a course square to it is not."""
    guidance = straight(profile={'depth_m': 5000.0})
    current = turned((0.5144, 0.0), math.radians(8.0))
    flight = Flight(guidance, (0.0, beside, 0.0), current).fly(9000.0)
    assert abs(flight.e2[-1]) < 0.1


@pytest.mark.parametrize('stall', [0.0, 1.0, 3.0])
def test_estimate_survives_the_turn_at_depth(stall):
    """Within 1 cm/s of the current after 1500 s, however the vehicle flies while it turns over."""
    guidance = straight(profile={'depth_m': 400.0})
    flight = Flight(guidance, current=(0.2, 0.1), stall=stall).fly(4000.0)
    assert INFLECTING_UP in flight.stage
    late = slice(round(1500.0 / TICK_S), None)
    assert flight.c_n[late] == pytest.approx(0.2, abs=0.01)
    assert flight.c_e[late] == pytest.approx(0.1, abs=0.01)


def test_heading_is_held_while_the_vehicle_turns_over():
    filters = {'heading_frequency_radps': 0.2}
    guidance = straight(profile={'depth_m': 250.0}, filters=filters)
    flight = Flight(guidance, current=(0.0, 0.15)).fly(2500.0)
    turn = np.flatnonzero(flight.stage == INFLECTING_UP)
    # the filter comes to rest within half a minute
    held = flight.psi[turn[round(30.0 / TICK_S) :]]
    assert len(held) > 50
    assert np.ptp(held) < math.radians(0.05)


def test_first_reference_is_the_measured_attitude():
    _, output = step(straight(), (3.0, -8.0, 0.0, 0.2, 2.5, 0.0))
    assert output.reference.theta == pytest.approx(0.2, abs=0.03 * TICK_S)
    assert output.reference.psi == pytest.approx(2.5, abs=0.012 * TICK_S)


@quick
@given(st.floats(1.0, 40000.0), st.floats(-500.0, 500.0), st.floats(-3.0, 3.0))
def test_virtual_target_starts_at_the_closest_point(ahead, beside, course):
    position = turned((ahead, beside), course)
    _, output = step(straight(math.degrees(course)), (*position, 0.0, 0.0, course, 0.0))
    assert output.error.e1 == pytest.approx(0.0, abs=1e-6)
    assert output.error.e2 == pytest.approx(beside, abs=1e-6)
    assert (output.reference.p_n, output.reference.p_e) == pytest.approx(
        turned((ahead, 0.0), course), abs=1e-6
    )


def test_cross_track_error_is_positive_to_starboard():
    _, output = step(straight(90.0), (-5.0, 10.0, 0.0, 0.0, 0.0, 0.0))
    assert output.error.e2 == pytest.approx(5.0, abs=1e-9), 'm: path due east, vehicle south of it'


def test_cross_current_faster_than_the_vehicle_is_infeasible_after_a_while():
    guidance = straight()
    params = guidance.params()
    state = guidance.initial_state()._replace(
        water=WaterState(ObserverState(0.0, 0.0, 0.0, 0.6), 0.0)
    )
    odometry, _, _ = _odometry(Point(0.0, 0.0, 0.0, 0.0, 0.0, 0.0), (0.0, 0.0), params.polar)
    flags = []
    for _ in range(round(INFEASIBLE_S / TICK_S) + 5):
        state, output = guidance_step(state, odometry, NO_ECHO, params, TICK_S)
        flags.append(output.infeasible)
    assert flags.index(True) == pytest.approx(INFEASIBLE_S / TICK_S, abs=1.0)
    assert all(flags[flags.index(True) :])


def test_approach_from_far_does_not_make_a_feasible_course_infeasible():
    """0.5 m/s along the path cannot be balanced while flying square to it, but need not be."""
    flight = Flight(straight(), (0.0, 2000.0, 0.0), (0.5, 0.1)).fly(3000.0)
    assert not flight.infeasible.any()


@quick
@given(st.floats(-0.5, 0.5), st.floats(-0.5, 0.5), st.floats(-500.0, 500.0))
def test_paper_method_ignores_the_estimate(current_n, current_e, beside):
    guidance = straight(los={'method': 'los_zhang2021'})
    point = (10.0, beside, 0.0, 0.0, 1.0, 0.0)
    _, plain = step(guidance, point)
    _, told = step(guidance, point, observer=(0.0, 0.0, current_n, current_e))
    assert told.reference == plain.reference


def test_observer_method_crabs_into_the_estimate():
    _, plain = step(straight(), (0.0, 0.0, 0.0, 0.0, 0.0, 0.0))
    _, told = step(straight(), (0.0, 0.0, 0.0, 0.0, 0.0, 0.0), observer=(0.0, 0.0, 0.0, 0.2))
    assert told.reference.psi < plain.reference.psi, 'current to starboard: head to port'


def test_paper_method_drifts_off_the_path_where_the_other_does_not():
    """Steady offset of a line of sight without compensation: Delta tan(crab) = 60 tan(28 deg)."""
    fields = {'profile': {'depth_m': 5000.0}}
    paper = {'los': {'method': 'los_zhang2021', 'delta1_m': 60.0}}
    flight = Flight(straight(**fields, **paper), current=(0.0, 0.2)).fly(3500.0)
    speed = flight.state.water.speed
    expected = 60.0 * 0.2 / math.sqrt(speed**2 - 0.2**2)
    assert flight.e2[-1] == pytest.approx(expected, rel=0.02)
    assert abs(Flight(straight(**fields), current=(0.0, 0.2)).fly(3500.0).e2[-1]) < 0.1


def slope_guidance():
    """A leg that descends at 30 deg, flown in three dimensions."""
    path = WaypointPath(kind='waypoints', waypoints=[(0, 0, 100), (1000, 0, 677.35)])
    return GuidanceSettings.model_validate({'path': path, 'profile': {'mode': 'path'}})


def test_in_path_mode_the_pitch_follows_the_error_below_the_path():
    """10 m above: steeper down; 10 m below: shallower, than on the path; at the same speed."""
    pitches = {}
    for offset in (-10.0, 0.0, 10.0):
        state, output = step(slope_guidance(), (100.0, 0.0, 157.735 + offset, -0.5, 0.0, 0.25))
        assert math.copysign(1.0, output.error.e3) == math.copysign(1.0, offset) or offset == 0.0
        pitches[offset] = state.commanded.pitch.value
    assert pitches[-10.0] < pitches[0.0] < pitches[10.0]


@pytest.mark.parametrize('offset', [-20.0, 20.0])
def test_in_path_mode_the_vehicle_comes_onto_a_slope(offset):
    """From 20 m above or below: within 0.5 m after 800 s."""
    flight = Flight(slope_guidance(), (50.0, 10.0, 128.87 + offset), theta=-0.5).fly(800.0)
    assert abs(flight.e3[-1]) < 0.5
    assert abs(flight.e2[-1]) < 0.5


def test_helix_is_followed_in_three_dimensions():
    """Around 150 m at 31.6 deg: within 3 m across and 1 m vertically, once settled."""
    path = HelixPath(
        kind='helix', centre=(0.0, 0.0, 20.0), radius_m=150.0, slope_deg=31.6, turns=2.0
    )
    guidance = GuidanceSettings.model_validate({'path': path, 'profile': {'mode': 'path'}})
    flight = Flight(guidance, (0.0, -150.0, 20.0), theta=-0.5).fly(2500.0)
    late = slice(round(800.0 / TICK_S), None)
    assert np.max(np.abs(flight.e2[late])) < 3.0
    assert np.max(np.abs(flight.e3[late])) < 1.0


@pytest.mark.parametrize('mode', ['profile', 'path'])
def test_abort_turns_the_vehicle_up(mode):
    guidance = slope_guidance() if mode == 'path' else straight(profile={'depth_m': 500.0})
    flight = Flight(guidance, (0.0, 0.0, 100.0 if mode == 'path' else 0.0)).fly(700.0)
    assert flight.v_d[-1] > 0.0
    flight.state = guidance_abort(flight.state)
    flight.fly(300.0)
    assert flight.stage[-1] == SURFACING
    assert flight.v_d[-1] < 0.0
    assert flight.theta[-1] == pytest.approx(flight.params.profile.pitch, abs=1e-3)


def test_desired_velocity_is_along_the_course_at_the_speed_through_the_water():
    flight = Flight(straight(60.0, profile={'depth_m': 5000.0})).fly(3000.0)
    speed = flight.state.water.speed
    assert (flight.v_n[-1], flight.v_e[-1]) == pytest.approx(
        turned((speed, 0.0), math.radians(60.0)), abs=1e-6
    )


def test_reference_rates_are_the_derivatives_of_the_reference():
    flight = Flight(straight(200.0), (0.0, 50.0, 0.0), (0.1, 0.1), psi=0.3).fly(1000.0)
    assert flight.psi_dot[1:] == pytest.approx(wrapped(np.diff(flight.psi)) / TICK_S, abs=1e-9)
    assert flight.theta_dot[1:] == pytest.approx(np.diff(flight.theta) / TICK_S, abs=1e-9)


def weak(b, k=-0.3):
    """Estimate of a phase, sure of its steering b (rad/s) and kick k."""
    prior = SteeringLearningSettings().initial_state().dive
    return prior._replace(b=b, k=k, p=(1e-12, *prior.p[1:]))


def steered(state, **phases):
    """State of guidance that knows its vehicle to steer so."""
    steering = state.followed.steering._replace(**phases)
    return state._replace(followed=state.followed._replace(steering=steering))


def test_turn_over_is_flown_on_the_heading_of_a_steady_glide():
    """The crab for the speed that pitch and rate ask for, whatever the speed before the turn."""
    guidance = straight(profile={'depth_m': 250.0})
    flight = Flight(guidance, current=(0.0, 0.15)).fly(2500.0)
    turn = np.flatnonzero(flight.stage == INFLECTING_UP)
    speed = guidance.params().profile_speed
    assert flight.psi[turn[-1]] == pytest.approx(-math.asin(0.15 / speed), abs=math.radians(0.3))


def test_vehicle_that_steers_weakly_approaches_by_a_smaller_angle():
    """30 m beside the path: the angle goes with the lookahead, and in the weak phase only."""
    headings, dive_s = {}, {}
    less = weak(0.003)
    for name, phases in (('none', {}), ('dive', {'dive': less}), ('climb', {'climb': less})):
        guidance = straight(0.0)
        params = guidance.params()
        point = Point(100.0, 30.0, 300.0, -0.5, 0.0, 0.25)
        odometry, _, _ = _odometry(point, (0.0, 0.0), params.polar)
        state, _ = guidance_step(guidance.initial_state(), odometry, NO_ECHO, params, TICK_S)
        state = steered(state, **phases)._replace(
            profile=state.profile._replace(stage=GLIDING_DOWN, ticks=0),
        )
        for _ in range(500):
            state, output = guidance_step(state, odometry, NO_ECHO, params, TICK_S)
        headings[name] = output.reference.psi
        dive_s[name] = lookahead(state.followed.steering, True, params.steering)
    assert headings['none'] < -0.2
    assert dive_s['dive'] > 1.5 * dive_s['none'] == 1.5 * dive_s['climb']
    assert headings['none'] < 1.2 * headings['dive'] < 0.0
    assert headings['climb'] == headings['none']


def test_the_target_is_led_on_by_no_more_than_three_metres_per_second():
    """Along a path whose parameter is no length of it, to a vehicle that is set to its end."""
    legs = [(0.0, 0.0), (400.0, 300.0), (800.0, -300.0), (1600.0, 0.0)]
    guidance = GuidanceSettings.model_validate({'path': {'kind': 'spline', 'waypoints': legs}})
    flight = Flight(guidance).fly(5.0)
    flight.point = flight.point._replace(n=1600.0, e=0.0)
    flight.fly(200.0)
    fast = np.hypot(np.diff(flight.t_n), np.diff(flight.t_e))[60:] / TICK_S
    assert fast.max() == pytest.approx(3.0, rel=1e-3)
