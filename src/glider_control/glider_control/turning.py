# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""From a turn rate, or a heading error, to the roll for it, by what is known of the steering."""

import math

from glider_base.kernel import kernel

#: A vehicle that steers less is not steered at all (rad/s).
SMALLEST_STEERING = 1e-6
#: A standard deviation of this share of b is no doubt.
SURE_SHARE = 0.3
#: A vehicle that is slightly reversed is kicked for heading errors up to this size (rad).
KICK_ERROR = 0.09
#: The vehicle rolls to this share of the roll at which it turns fastest.
SHARE_OF_PEAK = 0.7


@kernel
def caution(state):
    """Share of a turn for which the vehicle is rolled: the less is known of b, the less.

    b^2 / (b^2 + var b) minimises the expected squared error of the turn rate (cautious control:
    Astrom and Wittenmark, Adaptive Control, 1995, chapter 7). A vehicle whose sign is in doubt is
    hardly rolled; a deviation that leaves no doubt about it is no reason.
    """
    square = state.b * state.b
    return square / (square + max(0.0, state.p[0] - SURE_SHARE * SURE_SHARE * square))


@kernel
def sure_disturbance(state):
    """Turn-rate disturbance d (rad/s), as far as it is no doubt: d^3 / (d^2 + var d)."""
    square = state.d * state.d
    return state.d * square / (square + state.p[9])


@kernel
def roll_to_kick(state, error):
    """Sine of the roll whose kick alone turns the nose by a heading error (rad), if it is of use.

    A vehicle that hardly turns is steered by nothing else. For others it is of use where turn and
    kick go to the same side: there the heading that is left when the roll is gone comes nearer by
    itself. Of a kick that is not known well, a share is used, as of b.
    """
    sine = state.k / (state.k * state.k + state.p[7])
    if state.is_kicked:
        return sine * error
    if state.b * state.k <= 0.0:
        return 0.0
    return (1.0 - caution(state)) * sine * min(KICK_ERROR, max(-KICK_ERROR, error))


@kernel
def roll_to_turn(state, turn, ratio, limit):
    """Sine of the roll that turns at ``turn``, and the largest sine that is of use.

    Where steering fades with roll, b s + c s^3 has a peak; beyond it a vehicle turns the less,
    and at last the other way, the more it rolls.

    Parameters
    ----------
    state : SteeringState
    turn : float
        Turn rate that roll shall make (rad/s).
    ratio : float
        V / V_0 (-).
    limit : float
        Largest sine of roll (-).
    """
    b, c = state.b, state.c
    if b * c < 0.0:
        limit = min(limit, SHARE_OF_PEAK * math.sqrt(-b / (3.0 * c)))
    sine = 0.0
    if abs(b) > SMALLEST_STEERING:
        part = turn / ratio * caution(state)
        for _ in range(4):
            sine += (part - (b + c * sine * sine) * sine) / (b + 3.0 * c * sine * sine)
            sine = min(limit, max(-limit, sine))
    return sine, limit
