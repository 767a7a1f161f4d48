# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""Scoring a run again, from its bag."""

from collections.abc import Callable, Iterable
from pathlib import Path

from glider_base.ros.lockstep.health import FINISHED
from glider_base.settings import ConfigurationError
from glider_bringup.engines.flight import Outcome, ended
from glider_bringup.scoring.card import STOPPED, read_score, scorecard
from glider_bringup.scoring.score import Scorer, scores_of
from glider_mission.planned import planned_ticks
from glider_mission.recording.bag_files import has_bag
from glider_mission.recording.mcap_reader import Bag
from glider_mission.recording.ros.recorded_log import Reader, read_back
from glider_mission.run_folder import PARAMETERS_FILE, scenario_of
from glider_mission.scenario import Scenario

#: Gets the ticks read from a bag, and about how many there are.
Reading = Callable[[int, int], None]


def score_again(run: Path, progress: Reading = lambda ticks, total: None) -> dict:
    """Scorecard of a run folder or MCAP file, computed afresh from the bag if there is one.

    How the run ended is what its `SCORE_FILE` says, or the bag where there is none: a recording
    made by the launch file, or the MCAP file alone. A run of which ticks are missing in its bag is
    not completed, whatever is said: its status is ``aborted``, and the reason names what is
    missing. Reports, figures and comparisons keep to that. Raises ConfigurationError if it holds
    no run, its bag is damaged, or not one tick is in it.
    """
    old = read_score(run)
    if not has_bag(run):
        return old
    bag = Bag(run)
    with scenario_of(run, bag.attachments) as flown:
        return score_bag(run, bag, flown.scenario, old, progress)


def score_bag(
    run: Path,
    bag: Bag,
    scenario: Scenario,
    old: dict,
    progress: Reading,
    sinks: Iterable[Reader] = (),
) -> dict:
    """Scorecard of a bag, whose rows sinks are given too; ``old`` is the one it has, or empty."""
    scorer = Scorer(scenario)
    total = old.get('ticks') or planned_ticks(scenario)
    log = read_back(
        bag, scenario.vehicle, [scorer, *sinks], lambda ticks: progress(ticks, max(ticks, total))
    )
    missing = log.missing(old.get('ticks'))
    if old:
        complete = old['status'] not in STOPPED
        reason = '' if complete else old['reason']
    else:
        complete = bool(log.end) and log.end.phase == FINISHED
        cut = log.untold or 'the recording was stopped before the run was complete'
        reason = '' if complete else log.end.message if log.end else cut
    lost = log.lost(complete)
    untold = not (old or log.end) and any(log.recorded().values())
    if not log.ticks and (lost or missing or untold):
        why = bag.cut or (
            f'{log.lacks}, as in a free-running recording or where topics were remapped (allowed: '
            'runs in lockstep, with every message of every tick)'
        )
        raise ConfigurationError(f'{run}: cannot be scored: {why}')
    if missing and (complete or not old or log.ticks < old['ticks']):
        complete, reason = False, '; '.join(one for one in (reason, missing) if one)
    status = ended(complete, reason)
    recorded = sum(log.counts.values())
    flight = Outcome(status, reason, old.get('wall_time_s'), recorded, lost)
    engine = old.get('engine') or ('nodes' if (run / PARAMETERS_FILE).exists() else None)
    return scorecard(scenario, engine, flight, scores_of(scenario, scorer))
