# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""Adaptive line of sight: the crab angle is learnt from the cross-track error alone.

Fossen (2023), "An Adaptive Line-of-Sight (ALOS) Guidance Law for Path Following of Aircraft and
Marine Craft", IEEE Trans. Control Syst. Technol. 31 (6), doi 10.1109/TCST.2023.3259819:

    psi_d = pi_h - beta_hat - atan(y_e / Delta)
    beta_hat' = gamma Delta y_e / sqrt(Delta^2 + y_e^2)

with pi_h the course and y_e the cross-track error. It needs no speed, no flight model and no
estimate of the current, and a crab angle that stays as it is: one that changes, as from dive to
climb or in an inflection, is learnt anew.
"""

import math
from typing import NamedTuple

from glider_base.frames import wrap_angle
from glider_base.kernel import kernel
from glider_base.settings import number
from glider_guidance.los import approach_angles, crab_heading, desired_direction
from glider_guidance.method import Asked, LosGains, MethodSettings, method_step
from glider_model.vehicle.file import Vehicle

#: A crab angle is held within this (rad).
CRAB_MAX = math.radians(80.0)


class AlosSettings(MethodSettings):
    """Adaptive line of sight."""

    lookahead_m: float = number(65.0, (1.0, 10000.0), 'Delta, lookahead (m)', tunable=True)
    gamma_radpms: float = number(
        2e-5, (0.0, 0.01), 'gamma, adaptation of the crab angle (rad/(m s))', tunable=True
    )

    def params(self, los: LosGains, vehicle: Vehicle) -> 'AlosParams':
        """Kernel parameters."""
        return AlosParams(self.lookahead_m, self.gamma_radpms, los.delta2)

    def initial_state(self) -> 'AlosState':
        """No crab angle yet."""
        return AlosState(0.0)


class AlosParams(NamedTuple):
    """Gains of the method."""

    lookahead: float  #: Delta (m)
    gamma: float  #: (rad/(m s))
    vertical_ratio: float  #: delta2 (-)


class AlosState(NamedTuple):
    """What has been learnt."""

    crab: float  #: beta_hat (rad)


@method_step.body(AlosParams)
@kernel
def alos_step(state, seen, params, dt):
    """Direction to fly: see `method_step`. Learns in a glide only, where the course is made."""
    e2, current, crab = seen.error.e2, seen.current, state.crab
    if seen.leg.is_gliding:
        far = math.sqrt(params.lookahead * params.lookahead + e2 * e2)
        moved = crab + dt * params.gamma * params.lookahead * e2 / far
        crab = min(CRAB_MAX, max(-CRAB_MAX, moved))
    gamma_r, rho_r = approach_angles(e2, seen.error.e3, params.lookahead, params.vertical_ratio)
    course, elevation = desired_direction(seen.course, seen.elevation, gamma_r, rho_r)
    _, _, feasible = crab_heading(seen.course, seen.speed, current.v_n, current.v_e)
    return AlosState(crab), Asked(
        heading=seen.heading if seen.leg.turns_over else wrap_angle(course - crab),
        elevation=elevation,
        speed=seen.speed,
        current_n=current.v_n,
        current_e=current.v_e,
        feasible=feasible,
    )
