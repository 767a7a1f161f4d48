# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""A recording whose end is missing is made whole, by one command, and what is missing is said."""

import json
import os
import random
import resource
import shutil
from functools import partial
from pathlib import Path

import pytest
from mcap.reader import make_reader
from mcap.writer import CompressionType
from rosbags.highlevel import AnyReader
from rosbags.rosbag2 import CompressionFormat, CompressionMode, StoragePlugin, Writer
from typer.testing import CliRunner

from command_line import glider
from glider_base.settings import ConfigurationError
from glider_base.signals import TICK_NS
from glider_bringup.cli import app
from glider_bringup.engines.recorded import fly_recorded
from glider_bringup.scoring.again import score_again
from glider_mission.recording.mcap_reader import Bag
from glider_mission.recording.mcap_writer import McapWriter
from glider_mission.recording.recover import recover
from glider_mission.recording.ros.rosbag2 import CHUNK_TICKS
from glider_mission.run_folder import make_run_folder
from glider_mission.scenario import load_scenario


def file_of(folder: Path) -> Path:
    (file,) = folder.glob('*.mcap')
    return file


def chunks_of(file: Path) -> list:
    with file.open('rb') as stream:
        return make_reader(stream).get_summary().chunk_indexes


def rewrite(bag: Path, folder: Path, storage: StoragePlugin) -> None:
    """Write the first second of a bag with rosbags; in MCAP each message is compressed."""
    with AnyReader([bag]) as reader:
        writer = Writer(folder, version=9, storage_plugin=storage)
        if storage == StoragePlugin.MCAP:
            writer.set_compression(CompressionMode.MESSAGE, CompressionFormat.ZSTD)
        with writer:
            into = {
                one.id: writer.add_connection(one.topic, one.msgtype, typestore=reader.typestore)
                for one in reader.connections
            }
            for connection, stamp_ns, raw in reader.messages(stop=1_000_000_000):
                writer.write(into[connection.id], stamp_ns, raw)


@pytest.fixture
def cut_run(short_run, tmp_path):
    """Copy the short run, cut its file and take its metadata.yaml away; gives the folder."""

    def cut(length: int) -> Path:
        folder = tmp_path / 'cut'
        shutil.copytree(short_run, folder)
        os.truncate(file_of(folder), length)
        (folder / 'metadata.yaml').unlink()
        return folder

    return cut


def run(*arguments) -> dict:
    done = CliRunner().invoke(app, [*map(str, arguments), '--json'])
    assert done.exit_code == 0, (done.output, done.exception)
    return json.loads(done.stdout)


@pytest.mark.parametrize('whole_chunks', [1, 6])
def test_cut_run_is_whole_again_and_every_command_reads_it(short_run, cut_run, whole_chunks):
    next_chunk = chunks_of(file_of(short_run))[whole_chunks]
    folder = cut_run(next_chunk.chunk_start_offset + random.randrange(30, next_chunk.chunk_length))
    found = run('recover', folder)
    ticks = whole_chunks * CHUNK_TICKS
    file = file_of(folder)
    assert (found['state'], found['rebuilt']) == ('recovered', [file.name, 'metadata.yaml'])
    assert (found['ticks'], found['acknowledged_tick']) == (ticks, ticks - 1)
    assert (found['ticks_planned'], found['lacking']) == (1200, {})
    (dropped,) = found['dropped']
    assert f't = {ticks * 0.1:.1f} s to ' in dropped
    assert found['dropped_bytes'] > 0
    assert {path.name for path in folder.iterdir()} == {path.name for path in short_run.iterdir()}

    card = run('score', folder)
    assert (card['status'], card['ticks'], card['messages_lost']) == ('aborted', ticks, 0)
    report = run('verify', folder)
    assert report['identical']
    assert {one['ticks'] for one in report['blocks']} == {ticks}
    replayed = run('replay', folder, '--rate', 'max')
    assert sum(replayed['counts'].values()) == found['messages']
    done = CliRunner().invoke(app, ['report', str(folder)])
    assert done.exit_code == 0, done.output
    with AnyReader([folder]) as reader:
        read = [connection.topic for connection, _, _ in reader.messages()]
        assert reader.message_count == len(read) == found['messages']
    assert {name: read.count(name) for name in found['topics']} == found['topics']

    again = run('recover', folder)
    assert (again['state'], again['rebuilt'], again['ticks']) == ('whole', [], ticks)


