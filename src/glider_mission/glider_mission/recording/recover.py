# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""A bag whose end is missing, made whole: what is there gets its index and its metadata.yaml.

A file is written anew beside the old one, and takes its place once it is on disk: whoever pulls
the plug meanwhile finds the one or the other. Its chunks are those of the old file. A recording of
ours is then, byte by byte, what its recorder would have left had it been stopped there.
"""

import fcntl
import os
from collections.abc import Callable
from pathlib import Path
from typing import IO, Any

from mcap.opcode import Opcode
from mcap.records import Attachment, Header, Metadata
from mcap.summary import Summary

from glider_base.settings import ConfigurationError
from glider_mission.disk import not_written
from glider_mission.recording import mcap_records as records
from glider_mission.recording.bag_files import (
    METADATA_FILE,
    ROSBAG2,
    OtherFilesError,
    bag_files,
    metadata_text,
    topic_counts,
    write_metadata,
)
from glider_mission.recording.mcap_reader import Bag
from glider_mission.recording.mcap_writer import McapWriter

#: Messages that are in no chunk are put into chunks of about this size (B).
_LOOSE_BYTES = 1 << 20

#: Called with the bytes read of a file, and how many it has.
Progress = Callable[[int, int], None]


def recover(path: Path, progress: Progress = lambda done, total: None) -> dict[str, Any]:
    """Make a run, a bag or a single MCAP file whole. What is whole is left as it is.

    Returns
    -------
    dict
        rebuilt (names of the files that were made anew; none if all were whole), start_s and end_s
        (log times of the first and the last message; 0 without one), messages, topics (messages
        by topic), dropped_bytes (of what was no whole chunk), dropped (the same in words).

    Raises
    ------
    ConfigurationError
        If there is no bag, or it is damaged and not just cut; a `DiskError` if the disk has no
        room for the new file. All files are as they were, then.
    """
    files, is_listed = _files(path)
    rebuilt, dropped, summaries = [], [], {}
    for file in files:
        summary = _summary(file)
        if summary is None:
            dropped += _rebuild(file, progress)
            rebuilt.append(file.name)
            summary = _summary(file)
        summaries[file.name] = summary
    if path.is_dir() and (rebuilt or not is_listed):
        write_metadata(path, metadata_text(summaries))
        rebuilt.append(METADATA_FILE)
    bag = Bag(path)  # which tests all checksums
    counts = topic_counts(summaries.values())
    return {
        'rebuilt': rebuilt,
        'start_s': bag.start_ns / 1e9,
        'end_s': bag.end_ns / 1e9,
        'messages': counts.total(),
        'topics': dict(counts),
        'dropped_bytes': sum(size for size, _ in dropped),
        'dropped': [what for _, what in dropped],
    }


def _files(path: Path) -> tuple[list[Path], bool]:
    """Files of a bag, and whether its metadata.yaml lists them."""
    try:
        return bag_files(path), path.is_file() or (path / METADATA_FILE).is_file()
    except OtherFilesError:
        raise  # what it tells is to be found nowhere else
    except ConfigurationError:
        files = sorted(path.glob('*.mcap')) if path.is_dir() else []
        if not files:
            raise
        return files, False


def _summary(file: Path) -> Summary | None:
    """What the end of a file says is in it; None if it does not count its messages."""
    try:
        with file.open('rb') as stream:
            summary = records.read_summary(stream, is_checked=False)  # the bag is, in the end
    except OSError as error:
        raise ConfigurationError(f'{file}: {error.strerror or error}') from None
    except ValueError as error:
        raise ConfigurationError(f'{file}: damaged: {error}') from None
    return summary if summary and summary.statistics else None


def _rebuild(file: Path, progress: Progress) -> list[tuple[int, str]]:
    """Give a file its index; sizes of what was dropped of it, and what it was, in words."""
    draft, writer, end = file.with_name(f'.part-{file.stem}'), None, len(records.MAGIC)
    dropped = []
    try:
        with file.open('rb') as stream:
            _refuse_if_written(stream, file)
            if stream.read(len(records.MAGIC)) != records.MAGIC:
                raise ConfigurationError(f'{file}: not an MCAP file, or nothing is left of it')
            for opcode, at, data in records.whole_records(stream):
                if opcode == Opcode.HEADER:
                    writer = McapWriter(draft, records.parse(Header, data).profile)
                elif writer is None:
                    raise ValueError('no header')
                elif lost := _take(writer, opcode, data):
                    dropped.append((len(data), f'the chunk {lost[0]} at byte {at:,}: {lost[1]}'))
                end = at + records.HEAD.size + len(data)
                progress(stream.tell(), stream.seek(0, 2))
            if writer is None:
                raise ValueError('nothing is left of it')
            dropped += _rest(stream, end)
        text = metadata_text({file.name: writer.summary()})
        writer.add_metadata(ROSBAG2, {'serialized_metadata': text})
        writer.close(sync=True)
        os.replace(draft, file)
    except ConfigurationError:
        raise
    except (ValueError, *records.UNREADABLE) as error:
        raise ConfigurationError(f'{file}: cannot be recovered: {error} (byte {end:,})') from None
    except OSError as error:
        raise not_written(file, error) from None
    finally:
        draft.unlink(missing_ok=True)
    return [(size, f'{file.name}: {what}') for size, what in dropped]


def _refuse_if_written(stream: IO[bytes], file: Path) -> None:
    """Refuse a file whose writer is still at work: its end is not missing, but to come."""
    try:
        fcntl.flock(stream, fcntl.LOCK_SH | fcntl.LOCK_NB)
    except BlockingIOError:
        raise ConfigurationError(
            f'{file}: is still being written (allowed: once its recorder has ended)'
        ) from None
    except OSError:  # the file system has no locks
        pass


def _take(writer: McapWriter, opcode: int, data: bytes) -> tuple[str, str] | None:
    """Write a record into the new file; times of a chunk that is harmed, and what harms it."""
    if opcode in records.DEFINITIONS:
        writer.define(records.parse(records.DEFINITIONS[opcode], data))
    elif opcode == Opcode.ATTACHMENT:
        one = records.parse(Attachment, data)
        writer.add_attachment(one.name, one.media_type, one.data)
    elif opcode == Opcode.METADATA:
        one = records.parse(Metadata, data)
        if one.name != ROSBAG2:
            writer.add_metadata(one.name, one.metadata)
    elif opcode == Opcode.MESSAGE:
        _write(writer, records.HEAD.pack(opcode, len(data)) + data)
        if writer.waiting > _LOOSE_BYTES:
            writer.flush()
    elif opcode == Opcode.CHUNK:
        writer.flush()
        try:
            _write(writer, records.unpack(data))
        except ValueError as error:
            return f'({records.span(*records.CHUNK_TIMES.unpack_from(data))})', str(error)
        writer.flush()
    return None


def _write(writer: McapWriter, content: bytes) -> None:
    """Write the records of a chunk; raise ValueError if they are none."""
    found = records.find_defined(content, writer.define, writer.channels)
    if len(found.channel):
        writer.add(content)


def _rest(stream: IO[bytes], end: int) -> list[tuple[int, str]]:
    """What is behind the last whole record, if it is more than an index: its size, and words."""
    size = stream.seek(0, 2)
    stream.seek(end)
    rest, what = stream.read(records.HEAD.size + records.CHUNK_TIMES.size), 'what begins'
    if not rest or rest[0] in (Opcode.DATA_END, Opcode.FOOTER):
        return []
    times = rest[records.HEAD.size :]
    if rest[0] == Opcode.CHUNK and len(times) == records.CHUNK_TIMES.size:
        what = f'the chunk ({records.span(*records.CHUNK_TIMES.unpack(times))})'
    return [(size - end, f'{what} at byte {end:,}: its end is missing')]
