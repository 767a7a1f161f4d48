# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""Missions drawn at random: every shipped scenario and vehicle, half of them awkward.

Mission i of seed S is a function of both alone. What its scenario file refuses is drawn again.
"""

from typing import Any, NamedTuple

import numpy as np

from glider_base.settings import ConfigurationError
from glider_mission.scenario import Scenario, load_scenario, scenario_names
from glider_model.plant.faults.settings import measured
from glider_model.vehicle.file import load_vehicle, steers_by, vehicle_names
from glider_studies.montecarlo import ERRORS, SENSORS, sample_plant
from glider_studies.random_faults import sample_faults

#: It does not glide, and says so.
NOT_FLOWN = 'zhang2021_table1'
#: Whose water is in a file: it covers their own path and time, and no others.
IN_A_FILE = ('eddies_10d', 'eddies_hard')
#: Shares of the missions that are awkward, by dead reckoning, and with sensors that err.
AWKWARD, RECKONED, ERRING = 0.5, 0.5, 0.5
#: Faults of a flight.
FAULTS = (2, 3)
#: Faults begin within one and a half dives, but not later than this (s).
LATEST_S = 21600.0
#: Nobody is asked to be at the surface before this (s), nor to rise faster than this (m/s).
SURFACE_S, SURFACE_MPS = 3600.0, 0.1
#: Rounds of drawing a mission before one gives up.
TRIES = 100


class Mission(NamedTuple):
    """A flight, in the words of a scenario."""

    scenario: str
    changes: dict[str, Any]  #: fields, without faults
    faults: list[dict[str, Any]]
    aging: list[dict[str, Any]]  #: faults that no reaction is due to: growth

    def load(self, faults: list[dict[str, Any]] | None = None) -> Scenario:
        """Scenario with some of its faults; by default with all."""
        broken = self.faults if faults is None else faults
        return load_scenario(self.scenario, {**self.changes, 'faults': [*self.aging, *broken]})


def due_s(depth_m: float) -> float:
    """Time (s) within which a vehicle at a depth (m) is at the surface, once it is ordered to."""
    return SURFACE_S + depth_m / SURFACE_MPS


def _awkward(draw: np.random.Generator, vehicle, fields: dict, aging: list) -> None:
    """Make a mission awkward in one to three ways, in place."""
    rated, most = vehicle.rated_depth_m, vehicle.params().m_b_max
    ballast = min(0.3, 0.4 * most)
    # what a vehicle loses of its weight down there, its pump has to make up for
    rise = min(0.006, 0.4 * most / vehicle.params().m)
    plant = sample_plant(int(draw.integers(2**31)), vehicle.params())
    components = [
        {'kind': 'tidal', 'speed_mps': 0.5, 'direction_deg': round(draw.uniform(0.0, 360.0), 1)},
        {
            'kind': 'shear',
            'speed_mps': 1.0,
            'direction_deg': round(draw.uniform(0.0, 360.0), 1),
            'law': 'exponential',
            'depth_m': 200.0,
        },
    ]
    ways: list[dict[str, Any]] = [
        {
            'profile.depth_m': rated,
            'profile.pitch_deg': 45.0,
            'profile.net_heaviness_kg': round(0.95 * most, 3),
        },
        {'profile.depth_m': 20.0, 'profile.top_depth_m': 3.0},
        {'profile.net_heaviness_kg': 0.02},
        {'current.components': components[:1]},
        {'current.components': components[1:]},
        {'water.pycnocline_rise': round(rise, 5), 'water.pycnocline_depth_m': 60.0},
        {'perturb.net_heaviness_kg': round(draw.uniform(-ballast, ballast), 3)},
        {'perturb': plant['perturb']},
        {'current.speed_mps': 2.5, 'current.direction_deg': round(draw.uniform(0.0, 360.0), 1)},
        {},
    ]
    for number in draw.choice(len(ways), draw.integers(1, 4), replace=False):
        if not ways[number]:
            drag = round(draw.uniform(1.2, 2.0), 3)
            aging.append({'kind': 'fouling', 'drag': drag, 'over_s': 14400.0})
        fields.update(ways[number])
    if 'perturb' in fields:
        fields.pop('perturb.net_heaviness_kg', None)


def _draw(draw: np.random.Generator) -> tuple[str, dict[str, Any], list[dict[str, Any]]]:
    """Name of a scenario, its fields, and how the vehicle ages."""
    names = [one for one in scenario_names() if one not in IN_A_FILE]
    name = str(draw.choice(names))
    fields: dict[str, Any] = {'dives': 0, 'seed': int(draw.integers(2**31))}
    aging: list[dict[str, Any]] = []
    shipped = load_scenario(name)
    vehicle = load_vehicle(shipped.vehicle)
    if shipped.profile.mode == 'profile':
        chosen = str(draw.choice([one for one in vehicle_names() if one != NOT_FLOWN]))
        vehicle = load_vehicle(chosen)
        rated, most = vehicle.rated_depth_m, vehicle.params().m_b_max
        fields |= {
            'vehicle': chosen,
            'profile.depth_m': round(draw.uniform(0.1, 1.0) * rated, 1),
            'profile.top_depth_m': 5.0,
            'profile.pitch_deg': round(draw.uniform(15.0, 40.0), 1),
            'profile.net_heaviness_kg': round(draw.uniform(0.15, 0.7) * most, 3),
            'profile.surface_every_dives': int(draw.integers(0, 3)),
        }
    if draw.random() < RECKONED:
        fields['navigation.method'] = 'dead_reckoned'
        fields['profile.surface_every_dives'] = int(draw.integers(1, 4))
    else:
        fields['navigation.method'] = 'known'
    if draw.random() < ERRING:
        sensors = {**SENSORS, **{k: round(draw.uniform(*of), 4) for k, of in ERRORS.items()}}
        if draw.random() < 0.3:
            sensors['imu_period_s'] = round(draw.uniform(1.0, 10.0), 1)
        if draw.random() < 0.3:
            sensors['gyro'] = False
        if draw.random() < 0.3:
            sensors['depth_resolution_m'] = round(draw.uniform(0.01, 0.5), 2)
        fields['sensors'] = sensors
    if draw.random() < AWKWARD and shipped.profile.mode == 'profile':
        _awkward(draw, vehicle, fields, aging)
    return name, fields, aging


def draw_mission(seed: int, number: int) -> Mission:
    """Mission of a number under a seed."""
    draw = np.random.Generator(np.random.PCG64([seed, number]))
    for _ in range(TRIES):
        name, fields, aging = _draw(draw)
        try:
            scenario = load_scenario(name, fields)
        except ConfigurationError:
            continue
        break
    else:
        raise RuntimeError(f'no mission in {TRIES} rounds (seed {seed}, flight {number})')
    depth = load_vehicle(scenario.vehicle).rated_depth_m
    if scenario.profile.mode == 'profile':
        depth = scenario.profile.depth_m
    window_s = min(LATEST_S, max(3600.0, 1.5 * _dive_s(scenario)))
    fields['duration_s'] = round(window_s + due_s(depth) + 1800.0, 1)
    faults = sample_faults(
        int(draw.integers(2**31)),
        int(draw.integers(FAULTS[0], FAULTS[1] + 1)),
        window_s,
        steered=bool(steers_by(scenario)),
        depth_m=depth,
        shows=measured(scenario.topics, scenario.sensors.gyro),
    )
    return Mission(name, fields, faults, aging)


def _dive_s(scenario: Scenario) -> float:
    """Time (s) of a dive."""
    if scenario.profile.mode == 'path':
        return LATEST_S
    profile = scenario.guidance_settings().params().profile
    return 2.0 * profile.depth / profile.glide_rate
