# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""A run's folder as rosbag2 (Jazzy) would have written it, with MCAP storage."""

import errno
import itertools
import json
import re
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Literal

import numpy as np
from ament_index_python.packages import get_package_share_directory
from mcap.records import Channel, Schema
from rclpy.qos import QoSProfile

from glider_base.ros.wire.topics import TOPICS, Topic, message_class
from glider_base.signals import TICK_NS
from glider_mission.disk import DiskError
from glider_mission.recording.bag_files import (
    METADATA_FILE,
    ROSBAG2,
    metadata_text,
    topic_counts,
    write_metadata,
)
from glider_mission.recording.mcap_writer import McapWriter

#: Ticks per chunk of the file. A chunk is what can be lost when the recorder is killed.
CHUNK_TICKS = 128
#: When a recording is synced to disk: never, when it is complete, or with every chunk too.
Sync = Literal['never', 'end', 'chunk']

_DELIMITER = 80 * '=' + '\n'
_INFINITE = '\n    sec: 9223372036\n    nsec: 854775807\n'  #: time, which ours all have


def _interface_file(type_name: str, suffix: str) -> Path:
    package, name = type_name.split('/')[0], type_name.split('/')[-1]
    return Path(get_package_share_directory(package)) / 'msg' / f'{name}{suffix}'


def message_definition(type_name: str) -> str:
    """Text of a message definition, followed by those of every type it needs.

    Concatenated as rosbag2 does for schemas of the encoding ``ros2msg``.
    """
    seen: set[str] = set()

    def text_of(name: str) -> str:
        text = _interface_file(name, '.msg').read_text(encoding='utf-8')
        kinds = message_class(name).get_fields_and_field_types().values()
        for need in sorted(set(re.findall(r'\w+/\w+', ' '.join(kinds)))):
            if need not in seen:
                seen.add(need)
                text += f'\n{_DELIMITER}MSG: {need}\n{text_of(need)}'
        return text

    return text_of(type_name)


def type_hash(type_name: str) -> str:
    """RIHS01 hash of a message type, or '' if the installation does not carry it."""
    path = _interface_file(type_name, '.json')
    if not path.is_file():
        return ''
    hashes = json.loads(path.read_text(encoding='utf-8'))['type_hashes']
    return next((h['hash_string'] for h in hashes if h['type_name'] == type_name), '')


def qos_yaml(qos: QoSProfile) -> str:
    """Offered quality of service, as a YAML list with one profile (version 9 of rosbag2)."""
    return (
        f'- history: {qos.history.name.lower()}\n'
        f'  depth: {qos.depth}\n'
        f'  reliability: {qos.reliability.name.lower()}\n'
        f'  durability: {qos.durability.name.lower()}\n'
        f'  deadline:{_INFINITE}'
        f'  lifespan:{_INFINITE}'
        '  liveliness: automatic\n'
        f'  liveliness_lease_duration:{_INFINITE}'
        '  avoid_ros_namespace_conventions: false'
    )


