# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""Bounds of the steering loop: certificates that can fail, and flights that stay within them."""

import itertools
import math

import numpy as np
import pytest

from glider_base.settings import ConfigurationError
from glider_base.signals import TICK_S
from glider_model.onboard.command_filter import FilterParams
from glider_model.vehicle.file import load_vehicle, vehicle_path
from glider_studies.bounds import lmi
from glider_studies.bounds.certificate import dissipates, gain, gain_verified, reached, region
from glider_studies.bounds.flights import fly_jumps, fly_starts
from glider_studies.bounds.glide import glides, scenario_of, slope, steering_loop
from glider_studies.bounds.steering_loop import (
    INPUTS,
    Gains,
    SteeringLoop,
    box,
    limits,
    names,
    sensitivity,
    tick,
)
from glider_studies.bounds.study import bounds

B, K = 0.0276, -0.303


def made(b=B, k=K, faster=1.0, estimated_b=B):
    """A loop by hand, with a law that believes b and knows k: bandwidth .035, lookahead 150 s."""
    turn = faster * 0.035 / estimated_b
    ahead = (1.1 - turn * k) / estimated_b  # of the turn itself, and of the roll that it takes
    return SteeringLoop(
        speed=0.435,
        b=b,
        k=k,
        line_of_sight=faster / (150.0 * 0.435),
        heading_filter=FilterParams(0.07, 0.012),
        law=(turn, ahead, -turn, -0.1 / estimated_b, turn * k, 0.1 * k / estimated_b),
        limit=math.radians(30.0),
        roll_filter=FilterParams(0.5, 0.08),
        leg_s=3700.0,
    )


def less_by_reach(reach):
    """Gain of an arc tangent at a reach (m), of that at 0."""
    share = reach / (150.0 * 0.435)
    return math.atan(share) / share


@pytest.fixture(scope='module')
def loop():
    return made()


@pytest.fixture(scope='module')
def current(loop):
    return gain(loop, 1)


@pytest.fixture(scope='module')
def strong():
    """A vehicle that turns well for its kick, as zhang2021 does in a climb."""
    return made(b=-0.0367, k=0.295, estimated_b=-0.0367)


@pytest.fixture(scope='module')
def home(strong):
    """Its region."""
    return region(strong, less_by_reach, ((1.5, 0.6),))


def test_lmi_finds_the_smallest_trace_above_a_matrix():
    """Minimise trace P over P > A: the optimum is trace A."""
    a = np.array([[2.0, 1.0], [1.0, 3.0]])
    basis = np.array([[[1.0, 0], [0, 0]], [[0, 1.0], [1.0, 0]], [[0, 0], [0, 1.0]]])
    found = lmi.solve(np.array([1.0, 0.0, 1.0]), [(-a, basis)], np.zeros(3))
    assert np.tensordot(found, basis, axes=1) == pytest.approx(a, abs=0.01)


def test_lmi_says_that_there_is_none():
    """y > 1 and y < 0."""
    blocks = [(np.array([[-1.0]]), np.ones((1, 1, 1))), (np.zeros((1, 1)), -np.ones((1, 1, 1)))]
    assert lmi.solve(np.ones(1), blocks, np.zeros(1)) is None


def test_tick_is_that_of_the_continuous_loop_at_low_frequency(loop):
    """With filters that are fast beside it, e'' + a e' + a e / T = 0."""
    fast = FilterParams(2.0, 1.0)
    quick = made()._replace(heading_filter=fast, roll_filter=fast, k=0.0)
    quick = quick._replace(law=(*quick.law[:1], 1.0 / B, quick.law[2], 0.0, 0.0, 0.0))
    slow = np.sort(np.linalg.eigvals(tick(quick).f).real)[-2:]
    assert slow == pytest.approx([-0.035, -1.0 / 150.0], rel=0.15)


def test_gain_holds_for_errors_and_gains_of_any_course(loop, current):
    """Random courses of gains and of the error, and the worst constant one."""
    ticks = [tick(loop, one) for one in box(loop)]
    random = np.random.default_rng(5)
    largest = 0.0
    for _ in range(20):
        x = np.zeros(len(names(loop)))
        error = random.choice((-1.0, 1.0))
        for _ in range(300):
            one = ticks[random.integers(len(ticks))]
            error = error if random.random() < 0.97 else -error
            for _ in range(20):
                x = x + TICK_S * (one.f @ x + one.g[:, 1] * error)
            largest = max(largest, abs(x[0]))
    assert 0.3 * current.gain < largest <= current.gain


def test_gain_is_not_less_than_what_an_input_reaches(loop, current):
    """A constant error of the current does no more than the worst course of it."""
    constant = max(
        abs(np.linalg.solve(one.f, one.g[:, 1])[0]) for one in (tick(loop, at) for at in box(loop))
    )
    least = reached(loop)[1]
    assert constant * (1.0 - 1e-3) <= least <= current.gain < 1.5 * least


def test_nothing_saturates_up_to_what_the_gain_is_told_for(loop, current):
    inverse = np.linalg.inv(current.p)
    for one in (tick(loop, at) for at in box(loop)):
        for name, row in one.signals.items():
            largest = current.holds_to * math.sqrt(row @ inverse @ row)
            assert largest <= limits(loop)[name] * (1.0 + 1e-9)


@pytest.mark.parametrize('column', range(len(INPUTS)), ids=INPUTS)
def test_no_certificate_with_the_wrong_sign_of_b(column):
    assert gain(made(b=-B), column) is None


