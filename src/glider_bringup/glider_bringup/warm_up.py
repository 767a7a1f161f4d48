# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""Compiles every kernel once, so that the first run does not have to: set-up calls this."""

import tempfile
from pathlib import Path

import numpy as np

from glider_bringup.direct import ROW, fly
from glider_bringup.mcap_reader import Bag
from glider_bringup.mission import fly_direct, make_run_folder, make_tracer, mission_of
from glider_bringup.ros.recording import Recording, read_told
from glider_bringup.ros.verify import verify
from glider_bringup.scenario import load_scenario
from glider_bringup.score import Rules, Scorer
from glider_bringup.traces import halve
from glider_control.control import control_step, control_surface
from glider_guidance.guidance import guidance_abort, guidance_step
from glider_model.current import current_step
from glider_model.frames import (
    odometry_from_wire,
    odometry_to_wire,
    reference_from_wire,
    reference_to_wire,
    water_from_wire,
    water_to_wire,
    wrench_to_wire,
)
from glider_model.plant import plant_finished, plant_joints, plant_measurement, plant_step
from glider_model.sensors import SensorSettings
from glider_model.signals import TICK_S
from glider_model.trim import solve_trim


def main() -> None:
    """One tick by the direct engine, one by the steps as the nodes call them, and a trim."""
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

    plant, current, guidance, control = state
    odometry = odometry_from_wire(odometry_to_wire(plant_measurement(plant, params.plant)))
    joints = plant_joints(plant)
    position = (odometry.p_n, odometry.p_e, odometry.p_d)
    _, water = current_step(current, position, 0.0, params.current, TICK_S)
    water = water_from_wire(water_to_wire(water))
    guidance, guided = guidance_step(guidance, odometry, params.guidance, TICK_S)
    guidance_abort(guidance)
    reference = reference_from_wire(reference_to_wire(guided.reference))
    _, controlled = control_step(control, odometry, joints, reference, params.control, TICK_S)
    control_surface(control)
    wrench_to_wire(controlled.wrench)
    plant = plant_step(plant, controlled.command, water, params.plant, TICK_S)
    plant_finished(plant, params.plant)
    verify_one_tick()
    solve_trim(params.plant.vehicle, 0.4, pitch_deg=-30.0)


def verify_one_tick() -> None:
    """Record a run of one tick, and verify it."""
    scenario = load_scenario(changes={'dives': 0, 'duration_s': TICK_S})
    with tempfile.TemporaryDirectory() as scratch:
        folder = make_run_folder(scenario, Path(scratch) / 'run')
        fly_direct(scenario, folder, True, lambda ticks, depth_m: None)
        bag = Bag(folder)
        told = read_told(bag, folder, None, Path(scratch))
        recording = Recording(bag, None, lambda share: None)
        list(verify(recording, told, [], lambda what, share: None))


if __name__ == '__main__':
    main()
