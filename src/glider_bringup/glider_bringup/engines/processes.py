# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""Flies a scenario over ROS 2: its processes, started, watched and stopped together."""

import json
import os
import selectors
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from functools import partial
from pathlib import Path
from typing import IO, Any, Literal, NamedTuple

from glider_base import wiring
from glider_base.errors import FATAL
from glider_base.ros.places import NAMESPACE, QUIET, domain_id
from glider_base.wiring import WIRING
from glider_bringup.engines.fork_server import FORK_SERVER, tie_to
from glider_bringup.engines.janitor import is_alive

PLANT, RECORDER = wiring.PLANT.node, 'recorder_node'

#: Module of every node, in the order in which they are started: the plant, which makes time, is
#: the last.
MODULES = {wired.node: wired.module for wired in WIRING if wired != wiring.PLANT}
MODULES |= {RECORDER: 'glider_bringup.nodes.recorder_node', PLANT: wiring.PLANT.module}

#: The process that has the nodes of these blocks in it, and its module.
AUTOPILOT, AUTOPILOT_MODULE = 'autopilot', 'glider_bringup.nodes.autopilot'
ON_BOARD = (wiring.NAVIGATION, wiring.GUIDANCE, wiring.CONTROL, wiring.GUARD)
#: The process that has all nodes in it but the recorder, and its module.
STACK, STACK_MODULE = 'stack', 'glider_bringup.nodes.stack'
#: Which nodes share a process: all but the recorder, those on board, none.
Layout = Literal['together', 'autopilot', 'processes']

#: Who sees the nodes if nobody says else: those on this machine.
RANGE, LOCAL = 'ROS_AUTOMATIC_DISCOVERY_RANGE', 'LOCALHOST'

#: Remapping that brings the clock into the namespace: docs/adr/0013.
OWN_CLOCK = ('/clock', 'clock')
#: Processes that have the plant in them.
_MAKES_TIME = (PLANT, STACK)
#: Signals of a stop, and how long (s) a process has after each.
_ESCALATION = ((signal.SIGINT, 2.0), (signal.SIGTERM, 1.0), (signal.SIGKILL, 2.0))
#: So much longer (s) the recorder has after the first: what it has not written is lost.
_TO_WRITE_S = 8.0
#: Nodes have this long (s) to leave by themselves after a completed run.
_LEAVE_S = 3.0
#: The recorder hears the last messages within this time (s) after the plant has stopped.
_HEAR_S = 0.5
#: The fork server is gone within this time (s) after the nodes.
_END_S = 1.0
#: A failure is seen within this time (s) after nodes left because of it, on a busy machine too.
_AFTERMATH_S = 10.0
#: Of processes that are killed at the same moment one hears within this time (s).
_TOGETHER_S = 0.1


class RunnerResult(NamedTuple):
    """How a run over nodes ended."""

    status: str  #: 'completed', 'aborted' (by a signal to the runner) or 'failed'
    reason: str = ''  #: one or more sentences for the person
    exit_code: int = 0  #: of the node that failed; negative: the signal that killed it
    flight_s: float = 0.0  #: wall time from the first tick to the end


def process_modules(layout: Layout = 'processes') -> dict[str, str]:
    """Module of every process: of each node, or of what has several of them in it."""
    if layout == 'processes':
        return dict(MODULES)
    if layout == 'together':
        return {RECORDER: MODULES[RECORDER], STACK: STACK_MODULE}
    aboard = {wired.node for wired in ON_BOARD}
    others = {name: module for name, module in MODULES.items() if name not in aboard}
    return {AUTOPILOT: AUTOPILOT_MODULE, **others}


def node_commands(
    params_file: Path,
    namespace: str = NAMESPACE,
    own_clock: bool = False,
    layout: Layout = 'processes',
) -> dict[str, list[str]]:
    """Command line of every process.

    With ``own_clock`` the clock lies in the namespace, so that gliders can share a ROS domain.
    """
    ros = ['--ros-args', QUIET, '--params-file', str(params_file)]
    ros += ['-r', f'__ns:={namespace}']
    if own_clock:
        ros += ['-r', ':='.join(OWN_CLOCK)]
    modules = process_modules(layout)
    return {name: [sys.executable, '-m', module, *ros] for name, module in modules.items()}


