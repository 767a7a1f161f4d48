# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""Hostile input at the command line: one short message, the exit code, no traceback."""

import os
import subprocess
import sys
import time

import pytest

from glider_bringup import cli

DIRECT = ('run', '--engine', 'direct', '--duration', '0.5', '--no-report')
LONG = 'a' * 300
BOMB = 'a: &a [x, x, x, x, x, x, x, x, x]\n' + ''.join(
    f'{one}: &{one} [{", ".join([f"*{before}"] * 9)}]\n'
    for before, one in zip('abcdefgh', 'bcdefghi', strict=True)
)


@pytest.fixture
def refused(tmp_path, monkeypatch, capsys):
    """Function that gives the message of a command line that is refused at once."""

    def run(*words: str) -> str:
        monkeypatch.chdir(tmp_path)
        monkeypatch.setattr(sys, 'argv', ['./glider', *words])
        start = time.monotonic()
        assert cli.main() == 2
        assert time.monotonic() - start < 10.0
        printed = capsys.readouterr()
        assert printed.out == ''
        assert 'Traceback' not in printed.err
        assert 0 < len(printed.err) < 2000
        assert printed.err.replace('\n', '').isprintable()
        return printed.err

    return run


@pytest.mark.parametrize(
    ('text', 'word'),
    [
        ('profile.depth_m=2024-13-45', "profile.depth_m = '2024-13-45'"),
        ('seed=!!bool x', '--set seed=!!bool x'),
        ('seed=!!timestamp foo', '--set seed=!!timestamp foo'),
        ('seed=!!int ""', '--set seed=!!int'),
        ('seed=' + '[' * 3000, 'nested'),
        ('seed=' + '9' * 5000, 'a number of 5000 characters'),
        ('seed=' + '9' * 99, 'seed = (a number of about 100 digits)'),
        ('name=' + LONG, 'at most 100 characters'),
        ('description=' + 'x' * 5000, 'at most 2000 characters'),
        ('vehicle=' + LONG + '.yaml', 'File name too long'),
        ('=', 'expected path.to.field=value'),
        ('', 'expected path.to.field=value'),
        ('a..b=1', 'expected path.to.field=value'),
        ('seed=\udcff', 'in UTF-8'),
        ('seed="\\ud800"', 'not valid YAML'),
        ('description="\\e[31m"', 'control character'),
    ],
    ids=lambda value: ascii(value)[:30],
)
def test_set(refused, text, word):
    assert word in refused(*DIRECT, '--set', text)


@pytest.mark.parametrize(
    ('text', 'word'),
    [
        (BOMB, 'mission.yaml:6: not valid YAML: more than 200,000 values'),
        (
            'seed: 1\ndives: ' + '9' * 5000,
            'mission.yaml:2: not valid YAML: dives: a number of 5000',
        ),
        (
            'seed: 1\n\nwater: {depth: 5}\n',
            'mission.yaml:3 with dives=0, duration_s=0.5: water.depth = 5: unknown',
        ),
        ('description: "\\e[31mred"', 'control character'),
        ('description: \x1b[31mred', 'control character'),
        ('current: {components: [{kind: table, file: /dev/zero}]}', '/dev/zero: not a regular'),
        ('current: {components: [{kind: table, file: ' + LONG + '}]}', 'File name too long'),
        (
            'path: {kind: waypoints, waypoints: [' + 'x,' * 150_000 + ']}',
            'at most 10000 items',
        ),
        ('water: {' + ','.join(f'{"x" * 500}{i}: 1' for i in range(1000)) + '}', 'and 981 more'),
    ],
    ids=lambda value: ascii(value)[:30],
)
def test_scenario_file(tmp_path, monkeypatch, capsys, text, word):
    (tmp_path / 'mission.yaml').write_text(text, encoding='utf-8')
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, 'argv', ['./glider', *DIRECT, 'mission.yaml'])
    start = time.monotonic()
    assert cli.main() == 2
    assert time.monotonic() - start < 10.0
    told = capsys.readouterr().err
    assert word in told
    assert len(told) < 20_000
    assert told.replace('\n', '').isprintable()


def test_content_of_another_file_is_not_shown(refused, tmp_path):
    (tmp_path / 'secret').write_text('root:x:0:0:Super User:/root\n', encoding='utf-8')
    (tmp_path / 'mission.yaml').write_text(
        'current: {components: [{kind: table, file: secret}]}', encoding='utf-8'
    )
    told = refused(*DIRECT, 'mission.yaml')
    assert 'file secret: row 1: column depth_m is missing' in told
    assert 'root' not in told and 'Super' not in told


