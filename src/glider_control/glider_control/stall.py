# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""A stall: the vehicle slides tail first, hardly sinks or rises, and does not glide by itself.

Where it begins, and how a vehicle is led out of it, is in docs/theory.md, 3.
"""

import math

from glider_base.kernel import kernel, replace
from glider_control.vertical_rate import Trim
from glider_model.onboard.glide_polar import glide_net_heaviness

#: Less than this share of the vertical rate that is asked for is none, of at least so much (m/s).
NO_RATE, LEAST_RATE = 0.25, 0.02
#: A vehicle that has less than that with so many times the net heaviness of its glide, or with
#: this share of what its pump can do, and its nose down or up by this (rad), stalls;
TOO_MUCH, WHOLE, NOSE = 2.0, 0.95, math.radians(10.0)
#: so it is after this time (s).
STALL_S = 120.0
#: Its nose is sent to this (rad) for so long (s), in a climb until it rises as it is asked to; in
#: a dive the pump is in the middle meanwhile, but for the last (s).
REST_S, BEGINS_S, STEEP = 240.0, 60.0, math.radians(60.0)


@kernel
def watch_stall(stall_s, measured, reference, m_b, params, dt):
    """Time (s) for which a vehicle has stalled; less than 0: for so long it is led out of it."""
    sign = 1.0 if reference.v_d > 0.0 else -1.0
    if stall_s < 0.0:
        rises = sign < 0.0 and measured.vertical_rate < reference.v_d
        return 0.0 if rises else min(0.0, stall_s + dt)
    is_asked = abs(reference.v_d) > LEAST_RATE and -sign * measured.theta > NOSE
    is_none = sign * measured.vertical_rate < NO_RATE * abs(reference.v_d)
    if not (is_asked and is_none):
        return 0.0
    glide = glide_net_heaviness(reference.theta, reference.v_d, params.polar)
    if not sign * m_b > min(TOO_MUCH * abs(glide), WHOLE * params.allocation.m_b_max):
        return 0.0
    return stall_s + dt if stall_s < STALL_S else -REST_S


@kernel
def leave_stall(stall_s, m_b, trim, reference):
    """Net heaviness (kg), its integrals and the reference of a vehicle that is led out."""
    if reference.v_d > 0.0:
        m_b, trim = (m_b if stall_s > -BEGINS_S else 0.0), Trim(0.0, 0.0)
    theta = math.copysign(STEEP, -reference.v_d)
    return m_b, trim, replace(reference, theta=theta, theta_dot=0.0)
