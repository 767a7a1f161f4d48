# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""``ros2 launch glider_bringup glider.launch.py scenario:=current_8deg``."""

import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import launch.logging
from launch import LaunchContext, LaunchDescription
from launch.actions import DeclareLaunchArgument, LogInfo, OpaqueFunction, Shutdown
from launch.events.process import ProcessExited
from launch.substitutions import LaunchConfiguration
from launch_ros.actions import LifecycleNode, LifecycleTransition, Node
from lifecycle_msgs.msg import Transition

from glider_bringup.engines.launch_plan import (
    ARGUMENTS,
    TF,
    LaunchedNode,
    LaunchPlan,
    check_names,
    plan_launch,
)
from glider_bringup.engines.processes import PLANT

#: Where a launch keeps the namespaces whose plants have not ended.
_FLYING = 'gliders_flying'


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
    if Path(__file__).name in (Path(word).name for word in sys.argv):  # else another includes it
        check_names(context.argv)
    values = {
        argument.name: LaunchConfiguration(argument.name).perform(context)
        for argument in ARGUMENTS
    }
    plan = plan_launch(values, Path(launch.logging.launch_config.log_dir))
    if PLANT in (node.executable for node in plan.nodes):
        context.extend_globals({_FLYING: flying(context) | {plan.namespace}})
    said = f'{plan.scenario.name}: {plan.scenario.description} ({plan.parameters_file})'
    actions = [LogInfo(msg=said), *(node_action(node, plan) for node in plan.nodes)]
    if plan.managed:
        steps = [Transition.TRANSITION_CONFIGURE, Transition.TRANSITION_ACTIVATE]
        actions.append(
            LifecycleTransition(lifecycle_node_names=plan.managed_names, transition_ids=steps)
        )
    return actions


def flying(context: LaunchContext) -> set[str]:
    """Namespaces of the gliders of this launch whose plants have not ended."""
    return context.get_locals_as_dict().get(_FLYING, set())


def node_action(node: LaunchedNode, plan: LaunchPlan) -> Node:
    """Process of a node."""
    name = {'name': node.executable} if node.executable in plan.managed else {}
    return (LifecycleNode if name else Node)(
        **name,
        package=node.package,
        executable=node.executable,
        arguments=node.words,
        namespace=plan.namespace,
        remappings=plan.remappings,
        parameters=[plan.parameters_file],
        additional_env=plan.environment,
        output='screen',
        on_exit=on_exit(node.executable, plan),
    )


def on_exit(name: str, plan: LaunchPlan) -> Callable[[ProcessExited, LaunchContext], Any]:
    """What the end of a node means.

    The last plant ends the launch, be it that somebody sent it away. In lockstep nobody can go on
    without a peer that failed; free-running nodes can, and nobody needs the node for transforms.
    """

    def end(event: ProcessExited, context: LaunchContext) -> Shutdown | None:
        if context.is_shutdown:
            return None
        if event.returncode and (name == PLANT or (plan.lockstep and name != TF)):
            # Only an exception gives `ros2 launch` an exit code, 1; a Shutdown would be a success.
            raise RuntimeError(f'{name} ended with exit code {event.returncode}; the run is over')
        if name != PLANT:
            return None
        context.extend_globals({_FLYING: flying(context) - {plan.namespace}})
        return None if flying(context) else Shutdown(reason='the plant has ended')

    return end
