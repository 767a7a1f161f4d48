# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""A flight in one's own hands: the bits of a flight at once, however it is cut up or carried."""

import copy
import json
import math
import pickle
import re
import signal
import subprocess
import sys
from contextlib import nullcontext
from functools import partial
from types import SimpleNamespace
from typing import NamedTuple

import numpy as np
import pytest
from typer.testing import CliRunner

import glider_bringup as glider
from glider_base.kernel import kernel
from glider_base.ros.lockstep import block_node
from glider_base.ros.lockstep.block_node import BlockNode
from glider_base.ros.lockstep.process import Stop
from glider_base.signals import TICK_NS, TICK_S
from glider_bringup.cli import app
from glider_bringup.engines.direct import FlightError, HeldMission
from glider_bringup.engines.flight import ended
from glider_control.law import LawSettings, law_step
from glider_guard.rows import LATCHED
from glider_guidance.settings import GuidanceSettings
from glider_mission.routing.pilot import LOOK_TICKS

WATERS = {
    'rough_water': {},
    'current_8deg': {'faults': [{'kind': 'leak', 'at_s': 800.0, 'rate_kgps': 0.002}]},
    'slocum_shelf': {},
}
END_S = 1000.0


def numbers(flight) -> dict:
    """Numbers of the last tick, with the bits of each."""
    return {name: np.float64(value).tobytes() for name, value in flight.now.items()}


@pytest.fixture(scope='module', params=WATERS)
def at_once(request):
    """Name of a scenario, and a flight of it that was flown at once."""
    flight = glider.Flight(request.param, WATERS[request.param], seed=3)
    assert flight.until(t_s=END_S) == ('time', 10000)
    return request.param, flight


def test_steps_of_one_have_the_same_bits(at_once):
    name, whole = at_once
    flight = glider.Flight(name, WATERS[name], seed=3)
    assert not flight.now
    for _ in range(10000):
        flight.step()
    assert numbers(flight) == numbers(whole)
    assert flight.t_s == END_S and not flight.is_over


def test_ticks_and_times_may_be_small_numbers_of_numpy():
    flight = glider.Flight('current_8deg')
    flight.step(np.int16(600))
    assert flight.step(np.int8(100)).tick == 700
    assert flight.until(t_s=np.float16(75.0)).tick == 750


def test_it_is_what_fly_flies(at_once):
    name, whole = at_once
    run = glider.fly(name, WATERS[name], seed=3, duration=END_S).to_xarray().isel(time=-1)
    theirs = {one: np.float64(run[one].item()).tobytes() for one in run.data_vars}
    assert numbers(whole) == theirs


def test_a_state_can_be_kept_and_flown_on_as_often_as_one_likes(at_once):
    name, whole = at_once
    flight = glider.Flight(name, WATERS[name], seed=3)
    flight.until(t_s=400.0)
    kept, then = flight.state, numbers(flight)
    for _ in range(2):
        flight.until(t_s=END_S)
        assert numbers(flight) == numbers(whole)
        flight.restore(kept)
        assert numbers(flight) == then and flight.tick == 4000


ELSEWHERE = """
import pickle, sys
import glider_bringup as glider

told = {}
for name, (changes, state) in pickle.load(sys.stdin.buffer).items():
    flight = glider.Flight(name, changes, seed=3).restore(state)
    flight.until(t_s=1000.0)
    told[name] = flight.now
sys.stdout.buffer.write(pickle.dumps(told))
"""


def test_a_state_goes_to_another_process():
    flights = {name: glider.Flight(name, WATERS[name], seed=3) for name in WATERS}
    for flight in flights.values():
        flight.step(2503)
    sent = pickle.dumps({name: (WATERS[name], one.state) for name, one in flights.items()})
    done = subprocess.run([sys.executable, '-c', ELSEWHERE], input=sent, stdout=subprocess.PIPE)
    for name, told in pickle.loads(done.stdout).items():
        flights[name].until(t_s=END_S)
        assert told == pytest.approx(flights[name].now, rel=0.0, abs=0.0, nan_ok=True)


def test_two_fly_side_by_side_and_do_not_touch_each_other(at_once):
    name, whole = at_once
    one, other = (glider.Flight(name, WATERS[name], seed=seed) for seed in (3, 4))
    for _ in range(100):
        one.step(100)
        other.step(100)
    assert numbers(one) == numbers(whole)


