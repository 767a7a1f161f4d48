# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""Process that starts the nodes of a run as copies of itself: what they share is imported once.

To import the mathematics is most of the start of a node, and a run over nodes has eight processes.
It imports nothing that starts threads other than those of numpy, which a fork ends in good order;
rclpy is imported by each node. A node that is not a Python module is executed.

It gets one line of JSON on standard input: a list of ``[name, command, standard output, standard
error, signal]``, the signal being what a node gets when this process ends. What it has to say goes
to the file descriptor that is its argument, a line of JSON each: ``[name, pid]`` once, and
``[name, exit code]`` when the node has ended, negative for a signal. It stays until its standard
input ends.
"""

import ctypes
import gc
import importlib
import json
import os
import runpy
import signal
import sys
from contextlib import suppress
from pathlib import Path

#: What the nodes share; it must not start threads, rclpy does.
SHARED = 'glider_mission.blocks'
#: What it is called in messages.
FORK_SERVER = 'fork_server'
#: The kernel keeps this much of the name of a process.
NAME_LENGTH = 15
_PR_SET_PDEATHSIG = 1
_LIBC = ctypes.CDLL(None)
#: Where the command line lies in memory, among what /proc/PID/stat says after the name.
_ARGUMENTS = slice(45, 47)


def tie_to(parent: int, last_signal: int) -> None:
    """Have this process sent a signal when its parent ends."""
    _LIBC.prctl(_PR_SET_PDEATHSIG, int(last_signal))
    if os.getppid() != parent:
        os._exit(1)


def set_title(title: str) -> None:
    """Have ``ps`` show another command line for this process, as far as there is room.

    A copy of a process has the command line of the first one, which lies in its own memory.
    """
    stat = Path('/proc/self/stat').read_text(encoding='ascii', errors='replace')
    numbers = stat.rpartition(')')[2].split()
    start, end = (int(number) for number in numbers[_ARGUMENTS])
    if start:
        room = end - start
        ctypes.memmove(start, title.encode()[: room - 1].ljust(room, b'\0'), room)


def children_of(pid: int) -> list[int]:
    """Process ids of the children of a process; none if it is gone."""
    found = []
    for threads in Path(f'/proc/{pid}/task').glob('*/children'):
        with suppress(FileNotFoundError, ProcessLookupError):
            found += map(int, threads.read_text(encoding='ascii').split())
    return found


def nodes_of(runner: int) -> dict[str, int]:
    """Process ids by name of what a runner has started: this process, and nodes that are alive."""
    found = {}
    for server in children_of(runner):
        with suppress(OSError):
            if __name__.encode() in Path(f'/proc/{server}/cmdline').read_bytes().split(b'\0'):
                found[FORK_SERVER] = server
                for pid in children_of(server):
                    found[Path(f'/proc/{pid}/comm').read_text(encoding='utf-8').strip()] = pid
    return found


def _is_module(command: list[str]) -> bool:
    return command[:2] == [sys.executable, '-m']


def _become(command: list[str]) -> None:
    """Turn this process into that of a command."""
    if not _is_module(command):
        signal.signal(signal.SIGPIPE, signal.SIG_DFL)
        os.execvp(command[0], command)
    sys.argv = command[2:]
    runpy.run_module(command[2], run_name='__main__', alter_sys=True)


def _start(server: int, name: str, command: list[str], out: int, error: int, last: int) -> int:
    """Process id of a node. In the process of the node it does not come back."""
    pid = os.fork()
    if pid:
        return pid
    tie_to(server, last)
    os.setsid()
    os.dup2(out, 1)
    os.dup2(error, 2)
    os.closerange(3, max(map(int, os.listdir('/proc/self/fd'))) + 1)
    Path('/proc/self/comm').write_text(name[:NAME_LENGTH], encoding='utf-8')
    set_title(f'{name} ({" ".join(command[1:3])})')
    _become(command)
    sys.exit()


def main() -> None:
    """Start nodes, and tell how they end."""
    says, server, names = int(sys.argv[1]), os.getpid(), {}

    def say(*words) -> None:
        with suppress(BrokenPipeError):
            os.write(says, json.dumps(words).encode() + b'\n')

    plan = json.loads(sys.stdin.buffer.readline())
    if any(_is_module(command) for _, command, *_ in plan):
        gc.disable()
        importlib.import_module(SHARED)
        gc.enable()
    gc.freeze()
    for name, *how in plan:
        pid = _start(server, name, *how)
        names[pid] = name
        say(name, pid)
        for end in how[1:3]:
            os.close(end)
    while names:
        pid, status = os.wait()
        say(names.pop(pid), os.waitstatus_to_exitcode(status))
    sys.stdin.buffer.read()


if __name__ == '__main__':
    main()
