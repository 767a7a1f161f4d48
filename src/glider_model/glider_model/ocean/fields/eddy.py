# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""An eddy: the vortex of Lamb and Oseen, weaker with depth, carried along with its centre.

v(r) = V_m (1 + 1/(2 a)) (R/r) (1 - exp(-a r^2/R^2)), with a = 1.25643 so that the speed is largest
at the radius R and V_m there (Devenport et al., J. Fluid Mech. 312, 1996, pp. 67-106, eq. 2). The
flow goes round in circles, so that no water is made or lost at any depth.
"""

import math
from typing import Literal, NamedTuple

from glider_base.kernel import kernel
from glider_base.settings import derived, number
from glider_model.ocean.field import FieldSettings, field_velocity

#: a, for which the largest speed is at the radius: exp(a) = 1 + 2 a.
ALPHA = 1.2564312086261697


class EddySettings(FieldSettings):
    """An eddy: water that turns round a centre, weaker with depth."""

    kind: Literal['eddy'] = 'eddy'
    north_m: float = number(0.0, (-1e6, 1e6), 'Centre at the start, north of the origin (m).')
    east_m: float = number(0.0, (-1e6, 1e6), 'Centre at the start, east of the origin (m).')
    radius_m: float = number(
        10000.0, (100.0, 1e6), 'Distance of the largest speed from the centre (m).'
    )
    peak_mps: float = number(
        0.3, (-3.0, 3.0), 'Largest speed at the surface, + clockwise seen from above (m/s).'
    )
    depth_m: float = number(500.0, (1.0, 12000.0), 'Depth where the speed has fallen to 1/e (m).')
    drift_north_mps: float = number(0.0, (-1.0, 1.0), 'Velocity of the centre to the north (m/s).')
    drift_east_mps: float = number(0.0, (-1.0, 1.0), 'Velocity of the centre to the east (m/s).')

    def params(self) -> 'EddyParams':
        """Kernel parameters."""
        return derived(EddyParams, self, speed=self.peak_mps * (1.0 + 0.5 / ALPHA))


class EddyParams(NamedTuple):
    """An eddy as the kernel sees it."""

    north: float  #: of the centre at the start (m)
    east: float
    drift_north: float  #: of the centre (m/s)
    drift_east: float
    radius: float  #: (m)
    speed: float  #: V_m (1 + 1/(2 a)) (m/s)
    depth: float  #: (m)


@field_velocity.body(EddyParams)
@kernel
def eddy_velocity(position, t_s, params):
    """Velocity in an eddy (m/s): see `field_velocity`."""
    north = position[0] - params.north - params.drift_north * t_s
    east = position[1] - params.east - params.drift_east * t_s
    square = (north * north + east * east) / (params.radius * params.radius)
    # (1 - exp(-x)) / x has the limit 1 at the centre
    x = ALPHA * square
    share = -math.expm1(-x) / x if x > 0.0 else 1.0
    rate = params.speed * ALPHA * share / params.radius * math.exp(-position[2] / params.depth)
    return -rate * east, rate * north, 0.0
