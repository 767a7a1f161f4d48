# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""Dead reckoning over dives that are known, in a constant current; its covariance by lot."""

import math

import numpy as np
import pytest

from glider_base.frames import odometry_from_wire
from glider_base.kernel import kernel
from glider_base.signals import TICK_S, Imu, Joints, Vector
from glider_model.ocean.density import SURFACE_PRESSURE
from glider_model.onboard.glide_polar import make_polar
from glider_model.vehicle.file import load_vehicle
from glider_navigation.block import navigation_tick
from glider_navigation.current_estimate import Uncertainty, initial_estimate
from glider_navigation.forecast import ForecastSettings, Trust, forecast_at, make_forecast, weigh
from glider_navigation.intake import is_refusing, take_in
from glider_navigation.method import Fix, Received, method_step
from glider_navigation.methods.dead_reckoned import Way, _dive, _unforeseen, place_covariance
from glider_navigation.phase import AT_SURFACE, FIXED, UNDER_WATER
from glider_navigation.settings import NavigationSettings
from glider_navigation.surface_interval import begin, drifted_variance, wait

#: Current and drift at the surface (m/s, north and east), and how the vehicle flies.
CURRENT, DRIFT = np.array([0.12, -0.09]), np.array([0.20, -0.02])
PITCH, RATE = math.radians(25.0), 0.16
#: Time at the surface, and of a way to 400 m and back (s); variance of a fix (m^2).
STAY_S, WAY_S, FIX_VARIANCE = 600.0, 5000.0, 25.0
COLUMNS = ('n', 'e', 'depth', 'nn', 'ne', 'ee', 'current_n', 'current_e', 'current_nn', 'phase')


@kernel
def _navigate(state, q, depths, has_fix, places, variance, params, dt):
    rows = np.empty((len(q), 10))
    odom = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    for i in range(len(q)):
        received = Received(
            Joints(0.0, 0.0, 0.0, 0.0),
            odom,
            odometry_from_wire(odom),
            Imu(q[i, 0], q[i, 1], q[i, 2], q[i, 3], 0.0, 0.0, 0.0, False),
            depths[i],
            Fix(has_fix[i], places[i, 0], places[i, 1], variance),
            0.0,
        )
        state, is_ = method_step(state, received, params, dt)
        x = odometry_from_wire(is_.odom)
        rows[i, 0], rows[i, 1], rows[i, 2] = x.p_n, x.p_e, x.p_d
        rows[i, 3], rows[i, 4], rows[i, 5] = is_.place.nn, is_.place.ne, is_.place.ee
        rows[i, 6], rows[i, 7] = is_.current.n, is_.current.e
        rows[i, 8], rows[i, 9] = is_.current_covariance.nn, is_.phase
    return rows, state


