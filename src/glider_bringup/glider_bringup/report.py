# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""The report of a run: one web page that says what happened, to someone who was not there."""

import math
from html import escape
from typing import Any, NamedTuple

import numpy as np

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
from glider_bringup.score import STEADY_DEPTH_M
from glider_bringup.scorecard import card_rows, guard_texts
from glider_bringup.traces import Traces
from glider_model.files import yaml_text
from glider_model.signals import TICK_S

#: A track is lost if the vehicle is farther off its path than this until the end (m).
LOST_M = 100.0

_BADGES = {
    'completed': '✓ Completed',
    'infeasible': '! Infeasible',
    'aborted': '✕ Aborted',
    'failed': '✕ Failed',
}


class Actuator(NamedTuple):
    """How pages show an actuator."""

    joint: str
    unit: str
    title: str
    caption: str

    @property
    def position(self) -> str:
        """Name of the curve of where it is."""
        return f'{self.joint}_{self.unit}'

    @property
    def command(self) -> str:
        """Name of the curve of where it shall go."""
        return f'{self.joint}_ref_{self.unit}'

    @property
    def flag(self) -> str:
        """Name of the curve that says when it is commanded to its limit."""
        return f'{self.joint}_at_limit'


ACTUATORS = (
    Actuator('buoyancy_engine', 'kg', 'Buoyancy engine', 'Net heaviness, + sinks'),
    Actuator('pitch_mass', 'mm', 'Pitch mass', 'Position from neutral, + forward: nose down'),
    Actuator('roll_mass', 'deg', 'Roll mass', 'Rotation, + to starboard; 0 hangs straight down'),
)
#: Groups of what the adaptive law has learnt: panel, title, caption, axis, curves.
_LEARNT = (
    (
        'learnt_pitch',
        'Pitch moment',
        'Parameters of the pitch moment that the file of the vehicle does not have.',
        'N m',
        ('pitch_bias_nm', 'pitch_alpha_nm', 'pitch_speed_nm', 'pitch_damping_nm'),
    ),
    (
        'learnt_roll',
        'Roll moment',
        'Parameters of the roll moment that the file of the vehicle does not have.',
        'N m',
        ('roll_bias_nm', 'roll_side_force_nm', 'roll_damping_nm'),
    ),
    (
        'learnt_steering',
        'Steering',
        'Turn rate over sine of roll at 0.5 m/s, + to starboard: it differs in dive and climb.',
        'rad/s',
        ('steering_dive_radps', 'steering_climb_radps'),
    ),
    (
        'learnt_disturbance',
        'Turn-rate disturbance',
        'Turn rate that is there without roll.',
        'rad/s',
        ('disturbance_dive_radps', 'disturbance_climb_radps'),
    ),
    (
        'learnt_lyapunov',
        'Lyapunov functions',
        'V1 of the angles, V2 of angles and rates, without the part of the unknown parameter '
        'errors. They fall where errors die out, and jump where a turn begins.',
        'V1, V2 (-)',
        ('lyapunov_1', 'lyapunov_2'),
    ),
)
_ROLES = ('measured', 'reference', 'third', 'fourth')


def span(seconds: float) -> str:
    """Time as a person says it."""
    minutes = round(seconds / 60.0)
    if seconds < 120.0:
        return f'{seconds:.4g} s'
    if minutes < 120:
        return f'{minutes} min'
    hours, minutes = divmod(minutes, 60)
    return f'{hours} h {minutes} min' if minutes else f'{hours} h'


def way(metres: float) -> str:
    """Distance as a person says it."""
    return f'{metres / 1e3:,.1f} km' if metres >= 2000.0 else f'{metres:,.0f} m'


def small(metres: float) -> str:
    """Error as a person says it."""
    return f'{metres:.2f} m' if metres < 10.0 else way(metres)


def _count(number: int, what: str) -> str:
    """Number of things, in words that agree."""
    return f'{number:,} {what}' if number == 1 else f'{number:,} {what}s'


