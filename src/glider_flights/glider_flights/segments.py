# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""A recorded flight of its files, cut into segments from one stay at the surface to the next."""

from collections.abc import Callable
from typing import NamedTuple, TypeVar

import numpy as np

from glider_flights.record import (
    SURFACE_DEPTH_M,
    Fixes,
    Flight,
    Instruments,
    OnBoard,
    Polar,
    Samples,
    Segment,
    in_order,
    joined,
    local_metres,
    usual,
)

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


Item = TypeVar('Item')


class LogFile(NamedTuple):
    """What one file says of a flight."""

    name: str
    vehicle: str  #: '' if it does not say
    begin_s: float  #: when it begins (s since 1970)
    fixes: np.ndarray  #: shape (n, 3): time (s since 1970), latitude, longitude (degrees)
    about_deg: np.ndarray  #: latitude and longitude (degrees) for want of a fix, shape (2,)
    samples: Samples
    instruments: Instruments
    polar: Polar
    #: What was made on board, or by a base station, of a segment with such samples.
    on_board: Callable[[Samples], OnBoard]
    of_base_station: bool  #: whether that is of one: its current is a mean between fixes
    notes: list[str]
    dive: int = 0  #: number of the one dive that it holds; 0 if it does not say
    #: Constants of the body that it names, see `glider_flights.record.Flight`.
    body: dict[str, float] = {}

    @property
    def time_s(self) -> np.ndarray:
        """Times of its samples (s since 1970)."""
        return self.samples.time_s


def put_together(kind: str, files: list[LogFile], notes: list[str]) -> Flight:
    """A flight of its files."""
    files = sorted(files, key=lambda file: file.begin_s)
    fixes = np.concatenate([file.fixes for file in files])
    origin = fixes[0, 1:] if len(fixes) else files[0].about_deg
    segments, unused = [], []
    # Where a dive is missing a vehicle may have been anywhere.
    for run in runs(files, lambda last, one: one.dive == last.dive + 1 or not one.dive):
        found, why = _segments(run, origin)
        segments += found
        unused += [one for one in why if one not in unused]
    names = {name for file in files for name in file.body}
    body = {
        name: usual([file.body[name] for file in files if name in file.body]) for name in names
    }
    return Flight(
        kind=kind,
        files=[file.name for file in files],
        segments=segments,
        notes=notes + [note for file in files for note in file.notes] + unused,
        origin_deg=origin,
        instruments=joined(_of_one_zero(file, body) for file in files),
        body=body,
        on_board_over='between fixes' if files[0].of_base_station else 'under water',
    )


def _of_one_zero(file: LogFile, body: dict[str, float]) -> Instruments:
    """Instruments of a file; the zero of its engine is that of the whole flight.

    Each dive may have another one: people move it between dives.
    """
    own = file.instruments
    if 'volume_m3' not in file.body:
        return own
    shift = file.body['volume_m3'] - body['volume_m3']
    return own._replace(pumped_m3=own.pumped_m3 + shift)


def runs(items: list[Item], follows: Callable[[Item, Item], bool]) -> list[list[Item]]:
    """Items in runs: in each every one follows the one before it."""
    found: list[list[Item]] = []
    for item in items:
        if found and follows(found[-1][-1], item):
            found[-1].append(item)
        else:
            found.append([item])
    return found


def _segments(files: list[LogFile], origin: np.ndarray) -> tuple[list[Segment], list[str]]:
    table = np.concatenate([file.fixes for file in files])
    samples = Samples(*np.concatenate([np.stack(file.samples) for file in files], axis=1))
    cuts, notes = cut(Fixes(table[:, 0], local_metres(origin, *table.T[1:])), samples)
    segments = []
    for one in cuts:
        middle = 0.5 * (one.before.time_s[-1] + one.after.time_s[0])
        file = [file for file in files if file.begin_s <= middle][-1]
        segments.append(Segment(file.name, *one, file.on_board(one.samples), file.polar))
    return segments, notes


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
