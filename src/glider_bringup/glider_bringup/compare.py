# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""Runs side by side: their scores, what their scenarios differ in, and one page over the other."""

from collections.abc import Iterator
from html import escape
from operator import itemgetter
from pathlib import Path
from typing import Any

from glider_bringup.page import (
    ZOOM_BAR,
    Curve,
    FlownRun,
    Panel,
    make_page,
    page_data,
    section,
    table,
)
from glider_bringup.report import ACTUATORS, small, span
from glider_bringup.scorecard import card_rows
from glider_model.settings import ConfigurationError

#: Curves that are laid over each other: panel, title, caption, axis, curve.
_OVERLAID = (
    ('depth', 'Depth', 'How deep each was.', 'depth (m)', 'depth_m'),
    (
        'cross_track',
        'Cross-track error',
        'Distance from its own path, + to starboard of it.',
        'off the path (m)',
        'cross_track_m',
    ),
    ('pitch', 'Pitch', 'Nose up is positive.', 'pitch (deg)', 'pitch_deg'),
    ('heading', 'Heading', 'Clockwise from north.', 'heading (deg)', 'heading_deg'),
    ('roll', 'Roll', 'Starboard side down is positive.', 'roll (deg)', 'roll_deg'),
    *(
        (
            one.joint,
            one.title,
            f'{one.caption}.',
            f'{one.title.lower()} ({one.unit})',
            one.position,
        )
        for one in ACTUATORS
    ),
)
#: Colours before they come again, then dashed.
_COLOURS = 8


def labels(folders: list[Path]) -> list[str]:
    """Short names of runs: those of their folders, or the whole paths if two have one name.

    Raises
    ------
    ConfigurationError
        If a run is given twice.
    """
    whole = [folder.resolve() for folder in folders]
    for i, folder in enumerate(whole):
        if folder in whole[:i]:
            raise ConfigurationError(f'{folders[i]}: given twice (allowed: different runs)')
    names = [folder.name for folder in whole]
    return names if len(set(names)) == len(names) else [str(folder) for folder in folders]


def _fields(values: Any, name: str = '') -> Iterator[tuple[str, Any]]:
    """Every number and word in nested values, with its dotted name."""
    if isinstance(values, dict):
        for key, inner in values.items():
            yield from _fields(inner, f'{name}.{key}' if name else key)
    else:
        yield name, values


def differences(runs: list[FlownRun]) -> list[dict[str, Any]]:
    """Fields in which the scenarios of runs, or their vehicles, are not all the same.

    Returns
    -------
    list of dict
        ``field``, its dotted name, and ``values``, one of each run; None where there is no
        such field.
    """
    flat = []
    for run in runs:
        values = run.scenario.model_dump(mode='json', exclude={'vehicle', 'description'})
        vehicle = run.vehicle.model_dump(mode='json', exclude={'description'})
        flat.append(dict(_fields({**values, 'vehicle': vehicle})))
    names = dict.fromkeys(name for fields in flat for name in fields)
    return [
        {'field': name, 'values': [fields.get(name) for fields in flat]}
        for name in names
        if any(fields.get(name) != flat[0].get(name) for fields in flat)
    ]


def score_rows(cards: list[dict[str, Any]]) -> list[list[str]]:
    """Lines of scorecards side by side: name, then the text of each."""
    each = [card_rows(card) for card in cards]
    names = [name for name, _ in each[0]]
    return [[name, *(rows[i][1] for rows in each)] for i, name in enumerate(names)]


def difference_rows(found: list[dict[str, Any]]) -> list[list[str]]:
    """Lines of differences: field, then the text of each value."""
    return [
        [one['field'], *('-' if value is None else str(value) for value in one['values'])]
        for one in found
    ]


def caveats(cards: list[dict[str, Any]]) -> list[str]:
    """What to mind when these scores are compared."""
    found = []
    times = [card['sim_time_s'] for card in cards]
    if max(times) != min(times):
        found.append(
            f'The runs last from {span(min(times))} to {span(max(times))}: their scores are of '
            'different times, and each curve ends where its run does.'
        )
    for status in ('aborted', 'failed'):
        stopped = sum(card['status'] == status for card in cards)
        if stopped:
            found.append(f'{status.capitalize()} before its end: {stopped} of {len(cards)} runs.')
    return found


def _headline(runs: list[FlownRun]) -> str:
    """How far off the path each was, in a sentence."""
    errors = [
        (run.label, run.card['cross_track_m']['max_steady'])
        for run in runs
        if run.card['cross_track_m']['max_steady'] is not None
    ]
    whole = [
        (run.label, run.card['cross_track_m']['max_run'])
        for run in runs
        if run.card['cross_track_m'].get('max_run') is not None
    ]
    if not errors:
        return f'{len(runs)} runs; none has flown long enough for a score in steady glide.'
    return (
        f'Largest cross-track error in steady glide: {_ranked(errors)}. In the whole run: '
        f'{_ranked(whole)}.'
    )


def _ranked(errors: list[tuple[str, float]]) -> str:
    """Runs by their errors, the smallest first."""
    return ', '.join(f'{name} {small(error)}' for name, error in sorted(errors, key=itemgetter(1)))


def _panels(runs: list[FlownRun]) -> dict[str, list[Panel]]:
    """Panels by heading."""
    flown = [(i, run) for i, run in enumerate(runs) if run.traces.ticks]

    def overlaid(panel: str, title: str, caption: str, axis: str, name: str) -> Panel:
        curves = tuple(
            Curve(name, run.label, f'run{i % _COLOURS}', dashed=i >= _COLOURS, run=i)
            for i, run in flown
            if run.traces.has(name)
        )
        return Panel(panel, title, caption, axis, curves, inverted=name == 'depth_m')

    if not flown:
        return {}
    return {
        'Where they went': [
            Panel('track', 'Tracks', 'From above, to scale.', kind='track'),
            Panel(
                'space', 'In three dimensions', 'Drag to turn. Depth is stretched.', kind='space'
            ),
        ],
        'How they flew': [overlaid(*row) for row in _OVERLAID],
    }


def compare_page(runs: list[FlownRun]) -> str:
    """Text of the page that lays runs over each other."""
    sections = _panels(runs)
    panels = [panel for group in sections.values() for panel in group]
    names = [
        f'<span class="key" style="border-color: var(--run{i % _COLOURS}); '
        f'border-top-style: {"dashed" if i >= _COLOURS else "solid"}"></span>{escape(run.label)}'
        for i, run in enumerate(runs)
    ]
    found = differences(runs)
    notes = ''.join(
        f'<li class="note">{escape(text)}</li>' for text in caveats([run.card for run in runs])
    )
    title = f'{len(runs)} runs compared'
    body = (
        f'<h1><b>{title}</b></h1><p class="verdict">{escape(_headline(runs))}</p>'
        f'{table(score_rows([run.card for run in runs]), ["", *names])}'
        f'<ul class="findings">{notes}</ul>'
        '<h2>What the scenarios differ in</h2>'
        + (
            table(difference_rows(found), ['', *names])
            if found
            else '<p>Nothing: scenarios and vehicles are the same.</p>'
        )
        + (ZOOM_BAR if panels else '')
        + ''.join(section(heading, group) for heading, group in sections.items())
    )
    return make_page(title, body, page_data(runs, panels))