def test_recovered_file_is_what_the_recorder_would_have_left(short_run, tmp_path):
    """Byte by byte, and metadata.yaml with it."""
    ticks = 3 * CHUNK_TICKS
    fields = {'duration_s': ticks / 10.0}
    scenario = load_scenario(str(short_run / 'scenario.yaml'), fields)
    folder = make_run_folder(scenario, tmp_path / 'stopped')
    fly_recorded(scenario, folder)
    whole = file_of(folder).read_bytes()
    metadata = (folder / 'metadata.yaml').read_bytes()
    with file_of(folder).open('rb') as stream:
        summary = make_reader(stream).get_summary()
    last, (metadata_index,) = summary.chunk_indexes[-1], summary.metadata_indexes
    behind = last.chunk_start_offset + last.chunk_length  # its index comes next
    places = (behind, behind + 5, metadata_index.offset, metadata_index.offset + 10)
    for length in (*places, len(whole) - 1):
        file_of(folder).write_bytes(whole[:length])
        (folder / 'metadata.yaml').unlink()
        assert recover(folder)['rebuilt'] == [file_of(folder).name, 'metadata.yaml']
        assert file_of(folder).read_bytes() == whole
        assert (folder / 'metadata.yaml').read_bytes() == metadata


def test_whole_bag_is_left_as_it_is(short_run, tmp_path):
    folder = tmp_path / 'whole'
    shutil.copytree(short_run, folder)
    before = {path.name: (path.read_bytes(), path.stat().st_ino) for path in folder.iterdir()}
    assert run('recover', folder)['state'] == 'whole'
    assert run('recover', file_of(folder))['state'] == 'whole'
    assert before == {p.name: (p.read_bytes(), p.stat().st_ino) for p in folder.iterdir()}


@pytest.mark.parametrize('text', [None, '', 'rosbag2_bagfile_information: {'])
def test_metadata_alone_is_made_anew(short_run, tmp_path, text):
    folder = tmp_path / 'run'
    shutil.copytree(short_run, folder)
    (folder / 'metadata.yaml').unlink()
    if text is not None:
        (folder / 'metadata.yaml').write_text(text)
    assert recover(folder)['rebuilt'] == ['metadata.yaml']
    for name in ('metadata.yaml', file_of(folder).name):
        assert (folder / name).read_bytes() == (short_run / name).read_bytes()


@pytest.mark.parametrize('kind', ['compressed messages', 'sqlite3', 'a file is missing'])
def test_metadata_that_tells_more_than_the_files_is_kept(short_run, tmp_path, kind):
    """Without it nobody knows that messages are compressed, or that a file belongs to the bag."""
    folder = tmp_path / 'run'
    if kind == 'a file is missing':
        shutil.copytree(short_run, folder)
        metadata = folder / 'metadata.yaml'
        metadata.write_text(metadata.read_text().replace('_0.mcap', '_1.mcap'))
    else:
        is_sql = kind == 'sqlite3'
        rewrite(short_run, folder, StoragePlugin.SQLITE3 if is_sql else StoragePlugin.MCAP)
    before = {path.name: path.read_bytes() for path in folder.iterdir()}
    words = {'sqlite3': 'storage sqlite3', 'compressed messages': 'compressed with zstd'}
    used = ['recover'] if kind == 'a file is missing' else ['recover', 'score', 'report']
    for command in used:
        done = CliRunner().invoke(app, [command, str(folder)])
        assert isinstance(done.exception, ConfigurationError)
        assert words.get(kind, 'missing; ') in str(done.exception)
    assert before == {path.name: path.read_bytes() for path in folder.iterdir()}


def test_compressed_messages_without_metadata_are_no_run_of_nothing(short_run, tmp_path):
    rewrite(short_run, tmp_path / 'bag', StoragePlugin.MCAP)
    for name in ('scenario.yaml', 'vehicle.yaml'):
        shutil.copy(short_run / name, tmp_path / 'bag')
    (tmp_path / 'bag' / 'metadata.yaml').unlink()
    with pytest.raises(ConfigurationError, match=r'bag: cannot be scored: tick 0 .* lacks '):
        score_again(tmp_path / 'bag')


