# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""Files of a Slocum for tests."""

import struct
from pathlib import Path

import numpy as np
import pytest

#: A file of a Slocum begins a second before this (s since 1970).
_DBD_START_S = 1.6e9


def _write_dbd(
    file: Path,
    table: dict[str, tuple[np.ndarray, np.ndarray]],
    cached: bool,
    written: str = 'unit-2026-001-0-0',
    cache_name: str = 'AB12CD34',
) -> None:
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
        'full_filename': written,
        'filename_extension': 'dbd',
        'mission_name': 'test.mi',
        'fileopen_time': 'Sun_Sep_13_12:26:40_2020',
        'total_num_sensors': len(names),
        'sensors_per_cycle': len(names),
        'state_bytes_per_cycle': state_bytes,
        'sensor_list_crc': cache_name,
        'sensor_list_factored': int(cached),
    }
    text = ''.join(f'{name}:    {value}\n' for name, value in header.items())
    if cached:
        cache = file.parent / 'cache'
        cache.mkdir(exist_ok=True)
        (cache / f'{cache_name}.CAC').write_text(listed)
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


@pytest.fixture(scope='session')
def write_dbd():
    """Function that writes a file of a Slocum."""
    return _write_dbd
