# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""The glide polar: what a vehicle's drag and lift say about a steady glide.

Guidance and control use it as the flight model of glider practice: with the pitch and the vertical
rate, both measured, it gives the speed through the water.
"""

import math
from typing import NamedTuple

from glider_model.base.kernel import kernel
from glider_model.vehicle.file import VehicleParams
from glider_model.vehicle.rigid_body import GRAVITY


class Polar(NamedTuple):
    """Drag K_D0 + K_D alpha^2 and lift K_L0 + K_L alpha, per V^2."""

    K_D0: float
    K_D: float
    K_L0: float
    K_L: float


#: The polar is used at no shallower pitch than this (rad): 12 deg, about the best glide.
SHALLOWEST_PITCH = math.radians(12.0)
#: Drag and lift polynomials are not believed beyond this angle of attack (rad).
LARGEST_ALPHA = math.radians(15.0)


def make_polar(vehicle: VehicleParams) -> Polar:
    """Polar of a vehicle; linear drag, where a vehicle has it, is taken at 0.5 m/s."""
    return Polar(
        max(1e-3, vehicle.K_D0 + vehicle.D_u / 0.5),
        max(1e-3, vehicle.K_D),
        vehicle.K_L0,
        max(1e-3, vehicle.K_L),
    )


@kernel
def glide_alpha(theta, polar):
    """Angle of attack (rad) of the steady glide at pitch ``theta`` (rad).

    Lift and drag balance a vertical weight: K_D0 + K_D a^2 + (K_L0 + K_L a) tan(theta - a) = 0.
    Shallower than the polar allows, the angle of the best glide is given, 15 deg at most.
    """
    drag, offset = polar.K_D0 / polar.K_D, polar.K_L0 / polar.K_D
    lift = 0.5 * polar.K_L / polar.K_D
    alpha = 0.0
    for _ in range(4):
        slope = math.tan(theta - alpha)
        half = lift * slope
        root = half * half - (drag + offset * slope)
        alpha = -half
        if root > 0.0:
            alpha += math.sqrt(root) if half > 0.0 else -math.sqrt(root)
        alpha = min(LARGEST_ALPHA, max(-LARGEST_ALPHA, alpha))
    return alpha


@kernel
def steepen(theta):
    """``theta`` (rad), but no shallower than the polar is used at, keeping its sign."""
    if theta < 0.0:
        return min(theta, -SHALLOWEST_PITCH)
    return max(theta, SHALLOWEST_PITCH)


@kernel
def glide_force(alpha, polar):
    """Resultant of lift and drag per V^2 (kg/m)."""
    drag = polar.K_D0 + polar.K_D * alpha * alpha
    lift = polar.K_L0 + polar.K_L * alpha
    return math.sqrt(drag * drag + lift * lift)


@kernel
def glide_vertical_rate(theta, net_heaviness, polar):
    """Vertical rate (m/s, + down) of the steady glide at a pitch with so much weight (kg)."""
    steep = steepen(theta)
    alpha = glide_alpha(steep, polar)
    speed = math.sqrt(abs(net_heaviness) * GRAVITY / glide_force(alpha, polar))
    return -speed * math.sin(steep - alpha)


@kernel
def glide_net_heaviness(theta, vertical_rate, polar):
    """Net heaviness (kg, + sinks) that a steady glide at this pitch and vertical rate takes."""
    steep = -abs(steepen(theta)) if vertical_rate >= 0.0 else abs(steepen(theta))
    alpha = glide_alpha(steep, polar)
    speed = vertical_rate / math.sin(steep - alpha)
    weight = glide_force(alpha, polar) * speed * speed / GRAVITY
    return weight if vertical_rate >= 0.0 else -weight


@kernel
def glide_horizontal_speed(theta, vertical_rate, polar):
    """Horizontal speed through the water (m/s) from pitch (rad) and vertical rate (m/s)."""
    steep = steepen(theta)
    return abs(vertical_rate / math.tan(steep - glide_alpha(steep, polar)))


@kernel
def steady_horizontal_speed(theta, net_heaviness, polar):
    """Horizontal speed U_h (m/s) of the steady glide at a pitch (rad) with so much weight (kg)."""
    return glide_horizontal_speed(theta, glide_vertical_rate(theta, net_heaviness, polar), polar)


@kernel
def glide_speed(theta, vertical_rate, polar):
    """Speed through the water (m/s) and angle of attack (rad) from pitch and vertical rate."""
    steep = steepen(theta)
    alpha = glide_alpha(steep, polar)
    return abs(vertical_rate / math.sin(steep - alpha)), alpha
