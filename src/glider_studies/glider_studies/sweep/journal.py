# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""The journal of a sweep: what is known of every cell, in a file that can only grow.

One JSON object in each line; the first says what the sweep is. A line is there once its line feed
is: whatever kills the program in the middle of one costs that line only.
"""

import fcntl
import json
import os
from collections.abc import Iterator
from itertools import islice
from pathlib import Path
from typing import Any

from glider_base.files import parse_json
from glider_base.settings import ConfigurationError
from glider_mission.disk import DiskError


class Journal:
    """A journal that is open; no second process can open it.

    ``head`` is what the sweep is: a journal of another one is refused. With ``resume`` the file is
    there already, and is continued. Raises ConfigurationError if it cannot be used.
    """

    def __init__(self, path: Path, head: dict[str, Any], resume: bool) -> None:
        self.path = path
        if path.exists() and not resume:
            raise ConfigurationError(
                f'{path}: a sweep has been here already (allowed: --resume, which goes on with '
                f'it, or another --out)'
            )
        if resume and not path.is_file():
            raise ConfigurationError(
                f'--resume: there is no {path} (allowed: the folder of a sweep that was '
                f'interrupted, or no --resume)'
            )
        try:
            self._file = path.open('a+b', buffering=0)
            fcntl.flock(self._file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            raise ConfigurationError(f'{path}: another sweep is at work here') from None
        except OSError as error:
            raise ConfigurationError(f'{path}: {error.strerror}') from None
        try:
            self._end = self._whole_lines()
            self._file.truncate(self._end)
            if self._end:
                self._check(head)
            else:
                self.append([head])
        except BaseException:
            self.close()
            raise

    def __enter__(self) -> 'Journal':
        return self

    def __exit__(self, *_) -> None:
        self.close()

    def close(self) -> None:
        """Let others open the file."""
        self._file.close()

    def _whole_lines(self) -> int:
        """Length of the file up to the last line that was written to its end.

        If a line before it is damaged, something else than this program has written.
        """
        end, bad = 0, 0
        self._file.seek(0)
        with open(self._file.fileno(), 'rb', closefd=False) as file:
            for number, line in enumerate(file, 1):
                if bad:
                    raise ConfigurationError(
                        f'{self.path}: line {bad} is damaged, and is not the last '
                        f'(allowed: the file as it was written, or another --out)'
                    )
                if line.endswith(b'\n') and _is_object(line):
                    end += len(line)
                else:
                    bad = number
        return end

    def _check(self, head: dict[str, Any]) -> None:
        found = next(self._lines())
        different = [name for name in head if found.get(name) != head[name]]
        if different:
            raise ConfigurationError(
                f'{self.path}: belongs to another sweep, other inputs or another version of the '
                f'program: different {", ".join(different)} (allowed: what it was begun with, or '
                f'another --out)'
            )

    def _lines(self) -> Iterator[dict[str, Any]]:
        with self.path.open('rb') as file:
            yield from map(json.loads, file)

    def records(self) -> Iterator[dict[str, Any]]:
        """Records in the order in which they came."""
        return islice(self._lines(), 1, None)

    def append(self, records: list[dict[str, Any]]) -> None:
        """Write records, so that they outlive the machine.

        Raises DiskError if they cannot be written, as on a full disk; what was there before is.
        """
        text = b''.join(json.dumps(record).encode() + b'\n' for record in records)
        try:
            written = self._file.write(text)
            if written == len(text):
                os.fsync(self._file.fileno())
                return
            reason = 'not all of it could be written'
        except OSError as error:
            reason = error.strerror
        raise DiskError(
            f'{self.path}: cannot be written: {reason}; what was written before is there: make '
            f'room and go on with --resume'
        )


def _is_object(line: bytes) -> bool:
    try:
        return isinstance(parse_json(line, 'line'), dict)
    except ConfigurationError:
        return False
