# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""The runner with small processes in place of the nodes: no ROS, all the ways to die."""

import json
import os
import signal
import subprocess
import sys
import tempfile
import threading
import time
from tempfile import TemporaryDirectory

import pytest

from glider_base.ros.places import domain_id
from glider_bringup.engines import processes
from glider_bringup.engines.processes import PLANT, RECORDER, node_commands, run_nodes

#: A node that says it is there, and then waits for a signal.
WAIT = """
import os, signal, sys, time
print('up', os.getpid(), flush=True)
{setup}
while True:
    time.sleep(0.02)
    {loop}
"""
CALM = 'for s in (signal.SIGINT, signal.SIGTERM): signal.signal(s, lambda *a: sys.exit(0))'
DEAF = 'for s in (signal.SIGINT, signal.SIGTERM): signal.signal(s, signal.SIG_IGN)'

#: A recorder: progress at once, a last word when it is told to stop or after a while.
RECORD = """
import json, signal, sys, time
def say(**more):
    print(json.dumps(dict(tick=7, t_s=0.7, depth_m=1.0, stage='', messages=63, lost=0, **more)),
          flush=True)
stop = []
for s in (signal.SIGINT, signal.SIGTERM): signal.signal(s, lambda *a: stop.append(1))
say()
end = time.monotonic() + {seconds}
while not stop and time.monotonic() < end:
    time.sleep(0.01)
time.sleep({writing})
say(complete=not stop, counts={{}})
"""


def python(source: str) -> list[str]:
    return [sys.executable, '-c', source]


def node(setup: str = CALM, loop: str = 'pass') -> list[str]:
    return python(WAIT.format(setup=setup, loop=loop))


def recorder(seconds: float = 1e9, writing: float = 0.0) -> list[str]:
    return python(RECORD.format(seconds=seconds, writing=writing))


def after(seconds: float, action: str) -> list[str]:
    """A node that does something after a while."""
    return node(
        f'{CALM}; start = time.monotonic()', f'time.monotonic() - start > {seconds} and ({action})'
    )


LEAVE = 'sys.exit(0)'


@pytest.fixture
def fly(tmp_path):
    """Run commands; gives result, log lines and the pids of the nodes."""

    def run(commands, **arguments):
        lines = []
        result = run_nodes(commands, tmp_path / 'log.txt', lines.append, **arguments)
        assert (tmp_path / 'log.txt').read_text().splitlines() == lines
        pids = [int(line.split()[-1]) for line in lines if '] up ' in line]
        assert not [pid for pid in pids if is_alive(pid)]
        return result, lines

    return run


def is_alive(pid: int) -> bool:
    try:
        os.kill(pid, 0)
    except ProcessLookupError:
        return False
    with open(f'/proc/{pid}/stat', encoding='ascii') as stat:
        return stat.read().rpartition(')')[2].split()[0] != 'Z'


def test_complete_run(fly):
    seen = []
    commands = {
        'guidance_node': after(0.5, LEAVE),
        RECORDER: recorder(0.3),
        PLANT: after(0.5, LEAVE),
    }
    result, lines = fly(commands, on_progress=seen.append)
    assert result.status == 'completed'
    assert result.reason == ''
    assert seen[0]['tick'] == 7
    assert seen[-1]['complete'] is True
    assert result.flight_s > 0.0
    assert any(line.startswith('[guidance_node] up') for line in lines)


@pytest.mark.parametrize('name', ['guidance_node', RECORDER, PLANT])
@pytest.mark.parametrize('number', [signal.SIGKILL, signal.SIGSEGV])
def test_killed_node_is_named(fly, name, number):
    commands = {'guidance_node': node(), RECORDER: recorder(), PLANT: node()}
    die = python(f'import os, time; time.sleep(0.3); os.kill(os.getpid(), {int(number)})')
    started = time.monotonic()
    result, _ = fly({**commands, name: die})
    assert result.status == 'failed'
    assert result.exit_code == -number
    assert result.reason == f'{name} was killed by {number.name}'
    assert time.monotonic() - started < 30.0, 'it waited for a time-out'


def test_nodes_that_are_killed_together_are_all_named(fly):
    at = time.time() + 2.0
    wait = f'time.sleep(max(0.0, {at} - time.time()))'
    die = python(f'import os, time; {wait}; os.kill(os.getpid(), 9)')
    result, _ = fly({'guidance_node': die, RECORDER: recorder(), PLANT: node(), 'guard_node': die})
    killed = ('guidance_node', 'guard_node')
    assert result.reason == '; '.join(f'{name} was killed by SIGKILL' for name in killed)