def test_ctrl_c_leaves_it_between_two_ticks(monkeypatch):
    one, other = (glider.Flight('current_8deg', seed=3) for _ in range(2))
    fly = HeldMission.fly
    with monkeypatch.context() as patch:
        patch.setattr(
            HeldMission,
            'fly',
            lambda *held, **how: (fly(*held, **how), signal.raise_signal(signal.SIGINT))[0],
        )
        with pytest.raises(KeyboardInterrupt):
            one.until('surfacing', t_s=300.0)
    assert one.tick == other.step(600).tick
    one.step(100)
    other.step(100)
    assert numbers(one) == numbers(other)


def test_it_is_flown_until_something_happens():
    flight = glider.Flight('current_8deg', {'profile.depth_m': 60.0, 'dives': 2})
    rows = glider.fly('current_8deg', {'profile.depth_m': 60.0, 'dives': 2}).to_xarray()
    depth = rows.ground_truth_odom_depth.values
    name, tick = flight.until('surfacing')
    assert name == 'surfacing'
    assert depth[tick - 2] >= 1.0 > depth[tick - 1] and depth[: tick - 1].max() > 50.0
    assert flight.now['ground_truth_odom_depth'] == depth[tick - 1]
    assert flight.until('surfacing', t_s=flight.t_s + 1.0) == ('time', tick + 10)
    assert flight.until() == ('end', len(depth))
    assert flight.is_over and flight.step() == ('end', len(depth))


def test_it_stops_where_the_guard_acts():
    changes = {'faults': [{'kind': 'leak', 'at_s': 300.0, 'rate_kgps': 0.002}]}
    flight = glider.Flight('current_8deg', changes)
    name, tick = flight.until('guard', t_s=3600.0)
    assert name == 'guard' and tick > 3000
    assert int(flight.state.past.row[-1]) & LATCHED  # the guard is the last column
    again = glider.Flight('current_8deg', changes)
    again.step(tick - 1)
    assert not int(again.state.past.row[-1]) & LATCHED


def test_it_arrives():
    short = {'path.waypoints': [[0, 0], [300, 0]], 'profile.depth_m': 60.0}
    flight = glider.Flight('survey', short)
    assert flight.until('arrival').name == 'arrival'


def test_a_state_of_another_law_or_navigation_is_refused():
    flight = glider.Flight('current_8deg')
    flight.step(10)
    before = numbers(flight)
    gust = {'kind': 'gauss_markov', 'std_mps': 0.1, 'time_constant_s': 100.0}
    for name, fields, law in (
        ('current_8deg', {}, 'pid'),
        ('reckoned_12deg', {}, None),
        ('current_8deg', {'current.components': [gust]}, None),
    ):
        other = glider.Flight(name, fields, controller=law)
        with pytest.raises(glider.ConfigurationError, match='state: of another flight'):
            flight.restore(other.state)
        assert numbers(flight) == before and flight.tick == 10


def test_a_state_is_flown_on_by_the_numbers_of_the_flight_and_the_orders_of_the_state():
    flight = glider.Flight('current_8deg', {'profile.depth_m': 40.0})
    flight.order(pitch_deg=20.0)
    flight.step(2500)
    deeper = glider.Flight('current_8deg', {'profile.depth_m': 80.0}).restore(flight.state)
    deepest, steepest = 0.0, 0.0
    while deeper.step(100).name == 'time' and deeper.now['odom_depth'] > 5.0:
        deepest = max(deepest, deeper.now['ground_truth_odom_depth'])
        steepest = min(steepest, math.degrees(deeper.now['odom_pitch']))
    assert 78.0 < deepest < 84.0
    assert -22.0 < steepest < -18.0


@pytest.mark.parametrize('way', [pickle.dumps, copy.copy, copy.deepcopy])
def test_who_copies_a_flight_is_told_to_keep_its_state(way):
    with pytest.raises(TypeError, match='keep its state, and restore that'):
        way(glider.Flight('current_8deg'))


def test_an_order_costs_as_much_after_many_as_after_none(monkeypatch):
    checked = []
    check = GuidanceSettings.check
    monkeypatch.setattr(GuidanceSettings, 'check', lambda told: checked.append(1) or check(told))
    flight, counts = glider.Flight('current_8deg', {'profile.depth_m': 60.0}), []
    for i in range(8):
        before = len(checked)
        flight.order(depth_m=30.0 + i)
        flight.step()
        counts.append(len(checked) - before)
    assert len(set(counts[2:])) == 1, counts


class Failing(NamedTuple):
    at: int
    raises: bool


class Called(NamedTuple):
    times: int


