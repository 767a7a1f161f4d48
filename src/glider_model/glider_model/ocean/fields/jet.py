# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""A jet: a straight band of fast water, as along a front.

v(y) = V sech^2(y / L) at a distance y from the middle of the band (Bickley, Phil. Mag. 23, 1937).
"""

import math
from typing import Literal, NamedTuple

from glider_base.kernel import kernel
from glider_base.settings import derived, number
from glider_model.ocean.field import FieldSettings, field_velocity


class JetSettings(FieldSettings):
    """A jet: a straight band of fast water, weaker with depth."""

    kind: Literal['jet'] = 'jet'
    north_m: float = number(0.0, (-1e6, 1e6), 'A place in its middle, north of the origin (m).')
    east_m: float = number(0.0, (-1e6, 1e6), 'A place in its middle, east of the origin (m).')
    direction_deg: float = number(
        0.0, (-360.0, 360.0), 'Where it flows to (deg, clockwise from north).'
    )
    width_m: float = number(
        5000.0, (10.0, 1e6), 'Distance where the speed has fallen to 0.42 (m).'
    )
    peak_mps: float = number(0.3, (0.0, 3.0), 'Speed in its middle at the surface (m/s).')
    depth_m: float = number(500.0, (1.0, 12000.0), 'Depth where the speed has fallen to 1/e (m).')

    def params(self) -> 'JetParams':
        """Kernel parameters."""
        direction = math.radians(self.direction_deg)
        return derived(JetParams, self, along_n=math.cos(direction), along_e=math.sin(direction))


class JetParams(NamedTuple):
    """A jet as the kernel sees it."""

    north: float  #: of a place in its middle (m)
    east: float
    along_n: float  #: where it flows to, a vector of length 1
    along_e: float
    width: float  #: (m)
    peak: float  #: speed in its middle at the surface (m/s)
    depth: float  #: (m)


@field_velocity.body(JetParams)
@kernel
def jet_velocity(position, t_s, params):
    """Velocity in a jet (m/s): see `field_velocity`."""
    north, east = position[0] - params.north, position[1] - params.east
    across = (east * params.along_n - north * params.along_e) / params.width
    tanh = math.tanh(across)
    speed = params.peak * (1.0 - tanh * tanh) * math.exp(-position[2] / params.depth)
    return speed * params.along_n, speed * params.along_e, 0.0
