# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""The map after figure 12 of the paper: in which currents a straight path can be held.

A place in the map is the tip of the current's arrow, with the path pointing up. So the limit of
physics, |V sin d| = U_h, is a straight line, and where no progress is left, a circle.
"""

import math
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import xarray

from glider_base.files import parse_yaml
from glider_base.settings import ConfigurationError, validate
from glider_bringup.door.netcdf import read_dataset
from glider_guidance.los import crab_heading
from glider_mission.scenario import Scenario
from glider_model.ocean.current_settings import KNOT_MPS
from glider_model.vehicle.file import Vehicle
from glider_studies.paper.measures import horizontal_speed

#: Largest steady cross-track error of a stable and of a critical flight (m).
STABLE_M, CRITICAL_M = 10.0, 50.0
CLASSES = ('stable', 'critical', 'lost', 'infeasible', 'failed')
STABLE, CRITICAL, LOST, INFEASIBLE, FAILED = CLASSES
SPEED, ANGLE = 'current.speed_kn', 'current.angle_deg'


class Measure(NamedTuple):
    """What a cell is judged by."""

    variable: str  #: of the result of a sweep (m)
    stable_m: float  #: largest value of a stable flight, and of a critical one
    critical_m: float
    text: str


#: A vehicle that comes up drifts off its path: it is judged by where it comes up, from the fourth
#: time on.
MEASURES = {
    'steady': Measure('cross_track_m_max_steady', STABLE_M, CRITICAL_M, 'steady error'),
    'surfacing': Measure(
        'navigation_from_fourth_surfacing_cross_track_m', 50.0, 200.0, 'off where it comes up'
    ),
}
#: More panels than this cannot be read on one page.
MAX_PANELS = 9


class StabilityMap(NamedTuple):
    """What became of the flights of a sweep over speed and angle of the current."""

    title: str
    vehicle: str
    speed_kn: np.ndarray  #: float64[n]
    angle_deg: np.ndarray  #: float64[m]
    panels: list[str]  #: names of the values of the third dimension; one empty name without
    classes: np.ndarray  #: int[panels, n, m], index of `CLASSES`
    feasible: np.ndarray  #: bool[n, m], what physics allows
    horizontal_kn: float  #: U_h, horizontal speed through the water
    measure: Measure


def load_map(file: Path, by: str = 'steady') -> StabilityMap:
    """Map of the result of a sweep, by one of `MEASURES`.

    Raises
    ------
    ConfigurationError
        If the file cannot be read, or its dimensions are others.
    """
    try:
        data = read_dataset(file)
    except FileNotFoundError:
        raise ConfigurationError(f'{file}: no such file') from None
    except Exception as error:  # readers of damaged files raise whatever they like
        raise ConfigurationError(f'{file}: cannot be read as NetCDF: {error}') from None
    needed = {'scenario_yaml', 'vehicle_yaml', 'sweep'}
    if not needed <= set(data.attrs) or 'status' not in data:
        raise ConfigurationError(f'{file}: not a result of ./glider sweep')
    measure = MEASURES[by]
    if measure.variable not in data:
        raise ConfigurationError(
            f'{file}: every cell failed, or has no {measure.variable}: nothing to draw by {by}'
        )
    speed, angle, others = _dimensions(file, data)
    data = data.transpose(*others, speed, angle, ...).sortby([speed, angle])
    classes = _classify(data, measure)
    panels = [str(value) for value in data[others[0]].values] if others else ['']
    if len(panels) > MAX_PANELS:
        raise ConfigurationError(
            f'{file}: {others[0]} has {len(panels)} values (allowed: <= {MAX_PANELS} panels)'
        )
    horizontal_mps, vehicle = _horizontal_speed(file, data)
    speeds, angles = data[speed].values, data[angle].values
    return StabilityMap(
        title=data.attrs['title'],
        vehicle=vehicle,
        speed_kn=speeds,
        angle_deg=angles,
        panels=panels,
        classes=classes.reshape(len(panels), len(speeds), len(angles)),
        feasible=_feasible(horizontal_mps, speeds, angles),
        horizontal_kn=horizontal_mps / KNOT_MPS,
        measure=measure,
    )


def _dimensions(file: Path, data: xarray.Dataset) -> tuple[str, str, list[str]]:
    """Names of the dimensions of speed and angle, and of at most one more."""
    over = data['status'].dims
    fields = {data[name].attrs.get('scenario_field'): name for name in over if name in data}
    others = [name for name in over if name not in (fields.get(SPEED), fields.get(ANGLE))]
    if SPEED not in fields or ANGLE not in fields or len(others) > 1:
        raise ConfigurationError(
            f'{file}: dimensions {", ".join(over)}: a map cannot show them '
            f'(allowed: {SPEED}, {ANGLE} and at most one more)'
        )
    return fields[SPEED], fields[ANGLE], others


def _horizontal_speed(file: Path, data: xarray.Dataset) -> tuple[float, str]:
    """U_h (m/s) that the polar of the vehicle in the file gives, and the vehicle's name."""
    vehicle, scenario = (
        validate(
            model, parse_yaml(data.attrs[f'{what}_yaml'], f'{file}: {what}'), f'{file}: {what}'
        )
        for what, model in (('vehicle', Vehicle), ('scenario', Scenario))
    )
    return horizontal_speed(scenario, vehicle), vehicle.name


def _classify(data: xarray.Dataset, measure: Measure) -> np.ndarray:
    """Class of every cell, an index of `CLASSES`."""
    error = data[measure.variable].values
    statuses = data['status'].attrs['flag_meanings'].split()
    status = data['status'].values
    classes = np.full(error.shape, CLASSES.index(LOST))
    classes[error <= measure.critical_m] = CLASSES.index(CRITICAL)
    classes[error <= measure.stable_m] = CLASSES.index(STABLE)
    for code, name in enumerate(statuses):
        if name != 'completed':
            classes[status == code] = CLASSES.index(INFEASIBLE if name == INFEASIBLE else FAILED)
    return classes


def _feasible(speed_mps: float, current_kn: np.ndarray, angle_deg: np.ndarray) -> np.ndarray:
    """Whether the path can be held in each current by any controller."""

    def is_held(current: float, angle: float) -> bool:
        along, across = current * math.cos(angle), current * math.sin(angle)
        return crab_heading(0.0, speed_mps, along, across)[2]

    angles = np.radians(angle_deg)
    return np.array([[is_held(one, angle) for angle in angles] for one in current_kn * KNOT_MPS])


def shares(stability: StabilityMap) -> list[dict[str, Any]]:
    """Share of the cells of every class, by panel.

    Returns
    -------
    list of dict
        ``panel``, ``cells``, a share for each of `CLASSES`, ``feasible`` (share of the cells in
        which physics allows to hold the path), and ``stable_of_feasible``, None if no cell is.
    """
    rows, feasible = [], stability.feasible
    for name, classes in zip(stability.panels, stability.classes, strict=True):
        held = classes[feasible] == CLASSES.index(STABLE)
        rows.append(
            {
                'panel': name,
                'cells': classes.size,
                **{one: float(np.mean(classes == i)) for i, one in enumerate(CLASSES)},
                'feasible': float(np.mean(feasible)),
                'stable_of_feasible': float(np.mean(held)) if len(held) else None,
            }
        )
    return rows
