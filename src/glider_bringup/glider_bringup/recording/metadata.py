# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""metadata.yaml of a bag, as rosbag2 (Jazzy) writes it."""

from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

from glider_bringup.mission.disk import write_whole

METADATA_FILE = 'metadata.yaml'
#: Under this name the same lies in every file, too.
ROSBAG2 = 'rosbag2'


class TopicFacts(NamedTuple):
    """A topic of a bag."""

    name: str
    type_name: str  #: such as nav_msgs/msg/Odometry
    qos: str  #: offered profiles as YAML; empty if nobody knows
    type_hash: str
    count: int  #: of messages


class FileFacts(NamedTuple):
    """A file of a bag."""

    name: str
    start_ns: int  #: log time of the first message; 0 without one
    end_ns: int  #: and of the last
    count: int  #: of messages


def metadata_text(files: Sequence[FileFacts], topics: Sequence[TopicFacts]) -> str:
    """What metadata.yaml says, and what lies in the last file too, without the first line."""
    filled = [file for file in files if file.count] or files[:1]
    start_ns = min(file.start_ns for file in filled)
    duration_ns = max(0, max(file.end_ns for file in filled) - start_ns)
    total = sum(file.count for file in files)
    paths = ''.join(f'  - {file.name}\n' for file in files)
    return (
        'version: 9\n'
        'storage_identifier: mcap\n'
        f'duration:\n  nanoseconds: {duration_ns}\n'
        f'starting_time:\n  nanoseconds_since_epoch: {start_ns}\n'
        f'message_count: {total}\n'
        f'topics_with_message_count:\n{"".join(map(_topic, topics))}'
        'compression_format: ""\n'
        'compression_mode: ""\n'
        f'relative_file_paths:\n{paths}'
        f'files:\n{"".join(map(_file, files))}'
        'custom_data: ~\n'
        'ros_distro: jazzy\n'
    )


def _file(file: FileFacts) -> str:
    return (
        f'  - path: {file.name}\n'
        f'    starting_time:\n      nanoseconds_since_epoch: {file.start_ns}\n'
        f'    duration:\n      nanoseconds: {max(0, file.end_ns - file.start_ns)}\n'
        f'    message_count: {file.count}\n'
    )


def _topic(topic: TopicFacts) -> str:
    profiles = topic.qos.rstrip('\n').replace('\n', '\n        ') or '[]'
    return (
        '  - topic_metadata:\n'
        f'      name: {topic.name}\n'
        f'      type: {topic.type_name}\n'
        '      serialization_format: cdr\n'
        f'      offered_qos_profiles:\n        {profiles}\n'
        f'      type_description_hash: {topic.type_hash}\n'
        f'    message_count: {topic.count}\n'
    )


def write_metadata(folder: Path, text: str) -> None:
    """Write metadata.yaml, in one go."""
    lines = ''.join(f'  {line}\n' for line in text.splitlines())
    write_whole(folder / METADATA_FILE, f'rosbag2_bagfile_information:\n{lines}')
