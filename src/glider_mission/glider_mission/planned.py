# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""How long a mission takes, and how fast, as far as that is known before it is flown."""

import math

from glider_base.signals import TICK_S
from glider_guidance.guidance import path_time_s
from glider_guidance.yo.machine import mission_time_s
from glider_mission.scenario import Scenario
from glider_model.onboard.glide_polar import make_polar, steady_horizontal_speed
from glider_model.vehicle.file import Vehicle, load_vehicle


def planned_ticks(scenario: Scenario) -> int:
    """Ticks that a run of the scenario takes; an estimate where dives or its path end it."""
    duration_s, plant = scenario.duration_s, scenario.plant_settings()
    guidance = scenario.guidance_settings().params()
    if scenario.dives:
        dives_s = mission_time_s(guidance.profile, scenario.dives)
        duration_s = min(duration_s, dives_s + plant.surface_s)
    if guidance.ends_with_path:
        path_s = path_time_s(guidance, *scenario.constant_current())
        duration_s = min(duration_s, path_s + plant.afloat_s)
    return max(1, round(duration_s / TICK_S))


def horizontal_speed(scenario: Scenario, vehicle: Vehicle | None = None) -> float:
    """U_h (m/s) that the polar of its vehicle gives for a scenario's pitch and net heaviness."""
    polar = make_polar((vehicle or load_vehicle(scenario.vehicle)).params())
    pitch = -math.radians(scenario.profile.pitch_deg)
    return steady_horizontal_speed(pitch, scenario.profile.net_heaviness_kg, polar)
