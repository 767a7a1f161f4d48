# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""Guidance as a node: odom in; reference, tracking_error, current_estimate and path out."""

import sys

from geometry_msgs.msg import PoseStamped
from nav_msgs.msg import Path
from rclpy.parameter import Parameter
from std_srvs.srv import Trigger

from glider_base.frames import water_to_wire
from glider_base.ros.lockstep import health
from glider_base.ros.lockstep.block_node import BlockNode
from glider_base.ros.lockstep.process import run
from glider_base.settings import ConfigurationError
from glider_base.signals import TICK_NS, Water
from glider_base.wiring import MAP
from glider_guidance.block import GUIDANCE
from glider_guidance.order import Order
from glider_guidance.orders import changed, due

#: Number of points of the published path.
PATH_POINTS = 500


class GuidanceNode(BlockNode):
    """Where to go. The service abort brings the vehicle to the surface for good.

    Other orders are parameters: path, profile.depth_m, profile.pitch_deg, profile.wait_s, hold.
    """

    def __init__(self, **kwargs) -> None:
        super().__init__(GUIDANCE, **kwargs)
        self.create_service(Trigger, 'abort', self.on_abort)
        self.waiting, self.first_ns = list(self.settings.orders), None
        self.publish_path = self.add_output('path')
        self.tell_path(0)
        self.start_up()

    def tell_path(self, stamp_ns: int) -> None:
        """Publish the path that is followed from a tick on."""
        self.told_path = self.settings.path
        self.publish_path(path_message(self.told_path.points(PATH_POINTS), stamp_ns))

    def step(self, stamp_ns: int, *inputs: tuple[float, ...]) -> None:
        """Answer one tick, by the orders that hold from it on."""
        self.first_ns = stamp_ns if self.first_ns is None else self.first_ns
        tick = (stamp_ns - self.first_ns) // TICK_NS
        for order in due(self.waiting, tick, self.flags[0] if self.flags else -1):
            self.waiting.remove(order)
            self.follow(stamp_ns, order)
        if self.settings.path != self.told_path:
            self.tell_path(stamp_ns)
        super().step(stamp_ns, *inputs)

    def follow(self, stamp_ns: int, order: Order) -> None:
        """Do what an order says."""
        if order.abort:
            self.waiting.clear()
            self.surface(health.ABORT)
            return
        values = {
            name: value if isinstance(value, float | bool) else value.model_dump_json()
            for name, value in order.changes().items()
        }
        try:
            changed(self.settings, order)
            asked = [Parameter(name, value=value) for name, value in values.items()]
            said = self.set_parameters_atomically(asked)
            reason = '' if said.successful else said.reason
        except ConfigurationError as error:
            reason = str(error)
        if reason:
            self.event(stamp_ns, health.WARN, f'order refused: {reason}')

    def on_abort(self, request, response):
        """Serve ``abort``."""
        self.surface(health.ABORT)
        response.success = True
        response.message = 'surfacing'
        return response


def path_message(points, stamp_ns: int = 0) -> Path:
    """Path in `map` (ENU) from points float64[n, 3] in NED (m), followed from a tick on."""
    path = Path()
    path.header.stamp.sec, path.header.stamp.nanosec = divmod(stamp_ns, 1_000_000_000)
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
