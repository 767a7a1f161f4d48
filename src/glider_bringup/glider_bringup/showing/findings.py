# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""What happened in a run, in words: the verdict, and what went wrong."""

import math
from typing import Any

import numpy as np

from glider_base.signals import TICK_S
from glider_bringup.scoring.card import STOPPED
from glider_bringup.scoring.scores import reckoned
from glider_bringup.scoring.traces import Traces
from glider_bringup.showing.panels import actuators_of
from glider_bringup.showing.scorecard import arrival_text, event_texts, fault_texts
from glider_bringup.showing.web_page import FlownRun
from glider_bringup.showing.words import count, small, span, way
from glider_mission.rules import STEADY_DEPTH_M
from glider_model.ocean.current_settings import KNOT_MPS

#: Farther off than this (m) something went wrong, and a track that is until the end is lost.
LOST_M = 100.0
#: No vehicle rolls farther than this in flight (deg).
ROLLED_DEG = 60.0
#: A current is learnt from the surfacing on after which the vehicle comes up no farther off its
#: path than this share of the first time.
LEARNT_SHARE = 0.1
#: With fewer surfacings inside their 95 % ellipses than by chance in one of a thousand runs, what
#: is estimated is too sure.
UNLIKELY = 1e-3


def verdict(card: dict[str, Any], settle_s: float) -> str:
    """What happened, in some sentences: how it ended, how bad it was, what was flown."""
    if not card['ticks']:
        return f'It ended before the first tick: {card["reason"] or "no reason is known"}.'
    texts = [_ended(card), _worst(card), _flown(card), _steady(card, settle_s)]
    if arrival := arrival_text(card):
        texts.append(f'It {arrival}.')
    return ' '.join(filter(None, texts))


def _ended(card: dict[str, Any]) -> str:
    """How a run ended that is not complete; empty of one that is."""
    status = card['status']
    if status in STOPPED:
        return f'Stopped after {span(card["sim_time_s"])}: {card["reason"]}.'
    ended = '' if status == 'completed' else f'{status.capitalize()}: '
    if status == 'infeasible':
        ended = 'The estimated current was too strong to hold the course for half of the time or '
        ended += 'more. ' if card['reason'] else 'more.'
    reason = card['reason']
    if not reason:
        return ended
    return f'{ended}{reason}.' if ended else f'{reason[0].upper()}{reason[1:]}.'


def _worst(card: dict[str, Any]) -> str:
    """Largest errors of the whole run, settling and turns included."""
    off, texts = card['cross_track_m'].get('max_run'), []
    if off is not None:
        texts.append(f'it was {small(off)} off its path')
    place = ((reckoned(card) or {}).get('error_m') or {}).get('worst')
    if place is not None:
        texts.append(f'came up {small(place)} from its estimated position')
    return f'At worst {" and ".join(texts)}.' if texts else ''


def _flown(card: dict[str, Any]) -> str:
    time, along = span(card['sim_time_s']), way(card['distance_along_path_m'])
    depth, dives = f'{card["depth_m"]["max"]:,.0f} m', card['dives']
    by = ', at last down to' if card['status'] == 'lost' else ' to'
    flown = f'{count(dives, "dive")}{by} {depth}' if dives else f'Down to {depth}'
    return f'{flown}, {along} along the path in {time}.'


def _steady(card: dict[str, Any], settle_s: float) -> str:
    """Errors where nothing disturbs: in steady glide, or at least after settling."""
    track = card['cross_track_m']
    if track['max_steady'] is not None:
        within, rms = small(track['max_steady']), small(track['rms_steady'])
        return f'In steady glide it stayed within {within} of the path (rms {rms}).'
    if track['max_all'] is not None:
        return f'After settling it was at most {small(track["max_all"])} off the path.'
    at = f'within the settling time of {span(settle_s)}' if settle_s else 'at its first tick'
    return f'It ended {at}, so errors have no score.'


def lost_since_s(traces: Traces) -> float | None:
    """Since when the vehicle was off its path by more than `LOST_M` till the end (s), or None.

    Near the surface, where a vehicle drifts with the current, does not count.
    """
    curves = traces.curves
    with np.errstate(invalid='ignore'):
        deep = np.flatnonzero(curves['depth_m'] > STEADY_DEPTH_M)
        off = np.fmax(np.abs(curves['cross_track_m']), np.abs(curves['vertical_error_m']))[deep]
        near = np.flatnonzero(off <= LOST_M)
    first = near[-1] + 1 if len(near) else 0
    return float(deep[first]) * traces.spacing_s if first < len(deep) else None