class BagWriter:
    """Writes ``<folder>/<name>_0.mcap`` and, when closed, ``<folder>/metadata.yaml``.

    The folder is made if it is missing. ``topics`` are in the order in which a tick is written;
    names given to `write` are theirs. ``names`` are absolute, by topic; without them those in the
    namespace `/glider`. ``attachments`` are files that are stored under their own names. ``sync``
    says when the file is synced to disk: what was flushed only is safe from a kill of this
    process, what was synced from a loss of power as well. Raises OSError if a recording is there
    already, or the file cannot be made. All methods that write raise a `DiskError` if the disk
    takes no more, or the file is no longer there.
    """

    def __init__(
        self,
        folder: Path,
        name: str,
        names: Mapping[str, str] | None = None,
        attachments: Iterable[Path] = (),
        topics: Iterable[Topic] = tuple(t for t in TOPICS.values() if t.recorded),
        sync: Sync = 'end',
    ) -> None:
        self._folder, self._sync = Path(folder), sync
        self._folder.mkdir(parents=True, exist_ok=True)
        self._file_name = f'{name}_0.mcap'
        file = self._folder / self._file_name
        for path in (file, self._folder / METADATA_FILE):
            if path.exists():
                reason = 'exists; a recording is never written over another'
                raise FileExistsError(errno.EEXIST, reason, str(path))
        attached = [(path, path.read_bytes()) for path in map(Path, attachments)]
        topics = list(topics)
        self._names = names or {topic.name: topic.full_name('/glider') for topic in topics}
        self._mcap = McapWriter(file, profile='ros2')
        schemas: dict[str, int] = {}
        self._channels: dict[str, int] = {}
        for number, topic in enumerate(topics, 1):
            kind = topic.type_name
            if kind not in schemas:
                schemas[kind] = len(schemas) + 1
                text = message_definition(kind).encode()
                self._mcap.define(Schema(schemas[kind], text, 'ros2msg', kind))
            metadata = {
                'offered_qos_profiles': qos_yaml(topic.qos),
                'topic_type_hash': type_hash(kind),
            }
            self._mcap.define(
                Channel(number, self._names[topic.name], 'cdr', metadata, schemas[kind])
            )
            self._channels[topic.name] = number
        for path, data in attached:
            self._mcap.add_attachment(path.name, 'application/yaml', data)
        try:
            self.flush()
        except DiskError:
            self.discard()
            raise

    def discard(self) -> None:
        """Take the file away, of a flight that never began: it would be in the way."""
        (self._folder / self._file_name).unlink(missing_ok=True)

    def write(self, topic: str, stamp_ns: int, payload: bytes) -> None:
        """Add a serialized message."""
        self._mcap.write(self._channels[topic], stamp_ns, payload)

    def write_ticks(
        self,
        stamps_ns: Sequence[int],
        payloads: Mapping[str, np.ndarray],
        events: Iterable[tuple[int, str, bytes]] = (),
    ) -> None:
        """Add many whole ticks, interleaved by stamp and cut into chunks as a recorder does.

        Stamps int64[n] ascend; payloads are messages by topic, as of `Codec.encode_many`. Each
        event, as `write` takes it but with its stamp first, follows its tick.
        """
        stamps_ns = np.asarray(stamps_ns, np.int64)
        rest = sorted(events, key=lambda event: event[0])
        chunk_of = stamps_ns // (CHUNK_TICKS * TICK_NS)
        told = np.searchsorted(stamps_ns, [event[0] for event in rest], 'right')
        edges = {0, *(np.flatnonzero(np.diff(chunk_of)) + 1), *told, len(stamps_ns)}
        channels = [self._channels[topic] for topic in payloads]
        for start, end in itertools.pairwise(sorted(edges)):
            blocks = [payload[start:end] for payload in payloads.values()]
            self._mcap.write_rows(channels, stamps_ns[start:end], blocks)
            while rest and rest[0][0] <= stamps_ns[end - 1]:
                stamp_ns, topic, payload = rest.pop(0)
                self.write(topic, stamp_ns, payload)
            if end < len(stamps_ns) and chunk_of[end] != chunk_of[end - 1]:
                self.flush()
        if len(stamps_ns):
            self.end_tick(int(stamps_ns[-1]))

    def end_tick(self, stamp_ns: int) -> bool:
        """Say that a tick is complete. True if everything up to it was flushed just now."""
        if (stamp_ns // TICK_NS + 1) % CHUNK_TICKS:
            return False
        self.flush()
        return True

    def flush(self) -> None:
        """Write everything so far into the file, and sync it if every chunk is."""
        self._mcap.flush()
        self.refuse_vanished()
        if self._sync == 'chunk':
            self._mcap.sync()

    def refuse_vanished(self) -> None:
        """Raise a `DiskError` if the recording was deleted or renamed, or the folder of it."""
        self._mcap.refuse_vanished()

    @property
    def counts(self) -> dict[str, int]:
        """Messages written, by topic."""
        counts = topic_counts([self._mcap.summary()])
        return {topic: counts[self._names[topic]] for topic in self._channels}

    def close(self) -> None:
        """Complete the file, and write metadata.yaml in one go."""
        self.flush()
        text = metadata_text({self._file_name: self._mcap.summary()})
        self._mcap.add_metadata(ROSBAG2, {'serialized_metadata': text})
        self._mcap.close(sync=self._sync != 'never')
        write_metadata(self._folder, text)
