# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""What is believed of the current against a Kalman filter with matrices, and simulated seas."""

import math

import numpy as np
import pytest

from glider_base.signals import Vector
from glider_navigation.current_estimate import (
    Regressors,
    carry,
    current_at,
    initial_estimate,
    last_mean,
    mean_variance,
    take_in,
    wandered,
)
from glider_navigation.forecast import Trust

#: Principal lunar tide (rad/s), what is known before the first way, and what never is (m/s).
M2 = 2.0 * math.pi / (12.4206012 * 3600.0)
MEAN_STD, TIDE_STD, LEAST_STD = 0.3, 0.05, 0.0007
#: Good fixes at both ends of a way (m^2/s^2).
GOOD = 2.0 * (5.0 / 5400.0) ** 2
GLIDE = Vector(0.3, 0.1)


def regressors(start_s, end_s):
    """Means of 1, cos(w t), sin(w t), by their integrals."""
    angles, span = M2 * np.array([start_s, end_s]), M2 * (end_s - start_s)
    return Regressors(
        1.0, float(np.diff(np.sin(angles))[0]) / span, float(-np.diff(np.cos(angles))[0]) / span
    )


def matrix(p):
    """Covariance of mean, cosine and sine."""
    return np.array([[p.mm, p.ma, p.mb], [p.ma, p.aa, p.ab], [p.mb, p.ab, p.bb]])


def axis_of(estimate, axis):
    return np.array(
        [getattr(estimate.mean, axis), getattr(estimate.cos, axis), estimate.sin._asdict()[axis]]
    )


def take_mean(estimate, mean, way_s, h=None, variance=GOOD, bias=0.0):
    """Take in the mean current (m/s) over a way, as a vehicle does that believed what it did."""
    h = h or Regressors(1.0, 0.0, 0.0)
    off = [
        float(y - axis_of(estimate, axis) @ np.array(h))
        for y, axis in zip(mean, 'ne', strict=True)
    ]
    return take_in(estimate, Vector(*off), h, way_s, GLIDE, variance, bias)


class Walk:
    """A current that wanders: a random walk on each axis, and its means over ways of one length.

    Its increments have variance q t (m^2/s^2), so that the means of two ways that follow each
    other differ by a variance of 2 q T / 3.
    """

    def __init__(self, q, way_s, ways, seed):
        steps = 100
        rng = np.random.default_rng(seed)
        walk = np.cumsum(rng.normal(0.0, math.sqrt(q * way_s / steps), (ways * steps, 2)), axis=0)
        self.means = walk.reshape(ways, steps, 2).mean(axis=1)


@pytest.mark.parametrize('tide', [True, False], ids=['tidal', 'persistence'])
def test_it_is_the_kalman_filter(tide):
    """Ways of all lengths, fixes of all kinds; the filter in Joseph's form."""
    rng = np.random.default_rng(5)
    estimate = initial_estimate(tide)
    x = np.zeros((3, 2))
    P = np.diag([MEAN_STD**2, *(2 * [TIDE_STD**2 if tide else 0.0])])
    t_s, before_s = 600.0, 0.0
    for way in range(60):
        way_s = rng.uniform(600.0, 20000.0)
        variance, bias = 10.0 ** rng.uniform(-6.0, -2.0), 10.0 ** rng.uniform(-8.0, -4.0)
        h, mean = regressors(t_s, t_s + way_s), rng.normal(0.0, 0.3, 2)
        if way > 0:
            learnt = estimate.q * (before_s + way_s) / 3.0
            wander = learnt * (1.0 + 1.0 / estimate.weight) + LEAST_STD**2
            assert wandered(estimate, way_s) == pytest.approx(wander, rel=1e-12)
            P = P + np.diag([wander, 0.0, 0.0])
        P = P + np.diag([bias, 0.0, 0.0])
        H = np.array([h])
        K = P @ H.T / (H @ P @ H.T + variance)
        estimate = take_mean(estimate, mean, way_s, h, variance, bias)
        x = x + K @ (mean[None, :] - H @ x)
        P = (np.eye(3) - K @ H) @ P @ (np.eye(3) - K @ H).T + variance * K @ K.T
        for i, axis in enumerate('ne'):
            assert axis_of(estimate, axis) == pytest.approx(x[:, i], rel=1e-8, abs=1e-10)
        assert matrix(estimate.p) == pytest.approx(P, rel=1e-6, abs=1e-12)
        assert mean_variance(estimate, h) == pytest.approx((H @ P @ H.T)[0, 0], rel=1e-6)
        t_s, before_s = t_s + way_s + 600.0, way_s
        parts = np.array([1.0, math.cos(M2 * t_s), math.sin(M2 * t_s)])
        assert tuple(current_at(estimate, t_s)) == pytest.approx(parts @ x, rel=1e-8, abs=1e-10)


