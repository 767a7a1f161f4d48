# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""The panels of a report: which curves of a run are drawn together, and what is said of them."""

import math
from typing import NamedTuple

from glider_bringup.scoring.scores import reckoned
from glider_bringup.showing.web_page import Curve, FlownRun, Panel, Steps
from glider_model.ocean.current_settings import KNOT_MPS


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

    def panel(self, more: str, curves: tuple[Curve, ...], **look) -> Panel:
        """Panel of it, with more in its caption."""
        axis = f'{self.title.lower()} ({self.unit})'
        return Panel(self.joint, self.title, f'{self.caption}.{more}', axis, curves, **look)


ACTUATORS = (
    Actuator('buoyancy_engine', 'kg', 'Buoyancy engine', 'Net buoyancy, + sinks'),
    Actuator('pitch_mass', 'mm', 'Pitch mass', 'Position from neutral, + forward: nose down'),
    Actuator('roll_mass', 'deg', 'Roll mass', 'Rotation, + to starboard; 0 hangs straight down'),
)
SURFACE = Actuator('surface', 'deg', 'Steering surface', 'Angle, + turns the nose to starboard')
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
        'Turn rate over sine of roll at 0.5 m/s, + to starboard: it differs in dive and climb; of '
        'a vehicle with a fin over the sine of its angle.',
        'rad/s',
        ('steering_dive_radps', 'steering_climb_radps'),
    ),
    (
        'learnt_disturbance',
        'Turn-rate disturbance',
        'Turn rate that is there without roll, or with the fin straight.',
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
_BATTERY = Panel(
    'battery',
    'Battery',
    'Charge that is left, as the battery tells it.',
    'battery (%)',
    (Curve('battery_percent', 'left', 'measured'),),
)
_TRACK = Panel(
    'track',
    'Track',
    'From above, to scale. Arrows: where the current flows to. What is zoomed into below is drawn '
    'bold.',
    kind='track',
)
_PLACES = Panel(
    'places',
    'Where it surfaced, around its estimated position',
    'From above, each to its own scale, in metres east and north of the estimate before the first '
    'fix. Of many surfacings those that were farthest off.',
    kind='places',
)
_ROLES = ('measured', 'reference', 'third', 'fourth')


def actuators_of(run: FlownRun) -> list[tuple[Actuator, float]]:
    """Actuators that the vehicle can move, each with its limit in its unit."""
    vehicle, name = run.vehicle.params(), run.vehicle.steers_by
    limits = vehicle.m_b_max, 1e3 * vehicle.x_p_max, math.degrees(vehicle.mu_max)
    found = list(zip(ACTUATORS, limits, strict=True))
    if name:
        surface = SURFACE._replace(title=name.replace('_', ' ').capitalize())
        found.append((surface, math.degrees(vehicle.delta_max)))
    return [(one, limit) for one, limit in found if limit > 0.0]


#: Panels of one run and of several: title, axis, and the curve in which runs are compared.
FLOWN = {
    'depth': ('Depth', 'depth (m)', 'depth_m'),
    'cross_track': ('Cross-track error', 'off the path (m)', 'cross_track_m'),
    'place_error': ('Navigation error', 'error (m)', 'place_error_m'),
    'pitch': ('Pitch', 'pitch (deg)', 'pitch_deg'),
    'heading': ('Heading', 'heading (deg)', 'heading_deg'),
    'roll': ('Roll', 'roll (deg)', 'roll_deg'),
}
SPACE = Panel('space', 'In three dimensions', 'Drag to turn. Depth is stretched.', kind='space')


def flown_panel(name: str, caption: str, curves: tuple[Curve, ...], **look) -> Panel:
    """Panel of `FLOWN`."""
    title, axis, _ = FLOWN[name]
    return Panel(name, title, caption, axis, curves, inverted=name == 'depth', **look)


def _desired(name: str, label: str = 'desired') -> Curve:
    """Curve of what was asked for, or estimated."""
    return Curve(name, label, 'reference', dashed=True)


def _flight_panels(run: FlownRun) -> list[Panel]:
    noisy = run.traces.has('measured_depth_m')
    source = 'estimated' if reckoned(run.card) else 'measured, with noise'

    def curves(name: str, *others: Curve) -> tuple[Curve, ...]:
        measured = (Curve(f'measured_{name}', source, 'faint'),) if noisy else ()
        return (*measured, Curve(name, 'true' if noisy else 'flown', 'measured'), *others)

    follows_path = run.scenario.profile.mode == 'path'
    target = 'virtual target' if follows_path else 'turn flown to'
    below = Curve('vertical_error_m', 'normal to the path, + below it', 'third')
    lost = Curve('cross_track_m', 'course cannot be held', 'alert', flag='infeasible')
    return [
        flown_panel(
            'depth',
            'How deep it was, and the depth it was flying to.',
            curves('depth_m', _desired('depth_ref_m', target)),
        ),
        flown_panel(
            'cross_track',
            'Distance from the path, + to starboard of it. A vehicle can hardly steer while it '
            'turns over between dive and climb: at the inflections.',
            curves('cross_track_m', *((below,) if follows_path else ()), lost),
            inflections=0,
        ),
        flown_panel(
            'pitch',
            'Nose up is positive: a dive has about minus, a climb plus the glide pitch.',
            curves('pitch_deg', _desired('pitch_ref_deg')),
        ),
        flown_panel(
            'heading',
            'Clockwise from north, counted on through 180 deg. It differs from the course of the '
            'path by the crab angle against the current.',
            curves('heading_deg', _desired('heading_ref_deg')),
        ),
        flown_panel(
            'roll',
            'Starboard side down is positive. Control banks to turn; the roll it asks for is its '
            'own, so there is no reference.',
            curves('roll_deg'),
        ),
    ]


def _navigation_panels(run: FlownRun) -> list[Panel]:
    """Where the vehicle was, and its own estimate; nothing of one that knows its place."""
    navigation = reckoned(run.card)
    if navigation is None:
        return []
    estimated = _desired('measured_cross_track_m', 'estimated')
    return [
        Panel(
            'plan',
            'True and estimated track',
            'From above, not to scale: north and east each have one of their own. Drag a box to '
            'zoom in. Numbers: surfacings, as in the table.',
            kind='plan',
        ),
        Panel(
            'estimated_cross_track',
            'Cross-track error, true and estimated',
            'Distance from the path, + to starboard of it. It steers by its estimate.',
            'off the path (m)',
            (Curve('cross_track_m', 'true', 'measured'), estimated),
            surfacings=0,
        ),
        flown_panel(
            'place_error',
            'Horizontal distance between true and estimated position, and the bound that it '
            'should keep to 95 % of the time: the longer half axis of the ellipse.',
            (
                Curve('place_error_m', 'error', 'measured'),
                _desired('place_bound_m', '95 % bound, as estimated'),
            ),
            surfacings=0,
            log=True,
        ),
        *(_mean_current_panel(navigation.get('reports', []), i) for i in (0, 1)),
    ]


def _mean_current_panel(reports: list[dict], axis: int) -> Panel:
    """Mean current to the north (0) or east (1) of every dive segment."""
    name = ('north', 'east')[axis]

    def spans(key: str) -> tuple[tuple[float, float, float], ...]:
        known = [one for one in reports if one[key]]
        return tuple((one['dive_t_s'], one['t_s'], one[key][axis] / KNOT_MPS) for one in known)

    return Panel(
        f'mean_current_{name}',
        f'Depth-averaged current of each dive segment, {name}',
        'Depth-averaged current (DAC): the true mean from dive to surfacing, and what was '
        'estimated of it after the fixes.',
        'current (kn)',
        (Curve(f'current_{name}_kn', 'true, where it is', 'faint'),),
        steps=(
            Steps('true mean of the way', 'measured', spans('dac_true_mps')),
            Steps('estimated, after fixes', 'reference', spans('dac_believed_mps'), True),
        ),
        surfacings=0,
    )


def _actuator_panels(run: FlownRun) -> list[Panel]:
    panels = []
    for one, limit in actuators_of(run):
        used = run.traces.largest(one.position) / limit
        more = (
            f' Its limits of ±{limit:g} {one.unit} are drawn where it comes near them; '
            f'the largest use of its range was {100.0 * used:.0f} %.'
        )
        curves = (
            Curve(one.position, 'position', 'measured'),
            _desired(one.command, 'commanded'),
            Curve(one.command, 'at its limit', 'alert', flag=one.flag),
        )
        panels.append(one.panel(more, curves, limits=(-limit, limit)))
    return panels


def _current_panels(run: FlownRun) -> list[Panel]:
    """The current, and what guidance made of it."""
    return [
        Panel(
            f'current_{axis}',
            f'Current, {axis}',
            f'Velocity of the water to the {axis}, and what guidance estimates from '
            f'{"what navigation tells of the motion" if reckoned(run.card) else "its drift"}.',
            'current (kn)',
            (
                Curve(f'current_{axis}_kn', 'true', 'measured'),
                _desired(f'estimate_{axis}_kn', 'estimated'),
            ),
        )
        for axis in ('north', 'east')
    ]


def _learnt_panels(run: FlownRun) -> list[Panel]:
    """What the adaptive law has learnt; nothing of what stayed zero."""
    panels = []
    for *shown, names in _LEARNT:
        curves = []
        for name in names:
            if run.traces.largest(name) > 0.0:
                label = name.removesuffix('_nm').removesuffix('_radps').replace('_', ' ')
                curves.append(Curve(name, label, _ROLES[len(curves)]))
        if curves:
            panels.append(Panel(*shown, tuple(curves), log='lyapunov_1' in names))
    return panels


def report_panels(run: FlownRun) -> dict[str, list[Panel]]:
    """Panels of a report by heading; without those, and their curves, that have no data."""
    if not run.traces.ticks:
        return {}
    groups = {
        'Each surfacing': [_PLACES] if (reckoned(run.card) or {}).get('reports') else [],
        'Where it went': [_TRACK, SPACE],
        'How it knew where it was': _navigation_panels(run),
        'How it flew': _flight_panels(run),
        'What the actuators did, and the battery': [*_actuator_panels(run), _BATTERY],
        'The current': _current_panels(run),
        'What control learnt': _learnt_panels(run),
    }
    has, flagged, found = run.traces.has, {'': True, **run.traces.flagged}, {}
    for heading, panels in groups.items():
        for panel in panels:
            curves = tuple(one for one in panel.curves if has(one.name) and flagged[one.flag])
            if curves or panel.steps or panel.kind != 'time':
                found.setdefault(heading, []).append(panel._replace(curves=curves))
    return found
