# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""A run as an xarray Dataset: every number of every topic over time, by name.

Topics are ENU and FLU; here everything is NED (world) and FRD (body), as in the scorecard and in
books on marine craft, SI and radians. `glider_base.frames` turns one into the other.
"""

from itertools import groupby
from operator import attrgetter
from typing import Any, NamedTuple

import numpy as np
import xarray
from xarray.plot.accessor import DataArrayPlotAccessor

from glider_base.frames import (
    angles_if_any,
    from_geodetic,
    odometry_from_wire,
    poses_from_wire,
    reference_from_wire,
    water_from_wire,
    wrench_from_wire,
)
from glider_base.kernel import kernel, source_digest
from glider_base.kernels.packing import put
from glider_base.signals import TICK_NS, Adaptation
from glider_base.wiring import NO_ECHO
from glider_bringup.scoring.outcome import as_reported
from glider_control.control import (
    SATURATED_BUOYANCY,
    SATURATED_PITCH,
    SATURATED_ROLL,
    SATURATED_SURFACE,
)
from glider_control.intake import REFUSED
from glider_guard.rows import ROWS
from glider_guidance.yo.stage import STAGE_NAMES
from glider_mission.blocks import COLUMNS
from glider_mission.scenario import Scenario
from glider_model.vehicle.file import steers_by

NED, FRD, PATH = 'NED', 'FRD', 'path'
#: Names of numbers, and what each is.
_PLACE = {'north': 'north', 'east': 'east', 'depth': 'depth, positive down'}
_ANGLES = {
    'roll': 'roll, starboard side down is positive',
    'pitch': 'pitch, nose up is positive',
    'heading': 'heading, clockwise from north',
}
_AXES = ('north', 'east', 'down')
_RATES = {'p': 'x axis', 'q': 'y axis', 'r': 'z axis'}
_COVARIANCE = {
    'north_variance': 'variance to the north',
    'north_east_covariance': 'covariance of north and east',
    'east_variance': 'variance to the east',
}
_UNITS = {'_nm': 'N m', '_radps': 'rad/s'}
#: What the battery says; less than nothing is not known.
_BATTERY = (
    ('voltage', 'V', 'voltage of the battery'),
    ('current', 'A', 'current of the battery, negative discharges'),
    ('charge', 'A h', 'charge that is left'),
    ('capacity', 'A h', 'charge of the full battery'),
    ('percentage', '1', 'share of the charge that is left'),
)
#: Stage of which nothing is known: a recording that began late.
_UNKNOWN_STAGE = -1

_ODOM, _REFERENCE = COLUMNS['odom'].start, COLUMNS['reference'].start
_CURRENT, _ESTIMATE = COLUMNS['current_velocity'].start, COLUMNS['current_estimate'].start
_WRENCH, _TRUTH = COLUMNS['wrench'].start, COLUMNS['ground_truth/odom'].start


class _Variable(NamedTuple):
    """One variable; its name is that of the topic, with ``_`` for ``/``, and of the quantity."""

    topic: str
    quantity: str
    unit: str
    text: str
    frame: str = ''

    @property
    def name(self) -> str:
        return f'{self.topic.replace("/", "_")}_{self.quantity}'

    @property
    def attributes(self) -> dict[str, str]:
        attributes = {'units': self.unit, 'long_name': self.text, 'topic': self.topic}
        if self.quantity == 'depth':
            attributes['positive'] = 'down'
        return attributes | ({'frame': self.frame} if self.frame else {})


def _each(
    topic: str, unit: str, what: str, texts: dict[str, str], frame: str = NED
) -> list[_Variable]:
    """A variable of each of these quantities; ``what`` begins what is said of it."""
    return [_Variable(topic, name, unit, f'{what}{text}', frame) for name, text in texts.items()]


def _position(topic: str, what: str) -> list[_Variable]:
    return _each(topic, 'm', f'{what}, ', _PLACE)


def _euler(topic: str, what: str) -> list[_Variable]:
    return _each(topic, 'rad', f'{what} ', _ANGLES)


def _velocity(topic: str, what: str, before: str = '') -> list[_Variable]:
    return _each(topic, 'm/s', f'{what}, ', {f'{before}{axis}': axis for axis in _AXES})


def _joints(topic: str, what: str, steers_by: str) -> list[_Variable]:
    found = [
        _Variable(topic, 'buoyancy_engine', 'kg', f'{what} net buoyancy, positive sinks'),
        _Variable(topic, 'pitch_mass', 'm', f'{what} pitch mass, positive forward', FRD),
        _Variable(topic, 'roll_mass', 'rad', f'{what} roll mass about the x axis', FRD),
    ]
    if steers_by:
        text = f'{what} angle, positive turns the nose to starboard'
        found.append(_Variable(topic, steers_by, 'rad', text, FRD))
    return found


def _learnt() -> list[_Variable]:
    found = []
    for field in Adaptation._fields:
        ending = next((one for one in _UNITS if field.endswith(one)), '')
        quantity = field.removesuffix(ending)
        text = f'learnt by control: {quantity.replace("_", " ")}'
        found.append(_Variable('adaptation', quantity, _UNITS.get(ending, '1'), text))
    return found


#: What `_turn` writes, in its order.
_TURNED = (
    *_position('odom', 'estimated position'),
    *(
        _Variable('odom', f'q_{part}', '1', f'attitude quaternion, FRD to NED, {part}', NED)
        for part in 'wxyz'
    ),
    _Variable('odom', 'u', 'm/s', 'velocity over ground, forward', FRD),
    _Variable('odom', 'v', 'm/s', 'velocity over ground, to starboard', FRD),
    _Variable('odom', 'w', 'm/s', 'velocity over ground, down', FRD),
    *_each('odom', 'rad/s', 'angular rate about the ', _RATES, FRD),
    *_euler('odom', 'estimated'),
    *_position('reference', 'virtual target'),
    *_euler('reference', 'desired'),
    *_velocity('reference', 'desired velocity over ground', 'velocity_'),
    *_each('reference', 'rad/s', 'desired rate of ', {f'{one}_rate': one for one in _ANGLES}),
    *_velocity('current_velocity', 'velocity of the water over ground'),
    *_velocity('current_estimate', 'velocity of the water, as guidance estimates it'),
    *_position('ground_truth/odom', 'true position'),
    *_euler('ground_truth/odom', 'true'),
    _Variable('wrench', 'heave_force', 'N', 'demanded force, down', FRD),
    _Variable('wrench', 'roll_moment', 'N m', 'demanded moment about the x axis', FRD),
    _Variable('wrench', 'pitch_moment', 'N m', 'demanded moment about the y axis', FRD),
)


def _same(steers_by: str) -> list[_Variable]:
    """What topics carry in the same numbers."""
    return [
        *_joints('joint_states', 'position:', steers_by),
        *_joints('demand', 'demanded by control:', steers_by),
        *_joints('command', 'commanded:', steers_by),
        *(_Variable('battery', name, unit, text) for name, unit, text in _BATTERY),
        _Variable('drop_weight', 'release', '1', '1 where the guard lets the weight go'),
        _Variable('tracking_error', 'along', 'm', 'ahead of the virtual target', PATH),
        _Variable('tracking_error', 'across', 'm', 'starboard of the virtual target', PATH),
        _Variable('tracking_error', 'below', 'm', 'below the virtual target', PATH),
        *_learnt(),
    ]


def _water(topic: str, what: str) -> list[_Variable]:
    return [*_velocity(topic, what)[:2], *_each(topic, 'm2 s-2', f'{what}, ', _COVARIANCE)]


#: What there is of sensors and estimates, by topic: nothing of it where navigation has none.
_BESIDE = {
    'imu': (
        *_euler('imu', 'measured'),
        *_each('imu', 'rad/s', 'measured angular rate about the ', _RATES, FRD),
    ),
    'pressure': (
        _Variable('pressure', 'absolute', 'Pa', 'measured pressure, with the air above'),
    ),
    'fix': (
        _Variable('fix', 'latitude', 'degrees_north', 'fix, latitude'),
        _Variable('fix', 'longitude', 'degrees_east', 'fix, longitude'),
        _Variable('fix', 'north', 'm', 'fix, north', NED),
        _Variable('fix', 'east', 'm', 'fix, east', NED),
        _Variable('fix', 'variance', 'm2', 'fix, variance to the north and to the east each', NED),
    ),
    'altitude': (_Variable('altitude', 'height', 'm', 'measured height over the bottom'),),
    'believed_current': _water('believed_current', 'estimated current under water'),
    'believed_surface_current': _water(
        'believed_surface_current', 'estimated drift at the surface'
    ),
}


@kernel
def _turn(log, out):
    """Fill ``out``, float64[n, len(_TURNED)], from log rows, float64[n, ROW]."""
    for row in range(log.shape[0]):
        estimated = odometry_from_wire(log[row, _ODOM : _ODOM + 13])
        angles = angles_if_any(estimated[3:7])
        reference = reference_from_wire(log[row, _REFERENCE : _REFERENCE + 13])
        water = water_from_wire(log[row, _CURRENT : _CURRENT + 3])
        estimate = water_from_wire(log[row, _ESTIMATE : _ESTIMATE + 3])
        true = odometry_from_wire(log[row, _TRUTH : _TRUTH + 13])
        motion = (true.p_n, true.p_e, true.p_d)
        attitude = angles_if_any(true[3:7])
        wrench = wrench_from_wire(log[row, _WRENCH : _WRENCH + 3])
        turned = (estimated, angles, reference, water, estimate, motion, attitude, wrench)
        put(out, row, 0, turned)


def _numbers(log: np.ndarray, steers_by: str) -> dict[str, tuple]:
    """Variables that are numbers, as xarray takes them."""
    out = np.empty((len(log), len(_TURNED)))
    _turn(log, out)
    found = dict(zip(_TURNED, out.T.copy(), strict=True))
    for topic, variables in groupby(_same(steers_by), attrgetter('topic')):
        found |= zip(variables, log[:, COLUMNS[topic]].T.copy(), strict=False)
    return _named(found)


def _named(found: dict[_Variable, np.ndarray]) -> dict[str, tuple]:
    """Variables by their names, as xarray takes them."""
    return {
        variable.name: ('time', values, variable.attributes) for variable, values in found.items()
    }


def _beside(log: np.ndarray, scenario: Scenario) -> dict[str, tuple]:
    """Covariance of the place, and the sensors and estimates in a run, as xarray takes them."""
    xx, xy, _, yy = log[:, COLUMNS['odom']].T[13:].copy()
    place = _each('odom', 'm2', 'estimated position, ', _COVARIANCE)
    found = dict(zip(place, (yy, xy, xx), strict=True))
    for topic in (topic for topic in _BESIDE if topic in scenario.topics):
        values = _AS_NUMBERS[topic](log[:, COLUMNS[topic]].T.copy(), scenario)
        found |= zip(_BESIDE[topic], values, strict=True)
    return _named(found)


def _imu(wire: np.ndarray, scenario: Scenario) -> tuple[np.ndarray, ...]:
    """Attitude and rates; rates are NaN where they are not measured."""
    quaternion, (p, q, r, gyro) = wire[:4], wire[4:]
    nowhere = np.zeros((3, wire.shape[1]))
    angles = poses_from_wire(np.concatenate((nowhere, quaternion)).T)[:, 3:].T
    return (*angles, *np.where(gyro >= 0.0, (p, -q, -r), np.nan))


def _fix(wire: np.ndarray, scenario: Scenario) -> tuple[np.ndarray, ...]:
    """Fixes; NaN where there is none."""
    status, *values = wire
    latitude, longitude, east_variance, north_variance = np.where(status >= 0.0, values, np.nan)
    origin, place = scenario.origin.params(), np.full((2, len(status)), np.nan)
    for tick in np.flatnonzero(status >= 0.0):
        place[:, tick] = from_geodetic(latitude[tick], longitude[tick], origin)
    return latitude, longitude, *place, 0.5 * (east_variance + north_variance)


def _water_numbers(wire: np.ndarray, scenario: Scenario) -> tuple[np.ndarray, ...]:
    east, north, xx, xy, _, yy = wire
    return north, east, yy, xy, xx


#: Numbers of the variables of `_BESIDE` from those of a topic, float64[m, n].
_AS_NUMBERS = {
    'imu': _imu,
    'pressure': lambda wire, scenario: wire,
    'fix': _fix,
    'altitude': lambda wire, scenario: np.where(wire > NO_ECHO, wire, np.nan),
    'believed_current': _water_numbers,
    'believed_surface_current': _water_numbers,
}


def _bits(flag: str, log: np.ndarray, what: str, names: dict[int, str]) -> tuple:
    """Variable of a flag that is a sum of bits, with their names; as a bag has them."""
    about = {
        'units': '1',
        'topic': '/diagnostics',
        'long_name': f'{what}, bit by bit, once a second at most',
        'flag_masks': np.array(list(names), dtype=np.int32),
        'flag_meanings': ' '.join(names.values()),
    }
    return 'time', as_reported(log[:, COLUMNS[flag]]).astype(np.int32), about


def _flags(log: np.ndarray) -> dict[str, tuple]:
    """Variables that are states or bits, with what they mean by the conventions of CF."""
    stage = np.nan_to_num(log[:, COLUMNS['stage']], nan=_UNKNOWN_STAGE).astype(np.int8)
    names = ['unknown', *(name.replace(' ', '_') for name in STAGE_NAMES)]
    stages = {
        'long_name': 'stage of the mission',
        'flag_values': np.arange(_UNKNOWN_STAGE, len(STAGE_NAMES), dtype=np.int8),
        'flag_meanings': ' '.join(names),
    }
    course = {'long_name': '1 where the course cannot be held in this current'}
    stays = {'long_name': 'number of the waypoint that comes no nearer, 0 for none'}
    bits = {
        SATURATED_BUOYANCY: 'buoyancy_engine_at_limit',
        SATURATED_PITCH: 'pitch_mass_at_limit',
        SATURATED_ROLL: 'roll_mass_at_limit',
        SATURATED_SURFACE: 'steering_surface_at_limit',
        REFUSED: 'measurement_refused',
    }
    source = {'units': '1', 'topic': '/diagnostics'}
    return {
        'stage': ('time', stage, source | stages),
        'infeasible': ('time', log[:, COLUMNS['infeasible']].astype(np.int8), source | course),
        'no_progress': ('time', log[:, COLUMNS['no_progress']].astype(np.int32), source | stays),
        'saturation': _bits('saturation', log, 'what control notices', bits),
        'guard': _bits('guard', log, 'what the guard tells', {row.bit: row.name for row in ROWS}),
    }


class _Plot(DataArrayPlotAccessor):
    """xarray's plots, with what is positive downward drawn so."""

    def __call__(self, **choices):
        return super().__call__(**self._downward(choices))

    def line(self, *places, **choices):
        return super().line(*places, **self._downward(choices))

    def step(self, *places, **choices):
        return super().step(*places, **self._downward(choices))

    def _downward(self, choices: dict[str, Any]) -> dict[str, Any]:
        """Choices of a plot over time. Only of our variables: they name their topic."""
        about = self._da.attrs
        is_down = about.get('positive') == 'down' and 'topic' in about and self._da.ndim == 1
        return {'yincrease': False, **choices} if is_down and 'y' not in choices else choices


