# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""Steering by a tail fin: the angle whose turn is the one that is wanted.

In a steady turn r = c sin(delta) V^2, with c from the vehicle's file. Wanted is

    turn = psi_s' + k_psi e + k_d (psi_s' - psi') + d,   d' = k_i e

with the heading error e, as of a law that banks to turn. It turns to the same side in dive and
climb, so that there is one d.
"""

import math
from typing import NamedTuple

from pydantic import Field

from glider_control.surface import SurfaceLawSettings, steer
from glider_model.base.frames import wrap_angle
from glider_model.base.kernel import kernel
from glider_model.onboard.learnt_steering import LEARN_SPEED
from glider_model.vehicle.file import Vehicle

_TUNABLE = {'tunable': True}

#: Below this vertical rate the vehicle turns over, or floats: the speed is not known (m/s).
GLIDING_VERTICAL_RATE = 0.05
#: d is held within this (rad/s).
INTEGRAL_MAX = 0.005


class FinLawSettings(SurfaceLawSettings):
    """Gains of steering by a tail fin."""

    heading_kp_per_s: float = Field(
        0.05, ge=0.0, le=1.0, description='k_psi, heading (1/s)', json_schema_extra=_TUNABLE
    )
    heading_ki_per_s2: float = Field(
        2e-4, ge=0.0, le=0.1, description='heading integral (1/s^2)', json_schema_extra=_TUNABLE
    )
    heading_kd: float = Field(
        0.5, ge=0.0, le=5.0, description='yaw-rate damping (-)', json_schema_extra=_TUNABLE
    )

    def params(self, vehicle: Vehicle) -> 'FinLawParams':
        """Kernel parameters for a vehicle whose fin is known."""
        return FinLawParams(
            self.heading_kp_per_s,
            self.heading_ki_per_s2,
            self.heading_kd,
            vehicle.fin.turn_rate.value,
            math.radians(vehicle.fin.range.value),
        )

    def initial_state(self) -> 'FinLawState':
        """Integral at zero."""
        return FinLawState(0.0)


class FinLawParams(NamedTuple):
    """Gains, and how the vehicle turns."""

    heading_kp: float
    heading_ki: float
    heading_kd: float
    turn_rate: float  #: over sin(delta) V^2 (rad s/m^2)
    limit: float  #: largest angle (rad)


class FinLawState(NamedTuple):
    """Integral."""

    heading_integral: float  #: d (rad/s)


@steer.body(FinLawParams)
@kernel
def steer_by_fin(state, seen, params, dt):
    """Angle (rad) of the fin: see `steer`."""
    measured, reference = seen.measured, seen.reference
    integral = state.heading_integral
    if abs(measured.vertical_rate) < GLIDING_VERTICAL_RATE:
        return FinLawState(integral), 0.0
    error = wrap_angle(reference.psi - measured.psi)
    turn = (
        reference.psi_dot
        + params.heading_kp * error
        + params.heading_kd * (reference.psi_dot - measured.psi_dot)
        + integral
    )
    speed = max(seen.speed, LEARN_SPEED)
    sine = turn / (params.turn_rate * speed * speed)
    delta = math.asin(min(1.0, max(-1.0, sine)))
    if abs(delta) < params.limit or delta * error < 0.0:
        moved = integral + dt * params.heading_ki * error
        integral = min(INTEGRAL_MAX, max(-INTEGRAL_MAX, moved))
    return FinLawState(integral), min(params.limit, max(-params.limit, delta))
