# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""The bottom of the sea: how deep it is at a place, and a vehicle that touches it."""

import math
from typing import ClassVar, NamedTuple

import numpy as np

from glider_base.frames import Origin, from_geodetic, on_chart, rotate_to_body, rotate_to_ned
from glider_base.kernel import kernel, replace
from glider_base.slot import slot
from glider_model.ocean.field import bracket
from glider_model.ocean.fields.grid import GridFileSettings
from glider_model.ocean.grid_file import Loaded


class FlatBottom(NamedTuple):
    """A bottom that is as deep everywhere."""

    depth: float  #: (m)


#: Deeper than any sea: there is none.
NO_BOTTOM = FlatBottom(1e6)


@slot
def bottom_depth(n, e, params):
    """Depth of the bottom (m) at a place north and east (m)."""
    raise NotImplementedError


@bottom_depth.body(FlatBottom)
@kernel
def _flat_depth(n, e, params):
    return params.depth


class ChartedBottom(NamedTuple):
    """A bottom on a chart; its axes increase."""

    latitudes: np.ndarray  #: float64[y] (deg)
    longitudes: np.ndarray  #: float64[x] (deg), around the origin
    depth: np.ndarray  #: float32[y, x] (m); not above 0: land
    origin: Origin


@bottom_depth.body(ChartedBottom)
@kernel
def _charted_depth(n, e, params):
    """Linear between the points of the chart; beyond its edge that of the edge; 0: land."""
    latitude, longitude = on_chart(n, e, params.origin)
    y, y_next, f_y = bracket(latitude, params.latitudes)
    x, x_next, f_x = bracket(longitude, params.longitudes)
    south = (1.0 - f_x) * params.depth[y, x] + f_x * params.depth[y, x_next]
    north = (1.0 - f_x) * params.depth[y_next, x] + f_x * params.depth[y_next, x_next]
    return max(0.0, (1.0 - f_y) * south + f_y * north)


class BathymetrySettings(GridFileSettings):
    """A chart of the bottom, from a file as GEBCO writes it."""

    of: ClassVar[str] = 'bottom'

    def is_land(self, loaded: Loaded, place: tuple[float, float]) -> bool:
        """Whether there is land at a place (deg), between the points too."""
        chart = self._charted(loaded)
        return bottom_depth(*from_geodetic(*place, chart.origin), chart) <= 0.0

    def _charted(self, loaded: Loaded) -> ChartedBottom:
        depth, origin = loaded.water[0, 0, ..., 0], self.mission.origin.params()
        return ChartedBottom(*loaded.axes[2:], depth, origin)

    def params(self) -> ChartedBottom:
        """Kernel parameters.

        A ValueError names the file, and what of it or of the mission is at fault.
        """
        self.check_places(self.mission.places, 'on the path')
        return self._charted(self.loaded()[0])


@kernel
def least_height(n, e, depth, params):
    """Least height over the bottom (m) along a track, and the index of it.

    ``n``, ``e`` and ``depth`` are float64[ticks] (m), ``params`` those of the bottom.
    """
    least, where = math.inf, 0
    for i in range(len(depth)):
        height = bottom_depth(n[i], e[i], params) - depth[i]
        if height < least:
            least, where = height, i
    return least, where


@kernel
def aground(motion, water, bottom):
    """The motion of a vehicle, stopped by the bottom (m) if it would be below it.

    It lies where it touched: the mud holds it against the current, and lets it go upward.
    """
    x = motion
    if not x.p_d > bottom:
        return motion
    _, _, down = rotate_to_ned(x.q_w, x.q_x, x.q_y, x.q_z, x.u, x.v, x.w)
    down = min(0.0, down + water.v_d) - water.v_d
    u, v, w = rotate_to_body(x.q_w, x.q_x, x.q_y, x.q_z, -water.v_n, -water.v_e, down)
    return replace(x, p_d=bottom, u=u, v=v, w=w)
