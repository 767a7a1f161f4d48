# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""Direct engine: the same bits however it is run, and the symmetries of the world."""

import ast
import json
import math
import subprocess
import sys

import numpy as np
import pytest

from glider_base.signals import TICK_S
from glider_bringup.engines.direct import fly, fly_blocks
from glider_bringup.engines.flight import mission_of
from glider_mission.blocks import BLOCK_TICKS, COLUMNS, ROW
from glider_mission.scenario import load_scenario

#: A dive of 60 m and back within half an hour, so that a flight has everything in it.
SHALLOW = {
    'dives': 0,
    'duration_s': 1500.0,
    'profile.depth_m': 60.0,
    'initial.depth_m': 0.1,
    'control.law': 'pid',
}
ANGLES = slice(3, 7)
UP = COLUMNS['ground_truth/odom'].start + 2


def mission(name, **changes):
    """State at tick 0 and parameters; ``__`` in a field's name stands for its dot."""
    fields = {field.replace('__', '.'): value for field, value in changes.items()}
    scenario = load_scenario(name, {**SHALLOW, **fields})
    return mission_of(scenario)


def flown(state, params, block_ticks=BLOCK_TICKS, most=np.inf):
    """Log of a mission, flown in blocks of so many ticks: whole, or so many blocks."""
    blocks, finished = [], False
    while not finished and len(blocks) < most:
        log = np.full((block_ticks, ROW), np.nan)
        state, rows, finished = fly(state, params, log)
        blocks.append(log[:rows])
    return np.concatenate(blocks)


def column(log, name):
    return log[:, COLUMNS[name]]


def yaw(log):
    """Heading in the ENU sense (rad), from the quaternion on the wire."""
    w, x, y, z = column(log, 'odom')[:, ANGLES].T
    return np.unwrap(np.arctan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z)))


@pytest.fixture(scope='module')
def rough():
    """Log in rough water: shear, tide, Gauss-Markov current and stratification."""
    return flown(*mission('rough_water'))


def test_two_flights_agree_to_the_last_bit(rough):
    assert np.array_equal(flown(*mission('rough_water')), rough)


@pytest.mark.parametrize('block_ticks', [1, 7, 999, 14999, 15000, 15001])
def test_length_of_a_block_changes_no_bit(rough, block_ticks):
    log = flown(*mission('rough_water'), block_ticks, most=400)
    assert len(log) == min(len(rough), 400 * block_ticks)
    assert np.array_equal(log, rough[: len(log)])


def test_blocks_are_those_of_one_long_flight(rough):
    blocks = [block.copy() for block in fly_blocks(*mission('rough_water'))]
    assert np.array_equal(np.concatenate(blocks), rough)


def test_flight_leaves_its_initial_state_as_it_was(rough):
    state, params = mission('rough_water')
    assert len(state.current.values) > 0
    for _ in range(2):
        assert np.array_equal(np.concatenate([b.copy() for b in fly_blocks(state, params)]), rough)


#: Flies missions one after another and prints a digest of each one's log.
BATCH = """
import hashlib, json, sys
from glider_bringup.engines.direct import fly_blocks
from glider_bringup.engines.flight import mission_of
from glider_mission.scenario import load_scenario
digests = {}
for name in sys.argv[2:]:
    log = hashlib.sha256()
    for block in fly_blocks(*mission_of(load_scenario(name, json.loads(sys.argv[1])))):
        log.update(block.tobytes())
    digests[name] = log.hexdigest()
print(json.dumps(digests))
"""


def test_one_mission_is_the_same_bits_wherever_in_a_batch_in_any_process():
    batches = [
        ('rough_water', 'noisy_sensors', 'spline'),
        ('spline', 'noisy_sensors', 'rough_water'),
    ]
    command = [sys.executable, '-c', BATCH, json.dumps(SHALLOW)]
    processes = [
        subprocess.Popen([*command, *names], stdout=subprocess.PIPE, text=True)
        for names in batches
    ]
    printed = [json.loads(process.communicate(timeout=300)[0]) for process in processes]
    assert len(set(printed[0].values())) == 3
    assert printed[0] == printed[1]


