# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""Guidance as a node: odom in; reference, tracking_error, current_estimate and path out."""

import sys

from geometry_msgs.msg import PoseStamped
from nav_msgs.msg import Path
from std_srvs.srv import Trigger

from glider_guidance.block import GUIDANCE
from glider_model.base.frames import water_to_wire
from glider_model.base.signals import Water
from glider_model.base.wiring import MAP
from glider_model.ros.lockstep.block_node import BlockNode
from glider_model.ros.lockstep.orders import ABORT
from glider_model.ros.lockstep.process import run

#: Number of points of the published path.
PATH_POINTS = 500


class GuidanceNode(BlockNode):
    """Where to go. The service abort brings the vehicle to the surface for good."""

    def __init__(self, **kwargs) -> None:
        super().__init__(GUIDANCE, **kwargs)
        self.settings.check_depth()
        self.create_service(Trigger, 'abort', self.on_abort)
        publish_path = self.add_output('path')
        publish_path(path_message(self.settings.path.points(PATH_POINTS)))
        self.start_up()

    def on_abort(self, request, response):
        """Serve ``abort``."""
        self.surface(ABORT)
        response.success = True
        response.message = 'surfacing'
        return response


def path_message(points) -> Path:
    """Path in `map` (ENU) from points float64[n, 3] in NED (m)."""
    path = Path()
    path.header.frame_id = MAP
    for point in points:
        pose = PoseStamped()
        pose.header.frame_id = MAP
        position = pose.pose.position
        position.x, position.y, position.z = water_to_wire(Water(*(float(x) for x in point)))
        path.poses.append(pose)
    return path


def main(args=None) -> int:
    """Run the node; returns its exit code."""
    return run(GuidanceNode, args)


if __name__ == '__main__':
    sys.exit(main())
