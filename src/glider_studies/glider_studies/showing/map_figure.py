# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""The stability map as an image: each cell at the tip of the arrow of its current."""

import math
from pathlib import Path
from typing import Any

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
#: No less of the circle is in view (deg).
LEAST_DEG = 60.0
#: Points of an arc, and size of a panel (inch).
_ARC, _SIZE = 181, 4.2

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


def _edges(values: np.ndarray, alone: float) -> np.ndarray:
    """Bounds of cells around increasing values; the outer ones go half a step beyond them."""
    if len(values) == 1:
        return np.array([values[0] - alone, values[0] + alone])
    middle = 0.5 * (values[1:] + values[:-1])
    return np.concatenate(([2.0 * values[0] - middle[0]], middle, [2.0 * values[-1] - middle[-1]]))


def draw_map(stability: StabilityMap, file: Path) -> None:
    """Draw a map into an image file; the suffix says which kind (png, svg, pdf).

    Raises
    ------
    ConfigurationError
        If the file cannot be written.
    """
    count = len(stability.panels)
    columns = min(3, count)
    rows = math.ceil(count / columns)
    figure = new_figure(max(1.5 + _SIZE * columns, 7.0), 3.9 + (0.6 + _SIZE) * rows)
    polar = {'projection': 'polar'}
    axes = figure.subplots(rows, columns, squeeze=False, subplot_kw=polar)
    panels = zip(axes.flat, stability.panels, stability.classes, shares(stability), strict=False)
    for axis, name, classes, share in panels:
        _draw_panel(axis, stability, classes)
        axis.set_title(_title(name, share))
    for axis in axes.flat[count:]:
        axis.set_visible(False)
    figure.suptitle(
        f'{stability.title}\n'
        f'Each cell is one flight of {stability.vehicle}, at the tip of the arrow of its current:\n'
        'its speed (kn), and its angle off the path, which points up'
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


def _draw_panel(axis, stability: StabilityMap, classes: np.ndarray) -> None:
    """Cells, the path, the limits of physics, and the points of the paper."""
    from matplotlib.colors import ListedColormap

    angles, glide = stability.angle_deg, stability.horizontal_kn
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
        cmap=ListedColormap([_COLOURS[name] for name in CLASSES]),
        vmin=-0.5,
        vmax=len(CLASSES) - 0.5,
        rasterized=True,
    )
    for side in (-1.0, 1.0):
        off = np.linspace(0.02, 0.5 * np.pi, _ARC)
        axis.plot(side * off, glide / np.sin(off), color='black', linewidth=2.0)
    behind = np.linspace(0.5 * np.pi, 1.5 * np.pi, _ARC)
    axis.plot(behind, np.full(_ARC, glide), '--', color='black', linewidth=2.0)
    for degrees, _, marker in PAPER_POINTS:
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
