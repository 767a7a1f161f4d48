# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""Whose a topic is: of all who publish it, the one that is obeyed.

In lockstep it is the node that the wiring says, for good. Free-running, what the blocks say is
theirs too; what a vehicle says (its sensors, where it is) is that of whoever speaks first, under
any name, until it is gone. One that falls silent is followed by the next of its name: a driver
that has crashed and was started again. Who has no name yet is waited for.
Who has spoken while the owner did is never obeyed.
"""

from collections.abc import Mapping
from enum import Enum

from glider_base.ros.hearing import gids
from glider_base.ros.wire.topics import Topic
from glider_base.wiring import NAVIGATION, PLANT

#: Blocks in the place of which a vehicle may publish, under a name of its own.
_VEHICLE = (PLANT.node, NAVIGATION.node)
#: Wall time (s) within which the middleware tells the name of a node that speaks.
NAMED_WITHIN_S = 10.0


class Verdict(Enum):
    """What becomes of a message."""

    OWNED = 'it is the owner that says it'
    TAKEN_OVER = 'it is the owner from now on'
    DOUBTFUL = 'it is dropped: who it is will be known soon'
    STRANGE = 'it is refused'


class Owner:
    """Whose a topic is; a node ``stand_in`` may be in the place of its publisher."""

    def __init__(self, topic: Topic, lockstep: bool, stand_in: str = '') -> None:
        self._lockstep = lockstep
        self._may_be_other = not lockstep and topic.publisher in _VEHICLE
        self._wired = {name for name in (topic.publisher, stand_in) if name}
        self.gid = b''  #: of the owner; empty as long as there is none
        self.name = ''  #: full name of its node, as far as it is known
        self.before = ''  #: name of the owner before it
        self.heard_s = -float('inf')  #: when it spoke last
        self.strangers: set[bytes] = set()  #: have spoken while it did
        self._new: dict[bytes, float] = {}  #: have spoken since it did, and when at first

    def owns(self, gid: bytes, now_s: float) -> bool:
        """Whether a message is that of the owner, as nearly every one is; or nobody can tell."""
        if gid != self.gid and gid:
            return False
        self.heard_s = now_s
        if self._new:
            self.strangers |= set(self._new)
            self._new = {}
        return True

    def is_strange(self, gid: bytes) -> bool:
        """Whether somebody is no owner, whatever else is known."""
        return gid in self.strangers or bool(self._lockstep and self.gid)

    def claimed(
        self,
        gid: bytes,
        names: Mapping[bytes, str],
        namespace: str,
        now_s: float,
        patience_s: float,
    ) -> Verdict:
        """Look who somebody is that is not the owner, which may be silent for ``patience_s``.

        ``names`` are the full names of the nodes that publish the topic, by gid; empty if not
        known yet. The ``namespace`` is that of the node that has the message.
        """
        if self.is_strange(gid):
            return Verdict.STRANGE
        since_s = self._new.setdefault(gid, now_s)
        verdict = self._judged(gid, names, namespace, now_s - self.heard_s, patience_s)
        if verdict is Verdict.STRANGE and not names.get(gid) and now_s < since_s + NAMED_WITHIN_S:
            return Verdict.DOUBTFUL
        if verdict in (Verdict.OWNED, Verdict.TAKEN_OVER):
            self.before, self.name = self.name, names.get(gid, '')
            self.gid, self.heard_s = gid, now_s
            self._new = {}
        return verdict

    def _judged(self, gid, names, namespace, silent_s, patience_s) -> Verdict:
        name = names.get(gid, '')
        wired = {f'{namespace.rstrip("/")}/{node}' for node in self._wired}
        if not self.gid and not self.name:
            return self._first(name, wired, names)
        self.name = names.get(self.gid) or self.name
        is_gone, is_over = self.gid not in names, silent_s > patience_s
        if name and name == self.name:
            return Verdict.TAKEN_OVER if is_gone or is_over else Verdict.DOUBTFUL
        is_free = is_gone and is_over and name and self._may_be_other
        return Verdict.TAKEN_OVER if is_free else Verdict.STRANGE

    def _first(self, name: str, wired: set[str], names: Mapping[bytes, str]) -> Verdict:
        """Whether somebody is the first owner."""
        if name in wired:
            return Verdict.OWNED
        if not self._may_be_other or wired.intersection(names.values()):
            return Verdict.STRANGE if name else Verdict.DOUBTFUL
        return Verdict.OWNED if name or len(names) <= 1 else Verdict.DOUBTFUL

    def follow(self, before: bytes, now: bytes) -> None:
        """Be that of the next of the owner's name, if the owner was of a process that is gone.

        Another topic was owned by ``before``, and has been taken over.
        """
        was = gids.are_of_one_process(self.gid, before)
        if was and not gids.are_of_one_process(before, now):
            self.gid = b''

    def restart(self) -> None:
        """Forget an owner that has said nothing that counts."""
        self.gid, self.name = b'', ''
