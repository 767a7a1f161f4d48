# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""The stability map as an image: each cell at the tip of the arrow of its current."""

import math
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from glider_bringup.showing.figure import new_figure
from glider_mission.disk import save_figure
from glider_studies.showing.stability_map import (
    CLASSES,
    CRITICAL,
    FAILED,
    INFEASIBLE,
    LOST,
    STABLE,
    StabilityMap,
    shares,
)

#: The paper's points at 1.0 kn: angle (deg) and what it says of it.
PAPER_KN = 1.0
PAPER_POINTS = ((8.0, STABLE, 'o'), (10.0, CRITICAL, '^'), (12.0, LOST, 'X'))
#: A speed and an angle that stand alone are drawn so far to either side (kn, deg).
ALONE_KN, ALONE_DEG = 0.1, 5.0
#: Between rays that are labelled (deg) and circles (kn): the first that gives two of them.
_RAYS = (30.0, 15.0, 10.0, 5.0, 2.0, 1.0)
_CIRCLES = (1.0, 0.5, 0.2, 0.1, 0.05, 0.02, 0.01)
#: Points of an arc.
_ARC = 181
#: Width of a panel, and its smallest and largest height (inch).
_WIDTH, _HEIGHTS = 3.7, (3.0, 6.0)

# Okabe and Ito's colours, which differ for every kind of colour vision, and in grey.
_COLOURS = {
    STABLE: '#56b4e9',
    CRITICAL: '#f0e442',
    LOST: '#d55e00',
    INFEASIBLE: '#c8c8c8',
    FAILED: '#ffffff',
}
_MEANING = {
    STABLE: 'stable: {0.text} <= {0.stable_m:g} m',
    CRITICAL: 'critical: <= {0.critical_m:g} m',
    LOST: 'lost: more, or none measured',
    INFEASIBLE: 'reported infeasible by the run',
    FAILED: 'failed: not flown to the end',
}


class Extent(NamedTuple):
    """Bounds of the cells of a map, and of what is in view."""

    speed_kn: np.ndarray  #: float64[n + 1]
    angle_deg: np.ndarray  #: float64[m + 1]
    across_kn: tuple[float, float]  #: in view, left and right
    along_kn: tuple[float, float]  #: in view, bottom and top


def _edges(values: np.ndarray, alone: float) -> np.ndarray:
    """Bounds of cells around increasing values; the outer ones go half a step beyond them."""
    if len(values) == 1:
        return np.array([values[0] - alone, values[0] + alone])
    middle = 0.5 * (values[1:] + values[:-1])
    return np.concatenate(([2.0 * values[0] - middle[0]], middle, [2.0 * values[-1] - middle[-1]]))


def _extent(stability: StabilityMap) -> Extent:
    """Bounds of the cells, and a view that holds all of them, the origin and the arrow."""
    angles = stability.angle_deg
    speed = np.maximum(_edges(stability.speed_kn, ALONE_KN), 0.0)
    angle = _edges(angles, ALONE_DEG)
    if len(angles) > 1 and angles[0] >= 0.0 and angles[-1] <= 180.0:
        angle = np.clip(angle, 0.0, 180.0)  # beyond is the mirror image
    rim = speed[-1]
    across, along = _arc(rim, angle[0], angle[-1])
    left, right = min(0.0, across.min()), max(0.0, across.max())
    bottom, top = min(0.0, along.min()), max(0.42 * rim, along.max())
    least = 0.25 * rim  # a map of currents along the path is narrow
    return Extent(
        speed,
        angle,
        (1.25 * left if left < -1e-9 else 0.0, 1.14 * max(right, least)),
        (1.1 * bottom if bottom < -1e-9 else -0.05 * rim, 1.1 * top),
    )


def draw_map(stability: StabilityMap, file: Path) -> None:
    """Draw a map into an image file; the suffix says which kind (png, svg, pdf).

    Raises
    ------
    ConfigurationError
        If the file cannot be written.
    """
    count, extent = len(stability.panels), _extent(stability)
    columns = min(3, count)
    rows = math.ceil(count / columns)
    slope = np.diff(extent.along_kn)[0] / np.diff(extent.across_kn)[0]
    height = min(max(_WIDTH * slope, _HEIGHTS[0]), _HEIGHTS[1])
    figure = new_figure(max(1.5 + _WIDTH * columns, 7.0), 3.2 + (1.0 + height) * rows)
    axes = figure.subplots(rows, columns, squeeze=False, sharex=True, sharey=True)
    panels = zip(axes.flat, stability.panels, stability.classes, shares(stability), strict=False)
    for axis, name, classes, share in panels:
        _draw_panel(axis, stability, classes, extent)
        axis.set_title(_title(name, share))
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
    figure.legend(
        handles=_legend(stability), loc='outside lower center', ncols=2 if columns > 1 else 1
    )
    save_figure(figure, file, dpi=150)


def _title(name: str, share: dict[str, Any]) -> str:
    """Name of a panel, and how much of it is stable."""
    held = share['stable_of_feasible']
    of = 'no cell is feasible' if held is None else f'{held:.1%} of the feasible'
    stable = f'stable: {share[STABLE]:.1%} of all cells,\n{of}'
    return f'{name.replace("_", " ")}\n{stable}' if name else stable


