# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""A run opens in the readers that people use, and nothing is missing in it."""

import math
from collections import Counter, defaultdict

import pytest
import yaml
from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory
from rosbags.highlevel import AnyReader
from rosbags.typesys import Stores, get_typestore

from glider_base.ros.wire.topics import recorded_topics
from glider_base.signals import TICK_NS
from glider_base.wiring import BASE_LINK, JOINTS, MAP
from glider_mission.scenario import load_scenario

RECORDED = {topic.full_name('/glider'): topic for topic in recorded_topics(['measured_odom'])}
PER_TICK = [name for name, topic in RECORDED.items() if topic.per_tick]


def stamp_of(message) -> int:
    """Stamp of a message (ns)."""
    time = message.clock if hasattr(message, 'clock') else message.header.stamp
    return time.sec * 1_000_000_000 + time.nanosec


def check_every_tick(stamps: dict[str, list[int]], ticks: int) -> None:
    """Each per-tick topic has each tick exactly once, 0.1 s apart; the latched ones are there."""
    assert set(stamps) == set(RECORDED)
    expected = [tick * TICK_NS for tick in range(ticks)]
    for name in PER_TICK:
        assert stamps[name] == expected, name
    assert stamps['/glider/path'] == [0]
    assert stamps['/diagnostics'] == sorted(stamps['/diagnostics'])


@pytest.mark.parametrize('store', [None, Stores.ROS2_JAZZY], ids=['own schemas', 'jazzy'])
def test_rosbags_reads_every_message(over_nodes, store):
    typestore = get_typestore(store) if store else None
    stamps, counts = defaultdict(list), Counter()
    with AnyReader([over_nodes.folder], default_typestore=typestore) as reader:
        for connection, stamp_ns, raw in reader.messages():
            message = reader.deserialize(raw, connection.msgtype)
            assert connection.msgtype == RECORDED[connection.topic].type_name
            assert stamp_of(message) == stamp_ns
            stamps[connection.topic].append(stamp_ns)
        for connection in reader.connections:
            counts[connection.topic] += connection.msgcount
        assert reader.message_count == over_nodes.card['messages_recorded']
    check_every_tick(stamps, over_nodes.card['ticks'])
    assert counts == {name: len(times) for name, times in stamps.items()}


def test_mcap_ros2_support_reads_every_message(over_nodes):
    (file,) = over_nodes.folder.glob('*.mcap')
    stamps, last = defaultdict(list), {}
    with file.open('rb') as stream:
        reader = make_reader(stream, decoder_factories=[DecoderFactory()])
        for _, channel, record, message in reader.iter_decoded_messages():
            assert stamp_of(message) == record.log_time == record.publish_time
            stamps[channel.topic].append(record.log_time)
            last[channel.topic] = message
    check_every_tick(stamps, over_nodes.card['ticks'])
    odom, joints = last['/glider/odom'], last['/glider/joint_states']
    assert (odom.header.frame_id, odom.child_frame_id) == (MAP, BASE_LINK)
    assert tuple(joints.name) == tuple(last['/glider/command'].name) == JOINTS
    north, east, down = over_nodes.card['final_state']['position_ned_m']
    position = odom.pose.pose.position
    assert (position.x, position.y, position.z) == (east, north, -down)


def test_metadata_is_what_rosbag2_writes(over_nodes):
    ticks = over_nodes.card['ticks']
    text = (over_nodes.folder / 'metadata.yaml').read_text()
    information = yaml.safe_load(text)['rosbag2_bagfile_information']
    (file,) = over_nodes.folder.glob('*.mcap')
    assert information['version'] == 9
    assert information['storage_identifier'] == 'mcap'
    assert information['ros_distro'] == 'jazzy'
    assert information['starting_time'] == {'nanoseconds_since_epoch': 0}
    assert information['duration'] == {'nanoseconds': (ticks - 1) * TICK_NS}
    assert information['message_count'] == over_nodes.card['messages_recorded']
    assert (information['compression_format'], information['compression_mode']) == ('', '')
    assert information['custom_data'] is None
    assert information['relative_file_paths'] == [file.name]
    (part,) = information['files']
    assert (part['path'], part['message_count']) == (file.name, information['message_count'])
    assert part['starting_time'] == information['starting_time']
    assert part['duration'] == information['duration']
    topics = {
        item['topic_metadata']['name']: item for item in information['topics_with_message_count']
    }
    assert set(topics) == set(RECORDED)
    for name, item in topics.items():
        metadata = item['topic_metadata']
        assert metadata['type'] == RECORDED[name].type_name
        assert metadata['serialization_format'] == 'cdr'
        assert metadata['type_description_hash'].startswith('RIHS01_')
        (profile,) = metadata['offered_qos_profiles']
        assert profile['reliability'] == 'reliable'
        assert profile['durability'] == ('volatile' if name in PER_TICK else 'transient_local')
        assert item['message_count'] == ticks or name not in PER_TICK
    assert sum(item['message_count'] for item in topics.values()) == information['message_count']


def test_recording_alone_is_enough_to_fly_the_run_again(over_nodes, tmp_path):
    (file,) = over_nodes.folder.glob('*.mcap')
    with file.open('rb') as stream:
        reader = make_reader(stream, validate_crcs=True)
        assert reader.get_header().profile == 'ros2'
        for attachment in reader.iter_attachments():
            (tmp_path / attachment.name).write_bytes(attachment.data)
    assert {path.name for path in tmp_path.iterdir()} == {'scenario.yaml', 'vehicle.yaml'}
    for name in ('scenario.yaml', 'vehicle.yaml'):
        assert (tmp_path / name).read_bytes() == (over_nodes.folder / name).read_bytes()
    scenario = load_scenario(str(tmp_path / 'scenario.yaml'))
    assert scenario.name == over_nodes.card['scenario']
    assert math.isclose(scenario.duration_s, over_nodes.card['sim_time_s'])
