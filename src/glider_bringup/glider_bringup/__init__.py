# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""Flying it: scenarios, engines, recorder, scores and the command line.

What ``__all__`` names is for programs of your own; docs/python.md shows it. It is loaded when it
is first asked for, so that ``import glider_bringup as glider`` takes no time.
"""

from importlib import import_module
from importlib.metadata import EntryPoint
from typing import Any

#: Public names, and the module of each.
_PUBLIC = {
    'ConfigurationError': 'glider_base.settings',
    'Flight': 'glider_bringup.door.flight',
    'Run': 'glider_bringup.door.run',
    'Scenario': 'glider_mission.scenario',
    'fly': 'glider_bringup.door.run',
    'load_scenario': 'glider_mission.scenario',
    'open_run': 'glider_bringup.door.run',
    'scenarios': 'glider_bringup.door.shipped',
    'trim': 'glider_bringup.door.shipped',
    'vehicles': 'glider_bringup.door.shipped',
}
__all__ = list(_PUBLIC)


def _added() -> dict[str, EntryPoint]:
    """What packages on top bring, by name: entry points in the group ``glider.python``."""
    from glider_base.plugins import offered

    return offered('glider.python')


def __getattr__(name: str) -> Any:
    if name in _PUBLIC:
        found = getattr(import_module(_PUBLIC[name]), name)
    elif not name.startswith('_') and name in (added := _added()):
        found = added[name].load()
    else:
        raise AttributeError(f'module {__name__!r} has no attribute {name!r}')
    globals()[name] = found
    return found


def __dir__() -> list[str]:
    return sorted({*__all__, *_added()})
