# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""The live view speaks the protocol of Foxglove, shows what is recorded, and disturbs nothing."""

import json
import os
import socket
import struct
import subprocess
import sys
import time
from collections import defaultdict
from contextlib import ExitStack
from functools import partial
from types import SimpleNamespace

import pytest
from mcap.reader import make_reader
from mcap.records import Schema
from mcap_ros2.decoder import DecoderFactory
from rosbags.typesys import Stores, get_typestore
from websockets.exceptions import ConnectionClosed
from websockets.sync.client import connect

from glider_base.ros.wire.topics import TOPICS, recorded_topics
from glider_bringup.nodes import viewer_node

DEADLINE_S = 200.0
RECORDED = {topic.full_name('/glider'): topic for topic in recorded_topics(['measured_odom'])}
#: Also those that this run does not have: who looks does not know how it navigates.
OFFERED = {topic.full_name('/glider') for topic in TOPICS.values() if topic.recorded}
#: Binary message of a subscription: opcode 1, subscription, log time (ns).
DATA = struct.Struct('<BIQ')


@pytest.fixture
def port() -> int:
    """A port that nobody uses."""
    with socket.socket() as probe:
        probe.bind(('127.0.0.1', 0))
        return probe.getsockname()[1]


class Viewer:
    """A client that keeps what it is sent."""

    def __init__(self, stack: ExitStack, port: int, process: subprocess.Popen) -> None:
        end = time.monotonic() + DEADLINE_S
        while True:
            assert process.poll() is None, 'ended before there was a server'
            assert time.monotonic() < end, 'no server'
            try:
                self.socket = stack.enter_context(
                    connect(
                        f'ws://localhost:{port}', subprotocols=['foxglove.sdk.v1'], max_size=None
                    )
                )
                break
            except OSError:
                time.sleep(0.1)
        self.channels: dict[str, dict] = {}
        self.names: dict[int, str] = {}
        self.got: dict[str, list[tuple[int, bytes]]] = defaultdict(list)
        self.times: list[int] = []

    def receive_until(self, condition) -> None:
        end = time.monotonic() + DEADLINE_S
        while not condition():
            assert time.monotonic() < end
            self.take(self.socket.recv(timeout=DEADLINE_S))

    def take(self, message) -> None:
        if isinstance(message, str):
            said = json.loads(message)
            for channel in said.get('channels', []):
                self.channels[channel['topic']] = channel
        elif message[0] == 1:
            _, number, log_ns = DATA.unpack_from(message)
            self.got[self.names[number]].append((log_ns, message[DATA.size :]))
        elif message[0] == 2:
            self.times.append(int.from_bytes(message[1:9], 'little'))

    def subscribe(self, *names: str) -> None:
        wanted = []
        for name in names:
            number = len(self.names) + 1
            self.names[number] = name
            wanted.append({'id': number, 'channelId': self.channels[name]['id']})
        self.socket.send(json.dumps({'op': 'subscribe', 'subscriptions': wanted}))

    def receive_rest(self) -> None:
        try:
            while True:
                self.take(self.socket.recv(timeout=DEADLINE_S))
        except ConnectionClosed:
            pass


def plain(value):
    """Numbers and texts of a message, without constants, whichever library decoded it."""
    names = getattr(value, '__slots__', None) or getattr(value, '__dataclass_fields__', None)
    if names:
        return {n: plain(getattr(value, n)) for n in names if n[0] != '_' and not n.isupper()}
    if isinstance(value, str | bytes | bool | int | float):
        return value if value == value else 'NaN'
    return [plain(one) for one in value]


@pytest.fixture
def stack():
    """Closes connections when a test is over."""
    with ExitStack() as stack:
        yield stack


