# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""The direct engine on one processor, beside the same arithmetic in C (floor.py).

Times are processor time of this thread, the least of several, engine and floor by turns: what else
the machine does counts little. Compilation stands apart.
"""

import os
import subprocess
import sys
import time
from collections.abc import Callable
from tempfile import TemporaryDirectory

import numpy as np
from floor import Floor, compare, compiler, compiler_version, ticks_compared

from glider_bringup.direct import COLUMNS, fly_blocks
from glider_bringup.mission import mission_of
from glider_bringup.scenario import Scenario, load_scenario
from glider_bringup.score import Scorer
from glider_model.frames import water_from_wire
from glider_model.kernel import kernel
from glider_model.plant import plant_step
from glider_model.signals import TICK_S, Joints, Water

#: The mission: straight path, constant current, no noise.
SCENARIO, DURATION_S = 'current_8deg', 108000.0
#: What engine and floor have to agree on before they are compared: dives, turns, the surface.
SHALLOW = {'duration_s': 6000.0, 'profile.depth_m': 150.0, 'profile.surface_every_dives': 2}
REPEATS = 5

MEANING = {
    'compile_s': 'compiling all kernels, once after a change of the sources (s)',
    'load_s': 'loading them compiled, once in each process (s)',
    'c_compiler': 'what makes the floor (cc); without one there is nothing to compare with',
    'mission_30h_s': 'mission of 30 h, 1 080 000 ticks (s)',
    'mission_30h_floor_s': 'the same mission in C (s)',
    'mission_over_c': 'their ratio',
    'plant_step_ns': 'one tick of the plant alone (ns)',
    'plant_step_floor_ns': 'the same in C (ns)',
    'plant_step_over_c': 'their ratio',
    'floor_ticks_compared': 'ticks in which every number of engine and C has the same bits',
    'score_30h_s': 'scoring the mission of 30 h (s)',
    'mission_real_time_factor': 'simulated time over that of mission and score',
}


def measure(progress: Callable[[str], None]) -> dict:
    """Figures of the direct engine.

    Raises
    ------
    RuntimeError
        If the floor does not compute the same bits.
    """
    progress('compiling all kernels')
    with TemporaryDirectory() as empty:
        compilation = {'compile_s': _warm_up_s(empty), 'load_s': _warm_up_s(empty)}
    floor = Floor(*mission_of(load_mission())) if compiler() else None
    progress('comparing engine and C')
    compared = ticks_compared(floor, *mission_of(load_mission(**SHALLOW))) if floor else None
    progress('plant')
    plant_s, plant_floor_s = _plant_s(floor)
    missions = []
    for i in range(REPEATS):
        progress(f'mission of 30 h, {i + 1} of {REPEATS}')
        missions.append(_mission_s(floor))
    mission_s, score_s, mission_floor_s = map(_least, zip(*missions, strict=True))
    return {
        **compilation,
        'c_compiler': compiler_version(),
        'mission_30h_s': mission_s,
        'mission_30h_floor_s': mission_floor_s,
        'mission_over_c': _ratio(mission_s, mission_floor_s),
        'plant_step_ns': 1e9 * plant_s,
        'plant_step_floor_ns': plant_floor_s and 1e9 * plant_floor_s,
        'plant_step_over_c': _ratio(plant_s, plant_floor_s),
        'floor_ticks_compared': compared,
        'score_30h_s': score_s,
        'mission_real_time_factor': DURATION_S / (mission_s + score_s),
    }


def load_mission(**changes) -> Scenario:
    """The mission that is measured, with changes to its fields."""
    return load_scenario(SCENARIO, {'dives': 0, 'duration_s': DURATION_S, **changes})


def _least(times: tuple) -> float | None:
    return None if None in times else min(times)


def _ratio(time_s: float, floor_s: float | None) -> float | None:
    return None if floor_s is None else time_s / floor_s


def _cost_s(function: Callable, *arguments) -> float:
    """Processor time (s) of a call."""
    start = time.thread_time()
    function(*arguments)
    return time.thread_time() - start


def _mission_s(floor: Floor | None) -> tuple[float, float, float | None]:
    """Processor times (s) of a mission, of its score, and of the mission in C."""
    scenario = load_mission()
    state, params = mission_of(scenario)
    scorer = Scorer(scenario.sensors.params(scenario.seed))
    scoring_s = [0.0]

    def fly() -> None:
        for log in fly_blocks(state, params):
            scoring_s.append(_cost_s(scorer.add, log))

    def fly_floor() -> None:
        for _ in floor.fly_blocks(state, params):
            pass

    whole_s = _cost_s(fly)
    flying_s = whole_s - sum(scoring_s)
    scoring_s.append(_cost_s(scorer.result, scenario.score_rules(DURATION_S)))
    return flying_s, sum(scoring_s), _cost_s(fly_floor) if floor else None


@kernel
def plant_steps(plant, params, commands, waters, dt, motions):
    """Fill ``motions`` (n, 13) with where the plant goes under commands and waters (n, 3)."""
    for row in range(len(commands)):
        command = Joints(commands[row, 0], commands[row, 1], commands[row, 2])
        water = Water(waters[row, 0], waters[row, 1], waters[row, 2])
        plant = plant_step(plant, command, water, params, dt)
        for i, value in enumerate(plant.motion):
            motions[row, i] = value


def _plant_s(floor: Floor | None) -> tuple[float, float | None]:
    """Processor time (s) of a tick of the plant, and of one in C, under commands of a mission."""
    state, params = mission_of(load_mission(**SHALLOW))
    log = np.concatenate([block.copy() for block in fly_blocks(state, params)])
    commands = np.ascontiguousarray(log[:, COLUMNS['command']])
    waters = np.array([water_from_wire(row) for row in log[:, COLUMNS['current_velocity']]])
    motions = np.empty((len(log), len(state.plant.motion)))
    given = (state.plant, params.plant, commands, waters)
    plant_steps(*given, TICK_S, motions)
    if floor:
        compare(motions, floor.plant_steps(*given), 'motion')
    times = [
        (
            _cost_s(plant_steps, *given, TICK_S, motions),
            _cost_s(floor.plant_steps, *given) if floor else None,
        )
        for _ in range(2 * REPEATS)
    ]
    plant_s, floor_s = map(_least, zip(*times, strict=True))
    return plant_s / len(log), floor_s and floor_s / len(log)


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
