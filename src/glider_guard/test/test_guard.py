# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""The guard alone: what it lets through, what it reacts to, and what stays."""

import math
from typing import NamedTuple

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from glider_base.frames import odometry_to_wire, quaternion_from_euler, rotate_to_body
from glider_base.kernel import kernel, replace
from glider_base.settings import ConfigurationError
from glider_base.signals import SURFACE_TARGET, TICK_S, Battery, Health, Joints, Odometry
from glider_base.wiring import NO_ECHO, WHEN_SILENT
from glider_guard import rows
from glider_guard.actuators import INITIAL_FOLLOWERS, follow
from glider_guard.ascent import INITIAL_ASCENT, Rise, come_up
from glider_guard.block import GUARD, guard_surface, guard_tick, say
from glider_guard.guard import GuardOutput, GuardParams, GuardState, Received, guard_step
from glider_guard.settings import GuardSettings
from glider_model.ocean.density import pressure_at
from glider_model.onboard.glide_polar import glide_vertical_rate
from glider_model.vehicle.file import changed_vehicle, load_vehicle

DIVES = Joints(0.4, 0.02, 0.1, 0.0)
RISES = Joints(-0.4, -0.02, 0.1, 0.0)
SAFE = (-1.0, -0.06, 0.0, 0.0)
#: Held level: the mass is within a few millimetres of its balance, by what the pitch shows.
LEVEL = pytest.approx((-1.0, 0.0, 0.0, 0.0), abs=0.004)
#: Vertical rate of a vehicle that is well (m/s).
RATE = 0.2


class Flight(NamedTuple):
    """What a vehicle does, however it is commanded."""

    pitch: float  #: (rad)
    rate: float  #: vertical (m/s, + down)
    joints: Joints  #: after the first tick
    follows: bool  #: its actuators are where they were sent instead
    says_where: bool  #: it tells its own odometry, not the one that is received
    says_depth: bool  #: it tells its own depth


class Where(NamedTuple):
    """Where a vehicle is after some time."""

    depth: float  #: (m)
    time_s: float
    joints: Joints


@kernel
def seen_at(where, rate, pitch):
    """Pitched, moving down at a rate; no two samples are the same."""
    q_w, q_x, q_y, q_z = quaternion_from_euler(0.0, pitch, 0.0)
    u, v, w = rotate_to_body(q_w, q_x, q_y, q_z, 0.3, 0.0, rate)
    p_n, p_d = where.time_s, where.depth
    return Odometry(p_n, 0.0, p_d, q_w, q_x, q_y, q_z, u, v, w, 0.0, 0.0, 0.0)


@kernel
def fly_on(state, out, where, ticks, flight, at, params, dt):
    """Fly some ticks, and hear the same but for the place."""
    for _ in range(ticks):
        odometry = seen_at(where, flight.rate, flight.pitch) if flight.says_where else at.odometry
        depth = where.depth if flight.says_depth else at.depth
        received = replace(at, odometry=odometry, depth=depth, joints=where.joints)
        state, out = guard_step(state, received, params, dt)
        joints = out.command if flight.follows else flight.joints
        where = Where(max(0.0, where.depth + dt * flight.rate), where.time_s + dt, joints)
    return state, out, where


class Vehicle:
    """A vehicle that does what it is told, unless a test says else."""

    def __init__(self, depth_m: float = 100.0, vehicle: str = 'zhang2021', **changes) -> None:
        self.settings = GuardSettings(vehicle=vehicle, **changes)
        self.params: GuardParams = self.settings.params()
        self.state: GuardState = self.settings.initial_state()
        self.depth, self.target, self.time_s, self.pitch_deg = depth_m, 300.0, 0.0, 0.0
        self.joints = DIVES
        self.out = GuardOutput(DIVES, False, 0)

    def odometry(self, rate: float) -> Odometry:
        """What it tells of where it is."""
        return seen_at(self._where(), rate, math.radians(self.pitch_deg))

    def _where(self) -> Where:
        return Where(float(self.depth), self.time_s, self.joints)

    def go(self, seconds: float, demand=DIVES, rate: float = RATE, joints=None, **received) -> int:
        """Fly on; rows at the end. Without ``joints`` actuators are where they were sent."""
        known = (self.target, float(self.depth), NO_ECHO, WELL, POWER)
        at = Received(demand, self.odometry(rate), self.joints, *known)._replace(**received)
        flight = Flight(
            pitch=math.radians(self.pitch_deg),
            rate=float(rate),
            joints=joints or self.joints,
            follows=joints is None,
            says_where='odometry' not in received,
            says_depth='depth' not in received,
        )
        ticks, where = round(seconds / TICK_S), self._where()
        self.state, self.out, where = fly_on(
            self.state, self.out, where, ticks, flight, at, self.params, TICK_S
        )
        self.depth, self.time_s, self.joints = where
        return self.out.reported


