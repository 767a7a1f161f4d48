# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""The moving picture of README: a mission on a chart of the current, and its dives below.

Chart: speed of the water, mean over the depth of the dives, at the time of the frame; the route,
the track and the surfacings. Below: depth over time, with the vehicle at its pitch.
"""

from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.markers import MarkerStyle
from matplotlib.path import Path as Outline
from matplotlib.transforms import Affine2D
from PIL import Image

from glider_bringup.showing.figure import BLUE, GREY, ORANGE
from glider_bringup.showing.web_page import FlownRun
from glider_model.ocean.current import current_initial, current_step

FRAMES = 48
FRAME_MS = 180
#: The whole mission is shown this much longer at the end.
LAST_MS = 3000
#: Colours of the picture: few keep it small.
COLOURS = 64
#: Of the chart (km).
STEP_KM, MARGIN_KM = 0.8, 5.0
#: What the lower panel shows of the time before the frame (h).
WINDOW_H = 4.0
#: Side view of a glider, nose to the right; its wing is seen edge on.
GLIDER = Outline(
    [
        *((1.0, 0.0), (0.8, 0.13), (-0.75, 0.13), (-1.0, 0.03), (-1.2, 0.42), (-1.32, 0.42)),
        *((-1.15, 0.0), (-1.0, -0.03), (-0.75, -0.13), (0.8, -0.13), (1.0, 0.0)),
    ]
)


def draw(run: FlownRun, moving: Path, still: Path, progress: Callable[[int], None]) -> None:
    """Write the moving picture (GIF) and its last frame (PNG).

    Parameters
    ----------
    run : FlownRun
        A run of which traces were kept.
    moving, still : Path
        Files that are written.
    progress : callable
        Is told the frames that are done.
    """
    frames = []
    for image in images(run):
        frames.append(image)
        progress(len(frames))
    frames[-1].save(still, optimize=True)
    palette = frames[-1].quantize(COLOURS)
    small = [image.quantize(COLOURS, palette=palette, dither=0) for image in frames]
    times = [FRAME_MS] * (len(small) - 1) + [LAST_MS]
    small[0].save(moving, save_all=True, append_images=small[1:], duration=times, loop=0)


def images(run: FlownRun) -> Iterator[Image.Image]:
    """The frames, one after the other, the last one at the end of the mission."""
    samples, curves = run.traces.samples, run.traces.curves
    north, east = (samples[f'track_{name}_m'] / 1e3 for name in ('north', 'east'))
    hours = run.traces.time_s() / 3600.0
    surfaced = run.card['navigation']['reports']
    box = (east.min() - MARGIN_KM, east.max() + MARGIN_KM, north.min() - 4.0, north.max() + 4.0)
    route = np.array(run.scenario.path.waypoints) / 1e3
    for share in np.linspace(1.0 / FRAMES, 1.0, FRAMES):
        now = share * hours[-1]
        figure = Figure(figsize=(8.3, 4.3), dpi=100, layout='constrained')
        canvas = FigureCanvasAgg(figure)
        chart, profile = figure.subplots(2, 1, height_ratios=(2.1, 1.0))
        draw_water(chart, figure, run.scenario, box, 3600.0 * now)
        chart.plot(route[:, 1], route[:, 0], '--', color=GREY, linewidth=1.2, label='route')
        passed = int(share * (len(north) - 1)) + 1
        chart.plot(east[:passed], north[:passed], color=BLUE, linewidth=1.8, label='track')
        fixes = [one['true_ned_m'] for one in surfaced if one['t_s'] <= 3600.0 * now]
        at = np.array(fixes).reshape(-1, 2) / 1e3
        chart.plot(at[:, 1], at[:, 0], 'o', color=ORANGE, markersize=5, label='surfacing, fix')
        chart.plot(east[passed - 1], north[passed - 1], '^', color='black', markersize=8)
        chart.set(xlabel='east (km)', ylabel='north (km)', xlim=box[:2], ylim=box[2:])
        chart.set_title(f'{run.card["vehicle"]}, dead-reckoned: {now:.0f} h', fontsize=11)
        chart.legend(loc='upper right', fontsize='small')
        seen = (hours <= now) & (hours > now - WINDOW_H)
        depth, pitch = curves['depth_m'][seen], curves['pitch_deg'][seen]
        profile.plot(hours[seen], depth, color=BLUE, linewidth=1.5)
        marker = MarkerStyle(GLIDER, transform=Affine2D().rotate_deg(float(pitch[-1])))
        profile.plot(hours[seen][-1], depth[-1], color='black', marker=marker, markersize=34)
        profile.set(xlabel='time (h)', ylabel='depth (m)')
        deepest = 1.15 * run.scenario.profile.depth_m
        profile.set(xlim=(now - WINDOW_H, now + 0.4), ylim=(deepest, -30.0))
        profile.grid(alpha=0.3)
        canvas.draw()
        yield Image.fromarray(np.asarray(canvas.buffer_rgba())[..., :3])


def draw_water(axis, figure, scenario, box, t_s: float) -> None:
    """Speed and direction of the water over a box (km), at a time, mean over depth."""
    params = scenario.current_settings().params()
    east, north = (np.arange(first, last + STEP_KM, STEP_KM) for first, last in (box[:2], box[2:]))
    depths = np.linspace(0.0, scenario.profile.depth_m, 5)
    flow = np.zeros((len(north), len(east), 2))
    for row, y in enumerate(1e3 * north):
        for column, x in enumerate(1e3 * east):
            waters = [
                current_step(current_initial(params), np.array([y, x, z]), t_s, params, 0.1)[1]
                for z in depths
            ]
            flow[row, column] = np.mean(waters, axis=0)[:2]
    speed = np.hypot(flow[..., 0], flow[..., 1])
    levels = np.arange(0.0, 0.41, 0.05)
    filled = axis.contourf(east, north, speed, levels, cmap='YlGnBu', alpha=0.75, extend='max')
    figure.colorbar(filled, ax=axis, label='current (m/s)')
    few = slice(None, None, 4)
    arrows = (flow[few, few, 1], flow[few, few, 0])
    axis.quiver(east[few], north[few], *arrows, color='#355', scale=9.0, width=0.0016)
    axis.set_aspect('equal')
