# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""A run as an xarray Dataset: every number of every topic over time, by name.

Topics are ENU and FLU; here everything is NED (world) and FRD (body), as in the scorecard and in
books on marine craft, SI and radians. `glider_model.base.frames` turns one into the other.
"""

import json
from typing import Any, NamedTuple

import numpy as np
import xarray

from glider_bringup.blocks import COLUMNS
from glider_bringup.mission.run_folder import VEHICLE_FILE
from glider_bringup.mission.scenario import Scenario
from glider_bringup.scoring.true_motion import wire_of
from glider_control.block import CONTROL
from glider_control.control import SATURATED_BUOYANCY, SATURATED_PITCH, SATURATED_ROLL
from glider_control.watch import ROWS
from glider_guidance.yo.stage import STAGE_NAMES
from glider_model.base.block import Telling
from glider_model.base.frames import (
    euler_from_quaternion,
    odometry_from_wire,
    reference_from_wire,
    water_from_wire,
    wrench_from_wire,
)
from glider_model.base.kernel import kernel, source_digest
from glider_model.base.signals import TICK_NS, Adaptation
from glider_model.vehicle.file import vehicle_file

NED, FRD, PATH = 'NED', 'FRD', 'path'
_AXES = ('north', 'east', 'down')
_ANGLES = ('roll', 'pitch', 'heading')
_ANGLE_TEXTS = (
    'roll, starboard side down is positive',
    'pitch, nose up is positive',
    'heading, clockwise from north',
)
_UNITS = {'_nm': 'N m', '_radps': 'rad/s'}
#: Stage of which nothing is known: a recording that began late.
_UNKNOWN_STAGE = -1

_ODOM, _REFERENCE = COLUMNS['odom'].start, COLUMNS['reference'].start
_CURRENT, _ESTIMATE = COLUMNS['current_velocity'].start, COLUMNS['current_estimate'].start
_WRENCH = COLUMNS['wrench'].start


class _Variable(NamedTuple):
    """One variable; its name is that of the topic, ``_``, and that of the quantity."""

    topic: str
    quantity: str
    unit: str
    text: str
    frame: str = ''

    @property
    def name(self) -> str:
        return f'{self.topic}_{self.quantity}'

    @property
    def attributes(self) -> dict[str, str]:
        attributes = {'units': self.unit, 'long_name': self.text, 'topic': self.topic}
        return attributes | ({'frame': self.frame} if self.frame else {})


def _position(topic: str, what: str) -> list[_Variable]:
    texts = ('north', 'east', 'depth, positive down')
    names = ('north', 'east', 'depth')
    return [
        _Variable(topic, name, 'm', f'{what}, {text}', NED)
        for name, text in zip(names, texts, strict=True)
    ]


def _euler(topic: str, what: str) -> list[_Variable]:
    return [
        _Variable(topic, name, 'rad', f'{what} {text}', NED)
        for name, text in zip(_ANGLES, _ANGLE_TEXTS, strict=True)
    ]


def _velocity(topic: str, what: str, before: str = '') -> list[_Variable]:
    return [_Variable(topic, f'{before}{axis}', 'm/s', f'{what}, {axis}', NED) for axis in _AXES]


def _joints(topic: str, what: str) -> list[_Variable]:
    return [
        _Variable(topic, 'buoyancy_engine', 'kg', f'{what} net heaviness, positive sinks'),
        _Variable(topic, 'pitch_mass', 'm', f'{what} pitch mass, positive forward', FRD),
        _Variable(topic, 'roll_mass', 'rad', f'{what} roll mass about the x axis', FRD),
    ]


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
    *_position('odom', 'measured position'),
    *(
        _Variable('odom', f'q_{part}', '1', f'attitude quaternion, FRD to NED, {part}', NED)
        for part in 'wxyz'
    ),
    _Variable('odom', 'u', 'm/s', 'velocity over ground, forward', FRD),
    _Variable('odom', 'v', 'm/s', 'velocity over ground, to starboard', FRD),
    _Variable('odom', 'w', 'm/s', 'velocity over ground, down', FRD),
    _Variable('odom', 'p', 'rad/s', 'angular rate about the x axis', FRD),
    _Variable('odom', 'q', 'rad/s', 'angular rate about the y axis', FRD),
    _Variable('odom', 'r', 'rad/s', 'angular rate about the z axis', FRD),
    *_euler('odom', 'measured'),
    *_position('reference', 'virtual target'),
    *_euler('reference', 'desired'),
    *_velocity('reference', 'desired velocity over ground', 'velocity_'),
    *(
        _Variable('reference', f'{angle}_rate', 'rad/s', f'desired rate of {angle}', NED)
        for angle in _ANGLES
    ),
    *_velocity('current_velocity', 'velocity of the water over ground'),
    *_velocity('current_estimate', 'velocity of the water, as guidance estimates it'),
    _Variable('wrench', 'heave_force', 'N', 'demanded force, down', FRD),
    _Variable('wrench', 'roll_moment', 'N m', 'demanded moment about the x axis', FRD),
    _Variable('wrench', 'pitch_moment', 'N m', 'demanded moment about the y axis', FRD),
)
#: What topics carry in the same numbers.
_SAME = (
    *_joints('joint_states', 'position:'),
    *_joints('command', 'commanded:'),
    _Variable('tracking_error', 'along', 'm', 'ahead of the virtual target', PATH),
    _Variable('tracking_error', 'across', 'm', 'starboard of the virtual target', PATH),
    _Variable('tracking_error', 'below', 'm', 'below the virtual target', PATH),
    *_learnt(),
)


@kernel
def _put(out, row, start, values):
    for i, value in enumerate(values):
        out[start + i, row] = value


@kernel
def _turn(log, out):
    """Fill ``out``, float64[len(_TURNED), n], from log rows, float64[n, ROW]."""
    for row in range(log.shape[0]):
        odometry = odometry_from_wire(wire_of(log, row, _ODOM))
        _put(out, row, 0, odometry)
        angles = euler_from_quaternion(odometry.q_w, odometry.q_x, odometry.q_y, odometry.q_z)
        _put(out, row, 13, angles)
        _put(out, row, 16, reference_from_wire(wire_of(log, row, _REFERENCE)))
        _put(out, row, 28, water_from_wire(log[row, _CURRENT : _CURRENT + 3]))
        _put(out, row, 31, water_from_wire(log[row, _ESTIMATE : _ESTIMATE + 3]))
        _put(out, row, 34, wrench_from_wire(log[row, _WRENCH : _WRENCH + 3]))


def _numbers(log: np.ndarray) -> dict[str, tuple]:
    """Variables that are numbers, as xarray takes them."""
    out = np.empty((len(_TURNED), len(log)))
    _turn(log, out)
    found = dict(zip(_TURNED, out, strict=True))
    place: dict[str, int] = {}
    for variable in _SAME:
        first = COLUMNS[variable.topic].start
        place[variable.topic] = place.get(variable.topic, first - 1) + 1
        found[variable] = log[:, place[variable.topic]].copy()
    return {
        variable.name: ('time', values, variable.attributes) for variable, values in found.items()
    }


def _as_told(saturation: np.ndarray) -> np.ndarray:
    """Saturation masks, int16[n], as a bag has them: a change is told at most once a second."""
    stamps_ns = np.arange(len(saturation)) * TICK_NS
    told = Telling(CONTROL).among(saturation[:, None].astype(np.int64), stamps_ns)
    values = np.append(0, saturation[told])
    lengths = np.diff(np.concatenate(([0], told, [len(saturation)])))
    return np.repeat(values, lengths).astype(np.int16)


def _flags(log: np.ndarray) -> dict[str, tuple]:
    """Variables that are states or bits, with what they mean by the conventions of CF."""
    stage = np.nan_to_num(log[:, COLUMNS['stage']], nan=_UNKNOWN_STAGE).astype(np.int8)
    values = np.arange(_UNKNOWN_STAGE, len(STAGE_NAMES), dtype=np.int8)
    bits = {
        SATURATED_BUOYANCY: 'buoyancy_engine_at_limit',
        SATURATED_PITCH: 'pitch_mass_at_limit',
        SATURATED_ROLL: 'roll_mass_at_limit',
        **{bit: name for bit, (name, _) in ROWS.items()},
    }
    names = ['unknown', *(name.replace(' ', '_') for name in STAGE_NAMES)]
    told = {'units': '1', 'topic': '/diagnostics'}
    return {
        'stage': (
            'time',
            stage,
            {
                **told,
                'long_name': 'stage of the mission',
                'flag_values': values,
                'flag_meanings': ' '.join(names),
            },
        ),
        'infeasible': (
            'time',
            log[:, COLUMNS['infeasible']].astype(np.int8),
            {**told, 'long_name': '1 where the course cannot be held in this current'},
        ),
        'saturation': (
            'time',
            _as_told(log[:, COLUMNS['saturation']].astype(np.int64)),
            {
                **told,
                'long_name': 'what control notices, bit by bit, told once a second at most',
                'flag_masks': np.array(list(bits), dtype=np.int16),
                'flag_meanings': ' '.join(bits.values()),
            },
        ),
    }


def make_dataset(log: np.ndarray, scenario: Scenario, score: dict[str, Any]) -> xarray.Dataset:
    """Dataset of a run.

    Parameters
    ----------
    log : float64[n, ROW]
        Every tick of the run, as on the wire; NaN in columns of topics that were not recorded.
    scenario : Scenario
    score : dict
        Its scorecard.

    Returns
    -------
    xarray.Dataset
        One-dimensional variables over ``time`` (s), each with ``units``, ``long_name``, ``topic``
        and, if it has one, ``frame``.
    """
    beside = scenario.model_copy(update={'vehicle': VEHICLE_FILE})  # as in a run folder
    time_s = np.arange(len(log)) * TICK_NS / 1e9
    about = ('scenario', 'vehicle', 'controller', 'guidance', 'seed', 'status')
    return xarray.Dataset(
        {**_numbers(log), **_flags(log)},
        coords={
            'time': ('time', time_s, {'units': 's', 'long_name': 'simulated time of the tick'})
        },
        attrs={
            'Conventions': 'CF-1.8',
            'title': scenario.description or scenario.name,
            'source': 'glider stack',
            'frames': 'world NED, body FRD, SI and radians; path: along, to starboard, below',
            **{name: score[name] for name in about},
            'score_json': json.dumps(score),
            'scenario_yaml': beside.to_yaml(),
            'vehicle_yaml': vehicle_file(scenario.vehicle).decode(),
            'code_digest': source_digest(),
        },
    )