@pytest.mark.parametrize(
    'words',
    [
        (*DIRECT, LONG),
        (*DIRECT, LONG + '.yaml'),
        (*DIRECT, '--out', LONG),
        *((name, LONG) for name in ('score', 'report', 'figure', 'replay', 'verify', 'map')),
        ('sweep', LONG + '.yaml'),
        ('trim', LONG, '--net-heaviness-kg', '0.4'),
        ('compare', LONG, LONG),
        ('score', 'a\udcff'),
        ('score', '\x1b[31mred'),
        ('bench', '\u202ered'),
        ('\x1b[31mred',),
        ('run', '--engine', '\x1b[31mred'),
        ('run', 'x' * 20_000),
        ('run', '--namespace', 'a b'),
        ('run', '--namespace', 'a' * 60 + ' '),
        ('run', '--namespace', LONG),
    ],
    ids=lambda words: ascii(' '.join(words))[:40],
)
def test_word(refused, words):
    refused(*words)


def test_special_file_as_a_scenario(refused, tmp_path):
    os.mkfifo(tmp_path / 'fifo.yaml')
    assert 'fifo.yaml: not a regular file' in refused(*DIRECT, 'fifo.yaml')


@pytest.mark.parametrize('domain', ['x', '-1', '233', '1.5', '9' * 5000, '\u0663'])
def test_ros_domain(refused, monkeypatch, domain):
    monkeypatch.setenv('ROS_DOMAIN_ID', domain)
    assert 'no ROS domain (allowed: 0 to 232)' in refused('run', '--duration', '0.5')


@pytest.mark.parametrize('depth', [42, 100_000])
def test_score_that_is_nested_deeply(refused, tmp_path, depth):
    (tmp_path / 'score.json').write_text('[' * depth + ']' * depth, encoding='utf-8')
    assert 'score.json: not valid JSON: nested' in refused('score', '.')


# ------------------------------------------------------------------------------ as a process


def process(words: str, redirection: str = '') -> subprocess.CompletedProcess:
    """Finished command line, run by a shell."""
    return subprocess.run(
        ['bash', '-c', f'{sys.executable} -m glider_bringup.cli {words} {redirection}'],
        capture_output=True,
        text=True,
        timeout=300,
        check=False,
    )


@pytest.mark.parametrize(
    ('words', 'redirection', 'told'),
    [
        ('list --json', '>/dev/full', 'No space left on device'),
        ('list', '>&-', 'standard output is closed'),
    ],
)
def test_output_that_cannot_be_written(words, redirection, told):
    found = process(words, redirection)
    assert found.returncode == 1
    (line,) = found.stderr.splitlines()
    assert told in line


def test_reader_that_leaves_early():
    found = process('list --json', '| head -c 1; exit ${PIPESTATUS[0]}')
    assert (found.stdout, found.stderr) == ('{', '')


def test_too_few_files(tmp_path):
    limited = subprocess.run(
        ['bash', '-c', f'ulimit -n 14; {sys.executable} -m glider_bringup.cli run --duration 0.5'],
        capture_output=True,
        text=True,
        timeout=300,
        check=False,
        cwd=tmp_path,
    )
    assert limited.returncode == 1
    assert 'Traceback' not in limited.stderr
    assert 'Too many open files' in limited.stderr


def test_interrupt_while_loading():
    """Ctrl-C that comes as soon as anybody can hear it."""
    program = (
        'import os, runpy, signal; signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT}); '
        'os.kill(os.getpid(), signal.SIGINT); '
        'runpy.run_module("glider_bringup.cli", run_name="__main__")'
    )
    found = subprocess.run(
        [sys.executable, '-c', program], capture_output=True, text=True, timeout=300, check=False
    )
    assert (found.returncode, found.stderr) == (130, '')


@pytest.mark.parametrize('node', ['control_node', 'recorder_node', 'viewer_node', 'autopilot'])
def test_interrupt_of_a_node_that_still_imports(node, tmp_path):
    """Ctrl-C reaches all that `ros2 launch` has started: a node ends with 0, as in flight."""
    program = 'import signal\ntry:\n    signal.raise_signal(signal.SIGINT)\nexcept:\n    pass\n'
    (tmp_path / 'rclpy.py').write_text(program)
    package = 'glider_control' if node == 'control_node' else 'glider_bringup'
    found = subprocess.run(
        [sys.executable, '-m', f'{package}.nodes.{node}'],
        env={**os.environ, 'PYTHONPATH': f'{tmp_path}{os.pathsep}{os.environ["PYTHONPATH"]}'},
        capture_output=True,
        text=True,
        timeout=300,
        check=False,
    )
    assert (found.returncode, found.stdout, found.stderr) == (0, '', '')
