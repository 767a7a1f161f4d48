# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""A vehicle that is not there, on a bad line: try guidance_node and control_node against it.

It keeps its own time, which begins at 1000 s. What it sends arrives up to 50 ms early or late,
one message in twenty never, and for three seconds nothing goes either way. With a speed of more
than 1 it publishes its time on /clock, for nodes with use_sim_time, and does not run away from
them: they command once in a period, and it waits for that.

    python examples/stand_in.py --ros-args -r __ns:=/glider -p speed:=1.0
"""

import random
import time

import rclpy
from driver import JOINTS, PERIOD_S, Driver
from rclpy.executors import ExternalShutdownException, SingleThreadedExecutor
from rclpy.time import Time
from rosgraph_msgs.msg import Clock

from glider_model.base.signals import Joints, Water
from glider_model.plant.block import plant_outputs
from glider_model.plant.plant import PlantSettings, plant_step

#: Parameters and what they are unless somebody says otherwise.
PARAMETERS = {
    'speed': 1.0,  # times real time
    'depth_m': 50.0,  # where it begins, gliding down to the north-north-east
    'current_mps': 0.05,  # to the east
    'jitter_s': 0.05,
    'loss': 0.05,  # part of all messages, in either direction
    'silence_at_s': 60.0,  # after the start; 0.0: never
    'silence_s': 3.0,
    'duration_s': 0.0,  # 0.0: until Ctrl-C
    'listeners': 2,  # subscribers of odom that it waits for, guidance and control
    'seed': 1,
}
GLIDING = {'heading_deg': 30.0, 'pitch_deg': -30.0, 'speed_mps': 0.5, 'net_heaviness_kg': 0.4}
START_NS = 1000 * 10**9
#: The line is looked at this often in a period.
STEPS = 4
#: Periods that time may be ahead of the commands, and how long it waits for one (s).
AHEAD, PATIENCE_S = 1, 2.0


class StandIn:
    """A glider in a uniform current, integrated at its own 10 Hz."""

    def __init__(self) -> None:
        self._time_ns = START_NS
        self.place(0.0, 0.0)

    def place(self, depth_m: float, current_mps: float) -> None:
        """Put it somewhere."""
        settings = PlantSettings(initial={**GLIDING, 'depth_m': depth_m})
        self._params, self._state = settings.params(), settings.initial_state()
        self._target = self._state.joints
        self._water = Water(0.0, current_mps, 0.0)

    def advance(self) -> None:
        """Let one period pass."""
        self._time_ns += round(PERIOD_S * 1e9)
        self._state = plant_step(self._state, self._target, self._water, self._params, PERIOD_S)

    def time_ns(self) -> int:
        """Time since 1000 s before the start."""
        return self._time_ns

    def navigation(self) -> tuple[tuple, tuple, tuple, tuple]:
        """Position, orientation (w, x, y, z), velocity over ground and rates, ENU and FLU."""
        (wire, _), _ = plant_outputs(self._state, self._params)
        return wire[:3], wire[3:7], wire[7:10], wire[10:]

    def actuators(self) -> list[float]:
        """Positions of the actuators."""
        return list(self._state.joints)

    def move(self, targets: dict[str, float]) -> None:
        """Move actuators towards their targets."""
        self._target = Joints(*(targets[joint] for joint in JOINTS))


class BadLine(Driver):
    """A driver whose messages come early, late or never."""

    def __init__(self) -> None:
        super().__init__(StandIn(), 'stand_in')
        given = {
            name: self.declare_parameter(name, value).value for name, value in PARAMETERS.items()
        }
        self.vehicle.place(given['depth_m'], given['current_mps'])
        self.line, self.random = given, random.Random(given['seed'])
        self.clock = self.create_publisher(Clock, '/clock', 10) if given['speed'] > 1.0 else None
        self.under_way: list[tuple[float, tuple]] = []
        self.elapsed_s = 0.0
        self.unanswered = None  # periods without a command, once there has been one

    def runs_away(self) -> bool:
        """Whether the nodes do not keep up with /clock."""
        return self.clock is not None and (self.unanswered or 0) > AHEAD

    def passes(self) -> bool:
        """Whether a message comes through now."""
        since_s = self.elapsed_s - self.line['silence_at_s']
        silent = self.line['silence_at_s'] > 0.0 and 0.0 <= since_s < self.line['silence_s']
        return not silent and self.random.random() >= self.line['loss']

    def on_command(self, command) -> None:
        """Obey what comes through."""
        self.unanswered = 0
        if self.passes():
            super().on_command(command)

    def step(self, number: int) -> None:
        """A quarter of a period: time goes on, the vehicle too, and what is due is delivered."""
        self.elapsed_s = number * PERIOD_S / STEPS
        if self.clock:
            now = Time(nanoseconds=START_NS + round(self.elapsed_s * 1e9))
            self.clock.publish(Clock(clock=now.to_msg()))
        if number % STEPS == 0:
            self.vehicle.advance()
            if self.unanswered is not None:
                self.unanswered += 1
            if self.passes():
                jitter_s = self.random.uniform(-1.0, 1.0) * self.line['jitter_s']
                due_s = self.elapsed_s + PERIOD_S / 2 + jitter_s
                self.under_way.append((due_s, self.read()))
        for due_s, state in list(self.under_way):
            if due_s <= self.elapsed_s:
                self.under_way.remove((due_s, state))
                self.publish(*state)


def wait(executor: SingleThreadedExecutor, node: BadLine, due_s: float) -> None:
    """Take commands until a time of the wall clock, or longer if the nodes do not keep up."""
    executor.spin_once(timeout_sec=0.0)
    while (wait_s := due_s - time.monotonic()) > 0.0:
        executor.spin_once(timeout_sec=wait_s)
    while node.runs_away() and time.monotonic() - due_s < PATIENCE_S:
        executor.spin_once(timeout_sec=0.01)


def main() -> None:
    """Keep the time of the vehicle until it is over."""
    rclpy.init()
    node = BadLine()
    executor = SingleThreadedExecutor()
    executor.add_node(node)
    step_s = PERIOD_S / STEPS / node.line['speed']
    try:
        while node.odom.get_subscription_count() < node.line['listeners']:
            executor.spin_once(timeout_sec=0.1)
        number, due_s = 0, time.monotonic()
        while not 0.0 < node.line['duration_s'] <= node.elapsed_s:
            node.step(number)
            number += 1
            due_s += step_s
            wait(executor, node, due_s)
            due_s = max(due_s, time.monotonic() - step_s)
    except (KeyboardInterrupt, ExternalShutdownException):
        pass


if __name__ == '__main__':
    main()