def node_environment(domain: int) -> dict[str, str]:
    """Environment of every node of a run in a ROS domain, on this machine if nobody says else."""
    return {
        RANGE: LOCAL,
        **os.environ,
        'ROS_DOMAIN_ID': str(domain),
        'RCUTILS_COLORIZED_OUTPUT': '0',
        'PYTHONUNBUFFERED': '1',
    }


class _Process:
    """One node and what it says."""

    def __init__(self, name: str) -> None:
        self.name = name
        self.pid: int | None = None
        self.code: int | None = None  #: with which it has ended; negative: the signal
        self.last_line = ''
        self.fatal = ''

    def note(self, line: str) -> None:
        """Remember a line for the case that it was the last."""
        if line.startswith(FATAL):
            self.fatal = line.removeprefix(FATAL)
        elif self.fatal:
            self.fatal += '\n' + line
        if line.strip():
            self.last_line = line.strip()

    def send(self, number: int) -> None:
        if self.pid is not None and self.code is None:
            with suppress(ProcessLookupError):  # it went with the fork server
                os.kill(self.pid, number)

    def epitaph(self) -> str:
        """How the process ended, in words."""
        if self.code < 0:
            return f'{self.name} was killed by {signal.Signals(-self.code).name}'
        if self.fatal:
            return self.fatal
        if self.code == 0:
            return f'{self.name} ended before the run was complete'
        tail = f': {self.last_line}' if self.last_line else ''
        return f'{self.name} ended with exit code {self.code}{tail}'


class _ForkServer(_Process):
    """The process that starts the nodes and tells how they end."""

    def __init__(self) -> None:
        super().__init__(FORK_SERVER)
        self._popen: subprocess.Popen | None = None

    def start(
        self, plan: Sequence[tuple[str, Sequence[str], int, int, int]], environment: dict[str, str]
    ) -> tuple[int, IO[bytes]]:
        """Start it with what `fork_server` wants to know; gives what it tells, and its output."""
        reader, says = os.pipe()
        parent = os.getpid()
        self._popen = subprocess.Popen(
            [sys.executable, '-m', 'glider_bringup.engines.fork_server', str(says)],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            pass_fds=[says, *(end for _, _, out, error, _ in plan for end in (out, error))],
            env=environment,
            start_new_session=True,
            preexec_fn=lambda: tie_to(parent, signal.SIGKILL),
        )
        os.close(says)
        self.pid = self._popen.pid
        with suppress(BrokenPipeError):  # it is gone already, which is seen soon
            self._popen.stdin.write(json.dumps(plan).encode() + b'\n')
            self._popen.stdin.flush()
        return reader, self._popen.stdout

    def look(self) -> bool:
        """Whether it is gone."""
        self.code = self._popen.poll() if self._popen else None
        return self.code is not None

    def finish(self, patience_s: float) -> None:
        """End it. It has no nodes any more, or they go with it."""
        if self._popen is None:
            return
        with suppress(BrokenPipeError):
            self._popen.stdin.close()
        try:
            self._popen.wait(patience_s)
        except subprocess.TimeoutExpired:
            self._popen.kill()
            self._popen.wait()


class _Janitor:
    """The process that tidies up after the nodes, also when this one is killed with them."""

    def __init__(self) -> None:
        self._popen = subprocess.Popen(
            [sys.executable, '-IS', str(Path(__file__).with_name('janitor.py'))],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
        )
        self._popen.wait()  # it has made itself a process of nobody

    def watch(self, pid: int) -> None:
        """Let it tidy up after a process."""
        with suppress(OSError):  # it was killed, which must not end the run
            self._popen.stdin.write(b'%d\n' % pid)
            self._popen.stdin.flush()

    def finish(self) -> None:
        """Let it tidy up now, and wait until it has."""
        with suppress(OSError):
            self._popen.stdin.close()
        self._popen.stdout.read()  # which ends when the janitor does
        self._popen.stdout.close()


