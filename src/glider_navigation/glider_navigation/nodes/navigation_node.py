# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""Navigation as a node: sensors in; odom and the estimated current out."""

import sys

from glider_base.frames import from_geodetic
from glider_base.ros.lockstep.block_node import BlockNode
from glider_base.ros.lockstep.process import entry
from glider_base.ros.wire.codec import MessageError
from glider_navigation.block import NAVIGATION
from glider_navigation.intake import VARIANCE_MAX

#: Farther north or east of the origin, twice as far as a path may lead, there is no fix (km).
FIX_MAX_KM = 2000.0


class NavigationNode(BlockNode):
    """The estimate of where the vehicle is. Free-running, it is silent while a sensor is."""

    def __init__(self, **kwargs) -> None:
        super().__init__(NAVIGATION, **kwargs)
        for item in self.inputs:
            if item.topic.name == 'fix' and not self.ticks.lockstep:
                item.check = self.check_fix
        self.start_up()

    def check_fix(self, values: tuple[float, ...]) -> None:
        """Refuse a fix by another origin, with degrees swapped, or with no use of its variance."""
        origin = self.settings.origin.params()
        far_km = max(map(abs, from_geodetic(*values[1:3], origin))) / 1e3
        if values[0] >= 0.0 and far_km > FIX_MAX_KM:
            raise MessageError(
                f'latitude {values[1]:g}, longitude {values[2]:g}: {far_km:,.0f} km from the '
                f'origin, {origin.latitude:g}, {origin.longitude:g} '
                f'(allowed: <= {FIX_MAX_KM:,.0f} km)'
            )
        if values[0] >= 0.0 and not 0.0 <= min(values[3:]) <= max(values[3:]) <= VARIANCE_MAX:
            raise MessageError(
                f'position_covariance is {values[3]:g}, {values[4]:g} m^2 '
                f'(allowed: 0 to {VARIANCE_MAX:g})'
            )

    @property
    def sample_period_s(self) -> float:
        """Time (s) between two samples of what is not measured in every tick."""
        return self.settings.imu_period_s


main = entry(NavigationNode)

if __name__ == '__main__':
    sys.exit(main())
