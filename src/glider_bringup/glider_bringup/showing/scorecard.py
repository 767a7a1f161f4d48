# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""The scorecard of a run, as a person reads it."""

from collections import Counter
from collections.abc import Callable, Iterable, Iterator
from itertools import groupby
from operator import attrgetter
from pathlib import Path

from rich.console import Console
from rich.table import Table

from glider_bringup.console import messages, output
from glider_bringup.scoring.card import STATUSES, STOPPED
from glider_bringup.scoring.outcome import LOST, SURFACED
from glider_bringup.scoring.scores import EVENTS_KEPT, SCORES, Score, reckoned, scores_in
from glider_bringup.showing.words import span, way
from glider_mission.changes import fields_text
from glider_mission.chart import place_text
from glider_model.ocean.current_settings import KNOT_MPS


def show(value: float | None, unit: str, digits: int = 2) -> str:
    """Number with its unit; a dash if there is none."""
    return '-' if value is None else f'{value:,.{digits}f} {unit}'.rstrip()


def _navigation_rows(card: dict) -> list[tuple[str, str]]:
    """Lines of how well a vehicle that reckons its place knew it."""
    part = reckoned(card)
    if part is None:
        return []
    error, dac = part['error_m'], part['dac_error_mps']
    off, estimated = part['surfacing_cross_track_m'], part['believed_cross_track_m']
    within, surfacings = part['ellipse_95_share'], part['surfacings']
    rms, worst = (None if dac[name] is None else dac[name] / KNOT_MPS for name in ('rms', 'worst'))
    times = f'{surfacings} surfacing' + 's' * (surfacings != 1)
    inside = '-' if within is None else f'{round(within * surfacings)} of {surfacings} true places'
    return [
        ('navigation', f'{part["method"]}, {times}, {part["fixed"]} with a fix'),
        ('surfacing position error', f'off by {show(error["p50"], "m", 1)} (p50), '
         f'{show(error["p95"], "m", 1)} (p95), {show(error["worst"], "m", 1)} (worst)'),
        ('cross-track, surfacing', f'max {show(max(map(abs, off), default=None), "m", 1)}, last '
         f'{show(abs(off[-1]) if off else None, "m", 1)}'),
        ('cross-track, estimated', f'steady: rms {show(estimated["rms_steady"], "m", 3)}, max '
         f'{show(estimated["max_steady"], "m", 3)}'),
        ('depth-averaged current', f'off by rms {show(rms, "kn", 3)}, worst '
         f'{show(worst, "kn", 3)}'),
        ('inside the 95 % ellipse', inside),
    ]  # fmt: skip


def status_text(card: dict) -> str:
    """What became of a run, and why."""
    return card['status'] + (f' ({card["reason"]})' if card['reason'] else '')


def card_rows(card: dict) -> list[tuple[str, str]]:
    """Name and text of every line of a scorecard."""
    rows = [
        ('status', status_text(card)),
        ('flown', flown_text(card)),
        ('engine', engine_text(card)),
    ]
    for group, scores in groupby(SCORES, key=attrgetter('group')):
        say = _IN_WORDS.get(group)
        rows += say(card) if say else _score_rows(card, scores)
    return rows


def _score_rows(card: dict, scores: Iterable[Score]) -> Iterator[tuple[str, str]]:
    """Lines of scores; those of which only the end of the label differs stand in one."""
    for name, some in groupby(scores, key=attrgetter('line')):
        text = ', '.join(f'{one.part} {_text(card, one)}'.lstrip() for one in some)
        if name == 'cross-track, after settling':
            settle_s = card.get('settle_s')
            first = '' if settle_s is None else f', the first {settle_s:,.0f} s'
            name, text = 'cross-track, all', f'{text} (after settling{first})'
        yield name, text


def _text(card: dict, score: Score) -> str:
    return show(score.in_card(card), score.unit, score.digits)


def flown_text(card: dict) -> str:
    """What flew, and by what laws."""
    return f'{card["vehicle"]}, {card["controller"]}, {card["guidance"]}'


def engine_text(card: dict) -> str:
    """How a run was computed."""
    return f'{card["engine"] or "not known"}, seed {card["seed"]}'


def _end_rows(card: dict) -> list[tuple[str, str]]:
    """Lines of what broke, what the guard reported, and where it came up if it flew to its end."""
    rows = [('fault', text) for text in fault_texts(card)]
    rows += [('guard', text) for text in event_texts(card, 'guard')]
    rows += [('guidance', text) for text in event_texts(card, 'no_progress')]
    texts = {'arrival': arrival_text(card), 'bottom': bottom_text(card)}
    return [*rows, *((name, text) for name, text in texts.items() if text)]


def bottom_text(card: dict) -> str:
    """Whether it touched the bottom, or how near it came; empty where there is none."""
    part = card.get('bottom')
    if not part:
        return ''
    if part['touched']:
        return f'touched at {show(part["t_s"], "s", 1)}'
    return f'cleared by {show(part["least_height_m"], "m", 1)} or more'


