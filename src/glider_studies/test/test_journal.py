# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""The journal of a sweep: whatever is cut off it, damaged in it or asked of it."""

import os
import signal
import subprocess
import sys

import pytest

from glider_base.settings import ConfigurationError
from glider_studies.sweep.journal import Journal

HEAD = {'sweep': 'one', 'cells': 3, 'code': 'c0de', 'inputs': 'd1ge57'}
RECORDS = [
    {'cell': 2, 'status': 'completed', 'reason': '', 'figures': {'x': 0.1, 'y': None}},
    {'cell': 0, 'status': 'failed', 'reason': 'käputt\n[/red]', 'figures': {}},
    {'cell': 1, 'status': 'completed', 'reason': '', 'figures': {'x': [1e-300, -0.0, 5e22]}},
]


def write(path, records=RECORDS):
    with Journal(path, HEAD, resume=False) as journal:
        journal.append(records)
    return path.read_bytes()


def read(path, head=HEAD):
    with Journal(path, head, resume=True) as journal:
        return list(journal.records())


def test_records_come_back_to_the_last_bit(tmp_path):
    write(tmp_path / 'journal')
    assert read(tmp_path / 'journal') == RECORDS
    assert str(read(tmp_path / 'journal')) == str(RECORDS), 'the sign of zero too'


def test_killed_at_any_byte_only_the_line_in_the_making_is_lost(tmp_path):
    path = tmp_path / 'journal'
    whole = write(path)
    ends = [i + 1 for i, byte in enumerate(whole) if byte == ord('\n')]
    for length in range(len(whole) + 1):
        path.write_bytes(whole[:length])
        kept = max(0, sum(end <= length for end in ends) - 1)
        with Journal(path, HEAD, resume=True) as journal:
            assert list(journal.records()) == RECORDS[:kept]
            journal.append(RECORDS[kept:])
        assert path.read_bytes() == whole


def test_tail_of_zeros_as_after_a_power_cut_is_dropped(tmp_path):
    path = tmp_path / 'journal'
    whole = write(path)
    for tail in (b'\0' * 5000, b'\xff\xfe', b'[1]\n', b'12\n'):
        path.write_bytes(whole + tail)
        assert read(path) == RECORDS
        assert path.read_bytes() == whole


@pytest.mark.parametrize('damage', [b'', b'{"a":' * 100_000 + b'\n', b'9' * 5000 + b'\n'], ids=len)
def test_damage_before_the_last_line_is_refused_and_nothing_is_changed(tmp_path, damage):
    path = tmp_path / 'journal'
    first, second, *rest = write(path).splitlines(keepends=True)
    damaged = b''.join([first, damage or second[:10], *rest])
    path.write_bytes(damaged)
    with pytest.raises(ConfigurationError, match='line 2 is damaged'):
        read(path)
    assert path.read_bytes() == damaged


@pytest.mark.parametrize('field', HEAD)
def test_journal_of_another_sweep_is_refused(tmp_path, field):
    before = write(tmp_path / 'journal')
    with pytest.raises(ConfigurationError, match=f'different {field}'):
        read(tmp_path / 'journal', {**HEAD, field: 'other'})
    assert (tmp_path / 'journal').read_bytes() == before


def test_journal_is_not_begun_twice(tmp_path):
    before = write(tmp_path / 'journal')
    with pytest.raises(ConfigurationError, match='--resume'):
        Journal(tmp_path / 'journal', HEAD, resume=False)
    assert (tmp_path / 'journal').read_bytes() == before


def test_there_is_nothing_to_resume(tmp_path):
    with pytest.raises(ConfigurationError, match='there is no'):
        Journal(tmp_path / 'journal', HEAD, resume=True)
    assert not (tmp_path / 'journal').exists()


def test_two_sweeps_do_not_write_into_one_journal(tmp_path):
    with Journal(tmp_path / 'journal', HEAD, resume=False) as journal:
        journal.append(RECORDS[:1])
        with pytest.raises(ConfigurationError, match='another sweep is at work'):
            Journal(tmp_path / 'journal', HEAD, resume=True)
        journal.append(RECORDS[1:])
    assert read(tmp_path / 'journal') == RECORDS


FULL_DISK = """
import resource, sys
from glider_studies.sweep.journal import Journal
from glider_base.settings import ConfigurationError
resource.setrlimit(resource.RLIMIT_FSIZE, (1000, 1000))
with Journal(__import__('pathlib').Path(sys.argv[1]), {'sweep': 'one'}, False) as journal:
    try:
        for cell in range(100):
            journal.append([{'cell': cell, 'text': 'x' * 77}])
    except ConfigurationError as error:
        print(cell, error)
"""


def test_disk_that_is_full_costs_nothing_that_was_written(tmp_path):
    """A limit on the size of files does what a full disk does: half a line is written."""
    path = tmp_path / 'journal'
    done = subprocess.run(
        [sys.executable, '-c', FULL_DISK, path],
        capture_output=True,
        text=True,
        timeout=120.0,
        check=True,
        preexec_fn=lambda: signal.signal(signal.SIGXFSZ, signal.SIG_IGN),
    )
    cell, _, message = done.stdout.partition(' ')
    assert str(path) in message and '--resume' in message
    assert os.path.getsize(path) == 1000
    with Journal(path, {'sweep': 'one'}, resume=True) as journal:
        assert [record['cell'] for record in journal.records()] == list(range(int(cell)))