@pytest.mark.parametrize('name', ['guidance_node', PLANT])
def test_node_that_leaves_early_is_named(fly, name):
    commands = {'guidance_node': node(), RECORDER: recorder(), PLANT: node()}
    result, _ = fly({**commands, name: after(0.3, LEAVE)})
    assert result.status == 'failed'
    assert result.reason == f'{name} ended before the run was complete'


def test_last_words_of_a_node_are_the_reason(fly):
    words = "print('fatal: plant_node: parameter speed = -1', file=sys.stderr); sys.exit(2)"
    commands = {'guidance_node': node(), PLANT: python(f'import sys; {words}')}
    result, lines = fly(commands)
    assert result.exit_code == 2
    assert result.reason == 'plant_node: parameter speed = -1'
    assert '[plant_node] fatal: plant_node: parameter speed = -1' in lines


def test_crash_shows_its_last_line(fly):
    commands = {'guidance_node': python('raise ValueError("no good")'), PLANT: node()}
    result, _ = fly(commands)
    assert result.reason.startswith('guidance_node ended')
    assert 'no good' in result.reason


@pytest.mark.parametrize('late_s', [0.3, 2.0])
def test_plant_that_blames_a_peer_is_believed_over_those_who_left(fly, late_s):
    blame = "print('fatal: guidance_node did not publish', file=sys.stderr, flush=True)"
    commands = {
        'guidance_node': node(),
        'control_node': after(0.2, LEAVE),
        PLANT: after(0.2 + late_s, f'{blame} or sys.exit(3)'),
    }
    result, _ = fly(commands)
    assert (result.status, result.reason) == ('failed', 'guidance_node did not publish')


def test_deaf_node_is_killed(fly):
    commands = {'guidance_node': node(DEAF), RECORDER: recorder(), PLANT: after(0.3, LEAVE)}
    started = time.monotonic()
    result, _ = fly(commands)
    assert result.reason.startswith(PLANT)
    assert time.monotonic() - started < 30.0, 'it waited for a time-out'


def test_recorder_that_writes_for_seconds_is_waited_for(fly):
    """Any other process that does not leave is killed after three."""
    commands = {RECORDER: recorder(writing=4.0), PLANT: after(0.3, LEAVE)}
    seen = []
    result, _ = fly(commands, on_progress=seen.append)
    assert (result.status, seen[-1]['complete']) == ('failed', False)
    assert result.reason.startswith(PLANT)


@pytest.mark.parametrize('number', [signal.SIGINT, signal.SIGTERM])
def test_signal_aborts_the_run_and_the_recorder_has_the_last_word(fly, number):
    commands = {'guidance_node': node(), RECORDER: recorder(), PLANT: node()}

    seen = []

    def interrupt(progress):
        seen.append(progress)
        if 'complete' not in progress:
            threading.Timer(0.2, os.kill, (os.getpid(), number)).start()

    before = signal.getsignal(number)
    result, _ = fly(commands, on_progress=interrupt)
    assert result.status == 'aborted'
    assert number.name in result.reason
    assert seen[-1]['complete'] is False
    assert signal.getsignal(number) is before


@pytest.mark.parametrize('number', [signal.SIGINT, signal.SIGTERM])
def test_signal_while_the_nodes_are_started_leaves_none(fly, monkeypatch, number):
    started = []

    class Starting(subprocess.Popen):
        def __init__(self, *arguments, **options):
            super().__init__(*arguments, **options)
            started.append(self)
            if len(started) == 2:  # the janitor, and the fork server
                os.kill(os.getpid(), number)

    monkeypatch.setattr(processes.subprocess, 'Popen', Starting)
    result, _ = fly({'guidance_node': node(), RECORDER: recorder(), PLANT: node()})
    assert (result.status, result.reason) == ('aborted', f'stopped by {number.name}')
    assert len(started) == 2
    assert not [process.pid for process in started if is_alive(process.pid)]


@pytest.mark.parametrize('number', [signal.SIGKILL, signal.SIGTERM])
def test_no_node_survives_the_runner(tmp_path, number):
    source = (
        'import sys; from pathlib import Path\n'
        'from glider_bringup.engines.processes import run_nodes\n'
        f'run_nodes({dict(guidance_node=node(DEAF), recorder_node=recorder(), plant_node=node())},'
        f' Path({str(tmp_path / "log.txt")!r}),'
        ' lambda line: print(line, file=sys.stderr, flush=True))\n'
    )
    process = subprocess.Popen(python(source), stderr=subprocess.PIPE, text=True)
    pids = []
    while len(pids) < 2:
        line = process.stderr.readline()
        assert line, 'the runner ended too early'
        if '] up ' in line:
            pids.append(int(line.split()[-1]))
    process.send_signal(number)
    process.communicate(timeout=120)
    deadline = time.monotonic() + 60.0
    while any(is_alive(pid) for pid in pids):
        assert time.monotonic() < deadline
        threading.Event().wait(0.02)


