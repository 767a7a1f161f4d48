# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""Line of sight that crabs into the estimated current, as far ahead as the vehicle can follow.

In a turn-over the vehicle is slow and the current takes it along, by a drift that is known
beforehand: the desired track moves aside, so that half of it comes before the turn.
"""

import math
from typing import NamedTuple

from glider_base.frames import wrap_angle
from glider_base.kernel import kernel
from glider_guidance.los import (
    approach_angles,
    approach_heading,
    crab_heading,
    desired_direction,
)
from glider_guidance.method import Asked, LosGains, MethodSettings, method_step
from glider_guidance.yo.stage import INFLECTING_UP
from glider_guidance.yo.turns import turn_offset
from glider_model.onboard.learnt_steering import followed_frequency
from glider_model.vehicle.file import Vehicle

#: Lookahead in time, times the frequency up to which the vehicle can be steered, is no less (-).
LOOKAHEAD_OVER_ZERO = 3.0
#: It grows to this many times itself.
LOOKAHEAD_STRETCH_MAX = 10.0
#: Of the lag behind a desired track that moves aside, this share is made up for beforehand.
OFFSET_AHEAD = 0.5
#: What a turn really cost across the path is measured so long after it (s), on the cross-track
#: error smoothed over this time (s), in a cross current of no less than this (m/s).
MEASURED_S, BESIDE_S, MEASURED_CURRENT = 120.0, 20.0, 0.02
#: Largest correction of the lead of a turn (s).
LEAD_CORRECTION_S = 60.0
#: A phase that can hardly be steered is entered on its heading: the vehicle turns to it so long
#: before the turn-over (s) for each time that the lookahead grows by itself, and so long at most.
READY_S, READY_S_MAX = 60.0, 100.0


class LosCurrentSettings(MethodSettings):
    """Crab into the estimated current."""

    def params(self, los: LosGains, vehicle: Vehicle) -> 'LosCurrentParams':
        """Kernel parameters."""
        return LosCurrentParams(los.lookahead_m, los.lookahead_s, los.delta2, los.lead_turns)

    def initial_state(self) -> 'LosCurrentState':
        """Nothing learnt yet."""
        return LosCurrentState(0.0, 0.0, 0.0, 0.0)


class LosCurrentParams(NamedTuple):
    """Gains of the method."""

    lookahead: float  #: (m), at least
    lookahead_s: float  #: times the speed over ground, if that is more
    vertical_ratio: float  #: delta2 (-)
    leads: bool  #: share the drift of a turn between before and after


class LosCurrentState(NamedTuple):
    """What is known of the turns."""

    drift: float  #: what the last turn was expected to cost across the path (m)
    beside: float  #: smoothed cross-track error (m)
    more_up_s: float  #: by how much the turn at depth has to be led more, as learnt (s)
    more_down_s: float  #: the same for the upper turn


class Aside(NamedTuple):
    """Where the desired track lies beside the path, for the sake of a turn."""

    offset: float  #: (m, + to starboard)
    is_nearly_over: bool  #: the glide is: the vehicle turns to the heading of the next one


@kernel
def lookahead_stretch(steering, lookahead_s):
    """Factor on the lookahead, 1 or more, for a vehicle that steers weakly in a phase.

    Position is steered by heading. Where each roll first turns the nose the wrong way, position
    must be asked for more slowly, or the two loops swing against each other.

    Parameters
    ----------
    steering : SteeringState
        What is known of the phase.
    lookahead_s : float
        Lookahead for a vehicle that steers well (s).
    """
    if lookahead_s <= 0.0:
        return 1.0
    needed_s = LOOKAHEAD_OVER_ZERO / followed_frequency(steering)
    return min(LOOKAHEAD_STRETCH_MAX, max(1.0, needed_s / lookahead_s))


@kernel
def _within(value, most):
    """``value``, held within -most and most."""
    return min(most, max(-most, value))


@kernel
def lead_turns(state, seen, stretch, next_stretch, lookahead_s):
    """Where the desired track lies for the sake of the turns, and what has been learnt of them.

    Parameters
    ----------
    state : LosCurrentState
    seen : Situation
    stretch, next_stretch : float
        `lookahead_stretch` of this phase and of the next one.
    lookahead_s : float
        Lookahead in time (s), stretched.

    Returns
    -------
    LosCurrentState, Aside
    """
    leg, current = seen.leg, seen.current
    more_up_s, more_down_s = state.more_up_s, state.more_down_s
    across = current.v_e * math.cos(seen.course) - current.v_n * math.sin(seen.course)
    more_s = more_up_s if leg.descends else more_down_s
    coming = across * (leg.lead_s + more_s)
    drift = state.drift
    if leg.is_surfaced:
        drift = 0.0
    elif leg.begins_to_turn_over:
        more_s = more_up_s if leg.stage == INFLECTING_UP else more_down_s
        drift = across * (leg.lead_before_s + more_s)
    offset, is_nearly_over = 0.0, False
    if leg.is_gliding:
        # the phase that steers less well bears the smaller part of the drift
        part = next_stretch / (stretch + next_stretch)
        coming, past = part * coming, part * drift
        offset = turn_offset(leg.to_turn_s, leg.glided_s, coming, past)
        if (
            leg.glided_before_s < MEASURED_S <= leg.glided_s
            and drift != 0.0
            and abs(across) > MEASURED_CURRENT
        ):
            # those that steer well make it good by themselves
            more_s = (1.0 - 1.0 / stretch) * (state.beside - offset) / across
            if leg.descends:
                more_down_s = _within(more_down_s + more_s, LEAD_CORRECTION_S)
            else:
                more_up_s = _within(more_up_s + more_s, LEAD_CORRECTION_S)
        moved = turn_offset(leg.to_turn_s - 1.0, leg.glided_s + 1.0, coming, past) - offset
        offset += OFFSET_AHEAD * lookahead_s * moved
        is_nearly_over = leg.to_turn_s < min(READY_S_MAX, READY_S * (next_stretch - 1.0))
    return (
        LosCurrentState(drift, state.beside, more_up_s, more_down_s),
        Aside(offset, is_nearly_over),
    )


@method_step.body(LosCurrentParams)
@kernel
def los_current_step(state, seen, params, dt):
    """Direction to fly: see `method_step`."""
    leg, current = seen.leg, seen.current
    # a turn-over is flown on the heading of the glide to come, as it should be
    speed = seen.glide_speed if leg.begins_to_turn_over else seen.speed
    stretch = lookahead_stretch(seen.steering.dive, params.lookahead_s)
    next_stretch = lookahead_stretch(seen.steering.climb, params.lookahead_s)
    if not leg.descends:
        stretch, next_stretch = next_stretch, stretch
    lookahead_s = stretch * params.lookahead_s
    lookahead = max(
        params.lookahead,
        lookahead_s * math.sqrt(seen.ground_n * seen.ground_n + seen.ground_e * seen.ground_e),
    )
    beside = state.beside + dt / BESIDE_S * (seen.error.e2 - state.beside)
    state = LosCurrentState(state.drift, beside, state.more_up_s, state.more_down_s)
    aside = Aside(0.0, False)
    if params.leads and not seen.follows_path:
        state, aside = lead_turns(state, seen, stretch, next_stretch, lookahead_s)

    gamma_r, rho_r = approach_angles(
        seen.error.e2 - aside.offset, seen.error.e3, lookahead, params.vertical_ratio
    )
    if not seen.follows_path:
        rho_r = 0.0
    course, elevation = desired_direction(seen.course, seen.elevation, gamma_r, rho_r)
    _, progress, feasible = crab_heading(seen.course, speed, current.v_n, current.v_e)
    heading = approach_heading(
        seen.course,
        wrap_angle(course - seen.course),
        progress,
        speed,
        current.v_n,
        current.v_e,
    )
    if aside.is_nearly_over or leg.begins_to_turn_over:
        heading, _, _ = crab_heading(seen.course, seen.glide_speed, current.v_n, current.v_e)
    elif leg.turns_over:
        heading = seen.heading
    return state, Asked(
        heading=heading,
        elevation=elevation,
        speed=speed,
        current_n=current.v_n,
        current_e=current.v_e,
        feasible=feasible,
    )
