# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""Messages with the number (gid) of who published them.

The middleware knows it of every message, and rclpy does not pass it on: so a message is taken from
below rclpy, by the function of rcl that rclpy takes it by. Its interface is fixed for a
distribution of ROS 2 (REP-2004, ABI stability), this is that of Jazzy.

Only where the middleware is Fast DDS are the gids of messages those of the publishers that it
lists; with another one nobody can be distinguished.
"""

import ctypes
from ctypes import POINTER, byref, c_bool, c_char_p, c_int, c_int64, c_size_t, c_uint8, c_void_p
from functools import cache

from rclpy.utilities import get_rmw_implementation_identifier

#: What a gid is called in what is known of a message, beside what rclpy tells of it.
GID = 'publisher_gid'
#: Bytes of a gid (RMW_GID_STORAGE_SIZE), and those of them that are the same in a process.
_GID_BYTES, _PARTICIPANT_BYTES = 16, 12
#: Nothing is there to be taken (RCL_RET_SUBSCRIPTION_TAKE_FAILED).
_NOTHING = 401


class _Info(ctypes.Structure):
    """The struct rmw_message_info_t of C, with the rmw_gid_t in it."""

    _fields_ = [
        ('times_and_numbers', c_int64 * 4),
        ('implementation', c_char_p),
        ('gid', c_uint8 * _GID_BYTES),
        ('from_intra_process', c_bool),
    ]


class _Allocator(ctypes.Structure):
    """The struct rcutils_allocator_t of C."""

    _fields_ = [(name, c_void_p) for name in ('get', 'free', 'resize', 'zeroed', 'state')]


class _Bytes(ctypes.Structure):
    """The struct rcutils_uint8_array_t of C."""

    _fields_ = [
        ('buffer', c_void_p),
        ('length', c_size_t),
        ('capacity', c_size_t),
        ('allocator', _Allocator),
    ]


class _Taker:
    """The function of rcl, and the memory that it writes to; for one thread."""

    def __init__(self) -> None:
        rcl, rcutils = ctypes.CDLL('librcl.so'), ctypes.CDLL('librcutils.so')
        rcutils.rcutils_get_default_allocator.restype = _Allocator
        self._bytes = _Bytes(allocator=rcutils.rcutils_get_default_allocator())
        self._info = _Info()
        self._take = rcl.rcl_take_serialized_message
        self._take.argtypes = [c_void_p, POINTER(_Bytes), POINTER(_Info), c_void_p]
        self._take.restype = c_int
        self._reset_error = rcutils.rcutils_reset_error
        self._where = byref(self._bytes), byref(self._info), None

    def take(self, subscription: int) -> tuple[bytes, dict] | None:
        """Oldest message of a subscription, which is a pointer of rcl; None if there is none."""
        code = self._take(subscription, *self._where)
        if code:
            self._reset_error()
            if code != _NOTHING:
                raise RuntimeError(f'rcl_take_serialized_message: error {code}')
            return None
        raw = ctypes.string_at(self._bytes.buffer, self._bytes.length)
        return raw, {GID: bytes(self._info.gid)}


@cache
def taker() -> _Taker | None:
    """What takes messages with the gids of their publishers; None where nothing does."""
    if not get_rmw_implementation_identifier().startswith('rmw_fastrtps'):
        return None
    try:
        return _Taker()
    except (OSError, AttributeError):
        return None


def gid_of(info: dict) -> bytes:
    """Who published a message; empty if nobody tells."""
    return info.get(GID, b'')


def are_of_one_process(gid: bytes, other: bytes) -> bool:
    """Whether two publishers are of one participant of the middleware."""
    return gid[:_PARTICIPANT_BYTES] == other[:_PARTICIPANT_BYTES]


def shown(gid: bytes) -> str:
    """A gid as ``ros2 topic info --verbose`` shows it."""
    return '.'.join(f'{byte:02x}' for byte in gid)