class Dives:
    """Ways under water, each after a stay at the surface; what the sensors say, tick by tick."""

    def __init__(self, headings_deg, speed, has_fixes, quaternions):
        stay, way = round(STAY_S / TICK_S), round(WAY_S / TICK_S)
        count = len(headings_deg)
        half = RATE * TICK_S * np.arange(way // 2)
        down_up = np.concatenate([half, half[-1] - half])
        self.depths = np.tile(np.concatenate([np.zeros(stay), down_up]), count)
        glides = np.concatenate([np.zeros(stay), np.ones(way)])
        pitch = PITCH * np.concatenate([np.zeros(stay), -np.ones(way // 2), np.ones(way // 2)])
        self.glides = np.tile(glides, count) > 0.0
        psi = np.radians(np.repeat(headings_deg, stay + way))
        through = speed * np.tile(glides, count)[:, None] * np.stack([np.cos(psi), np.sin(psi)], 1)
        ground = through + np.where(self.glides[:, None], CURRENT, DRIFT)
        self.places = np.concatenate([np.zeros((1, 2)), np.cumsum(TICK_S * ground, axis=0)[:-1]])
        self.has_fix = ~self.glides & np.repeat(np.broadcast_to(has_fixes, count), stay + way)
        # a fix takes its time after coming up
        self.has_fix &= np.tile(np.arange(stay + way), count) * TICK_S > 120.0
        # no two samples are alike: a little sea in roll
        phi = np.radians(np.random.default_rng(6).normal(0.0, 0.2, len(psi)))
        last = np.arange(len(psi)) // 40 * 40
        q = quaternions(phi, np.tile(pitch, count), psi)
        self.q, self.seen_depths = q[last], self.depths[last]
        self.cycle, self.stay = stay + way, stay

    def before(self, way):
        """Tick just before a way begins, at the surface."""
        return way * self.cycle + self.stay - 1

    def end(self, way):
        """Tick a quarter of a minute before a way ends: deep enough that nothing has come up."""
        return (way + 1) * self.cycle - 151

    def begun(self, way):
        """Tick half a minute after a way has begun."""
        return way * self.cycle + self.stay + 400


class Track:
    """What is believed, tick by tick, by name."""

    def __init__(self, rows, state):
        self.state = state
        for name, column in zip(COLUMNS, rows.T, strict=True):
            setattr(self, name, column)

    def place(self, tick):
        return np.array([self.n[tick], self.e[tick]])

    def current(self, tick):
        return np.array([self.current_n[tick], self.current_e[tick]])


@pytest.fixture(scope='module')
def dives(quaternions, steady_speed):
    """``dives(headings_deg, has_fixes)``: truth of ways, in steady glides by the polar."""
    polar = make_polar(load_vehicle('zhang2021').params())
    speed = steady_speed(-PITCH, RATE, polar)

    def make(headings_deg, has_fixes=True):
        return Dives(np.array(headings_deg), speed, has_fixes, quaternions)

    return make


def navigate(dives, **settings):
    settings = NavigationSettings(method='dead_reckoned', imu_period_s=4.0, gyro=False, **settings)
    state, params = settings.initial_state().method, settings.params().method
    q = np.ascontiguousarray(dives.q)
    return Track(
        *_navigate(
            state, q, dives.seen_depths, dives.has_fix, dives.places, FIX_VARIANCE, params, TICK_S
        )
    )


@pytest.mark.parametrize('current', ['persistence', 'tidal'])
def test_the_first_way_tells_the_current_and_the_second_is_reckoned_with_it(dives, current):
    truth = dives([30.0, 40.0, 200.0])
    track = navigate(truth, current=current)
    still = truth.end(0)
    lost = np.linalg.norm(truth.places[still] - track.place(still))
    assert track.current(still).tolist() == [0.0, 0.0]
    assert lost == pytest.approx(np.linalg.norm(CURRENT) * WAY_S, rel=0.05)
    assert track.current(truth.begun(1)) == pytest.approx(CURRENT, abs=0.003)
    for way in (1, 2):
        error = np.linalg.norm(truth.places[truth.end(way)] - track.place(truth.end(way)))
        assert error < 0.05 * lost


OFF = np.array([0.03, -0.05])
FORECAST = {'components': [{'kind': 'table', 'rows': [[0.0, *(CURRENT + OFF).tolist()]]}]}


def test_a_forecast_leads_the_first_way_and_fixes_tell_by_how_much_it_is_off(dives):
    truth = dives([30.0, 40.0, 200.0])
    track = navigate(truth, current='forecast', forecast={**FORECAST, 'error_std_mps': 0.05})
    first = truth.places[truth.end(0)] - track.place(truth.end(0))
    assert first == pytest.approx(-OFF * WAY_S, abs=15.0)
    assert track.current(truth.end(0)) == pytest.approx(CURRENT + OFF, abs=1e-9)
    assert track.current(truth.begun(1)) == pytest.approx(CURRENT, abs=0.003)
    for way in (1, 2):
        error = np.linalg.norm(truth.places[truth.end(way)] - track.place(truth.end(way)))
        assert error < 0.1 * np.linalg.norm(first)
    told = np.sqrt([track.nn[truth.end(0)], track.ee[truth.end(0)]])
    assert np.all(told > 0.05 * 0.9 * WAY_S)
    assert np.all(told < 0.05 * 1.2 * WAY_S)


def test_a_forecast_changes_with_time_and_depth_as_it_says(dives):
    """A step in the second way, and a current below 200 m, both forecast by their amounts."""
    truth = dives([30.0, 40.0])
    changes_s = STAY_S + WAY_S + STAY_S + 0.25 * WAY_S
    shear = {'kind': 'table', 'rows': [[199.0, 0.0, 0.0], [201.0, 0.1, 0.0]]}
    step = {'kind': 'steps', 'steps': [{'at_s': changes_s, 'north_mps': 0.0, 'east_mps': 0.2}]}
    plain, told = (
        navigate(truth, current='forecast', forecast={'components': more})
        for more in (FORECAST['components'], [*FORECAST['components'], shear, step])
    )
    deep_s = np.sum(truth.depths[: truth.cycle] > 200.0) * TICK_S
    led = told.place(truth.end(0)) - plain.place(truth.end(0))
    assert led == pytest.approx([0.1 * deep_s, 0.0], abs=2.0)
    led = (told.place(truth.end(1)) - told.place(truth.begun(1))) - (
        plain.place(truth.end(1)) - plain.place(truth.begun(1))
    )
    assert led[1] == pytest.approx(0.2 * 0.75 * WAY_S, rel=0.02)


def test_a_forecast_is_taken_by_its_mean_over_the_depth_of_the_dive_before(dives):
    """In the first way by what it is at the depth, for nobody knows how deep that leads.

    There is no shear in this sea: after the first way its mean is taken off.
    """
    truth = dives([30.0, 40.0])
    shear = {'kind': 'table', 'rows': [[0.0, 0.2, 0.0], [truth.depths.max(), 0.0, 0.0]]}
    plain, told = (
        navigate(truth, current='forecast', forecast={'components': more})
        for more in (FORECAST['components'], [*FORECAST['components'], shear])
    )
    for way, means in ((0, (0.15, 0.05)), (1, (0.0, 0.0))):
        begin, end = truth.begun(way), truth.end(way)
        ticks = np.linspace(begin, end, 5).astype(int)[:3]
        led = [told.place(tick)[0] - plain.place(tick)[0] for tick in ticks]
        assert np.diff(led) == pytest.approx(0.25 * WAY_S * np.array(means), abs=6.0)


@pytest.mark.parametrize('deepest', [0.0, 300.0])
def test_a_forecast_that_is_late_tells_what_was_before(deepest):
    tide = {'kind': 'tidal', 'speed_mps': 0.3, 'direction_deg': 20.0, 'ellipticity': 0.4}
    now, late = (
        make_forecast(ForecastSettings(components=[tide], late_h=hours), True)
        for hours in (0.0, 2.5)
    )
    then, told = (
        forecast_at(one, Vector(1.0, 2.0), 40.0, deepest, t_s)
        for one, t_s in ((now, 1000.0), (late, 10_000.0))
    )
    assert tuple(told) == pytest.approx(tuple(then))


def test_changes_of_a_forecast_are_told_from_what_it_said_at_the_start(dives):
    step = {'kind': 'steps', 'steps': [{'at_s': 300.0, 'north_mps': 0.0, 'east_mps': 0.2}]}
    forecast = {'components': [*FORECAST['components'], step]}
    track = navigate(dives([30.0]), current='forecast', forecast=forecast)
    assert tuple(track.state.column) == pytest.approx(CURRENT + OFF)


@pytest.mark.parametrize(('has_fixes', 'drift'), [(True, DRIFT), (False, CURRENT + OFF)])
def test_who_comes_up_believes_in_the_drift_of_the_last_stay_if_fixes_told_it(
    dives, has_fixes, drift
):
    """Else in the forecast; there is no fix yet in the second stay."""
    truth = dives([30.0, 40.0], [has_fixes, False])
    for name in ('q', 'seen_depths', 'has_fix', 'places'):
        setattr(truth, name, getattr(truth, name)[: truth.cycle + 500])
    track = navigate(truth, current='forecast', forecast=FORECAST)
    assert tuple(track.state.stay.drift) == pytest.approx(drift, abs=0.02)


def test_of_a_drift_the_water_that_is_believed_is_taken_off():
    settings = NavigationSettings(method='dead_reckoned')
    params, state = settings.params().method, settings.initial_state().method
    current = state.current._replace(mean=Vector(0.1, -0.05))
    left = _unforeseen(Vector(0.3, 0.2), Vector(5.0, 7.0), 60.0, current, state.trust, params)
    assert tuple(left) == pytest.approx((0.2, 0.25))


def test_a_stay_without_a_fix_makes_a_way_longer_and_less_known():
    """By how it drifted meanwhile, and by how well that is known."""
    settings = NavigationSettings(method='dead_reckoned')
    way = settings.initial_state().method.way._replace(variance=400.0, through=Vector(30.0, -5.0))
    stay = begin(Vector(7.0, 8.0), 25.0, Vector(0.2, -0.1))
    for _ in range(600):
        stay = wait(stay, 1.0)
    longer = _dive(way, stay)
    assert tuple(longer.through) == pytest.approx((150.0, -65.0))
    assert longer.variance == pytest.approx(400.0 + drifted_variance(stay))
    assert drifted_variance(stay) > 50.0**2


def _first(**changes):
    """What the intake makes of the first sample, and whether something was refused."""
    settings = NavigationSettings(method='dead_reckoned')
    odom = (0.0,) * 13
    rest = Joints(0.0, 0.0, 0.0, 0.0), odom, odometry_from_wire(odom)
    received = Received(*rest, Imu(1.0, *(6 * (0.0,)), False), 3.0, Fix(False, 0.0, 0.0, 0.0), 0.0)
    state, params = settings.initial_state().intake, settings.params().intake
    state, told = take_in(state, received._replace(**changes), params, TICK_S)
    return told, is_refusing(state)


def test_what_the_altimeter_says_is_no_echo_where_it_is_no_number():
    for altitude, taken in ((math.nan, 0.0), (12.5, 12.5)):
        assert _first(altitude=altitude)[0].altitude == taken


@pytest.mark.parametrize('variance', [-1.0, 1e300, math.inf, math.nan])
def test_a_fix_that_does_not_say_where_it_is_is_none(variance):
    told, refuses = _first(fix=Fix(True, 0.0, 0.0, variance))
    assert (told.fix.is_fix, refuses) == (False, True)


@pytest.mark.parametrize('side', [-1.0, 1.0])
def test_no_depth_beyond_that_of_any_sea_is_taken_in(side):
    told, refuses = _first(depth=11_900.0 * side)
    assert (told.depth, refuses) == (11_900.0 * side, False)
    told, refuses = _first(depth=12_100.0 * side)
    assert abs(told.depth) < 1.0
    assert refuses


@pytest.mark.parametrize('place', [(9e7, 0.0), (0.0, -9e7), (1.1e8, 0.0), (0.0, -1.1e8)])
def test_no_fix_that_is_farther_than_the_earth_is_round_twice_is_taken_in(place):
    told, refuses = _first(fix=Fix(True, *place, 25.0))
    is_far = max(map(abs, place)) > 1e8
    assert told.fix == (Fix(False, 0.0, 0.0, 0.0) if is_far else Fix(True, *place, 25.0))
    assert refuses == is_far


def test_who_has_lost_its_attitude_tells_of_none_and_of_all_else():
    """Its quaternion is nothing, which no gate believes; all else stands where it does."""
    settings = NavigationSettings(method='dead_reckoned')
    state, params = settings.initial_state(), settings.params()
    nan = math.nan
    for k in range(round(params.intake.hold_s / TICK_S) + 2):
        q = (1.0, 0.0, 0.0, 0.0) if k == 0 else (nan, nan, nan, nan)
        imu = (*q, 0.0, 0.0, 0.0, 0.0)
        sensors = (
            (0.0,) * 4,
            (0.0,) * 13,
            imu,
            (SURFACE_PRESSURE,),
            (-1.0, *(4 * (0.0,))),
            (0.0,),
        )
        state, (odom, *_), _ = navigation_tick(state, k * TICK_S, sensors, params, TICK_S)
        assert len(odom) == 17
        assert (odom[3:7] == (0.0,) * 4) == (k * TICK_S > params.intake.hold_s)
        assert np.isfinite(odom).all()


def test_a_depth_that_jumps_is_left_until_none_was_believed_for_long():
    """Not the first one, wherever the vehicle is."""
    settings = NavigationSettings(method='dead_reckoned')
    odom = (0.0,) * 13
    rest = Joints(0.0, 0.0, 0.0, 0.0), odom, odometry_from_wire(odom)
    imu = Imu(1.0, *(6 * (0.0,)), False)
    state, params = settings.initial_state().intake, settings.params().intake
    far = 300.0 + 2.0 * params.gate.depth_jump
    received = Received(*rest, imu, 300.0, Fix(False, 0.0, 0.0, 0.0), 0.0)
    state, told = take_in(state, received, params, TICK_S)
    assert told.depth == 300.0
    waited_s = 0.0
    while told.depth == 300.0:
        state, told = take_in(state, received._replace(depth=far), params, TICK_S)
        waited_s += TICK_S
        assert waited_s < params.hold_s + 1.0
    assert told.depth == far
    assert waited_s == pytest.approx(params.hold_s, abs=2.0 * TICK_S)


def test_a_forecast_of_changes_that_do_not_come_is_left_out(dives):
    """The sea is steady. The forecast of its first way holds, and swings from way to way."""
    truth = dives([30.0, 40.0, 200.0, 120.0, 310.0, 75.0, 20.0, 250.0])
    swings = [(0.0, 0.15), (0.12, 0.0), (-0.1, 0.1), (0.0, -0.15), (0.1, 0.1)]
    steps = [
        {'at_s': way * (STAY_S + WAY_S), 'north_mps': n, 'east_mps': e}
        for way, (n, e) in enumerate([*swings, *swings[:2]], 1)
    ]
    forecast = {'components': [*FORECAST['components'], {'kind': 'steps', 'steps': steps}]}

    def last_error(**more):
        track = navigate(truth, current='forecast', forecast={**forecast, **more})
        end = truth.end(7)
        return np.linalg.norm(truth.places[end] - track.place(end)), track.state.trust

    believed, whole = last_error(share_std=0.0)
    left_out, trust = last_error()
    assert believed > 0.1 * WAY_S
    assert left_out < 0.1 * believed
    assert whole == (1.0, 0.0)
    assert trust.share < 0.05
    assert trust.variance < 0.1**2


def test_a_forecast_of_changes_that_come_is_believed_and_more_surely():
    """What each way is off by, drawn by lot: the share that there is in the sea is found."""
    rng, trust = np.random.default_rng(3), Trust(1.0, 0.25)
    shares = []
    for true in rng.uniform(0.3, 1.2, 300):
        weighed = trust
        for change in rng.normal(0.0, 0.1, (6, 2)):
            off = (true - weighed.share) * change + rng.normal(0.0, 0.02, 2)
            weighed = weigh(weighed, Vector(*off), Vector(*change), 0.02**2)
        shares.append((weighed.share - true, weighed.variance))
    errors, told = np.array(shares).T
    assert np.var(errors) == pytest.approx(np.mean(told), rel=0.2)
    assert np.mean(told) < 0.1**2


@pytest.mark.parametrize(
    'forecast',
    [{}, {'components': [{'kind': 'gauss_markov', 'std_mps': 0.1, 'time_constant_s': 9.0}]}],
)
def test_a_forecast_that_is_none_is_refused(forecast):
    with pytest.raises(ValueError, match='forecast'):
        NavigationSettings(method='dead_reckoned', current='forecast', forecast=forecast)


def test_no_current_is_believed_where_none_is_asked_for(dives):
    truth = dives([30.0, 40.0])
    track = navigate(truth, current='none')
    assert not track.current_n.any() and not track.current_e.any()
    for way in (0, 1):
        error = truth.places[truth.end(way)] - track.place(truth.end(way))
        assert error == pytest.approx(CURRENT * WAY_S, abs=25.0)


def test_a_surfacing_without_a_fix_is_a_point_of_one_longer_way(dives):
    """After the second way without a fix between: the current is learnt from both at once."""
    truth = dives([30.0, 120.0, 40.0], [True, False, True])
    track = navigate(truth)
    at_surface = slice(truth.cycle + 200, truth.cycle + truth.stay)
    assert np.all(track.phase[at_surface] == AT_SURFACE)
    assert track.current(truth.end(1)).tolist() == [0.0, 0.0]
    drifted = STAY_S * (DRIFT - CURRENT) / (2.0 * WAY_S)
    assert np.linalg.norm(drifted) > 0.005
    assert track.current(truth.begun(2)) == pytest.approx(CURRENT, abs=0.003)
    assert track.state.current.way_s == pytest.approx(2.0 * WAY_S, rel=0.02)
    error = truth.places[truth.end(2)] - track.place(truth.end(2))
    assert np.linalg.norm(error) < 40.0


def test_covariance_of_the_place_grows_under_water_and_falls_at_a_fix(dives):
    truth = dives([30.0, 120.0, 40.0])
    track = navigate(truth)
    trace = track.nn + track.ee
    assert np.all(track.nn * track.ee - track.ne**2 > 0.0)
    for way in range(3):
        under = slice(truth.begun(way), truth.end(way))
        assert np.all(track.phase[under] == UNDER_WATER)
        assert np.all(np.diff(trace[under]) > 0.0)
    for way in (1, 2):
        fixed = way * truth.cycle + np.argmax(truth.has_fix[way * truth.cycle :])
        before, after = trace[fixed - 10], trace[fixed + 10]
        assert after < 1.01 * 2.0 * FIX_VARIANCE < 0.1 * before
        assert np.all(track.phase[fixed + 1 : truth.before(way)] == FIXED)
    assert np.all(track.current_nn[truth.begun(1) :] < track.current_nn[truth.end(0)])


def test_where_it_believes_it_is_is_as_far_off_as_it_says(dives):
    """At fixes and at the end of ways, in a constant current: within 3 sigma on each axis."""
    truth = dives([30.0, 120.0, 200.0])
    track = navigate(truth)
    for way in range(3):
        for tick in (truth.before(way), truth.end(way)):
            error = truth.places[tick] - track.place(tick)
            sigma = np.sqrt([track.nn[tick], track.ee[tick]])
            assert np.all(np.abs(error) < 3.0 * sigma)


def test_depth_and_phase_are_those_of_the_dives(dives):
    truth = dives([30.0])
    track = navigate(truth)
    steady = np.r_[truth.begun(0) : truth.stay + 24000, truth.stay + 26000 : truth.end(0)]
    assert track.depth[steady] == pytest.approx(truth.depths[steady], abs=0.05)
    assert np.all(track.phase[: truth.before(0)] == FIXED)


@pytest.mark.parametrize('tide', [True, False], ids=['tidal', 'persistence'])
def test_covariance_of_a_place_is_that_of_its_errors_drawn_by_lot(tide):
    """Where a way began, mean and tide, how far the sea wandered, the forecast, speed, compass.

    Errors of speed and compass were in the way before, too, and were taken for current then: what
    they do to this way is what they do to both, less that.
    """
    params = NavigationSettings(method='dead_reckoned').params().method
    t_s, before_s, glide, before = 5000.0, 4000.0, np.array([0.3, -0.1]), np.array([-0.1, 0.35])
    root = np.array([[0.02, 0.0, 0.0], [0.004, 0.01, 0.0], [-0.006, 0.003, 0.015]])
    P = root @ root.T if tide else np.diag([4e-4, 0.0, 0.0])
    h = np.array([1.0, 0.7, -0.4])
    estimate = initial_estimate(tide)._replace(
        p=Uncertainty(*(float(P[i, j]) for i in range(3) for j in range(i, 3))),
        q=2e-8,
        weight=4.0,
        glide=Vector(*before.tolist()),
        way_s=before_s,
    )
    through = Vector(*(t_s * glide).tolist())
    still = Vector(0.0, 0.0)
    told_now, told_before, trust = (0.12, -0.05), Vector(-0.04, 0.02), Trust(0.8, 0.09)
    forecast = Vector(*(t_s * told for told in told_now))
    way = Way(
        begun=still,
        variance=900.0,
        through=through,
        by_current=still,
        forecast=forecast,
        t_s=t_s,
        cos_s=h[1] * t_s,
        sin_s=h[2] * t_s,
    )

    rng, count = np.random.default_rng(8), 400_000
    start = rng.normal(0.0, 30.0, (count, 2))
    sea = np.stack([rng.multivariate_normal(np.zeros(3), P, count) @ h for _ in range(2)], axis=1)
    sea += rng.normal(0.0, math.sqrt(1.25 * 2e-8 * (t_s + before_s) / 3.0 + 0.0007**2), (count, 2))
    share, turn = rng.normal(0.0, 0.05, count), rng.normal(0.0, math.radians(2.0), count)

    def flown(velocity):
        """How far a velocity through the water is off, by speed and compass."""
        wrong = (1.0 + share) * np.exp(1j * turn) * (velocity[0] + 1j * velocity[1])
        return np.stack([wrong.real, wrong.imag], axis=1) - velocity

    holds = rng.normal(0.0, 0.3, (count, 1)) * (np.array(told_now) - told_before)
    errors = start + t_s * (sea + holds + flown(glide) - flown(before))
    drawn = np.cov(errors.T)
    told = place_covariance(way, estimate, trust, told_before, params)
    assert [told.nn, told.ee] == pytest.approx(np.diag(drawn), rel=0.012)
    scale = math.sqrt(told.nn * told.ee)
    assert told.ne == pytest.approx(drawn[0, 1], abs=0.01 * scale)
    assert abs(told.ne) > 0.05 * scale