class Case(NamedTuple):
    """How to bring a row about, and for how long nothing is told (s)."""

    begin: dict
    flown: dict
    quiet_s: float


NAN = Joints(math.nan, 0.0, 0.0, 0.0)
WELL = Health(0.0, 23700.0, 100.0)
POWER = Battery(15.0, -0.1, 200.0, 225.0, 0.9)
#: One case for each row, by its name.
CASES = {
    'buoyancy_engine_stuck': Case({}, {'joints': Joints(0.2, 0.02, 0.1, 0.0)}, 55.0),
    'pitch_mass_stuck': Case({}, {'joints': Joints(0.4, 0.0, 0.1, 0.0)}, 55.0),
    'roll_mass_stuck': Case({}, {'joints': Joints(0.4, 0.02, 0.5, 0.0)}, 55.0),
    'surface_ordered': Case({}, {'target': SURFACE_TARGET}, 0.0),
    'too_deep': Case({'depth_m': 999.5}, {'rate': 0.1}, 3.5),
    # 50 m before 1250, and what it sinks on
    'crush_depth': Case({'depth_m': 1150.0}, {'rate': 0.2}, 220.0),
    'near_bottom': Case({'altitude': True}, {'altitude': 2.5}, 1.5),
    'overdepth': Case({'depth_m': 300.0}, {'rate': 0.2}, 525.0),
    'not_climbing': Case(
        {'depth_m': 200.0}, {'demand': RISES, 'rate': 0.02, 'target': 5.0}, 895.0
    ),
    'stalled': Case({}, {'rate': 0.002}, 1795.0),
    'under_too_long': Case({'under_water_s': 500.0}, {'rate': 0.2}, 495.0),
    'measurement_frozen': Case({}, {'rate': 0.0}, 25.0),
    'measurement_lost': Case({}, {'odometry': Odometry(*(13 * (math.nan,)))}, 0.0),
    'depth_disagrees': Case({'pressure': True}, {'depth': 50.0}, 25.0),
    'depth_wrong': Case({'pressure': True}, {'depth': 60.0}, 0.8),
    'demand_lost': Case({}, {'demand': NAN}, 0.8),
    'leak': Case({}, {'health': WELL._replace(leak=1.0), 'rate': -0.1}, 9.5),
    'vacuum': Case({}, {'health': WELL._replace(vacuum_pa=2000.0)}, 9.5),
    'battery': Case({}, {'battery': POWER._replace(voltage=9.0)}, 9.5),
    'no_contact': Case({}, {'health': WELL._replace(contact_age_s=3e5)}, 0.0),
}


def brought(name: str) -> tuple[Vehicle, Case]:
    """A vehicle just before a row holds."""
    case, vehicle = CASES[name], Vehicle(**CASES[name].begin)
    vehicle.go(1.0)
    return vehicle, case


@pytest.mark.parametrize('name', CASES)
def test_a_row_is_told_in_time_and_reacted_to_as_it_says(name):
    row = next(one for one in rows.ROWS if one.name == name)
    vehicle, case = brought(name)
    flown = dict(case.flown)
    if 'odometry' in flown or name == 'measurement_frozen':
        flown.setdefault('odometry', vehicle.odometry(0.0))
    if case.quiet_s:
        assert not vehicle.go(case.quiet_s, **flown) & row.bit
    told = vehicle.go(60.0, **flown)
    assert told & row.bit
    assert rows.reaction_of(told) >= row.reaction
    demand = flown.get('demand', DIVES)
    if rows.reaction_of(told) == rows.HOLD:
        assert vehicle.out.command == (demand.m_b, demand.x_p, 0.0, 0.0)
    else:  # the mass waits for the pump
        assert vehicle.out.command == SAFE or vehicle.out.command == LEVEL
    assert vehicle.out.drops == (row.reaction == rows.DROP)


def test_every_row_has_a_case():
    # each in a test of its own
    apart = {'not_rising', 'steering_surface_stuck', 'too_heavy', 'depth_offset'}
    apart |= {'fixes_contradict', 'astray'}
    assert set(CASES) | apart == {row.name for row in rows.ROWS}
    bits = [row.bit for row in rows.ROWS]
    assert len(set(bits)) == len(bits) and all(bit.bit_count() == 1 for bit in bits)