def verdict(card: dict[str, Any], settle_s: float) -> str:
    """What happened, in a sentence or two."""
    if not card['ticks']:
        return f'It ended before the first tick: {card["reason"] or "no reason is known"}.'
    time, along = span(card['sim_time_s']), way(card['distance_along_path_m'])
    depth = f'{card["depth_m"]["max"]:,.0f} m'
    dives = card['dives']
    flown = f'{_count(dives, "dive")} to {depth}' if dives else f'Down to {depth}'
    text = f'{flown}, {along} along the path in {time}.'
    if card['status'] in ('aborted', 'failed'):
        text = f'Stopped after {time}: {card["reason"]}. Until then: {flown[0].lower()}{flown[1:]}'
        text += f', {along} along the path.'
    if card['status'] == 'infeasible':
        text += ' The current was too strong to hold the course for half of the time or more.'
    track = card['cross_track_m']
    if track['max_steady'] is not None:
        text += (
            f' In steady glide it stayed within {small(track["max_steady"])} of the path '
            f'(rms {small(track["rms_steady"])}).'
        )
    elif track['max_all'] is not None:
        text += f' After settling it was at most {small(track["max_all"])} off the path.'
    else:
        text += f' It ended within the settling time of {span(settle_s)}, so errors have no score.'
    if track.get('max_run') is not None:
        text += f' In the whole run, settling and turns included: {small(track["max_run"])}.'
    if card.get('end_of_path_m') is not None:
        text += f' It came up {small(card["end_of_path_m"])} from the end of the path.'
    return text


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


def findings(run: FlownRun) -> list[tuple[str, str]]:
    """What went wrong, and what is worth a look: kind (problem, note, fine) and sentence."""
    card, traces = run.card, run.traces

    def at(time_s: float | None) -> str:
        return span(time_s) if time_s else 'the start'

    def share(ticks: int) -> str:
        return f'{span(ticks * TICK_S)} ({100.0 * ticks / traces.ticks:.2g} % of the time)'

    problems, notes = [], []
    if card['status'] in ('aborted', 'failed'):
        ended = 'was aborted' if card['status'] == 'aborted' else 'failed'
        problems.append(f'The run {ended} at {at(card["sim_time_s"])}: {card["reason"]}.')
    problems += [f'Control noticed {text}.' for text in guard_texts(card)]
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
    if ticks:
        text = f'The course could not be held against the estimated current for {share(ticks)}, '
        text += f'first at {at(traces.first_s("infeasible"))}.'
        (problems if card['status'] == 'infeasible' else notes).append(text)
    for actuator, limit in zip(ACTUATORS, limits_of(run), strict=True):
        ticks = traces.flagged[actuator.flag]
        if ticks:
            notes.append(
                f'{actuator.title} commanded to its limit of {limit:g} {actuator.unit} for '
                f'{share(ticks)}, first at {at(traces.first_s(actuator.flag))}.'
            )
    if not problems:
        messages = ', and no message was lost' if card['messages_recorded'] else ''
        fine = f'Nothing went wrong: the run is complete, the course could be held{messages}.'
        return [('fine', fine), *(('note', text) for text in notes)]
    return [*(('problem', text) for text in problems), *(('note', text) for text in notes)]


def limits_of(run: FlownRun) -> tuple[float, float, float]:
    """Limits of the actuators, in the units of `ACTUATORS`."""
    vehicle = run.vehicle.params()
    return vehicle.m_b_max, 1e3 * vehicle.x_p_max, math.degrees(vehicle.mu_max)


def _tiles(run: FlownRun) -> str:
    """The figures that a person asks for first."""

    def number(value: float | None, digits: int, unit: str) -> str:
        return '-' if value is None else f'{value:,.{digits}f}\N{NO-BREAK SPACE}{unit}'

    card, depth_m = run.card, run.scenario.profile.depth_m
    track, pitch = card['cross_track_m'], card['pitch_error_deg']
    heading, depth = card['heading_fluctuation_deg'], card['depth_m']
    dives = run.scenario.profile.mode == 'profile'
    tiles = (
        ('simulated time', span(card['sim_time_s']), f'{card["ticks"]:,} ticks of 0.1 s'),
        ('along the path', way(card['distance_along_path_m']), _count(card['dives'], 'dive')),
        (
            'cross-track, steady',
            number(track['max_steady'], 2, 'm'),
            f'largest; rms {number(track["rms_steady"], 3, "m")}; '
            f'whole run {number(track.get("max_run"), 2, "m")}',
        ),
        (
            'deepest point',
            number(depth['max'], 1, 'm'),
            f'{number(depth["overshoot"], 1, "m")} beyond {number(depth_m, 0, "m")}'
            if dives
            else '',
        ),
        (
            'pitch error, steady',
            number(pitch['rms_steady'], 2, 'deg'),
            f'rms; largest {number(pitch["max_steady"], 2, "deg")}',
        ),
        (
            'heading, steady',
            number(heading['rms_steady'], 3, 'deg'),
            f'fluctuation, rms; largest {number(heading["max_steady"], 3, "deg")}',
        ),
    )
    html = ''.join(
        f'<div class="tile"><dt>{escape(name)}</dt><dd>{escape(value)}'
        f'<small>{escape(more)}</small></dd></div>'
        for name, value, more in tiles
    )
    return f'<dl class="tiles">{html}</dl>'


