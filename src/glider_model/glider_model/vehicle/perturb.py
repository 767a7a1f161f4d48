# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""A vehicle that is not quite what its file says: the plant's, while control knows the file.

Factors apply to the numbers of the file. Of a static moment that is the viscous coefficient alone:
the Munk moment belongs to the added mass, which has factors of its own.
"""

import math

import pydantic
from pydantic import Field

from glider_base.settings import ConfigurationError, Settings, number, positive
from glider_model.vehicle.file import VehicleParams, mass_fault

#: What may be scaled, by the names of `VehicleParams`. A static moment may change its sign; drag,
#: lift and damping may not.
STATIC = ('K_L0', 'K_MR', 'K_M0', 'K_M', 'K_MY')
VISCOUS = ('K_D0', 'K_D', 'K_L', 'K_beta', 'K_p', 'K_q', 'K_r')
DAMPING = tuple('D_u D_v D_w D_p D_q D_r D_uu D_vv D_ww D_pp D_qq D_rr'.split())
ADDED_MASS = tuple('a_11 a_22 a_33 a_44 a_55 a_66 a_26 a_35'.split())
_SCALED = (*VISCOUS, *STATIC, *DAMPING, *ADDED_MASS)


def _factor(name: str):
    """Field of a factor on one number of the vehicle file."""
    least = -10.0 if name in STATIC else 0.0
    return (float, Field(1.0, ge=least, le=10.0, description=f'factor on {name} (-)'))


_Factors = pydantic.create_model(
    '_Factors', __base__=Settings, **{name: _factor(name) for name in _SCALED}
)


class PerturbSettings(_Factors):
    """What a plant differs in from its vehicle file; by default in nothing."""

    pump_rate: float = positive(1.0, 10.0, 'factor on the rate of the buoyancy engine (-)')
    roll_range: float = number(1.0, (0.0, 2.0), 'factor on the range of the roll mass (-)')
    pitch_trim_m: float = number(
        0.0, (-0.1, 0.1), 'how far forward of neutral the pitch mass really is (m, + nose down)'
    )
    roll_bias_deg: float = number(
        0.0,
        (-45.0, 45.0),
        'roll at rest with the roll mass at 0, by a hull that is heavier on one side (deg, + '
        'starboard side down)',
    )
    net_heaviness_kg: float = number(0.0, (-5.0, 5.0), 'error of the ballast (kg, + sinks)')


def perturbed(vehicle: VehicleParams, settings: PerturbSettings) -> VehicleParams:
    """Vehicle that differs from ``vehicle`` as the settings say.

    A ConfigurationError if its mass matrix is not positive definite.
    """
    scaled = {name: getattr(vehicle, name) * getattr(settings, name) for name in _SCALED}
    # at rest the first moment of the whole vehicle points down: tan(roll) = s_y / s_z
    hanging = vehicle.s_z + vehicle.m_p * vehicle.R_p
    changed = vehicle._replace(
        **scaled,
        s_y=vehicle.s_y + hanging * math.tan(math.radians(settings.roll_bias_deg)),
        x_p0=vehicle.x_p0 + settings.pitch_trim_m,
        m_b_rate=vehicle.m_b_rate * settings.pump_rate,
        mu_max=vehicle.mu_max * settings.roll_range,
        ballast=vehicle.ballast + settings.net_heaviness_kg,
    )
    fault = mass_fault(changed)
    if fault:
        raise ConfigurationError(f'perturb: {fault}')
    return changed