class _Run:
    """The processes of one run, their output, and the order to stop."""

    def __init__(self, on_progress, on_log) -> None:
        self._on_progress, self._on_log = on_progress, on_log
        self._selector = selectors.DefaultSelector()
        self._partial: dict[int, bytes] = {}
        self.signal: int | None = None
        self.first_tick_s: float | None = None
        self.progress: dict[str, Any] = {}
        self.processes: dict[str, _Process] = {}
        self._server = _ForkServer()
        self._janitor = _Janitor()

    def start(self, commands: Mapping[str, Sequence[str]], environment: dict[str, str]) -> None:
        """Have a process started per node."""
        plan, ends = [], []
        for name, command in commands.items():
            process = self.processes[name] = _Process(name)
            last_signal = signal.SIGTERM if name == RECORDER else signal.SIGKILL
            (out, out_end), (error, error_end) = os.pipe(), os.pipe()
            self._listen(out, partial(self._say, process, from_stdout=True))
            self._listen(error, partial(self._say, process))
            plan.append((name, list(command), out_end, error_end, int(last_signal)))
            ends += [out_end, error_end]
        reader, output = self._server.start(plan, environment)
        for end in ends:
            os.close(end)
        self._listen(reader, self._hear)
        self._listen(os.dup(output.fileno()), partial(self._say, self._server))
        output.close()

    def _listen(self, pipe: int, take: Callable[[str], None]) -> None:
        """Have the lines from a pipe taken."""
        os.set_blocking(pipe, False)
        self._selector.register(pipe, selectors.EVENT_READ, take)
        self._partial[pipe] = b''

    # ------------------------------------------------------------------ output

    def pump(self, timeout_s: float) -> None:
        """Pass on what the nodes have said, waiting at most ``timeout_s`` for it."""
        gone = self._server.look()  # first, so that all it had to tell is read below
        for key, _ in self._selector.select(timeout_s):
            self._read(key.fd, key.data)
        if gone:
            for process in self.processes.values():
                if process.code is None and (process.pid is None or not is_alive(process.pid)):
                    process.code = -signal.SIGKILL

    def _read(self, pipe: int, take: Callable[[str], None]) -> None:
        data = os.read(pipe, 65536)
        *lines, rest = (self._partial[pipe] + data).split(b'\n')
        self._partial[pipe] = rest
        if not data:
            self._selector.unregister(pipe)
            os.close(pipe)
            lines += [rest] if rest else []
        for line in lines:
            take(line.decode(errors='replace'))

    def _hear(self, line: str) -> None:
        """Take what the fork server tells of a node: first its process id, then its exit code."""
        name, number = json.loads(line)
        process = self.processes[name]
        if process.pid is None:
            process.pid = number
            self._janitor.watch(number)
        else:
            process.code = number

    def _say(self, process: _Process, line: str, from_stdout: bool = False) -> None:
        if from_stdout and process.name == RECORDER and line.startswith('{'):
            self.progress = json.loads(line)
            if self.first_tick_s is None:
                self.first_tick_s = time.monotonic()
            if self._on_progress:
                self._on_progress(self.progress)
            return
        process.note(line)
        self._on_log(f'[{process.name}] {line}')

    # ------------------------------------------------------------------ watching

    def watch(self) -> tuple[str, list[_Process]]:
        """Wait for the end. Status, and the processes that are to blame for a failure."""
        while True:
            self.pump(0.1)
            if self.signal is not None:
                return 'aborted', []
            ended = [p for p in self.processes.values() if p.code is not None]
            if not ended and self._server.code is None:
                continue
            self.pump(0.0)
            if self._server.code is not None:
                return 'failed', [self._server]
            if not self.progress.get('complete'):
                return 'failed', self._culprits()
            self._wait_for(self.processes.values(), _LEAVE_S)
            return 'completed', []

    def _culprits(self) -> list[_Process]:
        """Of the dead, the one that did not merely notice that another was ill, and the killed.

        Nodes that leave because the plant gave up may be gone before the plant is.
        """
        deadline = time.monotonic() + _AFTERMATH_S
        while True:
            ended = [p for p in self.processes.values() if p.code is not None]
            first = min(ended, key=lambda p: (p.code == 0, p.code == 3))
            if first.code != 0 or time.monotonic() > deadline:
                self._wait_for(self.processes.values(), _TOGETHER_S)
                return [p for p in self.processes.values() if p is first or (p.code or 0) < 0]
            self.pump(0.05)

    def _wait_for(self, processes: Collection[_Process], timeout_s: float) -> None:
        deadline = time.monotonic() + timeout_s
        while any(p.code is None for p in processes) and time.monotonic() < deadline:
            self.pump(0.05)

    # ------------------------------------------------------------------ the end

    def stop(self) -> None:
        """End every process.

        The plant goes first, so that ticks cease while all are still there, and the recorder
        last, so that it has everything.
        """
        by_name = self.processes.values()
        if any(p.pid is None for p in by_name):  # in the middle of the start
            self._server.finish(0.0)
        groups = (
            [p for p in by_name if p.name in _MAKES_TIME],
            [p for p in by_name if p.name not in (*_MAKES_TIME, RECORDER)],
            [p for p in by_name if p.name == RECORDER],
        )
        first = 0 if self.first_tick_s is not None else 1
        for group in groups:
            running = [p for p in group if p.code is None]
            for number, patience_s in _ESCALATION[first:]:
                if all(p.code is not None for p in group):
                    break
                for process in group:
                    process.send(number)
                writes = group is groups[2] and number == signal.SIGINT
                self._wait_for(group, patience_s + _TO_WRITE_S * writes)
            if running and group is groups[0] and first == 0:
                self._wait_for(groups[2], _HEAR_S)
        self._server.finish(_END_S)
        while self._selector.get_map():
            before = len(self._selector.get_map())
            self.pump(0.2)
            if len(self._selector.get_map()) == before and not self._selector.select(0):
                break
        for pipe in list(self._selector.get_map()):
            os.close(pipe)
        self._selector.close()
        self._janitor.finish()


