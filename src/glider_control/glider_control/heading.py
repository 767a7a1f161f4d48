# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""The heading of a vehicle that banks to turn, by the steering that its file tells of."""

import math
from typing import NamedTuple

from glider_base.frames import wrap_angle
from glider_base.kernel import kernel
from glider_base.settings import number
from glider_control.law import LawSettings
from glider_model.onboard.learnt_steering import speed_ratio
from glider_model.vehicle.file import Vehicle

#: The integrator is held within this (rad/s).
HEADING_INTEGRAL_MAX = 0.005


class HeadingLawSettings(LawSettings):
    """Gains of a law whose heading goes by the steering of the vehicle file."""

    heading_kp_per_s: float = number(0.035, (0.0, 1.0), 'k_psi, heading (1/s)', tunable=True)
    heading_ki_per_s2: float = number(2e-4, (0.0, 0.1), 'heading integral (1/s^2)', tunable=True)
    heading_kd: float = number(0.3, (0.0, 5.0), 'yaw-rate damping (-)', tunable=True)

    def heading_params(self, vehicle: Vehicle) -> 'HeadingParams':
        """Kernel parameters for a vehicle whose steering is known."""
        return HeadingParams(
            kp=self.heading_kp_per_s,
            ki=self.heading_ki_per_s2,
            kd=self.heading_kd,
            steering_dive=vehicle.steering_rates.dive,
            steering_climb=vehicle.steering_rates.climb,
            slowest_glide=vehicle.params().slowest_glide,
        )


class HeadingParams(NamedTuple):
    """Gains, and how the vehicle steers."""

    kp: float
    ki: float
    kd: float
    steering_dive: float  #: turn rate over sin(roll) at STEERING_SPEED (rad/s), signed
    steering_climb: float
    slowest_glide: float  #: vertical rate below which it turns over and cannot be steered (m/s)


@kernel
def heading_to_roll(integral, measured, reference, speed, roll_limit, params, dt):
    """Roll that steers to the reference heading.

    phi_s = asin sat((psi_s' + k_psi e + k_d (psi_s' - psi') + d) / (b V / V_0)), d' = k_i e

    Parameters
    ----------
    integral : float
        d (rad/s).
    measured : Measured
    reference : Reference
    speed : float
        Through the water (m/s).
    roll_limit : float
        Largest commanded roll (rad).
    params : HeadingParams
    dt : float
        Length of the tick (s).

    Returns
    -------
    roll : float
        (rad)
    integral : float
        As it is afterwards: it waits while the roll is at its limit (rad/s).
    """
    if abs(measured.vertical_rate) < params.slowest_glide:
        return 0.0, integral
    steering = params.steering_dive if measured.vertical_rate > 0.0 else params.steering_climb
    gain = steering * speed_ratio(speed)
    error = wrap_angle(reference.psi - measured.psi)
    turn = (
        reference.psi_dot
        + params.kp * error
        + params.kd * (reference.psi_dot - measured.psi_dot)
        + integral
    )
    demand = turn / gain
    limit = math.sin(roll_limit)
    if abs(demand) < limit or demand * gain * error < 0.0:
        moved = integral + dt * params.ki * error
        integral = min(HEADING_INTEGRAL_MAX, max(-HEADING_INTEGRAL_MAX, moved))
    return math.asin(min(limit, max(-limit, demand))), integral
