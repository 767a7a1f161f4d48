# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""The vehicle and the water around it, as a node that also makes time."""

import math
import sys

from glider_base.kernels.holding import Held
from glider_base.ros.lockstep.clock import ClockNode
from glider_base.ros.lockstep.process import entry
from glider_base.ros.parameters import declare_settings
from glider_base.signals import TICK_S
from glider_base.wiring import at_rest, present
from glider_model.plant.block import PLANT, measure_held, move_held
from glider_model.plant.plant import plant_odometry, state_fault


class PlantNode(ClockNode):
    """Publishes /clock, the truth and what sensors show; obeys command in current_velocity."""

    def __init__(self, **kwargs) -> None:
        super().__init__(PLANT.wired.node, **kwargs)
        settings = declare_settings(self, PLANT.settings)
        self.steers_by = PLANT.steers_by(settings)
        state = settings.initial_state()
        self.plant = Held(state, settings.params())
        #: newest of each input; none moves the actuators before the first command
        self.newest = [at_rest(topic) for topic in PLANT.wired.inputs]
        self.newest[PLANT.wired.inputs.index('command')] = tuple(state.joints)
        self.is_last = False  #: the tick that was published last ends the run
        outputs = PLANT.wired.outputs
        self.publish_clock, *self.senders = map(self.add_output, present(outputs, settings.topics))
        #: places of what they send among the outputs
        self.sent = [outputs.index(topic) - 1 for topic in present(outputs[1:], settings.topics)]
        for topic in PLANT.wired.inputs:
            self.add_input(topic)
        # so that no tick waits for the compiler
        move_held(self.plant.held, tuple(self.newest), TICK_S)
        measure_held(self.plant.held)
        self.plant.state = state
        self.start_up()

    def publish_tick(self, stamp_ns: int) -> None:
        """Publish the state of the vehicle, or end the run if there is none any more."""
        outputs, self.is_last = measure_held(self.plant.held)
        if not math.isfinite(sum(map(sum, outputs))):
            state = self.plant.state
            self.fail(state_fault(plant_odometry(state), state.joints, state.tick))
        self.publish_clock(stamp_ns)
        for publish, place in zip(self.senders, self.sent, strict=True):
            publish(stamp_ns, outputs[place])

    def complete_tick(self, *inputs: tuple[float, ...]) -> bool:
        """Integrate to the next tick; False at the end of the run."""
        if self.is_last:
            return False
        self.newest = [new or old for new, old in zip(inputs, self.newest, strict=True)]
        move_held(self.plant.held, tuple(self.newest), TICK_S)
        return True


main = entry(PlantNode)

if __name__ == '__main__':
    sys.exit(main())
