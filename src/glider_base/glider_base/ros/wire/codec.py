# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""Messages as flat tuples of floats, without building message objects.

A per-tick message differs from tick to tick in its stamp and in some numbers; everything else in
its CDR bytes never changes. A `Codec` knows where those numbers lie. From then on encoding is
packing them, with zeros between, over bytes that are zero where they lie; decoding is unpacking
them, once the rest has been compared. A message that is laid out otherwise (another publisher,
other frame names, joints in another order, covariances filled) is deserialized and its fields are
read by name: slower, same numbers.
"""

import math
import operator
import struct
from collections.abc import Iterator
from typing import Any, NamedTuple

import numpy as np
from rclpy.serialization import deserialize_message

from glider_base.errors import shown

_SECOND_NS, _STAMP = 1_000_000_000, struct.Struct('<iI')
_CDR_HEADER = b'\x00\x01\x00\x00'  #: of little-endian bytes, which are aligned from behind it on
#: Fields that name frames.
_FRAMES = ('header.frame_id', 'child_frame_id')
_PRIMITIVES = {
    'boolean': '?',
    'octet': 'c',
    'int8': 'b',
    'uint8': 'B',
    'char': 'B',
    'int16': 'h',
    'uint16': 'H',
    'int32': 'i',
    'uint32': 'I',
    'int64': 'q',
    'uint64': 'Q',
    'float': 'f',
    'double': 'd',
}


class MessageError(ValueError):
    """A message that cannot be used: it is none, or of another frame, or a field is missing."""


class NotFiniteFieldError(MessageError):
    """A message with a number that is NaN or infinite."""


class Place(NamedTuple):
    """Where a field of primitive type, or the length of a sequence, lies in CDR bytes."""

    path: str  #: such as 'status[0].values[1].key'; 'len(status)' for the length of a sequence
    code: str  #: of `struct`; 's' for a string, which begins with its length (4 bytes)
    start: int
    end: int


def to_cdr(message) -> bytes:
    """Serialize any message as little-endian CDR whose padding is always zero.

    The middleware leaves whatever was in memory between aligned fields, so the bytes of one
    message differ from process to process. These do not, and readers take them all the same.
    """
    return _serialize(message)[0]


def cdr_places(message) -> list[Place]:
    """Places of all fields in `to_cdr` of a message, in their order."""
    return _serialize(message)[1]


def _serialize(message) -> tuple[bytes, list[Place]]:
    raw, places = bytearray(_CDR_HEADER), []
    for path, code, value in _fields(message, ''):
        text, number = (value, len(value)) if code == 's' else (b'', value)
        number_code = '<I' if code == 's' else f'<{code}'
        raw += bytes((len(_CDR_HEADER) - len(raw)) % struct.calcsize(number_code))
        start = len(raw)
        raw += struct.pack(number_code, number) + text
        places.append(Place(path, code, start, len(raw)))
    return bytes(raw), places


def _fields(message, owner: str) -> Iterator[tuple[str, str, Any]]:
    """Path, code as in `Place`, and value of all that is in a message, one after the other."""
    for name, kind in message.get_fields_and_field_types().items():
        yield from _parts(getattr(message, name), kind, owner + name)


def _parts(value, kind: str, path: str) -> Iterator[tuple[str, str, Any]]:
    if kind.endswith(('>', ']')):
        item = kind[len('sequence<') : -1].split(',')[0]
        if kind.endswith(']'):
            item = kind[: kind.rindex('[')]
        else:
            yield f'len({path})', 'I', len(value)
        for index, element in enumerate(value):
            yield from _parts(element, item, f'{path}[{index}]')
    elif kind.startswith('string'):
        yield path, 's', value.encode() + b'\0'
    elif kind in _PRIMITIVES:
        yield path, _PRIMITIVES[kind], value
    else:
        yield from _fields(value, f'{path}.')


class Codec:
    """How one kind of per-tick message maps to a stamp and a tuple of floats.

    Parameters
    ----------
    template : message
        A message with every constant field (frame names, joint names) filled in, and with
        sequences of the length they have in flight.
    fields : sequence of str
        The fields that carry the numbers, in the order of the tuple, as dotted paths
        (``'pose.pose.position.x'``): floats or integers. ``'position[pitch_mass]'`` is
        the entry of a JointState that belongs to that joint, ``'covariance[7]'`` that of an array.
    stamp : str
        Path of the builtin_interfaces/Time field.
    width : int, optional
        Numbers of the tuple, if it has more than there are fields: those after them are 0.0, and
        not in the message.
    unmeasured : sequence of float, optional
        What stands for each number that is NaN, if NaN says that it is not measured. What is less
        than nothing is sent as NaN.
    """

    def __init__(
        self, template, fields, stamp: str = 'header.stamp', width: int = 0, unmeasured=()
    ) -> None:
        self.message_type = type(template)
        self.fields = tuple(fields)
        self.width = max(width, len(self.fields))
        self._absent = (self.width - len(self.fields)) * (0.0,)
        self._stamp_path = stamp
        self._unmeasured = tuple(unmeasured)[: len(self.fields)]
        raw = to_cdr(template)
        raw += bytes(-len(raw) % 4)  # the middleware sends whole words
        places = {place.path: place for place in cdr_places(template)}
        frames = {one: operator.attrgetter(one)(template) for one in _FRAMES if one in places}
        self._frames = {path: name for path, name in frames.items() if name}
        split = [_split(template, path) for path in self.fields]
        names = [name if i is None else f'{name}[{i}]' for name, i in split]
        self._lay_out(raw, [places[one] for one in (f'{stamp}.sec', f'{stamp}.nanosec', *names)])
        #: as the constant rest was in older bags, which have 0 where it is NaN now
        self._before = self._template.copy()
        for place in places.values():
            (number,) = struct.unpack_from(f'<{place.code}', raw, place.start)
            if place.code in 'df' and math.isnan(number):
                self._before[place.start : place.end] = 0

    def _lay_out(self, raw: bytes, places: list[Place]) -> None:
        """Note where stamp and numbers lie, and keep the constant rest, which is 0 there."""
        self.size, self._stamp_at = len(raw), places[0].start
        order = sorted(range(len(places)), key=lambda index: places[index].start)
        template, mask, text, end = bytearray(raw), bytearray(self.size * b'\xff'), '<', 0
        for place in (places[index] for index in order):
            text += f'{place.start - end}x{place.code}'
            end = place.end
            template[place.start : end] = mask[place.start : end] = bytes(end - place.start)
        self._struct = struct.Struct(f'{text}{self.size - end}x')
        self._template, self._mask = (np.frombuffer(one, np.uint8) for one in (template, mask))
        self._constant, self._kept = (int.from_bytes(one, 'little') for one in (template, mask))
        self._in_memory = operator.itemgetter(*order)
        self._in_order = operator.itemgetter(*map(order.index, range(len(order))))
        self._codes = [place.code for place in places[2:]]
        self._has_integers = any(code != 'd' for code in self._codes)
        self._columns = [str(index) for index in range(len(places))]
        self._rows = np.dtype(
            {
                'names': self._columns,
                'formats': [f'<{place.code}' for place in places],
                'offsets': [place.start for place in places],
                'itemsize': self.size,
            }
        )

    def encode(self, stamp_ns: int, values) -> bytes:
        """Bytes of the message with this stamp (ns) and these numbers, ready to publish."""
        if self._has_integers:
            kinds = zip(self._codes, values, strict=False)
            values = [value if code in 'df' else int(value) for code, value in kinds]
        if self._unmeasured:
            pairs = zip(values, self._unmeasured, strict=False)
            values = [math.nan if one == other < 0.0 else one for one, other in pairs]
        numbers = (*divmod(stamp_ns, _SECOND_NS), *values)
        packed = int.from_bytes(self._struct.pack(*self._in_memory(numbers)), 'little')
        return (packed | self._constant).to_bytes(self.size, 'little')

    def encode_many(self, stamps_ns, values) -> np.ndarray:
        """Bytes uint8[n, size] of n messages at once.

        Of stamps int64[n] (ns), and of rows float64[n, m] that begin with the ``fields``.
        """
        stamps_ns = np.asarray(stamps_ns, np.int64)
        out = np.tile(self._template, (len(stamps_ns), 1))
        rows = out.view(self._rows)[:, 0]
        values = np.asarray(values, np.float64)
        if self._unmeasured:
            other = np.array(self._unmeasured)
            values = values[:, : len(other)]
            values = np.where((values == other) & (other < 0.0), np.nan, values)
        columns = (*np.divmod(stamps_ns, _SECOND_NS), *values.T)
        for name, column in zip(self._columns, columns, strict=False):
            rows[name] = column
        return out

    def decode(self, raw: bytes, check_frames: bool = False) -> tuple[int, tuple[float, ...]]:
        """Stamp (ns) and numbers of a serialized message.

        Raises MessageError if it is no message of this type, a joint is missing, or, where frames
        are checked, it names others than the template; NotFiniteFieldError if a number is NaN or
        infinite.
        """
        if len(raw) != self.size or int.from_bytes(raw, 'little') & self._kept != self._constant:
            return self._decode_foreign(raw, check_frames)
        numbers = self._in_order(self._struct.unpack(raw))
        values = tuple(map(float, numbers[2:])) if self._has_integers else numbers[2:]
        return _stamp_ns(*numbers[:2]), self._measured(values) + self._absent

    def decode_many(self, rows: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Stamps and numbers of n serialized messages uint8[n, size] at once.

        Stamps int64[n] are in ns; numbers float64[n, m] may be NaN or infinite. The last, bool[n],
        is whether all other bytes are those that `encode_many` writes, or once wrote: then, and
        only then, stamp and numbers are the whole message. Else they may be anything.
        """
        rest = rows & self._mask
        own = np.all(rest == self._template, axis=1) | np.all(rest == self._before, axis=1)
        table = np.ascontiguousarray(rows).view(self._rows)[:, 0]
        sec, nanosec = (table[name].astype(np.int64) for name in self._columns[:2])
        values = np.zeros((len(rows), self.width))
        with np.errstate(invalid='ignore'):  # damaged bytes may be NaN of the kind that signals
            for i, name in enumerate(self._columns[2:]):
                values[:, i] = table[name]
        if self._unmeasured:
            said = values[:, : len(self.fields)]
            np.copyto(said, self._unmeasured, where=np.isnan(said))
        return sec * _SECOND_NS + nanosec, values, own & (nanosec < _SECOND_NS)

    def decode_stamp(self, raw: bytes) -> int:
        """Stamp (ns) of a serialized message; its numbers are not looked at."""
        if len(raw) == self.size:
            return _stamp_ns(*_STAMP.unpack_from(raw, self._stamp_at))
        return self._stamp_of(self.message(raw))

    def message(self, raw: bytes):
        """Message of these bytes, whatever its layout; a `MessageError` if they are none."""
        try:
            return deserialize_message(raw, self.message_type)
        except Exception:  # rclpy has no name for its error, and wants no more of it to be known
            name = self.message_type.__name__
            raise MessageError(f'{len(raw)} bytes that are no {name}') from None

    def _decode_foreign(self, raw: bytes, check_frames: bool) -> tuple[int, tuple[float, ...]]:
        message = self.message(raw)
        for path, name in self._frames.items() if check_frames else ():
            frame = operator.attrgetter(path)(message)
            if frame.rpartition('/')[2] != name:  # a prefix, as of a vehicle, is not our business
                raise MessageError(f'{path} is {frame[:80]!r} (allowed: {name!r})')
        if getattr(message, 'orientation_covariance', (0.0,))[0] == -1.0:
            raise MessageError('orientation_covariance[0] is -1: it has no orientation')
        values = tuple(float(_get(message, path)) for path in self.fields)
        return self._stamp_of(message), self._measured(values) + self._absent

    def _stamp_of(self, message) -> int:
        time = operator.attrgetter(self._stamp_path)(message)
        return _stamp_ns(time.sec, time.nanosec)

    def _measured(self, values: tuple[float, ...]) -> tuple[float, ...]:
        """Numbers with what stands for those that are not measured; others are finite."""
        if math.isfinite(sum(values)):
            return values
        if self._unmeasured:
            pairs = zip(values, self._unmeasured, strict=True)
            values = tuple(other if math.isnan(one) else one for one, other in pairs)
        for path, value in zip(self.fields, values, strict=True):
            if not math.isfinite(value):
                raise NotFiniteFieldError(f'{path} is {value}')
        return values


