# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""The map after figure 12 of the paper: in which currents a straight path can be held.

A place in the map is the tip of the current's arrow, with the path pointing up. So the limit of
physics, |V sin d| = U_h, is a straight line, and where no progress is left, a circle.
"""

import math
import re
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import xarray

from glider_base.files import parse_yaml
from glider_base.settings import ConfigurationError, validate
from glider_bringup.door.netcdf import read_dataset
from glider_bringup.showing.figure import new_figure
from glider_guidance.los import crab_heading
from glider_mission.disk import save_figure
from glider_mission.planned import horizontal_speed
from glider_mission.scenario import Scenario
from glider_model.ocean.current_settings import KNOT_MPS
from glider_model.vehicle.file import Vehicle
from glider_studies.sweep.netcdf import GLIDE_MPS

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
    feasible: np.ndarray  #: bool[panels, n, m], what physics allows
    horizontal_kn: list[float]  #: U_h of each panel, horizontal speed through the water
    measure: Measure


def load_map(file: Path, by: str = 'steady') -> StabilityMap:
    """Map of the result of a sweep, by one of `MEASURES`.

    Raises ConfigurationError if the file cannot be read, or its dimensions are others.
    """
    try:
        data = read_dataset(file)
    except FileNotFoundError:
        raise ConfigurationError(f'{file}: no such file') from None
    except Exception as error:  # readers of damaged files raise whatever they like
        why = str(error).partition('\n')[0]  # scipy goes on with what to install for NetCDF 4
        raise ConfigurationError(f'{file}: cannot be read as NetCDF: {why}') from None
    needed = {'scenario_yaml', 'vehicle_yaml', 'sweep'}
    if not needed <= set(data.attrs) or 'status' not in data:
        raise ConfigurationError(f'{file}: not a result of ./glider sweep')
    measure = MEASURES[by]
    if measure.variable not in data or by != 'steady' and data[measure.variable].isnull().all():
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
    first_mps, vehicle = _horizontal_speed(file, data)
    glide_mps = data[others[0]].attrs.get(GLIDE_MPS, first_mps) if others else first_mps
    glides_mps = np.broadcast_to(glide_mps, len(panels))
    speeds, angles = data[speed].values, data[angle].values
    return StabilityMap(
        title=data.attrs['title'],
        vehicle=vehicle,
        speed_kn=speeds,
        angle_deg=angles,
        panels=panels,
        classes=classes.reshape(len(panels), len(speeds), len(angles)),
        feasible=np.array([_feasible(one, speeds, angles) for one in glides_mps]),
        horizontal_kn=(glides_mps / KNOT_MPS).tolist(),
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
    """U_h (m/s) of the first flight by the polar of its vehicle, and the names of all vehicles."""
    vehicle, scenario = (
        validate(
            model, parse_yaml(data.attrs[f'{what}_yaml'], f'{file}: {what}'), f'{file}: {what}'
        )
        for what, model in (('vehicle', Vehicle), ('scenario', Scenario))
    )
    others = filter(None, (re.fullmatch('vehicle_(.+)_yaml', key) for key in data.attrs))
    names = (vehicle.name, *(found[1] for found in others))
    return horizontal_speed(scenario, vehicle), ', '.join(names)


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

    Of each ``panel`` they are ``cells``, a share for each of `CLASSES`, ``feasible`` (share of the
    cells in which physics allows to hold the path), ``stable_of_feasible``, None if no cell is,
    and ``horizontal_kn``, U_h.
    """
    rows = []
    for name, classes, feasible, horizontal_kn in zip(
        stability.panels,
        stability.classes,
        stability.feasible,
        stability.horizontal_kn,
        strict=True,
    ):
        held = classes[feasible] == CLASSES.index(STABLE)
        rows.append(
            {
                'panel': name,
                'cells': classes.size,
                **{one: float(np.mean(classes == i)) for i, one in enumerate(CLASSES)},
                'feasible': float(np.mean(feasible)),
                'stable_of_feasible': float(np.mean(held)) if len(held) else None,
                'horizontal_kn': horizontal_kn,
            }
        )
    return rows


