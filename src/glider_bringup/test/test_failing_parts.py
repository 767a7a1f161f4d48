# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""Missions with measurements and actuators that fail: what shows in the track, what surfaces."""

from functools import cache

import numpy as np
import pytest

from glider_base import wiring
from glider_base.frames import (
    odometry_from_wire,
    reference_from_wire,
    reference_to_wire,
    water_from_wire,
    water_to_wire,
)
from glider_base.signals import TICK_S
from glider_base.wiring import NO_ECHO
from glider_bringup.engines.direct import MissionState, fly
from glider_bringup.engines.flight import mission_of
from glider_control.control import control_step
from glider_control.intake import REFUSED
from glider_guard.guard import Received, guard_step
from glider_guard.rows import FROZEN, LOST, STUCK_BUOYANCY, STUCK_ROLL, SURFACES, TOO_DEEP
from glider_guidance.guidance import guidance_abort, guidance_step
from glider_guidance.yo.stage import GLIDING_DOWN, GLIDING_UP, INFLECTING_UP, WAITING_ON_SURFACE
from glider_mission.blocks import COLUMNS, ROW
from glider_mission.scenario import load_scenario
from glider_model.ocean.current import current_step
from glider_model.ocean.density import depth_at
from glider_model.plant.block import plant_outputs
from glider_model.plant.energy import battery_of
from glider_model.plant.plant import plant_odometry, plant_step
from glider_model.plant.sensors import health_of
from glider_navigation.block import navigation_tick
from glider_navigation.phase import AT_SURFACE, FIXED

#: One dive to 250 m, with both turns; in a cross current, so that the track has to be held.
FLIGHT = {'dives': 0, 'duration_s': 3600.0, 'profile.depth_m': 250.0, 'profile.prepare_s': 0.0}
TICKS = 36000
E2, COMMAND = COLUMNS['tracking_error'].start + 1, COLUMNS['command']
UP = COLUMNS['ground_truth/odom'].start + 2
PLACE = slice(UP - 2, UP)
#: Place of measured_odom among the numbers of the plant, which do not include those of /clock.
MEASURED = wiring.PLANT.outputs.index('measured_odom') - 1
#: The same of a vehicle that has no such thing, and reckons.
RECKONS = {'navigation.method': 'dead_reckoned', 'profile.surface_every_dives': 1}

#: On the wire: position 0:3, quaternion 3:7, velocity 7:10, rates 10:13.
WILD = {
    'rates of 10 rad/s': lambda wire: (*wire[:10], 10.0, -10.0, 10.0),
    'rates of 1e6 rad/s': lambda wire: (*wire[:10], 1e6, 1e6, -1e6),
    'velocity of 100 m/s': lambda wire: (*wire[:7], 100.0, 0.0, 100.0, *wire[10:]),
    'quaternion of norm 2': lambda wire: (*wire[:3], *(2.0 * q for q in wire[3:7]), *wire[7:]),
    'quaternion of norm 0': lambda wire: (*wire[:3], *(4 * (0.0,)), *wire[7:]),
    'position 10 km off': lambda wire: (wire[0] + 1e4, *wire[1:]),
    'depth 100 m off': lambda wire: (*wire[:2], wire[2] - 100.0, *wire[3:]),
    'turned about': lambda wire: (*wire[:3], wire[6], -wire[5], wire[4], -wire[3], *wire[7:]),
    'not a number': lambda wire: 13 * (float('nan'),),
}


def sensors(plant, params) -> dict[str, tuple[float, ...]]:
    """What the plant measures, on the wire, by topic."""
    outputs, _ = plant_outputs(plant, params)
    several = outputs[MEASURED : MEASURED + len(wiring.SENSORS)]
    return dict(zip(wiring.SENSORS, several, strict=True))


def measured(plant, params) -> tuple[float, ...]:
    """What the plant measures: odometry on the wire."""
    return sensors(plant, params)['measured_odom']


def still(state: MissionState, params):
    """Odometry that stays what it is."""
    kept = measured(state.plant, params.plant)
    return lambda wire: kept