def _draw_panel(axis, stability: StabilityMap, classes: np.ndarray, extent: Extent) -> None:
    """Cells, rays and circles, limits and the points of the paper."""
    from matplotlib.colors import ListedColormap

    cells = len(extent.angle_deg) - 1
    fine = max(8, math.ceil(_ARC / cells))  # chords for the arc of a cell
    steps = np.arange(fine * cells + 1) / fine
    angle_deg = np.interp(steps, np.arange(cells + 1), extent.angle_deg)
    axis.pcolormesh(
        *_tip(extent.speed_kn[:, None], angle_deg),
        np.repeat(classes, fine, axis=1),
        cmap=ListedColormap([_COLOURS[name] for name in CLASSES]),
        vmin=-0.5,
        vmax=len(CLASSES) - 0.5,
        rasterized=True,
    )
    _draw_rose(axis, extent)
    _draw_limits(axis, extent.speed_kn[-1], stability.horizontal_kn)
    for degrees, _, marker in PAPER_POINTS:
        across, along = _tip(PAPER_KN, degrees)
        axis.plot(across, along, marker, color='white', markeredgecolor='black', markersize=6.5)
    axis.set_xlim(extent.across_kn)
    axis.set_ylim(extent.along_kn)
    axis.set_aspect('equal')
    axis.spines[['top', 'right']].set_visible(False)


def _tip(speed: float, angle_deg: float) -> tuple[float, float]:
    """Where a current lies in the map: across and along the path; of numbers or arrays."""
    return speed * np.sin(np.radians(angle_deg)), speed * np.cos(np.radians(angle_deg))


def _arc(speed: float, first_deg: float, last_deg: float) -> tuple[np.ndarray, np.ndarray]:
    """The same for a speed at all angles between two."""
    return _tip(speed, np.linspace(first_deg, last_deg, _ARC))


def _round_values(first: float, last: float, steps: tuple[float, ...]) -> np.ndarray:
    """Multiples of the first step that has two of them from first to last, or of the last step."""
    for step in steps:
        values = step * np.arange(
            math.ceil(first / step - 1e-9), math.floor(last / step + 1e-9) + 1
        )
        if len(values) > 1:
            break
    return values


def _draw_rose(axis, extent: Extent) -> None:
    """Rays and circles by which angle and speed of a current can be read."""
    first, last, rim = extent.angle_deg[0], extent.angle_deg[-1], extent.speed_kn[-1]
    thin = {'color': 'black', 'linewidth': 0.4, 'alpha': 0.4}
    for degrees in _round_values(first, last, _RAYS):
        across, along = _tip(rim, degrees)
        axis.plot([0.0, across], [0.0, along], **thin)
        is_aside = abs(across) > 0.01 * rim
        place = (1.06 * across if is_aside else 0.03 * rim, 1.06 * along)
        to = 'center' if is_aside else 'left'
        axis.annotate(f'{degrees:.0f}°', place, ha=to, va='center', fontsize='small')
    for speed in _round_values(1e-6, rim, _CIRCLES):
        axis.plot(*_arc(speed, first, last), **thin)
        axis.annotate(f' {speed:g} kn', _tip(speed, last), fontsize='x-small', va='center')
    look = {'arrowstyle': '-|>', 'linewidth': 2.0, 'color': 'black'}
    axis.annotate('', xy=(0.0, 0.42 * rim), xytext=(0.0, 0.0), arrowprops=look)
    axis.annotate('path', (0.02 * rim, 0.36 * rim), fontsize='small')


def _draw_limits(axis, rim: float, speed: float) -> None:
    """Where the cross current is U_h, and where no progress is left."""
    if speed < rim:
        top = math.sqrt(rim * rim - speed * speed)
        for side in (-speed, speed):
            axis.plot([side, side], [0.0, top], color='black', linewidth=2.0)
    axis.plot(*_arc(speed, 90.0, 270.0), '--', color='black', linewidth=2.0)


def _legend(stability: StabilityMap) -> list:
    from matplotlib.lines import Line2D
    from matplotlib.patches import Patch

    failed = np.any(stability.classes == CLASSES.index(FAILED))
    handles = []
    for name in CLASSES if failed else CLASSES[:-1]:
        text, look = _MEANING[name].format(stability.measure), {'edgecolor': 'black'}
        handles.append(Patch(facecolor=_COLOURS[name], linewidth=0.5, label=text, **look))
    limits = {
        '-': f'cross current = speed of the glide U_h = {stability.horizontal_kn:.2f} kn',
        '--': 'no progress along the path is left',
    }
    for style, what in limits.items():
        look = {'color': 'black', 'linewidth': 2.0, 'linestyle': style}
        handles.append(Line2D([], [], label=f'limit: {what}', **look))
    white = {'color': 'none', 'markerfacecolor': 'white', 'markeredgecolor': 'black'}
    for degrees, what, marker in PAPER_POINTS:
        text = f'the paper: {PAPER_KN:.1f} kn at {degrees:.0f} deg, {what}'
        handles.append(Line2D([], [], marker=marker, label=text, **white))
    return handles
