# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""The scorecard as data, which is ``score.json``: made, written, read and checked."""

import json
import math
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Annotated, Any

from pydantic import BaseModel, ConfigDict, Field, ValidationError

from glider_bringup.engines.flight import Outcome, Progress, Taker, fly
from glider_bringup.mission.disk import write_whole
from glider_bringup.mission.run_folder import SCORE_FILE
from glider_bringup.mission.scenario import Scenario
from glider_bringup.recording.bag_files import has_bag
from glider_bringup.scoring.score import make_scorer, scores_of
from glider_model.base.files import is_file, read_json
from glider_model.base.settings import ConfigurationError
from glider_model.vehicle.file import load_vehicle

#: Fields without which a score file is not a scorecard.
CARD_FIELDS = {
    *('scenario', 'vehicle', 'controller', 'guidance', 'engine', 'seed', 'status', 'reason'),
    *('ticks', 'sim_time_s', 'wall_time_s', 'real_time_factor', 'messages_recorded'),
    *('messages_lost', 'dives', 'distance_along_path_m', 'cross_track_m', 'pitch_error_deg'),
    *('heading_fluctuation_deg', 'depth_m', 'actuator_travel', 'final_state'),
}
#: What these fields hold: numbers, lists of numbers, or None where there is no data.
CARD_GROUPS = {
    'cross_track_m': {'rms_steady', 'max_steady', 'max_all'},
    'pitch_error_deg': {'rms_steady', 'max_steady'},
    'heading_fluctuation_deg': {'rms_steady', 'max_steady'},
    'depth_m': {'max', 'overshoot'},
    'actuator_travel': {'buoyancy_engine_kg', 'pitch_mass_m', 'roll_mass_deg'},
    'final_state': {'position_ned_m', 'attitude_rpy_rad', 'velocity_mps'},
}
#: North and east.
_Pair = Annotated[list[float], Field(min_length=2, max_length=2)]
STATUSES = ('completed', 'surfaced', 'lost', 'infeasible', 'aborted', 'failed')
#: Statuses of runs that were not flown to their end.
STOPPED = ('aborted', 'failed')


def fly_scored(
    scenario: Scenario, takers: Iterable[Taker] = (), progress: Progress | None = None
) -> tuple[Outcome, dict]:
    """Fly with the direct engine, as `fly` does, and give the scores too."""
    scorer = make_scorer(scenario)
    flight = fly(scenario, [scorer, *takers], progress)
    return flight, scores_of(scenario, scorer)


def scorecard(scenario: Scenario, engine: str | None, flight: Outcome, scores: dict) -> dict:
    """Contents of ``score.json``; a figure that is not finite is None there, and a failure."""
    scores, wrong = dict(scores), list(_not_finite(scores))
    status, reason = became, why = scores.pop('status'), scores.pop('reason')
    if flight.status != 'completed':
        status, reason = flight.status, flight.reason
        if became == 'lost' and why not in reason:
            reason = f'{reason}; {why}'
    if wrong and status != 'failed':
        status, reason = 'failed', f'the score is not finite: {", ".join(wrong)}'
    sim_time_s = scores['sim_time_s']
    return {
        'scenario': scenario.name,
        'changed': scenario.changed,
        'vehicle': load_vehicle(scenario.vehicle).name,
        'controller': scenario.control.law,
        'guidance': scenario.guidance.los.method,
        'engine': engine,
        'seed': scenario.seed,
        'status': status,
        'reason': reason,
        'ticks': scores.pop('ticks'),
        'sim_time_s': scores.pop('sim_time_s'),
        'wall_time_s': flight.wall_time_s,
        'real_time_factor': sim_time_s / flight.wall_time_s if flight.wall_time_s else None,
        'messages_recorded': flight.messages_recorded,
        'messages_lost': flight.messages_lost,
        **finite(scores),
    }


