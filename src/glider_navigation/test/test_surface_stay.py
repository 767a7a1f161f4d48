# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""A stay at the surface against Bayesian linear regression with matrices."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from glider_model.base.signals import Vector
from glider_navigation.method import Fix
from glider_navigation.surface_stay import begin, counts, now, take_fix, variance_now, wait

quick = settings(max_examples=50, deadline=None)

#: What is believed of the drift before there is a fix is off by so much (m/s).
DRIFT_STD = 0.15
metres = st.floats(-5000.0, 5000.0)
# by rounding, a fix after 60 s sharp may be one too early
fixes = st.lists(
    st.tuples(st.floats(60.1, 900.0), metres, metres, st.floats(1.0, 1e4)), min_size=1, max_size=8
)


def regression(prior, covariance, times, seen, variances):
    """Posterior mean and covariance of [p, v] in p + v t, in information form."""
    H = np.stack([np.ones_like(times), times], axis=1)
    R_inverse = np.diag(1.0 / np.asarray(variances))
    information = np.linalg.inv(covariance) + H.T @ R_inverse @ H
    posterior = np.linalg.inv(information)
    mean = posterior @ (np.linalg.solve(covariance, prior) + H.T @ R_inverse @ seen)
    return mean, posterior


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
    times, prior = np.cumsum(after), np.diag([variance, DRIFT_STD**2])
    for axis, start, at_first, seen in (('n', drift, place[0], n), ('e', -drift, place[1], e)):
        mean, covariance = regression([at_first, start], prior, times, seen, variances)
        there = [getattr(stay.place, axis), getattr(stay.drift, axis)]
        assert there == pytest.approx(mean, rel=1e-6, abs=1e-5)
        t = np.array([1.0, times[-1]])
        assert getattr(now(stay), axis) == pytest.approx(t @ mean, rel=1e-6, abs=1e-4)
        assert [stay.pp, stay.pv, stay.vv] == pytest.approx(
            covariance[[0, 0, 1], [0, 1, 1]], rel=1e-6, abs=1e-9
        )
        assert variance_now(stay) == pytest.approx(t @ covariance @ t, rel=1e-6)
    assert stay.fixes == len(fixes)


def test_with_nothing_known_before_it_is_the_least_squares_line():
    rng = np.random.default_rng(3)
    times = np.arange(60.0, 1200.0, 60.0)
    track = np.outer(times, [0.2, -0.1]) + [300.0, -200.0] + rng.normal(0.0, 5.0, (len(times), 2))
    stay = begin(Vector(0.0, 0.0), 1e12, Vector(0.1, 0.1))._replace(vv=1e6)
    stay = stay_with(stay, [(60.0, n, e, 25.0) for n, e in track])
    for axis, seen in zip('ne', track.T, strict=True):
        drift, place = np.polyfit(times, seen, 1)
        assert getattr(stay.drift, axis) == pytest.approx(drift, abs=1e-5)
        assert getattr(stay.place, axis) == pytest.approx(place, abs=1e-2)


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
    assert tuple(now(stay)) == pytest.approx((220.0, 20.0))
    assert variance_now(stay) == pytest.approx(400.0 + (600.0 * DRIFT_STD) ** 2)
