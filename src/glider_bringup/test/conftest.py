# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""Bags for tests, read and written with the mcap package, and files of a Slocum."""

import signal
import struct
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pytest
import rclpy
from mcap.reader import make_reader
from mcap.writer import CompressionType, Writer
from rclpy.context import Context

from glider_bringup.engines.recorded import fly_recorded
from glider_bringup.mission.run_folder import make_run_folder
from glider_bringup.mission.scenario import load_scenario
from glider_model.ros.places import domain_id

#: A file of a Slocum begins a second before this (s since 1970).
_DBD_START_S = 1.6e9


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
                channel.topic, channel.message_encoding, number, channel.metadata
            )
        for attachment in reader.iter_attachments() if attachments else ():
            writer.add_attachment(0, 0, attachment.name, attachment.media_type, attachment.data)
        for message in messages:
            writer.add_message(ids[message.topic], message.log_ns, message.data, message.log_ns)
        writer.finish()


def _write_dbd(file: Path, table: dict[str, tuple[np.ndarray, np.ndarray]], cached: bool) -> None:
    """Write a dbd file of 2020; its cache goes beside it, in capitals as some tools do."""
    names = ['m_present_time', *table]
    listed = ''.join(f's: T {n:4d} {n:4d} 8 {name} nodim\n' for n, name in enumerate(names))
    state_bytes = (len(names) + 3) // 4
    header = {
        'dbd_label': 'DBD(dinkum_binary_data)file',
        'encoding_ver': 5,
        'num_ascii_tags': 14,
        'all_sensors': 'F',
        'the8x3_filename': '00010000',
        'full_filename': 'unit-2026-001-0-0',
        'filename_extension': 'dbd',
        'mission_name': 'test.mi',
        'fileopen_time': 'Sun_Sep_13_12:26:40_2020',
        'total_num_sensors': len(names),
        'sensors_per_cycle': len(names),
        'state_bytes_per_cycle': state_bytes,
        'sensor_list_crc': 'AB12CD34',
        'sensor_list_factored': int(cached),
    }
    text = ''.join(f'{name}:    {value}\n' for name, value in header.items())
    if cached:
        cache = file.parent / 'cache'
        cache.mkdir(exist_ok=True)
        (cache / 'AB12CD34.CAC').write_text(listed)
    data = [(text if cached else text + listed).encode(), b'sa']
    data += [struct.pack('<Hfd', 0x1234, 123.456, 123456789.12345678), b'd']
    cycles: dict[float, dict[str, float]] = {_DBD_START_S - 1.0: {}}
    for name, (times, values) in table.items():
        for time_s, value in zip(times, values, strict=True):
            cycles.setdefault(float(time_s), {})[name] = float(value)
    for time_s in sorted(cycles):
        row = {'m_present_time': time_s, **cycles[time_s]}
        bits = 0
        for name in names:
            bits = bits << 2 | (2 if name in row else 0)
        bits <<= 2 * (4 * state_bytes - len(names))
        data.append(bits.to_bytes(state_bytes, 'big'))
        data += [struct.pack('<d', row[name]) for name in names if name in row]
        data.append(b'd')
    file.write_bytes(b''.join(data)[:-1] + b'X')


@pytest.fixture
def context(monkeypatch):
    """Context of rclpy in a ROS domain of its own; handlers of signals stay as they were."""
    monkeypatch.delenv('ROS_DOMAIN_ID', raising=False)
    monkeypatch.setenv('ROS_AUTOMATIC_DISCOVERY_RANGE', 'LOCALHOST')
    before = {number: signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM)}
    context = Context()
    with domain_id() as domain:
        rclpy.init(context=context, domain_id=domain)
        yield context
        rclpy.try_shutdown(context=context)
    for number, handler in before.items():
        signal.signal(number, handler)


@pytest.fixture(scope='session')
def write_dbd():
    """Function that writes a file of a Slocum."""
    return _write_dbd


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
