# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""Quality of service of every kind of topic."""

from rclpy.qos import DurabilityPolicy, HistoryPolicy, QoSProfile, ReliabilityPolicy


def _profile(depth: int, reliable: bool = False, latched: bool = False) -> QoSProfile:
    """The last ``depth`` messages: as they come or all of them, now or for who comes later."""
    return QoSProfile(
        history=HistoryPolicy.KEEP_LAST,
        depth=depth,
        reliability=ReliabilityPolicy.RELIABLE if reliable else ReliabilityPolicy.BEST_EFFORT,
        durability=DurabilityPolicy.TRANSIENT_LOCAL if latched else DurabilityPolicy.VOLATILE,
    )


#: Per-tick topics: reliable, with room for far more ticks than the plant may be ahead of the
#: recorder (`glider_base.ros.lockstep.clock.MAX_TICKS_AHEAD`), so that nothing is ever lost.
PER_TICK = _profile(1024, reliable=True)
#: For who looks on: the newest value only, from reliable and best-effort publishers alike.
NEWEST = _profile(1)
#: What free-running nodes ask for: they keep the newest, and pass over what a stranger says, of
#: which there may be many before they look.
FREE = _profile(256)
#: Published once, for whoever comes later.
LATCHED = _profile(1, reliable=True, latched=True)
#: /diagnostics, lockstep: few messages, each of which matters, also to those who come later.
EVENTS = _profile(256, reliable=True, latched=True)
#: What a node repeats on /diagnostics, for who listens now: neither a recorder nor anybody else
#: who asks for what was said before is given it.
REPEATED = _profile(1, reliable=True)
#: What a recorder asks for where somebody publishes with best effort.
EVERYTHING = _profile(1024)
