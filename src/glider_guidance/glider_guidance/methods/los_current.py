# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""Line of sight that crabs into the estimated current, as far ahead as the vehicle can follow.

In an inflection the vehicle is slow and the current takes it along, by a drift that is known
beforehand: the desired track shifts across, so that half of it comes before the turn.
"""

import math
from typing import NamedTuple

from glider_base.frames import wrap_angle
from glider_base.kernel import kernel
from glider_guidance.los import approach_angles, approach_heading, crab_heading, desired_direction
from glider_guidance.method import Asked, LosGains, MethodSettings, method_step
from glider_guidance.yo.turns import turn_offset
from glider_model.onboard.learnt_steering import WELL_S, lookahead
from glider_model.vehicle.file import Vehicle

#: Of the drift of a turn this part is made up for before it, and as much after it; of the lag
#: behind a desired track that shifts across this share is made up for beforehand.
TURN_SHARE, OFFSET_AHEAD = 0.46, 0.5
#: A phase that can hardly be steered is entered on its heading: the vehicle turns to it so long
#: before the inflection (s), less by the share that `WELL_S` is of its lookahead.
READY_S = 120.0
#: Position pulls the cross-track error that goes by the way over ground in this time (s), and lets
#: it differ by so much at most (m).
BESIDE_S, BESIDE_M = 60.0, 5.0


class LosCurrentSettings(MethodSettings):
    """Crab into the estimated current."""

    def params(self, los: LosGains, vehicle: Vehicle) -> 'LosCurrentParams':
        """Kernel parameters."""
        return LosCurrentParams(los.lookahead_m, los.delta2, los.lead_turns)

    def initial_state(self) -> 'LosCurrentState':
        """Nothing learnt yet."""
        return LosCurrentState(0.0, 0.0)


class LosCurrentParams(NamedTuple):
    """Gains of the method."""

    lookahead: float  #: (m), at least
    vertical_ratio: float  #: delta2 (-)
    leads: bool  #: share the drift of a turn between before and after


class LosCurrentState(NamedTuple):
    """What is known of the turns."""

    drift: float  #: what the last turn was expected to cost across the path (m)
    beside: float  #: cross-track error, by position and way over ground (m)


@kernel
def cross_track(before, seen, dt):
    """Cross-track error (m, + to starboard): the way over ground, pulled by the position."""
    rate = seen.ground_e * math.cos(seen.course) - seen.ground_n * math.sin(seen.course)
    e2 = seen.error.e2
    beside = min(e2 + BESIDE_M, max(e2 - BESIDE_M, before + dt * rate))
    return beside + dt / (BESIDE_S + dt) * (e2 - beside)


@kernel
def lead_turns(drift, seen, lookahead_s):
    """Drift (m) of the last turn, and where the desired track lies for the sake of the turns.

    That is its offset (m, + to starboard), and whether the glide is nearly over: the vehicle turns
    to the heading of the next one.
    """
    leg, current = seen.leg, seen.current
    across = current.v_e * math.cos(seen.course) - current.v_n * math.sin(seen.course)
    if leg.is_surfaced:
        drift = 0.0
    elif leg.begins_to_turn_over:
        drift = across * leg.lead_before_s
    if not leg.is_gliding:
        return drift, 0.0, False
    coming, past = TURN_SHARE * across * leg.lead_s, TURN_SHARE * drift
    offset = turn_offset(leg.to_turn_s, leg.glided_s, coming, past)
    moved = turn_offset(leg.to_turn_s - 1.0, leg.glided_s + 1.0, coming, past) - offset
    ready_s = READY_S
    if leg.to_turn_s < ready_s:
        next_s = lookahead(seen.steering, not leg.descends, seen.turning)
        ready_s = READY_S * (1.0 - WELL_S / next_s)
    return drift, offset + OFFSET_AHEAD * lookahead_s * moved, leg.to_turn_s < ready_s


@method_step.body(LosCurrentParams)
@kernel
def los_current_step(state, seen, params, dt):
    """Direction to fly: see `method_step`."""
    leg, current, course = seen.leg, seen.current, seen.course
    # an inflection is flown on the heading of the glide to come, as it should be
    speed = seen.glide_speed if leg.begins_to_turn_over else seen.speed
    lookahead_s = lookahead(seen.steering, leg.descends, seen.turning)
    over_ground = math.sqrt(seen.ground_n * seen.ground_n + seen.ground_e * seen.ground_e)
    ahead_m = max(params.lookahead, lookahead_s * over_ground)
    drift, offset, is_nearly_over = state.drift, 0.0, False
    if params.leads and not seen.follows_path:
        drift, offset, is_nearly_over = lead_turns(drift, seen, lookahead_s)
    beside = cross_track(state.beside, seen, dt)
    e2, e3 = beside - offset, seen.error.e3
    gamma_r, rho_r = approach_angles(e2, e3, ahead_m, params.vertical_ratio)
    desired, elevation = desired_direction(course, seen.elevation, gamma_r, rho_r)
    _, progress, feasible = crab_heading(course, speed, current.v_n, current.v_e)
    if is_nearly_over or leg.begins_to_turn_over:
        heading, _, _ = crab_heading(course, seen.glide_speed, current.v_n, current.v_e)
    elif leg.turns_over:
        heading = seen.heading
    else:
        approach = wrap_angle(desired - course)
        heading = approach_heading(course, approach, progress, speed, current.v_n, current.v_e)
    asked = Asked(heading, elevation, speed, current.v_n, current.v_e, feasible)
    return LosCurrentState(drift, beside), asked