# ---------------------------------------------------------------------------------- the image

#: The paper's points at 1.0 kn: angle (deg) and what it says of it.
PAPER_KN = 1.0
PAPER_POINTS = ((8.0, STABLE, 'o'), (10.0, CRITICAL, '^'), (12.0, LOST, 'X'))
#: A speed and an angle that stand alone are drawn so far to either side (kn, deg).
ALONE_KN, ALONE_DEG = 0.1, 5.0
#: Between circles (kn): the first that gives two of them.
_CIRCLES_KN = (1.0, 0.5, 0.2, 0.1, 0.05, 0.02, 0.01)
#: No less of the circle is in view (deg).
LEAST_DEG = 60.0
#: Points of an arc, and size of a panel (inch).
_ARC, _SIZE = 181, 4.2

# Okabe and Ito's colours, which differ for every kind of colour vision, and in grey.
_LOOKS = {
    STABLE: ('#56b4e9', 'stable: {0.text} <= {0.stable_m:g} m'),
    CRITICAL: ('#f0e442', 'critical: <= {0.critical_m:g} m'),
    LOST: ('#d55e00', 'lost: more, or none measured'),
    INFEASIBLE: ('#c8c8c8', 'reported infeasible by the run'),
    FAILED: ('#ffffff', 'failed: not flown to the end'),
}


def _edges(values: np.ndarray, alone: float) -> np.ndarray:
    """Bounds of cells around increasing values; the outer ones go half a step beyond them."""
    if len(values) == 1:
        return np.array([values[0] - alone, values[0] + alone])
    middle = 0.5 * (values[1:] + values[:-1])
    return np.concatenate(([2.0 * values[0] - middle[0]], middle, [2.0 * values[-1] - middle[-1]]))


def draw_map(stability: StabilityMap, file: Path) -> None:
    """Draw a map into an image file; the suffix says which kind (png, svg, pdf).

    Raises ConfigurationError if the file cannot be written.
    """
    count = len(stability.panels)
    columns = min(3, count)
    rows = math.ceil(count / columns)
    figure = new_figure(max(1.5 + _SIZE * columns, 7.0), 3.9 + (0.6 + _SIZE) * rows)
    polar = {'projection': 'polar'}
    axes = figure.subplots(rows, columns, squeeze=False, subplot_kw=polar)
    panels = zip(axes.flat, stability.panels, stability.classes, shares(stability), strict=False)
    for axis, name, classes, share in panels:
        _draw_panel(axis, stability, classes, share['horizontal_kn'])
        axis.set_title(_title(name, share))
    for axis in axes.flat[count:]:
        axis.set_visible(False)
    figure.suptitle(
        f'{stability.title}\n'
        f'Each cell: a flight of {stability.vehicle}, at the tip of the arrow of its current:\n'
        'its speed, and its angle off the path, which points up'
    )
    figure.legend(
        handles=_legend(stability), loc='outside lower center', ncols=2 if columns > 1 else 1
    )
    figure.draw_without_rendering()  # labels of circles have no place before, and were cut off
    save_figure(figure, file, dpi=150)


def _paper_points(stability: StabilityMap) -> tuple[tuple[float, str, str], ...]:
    """`PAPER_POINTS` on a map of the vehicle that they are of."""
    return PAPER_POINTS if 'zhang2021' in stability.vehicle else ()


def _title(name: str, share: dict[str, Any]) -> str:
    """Name of a panel, and how much of it is stable."""
    held = share['stable_of_feasible']
    of = 'no cell is feasible' if held is None else f'{held:.1%} of the feasible'
    stable = f'stable: {share[STABLE]:.1%} of all cells,\n{of}'
    return f'{name.replace("_", " ")}\n{stable}' if name else stable


