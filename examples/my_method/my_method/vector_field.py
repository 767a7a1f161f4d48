"""Vector-field guidance: the farther from the path, the more straight toward it.

chi = chi_path - chi_far 2/pi atan(e2 / width): Nelson et al., IEEE Trans. Robotics 23(3), 2007.
"""

import math
from typing import NamedTuple

from pydantic import Field

from glider_base.kernel import kernel
from glider_guidance.los import crab_heading
from glider_guidance.method import Asked, LosGains, MethodSettings, method_step


class VectorFieldSettings(MethodSettings):
    """Vector field round the path, crab into the estimated current."""

    width_m: float = Field(
        100.0,
        gt=0.0,
        le=10000.0,
        description='distance at which half of far_deg is flown (m)',
        json_schema_extra={'tunable': True},
    )
    far_deg: float = Field(70.0, gt=0.0, le=90.0, description='approach from far away (deg)')

    def params(self, los: LosGains, vehicle) -> 'VectorFieldParams':
        """Kernel parameters."""
        return VectorFieldParams(self.width_m, math.radians(self.far_deg))

    def initial_state(self) -> 'VectorFieldState':
        """There is nothing that it keeps."""
        return VectorFieldState()


class VectorFieldParams(NamedTuple):
    """Gains of the method."""

    width: float  #: (m)
    far: float  #: (rad)


class VectorFieldState(NamedTuple):
    """There is nothing that it keeps."""


@kernel
def approach(error, params):
    """Angle (rad) by which to fly back to the path from an error (m)."""
    return -params.far * 2.0 / math.pi * math.atan(error / params.width)


@method_step.body(VectorFieldParams)
@kernel
def vector_field_step(state, seen, params, dt):
    """Direction to fly: see `method_step`."""
    water = seen.current
    course = seen.course + approach(seen.error.e2, params)
    heading, _, _ = crab_heading(course, seen.speed, water.v_n, water.v_e)
    _, _, feasible = crab_heading(seen.course, seen.speed, water.v_n, water.v_e)
    if seen.leg.turns_over:
        heading = seen.heading  # too slow to steer
    # e3 is below the path, elevation is upwards
    elevation = seen.elevation - approach(seen.error.e3, params) if seen.follows_path else 0.0
    return state, Asked(heading, elevation, seen.speed, water.v_n, water.v_e, feasible)
