# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""A replay is the recording: every message once, in order, byte by byte, at any speed."""

import filecmp
import json
import os
import random
import signal
import time
from collections import defaultdict

import pytest
import rclpy
from mcap.writer import Writer
from rclpy.context import Context
from rclpy.duration import Duration
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, HistoryPolicy, QoSProfile, ReliabilityPolicy
from typer.testing import CliRunner

from command_line import Started
from glider_base.ros.lockstep import health
from glider_base.ros.places import domain_id
from glider_base.ros.wire.topics import REPLAY, TOPICS, recorded_topics
from glider_base.settings import ConfigurationError
from glider_base.signals import TICK_NS
from glider_bringup.cli import app
from glider_bringup.engines.node_parameters import node_parameters, write_parameters
from glider_bringup.engines.processes import RECORDER, node_commands
from glider_mission.recording.mcap_reader import Bag, BagTopic
from glider_mission.recording.ros.recorded_log import RecordedLog
from glider_mission.recording.ros.republish import plan_replay, qos_of
from glider_mission.recording.ros.rosbag2 import BagWriter
from glider_mission.scenario import load_scenario

DEADLINE_S = 120.0
RECORDED = {topic.full_name('/glider'): topic for topic in recorded_topics(['measured_odom'])}


@pytest.fixture
def context(monkeypatch):
    """ROS context in a domain of its own, which the processes of the test share."""
    monkeypatch.setenv('ROS_AUTOMATIC_DISCOVERY_RANGE', 'LOCALHOST')
    monkeypatch.delenv('ROS_DOMAIN_ID', raising=False)
    context = Context()
    with domain_id() as domain:
        monkeypatch.setenv('ROS_DOMAIN_ID', str(domain))
        rclpy.init(context=context, domain_id=domain)
        yield context
        rclpy.try_shutdown(context=context)


@pytest.fixture
def start(context, tmp_path_factory):
    """Start a module with words; it does not outlive the test."""
    processes = []

    def run(module: str, *words) -> Started:
        folder = tmp_path_factory.mktemp('said')
        processes.append(Started(words, {**os.environ}, folder, module))
        return processes[-1]

    yield run
    for process in processes:
        process.kill()


@pytest.fixture
def replay(start):
    """Start a replay."""
    return lambda *arguments: start('glider_bringup.cli', 'replay', *arguments)


@pytest.fixture
def start_recorder(start, tmp_path):
    """Start a recorder that writes to a folder of a name, with parameters."""

    def run(name: str, **options) -> Started:
        parameters = node_parameters(load_scenario(), record_to=tmp_path / name, **options)
        write_parameters(parameters, tmp_path / f'{name}.yaml')
        _, _, *module_and_words = node_commands(tmp_path / f'{name}.yaml')[RECORDER]
        return start(*module_and_words)

    return run


class Listener:
    """Subscribes to topics, with a queue without end, and keeps what comes."""

    def __init__(self, context, names, durability=DurabilityPolicy.VOLATILE) -> None:
        self.node = Node('listener', context=context)
        self.executor = SingleThreadedExecutor(context=context)
        self.executor.add_node(self.node)
        self.got: dict[str, list[bytes]] = defaultdict(list)
        qos = QoSProfile(
            history=HistoryPolicy.KEEP_ALL,
            reliability=ReliabilityPolicy.RELIABLE,
            durability=durability,
        )
        for name in names:
            kind, take = RECORDED[name].message_type, self.got[name].append
            self.node.create_subscription(kind, name, take, qos, raw=True)

    def listen_until(self, condition, process) -> None:
        end = time.monotonic() + DEADLINE_S
        while not condition():
            assert time.monotonic() < end, {name: len(got) for name, got in self.got.items()}
            assert process.poll() in (None, 0), process.communicate()
            self.executor.spin_once(timeout_sec=0.1)

    def close(self) -> None:
        self.executor.shutdown()
        self.node.destroy_node()


@pytest.fixture
def listen(context):
    """Make listeners."""
    made = []

    def make(*names, **options) -> Listener:
        made.append(Listener(context, names, **options))
        return made[-1]

    yield make
    for listener in made:
        listener.close()


@pytest.fixture(scope='module')
def recorded(short_run, read_bag):
    """Payloads of the short run by topic."""
    (file,) = short_run.glob('*.mcap')
    payloads = defaultdict(list)
    for message in read_bag(file):
        payloads[message.topic].append(message)
    return payloads


def data(messages) -> list[bytes]:
    return [message.data for message in messages]


# ---------------------------------------------------------------------- every message


