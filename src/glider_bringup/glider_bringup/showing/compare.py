# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""Runs side by side: their scores, what their scenarios differ in, and one page over the other."""

import math
from collections.abc import Callable
from itertools import compress
from pathlib import Path
from typing import Any, NamedTuple

from glider_base.settings import ConfigurationError, leaves
from glider_bringup.scoring.card import STOPPED
from glider_bringup.scoring.scores import Score, reckoned, scores_in
from glider_bringup.showing.panels import ACTUATORS, FLOWN, SPACE, SURFACE, flown_panel
from glider_bringup.showing.scorecard import engine_text, event_texts, flown_text, show
from glider_bringup.showing.web_page import Curve, FlownRun, Panel, make_page
from glider_bringup.showing.words import small, span
from glider_mission.changes import fields_text

#: Captions of the panels of curves that are laid over each other.
_OVERLAID = {
    'depth': 'How deep each was.',
    'cross_track': 'Distance from its own path, + to starboard of it.',
    'place_error': 'Horizontal distance between the true and the estimated position.',
    'pitch': 'Nose up is positive.',
    'heading': 'Clockwise from north.',
    'roll': 'Starboard side down is positive.',
}
#: Colours before they come again, then dashed.
_COLOURS = 8


def labels(folders: list[Path]) -> list[str]:
    """Short names of runs: those of their folders, or the whole paths if two have one name.

    Raises ConfigurationError if a run is given twice.
    """
    whole = [folder.resolve() for folder in folders]
    for i, folder in enumerate(whole):
        if folder in whole[:i]:
            raise ConfigurationError(f'{folders[i]}: given twice (allowed: different runs)')
    names = [folder.name for folder in whole]
    return names if len(set(names)) == len(names) else [str(folder) for folder in folders]


def differences(runs: list[FlownRun]) -> list[dict[str, Any]]:
    """Fields in which the scenarios of runs, or their vehicles, are not all the same.

    Each has a ``field``, its dotted name, and ``values``, one of each run; None where there is no
    such field.
    """
    flat = []
    for run in runs:
        values = run.scenario.model_dump(
            mode='json', exclude={'vehicle', 'description', 'changed'}
        )
        vehicle = run.vehicle.model_dump(mode='json', exclude={'description'})
        flat.append(dict(leaves({**values, 'vehicle': vehicle})))
    names = dict.fromkeys(name for fields in flat for name in fields)
    return [
        {'field': name, 'values': [fields.get(name) for fields in flat]}
        for name in names
        if any(fields.get(name) != flat[0].get(name) for fields in flat)
    ]


def difference_rows(found: list[dict[str, Any]]) -> list[list[str]]:
    """Lines of differences: field, then the text of each value, of vehicles without its source."""
    return [
        [name, *(_said(name, value) for value in one['values'])]
        for one in found
        if not (name := one['field']).endswith(('.unit', '.source'))
    ]


def _said(field: str, value: Any) -> str:
    """Value of a field; a long time also as a person says it."""
    if value is None:
        return '-'
    is_long = field.endswith('_s') and isinstance(value, int | float) and value >= 120.0
    return f'{value} ({span(value)})' if is_long else str(value)


# ---------------------------------------------------------------------------------- scores


class Cell(NamedTuple):
    """What a comparison shows of one run in one line."""

    text: str
    change: str = ''  #: from the first run; empty where there is nothing to subtract
    better: bool = False


#: What a scorecard says of how a run was computed and recorded, not of the flight.
_NOT_FLOWN = (
    *('engine', 'wall_time_s', 'real_time_factor'),
    *('messages_recorded', 'messages_lost'),
)
#: Runs are judged against each other if none lasts longer than another by more than this share.
ALIKE = 0.1
HOW_TO_READ = (
    'In brackets: the difference from the first run. {mark} marks the better value; nothing is '
    'marked where neither is better, in a run that was stopped, and where one run lasts more than '
    'a tenth longer than another.'
)


def _change(score: Score, value: float | None, first: float | None) -> str:
    """How a value differs from that of the first run."""
    if value is None or first is None:
        return ''
    difference = round(value - first, score.digits)
    if not difference:
        return '='
    if score.unit == 's':
        return f'{"+" if difference > 0.0 else "-"}{span(abs(difference))}'
    return f'{difference:+,.{score.digits}f}'


def _cells(score: Score, cards: list[dict[str, Any]]) -> list[Cell]:
    """One score of all runs, rounded as it is shown, and which is better if that can be said."""
    values = [score.in_card(card) for card in cards]
    values = [None if value is None else round(value, score.digits) for value in values]
    judged = [card['status'] not in ('surfaced', 'lost', *STOPPED) for card in cards]
    times = [card['sim_time_s'] for card in compress(cards, judged)]
    known = set(compress(values, judged)) - {None}
    alike = len(known) > 1 and max(times) <= (1.0 + ALIKE) * min(times)
    best = min(known) if score.less_is_better and alike else None
    cells = []
    for i, (value, is_judged) in enumerate(zip(values, judged, strict=True)):
        is_time = score.unit == 's' and value is not None
        text = span(value) if is_time else show(value, score.unit, score.digits)
        better = is_judged and best is not None and value == best
        cells.append(Cell(text, _change(score, value, values[0]) if i else '', better))
    return cells


