# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""What ``ros2 launch`` starts: arguments as text in; parameter file and nodes out.

The launch file itself only turns this into launch actions, so that everything here can be used and
tested where the launch system is not installed.
"""

from pathlib import Path
from typing import NamedTuple

from glider_bringup.mission import PARAMETERS_FILE, SCENARIO_FILE, VEHICLE_FILE, make_run_folder
from glider_bringup.ros.node_parameters import node_parameters, write_parameters
from glider_bringup.runner import (
    MODULES,
    NAMESPACE_ALLOWED,
    OWN_CLOCK,
    RECORDER,
    absolute_namespace,
)
from glider_bringup.scenario import DEFAULT_SCENARIO, Scenario, load_scenario
from glider_model.settings import ConfigurationError
from glider_model.signals import TICK_S

_TRUTH = {'true': True, 'false': False}


class Argument(NamedTuple):
    """An argument of the launch file."""

    name: str
    default: str
    description: str
    choices: tuple[str, ...] | None = None


ARGUMENTS = (
    Argument(
        'scenario', DEFAULT_SCENARIO, 'Scenario by name (./glider list) or path of its YAML file.'
    ),
    Argument('controller', '', "Attitude law; empty: the scenario's.", ('', 'adaptive', 'pid')),
    Argument('guidance', '', "Line of sight; empty: the scenario's.", ('', 'observer', 'paper')),
    Argument('namespace', 'glider', 'Namespace of the nodes and their topics.'),
    Argument(
        'clock',
        '/clock',
        'clock: in the namespace, so that several gliders can share a ROS domain.',
        OWN_CLOCK,
    ),
    Argument('record', '', 'New folder for the recording; empty: no recording.'),
    Argument('speed', '1.0', 'Times real time, or max. Free-running nodes keep real time: 1.0.'),
    Argument(
        'lockstep',
        'true',
        'true: tick by tick, the same result every time; false: free-running at 10 Hz.',
        tuple(_TRUTH),
    ),
    Argument(
        'duration',
        '',
        "Simulated seconds, or full: the scenario's duration; empty: the scenario's dives.",
    ),
)


class LaunchedNode(NamedTuple):
    """A node to start."""

    package: str
    executable: str


class LaunchPlan(NamedTuple):
    """What is to be started."""

    scenario: Scenario
    parameters_file: Path  #: one file for all nodes
    namespace: str  #: absolute
    remappings: tuple[tuple[str, str], ...]
    lockstep: bool
    nodes: tuple[LaunchedNode, ...]


def plan_launch(arguments: dict[str, str], log_folder: Path) -> LaunchPlan:
    """Check the arguments, and write the parameter file that all nodes are handed.

    Parameters
    ----------
    arguments : dict of str
        Text by name of the argument; what is not given takes its default.
    log_folder : Path
        Where the parameter file goes if there is no recording. With one it lies in its folder,
        beside scenario and vehicle.

    Returns
    -------
    LaunchPlan

    Raises
    ------
    ConfigurationError
        Naming the argument, or the file and field, its value and what is allowed.
    """
    text = {argument.name: argument.default for argument in ARGUMENTS} | arguments
    for argument in ARGUMENTS:
        if argument.choices and text[argument.name] not in argument.choices:
            _refuse(argument.name, text, ', '.join(filter(None, argument.choices)))
    lockstep = _TRUTH[text['lockstep']]
    speed = 0.0 if text['speed'] == 'max' else _number('speed', text, 0.01, 1e6, 'max')
    if not lockstep and speed != 1.0:
        _refuse('speed', text, '1.0 with lockstep:=false')
    namespace = absolute_namespace(text['namespace'])
    if namespace is None:
        _refuse('namespace', text, NAMESPACE_ALLOWED)
    scenario = load_scenario(text['scenario'], _changes(text))
    record_to = None
    if text['record']:
        record_to = make_run_folder(scenario, Path(text['record']).expanduser())
    folder = record_to or log_folder
    attached = (folder / SCENARIO_FILE, folder / VEHICLE_FILE) if record_to else ()
    parameters = node_parameters(
        scenario, speed=speed, lockstep=lockstep, record_to=record_to, attachments=attached
    )
    if record_to:
        parameters[RECORDER]['progress'] = False
    write_parameters(parameters, folder / PARAMETERS_FILE, namespace)
    nodes = tuple(
        LaunchedNode(module.partition('.')[0], name)
        for name, module in MODULES.items()
        if name in parameters
    )
    remappings = (OWN_CLOCK,) if text['clock'] == OWN_CLOCK[1] else ()
    return LaunchPlan(scenario, folder / PARAMETERS_FILE, namespace, remappings, lockstep, nodes)


def _changes(text: dict[str, str]) -> dict:
    """Scenario fields that the arguments change."""
    fields = {}
    if text['controller']:
        fields['control.law'] = text['controller']
    if text['guidance']:
        fields['guidance.los.method'] = text['guidance']
    if text['duration']:
        fields['dives'] = 0
        if text['duration'] != 'full':
            fields['duration_s'] = _number('duration', text, TICK_S, 1e8, 'full')
    return fields


def _number(name: str, text: dict[str, str], low: float, high: float, word: str) -> float:
    try:
        number = float(text[name])
    except ValueError:
        number = float('nan')
    if not low <= number <= high:
        _refuse(name, text, f'{low:g} to {high:g}, or {word}')
    return number


def _refuse(name: str, text: dict[str, str], allowed: str) -> None:
    raise ConfigurationError(f'{name}:={text[name]}: not usable (allowed: {allowed})')
