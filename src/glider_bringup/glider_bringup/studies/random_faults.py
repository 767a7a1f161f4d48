# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""Faults drawn at random, and what became of flights with them."""

from collections.abc import Iterable
from typing import Any

import numpy as np
import pydantic

from glider_model.plant.faults.settings import Fault, FaultSettings

#: Fields of what is drawn, by kind: numbers between two limits, else one of some words.
_MOVES = ('buoyancy_engine', 'pitch_mass', 'roll_mass')
_SHOWS = ('attitude', 'heading', 'rates', 'depth', 'position')
_SHARE = (0.05, 0.5)
DRAWN: dict[str, dict[str, Any]] = {
    'leak': {'rate_kgps': (1e-5, 1e-3), 'limit_kg': (0.05, 1.0)},
    'mass': {'mass_kg': (-0.3, 0.3)},
    'fouling': {'drag': (1.1, 2.5), 'lift': (0.6, 1.0)},
    'loose_roll_mass': {},
    'gust': {'north_mps': (-1.0, 1.0), 'east_mps': (-1.0, 1.0)},
    'stuck': {'actuator': _MOVES},
    'slow': {'actuator': _MOVES, 'rate': (0.05, 0.8)},
    'offset': {'actuator': _MOVES, 'offset': (-0.3, 0.3)},
    'partial': {'actuator': _MOVES, 'low': (-0.9, -0.2), 'high': (0.2, 0.9)},
    'jam': {'actuator': _MOVES, 'period_s': (2.0, 600.0), 'share': (0.1, 0.9)},
    'frozen': {'sensor': _SHOWS},
    'biased': {'sensor': _SHOWS, 'error': (-20.0, 20.0)},
    'spike': {'sensor': _SHOWS, 'error': (1.0, 1000.0), 'share': (0.0001, 0.1)},
    'dropout': {'sensor': _SHOWS, 'share': _SHARE},
    'noisier': {'sensor': _SHOWS, 'std': (0.1, 10.0)},
    'compass': {'deviation_deg': (-20.0, 20.0), 'phase_deg': (-180.0, 180.0)},
    'gps_silent': {},
    'battery': {'drop_v': (1.0, 8.0)},
    'vacuum': {'rate_paps': (1.0, 1000.0)},
    'no_contact': {},
}
#: They begin within this share of the flight, and half of them end after a time between these (s).
BEGINS = (0.05, 0.6)
LASTS_S = (60.0, 3600.0)
#: Sets the draw apart from that of the plant of the same seed.
_STREAM = 13
_FAULT = pydantic.TypeAdapter(Fault)


def sample_faults(seed: int, count: int, duration_s: float) -> list[dict[str, Any]]:
    """Draw faults of a flight of some length: fields of a scenario, rounded so as to be typed."""
    draw = np.random.Generator(np.random.PCG64([seed, _STREAM]))
    return [_sample(draw, duration_s) for _ in range(count)]


def _sample(draw: np.random.Generator, duration_s: float) -> dict[str, Any]:
    kind = str(draw.choice(sorted(DRAWN)))
    fields: dict[str, Any] = {'kind': kind}
    for name, of in DRAWN[kind].items():
        numbers = isinstance(of[0], float)
        fields[name] = float(f'{draw.uniform(*of):.4g}') if numbers else str(draw.choice(of))
    fields['at_s'] = round(draw.uniform(*BEGINS) * duration_s, 1)
    if draw.random() < 0.5:
        fields['for_s'] = round(draw.uniform(*LASTS_S), 1)
    return fields


def validated(fields: Iterable[dict[str, Any]]) -> list[FaultSettings]:
    """Faults of drawn fields."""
    return [_FAULT.validate_python(one) for one in fields]


def outcome(scores: dict, failed: bool, diverged: bool) -> str:
    """What became of a flight, in a word or two: the worst that is true of it."""
    if failed:
        return 'failed'
    reaction = scores.get('guard', {}).get('reaction', 'none')
    if reaction != 'none':
        return f'guard: {reaction}'
    return 'off its path' if diverged else 'flew on'
