# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""Steady glides and spirals: the equilibrium of the plant, solved for its own equations.

The net heaviness is that of the whole vehicle, by its buoyancy engine, in water of one density.
"""

import math
from dataclasses import dataclass
from numbers import Real
from typing import NamedTuple

import numpy as np

from glider_base.frames import body_rates, quaternion_from_euler, rotate_to_ned
from glider_base.settings import ConfigurationError
from glider_base.signals import Joints, Water
from glider_model.ocean.density import DensityParams
from glider_model.plant.motion import Motion, acceleration
from glider_model.vehicle.file import VehicleParams
from glider_model.vehicle.rigid_body import make_inertia

_STILL = Water(0.0, 0.0, 0.0)
_UNIFORM = DensityParams(0.0, 1.0, 0.0, 0.0)


@dataclass(frozen=True)
class Trim:
    """A steady glide (turn rate 0) or spiral. Field names carry the unit."""

    speed_mps: float
    alpha_deg: float
    beta_deg: float
    pitch_deg: float
    roll_deg: float
    glide_deg: float  # angle of the path below the horizontal is negative
    horizontal_mps: float
    vertical_mps: float  # positive sinking
    turn_rate_radps: float
    turn_radius_m: float | None  # None: straight
    pitch_mass_m: float
    net_heaviness_kg: float
    roll_mass_deg: float
    fin_deg: float
    converged: bool


class _Glide(NamedTuple):
    """What a glide is asked for; one of pitch and pitch mass is None, and solved for."""

    vehicle: VehicleParams
    net_heaviness: float  #: (kg)
    theta: float | None  #: pitch (rad)
    x_p: float | None  #: pitch mass from neutral (m)
    mu: float  #: roll mass (rad)
    delta: float  #: steering surface (rad)


def solve_trim(
    vehicle: VehicleParams,
    net_heaviness_kg: float,
    pitch_deg: float | None = None,
    pitch_mass_m: float | None = None,
    roll_mass_deg: float = 0.0,
    fin_deg: float = 0.0,
) -> Trim:
    """Solve M nu' = 0 for a steady rotation about the vertical.

    Give either the pitch (the pitch-mass position is solved for) or the pitch-mass position
    from neutral (the pitch is solved for). A ConfigurationError if both or neither are given,
    or an input is outside the actuator's range.
    """
    if (pitch_deg is None) == (pitch_mass_m is None):
        raise ConfigurationError('give either pitch_deg or pitch_mass_m')
    checks = (
        ('net buoyancy', net_heaviness_kg, 'kg', vehicle.m_b_max),
        ('roll mass', roll_mass_deg, 'deg', math.degrees(vehicle.mu_max)),
        ('fin', fin_deg, 'deg', math.degrees(vehicle.delta_max)),
        ('pitch', pitch_deg, 'deg', 80.0)
        if pitch_mass_m is None
        else ('pitch mass', pitch_mass_m, 'm', vehicle.x_p_max),
    )
    for name, number, unit, limit in checks:
        if not isinstance(number, Real) or not abs(number) <= limit * (1.0 + 1e-12):
            raise ConfigurationError(
                f'{name} = {number!s:.80} {unit}: out of range '
                f'(allowed: -{limit:g} to {limit:g} {unit})'
            )
    if net_heaviness_kg == 0.0:
        raise ConfigurationError('net buoyancy = 0 kg: a neutral vehicle does not glide')
    theta = None if pitch_deg is None else math.radians(pitch_deg)
    mu, delta = math.radians(roll_mass_deg), math.radians(fin_deg)
    # its whole net weight is given: the hull that displaces it is of no account
    glide = _Glide(
        vehicle=vehicle._replace(volume=0.0),
        net_heaviness=float(net_heaviness_kg),  # kernels take no float32
        theta=theta,
        x_p=pitch_mass_m,
        mu=mu,
        delta=delta,
    )
    sign = math.copysign(1.0, net_heaviness_kg)
    for guess_deg in (-30.0, -20.0, -45.0, -10.0):
        guess = sign * math.radians(guess_deg if pitch_deg is None else -abs(pitch_deg))
        fourth = guess if pitch_deg is None else 0.0
        z = np.array([0.5, 0.0, sign * 0.01, fourth, 0.0, 0.0])
        z, solved = _follow_branch(z, glide)
        if solved:
            break
    return _trim_of(z, solved, glide)


def _unpack(z: np.ndarray, glide: _Glide):
    """Velocity (m/s), pitch, roll (rad), turn rate (rad/s) and pitch mass (m) of the unknowns."""
    u, v, w, fourth, phi, rate = z
    if glide.theta is None:
        return u, v, w, fourth, phi, rate, glide.x_p
    return u, v, w, glide.theta, phi, rate, 0.1 * fourth


def _residual(z: np.ndarray, share: float, glide: _Glide) -> np.ndarray:
    """Acceleration (6), which a steady glide does not have; a share of the way to its turn."""
    u, v, w, theta, phi, rate, x_p = _unpack(z, glide)
    q = quaternion_from_euler(phi, theta, 0.0)
    motion = Motion(0.0, 0.0, 100.0, *q, u, v, w, *body_rates(phi, theta, 0.0, 0.0, rate))
    mu = share * glide.mu
    inertia = make_inertia(x_p, mu, glide.vehicle)
    joints = Joints(glide.net_heaviness, x_p, mu, share * glide.delta)
    return np.array(acceleration(motion, joints, inertia, _STILL, glide.vehicle, _UNIFORM))


def _follow_branch(z: np.ndarray, glide: _Glide) -> tuple[np.ndarray, bool]:
    """Unknowns of a glide, and whether they are solved.

    From the straight glide in small steps of roll mass and fin, so that the branch is followed.
    """
    from scipy.optimize import root  # slow to load, and most commands trim nothing

    solved = True
    steps = 2 + int(max(abs(glide.mu), abs(glide.delta)) / 0.05)
    for share in np.linspace(0.0, 1.0, steps):
        z = root(_residual, z, args=(share, glide), method='hybr', tol=1e-13).x
        upright = abs(_unpack(z, glide)[3]) < 0.5 * math.pi and abs(z[4]) < 0.5 * math.pi
        small = np.max(np.abs(_residual(z, share, glide))) < 1e-9
        solved = bool(upright and z[0] > 0.0 and small)
        if not solved:
            break
    return z, solved


def _trim_of(z: np.ndarray, solved: bool, glide: _Glide) -> Trim:
    """The solution, in the units of a person."""
    u, v, w, theta, phi, rate, x_p = (float(number) for number in _unpack(z, glide))
    speed = math.sqrt(u * u + v * v + w * w)
    north, east, down = rotate_to_ned(*quaternion_from_euler(phi, theta, 0.0), u, v, w)
    horizontal = math.hypot(north, east)
    v, phi, rate = (0.0 if abs(number) < 1e-9 else number for number in (v, phi, rate))
    return Trim(
        speed_mps=speed,
        alpha_deg=math.degrees(math.atan2(w, u)),
        beta_deg=math.degrees(math.asin(v / speed)) if speed > 0.0 else 0.0,
        pitch_deg=math.degrees(theta),
        roll_deg=math.degrees(phi),
        glide_deg=-math.degrees(math.atan2(down, horizontal)),
        horizontal_mps=horizontal,
        vertical_mps=down,
        turn_rate_radps=rate,
        turn_radius_m=horizontal / abs(rate) if rate else None,
        pitch_mass_m=x_p,
        net_heaviness_kg=glide.net_heaviness,
        roll_mass_deg=math.degrees(glide.mu),
        fin_deg=math.degrees(glide.delta),
        converged=solved and abs(x_p) <= glide.vehicle.x_p_max,
    )
