# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""Flights over topics: ticks per second beside what the middleware gives to bare nodes.

In a tick one message after the other passes plant, navigation, guidance, control, guard and plant
again: five hops. The baseline is five bare nodes that hand on one message in that ring, in the
same environment and, because machines are not the same every minute, in turn with the flights.
"""

import resource
import subprocess
import sys
import time
from collections.abc import Callable
from itertools import pairwise
from pathlib import Path
from statistics import mean, median
from tempfile import TemporaryDirectory

from glider_base.ros.places import domain_id
from glider_bringup.engines.flight import Outcome, Progress
from glider_bringup.engines.memory import memory_mb
from glider_bringup.engines.processes import Layout, node_environment
from glider_bringup.engines.recorded import fly_nodes
from glider_mission.run_folder import make_run_folder
from glider_mission.scenario import load_scenario

SCENARIO, DURATION_S = 'current_8deg', 2000.0
REPEATS = 3
HOPS, FLOOR_TICKS = 5, 8000

MEANING = {
    'floor_ticks_per_s': 'five hops of bare rclpy, the floor (1/s)',
    'nodes_ticks_per_s': 'flight over nodes, every topic recorded (1/s)',
    'nodes_over_floor': 'each flight over the floors before and after it, the median ratio',
    'nodes_real_time_factor': 'simulated time over wall time of that flight, with its end',
    'nodes_messages_lost': 'messages that its bag lacks',
    'nodes_cpu_over_processes': 'processor time of a flight, over that with a process a node',
    'nodes_rss_over_processes': 'most resident memory of its processes, over theirs',
}


def measure(progress: Callable[[str], None]) -> dict:
    """Figures of flights over topics."""
    progress('five hops of bare rclpy')
    floors, rates, flights = [floor_ticks_per_s()], [], []
    for i in range(REPEATS):
        progress(f'{DURATION_S:,.0f} s over topics, {i + 1} of {REPEATS}')
        rate, flight = fly_over_topics(DURATION_S)
        rates.append(rate)
        flights.append(flight)
        progress(f'five hops of bare rclpy, after flight {i + 1} of {REPEATS}')
        floors.append(floor_ticks_per_s())
    ratios = [rate / mean(two) for rate, two in zip(rates, pairwise(floors), strict=True)]
    progress('a flight with a process for each node, and one without')
    processes, together = (_costs(layout) for layout in ('processes', 'together'))
    return {
        'floor_ticks_per_s': median(floors),
        'nodes_ticks_per_s': median(rates),
        'nodes_over_floor': median(ratios),
        'nodes_real_time_factor': DURATION_S / median(one.wall_time_s for one in flights),
        'nodes_messages_lost': sum(one.messages_lost for one in flights),
        'nodes_cpu_over_processes': together[0] / processes[0],
        'nodes_rss_over_processes': together[1] / processes[1],
    }


def floor_ticks_per_s() -> float:
    """Rounds per second of a ring of bare rclpy nodes."""
    program = [sys.executable, str(Path(__file__).with_name('ping_pong.py'))]
    with domain_id() as domain:
        places = [
            subprocess.Popen(
                [*program, str(place), str(HOPS), str(FLOOR_TICKS)],
                env=node_environment(domain),
                stdout=subprocess.PIPE,
                text=True,
            )
            for place in range(HOPS)
        ]
        try:
            printed, _ = places[0].communicate(timeout=120.0)
        finally:
            for place in places:
                place.kill()
                place.communicate()
    return float(printed)


def fly_once(
    duration_s: float,
    on_progress: Progress,
    navigation: str = 'known',
    layout: Layout = 'together',
) -> Outcome:
    """Fly the scenario over topics, as fast as possible."""
    changes = {'dives': 0, 'duration_s': duration_s, 'navigation.method': navigation}
    scenario = load_scenario(SCENARIO, changes)
    with TemporaryDirectory() as parent:
        folder = make_run_folder(scenario, Path(parent) / 'run')
        flight = fly_nodes(scenario, folder, progress=on_progress, speed=0.0, layout=layout)
    if flight.status != 'completed':
        raise RuntimeError(f'the flight over topics was aborted: {flight.reason}')
    return flight


def _costs(layout: Layout) -> tuple[float, float]:
    """Processor time (s) and most resident memory (MB) of the processes of a flight."""
    peaks: dict[str, float] = {}
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    fly_once(DURATION_S, lambda *_: peaks.update(memory_mb('VmHWM')), layout=layout)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    used_s = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
    return used_s, sum(peaks.values())


def fly_over_topics(
    duration_s: float, on_tick: Callable[[int], None] = lambda tick: None
) -> tuple[float, Outcome]:
    """Ticks per second between the first and the last word of the recorder, and the flight.

    ``on_tick`` is called several times a second.
    """
    said = []

    def note(tick: int, depth_m: float) -> None:
        if tick > 0:
            said.append((tick, time.perf_counter()))
            on_tick(tick)

    flight = fly_once(duration_s, note)
    (first, start_s), (last, end_s) = said[0], said[-2]
    return (last - first) / (end_s - start_s), flight
