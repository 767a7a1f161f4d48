# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""What nodes say about themselves, as DiagnosticArrays.

Two kinds of status: events of the flight (stage, saturation, failsafe) on /diagnostics, which are
recorded, and the state of a node as a member of the lockstep (`Report`) on ``lockstep``, by which
the peers of one namespace find each other. What changes is an event. A `Pulse` repeats
what holds once in a second, for tools that take silence for a failure, and is not recorded.
"""

import struct
from typing import NamedTuple

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from rclpy.node import Node
from rclpy.publisher import Publisher

from glider_base.block import Said
from glider_base.ros.wire.codec import to_cdr
from glider_base.ros.wire.topics import PLANT

OK, WARN, ERROR = DiagnosticStatus.OK, DiagnosticStatus.WARN, DiagnosticStatus.ERROR

LEVELS = {'ok': OK, 'warn': WARN, 'error': ERROR}

STARTING, READY, WAITING, FINISHED, FAILED = 'starting', 'ready', 'waiting', 'finished', 'failed'

#: What the plant says about a run that is finished.
COMPLETE = 'the run is complete'

#: Messages of the events by which a node tells what a person asked of it in flight, with the first
#: tick that it acts on. Whoever computes a recorded run again needs them: a step is a function of
#: state, inputs and parameters, and these change the last of them, or the state.
ABORT, PARAMETERS_SET, SURFACE, CLEAR = 'abort', 'parameters set', 'surface', 'clear'

#: What a managed node tells when it is configured.
CONFIGURED = 'configured: it knows nothing of before'

_SECOND_NS = 1_000_000_000
#: Key that an event of a block has, and what is repeated beside it has not.
EVENT = 't_s'
#: The stamp of a message with a header, after the 4 bytes that say how it is encoded.
_STAMP, _STAMP_AT = struct.Struct('<iI'), 4


def seconds(stamp_ns: int) -> str:
    """Simulated time, for a message."""
    return f't = {stamp_ns / 1e9:.1f} s'


class Report(NamedTuple):
    """State of a node in the lockstep."""

    node: str
    phase: str
    message: str = ''
    stamp_ns: int = 0  #: stamp of the tick it is about
    peer: str = ''  #: node it waits for
    topic: str = ''  #: what it waits for
    level: bytes = OK
    process: str = ''  #: by which a node knows its peers from those of a second glider


def status_array(stamp_ns: int, name: str, level: bytes, message: str, values: dict):
    """DiagnosticArray with one status, stamped with a tick."""
    array = DiagnosticArray()
    array.header.stamp.sec, array.header.stamp.nanosec = divmod(stamp_ns, _SECOND_NS)
    pairs = [KeyValue(key=key, value=str(value)) for key, value in values.items()]
    array.status = [DiagnosticStatus(level=level, name=name, message=message, values=pairs)]
    return array


def said_array(stamp_ns: int, node: str, said: Said) -> DiagnosticArray:
    """Event of a block at a tick; ``node`` is the full name of the node that tells it."""
    values = {**said.values, EVENT: stamp_ns / 1e9}
    return status_array(stamp_ns, node, LEVELS[said.level], said.message, values)


def report_array(report: Report) -> DiagnosticArray:
    """Message that carries ``report``."""
    values = {'phase': report.phase, 'peer': report.peer, 'topic': report.topic}
    array = status_array(report.stamp_ns, report.node, report.level, report.message, values)
    array.status[0].hardware_id = report.process
    return array


class EventCount(NamedTuple):
    """How many events a node has reported up to a tick: without them a recording is not whole."""

    node: str  #: full name
    events: int  #: since it was started
    stamp_ns: int
    process: str = ''


def count_array(count: EventCount) -> DiagnosticArray:
    """Message that carries ``count``."""
    array = status_array(count.stamp_ns, count.node, OK, '', {'events': count.events})
    array.status[0].hardware_id = count.process
    return array


def count_in(array: DiagnosticArray) -> EventCount | None:
    """What a message carries; None if it is of somebody else."""
    try:
        (status,) = array.status
        (pair,) = status.values
        return EventCount(status.name, int(pair.value), stamp_of(array), status.hardware_id)
    except ValueError:
        return None


def stamp_of(array: DiagnosticArray) -> int:
    """Stamp (ns) of the tick that a message is about."""
    return array.header.stamp.sec * _SECOND_NS + array.header.stamp.nanosec


def reports_in(array: DiagnosticArray) -> list[Report]:
    """Reports that a message carries."""
    stamp_ns, found = stamp_of(array), []
    for status in array.status:
        said = {pair.key: pair.value for pair in status.values}
        phase, peer, topic = (said.get(key, '') for key in ('phase', 'peer', 'topic'))
        about = (phase, status.message, stamp_ns, peer, topic, status.level)
        found.append(Report(status.name, *about, status.hardware_id))
    return found


def end_of_run(array: DiagnosticArray) -> Report | None:
    """What the plant says about the end of the run, if that is what a message is about."""
    for report in reports_in(array):
        if report.node.rpartition('/')[2] == PLANT and report.phase in (FINISHED, FAILED):
            return report
    return None


def concerns(array: DiagnosticArray, namespace: str) -> bool:
    """Whether a message on /diagnostics is about something in a namespace, or in none.

    Nodes of this stack give their full names there.
    """
    return any(
        not status.name.startswith('/') or status.name.rpartition('/')[0] == namespace.rstrip('/')
        for status in array.status
    )


class Pulse:
    """Repeats how a node is.

    The node has a method ``condition``, as `glider_base.ros.lockstep.node.TickNode`.
    """

    def __init__(self, node: Node, publisher: Publisher) -> None:
        self._node, self._publisher = node, publisher
        self._second = -1
        self._said: Said | None = None
        self._raw = bytearray()

    def beat(self, now_ns: int, stamp_ns: int) -> None:
        """Say it with a stamp if a second has begun since, by the clock that the node goes by."""
        if now_ns // _SECOND_NS == self._second:
            return
        self._second = now_ns // _SECOND_NS
        said = self._node.condition()
        if said != self._said:
            name = self._node.get_fully_qualified_name()
            self._said = said
            array = status_array(0, name, LEVELS[said.level], said.message, said.values)
            self._raw = bytearray(to_cdr(array))
        _STAMP.pack_into(self._raw, _STAMP_AT, *divmod(stamp_ns, _SECOND_NS))
        self._publisher.publish(bytes(self._raw))
