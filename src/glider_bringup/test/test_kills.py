# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""``./glider test --only fuzz --door kills``, in little; and the janitor that tidies up after."""

import mmap
import os
import random
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from fuzzing import kills
from fuzzing.counts import Counter
from glider_bringup.engines import processes
from glider_bringup.engines.janitor import SHARED_MEMORY, mapped

#: A process that maps a segment as Fast DDS does, says so and waits.
MAP = """
import mmap, os, sys, time
file = os.open(sys.argv[1], os.O_RDWR | os.O_CREAT)
os.truncate(file, 4096)
segment = mmap.mmap(file, 4096)
print('mapped', flush=True)
time.sleep(600)
"""
#: The same for a process that takes its time to begin, as on a busy machine.
MAP_LATE = "import time; print('begins', flush=True); time.sleep(6.0)" + MAP
#: A process that has a segment and its lock, and then no first thread any more, but another one.
HEADLESS = """
import ctypes, fcntl, mmap, os, sys, threading, time
file = os.open(sys.argv[1], os.O_RDWR | os.O_CREAT)
os.truncate(file, 4096)
segment = mmap.mmap(file, 4096)
lock = os.open(sys.argv[1] + '_el', os.O_RDWR | os.O_CREAT)
fcntl.flock(lock, fcntl.LOCK_EX)
threading.Thread(target=time.sleep, args=[600]).start()
print('mapped', flush=True)
time.sleep(3.0)
ctypes.CDLL(None).pthread_exit(None)
"""
#: A runner: it lets the janitor watch over a process, and waits.
WATCH = """
import sys, time
from glider_bringup.engines.processes import _Janitor
janitor = _Janitor()
janitor.watch(int(sys.argv[1]))
print('watched', flush=True)
time.sleep(600)
"""


def test_killed_flights_end_named_and_every_acknowledged_tick_can_be_read(monkeypatch):
    monkeypatch.setattr(kills, 'VICTIMS', ('fork_server', 'recorder_node', kills.ALL))
    monkeypatch.setattr(kills, 'KILLED_BY', 500)
    counter = Counter(lambda tried: None)
    kills.fuzz(7, 3, counter)
    found = counter.result()
    assert (found.tried, found.examples) == (3, ())
    assert found.clean


@pytest.fixture
def segment():
    """Path of a segment that is not there yet; it does not outlive the test."""
    path = f'{SHARED_MEMORY}/fastrtps_{random.getrandbits(64):016x}'
    yield path
    for ending in ('', '_el'):
        if os.path.exists(path + ending):
            os.unlink(path + ending)


@pytest.fixture
def ports():
    """Paths of a port that is ready and of one that is half made; they do not outlive the test."""
    found = []
    for state in (2, 1):
        path = f'{SHARED_MEMORY}/fastrtps_port{random.randrange(10**8, 10**9)}'
        with open(path, 'xb') as port:
            port.write(state.to_bytes(4, sys.byteorder) + bytes(52396))
        found.append(path)
    yield found
    for path in found:
        if os.path.exists(path):
            os.unlink(path)


def test_port_that_was_never_completed_is_removed_before_a_run(ports):
    """Fast DDS would wait for it for ever, in every process of its domain."""
    ready, half_made = ports
    janitor = processes._Janitor()
    assert os.path.exists(ready) and not os.path.exists(half_made)
    janitor.finish()
    assert os.path.exists(ready)


@pytest.fixture
def start():
    """Start a process that says one word when it is ready; it does not outlive the test."""
    started = []

    def run(source: str, argument: str) -> subprocess.Popen:
        command = [sys.executable, '-c', source, argument]
        started.append(subprocess.Popen(command, stdout=subprocess.PIPE, text=True))
        assert started[-1].stdout.readline()
        return started[-1]

    yield run
    for process in started:
        process.kill()
        process.communicate()


def wait_until_gone(path: str) -> None:
    deadline_s = time.monotonic() + 60.0
    while os.path.exists(path):
        assert time.monotonic() < deadline_s
        time.sleep(0.02)


@pytest.mark.parametrize('source', [MAP, MAP_LATE], ids=['early', 'late'])
def test_segment_of_processes_that_were_killed_with_their_runner_is_removed(
    segment, start, source
):
    process = start(source, segment)
    open(f'{segment}_el', 'w').close()
    runner = start(WATCH, str(process.pid))
    deadline_s = time.monotonic() + 60.0
    while os.path.basename(segment) not in mapped(process.pid):
        assert time.monotonic() < deadline_s
        time.sleep(0.02)
    time.sleep(1.0)  # the janitor looks five times a second
    for one in (process, runner):
        one.send_signal(signal.SIGKILL)
        one.wait()
    wait_until_gone(segment)
    wait_until_gone(f'{segment}_el')


def test_segment_of_a_process_that_is_not_wholly_gone_is_removed_once_it_is(segment, start):
    """One that is killed may lose its first thread before those that have its locks."""
    process = start(HEADLESS, segment)
    runner = start(WATCH, str(process.pid))
    deadline_s = time.monotonic() + 60.0
    while ') Z ' not in Path(f'/proc/{process.pid}/stat').read_text():
        assert time.monotonic() < deadline_s
        time.sleep(0.02)
    runner.kill()
    runner.wait()
    time.sleep(1.0)
    assert os.path.exists(segment)
    process.kill()
    process.wait()
    wait_until_gone(segment)


def test_segment_that_somebody_else_has_stays(segment, start):
    process = start(MAP, segment)
    with open(segment, 'r+b') as file, mmap.mmap(file.fileno(), 0):
        janitor = processes._Janitor()
        janitor.watch(process.pid)
        time.sleep(1.0)
        process.kill()
        process.wait()
        janitor.finish()
        assert os.path.exists(segment)
