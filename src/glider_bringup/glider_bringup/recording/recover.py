# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""A bag whose end is missing, made whole: what is there gets its index and its metadata.yaml.

A file is written anew beside the old one, and takes its place once it is on disk: whoever pulls
the plug meanwhile finds the one or the other. Its chunks are those of the old file. A recording of
ours is then, byte by byte, what its recorder would have left had it been stopped there.
"""

import os
import struct
from collections import Counter
from collections.abc import Callable, Iterable, Iterator
from io import BytesIO
from itertools import chain
from pathlib import Path
from typing import IO, NamedTuple

import numpy as np
from mcap.data_stream import ReadDataStream
from mcap.opcode import Opcode
from mcap.reader import make_reader
from mcap.records import Attachment, Channel, Header, Metadata, Schema

from glider_bringup.mission.disk import not_written
from glider_bringup.recording.bag_files import bag_files
from glider_bringup.recording.mcap_reader import UNREADABLE, Bag, span, unpack
from glider_bringup.recording.mcap_scan import find
from glider_bringup.recording.mcap_summary import HEAD, read_footer
from glider_bringup.recording.mcap_writer import MAGIC, McapWriter
from glider_bringup.recording.metadata import (
    METADATA_FILE,
    ROSBAG2,
    FileFacts,
    TopicFacts,
    metadata_text,
    write_metadata,
)
from glider_model.base.settings import ConfigurationError

#: Messages that are in no chunk are put into chunks of about this size (B).
_LOOSE_BYTES = 1 << 20

#: What a chunk begins with: the log times of its first and its last message.
_CHUNK_TIMES = struct.Struct('<QQ')
#: Called with the bytes read of a file, and how many it has.
Progress = Callable[[int, int], None]


class Recovered(NamedTuple):
    """What is in a bag that is whole now."""

    rebuilt: tuple[str, ...]  #: names of the files that were made anew; none if all were whole
    dropped_bytes: int  #: of what was no whole chunk
    dropped: tuple[str, ...]  #: the same in words
    counts: dict[str, int]  #: messages by topic
    start_ns: int  #: log time of the first message; 0 without one
    end_ns: int  #: and of the last


def recover(path: Path, progress: Progress = lambda done, total: None) -> Recovered:
    """Make a bag whole. What is whole is left as it is.

    Parameters
    ----------
    path : Path
        Folder of a run or a bag, or a single MCAP file.
    progress : callable, optional

    Raises
    ------
    ConfigurationError
        If there is no bag, or it is damaged and not just cut; a `DiskError` if the disk has no
        room for the new file. All files are as they were, then.
    """
    files, is_listed = _files(path)
    rebuilt, dropped_bytes, dropped = [], 0, []
    for file in files:
        if not _has_end(file):
            size, words = _rebuild(file, progress)
            rebuilt.append(file.name)
            dropped_bytes += size
            dropped += words
    facts, topics = zip(*map(_facts, files), strict=True)
    topics = _together(topics)
    if path.is_dir() and (rebuilt or not is_listed):
        write_metadata(path, metadata_text(facts, topics))
        rebuilt.append(METADATA_FILE)
    bag = Bag(path)  # which tests all checksums
    return Recovered(
        rebuilt=tuple(rebuilt),
        dropped_bytes=dropped_bytes,
        dropped=tuple(dropped),
        counts={topic.name: topic.count for topic in topics},
        start_ns=bag.start_ns,
        end_ns=bag.end_ns,
    )


def _files(path: Path) -> tuple[list[Path], bool]:
    """Files of a bag, and whether its metadata.yaml lists them."""
    try:
        return bag_files(path), path.is_file() or (path / METADATA_FILE).is_file()
    except ConfigurationError:
        files = sorted(path.glob('*.mcap')) if path.is_dir() else []
        if not files:
            raise
        return files, False


def _has_end(file: Path) -> bool:
    """Whether a file has an index that says what is in it."""
    try:
        with file.open('rb') as stream:
            if read_footer(stream, stream.seek(0, 2)) is None:
                return False
            stream.seek(0)
            summary = make_reader(stream).get_summary()
    except OSError as error:
        raise ConfigurationError(f'{file}: {error.strerror or error}') from None
    except UNREADABLE as error:
        raise ConfigurationError(f'{file}: damaged: its index cannot be read: {error}') from None
    return summary is not None and summary.statistics is not None


def _facts(file: Path) -> tuple[FileFacts, list[TopicFacts]]:
    """What the end of a file says is in it."""
    with file.open('rb') as stream:
        summary = make_reader(stream).get_summary()
    said = summary.statistics
    start_ns, end_ns = said.message_start_time, said.message_end_time
    topics = _topics(summary.channels, summary.schemas, said.channel_message_counts)
    return FileFacts(file.name, start_ns, end_ns, said.message_count), topics


def _topics(
    channels: dict[int, Channel], schemas: dict[int, Schema], counts: dict[int, int]
) -> list[TopicFacts]:
    """What metadata.yaml says of the topics of a file."""
    return [
        TopicFacts(
            channel.topic,
            schemas[channel.schema_id].name if channel.schema_id in schemas else '',
            channel.metadata.get('offered_qos_profiles', ''),
            channel.metadata.get('topic_type_hash', ''),
            counts.get(number, 0),
        )
        for number, channel in channels.items()
    ]


def _together(topics: Iterable[list[TopicFacts]]) -> list[TopicFacts]:
    """Topics of all files of a bag."""
    known, counts = {}, Counter()
    for topic in chain.from_iterable(topics):
        known.setdefault(topic.name, topic)
        counts[topic.name] += topic.count
    return [topic._replace(count=counts[name]) for name, topic in known.items()]


# ---------------------------------------------------------------------- one file


def _rebuild(file: Path, progress: Progress) -> tuple[int, list[str]]:
    """Give a file its index; the bytes of it that were dropped, and what they were, in words."""
    draft = file.with_name(f'.part-{file.stem}')
    try:
        with file.open('rb') as stream:
            if stream.read(len(MAGIC)) != MAGIC:
                raise ConfigurationError(f'{file}: not an MCAP file, or nothing is left of it')
            rebuilt = _Rebuilt(file, draft)
            for opcode, at, data in _records(stream):
                rebuilt.take(opcode, at, data)
                progress(stream.tell(), stream.seek(0, 2))
            dropped_bytes, dropped = rebuilt.close(stream)
        os.replace(draft, file)
    except OSError as error:
        raise not_written(file, error) from None
    finally:
        draft.unlink(missing_ok=True)
    return dropped_bytes, dropped


def _records(stream: IO[bytes]) -> Iterator[tuple[int, int, bytes]]:
    """Opcode, place and content of each whole record, up to the end of the data."""
    size, at = stream.seek(0, 2), len(MAGIC)
    while at + HEAD.size <= size:
        stream.seek(at)
        opcode, length = HEAD.unpack(stream.read(HEAD.size))
        end = at + HEAD.size + length
        if end > size or opcode in (0, Opcode.DATA_END, Opcode.FOOTER):
            return
        yield opcode, at, stream.read(length)
        at = end


class _Rebuilt:
    """The new file that what is left of an old one goes into."""

    def __init__(self, file: Path, draft: Path) -> None:
        self._file, self._draft = file, draft
        self._writer: McapWriter | None = None
        self._loose = bytearray()  #: messages that are in no chunk
        self._schemas: dict[int, Schema] = {}
        self._channels: dict[int, Channel] = {}
        self._end = len(MAGIC)  #: of what was taken, in the old file
        self._dropped_bytes, self._dropped = 0, []

    def take(self, opcode: int, at: int, data: bytes) -> None:
        """Take a record."""
        if self._writer is None and opcode != Opcode.HEADER:
            raise self._damaged(at, 'no header')
        try:
            self._take(opcode, at, data)
        except UNREADABLE as error:
            raise self._damaged(at, str(error)) from None
        self._end = at + HEAD.size + len(data)

    def _take(self, opcode: int, at: int, data: bytes) -> None:
        if opcode == Opcode.HEADER:
            self._writer = McapWriter(self._draft, _read(Header, data).profile)
        elif opcode in (Opcode.SCHEMA, Opcode.CHANNEL):
            self._define(opcode, data)
        elif opcode == Opcode.ATTACHMENT:
            one = _read(Attachment, data)
            self._writer.add_attachment(one.name, one.media_type, one.data)
        elif opcode == Opcode.METADATA:
            one = _read(Metadata, data)
            if one.name != ROSBAG2:
                self._writer.add_metadata(one.name, one.metadata)
        elif opcode == Opcode.MESSAGE:
            self._loose += HEAD.pack(opcode, len(data)) + data
            if len(self._loose) > _LOOSE_BYTES:
                self._write_loose()
        elif opcode == Opcode.CHUNK:
            self._write_loose()
            try:
                self._write(unpack(data))
            except ValueError as error:
                times = span(*_CHUNK_TIMES.unpack_from(data))
                self._drop(len(data), f'the chunk ({times}) at byte {at:,}: {error}')

    def _define(self, opcode: int, data: bytes) -> None:
        """Take a definition; those that come again are not needed."""
        is_schema = opcode == Opcode.SCHEMA
        record = _read(Schema if is_schema else Channel, data)
        known = self._schemas if is_schema else self._channels
        if record.id not in known:
            known[record.id] = record
            self._writer.define(record)

    def _write_loose(self) -> None:
        content, self._loose = bytes(self._loose), bytearray()
        self._write(content)

    def _write(self, content: bytes) -> None:
        """Write the records of a chunk.

        Raises
        ------
        ValueError
            If they are none.
        """
        data = np.frombuffer(content, np.uint8)
        found = find(data)
        for at in map(int, found.others):
            opcode, length = HEAD.unpack_from(content, at)
            if opcode in (Opcode.SCHEMA, Opcode.CHANNEL):
                self._define(opcode, content[at + HEAD.size : at + HEAD.size + length])
        strange = set(found.channel.tolist()).difference(self._writer.counts)
        if strange:
            raise ValueError(f'messages of channel {min(strange)}, which is not defined')
        if len(found.channel):
            self._writer.write_chunk(content, found.channel, found.log_ns, found.start)

    def close(self, stream: IO[bytes]) -> tuple[int, list[str]]:
        """Complete the new file, on disk; how much of the old one was dropped, and what."""
        if self._writer is None:
            raise self._damaged(len(MAGIC), 'nothing is left of it')
        self._write_loose()
        self._drop_rest(stream)
        writer = self._writer
        facts = FileFacts(
            self._file.name, writer.start_ns or 0, writer.end_ns, sum(writer.counts.values())
        )
        topics = _topics(self._channels, self._schemas, writer.counts)
        writer.add_metadata(ROSBAG2, {'serialized_metadata': metadata_text([facts], topics)})
        writer.close(sync=True)
        return self._dropped_bytes, self._dropped

    def _drop_rest(self, stream: IO[bytes]) -> None:
        """Note what is behind the last whole record, if it is more than an index."""
        size = stream.seek(0, 2)
        stream.seek(self._end)
        rest = stream.read(HEAD.size + _CHUNK_TIMES.size)
        if not rest or rest[0] in (Opcode.DATA_END, Opcode.FOOTER):
            return
        what = 'what begins'
        if rest[0] == Opcode.CHUNK and len(rest) == HEAD.size + _CHUNK_TIMES.size:
            what = f'the chunk ({span(*_CHUNK_TIMES.unpack_from(rest, HEAD.size))})'
        self._drop(size - self._end, f'{what} at byte {self._end:,}: its end is missing')

    def _drop(self, size: int, what: str) -> None:
        self._dropped_bytes += size
        self._dropped.append(f'{self._file.name}: {what}')

    def _damaged(self, at: int, what: str) -> ConfigurationError:
        return ConfigurationError(f'{self._file}: cannot be recovered: {what} (byte {at:,})')


def _read(kind: type, data: bytes):
    """Record of a kind."""
    return kind.read(ReadDataStream(BytesIO(data)))
