# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""Navigation, guidance, control and guard as four nodes in one process, for a computer on board.

``autopilot guidance control guard`` leaves navigation out, for a vehicle that publishes odom
itself. Names, topics and parameters are those of the nodes: a parameter file serves as it serves
them, and ``-p control_node:law:=pid`` sets the parameter of one.
"""

import sys

from rclpy.utilities import remove_ros_args

from glider_base.errors import EXIT_USAGE, say_fatal
from glider_base.ros.lockstep.process import run_together
from glider_control.nodes.control_node import ControlNode
from glider_guard.nodes.guard_node import GuardNode
from glider_guidance.nodes.guidance_node import GuidanceNode
from glider_navigation.nodes.navigation_node import NavigationNode

#: Nodes by the names of their blocks, in the order in which they act in a tick.
PARTS = {
    'navigation': NavigationNode,
    'guidance': GuidanceNode,
    'control': ControlNode,
    'guard': GuardNode,
}


def main(args=None) -> int:
    """Run the nodes that the words of the command line name, or all; returns the exit code."""
    try:
        words = remove_ros_args(args)[1:]
    except Exception as error:  # rclpy has several, and names none of them
        say_fatal(f'bad command line: {error}')
        return EXIT_USAGE
    for word in words:
        if word not in PARTS:
            say_fatal(f'autopilot: {word}: no such part (allowed: {", ".join(PARTS)})')
            return EXIT_USAGE
    return run_together([PARTS[name] for name in PARTS if name in (words or PARTS)], args)


if __name__ == '__main__':
    sys.exit(main())
