# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""Nodes in step: order, exactness, readiness, blame, pause, pace, and the free-running mode."""

import contextlib
import os
import subprocess
import sys
import threading
import time
from collections import Counter, defaultdict

import pytest
import rclpy.clock
from diagnostic_msgs.msg import DiagnosticArray
from nav_msgs.msg import Odometry
from rcl_interfaces.msg import Parameter as ParameterMessage
from rcl_interfaces.msg import ParameterValue
from rcl_interfaces.srv import SetParameters
from rclpy.executors import ExternalShutdownException
from rclpy.parameter import Parameter
from rclpy.qos import DurabilityPolicy, QoSProfile
from rclpy.serialization import deserialize_message
from std_msgs.msg import Header
from std_srvs.srv import SetBool

from glider_base.ros.hearing.gids import GID
from glider_base.ros.hearing.inputs import Input
from glider_base.ros.lockstep import clock, health, peers, step_node
from glider_base.ros.lockstep.clock import MAX_TICKS_AHEAD, ClockNode
from glider_base.ros.lockstep.executor import Gate, TickExecutor
from glider_base.ros.lockstep.process import Stop
from glider_base.ros.lockstep.step_node import StepNode
from glider_base.ros.wire.codec import MessageError, to_cdr
from glider_base.ros.wire.topics import (
    CONTROL,
    CURRENT,
    GUARD,
    GUIDANCE,
    NAVIGATION,
    PLANT,
    RECORDER,
    TOPICS,
)
from glider_base.settings import ConfigurationError
from glider_base.signals import TICK_NS

TIMEOUT_S = 30.0
#: What the plant says of a tick.
SAID = ('/clock', 'ground_truth/odom', 'measured_odom', 'joint_states', 'health', 'battery')


class Clock(ClockNode):
    """Stands in for the plant: counts, and remembers what it was told."""

    def __init__(self, last_tick: int = 50, **kwargs) -> None:
        super().__init__(PLANT, **kwargs)
        self.last_tick, self.log = last_tick, []
        self.publish = [self.add_output(name) for name in SAID]
        for topic in ('command', 'current_velocity', 'drop_weight'):
            self.add_input(topic)
        self.start_up()

    def publish_tick(self, stamp_ns: int) -> None:
        publish_clock, truth, measured, joints, health, battery = self.publish
        value = float(self.tick)
        publish_clock(stamp_ns)
        truth(stamp_ns, 13 * (value,))
        measured(stamp_ns, 13 * (2.0 * value,))
        joints(stamp_ns, 3 * (-value,))
        health(stamp_ns, 3 * (0.0,))
        battery(stamp_ns, 5 * (0.0,))

    def complete_tick(self, command, current, drop_weight) -> bool:
        self.log.append((time.monotonic(), self.tick, command, current))
        return self.tick < self.last_tick


class Block(StepNode):
    """Stands in for a block: sends on the sum of the first numbers of its inputs."""

    def __init__(self, name, inputs, outputs, mute_from=None, **kwargs) -> None:
        super().__init__(name, **kwargs)
        self.mute_from_ns = None if mute_from is None else mute_from * TICK_NS
        self.steps, self.stale_steps = [], 0
        self.publish = {name: self.add_output(name) for name in outputs}
        for item in inputs:
            self.add_input(item)
        self.start_up()

    def step(self, stamp_ns: int, *inputs) -> None:
        self.steps.append(stamp_ns)
        if self.mute_from_ns is not None and stamp_ns >= self.mute_from_ns:
            return
        total = sum(values[0] for values in inputs)
        for name, publish in self.publish.items():
            publish(stamp_ns, len(TOPICS[name].codec.fields) * (total,))

    def on_stale(self, stamp_ns: int, cycles: int) -> None:
        self.stale_steps += 1


INPUTS = {
    CURRENT: ['ground_truth/odom'],
    NAVIGATION: ['joint_states', 'measured_odom'],
    GUIDANCE: ['odom'],
    CONTROL: ['reference', 'odom', 'joint_states'],
    GUARD: ['demand', 'reference', 'odom', 'joint_states', 'health', 'battery'],
}
OUTPUTS = {
    CURRENT: ['current_velocity'],
    NAVIGATION: ['odom'],
    GUIDANCE: ['tracking_error', 'current_estimate', 'reference'],
    CONTROL: ['wrench', 'demand'],
    GUARD: ['drop_weight', 'command'],
}


class Graph:
    """Some of the nodes in one executor, spun until the plant stops."""

    def __init__(self, context, without=(), mute=None, last_tick=50, **parameters) -> None:
        overrides = [Parameter(name, value=value) for name, value in parameters.items()]
        shared = {'context': context, 'namespace': '/glider', 'use_global_arguments': False}
        common = [p for p in overrides if p.name != 'speed']
        self.executor = TickExecutor(context=context)
        self.blocks = {
            name: Block(
                name,
                INPUTS[name],
                OUTPUTS[name],
                (mute or {}).get(name),
                parameter_overrides=common,
                **shared,
            )
            for name in INPUTS
            if name not in without
        }
        self.plant = Clock(last_tick, parameter_overrides=overrides, **shared)
        self.nodes = [self.plant, *self.blocks.values()]
        for node in self.nodes:
            self.executor.add_node(node)

    def spin(self, until=lambda: False) -> Stop | None:
        """Spin until a condition holds, or until a node stops; that node's reason."""
        deadline = time.monotonic() + TIMEOUT_S
        while not until():
            assert time.monotonic() < deadline, 'the graph hangs'
            try:
                self.executor.spin_once(timeout_sec=0.1)
            except Stop as stop:
                return stop
        return None

    def spin_until_over(self) -> Stop:
        stop = self.spin(lambda: self.plant.over_since_s is not None)
        assert stop is None or stop.code
        return stop

    def close(self) -> None:
        self.executor.shutdown()
        for node in self.nodes:
            node.destroy_node()


