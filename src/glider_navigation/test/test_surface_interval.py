# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""A stay at the surface against regression over a random walk, with matrices; and under a tide."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from glider_base.signals import Vector
from glider_navigation.method import Fix
from glider_navigation.surface_interval import (
    LOST_DRIFT_STD,
    _begin_aside,
    begin,
    change_of_drift,
    counts,
    drifted_variance,
    hear_fix,
    take_fix,
    wait,
)

quick = settings(max_examples=50)

#: What is believed of the drift before there is a fix is off by so much (m/s).
DRIFT_STD = 0.15
#: Its variance grows by so much (m^2/s^3).
WANDERS = 3e-7
metres = st.floats(-5000.0, 5000.0)
# by rounding, a fix after 60 s sharp may be one too early
fixes = st.lists(
    st.tuples(st.floats(60.1, 900.0), metres, metres, st.floats(1.0, 1e4)), min_size=1, max_size=8
)


def regression(place, drift, variance, times, seen, variances):
    """Posterior mean and covariance of [p(0), v(0), p(t), v(t)] at the last of the times.

    The place is p(0) + v(0) t + the integral of a random walk, all that jointly Gaussian: the
    covariance of that integral at s and t >= s is q (s^2 t / 2 - s^3 / 6), and that of the walk at
    t with the integral at s is q s^2 / 2.
    """
    at = np.concatenate([[0.0], times])
    s, t = np.minimum.outer(at, at), np.maximum.outer(at, at)
    places = variance + DRIFT_STD**2 * s * t + WANDERS * (s**2 * t / 2.0 - s**3 / 6.0)
    with_v = DRIFT_STD**2 * at + WANDERS * at**2 / 2.0
    v = DRIFT_STD**2 + WANDERS * at[-1]
    both = np.array([[DRIFT_STD**2, DRIFT_STD**2], [DRIFT_STD**2, v]])
    with_both = np.stack([DRIFT_STD**2 * at, with_v])
    everything = np.block([[places, with_both.T], [with_both, both]])
    mean = np.concatenate([place + drift * at, [drift, drift]])
    H = np.eye(len(mean))[1:-2]
    gain = everything @ H.T @ np.linalg.inv(H @ everything @ H.T + np.diag(variances))
    mean = mean + gain @ (seen - H @ mean)
    covariance = everything - gain @ H @ everything
    wanted = [0, -2, -3, -1]
    return mean[wanted], covariance[np.ix_(wanted, wanted)]


def stay_with(stay, fixes):
    """A stay with fixes, each so long (s) after the one before."""
    for after_s, n, e, variance in fixes:
        stay = wait(stay, after_s)
        fix = Fix(True, n, e, variance)
        assert counts(stay, fix)
        stay = take_fix(stay, fix)
    return stay


@quick
@given(st.tuples(metres, metres), st.floats(1.0, 1e5), st.floats(-1.0, 1.0), fixes)
def test_fixes_are_taken_in_as_by_regression(place, variance, drift, fixes):
    stay = stay_with(begin(Vector(*place), variance, Vector(drift, -drift)), fixes)
    after, n, e, variances = np.array(fixes).T
    times = np.cumsum(after)
    for axis, start, at_first, seen in (('n', drift, place[0], n), ('e', -drift, place[1], e)):
        mean, covariance = regression(at_first, start, variance, times, seen, variances)
        vectors = stay.came_up, stay.first_drift, stay.place, stay.drift
        there = [getattr(vector, axis) for vector in vectors]
        assert there == pytest.approx(mean, rel=1e-5, abs=1e-4)
        scale = np.sqrt(np.diag(covariance))
        k, unused = stay.known, covariance[0, 1]
        known = [
            [k.cc, unused, k.cp, k.cv],
            [unused, k.dd, k.dp, k.dv],
            [k.cp, k.dp, k.pp, k.pv],
            [k.cv, k.dv, k.pv, k.vv],
        ]
        assert known / np.outer(scale, scale) == pytest.approx(
            covariance / np.outer(scale, scale), abs=1e-5
        )
    assert stay.fixes == len(fixes)