def test_without_a_tide_the_last_mean_is_believed():
    """Persistence, where fixes are good: within 1 % of the change from way to way."""
    estimate = initial_estimate(False)
    for mean in np.random.default_rng(2).normal(0.0, 0.1, (50, 2)):
        change = np.abs(mean - np.array(estimate.mean))
        estimate = take_mean(estimate, mean, 5400.0)
        assert np.all(np.abs(np.array(estimate.mean) - mean) <= 0.01 * change)
        assert current_at(estimate, 1e5) == estimate.mean


def test_a_tide_is_learnt():
    """A mean and M2 of 0.1 m/s, over four days: believed ahead to within 1 cm/s."""
    estimate, t_s = initial_estimate(True), 0.0
    mean, cos, sin = np.array([0.10, -0.05]), np.array([0.08, 0.02]), np.array([-0.03, 0.06])
    for _ in range(64):
        h = regressors(t_s, t_s + 5400.0)
        seen = mean + h.cos * cos + h.sin * sin
        estimate, t_s = take_mean(estimate, seen, 5400.0, h), t_s + 5400.0
    assert tuple(last_mean(estimate)) == pytest.approx(seen, abs=0.01)
    for ahead_s in np.linspace(t_s, t_s + 12.0 * 3600.0, 25):
        truth = mean + math.cos(M2 * ahead_s) * cos + math.sin(M2 * ahead_s) * sin
        assert tuple(current_at(estimate, ahead_s)) == pytest.approx(truth, abs=0.01)


def test_how_much_the_sea_wanders_is_learnt():
    """Up where every way is another sea, down where all are the same; the first tells nothing."""
    still = changing = take_mean(initial_estimate(False), [0.1, 0.2], 5400.0)
    first = initial_estimate(False).q
    assert still.q == first
    for sign in (-1.0, 1.0, -1.0, 1.0, -1.0, 1.0):
        before = still.q, changing.q
        still = take_mean(still, [0.1, 0.2], 5400.0)
        changing = take_mean(changing, [sign * 0.3, sign * 0.1], 5400.0)
        assert still.q < before[0] and changing.q > before[1]
    assert still.q < 0.3 * first
    assert still.q == pytest.approx(0.8 * before[0]), 'four ways count'
    assert changing.q > 10.0 * first


@pytest.mark.parametrize('seed', range(5))
def test_covariance_stays_symmetric_and_positive(seed):
    """Of 500 ways of all kinds; known no better than a perfect filter would."""
    rng = np.random.default_rng(seed)
    estimate, t_s = initial_estimate(True), 0.0
    for _ in range(500):
        way_s = 10.0 ** rng.uniform(2.5, 5.0)
        h = regressors(t_s, t_s + way_s)
        variance = 10.0 ** rng.uniform(-10.0, 0.0)
        estimate = take_mean(estimate, rng.normal(0.0, 0.2, 2), way_s, h, variance)
        t_s += way_s + 10.0 ** rng.uniform(1.0, 5.0)
        values = np.linalg.eigvalsh(matrix(estimate.p))
        assert values[0] > -1e-12 * values[-1]
        assert estimate.q >= 0.0


def squared_innovations(means, estimate, way_s, q=None):
    """Squared innovations over their variance, way by way, and what was believed of the sea.

    A random walk leaves what any sea does: it is looked at from the frame that goes with it.
    """
    squared, learnt, frame = [], [], np.zeros(2)
    for mean in means:
        if q is not None:
            estimate = estimate._replace(q=q, weight=1e12)
        if estimate.way_s > 0.0:
            off = mean - frame - np.array(estimate.mean)
            variance = estimate.p.mm + wandered(estimate, way_s) + GOOD
            squared.append(off @ off / variance)
            learnt.append(estimate.q)
        estimate = take_mean(estimate, mean - frame, way_s)
        frame = frame + np.array(estimate.mean)
        estimate = estimate._replace(mean=Vector(0.0, 0.0))
    return np.array(squared), np.array(learnt)