@pytest.mark.parametrize('name', CASES)
def test_what_latches_stays_and_the_rest_goes(name):
    row = next(one for one in rows.ROWS if one.name == name)
    vehicle, case = brought(name)
    flown = dict(case.flown)
    if name == 'measurement_frozen':
        flown['odometry'] = vehicle.odometry(0.0)
    vehicle.go(case.quiet_s + 60.0, **flown)
    vehicle.depth, vehicle.target = 100.0, 300.0
    assert bool(vehicle.go(5.0) & row.bit) == row.latches


@pytest.mark.parametrize('demands', [(0.52, 0.22), (0.52,)], ids=['swings', 'stands'])
@pytest.mark.parametrize(
    ('pump', 'is_told'),
    [('follows', False), ('stuck', True), ('runs away', True)],
)
def test_a_pump_follows_that_goes_towards_its_command(pump, is_told, demands):
    """A demand that swings by 0.15 kg every 4 s is too fast for a pump of 0.004 kg/s."""
    limits = Vehicle().params.actuators
    at, state, told = 0.37, INITIAL_FOLLOWERS, 0
    step = {'follows': 0.004, 'stuck': 0.0, 'runs away': -0.004}[pump] * TICK_S
    for demand in 50 * demands:
        for _ in range(40):
            state, now = follow(state, at_rest(at), at_rest(demand), limits, TICK_S)
            told |= now
            at += math.copysign(step, (demand - at) * step) if step else 0.0
    assert told == (rows.STUCK_BUOYANCY if is_told else 0)


def at_rest(pump_kg):
    """Actuators, of which the pump alone is anywhere."""
    return Joints(pump_kg, 0.0, 0.0, 0.0)


def test_a_fin_that_does_not_move_is_held():
    values = {'range': 26.0, 'rate': 1.2, 'area': 0.05, 'lift_slope': 3.0, 'x': -1.2}
    fin = {f'fin.{name}': value for name, value in {**values, 'turn_rate': 0.5}.items()}
    vehicle = Vehicle(vehicle=changed_vehicle('zhang2021', fin))
    turns = Joints(0.4, 0.02, 0.0, 0.3)
    assert vehicle.go(70.0, demand=turns, joints=turns._replace(delta=0.0)) == rows.STUCK_SURFACE
    assert vehicle.out.command == turns._replace(delta=0.0)


def test_the_weight_goes_when_nothing_else_helps_and_not_before():
    vehicle = Vehicle()
    vehicle.go(1.0)
    vehicle.target = SURFACE_TARGET
    assert vehicle.go(600.0, rate=0.05) == rows.ORDERED  # it still sinks
    assert not vehicle.out.drops
    told = vehicle.go(650.0, rate=0.05)
    assert told & rows.NOT_RISING and vehicle.out.drops
    assert vehicle.out.command == LEVEL
    vehicle.go(60.0, rate=-0.2)
    assert vehicle.out.command == SAFE


def test_a_depth_that_is_frozen_is_no_reason_to_drop_the_weight_at_once():
    """From 100 m it has 1200 s, and 667 s at 0.15 m/s; who has contact has come up."""
    vehicle, received = Vehicle(), Vehicle()
    for one, age_s, dropped in ((vehicle, 100.0, True), (received, 0.0, False)):
        one.go(1.0)
        frozen, health = one.odometry(0.0), WELL._replace(contact_age_s=age_s)
        assert one.go(1700.0, odometry=frozen) & rows.FROZEN
        assert not one.out.drops
        assert bool(one.go(400.0, odometry=frozen, health=health) & rows.NOT_RISING) == dropped
        assert one.out.drops == dropped


@pytest.mark.parametrize(
    ('depth_m', 'age_s', 'drops'),
    [(4.0, 100.0, True), (4.0, 0.0, False), (4.0, -1.0, False), (1.0, 100.0, False)],
)
def test_who_hangs_just_below_the_surface_and_is_not_heard_lets_the_weight_go(
    depth_m, age_s, drops
):
    """Neither one that has contact does, nor one that could have none, nor one afloat."""
    vehicle, health = Vehicle(depth_m=depth_m), WELL._replace(contact_age_s=age_s)
    vehicle.target = SURFACE_TARGET
    vehicle.go(1200.0, rate=0.0, health=health)
    assert not vehicle.out.drops
    assert bool(vehicle.go(60.0, rate=0.0, health=health) & rows.NOT_RISING) == drops
    assert vehicle.out.drops == drops


def test_a_leak_that_nobody_can_see_the_end_of_costs_the_weight():
    vehicle = Vehicle()
    vehicle.go(1.0)
    frozen, leak = vehicle.odometry(0.0), WELL._replace(leak=1.0)
    told = vehicle.go(60.0, odometry=frozen, health=leak)
    assert told & rows.FROZEN and told & rows.LEAK and vehicle.out.drops


