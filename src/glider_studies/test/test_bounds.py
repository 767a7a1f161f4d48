# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""Bounds of the steering loop: certificates that can fail, and flights that stay within them."""

import math

import numpy as np
import pytest

from glider_base.signals import TICK_S
from glider_model.onboard.command_filter import FilterParams
from glider_studies.bounds import lmi
from glider_studies.bounds.certificate import dissipates, gain, gain_verified, region
from glider_studies.bounds.flights import fly_jumps, fly_starts
from glider_studies.bounds.glide import glides, slope, steering_loop
from glider_studies.bounds.steering_loop import (
    INPUTS,
    SteeringLoop,
    box,
    limits,
    names,
    sensitivity,
    tick,
)

B, K = 0.0276, -0.303


def made(b=B, k=K, faster=1.0, believed_b=B):
    """A loop by hand, with a law that believes b and knows k: bandwidth .035, lookahead 150 s."""
    turn = faster * 0.035 / believed_b
    return SteeringLoop(
        speed=0.435,
        b=b,
        k=k,
        line_of_sight=faster / (150.0 * 0.435),
        heading_filter=FilterParams(0.07, 0.012),
        law=(turn, 1.1 / believed_b, -turn, -0.1 / believed_b, turn * K, 0.1 * K / believed_b),
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


def test_gain_is_not_less_than_that_of_a_constant_error(loop, current):
    constant = max(
        abs(np.linalg.solve(one.f, one.g[:, 1])[0]) for one in (tick(loop, at) for at in box(loop))
    )
    assert constant <= current.gain < 1.5 * constant


def test_nothing_saturates_up_to_what_the_gain_is_told_for(loop, current):
    inverse = np.linalg.inv(current.p)
    for one in (tick(loop, at) for at in box(loop)):
        for name, row in one.signals.items():
            largest = current.holds_to * math.sqrt(row @ inverse @ row)
            assert largest <= limits(loop)[name] * (1.0 + 1e-9)


@pytest.mark.parametrize('column', range(len(INPUTS)), ids=INPUTS)
def test_no_certificate_with_the_wrong_sign_of_b(column):
    assert gain(made(b=-B), column) is None


def test_no_region_with_the_wrong_sign_of_b():
    assert region(made(b=-B), less_by_reach) is None


def test_no_certificate_with_gains_five_times_too_large():
    """Of law and line of sight; that every vertex by itself is still stable does not help."""
    fast = made(faster=5.0)
    assert gain(fast, 1) is None
    assert max(sensitivity(fast, one) for one in box(fast)) > 2.0


def test_no_certificate_where_the_kick_outruns_the_turn():
    """A tenth of the steering, whoever knows it, with gains for all of it."""
    assert gain(made(b=0.1 * B, believed_b=0.1 * B), 1) is None


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


@pytest.mark.parametrize(('vehicle', 'phase'), [('zhang2021', 'dive'), ('slocum_g2', 'climb')])
def test_starts_in_the_region_come_home_within_their_bound(vehicle, phase):
    """Few here: ./glider bounds flies 200 of each phase of each vehicle."""
    glide = glides(vehicle)[phase]
    of_glide = steering_loop(glide)
    home = region(of_glide, lambda reach: slope(glide, reach))
    flown = fly_starts(glide, home, 3, 7, lambda: None)
    assert flown.home == flown.starts
    assert 0.05 < flown.of_bound <= 1.0
    jumps = fly_jumps(glide, gain(of_glide, 1), 1, 7, lambda: None)
    assert 0.05 < jumps.of_bound <= 1.0
