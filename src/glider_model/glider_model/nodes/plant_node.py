# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""The vehicle and the water around it, as a node that also makes time."""

import math
import sys

from glider_model.frames import odometry_to_wire, water_from_wire
from glider_model.plant import (
    PlantSettings,
    plant_finished,
    plant_joints,
    plant_measurement,
    plant_step,
    state_fault,
)
from glider_model.ros import messages
from glider_model.ros.clock import ClockNode
from glider_model.ros.parameters import declare_settings
from glider_model.ros.tick import run
from glider_model.signals import TICK_S, Joints, Water


class PlantNode(ClockNode):
    """Publishes /clock, odom and joint_states; obeys command in current_velocity."""

    def __init__(self, **kwargs) -> None:
        super().__init__(messages.PLANT, **kwargs)
        settings = declare_settings(self, PlantSettings)
        self.params = settings.params()
        self.state = settings.initial_state()
        self.command = plant_joints(self.state)
        self.water = Water(0.0, 0.0, 0.0)
        self.publish_clock = self.add_output('/clock')
        self.publish_odom = self.add_output('odom')
        self.publish_joints = self.add_output('joint_states')
        self.add_input('command')
        self.add_input('current_velocity')
        self.compile_kernels()
        self.start_up()

    def compile_kernels(self) -> None:
        """Call every kernel once, so that no tick waits for the compiler."""
        state = plant_step(self.state, self.command, self.water, self.params, TICK_S)
        plant_finished(state, self.params)
        odometry_to_wire(plant_measurement(state, self.params))
        plant_joints(state)
        water_from_wire((0.0, 0.0, 0.0))

    def publish_tick(self, stamp_ns: int) -> None:
        """Publish the state of the vehicle, or end the run if there is none any more."""
        measured = plant_measurement(self.state, self.params)
        joints = plant_joints(self.state)
        if not math.isfinite(sum(measured) + sum(joints)):
            self.fail(state_fault(measured, joints, self.state.tick))
        self.publish_clock(stamp_ns)
        self.publish_odom(stamp_ns, odometry_to_wire(measured))
        self.publish_joints(stamp_ns, joints)

    def complete_tick(self, command, current_velocity) -> bool:
        """Integrate to the next tick; False at the end of the run."""
        if plant_finished(self.state, self.params):
            return False
        if command:
            self.command = Joints(*command)
        if current_velocity:
            self.water = water_from_wire(current_velocity)
        self.state = plant_step(self.state, self.command, self.water, self.params, TICK_S)
        return True


def main(args=None) -> int:
    """Run the node; returns its exit code."""
    return run(PlantNode, args)


if __name__ == '__main__':
    sys.exit(main())
