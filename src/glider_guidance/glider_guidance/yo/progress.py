# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""Whether the way along the path gets shorter from surfacing to surfacing."""

from typing import NamedTuple

from glider_base.kernel import kernel, replace
from glider_base.signals import TICK_S
from glider_guidance.path.curve import path_piece
from glider_guidance.yo.end_of_path import LEAST_PROGRESS
from glider_guidance.yo.stage import WAITING_ON_SURFACE


class Progress(NamedTuple):
    """The last progress, and how often the vehicle has come up since without any."""

    s: float = 0.0  #: parameter of the virtual target then (m)
    tick: int = 0
    surfacings: int = 0


@kernel
def watch_progress(progress, tick, s, stage, profile):
    """The progress after a tick; it counts as the vehicle comes up.

    ``s`` (m) is the parameter of the virtual target, which never goes back along a path; ``stage``
    is the one before the tick, ``profile`` the `ProfileState` after it.
    """
    if profile.stage != WAITING_ON_SURFACE or profile.aborted:
        return progress
    if stage == profile.stage:  # while it waits or is held there is none to be made
        return Progress(progress.s, progress.tick + 1, progress.surfacings)
    if s - progress.s > LEAST_PROGRESS * TICK_S * (tick - progress.tick):
        return Progress(s, tick, 0)
    return replace(progress, surfacings=progress.surfacings + 1)


@kernel
def waypoint_not_neared(progress, s, surfacings, path):
    """Number of the waypoint (from 1 on) that so many surfacings came no nearer to; 0: none."""
    if surfacings == 0 or progress.surfacings < surfacings:
        return 0
    piece, _ = path_piece(s, path)
    return piece + 1


@kernel
def on_another_path(progress, tick, s, surfacings):
    """The progress once another path is followed, from there on: it is as good as before."""
    count = progress.surfacings if progress.surfacings < surfacings else 0
    return Progress(s, tick, count)
