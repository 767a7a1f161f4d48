# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""The turns of a yo: when they are led, and how the desired track makes up for their drift."""

import math

from glider_base.kernel import kernel
from glider_guidance.yo.stage import GLIDING_DOWN, GLIDING_UP, is_descending

#: The desired track is led between these times before a turn, and comes back in this time (s).
LEAD_FROM_S, LEAD_TO_S, RETURN_S = 400.0, 150.0, 240.0
#: A vehicle slower than this share of its glide's vertical rate is not in its glide; one faster
#: than this is heavier than its file says.
SLOW, FAST = 0.5, 1.1
#: That much more lead it gets at most: its rate, at a tick, may be noise.
MOST_LEAD = 2.0


@kernel
def turn_lead_s(state, params):
    """Time (s) by which the coming turn is led: a turn costs the way of so much straight glide.

    The first turn goes by the pump of the vehicle's file, later ones by how long the last one, if
    there was one of the same kind, took, so that a slow pump or a wrong ballast is led too.
    """
    same_s, other_s = state.lead_down_s, state.lead_up_s
    if is_descending(state.stage):
        same_s, other_s = other_s, same_s
    if same_s > 0.0:
        return same_s
    return other_s if other_s > 0.0 else params.lead_s


@kernel
def turn_lead_m(rate, full, lead_s, is_first):
    """Way (m) by which a turn is led, at a vertical rate (m/s) towards it.

    The weight goes with the square of the rate, and the lead with the weight. A vehicle that goes
    at less than half of its ``full`` vertical rate (m/s) has its pump nearly in the middle yet.
    One that is heavier than its file says shows it before its first turn; later ones know.
    """
    share = rate / full
    lead = rate * lead_s * min(1.0, share * share / (SLOW * SLOW))
    return lead * min(MOST_LEAD, share * share) if is_first and share > FAST else lead


@kernel
def time_to_turn(state, depth, vertical_rate, turn_depth, params):
    """Time (s) until the pump starts for the next turn; infinite where none is to come.

    ``turn_depth`` is that of `coming_turn`.
    """
    rate = max(abs(vertical_rate), 0.01)
    if state.stage == GLIDING_DOWN:
        return (turn_depth - depth) / rate - turn_lead_s(state, params)
    done = state.dives + 1
    surfacing = (params.dives > 0 and done >= params.dives) or (
        params.surface_every > 0 and done % params.surface_every == 0
    )
    if state.stage == GLIDING_UP and not surfacing and turn_depth > 0.0:
        return (depth - params.top_depth) / rate - turn_lead_s(state, params)
    return math.inf


@kernel
def _smooth(share):
    """Smooth step from 0 to 1."""
    x = min(1.0, max(0.0, share))
    return x * x * (3.0 - 2.0 * x)


@kernel
def turn_offset(to_turn_s, since_turn_s, coming, past):
    """Offset (m) of the desired track that shares a turn's drift between before and after.

    In a turn the vehicle is slow and the current takes it along by a drift that is known
    beforehand. The desired track therefore moves up-current by the ``coming`` drift (m) before the
    turn, and from the ``past`` drift back to zero after it: of either, the part that this phase
    bears.
    """
    before = _smooth((LEAD_FROM_S - to_turn_s) / (LEAD_FROM_S - LEAD_TO_S))
    after = 1.0 - _smooth(since_turn_s / RETURN_S)
    return past * after - coming * before
