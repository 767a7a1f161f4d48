# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""One bare rclpy node among COUNT of them, each publishing and hearing one common topic.

    python benchmarks/participant.py NUMBER COUNT TIMEOUT_S

It says ``ready`` once everything is imported, starts at a line on standard input, and prints when
it knew all the others, what that cost and how many it knows; it leaves at the next line.
"""

import json
import sys
import time

import rclpy
from nav_msgs.msg import Odometry
from rclpy.node import Node

_LOOK_S = 0.1


def main() -> None:
    """Meet the others."""
    number, count, timeout_s = sys.argv[1], int(sys.argv[2]), float(sys.argv[3])
    print('ready', flush=True)
    sys.stdin.readline()
    start_cpu_s, deadline_s = time.process_time(), time.monotonic() + timeout_s
    rclpy.init()
    node = Node(f'participant_{number}')
    publisher = node.create_publisher(Odometry, 'fleet', 10)
    subscription = node.create_subscription(Odometry, 'fleet', lambda message: None, 10)
    met = 0
    while met < count and time.monotonic() < deadline_s:
        time.sleep(_LOOK_S)
        met = min(
            publisher.get_subscription_count(),
            subscription.get_publisher_count(),
            len(node.get_node_names()),
        )
    with open('/proc/self/status', encoding='utf-8') as file:
        rss_kb = next(int(line.split()[1]) for line in file if line.startswith('VmRSS'))
    figures = {
        'met': met,
        'at_s': time.monotonic(),
        'cpu_s': time.process_time() - start_cpu_s,
        'rss_mb': rss_kb / 1024.0,
    }
    print(json.dumps(figures), flush=True)
    sys.stdin.readline()
    rclpy.shutdown()


if __name__ == '__main__':
    main()
