# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""The end of an MCAP file: footer, summary and checksum."""

import struct
import zlib
from io import BytesIO
from typing import IO, NamedTuple

from mcap.data_stream import ReadDataStream
from mcap.opcode import Opcode
from mcap.records import AttachmentIndex, Channel, ChunkIndex, Schema, Statistics

from glider_bringup.recording.mcap_writer import MAGIC

#: What every record begins with: its opcode and its length.
HEAD = struct.Struct('<BQ')
_FOOTER = struct.Struct('<BQQQI')
END_SIZE = _FOOTER.size + len(MAGIC)  #: of a file: the footer, and the magic again
CHECKED = _FOOTER.size - 4  #: bytes of the footer that the checksum in it is of, too
_CHECKED_AT_ONCE = 1 << 20  #: bytes


class Summary(NamedTuple):
    """What the end of a file says is in it."""

    schemas: list[Schema]
    channels: list[Channel]
    chunks: dict[int, ChunkIndex]  #: by place in the file
    attachments: set[int]  #: their places
    statistics: Statistics | None


def read_footer(stream: IO[bytes], size: int) -> tuple[int, int, int] | None:
    """Start of the summary, start of its offsets, and checksum; None if a file does not end so."""
    if size < END_SIZE + len(MAGIC):
        return None
    stream.seek(size - END_SIZE)
    end = stream.read(END_SIZE)
    opcode, length, *footer = _FOOTER.unpack_from(end)
    if (opcode, length) != (Opcode.FOOTER, 20) or not end.endswith(MAGIC):
        return None
    return tuple(footer)


def checksum_to(stream: IO[bytes], end: int) -> int:
    """CRC of a file up to a place."""
    stream.seek(0)
    value = 0
    while end:
        data = stream.read(min(end, _CHECKED_AT_ONCE))
        if not data:
            break
        value, end = zlib.crc32(data, value), end - len(data)
    return value


def parse_summary(data: bytes) -> Summary:
    """Records of a summary."""
    summary, at = Summary([], [], {}, set(), None), 0
    while at < len(data):
        opcode, length = HEAD.unpack_from(data, at)
        stream = ReadDataStream(BytesIO(data[at + HEAD.size : at + HEAD.size + length]))
        if opcode == Opcode.SCHEMA:
            summary.schemas.append(Schema.read(stream))
        elif opcode == Opcode.CHANNEL:
            summary.channels.append(Channel.read(stream))
        elif opcode == Opcode.CHUNK_INDEX:
            index = ChunkIndex.read(stream)
            summary.chunks[index.chunk_start_offset] = index
        elif opcode == Opcode.ATTACHMENT_INDEX:
            summary.attachments.add(AttachmentIndex.read(stream).offset)
        elif opcode == Opcode.STATISTICS:
            summary = summary._replace(statistics=Statistics.read(stream))
        at += HEAD.size + length
    return summary
