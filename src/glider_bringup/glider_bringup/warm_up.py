# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""Compiles every kernel once, so that the first run does not have to: set-up calls this."""

import tempfile
from pathlib import Path

import numpy as np

import glider_bringup
from glider_bringup.blocks import BLOCKS, ROW
from glider_bringup.engines.direct import fly
from glider_bringup.engines.flight import mission_of
from glider_bringup.engines.recorded import fly_recorded
from glider_bringup.mission.rules import Rules
from glider_bringup.mission.run_folder import make_run_folder
from glider_bringup.mission.scenario import load_scenario
from glider_bringup.recording.mcap_reader import Bag
from glider_bringup.recording.ros.recorded_run import Recording
from glider_bringup.recording.ros.told import read_told
from glider_bringup.recording.ros.verify.every_block import verify
from glider_bringup.scoring.score import Scorer
from glider_bringup.scoring.traces import halve, make_tracer
from glider_model.base.signals import TICK_S
from glider_model.base.wiring import at_rest
from glider_model.plant.block import PLANT, plant_move, plant_outputs
from glider_model.plant.sensors import SensorSettings
from glider_model.plant.trim import solve_trim


def main() -> None:
    """One tick by the direct engine, one by each block as its node calls it, and a trim."""
    scenario = load_scenario()
    state, params = mission_of(scenario)
    log = np.zeros((1, ROW))
    fly(state, params, log, TICK_S)
    scorer = Scorer(SensorSettings(position_std_m=1.0).params(0))
    scorer.add(log)
    scorer.result(Rules())
    tracer = make_tracer(scenario)
    tracer.add(log)
    halve(np.zeros(4, np.float32))

    for block, told, own in zip(BLOCKS[1:], params[1:], state[1:], strict=True):
        inputs = tuple(at_rest(topic) for topic in block.wired.inputs)
        moved, _, _ = block.tick(own, 0.0, inputs, told, TICK_S)
        for order in block.orders:
            order(moved)
    at_sea = tuple(at_rest(topic) for topic in PLANT.wired.inputs)
    plant_outputs(plant_move(state.plant, at_sea, params.plant, TICK_S), params.plant)
    verify_one_tick()
    glider_bringup.fly(duration=TICK_S).to_xarray()
    solve_trim(params.plant.vehicle, 0.4, pitch_deg=-30.0)


def verify_one_tick() -> None:
    """Record a run of one tick, and verify it."""
    scenario = load_scenario(changes={'dives': 0, 'duration_s': TICK_S})
    with tempfile.TemporaryDirectory() as scratch:
        folder = make_run_folder(scenario, Path(scratch) / 'run')
        fly_recorded(scenario, folder)
        bag = Bag(folder)
        told = read_told(bag, folder, None, Path(scratch))
        recording = Recording(bag, None, lambda share: None, told.steers_by)
        list(verify(recording, told, [], lambda what, share: None))


if __name__ == '__main__':
    main()