def test_flight_lasts_as_many_ticks_as_asked(rough):
    assert len(rough) == round(SHALLOW['duration_s'] / TICK_S)
    assert np.all(np.isfinite(rough))


def test_first_row_is_the_initial_state():
    changes = {'initial__north_m': 30.0, 'initial__east_m': -4.0, 'initial__depth_m': 7.0}
    first = flown(*mission('current_8deg', duration_s=1.0, **changes))[0]
    assert first[COLUMNS['odom']][:3] == pytest.approx([-4.0, 30.0, -7.0], abs=1e-12)


def test_another_seed_is_another_flight(rough):
    other = flown(*mission('rough_water', seed=2))
    assert not np.array_equal(column(other, 'odom')[-1], column(rough, 'odom')[-1])


def test_seed_changes_nothing_where_nothing_is_random():
    logs = [flown(*mission('current_8deg', seed=seed)) for seed in (0, 5)]
    assert np.array_equal(*logs)


@pytest.mark.parametrize('method', ['los_current', 'los_zhang2021'])
def test_mirrored_current_mirrors_the_flight(method):
    """Starboard for port, along a path due north: east, roll and heading change their sign.

    The rotation by 90 deg between NED and ENU costs the last bits of the heading: 1 um, 1 urad.
    """
    fields = {'guidance__los__method': method, 'guidance__los__delta1_m': 100.0}
    starboard, port = (
        flown(*mission('current_8deg', current__angle_deg=angle, **fields))
        for angle in (8.0, -8.0)
    )
    east, north, up = column(starboard, 'odom')[:, :3].T
    assert np.max(np.abs(east)) > 5.0
    expected = np.stack([-east, north, up], axis=1)
    assert np.abs(column(port, 'odom')[:, :3] - expected).max() < 1e-6
    assert np.abs(yaw(port) + yaw(starboard) - math.pi).max() < 1e-6
    mass = column(starboard, 'command')
    assert np.abs(column(port, 'command') - mass * [1.0, 1.0, -1.0, 1.0]).max() < 1e-6


@pytest.mark.parametrize('course_deg', [90.0, 180.0, 225.0])
def test_turned_world_gives_the_same_flight(course_deg):
    """Path, current and vehicle turned: errors, actuators and depth as before, 1 mm and 1e-5."""
    changes = {'path__course_deg': course_deg, 'initial__heading_deg': course_deg}
    north, turned = flown(*mission('current_8deg')), flown(*mission('current_8deg', **changes))
    for name, tolerance in (('tracking_error', 1e-3), ('command', 1e-5), ('joint_states', 1e-5)):
        assert np.abs(column(turned, name) - column(north, name)).max() < tolerance, name
    assert np.abs(turned[:, UP] - north[:, UP]).max() < 1e-3


def test_still_vehicle_drifts_with_the_current():
    """Neutral, level and at rest in the water, commanded nothing: only the current moves it.

    The first tick finds the water already moving, and so does the vehicle at rest in it. A depth
    that is the same to the last bit is no measurement to the guard, which has to wait here.
    """
    waits = {'guard__still_s': 3600.0}
    state, params = mission('current_8deg', initial__depth_m=500.0, duration_s=600.0, **waits)
    control = params.control
    limits = control.allocation._replace(m_b_max=0.0, x_p_max=0.0, mu_max=0.0)
    params = params._replace(control=control._replace(allocation=limits))
    log = flown(state, params)
    speed = 1852.0 / 3600.0
    t = TICK_S * np.arange(len(log))
    drift = speed * t[:, None] * [math.sin(math.radians(8.0)), math.cos(math.radians(8.0)), 0.0]
    moved = column(log, 'odom')[:, :3] - column(log, 'odom')[0, :3]
    assert moved == pytest.approx(drift, abs=1e-6)


