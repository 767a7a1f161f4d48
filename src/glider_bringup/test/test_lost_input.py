# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""Control and guard, free-running, whose inputs fail: what they bridge, and what surfaces."""

import time

import pytest
import rclpy
from diagnostic_msgs.msg import DiagnosticArray
from nav_msgs.msg import Odometry
from rclpy.executors import SingleThreadedExecutor
from rclpy.lifecycle import TransitionCallbackReturn
from rclpy.parameter import Parameter
from rclpy.serialization import deserialize_message
from sensor_msgs.msg import JointState
from std_srvs.srv import Trigger

from glider_base.ros.lockstep import health
from glider_base.ros.wire import qos
from glider_base.ros.wire.codec import to_cdr
from glider_base.ros.wire.topics import TOPICS
from glider_base.settings import ConfigurationError
from glider_base.signals import TICK_NS
from glider_base.wiring import at_rest
from glider_control.nodes.control_node import ControlNode
from glider_guard.nodes.guard_node import GuardNode
from glider_guard.rows import DEPTH_WRONG, LOST, ORDERED
from glider_guard.settings import GuardSettings

LEVEL = (0.0, 0.0, -50.0, 1.0, 0.0, 0.0, 0.0, 0.5, 0.0, 0.0, 0.0, 0.0, 0.0)
#: Covariance of the place that navigation believes (m^2).
CERTAIN = (1.0, 0.0, 0.0, 1.0)
INPUTS = {'odom': (*LEVEL, *CERTAIN), 'joint_states': (0.4, 0.0, 0.0), 'reference': LEVEL}
DEMAND = (0.4, 0.0, 0.0)
DEADLINE_S = 200.0
#: The mass holds it level: the pump of this vehicle does not move, and nobody sees it rise.
SAFE = (GuardSettings().params().ascent.safe.m_b, 0.0, 0.0)


class Vehicle:
    """Publishes their inputs, and hears what they say."""

    def __init__(self, context) -> None:
        self.node = rclpy.create_node('vehicle', namespace='/glider', context=context)
        self.publishers = {
            name: self.node.create_publisher(TOPICS[name].message_type, name, TOPICS[name].qos)
            for name in INPUTS
        }
        self.commands, self.told, self.stamp_ns = [], [], 0
        self.says, self.change = INPUTS, lambda name, raw: raw
        self.node.create_subscription(JointState, 'command', self.on_command, 10)
        self.node.create_subscription(
            DiagnosticArray, '/diagnostics', self.on_diagnostics, qos.EVENTS
        )
        self.node.create_timer(0.1, self.publish)

    def on_command(self, command) -> None:
        self.commands.append(tuple(command.position))

    def on_diagnostics(self, array) -> None:
        self.told += [status.message for status in array.status]

    def publish(self) -> None:
        self.stamp_ns += TICK_NS
        for name, values in self.says.items():
            raw = TOPICS[name].codec.encode(self.stamp_ns, values)
            self.publishers[name].publish(self.change(name, raw))

    def said(self, text: str) -> bool:
        return any(text in told for told in self.told)


class Flight:
    """Both, free-running, and a vehicle that has begun to talk to them."""

    def __init__(self, context) -> None:
        overrides = [Parameter('lockstep', value=False), Parameter('input_max_age_s', value=0.5)]
        self.vehicle = Vehicle(context)
        said = {'context': context, 'namespace': '/glider'}
        self.control = ControlNode(parameter_overrides=overrides, **said)
        overrides.append(Parameter('lost_after_s', value=1.0))
        self.guard = GuardNode(parameter_overrides=overrides, **said)
        self.nodes = (self.control, self.guard)
        self.executor = SingleThreadedExecutor(context=context)
        self.executor.add_node(self.vehicle.node)
        for node in self.nodes:
            self.executor.add_node(node)

    def until(self, condition) -> None:
        end = time.monotonic() + DEADLINE_S
        while not condition():
            assert time.monotonic() < end
            self.executor.spin_once(timeout_sec=0.1)

    def close(self) -> None:
        self.executor.shutdown()
        for node in self.nodes:
            node.close()
            node.destroy_node()
        self.vehicle.node.destroy_node()


