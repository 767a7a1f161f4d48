# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""Random numbers that belong to a tick: a hash of (seed, purpose, tick), not a generator.

There is nothing to share, to reset or to keep in step: whoever asks for tick 7 gets the numbers of
tick 7, in a node, in the direct engine, and when a recording is read years later.
"""

import math

import numpy as np

from glider_base.kernel import kernel


@kernel
def splitmix64(x):
    """Hash a 64-bit number: output function of the SplitMix64 generator (Steele et al. 2014)."""
    x += np.uint64(0x9E3779B97F4A7C15)
    x = (x ^ (x >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
    x = (x ^ (x >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
    return x ^ (x >> np.uint64(31))


@kernel
def random_stream(seed, offset, ordinal):
    """Start of the random stream that belongs to one purpose under one seed."""
    x = splitmix64(np.uint64(seed))
    x = splitmix64(x + np.uint64(offset))
    return splitmix64(x + np.uint64(ordinal))


@kernel
def normal_pair(stream, tick):
    """Two independent standard normal numbers that belong to ``tick`` (Box and Muller 1958)."""
    counter = np.uint64(2) * np.uint64(tick)
    first = splitmix64(stream ^ splitmix64(counter))
    second = splitmix64(stream ^ splitmix64(counter + np.uint64(1)))
    # 53 random bits each, in (0, 1]: the logarithm stays finite
    radius = (np.float64(first >> np.uint64(11)) + 0.5) * 2.0**-53
    angle = (np.float64(second >> np.uint64(11)) + 0.5) * 2.0**-53
    radius = math.sqrt(-2.0 * math.log(radius))
    return radius * math.cos(2.0 * math.pi * angle), radius * math.sin(2.0 * math.pi * angle)


@kernel
def uniform(stream, number):
    """A number, even over (0, 1), that belongs to a number of a stream."""
    return (np.float64(splitmix64(stream ^ splitmix64(number)) >> np.uint64(11)) + 0.5) * 2.0**-53
