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

from glider_bringup.disk import save_figure
from glider_bringup.scenario import Scenario
from glider_bringup.sweep_result import read_dataset
from glider_guidance.los import crab_heading
from glider_model.current import KNOT_MPS
from glider_model.files import parse_yaml
from glider_model.polar import make_polar, steady_horizontal_speed
from glider_model.settings import ConfigurationError, validate
from glider_model.vehicle import Vehicle

#: Largest steady cross-track error of a stable and of a critical flight (m).
STABLE_M, CRITICAL_M = 10.0, 50.0
CLASSES = STABLE, CRITICAL, LOST, INFEASIBLE, FAILED = (
    'stable',
    'critical',
    'lost',
    'infeasible',
    'failed',
)
#: The paper's points at 1.0 kn: angle (deg) and what it says of it.
PAPER_KN = 1.0
PAPER_POINTS = ((8.0, STABLE, 'o'), (10.0, CRITICAL, '^'), (12.0, LOST, 'X'))

_ERROR = 'cross_track_m_max_steady'
SPEED, ANGLE = 'current.speed_kn', 'current.angle_deg'
#: More panels than this cannot be read on one page.
MAX_PANELS = 9

# Okabe and Ito's colours, which differ for every kind of colour vision, and in grey.
_COLOURS = {
    STABLE: '#56b4e9',
    CRITICAL: '#f0e442',
    LOST: '#d55e00',
    INFEASIBLE: '#c8c8c8',
    FAILED: '#ffffff',
}
_MEANING = {
    STABLE: f'stable: steady error <= {STABLE_M:g} m',
    CRITICAL: f'critical: <= {CRITICAL_M:g} m',
    LOST: 'lost: more, or none measured',
    INFEASIBLE: 'reported infeasible by the run',
    FAILED: 'failed: not flown to the end',
}


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


