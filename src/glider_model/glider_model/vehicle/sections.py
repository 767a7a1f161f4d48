# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""Sections of a vehicle file: every field with its unit, its range and what it means."""

import math

import pydantic
from pydantic import Field

from glider_base.settings import Settings
from glider_base.signals import SEA_WATER_DENSITY
from glider_model.vehicle.quantity import (
    CC,
    CC_PER_S,
    NotNegative,
    NotPositive,
    Positive,
    Signed,
    optional,
    required,
    vector,
)

#: Coefficients of lift and drag, with their units: what a set stands for.
LIFT_AND_DRAG = {
    'K_D0': 'kg/m',
    'K_D': 'kg/m/rad^2',
    'K_L0': 'kg/m',
    'K_L': 'kg/m/rad',
    'speed_exponent': '-',
}


class MerckelbachSettings(Settings):
    """Drag rho/2 U^2 S (Cd0 + Cd1 alpha^2) and lift rho/2 U^2 S (aw + ah) alpha of a Slocum.

    Merckelbach et al. (2010, 2019).
    """

    Cd0: required('-', 'drag at no angle of attack', gt=0.0, le=10.0)
    Cd1: required('1/rad^2', 'drag over alpha^2, all of it', ge=0.0, le=1000.0)
    S: required('m^2', 'reference area', gt=0.0, le=10.0)
    aw: required('1/rad', 'lift over alpha, of the wings', ge=0.0, le=100.0)
    ah: required('1/rad', 'lift over alpha, of the hull', ge=0.0, le=100.0)

    def coefficients(self) -> dict[str, float]:
        """Coefficients K (kg/m, rad) by their names."""
        pressure = 0.5 * SEA_WATER_DENSITY * self.S.value
        return {
            'K_D0': pressure * self.Cd0.value,
            'K_D': pressure * self.Cd1.value,
            'K_L0': 0.0,
            'K_L': pressure * (self.aw.value + self.ah.value),
            'speed_exponent': 0.0,
        }


class EriksenSettings(Settings):
    """Drag q l^2 (b q^(-1/4) + c alpha^2) and lift q l^2 a alpha of a Seaglider, q = rho/2 V^2.

    Eriksen et al. (2001): alpha in degrees, as in ``hd_a``, ``hd_b`` and ``hd_c`` of its files.
    """

    a: required('1/deg', 'lift over alpha, hd_a', gt=0.0, le=1.0)
    b: required('Pa^(1/4)', 'drag at no angle of attack, hd_b', gt=0.0, le=1.0)
    c: required('1/deg^2', 'drag over alpha^2, hd_c', ge=0.0, le=0.1)
    l: required('m', 'length of the glider', gt=0.0, le=20.0)  # noqa: E741

    def coefficients(self) -> dict[str, float]:
        """Coefficients K (kg/m, rad) by their names."""
        half, square = 0.5 * SEA_WATER_DENSITY, self.l.value**2
        return {
            'K_D0': half**0.75 * square * self.b.value,
            'K_D': half * square * self.c.value * math.degrees(1.0) ** 2,
            'K_L0': 0.0,
            'K_L': half * square * self.a.value * math.degrees(1.0),
            'speed_exponent': -0.5,
        }


SETS = {'merckelbach': MerckelbachSettings, 'eriksen': EriksenSettings}


def with_coefficients(values):
    """Fields of a hydrodynamics section, with those that follow from a set; or ValueError."""
    given = [name for name in SETS if isinstance(values, dict) and values.get(name) is not None]
    if not given:
        return values
    if len(given) > 1:
        raise ValueError(f'{" and ".join(given)}: both say what lift and drag are (allowed: one)')
    (name,) = given
    twice = [field for field in LIFT_AND_DRAG if values.get(field) is not None]
    if twice:
        raise ValueError(f'{twice[0]}: follows from {name} (allowed: one of the two)')
    try:
        found = SETS[name].model_validate(values[name]).coefficients()
    except ValueError:  # what is wrong with the set is named by its own fields
        found = dict.fromkeys(LIFT_AND_DRAG, 1.0)
    return values | {
        field: {'value': found[field], 'unit': unit, 'source': f'follows from {name}'}
        for field, unit in LIFT_AND_DRAG.items()
    }


class RigidBodySettings(Settings):
    """Hull without the moving mass. Origin at the centre of buoyancy, axes FRD."""

    hull_mass: required('kg', 'mass in air, without the moving mass', **Positive)
    hull_center_of_mass: vector('m', 'centre of mass of the hull; z > 0 keeps it upright')
    hull_inertia: vector('kg m^2', 'inertia of the hull about the origin', not_negative=True)


class AddedMassSettings(Settings):
    """Positive added mass M_A (Fossen's -X_udot, ...), symmetric, with its two cross terms."""

    linear: vector('kg', 'water that moves along in surge, sway, heave', not_negative=True)
    angular: vector('kg m^2', 'the same in roll, pitch, yaw', not_negative=True)
    sway_yaw: required('kg m', 'of sway by yaw; 0 if alike fore and aft', **Signed)
    heave_pitch: required('kg m', 'of heave by pitch; 0 if alike fore and aft', **Signed)


