# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""Guidance as a node: odom and battery in; reference, path and mission/status out."""

import re
import sys

import numpy as np
from geometry_msgs.msg import PoseStamped
from nav_msgs.msg import Path
from rcl_interfaces.msg import SetParametersResult
from rclpy.parameter import Parameter
from std_srvs.srv import Trigger

from glider_base.frames import water_to_wire
from glider_base.ros.lockstep import health
from glider_base.ros.lockstep.block_node import BlockNode
from glider_base.ros.lockstep.executor import take
from glider_base.ros.lockstep.process import entry
from glider_base.ros.wire import qos
from glider_base.ros.wire.codec import MessageError
from glider_base.ros.wire.topics import TOPICS
from glider_base.settings import ConfigurationError
from glider_base.signals import Battery, Water
from glider_base.wiring import MAP, SLOW_S, WHEN_SILENT
from glider_guidance.block import GUIDANCE
from glider_guidance.order import Order
from glider_guidance.orders import changed, due, judged_end, reaction, to_end
from glider_guidance.status import status_of

#: Number of points of the published path.
PATH_POINTS = 500
SECOND_NS = 10**9
#: Parameters that are orders.
_ORDER = re.compile(r'path$|hold$|profile\.')


class GuidanceNode(BlockNode):
    """Where to go. The service abort brings the vehicle to the surface for good.

    Other orders are parameters: path, profile.depth_m, profile.pitch_deg, profile.wait_s, hold.
    """

    def __init__(self, **kwargs) -> None:
        super().__init__(GUIDANCE, **kwargs)
        self.create_service(Trigger, 'abort', self.on_abort)
        self.publish_path = self.add_output('path')
        self.publish_status, self.second = self.add_output('mission/status'), -1
        # for the status alone: no input, as nothing is steered by it, and taken when it comes
        heard = None if self.ticks.lockstep else qos.FREE
        self.hears_battery = self._subscription(TOPICS['battery'], self.on_battery, profile=heard)
        self.tell_path(0)
        self.start_up()

    def compile_kernels(self) -> None:
        """Call every kernel once, so that no tick waits for the compiler."""
        super().compile_kernels()
        status_of(self.state, self.params, Battery(*WHEN_SILENT['battery']))

    def forget(self) -> None:
        """Know nothing, as at the start."""
        super().forget()
        self.waiting = list(self.settings.orders)
        self.tick = -1  #: the last one, by the time that passes in the steps
        self.answer = ''  #: to the last order
        self.arrived = False  #: at the end of the path
        self.battery, self.battery_ns = Battery(*WHEN_SILENT['battery']), 0  #: and when it said so

    def tell_path(self, stamp_ns: int) -> None:
        """Publish the path that is followed from a tick on."""
        self.path_published = self.settings.path
        self.publish_path(path_message(self.path_published.points(PATH_POINTS), stamp_ns))

    def step(self, stamp_ns: int, *inputs: tuple[float, ...]) -> None:
        """Answer one tick, by the orders that hold from it on."""
        self.tick += self.passed
        for order in due(self.waiting, self.tick, self.flags[0] if self.flags else -1):
            self.waiting.remove(order)
            self.follow(stamp_ns, order)
        if self.settings.path != self.path_published:
            self.tell_path(stamp_ns)
            self.arrived = False
        before = self.flags[2] if self.flags else 0
        super().step(stamp_ns, *inputs)
        if self.wrong:
            return
        no_progress = self.flags[2]
        if no_progress and not before:
            order = reaction(self.settings, no_progress, inputs[0], self.tick + 1)
            self.waiting += [order] if order else []
        ends = judged_end(self.settings, self.flags[:1], np.array(inputs[:1]), self.arrived)
        (misses,), (self.arrived,) = ends
        if misses:
            order = to_end(self.settings, inputs[0], self.tick + 1)
            self.waiting += [order] if order else []
        if stamp_ns // SECOND_NS != self.second:
            self.second = stamp_ns // SECOND_NS
            self.tell_status(stamp_ns)

    def on_battery(self, raw: bytes) -> None:
        """Remember what the battery says: nothing, if a number of it is NaN or it is damaged."""
        try:
            self.battery_ns, values = TOPICS['battery'].codec.decode(raw)
        except MessageError:
            values = WHEN_SILENT['battery']
        self.battery = Battery(*values)

    def tell_status(self, stamp_ns: int) -> None:
        """Publish how the mission goes, once a second."""
        while (raw := take(self.hears_battery)) is not None:
            self.on_battery(raw)
        is_silent = stamp_ns - self.battery_ns > SLOW_S['battery'] * SECOND_NS
        battery = Battery(*WHEN_SILENT['battery']) if is_silent else self.battery
        status = {
            name: value if isinstance(value, str | int) else round(value, 3)
            for name, value in status_of(self.state, self.params, battery)._asdict().items()
        }
        said, name = self.block.say(*self.flags), self.get_fully_qualified_name()
        values = {**status, 'order': self.answer}
        level = health.LEVELS[said.level]
        self.publish_status(health.status_array(stamp_ns, name, level, said.message, values))

    def set_parameters_atomically(self, parameter_list: list[Parameter]):
        """Set parameters at run time, and answer an order on `mission/status`."""
        named = [parameter.name for parameter in parameter_list]
        names = ', '.join(named)
        if self.state.profile.aborted and any(map(_ORDER.match, named)):
            reason = f'{names}: the mission is aborted (allowed: nothing more)'
            said = SetParametersResult(successful=False, reason=reason)
        else:
            said = super().set_parameters_atomically(parameter_list)
        self.answer = f'taken: {names}' if said.successful else refused(said.reason)
        return said

    def follow(self, stamp_ns: int, order: Order) -> None:
        """Do what an order says."""
        if order.abort:
            self.waiting.clear()
            self.answer = 'taken: abort'
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
            self.answer = refused(reason)
            self.event(stamp_ns, health.WARN, self.answer)

    def on_abort(self, request, response):
        """Serve ``abort``."""
        self.waiting.clear()
        self.answer = 'taken: abort'
        self.surface(health.ABORT)
        response.success = True
        response.message = 'surfacing'
        return response


def refused(why: object) -> str:
    """What the event of an order says that makes no sense."""
    return f'order refused: {why}'


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


main = entry(GuidanceNode)

if __name__ == '__main__':
    sys.exit(main())
