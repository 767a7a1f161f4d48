# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""What ``ros2 launch`` starts: arguments as text in; parameter file and nodes out.

The launch file itself only turns this into launch actions, so that everything here can be used and
tested where the launch system is not installed.
"""

import os
from collections.abc import Iterable
from importlib.util import find_spec
from pathlib import Path
from typing import NamedTuple

from glider_base.ros.places import NAMESPACE_ALLOWED, absolute_namespace
from glider_base.ros.wire.topics import CURRENT, NAVIGATION
from glider_base.settings import ConfigurationError
from glider_bringup.engines.node_parameters import node_parameters, write_parameters
from glider_bringup.engines.processes import (
    AUTOPILOT,
    LOCAL,
    ON_BOARD,
    OWN_CLOCK,
    PLANT,
    RANGE,
    RECORDER,
    process_modules,
)
from glider_control.settings import LAWS
from glider_guidance.settings import METHODS, OLD_NAMES
from glider_mission.choices import chosen_fields, number
from glider_mission.planned import refuse_planned_route
from glider_mission.run_folder import PARAMETERS_FILE, SCENARIO_FILE, VEHICLE_FILE, make_run_folder
from glider_mission.scenario import DEFAULT_SCENARIO, Scenario, load_scenario, scenario_names

#: The node that `ros2 launch` starts and `./glider run`, which nobody can watch, does not.
TF, TF_MODULE = 'tf_node', 'glider_model.nodes.tf_node'

_TRUTH = {'true': True, 'false': False}


class Argument(NamedTuple):
    """An argument of the launch file."""

    name: str
    default: str
    description: str
    choices: tuple[str, ...] | None = None


ARGUMENTS = (
    Argument(
        'scenario',
        DEFAULT_SCENARIO,
        f'Scenario: {", ".join(scenario_names())}; or path of a YAML file.',
    ),
    Argument('controller', '', "Attitude law; empty: the scenario's.", ('', *LAWS)),
    Argument('guidance', '', "Line of sight; empty: the scenario's.", ('', *METHODS, *OLD_NAMES)),
    Argument(
        'duration',
        '',
        "Simulated seconds, or full: the scenario's duration; empty: the scenario's dives.",
    ),
    Argument('namespace', 'glider', 'Namespace of the nodes and their topics.'),
    Argument(
        'clock',
        '/clock',
        'clock: in the namespace, so that several gliders can share a ROS domain.',
        OWN_CLOCK,
    ),
    Argument('record', '', 'New folder for the recording; empty: no recording.'),
    Argument(
        'speed', '1.0', 'Times real time (0.01 to 1e6), or max. With lockstep:=false only 1.0.'
    ),
    Argument(
        'lockstep',
        'true',
        'true: tick by tick, the same result every time; false: free-running at 10 Hz.',
        tuple(_TRUTH),
    ),
    Argument(
        'simulate',
        'true',
        'true: with plant and current; false: for a vehicle of yours. It publishes joint_states '
        'and odom, or what the navigation method of the scenario reads. Needs lockstep:=false.',
        tuple(_TRUTH),
    ),
    Argument(
        'navigation',
        'auto',
        'With simulate:=false. false: without navigation, the vehicle publishes odom itself; '
        'auto: without it if the navigation method of the scenario is one that knows the place.',
        ('auto', *_TRUTH),
    ),
    Argument(
        'autopilot',
        'false',
        'true: navigation, guidance, control and guard in one process, with the memory of one.',
        tuple(_TRUTH),
    ),
    Argument(
        'tf',
        'auto',
        'Publish odom as map -> base_link on /tf; auto: if tf2_msgs is installed.',
        ('auto', *_TRUTH),
    ),
    Argument(
        'frame_prefix', '', 'Put before base_link on /tf, such as one/, where gliders are several.'
    ),
)

#: What the launch system itself takes in the form of an argument.
_LAUNCH_OPTIONS = {'launch-prefix', 'launch-prefix-filter'}


class LaunchedNode(NamedTuple):
    """A node to start."""

    package: str
    executable: str
    words: tuple[str, ...] = ()  #: of its command line


class LaunchPlan(NamedTuple):
    """What is to be started."""

    scenario: Scenario
    parameters_file: Path  #: one file for all nodes
    namespace: str  #: absolute
    remappings: tuple[tuple[str, str], ...]
    lockstep: bool
    nodes: tuple[LaunchedNode, ...]
    managed: tuple[str, ...]  #: nodes that wait to be configured and activated

    @property
    def managed_names(self) -> list[str]:
        """Full names of the managed nodes."""
        return [f'{self.namespace.rstrip("/")}/{name}' for name in self.managed]

    @property
    def environment(self) -> dict[str, str]:
        """What nodes are given beside the environment: on this machine if nobody says else."""
        return {RANGE: os.environ.get(RANGE, LOCAL)}


def check_names(words: Iterable[str]) -> None:
    """Refuse ``name:=value`` words of a command line whose name is not that of an argument.

    The launch system would take them without a word. A ConfigurationError names it, and those that
    there are.
    """
    names = [argument.name for argument in ARGUMENTS]
    for word in words:
        name, sign, _ = word.partition(':=')
        if sign and name not in {*names, *_LAUNCH_OPTIONS}:
            raise ConfigurationError(f'{word}: no such argument (allowed: {", ".join(names)})')


def plan_launch(arguments: dict[str, str], log_folder: Path) -> LaunchPlan:
    """Check the arguments, and write the parameter file that all nodes are handed.

    ``arguments`` are texts by name; what is not given takes its default. The file goes beside
    scenario and vehicle of the recording; without one to ``log_folder``, in a folder called like
    the namespace. A ConfigurationError names the argument, or the file and field, its value and
    what is allowed.
    """
    text = {argument.name: argument.default for argument in ARGUMENTS} | arguments
    for argument in ARGUMENTS:
        if argument.choices and text[argument.name] not in argument.choices:
            _refuse(argument.name, text, ', '.join(filter(None, argument.choices)))
    lockstep = _TRUTH[text['lockstep']]
    speed = 0.0 if text['speed'] == 'max' else number('speed:=', text['speed'], 'max', 0.01, 1e6)
    if not lockstep and speed != 1.0:
        _refuse('speed', text, '1.0 with lockstep:=false, whose nodes act in wall time')
    simulate = _TRUTH[text['simulate']]
    if lockstep and not simulate:
        _refuse('lockstep', text, 'false with simulate:=false, a vehicle has its own clock')
    if simulate and text['navigation'] == 'false':
        _refuse('navigation', text, 'auto or true with simulate:=true, whose plant has no odom')
    with_tf = _TRUTH.get(text['tf'], find_spec('tf2_msgs') is not None)
    if with_tf and not find_spec('tf2_msgs'):
        _refuse('tf', text, 'false; tf2_msgs is not installed (Debian: ros-jazzy-tf2-msgs)')
    namespace = absolute_namespace(text['namespace'])
    if namespace is None:
        _refuse('namespace', text, NAMESPACE_ALLOWED)
    scenario = load_scenario(text['scenario'], _changes(text))
    refuse_planned_route(scenario)
    record_to = None
    if text['record']:
        record_to = make_run_folder(scenario, Path(text['record']).expanduser())
    folder = record_to or log_folder.joinpath(namespace[1:])  # a launch may start several gliders
    folder.mkdir(parents=True, exist_ok=True)
    attached = (folder / SCENARIO_FILE, folder / VEHICLE_FILE) if record_to else ()
    # a vehicle whose place is measured knows it, and publishes odom itself
    knows_place = not simulate and 'measured_odom' in scenario.navigation.topics
    with_navigation = _TRUTH.get(text['navigation'], not knows_place)
    parameters = node_parameters(
        scenario,
        speed=speed,
        lockstep=lockstep,
        navigates=with_navigation,
        record_to=record_to,
        attachments=attached,
    )
    if record_to:
        parameters[RECORDER]['progress'] = False
    nodes = _nodes(
        simulate, with_navigation, _TRUTH[text['autopilot']], record_to is not None, with_tf
    )
    started = [] if lockstep else [node.executable for node in nodes]
    managed = tuple(wired.node for wired in ON_BOARD if wired.node in started)
    for name in managed:
        parameters[name]['managed'] = True
    if with_tf:
        parameters[TF] = {'frame_prefix': text['frame_prefix']}
    write_parameters(parameters, folder / PARAMETERS_FILE, namespace)
    remappings = (OWN_CLOCK,) if text['clock'] == OWN_CLOCK[1] else ()
    return LaunchPlan(
        scenario=scenario,
        parameters_file=folder / PARAMETERS_FILE,
        namespace=namespace,
        remappings=remappings,
        lockstep=lockstep,
        nodes=nodes,
        managed=managed,
    )


def _nodes(
    simulate: bool, navigation: bool, autopilot: bool, record: bool, with_tf: bool
) -> tuple[LaunchedNode, ...]:
    modules, words = process_modules('autopilot' if autopilot else 'processes'), {}
    if not simulate:
        del modules[PLANT], modules[CURRENT]
    if not navigation and autopilot:
        words[AUTOPILOT] = tuple(wired.name for wired in ON_BOARD if wired.node != NAVIGATION)
    elif not navigation:
        del modules[NAVIGATION]
    if not record:
        del modules[RECORDER]
    if with_tf:
        modules[TF] = TF_MODULE
    return tuple(
        LaunchedNode(module.partition('.')[0], name, words.get(name, ()))
        for name, module in modules.items()
    )


def _changes(text: dict[str, str]) -> dict:
    """Scenario fields that the arguments change."""
    controller, guidance, duration = (
        text[name] or None for name in ('controller', 'guidance', 'duration')
    )
    return chosen_fields({}, controller, guidance, duration=duration, option='duration:=')


def _refuse(name: str, text: dict[str, str], allowed: str) -> None:
    raise ConfigurationError(f'{name}:={text[name]}: not usable (allowed: {allowed})')