def load_map(file: Path) -> StabilityMap:
    """Map of the result of a sweep.

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
    if _ERROR not in data:
        raise ConfigurationError(f'{file}: every cell failed, there is nothing to draw')
    speed, angle, others = _dimensions(file, data)
    for name in (speed, angle):
        if data.sizes[name] < 2:
            raise ConfigurationError(f'{file}: {name} has one value only (allowed: 2 or more)')
    data = data.transpose(*others, speed, angle, ...).sortby([speed, angle])
    classes = _classify(data)
    panels = [str(value) for value in data[others[0]].values] if others else ['']
    if len(panels) > MAX_PANELS:
        raise ConfigurationError(
            f'{file}: {others[0]} has {len(panels)} values (allowed: <= {MAX_PANELS} panels)'
        )
    horizontal_mps, vehicle = _horizontal_speed(file, data)
    speeds, angles = data[speed].values, data[angle].values
    return StabilityMap(
        data.attrs['title'],
        vehicle,
        speeds,
        angles,
        panels,
        classes.reshape(len(panels), len(speeds), len(angles)),
        _feasible(horizontal_mps, speeds, angles),
        horizontal_mps / KNOT_MPS,
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
    pitch, heaviness = scenario.profile.pitch_deg, scenario.profile.net_heaviness_kg
    polar = make_polar(vehicle.params())
    return steady_horizontal_speed(-math.radians(pitch), heaviness, polar), vehicle.name


def _classify(data: xarray.Dataset) -> np.ndarray:
    """Class of every cell, an index of `CLASSES`."""
    error = data[_ERROR].values
    statuses = data['status'].attrs['flag_meanings'].split()
    status = data['status'].values
    classes = np.full(error.shape, CLASSES.index(LOST))
    classes[error <= CRITICAL_M] = CLASSES.index(CRITICAL)
    classes[error <= STABLE_M] = CLASSES.index(STABLE)
    for name in (INFEASIBLE, FAILED):
        classes[status == statuses.index(name)] = CLASSES.index(name)
    return classes


def _feasible(speed_mps: float, current_kn: np.ndarray, angle_deg: np.ndarray) -> np.ndarray:
    """Whether the path can be held in each current by any controller."""
    feasible = np.empty((len(current_kn), len(angle_deg)), dtype=bool)
    for i, current in enumerate(current_kn * KNOT_MPS):
        for j, angle in enumerate(np.radians(angle_deg)):
            along, across = current * math.cos(angle), current * math.sin(angle)
            feasible[i, j] = crab_heading(0.0, speed_mps, along, across)[2]
    return feasible


def shares(stability: StabilityMap) -> list[dict[str, Any]]:
    """Share of the cells of every class, by panel.

    Returns
    -------
    list of dict
        ``panel``, ``cells``, a share for each of `CLASSES`, ``feasible`` (share of the cells in
        which physics allows to hold the path), and ``stable_of_feasible``.
    """
    rows = []
    for name, classes in zip(stability.panels, stability.classes, strict=True):
        stable = classes == CLASSES.index(STABLE)
        rows.append(
            {
                'panel': name,
                'cells': classes.size,
                **{one: float(np.mean(classes == i)) for i, one in enumerate(CLASSES)},
                'feasible': float(np.mean(stability.feasible)),
                'stable_of_feasible': float(np.mean(stable[stability.feasible])),
            }
        )
    return rows


# ---------------------------------------------------------------------------------- drawing


def _edges(values: np.ndarray, beyond: float) -> np.ndarray:
    """Bounds of cells around values; the outer ones go half a step ``beyond`` (0 or 1)."""
    middle = 0.5 * (values[1:] + values[:-1])
    first = values[0] - beyond * (middle[0] - values[0])
    last = values[-1] + beyond * (values[-1] - middle[-1])
    return np.concatenate(([first], middle, [last]))


def draw_map(stability: StabilityMap, file: Path) -> None:
    """Draw a map into an image file; the suffix says which kind (png, svg, pdf).

    Raises
    ------
    ConfigurationError
        If the file cannot be written.
    """
    import matplotlib

    matplotlib.use('Agg')
    from matplotlib import pyplot

    count = len(stability.panels)
    columns = min(3, count)
    rows = math.ceil(count / columns)
    figure, axes = pyplot.subplots(
        rows,
        columns,
        figsize=(1.5 + 3.7 * columns, 2.2 + 6.0 * rows),
        squeeze=False,
        sharex=True,
        sharey=True,
        layout='constrained',
    )
    panels = zip(axes.flat, stability.panels, stability.classes, shares(stability), strict=False)
    for axis, name, classes, share in panels:
        _draw_panel(axis, stability, classes)
        axis.set_title(f'{name.replace("_", " ")}: {share[STABLE]:.0%} stable'.lstrip(': '))
    for axis in axes.flat[count:]:
        axis.set_visible(False)
    for axis in axes[:, 0]:
        axis.set_ylabel('current along the path (kn), + with the vehicle')
    for axis in axes[-1]:
        axis.set_xlabel('current across the path (kn)')
    figure.suptitle(
        f'{stability.title}\n'
        f'Each cell is one flight of {stability.vehicle}, at the tip of the arrow of its current'
    )
    figure.legend(handles=_legend(stability), loc='outside lower center', ncols=2)
    save_figure(figure, file, dpi=150)


def _draw_panel(axis, stability: StabilityMap, classes: np.ndarray) -> None:
    from matplotlib.colors import ListedColormap

    radius = np.maximum(_edges(stability.speed_kn, 1.0), 0.0)
    coarse = np.radians(_edges(stability.angle_deg, 0.0))
    fine = 8  # chords for the arc of a cell
    angle = np.interp(
        np.arange(fine * (len(coarse) - 1) + 1) / fine, np.arange(len(coarse)), coarse
    )
    axis.pcolormesh(
        np.outer(radius, np.sin(angle)),
        np.outer(radius, np.cos(angle)),
        np.repeat(classes, fine, axis=1),
        cmap=ListedColormap([_COLOURS[name] for name in CLASSES]),
        vmin=-0.5,
        vmax=len(CLASSES) - 0.5,
        rasterized=True,
    )
    _draw_rose(axis, radius[-1], stability)
    _draw_limits(axis, radius[-1], stability.horizontal_kn)
    for degrees, _, marker in PAPER_POINTS:
        across, along = _tip(PAPER_KN, degrees)
        axis.plot(across, along, marker, color='white', markeredgecolor='black', markersize=6.5)
    rim = radius[-1]
    axis.set_xlim(min(0.0, 1.14 * np.min(rim * np.sin(angle))), 1.14 * rim)
    axis.set_ylim(1.1 * np.min(rim * np.cos(angle)), 1.1 * rim)
    axis.set_aspect('equal')
    axis.spines[['top', 'right']].set_visible(False)


def _tip(speed: float, angle_deg: float) -> tuple[float, float]:
    """Where a current lies in the map: across and along the path."""
    return speed * math.sin(math.radians(angle_deg)), speed * math.cos(math.radians(angle_deg))


def _draw_rose(axis, rim: float, stability: StabilityMap) -> None:
    """Rays and circles by which angle and speed of a current can be read."""
    first, last = stability.angle_deg[0], stability.angle_deg[-1]
    ray = np.arange(math.ceil(first / 30.0), math.floor(last / 30.0) + 1) * 30.0
    for degrees in ray:
        across, along = _tip(rim, degrees)
        axis.plot([0.0, across], [0.0, along], color='black', linewidth=0.4, alpha=0.4)
        axis.annotate(
            f'{degrees:.0f}°',
            (1.06 * across, 1.06 * along) if abs(across) > 0.01 else (0.03, 1.06 * along),
            ha='center' if abs(across) > 0.01 else 'left',
            va='center',
            fontsize='small',
        )
    arc = np.radians(np.linspace(first, last, 181))
    for speed in np.arange(0.5, rim, 0.5):
        axis.plot(
            speed * np.sin(arc), speed * np.cos(arc), color='black', linewidth=0.4, alpha=0.4
        )
    axis.annotate(
        '',
        xy=(0.0, 0.42 * rim),
        xytext=(0.0, 0.0),
        arrowprops={'arrowstyle': '-|>', 'linewidth': 2.0, 'color': 'black'},
    )
    axis.annotate('path', (0.02 * rim, 0.36 * rim), fontsize='small')


def _draw_limits(axis, rim: float, speed: float) -> None:
    """Where the cross current is U_h, and where no progress is left."""
    if speed < rim:
        top = math.sqrt(rim * rim - speed * speed)
        axis.plot([speed, speed], [0.0, top], color='black', linewidth=2.0)
    arc = np.radians(np.linspace(90.0, 180.0, 91))
    axis.plot(speed * np.sin(arc), speed * np.cos(arc), '--', color='black', linewidth=2.0)


def _legend(stability: StabilityMap) -> list:
    from matplotlib.lines import Line2D
    from matplotlib.patches import Patch

    failed = np.any(stability.classes == CLASSES.index(FAILED))
    handles = [
        Patch(facecolor=_COLOURS[name], edgecolor='black', linewidth=0.5, label=_MEANING[name])
        for name in (CLASSES if failed else CLASSES[:-1])
    ]
    speed = f'{stability.horizontal_kn:.2f} kn'
    for style, what in (
        ('-', f'limit: cross current = speed of the glide U_h = {speed}'),
        ('--', 'limit: no progress along the path is left'),
    ):
        handles.append(Line2D([], [], color='black', linewidth=2.0, linestyle=style, label=what))
    handles += [
        Line2D(
            *([], []),
            marker=marker,
            color='none',
            markerfacecolor='white',
            markeredgecolor='black',
            label=f'the paper: {PAPER_KN:.1f} kn at {degrees:.0f} deg, {what}',
        )
        for degrees, what, marker in PAPER_POINTS
    ]
    return handles