def run_nodes(
    commands: Mapping[str, Sequence[str]],
    log_file: Path,
    on_log: Callable[[str], None],
    on_progress: Callable[[dict[str, Any]], None] | None = None,
) -> RunnerResult:
    """Start the nodes, wait for the end of the run, stop them all.

    Commands are by node name, as of `node_commands`. ``log_file`` and ``on_log`` get every line
    that a node prints, with its name in front; ``on_progress`` what the recorder says several
    times a second: tick, t_s, depth_m, stage, messages, lost; in the last one also complete, and
    counts by topic. No process is left when it comes back. SIGINT and SIGTERM to this process
    abort the run.
    """
    with domain_id() as domain, log_file.open('wb', buffering=0) as log:

        def tell(line: str) -> None:
            with suppress(OSError):  # of a full disk, which must not end the run before its time
                log.write(f'{line}\n'.encode())
            on_log(line)

        run = _Run(on_progress, tell)
        with _signals(run):
            try:
                run.start(commands, node_environment(domain))
                status, culprits = run.watch()
            finally:
                run.stop()
        now, reason = time.monotonic(), ''
        if status == 'aborted':
            reason = f'stopped by {signal.Signals(run.signal).name}'
        if culprits:
            reason = '; '.join(one.epitaph() for one in culprits)
        flight_s = now - (run.first_tick_s or now)
        return RunnerResult(status, reason, culprits[0].code if culprits else 0, flight_s)


@contextmanager
def _signals(run: _Run) -> Iterator[None]:
    """Turn SIGINT and SIGTERM into an orderly end of the run."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return

    def remember(number, frame) -> None:
        run.signal = run.signal or number

    before = {n: signal.signal(n, remember) for n in (signal.SIGINT, signal.SIGTERM)}
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
