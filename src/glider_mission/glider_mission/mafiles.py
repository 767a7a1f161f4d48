# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""Files of a Slocum's mission, read and written: ``goto_l10.ma``, ``yo10.ma``, ``surfac10.ma``.

Each has one behavior: a list of waypoints, a yo, or surfacing. Its arguments stand in lines such
as ``b_arg: d_target_depth(m) 200``; what follows a # is a comment. A waypoint is a line, longitude
first, in degrees and minutes as one number: -5230.0 is 52 deg 30 min W. Angles are in radians,
+ nose up, oil in cc, + makes light. Names and meanings: the masterdata of Teledyne Webb Research,
as in files that pilots publish.
"""

import codecs
import math
import re
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

from glider_base.errors import shown
from glider_base.files import read_bytes
from glider_base.settings import limits
from glider_base.signals import SEA_WATER_DENSITY
from glider_guidance.yo.machine import ProfileSettings

#: How such a file ends.
SUFFIX = '.ma'
#: A waypoint is reached within this distance in a file that is written (m).
REACHED_M = 100.0
#: Field of a profile that names such files.
FIELD = 'mafiles'
#: Field of a path that may name a goto list.
PLACES = 'waypoints_latlon'
#: Degrees, and kg, that are read are rounded to so many decimals, so that 30 deg come back.
_DECIMALS = 9
#: Latitudes and longitudes (deg) likewise: 11 micrometres.
_PLACE_DECIMALS = 10
_ARGUMENT = re.compile(r'b_arg:\s*(\w+)\s*(?:\([^)]*\))?\s+(\S+)')
_BEHAVIOR = re.compile(r'behavior_name\s*=\s*(\w+)', re.IGNORECASE)


class _Of(NamedTuple):
    """An argument that is a field of the profile."""

    unit: str
    field: str
    scale: float = 1.0  #: of the field, for one of the argument
    negative: str = ''  #: what an argument below 0 means, which the field says by 0


class _Only(NamedTuple):
    """An argument that has to have one of some values: what else it could say cannot be flown."""

    unit: str
    allowed: dict[float, str]  #: values and what they mean; the first is written
    is_written: bool = True  #: an older Slocum may not know it
    is_needed: bool = False  #: without it, it would be another one


_DEG, _KG = math.degrees(1.0), 1e-6 * SEA_WATER_DENSITY
_SERVO, _ABSOLUTE = _Only('enum', {3: 'servo'}), _Only('enum', {2: 'absolute'})
_NO_THRUSTER = _Only('enum', {0: 'off'}, is_written=False)
_GOTO_LIST = {
    'initial_wpt': _Only('enum', {0: 'the first', -1: 'the next', -2: 'the closest'}),
    'num_legs_to_run': _Only('nodim', {-2: 'once through the list', -1: 'for ever'}),
}
_YO = {
    'start_when': _Only('enum', {2: 'pitch idle', 0: 'at once', 1: 'stack idle', 4: 'idle'}),
    'start_diving': _Only('bool', {1: 'dive first'}, is_written=False),
    'num_half_cycles_to_do': _Of('nodim', 'surface_every_dives', 0.5, 'without end'),
    'd_target_depth': _Of('m', 'depth_m'),
    'd_target_altitude': _Of('m', 'clearance_m', negative='off'),
    'd_use_bpump': _ABSOLUTE,
    'd_bpump_value': _Of('X', 'net_heaviness_kg', -_KG),
    'd_use_pitch': _SERVO,
    'd_pitch_value': _Of('X', 'pitch_deg', -_DEG),
    'd_use_thruster': _NO_THRUSTER,
    'c_target_depth': _Of('m', 'top_depth_m'),
    'c_target_altitude': _Only('m', {-1: 'off'}),
    'c_use_bpump': _ABSOLUTE,
    'c_bpump_value': _Of('X', 'climb_net_heaviness_kg', _KG),
    'c_use_pitch': _SERVO,
    'c_pitch_value': _Of('X', 'climb_pitch_deg', _DEG),
    'c_use_thruster': _NO_THRUSTER,
    'end_action': _Only('enum', {2: 'resume'}),
}
_SURFACE = {
    'start_when': _Only('enum', {2: 'pitch idle: the yo is done'}, is_needed=True),
    'end_action': _Only('enum', {1: 'wait for a call, then resume'}),
    'keystroke_wait_time': _Of('sec', 'wait_s'),
}
_ARGUMENTS = {'goto_list': _GOTO_LIST, 'yo': _YO, 'surface': _SURFACE}
#: Arguments that make no difference here, which docs/sea.md says.
_IGNORED = {
    'goto_list': {
        *('args_from_file', 'start_when', 'list_stop_when', 'list_when_wpt_dist', 'end_action'),
    },
    'yo': {
        'args_from_file',
        *(
            f'{way}_{name}'
            for way in 'dc'
            for name in (
                *('stop_when_hover_for', 'stop_when_stalled_for', 'speed_min', 'speed_max'),
                *('depth_rate_method', 'wait_for_pitch', 'wait_for_ballast', 'thruster_value'),
                *('delta_bpump_speed', 'delta_bpump_ballast', 'time_ratio', 'use_sc_model'),
                *('max_thermal_charge_time', 'max_pumping_charge_time', 'thr_reqd_pres_mul'),
            )
        ),
    },
    'surface': {
        *('args_from_file', 'when_secs', 'when_wpt_dist', 'when_utc_timestamp', 'when_utc_min'),
        *('when_utc_hour', 'when_utc_day', 'when_utc_month', 'when_utc_on_surface'),
        *('end_wpt_dist', 'report_all', 'gps_wait_time', 'gps_postfix_wait_time'),
        *('min_time_between_gps_fixes', 'sensor_input_wait_time', 'printout_cycle_time'),
        *('force_iridium_use', 'strobe_on', 'c_use_bpump', 'c_bpump_value', 'c_use_pitch'),
        *('c_pitch_value', 'c_use_thruster', 'c_thruster_value', 'c_stop_when_air_pump'),
    },
}
#: Fields of the climb, and those of the dive that they are without one of their own.
_AS_IN_DIVE = {'climb_pitch_deg': 'pitch_deg', 'climb_net_heaviness_kg': 'net_heaviness_kg'}


class _Line(NamedTuple):
    """A line without its comment, and where it stands: file and number."""

    where: str
    text: str


class _File(NamedTuple):
    """A file as it was read."""

    name: str  #: of the file
    behavior: str
    arguments: dict[str, tuple[str, float]]  #: by name, where it stands and its value
    lines: list[_Line]


def _read(file: Path, behaviors: Sequence[str]) -> _File:
    """Read a file of one of some behaviors.

    A ValueError names file, line, value and what is allowed.
    """
    # Comments are in whatever encoding the pilot's editor had, which may begin with its mark.
    text = read_bytes(file).removeprefix(codecs.BOM_UTF8).decode('latin-1')
    lines = [
        _Line(f'{file}: line {number}', line.partition('#')[0].strip())
        for number, line in enumerate(text.split('\n'), 1)
    ]
    names = [found[1].lower() for line in lines if (found := _BEHAVIOR.fullmatch(line.text))]
    if len(names) != 1 or names[0] not in behaviors:
        raise ValueError(
            f'{file}: behavior_name = {", ".join(map(shown, names)) or "missing"} (allowed: '
            f'behavior_name={" or behavior_name=".join(behaviors)})'
        )
    read = _File(str(file), names[0], {}, lines)
    for line in _section(read, 'b_arg'):
        name, value = _argument(line)
        if name in read.arguments:
            raise ValueError(f'{line.where}: {name}: given twice (allowed: once)')
        read.arguments[name] = line.where, value
    return read


def _section(read: _File, name: str) -> list[_Line]:
    """Lines with something in them between the start and the end of a section."""
    begin, end = f'<start:{name}>', f'<end:{name}>'
    texts = [line.text for line in read.lines]
    if begin not in texts or end not in texts[texts.index(begin) :]:
        raise ValueError(f'{read.name}: no section (needed: {begin} and {end})')
    first = texts.index(begin) + 1
    return [line for line in read.lines[first : texts.index(end, first)] if line.text]


def _argument(line: _Line) -> tuple[str, float]:
    """Name and value of an argument."""
    found = _ARGUMENT.fullmatch(line.text)
    try:
        value = float(found[2]) if found else math.nan
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise ValueError(
            f'{line.where}: {shown(line.text)}: no argument (allowed: one with a number, such as '
            'b_arg: d_target_depth(m) 200)'
        )
    return found[1], value


def _check(read: _File, also: Sequence[str] = ()) -> None:
    """Refuse arguments that are not known, but for some, or ask for what is not flown here."""
    known = _ARGUMENTS[read.behavior]
    for name, (where, value) in read.arguments.items():
        if name not in {*known, *_IGNORED[read.behavior], *also}:
            raise ValueError(f'{where}: {name}: unknown (allowed: {", ".join([*known, *also])})')
        only = known.get(name)
        if isinstance(only, _Only) and value not in only.allowed:
            raise ValueError(f'{where}: {name} = {value:g}: not flown here ({_words(only)})')
    for name, only in known.items():
        if isinstance(only, _Only) and only.is_needed and name not in read.arguments:
            raise ValueError(f'{read.name}: {name}: missing ({_words(only)})')


def _words(only: _Only) -> str:
    """What an argument is allowed to be."""
    return 'allowed: ' + ', '.join(f'{value} ({word})' for value, word in only.allowed.items())


def read_goto_list(file: Path) -> list[tuple[float, float]]:
    """Latitude and longitude (deg) of the waypoints of a list.

    A ValueError names file, line, value and what is allowed.
    """
    read = _read(file, ['goto_list'])
    _check(read, ['num_waypoints'])
    found = [_place(line) for line in _section(read, 'waypoints')]
    if not found:
        raise ValueError(f'{read.name}: no waypoints (allowed: one and more)')
    where, count = read.arguments.get('num_waypoints', (read.name, len(found)))
    if count not in range(1, len(found) + 1):
        raise ValueError(
            f'{where}: num_waypoints = {count:g} (allowed: 1 to {len(found)}, as it has)'
        )
    return found[: int(count)]


def _place(line: _Line) -> tuple[float, float]:
    """Latitude and longitude (deg) of a line."""
    words = line.text.split()
    try:
        longitude, latitude = (_degrees(float(word)) for word in words[:2])
    except ValueError:
        longitude = latitude = math.nan
    if not (len(words) >= 2 and abs(latitude) <= 90.0 and abs(longitude) <= 180.0):
        raise ValueError(
            f'{line.where}: {shown(line.text)}: no waypoint (allowed: longitude and latitude, '
            'degrees and minutes as one number, such as -5230.000 4730.500)'
        )
    return latitude, longitude


def _degrees(value: float) -> float:
    """Degrees of degrees and minutes as one number; NaN if it is none, as with 60 minutes."""
    if not math.isfinite(value):
        return math.nan
    whole = math.trunc(value / 100.0)
    minutes = value - 100.0 * whole
    return round(whole + minutes / 60.0, _PLACE_DECIMALS) if abs(minutes) < 60.0 else math.nan


def read_profile(files: Any) -> dict[str, float | str | None]:
    """Fields of a profile that a yo file, a surfacing file or both say, by their path or paths.

    A ValueError names file, line, argument, value and what is allowed.
    """
    paths = [files] if isinstance(files, str) else files
    is_list = isinstance(paths, list | tuple) and all(isinstance(path, str) for path in paths)
    if not is_list or not paths:
        raise ValueError(
            f"{FIELD} = {shown(files)}: no files (allowed: a Slocum's yo*.ma, surfac*.ma or both)"
        )
    fields, seen = {}, {}
    for path in paths:
        read = _read(Path(path), ['yo', 'surface'])
        if read.behavior in seen:
            raise ValueError(
                f'{path}: {read.behavior}: {seen[read.behavior]} is one too (allowed: one of each)'
            )
        seen[read.behavior] = path
        _check(read)
        if read.behavior == 'yo':
            fields['mode'] = 'profile'
        for name, of in _ARGUMENTS[read.behavior].items():
            if isinstance(of, _Of) and name in read.arguments:
                fields[of.field] = _value(name, of, *read.arguments[name])
    for climb, dive in _AS_IN_DIVE.items():
        if climb in fields and fields[climb] == fields.get(dive):
            fields[climb] = None
    return fields


def _value(name: str, of: _Of, where: str, value: float) -> float:
    """What an argument makes of its field."""
    if of.negative and value < 0.0:
        return 0
    field = ProfileSettings.model_fields[of.field]
    found = limits(field)
    low, high = found.get('ge', found.get('gt')), found['le']
    is_above, is_whole = bool(of.negative) or 'gt' in found, field.annotation is int
    made = round(value * of.scale, _DECIMALS)
    if not low <= made <= high or (is_above and made == low) or (is_whole and made % 1.0):
        ends = sorted((low / of.scale + 0.0, high / of.scale))  # no -0
        words = [
            f'{ends[0]:g} to {ends[1]:g}',
            *([f'not {low:g}'] if is_above else []),
            *(['even'] if is_whole else []),
            *([f'or -1 ({of.negative})'] if of.negative else []),
        ]
        raise ValueError(f'{where}: {name} = {value:g}: not usable (allowed: {", ".join(words)})')
    return int(made) if is_whole else made


def from_folder(values: Any, folder: Path, is_named: bool = False) -> Any:
    """Values of a scenario's file, with the paths of a Slocum's files from the folder it is in.

    What ``is_named`` stands in a field that names such files.
    """
    if isinstance(values, str):
        is_file = is_named and values.lower().endswith(SUFFIX)
        return str(folder / values) if is_file else values
    if isinstance(values, list):
        return [from_folder(value, folder, is_named) for value in values]
    if isinstance(values, dict):
        return {
            name: from_folder(value, folder, name in (FIELD, PLACES))
            for name, value in values.items()
        }
    return values


def with_mafiles(profile: Any) -> Any:
    """A profile as a person wrote it, with what its files say in place of their names.

    A ValueError names a file that cannot be used, or a field that says something else.
    """
    if not isinstance(profile, dict) or FIELD not in profile:
        return profile
    beside = {name: value for name, value in profile.items() if name != FIELD}
    fields = read_profile(profile[FIELD])
    for name in fields.keys() & beside.keys():
        if beside[name] != fields[name]:
            raise ValueError(
                f'{name} = {shown(beside[name])}: {FIELD} say {shown(fields[name])} (allowed: one '
                'of the two alone)'
            )
    return {**beside, **fields}


def mafiles(
    name: str, places: Sequence[tuple[float, float]], profile: ProfileSettings
) -> dict[str, str]:
    """Files of a mission of this name, by their names.

    The waypoints, latitude and longitude (deg), are written to 2 mm. They are gone to once.
    """
    waypoints = [f'{_minutes(longitude)} {_minutes(latitude)}' for latitude, longitude in places]
    list_only = [
        'b_arg: start_when(enum) 0 # at once',
        'b_arg: list_stop_when(enum) 7 # near a waypoint',
        f'b_arg: list_when_wpt_dist(m) {REACHED_M:g}',
        f'b_arg: num_waypoints(nodim) {len(places)}',
    ]
    tail = ['<start:waypoints>', '# LON LAT', *waypoints, '<end:waypoints>']
    title = ' '.join(name.split())
    return {
        f'goto_l10{SUFFIX}': _text(title, 'goto_list', profile, list_only, tail),
        f'yo10{SUFFIX}': _text(title, 'yo', profile),
        f'surfac10{SUFFIX}': _text(title, 'surface', profile),
    }


def _text(
    name: str,
    behavior: str,
    profile: ProfileSettings,
    more: Sequence[str] = (),
    tail: Sequence[str] = (),
) -> str:
    """A file of a behavior, with more arguments, and what follows them."""
    written = [
        f'b_arg: {argument}({one.unit}) {_written(one, profile)}'
        for argument, one in _ARGUMENTS[behavior].items()
        if isinstance(one, _Of) or one.is_written
    ]
    lines = [
        f'behavior_name={behavior}',
        f'# {name}, written by ./glider export --to slocum',
        *('<start:b_arg>', *more, *written, '<end:b_arg>', *tail),
    ]
    return '\n'.join([*lines, ''])


def _written(one: _Of | _Only, profile: ProfileSettings) -> str:
    """Value of an argument, and what it means where it is no measure."""
    if isinstance(one, _Only):
        value, word = next(iter(one.allowed.items()))
        return f'{value} # {word}'
    value = getattr(profile, one.field)
    if value is None:
        value = getattr(profile, _AS_IN_DIVE[one.field])
    return f'-1 # {one.negative}' if one.negative and not value else _digits(value, one.scale)


def _digits(value: float, scale: float) -> str:
    """The shortest number that makes a field of this value when it is read."""
    texts = [f'{value / scale:.{decimals}f}' for decimals in range(16)]
    kept = round(value, _DECIMALS)
    return next((one for one in texts if round(float(one) * scale, _DECIMALS) == kept), texts[-1])


def _minutes(degrees: float) -> str:
    """Degrees and minutes as one number."""
    millionths = round(abs(degrees) * 60e6)
    whole, rest = divmod(millionths, 60_000_000)
    return f'{"-" if degrees < 0.0 else ""}{whole:02d}{rest / 1e6:09.6f}'
