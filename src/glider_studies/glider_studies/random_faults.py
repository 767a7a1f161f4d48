# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""Faults drawn at random."""

from collections.abc import Iterable
from typing import Any, NamedTuple

import numpy as np
import pydantic

from glider_model.plant.faults.settings import Fault, FaultSettings

_MOVES = ('buoyancy_engine', 'pitch_mass', 'roll_mass')
_SURFACE = 'steering_surface'
#: What is shown, and the largest error that is drawn (deg, deg/s, m or m/s).
_SHOWS = {
    'attitude': 30.0,
    'roll': 30.0,
    'pitch': 30.0,
    'heading': 180.0,
    'rates': 30.0,
    'depth': 300.0,
    'position': 5000.0,
    'velocity': 1.0,
    'fix': 5000.0,
}


class Large(NamedTuple):
    """A number of either sign whose size is drawn over three decades below the largest."""

    largest: float | None  #: None: by what is measured


class Decades(NamedTuple):
    """A number between two limits, whose logarithm is drawn evenly."""

    least: float
    most: float


#: Fields of what is drawn, by kind: numbers between two limits, sizes, or some words.
DRAWN: dict[str, dict[str, Any]] = {
    'leak': {
        'rate_kgps': Decades(1e-5, 1e-2),
        'limit_kg': Decades(0.05, 3.0),
        'detected': (True, False),
    },
    'mass': {'mass_kg': Large(1.0)},
    'fouling': {'drag': (1.1, 4.0), 'lift': (0.3, 1.0)},
    'loose_roll_mass': {},
    'gust': {'north_mps': (-1.0, 1.0), 'east_mps': (-1.0, 1.0), 'down_mps': Large(0.1)},
    'stuck': {'actuator': _MOVES},
    'slow': {'actuator': _MOVES, 'rate': Decades(0.005, 0.8)},
    'offset': {'actuator': _MOVES, 'offset': (-0.5, 0.5)},
    'partial': {'actuator': _MOVES, 'low': (-0.9, -0.1), 'high': (0.1, 0.9)},
    'jam': {'actuator': _MOVES, 'period_s': Decades(2.0, 3600.0), 'share': (0.1, 0.95)},
    'frozen': {'sensor': _SHOWS},
    'biased': {'sensor': _SHOWS, 'error': Large(None)},
    'spike': {'sensor': _SHOWS, 'error': Decades(1.0, 1000.0), 'share': Decades(1e-4, 0.5)},
    'dropout': {'sensor': _SHOWS, 'share': (0.05, 0.99)},
    'noisier': {'sensor': _SHOWS, 'std': Decades(0.1, 30.0)},
    'compass': {'deviation_deg': (-60.0, 60.0), 'phase_deg': (-180.0, 180.0)},
    'gps_silent': {},
    'battery': {'drop_v': (1.0, 15.0)},
    'vacuum': {'rate_paps': Decades(1.0, 1000.0)},
    'no_contact': {},
}
#: They begin within this share of the flight, and half of them end after a time between these (s).
BEGINS = (0.0, 0.95)
LASTS_S = Decades(10.0, 36000.0)
#: Shares of them that wait for a phase, and for a depth.
BY_PHASE, BY_DEPTH = 0.25, 0.25
_PHASES = ('dive', 'turn', 'climb', 'surface')
#: Sets the draw apart from that of the plant of the same seed.
_STREAM = 13
_FAULT = pydantic.TypeAdapter(Fault)


def sample_faults(
    seed: int, count: int, duration_s: float, steered: bool = False, depth_m: float = 0.0
) -> list[dict[str, Any]]:
    """Draw faults that begin within ``duration_s``: fields of a scenario, as one would type them.

    Where the vehicle is ``steered`` by a surface, that may break too. Some begin somewhere in its
    dives to ``depth_m``; 0.0: by time alone.
    """
    draw = np.random.Generator(np.random.PCG64([seed, _STREAM]))
    return [_sample(draw, duration_s, steered, depth_m) for _ in range(count)]


def _typed(number: float) -> float:
    return float(f'{number:.4g}')


def _number(draw: np.random.Generator, of: Any, largest: float) -> float:
    if isinstance(of, Decades):
        return _typed(of.least * (of.most / of.least) ** draw.random())
    if isinstance(of, Large):
        size = (of.largest or largest) * 10.0 ** -draw.uniform(0.0, 3.0)
        return _typed(size if draw.random() < 0.5 else -size)
    return _typed(draw.uniform(*of))


def _sample(
    draw: np.random.Generator, duration_s: float, steered: bool, depth_m: float
) -> dict[str, Any]:
    kind = str(draw.choice(sorted(DRAWN)))
    fields: dict[str, Any] = {'kind': kind}
    for name, of in DRAWN[kind].items():
        if name == 'actuator':
            fields[name] = str(draw.choice([*of, _SURFACE] if steered else of))
        elif name == 'sensor':
            fields[name] = str(draw.choice(sorted(of)))
        elif name == 'detected':
            fields[name] = bool(draw.choice(of))
        else:
            fields[name] = _number(draw, of, _SHOWS.get(fields.get('sensor'), 1.0))
    fields['at_s'] = round(draw.uniform(*BEGINS) * duration_s, 1)
    when = draw.random()
    if depth_m and when < BY_PHASE + BY_DEPTH:
        fields['phase'] = str(draw.choice(_PHASES))
        if when < BY_DEPTH and fields['phase'] in ('dive', 'climb'):
            fields['at_depth_m'] = round(draw.uniform(0.0, 1.0) * depth_m, 1)
    if draw.random() < 0.5:
        fields['for_s'] = round(_number(draw, LASTS_S, 1.0), 1)
    return fields


def validated(fields: Iterable[dict[str, Any]]) -> list[FaultSettings]:
    """Faults of drawn fields."""
    return [_FAULT.validate_python(one) for one in fields]
