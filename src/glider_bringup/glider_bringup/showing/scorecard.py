# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""The scorecard of a run, as a person reads it."""

from collections import Counter
from pathlib import Path

from rich.console import Console
from rich.table import Table

from glider_bringup.console import output
from glider_bringup.mission.scenario import told_fields
from glider_bringup.scoring.card import CARD_GROUPS
from glider_model.ocean.current_settings import KNOT_MPS

#: Colours of what became of a run.
STYLES = {
    'completed': 'green',
    'infeasible': 'yellow',
    'surfaced': 'yellow',
    'lost': 'bold red',
    'aborted': 'red',
    'failed': 'red',
}


def show(value: float | None, unit: str, digits: int = 2) -> str:
    """Number with its unit; a dash if there is none."""
    return '-' if value is None else f'{value:,.{digits}f} {unit}'.rstrip()


def reckoned(card: dict) -> dict | None:
    """What a card tells of navigation, where the vehicle had to reckon its place; else None."""
    told = card.get('navigation') or {'method': 'known'}
    return None if told['method'] == 'known' else told


def _navigation_rows(told: dict) -> list[tuple[str, str]]:
    """Lines of how well a vehicle that reckons its place knew it."""
    error, dac = told['error_m'], told['dac_error_mps']
    off, believed = told['surfacing_cross_track_m'], told['believed_cross_track_m']
    within, surfacings = told['ellipse_95_share'], told['surfacings']
    rms, worst = (None if dac[name] is None else dac[name] / KNOT_MPS for name in ('rms', 'worst'))
    inside = '-' if within is None else f'{round(within * surfacings)} of {surfacings} true places'
    return [
        ('navigation', f'{told["method"]}, {surfacings} surfacings, {told["fixed"]} with a fix'),
        ('believed place, surfacing', f'off by {show(error["p50"], "m", 1)} (p50), '
         f'{show(error["p95"], "m", 1)} (p95), {show(error["worst"], "m", 1)} (worst)'),
        ('cross-track, surfacing', f'max {show(max(map(abs, off), default=None), "m", 1)}, last '
         f'{show(abs(off[-1]) if off else None, "m", 1)}'),
        ('cross-track, believed', f'steady: rms {show(believed["rms_steady"], "m", 3)}, max '
         f'{show(believed["max_steady"], "m", 3)}'),
        ('mean current learnt (DAC)', f'off by rms {show(rms, "kn", 3)}, worst '
         f'{show(worst, "kn", 3)}'),
        ('inside the 95 % ellipse', inside),
    ]  # fmt: skip


def status_text(card: dict) -> str:
    """What became of a run, and why."""
    return card['status'] + (f' ({card["reason"]})' if card['reason'] else '')


def card_rows(card: dict) -> list[tuple[str, str]]:
    """Name and text of every line of a scorecard."""
    track, pitch = card['cross_track_m'], card['pitch_error_deg']
    heading, depth = card['heading_fluctuation_deg'], card['depth_m']
    travel, settle_s = card['actuator_travel'], card.get('settle_s')
    settling = 'after settling' + ('' if settle_s is None else f', the first {settle_s:,.0f} s')
    end_m, navigation = card.get('end_of_path_m'), reckoned(card)
    energy = card.get('energy') or {'wh': None}
    return [
        ('status', status_text(card)),
        ('flown', f'{card["vehicle"]}, {card["controller"]}, LOS {card["guidance"]}'),
        ('engine', f'{card["engine"] or "not known"}, seed {card["seed"]}'),
        ('simulated time', show(card['sim_time_s'], 's', 1)),
        ('real-time factor', show(card['real_time_factor'], '', 0)),
        (
            'messages',
            f'{card["messages_recorded"]:,} recorded, {card["messages_lost"]} lost',
        ),
        ('dives', str(card['dives'])),
        ('along path', show(card['distance_along_path_m'], 'm', 0)),
        *(('fault', text) for text in fault_texts(card)),
        *(('guard', text) for text in guard_texts(card)),
        *([('end of path', f'came up {show(end_m, "m", 1)} from its last point')]
          if end_m is not None else []),
        ('cross-track, steady', f'rms {show(track["rms_steady"], "m", 3)}, max '
         f'{show(track["max_steady"], "m", 3)}'),
        ('cross-track, all', f'max {show(track["max_all"], "m")} ({settling})'),
        ('cross-track, whole run', f'max {show(track.get("max_run"), "m")}'),
        *(_navigation_rows(navigation) if navigation else []),
        ('pitch error, steady', f'rms {show(pitch["rms_steady"], "deg", 3)}, max '
         f'{show(pitch["max_steady"], "deg", 3)}'),
        ('heading fluctuation', f'rms {show(heading["rms_steady"], "deg", 3)}, max '
         f'{show(heading["max_steady"], "deg", 3)}'),
        ('depth', f'max {show(depth["max"], "m", 1)}, overshoot '
         f'{show(depth["overshoot"], "m", 1)}'),
        ('actuator travel', f'pump {show(travel["buoyancy_engine_kg"], "kg", 1)}, pitch mass '
         f'{show(travel["pitch_mass_m"], "m")}, roll mass '
         f'{show(travel["roll_mass_deg"], "deg", 0)}' + _surface_travel(travel)),
        *(_energy_rows(energy) if energy['wh'] else []),
    ]  # fmt: skip