def navigation_notes(part: dict[str, Any], learns: bool) -> list[str]:
    """How well a vehicle knew where it was that reckons its place, in sentences.

    By part ``navigation`` of a scorecard; it ``learns`` where it estimates a current.
    """
    off = [abs(value) for value in part['surfacing_cross_track_m']]
    if not off:
        return ['It came up from no dive, so its estimated position was never put to the proof.']
    notes = [_came_up(off, learns)]
    error = part['error_m']
    worst = small(error['worst'])
    if len(off) == 1:
        notes.append(f'It came up {worst} off its estimated position.')
    elif len(off) == 2:  # p50 is their mean
        other = small(abs(2.0 * error['p50'] - error['worst']))
        notes.append(f'It surfaced off its estimated position by {worst} and by {other}.')
    else:
        text = f'It surfaced off its estimated position by {small(error["p50"])} (median)'
        notes.append(f'{text}, by {worst} at worst.')
    if part['ellipse_95_share'] is not None:
        inside = round(part['ellipse_95_share'] * len(off))
        text = f'The 95 % ellipses hold {inside} of {len(off)} true places'
        if len(off) == 1:
            text = f'Its 95 % ellipse {"holds" if inside else "does not hold"} the true place'
        # by chance, were each in its ellipse in 95 % of all cases
        chance = sum(
            math.comb(len(off), k) * 0.95**k * 0.05 ** (len(off) - k) for k in range(inside + 1)
        )
        too_sure = ': its ellipses are too small' if chance < UNLIKELY else ''
        notes.append(f'{text}{too_sure}.')
    if part['dac_error_mps']['rms'] is not None:
        kinds = ('rms', 'worst')
        rms, worst = (f'{part["dac_error_mps"][name] / KNOT_MPS:.3f} kn' for name in kinds)
        off_by = rms if rms == worst else f'{rms} (rms), {worst} at worst'
        text = 'The depth-averaged current that it estimated after its fixes was off by'
        notes.append(f'{text} {off_by}.')
    return notes


def _came_up(off: list[float], learns: bool) -> str:
    """How far cross-track it came up, each time (m)."""
    text = f'Came up {small(off[0])} off its path'
    if len(off) == 1:
        return f'{text}.'
    if len(off) == 2:
        return f'{text} the first time, {small(off[1])} the second time.'
    rest = (i for i in range(1, len(off) - 1) if max(off[i:]) <= LEARNT_SHARE * off[0])
    since = next(rest, None)
    if since is None or not learns:
        return f'{text} the first time, later at most {small(max(off[1:]))}.'
    return (
        f'{text} the first time, from surfacing {since + 1} on at most {small(max(off[since:]))}: '
        'the current was learnt.'
    )


def _how_bad(card: dict[str, Any], traces: Traces) -> list[str]:
    """How the run ended, if not as it was to, and its largest errors if they are large."""
    problems = []
    if _ended(card) and card['status'] != 'infeasible':
        problems.append(_ended(card))
    place = ((reckoned(card) or {}).get('error_m') or {}).get('worst') or 0.0
    worst = max(card['cross_track_m'].get('max_run') or 0.0, place)
    if worst > LOST_M:
        problems.append(_worst(card))
    deeper_m = card['depth_m']['overshoot'] or 0.0
    if deeper_m > LOST_M:
        problems.append(f'It went {small(deeper_m)} deeper than it was to.')
    roll_deg = traces.largest('roll_deg')
    if roll_deg > ROLLED_DEG:
        problems.append(f'It rolled by {roll_deg:.0f} deg.')
    return problems


def findings(run: FlownRun) -> list[tuple[str, str]]:
    """What went wrong, and what is worth a look: kind (problem, note, fine) and sentence.

    What the verdict says already is not said again.
    """
    card, traces = run.card, run.traces

    def at(time_s: float | None) -> str:
        return span(time_s) if time_s else 'the start'

    def share(ticks: int) -> str:
        percent = 100.0 * ticks / traces.ticks
        text = f'{percent:.0f}' if percent >= 10.0 else f'{percent:.2g}'
        return f'{span(ticks * TICK_S)} ({text} % of the time)'

    navigation = reckoned(card)
    problems, notes = _how_bad(card, traces), []
    problems += [f'{text[0].upper()}{text[1:]}.' for text in run.unfit]
    if navigation:
        notes += navigation_notes(navigation, run.scenario.navigation.current != 'none')
    notes += [f'Broken on purpose: {text}.' for text in fault_texts(card)]
    problems += [f'The guard, {text}.' for text in event_texts(card, 'guard')]
    problems += [f'Guidance, {text}.' for text in event_texts(card, 'no_progress')]
    if (card.get('bottom') or {}).get('touched'):
        problems.append(f'It touched the bottom at {at(card["bottom"]["t_s"])}.')
    if card['messages_lost']:
        problems.append(f'{card["messages_lost"]:,} messages were lost on the way to the bag.')
    broken = {
        name: count
        for name, count in traces.missing.items()
        if count and not name.startswith('measured_')
    }
    if broken:
        counts = ', '.join(f'{name} ({count:,})' for name, count in broken.items())
        problems.append(f'Ticks without a finite value, out of {traces.ticks:,}: {counts}.')
    since_s = lost_since_s(traces)
    if since_s is not None:
        problems.append(
            f'Track lost: more than {LOST_M:.0f} m off the path from {at(since_s)} to the end.'
        )
    ticks = traces.flagged['infeasible']
    held = '' if ticks else ', the course could be held'
    if ticks:
        text = f'The course could not be held against the estimated current for {share(ticks)}, '
        text += f'first at {at(traces.first_s("infeasible"))}.'
        (problems if card['status'] == 'infeasible' else notes).append(text)
    for actuator, limit in actuators_of(run):
        ticks = traces.flagged[actuator.flag]
        if ticks:
            notes.append(
                f'{actuator.title} commanded to its limit of {limit:g} {actuator.unit} for '
                f'{share(ticks)}, first at {at(traces.first_s(actuator.flag))}.'
            )
    if not problems:
        messages = ', and no message was lost' if card['messages_recorded'] else ''
        fine = f'Nothing went wrong: the run is complete{held}{messages}.'
        return [('fine', fine), *(('note', text) for text in notes)]
    said = verdict(card, run.rules.settle_s)
    listed = [*(('problem', text) for text in problems), *(('note', text) for text in notes)]
    return [(kind, text) for kind, text in listed if text not in said]
