# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""What nodes say about themselves on /diagnostics.

Two kinds of status: events of the flight (stage, saturation, failsafe), which are recorded, and
the state of a node as a member of the lockstep (`Report`), by which peers find each other.
"""

from typing import NamedTuple

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue

OK, WARN, ERROR = DiagnosticStatus.OK, DiagnosticStatus.WARN, DiagnosticStatus.ERROR

STARTING, READY, WAITING, FINISHED, FAILED = 'starting', 'ready', 'waiting', 'finished', 'failed'

_SUFFIX = ': lockstep'


class Report(NamedTuple):
    """State of a node in the lockstep."""

    node: str
    phase: str
    message: str = ''
    stamp_ns: int = 0  #: stamp of the tick it is about
    peer: str = ''  #: node it waits for
    topic: str = ''  #: what it waits for
    level: bytes = OK


def status_array(stamp_ns: int, name: str, level: bytes, message: str, values: dict):
    """DiagnosticArray with one status, stamped with a tick."""
    array = DiagnosticArray()
    array.header.stamp.sec, array.header.stamp.nanosec = divmod(stamp_ns, 1_000_000_000)
    pairs = [KeyValue(key=key, value=str(value)) for key, value in values.items()]
    array.status = [DiagnosticStatus(level=level, name=name, message=message, values=pairs)]
    return array


def report_array(report: Report) -> DiagnosticArray:
    """Message that carries ``report``."""
    values = {'phase': report.phase, 'peer': report.peer, 'topic': report.topic}
    return status_array(
        report.stamp_ns, report.node + _SUFFIX, report.level, report.message, values
    )


def reports_in(array: DiagnosticArray) -> list[Report]:
    """Lockstep reports among the statuses of a message."""
    stamp_ns = array.header.stamp.sec * 1_000_000_000 + array.header.stamp.nanosec
    found = []
    for status in array.status:
        if status.name.endswith(_SUFFIX):
            values = {pair.key: pair.value for pair in status.values}
            found.append(
                Report(
                    status.name.removesuffix(_SUFFIX),
                    values.get('phase', ''),
                    status.message,
                    stamp_ns,
                    values.get('peer', ''),
                    values.get('topic', ''),
                    status.level,
                )
            )
    return found


def is_routine(array: DiagnosticArray) -> bool:
    """Whether a message holds nothing but lockstep reports that all is well."""
    return all(status.name.endswith(_SUFFIX) and status.level == OK for status in array.status)
