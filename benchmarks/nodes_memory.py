# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""Resident memory of each process in a long flight over topics, and whether it stays."""

from collections.abc import Callable

from nodes import fly_over_topics

from glider_base.signals import TICK_S
from glider_bringup.engines.memory import growth_mb_per_h, memory_mb
from glider_bringup.engines.processes import process_modules

HOURS, MISSION_HOURS = 1.0, 30.0
PROCESSES = tuple(process_modules('together'))
MEANING = {
    'nodes_memory_h': 'simulated time of the flight (h)',
    **{f'{name}_rss_mb': f'resident memory of {name} at the end (MB)' for name in PROCESSES},
    'nodes_rss_growth_mb_per_h': 'growth of the process that grows most (MB per simulated hour)',
    'nodes_30h_rss_mb': 'largest process after 30 h, if it goes on like this (MB)',
}


def measure(progress: Callable[[str], None]) -> dict:
    """Figures of one flight."""
    samples = {name: [] for name in PROCESSES}

    def sample(tick: int) -> None:
        for name, megabytes in memory_mb('VmRSS').items():
            samples[name].append((tick * TICK_S / 3600.0, megabytes))

    progress(f'{HOURS:g} h over topics')
    fly_over_topics(HOURS * 3600.0, sample)
    growth = {name: growth_mb_per_h(taken) for name, taken in samples.items()}
    last = {name: taken[-1][1] for name, taken in samples.items()}
    return {
        'nodes_memory_h': HOURS,
        **{f'{name}_rss_mb': megabytes for name, megabytes in last.items()},
        'nodes_rss_growth_mb_per_h': max(growth.values()),
        'nodes_30h_rss_mb': max(
            last[name] + max(0.0, growth[name]) * (MISSION_HOURS - HOURS) for name in PROCESSES
        ),
    }