def test_ctrl_c_in_a_terminal_reaches_the_runner_only(fly):
    report = "print('group', os.getpgrp() == os.getpid(), flush=True)"
    commands = {
        'guidance_node': node(f'{CALM}; {report}'),
        RECORDER: recorder(0.2),
        PLANT: after(0.3, LEAVE),
    }
    _, lines = fly(commands)
    assert '[guidance_node] group True' in lines


def test_nodes_share_a_domain_that_no_other_run_has(monkeypatch, fly):
    monkeypatch.delenv('ROS_DOMAIN_ID', raising=False)
    show = "print('domain', os.environ['ROS_DOMAIN_ID'], flush=True)"
    with domain_id() as taken:
        commands = {
            'guidance_node': node(f'{CALM}; {show}'),
            RECORDER: recorder(0.2),
            PLANT: after(0.3, f'{show} or {LEAVE}'),
        }
        _, lines = fly(commands)
    domains = {line.split()[-1] for line in lines if '] domain ' in line}
    assert len(domains) == 1
    assert domains != {str(taken)}
    assert 1 <= int(domains.pop()) <= 101


def test_ps_shows_which_node_is_which(fly):
    read = "print('line', open('/proc/self/cmdline').read().partition(chr(0))[0], flush=True)"
    commands = {PLANT: [sys.executable, '-m', 'timeit', '-n', '1', '-r', '1', read]}
    _, lines = fly(commands)
    assert f'[{PLANT}] line {PLANT} (-m timeit)' in lines


def test_domain_that_a_run_was_given_is_not_drawn(monkeypatch):
    monkeypatch.setenv('ROS_DOMAIN_ID', str(os.getpid() % 101 + 1))  # the first that it would draw
    with domain_id() as given, domain_id() as given_too:
        assert given == given_too
        monkeypatch.delenv('ROS_DOMAIN_ID')
        with domain_id() as drawn:
            assert drawn != given


@pytest.mark.skipif(os.getuid() != 0, reason='needs root, to become somebody else')
def test_domains_that_another_person_had_are_free(monkeypatch):
    with TemporaryDirectory() as folder:
        os.chmod(folder, 0o1777)
        monkeypatch.setattr(tempfile, 'tempdir', folder)
        umask = os.umask(0o077)
        for domain in range(1, 102):
            monkeypatch.setenv('ROS_DOMAIN_ID', str(domain))
            with domain_id():
                pass
        os.umask(umask)
        monkeypatch.delenv('ROS_DOMAIN_ID')
        program = (
            'import os, tempfile\n'
            'from glider_base.ros.places import domain_id\n'
            f'tempfile.tempdir = {folder!r}\n'
            'os.setuid(65534)\n'
            'with domain_id():\n'
            '    pass\n'
        )
        subprocess.run(python(program), check=True)


def test_domain_of_the_user_is_kept(monkeypatch):
    monkeypatch.setenv('ROS_DOMAIN_ID', '42')
    with domain_id() as domain:
        assert domain == 42


@pytest.mark.parametrize('wanted', [None, 'SUBNET'])
def test_range_of_the_user_is_kept_and_else_this_machine(monkeypatch, wanted):
    monkeypatch.delenv('ROS_AUTOMATIC_DISCOVERY_RANGE', raising=False)
    if wanted:
        monkeypatch.setenv('ROS_AUTOMATIC_DISCOVERY_RANGE', wanted)
    environment = processes.node_environment(7)
    assert environment['ROS_AUTOMATIC_DISCOVERY_RANGE'] == (wanted or 'LOCALHOST')
    assert environment['ROS_DOMAIN_ID'] == '7'


def test_every_node_gets_parameters_and_namespace(tmp_path):
    commands = node_commands(tmp_path / 'p.yaml', '/sea')
    assert list(commands) == list(processes.MODULES)
    for name, command in commands.items():
        assert command[:3] == [sys.executable, '-m', processes.MODULES[name]]
        assert str(tmp_path / 'p.yaml') in command
        assert '__ns:=/sea' in command
    assert json.dumps(commands)