def _maps() -> list[Panel]:
    """Plan view and three-dimensional view."""
    return [
        Panel(
            'track',
            'Track',
            'From above, to scale. Arrows: where the current flows to. What is zoomed into below '
            'is drawn bold.',
            kind='track',
        ),
        Panel(
            'space',
            'In three dimensions',
            'Drag to turn. Depth is stretched.',
            kind='space',
        ),
    ]


def _flight_panels(run: FlownRun) -> list[Panel]:
    """How it flew: depth, errors, attitude."""
    traces = run.traces
    noisy = traces.has('measured_depth_m')

    def curves(name: str, *others: Curve) -> tuple[Curve, ...]:
        label = 'true' if noisy else 'flown'
        measured = (Curve(f'measured_{name}', 'measured, with noise', 'faint'),) if noisy else ()
        return (*measured, Curve(name, label, 'measured'), *others)

    follows_path = run.scenario.profile.mode == 'path'
    target = 'virtual target' if follows_path else 'turn flown to'
    below = Curve('vertical_error_m', 'normal to the path, + below it', 'third')
    lost = Curve('cross_track_m', 'course cannot be held', 'alert', flag='infeasible')
    return [
        Panel(
            'depth',
            'Depth',
            'How deep it was, and the depth it was flying to.',
            'depth (m)',
            curves('depth_m', Curve('depth_ref_m', target, 'reference', dashed=True)),
            inverted=True,
        ),
        Panel(
            'cross_track',
            'Cross-track error',
            'Distance from the path, + to starboard of it. A vehicle can hardly steer while it '
            'turns over between dive and climb: at the inflections.',
            'off the path (m)',
            curves('cross_track_m', *((below,) if follows_path else ()), lost),
            inflections=0,
        ),
        Panel(
            'pitch',
            'Pitch',
            'Nose up is positive: a dive has about minus, a climb plus the glide pitch.',
            'pitch (deg)',
            curves('pitch_deg', Curve('pitch_ref_deg', 'desired', 'reference', dashed=True)),
        ),
        Panel(
            'heading',
            'Heading',
            'Clockwise from north, counted on through 180 deg. It differs from the course of the '
            'path by the crab angle against the current.',
            'heading (deg)',
            curves('heading_deg', Curve('heading_ref_deg', 'desired', 'reference', dashed=True)),
        ),
        Panel(
            'roll',
            'Roll',
            'Starboard side down is positive. Control banks to turn; the roll it asks for is its '
            'own, so there is no reference.',
            'roll (deg)',
            curves('roll_deg'),
        ),
    ]


def _actuator_panels(run: FlownRun) -> list[Panel]:
    """What the actuators did."""
    panels = []
    for one, limit in zip(ACTUATORS, limits_of(run), strict=True):
        used = run.traces.largest(one.position) / limit
        panels.append(
            Panel(
                one.joint,
                one.title,
                f'{one.caption}. Its limits of ±{limit:g} {one.unit} are drawn where it comes '
                f'near them; the largest use of its range was {100.0 * used:.0f} %.',
                f'{one.title.lower()} ({one.unit})',
                (
                    Curve(one.position, 'position', 'measured'),
                    Curve(one.command, 'commanded', 'reference', dashed=True),
                    Curve(one.command, 'at its limit', 'alert', flag=one.flag),
                ),
                limits=(-limit, limit),
            )
        )
    return panels