@pytest.fixture
def make_graph(context):
    graphs = []

    def make(**arguments):
        graphs.append(Graph(context, **arguments))
        return graphs[-1]

    yield make
    for graph in graphs:
        graph.close()


def test_every_tick_is_acted_on_once_and_in_order(make_graph):
    graph = make_graph(last_tick=200)
    assert graph.spin_until_over() is None
    ticks = list(range(201))
    assert [tick for _, tick, _, _ in graph.plant.log] == ticks
    for block in graph.blocks.values():
        assert block.steps == [tick * TICK_NS for tick in ticks]


def test_a_node_uses_the_inputs_of_its_tick_and_no_other(make_graph):
    graph = make_graph(last_tick=100)
    graph.spin_until_over()
    # joint_states = -k, measured_odom = 2 k, odom = reference = k: control sends k + k - k, and
    # the guard k + k + k - k
    for _, tick, command, current in graph.plant.log:
        assert command == (*3 * (2.0 * tick,), 0.0)
        assert current == 3 * (float(tick),)


def test_everybody_leaves_when_the_run_is_complete(make_graph):
    graph = make_graph(last_tick=3)
    for _ in graph.nodes:
        stop = graph.spin()
        assert stop.code == 0


@pytest.mark.parametrize('missing', INPUTS)
def test_missing_peer_is_named(make_graph, missing):
    graph = make_graph(without=[missing], startup_timeout_s=1.0)
    stop = graph.spin()
    assert stop.code == 3
    assert f'{missing} has not appeared' in str(stop)
    assert graph.plant.log == []


def test_missing_recorder_is_named(make_graph):
    graph = make_graph(startup_timeout_s=1.0, record=True)
    assert 'recorder_node has not appeared' in str(graph.spin())


def test_second_source_of_time_is_refused_and_named(make_graph, context, monkeypatch):
    monkeypatch.setattr(clock, '_RIVALS_LEAVE_S', 0.5)
    graph = make_graph()
    other = rclpy.create_node('plant_node', namespace='/beta', context=context)
    graph.nodes.append(other)
    other.create_publisher(TOPICS['/clock'].message_type, '/clock', 10)
    stop = graph.spin()
    assert stop.code == 3
    assert str(stop).startswith('/clock is published by /beta/plant_node too')
    assert graph.plant.log == []


@pytest.mark.parametrize(
    ('culprit', 'topic'),
    [
        (CURRENT, 'current_velocity'),
        (NAVIGATION, 'odom'),
        (GUIDANCE, 'reference'),
        (CONTROL, 'demand'),
        (GUARD, 'command'),
    ],
)
def test_node_that_falls_silent_is_named(make_graph, culprit, topic):
    graph = make_graph(mute={culprit: 20}, tick_timeout_s=1.0)
    stop = graph.spin()
    assert stop.code == 3
    assert str(stop).startswith(f'{culprit} did not publish {topic} for t = 2.0 s')


@pytest.mark.parametrize(('is_rival', 'lockstep'), [(True, True), (False, True), (True, False)])
def test_a_plant_of_a_second_glider_does_not_end_the_run(make_graph, context, is_rival, lockstep):
    """Nor, free-running, a simulated one beside the vehicle, that nobody has heard of before."""
    graph = make_graph(last_tick=10**9, lockstep=lockstep)
    assert graph.spin(lambda: graph.plant.tick > 10) is None
    topic = TOPICS['lockstep']
    rival = rclpy.create_node('rival', namespace='/glider', context=context)
    graph.nodes.append(rival)
    publisher = rival.create_publisher(topic.message_type, topic.name, topic.qos)
    assert graph.spin(lambda: publisher.get_subscription_count() == len(graph.nodes) - 1) is None
    process = 'another' if is_rival else graph.plant.process
    report = health.Report(PLANT, health.FAILED, 'it sank', process=process)
    publisher.publish(health.report_array(report))
    until = time.monotonic() + 1.0
    stop = graph.spin(lambda: time.monotonic() > until)
    assert (stop is None) == is_rival


@pytest.mark.parametrize('lockstep', [True, False])
@pytest.mark.parametrize('has_just_begun', [True, False])
def test_of_two_plants_the_one_that_has_just_begun_leaves(
    make_graph, context, monkeypatch, has_just_begun, lockstep
):
    """Both clocks lie in the same place; the other one comes in sight after the first tick."""
    monkeypatch.setattr(clock, '_RIVALS_SHOW_S', 60.0 if has_just_begun else 0.0)
    graph = make_graph(last_tick=10**9, lockstep=lockstep)
    begun_s = time.monotonic()
    assert graph.spin(lambda: time.monotonic() > begun_s + 1.0 and graph.plant.tick > 10) is None
    other, topic = rclpy.create_node(PLANT, namespace='/other', context=context), TOPICS['/clock']
    graph.nodes.append(other)
    other.create_publisher(topic.message_type, topic.name, topic.qos)
    until = time.monotonic() + 2.0
    stop = graph.spin(lambda: time.monotonic() > until)
    if has_just_begun:
        assert (stop.code, str(stop)) == (
            3,
            f'/clock is published by /other/{PLANT} too; {peers.ALONE}',
        )
    else:
        assert stop is None