@pytest.mark.parametrize(('rate', 'seconds'), [('1', 3), ('50', 120), ('max', 120)])
def test_subscriber_gets_every_message_once_and_in_order(
    short_run, recorded, replay, listen, rate, seconds
):
    names = ['/glider/odom', '/glider/adaptation', '/glider/command']
    listener = listen(*names)
    options = ('--topics', 'odom,adaptation', '--topics', '/glider/command')
    process = replay(
        short_run, '--rate', rate, '--duration', seconds, *options, '--wait-for', 1, '--json'
    )
    expected = {
        name: data(m for m in recorded[name] if m.log_ns <= seconds * 1e9) for name in names
    }
    total = sum(map(len, expected.values()))
    listener.listen_until(lambda: sum(map(len, listener.got.values())) >= total, process)
    out, error = process.communicate(timeout=DEADLINE_S)
    assert process.returncode == 0, error
    for name in names:
        assert listener.got[name] == expected[name], name
    report = json.loads(out)
    count = len(expected['/glider/odom'])
    assert report['counts'] == {**dict.fromkeys(names, count), '/clock': count}
    if rate != 'max':
        assert report['wall_s'] >= seconds / float(rate)


def test_second_recording_at_full_speed_is_byte_identical(
    short_run, recorded, read_bag, start_recorder, replay, tmp_path
):
    recorder = start_recorder('again')
    process = replay(short_run, '--rate', 'max', '--wait-for', 1)
    _, error = process.communicate(timeout=DEADLINE_S)
    assert process.returncode == 0, error
    recorder.send_signal(signal.SIGINT)
    assert recorder.wait(DEADLINE_S) == 0
    (file,) = (tmp_path / 'again').glob('*.mcap')
    again = defaultdict(list)
    for message in read_bag(file):
        again[message.topic].append(message)
    assert again == recorded


def test_events_that_come_late_are_recorded_with_their_tick(
    short_run, recorded, context, start_recorder, replay, listen, tmp_path
):
    """All messages of a minute, then all its events: the file is that of a replay in order."""
    process = start_recorder('usual')
    replayed = replay(short_run, '--rate', 'max', '--wait-for', 1, '--duration', 60)
    _, error = replayed.communicate(timeout=DEADLINE_S)
    assert replayed.returncode == 0, error
    process.send_signal(signal.SIGINT)
    assert process.wait(DEADLINE_S) == 0

    process = start_recorder('late')
    node = Node(REPLAY, context=context, namespace='/glider')
    publishers = {
        name: node.create_publisher(topic.message_type, name, topic.qos)
        for name, topic in {**RECORDED, '/glider/told': TOPICS['told']}.items()
    }
    listener, acknowledged = listen(), []
    listener.node.create_subscription(
        TOPICS['recorded'].message_type,
        '/glider/recorded',
        lambda header: acknowledged.append(header.stamp.sec),
        TOPICS['recorded'].qos,
    )

    def listen_until(condition) -> None:
        listener.listen_until(condition, process)

    listen_until(lambda: all(one.get_subscription_count() for one in publishers.values()))
    last_ns = 600 * TICK_NS
    kept = {n: [m for m in got if m.log_ns <= last_ns] for n, got in recorded.items()}
    events = kept.pop('/diagnostics')
    for name, messages in kept.items():
        for message in messages:
            publishers[name].publish(message.data)
    listener.executor.spin_once(timeout_sec=1.0)
    assert not acknowledged
    told = health.EventCount(f'/glider/{REPLAY}', len(events), last_ns)
    publishers['/glider/told'].publish(health.count_array(told))
    listener.executor.spin_once(timeout_sec=1.0)
    assert not acknowledged
    assert len(events) > 3
    for message in events:
        publishers['/diagnostics'].publish(message.data)
    listen_until(lambda: acknowledged and acknowledged[-1] >= 51)
    # those after it may be on their way, of any topic
    for publisher in publishers.values():
        assert publisher.wait_for_all_acked(Duration(seconds=DEADLINE_S))
    process.send_signal(signal.SIGINT)
    assert process.wait(DEADLINE_S) == 0
    node.destroy_node()
    usual, late = (next((tmp_path / name).glob('*.mcap')) for name in ('usual', 'late'))
    assert late.name == usual.name
    assert filecmp.cmp(late, usual, shallow=False)


@pytest.mark.parametrize('sync', ['end', 'chunk'])
def test_what_a_killed_recorder_has_acknowledged_can_be_read(
    short_run, start_recorder, replay, listen, tmp_path, sync
):
    listener, topic, acknowledged = listen(), TOPICS['recorded'], []
    listener.node.create_subscription(
        topic.message_type,
        topic.full_name('/glider'),
        lambda header: acknowledged.append(header.stamp.sec * 10**9 + header.stamp.nanosec),
        topic.qos,
    )
    recorder = start_recorder('again', sync=sync)
    process = replay(short_run, '--rate', 100, '--wait-for', 1)
    enough, wait_s = random.randint(1, 5), random.uniform(0.0, 0.05)
    listener.listen_until(lambda: len(acknowledged) >= enough, process)
    time.sleep(wait_s)
    recorder.kill()
    bag = Bag(tmp_path / 'again')
    assert 'ends early' in bag.cut
    log = RecordedLog(bag)
    rows = sum(len(block) for block in log.blocks())
    assert rows >= acknowledged[-1] // TICK_NS + 1, (enough, wait_s)
    assert log.lost(complete=True) == 0