def _current_panels(run: FlownRun) -> list[Panel]:
    """The current, and what guidance believed it to be."""
    return [
        Panel(
            f'current_{axis}',
            f'Current, {axis}',
            f'Velocity of the water to the {axis}, and what guidance estimates from its drift.',
            'current (kn)',
            (
                Curve(f'current_{axis}_kn', 'true', 'measured'),
                Curve(f'estimate_{axis}_kn', 'estimated', 'reference', dashed=True),
            ),
        )
        for axis in ('north', 'east')
    ]


def _learnt_panels(run: FlownRun) -> list[Panel]:
    """What the adaptive law has learnt; nothing of what stayed zero."""
    panels = []
    for panel, title, caption, axis, names in _LEARNT:
        names = [name for name in names if run.traces.largest(name) > 0.0]
        curves = tuple(
            Curve(name, _label(name), role) for name, role in zip(names, _ROLES, strict=False)
        )
        if curves:
            log = panel == 'learnt_lyapunov'
            panels.append(Panel(panel, title, caption, axis, curves, log=log))
    return panels


def _label(name: str) -> str:
    """Name of something learnt, without its unit."""
    for unit in ('_nm', '_radps'):
        name = name.removesuffix(unit)
    return name.replace('_', ' ')


def _what_was_set(run: FlownRun) -> str:
    """Fields of the scenario that are not as they would be by default, as YAML."""
    told = {'name', 'vehicle', 'description'}
    values = run.scenario.model_dump(mode='json', exclude_defaults=True, exclude=told)
    named = {'name': run.scenario.name, 'vehicle': run.card['vehicle']}
    return yaml_text({**named, **values})


def _is_there(curve: Curve, run: FlownRun) -> bool:
    """Whether there is anything to draw of a curve."""
    return run.traces.has(curve.name) and not (curve.flag and not run.traces.flagged[curve.flag])


def report_page(run: FlownRun) -> str:
    """Text of the report of a run."""
    card, scenario = run.card, run.scenario
    sections = {}
    if run.traces.ticks:
        sections = {
            'Where it went': _maps(),
            'How it flew': _flight_panels(run),
            'What the actuators did': _actuator_panels(run),
            'The current': _current_panels(run),
            'What control learnt': _learnt_panels(run),
        }
    panels = [
        panel._replace(curves=tuple(curve for curve in panel.curves if _is_there(curve, run)))
        for panels in sections.values()
        for panel in panels
    ]
    shown = {panel.id for panel in panels if panel.curves or panel.kind != 'time'}
    found = ''.join(f'<li class="{kind}">{escape(text)}</li>' for kind, text in findings(run))
    rules = run.rules
    body = (
        f'<h1><b>{escape(scenario.name)}</b> {escape(scenario.description)}</h1>'
        f'<p class="verdict"><span class="badge {card["status"]}">{_BADGES[card["status"]]}</span>'
        f'{escape(verdict(card, rules.settle_s))}</p>'
        f'{_tiles(run)}<ul class="findings">{found}</ul>'
        + (ZOOM_BAR if shown else '')
        + ''.join(
            section(title, [panel for panel in group if panel.id in shown])
            for title, group in sections.items()
        )
        + f'<h2>Scorecard</h2>{table(card_rows(card))}'
        f'<p class="page-note">Steady: after the settling time of {span(rules.settle_s)}, more '
        f'than {span(rules.margin_s)} from every inflection, deeper than '
        f'{rules.steady_depth_m:.3g} m. Curves show the '
        'smallest and the largest value of every '
        f'{2.0 * run.traces.spacing_s:g} s: no peak is lost.</p>'
        f'<h2>What was flown</h2><pre>{escape(_what_was_set(run))}</pre>'
        '<details><summary>The scenario, complete</summary>'
        f'<pre>{escape(run.as_flown)}</pre></details>'
        '<p class="page-note"><code>./glider run scenario.yaml</code> flies it again, with the '
        'scenario.yaml and vehicle.yaml of its folder; its bag holds them too.</p>'
    )
    data = page_data([run], [panel for panel in panels if panel.id in shown])
    return make_page(f'{scenario.name}: {card["status"]}', body, data)
