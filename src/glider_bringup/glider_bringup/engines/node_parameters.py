# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""From a scenario to the one parameter file that is handed to all nodes."""

import json
from collections import defaultdict
from collections.abc import Iterable
from pathlib import Path

from glider_base.ros.message_fault import MessageFault
from glider_base.ros.parameters import parameters_yaml, to_parameters
from glider_base.ros.wire import topics
from glider_base.wiring import GUARD, publisher
from glider_mission.blocks import BLOCKS
from glider_mission.disk import write_whole
from glider_mission.scenario import Scenario


def node_parameters(
    scenario: Scenario,
    *,
    speed: float = 0.0,
    lockstep: bool = True,
    navigates: bool = True,
    record_to: Path | None = None,
    attachments: Iterable[Path] = (),
    sync: str = 'end',
) -> dict[str, dict]:
    """Nested parameters of every node, by node name.

    The speed is times real time, 0.0 as fast as possible. If no node ``navigates``, nobody
    publishes what it alone reads. Without a folder to record to, a recorder is started by hand, if
    any; of ``attachments`` and ``sync`` see `recorder_node.RecorderSettings`.
    """
    common = {'lockstep': lockstep, 'record': record_to is not None}
    nodes = {
        block.wired.node: to_parameters(settings)
        for block, settings in zip(BLOCKS, scenario.block_settings(), strict=True)
    }
    nodes[topics.PLANT]['speed'] = speed
    if not navigates and 'pressure' not in scenario.sensors.also_fitted:
        nodes[GUARD.node]['pressure'] = False
    faults = defaultdict(list)
    for one in scenario.message_faults:
        own = one.model_dump(include=set(MessageFault.model_fields))
        faults[publisher(one.topic).node].append(own)
    for name, own in faults.items():
        nodes[name] |= {'message_faults': json.dumps(own), 'message_seed': scenario.seed}
    nodes[topics.RECORDER] = {'name': scenario.name, 'topics': json.dumps(scenario.topics)}
    if record_to is not None:
        nodes[topics.RECORDER] |= {
            'folder': str(record_to.resolve()),
            'attachments': json.dumps([str(path.resolve()) for path in attachments]),
            'progress': True,
            'sync': sync,
        }
    return {name: {**parameters, **common} for name, parameters in nodes.items()}


def write_parameters(nodes: dict[str, dict], file: Path, namespace: str = '/glider') -> None:
    """Write the parameter file for ``--params-file``."""
    write_whole(file, parameters_yaml(nodes, namespace))
