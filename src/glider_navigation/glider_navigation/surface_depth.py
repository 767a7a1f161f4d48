# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""The depth at the surface: what is shown with a fix is the offset of the sensor.

A receiver has a fix with its antenna out of the water alone. A larger offset than any sensor has
is left to the guard, which brings the vehicle up.
"""

from typing import NamedTuple

from glider_base.kernel import kernel

#: What is shown with a fix counts after this time (s), and so many samples.
FIXED_S, LEAST_SAMPLES = 10.0, 5
#: It is averaged over so many samples at most.
AVERAGED = 100
#: A smaller one is left: waves, and an antenna that is out before the hull is; a larger one is no
#: offset (m).
LEAST_M, LARGEST_M = 3.0, 20.0


class Zero(NamedTuple):
    """What the depth is at the surface, between two ticks."""

    fixed_s: float  #: with a fix, without a break
    samples: int  #: since then
    shown: float  #: depth then, averaged (m)
    offset: float  #: that is taken off (m)


INITIAL_ZERO = Zero(0.0, 0, 0.0, 0.0)


@kernel
def find_zero(zero, depth, is_new, is_fix, dt):
    """Take in the depth (m) that a tick shows, a new sample or not, with a fix or without."""
    if not is_fix:
        return Zero(0.0, 0, zero.shown, zero.offset)
    fixed_s, samples, shown = zero.fixed_s + dt, zero.samples, zero.shown
    if is_new:
        samples += 1
        shown = depth if samples == 1 else shown + (depth - shown) / min(samples, AVERAGED)
    offset = zero.offset
    counts = fixed_s >= FIXED_S and samples >= LEAST_SAMPLES
    if counts and LEAST_M < abs(shown - offset) and abs(shown) <= LARGEST_M:
        offset = shown
    return Zero(fixed_s, samples, shown, offset)
