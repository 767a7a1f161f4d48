# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""Flights over topics: ticks per second beside what the middleware gives to bare nodes.

In a tick one message after the other passes plant, navigation, guidance, control, guard and plant
again: five hops. The floor is five bare rclpy nodes that hand on one message in that ring, in the
same environment and, because machines are not the same every minute, in turn with the flights.
"""

import resource
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from statistics import mean, median
from tempfile import TemporaryDirectory

import numpy as np

from glider_bringup.blocks import COLUMNS
from glider_bringup.engines.direct import fly_blocks
from glider_bringup.engines.flight import Outcome, Progress, mission_of
from glider_bringup.engines.memory import memory_mb
from glider_bringup.engines.processes import Layout, node_environment
from glider_bringup.engines.recorded import fly_nodes
from glider_bringup.mission.run_folder import make_run_folder
from glider_bringup.mission.scenario import load_scenario
from glider_bringup.recording.ros.rosbag2 import CHUNK_TICKS, BagWriter
from glider_bringup.recording.tick_sorter import TickSorter
from glider_model.base.signals import TICK_NS
from glider_model.ros.places import domain_id
from glider_model.ros.wire.topics import recorded_topics

SCENARIO, DURATION_S = 'current_8deg', 2000.0
REPEATS = 3
HOPS, FLOOR_TICKS = 5, 8000
_PER_TICK = [topic for topic in recorded_topics(['measured_odom']) if topic.per_tick]

MEANING = {
    'floor_ticks_per_s': 'five hops of bare rclpy, the floor (1/s)',
    'nodes_ticks_per_s': 'flight over nodes, every topic recorded (1/s)',
    'nodes_over_floor': 'each flight over the floors before and after it, the median ratio',
    'nodes_real_time_factor': 'simulated time over wall time of that flight, with its end',
    'nodes_messages_lost': 'messages that its bag lacks',
    'nodes_cpu_over_processes': 'processor time of a flight, over that with a process a node',
    'nodes_rss_over_processes': 'most resident memory of its processes, over theirs',
    'file_messages_per_s': 'the messages of a flight written to a plain file, the floor (1/s)',
    'recorder_messages_per_s': 'the same by the recorder: ordered, indexed, compressed (1/s)',
    'recorder_mb_per_s': 'the same (MB/s of messages)',
    'recorder_over_file': 'ratio of the two',
    'recorder_over_flight': 'what the recorder can write, over what the flight sends it',
}


def measure(progress: Callable[[str], None]) -> dict:
    """Figures of flights over topics, and of the recorder on its own."""
    progress('five hops of bare rclpy')
    floors, rates, flights = [floor_ticks_per_s()], [], []
    for i in range(REPEATS):
        progress(f'{DURATION_S:,.0f} s over topics, {i + 1} of {REPEATS}')
        rate, flight = fly_over_topics(DURATION_S)
        rates.append(rate)
        flights.append(flight)
        progress(f'five hops of bare rclpy, after flight {i + 1} of {REPEATS}')
        floors.append(floor_ticks_per_s())
    ratios = [
        rate / mean(around)
        for rate, around in zip(rates, zip(floors[:-1], floors[1:], strict=True), strict=True)
    ]
    progress('a flight with a process for each node, and one without')
    processes, together = (_costs(layout) for layout in ('processes', 'together'))
    progress('recorder')
    file_s, recorder_s, messages, megabytes = _write_messages()
    ticks_per_s = median(rates)
    return {
        'floor_ticks_per_s': median(floors),
        'nodes_ticks_per_s': ticks_per_s,
        'nodes_over_floor': median(ratios),
        'nodes_real_time_factor': DURATION_S / median(one.wall_time_s for one in flights),
        'nodes_messages_lost': sum(one.messages_lost for one in flights),
        'nodes_cpu_over_processes': together[0] / processes[0],
        'nodes_rss_over_processes': together[1] / processes[1],
        'file_messages_per_s': messages / file_s,
        'recorder_messages_per_s': messages / recorder_s,
        'recorder_mb_per_s': megabytes / recorder_s,
        'recorder_over_file': file_s / recorder_s,
        'recorder_over_flight': messages / recorder_s / (ticks_per_s * len(_PER_TICK)),
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
    speed: float,
    on_progress: Progress,
    navigation: str = 'known',
    layout: Layout = 'together',
) -> Outcome:
    """Fly the scenario over topics, at ``speed`` times real time (0.0: as fast as possible)."""
    changes = {'dives': 0, 'duration_s': duration_s, 'navigation.method': navigation}
    scenario = load_scenario(SCENARIO, changes)
    with TemporaryDirectory() as parent:
        folder = make_run_folder(scenario, Path(parent) / 'run')
        flight = fly_nodes(scenario, folder, progress=on_progress, speed=speed, layout=layout)
    if flight.status != 'completed':
        raise RuntimeError(f'the flight over topics was aborted: {flight.reason}')
    return flight


def _costs(layout: Layout) -> tuple[float, float]:
    """Processor time (s) and most resident memory (MB) of the processes of a flight."""
    peaks: dict[str, float] = {}
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    fly_once(DURATION_S, 0.0, lambda *_: peaks.update(memory_mb('VmHWM')), layout=layout)
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

    flight = fly_once(duration_s, 0.0, note)
    (first, start_s), (last, end_s) = said[0], said[-2]
    return (last - first) / (end_s - start_s), flight


def _write_messages() -> tuple[float, float, int, float]:
    """Time (s) to write a flight to a plain file and to a bag; messages and MB in it."""
    scenario = load_scenario(SCENARIO, {'dives': 0, 'duration_s': DURATION_S})
    log = np.concatenate([block.copy() for block in fly_blocks(*mission_of(scenario))])
    stamps = np.arange(len(log)) * TICK_NS
    columns = [
        topic.codec.encode_many(stamps, log[:, COLUMNS.get(topic.name, slice(0, 0))])
        for topic in _PER_TICK
    ]
    ticks = list(zip(*([row.tobytes() for row in rows] for rows in columns), strict=True))
    messages = len(ticks) * len(_PER_TICK)
    megabytes = sum(map(len, ticks[0])) * len(ticks) / 1e6
    with TemporaryDirectory() as folder:
        file_s = min(_to_file(ticks, Path(folder)) for _ in range(REPEATS))
        bag_s = min(_to_bag(ticks, Path(folder) / str(number)) for number in range(REPEATS))
    return file_s, bag_s, messages, megabytes


def _to_file(ticks: list[tuple[bytes, ...]], folder: Path) -> float:
    start = time.perf_counter()
    with (folder / 'plain').open('wb') as file:
        for number, payloads in enumerate(ticks):
            for payload in payloads:
                file.write(payload)
            if not (number + 1) % CHUNK_TICKS:
                file.flush()
    return time.perf_counter() - start


def _to_bag(ticks: list[tuple[bytes, ...]], folder: Path) -> float:
    """As `RecorderNode` does it, from the moment that a message has been taken."""
    start = time.perf_counter()
    bag = BagWriter(folder, 'bag')
    order = TickSorter([topic.name for topic in _PER_TICK], TICK_NS, bag.write)
    for payloads in ticks:
        for topic, payload in zip(_PER_TICK, payloads, strict=True):
            order.add(topic.name, topic.codec.decode_stamp(payload), payload)
        order.write_complete(bag.end_tick)
    bag.close()
    return time.perf_counter() - start
