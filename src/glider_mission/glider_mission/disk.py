# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""Files are written whole or not at all, and a disk that takes no more is named as such."""

import errno
import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import IO

from glider_base.settings import ConfigurationError

#: What the disk says where the name of the file is not to blame.
_OF_THE_DISK = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG, errno.EIO)


class DiskError(ConfigurationError):
    """The disk takes no more, or what it had is gone. What was asked for is right: exit code 1."""


#: What is said of a recording that is no longer where it was begun.
VANISHED = 'the recording vanished'


def vanished(file: Path) -> DiskError:
    """What to tell the person about a recording that is gone."""
    return DiskError(f'{file}: {VANISHED}: it or its folder was deleted or renamed')


def refuse_vanished(file: Path, stream: IO[bytes]) -> None:
    """Raise a `DiskError` about a file that has been deleted, moved, or exchanged for another."""
    try:
        is_there = os.path.samestat(os.stat(file), os.fstat(stream.fileno()))
    except OSError:
        is_there = False
    if not is_there:
        raise vanished(file)


def not_written(file: Path, error: OSError) -> ConfigurationError:
    """What to tell the person about a file that cannot be written."""
    kind = DiskError if error.errno in _OF_THE_DISK else ConfigurationError
    return kind(f'{file}: cannot be written: {error.strerror or error}')


@contextmanager
def whole_file(file: Path) -> Iterator[IO[bytes]]:
    """Open a file that is to hold all of what is written, or what it held before.

    It is written under another name in the same folder, synced to disk and then renamed. What is
    no file on a disk (a pipe, a terminal) is written to as it is. Raises ConfigurationError if it
    cannot be written; a `DiskError` if the disk is to blame.
    """
    try:
        if file.exists() and not file.is_file():
            with file.open('wb') as stream:
                yield stream
            return
        target = Path(os.path.realpath(file))
        draft = target.with_name(f'.part-{target.name}')
        try:
            with draft.open('wb') as stream:
                yield stream
                stream.flush()
                os.fsync(stream.fileno())
            os.replace(draft, target)
        except BaseException:
            draft.unlink(missing_ok=True)
            raise
    except OSError as error:
        raise not_written(file, error) from None


def save_figure(figure, file: Path, dpi: int) -> None:
    """Write a figure of matplotlib into an image file.

    The suffix says which kind (png, svg, pdf; png without one); see `whole_file`.
    """
    kind = file.suffix.removeprefix('.').lower() or 'png'
    if kind not in figure.canvas.get_supported_filetypes():
        raise ConfigurationError(
            f'{file}: cannot be written: {kind!r} is no kind of image (allowed: png, svg, pdf)'
        )
    with whole_file(file) as stream:
        figure.savefig(stream, format=kind, dpi=dpi)


def write_whole(file: Path, content: str | bytes) -> None:
    """Write a file, text as UTF-8; see `whole_file`."""
    data = content.encode() if isinstance(content, str) else content
    with whole_file(file) as stream:
        stream.write(data)
