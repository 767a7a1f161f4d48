# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""A vehicle that is not there, on a bad line: try the nodes on board against it.

It navigates itself, or, with navigates:=false, publishes what its sensors take: attitude every
4 s without rates, pressure every second, and a fix every second at the surface alone. Where it
really is, is on ground_truth/odom.

It keeps its own time, which begins at 1000 s. What it sends arrives up to 50 ms early or late,
one message in twenty never, and for three seconds nothing goes either way. With a speed of more
than 1 it publishes its time on /clock, for nodes with use_sim_time, and does not run away from
them: they command once in a period, and it waits for that.

    python examples/stand_in.py --ros-args -r __ns:=/glider -p speed:=1.0
"""

import random
import time

import rclpy
from driver import JOINTS, KEPT, PERIOD_S, Driver
from nav_msgs.msg import Odometry
from rclpy.executors import ExternalShutdownException, SingleThreadedExecutor
from rclpy.time import Time
from rosgraph_msgs.msg import Clock

from glider_base.signals import Joints, Water
from glider_base.wiring import PLANT, SENSORS
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
    'imu_period_s': 4.0,
    'listeners': 5,  # subscriptions that it waits for; with navigates:=false there are 7
    'seed': 1,
}
GLIDING = {'heading_deg': 30.0, 'pitch_deg': -30.0, 'speed_mps': 0.5, 'net_heaviness_kg': 0.4}
#: Time between two samples of pressure, and between two fixes (s).
SAMPLE_S = 1.0
START_NS = 1000 * 10**9
#: The line is looked at this often in a period.
STEPS = 4
#: Periods that time may be ahead of the commands, and how long it waits for one (s).
AHEAD, PATIENCE_S = 1, 2.0


class StandIn:
    """A glider in a uniform current, integrated at its own 10 Hz."""

    def __init__(self) -> None:
        self._time_ns = START_NS
        self.place(0.0, 0.0, PERIOD_S)

    def place(self, depth_m: float, current_mps: float, imu_period_s: float) -> None:
        """Put it somewhere."""
        self._imu_period_s = imu_period_s
        settings = PlantSettings(initial={**GLIDING, 'depth_m': depth_m}, fitted=SENSORS)
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
        truth = self._says('ground_truth/odom')
        return truth[:3], truth[3:7], truth[7:10], truth[10:]

    def attitude(self) -> tuple[tuple, None] | None:
        """Orientation, now and then; there is no gyro."""
        return (self._says('imu')[:4], None) if self._is_due(self._imu_period_s) else None

    def pressure(self) -> float | None:
        """Absolute pressure, now and then."""
        return self._says('pressure')[0] if self._is_due(SAMPLE_S) else None

    def fix(self) -> tuple[float, float, float] | None:
        """Where it is, at the surface."""
        status, latitude, longitude, variance, _ = self._says('fix')
        if status < 0.0 or not self._is_due(SAMPLE_S):
            return None
        return latitude, longitude, variance**0.5

    def _says(self, topic: str) -> tuple[float, ...]:
        """What a topic of the plant would say."""
        outputs, _ = plant_outputs(self._state, self._params)
        return outputs[PLANT.outputs.index(topic) - 1]  # the first is the clock

    def _is_due(self, period_s: float) -> bool:
        """Whether something that is done once in a period is due."""
        return round((self._time_ns - START_NS) / 1e9 / PERIOD_S) % round(period_s / PERIOD_S) == 0

    def actuators(self) -> list[float]:
        """Positions of the actuators."""
        return list(self._state.joints[: len(JOINTS)])

    def move(self, targets: dict[str, float]) -> None:
        """Move actuators towards their targets."""
        self._target = Joints(*(targets[joint] for joint in JOINTS), 0.0)


class BadLine(Driver):
    """A driver whose messages come early, late or never."""

    def __init__(self) -> None:
        super().__init__(StandIn(), 'stand_in')
        given = {
            name: self.declare_parameter(name, value).value for name, value in PARAMETERS.items()
        }
        self.vehicle.place(given['depth_m'], given['current_mps'], given['imu_period_s'])
        self.line, self.random = given, random.Random(given['seed'])
        self.clock = self.create_publisher(Clock, '/clock', 10) if given['speed'] > 1.0 else None
        self.truth = self.create_publisher(Odometry, 'ground_truth/odom', KEPT)
        self.under_way: list[tuple[float, dict]] = []
        self.elapsed_s = 0.0
        self.unanswered = None  # periods without a command, once there has been one

    def listeners(self) -> int:
        """Subscriptions of all that it publishes."""
        return sum(publisher.get_subscription_count() for publisher in self.out.values())

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
            now = Time(nanoseconds=self.vehicle.time_ns())
            self.truth.publish(self.odometry(now.to_msg())['odom'])
            if self.unanswered is not None:
                self.unanswered += 1
            if self.passes():
                jitter_s = self.random.uniform(-1.0, 1.0) * self.line['jitter_s']
                due_s = self.elapsed_s + PERIOD_S / 2 + jitter_s
                self.under_way.append((due_s, self.read()))
        for due_s, state in list(self.under_way):
            if due_s <= self.elapsed_s:
                self.under_way.remove((due_s, state))
                self.publish(state)


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
        while node.listeners() < node.line['listeners']:
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
