# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""Exponential Runge-Kutta of fourth order for a number that decays fast (docs/theory.md, 1).

Cox and Matthews (2002), "Exponential time differencing for stiff systems", J. Comput. Phys. 176,
430-455, eq. (26)-(29). For x' = -pole x + n(x, t) with a constant pole, n is what a Runge-Kutta
method sees; the decay is solved exactly. Where the pole is zero this is the classical RK4.
"""

import math
from typing import NamedTuple

from glider_base.kernel import kernel

#: Below this |z| phi_3 is summed up as a series: the closed form loses digits to cancellation.
SERIES_BELOW = 0.5
#: Terms of that series; what comes after them is below 1e-16 of the sum.
SERIES_TERMS = 13


class Decay(NamedTuple):
    """Weights of a step for one pole."""

    half: float  #: decay within half a step
    half_input: float  #: weight of the input of half a step (s)
    whole: float  #: decay within the step
    first: float  #: weights of the inputs n_1, n_2 + n_3, n_4 (s)
    middle: float
    last: float


@kernel
def phi_functions(z):
    """e^z, phi_1(z), phi_2(z), phi_3(z) for z <= 0."""
    if z > -SERIES_BELOW:
        phi_3 = 0.0
        for k in range(SERIES_TERMS + 3, 3, -1):
            phi_3 = (1.0 + phi_3) * z / k
        phi_3 = (1.0 + phi_3) / 6.0
        phi_2 = 0.5 + z * phi_3
        phi_1 = 1.0 + z * phi_2
        return 1.0 + z * phi_1, phi_1, phi_2, phi_3
    decay = math.exp(z)
    phi_1 = (decay - 1.0) / z
    phi_2 = (phi_1 - 1.0) / z
    return decay, phi_1, phi_2, (phi_2 - 0.5) / z


@kernel
def decay_weights(pole, h):
    """Weights of a step of ``h`` s for a pole (1/s, >= 0: decay)."""
    half, half_1, half_2, half_3 = phi_functions(-0.5 * h * pole)
    # from z to 2 z by sums of positive numbers, which lose nothing
    phi_1 = 0.5 * (half + 1.0) * half_1
    phi_2 = 0.25 * ((half + 1.0) * half_2 + half_1)
    phi_3 = 0.125 * ((half + 1.0) * half_3 + half_2 + 0.5 * half_1)
    return Decay(
        half=half,
        half_input=0.5 * h * half_1,
        whole=half * half,
        first=h * (phi_1 - 3.0 * phi_2 + 4.0 * phi_3),
        middle=h * (2.0 * phi_2 - 4.0 * phi_3),
        last=h * (4.0 * phi_3 - phi_2),
    )
