# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""Coming up at the end of the path: what is left of it, and the dives that fit into that.

All ways are given as the time that they take in a straight glide (s), so that each leg counts with
the speed that the current leaves on it. An inflection loses no way through the water, for a glider
that is led into it, but it takes ``lead_s`` longer than its way does, and the current acts on.
"""

import math
from typing import NamedTuple

from glider_base.kernel import kernel
from glider_base.signals import TICK_S
from glider_guidance.los import crab_heading
from glider_guidance.path.curve import path_piece, path_tangent

#: A leg on which less is made good than this is never done (m/s).
LEAST_PROGRESS = 0.01
#: So many of the last dives share the way that is left; those before go to the full depth.
SHARED_DIVES = 2
#: Another dive of less than this (m) makes nothing good: in it the vehicle only turns.
LEAST_DIVE_M = 5.0


class WayLeft(NamedTuple):
    """What is left of the path."""

    glide_s: float  #: time that it takes in a straight glide (s); infinite: it does not end
    drift: float  #: current along the path, over the speed made good along it (-)


@kernel
def way_left(s, e1, speed, current_n, current_e, enough_s, path):
    """Way left from a position to the end of a path: `WayLeft`.

    ``s`` (m) is the parameter of the virtual target, ``e1`` (m) by how much the vehicle is
    ahead of it, ``speed`` (m/s) the horizontal one through the water in a glide; the current
    is in m/s. More than ``enough_s`` (s) is given as infinite: legs that are far away are not
    looked at.
    """
    first, _ = path_piece(s, path)
    begin, before, glide_s, drift = s, e1, 0.0, 0.0
    for piece in range(first, len(path.knots) - 1):
        end = path.knots[piece + 1]
        d_n, d_e, _ = path_tangent(0.5 * (begin + end), path)
        course = math.atan2(d_e, d_n)
        _, progress, _ = crab_heading(course, speed, current_n, current_e)
        if progress < LEAST_PROGRESS:
            return WayLeft(math.inf, 0.0)
        if piece == first:
            drift = (math.cos(course) * current_n + math.sin(course) * current_e) / progress
        flat = (path.ways[piece + 1] - path.ways[piece]) / (end - path.knots[piece])
        glide_s += (flat * (end - begin) - before) / progress
        if glide_s > enough_s:
            return WayLeft(math.inf, 0.0)
        begin, before = end, 0.0
    return WayLeft(glide_s, drift)


@kernel
def shallowest_dive(params):
    """Depth (m) of the shallowest dive that has a glide in it, of ``params`` (ProfileParams)."""
    return min(params.depth, params.top_depth + params.glide_rate * params.lead_s)


@kernel
def next_dive(left, depth, surfaced, lead_s, dives, is_first, params):
    """Depth (m) of the lower turn of the dive to come, so that the last one ends with the path.

    0.0 if no dive is to come. ``depth`` (m) is where the vehicle is: rising to the upper
    turn, or at the surface, if the dive begins there (``surfaced``). ``lead_s`` (s) is the
    lead of a turn, ``dives`` were begun so far. The first of a path is flown, however near its
    end is.
    """
    if math.isinf(left.glide_s):
        return params.depth
    top, rate = params.top_depth, params.glide_rate
    # what is left at the beginning of the dive, less the way up and down to the upper turn
    left_s = left.glide_s - 2.0 * top / rate
    if not surfaced:
        left_s -= max(0.0, (depth - top) / rate)
        left_s += top / rate
    turns_s = 2.0 * lead_s * left.drift
    dive_s = 2.0 * (params.depth - top) / rate + turns_s
    lost_s = 0.0  # by the surface interval before the next
    if params.surface_every > 0 and (dives + 1) % params.surface_every == 0:
        lost_s = -min(0.0, left.drift) * TICK_S * (params.wait_ticks + params.prepare_ticks)
    if dive_s <= lost_s:
        return params.depth
    count = max(1.0, math.ceil((left_s - lost_s) / (dive_s - lost_s)))
    if count > SHARED_DIVES or (params.dives > 0 and count > max(1, params.dives - dives)):
        return params.depth
    made_good_s = (left_s + (count - 1.0) * lost_s) / count
    planned = top + 0.5 * rate * (made_good_s - turns_s)
    shallowest = shallowest_dive(params)
    # nor is a dive worth it that mostly makes up for what its turns lose to the current
    worth_it = shallowest if is_first else min(params.depth, top + LEAST_DIVE_M)
    if planned < max(shallowest, worth_it) or made_good_s < -turns_s:
        return shallowest if is_first else 0.0
    return params.depth if count == 1.0 else planned


@kernel
def lower_turn(planned, left, depth, lead_s, params):
    """Depth (m) at which a dive turns: as planned, or where the rest of the path takes it up.

    ``planned`` (m) is what `next_dive` said, ``depth`` (m) where the vehicle is, ``lead_s`` (s)
    the lead of the turn.
    """
    if math.isinf(left.glide_s):
        return planned
    deepest = 0.5 * (depth + params.glide_rate * (left.glide_s - lead_s * left.drift))
    return min(planned, max(shallowest_dive(params), deepest))
