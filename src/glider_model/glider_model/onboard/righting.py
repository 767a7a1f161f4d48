# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""What rights a vehicle that is rolled, by its file: S_z + m_b K_MR / K_beta (docs/theory.md, 3).

At rest its weight below its buoyancy does. Under way the slip rolls it too, by its dihedral: back
in the dive, further over in the climb. A vehicle of which that is less than nothing rolls over by
itself, whatever its bank. Damping makes it a little later, by pitch (`test_righting.py`, by steady
spirals).
"""

from typing import NamedTuple

from glider_base.kernel import kernel
from glider_model.vehicle.file import VehicleParams


class Righting(NamedTuple):
    """What rights a vehicle at rest, and what its slip adds to that."""

    at_rest: float  #: S_z with the roll mass in the middle (kg m)
    lever: float  #: roll moment of a slip over its side force, K_MR / K_beta (m)


def make_righting(vehicle: VehicleParams) -> Righting:
    """Righting of a vehicle; without side force no slip is of account."""
    lever = vehicle.K_MR / vehicle.K_beta if vehicle.K_beta else 0.0
    return Righting(vehicle.s_z + vehicle.m_p * vehicle.R_p, lever)


@kernel
def rights_itself(m_b, share, righting):
    """Whether a glide with net heaviness m_b (kg) leaves this share of the righting at rest."""
    return righting.at_rest + m_b * righting.lever >= share * righting.at_rest