#: What parts show that have gone wild: topic, numbers.
WILD_PARTS = {
    'rates of 10 rad/s': ('imu', lambda wire: (*wire[:4], 10.0, -10.0, 10.0, wire[7])),
    'rates of 1e6 rad/s': ('imu', lambda wire: (*wire[:4], 1e6, 1e6, -1e6, wire[7])),
    'quaternion of norm 2': ('imu', lambda wire: (*(2.0 * q for q in wire[:4]), *wire[4:])),
    'quaternion of norm 0': ('imu', lambda wire: (*(4 * (0.0,)), *wire[4:])),
    'turned about': ('imu', lambda wire: (wire[3], -wire[2], wire[1], -wire[0], *wire[4:])),
    'attitude not a number': ('imu', lambda wire: 8 * (float('nan'),)),
    'depth 100 m off': ('pressure', lambda wire: (wire[0] + 1e6,)),
    'pressure not a number': ('pressure', lambda wire: (float('nan'),)),
    'fix 10 km off': ('fix', lambda wire: (wire[0], wire[1] + 0.09, *wire[2:])),
    'fix not a number': ('fix', lambda wire: (wire[0], float('nan'), *wire[2:])),
}

#: Measurements that fail from some state on.
FAILS = {
    'depth that stands still': lambda state, params: lambda wire: (*wire[:2], -60.0, *wire[3:]),
    'all that stands still': still,
    'not a number': lambda state, params: WILD['not a number'],
    'no attitude': lambda state, params: WILD['quaternion of norm 0'],
}
PHASES = {'dive': GLIDING_DOWN, 'turn': INFLECTING_UP, 'climb': GLIDING_UP}


def tick(
    state: MissionState, params, corrupt, topic: str = 'measured_odom'
) -> tuple[MissionState, int]:
    """One tick as in `fly`, with what ``corrupt`` makes of a measurement; what is told of it."""
    plant, current, navigation, guidance, control, guard = state
    t_s, true = plant.tick * TICK_S, plant_odometry(plant)
    current, water = current_step(current, true[:3], t_s, params.current, TICK_S)
    seen = sensors(plant, params.plant)
    seen[topic] = tuple(map(float, corrupt(seen[topic])))
    depth = depth_at(seen['pressure'][0])
    heard = (tuple(plant.joints), *seen.values())
    navigation, believed, (_, refused) = navigation_tick(
        navigation, t_s, heard, params.navigation, TICK_S
    )
    seen = odometry_from_wire(believed[0])
    guidance, guided = guidance_step(guidance, seen, NO_ECHO, params.guidance, TICK_S)
    reference = reference_from_wire(reference_to_wire(guided.reference))
    control, controlled = control_step(
        control, seen, plant.joints, reference, params.control, TICK_S
    )
    told = (health_of(plant), battery_of(plant.ledger, params.plant.energy))
    heard = Received(controlled.command, seen, plant.joints, reference.p_d, depth, NO_ECHO, *told)
    guard, guarded = guard_step(guard, heard, params.guard, TICK_S)
    water = water_from_wire(water_to_wire(water))
    plant = plant_step(plant, guarded.command, water, params.plant, TICK_S, guarded.drops)
    state = MissionState(plant, current, navigation, guidance, control, guard)
    return state, controlled.saturation | guarded.reported | (REFUSED if refused else 0)


def flown(state: MissionState, params, ticks: int) -> tuple[MissionState, np.ndarray]:
    log = np.empty((ticks, ROW))
    state, rows, _ = fly(state, params, log)
    return state, log[:rows]


def mission(law: str, reckons: bool = False):
    """State at the start, and parameters."""
    changes = RECKONS if reckons else {}
    return mission_of(load_scenario('current_12deg', {**FLIGHT, **changes, 'control.law': law}))


@cache
def clean(law: str, reckons: bool = False) -> np.ndarray:
    """The flight that nothing happens to."""
    return flown(*mission(law, reckons), TICKS)[1]


