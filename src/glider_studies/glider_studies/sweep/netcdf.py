# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""The result of a sweep: one NetCDF file, which is a function of its inputs to the last byte.

Every number of a scorecard is a variable over the dimensions of the sweep; its name is that of the
scorecard with ``_`` for the dots. The file also holds what made it.
"""

import json
from collections.abc import Iterable
from typing import Any, get_args

import numpy as np
import xarray

from glider_base.kernel import source_digest
from glider_base.settings import find_field, unit_of
from glider_mission.changes import VEHICLE
from glider_mission.planned import horizontal_speed
from glider_mission.scenario import Scenario
from glider_model.vehicle.file import Vehicle, vehicle_path
from glider_studies.sweep.plan import Plan

#: Units by how names in a scorecard end, in the spelling of UDUNITS.
_UNITS = {'_mps': 'm/s', '_m': 'm', '_deg': 'degree', '_kg': 'kg', '_s': 's', '_rad': 'rad'}
#: Units of a whole part of a scorecard.
_PARTS = {'energy': 'W h'}
#: Units of settings that UDUNITS spells otherwise.
_SPELLING = {'deg': 'degree', 'deg/s': 'degree/s', 'knots': 'knot', '-': '1', '': '1'}
#: Dimension and coordinates of vectors in a scorecard.
VECTORS = {
    'final_state.position_ned_m': ('ned', ('north', 'east', 'down')),
    'final_state.attitude_rpy_rad': ('rpy', ('roll', 'pitch', 'yaw')),
    'final_state.velocity_mps': ('frd', ('forward', 'starboard', 'down')),
}
#: Parts of a scenario that say how fast it glides, and the attribute of a dimension over them that
#: has the horizontal speed through the water of each value.
_GLIDE, GLIDE_MPS = {VEHICLE, 'profile'}, 'horizontal_speed_mps'
#: Those of before come first: a result keeps a status as its place among them.
STATUSES = ('completed', 'infeasible', 'failed', 'surfaced', 'lost', 'unfinished')
#: Names in a result that are no figures, apart from its dimensions.
NOT_FIGURES = {'status', 'reason', *(dimension for dimension, _ in VECTORS.values())}


def variable_name(figure: str) -> str:
    """Name of the variable of a figure, which is given by its dotted name."""
    return figure.replace('.', '_')


def _unit_and_name(figure: str) -> tuple[str, str]:
    """Unit and long name of a figure by its dotted name."""
    unit, words = '1', []
    for part in figure.split('.'):
        ending = next((ending for ending in _UNITS if part.endswith(ending)), '')
        unit = _UNITS.get(ending, _PARTS.get(part, unit))
        words.append(part.removesuffix(ending).replace('_', ' '))
    return unit, ', '.join(words)


def _description_and_unit(name: str) -> tuple[str, str]:
    """What a scenario field, or one of its vehicle's file, is, and its unit; empty without."""
    of, _, inside = name.partition('.')
    if of == VEHICLE and inside:
        unit = find_field(Vehicle, f'{inside}.unit')
        return '', next(iter(get_args(unit.annotation)), '') if unit is not None else ''
    field = find_field(Scenario, name)
    return (field.description or '', unit_of(field)) if field is not None else ('', '')


def _coordinate(plan: Plan, number: int) -> tuple[str, np.ndarray, dict[str, Any]]:
    """Dimension, values and attributes of a coordinate by the number of its dimension."""
    axis = plan.axes[number]
    description, unit = _description_and_unit(axis.field)
    attributes: dict[str, Any] = {'long_name': axis.name.replace('_', ' ')}
    if axis.field:
        attributes['scenario_field'] = axis.field
    if description:
        attributes['description'] = description
    changed = {field.partition('.')[0] for changes in axis.changes for field in changes}
    if changed & _GLIDE:
        attributes[GLIDE_MPS] = [horizontal_speed(one) for one in plan.along(number)]
    if all(isinstance(value, bool) for value in axis.values):
        values = np.array(axis.values, dtype=np.int8)
    elif all(isinstance(value, int | float) and float(value) == value for value in axis.values):
        values = np.array(axis.values, dtype=np.float64)
        attributes['units'] = _SPELLING.get(unit, unit)
    else:  # or seeds that a float would round
        values = np.array([str(value) for value in axis.values], dtype=object)
    return axis.name, values, attributes


def make_dataset(plan: Plan, records: Iterable[dict[str, Any]]) -> xarray.Dataset:
    """Dataset of a sweep, of what `sweep.fly.fly_chunk` says of every cell, in any order."""
    status = np.full(plan.cells, -1, dtype=np.int8)
    reasons = np.full(plan.cells, '', dtype=object)
    figures: dict[str, np.ndarray] = {}
    for record in records:
        cell = record['cell']
        status[cell] = STATUSES.index(record['status'])
        reasons[cell] = record['reason']
        for name, figure in record['figures'].items():
            if name not in figures:
                vector = np.shape(VECTORS[name][1]) if name in VECTORS else ()
                figures[name] = np.full((plan.cells, *vector), np.nan)
            if figure is not None:
                figures[name][cell] = figure
    dimensions = [axis.name for axis in plan.axes]
    flags = {
        'long_name': 'how the flight ended',
        'flag_values': np.arange(len(STATUSES), dtype=np.int8),
        'flag_meanings': ' '.join(STATUSES),
    }
    why = {'long_name': 'why the flight ended so; empty where the status says all'}
    dataset = xarray.Dataset(
        {
            'status': (dimensions, status.reshape(plan.shape), flags),
            'reason': (dimensions, reasons.reshape(plan.shape), why),
        },
        coords={axis.name: _coordinate(plan, i) for i, axis in enumerate(plan.axes)},
        attrs=_attributes(plan),
    )
    for name in sorted(figures):
        unit, long_name = _unit_and_name(name)
        attributes = {'long_name': long_name, 'units': unit, 'scorecard': name}
        values, over = figures[name].reshape(*plan.shape, *figures[name].shape[1:]), dimensions
        if values.ndim > len(dimensions):
            dimension, labels = VECTORS[name]
            over = [*dimensions, dimension]
            dataset = dataset.assign_coords({dimension: np.array(labels, dtype=object)})
        dataset[variable_name(name)] = (over, values, attributes)
    return dataset


def _attributes(plan: Plan) -> dict[str, str]:
    """What made a sweep."""
    first, *others = plan.vehicles
    return {
        'Conventions': 'CF-1.8',
        'title': plan.sweep.description or plan.sweep.name,
        'source': 'glider stack, direct engine',
        'sweep': plan.sweep.name,
        'sweep_yaml': plan.text,
        **({'set': json.dumps(plan.given)} if plan.given else {}),
        'scenario_yaml': plan.first.to_yaml(vehicle=vehicle_path(plan.first.vehicle).stem),
        'vehicle_yaml': first[1],
        **{f'vehicle_{name}_yaml': text for name, text in others},
        'code_digest': source_digest(),
        'inputs_digest': plan.digest,
    }
