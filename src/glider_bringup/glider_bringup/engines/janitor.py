# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""Removes what processes that were killed have left in shared memory.

A process that gets SIGKILL cannot tidy up, and whoever started it may be killed with it. This
program stands outside of their tree. It is told process ids, line by line on standard input, and
notes which segments of Fast DDS each of them has mapped. When the input ends, because whoever
started it is through with the run or is no more, it waits until the processes are gone and removes
those of the segments that nobody has any more. Ports, which are numbered for the whole machine,
stay: Fast DDS takes them up again by itself. Not so a port that somebody was killed in the middle
of making, on which whoever opens it waits for ever: those it removes, before the run as well. It
needs the standard library only.
"""

import fcntl
import os
import re
import select
import sys
import time
from contextlib import suppress

SHARED_MEMORY = '/dev/shm'
#: What the segment of a process is called: by a number that was drawn, so that nobody else's is.
_SEGMENT = re.compile(
    rf'{SHARED_MEMORY}/(fastrtps_[0-9a-f]{{16}})(?: \(deleted\))?$', re.MULTILINE
)
_PORT = re.compile('fastrtps_port[0-9]+')
#: What a port that is ready has as its first number (boost::interprocess), and how long (s) it may
#: take from the beginning to there: it takes microseconds.
_READY, _MAKING_S = 2, 1.0
#: How often it looks (s): as long as segments are made, and later.
_OFTEN_S, _SELDOM_S = 0.2, 5.0
#: Nothing is new for this long (s): once every process has a segment, which its own is the first
#: of, and before, on a busy machine or because they need none.
_SETTLED_S, _NO_MORE_S = 3.0, 60.0
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


def left_over(names: set[str]) -> set[str]:
    """Those of the segments that are there, and that nobody has."""
    pids = [int(name) for name in os.listdir('/proc') if name.isdecimal()]
    there = names.intersection(os.listdir(SHARED_MEMORY)).difference(*map(mapped, pids))
    return {name for name in there if not is_locked(name)}


def _in_the_making() -> set[str]:
    found = set()
    for name in filter(_PORT.fullmatch, os.listdir(SHARED_MEMORY)):
        with suppress(OSError), open(f'{SHARED_MEMORY}/{name}', 'rb') as port:
            if int.from_bytes(port.read(4), sys.byteorder) != _READY:
                found.add(name)
    return found


def half_made() -> set[str]:
    """Ports that somebody has begun to make, and will not complete."""
    found = _in_the_making()
    if found:
        time.sleep(_MAKING_S)
        found &= _in_the_making()
    return found


def remove(names: set[str]) -> None:
    """Remove segments, with their locks."""
    for name in names:
        for file in (name, f'{name}_el'):
            with suppress(OSError):
                os.unlink(f'{SHARED_MEMORY}/{file}')


def main() -> None:
    """Watch over processes until the input ends, then tidy up."""
    remove(half_made())
    if os.fork():
        os._exit(0)
    os.setsid()
    found: dict[int, set[str]] = {}  # segments by process
    new_s, rest = time.monotonic(), b''
    while True:
        settled_s = _SETTLED_S if all(found.values()) else _NO_MORE_S
        is_settled = time.monotonic() - new_s > settled_s
        ready, _, _ = select.select([0], [], [], _SELDOM_S if is_settled else _OFTEN_S)
        data = os.read(0, 4096) if ready else None
        if data == b'':
            break
        *lines, rest = (rest + (data or b'')).split(b'\n')
        found |= {int(line): set() for line in lines}
        if _look(found) or lines:
            new_s = time.monotonic()
    deadline_s = time.monotonic() + _PATIENCE_S
    while any(map(is_alive, found)) and time.monotonic() < deadline_s:
        _look(found)
        time.sleep(_OFTEN_S)
    remove(left_over(set().union(*found.values())) | half_made())


def _look(found: dict[int, set[str]]) -> bool:
    """Add what each process has mapped by now; whether anything is new."""
    before = sum(map(len, found.values()))
    for pid, names in found.items():
        names |= mapped(pid)
    return sum(map(len, found.values())) > before


if __name__ == '__main__':
    sys.exit(main())