@cache
def until(at: int, law: str, reckons: bool = False):
    """State of that flight at some tick, and parameters."""
    state, params = mission(law, reckons)
    return flown(state, params, at)[0], params


@pytest.mark.parametrize('law', ['adaptive', 'pid'])
@pytest.mark.parametrize('phase', PHASES)
@pytest.mark.parametrize('kind', WILD)
def test_a_wild_sample_does_not_show_in_the_track(law, phase, kind):
    """Nowhere is the vehicle more than 1 m from where it would have been, to either side."""
    expected = clean(law)
    in_phase = np.flatnonzero(expected[:, COLUMNS['stage']] == PHASES[phase])
    at = int(in_phase[len(in_phase) // 2])
    state, params = until(at, law)
    state, mask = tick(state, params, WILD[kind])
    assert mask & REFUSED
    state, after = flown(state, params, TICKS - at - 1)
    apart_m = np.abs(after[:, E2] - expected[at + 1 :, E2])
    assert np.max(apart_m) < 1.0
    assert abs(np.max(np.abs(after[:, E2])) - np.max(np.abs(expected[at + 1 :, E2]))) < 1.0
    assert not np.any(after[:, COLUMNS['guard']])


def beside(after: np.ndarray, expected: np.ndarray) -> float:
    """How far apart two flights were at most (m)."""
    return np.max(np.linalg.norm(after[:, PLACE] - expected[:, PLACE], axis=1))


@pytest.mark.parametrize('law', ['adaptive', 'pid'])
@pytest.mark.parametrize('kind', WILD_PARTS)
def test_a_wild_sample_of_a_part_does_not_show_where_the_vehicle_reckons(law, kind):
    """In dive, turn and climb, and at the surface, where alone there are fixes."""
    topic, corrupt = WILD_PARTS[kind]
    expected = clean(law, True)
    phases = [*PHASES.values(), WAITING_ON_SURFACE]
    stages = [np.flatnonzero(expected[:, COLUMNS['stage']] == phase) for phase in phases]
    ticks = [int(stage[len(stage) // 2]) for stage in stages]
    if topic == 'fix':  # the first one after the dive counts for most
        phase = expected[:, COLUMNS['phase']]
        ticks = [int(np.flatnonzero((phase[:-1] == AT_SURFACE) & (phase[1:] == FIXED))[0]) + 1]
    for at in ticks:
        state, params = until(at, law, True)
        state, mask = tick(state, params, corrupt, topic)
        assert mask & REFUSED or kind == 'fix 10 km off'  # that one could be one
        state, after = flown(state, params, TICKS - at - 1)
        assert beside(after, expected[at + 1 :]) < 1.0
        assert not np.any(after[:, COLUMNS['guard']])


def flown_with(state: MissionState, params, ticks: int, corrupt) -> tuple[MissionState, list, int]:
    """Some ticks with corrupted odometry; true depths (m) and the last mask."""
    depths, mask = [], 0
    for _ in range(ticks):
        state, mask = tick(state, params, corrupt)
        depths.append(state.plant.motion.p_d)
    return state, depths, mask


def in_dive(law: str = 'adaptive', depth_m: float = 60.0):
    """A mission on its way down."""
    return until(int(np.flatnonzero(-clean(law)[:, UP] > depth_m)[0]), law)


@pytest.mark.parametrize(
    ('kind', 'reason', 'law'),
    [
        ('depth that stands still', FROZEN, 'adaptive'),
        ('all that stands still', FROZEN, 'pid'),
        ('not a number', LOST, 'adaptive'),
        ('no attitude', LOST, 'pid'),
    ],
)
def test_a_measurement_that_fails_brings_the_vehicle_up_for_good(kind, reason, law):
    """At 60 m on its way to 250 m: it turns above 140 m and comes up, whatever is measured."""
    state, params = in_dive(law)
    state, depths, mask = flown_with(state, params, 5000, FAILS[kind](state, params))
    assert mask & reason
    assert max(depths) < 140.0
    assert depths[-1] < 1.0
    assert state.guard.command == params.guard.ascent.safe
    _, after = flown(state, params, 3000)  # the measurement is good again, the order stays
    assert np.all(after[:, COMMAND] == params.guard.ascent.safe)


def test_a_second_of_bad_measurements_is_bridged():
    state, params = in_dive()
    state, _, mask = flown_with(state, params, 10, lambda wire: 13 * (float('nan'),))
    assert mask & REFUSED
    assert not mask & SURFACES
    _, after = flown(state, params, 1000)
    assert not np.any(after[50:, COLUMNS['saturation']].astype(int) & REFUSED)
    assert not np.any(after[:, COLUMNS['guard']])


def test_an_abort_uses_the_whole_pump_and_surfaces_with_a_leak():
    """Aborted at 150 m, with half a kilogram too much, it sank to 964 m and stayed there."""
    state, params = in_dive(depth_m=150.0)
    leaky = params.plant.vehicle._replace(ballast=0.5)
    params = params._replace(plant=params.plant._replace(vehicle=leaky))
    state = state._replace(guidance=guidance_abort(state.guidance))
    state, log = flown(state, params, 20000)
    assert np.all(log[:, COMMAND][:, [0, 2, 3]] == (-1.0, 0.0, 0.0))
    mass = log[:, COMMAND][:, 1]
    up = int(np.argmax(mass == -0.06))  # level first: across its way it hardly sinks
    assert up > 0 and np.all(np.abs(mass[:up]) < 0.006)
    assert np.all(mass[up:] == -0.06)
    assert np.max(-log[:, UP]) < 180.0  # 1.4 kg at 4 g/s take six minutes
    assert -log[-1, UP] < 1.0


def test_a_heavy_vehicle_turns_by_itself():
    """The vertical-rate law waited while the vehicle sank: 1,181 m of 200 m."""
    changes = {'profile.depth_m': 200.0, 'perturb.net_heaviness_kg': 0.5, 'duration_s': 8000.0}
    state, params = mission_of(load_scenario('current_8deg', changes))
    _, log = flown(state, params, 80000)
    assert np.max(-log[:, UP]) < 320.0
    assert -log[-1, UP] < 1.0


def test_a_vehicle_below_its_rating_surfaces_and_says_so():
    """0.8 kg too heavy, its pump slow, it is stopped before it has overshot 1000 m by 40 m."""
    changes = {
        'perturb.net_heaviness_kg': 0.8,
        'perturb.pump_rate': 0.5,
        'initial.depth_m': 800.0,
        'duration_s': 4000.0,
        'dives': 0,
    }
    state, params = mission_of(load_scenario('current_8deg', changes))
    _, log = flown(state, params, 40000)
    mask, depth = log[:, COLUMNS['guard']].astype(int), -log[:, UP]
    first = int(np.flatnonzero(mask & TOO_DEEP)[0])
    assert np.max(depth) < 1040.0
    assert np.all(log[first:, COMMAND][:, [0, 2, 3]] == (-1.0, 0.0, 0.0))
    assert log[-1, COMMAND][1] == -0.06
    assert depth[-1] < np.max(depth) - 20.0


@pytest.mark.parametrize(
    ('changes', 'bit'),
    [
        ({'perturb.pump_rate': 1e-9}, STUCK_BUOYANCY),
        ({'perturb.roll_range': 0.0}, STUCK_ROLL),
    ],
)
def test_an_actuator_that_does_not_move_is_told(changes, bit):
    state, params = mission_of(load_scenario('current_12deg', {**FLIGHT, **changes}))
    _, log = flown(state, params, 6000)
    assert log[-1, COLUMNS['guard']].astype(int) & bit


def test_a_clean_flight_says_nothing():
    for law in ('adaptive', 'pid'):
        assert not np.any(clean(law)[:, COLUMNS['saturation']].astype(int) & ~7)
        assert not np.any(clean(law)[:, COLUMNS['guard']])