class Recorder(StepNode):
    """Stands in for the recorder: takes nothing, and says what it has when it is told."""

    def __init__(self, **kwargs) -> None:
        super().__init__(RECORDER, **kwargs)
        for topic in TOPICS.values():
            if topic.recorded:
                self._subscription(topic, lambda raw: None, gated=False)
        for name in MAX_TICKS_AHEAD:
            self.outputs[name] = (TOPICS[name], self._publisher(TOPICS[name]))
        self.start_up()

    def say(self, name: str, tick: int, process: str) -> None:
        """Say how far a recorder is."""
        header = Header(frame_id=process)
        header.stamp.sec, header.stamp.nanosec = divmod(tick * TICK_NS, 1_000_000_000)
        topic, publisher = self.outputs[name]
        publisher.publish(header)


@pytest.mark.parametrize('name', MAX_TICKS_AHEAD)
def test_only_its_own_recorder_lets_the_plant_go_on(make_graph, context, name):
    parameters = {'record': True, 'tick_timeout_s': 30.0}
    graph = make_graph(last_tick=10**9, **parameters)
    recorder = Recorder(
        context=context,
        namespace='/glider',
        use_global_arguments=False,
        parameter_overrides=[Parameter(name, value=value) for name, value in parameters.items()],
    )
    graph.nodes.append(recorder)
    graph.executor.add_node(recorder)
    ahead = MAX_TICKS_AHEAD[name]
    (other,) = {*MAX_TICKS_AHEAD} - {name}
    assert graph.spin(lambda: graph.plant.tick == min(MAX_TICKS_AHEAD.values())) is None
    recorder.say(other, 10_000, recorder.process)
    assert graph.spin(lambda: graph.plant.tick == ahead) is None
    recorder.say(name, 100, 'another')
    until = time.monotonic() + 1.0
    assert graph.spin(lambda: time.monotonic() > until) is None
    assert graph.plant.tick == ahead
    recorder.say(name, 100, recorder.process)
    assert graph.spin(lambda: graph.plant.tick == ahead + 101) is None


INTERRUPTED = """
import os, signal, sys
from glider_base.ros.lockstep.node import TickNode
from glider_base.ros.lockstep.process import run_together


class Interrupted(TickNode):
    def __init__(self):
        super().__init__('interrupted')
        self.wall_timer(0.01, self.act)

    def act(self):
        os.kill(os.getpid(), signal.SIGNAL)
        sum(range(1_000_000))  # many chances for an exception
        print('acted to the end', flush=True)


sys.exit(run_together([Interrupted]))
"""


@pytest.mark.parametrize('number', ['SIGINT', 'SIGTERM'])
def test_signal_does_not_break_off_what_a_node_does(number):
    """Compiled functions do not stand an exception from a signal handler."""
    done = subprocess.run(
        [sys.executable, '-c', INTERRUPTED.replace('SIGNAL', number)],
        env={'ROS_AUTOMATIC_DISCOVERY_RANGE': 'LOCALHOST', **os.environ},
        capture_output=True,
        text=True,
        timeout=TIMEOUT_S,
    )
    assert (done.returncode, done.stderr) == (0, '')
    assert done.stdout.startswith('acted to the end')


def test_ctrl_c_before_rclpy_hears_it_ends_a_node():
    """It was lost there: `ros2 launch` waited 5 s, and sent SIGTERM."""
    program = (
        'import signal, sys, tempfile\n'
        'from glider_base.ros.lockstep.process import run_together\n'
        'tempfile.TemporaryDirectory = lambda: signal.raise_signal(signal.SIGINT)\n'
        'sys.exit(run_together([lambda: 1 / 0]))\n'
    )
    done = subprocess.run(
        [sys.executable, '-c', program], capture_output=True, text=True, timeout=TIMEOUT_S
    )
    assert (done.returncode, done.stdout, done.stderr) == (0, '', '')


def test_number_that_is_not_finite_stops_the_run(make_graph):
    graph = make_graph()
    guidance = graph.blocks[GUIDANCE]
    send = guidance.publish['reference']
    guidance.publish['reference'] = lambda stamp_ns, values: send(
        stamp_ns, values if stamp_ns < 5 * TICK_NS else 13 * (float('nan'),)
    )
    stop = graph.spin()
    assert stop.code == 3
    assert 'reference of guidance_node' in str(stop)
    assert 'nan' in str(stop)