class HydrodynamicsSettings(Settings):
    """Coefficients of the viscous forces and moments (Graver 2005; Zhang et al. 2013)."""

    model_config = pydantic.ConfigDict(
        json_schema_extra={
            'others': 'Cd0, Cd1, S, aw and ah go under merckelbach, a, b, c and l under eriksen'
        }
    )

    merckelbach: MerckelbachSettings | None = Field(
        None,
        description='lift and drag as Merckelbach et al. write them, instead of K_D0, K_D, K_L0 '
        'and K_L',
    )
    eriksen: EriksenSettings | None = Field(
        None, description='the same as Eriksen et al. write them'
    )
    K_D0: required('kg/m', 'drag over V^2 at no angle of attack', **NotNegative)
    K_D: required('kg/m/rad^2', 'drag over V^2 alpha^2', **NotNegative)
    K_L0: required('kg/m', 'lift over V^2 at no angle of attack', **Signed)
    K_L: required('kg/m/rad', 'lift over V^2 alpha', **Signed)
    K_beta: required('kg/m/rad', 'side force over V^2 beta', **NotPositive)
    K_MR: required('kg/rad', 'roll moment over V^2 beta; < 0 with dihedral', **Signed)
    K_p: required('kg s/rad', 'roll moment over V^2 p; < 0 damps', **Signed)
    K_M0: required('kg', 'pitch moment over V^2 at no angle of attack', **Signed)
    K_M: required(
        'kg/rad',
        'pitch moment over V^2 alpha, without a_33 - a_11 of the added mass; the sum is < 0',
        **Signed,
    )
    K_q: required('kg s/rad', 'pitch moment over V^2 q; < 0 damps', **NotPositive)
    K_MY: required(
        'kg/rad',
        'yaw moment over V^2 beta, without a_22 - a_11 of the added mass; less that it is the '
        'weathercock, > 0',
        **Signed,
    )
    K_r: required('kg s/rad', 'yaw moment over V^2 r; < 0 damps', **NotPositive)
    speed_exponent: optional(
        '-',
        'K_D0 is that at 1 m/s and goes with this power of the speed; 0 without',
        ge=-1.0,
        le=1.0,
    )
    linear_damping: vector('kg/s', 'force over u, v, w; > 0 damps; mostly none', True)
    linear_angular_damping: vector('kg m^2/s', 'moment over p, q, r; > 0 damps', True)
    quadratic_damping: vector('kg/m', 'force over the square of u, v, w; > 0 damps')
    quadratic_angular_damping: vector('kg m^2', 'moment over the square of p, q, r; > 0 damps')

    _as_others_write_it = pydantic.model_validator(mode='before')(with_coefficients)

    @pydantic.model_validator(mode='after')
    def _has_drag(self):
        if not (self.K_D0.value or self.linear_damping.value[0]):
            raise ValueError(
                'K_D0 = 0: nothing brakes it (allowed: > 0 kg/m, or linear_damping along x)'
            )
        return self


class MovingMassSettings(Settings):
    """Mass that slides along x for pitch and turns about x for roll."""

    mass: required('kg', 'mass that moves, most often the battery', **Positive)
    neutral_x: required('m', 'where it trims level, + forward', ge=-10.0, le=10.0)
    radius: required('m', 'of its centre from the axis it turns about', gt=0.0, le=1.0)
    inertia: vector('kg m^2', 'about its own centre, turning with it', not_negative=True)
    travel: required('m', 'as far as it goes from neutral to each side', gt=0.0, le=2.0)
    rate: required('m/s', 'how fast it slides', gt=0.0, le=1.0)
    rotation: required('deg', 'as far as it turns to each side; 0: it does not', ge=0.0, le=180.0)
    rotation_rate: required('deg/s', 'how fast it turns', gt=0.0, le=180.0)
    dead_band: optional(
        'm', 'nearer than this to where it is sent it stops sliding', ge=0.0, le=0.1
    )
    noise: optional('m', 'standard deviation of where it says that it is', ge=0.0, le=0.1)
    rotation_dead_band: optional('deg', 'nearer than this it stops turning', ge=0.0, le=20.0)
    rotation_noise: optional(
        'deg', 'standard deviation of the angle that it says', ge=0.0, le=20.0
    )


class BuoyancyEngineSettings(Settings):
    """Oil pump: net heaviness within +-range; in cc, of sea water of 1025 kg/m^3."""

    range: required(
        'kg', 'most that it makes light or heavy; half a stroke', also=CC, gt=0.0, le=50.0
    )
    rate: required('kg/s', 'how fast', also=CC_PER_S, gt=0.0, le=10.0)
    rate_per_m: optional(
        '1/m',
        'share of the rate that a metre of depth takes off while it pumps out, against the water',
        ge=0.0,
        le=0.01,
    )
    dead_band: optional('kg', 'nearer than this to its goal it stops', also=CC, ge=0.0, le=1.0)
    noise: optional('kg', 'standard deviation of where it says it is', also=CC, ge=0.0, le=1.0)


class HullSettings(Settings):
    """Outer shape, used where the hull breaks the surface."""

    length: required('m', 'of the hull; for who reads it, no equation has it', gt=0.1, le=20.0)
    diameter: required('m', 'of the hull, by which it floats', gt=0.01, le=5.0)


class SteeringSettings(Settings):
    """Turn rate (starboard +) over sine of roll in a gentle spiral, as ``glider trim`` solves it.

    Its sign belongs to vehicle and phase: lift points the other way in the climb. A file without
    it has that of `glider_model.vehicle.steering`.
    """

    dive: required('rad/s', 'in the dive, at 0.5 m/s', ge=-1.0, le=1.0)
    climb: required('rad/s', 'in the climb', ge=-1.0, le=1.0)
