# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""Bags (rosbag2 folders of MCAP files, or single files), read chunk by chunk at memory speed.

The records are those of the `mcap` package. What its own readers do message by message, a
compiled scan does for a chunk at once: a flight of 30 h has ten million messages.

There are two kinds of harm. A file that was **cut**, as by a writer that was killed, reads as
far as it goes, and `Bag.cut` says how far. A file that is **damaged** is refused, by an error that
names the place: every checksum is tested, that of the data section as the file is opened. Where
there is none (ros2 bag writes none) the records are compared with the summary, which has a
checksum of its own, so that no chunk, topic or attachment is missed in silence.
"""

import struct
import zlib
from collections.abc import Iterator
from pathlib import Path
from typing import IO, NamedTuple

import numpy as np
from mcap.opcode import Opcode
from mcap.records import Attachment, Channel, Schema
from mcap.summary import Summary
from numpy.lib.stride_tricks import sliding_window_view

from glider_base.settings import ConfigurationError
from glider_mission.recording import mcap_records as records
from glider_mission.recording.bag_files import bag_files

_DATA_END = records.HEAD.pack(Opcode.DATA_END, 4)
_LOG_TIME_AT = 6  # in a message record: channel (2), sequence (4), log time (8), publish time (8)


class BagTopic(NamedTuple):
    """A recorded topic."""

    name: str
    type_name: str  #: such as nav_msgs/msg/Odometry
    qos: str  #: offered profiles as YAML, '' if not recorded


class Batch(NamedTuple):
    """Messages in the order of their log times; all arrays have one entry per message."""

    data: np.ndarray  #: uint8, in which the payloads lie
    topic: np.ndarray  #: index into `Bag.topics`
    log_ns: np.ndarray  #: log time (ns)
    start: np.ndarray  #: where the payload begins in data
    size: np.ndarray  #: its length

    def payload(self, index: int) -> bytes:
        """Serialized message."""
        start = int(self.start[index])
        return self.data[start : start + int(self.size[index])].tobytes()

    def rows(self, chosen: np.ndarray) -> np.ndarray:
        """Payloads of equal size, uint8[n, size], of the messages with these indices."""
        windows = sliding_window_view(self.data, int(self.size[chosen[0]]))
        return windows[self.start[chosen]]


class _Part(NamedTuple):
    """A chunk of a file, or a run of messages that are in no chunk."""

    file: int
    number: int  #: the chunks of a file count from 1; 0: no chunk
    start: int  #: of the content of the record
    length: int
    start_ns: int
    end_ns: int


class _File:
    """Where in a file messages are, and what else is in it."""

    def __init__(self, path: Path, number: int) -> None:
        self.path, self._number = path, number
        self.parts: list[_Part] = []
        self.schemas: dict[int, Schema] = {}
        self.channels: dict[int, Channel] = {}
        self.attachments: dict[str, bytes] = {}
        self.cut = ''
        self._chunks: dict[int, tuple[int, int]] = {}  #: times of each by its place
        self._attached: set[int] = set()  #: places of the attachments
        try:
            with path.open('rb') as stream:
                self._open(stream)
        except OSError as error:
            raise ConfigurationError(f'{path}: {error.strerror or error}') from None

    def _open(self, stream: IO[bytes]) -> None:
        """Note the chunks, topics and attachments, and test the checksums."""
        try:
            summary, unsound = records.read_summary(stream), ''
        except ValueError as error:
            summary, unsound = Summary(), str(error)
        stream.seek(0)
        magic = stream.read(len(records.MAGIC))
        if not records.MAGIC.startswith(magic):
            raise ConfigurationError(f'{self.path}: not an MCAP file')
        end, checksum = len(magic), zlib.crc32(magic)
        for opcode, at, data in records.whole_records(stream):
            try:
                self._take(opcode, at, data)
            except records.UNREADABLE:
                raise self._harmed(f'the record at byte {at:,} cannot be read') from None
            checksum = zlib.crc32(data, zlib.crc32(records.HEAD.pack(opcode, len(data)), checksum))
            end = at + records.HEAD.size + len(data)
        stream.seek(end)
        rest = stream.read(len(_DATA_END) + 4)
        ends = rest.startswith(_DATA_END) and len(rest) == len(_DATA_END) + 4
        stored = int.from_bytes(rest[len(_DATA_END) :], 'little') if ends else 0
        if stored and stored != checksum:
            unsound = 'the checksum (CRC) of its data is wrong'
        elif stored:
            unsound = ''
        elif summary and not ends:
            unsound = f'no record begins at byte {end:,}'
        elif summary is None:
            times = (part.end_ns / 1e9 for part in self.parts)
            goes = f'it goes to t = {max(times):.1f} s' if self.parts else 'no message is whole'
            self.cut = f'{self.path} ends early, after {end:,} bytes: {goes}'
        is_enough = bool(summary and summary.channels)  # else they may be in chunks only
        if unsound or not is_enough:
            for part in self.parts:
                self.read(part)
        if summary and (unsound or not stored):
            self._compare(summary)
        if unsound:
            raise self._harmed(unsound)
        if is_enough:
            self.schemas = summary.schemas | self.schemas
            self.channels = summary.channels | self.channels

    def _take(self, opcode: int, at: int, data: bytes) -> None:
        """Note a record that is in no chunk."""
        if opcode == Opcode.CHUNK:
            start_ns, end_ns, unpacked = struct.unpack_from('<QQQ', data)
            self._chunks[at] = start_ns, end_ns
            if unpacked:
                place = len(self._chunks), at + records.HEAD.size, len(data)
                self.parts.append(_Part(self._number, *place, start_ns, end_ns))
        elif opcode == Opcode.MESSAGE:
            (log_ns,) = struct.unpack_from('<Q', data, _LOG_TIME_AT)
            part = _Part(self._number, 0, at, records.HEAD.size + len(data), log_ns, log_ns)
            last = self.parts[-1] if self.parts else part
            if not last.number and last.start + last.length == at:
                times = min(last.start_ns, log_ns), max(last.end_ns, log_ns)
                self.parts[-1] = _Part(*last[:3], last.length + part.length, *times)
            else:
                self.parts.append(part)
        elif opcode in records.DEFINITIONS:
            self._define(records.parse(records.DEFINITIONS[opcode], data))
        elif opcode == Opcode.ATTACHMENT:
            one, stored = records.parse(Attachment, data), int.from_bytes(data[-4:], 'little')
            if stored and zlib.crc32(memoryview(data)[:-4]) != stored:
                raise self._harmed(f'the checksum (CRC) of the attachment {one.name!r} is wrong')
            self.attachments.setdefault(one.name, one.data)
            self._attached.add(at)

    def _define(self, record: Schema | Channel) -> None:
        """Note a type or a topic."""
        if isinstance(record, Channel):
            self.channels.setdefault(record.id, record)
        else:
            self.schemas[record.id] = record

    def _compare(self, summary: Summary) -> None:
        """Raise an error that names what lacks, if a summary tells of more or of others."""
        indexes = sorted(summary.chunk_indexes, key=lambda index: index.chunk_start_offset)
        for order, index in enumerate(indexes, 1):
            times = index.message_start_time, index.message_end_time
            if self._chunks.get(index.chunk_start_offset) != times:
                where = f'chunk {order} ({records.span(*times)})'
                raise self._harmed(f'{where} is not where it should be')
        if {index.offset for index in summary.attachment_indexes} - self._attached:
            raise self._harmed('an attachment is not where it should be')
        here = len(self._chunks)
        said = summary.statistics.chunk_count if summary.statistics else here
        if said != here:
            raise self._harmed(f'{here} chunks, {said} by its summary')
        pairs = (self.schemas, summary.schemas), (self.channels, summary.channels)
        for mine, theirs in pairs:
            if theirs and any(theirs.get(number) != one for number, one in mine.items()):
                raise self._harmed('a topic or type is not that of its summary')

    def read(self, part: _Part) -> tuple[np.ndarray, records.Places]:
        """Content of a part, and its messages in the order of the file."""
        with self.path.open('rb') as stream:
            stream.seek(part.start)
            content = stream.read(part.length)
        try:
            content = records.unpack(content) if part.number else content
            found = records.find_defined(content, self._define, self.channels)
            if len(found.channel):
                times = int(found.log_ns.min()), int(found.log_ns.max())
                if times != (part.start_ns, part.end_ns):
                    raise ValueError(f'its messages are of {records.span(*times)}')
        except (ValueError, *records.UNREADABLE) as error:
            place = f'bytes {part.start - records.HEAD.size:,} to {part.start + part.length:,}'
            what = f'{error} ({place}, {records.span(part.start_ns, part.end_ns)})'
            raise self._harmed(what, f'chunk {part.number} is ') from None
        return np.frombuffer(content, np.uint8), found

    def _harmed(self, what: str, which: str = '') -> ConfigurationError:
        return ConfigurationError(f'{self.path}: {which}damaged: {what}')


class Bag:
    """What is recorded in a bag: folder of a run or of rosbag2, also split, or one MCAP file.

    A ConfigurationError names the file, and the chunk if one is damaged.
    """

    def __init__(self, path: Path) -> None:
        self.files = bag_files(Path(path))
        self._read = [_File(file, number) for number, file in enumerate(self.files)]
        self.attachments: dict[str, bytes] = {}  #: by name
        self.cut = ''  #: or a sentence that says where a file ends early, and how far it goes
        topics: dict[str, BagTopic] = {}
        for file in self._read:
            self.attachments = file.attachments | self.attachments
            self.cut = file.cut or self.cut
            for channel in file.channels.values():
                schema = file.schemas.get(channel.schema_id)
                qos = channel.metadata.get('offered_qos_profiles', '')
                topic = BagTopic(channel.topic, schema.name if schema else '', qos)
                known = topics.setdefault(topic.name, topic)
                if known.type_name != topic.type_name:
                    raise ConfigurationError(
                        f'{file.path}: {topic.name} is recorded with two types, '
                        f'{topic.type_name} and {known.type_name}'
                    )
        self.topics = [*topics.values()]
        self._index = {name: index for index, name in enumerate(topics)}
        parts = (part for file in self._read for part in file.parts)
        self._parts = sorted(parts, key=lambda part: part.start_ns)

    @property
    def start_ns(self) -> int:
        """Log time (ns) of the first message; 0 if there is none."""
        return self._parts[0].start_ns if self._parts else 0

    @property
    def end_ns(self) -> int:
        """Log time (ns) of the last message; 0 if there is none."""
        return max((part.end_ns for part in self._parts), default=0)

    def batches(self) -> Iterator[Batch]:
        """All messages in the order of their log times; equal ones in the order of the file.

        Chunks that overlap in time are sorted together.
        """
        group: list[_Part] = []
        for part in self._parts:
            if group and part.start_ns >= max(one.end_ns for one in group):
                yield self._join(group)
                group = []
            group.append(part)
        if group:
            yield self._join(group)

    def _join(self, parts: list[_Part]) -> Batch:
        read = [self._batch(part) for part in sorted(parts)]
        shifts = np.cumsum([0, *(len(batch.data) for batch in read)])
        data, topic, log_ns, start, size = (
            np.concatenate(arrays) if len(read) > 1 else arrays[0]
            for arrays in zip(*read, strict=True)
        )
        if len(read) > 1:
            start = start + np.repeat(shifts[:-1], [len(batch.topic) for batch in read])
        if np.all(log_ns[1:] >= log_ns[:-1]):
            return Batch(data, topic, log_ns, start, size)
        order = np.argsort(log_ns, kind='stable')
        return Batch(data, topic[order], log_ns[order], start[order], size[order])

    def _batch(self, part: _Part) -> Batch:
        """Messages of a part in the order of the file."""
        file = self._read[part.file]
        data, found = file.read(part)
        topic = np.zeros(len(found.channel), np.int64)
        for number in np.unique(found.channel):
            topic[found.channel == number] = self._index[file.channels[int(number)].topic]
        return Batch(data, topic, found.log_ns, found.start, found.size)
