# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""The guard alone: what it lets through, what it reacts to, and what stays."""

import math
from typing import NamedTuple

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from glider_guard import rows
from glider_guard.block import GUARD, guard_surface, say
from glider_guard.guard import GuardOutput, GuardParams, GuardState, Heard, guard_step
from glider_guard.settings import GuardSettings
from glider_model.base.frames import quaternion_from_euler, rotate_to_body
from glider_model.base.settings import ConfigurationError
from glider_model.base.signals import SURFACE_TARGET, TICK_S, Battery, Health, Joints, Odometry
from glider_model.base.wiring import NO_ECHO
from glider_model.onboard.glide_polar import glide_vertical_rate
from glider_model.vehicle.file import changed_vehicle, load_vehicle

DIVES = Joints(0.4, 0.02, 0.1, 0.0)
RISES = Joints(-0.4, -0.02, 0.1, 0.0)
SAFE, LEVEL = (-1.0, -0.06, 0.0, 0.0), (-1.0, 0.0, 0.0, 0.0)
#: Vertical rate of a vehicle that is well (m/s).
RATE = 0.2


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
        """Pitched, moving down at a rate; no two samples are the same."""
        q = quaternion_from_euler(0.0, math.radians(self.pitch_deg), 0.0)
        velocity = rotate_to_body(*q, 0.3, 0.0, rate)
        return Odometry(self.time_s, 0.0, self.depth, *q, *velocity, *(3 * (0.0,)))

    def go(self, seconds: float, demand=DIVES, rate: float = RATE, joints=None, **heard) -> int:
        """Fly on; rows at the end. Without ``joints`` actuators are where they were sent."""
        for _ in range(round(seconds / TICK_S)):
            seen = (self.target, self.depth, NO_ECHO, WELL, POWER)
            at = Heard(demand, self.odometry(rate), self.joints, *seen)
            self.state, self.out = guard_step(
                self.state, at._replace(**heard), self.params, TICK_S
            )
            self.joints = joints or self.out.command
            self.depth = max(0.0, self.depth + TICK_S * rate)
            self.time_s += TICK_S
        return self.out.told


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
    'crush_depth': Case({'depth_m': 1249.0}, {'rate': 0.2}, 4.5),
    'near_bottom': Case({'altitude': True}, {'altitude': 2.5}, 1.5),
    'overdepth': Case({'depth_m': 300.0}, {'rate': 0.2}, 525.0),
    'not_climbing': Case({'depth_m': 200.0}, {'demand': RISES, 'rate': 0.02}, 895.0),
    'stalled': Case({}, {'rate': 0.002}, 1795.0),
    'under_too_long': Case({'under_water_s': 500.0}, {'rate': 0.2}, 495.0),
    'measurement_frozen': Case({}, {'rate': 0.0}, 25.0),
    'measurement_lost': Case({}, {'odometry': Odometry(*(13 * (math.nan,)))}, 0.0),
    'depth_disagrees': Case({'pressure': True}, {'depth': 50.0}, 25.0),
    'demand_lost': Case({}, {'demand': NAN}, 0.8),
    'leak': Case({}, {'health': WELL._replace(leak=1.0)}, 9.5),
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
        assert vehicle.out.command in (SAFE, LEVEL)
    assert vehicle.out.drops == (row.reaction == rows.DROP)


def test_every_row_has_a_case():
    apart = {'not_rising', 'steering_surface_stuck', 'too_heavy'}  # each in a test of its own
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
    assert vehicle.out.command == SAFE


def test_a_depth_that_is_frozen_is_no_reason_to_drop_the_weight():
    vehicle = Vehicle()
    vehicle.go(1.0)
    frozen = vehicle.odometry(0.0)
    assert vehicle.go(5000.0, odometry=frozen) & rows.FROZEN
    assert not vehicle.out.drops
    assert vehicle.go(11000.0, odometry=frozen) & rows.NOT_RISING
    assert vehicle.out.drops


@pytest.mark.parametrize(('pitch_deg', 'demand'), [(-25.0, DIVES), (25.0, RISES)])
def test_a_vehicle_that_is_heavier_than_its_pump_says_comes_up(pitch_deg, demand):
    """By 0.7 kg of 1.0 it flies on, by 1.0 kg it does not; the weights are those of the polar."""
    for unknown_kg, told in ((0.7, 0), (1.0, rows.TOO_HEAVY)):
        vehicle = Vehicle(depth_m=10.0)
        vehicle.target, vehicle.pitch_deg = 900.0, pitch_deg
        rate = glide_vertical_rate(
            math.radians(-25.0), demand.m_b + unknown_kg, vehicle.params.weight.polar
        )
        assert vehicle.go(850.0, demand=demand, rate=rate) == told


def test_a_vehicle_that_sinks_fast_is_stopped_in_time():
    """Sent down, at 0.4 m/s: more than 30 m before the depth that it is rated for."""
    vehicle = Vehicle(depth_m=700.0)
    vehicle.target, vehicle.pitch_deg = 990.0, -25.0
    while not vehicle.go(1.0, demand=DIVES._replace(m_b=1.0), rate=0.4):
        pass
    assert vehicle.out.told == rows.TOO_DEEP
    assert 900.0 < vehicle.depth < 970.0


@pytest.mark.parametrize(
    ('pump_kg', 'rate', 'after_s'), [(0.2, 0.2, 500.0), (-0.96, 0.2, 0.0), (0.2, -0.1, 0.0)]
)
def test_the_mass_waits_for_the_pump(pump_kg, rate, after_s):
    """Nose up at once where it rises or the pump is out, else when the pump had time to be."""
    vehicle = Vehicle(depth_m=200.0, stall_s=3600.0)
    vehicle.go(1.0)
    vehicle.target = SURFACE_TARGET
    pump = Joints(pump_kg, 0.0, 0.0, 0.0)
    if after_s:
        vehicle.go(after_s - 1.0, rate=rate, joints=pump)
        assert vehicle.out.command == LEVEL
    vehicle.joints = pump
    vehicle.go(2.0, rate=rate, joints=pump)
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


@settings(max_examples=100, deadline=None)
@given(st.lists(st.floats(width=64), min_size=32, max_size=32), st.integers(1, 30))
def test_whatever_it_hears_the_command_is_within_the_ranges(numbers, ticks):
    vehicle = Vehicle()
    vehicle.go(1.0)
    demand, joints, odometry = Joints(*numbers[:4]), Joints(*numbers[4:8]), numbers[8:21]
    told = (*numbers[21:24], Health(*numbers[24:27]), Battery(*numbers[27:]))
    at = Heard(demand, Odometry(*odometry), joints, *told)
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
