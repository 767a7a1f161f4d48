# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""Door ``kills``: SIGKILL to a process of a flight over nodes, to its parent, to all at once.

Each case is a flight of its own, with the next victim in turn, at a tick that is drawn. A hang is
a process that is still there 10 s later. What counts as wrong: a node that is not named, a segment
of shared memory that is left, an acknowledged tick of which any message cannot be read after
`recover`. What a killed node had said, and the recorder had not heard, is not acknowledged.
"""

import json
import os
import posixpath
import random
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import NamedTuple

import numpy as np

from fuzzing.counts import HANG_S, Counter
from fuzzing.flight_listener import Heard, flight_heard
from glider_base.ros.places import NAMESPACE, domain_id
from glider_base.signals import TICK_NS, TICK_S
from glider_bringup.engines.fork_server import FORK_SERVER, nodes_of
from glider_bringup.engines.janitor import is_alive, left_over, mapped
from glider_bringup.engines.processes import MODULES
from glider_mission.recording.mcap_reader import Bag
from glider_mission.recording.recover import recover
from glider_mission.recording.ros.recorded_log import RecordedLog, read_back
from glider_mission.scenario import load_scenario

SCENARIO = 'current_8deg'
#: A flight is killed in its first ticks, and would have many more of them: who listens may be told
#: of it seconds late, and it is not to be over by then.
KILLED_BY, TICKS = 2000, 100_000
PARENT, ALL = 'parent', 'all at once'
VICTIMS = (*MODULES, FORK_SERVER, PARENT, ALL)
#: Nodes of a flight tick within this time (s).
_START_S = 120.0


class _Flight(NamedTuple):
    """A flight that is under way."""

    parent: subprocess.Popen
    folder: Path
    pids: dict[str, int]  #: of the nodes, and of what has started them


def fuzz(seed: int, count: int, counter: Counter) -> None:
    """Fly and kill; see `glider_bringup.commands.fuzz`."""
    for i in range(count):
        victim = VICTIMS[i % len(VICTIMS)]
        tick = random.Random(f'{seed} {i}').randrange(KILLED_BY)
        with tempfile.TemporaryDirectory() as scratch, domain_id() as domain:
            try:
                outcome = _case(victim, tick, Path(scratch) / 'run', domain)
            except Exception as error:
                outcome = 'tracebacks', f'{type(error).__name__}: {error}'
        counter.add(f'seed {seed}, {victim} at tick {tick}', *outcome)


def _case(victim: str, tick: int, folder: Path, domain: int) -> tuple[str, str]:
    """What comes of one flight."""
    with flight_heard(domain) as heard, _flight(folder, domain) as parent:
        if not _wait(lambda: heard.take().tick >= tick or parent.poll() is not None, _START_S):
            return 'hangs', f'tick {heard.tick} after {_START_S:g} s'
        flight = _Flight(parent, folder, nodes_of(parent.pid))
        segments = set().union(*map(mapped, flight.pids.values()))
        if not {*MODULES, FORK_SERVER} <= set(flight.pids):
            return 'wrong', f'it was over at tick {heard.tick}, before the kill'
        for pid in _victims(flight, victim):
            with suppress(ProcessLookupError):  # who goes with its parent may be gone
                os.kill(pid, signal.SIGKILL)
        everybody = [*flight.pids.values(), parent.pid]
        ended = _wait(lambda: not any(map(is_alive, everybody)), HANG_S)
        if not ended:
            left = [name for name, pid in flight.pids.items() if is_alive(pid)]
            return 'hangs', f'{", ".join(left) or PARENT} still there after {HANG_S:g} s'
        if not _wait(lambda: not left_over() & segments, HANG_S):
            return 'wrong', f'shared memory is left: {", ".join(sorted(left_over() & segments))}'
        return _judge(flight, victim, heard.take())


def _victims(flight: _Flight, victim: str) -> list[int]:
    if victim == ALL:
        return [flight.parent.pid, *flight.pids.values()]
    return [flight.parent.pid if victim == PARENT else flight.pids[victim]]


def _judge(flight: _Flight, victim: str, heard: Heard) -> tuple[str, str]:
    """Whether the victim is named, and every tick that was acknowledged is there."""
    out, error = flight.parent.communicate()
    if 'Traceback' in error:
        return 'tracebacks', error[-500:]
    if victim in flight.pids:
        if flight.parent.returncode != 1:
            return 'wrong', f'exit code {flight.parent.returncode}'
        reason = json.loads(out)['reason']
        if f'{victim} was killed by SIGKILL' not in reason:
            return 'wrong', f'the reason is {reason!r}'
    recover(flight.folder)
    bag = Bag(flight.folder)
    log = read_back(bag, load_scenario(str(flight.folder / 'scenario.yaml')).vehicle, [])
    if bag.cut:
        return 'wrong', f'it is cut yet: {bag.cut}'
    lacking = _lacking(bag, log, heard.acknowledged)
    if lacking or log.ticks <= heard.acknowledged:
        return 'wrong', f'{log.ticks} ticks, {heard.acknowledged} was acknowledged {lacking}'
    return '', ''


def _lacking(bag: Bag, log: RecordedLog, newest: int) -> dict[str, int]:
    """How many messages of ticks up to the newest a bag lacks, by topic."""
    found = {posixpath.join(NAMESPACE, name): set() for name in log.recorded()}
    for batch in bag.batches():
        for index in np.unique(batch.topic):
            ticks = batch.log_ns[batch.topic == index] // TICK_NS
            found.get(bag.topics[index].name, set()).update(ticks[ticks <= newest].tolist())
    return {name: newest + 1 - len(ticks) for name, ticks in found.items() if len(ticks) <= newest}


# ------------------------------------------------------------------------------------ processes


@contextmanager
def _flight(folder: Path, domain: int) -> Iterator[subprocess.Popen]:
    """A flight over nodes, by the command line; whatever is left of it is killed."""
    process = subprocess.Popen(
        [
            *(sys.executable, '-m', 'glider_bringup.cli', 'run', SCENARIO, '--json'),
            '--processes',
            *('--duration', str(TICKS * TICK_S), '--no-report', '--out', str(folder)),
        ],
        env={**os.environ, 'ROS_DOMAIN_ID': str(domain)},
        stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
    try:
        yield process
    finally:
        for pid in [*nodes_of(process.pid).values(), process.pid]:
            if process.poll() is None:
                os.kill(pid, signal.SIGKILL)
        process.communicate()


def _wait(condition, seconds: float) -> bool:
    """Wait until a condition holds; whether it does in time."""
    deadline_s = time.monotonic() + seconds
    while not condition():
        if time.monotonic() > deadline_s:
            return False
        time.sleep(0.01)
    return True
