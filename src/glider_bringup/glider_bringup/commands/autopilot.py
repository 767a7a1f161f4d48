# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""``./glider autopilot``: what goes on board a vehicle."""

import re
import tempfile
from pathlib import Path
from typing import Annotated

import typer

from glider_base.ros.places import NAMESPACE_ALLOWED, absolute_namespace
from glider_base.settings import ConfigurationError
from glider_bringup.console import Changes, Law, Named, changed_fields, messages
from glider_mission.choices import chosen_fields
from glider_mission.planned import refuse_planned_route
from glider_mission.scenario import load_scenario

app = typer.Typer()


@app.command(
    context_settings={'allow_extra_args': True, 'ignore_unknown_options': True},
    epilog='Example: ./glider autopilot yours.yaml --ros-args -p use_sim_time:=true',
)
def autopilot(
    called: typer.Context,
    scenario: Named,
    controller: Law = None,
    navigation: Annotated[
        bool | None,
        typer.Option(
            '--navigation/--no-navigation',
            help='Whether odom is made here, or published by the vehicle. Default: made here if '
            'the navigation method of the scenario is not known.',
        ),
    ] = None,
    namespace: Annotated[str, typer.Option(help='Namespace of nodes and topics.')] = '/glider',
    changes: Changes = None,
    show: Annotated[
        bool,
        typer.Option(
            '--print-parameters',
            help='Print the parameter file of the nodes, for ros2 run ... --params-file, and end.',
        ),
    ] = False,
) -> None:
    """Navigation, guidance, control and guard in one process, free-running, beside a vehicle.

    They follow the scenario, at ten cycles a second by the computer's clock, with what the vehicle
    publishes; docs/your_vehicle.md says what that is. No plant, no current and no recorder are
    started. Words from --ros-args on go to the nodes. Ctrl-C ends it; it prints no JSON.
    """
    from glider_bringup.engines.node_parameters import node_parameters, write_parameters
    from glider_bringup.nodes.autopilot import PARTS, main

    place = absolute_namespace(namespace)
    if place is None:
        raise ConfigurationError(
            f'--namespace {namespace}: not usable (allowed: {NAMESPACE_ALLOWED})'
        )
    for word in called.args[:1]:
        if word != '--ros-args':
            raise ConfigurationError(f'{word}: unknown (allowed: --ros-args and what follows it)')
    for word in called.args:
        if '__ns:=' in word:  # rcl goes by the first one that it is given
            raise ConfigurationError(f'{word}: not here (allowed: --namespace)')
        if '__node:=' in word or '__name:=' in word:  # they would have no parameters
            raise ConfigurationError(f'{word}: not here (allowed: the nodes by their names)')
    flown = load_scenario(scenario, chosen_fields(changed_fields(changes), controller))
    refuse_planned_route(flown)
    reckons = 'measured_odom' not in flown.navigation.topics if navigation is None else navigation
    parts = [name for name in PARTS if name != 'navigation' or reckons]
    nodes = [f'{name}_node' for name in parts]
    for word in called.args:  # rcl passes over what is of a node that there is not
        whose = re.match(r'([\w/]+):(?!=|//).*:=', word)
        if whose and whose[1].rpartition('/')[2] not in nodes:
            raise ConfigurationError(f'{word}: no such node (allowed: {", ".join(nodes)})')
    parameters = node_parameters(flown, lockstep=False, navigates=reckons)
    with tempfile.TemporaryDirectory() as scratch:
        file = Path(scratch) / 'parameters.yaml'
        write_parameters(parameters, file, place)
        if show:
            print(file.read_text(encoding='utf-8'), end='')
            return
        messages.print(f'{flown.name}: {", ".join(parts)} in {place}', soft_wrap=True)
        words = ['autopilot', *parts, '--ros-args', '-r', f'__ns:={place}', '--params-file']
        raise typer.Exit(main([*words, str(file), *called.args]))
