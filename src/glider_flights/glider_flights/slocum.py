# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""Flights of a Slocum: a folder of dbd files (or of their kind) and the caches they need.

Names of sensors are those of the vehicle's masterdata. Its local mission coordinates (lmc) have
magnetic north as y. ``m_gps_mag_var`` is what is subtracted from a magnetic heading.
"""

import math
import re
import tempfile
from pathlib import Path
from typing import NamedTuple

import numpy as np

from glider_base.errors import ConfigurationError, installed
from glider_base.kernel import kernel
from glider_flights.folders import LATEST_S, Progress, declination_at, files_in, gsw, of_one_flight
from glider_flights.netcdf import PLAUSIBLE, names_of
from glider_flights.record import (
    NOT_KNOWN,
    Cut,
    Fixes,
    Flight,
    Instruments,
    OnBoard,
    Polar,
    Segment,
    angles_at_times,
    at_times,
    cut,
    instruments,
    local_metres,
    samples_of,
    usable,
    usual,
)

#: Kinds of files of the flight computer, fullest first: all that is measured, then what is sent.
KINDS = (('.dbd', '.dcd'), ('.mbd', '.mcd'), ('.sbd', '.scd'))
#: First letters of kinds of files of the science computer, by those of the flight computer.
SCIENCE = {'d': 'e', 'm': 'n', 's': 't'}
#: Folders in which the caches of a flight are, beside its files or above them.
CACHE_FOLDERS = ('cache', 'cac', '.dinkumcache', 'dinkumcache')
CACHES = '.cac'
#: So many folders above a flight may hold the folder of its caches.
CACHES_ABOVE = 2
#: How many lines the header of a file has, among its first bytes.
HEADER_LINES, HEADER_BYTES = re.compile(rb'^num_ascii_tags:\s*(\d+)', re.MULTILINE), 4096
#: Where its first cycle is after the header, and what a cycle and, often, the end begin with.
FIRST_CYCLE, CYCLE_TAG, LAST_TAG = 16, ord('d'), b'X'
#: State of a sensor that has a new value in a cycle.
UPDATED = 2
#: Name of a file on board: vehicle, year, day of the year, mission of the day, segment.
WRITTEN = re.compile(r'(.+)-(\d+)-(\d+)-(\d+)-(\d+)')
#: Times in one file are no further apart than this (s).
LONGEST_FILE_S = 20 * 86_400.0
#: Our names of what is ignored whatever it says.
OURS = {
    **{'m_depth': 'depth_m', 'm_pitch': 'pitch_rad', 'm_heading': 'heading_rad'},
    'sci_water_temp': 'temperature_degc',
}
#: Without these nothing can be reckoned.
NEEDED = ('m_depth', 'm_pitch', 'm_heading', 'm_gps_lat', 'm_gps_lon')
WANTED = (
    *('m_gps_mag_var', 'm_speed', 'm_lat', 'm_lon', 'm_dr_time'),
    *('m_final_water_vx', 'm_final_water_vy', 'm_water_vx', 'm_water_vy'),
)
#: What the science computer says of the water.
WATER = ('sci_water_pressure', 'sci_water_cond', 'sci_water_temp')
#: When the CTD measured, of which the times of the file are up to a second off.
CTD_TIMES = ('sci_ctd41cp_timestamp', 'sci_rbrctd_timestamp')
#: No further off than this, or they are of something else (s).
CTD_LATE_S = 10.0
#: Unit of pressures (dbar) and of conductivity (mS/cm) there.
BAR, SIEMENS_PER_METRE = 10.0, 10.0
#: Merckelbach, Smeed and Griffiths (2010), doi:10.1175/2009JTECHO710.1: lift slopes 3.8 of the
#: hull and 3.73 of the wings, drag 0.15 + 10.5 alpha^2, area 0.1 m^2.
POLAR = Polar(
    lift=7.53,
    drag=0.15,
    induced=10.5,
    exponent=0.0,
    area_m2=0.1,
    shallowest_rad=math.radians(11.3),
)
#: The vehicle's own current is of the same dive if the time it reckoned for is, up to this share.
SAME_TIME = 0.2
#: The current of a segment is reported until so long after the next dive has begun (s).
LATE_S = 60.0

Names = tuple[str, ...]
Sensors = dict[str, tuple[np.ndarray, np.ndarray]]


def slocum_files(place: Path) -> list[Path]:
    """Files of the flight computer, each of its fullest kind; plain before compressed."""
    suffixes = [suffix for kind in KINDS for suffix in kind]
    files = files_in(place, lambda path: path.suffix.lower() in suffixes)
    by_stem: dict[str, Path] = {}
    for path in sorted(files, key=lambda path: suffixes.index(path.suffix.lower())):
        by_stem.setdefault(path.stem.lower(), path)
    return sorted(by_stem.values())


def read_slocum(
    place: Path, cache: Path | None, progress: Progress, whole: bool = False
) -> Flight:
    """Read a flight; without a folder of caches they are looked for.

    With ``whole`` its instruments too, those of the science computer from the files beside.
    Raises ConfigurationError.
    """
    files = slocum_files(place)
    listed = NEEDED + WANTED
    if whole:
        names = (name for of in names_of('slocum').values() for name in of)
        listed += ('m_pressure', *(name for name in names if name not in (*NEEDED, *WATER)))
    sensors, files, names, notes = read_sensors(files, cache, progress, listed, NEEDED[:3])
    missing = [name for name in NEEDED if not len(sensors[name][0])]
    if missing:
        raise ConfigurationError(
            f'{place}: no value of {", ".join(missing)} in its {len(files)} files '
            f'*{files[0].suffix} (needed: {", ".join(NEEDED)})'
            + ''.join(f'; {note}' for note in notes)
        )
    origin, fixes = _fixes(sensors)
    declined = usual(sensors['m_gps_mag_var'][1])
    if math.isnan(declined):
        declination, source = declination_at(*origin, usual(sensors['m_gps_lat'][0]))
        declined = -declination
        notes.append(f'm_gps_mag_var is not recorded: magnetic north is {source}')
    attitude = (sensors[name] for name in ('m_pitch', 'm_heading'))
    cuts, left_out = cut(fixes, samples_of(*sensors['m_depth'], *attitude, -declined))
    ends = [*(one.before.time_s[-1] for one in cuts), math.inf][1:]
    segments = [
        Segment(
            _file_at(names, one.before.time_s[-1]),
            *one,
            on_board=_on_board(sensors, one, end, declined, origin),
            polar=POLAR,
        )
        for one, end in zip(cuts, ends, strict=True)
    ]
    recorded = None
    if whole:
        beside = [path for path in map(_science_file, files) if path is not None]
        water = dict.fromkeys(WATER + CTD_TIMES, (np.empty(0), np.empty(0)))
        if beside:
            try:
                water, _, _, unread = read_sensors(beside, cache, progress, WATER + CTD_TIMES)
            except ConfigurationError as error:
                unread = [f'no water: {error}']
            notes += unread
        recorded = _instruments(sensors | _by_ctd(water), declined, origin)
    return Flight(
        kind='slocum',
        files=[path.name for path in files],
        segments=segments,
        notes=notes + left_out,
        origin_deg=origin,
        instruments=recorded,
    )


def _science_file(path: Path) -> Path | None:
    """File of the science computer that belongs to one of the flight computer."""
    of_stem = {one.suffix.lower(): one for one in path.parent.glob(f'{path.stem}.*')}
    _, first, packed, _ = path.suffix.lower()
    kinds = (f'.{SCIENCE[first]}{letter}d' for letter in (packed, *'bc'))
    return next((of_stem[suffix] for suffix in kinds if suffix in of_stem), None)


def _by_ctd(water: Sensors) -> Sensors:
    """What the CTD measured, by its own times where these are recorded."""
    for name in CTD_TIMES:
        file_s, own_s = water[name]
        good = np.abs(own_s - file_s) < CTD_LATE_S
        if good.sum() > 1:
            file_s, own_s = file_s[good], own_s[good]
            timed = {}
            for one in WATER:
                _, mine, theirs = np.intersect1d(water[one][0], file_s, return_indices=True)
                timed[one] = (own_s[theirs], water[one][1][mine])
            return timed
    return water


def _instruments(sensors: Sensors, declined: float, origin: np.ndarray) -> Instruments:
    """What was measured, at the times of the finest pressure."""
    pressures = {
        name: (sensors[name][0], BAR * sensors[name][1])
        for name in ('sci_water_pressure', 'm_pressure')
    }
    own_s, dbar = max(pressures.values(), key=lambda pair: len(pair[0]))
    time_s, depth_m = own_s, -gsw().z_from_p(dbar, origin[0])
    if not len(time_s):
        time_s, depth_m = sensors['m_depth']

    measured = {'heading_rad': angles_at_times(time_s, *sensors['m_heading']) - declined}
    for key, names in names_of('slocum').items():
        readings = [scale * at_times(time_s, *sensors[name]) for name, scale in names.items()]
        measured[key] = max(readings, key=lambda values: int(np.isfinite(values).sum()))
    measured['salinity'] = gsw().SP_from_C(
        SIEMENS_PER_METRE * at_times(time_s, *sensors['sci_water_cond']),
        measured['temperature_degc'],
        gsw().p_from_z(-depth_m, origin[0]),
    )
    return instruments(time_s, depth_m=depth_m, **measured)


class DbdFile(NamedTuple):
    """What one file says."""

    path: Path
    vehicle: str
    #: Numbers in its name on board: year, day of the year, mission, segment.
    written: tuple[int, ...]
    #: Sensors that it lists, by name, whether or not they have values.
    sensors: Sensors
    is_cut: bool

    @property
    def name(self) -> str:
        """Name of the file."""
        return self.path.name

    @property
    def time_s(self) -> np.ndarray:
        """Times of all of its values (s since 1970)."""
        return np.concatenate([np.empty(0), *(times for times, _ in self.sensors.values())])


def read_sensors(
    files: list[Path], cache: Path | None, progress: Progress, names: Names, needed: Names = ()
) -> tuple[Sensors, list[Path], list[tuple[float, str]], list[str]]:
    """Read the files of one computer.

    Returns sensors by name, of which one that was never recorded has no times; the files that were
    read; when each begins (s since 1970) with its name; what is to be said of them. A file without
    a sensor that is needed is left out, as is one that cannot be read, or is not of the flight of
    the others. Raises ConfigurationError if that leaves none.
    """
    found, left_out = _read_files(files, cache, progress, names)
    found.sort(key=lambda file: file.written)
    for file in found:
        missing = [name for name in needed if name not in file.sensors]
        if missing and len(files) > 1:
            left_out[file.name] = f'no {", ".join(missing)} in it'
    found, notes = of_one_flight(files[0].parent, found, left_out)
    cut = [file.name for file in found if file.is_cut]
    if cut:
        notes.append(f'read as far as it goes: {", ".join(cut)}: cut short or damaged')
    for name in names:
        lack = [file.name for file in found if name not in file.sensors]
        if 0 < len(lack) < len(found):
            notes.append(f'no {name} in {", ".join(lack)}')
    begun = [
        (float(file.sensors['m_depth'][0][0]), file.name)
        for file in found
        if 'm_depth' in file.sensors and len(file.sensors['m_depth'][0])
    ]
    sensors = {
        name: _joined([file.sensors[name] for file in found if name in file.sensors])
        for name in names
    }
    return sensors, [file.path for file in found], sorted(begun), notes


def _read_files(
    files: list[Path], cache: Path | None, progress: Progress, names: Names
) -> tuple[list[DbdFile], dict[str, str]]:
    """The files that can be read, and why others cannot, by name."""
    with installed(f'{files[0]}: dbdreader, which reads the files of a Slocum'):
        from dbdreader import DbdError

    found, left_out = [], {}
    with tempfile.TemporaryDirectory() as scratch:
        _gather_caches(files[0].parent, cache, Path(scratch))
        for number, path in enumerate(files):
            progress(number, len(files))
            try:
                found.append(_read_file(path, Path(scratch), names))
            except Exception as error:  # noqa: BLE001 - of a damaged file dbdreader says anything
                lacking = getattr(getattr(error, 'data', None), 'missing_cache_files', None)
                known = isinstance(error, (DbdError, ConfigurationError))
                kind = '' if known else f'{type(error).__name__}: '
                left_out[path.name] = f'cannot be read: {kind}{error}'
                if lacking:
                    left_out[path.name] = (
                        f'its cache {"".join(lacking)}.cac is neither beside it nor in a folder '
                        f'{" or ".join(CACHE_FOLDERS[:2])} there or above; give the folder that '
                        'has it with --cache'
                    )
    return found, left_out


def _read_file(path: Path, scratch: Path, names: Names) -> DbdFile:
    """Read a file, by the caches in a folder; what dbdreader raises."""
    from dbdreader import DBD

    plain, is_cut = path, False
    if path.suffix.lower()[2] == 'c':
        # dbdreader takes the whole process down with a compressed file that is damaged.
        plain = scratch / 'plain.dbd'
        is_cut = _decompress(path, plain)
    content = plain.read_bytes()
    # Of a header without its last line dbdreader reads for ever.
    lines = HEADER_LINES.search(content, 0, HEADER_BYTES)
    if not lines or not content.count(b'\n', 0, lines.end()) < int(lines[1]) < HEADER_BYTES:
        raise ConfigurationError('it has no whole header')
    dbd = DBD(str(plain), str(scratch))
    known = [name for name in names if dbd.has_parameter(name)]
    read = dbd.get(*known) if len(known) > 1 else [dbd.get(*known)] if known else []
    written = WRITTEN.match(str(dbd.headerInfo.get('full_filename', '')))
    return DbdFile(
        path,
        written[1] if written else '',
        tuple(map(int, written.groups()[1:])) if written else (),
        {name: _plausible(name, *pair) for name, pair in zip(known, read, strict=True)},
        is_cut or _is_cut(content, dbd),
    )


def _is_cut(content: bytes, dbd) -> bool:
    """Whether a file, opened, ends within a cycle or is damaged before its end."""
    begin, sizes = dbd.fp_binary_start + FIRST_CYCLE, np.array(dbd.byteSizes)
    bytes_ = np.frombuffer(content, np.uint8)
    at = _end_of_cycles(bytes_, begin, sizes, dbd.n_state_bytes)
    return at > len(content) or content[at : at + 1] not in (b'', LAST_TAG)


@kernel
def _end_of_cycles(content, at, sizes, n_state_bytes):
    """Where the cycles of a file end that begin at ``at``: past its end if it ends in one.

    Two bits a sensor, of its number of bytes in ``sizes``, say whether a cycle has its value.
    """
    if 4 * n_state_bytes < len(sizes):
        return len(content) + 1
    while at < len(content) and content[at] == CYCLE_TAG:
        states = content[at + 1 : at + 1 + n_state_bytes]
        at += 1 + n_state_bytes
        if at > len(content):
            return at
        for i in range(len(sizes)):
            if states[i // 4] >> (6 - 2 * (i % 4)) & 3 == UPDATED:
                at += sizes[i]
    return at


def _decompress(path: Path, plain: Path) -> bool:
    """Write a compressed file out as far as it is whole; whether it is cut."""
    from dbdreader.decompress import Decompressor
    from lz4.block import LZ4BlockError

    with Decompressor(str(path)) as blocks, plain.open('wb') as file:
        try:
            for block in blocks.decompressed_blocks():
                file.write(block)
        except LZ4BlockError:
            return True
    return False


def _plausible(name: str, time_s: np.ndarray, values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Values of one sensor that a glider can have, with their times."""
    good = np.isfinite(values) & (time_s > 0.0) & (time_s < LATEST_S)
    lowest, highest = PLAUSIBLE.get(OURS.get(name), (-math.inf, math.inf))
    good &= (values >= lowest) & (values <= highest)
    if good.any():
        good &= np.abs(time_s - np.median(time_s[good])) < LONGEST_FILE_S
    return time_s[good], values[good]