# xarray looks at `positive` (CF) nowhere, so that depth would be drawn upward
xarray.DataArray.plot = property(_Plot)


def _variables(log: np.ndarray, scenario: Scenario) -> dict[str, tuple]:
    """Every variable: dimension, values, attributes."""
    return {**_numbers(log, steers_by(scenario)), **_beside(log, scenario), **_flags(log)}


def numbers_of(row: np.ndarray, scenario: Scenario) -> dict[str, Any]:
    """Numbers of one tick, float64[ROW] as on the wire, by the names that a Dataset has."""
    variables = _variables(row[None, :], scenario)
    return {name: values[0].item() for name, (_, values, *_) in variables.items()}


def make_dataset(log: np.ndarray, scenario: Scenario, score: dict[str, Any]) -> xarray.Dataset:
    """Dataset of a run, by its scorecard and every tick of it, float64[n, ROW], as on the wire.

    Columns of topics that were not recorded are NaN. The variables are one-dimensional over
    ``time`` (s), each with ``units``, ``long_name``, ``topic`` and, if it has one, ``frame``.
    Those of sensors and estimates that navigation does not have are not there.
    """
    time_s = np.arange(len(log)) * TICK_NS / 1e9
    about = ('scenario', 'vehicle', 'controller', 'guidance', 'seed', 'status')
    return xarray.Dataset(
        _variables(log, scenario),
        coords={
            'time': ('time', time_s, {'units': 's', 'long_name': 'simulated time of the tick'})
        },
        attrs={
            'Conventions': 'CF-1.8',
            'title': scenario.described or scenario.name,
            'source': 'glider stack',
            'frames': 'world NED, body FRD, SI and radians; path: along, to starboard, below',
            **{name: score[name] for name in about},
            'code_digest': source_digest(),
        },
    )