def test_a_leak_costs_the_weight_where_it_sinks_with_the_pump_out_and_not_else():
    leak = WELL._replace(leak=1.0)
    for rate, drops in ((-0.1, False), (0.1, True)):
        vehicle = Vehicle(depth_m=500.0)
        vehicle.go(1.0)
        vehicle.go(60.0, rate=rate, health=leak)
        assert vehicle.out.drops == drops


@pytest.mark.parametrize('pressure', [True, False])
def test_the_same_sample_is_none(pressure):
    """After 30 s and a sampling period under water, of a sensor without steps."""
    for steps_m, told in ((0.0, rows.FROZEN), (1.0, 0)):
        vehicle = Vehicle(pressure=pressure, depth_resolution_m=steps_m, imu_period_s=4.0)
        vehicle.go(1.0)
        depth = vehicle.depth
        for second in range(40):
            vehicle.depth = depth
            odometry = vehicle.odometry(0.0)
            told_now = vehicle.go(1.0, rate=0.0, odometry=odometry, depth=depth)
            assert second > 30 or told_now == 0
        assert told_now & rows.FROZEN == told


@pytest.mark.parametrize('share', [0.0, 0.05, 0.15])
@pytest.mark.parametrize('shown_m', [100.0, 0.0])
def test_heavy_and_nose_down_it_does_not_stay_at_one_depth(share, shown_m):
    """A sensor that shows one depth, or a part of the way, and noise; level, that is no alarm.

    At 0 m its port is blocked: it is where it was led to. With the antenna out it is afloat.
    """
    afloat = WELL._replace(contact_age_s=0.0)
    for pitch_deg, health in ((-25.0, WELL), (0.0, WELL), (-25.0, afloat)):
        vehicle = Vehicle(depth_m=shown_m)
        vehicle.go(1.0)
        vehicle.pitch_deg = pitch_deg
        rate = share * glide_vertical_rate(math.radians(-25.0), 0.4, vehicle.params.weight.polar)
        deepest = 0.0
        for second in range(600):
            vehicle.depth = shown_m + rate * second + 0.1 * (second % 3)
            now = vehicle.go(1.0, rate=rate, health=health)
            deepest = max(deepest, vehicle.state.witness.depth)
        is_told = pitch_deg < 0.0 and health is WELL
        assert bool(now & rows.FROZEN) == is_told
        assert share > 0.0 or not is_told or deepest > vehicle.params.depth.led_m


@pytest.mark.parametrize(
    ('shown_m', 'told'),
    [(1.0, 0), (-12.0, rows.DEPTH_OFFSET), (12.0, rows.DEPTH_OFFSET), (-60.0, rows.DEPTH_WRONG)],
)
def test_the_depth_is_checked_at_the_surface(shown_m, told):
    """'depth_offset' lets it dive, by the depth that is right."""
    vehicle = Vehicle(depth_m=shown_m, pressure=True)
    out = WELL._replace(contact_age_s=0.0)
    for second in range(60):
        vehicle.depth = shown = shown_m + 0.01 * (second % 3)
        now = vehicle.go(1.0, odometry=vehicle.odometry(0.0), depth=shown, health=out)
    assert now == told
    assert bool(now & rows.SURFACES) == (told == rows.DEPTH_WRONG)
    if told == rows.DEPTH_OFFSET:
        assert vehicle.state.witness.depth == pytest.approx(0.0, abs=0.1)


@pytest.mark.parametrize(
    ('jump_m', 'sensor', 'told'),
    [
        (-20.0, {}, True),
        (8.0, {}, True),
        (4.0, {}, False),
        (8.0, {'depth_resolution_m': 5.0}, False),
        (8.0, {'position_std_m': 1.0}, False),
        (18.0, {'position_std_m': 1.0}, True),
    ],
)
def test_a_depth_that_jumps_under_water_is_wrong(jump_m, sensor, told):
    """By more than its steps, or its noise, and whatever the gate lets through."""
    vehicle = Vehicle(pressure=True, **sensor)
    vehicle.go(10.0)
    vehicle.depth += jump_m
    assert bool(vehicle.go(10.0) & rows.DEPTH_WRONG) == told


