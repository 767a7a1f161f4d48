# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""What a person chooses for a flight beside its scenario, as fields of the scenario."""

from typing import Any, NamedTuple

from glider_base.errors import ConfigurationError, clipped
from glider_base.signals import TICK_S
from glider_mission.scenario import Scenario
from glider_model.vehicle.file import steers_by

#: The engines: nodes over topics, or one compiled loop. Same results.
ENGINES = ('nodes', 'direct')


class Combination(NamedTuple):
    """What the loop of a flight is compiled for: all else about a scenario is numbers."""

    law: str
    method: str
    navigation: str = 'known'
    breaks: bool = False  #: faults are part of it
    steered: str = ''  #: the vehicle, if a surface steers it


def combination_of(scenario: Scenario) -> Combination:
    """What the loop that flies a scenario is compiled for."""
    return Combination(
        scenario.control.law,
        scenario.guidance.los.method,
        scenario.navigation.method,
        bool(scenario.vehicle_faults),
        scenario.vehicle if steers_by(scenario) else '',
    )


def loop_of(scenario: Scenario) -> tuple:
    """What tells its loop from others: choices, the surface that steers, and the current."""
    surface, field = steers_by(scenario), type(scenario.current.field)
    return (*combination_of(scenario)[:-1], surface, field)


def number(option: str, text: str, word: str, low: float, high: float) -> float:
    """Number of an option that also takes a word; ``option`` as it stands before its value."""
    try:
        number = float(text)
    except ValueError:
        number = float('nan')
    if not low <= number <= high:
        raise ConfigurationError(
            f'{option}{clipped(text)}: not usable (allowed: {low:g} to {high:g}, or {word})'
        )
    return number


def chosen_fields(
    changes: dict[str, Any],
    controller: str | None = None,
    guidance: str | None = None,
    seed: int | None = None,
    duration: float | str | None = None,
    option: str = '--duration ',
) -> dict[str, Any]:
    """Values by dotted name, for `load_scenario`: changes, and what is said by options.

    A duration is simulated time (s), or that of the whole scenario: full; by default its dives.
    Raises ConfigurationError with its ``option`` if it is none.
    """
    chosen = {'control.law': controller, 'guidance.los.method': guidance, 'seed': seed}
    fields = changes | {name: value for name, value in chosen.items() if value is not None}
    if duration is not None:
        fields['dives'] = 0
        if duration != 'full':
            fields['duration_s'] = number(option, str(duration), 'full', TICK_S, 1e8)
    return fields
