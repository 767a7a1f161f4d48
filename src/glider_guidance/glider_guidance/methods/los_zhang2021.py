# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""The paper's method: line of sight as printed, equations (8) to (10), with no estimate."""

from typing import NamedTuple

from glider_base.kernel import kernel
from glider_guidance.los import approach_angles, crab_heading, desired_direction
from glider_guidance.method import Asked, LosGains, MethodSettings, method_step
from glider_model.vehicle.file import Vehicle


class LosZhangSettings(MethodSettings):
    """As printed, no estimate."""

    def params(self, los: LosGains, vehicle: Vehicle) -> 'LosZhangParams':
        """Kernel parameters."""
        return LosZhangParams(los.delta1_m, los.delta2)

    def initial_state(self) -> 'LosZhangState':
        """There is nothing that it keeps."""
        return LosZhangState(0)


class LosZhangParams(NamedTuple):
    """Gains of the method."""

    lookahead: float  #: Delta1 (m)
    vertical_ratio: float  #: delta2 (-)


class LosZhangState(NamedTuple):
    """Nothing; a tuple of numbers cannot be empty."""

    nothing: int


@method_step.body(LosZhangParams)
@kernel
def los_zhang_step(state, seen, params, dt):
    """Direction to fly: see `method_step`."""
    gamma_r, rho_r = approach_angles(
        seen.error.e2, seen.error.e3, params.lookahead, params.vertical_ratio
    )
    heading, elevation = desired_direction(seen.course, seen.elevation, gamma_r, rho_r)
    current = seen.current
    _, _, feasible = crab_heading(seen.course, seen.speed, current.v_n, current.v_e)
    if seen.leg.turns_over:
        heading = seen.heading
    return state, Asked(
        heading=heading,
        elevation=elevation,
        speed=seen.speed,
        current_n=0.0,
        current_e=0.0,
        feasible=feasible,
    )
