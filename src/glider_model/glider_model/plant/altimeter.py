# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""The altimeter: how far the bottom is below, where a sounder hears it."""

from typing import NamedTuple

import numpy as np

from glider_base.kernel import kernel
from glider_base.noise import normal_pair
from glider_base.wiring import ALTIMETER_REACH_M, NO_ECHO


class AltimeterParams(NamedTuple):
    """The altimeter as the kernels see it."""

    is_fitted: bool
    std: float  #: (m)
    period_ticks: int  #: from one echo to the next
    stream: np.uint64  #: start of the random stream


@kernel
def echo(height, tick, params):
    """Measured height over the bottom, of a true one (m), as a float32; `NO_ECHO` out of reach."""
    if params.std > 0.0:
        noise, _ = normal_pair(params.stream, np.uint64(tick))
        height += params.std * noise
    if height < ALTIMETER_REACH_M[0] or height > ALTIMETER_REACH_M[1]:
        return NO_ECHO
    return float(np.float32(height))
