# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""Cells of the stability map by worker processes, beside the same cells in one plain loop."""

import time
from collections.abc import Callable, Iterable
from itertools import islice

from distributed import Client, LocalCluster

from glider_studies.sweep.fly import Chunk, fly_chunk, make_chunks
from glider_studies.sweep.plan import load_sweep
from glider_studies.workers import Pool, worker_pool

MEANING = {
    'sweep_cell_direct_s': 'one cell of 50,000 s in a plain loop, the floor (s)',
    'sweep_cell_one_worker_s': 'one cell by one worker (s)',
    'sweep_cell_two_workers_s': 'one cell by two workers, time over all cells (s)',
    'sweep_one_worker_over_direct': 'what the worker and Dask cost: ratio to the floor',
    'sweep_two_workers_over_one': 'cells in the same time, two workers to one',
    'sweep_worker_peak_rss_mb': 'most resident memory of a worker at the end (MB)',
    'sweep_worker_growth_mb': 'of that, what came after its first chunk (MB)',
    'sweep_task_ms': 'handing out one chunk: processor time of client and scheduler (ms)',
    'sweep_task_1000_ms': 'the same with 1000 threads to hand out to (ms)',
}
#: Chunks that are timed, and how often: the fastest counts, as others use the machine too.
CHUNKS, TIMES = 4, 2
#: Threads of a cluster, and chunks with nothing in them for each of few and of many threads.
THREADS, EMPTY_CHUNKS = 1000, 500


def measure(progress: Callable[[str], None]) -> dict:
    """Times per cell, without the start of the workers, and the memory of the workers."""
    plan = load_sweep('stability_map')
    chunks = list(islice(make_chunks(plan, bytearray(plan.cells), 2), CHUNKS))
    cells = sum(len(chunk.cells) for chunk in chunks)
    progress('a plain loop')
    fly_chunk(chunks[0])
    seconds = {'direct': _fastest(lambda: [fly_chunk(chunk) for chunk in chunks])}
    for workers, name in ((1, 'one_worker'), (2, 'two_workers')):
        progress(name.replace('_', ' '))
        with worker_pool(workers) as pool:
            first = _fly(pool, chunks[:1] * 2 * workers)
            seconds[name] = _fastest(lambda pool=pool: _fly(pool, chunks))
            last = _fly(pool, chunks)
            task_ms = _task_ms(pool)
    progress(f'{THREADS} threads')
    per_cell = {f'sweep_cell_{name}_s': value / cells for name, value in seconds.items()}
    return {
        **per_cell,
        'sweep_one_worker_over_direct': seconds['one_worker'] / seconds['direct'],
        'sweep_two_workers_over_one': seconds['one_worker'] / seconds['two_workers'],
        'sweep_worker_peak_rss_mb': last,
        'sweep_worker_growth_mb': last - first,
        'sweep_task_ms': task_ms,
        'sweep_task_1000_ms': _task_ms_of_many(),
    }


def _fastest(work: Callable) -> float:
    """Shortest time (s) that some work takes."""
    times = []
    for _ in range(TIMES):
        start = time.perf_counter()
        work()
        times.append(time.perf_counter() - start)
    return min(times)


def _fly(pool: Pool, chunks: Iterable[Chunk]) -> float:
    """Fly chunks; most resident memory (MB) that a worker has had by then."""
    return max(outcome.result for outcome in pool.outcomes(fly_and_weigh, chunks))


def _task_ms(pool: Pool) -> float:
    """Processor time (ms) of this process, the scheduler's too, for a chunk with nothing in it."""
    start = time.process_time()
    for _ in pool.outcomes(fly_chunk, [Chunk(None, frozenset(), [])] * EMPTY_CHUNKS):
        pass
    return 1e3 * (time.process_time() - start) / EMPTY_CHUNKS


def _task_ms_of_many() -> float:
    """The same with as many threads as a cluster has, all in one process."""
    with (
        LocalCluster(
            n_workers=1, threads_per_worker=THREADS, dashboard_address=None, memory_limit=0
        ) as cluster,
        Client(cluster) as client,
    ):
        return _task_ms(Pool(client))


def fly_and_weigh(chunk: Chunk) -> float:
    """Fly a chunk in a worker; most resident memory (MB) that this process has had."""
    fly_chunk(chunk)
    with open('/proc/self/status', encoding='utf-8') as file:
        return next(int(line.split()[1]) for line in file if line.startswith('VmHWM')) / 1024.0
