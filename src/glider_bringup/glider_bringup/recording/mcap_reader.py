# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""Bags (rosbag2 folders of MCAP files, or single files), read chunk by chunk at memory speed.

The records are those of the `mcap` package. What its own readers do message by message, a
compiled scan does for a chunk at once: a flight of 30 h has ten million messages.

Two kinds of harm are told apart. A file that was **cut**, as by a writer that was killed, reads as
far as it goes, and `Bag.cut` says how far. A file that is **damaged** is refused, by an error that
names the place: every checksum is tested, that of the data section as the file is opened. Where
there is none (bags of before, and of others) the records are compared with the summary, which has
a checksum of its own, so that no chunk, topic or attachment is missed in silence.
"""

import struct
import zlib
from collections.abc import Iterator
from io import BytesIO
from pathlib import Path
from typing import IO, NamedTuple

import lz4.frame
import numpy as np
import zstandard
from mcap.data_stream import ReadDataStream
from mcap.exceptions import McapError
from mcap.opcode import Opcode
from mcap.records import Attachment, Channel, Schema

from glider_bringup.recording.bag_files import bag_files
from glider_bringup.recording.mcap_scan import find, gather
from glider_bringup.recording.mcap_summary import (
    CHECKED,
    END_SIZE,
    HEAD,
    Summary,
    checksum_to,
    parse_summary,
    read_footer,
)
from glider_bringup.recording.mcap_writer import MAGIC
from glider_model.base.settings import ConfigurationError
from glider_model.base.signals import TICK_NS

_CHUNK_HEAD = struct.Struct('<QQQII')
_LOG_TIME_AT = 6  # in a message record: channel (2), sequence (4), log time (8), publish time (8)
_MESSAGE_HEAD = 22
#: What is raised about a record that is none.
UNREADABLE = (McapError, struct.error, UnicodeDecodeError)
_NOT_TOLD = -1  #: by a zstd frame: the size of its content


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
        gather(self.data, self.start[chosen], rows)
        return rows


class _Found(NamedTuple):
    """Places of records in a file."""

    chunks: list[int]
    attachments: set[int]


class _Part(NamedTuple):
    """A chunk of a file, or a run of messages that are in no chunk."""

    file: int
    number: int  #: the chunks of a file count from 1; 0: no chunk
    start: int  #: of the content of the record
    length: int
    start_ns: int
    end_ns: int


def span(start_ns: int, end_ns: int) -> str:
    """Times from which to which messages are, in words."""
    ticks = max(0, end_ns - start_ns) // TICK_NS + 1
    return f't = {start_ns / 1e9:.1f} s to {end_ns / 1e9:.1f} s, {ticks:,} ticks'


def unpack(data: bytes) -> bytes:
    """Records of a chunk, decompressed and checked, from the content of its own record.

    Raises
    ------
    ValueError
        Saying what is wrong with it.
    """
    try:
        _, _, size, checksum, name_size = _CHUNK_HEAD.unpack_from(data)
        at = _CHUNK_HEAD.size + name_size
        compression = data[_CHUNK_HEAD.size : at].decode()
        packed = memoryview(data)[at + 8 :]
        if compression == 'zstd':
            told = zstandard.frame_content_size(packed)
            if told not in (size, _NOT_TOLD):
                raise ValueError(f'{told:,} bytes in place of {size:,}')
            content = zstandard.ZstdDecompressor().decompress(packed, max_output_size=size)
        elif compression == 'lz4':
            content = lz4.frame.decompress(packed)
        elif not compression:
            content = bytes(packed)
        else:
            raise ValueError(f'unknown compression {compression!r}')
    except (*UNREADABLE, zstandard.ZstdError, RuntimeError, MemoryError) as error:
        raise ValueError(f'it does not decompress ({error})') from None
    if len(content) != size:
        raise ValueError(f'{len(content):,} bytes in place of {size:,}')
    if checksum and zlib.crc32(content) != checksum:
        raise ValueError('its checksum (CRC) is wrong')
    return content


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
        Empty, or a sentence that says where a file ends early, and how far it goes.

    Raises
    ------
    ConfigurationError
        Naming the file, and the chunk if one is damaged.
    """

    def __init__(self, path: Path) -> None:
        self.files = bag_files(Path(path))
        self.topics: list[BagTopic] = []
        self.attachments: dict[str, bytes] = {}
        self.cut = ''
        self._parts: list[_Part] = []
        self._schemas: dict[tuple[int, int], Schema] = {}
        self._channels: dict[tuple[int, int], Channel] = {}
        self._index: dict[tuple[int, int], int] = {}
        for number, file in enumerate(self.files):
            try:
                with file.open('rb') as stream:
                    self._open(number, stream)
            except OSError as error:
                raise ConfigurationError(f'{file}: {error.strerror or error}') from None
        self._parts.sort(key=lambda part: part.start_ns)

    @property
    def start_ns(self) -> int:
        """Log time (ns) of the first message; 0 if there is none."""
        return self._parts[0].start_ns if self._parts else 0

    @property
    def end_ns(self) -> int:
        """Log time (ns) of the last message; 0 if there is none."""
        return max((part.end_ns for part in self._parts), default=0)

    # ------------------------------------------------------------------ records of a file

    def _open(self, number: int, stream: IO[bytes]) -> None:
        """Note the chunks of a file, its topics and attachments, and test its checksums."""
        file = self.files[number]
        size = stream.seek(0, 2)
        footer = read_footer(stream, size)
        stream.seek(0)
        magic = stream.read(len(MAGIC))
        if not MAGIC.startswith(magic):
            raise ConfigurationError(f'{file}: not an MCAP file')
        found, at = _Found([], set()), stream.tell()
        while True:
            head = stream.read(HEAD.size)
            opcode, length = HEAD.unpack(head) if len(head) == HEAD.size else (0, 0)
            body = at + HEAD.size
            fits = opcode and body + length <= size
            if not fits or opcode in (Opcode.DATA_END, Opcode.FOOTER):
                break
            try:
                self._take(number, opcode, at, length, stream, found)
            except UNREADABLE:
                raise self._harmed(number, f'the record at byte {at:,} cannot be read') from None
            at = stream.seek(body + length)
        ends = fits and opcode == Opcode.DATA_END and length == 4
        checksum = int.from_bytes(stream.read(4), 'little') if ends else 0
        if checksum and checksum != checksum_to(stream, at):
            raise self._harmed(number, 'the checksum (CRC) of its data is wrong', footer, found)
        if footer and not ends:
            raise self._harmed(number, f'no record begins at byte {at:,}', footer, found)
        if not checksum and not footer:
            self._note_cut(number, at, opcode, stream)
        summary = self._summary(number, footer, bool(checksum))
        if summary is None:  # topics may be defined in chunks only
            for part in [one for one in self._parts if one.file == number]:
                self._read(part)
            return
        if not checksum:
            self._compare(number, summary, found)
        for schema in summary.schemas:
            self._schemas.setdefault((number, schema.id), schema)
        for channel in summary.channels:
            self._note_channel(number, channel)

    def _take(
        self, number: int, opcode: int, at: int, length: int, stream: IO[bytes], found: _Found
    ) -> None:
        """Note one record, whose content comes next in the stream."""
        if opcode == Opcode.CHUNK:
            found.chunks.append(at)
            start_ns, end_ns, unpacked = struct.unpack('<QQQ', stream.read(24))
            if unpacked:
                order, body = len(found.chunks), at + HEAD.size
                self._parts.append(
                    _Part(
                        file=number,
                        number=order,
                        start=body,
                        length=length,
                        start_ns=start_ns,
                        end_ns=end_ns,
                    )
                )
        elif opcode == Opcode.MESSAGE:
            self._note_loose(number, at, stream.read(_MESSAGE_HEAD), length)
        elif opcode in (Opcode.SCHEMA, Opcode.CHANNEL, Opcode.ATTACHMENT):
            self._note(number, opcode, stream.read(length))
            if opcode == Opcode.ATTACHMENT:
                found.attachments.add(at)

    def _note_cut(self, number: int, at: int, opcode: int, stream: IO[bytes]) -> None:
        """Say where a file ends, and what is the last that is whole."""
        parts = [part for part in self._parts if part.file == number]
        end_ns = max((part.end_ns for part in parts), default=None)
        goes = 'no message is whole' if end_ns is None else f'it goes to t = {end_ns / 1e9:.1f} s'
        stream.seek(at + HEAD.size)
        times = stream.read(16) if opcode == Opcode.CHUNK else b''
        if len(times) == 16:
            start_ns, end_ns = struct.unpack('<QQ', times)
            goes += f', and of the chunk up to t = {end_ns / 1e9:.1f} s only a part is there'
        self.cut = f'{self.files[number]} ends early, after {at:,} bytes: {goes}'

    def _summary(self, number: int, footer: tuple | None, proven: bool) -> Summary | None:
        """Summary of a file; None if it has none.

        One that cannot be read does not matter where the data is ``proven`` to be whole.
        """
        if footer is None or not footer[0]:
            return None
        start, _, checksum = footer
        with self.files[number].open('rb') as stream:
            stream.seek(min(start, stream.seek(0, 2)))
            data = stream.read()[: CHECKED - END_SIZE]
        if checksum and zlib.crc32(data) != checksum:
            if proven:
                return None
            raise self._harmed(number, 'the checksum (CRC) of its summary is wrong')
        try:
            return parse_summary(data[:-CHECKED])
        except UNREADABLE:
            raise self._harmed(number, 'its summary cannot be read') from None

    def _compare(self, number: int, summary: Summary, found: _Found) -> None:
        """Refuse a file in which a summary and what was found are not the same.

        Raises
        ------
        ConfigurationError
            Naming what lacks.
        """
        parts = {part.start - HEAD.size: part for part in self._parts if part.file == number}
        places = set(found.chunks)
        for order, (place, index) in enumerate(sorted(summary.chunks.items()), 1):
            times = index.message_start_time, index.message_end_time
            part = parts.get(place)
            if place not in places or (part and (part.start_ns, part.end_ns) != times):
                what = f'chunk {order} ({span(*times)}) is not where it should be'
                raise self._harmed(number, what)
        if summary.attachments - found.attachments:
            raise self._harmed(number, 'an attachment is not where it should be')
        said = summary.statistics.chunk_count if summary.statistics else len(places)
        if said != len(places):
            raise self._harmed(number, f'{len(places)} chunks, {said} by its summary')
        for mine, theirs in (
            (self._schemas, summary.schemas),
            (self._channels, summary.channels),
        ):
            for (file, _), one in mine.items():
                if file == number and theirs and one not in theirs:
                    raise self._harmed(number, 'a topic or type is not that of its summary')

    def _harmed(
        self, number: int, what: str, footer: tuple | None = None, found: _Found | None = None
    ) -> ConfigurationError:
        """Error about a file; one about a chunk of it, if that can be found."""
        if found is not None:
            for part in [one for one in self._parts if one.file == number]:
                try:
                    self._read(part)
                except ConfigurationError as error:
                    return error
            try:
                summary = self._summary(number, footer, True)
                if summary is not None:
                    self._compare(number, summary, found)
            except ConfigurationError as error:
                return error
        return ConfigurationError(f'{self.files[number]}: damaged: {what}')

    def _note_loose(self, file: int, at: int, head: bytes, length: int) -> None:
        """Note a message that is in no chunk, together with the one before it."""
        (log_ns,) = struct.unpack_from('<Q', head, _LOG_TIME_AT)
        length += HEAD.size
        last = self._parts[-1] if self._parts else None
        if last and last.file == file and not last.number and last.start + last.length == at:
            self._parts[-1] = last._replace(
                length=last.length + length,
                start_ns=min(last.start_ns, log_ns),
                end_ns=max(last.end_ns, log_ns),
            )
        else:
            self._parts.append(
                _Part(file=file, number=0, start=at, length=length, start_ns=log_ns, end_ns=log_ns)
            )

    def _note(self, file: int, opcode: int, data: bytes) -> None:
        """Take a schema, a channel or an attachment."""
        stream = ReadDataStream(BytesIO(data))
        if opcode == Opcode.SCHEMA:
            schema = Schema.read(stream)
            self._schemas[file, schema.id] = schema
        elif opcode == Opcode.ATTACHMENT:
            attachment = Attachment.read(stream)
            checksum = int.from_bytes(data[-4:], 'little')
            if checksum and zlib.crc32(memoryview(data)[:-4]) != checksum:
                what = f'the checksum (CRC) of the attachment {attachment.name!r} is wrong'
                raise self._harmed(file, what)
            self.attachments.setdefault(attachment.name, attachment.data)
        elif opcode == Opcode.CHANNEL:
            self._note_channel(file, Channel.read(stream))

    def _note_channel(self, file: int, channel: Channel) -> None:
        if (file, channel.id) in self._index:
            return
        self._channels[file, channel.id] = channel
        schema = self._schemas.get((file, channel.schema_id))
        topic = BagTopic(
            name=channel.topic,
            type_name=schema.name if schema else '',
            encoding=channel.message_encoding,
            schema_encoding=schema.encoding if schema else '',
            schema=schema.data if schema else b'',
            qos=channel.metadata.get('offered_qos_profiles', ''),
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
        try:
            found = find(data)
        except ValueError as error:
            raise self._damaged(part, str(error)) from None
        for at in found.others:
            opcode, length = HEAD.unpack_from(data, at)
            body = int(at) + HEAD.size
            try:
                self._note(part.file, opcode, data[body : body + length].tobytes())
            except UNREADABLE as error:
                raise self._damaged(part, repr(error)) from None
        topic = np.zeros(len(found.channel), np.int64)
        for number in np.unique(found.channel):
            if (part.file, int(number)) not in self._index:
                raise self._damaged(part, f'messages of channel {number}, which is not defined')
            topic[found.channel == number] = self._index[part.file, int(number)]
        times = (int(found.log_ns.min()), int(found.log_ns.max())) if len(topic) else ()
        if times and times != (part.start_ns, part.end_ns):
            raise self._damaged(part, f'its messages are of {span(*times)}')
        return Batch(data, topic, found.log_ns, found.start, found.size)

    def _content(self, part: _Part) -> bytes:
        """Records of a part, decompressed and checked."""
        with self.files[part.file].open('rb') as stream:
            stream.seek(part.start)
            data = stream.read(part.length)
        if not part.number:
            return data
        try:
            return unpack(data)
        except ValueError as error:
            raise self._damaged(part, str(error)) from None

    def _damaged(self, part: _Part, reason: str) -> ConfigurationError:
        place = f'bytes {part.start - HEAD.size:,} to {part.start + part.length:,}'
        return ConfigurationError(
            f'{self.files[part.file]}: chunk {part.number} is damaged: {reason} ({place}, '
            f'{span(part.start_ns, part.end_ns)})'
        )
