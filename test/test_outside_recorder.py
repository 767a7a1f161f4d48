# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""A recorder that knows nothing of the lockstep, such as ``ros2 bag record``, gets a whole run."""

import json
import os
import time
from collections import Counter

import pytest
import rclpy
from mcap.writer import Writer
from rclpy.context import Context
from rclpy.executors import SingleThreadedExecutor
from std_srvs.srv import SetBool
from typer.testing import CliRunner

from command_line import Started
from glider_base.ros.places import domain_id
from glider_base.ros.wire.topics import (
    CONTROL,
    CURRENT,
    GUARD,
    GUIDANCE,
    NAVIGATION,
    TOPICS,
    recorded_topics,
)
from glider_base.wiring import readers
from glider_bringup.cli import app
from glider_bringup.engines.node_parameters import node_parameters, write_parameters
from glider_bringup.engines.processes import PLANT, RECORDER, node_commands
from glider_bringup.scoring.again import score_again
from glider_mission.recording.ros.rosbag2 import message_definition
from glider_mission.run_folder import make_run_folder
from glider_mission.scenario import load_scenario

TICKS = 400
DEADLINE_S = 200.0  #: at worst with every kernel to compile
RECORDED = recorded_topics(['measured_odom'])
#: Who listens to where the vehicle is, beside recorders: the sea alone knows the truth.
LISTENERS = {
    'ground_truth/odom': {CURRENT},
    'measured_odom': {NAVIGATION},
    'odom': {GUIDANCE, CONTROL, GUARD},
}


def test_nobody_on_board_is_wired_to_the_truth():
    assert [wired.node for wired in readers('ground_truth/odom')] == [CURRENT]
    for name, nodes in LISTENERS.items():
        assert set(TOPICS[name].readers) == nodes


class OutsideRecorder:
    """Takes the bytes of every topic as they come, and stamps them with the wall clock."""

    def __init__(self, context) -> None:
        self.node = rclpy.create_node('outside', namespace='/glider', context=context)
        self.executor = SingleThreadedExecutor(context=context)
        self.executor.add_node(self.node)
        self.taken: list[tuple[str, int, bytes]] = []
        self.subscriptions = [
            self.node.create_subscription(
                topic.message_type, topic.name, self._keep(topic.name), topic.qos, raw=True
            )
            for topic in RECORDED
        ]

    def _keep(self, name: str):
        return lambda raw: self.taken.append((name, time.time_ns(), raw))

    def wait_for(self, condition, processes, what: str) -> None:
        end = time.monotonic() + DEADLINE_S
        while not condition():
            assert time.monotonic() < end, what
            assert not [process for process in processes if process.poll()], what
            self.executor.spin_once(timeout_sec=0.05)

    def call(self, client, request, processes) -> None:
        self.wait_for(client.service_is_ready, processes, 'no service')
        answer = client.call_async(request)
        self.wait_for(answer.done, processes, 'no answer')
        assert answer.result().success

    def write(self, file) -> None:
        """Write a bag, with a library that is not ours."""
        with file.open('wb') as stream:
            writer = Writer(stream)
            writer.start(profile='ros2')
            channels = {}
            for topic in RECORDED:
                text = message_definition(topic.type_name).encode()
                schema = writer.register_schema(topic.type_name, 'ros2msg', text)
                channels[topic.name] = writer.register_channel(
                    topic.full_name('/glider'), 'cdr', schema
                )
            for name, log_time, raw in self.taken:
                writer.add_message(channels[name], log_time, raw, log_time)
            writer.finish()


@pytest.fixture
def fly(tmp_path, monkeypatch):
    """Start nodes of a run, by name; all of them are gone at the end."""
    scenario = load_scenario('survey', {'dives': 0, 'duration_s': TICKS / 10, 'settle_s': 0.0})
    folder = make_run_folder(scenario, tmp_path / 'flight')
    # who has no flow control needs time: at full speed beside other work, messages get lost
    parameters = node_parameters(scenario, speed=20.0)
    write_parameters(parameters, tmp_path / 'parameters.yaml')
    commands = node_commands(tmp_path / 'parameters.yaml')
    processes = []

    def start(*names) -> list[Started]:
        for name in names:
            _, _, module, *words = commands[name]
            (tmp_path / name).mkdir()
            processes.append(Started(words, {**os.environ}, tmp_path / name, module))
        return processes

    monkeypatch.setenv('ROS_AUTOMATIC_DISCOVERY_RANGE', 'LOCALHOST')
    monkeypatch.delenv('ROS_DOMAIN_ID', raising=False)
    with domain_id() as domain:
        monkeypatch.setitem(os.environ, 'ROS_DOMAIN_ID', str(domain))
        context = Context()
        rclpy.init(context=context, domain_id=domain)
        yield context, folder, start
        for process in processes:
            process.kill()
        rclpy.try_shutdown(context=context)


def test_paused_at_its_start_a_run_is_recorded_whole_and_scored(fly):
    """The plant does not wait for an outsider, but it can be held until that is ready."""
    context, folder, start = fly
    recorder = OutsideRecorder(context)
    pause = recorder.node.create_client(SetBool, 'pause')
    processes = start(PLANT)
    recorder.call(pause, SetBool.Request(data=True), processes)
    others = [name for name in node_commands(folder) if name not in (PLANT, RECORDER)]
    processes = start(*others)
    recorder.wait_for(
        lambda: all(one.get_publisher_count() for one in recorder.subscriptions),
        processes,
        'nodes',
    )
    begun = time.monotonic()  # the publishers have to match, too, and nobody here hears of it
    recorder.wait_for(lambda: time.monotonic() > begun + 1.0, processes, 'time')
    for name, nodes in LISTENERS.items():
        infos = recorder.node.get_subscriptions_info_by_topic(name)
        assert {info.node_name for info in infos} == {*nodes, 'outside'}, name
    recorder.call(pause, SetBool.Request(data=False), processes)

    def is_whole() -> bool:
        counts = Counter(name for name, _, _ in recorder.taken)
        return all(counts[topic.name] == TICKS for topic in RECORDED if topic.per_tick)

    recorder.wait_for(is_whole, processes, 'not every message of every tick')
    recorder.wait_for(lambda: processes[0].poll() == 0, processes, 'the plant does not end')
    recorder.write(folder / 'outside.mcap')
    card = score_again(folder)
    assert (card['status'], card['ticks'], card['messages_lost']) == ('completed', TICKS, 0)
    assert card['sim_time_s'] == pytest.approx(TICKS / 10)
    done = CliRunner().invoke(app, ['verify', str(folder), '--json'])
    said = json.loads(done.stdout)
    assert said['identical'], [(one['block'], one['first']) for one in said['blocks']]
    recorder.node.destroy_node()
