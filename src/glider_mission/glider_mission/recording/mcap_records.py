# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""The records of an MCAP file (https://mcap.dev/spec), one by one, chunks unopened."""

import struct
import zlib
from collections.abc import Iterator
from io import BytesIO
from typing import IO

import lz4.frame
import zstandard
from mcap.data_stream import ReadDataStream
from mcap.exceptions import McapError
from mcap.opcode import Opcode
from mcap.reader import SeekingReader
from mcap.summary import Summary

from glider_base.signals import TICK_NS

MAGIC = b'\x89MCAP0\r\n'
#: What every record begins with: its opcode and its length.
HEAD = struct.Struct('<BQ')
#: What a chunk begins with: the log times of its first and its last message.
CHUNK_TIMES = struct.Struct('<QQ')
_CHUNK_HEAD = struct.Struct('<QQQII')
_FOOTER = struct.Struct('<BQQQI')
#: What is raised about a record that is none.
UNREADABLE = (McapError, struct.error, UnicodeDecodeError)
_NOT_TOLD = -1  #: by a zstd frame: the size of its content


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

    Raises
    ------
    ValueError
        Saying what is wrong with it.
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
