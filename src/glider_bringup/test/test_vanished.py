# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""A recording that is deleted or renamed in flight is told at once, and the run has failed."""

import json
import os
import shutil
import time
from pathlib import Path

import pytest

from command_line import Started

DEADLINE_S = 300.0
FLOWN_BYTES = 100_000  #: of recording: several chunks are on disk
#: Simulated time (s) of a flight that nobody waits for to its end: of rows, a direct one has more
#: in a second than nodes in ten minutes.
LONG_S = {'nodes': 100_000, 'direct': 1_000_000}


def rename(folder: Path) -> None:
    folder.rename(folder.with_name('elsewhere'))


def delete_bag(folder: Path) -> None:
    (file,) = folder.glob('*.mcap')
    file.unlink()


def exchange_bag(folder: Path) -> None:
    """As an editor or a copy would: another file of the same name."""
    (file,) = folder.glob('*.mcap')
    shutil.copy(file, file.with_suffix('.copy'))
    file.with_suffix('.copy').replace(file)


@pytest.mark.parametrize(
    ('engine', 'happens'),
    [
        ('nodes', delete_bag),
        ('direct', rename),
        ('direct', shutil.rmtree),
        ('direct', exchange_bag),
    ],
)
def test_recording_that_vanishes_is_told_when_it_does(tmp_path, engine, happens):
    folder = tmp_path / 'run'
    words = (
        *('run', 'current_8deg', '--json', '--no-report', '--engine', engine, '--bag'),
        *('--out', folder, '--duration', LONG_S[engine]),
    )
    env = {name: value for name, value in os.environ.items() if name != 'ROS_DOMAIN_ID'}
    run = Started(words, env, tmp_path)
    try:
        end = time.monotonic() + DEADLINE_S
        while not any(file.stat().st_size > FLOWN_BYTES for file in folder.glob('*.mcap')):
            assert run.poll() is None, run.communicate()
            assert time.monotonic() < end
            time.sleep(0.02)
        happens(folder)
        out, err = run.communicate(timeout=DEADLINE_S)
    finally:
        run.kill()
    assert run.returncode == 1, err
    assert 'Traceback' not in err
    card = json.loads(out)
    assert card['status'] == 'failed'
    assert 'the recording vanished' in card['reason'] and str(folder) in card['reason']
    assert card['sim_time_s'] < 0.9 * LONG_S[engine]