def _stamp_ns(sec: int, nanosec: int) -> int:
    """Stamp in ns; a `MessageError` if it is none."""
    if sec < 0:
        raise MessageError(f'stamp.sec is {sec} (allowed: >= 0)')
    if nanosec >= _SECOND_NS:
        raise MessageError(f'stamp.nanosec is {nanosec} (allowed: < {_SECOND_NS})')
    return sec * _SECOND_NS + nanosec


def _split(message, path: str) -> tuple[str, int | None]:
    """Name of a field, and number of its entry, by a joint or by itself; None for all of it."""
    name, _, joint = path.partition('[')
    joint, names = joint.rstrip(']'), list(getattr(message, 'name', ()))
    if not joint or joint.isdigit():
        return name, int(joint) if joint else None
    if joint not in names:
        raise MessageError(f'joint {joint!r} is missing; the message has {shown(names)}')
    return name, names.index(joint)


def set_field(message, path: str, value: int) -> None:
    """Set the field at a dotted path; an entry of an array of float64 by its number."""
    name, index = _split(message, path)
    owner, _, leaf = name.rpartition('.')
    holder = operator.attrgetter(owner)(message) if owner else message
    if index is None:
        setattr(holder, leaf, value)
    else:
        getattr(holder, leaf)[index] = float(value)


def _get(message, path: str) -> float:
    name, index = _split(message, path)
    values = operator.attrgetter(name)(message)
    if index is None:
        return values
    if index >= len(values):
        raise MessageError(f'{name} of joint {message.name[index]!r} is missing')
    return values[index]
