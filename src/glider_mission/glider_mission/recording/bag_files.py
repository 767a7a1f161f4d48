# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""Which files a bag consists of, and its metadata.yaml as rosbag2 (Jazzy) writes it."""

from collections import Counter
from collections.abc import Iterable, Mapping
from pathlib import Path

from mcap.records import Statistics
from mcap.summary import Summary

from glider_base.files import read_yaml
from glider_base.settings import ConfigurationError
from glider_mission.disk import write_whole

METADATA_FILE = 'metadata.yaml'
#: Under this name the same lies in every file, too.
ROSBAG2 = 'rosbag2'


class OtherFilesError(ConfigurationError):
    """What a sound metadata.yaml tells of is stored in another way, or missing."""


def bag_files(path: Path) -> list[Path]:
    """MCAP files of a bag, in the order in which they were written.

    Raises ConfigurationError if there is none, or one of those that metadata.yaml lists is
    missing.
    """
    if path.is_file():
        return [path]
    if not path.is_dir():
        raise ConfigurationError(f'{path}: no such run, bag folder or .mcap file')
    listed = _listed_files(path / METADATA_FILE)
    files = listed or sorted(path.glob('*.mcap'))
    if not files:
        raise ConfigurationError(
            f'{path}: no .mcap file in it (allowed: the folder of a bag, of a run over nodes, or '
            f'of a direct one with --bag)'
        )
    for file in files:
        if not file.is_file():
            raise OtherFilesError(f'{file}: missing; {path / METADATA_FILE} lists it')
    return files


def _listed_files(metadata: Path) -> list[Path]:
    """Files that metadata.yaml lists; none if there is no such file."""
    if not metadata.is_file():
        return []
    try:
        values = read_yaml(metadata)
        information = values['rosbag2_bagfile_information']
        names = [str(name) for name in information['relative_file_paths']]
        storage = information['storage_identifier']
        compression = information.get('compression_format') or ''
    except (KeyError, TypeError, AttributeError) as error:
        raise ConfigurationError(f'{metadata}: not metadata of rosbag2: {error!r}') from None
    if storage != 'mcap' or compression:
        what = f'files compressed with {compression}' if compression else f'storage {storage}'
        raise OtherFilesError(
            f'{metadata}: {what} (allowed: storage mcap, compressed in chunks or not at all; '
            f'ros2 bag convert makes one)'
        )
    return [metadata.parent / name for name in names]


def has_bag(run: Path) -> bool:
    """Whether a run folder holds a bag, or is one: a single MCAP file."""
    return run.is_file() or any(run.glob('*.mcap'))


def topic_counts(files: Iterable[Summary]) -> Counter[str]:
    """Messages of every topic of a bag."""
    counts: Counter[str] = Counter()
    for file in files:
        for number, channel in file.channels.items():
            counts[channel.topic] += file.statistics.channel_message_counts.get(number, 0)
    return counts


def metadata_text(files: Mapping[str, Summary]) -> str:
    """What metadata.yaml says of files by their names, without the first line.

    The same lies in the last of the files, too.
    """
    counts = topic_counts(files.values())
    topics = {}
    for file in files.values():
        for channel in file.channels.values():
            schema = file.schemas.get(channel.schema_id)
            kind = schema.name if schema else ''
            topic = _topic(channel.topic, kind, channel.metadata, counts[channel.topic])
            topics.setdefault(channel.topic, topic)
    said = [file.statistics for file in files.values()]
    filled = [one for one in said if one.message_count] or said[:1]
    start_ns = min(one.message_start_time for one in filled)
    duration_ns = max(0, max(one.message_end_time for one in filled) - start_ns)
    paths = ''.join(f'  - {name}\n' for name in files)
    counted = ''.join(['\n', *topics.values()]) if topics else ' []\n'
    return (
        'version: 9\n'
        'storage_identifier: mcap\n'
        f'duration:\n  nanoseconds: {duration_ns}\n'
        f'starting_time:\n  nanoseconds_since_epoch: {start_ns}\n'
        f'message_count: {sum(one.message_count for one in said)}\n'
        f'topics_with_message_count:{counted}'
        'compression_format: ""\n'
        'compression_mode: ""\n'
        f'relative_file_paths:\n{paths}'
        f'files:\n{"".join(map(_file, files, said))}'
        'custom_data: ~\n'
        'ros_distro: jazzy\n'
    )


def _file(name: str, said: Statistics) -> str:
    duration_ns = max(0, said.message_end_time - said.message_start_time)
    return (
        f'  - path: {name}\n'
        f'    starting_time:\n      nanoseconds_since_epoch: {said.message_start_time}\n'
        f'    duration:\n      nanoseconds: {duration_ns}\n'
        f'    message_count: {said.message_count}\n'
    )


def _topic(name: str, kind: str, metadata: Mapping[str, str], count: int) -> str:
    qos = metadata.get('offered_qos_profiles', '').rstrip('\n').replace('\n', '\n        ')
    return (
        '  - topic_metadata:\n'
        f'      name: {name}\n'
        f'      type: {kind}\n'
        '      serialization_format: cdr\n'
        f'      offered_qos_profiles:\n        {qos or "[]"}\n'
        f'      type_description_hash: {metadata.get("topic_type_hash", "")}\n'
        f'    message_count: {count}\n'
    )


def write_metadata(folder: Path, text: str) -> None:
    """Write metadata.yaml, in one go."""
    lines = ''.join(f'  {line}\n' for line in text.splitlines())
    write_whole(folder / METADATA_FILE, f'rosbag2_bagfile_information:\n{lines}')
