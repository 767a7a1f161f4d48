# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""The bottom of the sea: how deep it is at a place, and a vehicle that touches it."""

import math
from typing import NamedTuple

from glider_base.frames import rotate_to_body, rotate_to_ned
from glider_base.kernel import kernel, replace
from glider_base.slot import slot


class FlatBottom(NamedTuple):
    """A bottom that is as deep everywhere."""

    depth: float  #: (m); infinite: none


NO_BOTTOM = FlatBottom(math.inf)


@slot
def bottom_depth(n, e, params):
    """Depth of the bottom (m) at a place north and east (m); infinite where there is none."""
    raise NotImplementedError


@bottom_depth.body(FlatBottom)
@kernel
def _flat_depth(n, e, params):
    return params.depth


@kernel
def least_height(n, e, depth, params):
    """Least height over the bottom (m) along a track, and the index of it.

    Parameters
    ----------
    n, e, depth : float64[ticks]
        (m)
    params : NamedTuple
        The bottom.
    """
    least, where = math.inf, 0
    for i in range(len(depth)):
        height = bottom_depth(n[i], e[i], params) - depth[i]
        if height < least:
            least, where = height, i
    return least, where


@kernel
def aground(motion, water, bottom):
    """The motion of a vehicle, stopped by the bottom if it would be below it.

    It lies where it touched: the mud holds it against the current, and lets it go upward.

    Parameters
    ----------
    motion : Motion
    water : Water
        Velocity of the water (m/s).
    bottom : float
        Its depth there (m).
    """
    x = motion
    if not x.p_d > bottom:
        return motion
    _, _, down = rotate_to_ned(x.q_w, x.q_x, x.q_y, x.q_z, x.u, x.v, x.w)
    down = min(0.0, down + water.v_d) - water.v_d
    u, v, w = rotate_to_body(x.q_w, x.q_x, x.q_y, x.q_z, -water.v_n, -water.v_e, down)
    return replace(x, p_d=bottom, u=u, v=v, w=w)