class Intruder:
    """A node outside of the lockstep that publishes on topics of the glider, and listens."""

    def __init__(self, graph, context, names: list[str]) -> None:
        self.node = rclpy.create_node('intruder', namespace='/other', context=context)
        graph.nodes.append(self.node)
        graph.executor.add_node(self.node)
        self.told = []
        events = TOPICS['/diagnostics']
        self.node.create_subscription(events.message_type, events.name, self.on_event, events.qos)
        self.publishers = {name: self._publisher(TOPICS[name]) for name in names}

    def _publisher(self, topic):
        return self.node.create_publisher(
            topic.message_type, topic.full_name('/glider'), topic.qos
        )

    def on_event(self, array) -> None:
        self.told += [status.message for status in array.status]

    def is_heard(self) -> bool:
        return all(
            publisher.get_subscription_count() >= max(1, len(TOPICS[name].readers))
            for name, publisher in self.publishers.items()
        )

    def not_named(self) -> list[str]:
        said = '/glider/{} is published by /other/intruder too'
        return [
            name
            for name in self.publishers
            if not any(said.format(name) in told for told in self.told)
        ]


#: Inputs of the blocks: a stranger may publish on any of them.
LISTENED = sorted({'command', 'current_velocity', 'drop_weight'}.union(*INPUTS.values()))
#: How a flight goes on.
MODES = {
    'as fast as possible': {},
    'four times real time': {'speed': 4.0},
    'free-running': {'lockstep': False},
}
#: How long (wall time, s) a stranger publishes on every topic in each way.
EACH_S = 0.4
WILD = 12345.0
#: What a stranger says, from the topic and the tick that is due.
SAYS = {
    'what the first one says': lambda topic, tick: _wild(topic, tick),
    'a tick ahead': lambda topic, tick: _wild(topic, tick + 1),
    'nothing': lambda topic, tick: b'',
    'noise': lambda topic, tick: bytes(range(256)),
}
#: Messages of a stranger for each turn of the executor: less often than the first one publishes,
#: and far more often.
BURSTS = (1, 60)


def _wild(topic, tick: int) -> bytes:
    return topic.codec.encode(tick * TICK_NS, len(topic.codec.fields) * (WILD,))


@pytest.mark.parametrize('mode', MODES)
def test_stranger_is_refused_and_named_however_much_it_says(make_graph, context, mode):
    """It joins in mid-flight, and its numbers rise from 1 to far beyond those of the first one."""
    graph = make_graph(last_tick=10**9, **MODES[mode])
    assert graph.spin(lambda: graph.plant.tick > 10) is None
    intruder = Intruder(graph, context, LISTENED)
    assert graph.spin(intruder.is_heard) is None
    sent, before = Counter(), graph.plant.tick
    for says in SAYS.values():
        for burst in BURSTS:
            until = time.monotonic() + EACH_S
            while time.monotonic() < until:
                for name, publisher in intruder.publishers.items():
                    for _ in range(burst):
                        publisher.publish(says(TOPICS[name], graph.plant.tick))
                    sent[name] += burst
                    graph.executor.spin_once(timeout_sec=0.005)
    assert graph.spin(lambda: not intruder.not_named()) is None, intruder.not_named()
    assert min(sent.values()) > graph.plant.tick + 100
    flown = [(tick, command, current) for _, tick, command, current in graph.plant.log]
    if MODES[mode].get('lockstep', True):
        # odom is the tick, joint_states less the tick, and each block sends on the sum
        assert [(command[0], current[0]) for _, command, current in flown] == [
            (2.0 * tick, float(tick)) for tick, *_ in flown
        ]
        assert graph.plant.tick > before + 10
    else:
        said = [(*command, *current) for tick, command, current in flown if tick > 10]
        assert max(abs(value) for values in said for value in values) < WILD
        # every tick brings something new: the first one is still obeyed
        assert len(set(said)) > 0.6 * len(said) > 10


def test_publisher_that_takes_the_place_of_one_that_is_gone_is_believed(make_graph):
    """Free-running, a driver may be started again: its numbers begin at 1."""
    graph = make_graph(lockstep=False, input_max_age_s=1.0)
    control = graph.blocks[CONTROL]
    assert graph.spin(lambda: len(control.steps) > 5) is None
    guidance = graph.blocks[GUIDANCE]
    (publisher,) = (p for topic, p in guidance.outputs.values() if topic.name == 'reference')
    guidance.destroy_publisher(publisher)
    assert graph.spin(lambda: not control.get_publishers_info_by_topic('reference')) is None
    guidance.publish['reference'] = guidance.add_output('reference')
    before = len(control.steps)
    assert graph.spin(lambda: len(control.steps) > before + 5) is None
    assert all(item.refused == 0 for item in control.inputs)


class Speaker:
    """A node that says things on a topic of the glider, when it is told to."""

    def __init__(self, graph, context, name: str, namespace: str, topic: str) -> None:
        self.node = rclpy.create_node(name, namespace=namespace, context=context)
        graph.nodes.append(self.node)
        self.topic, full_name = TOPICS[topic], TOPICS[topic].full_name('/glider')
        self.publisher = self.node.create_publisher(
            self.topic.message_type, full_name, self.topic.qos
        )
        self.number = 0

    def say(self, value: float) -> None:
        """Say something about a tick that is new."""
        self.number += 1
        stamp_ns = time.time_ns() // TICK_NS * TICK_NS + self.number
        self.publisher.publish(
            self.topic.codec.encode(stamp_ns, len(self.topic.codec.fields) * (value,))
        )


