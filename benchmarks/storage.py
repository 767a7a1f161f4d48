# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""Bytes that flights and sweeps leave on disk, and what writing the result of a sweep takes."""

import json
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from statistics import median
from tempfile import TemporaryDirectory

import yaml

from glider_bringup.engines.direct import fly_blocks
from glider_bringup.engines.flight import mission_of
from glider_bringup.engines.recorded import fly_recorded
from glider_bringup.mission.run_folder import make_run_folder
from glider_bringup.mission.scenario import load_scenario
from glider_bringup.recording.ros.log_writer import LogWriter
from glider_bringup.recording.ros.rosbag2 import BagWriter, Sync
from glider_bringup.studies.sweep.fly import (
    JOURNAL_FILE,
    RESULT_FILE,
    fly_chunk,
    make_chunks,
    open_journal,
)
from glider_bringup.studies.sweep.plan import MAX_CELLS, load_sweep
from glider_model.base.signals import TICK_S
from glider_model.ros.wire.topics import recorded_topics

SCENARIO, HOUR_S = 'current_8deg', 3600.0
#: The sweep whose result is written: of many cells, none of which is flown more than once.
SHAPE = 200, 500
CELLS = SHAPE[0] * SHAPE[1]
#: Of these, cells that are journalled one by one.
APPENDS = 100

MEANING = {
    'cdr_bytes_per_tick': 'messages of a tick, all per-tick topics (B)',
    'bag_bytes_per_h': 'recording of a flight of one hour, compressed (B)',
    'bag_over_cdr': 'ratio of that to its messages',
    'chunk_flush_ms': 'bringing a chunk of 12.8 s to the operating system, median (ms)',
    'chunk_sync_ms': 'bringing it to the disk as well, as --sync chunk does, median (ms)',
    'bag_flushed_real_time_factor': 'recording alone, --sync never: simulated over wall time',
    'bag_synced_real_time_factor': 'the same with --sync chunk',
    'bag_synced_over_flushed': 'time of recording with --sync chunk over that with never',
    'journal_bytes_per_cell': 'journal of a sweep (B)',
    'journal_append_ms': 'bringing one cell to disk, median (ms)',
    'netcdf_bytes_per_cell': 'result of a sweep (B)',
    'result_cells': 'cells of the sweep whose result is written here',
    'result_s': 'writing it: processor time (s)',
    'result_rss_mb': 'resident memory before (MB)',
    'result_peak_rss_mb': 'most resident memory while it is written (MB)',
    'result_largest_peak_rss_mb': f'the same for {MAX_CELLS:,} cells, if it grows evenly (MB)',
}

_WRITE = """
import json, sys, time
from pathlib import Path
from glider_bringup.studies.sweep.fly import RESULT_FILE, open_journal, write_result
from glider_bringup.studies.sweep.plan import load_sweep

def memory_mb(name):
    for line in open('/proc/self/status'):
        if line.startswith(name):
            return int(line.split()[1]) / 1024.0

file, folder = sys.argv[1:]
plan = load_sweep(file)
with open_journal(plan, Path(folder), True) as journal:
    before_mb, start_s = memory_mb('VmRSS'), time.process_time()
    write_result(plan, journal, Path(folder) / RESULT_FILE)
    print(json.dumps([time.process_time() - start_s, before_mb, memory_mb('VmHWM')]))
"""


