# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""Sections of a vehicle file: every field with its unit, its range and what it means."""

import pydantic

from glider_base.settings import Settings
from glider_model.vehicle.coefficients import (
    EriksenSettings,
    MerckelbachSettings,
    with_coefficients,
)
from glider_model.vehicle.quantity import (
    CC,
    CC_PER_S,
    NotNegative,
    Positive,
    Signed,
    meaning,
    quantity,
    vector,
)


class RigidBodySettings(Settings):
    """Hull without the moving mass. Origin at the centre of buoyancy, axes FRD."""

    hull_mass: meaning(quantity('kg', **Positive), 'mass in air, without the moving mass')
    hull_center_of_mass: vector('m', 'centre of mass of the hull; z > 0 keeps it upright')
    hull_inertia: vector('kg m^2', 'inertia of the hull about the origin', not_negative=True)


class AddedMassSettings(Settings):
    """Positive added mass M_A (Fossen's -X_udot, ...), symmetric, with its two cross terms."""

    linear: vector('kg', 'water that moves along in surge, sway, heave', not_negative=True)
    angular: vector('kg m^2', 'the same in roll, pitch, yaw', not_negative=True)
    sway_yaw: meaning(quantity('kg m', **Signed), 'of sway by yaw; 0 if alike fore and aft')
    heave_pitch: meaning(quantity('kg m', **Signed), 'of heave by pitch; 0 if alike fore and aft')


class HydrodynamicsSettings(Settings):
    """Coefficients of the viscous forces and moments (Graver 2005; Zhang et al. 2013)."""

    model_config = pydantic.ConfigDict(
        json_schema_extra={
            'others': 'Cd0, Cd1, S, aw and ah go under merckelbach, a, b, c and l under eriksen'
        }
    )

    merckelbach: meaning(
        MerckelbachSettings | None,
        'lift and drag as Merckelbach et al. write them, instead of K_D0, K_D, K_L0 and K_L',
    ) = None
    eriksen: meaning(EriksenSettings | None, 'the same as Eriksen et al. write them') = None
    K_D0: meaning(quantity('kg/m', **NotNegative), 'drag over V^2 at no angle of attack')
    K_D: meaning(quantity('kg/m/rad^2', **NotNegative), 'drag over V^2 alpha^2')
    K_L0: meaning(quantity('kg/m', **Signed), 'lift over V^2 at no angle of attack')
    K_L: meaning(quantity('kg/m/rad', **Signed), 'lift over V^2 alpha')
    K_beta: meaning(quantity('kg/m/rad', **Signed), 'side force over V^2 beta; < 0')
    K_MR: meaning(quantity('kg/rad', **Signed), 'roll moment over V^2 beta; < 0 with dihedral')
    K_p: meaning(quantity('kg s/rad', **Signed), 'roll moment over V^2 p; < 0 damps')
    K_M0: meaning(quantity('kg', **Signed), 'pitch moment over V^2 at no angle of attack')
    K_M: meaning(
        quantity('kg/rad', **Signed),
        'pitch moment over V^2 alpha, without a_33 - a_11 of the added mass; the sum is < 0',
    )
    K_q: meaning(quantity('kg s/rad', **Signed), 'pitch moment over V^2 q; < 0 damps')
    K_MY: meaning(
        quantity('kg/rad', **Signed),
        'yaw moment over V^2 beta, without a_22 - a_11 of the added mass; less that it is the '
        'weathercock, > 0',
    )
    K_r: meaning(quantity('kg s/rad', **Signed), 'yaw moment over V^2 r; < 0 damps')
    speed_exponent: meaning(
        quantity('-', ge=-1.0, le=1.0) | None,
        'K_D0 is that at 1 m/s and goes with this power of the speed; 0 without',
    ) = None
    linear_damping: vector('kg/s', 'force over u, v, w; mostly none')
    linear_angular_damping: vector('kg m^2/s', 'moment over p, q, r; mostly none')
    quadratic_damping: vector('kg/m', 'force over u |u|, v |v|, w |w|; mostly none')
    quadratic_angular_damping: vector('kg m^2', 'moment over p |p|, q |q|, r |r|; mostly none')

    @pydantic.model_validator(mode='before')
    @classmethod
    def _as_others_write_it(cls, values):
        return with_coefficients(values)


class MovingMassSettings(Settings):
    """Mass that slides along x for pitch and turns about x for roll."""

    mass: meaning(quantity('kg', **Positive), 'mass that moves, most often the battery')
    neutral_x: meaning(quantity('m', ge=-10.0, le=10.0), 'where it trims level, + forward')
    radius: meaning(quantity('m', gt=0.0, le=1.0), 'of its centre from the axis it turns about')
    inertia: vector('kg m^2', 'about its own centre, turning with it', not_negative=True)
    travel: meaning(quantity('m', gt=0.0, le=2.0), 'as far as it goes from neutral to each side')
    rate: meaning(quantity('m/s', gt=0.0, le=1.0), 'how fast it slides')
    rotation: meaning(
        quantity('deg', ge=0.0, le=180.0), 'as far as it turns to each side; 0: it does not'
    )
    rotation_rate: meaning(quantity('deg/s', gt=0.0, le=180.0), 'how fast it turns')
    dead_band: meaning(
        quantity('m', ge=0.0, le=0.1) | None,
        'nearer than this to where it is sent it stops sliding',
    ) = None
    noise: meaning(
        quantity('m', ge=0.0, le=0.1) | None, 'standard deviation of where it says that it is'
    ) = None
    rotation_dead_band: meaning(
        quantity('deg', ge=0.0, le=20.0) | None, 'nearer than this it stops turning'
    ) = None
    rotation_noise: meaning(
        quantity('deg', ge=0.0, le=20.0) | None, 'standard deviation of the angle that it says'
    ) = None


class BuoyancyEngineSettings(Settings):
    """Oil pump: net heaviness within +-range; in cc, of sea water of 1025 kg/m^3."""

    range: meaning(
        quantity('kg', also=CC, gt=0.0, le=50.0),
        'most that it makes light or heavy; half a stroke',
    )
    rate: meaning(quantity('kg/s', also=CC_PER_S, gt=0.0, le=10.0), 'how fast')
    rate_per_m: meaning(
        quantity('1/m', ge=0.0, le=0.01) | None,
        'share of the rate that a metre of depth takes off while it pumps out, against the water',
    ) = None
    dead_band: meaning(
        quantity('kg', also=CC, ge=0.0, le=1.0) | None, 'nearer than this to its goal it stops'
    ) = None
    noise: meaning(
        quantity('kg', also=CC, ge=0.0, le=1.0) | None, 'standard deviation of where it says it is'
    ) = None


class HullSettings(Settings):
    """Outer shape, used where the hull breaks the surface."""

    length: meaning(quantity('m', gt=0.1, le=20.0), 'of the hull')
    diameter: meaning(quantity('m', gt=0.01, le=5.0), 'of the hull')


class SteeringSettings(Settings):
    """Turn rate (starboard +) over sine of roll in a gentle spiral, as ``glider trim`` solves it.

    Its sign belongs to vehicle and phase: lift points the other way in the climb. A file without
    it has that of `glider_model.vehicle.steering`.
    """

    dive: meaning(quantity('rad/s', ge=-1.0, le=1.0), 'in the dive, at 0.5 m/s')
    climb: meaning(quantity('rad/s', ge=-1.0, le=1.0), 'in the climb')
