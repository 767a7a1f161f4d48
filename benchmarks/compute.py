# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""The direct engine on one processor: a mission of 30 h, compilation apart.

Times are processor time of this thread, the least of several: what else the machine does counts
little.
"""

import os
import subprocess
import sys
import time
from collections.abc import Callable
from tempfile import TemporaryDirectory

from glider_bringup.direct import fly_blocks
from glider_bringup.mission import mission_of
from glider_bringup.scenario import load_scenario
from glider_bringup.score import Scorer

#: The mission: straight path, constant current, no noise.
SCENARIO, DURATION_S = 'current_8deg', 108000.0
REPEATS = 3

MEANING = {
    'compile_s': 'compiling all kernels, once after a change of the sources (s)',
    'load_s': 'loading them compiled, once in each process (s)',
    'mission_30h_s': 'mission of 30 h, 1 080 000 ticks (s)',
    'score_30h_s': 'scoring it (s)',
    'mission_real_time_factor': 'simulated time over that of mission and score',
}


def measure(progress: Callable[[str], None]) -> dict:
    """Figures of the direct engine."""
    progress('compiling all kernels')
    with TemporaryDirectory() as empty:
        figures = {'compile_s': _warm_up_s(empty), 'load_s': _warm_up_s(empty)}
    flights = []
    for i in range(REPEATS):
        progress(f'30 h by the direct engine, {i + 1} of {REPEATS}')
        flights.append(fly_and_score_s(DURATION_S))
    mission_s, score_s = (min(times) for times in zip(*flights, strict=True))
    return figures | {
        'mission_30h_s': mission_s,
        'score_30h_s': score_s,
        'mission_real_time_factor': DURATION_S / (mission_s + score_s),
    }


def fly_and_score_s(duration_s: float) -> tuple[float, float]:
    """Processor time (s) of a mission by the direct engine, and of its score."""
    scenario = load_scenario(SCENARIO, {'dives': 0, 'duration_s': duration_s})
    state, params = mission_of(scenario)
    scorer = Scorer(scenario.sensors.params(scenario.seed))
    flying_s = scoring_s = 0.0
    start = time.thread_time()
    for log in fly_blocks(state, params):
        landed = time.thread_time()
        scorer.add(log)
        flying_s += landed - start
        start = time.thread_time()
        scoring_s += start - landed
    flying_s += time.thread_time() - start
    start = time.thread_time()
    scorer.result(scenario.settle_time_s(duration_s), scenario.profile.depth_m)
    return flying_s, scoring_s + time.thread_time() - start


def _warm_up_s(cache: str) -> float:
    """Processor time (s) that a new process needs until every kernel has run once."""
    program = (
        'import time; from glider_bringup import warm_up; start = time.process_time(); '
        'warm_up.main(); print(time.process_time() - start)'
    )
    environment = {name: v for name, v in os.environ.items() if name != 'NUMBA_CACHE_DIR'}
    environment['GLIDER_CACHE'] = cache
    done = subprocess.run(
        [sys.executable, '-c', program],
        env=environment,
        stdout=subprocess.PIPE,
        check=True,
        text=True,
    )
    return float(done.stdout)