def finite(value: Any) -> Any:
    """The same without numbers that JSON does not have: they become None."""
    if isinstance(value, dict):
        return {name: finite(inner) for name, inner in value.items()}
    if isinstance(value, list):
        return [finite(inner) for inner in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value


def _not_finite(scores: dict) -> Iterator[str]:
    """Dotted names of the figures that are not finite."""
    for name, value in scores.items():
        if isinstance(value, dict):
            yield from (f'{name}.{inner}' for inner in _not_finite(value))
        elif value != finite(value):
            yield name


def write_score(folder: Path, card: dict) -> None:
    """Write ``score.json``."""
    write_whole(folder / SCORE_FILE, json.dumps(card, indent=2, allow_nan=False) + '\n')


def read_score(run: Path) -> dict:
    """Contents of a run's score file; empty if it has none, but a bag."""
    path = run / SCORE_FILE
    if not is_file(path):
        if not run.exists():
            raise ConfigurationError(f'{run}: no such run folder or .mcap file')
        if not has_bag(run):
            raise ConfigurationError(
                f'{run}: not a run folder, it has neither a bag (.mcap) nor a {SCORE_FILE}'
            )
        return {}
    card = read_json(path)
    if not _is_card(card):
        raise ConfigurationError(f'{path}: not a scorecard of this program')
    return card


def _is_card(card) -> bool:
    """Whether a value, which may be anything, can be taken for a scorecard."""
    if not isinstance(card, dict) or not CARD_FIELDS <= set(card):
        return False
    texts = ('scenario', 'vehicle', 'controller', 'guidance', 'status', 'reason')
    numbers = ('sim_time_s', 'wall_time_s', 'real_time_factor', 'distance_along_path_m')
    counts = ('seed', 'ticks', 'messages_recorded', 'messages_lost', 'dives')
    return (
        all(isinstance(card[name], str) for name in texts)
        and card['status'] in STATUSES
        and isinstance(card['engine'], str | None)
        and all(isinstance(card[name], int) and card[name] >= 0 for name in counts)
        and all(_is_figure(card[name]) for name in numbers)
        and all(
            isinstance(card[group], dict)
            and names <= set(card[group])
            and all(_is_figure(value) for value in card[group].values())
            for group, names in CARD_GROUPS.items()
            if card['ticks'] or group != 'final_state'  # a run without a tick has none
        )
        and _is_guard(card.get('guard', {}))
        and _are_texts(card.get('changed', {}))
        and _are_faults(card.get('faults', []))
        and _is(_Navigation, card.get('navigation'))
        and _is(_Energy, card.get('energy'))
    )


def _are_texts(changed) -> bool:
    """Whether a value is what was changed in a scenario; older runs tell nothing of it."""
    return isinstance(changed, dict) and all(isinstance(text, str) for text in changed.values())


def _is_guard(guard) -> bool:
    """Whether a value is what the guard told in a run; runs of before tell nothing of it."""
    events = guard.get('events', []) if isinstance(guard, dict) else None
    return isinstance(events, list) and all(
        isinstance(event, dict)
        and isinstance(event.get('message'), str)
        and isinstance(event.get('t_s'), int | float)
        for event in events
    )


class _Checked(BaseModel):
    """Part of a score file, which may hold anything."""

    model_config = ConfigDict(strict=True)


class _Fault(_Checked):
    """What broke in a run, and when; older runs tell nothing of it."""

    t_s: float | None
    end_s: float | None
    kind: str
    message: str
    when: str


class _EnergyBy(_Checked):
    """What took it (Wh)."""

    pump: float | None
    hotel: float | None
    masses: float | None
    calls: float | None


class _Energy(_Checked):
    """What was taken out of the battery; older runs tell nothing of it."""

    wh: float | None
    wh_per_dive: float | None
    by: _EnergyBy
    endurance_days: float | None
    range_km: float | None


class _Report(_Checked):
    """One surfacing."""

    t_s: float
    dive_t_s: float
    true_ned_m: _Pair
    believed_ned_m: _Pair
    covariance_m2: Annotated[list[float], Field(min_length=3, max_length=3)]
    fix_ned_m: _Pair | None
    cross_track_m: float
    believed_cross_track_m: float
    error_m: float
    inside_95: bool | None
    dac_true_mps: _Pair | None
    dac_believed_mps: _Pair | None


class _PlaceError(_Checked):
    """How far the believed place was off at surfacings."""

    p50: float | None
    p95: float | None
    worst: float | None


class _CurrentError(_Checked):
    """How far the believed current was off."""

    rms: float | None
    worst: float | None


class _CrossTrack(_Checked):
    """How far off the path the vehicle believed to be."""

    rms_steady: float | None
    max_steady: float | None


class _Navigation(_Checked):
    """What is shown of how well the vehicle knew its place."""

    method: str
    surfacings: int
    fixed: int
    error_m: _PlaceError
    dac_error_mps: _CurrentError
    believed_cross_track_m: _CrossTrack
    surfacing_cross_track_m: list[float]
    ellipse_95_share: float | None
    reports: list[_Report] = []


def _is(kind: type[_Checked], told) -> bool:
    """Whether a value is a part of a scorecard, or nothing, as in older runs."""
    try:
        return told is None or bool(kind.model_validate(told))
    except ValidationError:
        return False


def _are_faults(told) -> bool:
    """Whether a value is what broke in a run."""
    try:
        return isinstance(told, list) and all(map(_Fault.model_validate, told))
    except ValidationError:
        return False


def _is_figure(value) -> bool:
    """Whether a value is a figure of a scorecard: a number, None, or three numbers."""
    if isinstance(value, list):
        return len(value) == 3 and all(isinstance(one, int | float) for one in value)
    return value is None or isinstance(value, int | float)