class ByHand:
    """A guard whose time, cycles and inputs are made by hand: no pause of the machine counts."""

    def __init__(self, context, monkeypatch, **parameters) -> None:
        given = {'lockstep': False, **parameters}
        overrides = [Parameter(name, value=value) for name, value in given.items()]
        self.guard = GuardNode(context=context, parameter_overrides=overrides)
        self.now_s, self.said, self.sent = 100.0, [], {'command': [], 'drop_weight': []}
        monkeypatch.setattr(self.guard, 'now_s', lambda: self.now_s)
        monkeypatch.setattr(
            self.guard, 'event', lambda stamp_ns, level, message, **_: self.said.append(message)
        )
        self.guard.senders = [
            lambda stamp_ns, values, sent=sent: sent.append((self.now_s, *values))
            for sent in self.sent.values()
        ]

    def cycle(self, says, s: float = 0.1) -> None:
        """What is said comes, and a cycle follows, so much later (s)."""
        self.now_s += s
        stamp_ns = round(self.now_s * 10) * TICK_NS
        for item in self.guard.inputs:
            if item.topic.name in says:
                raw = item.topic.codec.encode(stamp_ns, says[item.topic.name])
                item.accept_newest(raw, self.now_s, 1.0)
        self.guard._on_cycle()


@pytest.fixture
def by_hand(context, monkeypatch):
    made = []

    def make(**parameters) -> ByHand:
        made.append(ByHand(context, monkeypatch, **parameters))
        return made[-1]

    yield make
    for one in made:
        one.guard.close()
        one.guard.destroy_node()


@pytest.fixture
def flight(context):
    flight = Flight(context)
    try:
        commands = flight.vehicle.commands
        flight.until(lambda: len(commands) > 5 and commands[-1] != SAFE)
        yield flight
    finally:
        flight.close()


def test_lost_input_surfaces_the_vehicle_for_good(flight):
    vehicle = flight.vehicle
    vehicle.says = {}
    flight.until(lambda: vehicle.said('input lost for 1 s: surfacing for good'))
    assert vehicle.commands[-1] == SAFE
    vehicle.says = INPUTS
    flight.until(lambda: vehicle.said('inputs are fresh again'))
    before = len(vehicle.commands)
    flight.until(lambda: len(vehicle.commands) > before + 10)
    assert set(vehicle.commands[before:]) == {SAFE}
    flight.until(lambda: vehicle.said('surface: ordered to the surface'))
    assert flight.guard.state.reported & ORDERED
    vehicle.told.clear()
    vehicle.says = {}
    flight.until(lambda: 'missing or stale' in flight.guard.condition().message)
    assert flight.guard.condition().message.endswith('; surfacing for good')


def test_nothing_is_cleared_while_nobody_knows_how_deep_the_vehicle_is(context, monkeypatch):
    """Before the first message, and without one: it would dive on when the line is back."""
    overrides = [Parameter('lockstep', value=False)]
    guard, now_s = GuardNode(context=context, parameter_overrides=overrides), 100.0
    monkeypatch.setattr(guard, 'now_s', lambda: now_s)

    def cleared() -> str:
        return guard.on_clear(Trigger.Request(), Trigger.Response()).message

    try:
        assert 'depth not known' in cleared()
        for item in guard.inputs:
            item.accept_newest(
                item.topic.codec.encode(10**9, at_rest(item.topic.name)), now_s, 1.0
            )
        guard._on_cycle()
        assert cleared() == 'cleared'
        for _ in range(130):
            now_s += 0.1
            guard._on_cycle()
        assert 'depth not known without demand' in cleared()
        assert guard.condition().message.endswith('; surfacing for good')
    finally:
        guard.close()
        guard.destroy_node()


@pytest.mark.parametrize(
    ('depth_m', 'comes', 'goes'),
    [
        (50.0, ['joint_states'], True),  # navigation or control is dead, and the pump, too
        (50.0, ['joint_states', 'odom'], True),
        (50.0, [], False),  # nobody hears it
        (0.5, ['joint_states'], False),  # on deck, or afloat
        (50.0, ['joint_states', 'up'], False),
        (50.0, ['joint_states', 'contact'], False),
    ],
)
def test_the_weight_goes_where_input_is_lost_and_nothing_shows_it_up(
    by_hand, depth_m, comes, goes
):
    flight = by_hand(drop_blind_s=600.0)
    odom = {at_m: (0.0, 0.0, -at_m, *INPUTS['odom'][3:]) for at_m in (depth_m, 0.5)}
    says = {**INPUTS, 'odom': odom[depth_m], 'demand': DEMAND}
    for _ in range(20):
        flight.cycle(says, 0.5)
    lost_s = flight.now_s
    may = {**says, 'up': odom[0.5], 'contact': (0.0, -1.0, 0.0)}
    names = {'up': 'odom', 'contact': 'health'}
    while flight.now_s < lost_s + 1200.0:
        flight.cycle({names.get(name, name): may[name] for name in comes}, 0.5)
    dropped = [at_s - lost_s for at_s, says_so in flight.sent['drop_weight'] if says_so]
    assert bool(dropped) == goes
    if goes:  # 600 s, and the way up at climb_mps
        assert dropped[0] == pytest.approx(600.0 + 50.0 / 0.15, abs=20.0)
        assert sum('the weight is let go' in said for said in flight.said) == 1
        flight.cycle(says, 0.5)
        assert flight.sent['drop_weight'][-1][1] == 0.0  # what is to be seen again decides


