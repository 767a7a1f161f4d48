# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""The checkout beside another one: the same commands by both, by turns, in the same minutes.

Each is asked by its own ``./glider``, so that any commit can be compared with any other, wherever
its modules lie. The other checkout sets itself up first if it has not been used.
"""

import json
import os
import subprocess
import time
from collections.abc import Callable
from pathlib import Path
from statistics import median
from tempfile import TemporaryDirectory

MISSION_S, NODES_S = 108000.0, 2000.0
#: A sweep of twelve missions of 30 h: the start of the workers counts little.
SWEEP = """
name: against
description: twelve missions of 30 h
scenario: current_8deg
set: {dives: 0, duration_s: 108000.0}
dimensions:
  angle: {kind: grid, field: current.angle_deg, start: 0.0, stop: 44.0, step: 4.0}
"""
REPEATS = 3
#: Where the kernels are kept, for this checkout and for older ones.
CACHES = 'GLIDER_CACHE', 'XDG_CACHE_HOME'

MEANING = {
    'against_mission_s': 'mission of 30 h with its score, by the other checkout (s)',
    'mission_over_against': 'the same by this one: the ratio',
    'against_nodes_s': 'flight of 2,000 s over topics, by the other checkout (s)',
    'nodes_over_against': 'the same by this one: the ratio',
    'against_sweep_s': 'twelve missions of 30 h by two workers, by the other checkout (s)',
    'sweep_over_against': 'the same by this one: the ratio',
    'against_compile_s': 'flight of 10 s with nothing compiled, by the other checkout (s); once',
    'compile_over_against': 'the same by this one: the ratio',
}


def measure(progress: Callable[[str], None], checkout: Path) -> dict:
    """Ratios of this checkout to another one; a RuntimeError if a command fails in one of them."""
    ways = {
        'mission': lambda root: _flight_s(root, MISSION_S, '--engine', 'direct'),
        'nodes': lambda root: _flight_s(root, NODES_S),
        'sweep': _sweep_s,
        'compile': _compile_s,
    }
    roots = {'this': Path(__file__).parents[1], 'other': checkout.resolve()}
    figures = {}
    for way, time_s in ways.items():
        times, repeats = {name: [] for name in roots}, 1 if way == 'compile' else REPEATS
        for root in roots.values() if repeats > 1 else ():
            progress(f'{way} by {root}, once before it counts')
            time_s(root)
        for i in range(repeats):
            for name, root in roots.items():
                progress(f'{way} by {root}, {i + 1} of {repeats}')
                times[name].append(time_s(root))
        pairs = zip(times['this'], times['other'], strict=True)
        figures[f'against_{way}_s'] = median(times['other'])
        figures[f'{way}_over_against'] = median(this / other for this, other in pairs)
    return figures


def _glider(root: Path, *words: str, **environment: str) -> str:
    """Standard output of a command of a checkout."""
    done = subprocess.run(
        [str(root / 'glider'), *words],
        cwd=root,
        env=os.environ | environment,
        capture_output=True,
        text=True,
        check=False,
    )
    if done.returncode:
        raise RuntimeError(f'{root}: ./glider {" ".join(words)}: {done.stderr[-500:]}')
    return done.stdout


def _flight_s(root: Path, duration_s: float, *words: str) -> float:
    """Wall time (s) of a flight, as its scorecard says it."""
    with TemporaryDirectory() as scratch:
        out = ('--out', f'{scratch}/run', '--no-report', '--json')
        said = _glider(root, 'run', 'current_8deg', '--duration', str(duration_s), *words, *out)
    return json.loads(said)['wall_time_s']


def _sweep_s(root: Path) -> float:
    """Wall time (s) of the whole command."""
    with TemporaryDirectory() as scratch:
        file = Path(scratch) / 'against.yaml'
        file.write_text(SWEEP, encoding='utf-8')
        start = time.perf_counter()
        _glider(root, 'sweep', str(file), '--workers', '2', '--out', f'{scratch}/out', '--json')
        return time.perf_counter() - start


def _compile_s(root: Path) -> float:
    """Wall time (s) of a short flight that finds no kernel compiled."""
    with TemporaryDirectory() as scratch:
        words = ('current_8deg', '--duration', '10', '--engine', 'direct', '--no-report')
        start = time.perf_counter()
        _glider(root, 'run', *words, '--out', f'{scratch}/run', **dict.fromkeys(CACHES, scratch))
        return time.perf_counter() - start