@pytest.fixture
def listening(make_graph, context):
    """Control without guidance, and what else publishes reference: control, the rest by name."""
    graph = make_graph(lockstep=False, input_max_age_s=0.5, without=[GUIDANCE])
    control = graph.blocks[CONTROL]
    (item,) = (item for item in control.inputs if item.topic.name == 'reference')

    def add(name: str, namespace: str = '/glider') -> Speaker:
        speaker = Speaker(graph, context, name, namespace, 'reference')
        count = speaker.publisher.get_subscription_count
        assert graph.spin(lambda: count() >= 2) is None  # control and the guard
        return speaker

    def is_believed(speaker: Speaker, value: float, for_s: float = 3.0) -> bool:
        """Let it speak for a while; whether control believes it by then."""
        until = time.monotonic() + for_s

        def say() -> bool:
            speaker.say(value)
            return item.values[:1] == (value,) or time.monotonic() > until

        assert graph.spin(say) is None
        return item.values[:1] == (value,)

    return add, is_believed, item


def test_one_that_was_started_again_is_believed_once_the_first_is_silent(listening):
    """The first is not gone from sight: the middleware lists it for as long as it likes."""
    add, is_believed, item = listening
    first = add(GUIDANCE)
    assert is_believed(first, 1.0)
    again = add(GUIDANCE)
    heard_s = item.owner.heard_s
    assert is_believed(again, 2.0)
    assert item.owner.heard_s - heard_s >= 0.5  # not before input_max_age_s
    assert item.refused == 0


def test_two_of_one_name_are_told_apart_by_gid(listening, context):
    add, is_believed, item = listening
    first, second = add(GUIDANCE), add(GUIDANCE)
    for _ in range(10):
        assert is_believed(first, 1.0)
        assert not is_believed(second, 2.0, 0.05)
    assert item.refused > 0
    infos = {
        bytes(info.endpoint_gid) for info in first.node.get_publishers_info_by_topic('reference')
    }
    (gid,) = infos - {item.owner.gid}
    shown = '.'.join(f'{byte:02x}' for byte in gid)
    said = peers.stranger(first.node, item, gid)
    said_of = '/glider/reference is published by /glider/guidance_node'
    assert said == f'{said_of} ({shown}) too'
    first.node.destroy_publisher(first.publisher)
    end = time.monotonic() + 10.0
    while 'too' in (said := peers.stranger(second.node, item, gid)):
        assert time.monotonic() < end
    assert said == f'{said_of} which spoke while /glider/guidance_node did: start it again'


def test_one_that_publishes_alone_is_told_whose_the_topic_is(listening):
    add, is_believed, item = listening
    lone = add('my_guidance')
    assert not is_believed(lone, 9.0, 0.5)
    (info,) = lone.node.get_publishers_info_by_topic('reference')
    said = peers.stranger(lone.node, item, bytes(info.endpoint_gid))
    assert said == f'/glider/reference is published by /glider/my_guidance and not by {GUIDANCE}'


def test_one_that_was_started_again_in_a_run_is_told_what_to_do(listening):
    add, is_believed, item = listening
    again = add(GUIDANCE)
    assert is_believed(again, 9.0)
    said = peers.stranger(again.node, Input(TOPICS['reference'], True), item.owner.gid)
    assert said.startswith('/glider/reference is published by /glider/guidance_node which was')
    assert said.endswith('started when this run had begun: start all its nodes again')


@pytest.mark.parametrize('is_first', [True, False])
def test_silence_of_the_first_is_no_chance_for_a_stranger(listening, is_first):
    """Neither for one that came before it, nor for one that comes in its silence."""
    add, is_believed, item = listening
    if is_first:
        stranger = add('stranger', '/other')
        assert not is_believed(stranger, 9.0, 0.5)
    first = add(GUIDANCE)
    assert is_believed(first, 1.0)
    stranger = stranger if is_first else add('stranger', '/other')
    assert not is_believed(stranger, 9.0, 1.0)
    assert is_believed(first, 2.0)
    assert item.refused > 10


@pytest.mark.parametrize('lockstep', [True, False])
@pytest.mark.parametrize(
    'raw',
    [b'', b'\0\1\0\0', b'\0\1\0\0' + 40 * b'\xff', bytes(range(256)), 100_000 * b'\xff'],
    ids=['nothing', 'a header', 'too short', 'noise', 'too long'],
)
def test_malformed_message_ends_no_node(make_graph, context, lockstep, raw):
    graph = make_graph(last_tick=10**9, lockstep=lockstep)
    control = graph.blocks[CONTROL]
    assert graph.spin(lambda: len(control.steps) > 3) is None
    intruder = Intruder(graph, context, ['reference'])
    assert graph.spin(intruder.is_heard) is None
    (publisher,) = intruder.publishers.values()
    (item,) = (item for item in control.inputs if item.topic.name == 'reference')

    def is_refused() -> bool:
        publisher.publish(raw)  # again: free-running nodes keep the newest message only
        return item.refused >= 3

    assert graph.spin(is_refused) is None
    before = len(control.steps)
    assert graph.spin(lambda: len(control.steps) > before + 3) is None