def test_what_comes_with_a_stamp_that_stands_still_is_told_from_what_does_not_come(flight):
    vehicle = flight.vehicle
    first = {}
    vehicle.change = lambda name, raw: first.setdefault(name, raw) if name == 'odom' else raw
    flight.until(lambda: vehicle.said('missing or stale: odom (its stamp stands still); '))
    vehicle.says = {}
    flight.until(lambda: vehicle.said('for good'))
    flight.until(lambda: flight.guard.condition().message.startswith('missing or stale: '))
    assert 'stands still' not in flight.guard.condition().message


@pytest.mark.parametrize(
    ('name', 'stamp_s', 'old_s', 'told'),
    [
        ('health', 0, 10.0, True),
        ('battery', 7, 600.0, True),
        ('altitude', 0, 5.0, True),
        ('altitude', 7, 5.0, False),  # its last echo again
    ],
)
def test_what_counts_no_more_for_its_stamp_stands_still_is_told(
    by_hand, name, stamp_s, old_s, told
):
    """A driver that leaves the stamp empty."""
    flight = by_hand(altitude=True)
    item = next(item for item in flight.guard.inputs if item.topic.name == name)
    raw = item.topic.codec.encode(stamp_s * 10**9, at_rest(name))
    for after_s in (0.0, old_s - 1.0, 2.0):
        assert not flight.said
        flight.now_s += after_s
        flight.guard._on_newest(item, raw, {})
    assert flight.said == told * [
        f'message refused: {name}: its stamp stands still at {stamp_s} s'
    ]


def test_control_that_is_configured_again_counts_anew_what_it_refuses(context):
    node, told = ControlNode(context=context), []
    try:
        node.refused = 3  # of which it has told
        node.on_configure(None)
        node.publish_event = told.append
        node.tell(10**9, (0,))
        assert len(told) == 1  # and not that none was refused
    finally:
        node.close()
        node.destroy_node()


def test_a_node_that_cannot_be_configured_says_why(context, monkeypatch):
    """rclpy says that it failed, and no more."""
    node, told = ControlNode(context=context), []

    def fail(_):
        raise ConfigurationError('control.law: initial_state: division by zero')

    monkeypatch.setattr(type(node.settings), 'initial_state', fail)
    try:
        node.event = lambda stamp_ns, level, said: told.append(said)
        assert node.on_configure(None) == TransitionCallbackReturn.FAILURE
        assert told == ['not configured: control.law: initial_state: division by zero']
    finally:
        node.close()
        node.destroy_node()


@pytest.mark.parametrize('heard', [True, False])
def test_a_clock_that_is_set_forward_is_no_lost_input(by_hand, heard):
    """Nor is it that this node was stopped; and who is silent has the time that he has."""
    flight = by_hand(input_max_age_s=0.5, lost_after_s=1.0)
    says, commands = {**INPUTS, 'demand': DEMAND}, flight.sent['command']
    for _ in range(20):
        flight.cycle(says)
    if not heard:
        says = {}
        while not any('missing or stale' in said for said in flight.said):
            flight.cycle(says)
    before = len(commands)
    flight.cycle({}, 3600.0)  # before anything comes
    for _ in range(4):
        flight.cycle(says)
    assert len(commands) > before + 4
    assert not any('for good' in said for said in flight.said)
    assert not heard or SAFE not in [command[1:4] for command in commands[before:]]


@pytest.mark.parametrize('is_simulated', [True, False])
def test_a_clock_that_is_set_forward_is_no_slow_machine(by_hand, is_simulated):
    """By a first fix, say; one that nobody can set shows that this node was stopped."""
    flight = by_hand(use_sim_time=is_simulated)
    for s in (*20 * [0.1], 3600.0, *110 * [0.1]):
        flight.cycle({**INPUTS, 'demand': DEMAND}, s)
    assert any('too slow' in said for said in flight.said) == (not is_simulated)


