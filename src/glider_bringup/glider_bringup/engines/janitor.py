# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""Removes what processes that were killed have left in shared memory.

A process that gets SIGKILL cannot tidy up, and whoever started it may be killed with it. This
program stands outside of their tree. It reads process ids, line by line on standard input. When
the input ends, because whoever started it is through with the run or is no more, it waits until
the processes are gone and removes the segments of Fast DDS that nobody has any more, whoever left
them. Ports, which are numbered for the whole machine, stay: Fast DDS takes them up again by
itself. Not so a port that somebody was killed in the middle of making, on which whoever opens it
waits for ever: those it removes, before the run as well. It needs the standard library only.
"""

import fcntl
import os
import re
import sys
import time
from collections.abc import Callable
from contextlib import suppress

SHARED_MEMORY = '/dev/shm'
#: What the segment of a process is called: by a number that was drawn, so that nobody else's is.
_NAME = re.compile('fastrtps_[0-9a-f]{16}')
_SEGMENT = re.compile(rf'{SHARED_MEMORY}/({_NAME.pattern})(?: \(deleted\))?$', re.MULTILINE)
_PORT = re.compile('fastrtps_port[0-9]+')
#: What a port that is ready has as its first number (boost::interprocess).
_READY = 2
#: How long (s) it may take to make a port, or a segment that somebody has: it takes microseconds.
_MAKING_S = 1.0
#: How long it waits for processes to be gone (s): a recorder may complete its file.
_PATIENCE_S = 30.0


def mapped(pid: int) -> set[str]:
    """Names of the segments that a process has mapped; none if it is gone or somebody else's."""
    try:
        with open(f'/proc/{pid}/maps', encoding='utf-8', errors='replace') as maps:
            return set(_SEGMENT.findall(maps.read()))
    except OSError:
        return set()


def is_alive(pid: int) -> bool:
    """Whether a process, or a thread of it, is there and no zombie.

    The first thread of a process that is killed may be gone before the others, which have its
    files and its locks for a moment yet.
    """
    try:
        with open(f'/proc/{pid}/stat', encoding='utf-8', errors='replace') as stat:
            state = stat.read().rpartition(')')[2].split()[0]
        return state not in 'ZX' or len(os.listdir(f'/proc/{pid}/task')) > 1
    except OSError:
        return False


def is_locked(name: str) -> bool:
    """Whether the owner of a segment, maybe in another container, is alive and has it locked."""
    try:
        with open(f'{SHARED_MEMORY}/{name}_el', 'rb') as lock:
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except FileNotFoundError:
        return False
    except OSError:
        return True
    return False


def left_over() -> set[str]:
    """Segments that are there, and that nobody has."""
    pids = [int(name) for name in os.listdir('/proc') if name.isdecimal()]
    segments = filter(_NAME.fullmatch, os.listdir(SHARED_MEMORY))
    there = set(segments).difference(*map(mapped, pids))
    return {name for name in there if not is_locked(name)}


def _in_the_making() -> set[str]:
    """Ports that are not ready: somebody makes them, or was killed in the middle of it."""
    found = set()
    for name in filter(_PORT.fullmatch, os.listdir(SHARED_MEMORY)):
        with suppress(OSError), open(f'{SHARED_MEMORY}/{name}', 'rb') as port:
            if int.from_bytes(port.read(4), sys.byteorder) != _READY:
                found.add(name)
    return found


def lasting(found: Callable[[], set[str]]) -> set[str]:
    """What is found, and is so still when whoever is just making it must have done so."""
    names = found()
    if names:
        time.sleep(_MAKING_S)
        names &= found()
    return names


def remove(names: set[str]) -> None:
    """Remove segments, with their locks."""
    for name in names:
        for file in (name, f'{name}_el'):
            with suppress(OSError):
                os.unlink(f'{SHARED_MEMORY}/{file}')


def main() -> None:
    """Wait until the input has ended and the processes are gone, then tidy up."""
    remove(lasting(_in_the_making))
    if os.fork():
        os._exit(0)
    os.setsid()
    pids = [int(line) for line in sys.stdin]
    deadline_s = time.monotonic() + _PATIENCE_S
    while any(map(is_alive, pids)) and time.monotonic() < deadline_s:
        time.sleep(0.1)
    remove(lasting(lambda: left_over() | _in_the_making()))


if __name__ == '__main__':
    sys.exit(main())
