# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""Compiles every kernel once, so that the first run does not have to: set-up calls this.

By one process a processor: a kernel that another has compiled is read from the cache.
"""

import tempfile
from concurrent.futures import ProcessPoolExecutor
from functools import partial
from multiprocessing import get_context
from pathlib import Path

import numpy as np

import glider_bringup
from glider_base.block import answer
from glider_base.kernels.cache import forget_old
from glider_base.kernels.holding import Held
from glider_base.signals import TICK_S, Battery
from glider_base.wiring import WHEN_SILENT, at_rest
from glider_bringup.engines.direct import fly
from glider_bringup.engines.flight import mission_of
from glider_bringup.engines.recorded import fly_recorded
from glider_bringup.scoring.score import Scorer
from glider_bringup.scoring.traces import halve, make_tracer
from glider_guard.ascent import Rise, come_up
from glider_guidance.path.curve import path_length, path_tangent
from glider_guidance.status import status_of
from glider_mission.blocks import BLOCKS, ROW
from glider_mission.recording.mcap_reader import Bag
from glider_mission.recording.ros.node_settings import read_settings
from glider_mission.recording.ros.recorded_run import Recording
from glider_mission.recording.ros.verify.every_block import verify
from glider_mission.rules import Rules
from glider_mission.run_folder import make_run_folder
from glider_mission.scenario import load_scenario
from glider_model.plant.block import PLANT, measure_held, move_held
from glider_model.plant.trim import solve_trim


def main() -> None:
    """Blocks first, which the loop consists of; then what is called on its own; side by side."""
    with ProcessPoolExecutor(mp_context=get_context('fork')) as pool:
        blocks = [partial(one_tick, number) for number in range(len(BLOCKS))]
        for tasks in (blocks, (fly_one_tick, score_nothing), (verify_one_tick, fly_for_notebooks)):
            for future in [pool.submit(task) for task in tasks]:
                future.result()
    forget_old()


def one_tick(number: int) -> None:
    """One tick of a block, as its node calls it, and every order that it takes."""
    state, params = mission_of(load_scenario())
    block, own, own_params = BLOCKS[number], state[number], params[number]
    inputs = tuple(at_rest(topic) for topic in block.wired.inputs)
    held = Held(own, own_params)
    held.state = held.state
    if block.wired is PLANT.wired:
        move_held(held.held, inputs, TICK_S)
        measure_held(held.held)
        return
    answer(held.held, 0.0, inputs, TICK_S)
    for order in block.orders:
        order(own)


def fly_one_tick() -> None:
    """One tick by the direct engine."""
    state, params = mission_of(load_scenario())
    fly(state, params, np.zeros((1, ROW)))


def score_nothing() -> None:
    """Score a flight that has none, make its traces; a trim, and what nodes call beside a tick.

    Of two ticks: columns of one row are another kind of array.
    """
    scenario = load_scenario()
    state, params = mission_of(scenario)
    log = np.zeros((2, ROW))
    scorer = Scorer(scenario)
    scorer.add(log)
    scorer.result(Rules())
    make_tracer(scenario).add(log)
    halve(np.zeros(4, np.float32))
    solve_trim(params.plant.vehicle, 0.4, pitch_deg=-30.0)
    path_tangent(path_length(params.guidance.path), params.guidance.path)
    status_of(state.guidance, params.guidance, Battery(*WHEN_SILENT['battery']))
    come_up(state.guard.ascent, Rise(0.0, 0.0), params.guard.ascent, TICK_S)


def fly_for_notebooks() -> None:
    """Fly as a notebook does, and make its dataset."""
    glider_bringup.fly(duration=TICK_S).to_xarray()


def verify_one_tick() -> None:
    """Record a run of one tick, and verify it."""
    scenario = load_scenario(changes={'dives': 0, 'duration_s': TICK_S})
    with tempfile.TemporaryDirectory() as scratch:
        folder = make_run_folder(scenario, Path(scratch) / 'run')
        fly_recorded(scenario, folder)
        bag = Bag(folder)
        given = read_settings(bag, folder, None, Path(scratch))
        recording = Recording(bag, None, lambda share: None, given.steers_by)
        list(verify(recording, given, [], lambda what, share: None))


if __name__ == '__main__':
    main()