def _gather_caches(folder: Path, cache: Path | None, into: Path) -> None:
    """Link all caches that may be meant into one folder, by lower-case names as are looked for."""
    places = [cache]
    if cache is None:
        above = [folder.resolve(), *folder.resolve().parents[:CACHES_ABOVE]]
        places = [folder, *(one / name for one in above for name in CACHE_FOLDERS)]
    for place in places:
        for path in sorted(place.iterdir()) if place.is_dir() else ():
            link = into / path.name.lower()
            if path.suffix.lower() == CACHES and not link.exists():
                link.symlink_to(path.resolve())


def _joined(pairs: list) -> tuple[np.ndarray, np.ndarray]:
    """Times and values of one sensor from all files, in the order of time."""
    times, values = np.concatenate([np.empty((2, 0)), *map(np.asarray, pairs)], axis=1)
    order = np.argsort(times, kind='stable')
    return times[order], values[order]


def _places(sensors: Sensors, latitude: str, longitude: str) -> tuple[np.ndarray, np.ndarray]:
    """Times and degrees, shape (n, 2), of what was recorded as latitude and longitude."""
    (time_s, north), (own_s, east) = sensors[latitude], sensors[longitude]
    _, first, second = np.intersect1d(time_s, own_s, return_indices=True)
    degrees = np.stack([north[first], east[second]], axis=-1)
    good = usable(degrees)
    return time_s[first][good], degrees[good]