def mean_and_error(series):
    """Mean of a series, and its standard error by means over 20 ways, whatever they share."""
    batches = series[: len(series) // 20 * 20].reshape(-1, 20).mean(axis=1)
    return batches.mean(), batches.std(ddof=1) / math.sqrt(len(batches))


@pytest.mark.parametrize('way_s', [1800.0, 5400.0, 20000.0])
def test_errors_are_as_told_where_it_is_known_how_much_the_sea_wanders(way_s):
    """Two axes: a mean of 2."""
    q = 3.4e-7
    rng = np.random.default_rng(7)
    means = Walk(q, way_s, 2000, seed=11).means
    means += rng.normal(0.0, math.sqrt(GOOD), means.shape)
    squared, _ = squared_innovations(means, initial_estimate(False), way_s, q)
    mean, error = mean_and_error(squared)
    assert error < 0.1
    assert abs(mean - 2.0) < 4.0 * error


@pytest.mark.parametrize('q', [3e-8, 3e-7, 3e-6])
def test_errors_are_as_told_where_it_is_learnt_how_much_the_sea_wanders(q):
    """A calm, a common and a wild sea.

    What is learnt is right in the mean. It follows the last ways, a fifth of it the last one:
    (2 - 1/5) / (1/5) = 9 ways of two axes, so that the mean of 2 is that of Fisher's F with 18
    degrees of freedom, 2 (18 / 16), for ways that share nothing, and that over what is told for
    having learnt from a few, 1.25. By the same F 95.6 % are inside what is told as 95 %.
    """
    rng = np.random.default_rng(13)
    means = Walk(q, 5400.0, 4000, seed=17).means
    means += rng.normal(0.0, math.sqrt(GOOD), means.shape)
    squared, learnt = squared_innovations(means, initial_estimate(False), 5400.0)
    mean, error = mean_and_error(squared)
    assert error < 0.1
    assert abs(mean - 2.0 * 18.0 / 16.0 / 1.25) < 0.15 + 4.0 * error
    assert np.mean(learnt) == pytest.approx(q, rel=0.15)
    assert np.mean(squared < 5.991) == pytest.approx(0.956, abs=0.015)


def test_no_current_is_believed_that_no_sea_has():
    """Fixes that say 8 m/s: the direction is believed, and 3 m/s of it."""
    estimate = take_mean(initial_estimate(False), [4.8, -6.4], 5400.0)
    assert tuple(estimate.mean) == pytest.approx((1.8, -2.4), rel=1e-9)


def test_a_long_stay_carries_the_current_on_and_a_short_one_does_not():
    """By the change of the drift, as far as that is the current's; the rest of it is unknown."""
    estimate = take_mean(initial_estimate(False), [0.10, -0.05], 5400.0)
    estimate = estimate._replace(follows=Trust(0.8, 0.01))
    short = carry(estimate, Vector(0.1, 0.2), 3600.0, 1e-4)
    assert tuple(current_at(short, 0.0)) == tuple(estimate.mean)
    assert short.gap_s == 3600.0
    long = carry(estimate, Vector(0.1, 0.2), 21600.0, 1e-4)
    moved = np.array(current_at(long, 0.0)) - estimate.mean
    share = 0.8 * estimate.q * 21600.0 / (estimate.q * 21600.0 + 1e-4)
    assert moved == pytest.approx(share * np.array([0.1, 0.2]))
    assert tuple(last_mean(long)) == pytest.approx(tuple(estimate.mean))
    told = [wandered(one, 5400.0) for one in (estimate, short, long)]
    untold = [3600.0, (1.0 - share) * 21600.0]
    grown = 2.0 * estimate.q * np.array(untold)
    assert np.array(told[1:]) - told[0] == pytest.approx(grown, rel=1e-6)


@pytest.mark.parametrize('of_current', [0.0, 1.0], ids=['the wind', 'the current'])
def test_it_is_learnt_whether_the_drift_changes_with_the_current(of_current):
    """Ten stays of 2 h, after each of which the drift has changed by 0.1 m/s rms on each axis."""
    rng = np.random.default_rng(6)
    estimate, now = initial_estimate(False), np.array([0.1, -0.05])
    off = []
    for _ in range(10):
        carried = np.array(current_at(estimate, 0.0)) - estimate.mean
        estimate = take_mean(estimate, now - carried, 5400.0)
        change = rng.normal(0.0, 0.1, 2)
        estimate = carry(estimate, Vector(*change.tolist()), 7200.0, 1e-5)
        now = now + of_current * change
        off.append(math.hypot(*(np.array(current_at(estimate, 0.0)) - now)))
    assert estimate.follows.share == pytest.approx(of_current, abs=0.1)
    assert np.median(off[5:]) < 0.015