class FailingLaw(LawSettings):
    """Holds pitch, until it was called so often."""

    at: int = 1_000_000
    raises: bool = False

    def params(self, vehicle, bank):
        return Failing(self.at, self.raises)

    def initial_state(self):
        return Called(0)


@law_step.body(Failing)
@kernel
def failing_step(state, seen, params, dt):
    pitch = 25.0 * (seen.reference.theta - seen.measured.theta) - 40.0 * seen.measured.theta_dot
    if state.times == params.at and params.raises:
        raise ValueError('none of yours')
    if state.times == params.at:
        pitch = math.nan
    return Called(state.times + 1), -20.0 * seen.measured.phi_dot, pitch


RAISED = r'failing_step \(.*test_held_flight.py, line \d+\): ValueError: none of yours at tick'


@pytest.mark.parametrize('raises', [False, True])
def test_a_law_that_fails_ends_it_at_one_tick_however_it_is_cut_up(raises):
    told = RAISED if raises else 'wrench is not finite at tick'
    fields = {'profile.depth_m': 15.0, 'control.FailingLaw.raises': raises}
    flight = glider.Flight('current_8deg', fields, law=FailingLaw)
    surfaced = flight.until('surfacing')
    at = flight.state.kept.mission.control.law.times + 10
    flight.step(10)
    ended = set()
    for step in (1, 7, 600):
        failing = glider.Flight(
            'current_8deg', {**fields, 'control.FailingLaw.at': at}, law=FailingLaw
        )
        failing.until(t_s=0.1 * (surfaced.tick - 100))
        assert failing.until('surfacing') == surfaced
        with pytest.raises(FlightError, match=told) as error:
            while True:
                failing.step(step)
        assert failing.is_over and failing.step() == ('end', surfaced.tick + 10)
        assert numbers(failing) == numbers(flight)
        ended.add(str(error.value))
    (said,) = ended
    score = glider.fly(
        'current_8deg', {**fields, 'control.FailingLaw.at': at}, law=FailingLaw
    ).score
    assert (score['status'], score['reason'], score['ticks']) == ('failed', said, flight.tick)


def test_a_law_that_raised_over_nodes_is_verified_up_to_there(read_bag, write_bag, tmp_path):
    """There the inputs of its last tick are on record, and nothing that it would have said."""
    fields, at = {'dives': 0, 'duration_s': 200.0, 'profile.prepare_s': 10.0}, 1500
    flight = glider.Flight('current_8deg', fields, law=FailingLaw)
    flight.step(at)
    calls = flight.state.kept.mission.control.law.times
    folder = tmp_path / 'run'
    glider.fly('current_8deg', fields, law=FailingLaw, out=folder, bag=True)
    (file,) = folder.glob('*.mcap')
    silent = {f'/glider/{name}' for name in ('demand', 'wrench', 'adaptation', 'command')}
    heard = [m for m in read_bag(file) if m.log_ns <= at * TICK_NS]
    kept = [m for m in heard if m.log_ns < at * TICK_NS or m.topic not in silent]
    cut, tried = tmp_path / 'cut', tmp_path / 'cut' / 'tried.yaml'
    cut.mkdir()
    write_bag(cut / 'bag_0.mcap', file, kept)
    text = (folder / 'scenario.yaml').read_text()
    for name in ('scenario.yaml', 'vehicle.yaml'):
        (cut / name).write_text((folder / name).read_text())

    def control(calls):
        """What is said of it by a law that raises after so many."""
        fails = text.replace('at: 1000000\n    raises: false', f'at: {calls}\n    raises: true')
        tried.write_text(fails)
        line = ('verify', str(cut), '--settings', str(tried), '--only', 'control', '--json')
        done = CliRunner().invoke(app, line)
        assert done.stdout, done.output
        (one,) = json.loads(done.stdout)['blocks']
        return one

    same = control(calls)
    assert (same['result'], same['ticks']) == ('identical', at)
    (said,) = same['notes']
    assert re.match(RAISED + f' {at} .*, where its record ends', said), said
    assert control(calls - 1)['result'] == 'different'


def test_a_law_that_raises_on_a_planned_route_ends_it_at_that_tick():
    failing = {'control.FailingLaw.at': 1000, 'control.FailingLaw.raises': True}
    fields = {**failing, 'orders': [], 'guidance.route': 'planned'}
    score = glider.fly('eddies_10d', fields, law=FailingLaw, duration=3600.0).score
    assert f' at tick {score["ticks"]} ' in score['reason'] and score['ticks'] % LOOK_TICKS


