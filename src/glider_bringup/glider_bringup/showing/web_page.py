# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""Web pages that are one file and need no network: plotly.js, curves and text in one."""

import base64
import zlib
from functools import cache
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from glider_bringup.scoring.scores import reckoned
from glider_bringup.scoring.traces import SAMPLES, Traces
from glider_guidance.path.curve import path_length, path_point, path_tangent
from glider_mission.rules import Rules
from glider_mission.scenario import Scenario
from glider_model.vehicle.file import Vehicle

#: Templates, style and scripts of the pages.
_WEB = Path(__file__).parent / 'web'
#: Compression: 1 is fast, and close to what more would give.
_LEVEL = 1
#: A path is drawn with so many points.
_PATH_POINTS = 500
#: Units of a time axis: from which duration on, name, length (s).
_TIME_UNITS = ((7200.0, 'h', 3600.0), (600.0, 'min', 60.0), (0.0, 's', 1.0))


class Steps(NamedTuple):
    """One line of a panel that is level for some time, then for some other."""

    label: str
    role: str  #: colour, as page.css names it
    spans: tuple[tuple[float, float, float], ...]  #: from and until when (s), value
    dashed: bool = False


class Curve(NamedTuple):
    """One line of a panel."""

    name: str  #: of the curve in `Traces`
    label: str
    role: str  #: colour, as page.css names it
    dashed: bool = False
    flag: str = ''  #: name of the curve that says where to draw it; empty: everywhere
    run: int = 0


class Panel(NamedTuple):
    """One picture of a page."""

    id: str
    title: str
    caption: str
    axis: str = ''  #: name and unit of the vertical axis
    curves: tuple[Curve, ...] = ()
    limits: tuple[float, ...] = ()  #: horizontal lines
    kind: str = 'time'  #: time, track, space, plan or places
    inflections: int = -1  #: run whose inflections are marked
    surfacings: int = -1  #: run whose surfacings are marked
    steps: tuple[Steps, ...] = ()
    inverted: bool = False
    log: bool = False

    @property
    def shape(self) -> str:
        """How the style calls its shape: low, map, map plan, or none."""
        if self.kind == 'time':
            return 'low' if self.id.startswith('learnt') else ''
        return 'map' if self.kind in ('track', 'space') else f'map {self.kind}'


def pack(data: bytes) -> str:
    """Bytes, deflated, as text."""
    return base64.b64encode(zlib.compress(data, _LEVEL)).decode('ascii')


class FlownRun(NamedTuple):
    """A run as pages show it."""

    label: str
    scenario: Scenario
    as_flown: str  #: text of the scenario's file
    vehicle: Vehicle
    card: dict[str, Any]
    traces: Traces | None  #: None if only the score is wanted
    rules: Rules  #: by which it is scored
    unfit: list[str]  #: what the vehicle was not fit for, in words

    @property
    def is_rerouted(self) -> bool:
        """Whether an order changed the path: one whose time came."""
        ticks = self.traces.ticks
        return any(order.path and order.tick < ticks for order in self.scenario.orders)

    def path_points(self) -> list[list[float]]:
        """The desired path (m, NED): as far as it was followed, where it goes on at its end.

        Where orders changed it: what was desired, from the start to the end.
        """
        path, samples = self.scenario.path, self.traces.samples
        if self.is_rerouted:
            desired = [samples[f'target_{name}_m'] for name in ('north', 'east', 'depth')]
            points = np.column_stack(desired)
            points = points[np.isfinite(points).all(axis=1)]
            points[:, 2] *= self.scenario.profile.mode == 'path'  # a yo's is level
            chosen = np.linspace(0, len(points) - 1, min(_PATH_POINTS, len(points)))
            return np.round(points[chosen.astype(int)], 2).tolist()
        points = path.points(_PATH_POINTS)
        if path.at_end == 'continue':
            params = path.params()
            length = path_length(params)
            end, ahead = np.array([f(length, params) for f in (path_point, path_tangent)])
            north, east = (samples[f'track_{name}_m'] for name in ('north', 'east'))
            along = (north - end[0]) * ahead[0] + (east - end[1]) * ahead[1]
            beyond = float(np.max(along, initial=0.0, where=np.isfinite(along)))
            beyond /= float(np.dot(ahead[:2], ahead[:2]))
            if beyond > 0.0:
                points = np.vstack((points, path_point(length + beyond, params)))
        return np.round(points, 2).tolist()

    def data(self, names: set[str]) -> dict[str, Any]:
        """What the page's script needs of it: the curves of these names, track and path."""
        traces = self.traces
        arrays = {name: traces.curves[name] for name in sorted(names)} | {
            name: traces.samples[name]
            for name in SAMPLES
            if not name.startswith('believed_') or np.any(np.isfinite(traces.samples[name]))
        }
        # float32, all first bytes of them first, which packs tighter
        numbers = np.concatenate([np.asarray(values, '<f4') for values in arrays.values()])
        data = pack(numbers.view(np.uint8).reshape(-1, 4).T.tobytes())
        lengths = {name: len(values) for name, values in arrays.items()}
        return {
            'label': self.label,
            'spacing': traces.spacing_s,
            'packed': {'lengths': lengths, 'data': data},
            'inflections': [round(float(time), 3) for time in traces.inflections_s()],
            'path': self.path_points(),
            'origin': self.rules.origin and self.rules.origin._asdict(),
            'faults': [one for one in self.card.get('faults', []) if one['t_s'] is not None],
            'surfacings': (reckoned(self.card) or {}).get('reports', []),
        }


def page_data(runs: list[FlownRun], panels: list[Panel]) -> dict[str, Any]:
    """What the page's script needs to draw these panels."""
    duration_s = max(run.card['sim_time_s'] for run in runs)
    unit, seconds = next((name, s) for least, name, s in _TIME_UNITS if duration_s >= least)
    names: list[set[str]] = [set() for _ in runs]
    for curve in (curve for panel in panels for curve in panel.curves):
        names[curve.run] |= {curve.name, curve.flag} - {''}
    drawn = [run.data(names[i]) for i, run in enumerate(runs)]
    for i, run in enumerate(drawn):
        run['own_path'] = run['path'] not in [other['path'] for other in drawn[:i]]
    return {
        'duration': duration_s,
        'unit': {'name': unit, 'seconds': seconds},
        'panels': [
            panel._asdict()
            | {
                name: [one._asdict() for one in getattr(panel, name)]
                for name in ('curves', 'steps')
            }
            for panel in panels
        ],
        'runs': drawn,
    }


@cache
def _templates() -> Any:
    """Templates of the pages: what is put in is text, and an unknown name an error."""
    from jinja2 import Environment, FileSystemLoader, StrictUndefined

    strict = {'autoescape': True, 'undefined': StrictUndefined}
    found = Environment(
        loader=FileSystemLoader(_WEB), trim_blocks=True, lstrip_blocks=True, **strict
    )
    found.policies['json.dumps_kwargs'] = {'allow_nan': False, 'separators': (',', ':')}
    found.globals['source'] = lambda name: (_WEB / name).read_text(encoding='utf-8')
    return found


def make_page(
    template: str, runs: list[FlownRun], sections: dict[str, list[Panel]], **content
) -> str:
    """Whole text of a page with panels by heading, and what else its template in ``web`` names."""
    data = page_data(runs, [panel for group in sections.values() for panel in group])
    from plotly.offline import get_plotlyjs

    library = pack(get_plotlyjs().encode()) if data['panels'] else ''
    content |= {'data': data, 'library': library, 'sections': sections}
    return _templates().get_template(template).render(content)
