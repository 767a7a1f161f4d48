# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""Control as a node: odom, joint_states and reference in; command and wrench out."""

import sys

from diagnostic_msgs.msg import DiagnosticArray

from glider_control import watch
from glider_control.control import control_step, control_surface
from glider_control.settings import ControlSettings
from glider_model.frames import odometry_from_wire, reference_from_wire, wrench_to_wire
from glider_model.ros import health, messages
from glider_model.ros.orders import PARAMETERS_SET, SURFACE, Orders
from glider_model.ros.parameters import changed_parameters, declare_settings
from glider_model.ros.tick import BlockNode, run
from glider_model.signals import TICK_S, Joints

#: Actuators by the bits of the saturation mask that say that they are at their limits.
AT_LIMIT = {1: 'buoyancy engine', 2: 'pitch mass', 4: 'roll mass'}


class ControlNode(BlockNode):
    """How to get there. Free-running, it surfaces the vehicle when an input is stale."""

    when_stale = 'commanding the safe state until then'

    def __init__(self, **kwargs) -> None:
        super().__init__(messages.CONTROL, **kwargs)
        self.settings = declare_settings(self, ControlSettings, self.on_settings)
        self.params = self.settings.params()
        self.state = self.settings.initial_state()
        self.told, self.told_ns = 0, -watch.TELL_EVERY_NS
        self.refused = 0
        self.stale_ticks = 0
        self.orders = Orders(self)
        self.publish_wrench = self.add_output('wrench')
        self.publish_adaptation = self.add_output('adaptation')
        self.publish_command = self.add_output('command')
        self.add_input('reference')
        self.add_input('odom')
        self.add_input('joint_states')
        self.compile_kernels()
        self.start_up()

    def on_settings(self, settings: ControlSettings) -> None:
        """Fly on with tunable parameters that were set at run time."""
        self.orders.add(PARAMETERS_SET, changed_parameters(self.settings, settings))
        self.settings = settings
        self.params = settings.params()

    def compile_kernels(self) -> None:
        """Call every kernel once, so that no tick waits for the compiler."""
        level = (*(3 * (0.0,)), 1.0, *(9 * (0.0,)))
        odometry, reference = odometry_from_wire(level), reference_from_wire(level)
        joints = Joints(0.0, 0.0, 0.0)
        state, out = control_step(self.state, odometry, joints, reference, self.params, TICK_S)
        control_surface(state)
        wrench_to_wire(out.wrench)

    def step(self, stamp_ns: int, reference, odom, joint_states) -> None:
        """Answer one tick."""
        self.orders.tell(stamp_ns)
        self.stale_ticks = 0
        self.state, out = control_step(
            self.state,
            odometry_from_wire(odom),
            Joints(*joint_states),
            reference_from_wire(reference),
            self.params,
            TICK_S,
        )
        if out.saturation != self.told and stamp_ns - self.told_ns >= watch.TELL_EVERY_NS:
            self.tell(stamp_ns, out.saturation)
        self.publish_command(stamp_ns, out.command)
        self.publish_wrench(stamp_ns, wrench_to_wire(out.wrench))
        self.publish_adaptation(stamp_ns, out.adaptation)

    def tell(self, stamp_ns: int, saturation: int) -> None:
        """Put a change of saturation on /diagnostics."""
        self.told, self.told_ns = saturation, stamp_ns
        event = saturation_event(stamp_ns, saturation, self.get_fully_qualified_name())
        if event.status[0].level == health.ERROR:
            self.get_logger().error(event.status[0].message)
        self.publish_event(event)
        refused = self.state.watch.gate.refused
        if refused != self.refused:
            self.refused = refused
            said = f'odometry: {refused} samples refused so far'
            self.event(stamp_ns, health.WARN, said, odom_refused=refused)

    def on_stale(self, stamp_ns: int) -> None:
        """Command what surfaces the vehicle, after a while for good."""
        self.stale_ticks += 1
        if self.stale_ticks == round(self.settings.lost_after_s / TICK_S):
            self.state = control_surface(self.state)
            self.orders.add(SURFACE)
            said = f'input lost for {self.settings.lost_after_s:g} s: surfacing for good'
            self.event(stamp_ns, health.ERROR, said)
        self.publish_command(stamp_ns, self.params.safe_command)


def saturation_event(stamp_ns: int, saturation: int, node: str) -> DiagnosticArray:
    """Diagnostics that say what control has noticed, and which actuators are at their limits.

    ``node`` is the full name of the node that says it.
    """
    at_limit = ', '.join(name for bit, name in AT_LIMIT.items() if saturation & bit)
    said = [watch.say(saturation), f'at its limit: {at_limit}' if at_limit else '']
    message = '; '.join(text for text in said if text)
    level = health.WARN if message else health.OK
    if saturation & (watch.SURFACES | watch.STUCK):
        level = health.ERROR
    values = {'saturation': saturation, 't_s': stamp_ns / 1e9}
    text = message or 'no actuator at its limit'
    return health.status_array(stamp_ns, node, level, text, values)


def main(args=None) -> int:
    """Run the node; returns its exit code."""
    return run(ControlNode, args)


if __name__ == '__main__':
    sys.exit(main())