@pytest.mark.parametrize(
    ('field', 'frame'),
    [('header.frame_id', 'map_ned'), ('header.frame_id', ''), ('child_frame_id', 'base_link_frd')],
)
def test_other_frames_are_refused_and_named(make_graph, context, field, frame):
    """A driver in NED looks right to everything but the vehicle."""
    graph = make_graph(lockstep=False, input_max_age_s=1.0, without=())
    (item,) = graph.blocks[GUIDANCE].inputs
    message = deserialize_message(item.topic.codec.encode(TICK_NS, 17 * (0.5,)), Odometry)
    if field == 'child_frame_id':
        message.child_frame_id = frame
    else:
        message.header.frame_id = frame
    with pytest.raises(MessageError, match=f"{field} is '{frame}'"):
        item.accept(to_cdr(message))
    message.header.frame_id, message.child_frame_id = 'map', 'one/base_link'
    item.accept(to_cdr(message))
    assert item.values == 17 * (0.5,)


def test_a_battery_that_counts_in_percent_is_refused_and_named():
    item = Input(TOPICS['battery'], lockstep=False)
    with pytest.raises(MessageError, match='battery: percentage is 5 '):
        item.accept(item.topic.codec.encode(0, (15.0, -1.0, 1.0, 20.0, 5.0)))
    item.accept(item.topic.codec.encode(0, (15.0, -1.0, 20.5, 20.0, 1.025)))
    assert item.values[0] == 15.0


def test_a_free_running_message_that_is_none_is_named_by_its_topic():
    """By its stamp too, which says whether it was overtaken."""
    item = Input(TOPICS['odom'], lockstep=False)
    for raw in (b'nothing', item.topic.codec.encode(-1, 17 * (0.5,))):
        with pytest.raises(MessageError, match='^odom: '):
            item.accept_newest(raw, 0.0, 1.0)


@pytest.mark.parametrize(
    ('one', 'why'),
    [
        (Parameter('nonsense', value=1.0), 'control_node: parameter nonsense: unknown (allowed: '),
        (Parameter('use_sim_time', value=True), 'use_sim_time: a node goes by one clock '),
    ],
)
def test_parameter_that_cannot_be_set_in_flight_is_refused_by_its_name(
    make_graph, context, one, why
):
    graph = make_graph(lockstep=False)
    client_node = rclpy.create_node('client', namespace='/glider', context=context)
    graph.nodes.append(client_node)
    graph.executor.add_node(client_node)
    client = client_node.create_client(SetParameters, f'{CONTROL}/set_parameters')
    assert graph.spin(client.service_is_ready) is None
    future = client.call_async(SetParameters.Request(parameters=[one.to_parameter_msg()]))
    assert graph.spin(future.done) is None
    (result,) = future.result().results
    assert not result.successful
    assert result.reason.startswith(why)


def test_a_node_of_another_name_is_refused(context):
    """It flew by the defaults: a parameter file has its own name."""
    words = ['--ros-args', '-r', '__node:=law']
    with pytest.raises(ConfigurationError, match='__node:=law: not usable: the others know con'):
        StepNode('control_node', context=context, cli_args=words)


def test_parameter_of_a_type_that_there_is_not_ends_no_node(make_graph, context):
    """It ended autopilot, and the guard with it."""
    graph = make_graph(lockstep=False)
    client_node = rclpy.create_node('client', namespace='/glider', context=context)
    graph.nodes.append(client_node)
    graph.executor.add_node(client_node)
    client = client_node.create_client(SetParameters, f'{CONTROL}/set_parameters')
    assert graph.spin(client.service_is_ready) is None
    strange = ParameterMessage(name='pid.pitch_kp', value=ParameterValue(type=77))
    future = client.call_async(SetParameters.Request(parameters=[strange]))
    assert graph.spin(future.done) is None
    assert not future.result().results


@pytest.mark.parametrize(
    'durability', [DurabilityPolicy.VOLATILE, DurabilityPolicy.TRANSIENT_LOCAL]
)
def test_how_a_node_is_is_repeated_each_second_for_who_listens_now(
    make_graph, context, durability
):
    """Who asks for what was said before, as a recorder does, gets what changes and no more."""
    graph = make_graph(last_tick=101, speed=20.0)
    listener = rclpy.create_node('listener', namespace='/other', context=context)
    graph.nodes.append(listener)
    graph.executor.add_node(listener)
    heard = defaultdict(list)

    def hear(array) -> None:
        for status in array.status:
            heard[status.name].append((health.stamp_of(array), status.message))

    profile = QoSProfile(depth=100, durability=durability)
    listener.create_subscription(DiagnosticArray, '/diagnostics', hear, profile)

    def is_all_said() -> bool:
        over_s = graph.plant.over_since_s
        return over_s is not None and time.monotonic() > over_s + 0.5

    while not is_all_said():
        stop = graph.spin(is_all_said)
        assert stop is None or stop.code == 0  # the nodes leave
    names = {f'/glider/{name}' for name in (PLANT, *INPUTS)}
    stamps = {name: [stamp for stamp, said in heard[name] if said == 'running'] for name in names}
    seconds = [k * 1_000_000_000 for k in range(11)]
    if durability == DurabilityPolicy.VOLATILE:
        # the first may be said before the middleware has connected the two
        assert {name: found[-10:] for name, found in stamps.items()} == dict.fromkeys(
            names, seconds[1:]
        )
    else:
        assert stamps == dict.fromkeys(names, [])
        assert heard[f'/glider/{PLANT}'][-1][1] == health.COMPLETE


