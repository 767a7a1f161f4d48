# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""``ros2 launch glider_bringup glider.launch.py scenario:=current_8deg``."""

from pathlib import Path

import launch.logging
from launch import LaunchContext, LaunchDescription
from launch.actions import DeclareLaunchArgument, LogInfo, OpaqueFunction, Shutdown
from launch.events.process import ProcessExited
from launch.substitutions import LaunchConfiguration
from launch_ros.actions import Node

from glider_bringup.launching import ARGUMENTS, LaunchedNode, LaunchPlan, plan_launch
from glider_bringup.runner import PLANT


def generate_launch_description() -> LaunchDescription:
    """Arguments, and a function that starts the nodes once their values are known."""
    declarations = [
        DeclareLaunchArgument(
            argument.name,
            default_value=argument.default,
            description=argument.description,
            choices=argument.choices,
        )
        for argument in ARGUMENTS
    ]
    return LaunchDescription([*declarations, OpaqueFunction(function=start)])


def start(context: LaunchContext) -> list:
    """Nodes for the values that the arguments have."""
    values = {
        argument.name: LaunchConfiguration(argument.name).perform(context)
        for argument in ARGUMENTS
    }
    plan = plan_launch(values, Path(launch.logging.launch_config.log_dir))
    said = f'{plan.scenario.name}: {plan.scenario.description} ({plan.parameters_file})'
    return [LogInfo(msg=said), *(node_action(node, plan) for node in plan.nodes)]


def node_action(node: LaunchedNode, plan: LaunchPlan) -> Node:
    """Process of a node, and what its end means.

    The plant ends the run, and says why. In lockstep nobody can go on without a peer that failed;
    free-running nodes can.
    """

    def end_with_failure(event: ProcessExited, context: LaunchContext) -> Shutdown | None:
        return Shutdown() if plan.lockstep and event.returncode else None

    return Node(
        package=node.package,
        executable=node.executable,
        namespace=plan.namespace,
        parameters=[plan.parameters_file],
        output='screen',
        on_exit=Shutdown() if node.executable == PLANT else end_with_failure,
    )