@pytest.mark.parametrize('hours', [0.25, 2.0, 6.0, 12.0, 24.0])
def test_where_it_came_up_and_how_it_drifts_hold_in_a_long_stay_under_a_tide(hours):
    """A tide of 0.25 m/s and fixes of 4 m: what comes later does not bend what was before."""
    rng = np.random.default_rng(4)
    rate, amplitude = 2.0 * math.pi / (12.42 * 3600.0), 0.25
    for phase in np.linspace(0.0, 2.0 * math.pi, 8, endpoint=False):
        stay = begin(Vector(40.0, -30.0), 60.0**2, Vector(0.0, 0.0))
        for t in 60.0 * np.arange(1, round(60.0 * hours) + 1):
            angles = rate * t + phase
            east = amplitude / rate * (math.sin(angles) - math.sin(phase))
            seen = np.array([0.1 * t, east]) + rng.normal(0.0, 4.0, 2)
            stay = take_fix(wait(stay, 60.0), Fix(True, *seen.tolist(), 16.0))
        assert math.hypot(*stay.came_up) < 15.0
        assert math.hypot(stay.place.n - 0.1 * t, stay.place.e - east) < 15.0
        off = stay.drift.n - 0.1, stay.drift.e - amplitude * math.cos(angles)
        assert math.hypot(*off) < 0.05
        assert 1.0 < math.sqrt(stay.known.cc) < 8.0


@pytest.mark.parametrize('fix_every_s', [1.0, 7.0, 60.0, 150.0])
def test_fixes_count_once_a_minute(fix_every_s):
    """The first at once; of those that come faster, the first after a minute."""
    stay, counted = begin(Vector(0.0, 0.0), 100.0, Vector(0.0, 0.0)), []
    for second in range(1, 1201):
        stay = wait(stay, 1.0)
        fix = Fix(second % fix_every_s == 0.0, 10.0, -10.0, 25.0)
        if counts(stay, fix):
            stay = take_fix(stay, fix)
            counted.append(second)
    between = fix_every_s * np.ceil(60.0 / fix_every_s)
    assert counted == np.arange(fix_every_s, 1201.0, between).tolist()
    assert stay.fixes == len(counted)


def test_without_a_fix_the_place_drifts_and_is_known_less():
    stay = begin(Vector(100.0, 200.0), 400.0, Vector(0.2, -0.3))
    for _ in range(600):
        stay = wait(stay, 1.0)
        assert not counts(stay, Fix(False, 0.0, 0.0, 25.0))
    assert tuple(stay.place) == pytest.approx((220.0, 20.0))
    assert tuple(stay.came_up) == (100.0, 200.0)
    drifted = (600.0 * DRIFT_STD) ** 2 + WANDERS * 600.0**3 / 3.0
    assert drifted_variance(stay) == pytest.approx(drifted)
    assert stay.known.pp == pytest.approx(400.0 + drifted)


def test_who_begins_anew_at_a_fix_knows_of_its_surfacing_what_it_may_have_drifted_since():
    stay = begin(Vector(0.0, 0.0), 100.0**2, Vector(0.2, 0.0))
    for _ in range(600):
        stay = wait(stay, 1.0)
    stay = stay._replace(aside=Vector(1000.0, 50.0), aside_s=600.0)
    anew = _begin_aside(stay, 25.0)
    assert tuple(anew.place) == (1000.0, 50.0)
    assert tuple(anew.came_up) == pytest.approx((880.0, 50.0))
    assert anew.known.pp == 25.0
    drifted = (600.0 * LOST_DRIFT_STD) ** 2 + WANDERS * 600.0**3 / 3.0
    assert anew.known.cc == pytest.approx(25.0 + drifted)