def test_recorder_that_does_not_keep_step_does_not_hold_a_replay_up(
    short_run, start_recorder, replay
):
    start_recorder('again', lockstep=False)
    process = replay(short_run, '--rate', 'max', '--wait-for', 1)
    _, error = process.communicate(timeout=DEADLINE_S)
    assert process.returncode == 0, error


def test_latched_topic_is_there_for_who_comes_late_and_for_who_starts_late(
    short_run, recorded, replay, listen
):
    process = replay(short_run, '--start', 110, '--topics', 'path,odom')
    early = listen('/glider/odom')
    early.listen_until(lambda: early.got['/glider/odom'], process)
    late = listen('/glider/path', durability=DurabilityPolicy.TRANSIENT_LOCAL)
    late.listen_until(lambda: late.got['/glider/path'], process)
    assert late.got['/glider/path'] == data(recorded['/glider/path'])
    assert early.got['/glider/odom'][0] in data(recorded['/glider/odom'][1100:])


def test_publishers_offer_what_was_recorded(short_run, replay, listen):
    process = replay(short_run, '--namespace', 'a/b', '--wait-for', 1, '--start', 60)
    names = {name: name.replace('/glider/', '/a/b/') for name in RECORDED}
    listener = listen()
    found = {}

    def all_there() -> bool:
        for name, published in names.items():
            for info in listener.node.get_publishers_info_by_topic(published):
                if info.node_name != '_NODE_NAME_UNKNOWN_':  # it can come later
                    found[name] = info
        return set(found) == set(names)

    listener.listen_until(all_there, process)
    for name, info in found.items():
        topic = RECORDED[name]
        assert info.node_name == 'replay_node'
        assert info.topic_type == topic.type_name
        assert info.qos_profile.reliability == topic.qos.reliability
        assert info.qos_profile.durability == topic.qos.durability
    process.send_signal(signal.SIGINT)
    out, error = process.communicate(timeout=DEADLINE_S)
    assert process.returncode == 130
    assert 'stopped by SIGINT' in error
    assert 'Traceback' not in error + out


def test_loop_begins_again_with_the_recorded_stamps(
    short_run, recorded, replay, listen, monkeypatch
):
    listener = listen('/clock')
    monkeypatch.setenv('ROS_HOME', '/proc/none')  # nobody can write there, nor has to
    process = replay(
        short_run,
        '--loop',
        '--rate',
        'max',
        '--duration',
        2,
        '--topics',
        '/clock',
        '--wait-for',
        1,
    )
    once = data(recorded['/clock'][:21])
    listener.listen_until(lambda: len(listener.got['/clock']) >= 63, process)
    process.send_signal(signal.SIGINT)
    assert process.wait(DEADLINE_S) == 130
    assert listener.got['/clock'][:63] == 3 * once


@pytest.mark.parametrize('by', ['others', 'our recorder'])
def test_recording_without_clock_gets_one_by_its_log_times(
    short_run, read_bag, write_bag, replay, listen, tmp_path, by
):
    """Ours of free-running nodes has the topic, and no message of it."""
    (like,) = short_run.glob('*.mcap')
    kept = [m for m in read_bag(like) if m.topic == '/glider/odom' and m.log_ns < 3_000_000_000]
    moved = [m._replace(log_ns=m.log_ns + 1_700_000_000_000_000_000) for m in kept]
    if by == 'others':
        write_bag(tmp_path / 'vehicle_0.mcap', like, moved)
    else:
        bag = BagWriter(tmp_path, 'vehicle')
        for message in moved:
            bag.write('odom', message.log_ns, message.data)
        bag.close()
    listener = listen('/glider/odom', '/clock')
    options = ('--rate', 'max', '--topics', 'odom', '--wait-for', 1)
    process = replay(tmp_path / 'vehicle_0.mcap', *options)
    listener.listen_until(lambda: len(listener.got['/glider/odom']) >= 30, process)
    assert process.wait(DEADLINE_S) == 0
    listener.listen_until(lambda: listener.got['/clock'], process)
    codec = TOPICS['/clock'].codec
    times = [codec.decode(raw)[0] for raw in listener.got['/clock']]
    assert set(times) <= {m.log_ns for m in moved}
    assert times == sorted(set(times))
    assert listener.got['/glider/odom'] == data(kept)


# ---------------------------------------------------------------------- what cannot be


