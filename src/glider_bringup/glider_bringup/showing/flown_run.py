# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""A run as pages and figures show it: read from where it was kept, or from its bag."""

from collections.abc import Callable
from pathlib import Path

from glider_base.settings import ConfigurationError
from glider_base.signals import TICK_NS
from glider_bringup.scoring.card import read_score
from glider_bringup.scoring.traces import Tracer, Traces, load_traces, make_tracer
from glider_bringup.showing.web_page import FlownRun
from glider_guidance.settings import OLD_NAMES
from glider_mission.planned import unballasted
from glider_mission.recording.bag_files import has_bag
from glider_mission.recording.mcap_reader import Bag
from glider_mission.run_folder import SCORE_FILE, TRACES_FILE, VEHICLE_FILE, scenario_of
from glider_mission.scenario import Scenario
from glider_model.vehicle.file import load_vehicle


def read_run(
    run: Path,
    progress: Callable[[int, int], None] = lambda ticks, total: None,
    traced: bool = True,
) -> FlownRun:
    """A run folder or MCAP file as pages show it: as it was kept in flight, else from its bag.

    Where it has a scorecard and is not to be ``traced``, its bag is not read. Raises
    ConfigurationError if it holds no run, its bag is damaged, or there is nothing that could be
    drawn.
    """
    card, kept = read_score(run), run / TRACES_FILE
    bag = Bag(run) if has_bag(run) else None
    with scenario_of(run, bag.attachments if bag else {}) as found:
        scenario = found.scenario
        _refuse_another(card, scenario, found.source)
        is_kept = card and (not traced or kept.is_file())
        if is_kept and bag is not None:  # which goes as far as the scorecard
            is_kept = not bag.cut and bag.end_ns >= (card['ticks'] - 1) * TICK_NS
        if is_kept:
            traces = load_traces(kept) if traced else None
        elif bag is None:
            raise ConfigurationError(
                f'{run}: nothing to draw, it has neither {TRACES_FILE} nor a bag (allowed: a '
                f'run flown without --no-report, or with a bag)'
            )
        else:
            tracer = make_tracer(scenario) if traced else None
            from glider_bringup.scoring.again import score_bag  # which needs ROS 2

            card = score_bag(run, bag, scenario, card, progress, [tracer] if tracer else [])
            traces = tracer.result() if tracer else None
        return flown_run(run, scenario, card, traces, found.text)


def _refuse_another(card: dict, scenario: Scenario, source: str) -> None:
    """Refuse a scenario of which the scorecard of the run says that it was not flown."""
    flown = {
        'scenario': scenario.name,
        'vehicle': load_vehicle(scenario.vehicle).name,
        'controller': scenario.control.law,
        'guidance': scenario.guidance.los.method,
        'seed': scenario.seed,
    }
    card = card and {**card, 'guidance': OLD_NAMES.get(card['guidance'], card['guidance'])}
    for name, value in flown.items():
        if card and card[name] != value:
            raise ConfigurationError(
                f'{source}: {name} = {value!r}: not what was flown (allowed: {card[name]!r}, by '
                f'{SCORE_FILE})'
            )


def flown_run(
    run: Path, scenario: Scenario, card: dict, traces: Traces | None, as_flown: str = ''
) -> FlownRun:
    """A run with its name and vehicle, and the text of its scenario as it stands in its folder."""
    as_flown = as_flown or scenario.to_yaml(vehicle=VEHICLE_FILE)
    vehicle = load_vehicle(scenario.vehicle)
    rules = scenario.score_rules(card['sim_time_s'])
    unfit = _unfit(scenario)
    return FlownRun(run.resolve().name, scenario, as_flown, vehicle, card, traces, rules, unfit)


def _unfit(scenario: Scenario) -> list[str]:
    """What of its mission, or of its water, the vehicle is not fit for, in words."""
    try:
        return scenario.unsteered + unballasted(scenario)
    except ValueError:  # the file of its water is gone since
        return scenario.unsteered


def keep_traces(scenario: Scenario, folder: Path, card: dict, tracer: Tracer) -> FlownRun:
    """Keep what was traced of a flight in its run folder.

    Raises ConfigurationError if it cannot be written.
    """
    traces = tracer.result()
    traces.save(folder / TRACES_FILE)
    return flown_run(folder, scenario, card, traces)