#: What is shown of a run before its scores, and what of one that has none of it.
_TOLD: dict[str, tuple[Callable[[dict], str], str]] = {
    'status': (lambda card: ': '.join(filter(None, (card['status'], card['reason']))), ''),
    'flown': (flown_text, ''),
    'engine': (engine_text, ''),
    'changed': (lambda card: fields_text(card.get('changed', {})), 'nothing'),
    'navigation': (lambda card: (reckoned(card) or {'method': ''})['method'], 'known'),
    'guard': (lambda card: '; '.join(event_texts(card, 'guard')), 'nothing'),
}


def score_rows(cards: list[dict[str, Any]]) -> list[tuple[str, list[Cell]]]:
    """Lines of scorecards side by side: name, then a cell of each run."""
    rows = []
    for name, (say, without) in _TOLD.items():
        texts = [say(card) for card in cards]
        if any(texts):
            rows.append((name, [Cell(text or without) for text in texts]))
    return rows + [
        (score.label, _cells(score, cards))
        for score in scores_in(cards)
        if any(score.in_card(card) is not None for card in cards)
    ]


def are_equal(cards: list[dict[str, Any]]) -> bool:
    """Whether runs were flown alike: one scorecard, to the last digit."""
    flown = [
        {name: value for name, value in card.items() if name not in _NOT_FLOWN} for card in cards
    ]
    return all(one == flown[0] for one in flown)


EQUAL = 'The runs are equal: their scores are the same to the last digit.'


def caveats(cards: list[dict[str, Any]]) -> list[str]:
    """What to mind when these scores are compared."""
    found = []
    times = [card['sim_time_s'] for card in cards]
    shortest, longest = span(min(times)), span(max(times))
    if shortest != longest:
        found.append(
            f'The runs last from {shortest} to {longest}: their scores are of '
            'different times, and each curve ends where its run does.'
        )
    for status in ('lost', 'surfaced', *STOPPED):
        stopped = sum(card['status'] == status for card in cards)
        if stopped:
            found.append(f'{status.capitalize()} before its end: {stopped} of {len(cards)} runs.')
    return found


def _headline(runs: list[FlownRun]) -> str:
    """How far off the path each was, in a sentence."""
    if are_equal([run.card for run in runs]):
        return EQUAL
    steady, whole = (
        [(run.label, run.card['cross_track_m'].get(name)) for run in runs]
        for name in ('max_steady', 'max_run')
    )
    if all(error is None for _, error in steady):
        return f'{len(runs)} runs; none has flown long enough for a score in steady glide.'
    return (
        f'Largest cross-track error in steady glide: {_ranked(steady)}. In the whole run: '
        f'{_ranked(whole)}.'
    )


def _ranked(errors: list[tuple[str, float | None]]) -> str:
    """Runs by their errors, the smallest first, and last those that have none."""
    ranked = sorted(errors, key=lambda one: math.inf if one[1] is None else one[1])
    return ', '.join(f'{name} {"none" if m is None else small(m)}' for name, m in ranked)


def _panels(runs: list[FlownRun]) -> dict[str, list[Panel]]:
    flown = [(i, run) for i, run in enumerate(runs) if run.traces.ticks]

    def curves(name: str) -> tuple[Curve, ...]:
        return tuple(
            Curve(name, run.label, f'run{i % _COLOURS}', dashed=i >= _COLOURS, run=i)
            for i, run in flown
            if run.traces.has(name)
        )

    if not flown:
        return {}
    panels = [flown_panel(one, text, curves(FLOWN[one][2])) for one, text in _OVERLAID.items()]
    tracks = Panel('track', 'Tracks', 'From above, to scale.', kind='track')
    panels += [one.panel('', curves(one.position)) for one in (*ACTUATORS, SURFACE)]
    return {
        'Where they went': [tracks, SPACE],
        'How they flew': [panel for panel in panels if panel.curves],
    }


def compare_page(runs: list[FlownRun]) -> str:
    """Text of the page that lays runs over each other."""
    cards = [run.card for run in runs]
    return make_page(
        'compare.html',
        runs,
        _panels(runs),
        title=f'{len(runs)} runs compared',
        headline=_headline(runs),
        keys=[(run.label, i % _COLOURS, i >= _COLOURS) for i, run in enumerate(runs)],
        scores=score_rows(cards),
        how_to_read=HOW_TO_READ.format(mark='✓'),
        notes=caveats(cards),
        differences=difference_rows(differences(runs)),
    )
