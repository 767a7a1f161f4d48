# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""A recorded flight of a real glider, whoever made it: dives between surfacings with fixes.

Of what its files say it is cut into segments, from one surface interval to the next.

Positions are north and east (m) of the first fix, angles in the world NED and the body FRD.
"""

import math
from collections.abc import Callable, Iterable, Sequence
from typing import NamedTuple, TypeVar

import numpy as np

from glider_base.frames import within_180

#: Metres of a degree of latitude, on a sphere of the Earth's mean radius.
METRES_PER_DEGREE = 6_371_000.0 * math.pi / 180.0
#: Shallower than this a glider is at the surface (m): it floats with its tail out of the water.
SURFACE_DEPTH_M = 2.0
#: Between two fixes with a sample deeper than this a glider has dived (m).
DIVE_DEPTH_M = 5.0
#: Fixes further apart than this are of two stays (s): what was between them is not recorded.
LONGEST_STAY_S = 3600.0
#: A segment is not shorter than this under water (s): its current would be the noise of its fixes.
SHORTEST_SEGMENT_S = 300.0
#: A fix has the depth of a sample that is no further from it than this (s).
NEAR_S = 30.0
#: Of two fixes of a stay that are further apart than this (m), and as far as it may have drifted
#: at no more than this (m/s), one is wrong; a current and a glider together are no faster either.
FAR_OFF_M, FASTEST_MPS = 100.0, 4.0
#: Longest time without a sample (s), and as a share of the segment; the larger of them counts.
LONGEST_GAP_S, LONGEST_GAP = 900.0, 0.2

#: No times at all.
NEVER = np.empty(0)

WHY_LEFT_OUT = {
    'short': f'shorter than {SHORTEST_SEGMENT_S:.0f} s',
    'gap': 'with no samples for a large part of them',
    'far': 'with fixes further apart than a glider moves',
}


class Fixes(NamedTuple):
    """Fixes of one surface interval, in the order of time; may be none."""

    time_s: np.ndarray  #: shape (n,), s since 1970
    place_m: np.ndarray  #: shape (n, 2): north, east (m) of the flight's first fix


class Samples(NamedTuple):
    """What was measured under water, all of shape (n,), in the order of time."""

    time_s: np.ndarray  #: time (s since 1970)
    depth_m: np.ndarray  #: depth (m, + down)
    pitch_rad: np.ndarray  #: pitch (rad, + nose up)
    heading_rad: np.ndarray  #: heading (rad from true north, + to east)
    buoyancy_kg: np.ndarray  #: buoyancy (kg, + rises), NaN where it is not known


NOT_KNOWN = np.full(2, math.nan)


class OnBoard(NamedTuple):
    """What the vehicle, or its base station, made of the same segment; NaN if it did not.

    Each of shape (2,): north, east.
    """

    dac_mps: np.ndarray = NOT_KNOWN  #: depth-averaged current (m/s)
    way_m: np.ndarray = NOT_KNOWN  #: way through the water (m)
    #: Its own estimate of where it came up (m of the flight's first fix).
    surfaced_m: np.ndarray = NOT_KNOWN


class Polar(NamedTuple):
    """Lift and drag of a glider as functions of angle of attack alpha and dynamic pressure q (Pa).

    Lift q A a alpha, drag q A (b q^s + c alpha^2), where A is an area.
    """

    lift: float  #: a (1/rad)
    drag: float  #: b (Pa^-s)
    induced: float  #: c (1/rad^2)
    exponent: float  #: s
    area_m2: float  #: A (m^2)
    shallowest_rad: float  #: at shallower pitch the polar does not hold (rad)


class Segment(NamedTuple):
    """From one surface interval to the next."""

    #: Of the file that it begins in.
    name: str
    before: Fixes
    after: Fixes
    samples: Samples
    on_board: OnBoard
    polar: Polar


class Instruments(NamedTuple):
    """What was recorded over a whole flight, all of shape (n,), in the order of time.

    NaN where it is not known.
    """

    time_s: np.ndarray  #: time (s since 1970)
    depth_m: np.ndarray  #: depth (m, + down), of the finest pressure that was recorded
    pitch_rad: np.ndarray  #: pitch (rad, + nose up)
    roll_rad: np.ndarray  #: roll (rad, + to starboard)
    heading_rad: np.ndarray  #: heading (rad from true north, + to east)
    pumped_m3: np.ndarray  #: volume of the buoyancy engine (m^3, + rises)
    mass_x_m: np.ndarray  #: position of the pitch mass (m, + forward: nose down)
    mass_roll_rad: np.ndarray  #: angle of the roll mass (rad, + to starboard)
    surface_rad: np.ndarray  #: angle of the steering surface (rad, + nose to starboard)
    temperature_degc: np.ndarray  #: temperature in situ (deg C, ITS-90)
    salinity: np.ndarray  #: practical salinity (-)
    #: Vertical rate (m/s, + down) of the flight model of the vehicle's makers.
    own_rate_mps: np.ndarray


class Flight(NamedTuple):
    """A recorded flight."""

    kind: str  #: kind of files: 'slocum', 'seaglider' or 'og1'
    #: Names of the files that were read.
    files: list[str]
    segments: list[Segment]
    notes: list[str]  #: what a person should know of the files: a sentence each
    origin_deg: np.ndarray  #: latitude and longitude of its first fix (degrees), shape (2,)
    instruments: Instruments | None = None  #: what else was recorded; None if it was not asked for
    #: Constants of the body that the files name: mass_kg, and volume_m3 with the engine at zero.
    #: Those of a base station for compressibility belong to its own way of computing.
    body: dict[str, float] | None = None
    #: Over what the vehicle's own current is a mean; a base station counts the drift, too.
    on_board_over: str = 'under water'
    model: str = ''  #: what a file in OG1 calls the vehicle; '' if it does not say

    @property
    def label(self) -> str:
        """Its files, as an error names them."""
        return ' to '.join(dict.fromkeys((self.files[0], self.files[-1])))


Item = TypeVar('Item')
SamplesOrInstruments = TypeVar('SamplesOrInstruments', Samples, Instruments)


def instruments(time_s: np.ndarray, **known: np.ndarray) -> Instruments:
    """Instruments of which some are known, all at the same times; other names are no matter."""
    nothing = np.full(len(time_s), math.nan)
    return Instruments(
        time_s, **{name: known.get(name, nothing) for name in Instruments._fields[1:]}
    )


def joined(parts: Iterable[Instruments]) -> Instruments:
    """Instruments of several files, in the order of time."""
    table = np.concatenate([np.stack(part) for part in parts], axis=1)
    return Instruments(*table[:, np.argsort(table[0], kind='stable')])


def in_order(values: SamplesOrInstruments, needed: int) -> SamplesOrInstruments:
    """Values in the order of time, each time once, where the first ``needed`` are known."""
    table = np.stack(values)
    table = table[:, np.isfinite(table[:needed]).all(axis=0)]
    return type(values)(*table[:, np.unique(table[0], return_index=True)[1]])


def usual(values: Sequence[float]) -> float:
    """The median of what is known; NaN if nothing is."""
    values = np.asarray(values, float)
    values = values[np.isfinite(values)]
    return float(np.median(values)) if len(values) else math.nan


def usable(degrees: np.ndarray) -> np.ndarray:
    """Which latitudes and longitudes (degrees, last axis) a fix can have; 0, 0 is none."""
    return (np.abs(degrees) <= (90.0, 180.0)).all(axis=-1) & degrees.any(axis=-1)


def local_metres(origin_deg: np.ndarray, latitude_deg, longitude_deg) -> np.ndarray:
    """North and east (m, last axis) of an origin (latitude, longitude in degrees)."""
    latitude_deg, longitude_deg = np.asarray(latitude_deg), np.asarray(longitude_deg)
    turned = within_180(longitude_deg - origin_deg[1])
    scale = np.cos(np.radians(0.5 * (latitude_deg + origin_deg[0])))
    north = (latitude_deg - origin_deg[0]) * METRES_PER_DEGREE
    return np.stack([north, turned * scale * METRES_PER_DEGREE], axis=-1)


def at_bound(name: str, value: float, unit: str) -> str:
    """Say that a fitted number ran to its bound."""
    return f'{name} ran to its bound, {value:g} {unit}: the flight does not tell it'


def at_times(
    time_s: np.ndarray,
    own_s: np.ndarray,
    values: np.ndarray,
    gap_s: float = math.inf,
    idle_s: np.ndarray = NEVER,
) -> np.ndarray:
    """Values with times of their own at other times, linear between them.

    NaN beyond them, where there are none, and inside a gap that is longer than ``gap_s``. A gap
    ends at the times ``idle_s``, when nothing needs to be known.
    """
    good = np.isfinite(own_s) & np.isfinite(values)
    if not good.any():
        return np.full(len(time_s), math.nan)
    order = np.argsort(own_s[good], kind='stable')
    own_s, values = own_s[good][order], values[good][order]
    found = np.interp(time_s, own_s, values, left=math.nan, right=math.nan)
    known_s = np.union1d(own_s, idle_s)
    after = np.searchsorted(known_s, time_s).clip(1, None)
    lasts_s = np.append(known_s, math.inf)[after] - known_s[after - 1]
    return np.where((lasts_s > gap_s) & ~np.isin(time_s, known_s), math.nan, found)


def angles_at_times(
    time_s: np.ndarray,
    own_s: np.ndarray,
    angles: np.ndarray,
    gap_s: float = math.inf,
    idle_s: np.ndarray = NEVER,
) -> np.ndarray:
    """The same for angles (rad), across north."""
    east, north = (
        at_times(time_s, own_s, part(angles), gap_s, idle_s) for part in (np.sin, np.cos)
    )
    return np.arctan2(east, north)


def samples_of(
    time_s: np.ndarray, depth_m: np.ndarray, pitch, heading, turn=0.0, buoyancy_kg=None
) -> Samples:
    """Samples at some times, of pitch and heading (rad), pairs of times of their own and values.

    Both are NaN in a gap; at the surface they need not be recorded. The heading is turned by so
    much (rad).
    """
    gap = LONGEST_GAP_S, time_s[depth_m <= SURFACE_DEPTH_M]
    heading_rad = angles_at_times(time_s, *heading, *gap) + turn
    if buoyancy_kg is None:
        buoyancy_kg = np.full(len(time_s), math.nan)
    return Samples(time_s, depth_m, at_times(time_s, *pitch, *gap), heading_rad, buoyancy_kg)


def vertical_rate(time_s: np.ndarray, depth_m: np.ndarray, over_s: float = 15.0) -> np.ndarray:
    """Vertical rate (m/s, + down), shape (n,): the slope of depth over about ``over_s``."""
    begin = np.maximum(time_s - 0.5 * over_s, time_s[0])
    end = np.minimum(time_s + 0.5 * over_s, time_s[-1])
    index = np.arange(len(time_s))
    # With samples that are further apart, the neighbours.
    begin = np.minimum(begin, time_s[np.maximum(index - 1, 0)])
    end = np.maximum(end, time_s[np.minimum(index + 1, len(time_s) - 1)])
    first, last = np.interp(begin, time_s, depth_m), np.interp(end, time_s, depth_m)
    return (last - first) / (end - begin)


# ---------------------------------------------------------------------------------- segments


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
    model: str = ''  #: see `glider_flights.record.Flight`

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
    turned = [file.name for file in files if (np.diff(file.time_s) < 0.0).any()]
    if turned:
        notes = [*notes, f'time goes back in {", ".join(turned)}: its samples are sorted by it']
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
        model=next((file.model for file in files if file.model), ''),
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
        file = ([file for file in files if file.begin_s <= middle] or files[:1])[-1]
        segments.append(Segment(file.name, *one, file.on_board(one.samples), file.polar))
    return segments, notes


class Cut(NamedTuple):
    """A segment as it was cut."""

    before: Fixes
    after: Fixes
    samples: Samples


def stays(fixes: Fixes, samples: Samples) -> list[Fixes]:
    """Fixes by surface interval, without those reported while deep and those far off."""
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
    """The most fixes of a stay that a drifting vehicle can have had one after the other.

    Of as many the later ones: the first may be from where it dived.
    """
    count = len(fixes.time_s)
    longest, previous = np.ones(count, int), np.arange(count)
    for one in range(1, count):
        apart_m = np.hypot(*(fixes.place_m[:one] - fixes.place_m[one]).T)
        drifted_m = FASTEST_MPS * (fixes.time_s[one] - fixes.time_s[:one])
        before = np.where(apart_m <= FAR_OFF_M + drifted_m, longest[:one], 0)
        if before.any():
            previous[one] = before.argmax()
            longest[one] += before.max()
    kept = [count - 1 - int(longest[::-1].argmax())]
    while previous[kept[-1]] != kept[-1]:
        kept.append(previous[kept[-1]])
    return Fixes(fixes.time_s[kept[::-1]], fixes.place_m[kept[::-1]])


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