def test_a_node_without_its_inputs_repeats_that_it_is_not_well(make_graph, context):
    graph = make_graph(last_tick=10**9, lockstep=False, input_max_age_s=0.3)
    levels, listener = [], rclpy.create_node('listener', namespace='/other', context=context)
    graph.nodes.append(listener)
    graph.executor.add_node(listener)
    listener.create_subscription(
        DiagnosticArray,
        '/diagnostics',
        lambda array: levels.extend(
            (one.level, one.message) for one in array.status if one.name == f'/glider/{CONTROL}'
        ),
        10,
    )
    control, guidance = graph.blocks[CONTROL], graph.blocks[GUIDANCE]
    assert graph.spin(lambda: len(control.steps) > 2) is None
    guidance.mute_from_ns = 0
    said = 'missing or stale: reference; silent until then'
    assert graph.spin(lambda: levels.count((health.ERROR, said)) >= 3) is None
    guidance.mute_from_ns = None
    assert graph.spin(lambda: levels[-1:] == [(health.OK, 'running')]) is None


def test_speed_is_kept_without_drift(make_graph):
    graph = make_graph(last_tick=200, speed=10.0)
    graph.spin_until_over()
    times = [wall_s for wall_s, *_ in graph.plant.log]
    # tick k is not published before start + k * 10 ms, and answered soon after: of those of the
    # first second at least one, however busy the processors are
    start = min(time_s - 0.01 * k for k, time_s in enumerate(times[:100]))
    assert times[200] - start > 2.0 - 0.05
    assert times[200] - start < 2.0 + 2.0


def test_pause_holds_the_run_and_is_not_taken_for_a_fault(make_graph, context):
    graph = make_graph(last_tick=10**9, tick_timeout_s=0.5)
    client_node = rclpy.create_node('client', namespace='/glider', context=context)
    graph.nodes.append(client_node)
    graph.executor.add_node(client_node)
    client = client_node.create_client(SetBool, 'pause')
    assert graph.spin(lambda: graph.plant.tick > 10 and client.service_is_ready()) is None

    future = client.call_async(SetBool.Request(data=True))
    assert graph.spin(future.done) is None
    held_at, until = graph.plant.tick, time.monotonic() + 1.0
    assert graph.spin(lambda: time.monotonic() > until) is None
    assert graph.plant.tick <= held_at + 1

    future = client.call_async(SetBool.Request(data=False))
    assert graph.spin(future.done) is None
    assert graph.spin(lambda: graph.plant.tick > held_at + 20) is None


def test_free_running_acts_on_the_newest_input(make_graph):
    graph = make_graph(last_tick=10, lockstep=False, speed=2.0)
    assert graph.spin_until_over() is None
    assert len(graph.plant.log) == 11
    assert graph.blocks[CONTROL].steps


def test_free_running_node_notices_stale_input_and_recovers(make_graph):
    graph = make_graph(last_tick=10**9, lockstep=False, input_max_age_s=0.3)
    control, guidance = graph.blocks[CONTROL], graph.blocks[GUIDANCE]
    assert graph.spin(lambda: len(control.steps) > 2) is None
    guidance.mute_from_ns, before = 0, control.stale_steps
    assert graph.spin(lambda: control.stale_steps > before + 2) is None
    guidance.mute_from_ns, before = None, len(control.steps)
    assert graph.spin(lambda: len(control.steps) > before + 2) is None


def test_free_running_node_notices_silence_though_the_clock_was_set_back(make_graph, monkeypatch):
    graph = make_graph(last_tick=10**9, lockstep=False, input_max_age_s=0.3)
    control, guidance = graph.blocks[CONTROL], graph.blocks[GUIDANCE]
    assert graph.spin(lambda: len(control.steps) > 2) is None
    guidance.mute_from_ns, before, now_s = 0, control.stale_steps, control.now_s
    monkeypatch.setattr(control, 'now_s', lambda: now_s() - 3600.0)
    assert graph.spin(lambda: control.stale_steps > before + 2) is None


def test_who_may_be_silent_does_not_tell_a_node_the_time(make_graph):
    """By another clock than that of the vehicle, and then nothing more."""
    graph = make_graph(last_tick=10**9, lockstep=False)
    guard = graph.blocks[GUARD]
    assert graph.spin(lambda: len(guard.steps) > 2) is None
    silent = [SAID.index(name) for name in ('health', 'battery')]
    for place in silent:
        graph.plant.publish[place] = lambda *_: None
    (item,) = (one for one in guard.inputs if one.topic.name == 'health')
    item.subscription.callback(item.topic.codec.encode(10**18, 3 * (0.0,)), {})
    before = len(guard.steps)
    assert graph.spin(lambda: len(guard.steps) > before + 5) is None
    assert max(guard.steps) < 10**18


def test_health_that_comes_seldom_is_not_counted_as_lost_or_late(make_graph, monkeypatch):
    """Every fifth tick, as it may: what is told of the line is told of what is due in each."""
    monkeypatch.setattr(step_node, '_TELL_EVERY_S', 0.0)
    graph = make_graph(last_tick=10**9, lockstep=False)
    guard, place, told = graph.blocks[GUARD], SAID.index('health'), {}
    monkeypatch.setattr(guard, 'event', lambda *said, **counts: told.update(counts))
    say = graph.plant.publish[place]
    graph.plant.publish[place] = lambda *said: graph.plant.tick % 5 or say(*said)
    (demand,) = (one for one in guard.inputs if one.topic.name == 'demand')
    assert graph.spin(lambda: len(guard.steps) > 12) is None
    demand.subscription.callback(
        demand.topic.codec.encode(demand.stamp_ns + 5 * TICK_NS, 3 * (0.0,)), {}
    )
    assert graph.spin(lambda: told.get('demand_lost')) is None
    assert not told.get('health_lost') and not told.get('health_late')


