# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""How long a node waits, and for whom, in wall time."""

import time

from glider_base.ros.hearing.inputs import Input
from glider_base.ros.lockstep import health
from glider_base.ros.lockstep.health import seconds
from glider_base.ros.wire import topics

#: A node waits this long (wall time, s) for the recorder and its peers at the end of a run.
FAREWELL_S = 5.0
#: A node tells whom it waits for after this share of the time-out of a tick.
REPORT_AFTER = 0.4


class Watch:
    """Wall time for which the tick that is due has not changed."""

    def __init__(self) -> None:
        self._due_ns: int | None = None
        self._since_s = 0.0

    def begin(self) -> None:
        """Count from now on."""
        self._since_s = time.monotonic()

    def begin_at_next_look(self) -> None:
        """Count from the next look on."""
        self._due_ns = None

    def end_until_next_tick(self) -> None:
        """Count no more as long as the same tick is due."""
        self._since_s = float('inf')

    def stuck_s(self, due_ns: int | None) -> float:
        """Look at the tick that is due: the time (s) since it became so."""
        now = time.monotonic()
        if self._due_ns != due_ns:
            self._due_ns, self._since_s = due_ns, now
        return now - self._since_s


def wait_of(missing: list[Input], count: int, due_ns: int) -> dict:
    """Whom a node waits for, as the fields of its report.

    Parameters
    ----------
    missing : list of Input
        Inputs that are not there, at least one.
    count : int
        How many inputs the node has. As long as it has none of them it is idle, not held up.
    due_ns : int
        Stamp of the tick (ns).
    """
    idle = len(missing) == count
    names = {item.topic.publisher: item.topic.name for item in missing}
    peer = topics.PLANT if idle and topics.PLANT in names else missing[0].topic.publisher
    return {
        'message': f'waits for {names[peer]} of {peer} at {seconds(due_ns)}',
        'stamp_ns': due_ns,
        'peer': peer,
        'topic': names[peer],
        'level': health.OK if idle else health.WARN,
    }