def _node_of(lockstep: bool) -> SimpleNamespace:
    """What a node of control needs for `BlockNode.step`, with what it has sent and told."""
    wired = SimpleNamespace(name='control', outputs=('demand', 'wrench'))
    node = SimpleNamespace(orders={}, absent=(), passed=1, flags=None)
    node.block, node.held = SimpleNamespace(wired=wired, say=None), SimpleNamespace(held=None)
    node.ticks, node.wrong, node.sent, node.told = SimpleNamespace(lockstep=lockstep), '', [], []
    node.not_finite = partial(BlockNode.not_finite, node)
    node.repeat = lambda: node.sent.append(node.said)
    node.event = lambda stamp_ns, level, said: node.told.append(said)
    return node


def _raises(held, t_s, inputs, dt):
    class Aiming(NamedTuple):
        theta: float = 0.0
        theta_dot: float = 0.0

    if not (1 <= round(t_s / dt) <= 2):
        return ((0.0,), (0.0, 0.0)), (0,)
    seen = SimpleNamespace(reference=Aiming(), measured=Aiming())
    return failing_step.py_func(Called(3), seen, Failing(3, True), TICK_S)


def _makes_nan(held, t_s, inputs, dt):
    tau_p = (1e308, math.nan, math.nan, 1e308)[round(t_s / dt)]
    return ((max(-1.0, min(1.0, tau_p)),), (tau_p, tau_p)), (0,)


@pytest.mark.parametrize('lockstep', [False, True])
@pytest.mark.parametrize(
    ('tick', 'words'),
    [
        (_makes_nan, r'control: wrench is not finite at tick 1 \(t = 0.1 s\)'),
        (_raises, rf'{RAISED} 1 \(t = 0.1 s\)'),
    ],
)
def test_a_law_that_fails_ends_its_node_in_lockstep_and_else_is_not_heard(
    lockstep, tick, words, monkeypatch
):
    """On board the guard, in the same process, then misses `demand`. NaN was a full roll."""
    monkeypatch.setattr(block_node, 'answer', tick)
    node = _node_of(lockstep)
    BlockNode.step(node, 0)
    with pytest.raises(Stop, match=words) if lockstep else nullcontext() as stop:
        for at in (1, 2, 3):
            BlockNode.step(node, at * TICK_NS)
    if lockstep:
        assert (stop.value.code, ended(False, str(stop.value))) == (1, 'failed')
        assert not node.told and len(node.sent) == 1
    else:
        assert len(node.told) == 1 and re.fullmatch(f'.*{words}; silent.*', node.told[0])
        assert [bool(outputs) for _, outputs in node.sent] == [True, False, False, True]


def test_a_law_that_raises_at_rest_is_compiled_and_its_node_starts(monkeypatch):
    """Zeros are what it is compiled with: a division by the speed, say, that no flight has."""

    def tick(held, t_s, inputs, dt):
        raise ZeroDivisionError

    monkeypatch.setattr(block_node, 'answer', tick)
    node, told = _node_of(True), []
    node.block.wired.inputs, node.block.orders, node.state = ('odom',), (told.append,), 'at rest'
    BlockNode.compile_kernels(node)
    assert told == ['at rest']


@pytest.mark.parametrize(
    ('act', 'named'),
    [
        (lambda flight: flight.until('lunch'), "event = 'lunch'.*surfacing, arrival, guard, end"),
        (lambda flight: flight.until(['guard']), r"event = \['guard'\].*surfacing, arrival"),
        (lambda flight: flight.until(t_s=math.nan), 't_s = nan.*seconds, or inf'),
        (lambda flight: flight.until(t_s=-math.inf), 't_s = -inf.*seconds, or inf'),
        (lambda flight: flight.until(t_s='x'), "t_s = 'x'.*seconds, or inf"),
        (lambda flight: flight.step(0), 'n = 0.*1 and more'),
        (lambda flight: flight.step(2.5), r'n = 2\.5.*1 and more'),
        (lambda flight: flight.step(math.nan), 'n = nan.*1 and more'),
        (lambda flight: flight.restore(None), 'state = None.*Flight.state'),
        (lambda flight: glider.Flight('nowhere'), 'nowhere'),
        (lambda flight: glider.Flight(set=5), 'set = 5.*by dotted field name'),
        (lambda flight: glider.Flight(law=abs, controller='pid'), '--controller pid'),
    ],
)
def test_what_cannot_be_done_is_said(at_once, act, named):
    flight = at_once[1]
    with pytest.raises(glider.ConfigurationError, match=named):
        act(flight)
    assert flight.t_s == END_S
