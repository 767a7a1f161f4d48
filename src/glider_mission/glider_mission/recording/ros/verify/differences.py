# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""What verification says: where recorded bytes differ, and a verdict for each block."""

import struct
from collections.abc import Mapping, Sequence
from typing import NamedTuple

from rclpy.serialization import deserialize_message

from glider_base.ros.wire.codec import Codec, cdr_places, to_cdr
from glider_base.signals import TICK_NS

IDENTICAL, DIFFERENT, SKIPPED = 'identical', 'different', 'skipped'

#: What stands where there is no field, and no message.
NOT_RECORDED, WHOLE = 'not recorded', '(message)'


class Difference(NamedTuple):
    """Where a recording and today's code differ."""

    stamp_ns: int
    topic: str
    field: str
    computed: str
    recorded: str

    @property
    def tick(self) -> int:
        """Number of the tick; of a vehicle's own clock, that many tenths of a second."""
        return self.stamp_ns // TICK_NS


class Verdict(NamedTuple):
    """What came out for one block."""

    block: str
    result: str  #: IDENTICAL, DIFFERENT or SKIPPED
    reason: str = ''  #: why it was skipped
    ticks: int = 0  #: that were computed
    compared: Mapping[str, int] = {}  #: messages by topic
    differing: Mapping[str, int] = {}  #: those of them that differ, by topic
    first: Difference | None = None
    notes: Sequence[str] = ()


def field_difference(expected, recorded: bytes) -> tuple[str, str, str]:
    """First field in which any bytes differ from a message, and what is computed and recorded.

    With the bits where two numbers print alike.
    """
    raw = to_cdr(expected)
    shared = min(len(raw), len(recorded))
    at = next((i for i in range(shared) if raw[i] != recorded[i]), shared)
    if at < 4:
        return 'CDR header', raw[:4].hex(), recorded[:4].hex()
    if at >= len(raw):
        return WHOLE, f'{len(raw)} bytes', f'{len(recorded)} bytes'
    before = 'CDR header'
    for place in cdr_places(expected):
        if at < place.start:
            break
        before = place.path
        if at < place.end:
            return place.path, *_values(place, raw, recorded)
    return f'padding after {before}', f'byte {raw[at]:#04x}', f'byte {recorded[at]:#04x}'


def _values(place, raw: bytes, recorded: bytes) -> tuple[str, str]:
    texts = [_value(place, data) for data in (raw, recorded)]
    if texts[0] == texts[1]:
        bits = [data[place.start : place.end][::-1].hex() for data in (raw, recorded)]
        texts = [f'{text} (0x{bit})' for text, bit in zip(texts, bits, strict=True)]
    return texts[0], texts[1]


def _value(place, data: bytes) -> str:
    """Value of a field in bytes that may end before it."""
    if len(data) < place.start + (4 if place.code == 's' else place.end - place.start):
        return 'cut off'
    if place.code != 's':
        return str(struct.unpack_from('<' + place.code, data, place.start)[0])
    (length,) = struct.unpack_from('<I', data, place.start)
    text = data[place.start + 4 : place.start + 4 + length]
    if len(text) < length:
        return f'a string of {length} bytes'
    return repr(text[:-1].decode(errors='backslashreplace') if text[-1:] == b'\0' else text)


def message_difference(
    topic: str, codec: Codec, stamp_ns: int, values, recorded: bytes
) -> Difference:
    """Where a recorded message differs from the numbers that are computed."""
    expected = deserialize_message(codec.encode(stamp_ns, values), codec.message_type)
    return Difference(stamp_ns, topic, *field_difference(expected, recorded))