def test_what_is_gone_while_the_guard_is_paused_is_no_lag():
    """A managed node that is deactivated now and then, and a depth that stands still meanwhile."""
    for sinks, told in ((True, 0), (False, rows.FROZEN)):
        settings = GuardSettings()
        state, params, t_s, depth_m = settings.initial_state(), settings.params(), 0.0, 100.0
        for second in range(150):
            t_s += 29.0 * (second % 3 == 0)  # and 3 s of it is seen
            depth_m += 0.15 * 29.0 * (second % 3 == 0)
            for _ in range(10):
                t_s, depth_m = t_s + TICK_S, depth_m + 0.15 * TICK_S
                seen = seen_at(Where(depth_m if sinks else 100.0, t_s, DIVES), 0.15, -0.3)
                odom = (*odometry_to_wire(seen), *(4 * (0.0,)))
                said = {'reference': (0.0, 0.0, -1000.0, *odom[3:13]), 'odom': odom}
                said['pressure'] = (pressure_at(-odom[2]),)
                said |= {'demand': tuple(DIVES), 'joint_states': tuple(DIVES), **WHEN_SILENT}
                inputs = tuple(said[name] for name in GUARD.wired.inputs)
                state, _, flags = guard_tick(state, t_s, inputs, params, TICK_S)
        assert flags[0] & rows.FROZEN == told


def test_a_depth_that_jumps_at_the_surface_has_an_offset():
    vehicle = Vehicle(depth_m=0.5, pressure=True)
    out = WELL._replace(contact_age_s=0.0)
    for second in range(120):
        vehicle.depth = shown = (0.5 if second < 60 else 12.0) + 0.01 * (second % 3)
        now = vehicle.go(1.0, odometry=vehicle.odometry(0.0), depth=shown, health=out)
    assert now == rows.DEPTH_OFFSET


@pytest.mark.parametrize(('swing_m', 'told'), [(4.6, True), (5.6, False)])
def test_who_moves_by_more_than_a_few_metres_does_not_stand_still(swing_m, told):
    """A yo of a minute by a pump that is too slow for it; one that hangs may swing, too."""
    vehicle, now, turns = Vehicle(depth_m=20.0), 0, 2.0 * math.pi / 60.0
    for second in range(2400):
        rate = 0.5 * swing_m * turns * math.cos(turns * second)
        vehicle.target = 100.0 if rate > 0.0 else 0.0
        now |= vehicle.go(1.0, rate=rate)
    assert bool(now & rows.STALLED) == told


@pytest.mark.parametrize(
    ('sinks_mps', 'swing_m', 'period_s', 'told'),
    [(0.009, 4.0, 420.0, True), (0.013, 4.0, 420.0, False), (0.0, 44.0, 1080.0, True)],
)
def test_who_is_asked_down_and_swings_near_one_depth_stalls(sinks_mps, swing_m, period_s, told):
    """As one that stalls and is brought out of it again and again, in even water and denser."""
    vehicle, now, turns = Vehicle(depth_m=80.0), 0, 2.0 * math.pi / period_s
    vehicle.target = 200.0
    for second in range(4000):
        now |= vehicle.go(1.0, rate=sinks_mps + 0.5 * swing_m * turns * math.cos(turns * second))
    assert bool(now & rows.STALLED) == told


@pytest.mark.parametrize(('depth_m', 'period_s'), [(590.0, 6.0), (8.2, 0.1)])
def test_who_stands_still_is_seen_through_noise(depth_m, period_s):
    """Noise of 1 m, a sample now and then or a few metres deep, and no way up or down."""
    vehicle, draw, now = Vehicle(imu_period_s=period_s), np.random.default_rng(3), 0
    for _ in range(round(2000.0 / period_s)):
        vehicle.depth = depth_m + draw.normal()
        now |= vehicle.go(period_s, rate=0.0)
    assert now & rows.STALLED


@pytest.mark.parametrize(('pitch_deg', 'demand'), [(-25.0, DIVES), (25.0, RISES)])
def test_a_vehicle_that_is_heavier_than_its_pump_says_comes_up(pitch_deg, demand):
    """By 0.9 kg of 1.0 it flies on, by 1.1 kg it does not; the weights are those of the polar."""
    for unknown_kg in (0.9, 1.1):
        vehicle = Vehicle(depth_m=10.0)
        vehicle.target, vehicle.pitch_deg = 900.0, pitch_deg
        rate = glide_vertical_rate(
            math.radians(-25.0), demand.m_b + unknown_kg, vehicle.params.weight.polar
        )
        told = vehicle.go(1200.0, demand=demand, rate=rate)
        assert bool(told & rows.TOO_HEAVY) == (unknown_kg > 1.0)
        assert bool(told & rows.NOT_RISING) == (unknown_kg > 1.0)  # it sinks with its pump out


