# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""Quality of service of every kind of topic."""

from rclpy.qos import DurabilityPolicy, HistoryPolicy, QoSProfile, ReliabilityPolicy

#: Per-tick topics: reliable, with room for far more ticks than the plant may be ahead of the
#: recorder (`glider_model.ros.lockstep.clock.MAX_TICKS_AHEAD`), so that nothing is ever lost.
PER_TICK = QoSProfile(
    history=HistoryPolicy.KEEP_LAST,
    depth=1024,
    reliability=ReliabilityPolicy.RELIABLE,
    durability=DurabilityPolicy.VOLATILE,
)

#: For who looks on: the newest value only, from reliable and best-effort publishers alike.
NEWEST = QoSProfile(
    history=HistoryPolicy.KEEP_LAST,
    depth=1,
    reliability=ReliabilityPolicy.BEST_EFFORT,
    durability=DurabilityPolicy.VOLATILE,
)

#: What free-running nodes ask for: they keep the newest, and pass over what a stranger says, of
#: which there may be many before they look.
FREE = QoSProfile(
    history=HistoryPolicy.KEEP_LAST,
    depth=256,
    reliability=ReliabilityPolicy.BEST_EFFORT,
    durability=DurabilityPolicy.VOLATILE,
)

#: Published once, for whoever comes later.
LATCHED = QoSProfile(
    history=HistoryPolicy.KEEP_LAST,
    depth=1,
    reliability=ReliabilityPolicy.RELIABLE,
    durability=DurabilityPolicy.TRANSIENT_LOCAL,
)

#: /diagnostics, lockstep: few messages, each of which matters, also to those who come later.
EVENTS = QoSProfile(
    history=HistoryPolicy.KEEP_LAST,
    depth=256,
    reliability=ReliabilityPolicy.RELIABLE,
    durability=DurabilityPolicy.TRANSIENT_LOCAL,
)

#: What a node repeats on /diagnostics, for who listens now: neither a recorder nor anybody else
#: who asks for what was said before is given it.
REPEATED = QoSProfile(
    history=HistoryPolicy.KEEP_LAST,
    depth=1,
    reliability=ReliabilityPolicy.RELIABLE,
    durability=DurabilityPolicy.VOLATILE,
)

#: What a recorder asks for in free-running mode: everything, from whatever publisher there is.
EVERYTHING = QoSProfile(
    history=HistoryPolicy.KEEP_LAST,
    depth=1024,
    reliability=ReliabilityPolicy.BEST_EFFORT,
    durability=DurabilityPolicy.VOLATILE,
)
