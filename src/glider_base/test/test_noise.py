# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""Random numbers: the published sequence, the normal distribution, one number for one tick."""

import math

import numpy as np
import pytest
from scipy import stats

from glider_base.kernel import kernel
from glider_base.noise import normal_pair, random_stream, splitmix64


@kernel
def series(stream, first, count):
    """Pairs of ``count`` ticks from ``first`` on."""
    pairs = np.empty((count, 2))
    for i in range(count):
        pairs[i] = normal_pair(stream, first + i)
    return pairs


def pairs_of(seed, offset=0, ordinal=0, first=0, count=200_000):
    return series(np.uint64(random_stream(seed, offset, ordinal)), first, count)


def test_splitmix64_matches_its_published_sequence():
    # First outputs of SplitMix64 from state 1234567, the test vector that Rosetta Code lists.
    golden, mask = 0x9E3779B97F4A7C15, 2**64 - 1
    outputs = [int(splitmix64(np.uint64((1234567 + i * golden) & mask))) for i in range(5)]
    assert outputs == [
        6457827717110365317,
        3203168211198807973,
        9817491932198370423,
        4593380528125082431,
        16408922859458223821,
    ]


def test_numbers_are_standard_normal_and_independent():
    pairs = pairs_of(seed=5)
    assert stats.kstest(pairs.ravel(), 'norm').pvalue > 1e-3
    correlations = np.corrcoef(np.vstack([pairs[:-1].T, pairs[1:].T]))
    assert np.max(np.abs(correlations - np.eye(4))) < 4.5 / math.sqrt(len(pairs))


def test_a_tick_has_the_same_numbers_whatever_was_asked_before():
    np.testing.assert_array_equal(pairs_of(3, first=1000, count=10), pairs_of(3)[1000:1010])


@pytest.mark.parametrize('other', [(1, 0, 0), (0, 1, 0), (0, 0, 1)])
def test_seeds_and_purposes_have_streams_of_their_own(other):
    one, two = pairs_of(0)[:, 0], pairs_of(*other)[:, 0]
    assert abs(np.corrcoef(one, two)[0, 1]) < 4.5 / math.sqrt(len(one))