@pytest.mark.parametrize('came_up_m', [0.0, 2000.0])
def test_two_fixes_tell_a_strong_drift_wherever_it_came_up(came_up_m):
    """As of sg167 in 1 m/s: it dives after the second, and is to know where it came up."""
    stay = begin(Vector(0.0, 0.0), 60.0**2, Vector(0.0, 0.0))
    for wait_s in (160.0, 540.0):
        stay = wait(stay, wait_s)
        stay = hear_fix(stay, Fix(True, came_up_m + stay.t_s, -0.2 * stay.t_s, 25.0))
    assert tuple(stay.drift) == pytest.approx((1.0, -0.2), abs=0.03)
    assert tuple(stay.place) == pytest.approx((came_up_m + 700.0, -140.0), abs=5.0)
    assert tuple(stay.came_up) == pytest.approx((came_up_m, 0.0), abs=15.0)


@pytest.mark.parametrize('minutes', [3.0, 10.0])
def test_true_fixes_far_from_where_it_believed_to_be_are_believed_in_a_strong_drift(minutes):
    """Minutes apart in 1 m/s, the second is far from the first; a wrong one is still left."""
    stay, drift = begin(Vector(0.0, 0.0), 100.0**2, Vector(0.0, 0.0)), 1.0
    for number in range(3):
        stay = wait(stay, 60.0 * minutes)
        place = 900.0 + drift * 60.0 * minutes * number
        stay = hear_fix(stay, Fix(True, place, 0.0, 25.0))
    assert stay.place.n == pytest.approx(place, abs=10.0)
    assert hear_fix(stay, Fix(True, place + 1e4, 0.0, 25.0)).place == stay.place


@pytest.mark.parametrize(
    ('later_s', 'aside_m', 'believed'),
    [(15.0, 110.0, True), (15.0, 140.0, False), (9.0, 5.0, False)],
)
def test_a_fix_far_off_is_confirmed_by_one_near_it_and_a_while_later(later_s, aside_m, believed):
    """100 m beside it and what it may have drifted since, 10 s later at the soonest."""
    stay = wait(begin(Vector(0.0, 0.0), 25.0, Vector(0.0, 0.0)), 600.0)
    stay = hear_fix(stay, Fix(True, 5e4, 0.0, 25.0))
    assert stay.fixes == 0
    stay = hear_fix(wait(stay, later_s), Fix(True, 5e4, aside_m, 25.0))
    assert stay.fixes == believed
    assert (tuple(stay.place) == (5e4, 0.0)) == believed


@pytest.mark.parametrize(
    ('waits_s', 'most_std'),
    [([60.1, 60.1, 1800.0, 60.1], 0.2), (120 * [60.1], 0.05)],
    ids=['first and last minutes', 'each minute'],
)
def test_the_change_of_the_drift_is_as_well_known_as_it_says(waits_s, most_std):
    """It goes from 0.1 to 0.3 m/s, and the filter believes that it hardly changes."""
    ends = np.cumsum(waits_s)
    rng, changes = np.random.default_rng(3), []
    for _ in range(200):
        seen = 0.1 * ends + 0.1 * ends**2 / ends[-1] + rng.normal(0.0, 5.0, len(ends))
        stay = begin(Vector(0.0, 0.0), 25.0, Vector(0.1, 0.0))
        fixes = zip(waits_s, seen, np.zeros(len(ends)), np.full(len(ends), 25.0), strict=True)
        change, variance = change_of_drift(stay_with(stay, fixes))
        changes.append(change.n)
    assert np.mean(changes) == pytest.approx(0.2, abs=0.03)
    assert 0.5 * np.std(changes) < math.sqrt(variance) < most_std


def test_without_a_fix_nothing_tells_how_the_drift_has_changed():
    stay = wait(begin(Vector(0.0, 0.0), 25.0, Vector(0.1, 0.0)), 3600.0)
    assert change_of_drift(stay) == (Vector(0.0, 0.0), math.inf)