@pytest.mark.parametrize(('growth', 'told'), [(2e-4, False), (3e-4, True)])
def test_a_vehicle_that_grows_heavier_in_a_dive_turns_while_it_can(growth, told):
    """Of 1 kg that its pump can take off, it needs 0.8 or 1.2 by the end of the dive."""
    vehicle = Vehicle(depth_m=10.0)
    vehicle.target, vehicle.pitch_deg = 900.0, -25.0
    rate = glide_vertical_rate(math.radians(-25.0), 0.4, vehicle.params.weight.polar)
    while vehicle.depth < 890.0 and not vehicle.out.reported:
        unknown = growth * vehicle.time_s
        vehicle.go(10.0, demand=DIVES._replace(m_b=0.4 - unknown), rate=rate)
    assert bool(vehicle.out.reported & rows.TOO_HEAVY) == told
    assert not told or unknown < 0.8


def test_what_growth_takes_of_a_climb_is_not_weighed():
    """Of 0.87 kg that a climb lacks, twice the drag may be 0.08, since 0.08 are left."""
    vehicle = Vehicle(depth_m=600.0)
    vehicle.target, vehicle.pitch_deg = 5.0, 25.0
    demand = RISES._replace(m_b=-0.95)
    rate = glide_vertical_rate(math.radians(25.0), -0.08, vehicle.params.weight.polar)
    assert vehicle.go(850.0, demand=demand, rate=rate) == 0
    assert vehicle.state.weight.off > 0.8 > vehicle.state.weight.least


def test_a_vehicle_is_weighed_by_its_mean_vertical_rate():
    """Errors of 0.1 m/s from sample to sample, every 8 s, weigh nothing."""
    draw = np.random.default_rng(0)
    vehicle = Vehicle(depth_m=10.0, imu_period_s=8.0)
    vehicle.target, vehicle.pitch_deg = 900.0, -25.0
    true = glide_vertical_rate(math.radians(-25.0), DIVES.m_b, vehicle.params.weight.polar)
    for error in draw.normal(0.0, 0.1, 100):
        vehicle.go(8.0, demand=DIVES, rate=true + error)
    assert abs(vehicle.state.weight.off) < 0.1


def test_one_bad_sample_sets_no_zero_of_the_depth():
    vehicle, out = Vehicle(depth_m=0.0, pressure=True), WELL._replace(contact_age_s=0.0)
    for second in range(60):
        vehicle.depth, shown = 0.0, 5.5 if second == 40 else 0.01 * (second % 3)
        now = vehicle.go(1.0, odometry=vehicle.odometry(0.0), depth=shown, health=out)
        assert now == 0


def test_a_vehicle_that_sinks_fast_is_stopped_in_time():
    """Sent down, at 0.8 m/s: held level it sinks on by 48 m, of which 40 m may be too deep."""
    vehicle = Vehicle(depth_m=700.0)
    vehicle.target, vehicle.pitch_deg = 990.0, -50.0
    while not vehicle.go(1.0, demand=DIVES._replace(m_b=1.0), rate=0.8):
        pass
    assert vehicle.out.reported == rows.TOO_DEEP
    assert vehicle.depth == pytest.approx(992.0, abs=2.0)


@pytest.mark.parametrize('pump_kg', [0.2, -0.96])
def test_a_vehicle_is_level_while_it_sinks_and_nose_up_while_it_rises(pump_kg):
    """Wherever its pump is: nose up it may slide down tail first. A turn alone is no rise."""
    vehicle = Vehicle(depth_m=200.0, stall_s=3600.0)
    vehicle.go(1.0, rate=0.2)
    vehicle.target, pump = SURFACE_TARGET, Joints(pump_kg, 0.0, 0.0, 0.0)
    for rate, for_s, command in (
        (0.2, 250.0, LEVEL),
        (-0.2, 5.0, LEVEL),
        (0.2, 20.0, LEVEL),
        (-0.1, 60.0, SAFE),
        (0.1, 60.0, LEVEL),
    ):
        vehicle.go(for_s, rate=rate, joints=pump)
        assert vehicle.out.command == command


def test_a_vehicle_that_hardly_rises_with_its_nose_up_is_held_level_for_a_while():
    """It may be in a stall that it does not leave by itself: five minutes each way."""
    vehicle = Vehicle(depth_m=500.0, stall_s=3600.0)
    pump = Joints(-0.96, 0.0, 0.0, 0.0)
    vehicle.target, asked = SURFACE_TARGET, []
    for _ in range(120):
        pump = pump._replace(x_p=vehicle.out.command.x_p)
        vehicle.go(20.0, rate=-0.012, joints=pump)
        asked.append(vehicle.out.command == SAFE)
    assert 0.4 < sum(asked) / len(asked) < 0.6
    assert 3 <= sum(now and not then for then, now in zip(asked, asked[1:], strict=False)) <= 5
    vehicle.depth = 0.0
    vehicle.go(400.0, rate=0.0, joints=pump)
    for _ in range(60):
        vehicle.go(20.0, rate=0.0, joints=pump)
        assert vehicle.out.command == SAFE


