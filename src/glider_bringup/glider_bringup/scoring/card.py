# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""The scorecard as data, which is ``score.json``: made, written, read and checked."""

import json
from collections.abc import Iterable
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import BaseModel, ConfigDict, Field, ValidationError, create_model, model_validator

from glider_base.files import is_file, read_json
from glider_base.settings import ConfigurationError, leaves, mistakes
from glider_bringup.engines.flight import Outcome, Sink, fly
from glider_bringup.scoring.score import Scorer, scores_of
from glider_mission.disk import write_whole
from glider_mission.recording.bag_files import METADATA_FILE, bag_files, has_bag
from glider_mission.run_folder import SCORE_FILE
from glider_mission.scenario import Scenario
from glider_model.vehicle.file import load_vehicle

#: What may become of a run, and the colour of that word.
STATUSES = {
    'completed': 'green',
    'unfinished': 'yellow',
    'surfaced': 'yellow',
    'lost': 'bold red',
    'infeasible': 'yellow',
    'aborted': 'red',
    'failed': 'red',
}
#: A figure this large is of a number that grew without limit, whatever its unit: it is not known.
LARGEST = 1e15
#: Statuses of runs that were not flown to their end.
STOPPED = ('aborted', 'failed')


def fly_scored(scenario: Scenario, sinks: Iterable[Sink] = ()) -> tuple[Outcome, dict]:
    """Fly with the direct engine, as `fly` does, and give the scores too."""
    scorer = Scorer(scenario)
    flight = fly(scenario, [scorer, *sinks])
    return flight, scores_of(scenario, scorer)


def scorecard(scenario: Scenario, engine: str | None, flight: Outcome, scores: dict) -> dict:
    """Contents of ``score.json``; a figure that is not `finite` is None there, and a failure."""
    scores = dict(scores)
    wrong = [name for name, figure in leaves(scores) if figure != finite(figure)]
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
    """The same without numbers that JSON does not have, or beyond `LARGEST`: they become None."""
    if isinstance(value, dict):
        return {name: finite(inner) for name, inner in value.items()}
    if isinstance(value, list):
        return [finite(inner) for inner in value]
    return None if isinstance(value, float) and not abs(value) < LARGEST else value


def write_score(folder: Path, card: dict) -> None:
    """Write ``score.json``."""
    write_whole(folder / SCORE_FILE, json.dumps(card, indent=2, allow_nan=False) + '\n')


#: A number of a scorecard that is not known is None; north and east; in three dimensions.
_Figure = float | None
_Pair = Annotated[list[float], Field(min_length=2, max_length=2)]
_Triple = Annotated[list[_Figure], Field(min_length=3, max_length=3)]
_Count = Annotated[int, Field(ge=0)]


class _Part(BaseModel):
    """Part of a score file, which may hold anything."""

    model_config = ConfigDict(strict=True)


class _Figures(_Part):
    """A part that holds figures only."""

    model_config = ConfigDict(extra='allow')
    __pydantic_extra__: dict[str, _Figure]

    @model_validator(mode='after')
    def _are_known_together(self):
        names = sorted(type(self).model_fields.keys() - {'max_all'})  # settled, but never steady
        if len({getattr(self, name) is None for name in names}) > 1:
            raise ValueError(f'{", ".join(names)}: some are known, others are not')
        return self


def _part(names: str = '', **kinds: Any) -> Any:
    """Kind of a part with at least figures of these names, and others, each with its kind."""
    fields = {name: (_Figure, ...) for name in names.split()}
    for name, kind in kinds.items():
        fields[name] = kind if isinstance(kind, tuple) else (kind, ...)
    return create_model('Part', __base__=_Part if kinds else _Figures, **fields)


_Event = _part(t_s=float, message=str, row=(str, ''), reaction=(str, ''))
_Fault = _part('t_s end_s', kind=str, message=str, when=str)
#: What was taken out of the battery (Wh), and how long it lasts.
_Energy = _part('wh wh_per_dive endurance_days range_km', by=_part('pump hotel masses calls'))


