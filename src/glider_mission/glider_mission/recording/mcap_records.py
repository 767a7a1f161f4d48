# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""The records of an MCAP file (https://mcap.dev/spec): one by one, or of a chunk at once."""

import struct
import zlib
from collections.abc import Callable, Container, Iterator
from io import BytesIO
from typing import IO, NamedTuple

import numpy as np
import zstandard
from mcap.data_stream import ReadDataStream
from mcap.exceptions import McapError
from mcap.opcode import Opcode
from mcap.reader import SeekingReader
from mcap.records import Channel, Chunk, Schema
from mcap.stream_reader import get_chunk_data_stream
from mcap.summary import Summary

from glider_base.kernel import kernel
from glider_base.signals import TICK_NS

MAGIC = b'\x89MCAP0\r\n'
#: What every record begins with: its opcode and its length.
HEAD = struct.Struct('<BQ')
#: What a chunk begins with: the log times of its first and its last message.
CHUNK_TIMES = struct.Struct('<QQ')
_FOOTER = struct.Struct('<BQQQI')
#: What is raised about a record that is none.
UNREADABLE = (McapError, struct.error, UnicodeDecodeError, OverflowError)
#: Records that messages are read by.
DEFINITIONS = {Opcode.SCHEMA: Schema, Opcode.CHANNEL: Channel}
_NO_SIZE = -1  #: by a zstd frame: the size of its content


def span(start_ns: int, end_ns: int) -> str:
    """Times from which to which messages are, in words."""
    ticks = max(0, end_ns - start_ns) // TICK_NS + 1
    return f't = {start_ns / 1e9:.1f} s to {end_ns / 1e9:.1f} s, {ticks:,} ticks'


def parse(kind: type, data: bytes):
    """Record of a kind of the mcap package; raises one of `UNREADABLE`."""
    return kind.read(ReadDataStream(BytesIO(data)))


def whole_records(stream: IO[bytes]) -> Iterator[tuple[int, int, bytes]]:
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


def read_summary(stream: IO[bytes], is_checked: bool = True) -> Summary | None:
    """What the end of a file says is in it; None if the file was not completed.

    A ValueError says what is wrong with it.
    """
    size, end_size = stream.seek(0, 2), _FOOTER.size + len(MAGIC)
    if size < end_size + len(MAGIC):
        return None
    stream.seek(size - end_size)
    end = stream.read()
    opcode, length, start, _, checksum = _FOOTER.unpack_from(end)
    if (opcode, length) != (Opcode.FOOTER, 20) or not end.endswith(MAGIC):
        return None
    stream.seek(min(start, size))
    checked = stream.read()[: -4 - len(MAGIC)]
    if is_checked and start and checksum and zlib.crc32(checked) != checksum:
        raise ValueError('the checksum (CRC) of its summary is wrong')
    stream.seek(0)
    try:
        return SeekingReader(stream, record_size_limit=size).get_summary() or Summary()
    except Exception:  # whatever the package makes of bytes that are no records
        raise ValueError('its summary cannot be read') from None


def unpack(data: bytes) -> bytes:
    """Records of a chunk, decompressed and checked, from the content of its own record.

    A ValueError says what is wrong with it.
    """
    try:
        chunk = parse(Chunk, data)
        size = chunk.uncompressed_size
        stored = zstandard.frame_content_size(chunk.data) if chunk.compression == 'zstd' else size
        if stored not in (size, _NO_SIZE):
            raise ValueError(f'{stored:,} bytes in place of {size:,}')
        stream, length = get_chunk_data_stream(chunk, validate_crc=True)
    except (*UNREADABLE, zstandard.ZstdError, RuntimeError, MemoryError) as error:
        raise ValueError(f'it does not decompress ({error})') from None
    if length != size:
        raise ValueError(f'{length:,} bytes in place of {size:,}')
    return stream.read(length)


@kernel
def number_at(data, at, size):
    """Little-endian number of ``size`` bytes."""
    value = np.int64(0)
    for i in range(size):
        value |= np.int64(data[at + i]) << (8 * i)
    return value


@kernel
def scan(data, channel, log_ns, start, size, other):
    """Find the messages of a chunk, and the places of its other records; how many there are.

    Of messages -1 if a record is longer than what is left.
    """
    messages = others = at = 0
    while at < len(data):
        if at + 9 > len(data):
            return -1, others
        opcode, length = data[at], number_at(data, at + 1, 8)
        body = at + 9
        if length < 0 or length > len(data) - body or (opcode == 5 and length < 22):
            return -1, others
        if opcode == 5:
            channel[messages] = number_at(data, body, 2)
            log_ns[messages] = number_at(data, body + 6, 8)
            start[messages] = body + 22
            size[messages] = length - 22
            messages += 1
        else:
            other[others] = at
            others += 1
        at = body + length
    return messages, others


class Places(NamedTuple):
    """Where the records of a chunk are; int64 arrays."""

    channel: np.ndarray  #: of each message
    log_ns: np.ndarray  #: its log time
    start: np.ndarray  #: where its payload begins
    size: np.ndarray  #: of its payload
    others: np.ndarray  #: where each of the other records begins


def find(data: bytes) -> Places:
    """Records of a chunk; a ValueError if one is longer than what is left."""
    data = np.frombuffer(data, np.uint8)
    channel, log_ns, start, size, other = np.empty((5, len(data) // 9 + 1), np.int64)
    messages, others = scan(data, channel, log_ns, start, size, other)
    if messages < 0:
        raise ValueError('a record is longer than the chunk')
    found = (array[:messages] for array in (channel, log_ns, start, size))
    return Places(*found, other[:others])


def find_defined(
    content: bytes, define: Callable[[Schema | Channel], None], known: Container[int]
) -> Places:
    """Records of a chunk, of which ``define`` gets the definitions.

    Raises ValueError if a record is longer than what is left, or a message is of no channel that
    is ``known`` by then; one of `UNREADABLE` about a definition.
    """
    found = find(content)
    for at in map(int, found.others):
        opcode, length = HEAD.unpack_from(content, at)
        if opcode in DEFINITIONS:
            body = at + HEAD.size
            define(parse(DEFINITIONS[opcode], content[body : body + length]))
    strange = [one for one in np.unique(found.channel).tolist() if one not in known]
    if strange:
        raise ValueError(f'messages of channel {strange[0]}, which is not defined')
    return found
