# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""The ./glider script in terminals that have some ROS 2 or other, or only the name of one."""

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
WHEELS = Path(sys.prefix)
OWN_WHEELS = WHEELS == Path(os.environ.get('GLIDER_HOME') or ROOT) / '.venv'


def glider(distro, *prefixes, arguments=('list', '--json'), **variables):
    """Finished ./glider list --json, or another command, in a terminal with these variables."""
    return subprocess.run(
        [ROOT / 'glider', *arguments],
        capture_output=True,
        text=True,
        env={
            **os.environ,
            'ROS_DISTRO': distro,
            'AMENT_PREFIX_PATH': os.pathsep.join(map(str, prefixes)),
            **variables,
        },
        timeout=120,
        check=False,
    )


@pytest.mark.skipif(not OWN_WHEELS, reason='would set up an environment from wheels')
@pytest.mark.parametrize(
    ('distro', 'prefixes'),
    [('jazzy', [ROOT / 'install' / 'glider_model', WHEELS]), ('humble', [])],
)
def test_name_of_a_ros_without_one_is_told_and_the_wheels_are_used(distro, prefixes):
    """As after install/setup.bash in a shell whose start-up file exports ROS_DISTRO."""
    done = glider(distro, *prefixes)
    assert done.returncode == 0, done.stderr
    assert 'zhang2021' in json.loads(done.stdout)['vehicles']
    assert done.stderr.splitlines() == [
        f'glider: ROS_DISTRO is {distro}, but no ROS 2 is sourced here: using that of .venv'
    ]


def test_another_ros_that_is_sourced_is_refused(tmp_path):
    package = tmp_path / 'share' / 'rclpy' / 'package.xml'
    package.parent.mkdir(parents=True)
    package.touch()
    done = glider('humble', WHEELS, tmp_path)
    assert done.returncode == 2
    assert done.stdout == ''
    (line,) = done.stderr.splitlines()
    assert 'ROS 2 humble is sourced' in line and 'jazzy' in line


@pytest.mark.skipif(not OWN_WHEELS, reason='would set up an environment from wheels')
@pytest.mark.parametrize(
    ('arguments', 'said'),
    [
        (
            ['test', '--only', 'weather'],
            'test --only weather: no such tests (allowed: fast, fuzz, mutants, soak)',
        ),
        (['test', '--only'], 'test --only : no such tests (allowed: fast, fuzz, mutants, soak)'),
        (['soak'], 'soak: no command any more (allowed: ./glider test --only soak)'),
    ],
)
def test_tests_that_count_are_found_by_name(arguments, said):
    done = glider('', arguments=arguments)
    assert (done.returncode, done.stdout) == (2, '')
    assert done.stderr.splitlines()[-1] == f'glider: {said}'


@pytest.mark.skipif(not OWN_WHEELS, reason='would set up an environment from wheels')
def test_modules_are_read_once_where_no_bytecode_is_wanted_beside_them():
    """As in most container images: what a start imports is compiled once."""
    program = 'import sys, typer; print(sys.modules["typer"].__cached__)'
    kept = {'PYTHONDONTWRITEBYTECODE': '1', 'PYTHONPYCACHEPREFIX': ''}
    done = glider('', arguments=('python', '-c', program), **kept)
    assert done.returncode == 0, done.stderr
    compiled = Path(done.stdout.strip())
    assert compiled.is_file() and '__pycache__' not in compiled.parts
    assert compiled.is_relative_to(WHEELS / 'pycache')
