# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""Lift and drag as others write them, made into the coefficients K of `hydrodynamics`."""

import math

from glider_base.settings import Settings
from glider_base.signals import SEA_WATER_DENSITY
from glider_model.vehicle.quantity import required

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
    """Fields of a hydrodynamics section, with those that follow from a set of another's.

    A ValueError if there are two sets, or a coefficient beside the set that it follows from.
    """
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
