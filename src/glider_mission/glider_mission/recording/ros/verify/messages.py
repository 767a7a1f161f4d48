# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""One message: the first field in which recorded bytes differ from what is computed."""

import struct

from rclpy.serialization import deserialize_message

from glider_base.ros.wire.codec import Codec, cdr_places, to_cdr
from glider_mission.recording.ros.verify.verdict import WHOLE, Difference


def field_difference(expected, recorded: bytes) -> tuple[str, str, str]:
    """First field in which recorded bytes differ from a message.

    Parameters
    ----------
    expected : message
    recorded : bytes
        Anything.

    Returns
    -------
    field, computed, recorded : str
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