@pytest.mark.parametrize(
    ('arguments', 'words'),
    [
        (['--topics', 'odom,depth'], ['--topics depth', '/glider/odom', '/clock']),
        (['--start', '121'], ['--start 121', '119.9']),
        (['--duration', '1e400'], ['--duration inf', '1e+08']),
        (['--start', '1.01', '--duration', '0.01', '--topics', 'odom'], ['nothing to replay']),
        (['--rate', 'fast'], ['--rate', 'max']),
        (['--rate', '0'], ['--rate', '0.001']),
    ],
)
def test_what_cannot_be_replayed_is_refused(short_run, arguments, words):
    done = CliRunner().invoke(app, ['replay', str(short_run), *arguments])
    assert isinstance(done.exception, ConfigurationError)
    for word in words:
        assert word in str(done.exception)


def test_topic_whose_type_is_not_installed_is_named(replay, tmp_path):
    with (tmp_path / 'theirs.mcap').open('wb') as stream:
        writer = Writer(stream)
        writer.start(profile='ros2')
        schema = writer.register_schema('geometry_msgz/msg/WrenchStamped', 'ros2msg', b'')
        writer.add_message(writer.register_channel('/glider/wrench', 'cdr', schema), 0, b'', 0)
        writer.finish()
    process = replay(tmp_path / 'theirs.mcap', '--rate', 'max')
    _, error = process.communicate(timeout=DEADLINE_S)
    assert process.returncode == 2
    assert '/glider/wrench' in error
    assert 'geometry_msgz/msg/WrenchStamped' in error
    assert 'Traceback' not in error


def test_plan_of_a_part(short_run):
    plan = plan_replay(Bag(short_run), ['odom'], 10.0, 5.0, 'other')
    assert (plan.start_ns, plan.end_ns) == (100 * TICK_NS, 150 * TICK_NS)
    assert sorted(plan.names.values()) == ['/clock', '/other/odom']


@pytest.mark.parametrize(
    ('other', 'published'),
    [
        ('/dvl/odom', ['/b/clock', '/b/odom', '/b/reference', '/dvl/odom']),
        ('/dvl/reference', None),  # another glider
    ],
)
def test_of_several_gliders_in_a_bag_none_is_taken_for_the_one(tmp_path, other, published):
    """As of `ros2 bag record -a`; an odom of something else is no glider."""
    kinds = dict.fromkeys(['/a/reference', '/a/odom', other], 'nav_msgs/msg/Odometry')
    with (tmp_path / 'all.mcap').open('wb') as stream:
        writer = Writer(stream)
        writer.start(profile='ros2')
        for name, kind in {'/a/clock': 'rosgraph_msgs/msg/Clock', **kinds}.items():
            schema = writer.register_schema(kind, 'ros2msg', b'')
            writer.add_message(writer.register_channel(name, 'cdr', schema), 0, b'', 0)
        writer.finish()
    bag = Bag(tmp_path / 'all.mcap')
    if published:
        RecordedLog(bag)
        plan = plan_replay(bag, [], 0.0, None, 'b')
        assert sorted(plan.names.values()) == published
        return
    for read in (RecordedLog, lambda bag: plan_replay(bag, [], 0.0, None, 'b')):
        with pytest.raises(ConfigurationError, match='/a, /dvl'):
            read(bag)


@pytest.mark.parametrize(
    ('text', 'expected'),
    [
        ('', ('RELIABLE', 'VOLATILE', 1024)),
        (
            '- {history: keep_last, depth: 7, reliability: best_effort, durability: volatile}',
            ('BEST_EFFORT', 'VOLATILE', 7),
        ),
        (
            '- {history: 1, depth: 1, reliability: 1, durability: 1}',
            ('RELIABLE', 'TRANSIENT_LOCAL', 1),
        ),
        (
            '- {history: 3, depth: 0, reliability: 2, durability: 2}',
            ('BEST_EFFORT', 'VOLATILE', 1024),
        ),
        (
            '[{history: 2, depth: 0, reliability: 2, durability: 2}, {history: keep_last, '
            'depth: 5, reliability: reliable, durability: transient_local}]',
            ('RELIABLE', 'TRANSIENT_LOCAL', 1024),
        ),
    ],
)
def test_quality_of_service_in_words_and_in_the_numbers_of_older_bags(text, expected):
    qos = qos_of(BagTopic('/a', 'std_msgs/msg/String', text))
    assert (qos.reliability.name, qos.durability.name, qos.depth) == expected


@pytest.mark.parametrize('text', ['[1]', '- history: [', 'word'])
def test_quality_of_service_that_is_garbled_is_named(text):
    with pytest.raises(ConfigurationError, match='/a: quality of service not readable'):
        qos_of(BagTopic('/a', 'std_msgs/msg/String', text))
