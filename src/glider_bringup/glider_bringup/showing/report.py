# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""The report of a run: one web page that says what happened, to someone who was not there."""

import math
from typing import Any

from glider_bringup.mission.scenario import told_fields
from glider_bringup.scoring.dives import dives_of
from glider_bringup.scoring.scores import reckoned
from glider_bringup.showing.findings import findings, verdict
from glider_bringup.showing.panels import SURFACINGS, report_panels
from glider_bringup.showing.scorecard import card_rows
from glider_bringup.showing.web_page import FlownRun, make_page, page_data
from glider_bringup.showing.words import count, span, way
from glider_model.base.files import yaml_text
from glider_model.base.signals import TICK_S
from glider_model.ocean.current_settings import KNOT_MPS

_BADGES = {
    'completed': '✓ Completed',
    'surfaced': '! Surfaced',
    'lost': '✕ Lost',
    'infeasible': '! Infeasible',
    'aborted': '✕ Aborted',
    'failed': '✕ Failed',
}


def _title(run: FlownRun) -> str:
    """Name of what was flown, and what was changed in it."""
    changed = told_fields(run.scenario.changed)
    return f'{run.scenario.name} with {changed}' if changed else run.scenario.name


def _number(value: float | None, digits: int, unit: str) -> str:
    """Number and unit that stay on one line."""
    return '-' if value is None else f'{value:,.{digits}f}\N{NO-BREAK SPACE}{unit}'


def _tiles(run: FlownRun) -> list[tuple[str, str, str]]:
    """The figures that a person asks for first: name, value, and more about it."""
    card, depth_m = run.card, run.scenario.profile.depth_m
    track, pitch = card['cross_track_m'], card['pitch_error_deg']
    heading, depth = card['heading_fluctuation_deg'], card['depth_m']
    speed = card['distance_along_path_m'] / max(TICK_S, card['sim_time_s'])
    beyond = f'{_number(depth["overshoot"], 1, "m")} beyond {_number(depth_m, 0, "m")}'
    return [
        (
            'simulated time',
            span(card['sim_time_s']),
            count(card['dives'], 'dive') if card['dives'] else '',
        ),
        (
            'along the path',
            way(card['distance_along_path_m']),
            f'{speed:.2f} m/s on average',
        ),
        (
            'cross-track, steady',
            _number(track['max_steady'], 2, 'm'),
            f'largest; rms {_number(track["rms_steady"], 3, "m")}; '
            f'whole run {_number(track.get("max_run"), 2, "m")}',
        ),
        (
            'deepest point',
            _number(depth['max'], 1, 'm'),
            beyond if run.scenario.profile.mode == 'profile' else '',
        ),
        (
            'pitch error, steady',
            _number(pitch['rms_steady'], 2, 'deg'),
            f'rms; largest {_number(pitch["max_steady"], 2, "deg")}',
        ),
        (
            'heading, steady',
            _number(heading['rms_steady'], 3, 'deg'),
            f'fluctuation, rms; largest {_number(heading["max_steady"], 3, "deg")}',
        ),
    ]


def _what_was_set(run: FlownRun) -> str:
    """Fields of the scenario that are not as they would be by default, as YAML.

    So are those of the vehicle that are not as in its file.
    """
    told = {'name', 'vehicle', 'description', 'changed'}
    values = run.scenario.model_dump(mode='json', exclude_defaults=True, exclude=told)
    named = {'name': run.scenario.name, 'vehicle': run.card['vehicle']}
    changed = {f'vehicle.{field}': value for field, value in run.vehicle.changed().items()}
    return yaml_text({**named, **changed, **values})


def _pair(values: list[float] | None, digits: int) -> str:
    """North and east in one cell."""
    if values is None:
        return '-'
    return ' / '.join(f'{round(value, digits) + 0.0:,.{digits}f}' for value in values)


#: Head of the table of surfacings.
_SURFACING = (
    *('', 'time', 'believed place, N / E (m)', 'true place, N / E (m)', 'error (m)'),
    *('in the 95 % ellipse', 'off the path (m)'),
    *('mean current, N / E (kn)', 'believed of it, N / E (kn)'),
)


def _surfacings(card: dict[str, Any]) -> list[list[str]]:
    """Head and lines of the table of surfacings; empty of a vehicle that knows its place."""
    reports = (reckoned(card) or {}).get('reports', [])
    inside = {True: 'yes', False: 'no', None: '-'}
    lines = []
    for number, one in enumerate(reports, 1):
        currents = (
            one[name] and [value / KNOT_MPS for value in one[name]]
            for name in ('dac_true_mps', 'dac_believed_mps')
        )
        lines.append(
            [
                str(number),
                span(one['t_s']),
                _pair(one['believed_ned_m'], 0),
                _pair(one['true_ned_m'], 0),
                f'{one["error_m"]:,.1f}',
                inside[one['inside_95']],
                f'{one["cross_track_m"]:+,.1f}',
                *(_pair(current, 3) for current in currents),
            ]
        )
    return [list(_SURFACING), *lines] if lines else []


#: Head of the table of dives.
_DIVE = (
    *('', 'from', 'lasted', 'deepest (m)', 'way made good (m)', 'over ground (m/s)'),
    *('largest off the path (m)', 'battery left (%)'),
)


def _dives(run: FlownRun) -> list[list[str]]:
    """Head and lines of the table of dives; empty without one."""
    if not run.traces.ticks:
        return []
    lines = []
    for number, one in enumerate(dives_of(run.traces), 1):
        lasted_s = one.to_s - one.from_s
        left = '-' if math.isnan(one.battery_percent) else f'{one.battery_percent:.1f}'
        lines.append(
            [
                str(number),
                span(one.from_s),
                span(lasted_s),
                f'{one.deepest_m:,.1f}',
                f'{one.way_m:,.0f}',
                f'{one.way_m / lasted_s:.3f}',
                f'{one.off_path_m:,.1f}',
                left,
            ]
        )
    return [list(_DIVE), *lines] if lines else []


def report_page(run: FlownRun) -> str:
    """Text of the report of a run."""
    card, rules = run.card, run.rules
    sections = report_panels(run)
    data = page_data([run], [panel for group in sections.values() for panel in group])
    return make_page(
        'report.html',
        data,
        title=f'{_title(run)}: {card["status"]}',
        scenario=run.scenario,
        status=card['status'],
        badge=_BADGES[card['status']],
        verdict=verdict(card, rules.settle_s),
        tiles=_tiles(run),
        findings=findings(run),
        first={SURFACINGS: sections.pop(SURFACINGS)} if SURFACINGS in sections else {},
        sections=sections,
        surfacings=_surfacings(card),
        dives=_dives(run),
        card=card_rows(card),
        settle=span(rules.settle_s),
        margin=span(rules.margin_s),
        steady_depth_m=f'{rules.steady_depth_m:.3g}',
        bucket_s=f'{2.0 * run.traces.spacing_s:g}',
        was_set=_what_was_set(run),
        as_flown=run.as_flown,
    )