def test_a_mass_that_takes_an_hour_to_its_stop_gets_there():
    """At a hundredth of its rate: level again every five minutes it would be nowhere ever."""
    vehicle, x_p = Vehicle(depth_m=500.0, stall_s=3600.0), 0.0
    vehicle.target = SURFACE_TARGET
    for _ in range(200):
        pump = Joints(-0.96, x_p, 0.0, 0.0)
        vehicle.go(20.0, rate=-0.012 if x_p > -0.05 else -0.2, joints=pump)
        x_p += max(-0.0004, min(0.0004, vehicle.out.command.x_p - x_p))
    assert x_p < -0.055 and vehicle.out.command == SAFE


@pytest.mark.parametrize(('pump_kg', 'up'), [(-0.18, -0.08), (-0.18, 0.2), (0.18, -0.08)])
def test_a_light_vehicle_that_hangs_in_sinking_water_turns_its_nose_up(pump_kg, up):
    """Level it sinks by 4 mm/s. Nose up it rises, which it does until it is up, or slides down."""
    vehicle, pump = Vehicle(depth_m=50.0, stall_s=3600.0), Joints(pump_kg, 0.0, 0.0, 0.0)
    vehicle.target, asked = SURFACE_TARGET, []
    for _ in range(120):
        turned = bool(asked) and asked[-1]
        vehicle.go(20.0, rate=up if turned else 0.004, joints=pump)
        asked.append(vehicle.out.command == SAFE)
    if pump_kg > 0.0:
        assert not any(asked)
    elif up < 0.0:
        assert sum(asked) > 60 and all(asked[asked.index(True) :])
    else:  # one that it makes slide is level again within a minute, and tries no more often
        assert 2 <= sum(asked) <= 15


def test_a_vehicle_that_cannot_see_turns_nose_up_when_its_pump_had_the_time():
    vehicle = Vehicle(depth_m=200.0, stall_s=3600.0)
    vehicle.go(1.0)
    frozen = vehicle.odometry(0.0)
    while not vehicle.go(1.0, odometry=frozen, joints=Joints(0.2, 0.0, 0.0, 0.0)) & rows.FROZEN:
        pass
    assert vehicle.out.command == LEVEL
    vehicle.go(500.0, odometry=frozen, joints=Joints(0.2, 0.0, 0.0, 0.0))
    assert vehicle.out.command == SAFE


def test_a_vehicle_that_rises_keeps_its_weight():
    vehicle = Vehicle(depth_m=900.0)
    vehicle.target = SURFACE_TARGET
    assert vehicle.go(4000.0, rate=-0.2) == rows.ORDERED
    assert not vehicle.out.drops


def test_a_vehicle_that_does_not_say_how_it_is_is_well():
    unknown = Battery(-1.0, 0.0, -1.0, -1.0, -1.0)
    assert Vehicle().go(100.0, health=Health(0.0, -1.0, -1.0), battery=unknown) == 0


@pytest.mark.parametrize(('left', 'row'), [(0.11, 0), (0.09, rows.BATTERY)])
def test_what_is_not_usable_of_the_battery_brings_the_vehicle_up(left, row):
    """The file of zhang2021 says that nine tenths of its battery are usable."""
    assert Vehicle().go(15.0, battery=POWER._replace(percentage=left)) == row


def test_no_earlier_than_ten_minutes():
    with pytest.raises(ValueError, match='drop_after_s'):
        GuardSettings(drop_after_s=599.0)


def test_a_glide_down_and_up_is_let_through_untouched():
    vehicle = Vehicle(depth_m=1.0)
    for demand, rate in ((DIVES, RATE), (RISES, -RATE)) * 2:
        assert vehicle.go(1450.0, demand=demand, rate=rate) == 0
        assert vehicle.out.command is demand or vehicle.out.command == demand


