# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""The report of a run: one web page that says what happened, to someone who was not there."""

import math
from collections.abc import Callable, Sequence
from typing import Any

from glider_base.files import yaml_text
from glider_base.frames import Origin, to_geodetic
from glider_base.signals import TICK_S
from glider_bringup.scoring.card import STATUSES
from glider_bringup.scoring.scores import reckoned
from glider_bringup.scoring.traces import Dive, dives_of
from glider_bringup.showing.findings import findings, verdict
from glider_bringup.showing.panels import report_panels
from glider_bringup.showing.scorecard import card_rows, show, title_of
from glider_bringup.showing.web_page import FlownRun, make_page
from glider_bringup.showing.words import count, span, way
from glider_mission.chart import place_text
from glider_model.ocean.current_settings import KNOT_MPS

#: Marks of what became of a run, by the colour of that word; of others another one.
_MARKS, _OTHER_MARK = {'green': '✓', 'yellow': '!'}, '✕'


def _number(value: float | None, digits: int, unit: str) -> str:
    """Number and unit that stay on one line."""
    return show(value, unit, digits).replace(' ', '\N{NO-BREAK SPACE}')


def _tiles(run: FlownRun) -> list[tuple[str, str, str]]:
    """The figures that a person asks for first: name, value, and more about it."""
    card, depth_m = run.card, run.scenario.profile.depth_m
    time_s, way_m, dives = card['sim_time_s'], card['distance_along_path_m'], card['dives']
    track, depth = card['cross_track_m'], card['depth_m']
    rms, whole = _number(track['rms_steady'], 3, 'm'), _number(track.get('max_run'), 2, 'm')
    asked = _number(depth_m, 0, 'm')
    beyond = f'{_number(depth["overshoot"], 1, "m")} beyond {asked}'
    against = beyond if (depth['max'] or 0.0) > depth_m else f'of {asked}'
    speed = f'{way_m / max(TICK_S, time_s):.2f} m/s on average' if way_m is not None else ''
    (pitch, most_pitch), (heading, most_heading) = (
        [_number(card[of][name], digits, 'deg') for name in ('rms_steady', 'max_steady')]
        for of, digits in (('pitch_error_deg', 2), ('heading_fluctuation_deg', 3))
    )
    is_profile = run.scenario.profile.mode == 'profile'
    steady = f'largest; rms {rms}; whole run {whole}'
    return [
        ('simulated time', span(time_s), count(dives, 'dive') if dives else ''),
        ('along the path', way(way_m), speed),
        ('cross-track, steady', _number(track['max_steady'], 2, 'm'), steady),
        ('deepest point', _number(depth['max'], 1, 'm'), against if is_profile else ''),
        ('pitch error, steady', pitch, f'rms; largest {most_pitch}'),
        ('heading, steady', heading, f'fluctuation, rms; largest {most_heading}'),
    ]


def _what_was_set(run: FlownRun) -> str:
    """Fields of the scenario that are not as they would be by default, as YAML.

    So are those of the vehicle that are not as in its file.
    """
    said_elsewhere = {'name', 'vehicle', 'description', 'changed'}
    values = run.scenario.model_dump(mode='json', exclude_defaults=True, exclude=said_elsewhere)
    named = {'name': run.scenario.name, 'vehicle': run.card['vehicle']}
    changed = {f'vehicle.{field}': value for field, value in run.vehicle.changed().items()}
    return yaml_text({**named, **changed, **values})


def _pair(values: list[float] | None, digits: int) -> str:
    """North and east in one cell."""
    if values is None:
        return '-'
    return ' / '.join(f'{round(value, digits) + 0.0:,.{digits}f}' for value in values)


def _knots(values: list[float] | None) -> list[float] | None:
    return values and [value / KNOT_MPS for value in values]


#: Columns of the tables of surfacings, after time and places, and of dives: head, and line's text.
_SURFACING: dict[str, Callable[[dict], str]] = {
    'error (m)': lambda one: f'{one["error_m"]:,.1f}',
    'in the 95 % ellipse': lambda one: {True: 'yes', False: 'no', None: '-'}[one['inside_95']],
    'off the path (m)': lambda one: f'{one["cross_track_m"]:+,.1f}',
    'DAC, N / E (kn)': lambda one: _pair(_knots(one['dac_true_mps']), 3),
    'estimated DAC, N / E (kn)': lambda one: _pair(_knots(one['dac_believed_mps']), 3),
}
_DIVE: dict[str, Callable[[Dive], str]] = {
    'from': lambda one: span(one.from_s),
    'lasted': lambda one: span(one.to_s - one.from_s),
    'deepest (m)': lambda one: f'{one.deepest_m:,.1f}',
    'way made good (m)': lambda one: f'{one.way_m:,.0f}',
    'over ground (m/s)': lambda one: f'{one.way_m / (one.to_s - one.from_s):.3f}',
    'largest off the path (m)': lambda one: f'{one.off_path_m:,.1f}',
    'battery left (%)': lambda one: (
        '-' if math.isnan(one.battery_percent) else f'{one.battery_percent:.1f}'
    ),
}


def _surfacing(origin: Origin | None) -> dict[str, Callable[[dict], str]]:
    """Columns of the table of surfacings, with places in degrees if there is a chart."""
    unit = ', N / E (m)' if origin is None else ''

    def place(ned_m: list[float]) -> str:
        return place_text(*to_geodetic(*ned_m, origin)) if origin else _pair(ned_m, 0)

    return {
        'time': lambda one: span(one['t_s']),
        f'estimated place{unit}': lambda one: place(one['believed_ned_m']),
        f'true place{unit}': lambda one: place(one['true_ned_m']),
        **_SURFACING,
    }


def _table(columns: dict[str, Callable[[Any], str]], things: Sequence) -> list[list[str]]:
    """Head and numbered lines of a table; empty without a line."""
    lines = ([text(one) for text in columns.values()] for one in things)
    numbered = [[str(number), *line] for number, line in enumerate(lines, 1)]
    return [['', *columns], *numbered] if numbered else []


def report_page(run: FlownRun) -> str:
    """Text of the report of a run."""
    card, rules, status = run.card, run.rules, run.card['status']
    return make_page(
        'report.html',
        [run],
        report_panels(run),
        title=f'{title_of(run.scenario.name, run.scenario.changed)}: {status}',
        scenario=run.scenario,
        status=status,
        badge=f'{_MARKS.get(STATUSES[status], _OTHER_MARK)} {status.capitalize()}',
        verdict=verdict(card, rules.settle_s),
        tiles=_tiles(run),
        findings=findings(run),
        surfacings=_table(_surfacing(rules.origin), (reckoned(card) or {}).get('reports', [])),
        dives=_table(_DIVE, dives_of(run.traces) if run.traces.ticks else []),
        card=card_rows(card),
        settle=span(rules.settle_s),
        margin=span(rules.margin_s),
        steady_depth_m=f'{rules.steady_depth_m:.3g}',
        bucket_s=f'{2.0 * run.traces.spacing_s:g}',
        was_set=_what_was_set(run),
        as_flown=run.as_flown,
    )