@pytest.mark.parametrize(('silent_s', 'said'), [(5.4, ' for 5.4 s'), (-5.4, '')])
def test_nobody_was_silent_for_less_than_no_time(by_hand, silent_s, said):
    """As a driver whose /clock begins anew with it."""
    flight = by_hand()
    flight.guard.tell_successor(flight.guard.inputs[0], silent_s)
    assert flight.said[-1].endswith(f', which was silent{said}')


def test_who_commands_beside_the_guard_is_named(flight):
    """Nobody on board hears the command: whoever else gives one moves the vehicle unseen."""
    vehicle = flight.vehicle.node
    helm = vehicle.create_publisher(JointState, 'command', 10)
    flight.until(lambda: flight.vehicle.said('command is published by /glider/vehicle too'))
    vehicle.destroy_publisher(helm)
    second = GuardNode(
        parameter_overrides=[Parameter('lockstep', value=False)],
        context=vehicle.context,
        namespace='/glider',
    )
    for topic in ('command', 'drop_weight'):
        told = f'/glider/{topic} is published by /glider/guard_node too'
        flight.until(lambda told=told: flight.vehicle.said(told))
    second.destroy_node()


def test_what_sinks_while_the_guard_is_paused_has_not_jumped(flight):
    """As a managed node that is deactivated for a minute; what jumps in a second has."""
    vehicle, depth_m = flight.vehicle, -LEVEL[2]

    def sunk(by_m: float, s: float) -> bool:
        nonlocal depth_m
        flight.guard.pause()
        cleared = flight.guard.on_clear(Trigger.Request(), Trigger.Response())
        assert 'depth not known' in cleared.message
        depth_m += by_m
        vehicle.stamp_ns += int(s * 1e9)
        odom = (*LEVEL[:2], -depth_m, *LEVEL[3:], *CERTAIN)
        vehicle.says = {**INPUTS, 'odom': odom}
        heard, since_ns = flight.guard.inputs[0], vehicle.stamp_ns
        flight.until(lambda: heard.stamp_ns > since_ns)
        flight.guard.begin()
        before = len(vehicle.commands)
        flight.until(lambda: len(vehicle.commands) > before + 25)
        return bool(flight.guard.state.reported & DEPTH_WRONG)

    assert not sunk(12.0, 60.0)
    assert sunk(50.0, 1.0)


def test_silence_is_seen_by_a_clock_of_coarse_steps_too(flight, monkeypatch):
    now_s = flight.guard.now_s
    monkeypatch.setattr(flight.guard, 'now_s', lambda: 20.0 * now_s())
    flight.vehicle.says = {}
    flight.until(lambda: flight.vehicle.said('input lost for 1 s: surfacing for good'))


def test_what_holds_is_told_though_the_clock_of_the_vehicle_was_set_back(flight):
    vehicle = flight.vehicle
    vehicle.stamp_ns += 3600 * 10**9
    flight.guard.surface(health.SURFACE)
    flight.until(lambda: vehicle.said('surface: ordered to the surface'))
    vehicle.stamp_ns -= 3600 * 10**9
    flight.guard.clear()
    flight.until(lambda: vehicle.said('nothing to react to'))


@pytest.mark.parametrize('factor', [0.0, 2.0])
def test_quaternion_that_is_none_is_bridged_counted_and_told(flight, factor):
    """Driver of a vehicle that has no attitude for some samples; then, for good, none at all."""
    vehicle = flight.vehicle
    none = (*LEVEL[:3], *(factor * q for q in LEVEL[3:7]), *LEVEL[7:], *CERTAIN)
    vehicle.says = {**INPUTS, 'odom': none}
    flight.until(lambda: vehicle.said('refused a measurement, the last good one serves'))
    vehicle.says = INPUTS
    flight.until(lambda: vehicle.said('samples refused so far'))
    assert not vehicle.said('surfacing')
    assert vehicle.commands[-1] != SAFE
    vehicle.says = {**INPUTS, 'odom': none}
    flight.until(lambda: vehicle.said('surface: nothing usable is measured'))
    assert vehicle.commands[-1] == SAFE
    assert flight.guard.state.reported & LOST


def test_frames_of_ned_are_refused_and_named(flight):
    vehicle = flight.vehicle

    def in_ned(name: str, raw: bytes) -> bytes:
        if name != 'odom':
            return raw
        message = deserialize_message(raw, Odometry)
        message.header.frame_id = 'map_ned'
        return to_cdr(message)

    vehicle.change = in_ned
    flight.until(lambda: vehicle.said("message refused: odom: header.frame_id is 'map_ned'"))
    flight.until(lambda: vehicle.said('missing or stale: odom'))
    flight.until(lambda: vehicle.commands[-1] == SAFE)
