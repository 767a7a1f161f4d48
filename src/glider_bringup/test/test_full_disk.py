# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""A disk that takes no more is named, and what was there before stays."""

import errno
import json
import os
import resource
import subprocess
from functools import partial
from pathlib import Path

import pytest

import command_line
from glider_base.ros.wire.topics import TOPICS
from glider_base.settings import ConfigurationError
from glider_base.signals import TICK_NS
from glider_bringup.engines.recorded import fly_recorded
from glider_bringup.scoring.again import score_again
from glider_bringup.scoring.card import scorecard, write_score
from glider_bringup.scoring.score import Scorer, scores_of
from glider_mission.disk import DiskError, whole_file, write_whole
from glider_mission.recording.mcap_reader import Bag
from glider_mission.recording.ros.rosbag2 import CHUNK_TICKS, BagWriter
from glider_mission.run_folder import make_run_folder
from glider_mission.scenario import load_scenario

#: The largest file (B) that a disk which is full allows.
MOST = 500_000


def glider(*arguments, most: int = MOST) -> subprocess.CompletedProcess:
    """Run a command on a disk on which no file can grow beyond so much."""
    limit = partial(resource.setrlimit, resource.RLIMIT_FSIZE, (most, most))
    return command_line.glider(*arguments, preexec_fn=limit)


@pytest.mark.parametrize('code', [errno.ENOSPC, errno.EDQUOT, errno.EFBIG, errno.EIO])
@pytest.mark.parametrize('there', [False, True])
def test_file_is_whole_or_as_it_was(tmp_path, monkeypatch, code, there):
    file = tmp_path / 'score.json'
    if there:
        write_whole(file, 'old')

    def fail(number):
        raise OSError(code, os.strerror(code))

    monkeypatch.setattr(os, 'fsync', fail)
    with pytest.raises(DiskError) as error:
        write_whole(file, 'new')
    assert str(error.value) == f'{file}: cannot be written: {os.strerror(code)}'
    assert [one.read_text() for one in tmp_path.iterdir()] == ['old'] * there


def test_what_fails_in_between_leaves_nothing(tmp_path):
    with pytest.raises(KeyError), whole_file(tmp_path / 'x.npz') as stream:
        stream.write(b'a part')
        raise KeyError('x')
    assert list(tmp_path.iterdir()) == []


def test_name_that_cannot_be_is_no_matter_of_the_disk(tmp_path):
    for file in (tmp_path, tmp_path / 'no' / 'x', tmp_path / (300 * 'x')):
        with pytest.raises(ConfigurationError, match='cannot be written') as error:
            write_whole(file, 'new')
        assert not isinstance(error.value, DiskError)
    assert list(tmp_path.iterdir()) == []


def test_file_behind_a_link_is_written_and_the_link_stays(tmp_path):
    file, link = tmp_path / 'file', tmp_path / 'link'
    file.write_text('old')
    link.symlink_to(file)
    write_whole(link, 'new')
    assert link.is_symlink()
    assert file.read_text() == 'new'


@pytest.mark.parametrize('name', ['report', 'figure'])
def test_device_that_is_full_is_named_and_stays_a_device(tmp_path, name):
    scenario = load_scenario('current_8deg', {'dives': 0, 'duration_s': 10.0})
    folder = make_run_folder(scenario, tmp_path / 'flight')
    scorer = Scorer(scenario)
    flight = fly_recorded(scenario, folder, [scorer])
    write_score(folder, scorecard(scenario, 'direct', flight, scores_of(scenario, scorer)))
    done = glider(name, folder, '--out', '/dev/full')
    assert (done.returncode, done.stdout) == (1, '')
    assert done.stderr.split() == '/dev/full: cannot be written: No space left on device'.split()
    assert Path('/dev/full').is_char_device()


def test_sea_that_the_disk_does_not_take_leaves_nothing(tmp_path):
    file = tmp_path / 'sea.nc'
    done = glider('ocean', file, '--make', 3, most=100_000)
    assert (done.returncode, done.stdout) == (1, '')
    assert done.stderr.split() == f'{file}: cannot be written: File too large'.split()
    assert list(tmp_path.iterdir()) == []


def test_bag_is_readable_up_to_where_the_disk_was_full(tmp_path):
    done = glider(
        *('run', '--engine', 'direct', '--bag', '--duration', 600),
        *('--out', tmp_path / 'flight', '--no-report', '--json'),
    )
    assert done.returncode == 1, done.stderr
    (file,) = (tmp_path / 'flight').glob('*.mcap')
    card = json.loads(done.stdout)
    assert card['status'] == 'aborted'
    assert card['reason'] == f'{file}: cannot be written: File too large'
    assert f'aborted: {card["reason"]}' in done.stderr.splitlines()
    assert 'Traceback' not in done.stderr
    names = {one.name for one in file.parent.iterdir()}
    assert names == {file.name, 'scenario.yaml', 'vehicle.yaml', 'score.json'}
    card = score_again(file.parent)
    assert card['status'] == 'aborted'
    assert card['ticks'] >= CHUNK_TICKS
    assert card['ticks'] % CHUNK_TICKS == 0
    assert f'{file} ends early' in card['reason']


def test_recorder_whose_disk_is_full_ends_the_run_and_is_named(tmp_path):
    done = glider(
        *('run', 'rough_water', '--duration', 2000, '--out', tmp_path / 'flight'),
        *('--no-report', '--json'),
    )
    assert done.returncode == 1, done.stderr
    assert 'Traceback' not in done.stderr
    (file,) = (tmp_path / 'flight').glob('*.mcap')
    card = json.loads(done.stdout)
    assert card['status'] == 'aborted'
    assert card['reason'] == f'{file}: cannot be written: File too large'
    assert card['ticks'] >= CHUNK_TICKS
    assert card == json.loads((file.parent / 'score.json').read_text())
    assert score_again(file.parent)['ticks'] == card['ticks']
    assert file.stat().st_size <= MOST


def test_bag_goes_on_where_room_was_made(tmp_path):
    """What the disk did not take is kept, and written with the next chunk."""
    clock = TOPICS['/clock'].codec
    bag = BagWriter(tmp_path, 'run')
    limits = resource.getrlimit(resource.RLIMIT_FSIZE)

    def write(tick: int) -> bool:
        bag.write('/clock', tick * TICK_NS, clock.encode(tick * TICK_NS, ()))
        return bag.end_tick(tick * TICK_NS)

    for tick in range(CHUNK_TICKS - 1):
        assert not write(tick)
    resource.setrlimit(resource.RLIMIT_FSIZE, (bag._mcap._handed + 100, limits[1]))
    try:
        with pytest.raises(DiskError):
            write(CHUNK_TICKS - 1)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, limits)
    assert 'ends early' in Bag(tmp_path).cut
    write(CHUNK_TICKS)
    bag.close()
    again = Bag(tmp_path)
    assert not again.cut
    assert sum(len(batch.topic) for batch in again.batches()) == CHUNK_TICKS + 1