def measure(progress: Callable[[str], None]) -> dict:
    """Figures of a recording and of a result."""
    progress('one hour with a recording')
    cdr_bytes = sum(
        topic.codec.size for topic in recorded_topics(['measured_odom']) if topic.per_tick
    )
    bag_bytes = _bag_bytes()
    progress('an hour recorded, flushed and synced')
    flush_ms, flushed_s = _record('never')
    sync_ms, synced_s = _record('chunk')
    progress('one cell of the stability map')
    record = _fly_one_cell()
    with TemporaryDirectory() as parent:
        progress(f'a result of {CELLS:,} cells')
        folder = Path(parent) / 'sweep'
        file = Path(parent) / 'large.yaml'
        append_ms = _write_journal(record, file, folder)
        write_s, before_mb, peak_mb = _write_result(file, folder)
        journal_bytes = (folder / JOURNAL_FILE).stat().st_size
        result_bytes = (folder / RESULT_FILE).stat().st_size
    return {
        'cdr_bytes_per_tick': cdr_bytes,
        'bag_bytes_per_h': bag_bytes,
        'bag_over_cdr': bag_bytes / (cdr_bytes * HOUR_S / TICK_S),
        'chunk_flush_ms': flush_ms,
        'chunk_sync_ms': sync_ms,
        'bag_flushed_real_time_factor': HOUR_S / flushed_s,
        'bag_synced_real_time_factor': HOUR_S / synced_s,
        'bag_synced_over_flushed': synced_s / flushed_s,
        'journal_bytes_per_cell': journal_bytes / CELLS,
        'journal_append_ms': append_ms,
        'netcdf_bytes_per_cell': result_bytes / CELLS,
        'result_cells': CELLS,
        'result_s': write_s,
        'result_rss_mb': before_mb,
        'result_peak_rss_mb': peak_mb,
        'result_largest_peak_rss_mb': before_mb + (peak_mb - before_mb) * MAX_CELLS / CELLS,
    }


def _bag_bytes() -> int:
    """Size of the bag of an hour; one of nodes has the same messages, and a few events."""
    scenario = load_scenario(SCENARIO, {'dives': 0, 'duration_s': HOUR_S})
    with TemporaryDirectory() as parent:
        folder = make_run_folder(scenario, Path(parent) / 'run')
        fly_recorded(scenario, folder)
        return sum(file.stat().st_size for file in folder.glob('*.mcap'))


def _record(sync: Sync) -> tuple[float, float]:
    """Time (ms) that a chunk takes to be saved, and wall time (s) of recording an hour.

    On the disk of the folder in which this is started: the one on which runs lie.
    """
    scenario = load_scenario(SCENARIO, {'dives': 0, 'duration_s': HOUR_S})
    times = []
    with TemporaryDirectory(dir=Path.cwd()) as parent:
        bag = BagWriter(Path(parent) / 'run', 'run', sync=sync)
        save = bag.flush

        def timed() -> None:
            start = time.perf_counter()
            save()
            times.append(time.perf_counter() - start)

        bag.flush = timed
        log, recorded_s = LogWriter(bag, scenario.guidance_settings(), scenario.topics), 0.0
        for rows in fly_blocks(*mission_of(scenario)):
            start = time.perf_counter()
            log.add(rows)
            recorded_s += time.perf_counter() - start
        bag.close()
    return 1e3 * median(times), recorded_s


def _fly_one_cell() -> dict:
    """What a worker says of the first cell of the stability map."""
    plan = load_sweep('stability_map')
    chunk = next(make_chunks(plan, bytearray(plan.cells), 1))
    (record,) = fly_chunk(chunk._replace(cells=chunk.cells[:1]))
    return record


def _write_journal(record: dict, file: Path, folder: Path) -> float:
    """Make a sweep file, and its journal, in which every cell has ended like ``record``.

    Returns the time (ms) that the append of one cell takes.
    """
    fields = 'initial.north_m', 'initial.east_m'
    dimensions = {
        field.rpartition('.')[2]: {
            'kind': 'grid',
            'field': field,
            'start': 0,
            'stop': size - 1,
            'step': 1,
        }
        for field, size in zip(fields, SHAPE, strict=True)
    }
    file.write_text(yaml.safe_dump({'dimensions': dimensions}), encoding='utf-8')
    with open_journal(load_sweep(str(file)), folder, False) as journal:
        records = [{**record, 'cell': cell} for cell in range(CELLS)]
        times = []
        for one in records[:APPENDS]:
            start = time.perf_counter()
            journal.append([one])
            times.append(time.perf_counter() - start)
        journal.append(records[APPENDS:])
    return 1e3 * median(times)


def _write_result(file: Path, folder: Path) -> tuple[float, float, float]:
    """Processor time (s), memory before and most memory (MB) of a process that writes a result."""
    done = subprocess.run(
        [sys.executable, '-c', _WRITE, str(file), str(folder)],
        stdout=subprocess.PIPE,
        check=True,
        text=True,
    )
    return tuple(json.loads(done.stdout))
