# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""The messages of a chunk, found by compiled code."""

from typing import NamedTuple

import numpy as np

from glider_base.kernel import kernel


@kernel
def number_at(data, at, size):
    """Little-endian number of ``size`` bytes."""
    value = np.int64(0)
    for i in range(size):
        value |= np.int64(data[at + i]) << (8 * i)
    return value


@kernel
def scan(data, channel, log_ns, start, size, other):
    """Find the messages of a chunk, and the places of its other records.

    Returns
    -------
    int
        Number of messages; -1 if a record is longer than what is left.
    int
        Number of other records.
    """
    messages = others = at = 0
    while at < len(data):
        if at + 9 > len(data):
            return -1, others
        opcode, length = data[at], number_at(data, at + 1, 8)
        body = at + 9
        if length < 0 or length > len(data) - body or (opcode == 5 and length < 22):
            return -1, others
        if opcode == 5:
            channel[messages] = number_at(data, body, 2)
            log_ns[messages] = number_at(data, body + 6, 8)
            start[messages] = body + 22
            size[messages] = length - 22
            messages += 1
        else:
            other[others] = at
            others += 1
        at = body + length
    return messages, others


@kernel
def gather(data, start, rows):
    """Fill each row with what begins at its start."""
    for i in range(rows.shape[0]):
        rows[i] = data[start[i] : start[i] + rows.shape[1]]


class Places(NamedTuple):
    """Where the records of a chunk are; int64 arrays."""

    channel: np.ndarray  #: of each message
    log_ns: np.ndarray  #: its log time
    start: np.ndarray  #: where its payload begins
    size: np.ndarray  #: of its payload
    others: np.ndarray  #: where each of the other records begins


def find(data: np.ndarray) -> Places:
    """Records of a chunk, uint8[n].

    Raises
    ------
    ValueError
        If a record is longer than what is left.
    """
    channel, log_ns, start, size, other = np.empty((5, len(data) // 9 + 1), np.int64)
    messages, others = scan(data, channel, log_ns, start, size, other)
    if messages < 0:
        raise ValueError('a record is longer than the chunk')
    found = (array[:messages] for array in (channel, log_ns, start, size))
    return Places(*found, other[:others])