@pytest.mark.parametrize(
    ('stamps', 'kept', 'lost'),
    [
        ([0.1, 0.2, 0.3], 0.3, 0),
        ([0.1, 0.2, 0.5], 0.5, 2),
        ([0.1, 0.3, 0.2], 0.3, 1),  # overtaken on its way
        ([0.1, 5.0], 5.0, 0),  # a silence
        ([5.0, 0.1], 0.1, 0),  # the clock of the vehicle was set back
    ],
)
def test_free_running_input_keeps_the_newest_and_counts_what_lacks(make_graph, stamps, kept, lost):
    graph = make_graph(lockstep=False, input_max_age_s=1.0)
    (item,) = graph.blocks[GUIDANCE].inputs
    for stamp_s in stamps:
        raw = item.topic.codec.encode(round(stamp_s * 1e9), 17 * (stamp_s,))
        item.subscription.callback(raw, {})
    assert item.stamp_ns == round(kept * 1e9)
    assert item.values == 17 * (kept,)
    assert item.lost == lost


def test_reports_survive_the_way_over_a_topic():
    report = health.Report(
        'guidance_node', health.WAITING, 'waits', 300_000_000, PLANT, 'odom', health.WARN
    )
    array = health.report_array(report)
    assert health.reports_in(array) == [report]


@pytest.mark.parametrize(
    ('name', 'namespace', 'expected'),
    [
        ('/alpha/guidance_node', '/alpha', True),
        ('/alpha/guidance_node', '/beta', False),
        ('/alpha/guidance_node', '/alp', False),
        ('/alpha/guidance_node', '/', False),
        ('/guidance_node', '/', True),
        ('battery', '/alpha', True),
    ],
)
def test_diagnostics_of_another_namespace_do_not_concern_a_glider(name, namespace, expected):
    event = health.status_array(0, name, health.OK, 'gliding down', {'stage': 1})
    assert health.concerns(event, namespace) is expected


def test_every_message_is_told_by_whom_whatever_else_there_is_to_do(context):
    """A stranger is told apart by that alone, and timers in no gate are a matter of rclpy."""
    node, gate, infos = rclpy.create_node('listener', context=context), Gate(), []
    node.create_subscription(
        *(Header, 'words', lambda raw, info: infos.append(info), 10),
        callback_group=gate,
        raw=True,
    )
    gate.awaited |= set(node.subscriptions)
    for _ in range(3):
        node.create_timer(0.001, lambda: None)
    publisher, enough = node.create_publisher(Header, 'words', 10), threading.Event()

    def say() -> None:
        while not enough.wait(1e-4):
            publisher.publish(Header())

    with TickExecutor(context=context) as executor:
        executor.add_node(node)
        sayer = threading.Thread(target=say)
        sayer.start()
        end = time.monotonic() + 60.0
        while len(infos) < 2000 and time.monotonic() < end:
            executor.spin_once(timeout_sec=0.1)
        enough.set()
        sayer.join()
    node.destroy_node()
    assert len(infos) >= 2000
    assert all(info.get(GID) for info in infos)


def test_timers_in_a_gate_are_called_until_they_are_destroyed_or_cancelled(context):
    node, called = rclpy.create_node('ringing', context=context), Counter()

    def ring(name: str, then=lambda: None):
        def act() -> None:
            called[name] += 1
            then()

        return node.create_timer(0.002, act, gate, clock=clock)

    def end_others() -> None:
        if called['first'] == 10:
            node.destroy_timer(destroyed)
            cancelled.cancel()
            called['before'] = called['destroyed'] + called['cancelled']
            ring('new')

    gate = Gate()
    clock = rclpy.clock.Clock(clock_type=rclpy.clock.ClockType.STEADY_TIME)
    ring('first', end_others)
    destroyed, cancelled = ring('destroyed'), ring('cancelled')
    with TickExecutor(context=context) as executor:
        executor.add_node(node)
        end = time.monotonic() + 60.0
        while min(called['first'], 2 * called['new']) < 40 and time.monotonic() < end:
            if called['first'] % 2:  # there is always something for rclpy to see to as well
                executor.wake()
            executor.spin_once(timeout_sec=0.1)
    node.destroy_node()
    assert called['new'] >= 20
    assert 0 < called['before'] == called['destroyed'] + called['cancelled']


def test_who_was_woken_before_its_context_was_shut_down_does_not_wait_for_ever(context):
    """So rclpy answers SIGTERM: it wakes, then shuts down; about once in a thousand too late."""
    with TickExecutor(context=context) as executor:
        shut_down = threading.Timer(0.3, context.handle.shutdown)  # wakes nobody, as rclpy there
        shut_down.start()
        with contextlib.suppress(ExternalShutdownException, RuntimeError):
            executor.spin()
        assert not context.ok()
        shut_down.join()