def _energy_rows(told: dict) -> list[tuple[str, str]]:
    """Lines of what was taken out of the battery."""
    by = ', '.join(f'{name} {show(told["by"][name], "", 1)}' for name in told['by'])
    a_dive = f'; {show(told["wh_per_dive"], "Wh", 1)} a dive' if told['wh_per_dive'] else ''
    rows = [('energy', f'{show(told["wh"], "Wh", 1)}: {by}{a_dive}')]
    if told['endurance_days'] is not None:  # else the mission ended: nothing goes on so
        lasts, far = show(told['endurance_days'], 'days', 1), show(told['range_km'], 'km', 0)
        rows.append(('battery lasts', f'{lasts}, {far} at this pace'))
    return rows


def _surface_travel(travel: dict) -> str:
    """Travel of a steering surface, whatever its name, in words; empty without."""
    others = sorted(set(travel) - CARD_GROUPS['actuator_travel'])
    return ''.join(
        f', {name.removesuffix("_deg")} {show(travel[name], "deg", 0)}' for name in others
    )


def fault_texts(card: dict) -> list[str]:
    """What broke, in words: what it was, and when."""
    return [
        f'{one["message"]}, {one["when"]}: did not begin'
        if one['t_s'] is None
        else f'at {one["t_s"]:,.1f} s: {one["message"]}'
        + (f', until {one["end_s"]:,.1f} s' if one['end_s'] is not None else '')
        for one in card.get('faults', [])
    ]


def guard_texts(card: dict) -> list[str]:
    """What the guard told, in words: each kind once, with its first time and how often."""
    first, count = {}, Counter()
    for event in card.get('guard', {}).get('events', []):
        reaction, text = event.get('reaction'), event['message']
        if reaction not in (None, 'none', 'note'):
            text = f'{reaction}: {text}'
        first.setdefault(text, event['t_s'])
        count[text] += 1
    return [
        f'at {t_s:,.1f} s: {text}' + (f' ({count[text]} times)' if count[text] > 1 else '')
        for text, t_s in first.items()
    ]


def print_card(card: dict, folder: Path, report: Path | None = None) -> None:
    """Print the scorecard for a person, and where the run and its report are."""
    changed = told_fields(card.get('changed', {}))
    title = f'{card["scenario"]} with {changed}' if changed else card['scenario']
    table = Table(title=title, show_header=False, title_justify='left')
    for name, text in card_rows(card):
        table.add_row(name, text, style=STYLES[card['status']] if name == 'status' else None)
    output.print(table)
    print_places(output, folder, report)


def print_status(card: dict) -> None:
    """Print what became of a run."""
    text = f'status: {status_text(card)}'
    output.print(text, style=STYLES[card['status']], soft_wrap=True)


def print_places(console: Console, folder: Path, report: Path | None) -> None:
    """Print where a run is, and its report if it has one."""
    console.print(f'run folder: {folder}', soft_wrap=True)
    if report and report.is_file():
        console.print(f'report: {report}', soft_wrap=True)
