# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""Bags for tests, read and written with the mcap package."""

from pathlib import Path
from typing import NamedTuple

import pytest
from mcap.reader import make_reader
from mcap.writer import CompressionType, Writer

from glider_bringup.engines.recorded import fly_recorded
from glider_mission.run_folder import make_run_folder
from glider_mission.scenario import load_scenario


class Recorded(NamedTuple):
    """A message as the mcap package reads it."""

    topic: str
    log_ns: int
    data: bytes


def _read_bag(file: Path) -> list[Recorded]:
    """All messages in the order of their log times."""
    with file.open('rb') as stream:
        return [
            Recorded(channel.topic, message.log_time, message.data)
            for _, channel, message in make_reader(stream, validate_crcs=True).iter_messages()
        ]


def _write_bag(
    file: Path,
    like: Path,
    messages: list[Recorded],
    *,
    attachments: bool = True,
    compression: CompressionType = CompressionType.ZSTD,
    chunked: bool = True,
    rename=lambda topic: topic,
) -> None:
    """Write messages with the schemas, channels and attachments of another file."""
    with like.open('rb') as stream, file.open('wb') as out:
        reader = make_reader(stream)
        summary = reader.get_summary()
        writer = Writer(out, chunk_size=50_000, compression=compression, use_chunking=chunked)
        writer.start(profile='ros2')
        ids = {}
        used = {message.topic for message in messages}
        for channel in summary.channels.values():
            if channel.topic not in used:
                continue
            schema = summary.schemas[channel.schema_id]
            number = writer.register_schema(schema.name, schema.encoding, schema.data)
            ids[channel.topic] = writer.register_channel(
                rename(channel.topic), channel.message_encoding, number, channel.metadata
            )
        for attachment in reader.iter_attachments() if attachments else ():
            writer.add_attachment(0, 0, attachment.name, attachment.media_type, attachment.data)
        for message in messages:
            writer.add_message(ids[message.topic], message.log_ns, message.data, message.log_ns)
        writer.finish()


@pytest.fixture(scope='session')
def read_bag():
    """Function that reads an MCAP file."""
    return _read_bag


@pytest.fixture(scope='session')
def write_bag():
    """Function that writes one."""
    return _write_bag


@pytest.fixture(scope='session')
def short_run(tmp_path_factory) -> Path:
    """Folder of a direct run of two minutes in which everything happens, with a bag."""
    changes = {
        'dives': 0,
        'duration_s': 120.0,
        'profile.prepare_s': 20.0,
        'profile.depth_m': 14.0,
        'profile.top_depth_m': 5.0,
        'initial.depth_m': 8.0,
        'sensors.attitude_std_deg': 0.1,
    }
    scenario = load_scenario('rough_water', changes)
    folder = make_run_folder(scenario, tmp_path_factory.mktemp('short') / 'run')
    fly_recorded(scenario, folder)
    return folder
