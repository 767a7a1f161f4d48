# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""Flying it: scenarios, engines, recorder, scores and the command line.

What ``__all__`` names is for programs of your own; docs/python.md shows it. It is loaded when it
is first asked for, so that ``import glider_bringup as glider`` takes no time.
"""

from importlib import import_module
from importlib.metadata import EntryPoints, entry_points
from typing import Any

#: Public names: the module of each, and its name there.
_PUBLIC = {
    'ConfigurationError': ('glider_base.settings', 'ConfigurationError'),
    'Flight': ('glider_bringup.door.flight', 'Flight'),
    'Run': ('glider_bringup.door.run', 'Run'),
    'Scenario': ('glider_mission.scenario', 'Scenario'),
    'fly': ('glider_bringup.door.run', 'fly'),
    'load_scenario': ('glider_mission.scenario', 'load_scenario'),
    'open_run': ('glider_bringup.door.run', 'open_run'),
    'scenarios': ('glider_bringup.door.shipped', 'scenarios'),
    'trim': ('glider_bringup.door.shipped', 'trim'),
    'vehicles': ('glider_bringup.door.shipped', 'vehicles'),
}
__all__ = list(_PUBLIC)


def _added() -> EntryPoints:
    """What packages on top bring: entry points in the group ``glider.python``."""
    return entry_points(group='glider.python')


def __getattr__(name: str) -> Any:
    if name in _PUBLIC:
        module, public = _PUBLIC[name]
        found = getattr(import_module(module), public)
    elif not name.startswith('_') and name in _added().names:
        found = _added()[name].load()
    else:
        raise AttributeError(f'module {__name__!r} has no attribute {name!r}')
    globals()[name] = found
    return found


def __dir__() -> list[str]:
    return sorted({*__all__, *_added().names})