def test_part_that_the_disk_never_got_is_told(short_run, cut_run):
    """After a loss of power a file can have its length, but not its content."""
    chunks = chunks_of(file_of(short_run))
    folder = cut_run(chunks[6].chunk_start_offset + 100)
    with file_of(folder).open('r+b') as stream:
        stream.seek(chunks[4].chunk_start_offset + chunks[4].chunk_length // 2)
        stream.write(bytes(chunks[4].chunk_length // 3))
    with pytest.raises(ConfigurationError, match='chunk 5 is damaged'):
        Bag(folder)
    found = run('recover', folder)
    assert len(found['dropped']) == 2
    assert 't = 51.2 s to 63.9 s' in found['dropped'][0]
    assert found['ticks'] == 4 * CHUNK_TICKS
    assert found['topics']['/glider/odom'] == 5 * CHUNK_TICKS
    assert score_again(folder)['ticks'] == 4 * CHUNK_TICKS


@pytest.mark.parametrize('chunked', [True, False])
def test_cut_bag_of_another_writer(short_run, read_bag, write_bag, tmp_path, chunked):
    (tmp_path / 'theirs').mkdir()
    file = tmp_path / 'theirs' / 'theirs_0.mcap'
    like = file_of(short_run)
    messages = read_bag(like)
    write_bag(file, like, messages, chunked=chunked, compression=CompressionType.LZ4)
    os.truncate(file, file.stat().st_size // 2)
    found = run('recover', tmp_path / 'theirs')
    assert 0 < found['messages'] < len(messages)
    assert read_bag(file) == messages[: found['messages']]
    with AnyReader([tmp_path / 'theirs']) as reader:
        assert reader.message_count == found['messages']


def test_a_recording_that_is_still_being_written_is_left_alone(tmp_path):
    """It took the place of the file, and all that its recorder still wrote was lost."""
    file = tmp_path / 'run_0.mcap'
    writer = McapWriter(file, 'ros2')
    writer.flush()
    before = file.read_bytes()
    with pytest.raises(ConfigurationError, match='run_0.mcap: is still being written'):
        recover(tmp_path)
    assert file.read_bytes() == before
    writer.close()
    assert recover(tmp_path)['rebuilt'] == ['metadata.yaml']


@pytest.mark.parametrize('length', [0, 5, 8, 12])
def test_nothing_left_is_refused_and_stays(cut_run, length):
    folder = cut_run(length)
    before = file_of(folder).read_bytes()
    done = CliRunner().invoke(app, ['recover', str(folder)])
    assert isinstance(done.exception, ConfigurationError)
    assert str(file_of(folder)) in str(done.exception)
    assert file_of(folder).read_bytes() == before
    assert not [path for path in folder.iterdir() if path.name.startswith('.part')]


def test_bag_that_was_cut_before_its_first_topic_is_one_of_no_topics(cut_run):
    folder = cut_run(200)
    assert recover(folder)['topics'] == {}
    with AnyReader([folder]) as reader:
        assert reader.connections == []


def test_damaged_bag_that_is_not_cut_is_refused(short_run, tmp_path):
    file = tmp_path / file_of(short_run).name
    data = bytearray(file_of(short_run).read_bytes())
    data[chunks_of(file_of(short_run))[2].chunk_start_offset + 200] ^= 1
    file.write_bytes(data)
    with pytest.raises(ConfigurationError, match='chunk 3 is damaged'):
        recover(file)
    assert file.read_bytes() == data


def test_full_disk_is_named_and_the_file_stays(short_run, cut_run):
    size = file_of(short_run).stat().st_size
    folder = cut_run(size - 100)
    before = {path.name: path.read_bytes() for path in folder.iterdir()}
    limit = partial(resource.setrlimit, resource.RLIMIT_FSIZE, (size // 2, size // 2))
    done = glider('recover', folder, preexec_fn=limit)
    assert (done.returncode, done.stdout) == (1, '')
    assert 'File too large' in done.stderr
    assert 'Traceback' not in done.stderr
    assert before == {path.name: path.read_bytes() for path in folder.iterdir()}


def test_power_that_goes_while_it_recovers_costs_nothing(cut_run, short_run, monkeypatch):
    folder = cut_run(file_of(short_run).stat().st_size - 100)
    before = file_of(folder).read_bytes()

    def fail(*arguments):
        raise KeyboardInterrupt

    with monkeypatch.context() as patch:
        patch.setattr(os, 'replace', fail)
        with pytest.raises(KeyboardInterrupt):
            recover(folder)
    assert file_of(folder).read_bytes() == before
    assert recover(folder)['topics']['/glider/odom'] == 1200
    assert Bag(folder).end_ns == 1199 * TICK_NS
