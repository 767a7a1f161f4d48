# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""A stall in a dive: the vehicle slides backward, hardly sinks, and does not glide by itself.

It begins where a vehicle becomes heavy before it has way, with its nose not down by enough: in the
first metres of a slow dive. The heavier it is made then, the faster it slides. With the pump in
the middle it comes to rest, its nose goes down, and from there it begins anew. In a climb nobody
takes the pump back: what does not rise may be too heavy to.
"""

import math

from glider_base.kernel import kernel
from glider_model.onboard.glide_polar import glide_net_heaviness

#: Less than this share of the vertical rate that is asked for is none, of at least so much (m/s).
NO_RATE, LEAST_RATE = 0.25, 0.02
#: A vehicle that sinks by less than that with so many times the net heaviness of its glide, and
#: its nose down by this (rad), stalls;
TOO_MUCH, NOSE_DOWN = 2.0, math.radians(10.0)
#: so it is after this time (s).
STALL_S = 120.0
#: It rests for so long (s), its nose sent down to this (rad), while its pump is in the middle, and
#: for this (s) after.
REST_S, BEGINS_S, STEEP = 180.0, 60.0, math.radians(-60.0)


@kernel
def watch_stall(stall_s, measured, reference, m_b, polar, dt):
    """Time (s) for which a vehicle has stalled; less than 0: it is for so long that it rests."""
    if stall_s < 0.0:
        return min(0.0, stall_s + dt) if reference.v_d > 0.0 else 0.0
    is_asked = reference.v_d > LEAST_RATE and measured.theta < -NOSE_DOWN
    is_none = measured.vertical_rate < NO_RATE * reference.v_d
    glide = glide_net_heaviness(reference.theta, reference.v_d, polar)
    if not (is_asked and is_none and m_b > TOO_MUCH * glide):
        return 0.0
    return stall_s + dt if stall_s < STALL_S else -(REST_S + BEGINS_S)