def test_client_sees_the_run_as_it_is_recorded(
    glider, start_glider, stack, tmp_path, port, monkeypatch
):
    monkeypatch.setenv('ROS_HOME', '/proc/none')  # nobody can write there, nor has to
    out = tmp_path / 'run'
    view = ('--view', '--view-port', port)
    process = start_glider('run', '--duration', 60, '--speed', 4, '--out', out, '--json', *view)
    viewer = Viewer(stack, port, process)
    assert viewer.socket.subprotocol == 'foxglove.sdk.v1'
    viewer.receive_until(lambda: set(viewer.channels) == OFFERED)
    viewer.subscribe(*(name for name in RECORDED if name != '/glider/path'))
    viewer.receive_until(lambda: len(viewer.got['/glider/odom']) > 20)
    viewer.subscribe('/glider/path')
    viewer.receive_rest()
    assert process.wait(DEADLINE_S) == 0
    assert f'ws://localhost:{port}' in (tmp_path / 'stderr').read_text()
    assert json.loads((tmp_path / 'stdout').read_text())['status'] == 'completed'

    (file,) = out.glob('*.mcap')
    recorded = defaultdict(set)
    with file.open('rb') as stream:
        for _, channel, message in make_reader(stream).iter_messages():
            recorded[channel.topic].add((message.log_time, message.data))
    store = get_typestore(Stores.ROS2_JAZZY)
    for name, topic in RECORDED.items():
        channel = viewer.channels[name]
        assert (channel['encoding'], channel['schemaEncoding']) == ('cdr', 'ros2msg')
        assert channel['schemaName'] == topic.type_name
        schema = Schema(1, channel['schema'].encode(), 'ros2msg', topic.type_name)
        decode = DecoderFactory().decoder_for('cdr', schema)
        seen = [one for one in viewer.got[name] if one in recorded[name]]
        if topic.per_tick:
            assert viewer.got[name] == seen, f'{name}: something that is not recorded'
            assert len(seen) > 40
            assert [log_ns for log_ns, _ in seen] == sorted({log_ns for log_ns, _ in seen})
        assert seen
        for _, raw in (seen[0], seen[-1]):
            by_schema = plain(decode(raw))
            assert by_schema == plain(store.deserialize_cdr(raw, topic.type_name))
    assert viewer.times == sorted(viewer.times)
    assert viewer.times[-1] > 20_000_000_000

    done = glider('verify', out, '--json')
    assert done.returncode == 0, done.stdout
    assert {one['result'] for one in json.loads(done.stdout)['blocks']} == {'identical'}


def check_refused(done, out, *words) -> None:
    assert done.returncode == 2, done.stderr
    assert 'Traceback' not in done.stderr
    for word in words:
        assert word in done.stderr
    assert not out.exists()


def test_bytes_that_are_no_message_are_not_shown(monkeypatch):
    came, shown = [b'\0\1\0\0', bytes(12), None], []
    monkeypatch.setattr(viewer_node, 'take', lambda _: came.pop(0))
    channel = SimpleNamespace(log=lambda raw, log_time: shown.append((raw, log_time)))
    node = SimpleNamespace(asked=[], incoming={'odom': None}, held={}, channels={'odom': channel})
    node.send = partial(viewer_node.ViewerNode.send, node)
    viewer_node.ViewerNode.pass_on(node)
    assert shown == [(bytes(12), 0)]


def test_port_that_is_taken_is_named_before_the_flight(glider, tmp_path):
    with socket.socket() as taken:
        taken.bind(('127.0.0.1', 0))
        taken.listen()
        port = taken.getsockname()[1]
        done = glider('run', '--view', '--view-port', port, '--out', tmp_path / 'run')
    check_refused(done, tmp_path / 'run', '--view', f'port {port}', 'in use')


def test_direct_engine_has_nothing_to_view(glider, tmp_path):
    done = glider('run', '--view', '--engine', 'direct', '--out', tmp_path / 'run')
    check_refused(done, tmp_path / 'run', '--view', 'direct')
    done = glider('run', '--view-port', 9000, '--engine', 'direct', '--out', tmp_path / 'run')
    check_refused(done, tmp_path / 'run', '--view-port 9000', 'allowed: with --view')


def test_missing_server_is_named_before_the_flight(tmp_path):
    (tmp_path / 'foxglove').mkdir()
    (tmp_path / 'foxglove' / '__init__.py').write_text("raise ImportError('no wheel')")
    path = os.pathsep.join([str(tmp_path), os.environ.get('PYTHONPATH', '')])
    command = [sys.executable, '-m', 'glider_bringup.cli', 'run', '--view']
    done = subprocess.run(
        [*command, '--out', str(tmp_path / 'run')],
        env={**os.environ, 'PYTHONPATH': path},
        capture_output=True,
        text=True,
        timeout=DEADLINE_S,
    )
    check_refused(done, tmp_path / 'run', '--view', 'foxglove-sdk', 'no wheel')
