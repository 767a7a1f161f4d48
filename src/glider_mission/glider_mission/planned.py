# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""What is known of a mission before it is flown: how long, how fast, and whether it can dive."""

import math

import numpy as np

from glider_base.settings import ConfigurationError
from glider_base.signals import SEA_WATER_DENSITY, TICK_S
from glider_guidance.guidance import path_time_s
from glider_guidance.yo.machine import mission_time_s
from glider_mission.scenario import Scenario
from glider_model.ocean.density import immersed
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


def unballasted(scenario: Scenario) -> list[str]:
    """Whether the pump of its vehicle is too small for the water of its dives, in words."""
    plant = scenario.plant_settings().params()
    vehicle, most = plant.vehicle, plant.vehicle.m_b_max
    depths = {0.0: 'its start'} if vehicle.volume else {}  # without one it is neutral there
    if scenario.profile.mode == 'profile':
        deepest = min(scenario.profile.depth_m, float(np.max(scenario.bottom().depth)))
        depths[deepest] = f'{deepest:,.0f} m'
    for depth, where in depths.items():
        out, full = (immersed(depth, oil, vehicle, plant.density) for oil in (-most, most))
        if not out.net <= 0.0 <= full.net:
            off_kg, how = (out.net, 'sinks') if out.net > 0.0 else (-full.net, 'floats')
            density = out.ratio * SEA_WATER_DENSITY
            return [
                f'in water of {density:.1f} kg/m^3, as at {where}, it {how} whatever its pump '
                f'does: by {off_kg:.2g} kg; ballast it in its vehicle file (volume, rigid_body)'
            ]
    return []


def refuse_planned_route(scenario: Scenario) -> None:
    """Refuse a scenario whose route is planned in flight."""
    if scenario.guidance.route == 'planned':
        raise ConfigurationError(
            "guidance.route = 'planned': not over nodes, step by step, or with a bag (fly it with "
            '--engine direct: the scenario of its run folder has the route as orders, and flies '
            'so by either engine)'
        )
