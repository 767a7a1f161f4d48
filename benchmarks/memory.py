# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""Memory of a direct run of 30 h, beside that of a Python that has only imported the stack.

And of what flies on board: navigation, guidance and control, in one process and in three.
"""

import subprocess
import sys
from collections.abc import Callable

from nodes import fly_once

from glider_bringup.engines.memory import memory_mb
from glider_bringup.engines.processes import AUTOPILOT, ON_BOARD, Layout

#: Simulated time (s) of the flights of what is on board.
FLIGHT_S = 120.0

MEANING = {
    'imported_rss_mb': 'resident memory with everything imported, the floor (MB)',
    'mission_30h_peak_rss_mb': 'most resident memory of a direct run of 30 h with its score (MB)',
    'mission_30h_rss_over_imported': 'ratio of the two',
    'autopilot_peak_rss_mb': 'most resident memory of the autopilot, in flight over topics (MB)',
    'separate_nodes_peak_rss_mb': 'the same of its nodes, each in its own process, summed (MB)',
}

_IMPORT = 'from glider_bringup.scoring.card import fly_scored\n'
_FLY = """
from glider_mission.scenario import load_scenario
from glider_bringup.scoring.card import fly_scored

fly_scored(load_scenario('current_8deg', {'dives': 0, 'duration_s': 108000.0}))
"""
#: VmHWM, and not ru_maxrss: a child starts with the largest that its parent ever was.
_PEAK = """
for line in open('/proc/self/status'):
    if line.startswith('VmHWM'):
        print(line.split()[1])
"""


def measure(progress: Callable[[str], None]) -> dict:
    """Peak memory of processes of their own."""
    progress('imports')
    imported = _peak_mb(_IMPORT)
    progress('30 h by the direct engine')
    flown = _peak_mb(_FLY)
    progress('autopilot over topics')
    autopilot = _on_board_mb('autopilot')
    progress('its nodes over topics')
    separate = _on_board_mb('processes')
    return {
        'imported_rss_mb': imported,
        'mission_30h_peak_rss_mb': flown,
        'mission_30h_rss_over_imported': flown / imported,
        'autopilot_peak_rss_mb': autopilot,
        'separate_nodes_peak_rss_mb': separate,
    }


def _on_board_mb(layout: Layout) -> float:
    """Most resident memory (MB) of what is on board, dead reckoning."""
    peaks = {}
    fly_once(
        FLIGHT_S,
        lambda tick, depth_m: peaks.update(memory_mb('VmHWM')),
        navigation='dead_reckoned',
        layout=layout,
    )
    aboard = {AUTOPILOT, *(wired.node for wired in ON_BOARD)}
    return sum(peak for name, peak in peaks.items() if name in aboard)


def _peak_mb(program: str) -> float:
    """Most resident memory (MB) of a Python that runs ``program``."""
    done = subprocess.run(
        [sys.executable, '-c', program + _PEAK], stdout=subprocess.PIPE, check=True, text=True
    )
    return int(done.stdout) / 1024.0
