# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""The scores of a run: each is said once, and stands in ``score.json``, scorecard and comparison.

A new one is a line of `SCORES`: where it is in the card, and how it is made from a flight.
"""

import math
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import numpy as np

from glider_base.settings import nested
from glider_base.signals import TICK_S
from glider_model.ocean.current_settings import KNOT_MPS

#: So many events of each row of the guard, and of no progress, are kept: the first ones.
EVENTS_KEPT = 100


class Flown(NamedTuple):
    """What scores are made from: arrays over the ticks of a run."""

    depth: np.ndarray  #: true one (m)
    e2: np.ndarray  #: cross-track error (m)
    pitch_error: np.ndarray  #: (deg)
    heading: np.ndarray  #: less its running mean (deg)
    steady: np.ndarray  #: mask of what is steady
    scored: np.ndarray  #: mask of what comes after settling
    whole: np.ndarray  #: mask of what is steady, with the whole time of the heading's mean
    turn_m: float  #: depth of the lower turn


class Score(NamedTuple):
    """One figure of a run."""

    label: str  #: of a comparison; in a scorecard what follows its last comma is in the line
    key: str  #: where it is in ``score.json``, dotted, with its unit there
    unit: str  #: s: compared as a time
    digits: int
    less_is_better: bool = False  #: else neither more nor less is
    of: Callable[[Flown], float | None] | None = None  #: None: it is measured elsewhere
    scale: float = 1.0  #: unit of the card in that which is shown
    study: tuple[int, str, str] | None = None  #: in one of many plants: place, key and label

    @property
    def line(self) -> str:
        """Label of its line in a scorecard."""
        return self.label.rpartition(', ')[0] or self.label

    @property
    def part(self) -> str:
        """What it is called in that line; empty where it stands alone."""
        return self.label.removeprefix(self.line).removeprefix(', ')

    @property
    def group(self) -> str:
        """Part of the card in which it stands."""
        return self.key.partition('.')[0]

    def in_card(self, card: dict[str, Any]) -> float | None:
        """Value in a card, in the unit that is shown; None where it has none."""
        if self.group == 'navigation' and reckoned(card) is None:
            return None
        value: Any = card
        for name in self.key.split('.'):
            value = value.get(name) if isinstance(value, dict) else None
        return None if value is None else self.scale * value


def studied() -> list[tuple[str, str]]:
    """Key and label of the scores that a study of many plants tells, in its order."""
    return [study[1:] for study in sorted(one.study for one in SCORES if one.study)]


def reckoned(card: dict) -> dict | None:
    """What a card tells of navigation, where the vehicle had to reckon its place; else None."""
    navigation = card.get('navigation') or {'method': 'known'}
    return None if navigation['method'] == 'known' else navigation


def seconds(ticks: int) -> float:
    """Time (s) of so many ticks, without the rounding of 0.1."""
    return round(ticks * TICK_S, 6)


def rms(values: np.ndarray) -> float | None:
    """Root of the mean square; None of nothing."""
    return float(math.sqrt(np.mean(values * values))) if len(values) else None


def mean(values: Sequence[float]) -> float | None:
    """Mean; None of nothing."""
    return float(np.mean(values)) if len(values) else None


def largest(values: np.ndarray) -> float | None:
    """Largest magnitude; None of nothing."""
    return float(np.max(np.abs(values))) if len(values) else None


def _deepest(flown: Flown) -> float | None:
    return float(np.max(flown.depth)) if len(flown.depth) else None


def _overshoot(flown: Flown) -> float | None:
    return max(0.0, _deepest(flown) - flown.turn_m) if len(flown.depth) else None


# fmt: off
SCORES = [
    Score('simulated time', 'sim_time_s', 's', 1),
    Score('real-time factor', 'real_time_factor', '', 0),
    Score('messages recorded', 'messages_recorded', '', 0),
    Score('messages lost', 'messages_lost', '', 0, True),
    Score('dives', 'dives', '', 0),
    Score('along path', 'distance_along_path_m', 'm', 0),
    Score('came up from the end of path', 'end_of_path_m', 'm', 1, True),
    Score('cross-track, steady, rms', 'cross_track_m.rms_steady', 'm', 3, True,
          lambda flown: rms(flown.e2[flown.steady])),
    Score('cross-track, steady, max', 'cross_track_m.max_steady', 'm', 3, True,
          lambda flown: largest(flown.e2[flown.steady]),
          study=(1, 'max_steady_m', 'max steady (m)')),
    Score('cross-track, after settling, max', 'cross_track_m.max_all', 'm', 2, True,
          lambda flown: largest(flown.e2[flown.scored]), study=(2, 'max_all_m', 'max all (m)')),
    Score('cross-track, whole run, max', 'cross_track_m.max_run', 'm', 2, True,
          lambda flown: largest(flown.e2), study=(3, 'max_run_m', 'max whole run (m)')),
    Score('surfacings', 'navigation.surfacings', '', 0),
    Score('surfacing position error, p50', 'navigation.error_m.p50', 'm', 1, True),
    Score('surfacing position error, p95', 'navigation.error_m.p95', 'm', 1, True),
    Score('surfacing position error, worst', 'navigation.error_m.worst', 'm', 1, True),
    Score('cross-track estimated, steady, max', 'navigation.believed_cross_track_m.max_steady',
          'm', 3),
    Score('depth-averaged current, error, rms', 'navigation.dac_error_mps.rms', 'kn', 3, True,
          scale=1.0 / KNOT_MPS),
    Score('inside the 95 % ellipse', 'navigation.ellipse_95_share', '%', 0, scale=100.0),
    Score('pitch error, steady, rms', 'pitch_error_deg.rms_steady', 'deg', 3, True,
          lambda flown: rms(flown.pitch_error[flown.steady]),
          study=(5, 'pitch_error_deg', 'pitch rms (deg)')),
    Score('pitch error, steady, max', 'pitch_error_deg.max_steady', 'deg', 3, True,
          lambda flown: largest(flown.pitch_error[flown.steady])),
    Score('heading fluctuation, rms', 'heading_fluctuation_deg.rms_steady', 'deg', 3, True,
          lambda flown: rms(flown.heading[flown.whole]),
          study=(4, 'heading_fluctuation_deg', 'heading rms (deg)')),
    Score('heading fluctuation, max', 'heading_fluctuation_deg.max_steady', 'deg', 3, True,
          lambda flown: largest(flown.heading[flown.whole])),
    Score('depth, max', 'depth_m.max', 'm', 1, of=_deepest),
    Score('depth, overshoot', 'depth_m.overshoot', 'm', 1, True, _overshoot),
    Score('pump travel', 'actuator_travel.buoyancy_engine_kg', 'kg', 1, True),
    Score('pitch mass travel', 'actuator_travel.pitch_mass_m', 'm', 2, True),
    Score('roll mass travel', 'actuator_travel.roll_mass_deg', 'deg', 0, True,
          study=(7, 'roll_travel_deg', 'roll travel (deg)')),
    Score('energy', 'energy.wh', 'Wh', 1, True, study=(6, 'energy_wh', 'energy (Wh)')),
    Score('energy, a dive', 'energy.wh_per_dive', 'Wh', 1, True),
    Score('endurance', 'energy.endurance_days', 'days', 1),
    Score('range', 'energy.range_km', 'km', 0),
]
# fmt: on


def scores_in(cards: list[dict[str, Any]]) -> list[Score]:
    """Scores of some cards, with the travel of their steering surfaces, which have any name."""
    keys = [score.key for score in SCORES]
    names = sorted({name for card in cards for name in card['actuator_travel']})
    more = [
        Score(f'{name.removesuffix("_deg")} travel', key, 'deg', 0, True)
        for name in names
        if (key := f'actuator_travel.{name}') not in keys
    ]
    at = keys.index('actuator_travel.roll_mass_deg') + 1
    return SCORES[:at] + more + SCORES[at:]


def measured(flown: Flown, only: str = '') -> dict[str, Any]:
    """The part of ``score.json`` that is made from a flight: figures in their groups, or one."""
    return nested({one.key: one.of(flown) for one in SCORES if one.of and only in ('', one.group)})
