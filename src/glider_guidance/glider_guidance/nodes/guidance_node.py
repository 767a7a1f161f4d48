# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""Guidance as a node: odom in; reference, tracking_error, current_estimate and path out."""

import sys

from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import PoseStamped
from nav_msgs.msg import Path
from std_srvs.srv import Trigger

from glider_guidance.guidance import guidance_abort, guidance_step
from glider_guidance.profile import STAGE_NAMES
from glider_guidance.settings import GuidanceSettings
from glider_model.frames import odometry_from_wire, reference_to_wire, water_to_wire
from glider_model.ros import health, messages
from glider_model.ros.orders import ABORT, PARAMETERS_SET, Orders
from glider_model.ros.parameters import changed_parameters, declare_settings
from glider_model.ros.tick import BlockNode, run
from glider_model.signals import TICK_S, Water

#: Number of points of the published path.
PATH_POINTS = 500


class GuidanceNode(BlockNode):
    """Where to go. The service abort brings the vehicle to the surface for good."""

    def __init__(self, **kwargs) -> None:
        super().__init__(messages.GUIDANCE, **kwargs)
        self.publish_path = self.add_output('path')
        self.publish_reference = self.add_output('reference')
        self.publish_error = self.add_output('tracking_error')
        self.publish_estimate = self.add_output('current_estimate')
        self.settings = declare_settings(self, GuidanceSettings, self.on_settings)
        self.settings.check_depth()
        self.params = self.settings.params()
        self.state = self.settings.initial_state()
        self.told = None
        self.orders = Orders(self)
        self.add_input('odom')
        self.create_service(Trigger, 'abort', self.on_abort)
        self.compile_kernels()
        self.publish_path(path_message(self.settings.path.points(PATH_POINTS)))
        self.start_up()

    def on_settings(self, settings: GuidanceSettings) -> None:
        """Fly on with tunable parameters that were set at run time."""
        self.orders.add(PARAMETERS_SET, changed_parameters(self.settings, settings))
        self.settings = settings
        self.params = settings.params()

    def compile_kernels(self) -> None:
        """Call every kernel once, so that no tick waits for the compiler."""
        odometry = odometry_from_wire((*(3 * (0.0,)), 1.0, *(9 * (0.0,))))
        state, out = guidance_step(self.state, odometry, self.params, TICK_S)
        guidance_step(guidance_abort(state), odometry, self.params, TICK_S)
        reference_to_wire(out.reference)
        water_to_wire(out.current)

    def step(self, stamp_ns: int, odom) -> None:
        """Answer one tick."""
        self.orders.tell(stamp_ns)
        odometry = odometry_from_wire(odom)
        self.state, out = guidance_step(self.state, odometry, self.params, TICK_S)
        if (out.stage, out.infeasible) != self.told:
            self.tell(stamp_ns, out.stage, out.infeasible)
        self.publish_reference(stamp_ns, reference_to_wire(out.reference))
        self.publish_error(stamp_ns, out.error)
        self.publish_estimate(stamp_ns, water_to_wire(out.current))

    def tell(self, stamp_ns: int, stage: int, infeasible: bool) -> None:
        """Put a change of stage or feasibility on /diagnostics."""
        self.told = (stage, infeasible)
        name = self.get_fully_qualified_name()
        self.publish_event(stage_event(stamp_ns, stage, infeasible, name))

    def on_abort(self, request, response):
        """Serve ``abort``."""
        self.state = guidance_abort(self.state)
        self.orders.add(ABORT)
        response.success = True
        response.message = 'surfacing'
        return response


def stage_event(stamp_ns: int, stage: int, infeasible: bool, node: str) -> DiagnosticArray:
    """Diagnostics that say which stage began, or whether the course can be held.

    ``node`` is the full name of the node that says it.
    """
    name = STAGE_NAMES[stage]
    message = f'{name}; the course cannot be held against this current' if infeasible else name
    values = {
        'stage': name,
        'infeasible': str(bool(infeasible)).lower(),
        't_s': stamp_ns / 1e9,
    }
    level = health.WARN if infeasible else health.OK
    return health.status_array(stamp_ns, node, level, message, values)


def path_message(points) -> Path:
    """Path in `map` (ENU) from points float64[n, 3] in NED (m)."""
    path = Path()
    path.header.frame_id = messages.MAP
    for point in points:
        pose = PoseStamped()
        pose.header.frame_id = messages.MAP
        position = pose.pose.position
        position.x, position.y, position.z = water_to_wire(Water(*(float(x) for x in point)))
        path.poses.append(pose)
    return path


def main(args=None) -> int:
    """Run the node; returns its exit code."""
    return run(GuidanceNode, args)


if __name__ == '__main__':
    sys.exit(main())
