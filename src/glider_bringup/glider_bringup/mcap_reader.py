# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""Bags (rosbag2 folders of MCAP files, or single files), read chunk by chunk at memory speed.

The records are those of the `mcap` package. What its own readers do message by message, a
compiled scan does for a chunk at once: a flight of 30 h has ten million messages. The summary at
the end of a file is not relied upon, so that a file whose writer was killed reads as far as it
goes, and every checksum is tested.
"""

import struct
import zlib
from collections.abc import Iterator
from io import BytesIO
from pathlib import Path
from typing import NamedTuple

import lz4.frame
import numpy as np
import zstandard
from mcap.data_stream import ReadDataStream
from mcap.exceptions import McapError
from mcap.opcode import Opcode
from mcap.records import Attachment, Channel, Schema

from glider_bringup.mcap_writer import MAGIC
from glider_model.files import read_yaml
from glider_model.kernel import kernel
from glider_model.settings import ConfigurationError

_HEAD = struct.Struct('<BQ')
_CHUNK_HEAD = struct.Struct('<QQQII')
_LOG_TIME_AT = 6  # in a message record: channel (2), sequence (4), log time (8), publish time (8)
_MESSAGE_HEAD = 22
_UNREADABLE = (McapError, struct.error, UnicodeDecodeError)


class BagTopic(NamedTuple):
    """A recorded topic."""

    name: str
    type_name: str  #: such as nav_msgs/msg/Odometry
    encoding: str  #: of the messages, 'cdr' in ROS 2
    schema_encoding: str  #: 'ros2msg' or 'ros2idl'
    schema: bytes  #: definition of the type
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
        rows = np.empty((len(chosen), int(self.size[chosen[0]])), np.uint8)
        _gather(self.data, self.start[chosen], rows)
        return rows


class _Part(NamedTuple):
    """A chunk of a file, or a run of messages that are in no chunk."""

    file: int
    number: int  #: the chunks of a file count from 1; 0: no chunk
    start: int  #: of the content of the record
    length: int
    start_ns: int
    end_ns: int


@kernel
def _number(data, at, size):
    value = np.int64(0)
    for i in range(size):
        value |= np.int64(data[at + i]) << (8 * i)
    return value


@kernel
def _scan(data, channel, log_ns, start, size, other):
    """Find the messages of a chunk, and the places of its other records.

    Returns
    -------
    int
        Number of messages; -1 if a record is longer than what is left.
    int
        Number of other records.
    """
    messages = others = at = 0
    while at < len(data):
        if at + 9 > len(data):
            return -1, others
        opcode, length = data[at], _number(data, at + 1, 8)
        body = at + 9
        if length < 0 or length > len(data) - body or (opcode == 5 and length < 22):
            return -1, others
        if opcode == 5:
            channel[messages] = _number(data, body, 2)
            log_ns[messages] = _number(data, body + 6, 8)
            start[messages] = body + 22
            size[messages] = length - 22
            messages += 1
        else:
            other[others] = at
            others += 1
        at = body + length
    return messages, others


@kernel
def _gather(data, start, rows):
    for i in range(rows.shape[0]):
        rows[i] = data[start[i] : start[i] + rows.shape[1]]


def _bag_files(path: Path) -> list[Path]:
    """MCAP files of a bag, in the order in which they were written.

    Raises
    ------
    ConfigurationError
        If there is none, or one of those that metadata.yaml lists is missing.
    """
    if path.is_file():
        return [path]
    if not path.is_dir():
        raise ConfigurationError(f'{path}: no such run, bag folder or .mcap file')
    listed = _listed_files(path / 'metadata.yaml')
    files = listed or sorted(path.glob('*.mcap'))
    if not files:
        raise ConfigurationError(f'{path}: no .mcap file in it')
    for file in files:
        if not file.is_file():
            raise ConfigurationError(f'{file}: missing; {path / "metadata.yaml"} lists it')
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
    except (KeyError, TypeError) as error:
        raise ConfigurationError(f'{metadata}: not metadata of rosbag2: {error!r}') from None
    if storage != 'mcap' or compression:
        what = f'files compressed with {compression}' if compression else f'storage {storage}'
        raise ConfigurationError(
            f'{metadata}: {what} (allowed: storage mcap, compressed in chunks or not at all; '
            f'ros2 bag convert makes one)'
        )
    return [metadata.parent / name for name in names]


class Bag:
    """What is recorded in a bag.

    Parameters
    ----------
    path : Path
        Folder of a run or of a rosbag2 bag, also of a split one, or a single MCAP file.

    Attributes
    ----------
    topics : list of BagTopic
    attachments : dict of bytes
        By name.
    cut : str
        Empty, or a sentence that says where a file ends early.

    Raises
    ------
    ConfigurationError
        Naming the file, and the chunk if one is damaged.
    """

    def __init__(self, path: Path) -> None:
        self.files = _bag_files(Path(path))
        self.topics: list[BagTopic] = []
        self.attachments: dict[str, bytes] = {}
        self.cut = ''
        self._parts: list[_Part] = []
        self._schemas: dict[tuple[int, int], Schema] = {}
        self._index: dict[tuple[int, int], int] = {}
        for number, file in enumerate(self.files):
            try:
                self._open(number, file)
            except OSError as error:
                raise ConfigurationError(f'{file}: {error.strerror or error}') from None
            except _UNREADABLE as error:
                raise ConfigurationError(f'{file}: damaged: {error!r}') from None
        self._parts.sort(key=lambda part: part.start_ns)
        if self.cut:  # no summary: topics may be defined in chunks only
            for part in self._parts:
                self._read(part)

    @property
    def start_ns(self) -> int:
        """Log time (ns) of the first message; 0 if there is none."""
        return self._parts[0].start_ns if self._parts else 0

    @property
    def end_ns(self) -> int:
        """Log time (ns) of the last message; 0 if there is none."""
        return max((part.end_ns for part in self._parts), default=0)

    # ------------------------------------------------------------------ records of a file

    def _open(self, number: int, file: Path) -> None:
        """Note the chunks of a file, its topics and attachments."""
        size = file.stat().st_size
        chunks = 0
        with file.open('rb') as stream:
            if stream.read(len(MAGIC)) != MAGIC:
                raise ConfigurationError(f'{file}: not an MCAP file')
            while True:
                at = stream.tell()
                head = stream.read(_HEAD.size)
                opcode, length = _HEAD.unpack(head) if len(head) == _HEAD.size else (0, 0)
                body = at + _HEAD.size
                if not opcode or body + length > size:
                    self.cut = f'{file} ends early, after {at:,} bytes'
                    return
                if opcode == Opcode.FOOTER:
                    return
                if opcode == Opcode.CHUNK:
                    chunks += 1
                    start_ns, end_ns, unpacked = struct.unpack('<QQQ', stream.read(24))
                    if unpacked:
                        part = _Part(number, chunks, body, length, start_ns, end_ns)
                        self._parts.append(part)
                elif opcode == Opcode.MESSAGE:
                    self._note_loose(number, at, stream.read(_MESSAGE_HEAD), length)
                elif opcode in (Opcode.SCHEMA, Opcode.CHANNEL, Opcode.ATTACHMENT):
                    self._note(number, opcode, stream.read(length))
                stream.seek(body + length)

    def _note_loose(self, file: int, at: int, head: bytes, length: int) -> None:
        """Note a message that is in no chunk, together with the one before it."""
        (log_ns,) = struct.unpack_from('<Q', head, _LOG_TIME_AT)
        length += _HEAD.size
        last = self._parts[-1] if self._parts else None
        if last and last.file == file and not last.number and last.start + last.length == at:
            self._parts[-1] = last._replace(
                length=last.length + length,
                start_ns=min(last.start_ns, log_ns),
                end_ns=max(last.end_ns, log_ns),
            )
        else:
            self._parts.append(_Part(file, 0, at, length, log_ns, log_ns))

    def _note(self, file: int, opcode: int, data: bytes) -> None:
        """Take a schema, a channel or an attachment."""
        stream = ReadDataStream(BytesIO(data))
        if opcode == Opcode.SCHEMA:
            schema = Schema.read(stream)
            self._schemas[file, schema.id] = schema
        elif opcode == Opcode.ATTACHMENT:
            attachment = Attachment.read(stream)
            self.attachments.setdefault(attachment.name, attachment.data)
        elif opcode == Opcode.CHANNEL:
            self._note_channel(file, Channel.read(stream))

    def _note_channel(self, file: int, channel: Channel) -> None:
        if (file, channel.id) in self._index:
            return
        schema = self._schemas.get((file, channel.schema_id))
        topic = BagTopic(
            channel.topic,
            schema.name if schema else '',
            channel.message_encoding,
            schema.encoding if schema else '',
            schema.data if schema else b'',
            channel.metadata.get('offered_qos_profiles', ''),
        )
        names = [one.name for one in self.topics]
        if topic.name not in names:
            self.topics.append(topic)
            names.append(topic.name)
        elif self.topics[names.index(topic.name)].type_name != topic.type_name:
            raise ConfigurationError(
                f'{self.files[file]}: {topic.name} is recorded with two types, {topic.type_name} '
                f'and {self.topics[names.index(topic.name)].type_name}'
            )
        self._index[file, channel.id] = names.index(topic.name)

    # ------------------------------------------------------------------ messages

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
        read = [self._read(part) for part in sorted(parts)]
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

    def _read(self, part: _Part) -> Batch:
        """Messages of a part in the order of the file."""
        data = np.frombuffer(self._content(part), np.uint8)
        most = len(data) // _HEAD.size + 1
        channel, log_ns, start, size, other = (np.empty(most, np.int64) for _ in range(5))
        messages, others = _scan(data, channel, log_ns, start, size, other)
        if messages < 0:
            raise self._damaged(part, 'a record is longer than the chunk')
        for at in other[:others]:
            opcode, length = _HEAD.unpack_from(data, at)
            body = int(at) + _HEAD.size
            try:
                self._note(part.file, opcode, data[body : body + length].tobytes())
            except _UNREADABLE as error:
                raise self._damaged(part, repr(error)) from None
        topic = np.zeros(messages, np.int64)
        for number in np.unique(channel[:messages]):
            if (part.file, int(number)) not in self._index:
                raise self._damaged(part, f'messages of channel {number}, which is not defined')
            topic[channel[:messages] == number] = self._index[part.file, int(number)]
        return Batch(data, topic, log_ns[:messages], start[:messages], size[:messages])

    def _content(self, part: _Part) -> bytes:
        """Records of a part, decompressed and checked."""
        with self.files[part.file].open('rb') as stream:
            stream.seek(part.start)
            data = stream.read(part.length)
        if not part.number:
            return data
        try:
            _, _, size, checksum, name_size = _CHUNK_HEAD.unpack_from(data)
            at = _CHUNK_HEAD.size + name_size
            compression = data[_CHUNK_HEAD.size : at].decode()
            packed = memoryview(data)[at + 8 :]
            if compression == 'zstd':
                content = zstandard.ZstdDecompressor().decompress(packed, max_output_size=size)
            elif compression == 'lz4':
                content = lz4.frame.decompress(packed)
            elif not compression:
                content = bytes(packed)
            else:
                raise self._damaged(part, f'unknown compression {compression!r}')
        except (*_UNREADABLE, zstandard.ZstdError, RuntimeError, MemoryError) as error:
            raise self._damaged(part, f'it does not decompress ({error})') from None
        if len(content) != size:
            raise self._damaged(part, f'{len(content):,} bytes in place of {size:,}')
        if checksum and zlib.crc32(content) != checksum:
            raise self._damaged(part, 'its checksum (CRC) is wrong')
        return content

    def _damaged(self, part: _Part, reason: str) -> ConfigurationError:
        place = f'bytes {part.start - _HEAD.size:,} to {part.start + part.length:,}'
        return ConfigurationError(
            f'{self.files[part.file]}: chunk {part.number} is damaged: {reason} ({place}, '
            f't = {part.start_ns / 1e9:.1f} s to {part.end_ns / 1e9:.1f} s)'
        )
