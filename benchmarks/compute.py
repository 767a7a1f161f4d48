# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""The direct engine on one processor, and the plant beside the same arithmetic in C (floor.py).

Times are processor time of this thread, the least of several, each by turns: what else
the machine does counts little. Compilation stands apart.
"""

import os
import subprocess
import sys
from collections.abc import Callable
from functools import partial
from tempfile import TemporaryDirectory

import floor
import numpy as np

from glider_bringup.door.flight import Flight
from glider_bringup.engines.direct import fly_blocks
from glider_bringup.engines.flight import mission_of
from glider_bringup.scoring.score import Scorer
from glider_mission.scenario import Scenario, load_scenario

#: The mission: straight path, constant current, no noise.
DURATION_S = 108000.0
REPEATS, STEPS = 5, 2000

MEANING = {
    'compile_s': 'compiling all kernels, once after a change of the sources (s)',
    'load_s': 'loading them compiled, once in each process (s)',
    'c_compiler': 'what makes the floor (cc); without one there is nothing to compare with',
    'mission_30h_s': 'mission of 30 h, 1 080 000 ticks (s)',
    'plant_step_ns': 'one tick of the plant alone (ns)',
    'plant_step_floor_ns': 'the same in C (ns)',
    'plant_step_over_c': 'their ratio',
    'plant_step_sea_ns': 'one tick of a plant with a fin in measured water (ns)',
    'plant_step_sea_over_plain': 'its ratio to that of the plant alone, by turns',
    'floor_ticks_compared': 'ticks in which every number of plant and C has the same bits',
    'score_30h_s': 'scoring the mission of 30 h (s)',
    'mission_real_time_factor': 'simulated time over that of mission and score',
    'flight_step_us': 'one tick of the whole stack by `glider.Flight.step`, from Python (us)',
}


def measure(progress: Callable[[str], None]) -> dict:
    """Figures of the direct engine; a RuntimeError if C does not compute the same bits."""
    progress('compiling all kernels')
    with TemporaryDirectory() as empty:
        compilation = {'compile_s': _warm_up_s(empty), 'load_s': _warm_up_s(empty)}
    progress('plant')
    plant_s, plant_floor_s, compared = _plant_s()
    progress('plant with a fin in measured water')
    sea_s, plain_s = _sea_s()
    missions = []
    for i in range(REPEATS):
        progress(f'mission of 30 h, {i + 1} of {REPEATS}')
        missions.append(_mission_s())
    mission_s, score_s = map(min, zip(*missions, strict=True))
    return {
        **compilation,
        'c_compiler': floor.compiler_version(),
        'mission_30h_s': mission_s,
        'plant_step_ns': 1e9 * plant_s,
        'plant_step_floor_ns': plant_floor_s and 1e9 * plant_floor_s,
        'plant_step_over_c': None if plant_floor_s is None else plant_s / plant_floor_s,
        'plant_step_sea_ns': 1e9 * sea_s,
        'plant_step_sea_over_plain': sea_s / plain_s,
        'floor_ticks_compared': compared,
        'score_30h_s': score_s,
        'mission_real_time_factor': DURATION_S / (mission_s + score_s),
        'flight_step_us': 1e6 * _step_s(),
    }


def load_mission(**changes) -> Scenario:
    """The mission that is measured, with changes to its fields."""
    return load_scenario(floor.SCENARIO, {'dives': 0, 'duration_s': DURATION_S, **changes})


def _mission_s() -> tuple[float, float]:
    """Processor times (s) of a mission and of its score."""
    scenario = load_mission()
    state, params = mission_of(scenario)
    scorer = Scorer(scenario)
    scoring_s = [0.0]

    def fly() -> None:
        for log in fly_blocks(state, params):
            scoring_s.append(floor.cost_s(scorer.add, log))

    whole_s = floor.cost_s(fly)
    flying_s = whole_s - sum(scoring_s)
    scoring_s.append(floor.cost_s(scorer.result, scenario.score_rules(DURATION_S)))
    return flying_s, sum(scoring_s)


def _step_s() -> float:
    """Processor time (s) of a step of a flight in one's own hands."""
    flight = Flight(load_mission())

    def fly() -> None:
        for _ in range(STEPS):
            flight.step()

    return _least_s(fly)[0] / STEPS


def _plant_s() -> tuple[float, float | None, int | None]:
    """Processor time (s) of a tick of the plant, and of one in C; ticks with the same bits."""
    flight = floor.flight_of(load_mission(**floor.SHALLOW))
    motions = np.empty((2, len(flight[2]), len(flight[0].motion)))
    ways = [
        floor.plant_steps,
        *([floor.Floor(*flight[:2]).plant_steps] if floor.compiler() else []),
    ]
    calls = (partial(way, *flight, rows) for way, rows in zip(ways, motions, strict=False))
    plant_s, *floor_s = (time_s / len(flight[2]) for time_s in _least_s(*calls))
    return (plant_s, *floor_s, floor.compare(*motions)) if floor_s else (plant_s, None, None)


def _sea_s() -> tuple[float, float]:
    """Processor time (s) of a tick of the plant with a fin in measured water, and without."""
    flights = [
        floor.flight_of(load_mission(**floor.SHALLOW, **changes)) for changes in (floor.SEA, {})
    ]
    motions = np.empty((len(flights[0][2]), len(flights[0][0].motion)))
    sea_s, plain_s = _least_s(
        *(partial(floor.plant_steps, *flight, motions) for flight in flights)
    )
    return sea_s / len(motions), plain_s / len(motions)


def _least_s(*calls: Callable[[], None]) -> list[float]:
    """Least processor times (s) of some calls, by turns; in the first turn they may compile."""
    turns = [[floor.cost_s(call) for call in calls] for _ in range(2 * REPEATS)]
    return [min(times) for times in zip(*turns, strict=True)]


def _warm_up_s(cache: str) -> float:
    """Processor time (s) of a new process, and those that it starts, to run every kernel once."""
    program = (
        'import os; from glider_bringup import warm_up; start = sum(os.times()[:4]); '
        'warm_up.main(); print(sum(os.times()[:4]) - start)'
    )
    environment = {**os.environ, 'GLIDER_CACHE': cache}
    done = subprocess.run(
        [sys.executable, '-c', program],
        env=environment,
        stdout=subprocess.PIPE,
        check=True,
        text=True,
    )
    return float(done.stdout)