@settings(max_examples=100)
@given(st.lists(st.floats(width=64), min_size=32, max_size=32), st.integers(1, 30))
def test_whatever_it_hears_the_command_is_within_the_ranges(numbers, ticks):
    vehicle = Vehicle()
    vehicle.go(1.0)
    demand, joints, odometry = Joints(*numbers[:4]), Joints(*numbers[4:8]), numbers[8:21]
    told = (*numbers[21:24], Health(*numbers[24:27]), Battery(*numbers[27:]))
    at = Received(demand, Odometry(*odometry), joints, *told)
    state = vehicle.state
    most = Joints(*(1.5 * limit for limit in vehicle.params.actuators.range))
    for _ in range(ticks):
        state, out = guard_step(state, at, vehicle.params, TICK_S)
        assert all(abs(x) <= limit for x, limit in zip(out.command, most, strict=True))


def test_an_order_is_followed_and_told():
    vehicle = Vehicle()
    vehicle.go(1.0)
    vehicle.state = guard_surface(vehicle.state)
    assert vehicle.go(1.0) == rows.ORDERED
    said = say(rows.ORDERED)
    assert said.level == 'error' and said.message == 'surface: ordered to the surface'
    assert said.values == {'guard': rows.ORDERED, 'reaction': 'surface'}
    assert say(0).level == 'ok' and say(rows.STUCK_ROLL).level == 'warn'
    assert GUARD.quiet == (0,)


def test_a_hull_that_crushes_above_its_rating_is_refused():
    with pytest.raises(ConfigurationError, match=r'crush_depth: 900 m \(allowed: > 1000 m'):
        load_vehicle(changed_vehicle('zhang2021', {'crush_depth': 900.0}))


def test_a_slow_dive_with_the_pump_on_its_light_side_is_no_climb():
    vehicle = Vehicle(depth_m=20.0)
    assert not vehicle.go(1800.0, demand=DIVES._replace(m_b=-0.05), rate=0.04)


HANGS = Rise(
    rate=0.0,
    sees=True,
    moves=True,
    under=True,
    theta=0.0,
    is_new=True,
    m_b=-1.0,
    x_p=0.0,
    is_there=True,
)


def test_a_slow_way_up_is_seen_through_what_the_rate_errs_by():
    """In a stall it rises at 0.012 m/s: held level it comes out of it, but not at 0.08 m/s."""
    draw = np.random.default_rng(2)
    limits = Vehicle().params.ascent
    for rate, sees, levels in (
        (-0.012, True, True),
        (-0.08, True, False),
        (-0.012, False, True),  # a rate that is not believed may show one still
        (-0.08, False, False),
    ):
        state, sent = INITIAL_ASCENT, []
        for error in draw.normal(0.0, 0.4, 20000):
            at = HANGS._replace(rate=rate + error, sees=sees)
            state, command = come_up(state, at, limits, TICK_S)
            sent.append(command.x_p != limits.safe.x_p)
        held = np.count_nonzero(sent[1000:])  # at first it lies level until it rises
        assert (held > 2000) == levels
        assert levels or not held


@pytest.mark.parametrize('nose_deg', [-8.0, 3.0, 8.0])
def test_a_vehicle_out_of_balance_is_held_level_by_its_pitch(nose_deg):
    """A part that broke off turns its nose by so much where the scale says that it is level.

    The pitch of a hull at rest, by its moments alone.
    """
    limits, state, x_p, theta = Vehicle().params.ascent, INITIAL_ASCENT, 0.0, 0.0
    mass = limits.mass
    s_z = mass.s_z + mass.m_p * mass.R_p
    broken = -s_z * math.tan(math.radians(nose_deg))
    for _ in range(6000):
        s_x = broken + mass.s_x + mass.m_p * (mass.x_p0 + x_p) + 0.1 * mass.pump_x
        theta = math.atan2(-s_x, s_z)
        at = HANGS._replace(rate=0.1, theta=theta, m_b=0.1, x_p=x_p)
        state, command = come_up(state, at, limits, TICK_S)
        x_p += max(-0.002, min(0.002, command.x_p - x_p))
    assert math.degrees(theta) == pytest.approx(0.0, abs=0.2)


def test_a_pitch_that_errs_leaves_the_mass_near_its_balance():
    """One that stands at 40 deg, and one that comes no more."""
    limits = Vehicle().params.ascent
    mass = limits.mass
    within = (mass.s_z + mass.m_p * mass.R_p) * math.tan(math.radians(10.0)) / mass.m_p
    for is_new, most in ((True, within), (False, 0.0)):
        state = INITIAL_ASCENT
        at = HANGS._replace(rate=0.1, theta=math.radians(40.0), is_new=is_new, m_b=0.0)
        balance = -mass.s_x / mass.m_p - mass.x_p0
        for _ in range(6000):
            state, command = come_up(state, at, limits, TICK_S)
        assert abs(command.x_p - balance) == pytest.approx(most, abs=1e-4)
