# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""The glide polar: what a vehicle's drag and lift say about a steady glide.

Guidance and control use it as the flight model of glider practice: with the pitch and the vertical
rate, both measured, it gives the speed through the water.
"""

import math
from typing import NamedTuple

from glider_base.kernel import kernel, replace
from glider_model.vehicle.file import VehicleParams
from glider_model.vehicle.hydrodynamics import power_of_speed
from glider_model.vehicle.rigid_body import GRAVITY


class Polar(NamedTuple):
    """Drag K_D0 V^n + K_D alpha^2 and lift K_L0 + K_L alpha, per V^2."""

    K_D0: float
    K_D: float
    K_L0: float
    K_L: float
    n: float  #: 0: drag per V^2 does not change with speed
    shallowest: float  #: the polar is used at no shallower pitch than this (rad)
    to_the_end: bool  #: whether the angle of attack of a shallow glide is sought to the end


class Attack(NamedTuple):
    """The angle of attack (rad) of every steady glide at a pitch, once it is found."""

    theta: float  #: the pitch (rad)
    alpha: float


#: Not found yet. A default that is not equal to itself (NaN) each process would compile anew.
NO_ATTACK = Attack(math.inf, 0.0)
#: Below this vertical rate (m/s) a vehicle turns over, or floats: its speed is not known.
MODEL_VERTICAL_RATE = 0.05
#: Slower than this drag is taken as at this (m/s).
_SLOWEST = 0.05
#: Where the search for a speed begins (m/s).
_TYPICAL = 0.3
#: Drag and lift polynomials do not hold beyond this angle of attack (rad), in steering and
#: where it is sought to the end.
LARGEST_ALPHA, LARGEST_SOUGHT = math.radians(15.0), math.radians(40.0)
#: Passes in which the angle of attack of most glides is found, and where drag changes with the
#: speed, the speed with it; of a shallow one it takes more, until it changes by less than this
#: (rad).
_FEW, _FEW_WITH_SPEED, _MANY, _FOUND = 4, 6, 60, 1e-3
#: From twice so many passes on each goes less of the way: at the shallowest glide they alternate.
_STEADIED = 6.0


def make_polar(vehicle: VehicleParams, to_the_end: bool = False) -> Polar:
    """Polar of a vehicle; linear drag, where a vehicle has it, is taken at 0.5 m/s.

    To steer by, few passes do; what reckons with speeds of shallow glides seeks ``to_the_end``.
    """
    return Polar(
        K_D0=max(1e-3, vehicle.K_D0 + vehicle.D_u / 0.5),
        K_D=max(1e-3, vehicle.K_D),
        K_L0=vehicle.K_L0,
        K_L=max(1e-3, vehicle.K_L),
        n=vehicle.speed_exponent,
        shallowest=vehicle.shallowest_glide,
        to_the_end=to_the_end,
    )


@kernel
def _at_speed(speed, polar):
    """Polar whose drag does not change with speed, as at a speed (m/s)."""
    if polar.n == 0.0:
        return polar
    drag = polar.K_D0 * power_of_speed(max(speed, _SLOWEST), polar.n)
    return replace(polar, K_D0=drag, n=0.0)


@kernel
def _better_alpha(alpha, theta, polar):
    """The angle of attack (rad) after a pass more; drag as at 1 m/s."""
    drag, offset = polar.K_D0 / polar.K_D, polar.K_L0 / polar.K_D
    slope = math.tan(theta - alpha)
    half = 0.5 * polar.K_L / polar.K_D * slope
    root = half * half - (drag + offset * slope)
    better = -half
    if root > 0.0:
        better += math.sqrt(root) if half > 0.0 else -math.sqrt(root)
    most = LARGEST_SOUGHT if polar.to_the_end else LARGEST_ALPHA
    return min(most, max(-most, better))


@kernel
def _speed_at(steep, alpha, given, is_rate, polar):
    """Speed (m/s) of a glide whose angle of attack is known; see `_glide_at`."""
    if is_rate:
        return given / math.sin(steep - alpha)
    return math.sqrt(abs(given) / glide_force(alpha, polar))


@kernel
def _glide_at(steep, given, is_rate, polar, found):
    """Speed (m/s) and angle of attack (rad) of the steady glide at a pitch (rad).

    ``given`` is its vertical rate (m/s), or else its weight in water (N). A speed by a rate has a
    sign if pitch and rate disagree. Where drag changes with the speed each pass betters both.
    Shallower than the polar allows, the angle of the best glide is given, 15 deg at most, or 40.
    """
    if steep == found.theta:
        return _speed_at(steep, found.alpha, given, is_rate, polar), found.alpha
    alpha, last, there = 0.0, 0.0, _at_speed(_TYPICAL, polar)
    few = _FEW if polar.n == 0.0 else _FEW_WITH_SPEED
    for number in range(_MANY if polar.to_the_end else few):
        if number >= few:
            if abs(alpha - last) <= _FOUND:
                break
            alpha = last + min(0.5, _STEADIED / number) * (alpha - last)
        last, alpha = alpha, _better_alpha(alpha, steep, there)
        if polar.n != 0.0:
            there = _at_speed(abs(_speed_at(steep, alpha, given, is_rate, there)), polar)
    return _speed_at(steep, alpha, given, is_rate, there), alpha


@kernel
def glide_alpha(theta, polar):
    """Angle of attack (rad) of the steady glide at pitch ``theta`` (rad); drag as at 1 m/s.

    Lift and drag balance a vertical weight: K_D0 + K_D a^2 + (K_L0 + K_L a) tan(theta - a) = 0.
    """
    return _glide_at(theta, 0.0, True, replace(polar, n=0.0), NO_ATTACK)[1]


@kernel
def steepen(theta, polar):
    """``theta`` (rad), but no shallower than the polar is used at, keeping its sign."""
    if theta < 0.0:
        return min(theta, -polar.shallowest)
    return max(theta, polar.shallowest)


@kernel
def glide_attacks(theta, other, polar):
    """`Attack` at two pitches (rad), side by side: neither search waits for the other.

    None where drag changes with the speed, or the angle is sought to the end.
    """
    if polar.n != 0.0 or polar.to_the_end:
        return NO_ATTACK, NO_ATTACK
    one, two, alpha, beta = steepen(theta, polar), steepen(other, polar), 0.0, 0.0
    for _ in range(_FEW):
        alpha, beta = _better_alpha(alpha, one, polar), _better_alpha(beta, two, polar)
    return Attack(one, alpha), Attack(two, beta)


@kernel
def glide_force(alpha, polar):
    """Resultant of lift and drag per V^2 (kg/m); drag as at 1 m/s."""
    drag = polar.K_D0 + polar.K_D * alpha * alpha
    lift = polar.K_L0 + polar.K_L * alpha
    return math.sqrt(drag * drag + lift * lift)


@kernel
def glide_vertical_rate(theta, net_heaviness, polar, found=NO_ATTACK):
    """Vertical rate (m/s, + down) of the steady glide at a pitch with so much weight (kg)."""
    steep = steepen(theta, polar)
    speed, alpha = _glide_at(steep, net_heaviness * GRAVITY, False, polar, found)
    return -speed * math.sin(steep - alpha)


@kernel
def glide_net_heaviness(theta, vertical_rate, polar, found=NO_ATTACK):
    """Net heaviness (kg, + sinks) that a steady glide at this pitch and vertical rate takes."""
    steep = abs(steepen(theta, polar))
    if vertical_rate >= 0.0:
        steep = -steep
    speed, alpha = _glide_at(steep, vertical_rate, True, polar, found)
    weight = glide_force(alpha, _at_speed(abs(speed), polar)) * speed * speed / GRAVITY
    return weight if vertical_rate >= 0.0 else -weight


@kernel
def glide_horizontal_speed(theta, vertical_rate, polar, found=NO_ATTACK):
    """Horizontal speed through the water (m/s) from pitch (rad) and vertical rate (m/s)."""
    steep = steepen(theta, polar)
    _, alpha = _glide_at(steep, vertical_rate, True, polar, found)
    return abs(vertical_rate / math.tan(steep - alpha))


@kernel
def steady_horizontal_speed(theta, net_heaviness, polar):
    """Horizontal speed U_h (m/s) of the steady glide at a pitch (rad) with so much weight (kg)."""
    return glide_horizontal_speed(theta, glide_vertical_rate(theta, net_heaviness, polar), polar)


@kernel
def glide_speed(theta, vertical_rate, polar, found=NO_ATTACK):
    """Speed through the water (m/s) and angle of attack (rad) from pitch and vertical rate."""
    speed, alpha = _glide_at(steepen(theta, polar), vertical_rate, True, polar, found)
    return abs(speed), alpha