def arrival_text(card: dict) -> str:
    """Whether and when it came to the end of its path; empty where that is not its end."""
    part = card.get('arrival')
    if not part:
        return ''
    place = part['place_latlon_deg']
    where = f', at {place_text(*place)}' if place else ''
    if part['t_s'] is not None:
        missed = show(part['missed_m'], 'm', 1)
        text = f'came up {missed} from its last point after {span(part["t_s"])}{where}'
        return text + ('' if part['arrived'] else ', too far off to have arrived')
    text = f'did not arrive in {span(card["sim_time_s"])}: {way(part["left_m"])} left{where}'
    if part['eta_s'] is None or card['status'] in (SURFACED, LOST):  # it goes no further
        return text
    return text + f'; at its pace {span(part["eta_s"] - card["sim_time_s"])} more'


def _energy_rows(card: dict) -> list[tuple[str, str]]:
    """Lines of what was taken out of the battery."""
    part = card.get('energy') or {'wh': None}
    if not part['wh']:
        return []
    by = ', '.join(f'{name} {show(part["by"][name], "", 1)}' for name in part['by'])
    a_dive = f'; {show(part["wh_per_dive"], "Wh", 1)} a dive' if part['wh_per_dive'] else ''
    rows = [('energy', f'{show(part["wh"], "Wh", 1)}: {by}{a_dive}')]
    if part['endurance_days'] is not None:  # else the mission ended: nothing goes on so
        lasts, far = show(part['endurance_days'], 'days', 1), show(part['range_km'], 'km', 0)
        rows.append(('battery lasts', f'{lasts}, {far} at this pace'))
    return rows


def _travel_rows(card: dict) -> list[tuple[str, str]]:
    """Line of the ways of the actuators."""
    ways = [one for one in scores_in([card]) if one.group == 'actuator_travel']
    texts = [f'{one.label.removesuffix(" travel")} {_text(card, one)}' for one in ways]
    return [('actuator travel', ', '.join(texts))]


#: Parts of a card that are shown in words of their own, where the first of their scores stands.
_IN_WORDS: dict[str, Callable[[dict], list[tuple[str, str]]]] = {
    'messages_recorded': lambda card: [
        ('messages', f'{card["messages_recorded"]:,} recorded, {card["messages_lost"]:,} lost')
    ],
    'messages_lost': lambda card: [],
    'end_of_path_m': _end_rows,
    'navigation': _navigation_rows,
    'actuator_travel': _travel_rows,
    'energy': _energy_rows,
}


def fault_texts(card: dict) -> list[str]:
    """What broke, in words: what it was, and when."""
    return [
        f'{one["message"]}, {one["when"]}: did not begin'
        if one['t_s'] is None
        else f'at {one["t_s"]:,.1f} s: {one["message"]}'
        + (f', until {one["end_s"]:,.1f} s' if one['end_s'] is not None else '')
        for one in card.get('faults', [])
    ]


def event_texts(card: dict, part: str) -> list[str]:
    """Reports of the guard, or of no progress: each once, its first time, how often."""
    first, count = {}, Counter()
    for event in card.get(part, {}).get('events', []):
        reaction, text = event.get('reaction'), event['message']
        if reaction not in (None, 'none', 'note'):
            text = f'{reaction}: {text}'
        first.setdefault(text, event['t_s'])
        count[text] += 1
    times = {1: '', EVENTS_KEPT: f' ({EVENTS_KEPT} times or more)'}
    return [
        f'at {t_s:,.1f} s: {text}' + times.get(count[text], f' ({count[text]} times)')
        for text, t_s in first.items()
    ]


def title_of(scenario: str, changed: dict[str, str]) -> str:
    """Name of what was flown, and what was changed in it."""
    return f'{scenario} with {fields_text(changed)}' if changed else scenario


def print_card(card: dict, folder: Path, report: Path | None = None) -> None:
    """Print the scorecard for a person, and where the run and its report are."""
    title = title_of(card['scenario'], card.get('changed', {}))
    table = Table(title=title, show_header=False, title_justify='left')
    for name, text in card_rows(card):
        table.add_row(name, text, style=STATUSES[card['status']] if name == 'status' else None)
    output.print(table)
    print_places(output, folder, report)


def print_status(card: dict, console: Console = output) -> None:
    """Print what became of a run."""
    text = f'status: {status_text(card)}'
    console.print(text, style=STATUSES[card['status']], soft_wrap=True)


def tell_stopped(card: dict) -> None:
    """Say beside what was made of a run that it is not whole, if it is not, and why."""
    if card['status'] in STOPPED:
        print_status(card, messages)


def print_places(console: Console, folder: Path, report: Path | None) -> None:
    """Print where a run is, and its report if it has one."""
    console.print(f'run folder: {folder}', soft_wrap=True)
    if report and report.is_file():
        console.print(f'report: {report}', soft_wrap=True)