#: What became of a mission that ends with its path.
_Arrival = _part(
    't_s missed_m left_m eta_s overrun_s',
    arrived=bool,
    place_latlon_deg=_Pair | None,
    waypoints_m=(list[_Figure], []),
)
_Bottom = _part('t_s least_height_m', touched=bool)
_Surfacing = _part(
    t_s=float,
    dive_t_s=float,
    true_ned_m=_Pair,
    believed_ned_m=_Pair,
    covariance_m2=_Triple,
    fix_ned_m=_Pair | None,
    cross_track_m=float,
    believed_cross_track_m=float,
    error_m=float,
    inside_95=bool | None,
    dac_true_mps=_Pair | None,
    dac_believed_mps=_Pair | None,
)
_Navigation = _part(
    ellipse_95_share=Annotated[float, Field(ge=0.0, le=1.0)] | None,
    method=str,
    surfacings=int,
    fixed=int,
    error_m=_part('p50 p95 worst'),
    dac_error_mps=_part('rms worst'),
    believed_cross_track_m=_part('rms_steady max_steady'),
    surfacing_cross_track_m=list[float],
    reports=(list[_Surfacing], []),
)
_State = _part(position_ned_m=_Triple, attitude_rpy_rad=_Triple, velocity_mps=_Triple)
#: A scorecard: what it has to have, and what is shown of it. Older runs lack what has a default.
_Card = _part(
    'wall_time_s real_time_factor',
    sim_time_s=Annotated[float, Field(ge=0.0)],
    distance_along_path_m=_Figure,
    settle_s=(_Figure, None),
    end_of_path_m=(_Figure, None),
    scenario=str,
    changed=(dict[str, str], {}),
    vehicle=str,
    controller=str,
    guidance=str,
    engine=str | None,
    seed=_Count,
    status=Literal[tuple(STATUSES)],
    reason=str,
    ticks=_Count,
    messages_recorded=_Count,
    messages_lost=_Count,
    dives=_Count,
    cross_track_m=_part('rms_steady max_steady max_all'),
    pitch_error_deg=_part('rms_steady max_steady'),
    heading_fluctuation_deg=_part('rms_steady max_steady'),
    depth_m=_part('max overshoot'),
    actuator_travel=_part('buoyancy_engine_kg pitch_mass_m roll_mass_deg'),
    final_state=_State | None,
    guard=(_part(events=(list[_Event], [])), {}),
    no_progress=(_part(events=(list[_Event], [])), {}),
    faults=(list[_Fault], []),
    navigation=(_Navigation | None, None),
    energy=(_Energy | None, None),
    arrival=(_Arrival | None, None),
    bottom=(_Bottom | None, None),
)


def read_score(run: Path) -> dict:
    """Contents of a run's score file; empty if it has none, but a bag."""
    path = run / SCORE_FILE
    if not is_file(path):
        if not run.exists():
            raise ConfigurationError(f'{run}: no such run folder or .mcap file')
        if not has_bag(run):
            if (run / METADATA_FILE).is_file():
                bag_files(run)  # says which storage is not read, or which file is missing
            raise ConfigurationError(
                f'{run}: not a run folder, it has neither a bag (.mcap) nor a {SCORE_FILE}'
            )
        return {}
    card = read_json(path)
    try:
        read = _Card.model_validate(card)
    except ValidationError as error:
        ((_, wrong), *_) = mistakes(error, _Card)
    else:  # only a run without a tick has no final state
        unknown = read.final_state is None or read.depth_m.max is None
        wrong = 'final_state, depth_m.max: not known' if read.ticks and unknown else ''
        if read.arrival and read.arrival.arrived and read.arrival.t_s is None:
            wrong = 'arrival: t_s: not known, though it arrived'
    if wrong:
        raise ConfigurationError(f'{path}: not a scorecard of this program: {wrong}')
    return card
