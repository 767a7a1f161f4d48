# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""What nodes say about themselves, as DiagnosticArrays.

Two kinds of status: events of the flight (stage, saturation, failsafe) on /diagnostics, which are
recorded, and the state of a node as a member of the lockstep (`Report`) on ``lockstep``, by which
the peers of one namespace find each other.
"""

from typing import NamedTuple

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue

from glider_base.block import Said
from glider_base.ros.wire.topics import PLANT

OK, WARN, ERROR = DiagnosticStatus.OK, DiagnosticStatus.WARN, DiagnosticStatus.ERROR

LEVELS = {'ok': OK, 'warn': WARN, 'error': ERROR}

STARTING, READY, WAITING, FINISHED, FAILED = 'starting', 'ready', 'waiting', 'finished', 'failed'

#: What the plant says about a run that is finished.
COMPLETE = 'the run is complete'


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
    array.header.stamp.sec, array.header.stamp.nanosec = divmod(stamp_ns, 1_000_000_000)
    pairs = [KeyValue(key=key, value=str(value)) for key, value in values.items()]
    array.status = [DiagnosticStatus(level=level, name=name, message=message, values=pairs)]
    return array


def said_array(stamp_ns: int, node: str, said: Said) -> DiagnosticArray:
    """Event of a block at a tick; ``node`` is the full name of the node that tells it."""
    values = {**said.values, 't_s': stamp_ns / 1e9}
    return status_array(stamp_ns, node, LEVELS[said.level], said.message, values)


def report_array(report: Report) -> DiagnosticArray:
    """Message that carries ``report``."""
    values = {'phase': report.phase, 'peer': report.peer, 'topic': report.topic}
    array = status_array(report.stamp_ns, report.node, report.level, report.message, values)
    array.status[0].hardware_id = report.process
    return array


class Told(NamedTuple):
    """How many events a node has told of up to a tick: without them a recording is not whole."""

    node: str  #: full name
    events: int  #: since it was started
    stamp_ns: int
    process: str = ''


def told_array(told: Told) -> DiagnosticArray:
    """Message that carries ``told``."""
    array = status_array(told.stamp_ns, told.node, OK, '', {'events': told.events})
    array.status[0].hardware_id = told.process
    return array


def told_in(array: DiagnosticArray) -> Told | None:
    """What a message carries; None if it is of somebody else."""
    try:
        (status,) = array.status
        (pair,) = status.values
        return Told(status.name, int(pair.value), stamp_of(array), status.hardware_id)
    except ValueError:
        return None


def stamp_of(array: DiagnosticArray) -> int:
    """Stamp (ns) of the tick that a message is about."""
    return array.header.stamp.sec * 1_000_000_000 + array.header.stamp.nanosec


def reports_in(array: DiagnosticArray) -> list[Report]:
    """Reports that a message carries."""
    stamp_ns = stamp_of(array)
    return [_report(status, stamp_ns) for status in array.status]


def _report(status: DiagnosticStatus, stamp_ns: int) -> Report:
    values = {pair.key: pair.value for pair in status.values}
    phase, peer, topic = (values.get(key, '') for key in ('phase', 'peer', 'topic'))
    said = (status.name, phase, status.message, stamp_ns, peer, topic, status.level)
    return Report(*said, status.hardware_id)


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