def _fixes(sensors: Sensors) -> tuple[np.ndarray, Fixes]:
    """The first fix (degrees), and all of them in metres of it."""
    time_s, degrees = _places(sensors, 'm_gps_lat', 'm_gps_lon')
    if not len(time_s):
        return np.zeros(2), Fixes(time_s, np.empty((0, 2)))
    return degrees[0], Fixes(time_s, local_metres(degrees[0], *degrees.T))


def _on_board(
    sensors: Sensors, one: Cut, end_s: float, declined: float, origin: np.ndarray
) -> OnBoard:
    """What the vehicle made of a segment: its last current before the next dive is the one."""
    begin_s, surfaced_s = one.before.time_s[-1], one.after.time_s[0]
    dac = NOT_KNOWN
    for pair in (('m_final_water_vx', 'm_final_water_vy'), ('m_water_vx', 'm_water_vy')):
        if np.isnan(dac).any():
            pair_mps = [_last(sensors[name], surfaced_s - LATE_S, end_s + LATE_S) for name in pair]
            dac = _true(pair_mps[0], pair_mps[1], declined)
    reckoned_s = _last(sensors['m_dr_time'], surfaced_s - LATE_S, end_s + LATE_S, above=0.0)
    if abs(reckoned_s - (surfaced_s - begin_s)) > SAME_TIME * (surfaced_s - begin_s):
        dac = NOT_KNOWN
    speed_s, speed = sensors['m_speed']
    way = NOT_KNOWN
    inside = (speed_s >= begin_s) & (speed_s <= surfaced_s)
    if inside.sum() > 1:
        time_s, level = speed_s[inside], np.maximum(speed[inside], 0.0)
        heading = at_times(time_s, one.samples.time_s, np.unwrap(one.samples.heading_rad))
        velocity = np.nan_to_num([level * np.cos(heading), level * np.sin(heading)])
        way = (0.5 * (velocity[:, 1:] + velocity[:, :-1]) * np.diff(time_s)).sum(axis=1)
    time_s, degrees = _places(sensors, 'm_lat', 'm_lon')
    under = (time_s > begin_s) & (time_s < surfaced_s)
    estimated = local_metres(origin, *degrees[under][-1]) if under.any() else NOT_KNOWN
    return OnBoard(dac, way, estimated)


def _true(x: float, y: float, declined: float) -> np.ndarray:
    """North and east of a vector in local mission coordinates."""
    cosine, sine = math.cos(declined), math.sin(declined)
    return np.array([y * cosine + x * sine, x * cosine - y * sine])


def _last(
    pair: tuple[np.ndarray, np.ndarray], begin_s: float, end_s: float, above: float = -math.inf
) -> float:
    """The last value in a time that is above a limit; NaN if there is none."""
    inside = (pair[0] > begin_s) & (pair[0] < end_s) & (pair[1] > above)
    return float(pair[1][inside][-1]) if inside.any() else math.nan


def _file_at(names: list[tuple[float, str]], time_s: float) -> str:
    """Name of the file that was being written at a time."""
    begun = [name for begin_s, name in names if begin_s <= time_s]
    return begun[-1] if begun else names[0][1]
