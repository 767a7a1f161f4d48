# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""The vehicle and the water around it, as a node that also makes time."""

import math
import sys

from glider_base.ros.lockstep.clock import ClockNode
from glider_base.ros.lockstep.process import entry
from glider_base.ros.parameters import declare_settings
from glider_base.signals import TICK_S
from glider_base.wiring import at_rest, present
from glider_model.plant.block import PLANT, plant_move, plant_outputs
from glider_model.plant.plant import plant_odometry, state_fault


class PlantNode(ClockNode):
    """Publishes /clock, the truth and what sensors show; obeys command in current_velocity."""

    def __init__(self, **kwargs) -> None:
        super().__init__(PLANT.wired.node, **kwargs)
        settings = declare_settings(self, PLANT.settings)
        self.steers_by = PLANT.steers_by(settings)
        self.params = settings.params()
        self.state = settings.initial_state()
        #: newest of each input; none moves the actuators before the first command
        self.newest = [at_rest(topic) for topic in PLANT.wired.inputs]
        self.newest[PLANT.wired.inputs.index('command')] = tuple(self.state.joints)
        self.is_last = False  #: the tick that was published last ends the run
        outputs = PLANT.wired.outputs
        self.publish_clock, *self.senders = map(self.add_output, present(outputs, settings.topics))
        #: places of what they send among the outputs
        self.sent = [outputs.index(topic) - 1 for topic in present(outputs[1:], settings.topics)]
        for topic in PLANT.wired.inputs:
            self.add_input(topic)
        plant_outputs(plant_move(self.state, tuple(self.newest), self.params, TICK_S), self.params)
        self.start_up()

    def publish_tick(self, stamp_ns: int) -> None:
        """Publish the state of the vehicle, or end the run if there is none any more."""
        outputs, self.is_last = plant_outputs(self.state, self.params)
        if not math.isfinite(sum(map(sum, outputs))):
            fault = state_fault(plant_odometry(self.state), self.state.joints, self.state.tick)
            self.fail(fault)
        self.publish_clock(stamp_ns)
        for publish, place in zip(self.senders, self.sent, strict=True):
            publish(stamp_ns, outputs[place])

    def complete_tick(self, *inputs: tuple[float, ...]) -> bool:
        """Integrate to the next tick; False at the end of the run."""
        if self.is_last:
            return False
        self.newest = [new or old for new, old in zip(inputs, self.newest, strict=True)]
        self.state = plant_move(self.state, tuple(self.newest), self.params, TICK_S)
        return True


main = entry(PlantNode)

if __name__ == '__main__':
    sys.exit(main())
