# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""How roll turns a vehicle: turn rate over sine of roll in a gentle spiral, in closed form.

About a straight glide side force, roll and yaw moment are linear in roll phi, sideways velocity v,
turn rate psi' and the first moment s_y of the roll mass: three equations for three unknowns over
phi. The same forces as in `hydrodynamics`, `coriolis` and of gravity; `./glider trim` solves the
whole equations for any spiral.
"""

import math
from typing import NamedTuple

import numpy as np

from glider_model.vehicle.hydrodynamics import parasitic_drag
from glider_model.vehicle.rigid_body import GRAVITY
from glider_model.vehicle.surface import surface_loads

#: Pitch (rad) of the glide, and its weight over the range of the pump.
PITCH, SHARE = math.radians(25.0), 0.5
#: Speed (m/s) that a turn rate is told for; it is taken to go with the speed.
TOLD_SPEED = 0.5
#: The angle of attack is looked for up to this (rad).
_LARGEST_ALPHA = math.radians(20.0)


class SteeringRates(NamedTuple):
    """Turn rate (rad/s, starboard +) over sine of roll at 0.5 m/s; signed."""

    dive: float
    climb: float


def steering_rates(vehicle) -> SteeringRates:
    """Steering of a vehicle (`VehicleParams`) by its roll, with a fin that stays straight."""
    return SteeringRates(_rate(vehicle, 1.0), _rate(vehicle, -1.0))


def _glide_alpha(theta: float, drag: float, vehicle) -> float:
    """Angle of attack (rad) of a steady glide, the smaller of two; 0 if there is none.

    K_D0 + K_D a^2 + (K_L0 + K_L a) tan(theta - a) = 0
    """
    alphas = np.linspace(0.0, math.copysign(_LARGEST_ALPHA, -theta), 4001)
    lift = vehicle.K_L0 + vehicle.K_L * alphas
    left = drag + vehicle.K_D * alphas**2 + lift * np.tan(theta - alphas)
    balanced = np.flatnonzero(left <= 0.0)
    return float(alphas[balanced[0]]) if len(balanced) else 0.0


def _of_surface(u: float, w: float, p: float, r: float, vehicle) -> np.ndarray:
    """Side force, roll and yaw moment of a straight surface over v, turn rate and s_y, (3, 3)."""
    small = 1e-6
    none = (0.0,) * 6
    sway = surface_loads(none, u, small, w, 0.0, 0.0, 0.0, 0.0, vehicle.surface)
    turn = surface_loads(none, u, 0.0, w, small * p, 0.0, small * r, 0.0, vehicle.surface)
    return np.array([[sway[i], turn[i], 0.0] for i in (1, 3, 5)]) / small


def _rate(x, phase: float) -> float:
    """Turn rate over roll in a dive (1) or climb (-1) of a vehicle ``x``."""
    theta, speed, weight = -phase * PITCH, TOLD_SPEED, phase * SHARE * x.m_b_max * GRAVITY
    for _ in range(8):
        parasitic = parasitic_drag(speed, x) + x.D_u / speed
        alpha = _glide_alpha(theta, parasitic, x)
        drag, lift = parasitic + x.K_D * alpha**2, x.K_L0 + x.K_L * alpha
        speed = math.sqrt(abs(weight) / math.hypot(drag, lift))
    s_a, c_a = math.sin(alpha), math.cos(alpha)
    u, w, speed2 = speed * c_a, speed * s_a, speed * speed
    s_t, c_t = math.sin(theta), math.cos(theta)
    # the first moment that holds the pitch, the oil's share of it included
    static = x.K_M0 + x.K_M * s_a * c_a
    moment = static * speed2 + (x.a_33 - x.a_11) * u * w
    s_z = x.s_z + x.m_p * x.R_p
    held = (moment / GRAVITY - s_z * s_t) / c_t
    s_x = held - weight / GRAVITY * x.pump_x
    # rates over psi', and what they drive along
    p, r = -s_t, c_t
    s_d = s_a * c_a**4
    c_d = math.sqrt(1.0 - s_d * s_d)
    along, about = x.K_p * (c_d * p + s_d * r), x.K_r * (c_d * r - s_d * p)
    sideways = r * u - p * w
    side_v = (x.K_beta - drag) * speed - x.D_v
    side_turn = -(x.m + x.a_11) * u * r + (x.m + x.a_33) * w * p
    roll_v = (x.K_MR * c_a - x.K_MY * s_a - static * c_a) * speed - (x.a_33 - x.a_22) * w
    roll_turn = (c_d * along - s_d * about) * speed2 - x.D_p * p
    roll_turn += s_z * sideways + (x.a_35 + x.a_26) * w * r
    yaw_v = (x.K_MR * s_a + x.K_MY * c_a - static * s_a) * speed - (x.a_22 - x.a_11) * u
    yaw_turn = (s_d * along + c_d * about) * speed2 - x.D_r * r
    yaw_turn -= s_x * sideways + x.a_35 * w * p + x.a_26 * u * r
    matrix = _of_surface(u, w, p, r, x) + [
        [side_v, side_turn, 0.0],
        [roll_v, roll_turn, GRAVITY * c_t],
        [yaw_v, yaw_turn, GRAVITY * s_t],
    ]
    if abs(np.linalg.det(matrix)) < 1e-12:
        return 0.0
    by_roll = [-weight * c_t, GRAVITY * s_z * c_t, -GRAVITY * held * c_t]
    rate = np.linalg.solve(matrix, by_roll)[1]
    return float(rate) * TOLD_SPEED / speed
