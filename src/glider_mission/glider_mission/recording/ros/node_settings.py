# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""The settings of the nodes of a recorded run, from wherever they stand."""

from collections.abc import Mapping
from pathlib import Path
from typing import NamedTuple

from glider_base.files import read_yaml
from glider_base.ros.lockstep.node import TickSettings
from glider_base.ros.parameters import from_parameters
from glider_base.settings import ConfigurationError, Settings
from glider_mission.blocks import BLOCKS
from glider_mission.recording.mcap_reader import Bag
from glider_mission.run_folder import PARAMETERS_FILE, SCENARIO_FILE, find_scenario
from glider_mission.scenario import Scenario, load_scenario

#: After this time (s) an input is old, if nobody says another.
OLD_S = TickSettings().input_max_age_s


class NodeSettings(NamedTuple):
    """Settings of the nodes of a recorded run."""

    blocks: dict[str, Settings | None]  #: by name of the block; None: it is not known
    source: str  #: where it stands
    lockstep: bool | None = None  #: None: it does not say
    #: free-running: time (s) after which an input was old, by node; of all others under ``'**'``
    max_age_s: Mapping[str, float] = {}

    def old_s(self, node: str) -> float:
        """Time (s) after which an input of a node was old."""
        return self.max_age_s.get(node, self.max_age_s.get('**', OLD_S))

    @property
    def steers_by(self) -> str:
        """Name of the vehicle's steering surface; empty without, or if nobody knows."""
        known = (block for block in BLOCKS if self.blocks[block.wired.name] is not None)
        names = (block.steers_by(self.blocks[block.wired.name]) for block in known)
        return next(filter(None, names), '')


def read_settings(bag: Bag, path: Path, file: Path | None, scratch: Path) -> NodeSettings:
    """Settings of the blocks of a recorded run, whose bag was found at ``path``.

    A scenario.yaml that lies there counts, else the one attached; instead of both a scenario or
    parameter ``file``. Attached files go to ``scratch``, which has to stay as long as the settings
    are used. Raises ConfigurationError if there are none, or they cannot be used.
    """
    folder = path if path.is_dir() else path.parent
    parameters = folder / PARAMETERS_FILE
    how = _how(read_yaml(parameters)) if parameters.is_file() else ()
    if file is not None:
        values = read_yaml(file)
        if _sections(values):
            return _from_parameters(values, str(file))
        return NodeSettings(
            _from_scenario(load_scenario(str(file), recorded=True)), str(file), *how
        )
    found = find_scenario(bag.files[0], folder, bag.attachments, scratch)
    if found is not None:
        return NodeSettings(_from_scenario(found.scenario), found.source, *how)
    if parameters.is_file():
        return _from_parameters(read_yaml(parameters), str(parameters))
    raise ConfigurationError(
        f'{path}: it does not say what the nodes were told, neither {SCENARIO_FILE} nor '
        f'{PARAMETERS_FILE} is in it or attached: put one there, or give --settings FILE to verify'
    )


def _from_scenario(scenario: Scenario) -> dict[str, Settings | None]:
    settings = zip(BLOCKS, scenario.block_settings(), strict=True)
    return {block.wired.name: one for block, one in settings}


def _sections(values: dict) -> dict[str, dict]:
    """Parameters by node name; those under a wildcard under ``'**'``."""
    return {
        str(key).rstrip('/').rpartition('/')[2]: section['ros__parameters']
        for key, section in values.items()
        if isinstance(section, dict) and isinstance(section.get('ros__parameters'), dict)
    }


def _how(values: dict) -> tuple[bool | None, dict[str, float]]:
    """How the nodes of a parameter file act: whether in step, and when an input is old (s)."""
    sections = _sections(values)

    def of_all(name: str, kind: type) -> dict:
        given = ((node, section.get(name)) for node, section in sections.items())
        return {node: one for node, one in given if isinstance(one, kind)}

    in_step = of_all('lockstep', bool).values()
    return all(in_step) if in_step else None, of_all('input_max_age_s', float)


def _from_parameters(values: dict, source: str) -> NodeSettings:
    sections = _sections(values)
    found: dict[str, Settings | None] = {}
    for block in BLOCKS:
        node = block.wired.node
        given = {**sections.get('**', {}), **sections.get(node, {})}
        known = node in sections or '**' in sections
        settings = from_parameters(block.settings, given, f'{source}: {node}') if known else None
        found[block.wired.name] = settings
    return NodeSettings(found, source, *_how(values))