def test_steady_glide_sinks_as_the_polar_says():
    """After 500 s of a deep dive, against the polar of guidance: 2 % of the vertical rate."""
    log = flown(*mission('current_8deg', profile__depth_m=1000.0))
    descent = -(log[-1, UP] - log[9000, UP]) / (TICK_S * (len(log) - 1 - 9000))
    assert descent == pytest.approx(-log[-1, COLUMNS['reference']][9], rel=0.02)


def test_current_on_the_topic_is_that_of_the_scenario():
    """1.0 kn at 8 deg to starboard of due north, east first."""
    log = flown(*mission('current_8deg', duration_s=10.0))
    speed, angle = 1852.0 / 3600.0, math.radians(8.0)
    expected = [speed * math.sin(angle), speed * math.cos(angle), 0.0]
    assert column(log, 'current_velocity') == pytest.approx(
        np.broadcast_to(expected, (len(log), 3)), abs=1e-12
    )


def test_actuators_go_no_faster_than_they_can(rough):
    _, params = mission('rough_water')
    vehicle = params.plant.vehicle
    rates = np.abs(np.diff(column(rough, 'joint_states'), axis=0)) / TICK_S
    most = np.array([vehicle.m_b_rate, vehicle.x_p_rate, vehicle.mu_rate, 0.0])
    assert np.all(rates <= most + 1e-9)


def test_position_is_the_integral_of_the_velocity():
    """World velocity on the wire against position differences: 1 cm over the flight."""
    log = flown(*mission('current_8deg'))
    odom = column(log, 'odom')
    w, vector, body = odom[:, 3:4], odom[:, 4:7], odom[:, 7:10]
    t = 2.0 * np.cross(vector, body)
    world = body + w * t + np.cross(vector, t)
    way = np.cumsum(0.5 * TICK_S * (world[1:] + world[:-1]), axis=0)
    # the first velocity does not know of the water yet
    start = odom[1, :3] - way[0]
    assert np.abs(odom[2:, :3] - start - way[1:]).max() < 0.01


def test_mission_of_one_dive_ends_by_itself_at_the_surface():
    log = flown(*mission('current_8deg', dives=1, duration_s=20000.0))
    depth = -log[:, UP]
    assert len(log) * TICK_S < 3000.0
    assert np.max(depth) == pytest.approx(60.0, abs=3.0)
    assert np.all(depth[-600:] < 1.5)


INTERRUPTED = """
import signal

from glider_bringup.engines.direct import HeldMission
from glider_bringup.engines.flight import fly
from glider_bringup.engines.interrupts import end_as_interrupt
from glider_mission.scenario import load_scenario

scenario = load_scenario('current_8deg', {'dives': 0, 'duration_s': 10800.0})
flown = []
signal.signal(signal.SIGTERM, end_as_interrupt)
flies = HeldMission.fly


def fly_struck(self, log, halts=False):
    if shot and len(log):  # the first one compiles
        signal.setitimer(signal.ITIMER_REAL, 0.002)
    return flies(self, log, halts)


HeldMission.fly = fly_struck
for shot in range(10):
    number = (signal.SIGINT, signal.SIGTERM)[shot % 2]
    # a shell has SIGINT ignored in the background
    signal.signal(signal.SIGINT, (signal.default_int_handler, signal.SIG_IGN)[shot % 2])
    signal.signal(signal.SIGALRM, lambda *_: signal.raise_signal(number))
    began = []
    flight = fly(scenario, progress=lambda ticks, depth_m: began.append(ticks))
    flown.append((flight.reason, len(began)))
print(flown)
"""


def test_signals_within_compiled_code_end_the_flight():
    done = subprocess.run(
        [sys.executable, '-c', INTERRUPTED], capture_output=True, text=True, timeout=300
    )
    assert (done.returncode, done.stderr) == (0, '')
    first, *others = ast.literal_eval(done.stdout)
    assert first == ('', 12)
    assert others[::2] == 5 * [('stopped by SIGTERM', 1)]
    assert others[1::2] == 4 * [('stopped by SIGINT', 1)]
