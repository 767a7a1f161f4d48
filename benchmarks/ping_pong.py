# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""One process of a ring of bare rclpy nodes that hand an Odometry round: baseline of the nodes.

    python benchmarks/ping_pong.py PLACE RING TICKS

Place 0 starts each round when the one before has come back, and prints rounds per second.
"""

import sys
import time

import rclpy
from nav_msgs.msg import Odometry
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node

_WARM_UP = 500


class Place(Node):
    """Hands on what comes, under the stamp of the next round if it is place 0."""

    def __init__(self, place: int, ring: int, ticks: int) -> None:
        super().__init__(f'place_{place}')
        self.is_first, self.ticks = place == 0, ticks
        self.round, self.start_s, self.is_over = -1, 0.0, False
        self.publisher = self.create_publisher(Odometry, f'hop_{(place + 1) % ring}', 10)
        self.create_subscription(Odometry, f'hop_{place}', self.on_message, 10)
        self.ring = ring
        if self.is_first:
            self.starter = self.create_timer(0.05, self.on_timer)

    def on_timer(self) -> None:
        """Start the first round once all places are connected."""
        hops = [f'hop_{place}' for place in range(self.ring)]
        connected = all(self.count_publishers(hop) == self.count_subscribers(hop) for hop in hops)
        if connected and self.publisher.get_subscription_count() == 1:
            self.destroy_timer(self.starter)
            message = Odometry(child_frame_id='base_link')
            message.header.frame_id = 'map'
            self.on_message(message)

    def on_message(self, message: Odometry) -> None:
        """Publish at once."""
        if self.is_first:
            self.round += 1
            message.header.stamp.sec, tenths = divmod(self.round, 10)
            message.header.stamp.nanosec = tenths * 100_000_000
            if self.round == _WARM_UP:
                self.start_s = time.perf_counter()
            elif self.round == _WARM_UP + self.ticks:
                print(self.ticks / (time.perf_counter() - self.start_s), flush=True)
                self.is_over = True
                return
        self.publisher.publish(message)


def main() -> None:
    """Spin until the rounds are over; the other places are stopped from outside."""
    rclpy.init()
    node = Place(*map(int, sys.argv[1:4]))
    executor = SingleThreadedExecutor()
    executor.add_node(node)
    while not node.is_over:
        executor.spin_once()


if __name__ == '__main__':
    main()
