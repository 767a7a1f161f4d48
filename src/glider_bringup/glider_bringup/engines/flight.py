# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""One flight by the direct engine: its rows go to whoever takes them. Nothing of ROS is needed."""

import time
from collections.abc import Callable, Iterable
from typing import NamedTuple, Protocol

import numpy as np

from glider_bringup.engines.direct import MissionParams, MissionState, NotFiniteError, fly_blocks
from glider_bringup.engines.interrupts import interrupts_noted
from glider_bringup.mission.scenario import Scenario
from glider_model.base.settings import ConfigurationError

#: Called now and then with the ticks flown and the depth (m).
Progress = Callable[[int, float], None]


class Flight(NamedTuple):
    """How a flight ended, apart from what its topics tell."""

    status: str  #: completed, aborted, or failed: a number was not finite
    reason: str  #: why it was aborted, or failed
    wall_time_s: float | None  #: None if nobody measured it
    messages_recorded: int = 0
    messages_lost: int = 0


class Taker(Protocol):
    """What follows a flight: a score, traces, a bag."""

    def add(self, log: np.ndarray) -> None:
        """Take in the next rows, float64[n, ROW]; they are valid until the next are flown."""


def mission_of(scenario: Scenario) -> tuple[MissionState, MissionParams]:
    """State at tick 0 and parameters of the six blocks."""
    blocks = scenario.block_settings()
    state = MissionState(*(block.initial_state() for block in blocks))
    return state, MissionParams(*(block.params() for block in blocks))


def _refuse_message_faults(scenario: Scenario) -> None:
    for fault in scenario.message_faults:
        raise ConfigurationError(
            f"faults.{scenario.faults.index(fault)}.kind = '{fault.kind}': the direct engine has "
            'no messages that could go wrong (fly with --engine nodes)'
        )


def fly(
    scenario: Scenario,
    takers: Iterable[Taker] = (),
    progress: Progress | None = None,
    mission: tuple[MissionState, MissionParams] | None = None,
) -> Flight:
    """Fly with the direct engine; Ctrl-C ends it as aborted with what was flown.

    A number that is not finite ends it as failed, with what was flown before.

    Parameters
    ----------
    scenario : Scenario
    takers : iterable of Taker
        Each is given every row, in this order.
    progress : callable, optional
    mission : tuple, optional
        State and parameters to fly with, if they are not `mission_of` the scenario.

    Raises
    ------
    ConfigurationError
        If messages are to go wrong, for there are none.
    """
    _refuse_message_faults(scenario)
    takers = tuple(takers)
    status, reason, ticks = 'completed', '', 0
    with interrupts_noted() as interrupts:
        state, params = mission or mission_of(scenario)
        start = time.perf_counter()
        try:
            for log in fly_blocks(state, params):
                for taker in takers:
                    taker.add(log)
                ticks += len(log)
                if progress:
                    progress(ticks, float(-log[-1, 2]))
                if interrupts:
                    status, reason = 'aborted', 'stopped by SIGINT'
                    break
        except NotFiniteError as error:
            status, reason = 'failed', str(error)
    return Flight(status, reason, time.perf_counter() - start)
