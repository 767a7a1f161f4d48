# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""The command line as a person uses it: processes of its own, and two flights that tests share."""

import json
import os
from functools import partial
from pathlib import Path
from typing import NamedTuple

import pytest

import command_line

#: The flight that tests share: every kind of current, and a descent to 60 m.
SCENARIO, DURATION_S = 'rough_water', 400


class Recorded(NamedTuple):
    """A flight that is over."""

    folder: Path
    card: dict  #: what --json printed


def _environment() -> dict[str, str]:
    """Environment of a run: a ROS domain of its own, which the runner chooses."""
    return {name: value for name, value in os.environ.items() if name != 'ROS_DOMAIN_ID'}


@pytest.fixture(scope='session')
def glider():
    """Run a command to its end; gives the completed process."""
    return partial(command_line.glider, columns=80)


@pytest.fixture
def start_glider(tmp_path):
    """Start a command; gives the process, whose output lies in files of tmp_path."""
    processes = []

    def start(*arguments) -> command_line.Started:
        processes.append(command_line.Started(arguments, _environment(), tmp_path))
        return processes[-1]

    yield start
    for process in processes:
        process.kill()


def _fly(glider, folder: Path, *options) -> Recorded:
    done = glider('run', SCENARIO, '--duration', DURATION_S, '--out', folder, '--json', *options)
    assert done.returncode == 0, done.stderr
    return Recorded(folder, json.loads(done.stdout))


@pytest.fixture(scope='session')
def over_nodes(glider, tmp_path_factory) -> Recorded:
    """The shared flight, over ROS 2 topics."""
    return _fly(glider, tmp_path_factory.mktemp('flight') / 'nodes', '--engine', 'nodes')


@pytest.fixture(scope='session')
def direct(glider, tmp_path_factory) -> Recorded:
    """The shared flight, by the direct engine, which writes the same bag."""
    return _fly(
        *(glider, tmp_path_factory.mktemp('flight') / 'direct'),
        *('--engine', 'direct', '--bag', '--no-report'),
    )