def _draw_panel(axis, stability: StabilityMap, classes: np.ndarray, glide: float) -> None:
    """Cells, the path, the limits of physics, and the points of the paper."""
    from matplotlib.colors import ListedColormap

    angles = stability.angle_deg
    speed = np.maximum(_edges(stability.speed_kn, ALONE_KN), 0.0)
    angle = _edges(angles, ALONE_DEG)
    if len(angles) > 1 and angles[0] >= 0.0 and angles[-1] <= 180.0:
        angle = np.clip(angle, 0.0, 180.0)  # beyond is the mirror image
    rim, cells = speed[-1], len(angles)
    fine = max(8, math.ceil(_ARC / cells))  # chords for the arc of a cell
    along = np.interp(np.arange(fine * cells + 1) / fine, np.arange(cells + 1), angle)
    axis.pcolormesh(
        np.radians(along),
        speed,
        np.repeat(classes, fine, axis=1),
        cmap=ListedColormap([_LOOKS[name][0] for name in CLASSES]),
        vmin=-0.5,
        vmax=len(CLASSES) - 0.5,
        rasterized=True,
    )
    for side in (-1.0, 1.0):
        off = np.linspace(0.02, 0.5 * np.pi, _ARC)
        axis.plot(side * off, glide / np.sin(off), color='black', linewidth=2.0)
    behind = np.linspace(0.5 * np.pi, 1.5 * np.pi, _ARC)
    axis.plot(behind, np.full(_ARC, glide), '--', color='black', linewidth=2.0)
    for degrees, _, marker in _paper_points(stability):
        look = {'color': 'white', 'markeredgecolor': 'black', 'markersize': 6.5}
        axis.plot(math.radians(degrees), PAPER_KN, marker, **look)
    arrow = {'arrowstyle': '-|>', 'linewidth': 2.0, 'color': 'black'}
    axis.annotate('', xy=(0.0, 0.42 * rim), xytext=(0.0, 0.0), arrowprops=arrow)
    axis.annotate('path', (0.06, 0.36 * rim), fontsize='small')
    axis.set_theta_zero_location('N')
    axis.set_theta_direction(-1)
    first = min(0.0, angle[0])  # the path is in view, and ticks that can be read
    last = min(max(first + LEAST_DEG, angle[-1]), first + 360.0)
    axis.set(thetamin=first, thetamax=last, rmin=0.0, rmax=rim)
    axis.grid(color='black', linewidth=0.4, alpha=0.4)
    step = next((step for step in _CIRCLES_KN if rim >= 2.0 * step), rim)
    axis.set_rticks(np.arange(step, rim, step))
    axis.yaxis.set_major_formatter(' {x:g} kn')


def _legend(stability: StabilityMap) -> list:
    from matplotlib.lines import Line2D
    from matplotlib.patches import Patch

    failed = np.any(stability.classes == CLASSES.index(FAILED))
    handles = []
    for name in CLASSES if failed else CLASSES[:-1]:
        colour, text = _LOOKS[name]
        look = {'facecolor': colour, 'edgecolor': 'black', 'linewidth': 0.5}
        handles.append(Patch(label=text.format(stability.measure), **look))
    glides = dict.fromkeys(f'{one:.2f}' for one in stability.horizontal_kn)
    limits = {
        '-': f'cross current = speed of the glide U_h = {", ".join(glides)} kn',
        '--': 'no progress along the path is left',
    }
    for style, what in limits.items():
        look = {'color': 'black', 'linewidth': 2.0, 'linestyle': style}
        handles.append(Line2D([], [], label=f'limit: {what}', **look))
    white = {'color': 'none', 'markerfacecolor': 'white', 'markeredgecolor': 'black'}
    for degrees, what, marker in _paper_points(stability):
        text = f'the paper: {PAPER_KN:.1f} kn at {degrees:.0f} deg, {what}'
        handles.append(Line2D([], [], marker=marker, label=text, **white))
    return handles
