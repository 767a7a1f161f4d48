# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""By what a run is scored."""

import math
from typing import NamedTuple

from glider_base.frames import Origin
from glider_guidance.path.curve import PathParams

#: Around an inflection (s) and shallower than this (m) nothing counts as steady,
INFLECTION_MARGIN_S = 600.0
STEADY_DEPTH_M = 30.0
#: but of a dive or climb these shares of its time and its depth are left out at most.
MARGIN_SHARE, STEADY_DEPTH_SHARE = 0.3, 0.25


class Rules(NamedTuple):
    """By what a run is scored."""

    settle_s: float = 0.0  #: settling time (s)
    depth_m: float = 1000.0  #: depth of the lower turn (m)
    glide_s: float = math.inf  #: time of one dive or climb (s); along a path in depth infinite
    navigation: str = 'known'  #: method by which the vehicle navigates
    path: PathParams | None = None  #: that was to be flown
    ends: bool = False  #: at the end of the path
    arrival_radius_m: float = math.inf  #: of its last point, within which it is to come up
    pace_s: float = math.inf  #: time that is ample for a metre of way and its stays (s/m)
    spare_s: float = math.inf  #: beside that; infinite where it may wait for good (s)
    duration_s: float = math.inf  #: time that the mission has (s)
    origin: Origin | None = None  #: of its chart, if people read its places in degrees
    shallowest_m: float = math.inf  #: depth of dives by which they are counted, if less (m)
    dives: int = 0  #: that it is to fly, if there is time for them; 0: so many as there are
    dive_s: float = math.inf  #: time that is ample for a stay and a dive, if it is to fly some (s)

    @property
    def dives_at_all(self) -> bool:
        """Whether there is time for a dive, and it is to fly some."""
        return self.dive_s < self.duration_s

    def has_arrived(self, missed_m: float) -> bool:
        """Whether who came up so far from the end of its path has arrived.

        From the end of a path in depth it comes up wherever that leads.
        """
        return missed_m <= self.arrival_radius_m or math.isinf(self.glide_s)

    @property
    def margin_s(self) -> float:
        """Time around an inflection that is not steady (s)."""
        return min(INFLECTION_MARGIN_S, MARGIN_SHARE * self.glide_s)

    @property
    def steady_depth_m(self) -> float:
        """Depth above which nothing is steady (m)."""
        return min(STEADY_DEPTH_M, STEADY_DEPTH_SHARE * self.depth_m)
