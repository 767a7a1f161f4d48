# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""MCAP files (https://mcap.dev/spec), written chunk by chunk.

The records are those of the `mcap` package. What its own writer does message by message, a
`McapWriter` can also do for a block of many ticks at once, which the direct engine needs: a
mission of 30 h has ten million messages. The bytes depend on what is written and on nothing else.
Chunks, attachments, the data section and the summary all carry checksums.
"""

import fcntl
import os
import struct
import zlib
from collections import Counter
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path

import numpy as np
import zstandard
from mcap import records
from mcap.data_stream import RecordBuilder
from mcap.opcode import Opcode
from mcap.summary import Summary

from glider_mission.disk import not_written, refuse_vanished
from glider_mission.recording.mcap_records import MAGIC, find

_MESSAGE = struct.Struct('<BQHIQQ')
_LIBRARY = 'glider_bringup'


class McapWriter:
    """One MCAP file.

    After `flush` the operating system has every message: they outlive this process. After `sync`
    the disk has them: they outlive the machine. The file is complete after `close`. All three
    raise a `DiskError` if the disk takes no more; what was flushed before can be read. Until then
    the file is locked (flock), where the file system has locks.
    """

    def __init__(self, path: Path, profile: str) -> None:
        self._path = path
        self._file = path.open('wb', buffering=0)
        with suppress(OSError):  # where a file system has no locks
            fcntl.flock(self._file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        self._pending = bytearray(MAGIC)  #: of the file, not yet handed to the operating system
        self._handed, self._checksum = 0, 0  #: length of what was, and its CRC
        self._compressor = zstandard.ZstdCompressor(level=3)
        self._summary = Summary()
        self.channels = self._summary.channels  #: that are defined, by their ids
        self._counts: Counter[int] = Counter()  #: of messages in chunks that are finished
        self._chunk = bytearray()
        self._put(records.Header(profile, _LIBRARY))

    def _put(self, record) -> tuple[int, int]:
        """Write a record; return its place and length in the file."""
        data = _encoded(record)
        offset = self._tell()
        self._pending += data
        return offset, len(data)

    def _tell(self) -> int:
        """Place in the file of what comes next."""
        return self._handed + len(self._pending)

    def _hand_over(self) -> None:
        """Write what is pending; what a full disk does not take stays pending."""
        try:
            while self._pending:
                written = self._file.write(self._pending)
                self._checksum = zlib.crc32(memoryview(self._pending)[:written], self._checksum)
                self._handed += written
                del self._pending[:written]
        except OSError as error:
            raise not_written(self._path, error) from None

    def define(self, record: records.Schema | records.Channel) -> None:
        """Define a message type or a topic; one that comes again is not needed."""
        known = self.channels if isinstance(record, records.Channel) else self._summary.schemas
        if record.id not in known:
            known[record.id] = record
            self._put(record)

    def add_attachment(self, name: str, media_type: str, data: bytes) -> None:
        """Store a file beside the messages."""
        offset, length = self._put(records.Attachment(0, 0, name, media_type, data))
        self._summary.attachment_indexes.append(
            records.AttachmentIndex(offset, length, 0, 0, len(data), name, media_type)
        )

    def add_metadata(self, name: str, data: dict[str, str]) -> None:
        """Store named texts."""
        self.flush()
        place = self._put(records.Metadata(name=name, metadata=data))
        self._summary.metadata_indexes.append(records.MetadataIndex(*place, name))

    # ------------------------------------------------------------------ messages

    def write(self, channel_id: int, stamp_ns: int, payload: bytes) -> None:
        """Add one message; its log time and its publish time are ``stamp_ns``."""
        self._chunk += _MESSAGE.pack(
            Opcode.MESSAGE, 22 + len(payload), channel_id, 0, stamp_ns, stamp_ns
        )
        self._chunk += payload

    def write_rows(
        self, channel_ids: Sequence[int], stamps_ns: np.ndarray, payloads: Sequence[np.ndarray]
    ) -> None:
        """Add n messages to each of several channels, interleaved by stamp.

        The ascending stamps int64[n] are common to all; payloads are uint8[n, size] per channel.
        """
        count = len(stamps_ns)
        if not count:
            return
        stamps = np.asarray(stamps_ns, '<u8')
        width = sum(_MESSAGE.size + payload.shape[1] for payload in payloads)
        rows = np.empty((count, width), np.uint8)
        column = 0
        for channel_id, payload in zip(channel_ids, payloads, strict=True):
            size = payload.shape[1]
            head = _MESSAGE.pack(Opcode.MESSAGE, 22 + size, channel_id, 0, 0, 0)
            end = column + len(head)
            rows[:, column:end] = np.frombuffer(head, np.uint8)
            times = stamps.view(np.uint8).reshape(count, 8)
            rows[:, end - 16 : end - 8] = times
            rows[:, end - 8 : end] = times
            rows[:, end : end + size] = payload
            column = end + size
        self._chunk += rows.data

    def add(self, content: bytes) -> None:
        """Add records that are a chunk, or a part of one, as they are."""
        self._chunk += content

    @property
    def waiting(self) -> int:
        """Bytes of the chunk at hand."""
        return len(self._chunk)

    # ------------------------------------------------------------------ chunks

    def flush(self) -> None:
        """Finish the chunk at hand and hand it to the operating system."""
        if self._chunk:
            self._end_chunk()
        self._hand_over()

    def refuse_vanished(self) -> None:
        """Raise a `DiskError` if the file is no longer where it was begun."""
        refuse_vanished(self._path, self._file)

    def sync(self) -> None:
        """Bring what was flushed to disk, and wait until it is there."""
        try:
            os.fdatasync(self._file.fileno())
        except OSError as error:
            raise not_written(self._path, error) from None

    def _end_chunk(self) -> None:
        content, self._chunk = self._chunk, bytearray()
        found = find(bytes(content))
        start_ns, end_ns = int(found.log_ns.min()), int(found.log_ns.max())
        data = self._compressor.compress(content)
        chunk = records.Chunk(
            compression='zstd',
            data=data,
            message_start_time=start_ns,
            message_end_time=end_ns,
            uncompressed_crc=zlib.crc32(content),
            uncompressed_size=len(content),
        )
        offset, length = self._put(chunk)
        index_start = self._tell()
        index_offsets = {}
        places = np.stack((found.log_ns, found.start - _MESSAGE.size), axis=1).astype('<u8')
        for number in map(int, np.unique(found.channel)):
            entries = places[found.channel == number]
            self._counts[number] += len(entries)
            index_offsets[number] = self._tell()
            size = entries.nbytes
            self._pending += struct.pack('<BQHI', Opcode.MESSAGE_INDEX, 6 + size, number, size)
            self._pending += entries.tobytes()
        index = records.ChunkIndex(
            message_start_time=start_ns,
            message_end_time=end_ns,
            chunk_start_offset=offset,
            chunk_length=length,
            message_index_offsets=index_offsets,
            message_index_length=self._tell() - index_start,
            compression='zstd',
            compressed_size=len(data),
            uncompressed_size=len(content),
        )
        self._summary.chunk_indexes.append(index)

    # ------------------------------------------------------------------ end

    def close(self, sync: bool = False) -> None:
        """Write the summary, sync the file if so wanted, and close it."""
        self.flush()
        self._put(records.DataEnd(self._checksum))
        summary_start = self._tell()
        data, offsets = bytearray(), []
        summary = self.summary()
        for group in (
            [*summary.schemas.values()],
            [*summary.channels.values()],
            [summary.statistics],
            summary.chunk_indexes,
            summary.attachment_indexes,
            summary.metadata_indexes,
        ):
            start, encoded = summary_start + len(data), b''.join(map(_encoded, group))
            if group:
                offsets.append(records.SummaryOffset(encoded[0], start, len(encoded)))
            data += encoded
        offsets_start = summary_start + len(data)
        data += b''.join(map(_encoded, offsets))
        head = struct.pack('<BQQQ', Opcode.FOOTER, 20, summary_start, offsets_start)
        self._pending += data
        self._put(records.Footer(summary_start, offsets_start, zlib.crc32(head, zlib.crc32(data))))
        self._pending += MAGIC
        self._hand_over()
        if sync:
            self.sync()
        self._file.close()

    def summary(self) -> Summary:
        """What is in the file; messages are counted that wait for their chunk, too."""
        summary = self._summary
        waiting = find(bytes(self._chunk)).channel.tolist()
        counts = self._counts + Counter(waiting)
        starts_ns = [index.message_start_time for index in summary.chunk_indexes]
        ends_ns = [index.message_end_time for index in summary.chunk_indexes]
        summary.statistics = records.Statistics(
            attachment_count=len(summary.attachment_indexes),
            channel_count=len(summary.channels),
            channel_message_counts=dict(sorted(counts.items())),
            chunk_count=len(summary.chunk_indexes),
            message_count=counts.total(),
            message_start_time=min(starts_ns, default=0),
            message_end_time=max(ends_ns, default=0),
            metadata_count=len(summary.metadata_indexes),
            schema_count=len(summary.schemas),
        )
        return summary


def _encoded(record) -> bytes:
    """Bytes of a record."""
    builder = RecordBuilder()
    record.write(builder)
    return builder.end()
