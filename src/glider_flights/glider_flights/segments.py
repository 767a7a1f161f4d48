# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""Cutting a recorded flight into segments, from one stay at the surface to the next."""

from typing import NamedTuple

import numpy as np

from glider_flights.record import SURFACE_DEPTH_M, Fixes, Samples, in_order

#: Between two fixes with a sample deeper than this a glider has dived (m).
DIVE_DEPTH_M = 5.0
#: Fixes further apart than this are of two stays (s): what was between them is not recorded.
LONGEST_STAY_S = 3600.0
#: A segment is not shorter than this under water (s): its current would be the noise of its fixes.
SHORTEST_SEGMENT_S = 300.0
#: A fix is told at the depth of a sample that is no further from it than this (s).
NEAR_S = 30.0
#: Further than this from the others of its stay (m), and as far as it may have drifted at no more
#: than this (m/s), a fix is wrong; a current and a glider together are no faster either.
FAR_OFF_M, FASTEST_MPS = 1000.0, 4.0
#: Longest time without a sample (s), and as a share of the segment; the larger of them counts.
LONGEST_GAP_S, LONGEST_GAP = 900.0, 0.2

WHY_LEFT_OUT = {
    'short': f'shorter than {SHORTEST_SEGMENT_S:.0f} s',
    'gap': 'with no samples for a large part of them',
    'far': 'with fixes further apart than a glider moves',
}


class Cut(NamedTuple):
    """A segment as it was cut."""

    before: Fixes
    after: Fixes
    samples: Samples


def stays(fixes: Fixes, samples: Samples) -> list[Fixes]:
    """Fixes by stay at the surface, without those told while deep and those far off."""
    order = np.unique(fixes.time_s, return_index=True)[1]
    time_s, place_m = fixes.time_s[order], fixes.place_m[order]
    if len(samples.time_s):
        near = np.searchsorted(samples.time_s, time_s).clip(0, len(samples.time_s) - 1)
        apart = np.abs(samples.time_s[near] - time_s) > NEAR_S
        usable = apart | (samples.depth_m[near] <= DIVE_DEPTH_M)
        time_s, place_m = time_s[usable], place_m[usable]
    deep_s = samples.time_s[samples.depth_m > DIVE_DEPTH_M]
    dived = np.searchsorted(deep_s, time_s)
    apart = (np.diff(dived) > 0) | (np.diff(time_s) > LONGEST_STAY_S)
    edges = np.flatnonzero(apart) + 1
    pairs = zip(np.split(time_s, edges), np.split(place_m, edges), strict=True)
    return [_together(Fixes(*pair)) for pair in pairs if len(pair[0])]


def _together(fixes: Fixes) -> Fixes:
    """Fixes of a stay without those that a drifting vehicle cannot have had."""
    off = np.hypot(*(fixes.place_m - np.median(fixes.place_m, axis=0)).T)
    usable = off <= FAR_OFF_M + FASTEST_MPS * np.ptp(fixes.time_s)
    return Fixes(fixes.time_s[usable], fixes.place_m[usable]) if usable.any() else fixes


def cut(fixes: Fixes, samples: Samples) -> tuple[list[Cut], list[str]]:
    """Segments of a flight in the order of time, and what is to be said of those left out."""
    samples = in_order(samples, len(samples) - 1)  # buoyancy may be missing
    at_surface = stays(fixes, samples)
    found, left_out = [], dict.fromkeys(WHY_LEFT_OUT, 0)
    for before, after in zip(at_surface[:-1], at_surface[1:], strict=True):
        begin, end = before.time_s[-1], after.time_s[0]
        inside = (samples.time_s >= begin) & (samples.time_s <= end)
        own = Samples(*(values[inside] for values in samples))
        why = _why_left_out(own, before, after)
        if why:
            left_out[why] += 1
        else:
            found.append(Cut(before, after, own))
    return found, [
        f'segments left out: {count}, {WHY_LEFT_OUT[why]}'
        for why, count in left_out.items()
        if count
    ]


def _why_left_out(own: Samples, before: Fixes, after: Fixes) -> str:
    """Why a segment cannot be used; '' if it can be."""
    begin, end = before.time_s[-1], after.time_s[0]
    deep_s = own.time_s[own.depth_m > SURFACE_DEPTH_M]
    allowed_s = max(LONGEST_GAP_S, LONGEST_GAP * (end - begin))
    if len(deep_s) < 2 or np.diff(own.time_s, prepend=begin, append=end).max() > allowed_s:
        return 'gap'
    if np.ptp(deep_s) < SHORTEST_SEGMENT_S:
        return 'short'
    moved_m = float(np.hypot(*(after.place_m[0] - before.place_m[-1])))
    return 'far' if moved_m > FASTEST_MPS * (end - begin) else ''