def test_v_falls_in_the_region_though_signals_saturate(strong, home):
    """From its edge, at corners of the box, with the gains that what saturates has just now."""
    inverse, at_limit = np.linalg.inv(home.p), 0
    corners = itertools.product((0.7, 1.3), (0.7, 1.3), limits(strong))
    for b, k, name in corners:
        row = tick(strong, Gains(b=b, k=k)).signals[name]
        x = inverse @ row / math.sqrt(row @ inverse @ row)  # where this signal is largest
        v = 1.0
        for _ in range(40):
            now = Gains(b=b, k=k, line_of_sight=less_by_reach(abs(x[0]) + 1e-9))
            for _ in range(2):  # one signal's gain changes the other signals
                signals = tick(strong, now).signals
                now = now._replace(
                    **{
                        name: min(1.0, limit / max(1e-12, abs(signals[name] @ x)))
                        for name, limit in limits(strong).items()
                    }
                )
            at_limit += min(now.u, now.heading_rate, now.roll_rate) < 1.0
            x = x + TICK_S * tick(strong, now).f @ x
            after = x @ home.p @ x
            assert after <= v + 1e-12
            v = after
    assert at_limit > 10


def test_no_roll_changes_the_weighted_mean():
    """The integral of exp(-z t) e is (e + U psi* / z) / z, whatever is done with the roll."""
    b, k, speed, h = 0.02, -0.3, 0.4, 0.01
    z = -b / k
    t = np.arange(0.0, 400.0, h)
    for roll in (0.0 * t, 0.3 * np.sin(0.02 * t), 0.5 * np.sign(np.sin(0.013 * t**1.2))):
        u = roll - roll[0]
        left = 0.05 + np.cumsum(b * u) * h
        e = 3.0 + np.cumsum(speed * (left + k * u)) * h
        mean = float(np.sum(np.exp(-z * t) * e) * h)
        assert mean == pytest.approx((3.0 + speed * 0.05 / z) / z, rel=2e-3)


def test_no_region_with_the_wrong_sign_of_b():
    assert region(made(b=-B), less_by_reach, ((1.0, 0.3),)) is None


def test_no_certificate_with_gains_five_times_too_large():
    """Of law and line of sight; that every vertex by itself is still stable does not help."""
    fast = made(faster=5.0)
    assert gain(fast, 1) is None
    assert max(sensitivity(fast, one) for one in box(fast)) > 2.0


def test_no_certificate_where_the_kick_outruns_the_turn():
    """A tenth of the steering, whoever knows it, with gains for all of it."""
    assert gain(made(b=0.1 * B, estimated_b=0.1 * B), 1) is None


def test_a_certificate_is_refuted_where_it_does_not_hold(loop, current):
    """The same P, at the vertices of another vehicle: eigenvalues tell."""
    of = [tick(loop, one) for one in box(loop)]
    assert gain_verified(current.p, of, 1, current.rate)
    for other in (made(b=-B), made(faster=5.0), made(b=3.0 * B)):
        ticks = [tick(other, one) for one in box(other)]
        assert not gain_verified(current.p, ticks, 1, current.rate)
        worst = min(
            np.linalg.eigvalsh(dissipates(current.p, one, 1, current.rate))[0] for one in ticks
        )
        assert worst < 0.0


def test_sensitivity_grows_with_the_gains(loop):
    assert 1.0 <= sensitivity(loop) < sensitivity(made(faster=5.0))


def test_a_loop_that_is_unstable_has_no_slowest_time_and_no_sensitivity(tmp_path):
    """A vehicle with a tenth of its steering in the dive."""
    text, weak = vehicle_path('zhang2021').read_text(), tmp_path / 'weak.yaml'
    text = text.replace('K_MR: {value: -20', 'K_MR: {value: -18')
    weak.write_text(text.replace('K_MY: {value: 158.4', 'K_MY: {value: 104'))
    dive = bounds(str(weak), 0, 0)['phases']['dive']
    assert dive['loop']['slowest_s'] is dive['loop']['sensitivity'] is None
    assert 'the loop is unstable somewhere in the box' in dive['failed']


def test_a_vehicle_that_is_none_is_told_in_a_line():
    with pytest.raises(ConfigurationError, match="^vehicle = 'nosuch': no such vehicle"):
        glides('nosuch')


@pytest.mark.parametrize('vehicle', ['slocum_g2', 'seaglider'])
def test_a_vehicle_of_a_file_dives_as_its_pump_and_hull_allow(vehicle, tmp_path):
    file = tmp_path / 'mine.yaml'
    file.write_text(vehicle_path(vehicle).read_text())
    profile = scenario_of(str(file)).profile
    assert profile.depth_m == load_vehicle(vehicle).rated_depth_m
    pump_kg = load_vehicle(vehicle).params().m_b_max
    assert 0.4 * pump_kg < profile.net_heaviness_kg < 0.6 * pump_kg


@pytest.mark.parametrize(('vehicle', 'phase'), [('zhang2021', 'dive'), ('slocum_g2', 'climb')])
def test_starts_in_the_region_come_home_within_their_bound(vehicle, phase):
    """Few here: ./glider bounds flies 200 of each phase of each vehicle."""
    glide = glides(vehicle)[phase]
    of_glide = steering_loop(glide)
    inside = region(of_glide, lambda reach: slope(glide, reach), ((1.0, 0.3),))
    flown = fly_starts(glide, inside, 3, 7, lambda: None)
    assert flown['home'] == flown['starts']
    assert 0.05 < flown['of_bound'] <= 1.0
    jumps = fly_jumps(glide, gain(of_glide, 1), 1, 7, lambda: None)
    assert 0.05 < jumps['of_bound'] <= 1.0
