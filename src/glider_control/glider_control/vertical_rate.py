# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""The vertical-rate law: from the rate that is asked for to the buoyancy engine."""

import math
from typing import NamedTuple

from glider_base.kernel import kernel
from glider_model.onboard.glide_polar import NO_ATTACK, glide_net_heaviness

#: The integrals of the vertical-rate law wait until the pump is this near to where it goes (kg).
PUMP_ARRIVED_KG = 0.05
#: A hull is taken to have this share at least of the drag in its file. What is learnt beyond is
#: ballast, which must not change its sign when the vehicle turns over.
LEAST_DRAG = 0.5


#: A vertical rate that the depth does not follow, on an average over this time (s), by more than
#: this (m/s), is way over ground that an attitude shows as way up or down.
ERROR_S, ERROR_MPS = 600.0, 0.01
#: A depth that changes by more from tick to tick was set anew (m).
ANEW_M = 5.0


@kernel
def rate_error(error, rate, fallen, dt):
    """Error (m/s) of a vertical rate (m/s, + down), averaged, and the part that is taken off.

    ``fallen`` is by how much the depth has changed in this tick (m).
    """
    if abs(fallen) < ANEW_M:
        error += (dt * (rate - error) - fallen) / ERROR_S
    return error, math.copysign(max(0.0, abs(error) - ERROR_MPS), error)


class Trim(NamedTuple):
    """Integrals of the vertical-rate law."""

    ballast: float  #: the same in dive and climb: ballast, density (kg)
    drag: float  #: + in a dive, - in a climb (kg)


@kernel
def vertical_rate_law(trim, measured, reference, joints, is_afloat, params, dt, attack=NO_ATTACK):
    """Net heaviness (kg) for the reference's vertical rate, and the new integrals.

    The glide polar gives the weight of the steady glide. One integral corrects what ballast and
    density differ by, another, with the sign of the rate, what the drag does: a draggy vehicle
    has to be heavier in the dive and lighter in the climb, and has to know it as soon as it turns
    over. Both wait until the pump is where it is meant to be, and no longer: a vehicle that then
    sinks, or climbs too slowly, needs them most. At the surface there is no rate to learn from,
    until it is asked to dive.
    """
    sign = 1.0 if reference.v_d > 0.0 else -1.0
    ballast, drag = trim.ballast, trim.drag
    glide = glide_net_heaviness(reference.theta, reference.v_d, params.polar, attack)
    least = (LEAST_DRAG - 1.0) * abs(glide)
    wanted = glide + sign * max(least, drag)
    error = reference.v_d - measured.vertical_rate
    limit = params.allocation.m_b_max
    is_up = is_afloat and reference.v_d < 0.0
    if abs(joints.m_b - wanted - ballast) < PUMP_ARRIVED_KG and not is_up:
        most = params.buoyancy_trim_max
        ballast = min(most, max(-most, ballast + dt * params.buoyancy_ki * error))
        learnt = drag + dt * params.drag_ki * error * sign
        drag = min(most, max(min(drag, least), learnt))
    return min(limit, max(-limit, wanted + ballast)), Trim(ballast, drag)
